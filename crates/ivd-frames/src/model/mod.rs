//! A session with what a window shows of it: requests change it, and it says which panes that touches.

mod bones;
mod clips;
mod compare;
mod cut_off;
mod hand;
mod inside;
mod looks;
mod map;
mod matter;
mod outline;
mod parts;
mod patience;
mod refusal;
mod replay;
mod rulers;
mod sheet;
mod spots;
mod squeezed;
mod stroke;
mod told;
mod viewed;
mod window;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use ivd_core::{BRICK, Cancel, Exec, Labels, TransferFunction, Volume};
use ivd_field::clip::ClipParams;
use ivd_motion::handles::{Action, Handle, Pin};
use ivd_render::{Lens, View};
use ivd_session::{Event, Id, Physics, Session, Settings, Update};
use nalgebra::Vector3;

use crate::colours::{Turned, Window};
use crate::figures::{Figures, Hovered, Missed, Refused, Spot};
use crate::panes::{Across, Panes};
use crate::request::MOST_HANDLES;
use crate::{Compared, Error, Overlay, Pane, Request, Shows, Subject};

pub(crate) use looks::first_transfer;
pub use outline::Outline;
pub(crate) use outline::Outlines;
pub use patience::Patience;
use refusal::is_move;
pub(crate) use window::usual_radius;

/// What is shown and worked on.
pub struct Model {
    subject: Subject,
    session: Session,
    panes: Panes,
    lens: Lens,
    transfer: Option<TransferFunction>,
    turned: Turned,
    looks: looks::Looks,
    /// What was kept last.
    kept: Kept,
    window: Window,
    overlay: Option<Overlay>,
    compared: Compared,
    /// The body at rest, and its labels, without what planes and boxes take away, while it is shown.
    rest: Option<(ClipParams, Volume, Option<Labels>)>,
    first_window: Window,
    /// Of the next handle (mm).
    radius: f64,
    drag: Option<Drag>,
    /// A slider is held: what it does is one step, called by the first of it.
    adjusts: bool,
    hovered: Option<Hovered>,
    refused: Option<Refused>,
    /// How the lattice followed before it was to follow otherwise.
    other: Option<Physics>,
    /// What couldn't be done again when it was opened.
    missed: Vec<Missed>,
    /// By slice, whether it was clipped when its pane had a version.
    clipped: [(u64, bool); 3],
    /// Classes along the lattice of a level, and their areas (mm²).
    along: Option<(u8, BTreeMap<u16, f64>)>,
    spots: Vec<Spot>,
    pins: Vec<Spot>,
    /// How far the lattice goes beyond the scan's edge (mm).
    cut_off_mm: f64,
    hidden: spots::Hidden,
    sides: sheet::Sides,
    /// What can be undone of what is drawn.
    view_steps: viewed::ViewSteps,
    rulers: Vec<rulers::Places>,
    /// Number of the next of them.
    next_ruler: u32,
    /// Rise with every change of what a pane shows.
    versions: [u64; 4],
    exec: Exec,
    patience: Patience,
    /// Whether frames have the line in which each slice cuts the surface.
    outlines: bool,
    /// Stops what is worked on, and nothing else.
    stop: Cancel,
}

/// What a person would miss who hadn't kept it: settings, how classes look, and rulers where they are at rest.
type Kept = (Settings, looks::Looks, Vec<Vec<[f64; 3]>>);

/// A handle that is held.
#[derive(Debug, Clone, Copy)]
struct Drag {
    handle: Id,
    from: [f64; 2],
    /// How far it was moved then.
    by: Vector3<f64>,
    across: Across,
    /// Whether it was made to be held.
    is_new: bool,
    /// Out of the surface there, once that was asked for: it stays for the drag.
    out: Option<Vector3<f64>>,
    /// Where it was wanted last.
    wanted: Vector3<f64>,
    /// Where that is refused, the share of the way there that is tried next; 0: none is, as it was stopped.
    share: f64,
    /// Whether the way there takes longer than a hand waits for.
    late: bool,
    /// Whether the slices are to meet there once it moves.
    meets: bool,
}

