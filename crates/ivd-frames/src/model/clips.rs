//! Planes and boxes that clip.

use ivd_field::clip::{Cuboid, HalfSpace};
use ivd_field::lies::Lies;
use ivd_session::{ClipPart, ClipRule, Event};

use super::{Model, no_more_than};
use crate::request::MOST_HANDLES;
use crate::{Error, Request};

impl Model {
    /// Follows a request about planes and boxes.
    pub(super) fn change_clip(&mut self, request: &Request) -> Result<(), Error> {
        self.let_go_of_handles()?;
        match *request {
            Request::Clip { point, normal } => self.clip_by(ClipPart::Plane(HalfSpace { point, normal })),
            Request::ClipHere { along } => {
                let (point, normal) = self.panes.here(self.session.rest().grid(), along)?;
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
