//! What hands do, as requests: of buttons, moves and wheels over panes. Places are shares of a pane's picture.

use ivd_frames::{Axis, Pane, Request, Shows, Spot, Tool};

/// Points of a smooth scroll that are one step of a wheel.
const STEP: f32 = 50.0;
/// By how much a step of the wheel magnifies.
const ZOOM: f64 = 1.15;

/// A button.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Button {
    Left,
    Middle,
    Right,
}

/// What a drag does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Does {
    Turn,
    Cross,
    Pan,
    Zoom,
    Handle,
    Pin,
    Incise,
    Bone,
    Measure,
    Brightness,
    /// Moves the line that divides the pictures.
    Divide,
}

/// A button that is held.
#[derive(Debug, Clone, Copy)]
struct Press {
    pane: Pane,
    does: Does,
    button: Button,
    first: [f64; 2],
    at: [f64; 2],
}

/// What hands hold.
#[derive(Debug, Default)]
pub(crate) struct Hands {
    press: Option<Press>,
    lock: Option<Axis>,
    /// Of a smooth scroll, what is no step yet.
    scrolled: f32,
}

impl Hands {
    /// The pane that a drag began in: it goes on there, however far the pointer goes.
    pub(crate) fn pane(&self) -> Option<Pane> {
        self.press.map(|press| press.pane)
    }

    /// The line that is drawn in a pane, to cut or to measure or to make a bone along.
    pub(crate) fn line(&self, pane: Pane) -> Option<[[f64; 2]; 2]> {
        let draws = |press: &Press| matches!(press.does, Does::Incise | Does::Bone | Does::Measure);
        let press = self.press.filter(|press| press.pane == pane && draws(press))?;
        Some([press.first, press.at])
    }

    /// Whether a handle is held.
    pub(crate) fn hold(&self) -> bool {
        self.press.is_some_and(|press| press.does == Does::Handle)
    }

    /// The left button takes hold of the line that divides the pictures.
    pub(crate) fn divide(&mut self, pane: Pane, at: [f64; 2]) {
        self.press = Some(Press { pane, does: Does::Divide, button: Button::Left, first: at, at });
    }

    /// A button goes down.
    pub(crate) fn pressed(
        &mut self,
        pane: Pane,
        at: [f64; 2],
        button: Button,
        shift: bool,
        tool: Tool,
    ) -> Option<Request> {
        if self.press.is_some() {
            return None;
        }
        let does = match (button, tool) {
            (Button::Middle, _) => Does::Pan,
            (Button::Left, _) if shift => Does::Pan,
            (Button::Right, _) => Does::Zoom,
            (Button::Left, Tool::Turn) if pane == Pane::Volume => Does::Turn,
            (Button::Left, Tool::Turn) => Does::Cross,
            (Button::Left, Tool::Handle) => Does::Handle,
            (Button::Left, Tool::Pin) => Does::Pin,
            (Button::Left, Tool::Incise) => Does::Incise,
            (Button::Left, Tool::Bone) => Does::Bone,
            (Button::Left, Tool::Measure) => Does::Measure,
            (Button::Left, Tool::Brightness) => Does::Brightness,
        };
        self.press = Some(Press { pane, does, button, first: at, at });
        match does {
            Does::Handle => Some(Request::Grab { pane, at }),
            Does::Pin => Some(Request::Pin { pane, at }),
            Does::Cross => Some(Request::Cross { pane, at }),
            _ => None,
        }
    }