impl Model {
    /// At its first settings.
    ///
    /// # Errors
    /// Those of [`Session::new`], and of pictures.
    pub fn new(subject: Subject, size: [usize; 2], exec: Exec) -> Result<Self, Error> {
        let volume = &subject.volume;
        let looks = looks::of_subject(&subject);
        let transfer = looks::first_transfer(&subject)?;
        volume.find_bricks(&exec)?;
        let panes = Panes::new(subject.seen(transfer.as_ref()), &subject.picture, size, &exec)?;
        let lens = panes.lens(volume.grid())?;
        let window = Window::of(volume);
        let session = Session::new(
            volume.clone(),
            subject.lattice.clone(),
            subject.labels.clone(),
            subject.settings.clone(),
            &exec,
        )?;
        session.deformed().find_bricks(&exec)?;
        let said = subject.scene.window.clone().unwrap_or_default();
        let mut model = Self {
            kept: Kept::default(),
            looks,
            session,
            panes,
            lens,
            transfer,
            turned: Turned::of_section(&said),
            window,
            overlay: None,
            compared: Compared::default(),
            rest: None,
            first_window: window,
            radius: 0.0,
            drag: None,
            adjusts: false,
            hovered: None,
            refused: None,
            other: None,
            missed: Vec::new(),
            clipped: [(0, false); 3],
            along: None,
            spots: Vec::new(),
            pins: Vec::new(),
            cut_off_mm: 0.0,
            hidden: spots::Hidden::default(),
            sides: sheet::Sides::default(),
            view_steps: viewed::ViewSteps::default(),
            rulers: Vec::new(),
            next_ruler: 0,
            versions: [1; 4],
            exec,
            patience: Patience::default(),
            outlines: false,
            stop: Cancel::default(),
            subject,
        };
        model.follow_labels()?;
        model.show_section(&said)?;
        model.keep();
        model.find_spots()?;
        Ok(model)
    }

    /// What it shows.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The same, to be recorded.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// What it began with.
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// What is shown is kept: until something changes nothing would be lost.
    pub(crate) fn keep(&mut self) {
        self.kept = (self.session.settings().clone(), self.looks.clone(), self.rulers_at_rest());
    }

    /// Whether something would be lost.
    pub(crate) fn is_unsaved(&self) -> bool {
        let (settings, looks, rulers) = &self.kept;
        self.session.settings() != settings || self.looks != *looks || self.rulers_at_rest() != *rulers
    }

    /// Shows what was shown before there was a model.
    ///
    /// - `view`, `size`: of the volume's pane, where somebody has turned it or said how large it is.
    /// - `radius`: of the next handle, where somebody has said it.
    pub(crate) fn show_as(
        &mut self,
        cross: [f64; 3],
        window: Window,
        (view, size): (Option<View>, Option<[usize; 2]>),
        radius: Option<f64>,
    ) -> Result<(), Error> {
        self.radius = radius.unwrap_or(self.radius);
        (self.panes.planes.cross, self.window) = (cross, window);
        self.touch(&Pane::ALL[1..]);
        self.panes.view = view.unwrap_or(self.panes.view);
        self.panes.size = size.unwrap_or(self.panes.size);
        self.moved_camera()
    }

    /// Rise with every change of what a pane shows.
    pub fn versions(&self) -> [u64; 4] {
        self.versions
    }

