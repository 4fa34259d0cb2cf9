//! Cuts, clips and bones.

use ivd_field::clip::HalfSpace;
use ivd_map::space::{Cut, Step};
use ivd_motion::rigid::RigidTransform;
use ivd_session::{ClipPart, Event};

use super::Model;
use crate::request::MOST_HANDLES;
use crate::{Error, Request};

/// Fraction of a cut's radius within which it opens whole.
const CORE: f64 = 0.5;

impl Model {
    /// Follows a request about a part of the settings that isn't a handle.
    pub(super) fn change_part(&mut self, request: &Request) -> Result<(), Error> {
        // What is held stays one step by itself; a slider that is held goes on.
        if !self.adjusts {
            self.let_go()?;
        }
        match *request {
            Request::Incise { centre, normal, radius, open } => {
                let step = Step::Cut(Cut { centre, normal, radius, core: CORE, open });
                let steps = &self.session.settings().space;
                let there = steps.iter().find(|one| matches!(one.what, Step::Cut(_))).map(|one| one.id);
                self.apply(match there {
                    Some(space) => Event::Respace { space, step },
                    None => Event::Space { id: None, step },
                })
            }
            Request::Close { space } => self.apply(Event::Unspace { space }),
            Request::Clip { point, normal } => {
                self.no_more_than(MOST_HANDLES)?;
                self.apply(Event::Clip { id: None, part: ClipPart::Plane(HalfSpace { point, normal }) })
            }
            Request::Unclip { clip } => self.apply(Event::Unclip { clip }),
            Request::Turn { bone, pivot, axis, angle, by } => {
                self.apply(Event::Turn { bone, to: RigidTransform { pivot, axis, angle, by } })
            }
            _ => Ok(()),
        }
    }
}