    /// The pointer moves while a button is held.
    pub(crate) fn moved(&mut self, at: [f64; 2]) -> Option<Request> {
        let press = self.press.as_mut()?;
        let by = [at[0] - press.at[0], at[1] - press.at[1]];
        press.at = at;
        let (pane, within) = (press.pane, within(at));
        let is_volume = pane == Pane::Volume;
        match press.does {
            Does::Turn => Some(Request::Orbit { by }),
            Does::Pan if is_volume => Some(Request::Pan { by }),
            Does::Zoom if is_volume => {
                let factor = (-3.0 * by[1]).exp().clamp(0.01, 100.0);
                Some(Request::Zoom { factor, at: press.first })
            }
            Does::Cross => Some(Request::Cross { pane, at: within }),
            Does::Brightness if is_volume => Some(Request::Transfer { by }),
            Does::Brightness => Some(Request::Window { by }),
            Does::Handle => Some(Request::Drag { to: within, lock: self.lock }),
            Does::Divide => Some(Request::Compare { shows: Shows::Both, at: at[0].clamp(0.0, 1.0) }),
            Does::Pan | Does::Zoom | Does::Pin | Does::Incise | Does::Bone | Does::Measure => None,
        }
    }

    /// A button goes up.
    pub(crate) fn released(&mut self, button: Button) -> Vec<Request> {
        let Some(press) = self.press.filter(|press| press.button == button) else { return Vec::new() };
        (self.press, self.lock) = (None, None);
        let mut requests = Vec::new();
        let (pane, [from, to]) = (press.pane, [press.first, press.at].map(within));
        match press.does {
            Does::Incise => requests.push(Request::Stroke { pane, from, to }),
            Does::Bone => requests.push(Request::DrawBone { pane, from, to }),
            Does::Measure => requests.push(Request::Measure { pane, from, to }),
            _ => {}
        }
        if press.does == Does::Handle {
            requests.push(Request::Drop);
        }
        requests
    }

    /// Goes back to before what is held.
    pub(crate) fn give_up(&mut self) -> Option<Request> {
        let press = self.press.take()?;
        self.lock = None;
        (press.does == Does::Handle).then_some(Request::Abandon)
    }

    /// Keeps what is held to an axis, or no longer, from where it is at once.
    pub(crate) fn keep_to(&mut self, axis: Axis) -> Option<Request> {
        self.lock = if self.lock == Some(axis) { None } else { Some(axis) };
        // What hasn't been moved yet isn't by a key.
        let press = self.press.filter(|press| press.does == Does::Handle && press.at != press.first)?;
        Some(Request::Drag { to: within(press.at), lock: self.lock })
    }

    /// The wheel turns away from the hand; `on_handle`: whether a handle is pointed at.
    pub(crate) fn wheel(
        &mut self,
        pane: Pane,
        at: [f64; 2],
        points: f32,
        tool: Tool,
        on_handle: bool,
    ) -> Option<Request> {
        let radius = self.hold() || (tool == Tool::Handle && on_handle);
        if pane == Pane::Volume && !radius {
            let factor = ZOOM.powf(f64::from(points / STEP)).clamp(0.01, 100.0);
            return Some(Request::Zoom { factor, at });
        }
        self.scrolled += points / STEP;
        let steps = self.scrolled.trunc();
        self.scrolled -= steps;
        let steps = steps as i32;
        match (steps, radius) {
            (0, _) => None,
            (steps, true) => Some(Request::Wheel { steps }),
            (steps, false) => Some(Request::Slice { pane, steps }),
        }
    }
}

/// The place that a drag has come to, no further than requests may name.
fn within(at: [f64; 2]) -> [f64; 2] {
    at.map(|c| c.clamp(-1.0, 2.0))
}

/// The points of a step of the wheel.
pub(crate) const fn step() -> f32 {
    STEP
}