    /// Follows a request. What can't be deformed as asked isn't an error: the last state stays, and the figures say why.
    ///
    /// # Errors
    /// A request that makes no sense here; cancellation.
    pub fn follow(&mut self, request: &Request) -> Result<(), Error> {
        request.check()?;
        if !matches!(request, Request::Transfer { .. } | Request::Class { .. }) {
            self.view_steps.end();
        }
        let grid = self.session.rest().grid().clone();
        match request {
            Request::Resize { .. }
            | Request::Orbit { .. }
            | Request::Pan { .. }
            | Request::Zoom { .. }
            | Request::Look { .. }
            | Request::ResetView => {
                self.panes.turn(&grid, &self.lens, request);
                self.moved_camera()
            }
            Request::Show { sight } => {
                let before = self.panes.view;
                self.panes.turn(&grid, &self.lens, request);
                if let Err(error) = self.moved_camera() {
                    self.panes.view = before;
                    return Err(error);
                }
                self.panes.planes.meet(sight.cross, &grid);
                (self.window, self.radius, self.hovered) = (sight.window(), sight.radius, None);
                self.touch(&Pane::ALL[1..]);
                Ok(())
            }
            Request::Window { by } => {
                let least = 1e-6 * (self.first_window.high - self.first_window.low);
                self.window = self.window.dragged(*by, least);
                self.touch(&Pane::ALL[1..]);
                Ok(())
            }
            Request::Transfer { .. }
            | Request::ResetColours
            | Request::Class { .. }
            | Request::AllClasses { .. } => self.look_as(request),
            Request::Slice { pane, steps } => {
                self.panes.planes.step(*pane, *steps, grid.dims())?;
                self.hovered = None;
                self.touch(&[*pane]);
                self.moved_cross();
                Ok(())
            }
            Request::Cross { pane, at } => {
                if let Some(place) = self.look(*pane, *at)? {
                    let moved = self.panes.planes.meet(place, &grid);
                    self.touch(&moved);
                    self.moved_cross();
                }
                Ok(())
            }
            Request::Cut { along } => self.look_inside(*along),
            Request::ShowSqueezed => {
                self.show_squeezed();
                Ok(())
            }
            Request::Overlay { of } => {
                self.overlay = *of;
                self.touch(&Pane::ALL[1..]);
                Ok(())
            }
            Request::Compare { shows, at } => self.compare(Compared { shows: *shows, at: *at }),
            Request::Hover { pane, at } => {
                self.find_hidden();
                self.hovered = self.hover(*pane, *at)?;
                Ok(())
            }
            Request::Measure { .. } | Request::Ruler { .. } | Request::Unmeasure { .. } => {
                self.change_rulers(request)
            }
            Request::Restored => {
                self.view_steps.forget();
                Ok(())
            }
            Request::Grab { pane, at } => self.grab(*pane, *at),
            Request::Drag { to, lock } => self.drag(*to, *lock),
            Request::Adjust => {
                self.let_go()?;
                self.adjusts = true;
                Ok(())
            }
            Request::Drop => {
                self.come_closest()?;
                if self.drag.is_some() {
                    self.refused = self.stopped_short();
                }
                self.hovered = None;
                self.meet_at_held();
                self.let_go()
            }
            Request::Abandon => {
                (self.drag, self.adjusts, self.refused) = (None, false, None);
                if self.session.in_gesture() {
                    let update = self.session.abandon(&self.exec)?;
                    self.show(&update)?;
                }
                Ok(())
            }
            Request::Radius { handle, radius } => self.set_radius(*handle, *radius),
            Request::Wheel { steps } => {
                let pointed = self.hovered.as_ref().and_then(|hovered| hovered.handle);
                let there = |id: &Id| self.session.settings().handles.iter().any(|one| one.id == *id);
                let handle = self.drag.map(|drag| drag.handle).or(pointed).filter(there);
                self.set_radius(handle, (self.radius * 1.1_f64.powi(*steps)).clamp(1e-3, 1e6))
            }
            Request::Add { place, by } => {
                let at = self.anchor_at(*place, None);
                let Some(at) = self.or_refused(at) else { return Ok(()) };
                let handle = Handle { at, action: Action::Move(*by), radius: self.radius };
                no_more_than(MOST_HANDLES, self.session.settings().handles.len())?;
                self.apply(Event::Add { id: None, handle })
            }
            Request::Move { handle, by } => self.apply(Event::Move { handle: *handle, by: *by }),
            Request::Pull { handle, with } => self.apply(Event::Pull { handle: *handle, with: *with }),
            Request::Remove { handle } => {
                self.let_go()?;
                self.apply(Event::Remove { handle: *handle })
            }
            Request::Pin { pane, at } => {
                self.check_seen_now("pin", &[*at])?;
                no_more_than(MOST_HANDLES, self.session.settings().fixed.len())?;
                let [_, Some(place)] = self.look_through(*pane, *at)? else {
                    return Err(nothing_there("pin"));
                };
                let at = self.anchor(*pane, place);
                let Some(at) = self.or_refused(at) else { return Ok(()) };
                let pin = Pin { at, radius: 0.5 * self.radius };
                self.apply(Event::Pin { id: None, pin })
            }
            Request::Release { fix } => self.apply(Event::Release { fix: *fix }),
            Request::Stroke { pane, from, to } => self.stroke(*pane, *from, *to),
            Request::Clip { .. }
            | Request::ClipHere { .. }
            | Request::ClipBox { .. }
            | Request::MoveClip { .. }
            | Request::ClipIn { .. }
            | Request::Unclip { .. } => self.change_clip(request),
            Request::DrawBone { pane, from, to } => self.draw_bone(*pane, *from, *to),
            Request::Bone { from, to } => self.place_bone([*from, *to]),
            Request::Incise { .. }
            | Request::Open { .. }
            | Request::Close { .. }
            | Request::Turn { .. }
            | Request::SetBone { .. }
            | Request::Joint { .. }
            | Request::RemoveBone { .. } => self.change_part(request),
            Request::Undo => {
                self.let_go()?;
                if self.undo_view()? {
                    return Ok(());
                }
                let exec = self.in_time();
                let undone = self.session.undo(&exec);
                self.gone(undone, &exec)
            }
            Request::Redo => {
                self.let_go()?;
                if self.redo_view()? {
                    return Ok(());
                }
                let exec = self.in_time();
                let redone = self.session.redo(&exec);
                self.gone(redone, &exec)
            }
            Request::Reset => {
                self.let_go()?;
                self.apply(Event::Reset)
            }
            Request::Level { level } => self.apply(Event::Level(*level)),
            Request::Stiffness { stiffness } => self.apply(Event::Stiffness { newton_per_metre: *stiffness }),
            Request::Material { class, stiffness } => self.stiffen(*class, *stiffness),
            Request::Solver { solver } => {
                let now = self.session.settings().physics.clone();
                let known = [&now, self.other.as_ref().unwrap_or(&now), &self.subject.settings.physics];
                self.apply(Event::Physics(matter::solver(*solver, known)))?;
                if self.session.settings().physics != now {
                    self.other = Some(now);
                }
                Ok(())
            }
            Request::Map { map } => {
                let map = map::chosen(*map, [&self.session.settings().map, &self.subject.settings.map]);
                self.apply(Event::Map(map))
            }
            Request::Depth { weight } => self.weigh_depth(*weight),
            Request::Save { .. } | Request::Stop => Ok(()),
        }
    }

