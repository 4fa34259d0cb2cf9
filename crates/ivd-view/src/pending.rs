//! What was asked for a part and isn't shown yet: what is asked next for the same part goes on from there.

use ivd_frames::{Bone, ClipPart, Clipped, Compared, Figures, Incision, Request};

/// The last that was asked for a part, until it is shown or something else is done.
#[derive(Debug, Default)]
pub(crate) struct Pending(Option<Request>);

impl Pending {
    /// Something is asked for.
    pub(crate) fn ask(&mut self, request: &Request) {
        match request {
            Request::Turn { .. }
            | Request::SetBone { .. }
            | Request::Open { .. }
            | Request::MoveClip { .. }
            | Request::Compare { .. } => {
                self.0 = Some(request.clone());
            }
            // What only looks, and the ends of a slider's way.
            Request::Hover { .. }
            | Request::Orbit { .. }
            | Request::Pan { .. }
            | Request::Zoom { .. }
            | Request::Resize { .. }
            | Request::Adjust
            | Request::Drop => {}
            _ => self.0 = None,
        }
    }

    /// A frame has come; what it shows, or says why not, is pending no more.
    pub(crate) fn shown(&mut self, figures: &Figures) {
        let Figures { bones, incision, clips, refused, .. } = figures;
        self.compare(bones, incision.as_ref(), clips, refused.is_some());
        if self.compared(figures.compare) == figures.compare {
            self.0.take_if(|asked| matches!(asked, Request::Compare { .. }));
        }
    }

    fn compare(&mut self, bones: &[Bone], incision: Option<&Incision>, clips: &[Clipped], is_refused: bool) {
        let is_shown = match &self.0 {
            Some(Request::Turn { bone, axis, angle, by, .. }) => {
                let shown = bones.iter().find(|one| one.id == *bone);
                shown.is_none_or(|one| one.angle == *angle && one.by == *by && one.axis == *axis)
            }
            Some(Request::SetBone { bone, radius, reach }) => {
                let shown = bones.iter().find(|one| one.id == *bone);
                shown.is_none_or(|one| one.radius == Some(*radius) && one.reach == *reach)
            }
            Some(Request::Open { space, radius, open }) => {
                let shown = incision.filter(|cut| cut.id == *space);
                shown.is_none_or(|cut| cut.radius == *radius && cut.open == *open)
            }
            Some(Request::MoveClip { clip, part }) => {
                let shown = clips.iter().find(|one| one.id == *clip);
                shown.is_none_or(|one| one.part == *part)
            }
            _ => false,
        };
        if is_shown || is_refused {
            self.0 = None;
        }
    }

    /// What the panes will show of the body's two states.
    pub(crate) fn compared(&self, shown: Compared) -> Compared {
        match self.0 {
            Some(Request::Compare { shows, at }) => Compared { shows, at },
            _ => shown,
        }
    }

    /// A bone as it will be.
    pub(crate) fn bone(&self, shown: &Bone) -> Bone {
        match self.0 {
            Some(Request::Turn { bone, pivot, axis, angle, by }) if bone == shown.id => {
                Bone { pivot: Some(pivot), axis, angle, by, ..shown.clone() }
            }
            Some(Request::SetBone { bone, radius, reach }) if bone == shown.id => {
                Bone { radius: Some(radius), reach, ..shown.clone() }
            }
            _ => shown.clone(),
        }
    }

    /// A cut as it will be.
    pub(crate) fn incision(&self, shown: &Incision) -> Incision {
        match self.0 {
            Some(Request::Open { space, radius, open }) if space == shown.id => {
                Incision { radius, open, ..shown.clone() }
            }
            _ => shown.clone(),
        }
    }

    /// A plane or a box as it will be.
    pub(crate) fn clip(&self, id: u32, shown: ClipPart) -> ClipPart {
        match self.0 {
            Some(Request::MoveClip { clip, part }) if clip == id => part,
            _ => shown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_field_of_a_part_goes_on_from_the_first_that_is_not_shown_yet() {
        let shown = Bone {
            id: 3,
            name: "C3".to_owned(),
            pivot: Some([0.0; 3]),
            axis: [0.0, 0.0, 1.0],
            angle: 0.0,
            by: [0.0; 3],
            carried: false,
            fitted: false,
            radius: Some(2.0),
            reach: 5.0,
            at: [None; 4],
            beside: [false; 4],
        };
        let turn = |angle, by| Request::Turn { bone: 3, pivot: [0.0; 3], axis: [0.0, 0.0, 1.0], angle, by };
        let mut pending = Pending::default();
        pending.ask(&turn(4.0, [0.0; 3]));
        pending.ask(&Request::Drop);
        // A frame of something before.
        pending.compare(std::slice::from_ref(&shown), None, &[], false);
        let next = pending.bone(&shown);
        assert_eq!(next.angle, 4.0);
        pending.ask(&turn(next.angle, [0.0, 0.5, 0.0]));
        let then = pending.bone(&shown);
        assert_eq!((then.angle, then.by), (4.0, [0.0, 0.5, 0.0]));
        assert_eq!(pending.bone(&Bone { id: 2, ..shown.clone() }).angle, shown.angle);
        pending.compare(&[then], None, &[], false);
        assert_eq!(pending.bone(&shown), shown);
        pending.ask(&turn(4.0, [0.0; 3]));
        pending.ask(&Request::Undo);
        assert_eq!(pending.bone(&shown), shown, "something else was done");
    }
}
