//! Why something wasn't followed, and how far a hand is from what it holds.

use std::time::Duration;

use ivd_core::{Classified as _, ErrorClass, Exec};
use ivd_motion::handles::{Action, Handle};
use ivd_session::{Event, MapChoice, Physics};
use nalgebra::Vector3;

use super::{Drag, Model};
use crate::Error;
use crate::figures::Refused;
use crate::request::MapName;

/// A hand that is ahead by less than so much of a voxel is where it wants to be.
const AHEAD: f64 = 0.2;

impl Model {
    /// Tells why something wasn't followed; `moves`: it says how far something goes; `most`: how long it might take. Gives whether it took longer.
    pub(super) fn refuse(
        &mut self,
        error: &ivd_session::Error,
        exec: &Exec,
        (moves, most): (bool, Duration),
    ) -> Result<bool, Error> {
        if error.error_class() == ErrorClass::Cancelled {
            self.exec.check_cancelled()?;
            // What is held isn't tried to come closer, then.
            self.drag = self.drag.map(|drag| Drag { share: 0.0, ..drag });
            self.refused = Some(self.refusal("it was stopped".to_owned()));
            return Ok(false);
        }
        let is_nearest = matches!(self.session.settings().map, MapChoice::Octree(_));
        let is_late = exec.cancel.is_late();
        self.refused = Some(if is_late {
            let most = most.as_secs();
            let (other, instead) = match &self.session.settings().physics {
                Physics::Springs(_) => ("let the surface follow distance alone", None),
                Physics::Ring(_) if !is_nearest => {
                    ("let voxels follow what is nearest", Some(MapName::Octree))
                }
                Physics::Ring(_) => ("choose a higher level", None),
            };
            let why = format!("it would take more than {most} s; make the radius smaller, or {other}");
            Refused { instead, ..self.refusal(why) }
        } else if is_too_far(error) {
            let remedy = if is_nearest { "let voxels follow smoothest, take" } else { "take" };
            let when = if moves { "further on" } else { "by what is moved now" };
            let less = if moves { "move it less" } else { "move that less" };
            let why =
                format!("{when}, voxels would fold or stay behind; {remedy} a larger radius, or {less}");
            let instead = is_nearest.then_some(MapName::Biharmonic);
            Refused { exactly: Some(error.to_string()), instead, ..self.refusal(why) }
        } else {
            self.refusal(error.to_string())
        });
        Ok(is_late)
    }

    /// A refusal for a reason.
    pub(super) fn refusal(&self, why: String) -> Refused {
        Refused { why, exactly: None, instead: None, ahead_mm: self.ahead() }
    }

    /// What was found; where it wasn't, why is told.
    pub(super) fn or_refused<T>(&mut self, found: Result<T, String>) -> Option<T> {
        found.map_err(|why| self.refused = Some(self.refusal(why))).ok()
    }

    /// How far the hand is from what it holds (mm).
    pub(super) fn ahead(&self) -> f64 {
        self.held().map_or(0.0, |(drag, _, by)| (drag.wanted - by).norm())
    }

    /// What is held: by what hand, which handle, and how far that has gone. One that pulls with a force is where that has taken it.
    pub(super) fn held(&self) -> Option<(Drag, &Handle, Vector3<f64>)> {
        let drag = self.drag?;
        let handle = &self.session.settings().handles.iter().find(|one| one.id == drag.handle)?.what;
        Some((drag, handle, by_of(handle).unwrap_or(drag.by)))
    }

    /// What is told of a handle that is let go of where its hand isn't.
    pub(super) fn stopped_short(&self) -> Option<Refused> {
        let ((drag, _, by), refused) = self.held().zip(self.refused.clone())?;
        let (asked, gone) = (drag.wanted.norm(), by.norm());
        let why = format!("it went {gone:.1} mm, not {asked:.1} mm; {}", refused.why);
        Some(Refused { why, ahead_mm: 0.0, ..refused })
    }

    /// Whether that is noticeable.
    pub(super) fn is_ahead(&self) -> bool {
        self.ahead() >= self.noticeable()
    }

    /// A length that is noticed (mm).
    pub(super) fn noticeable(&self) -> f64 {
        AHEAD * self.session.rest().grid().voxel_diagonal()
    }
}

/// Whether an event says how far a handle goes.
pub(super) fn is_move(event: &Event) -> bool {
    matches!(event, Event::Add { .. } | Event::Move { .. } | Event::Pull { .. } | Event::Radius { .. })
}

/// Whether voxels can't follow a motion that far: a map that folds, or one that leaves the lattice behind where it doesn't.
fn is_too_far(error: &ivd_session::Error) -> bool {
    use ivd_core::Error::Untrusted;
    use ivd_session::Error::{Core, Map};
    match error {
        Map(ivd_map::Error::Folded { .. }) => true,
        Core(Untrusted { problem, .. }) | Map(ivd_map::Error::Core(Untrusted { problem, .. })) => {
            problem.starts_with("kept free of folds")
        }
        _ => false,
    }
}

/// How far a handle is told to move its vertex; none of one that pulls with a force.
fn by_of(handle: &Handle) -> Option<Vector3<f64>> {
    match handle.action {
        Action::Move(by) => Some(Vector3::from(by)),
        Action::Force(_) => None,
    }
}