    /// Applies an event. What can't be followed changes nothing, and the figures say why; only interruption is an error.
    fn apply(&mut self, event: Event) -> Result<(), Error> {
        let is_held = self.drag.is_some() || self.adjusts;
        let most = if is_held { self.patience.held } else { self.patience.work };
        self.apply_within(event, most).map(|_| ())
    }

    /// The same where it may take so long; whether it was given up as it took longer.
    fn apply_within(&mut self, event: Event, most: Duration) -> Result<bool, Error> {
        if self.adjusts && !self.session.in_gesture() {
            self.session.begin(event.name())?;
        }
        if let Err(error) = self.check_cut_after(&event) {
            self.refused = Some(self.refusal(error.to_string()));
            return Ok(false);
        }
        let exec = self.within(most);
        let moves = is_move(&event);
        match self.session.apply(event, &exec) {
            Ok(update) => self.show(&update).map(|()| false),
            Err(error) => self.refuse(&error, &exec, (moves, most)),
        }
    }

    /// Shows what a step back or forth came to, if there was one.
    fn gone(&mut self, gone: Result<Option<Update>, ivd_session::Error>, exec: &Exec) -> Result<(), Error> {
        match gone {
            Ok(Some(update)) => self.show(&update),
            Ok(None) => Ok(()),
            Err(error) => self.refuse(&error, exec, (false, self.patience.work)).map(|_| ()),
        }
    }

    /// Work that is given up where it takes too long.
    fn in_time(&self) -> Exec {
        self.within(self.patience.work)
    }

