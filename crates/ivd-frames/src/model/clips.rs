//! Planes and boxes that clip.

use ivd_field::clip::{Cuboid, HalfSpace};
use ivd_field::lies::Lies;
use ivd_session::{ClipPart, ClipRule, Event};

use super::{Model, no_more_than};
use crate::figures::Slice;
use crate::request::MOST_HANDLES;
use crate::{Error, Request, Shows};

impl Model {
    /// Finds which slices planes and boxes take something away of.
    pub(super) fn find_clipped(&mut self) {
        let slices = self.slices();
        for (number, (pane, axis, slice)) in slices.into_iter().enumerate() {
            let version = self.versions[pane.number()];
            if self.clipped[number].0 != version {
                self.clipped[number] = (version, self.is_clipped(axis, slice));
            }
        }
    }

    /// Whether what is shown is another in a slice than it would be if nothing clipped it.
    fn is_clipped(&self, axis: usize, slice: usize) -> bool {
        if self.session.settings().clip.parts.is_empty() {
            return false;
        }
        let [now, rest] = [Shows::Rest, Shows::Now].map(|other| self.compared.shows != other);
        let dims = self.session.rest().grid().dims();
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut voxels = (0..dims[v]).flat_map(|b| (0..dims[u]).map(move |a| [a, b]));
        voxels.any(|[a, b]| {
            let mut at = [slice; 3];
            (at[u], at[v]) = (a, b);
            now && self.is_taken(at) || rest && self.is_taken_at_rest(at)
        })
    }

    /// What is told of the slices.
    pub(super) fn told_slices(&self) -> [Slice; 3] {
        let mut slices = self.panes.planes.told(self.session.rest().grid());
        for (slice, (_, clipped)) in slices.iter_mut().zip(self.clipped) {
            slice.clipped = clipped;
        }
        slices
    }

    /// Follows a request about planes and boxes.
    pub(super) fn change_clip(&mut self, request: &Request) -> Result<(), Error> {
        self.let_go_of_handles()?;
        match *request {
            Request::Clip { point, normal } => self.clip_by(ClipPart::Plane(HalfSpace { point, normal })),
            Request::ClipHere { along } => {
                let (point, normal) = self.panes.beside_here(self.session.rest().grid(), along)?;
                self.clip_by(ClipPart::Plane(HalfSpace { point, normal }))
            }
            Request::ClipBox { min, max } => self.clip_by(ClipPart::Box(Cuboid { min, max })),
            Request::MoveClip { clip, part } => self.apply(Event::MoveClip { clip, part }),
            Request::ClipIn { space } => {
                // What isn't said stands still: a scene says no more than it has to.
                let space = (space == Lies::Rest).then_some(space);
                let rule = ClipRule { space, ..self.session.settings().clip.rule };
                self.apply(Event::ClipRule(rule))
            }
            Request::Unclip { clip } => self.apply(Event::Unclip { clip }),
            _ => Ok(()),
        }
    }

    /// Clips by a part more. A plane goes through what is seen at its point, wherever planes lie; a box has the numbers that it is given.
    fn clip_by(&mut self, part: ClipPart) -> Result<(), Error> {
        let clip = &self.session.settings().clip;
        if clip.rule.invert {
            return Err(Error::Request {
                what: "clip",
                problem: "the scene's planes and boxes throw away what lies within them".to_owned(),
                remedy: "take them away first",
            });
        }
        no_more_than(MOST_HANDLES, clip.parts.len())?;
        let part = match part {
            // The plane goes through what is seen there; at rest it is flat.
            ClipPart::Plane(HalfSpace { point, normal }) if clip.rule.space == Some(Lies::Rest) => {
                ClipPart::Plane(HalfSpace { point: self.rest_of(point), normal })
            }
            part => part,
        };
        self.apply(Event::Clip { id: None, part })
    }
}