/// The slices meet at a handle or a pin.
pub(crate) fn go_to(spot: &Spot) -> Vec<Request> {
    let there = |pane: Pane| spot.at[pane.number()].map(|at| Request::Cross { pane, at });
    [there(Pane::Axial), there(Pane::Coronal)].into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_never_edits_and_a_drag_stays_in_its_pane() {
        for pane in Pane::ALL {
            for (button, shift) in
                [(Button::Left, false), (Button::Left, true), (Button::Middle, false), (Button::Right, false)]
            {
                let mut hands = Hands::default();
                let mut all = Vec::from_iter(hands.pressed(pane, [0.5; 2], button, shift, Tool::Turn));
                all.extend(hands.moved([3.0, 0.4]));
                assert_eq!(hands.pane(), Some(pane));
                all.extend(hands.released(button));
                let views = |request: &Request| {
                    matches!(
                        request,
                        Request::Orbit { .. }
                            | Request::Pan { .. }
                            | Request::Zoom { .. }
                            | Request::Cross { .. }
                    )
                };
                assert!(all.iter().all(|request| views(request) && request.check().is_ok()), "{all:?}");
            }
        }
    }

    #[test]
    fn a_held_handle_is_dragged_along_an_axis_made_wider_and_given_up() {
        let mut hands = Hands::default();
        let grab = hands.pressed(Pane::Axial, [0.5; 2], Button::Left, false, Tool::Handle);
        assert!(matches!(grab, Some(Request::Grab { .. })));
        assert_eq!(hands.keep_to(Axis::Y), None, "it isn't moved yet");
        assert_eq!(hands.moved([0.6, 9.0]), Some(Request::Drag { to: [0.6, 2.0], lock: Some(Axis::Y) }));
        assert_eq!(hands.keep_to(Axis::Y), Some(Request::Drag { to: [0.6, 2.0], lock: None }), "at once");
        // Half steps of a smooth scroll come together.
        let wheel = |hands: &mut Hands| hands.wheel(Pane::Axial, [0.5; 2], 25.0, Tool::Handle, false);
        assert_eq!((wheel(&mut hands), wheel(&mut hands)), (None, Some(Request::Wheel { steps: 1 })));
        assert_eq!(hands.give_up(), Some(Request::Abandon));
        assert!(hands.released(Button::Left).is_empty() && hands.moved([0.5; 2]).is_none());
    }

    #[test]
    fn a_line_is_a_cut_once_it_is_let_go_of() {
        let mut hands = Hands::default();
        assert_eq!(hands.pressed(Pane::Coronal, [0.2, 0.3], Button::Left, false, Tool::Incise), None);
        assert_eq!(hands.moved([0.4, 9.0]), None);
        assert_eq!(hands.line(Pane::Coronal), Some([[0.2, 0.3], [0.4, 9.0]]));
        assert_eq!(hands.line(Pane::Axial), None);
        let cut = Request::Stroke { pane: Pane::Coronal, from: [0.2, 0.3], to: [0.4, 2.0] };
        assert_eq!((hands.released(Button::Left), hands.line(Pane::Coronal)), (vec![cut], None));
        hands.pressed(Pane::Coronal, [0.2, 0.3], Button::Left, false, Tool::Incise);
        assert_eq!(hands.give_up(), None);
        assert!(hands.released(Button::Left).is_empty(), "Esc gives it up");
        hands.pressed(Pane::Volume, [0.2, 0.3], Button::Left, false, Tool::Measure);
        hands.moved([0.4, 0.5]);
        let ruler = Request::Measure { pane: Pane::Volume, from: [0.2, 0.3], to: [0.4, 0.5] };
        assert_eq!(hands.released(Button::Left), [ruler]);
    }

    #[test]
    fn the_line_that_divides_goes_with_the_pointer_as_far_as_there_is_a_picture() {
        let mut hands = Hands::default();
        hands.divide(Pane::Axial, [0.5, 0.2]);
        for (to, at) in [(0.7, 0.7), (3.0, 1.0), (-0.2, 0.0)] {
            assert_eq!(hands.moved([to, 0.9]), Some(Request::Compare { shows: Shows::Both, at }));
        }
        assert!(hands.released(Button::Left).is_empty() && hands.pane().is_none());
    }

    #[test]
    fn only_the_button_that_went_down_lets_go() {
        let mut hands = Hands::default();
        hands.pressed(Pane::Volume, [0.5; 2], Button::Left, false, Tool::Handle);
        assert_eq!(hands.pressed(Pane::Volume, [0.5; 2], Button::Right, false, Tool::Handle), None);
        assert!(hands.released(Button::Right).is_empty());
        assert_eq!(hands.released(Button::Left), [Request::Drop]);
    }
}