    /// Work that is given up where it takes longer.
    fn within(&self, most: Duration) -> Exec {
        let mut exec = self.exec.clone().with_deadline(Instant::now() + most);
        exec.cancel = exec.cancel.or(&self.stop);
        exec
    }

    /// What is asked for next is given up where this is asked to stop.
    pub fn stops_by(&mut self, stop: Cancel) {
        self.stop = stop;
    }

    /// Takes what an event changed into account.
    fn show(&mut self, update: &Update) -> Result<(), Error> {
        self.show_now();
        self.follow_labels()?;
        if !update.dirty.is_empty() {
            let bricks = self.session.displacement().inverse().brick_dims();
            let at = |brick: usize| {
                [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]]
            };
            let cut: Vec<Pane> = self
                .slices()
                .iter()
                .filter(|(_, axis, slice)| {
                    update.dirty.iter().any(|&brick| at(brick)[*axis] == slice / BRICK)
                })
                .map(|(pane, ..)| *pane)
                .collect();
            self.touch(&cut);
            self.touch(&[Pane::Volume]);
        }
        if self.overlay.is_some_and(|of| of != Overlay::Classes) {
            // Its scale goes by the longest motion.
            self.touch(&Pane::ALL[1..]);
        }
        self.refused = None;
        self.carry_rulers();
        if self.clip_rest().is_err() {
            // No room for it: what is deformed is there still.
            self.compared.shows = Shows::Now;
            self.touch(&Pane::ALL);
        }
        self.find_spots()
    }

    /// The slices: their panes, the axis of the grid that each cuts, and where.
    fn slices(&self) -> [(Pane, usize, usize); 3] {
        self.panes.planes.slices(self.session.rest().grid().dims())
    }

    fn touch(&mut self, panes: &[Pane]) {
        for pane in panes {
            self.versions[pane.number()] += 1;
        }
    }

    fn moved_camera(&mut self) -> Result<(), Error> {
        // What lay under the pointer lies elsewhere.
        self.hovered = self.hovered.take().filter(|hovered| hovered.pane != Pane::Volume);
        self.lens = self.panes.lens(self.session.rest().grid())?;
        self.touch(&[Pane::Volume]);
        Ok(())
    }

    /// The cut goes where the slices meet.
    fn moved_cross(&mut self) {
        if self.panes.cut.is_some() {
            self.touch(&[Pane::Volume]);
        }
    }

    /// Lets go of what is held, as it is.
    fn let_go(&mut self) -> Result<(), Error> {
        (self.drag, self.adjusts) = (None, false);
        if self.session.in_gesture() {
            self.session.commit()?;
        }
        Ok(())
    }

    fn set_radius(&mut self, handle: Option<Id>, radius: f64) -> Result<(), Error> {
        self.radius = radius;
        let Some(handle) = handle else { return Ok(()) };
        self.apply(Event::Radius { handle, radius })?;
        // Within another radius what is held may come closer to the hand.
        if self.refused.is_none() && self.drag.is_some_and(|drag| drag.handle == handle) && self.is_ahead() {
            self.drag = self.drag.map(|drag| Drag { share: 0.5, ..drag });
            self.follow_hand()?;
        }
        Ok(())
    }

    /// The place that a pane shows (mm, RAS).
    fn look(&self, pane: Pane, at: [f64; 2]) -> Result<Option<[f64; 3]>, Error> {
        self.panes.look(pane, at, self.seen(at), &self.exec)
    }

    /// What is told beside the pictures.
    pub fn figures(&mut self) -> Figures {
        self.find_hidden();
        self.find_classes();
        self.find_clipped();
        Figures::of(self)
    }
}

fn nothing_there(what: &'static str) -> Error {
    Error::Request { what, problem: "nothing is seen there".into(), remedy: "point at what is shown" }
}

/// Refuses one more where there are as many as there may be.
fn no_more_than(most: usize, count: usize) -> Result<(), Error> {
    if count < most {
        return Ok(());
    }
    Err(Error::Request { what: "add", problem: format!("there are {count}"), remedy: "remove one first" })
}
