//! What is worked on, in a word, while an answer is waited for.

use std::time::{Duration, Instant};

use ivd_frames::Request;

/// What only looks.
const DRAWING: &str = "drawing";
/// What only writes.
const SAVING: &str = "saving";

/// What is done until an answer comes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Waits {
    does: &'static str,
    since: Instant,
    /// Number of the request that is waited for.
    number: u64,
}

/// Whether a request is more than where the pointer or how large the window is.
pub(crate) fn does_something(request: &Request) -> bool {
    !matches!(request, Request::Hover { .. } | Request::Resize { .. })
}

/// Whether what is done changes something.
fn changes(does: &str) -> bool {
    ![DRAWING, SAVING].contains(&does)
}

/// Whether a request is to become a step that can be undone, or goes through those.
pub(crate) fn makes_step(request: &Request) -> bool {
    changes(doing(request)) || matches!(request, Request::Class { .. } | Request::Adjust)
}

impl Waits {
    pub(crate) fn begin() -> Self {
        Self { does: DRAWING, since: Instant::now(), number: 0 }
    }

    /// Something more is asked for; whether it does more than look. What is worked on is what was asked first that does.
    pub(crate) fn ask(&mut self, request: &Request) -> bool {
        let does = doing(request);
        // What is given up isn't gone on with.
        if (self.does == DRAWING && does != DRAWING) || *request == Request::Abandon {
            (self.does, self.since) = (does, Instant::now());
        }
        does != DRAWING
    }

    /// The request of that number is waited for.
    pub(crate) fn until(&mut self, number: u64) {
        self.number = number;
    }

    /// Whether a frame that comes after so many requests is what is waited for.
    pub(crate) fn is_answered(&self, followed: u64) -> bool {
        self.number <= followed
    }

    /// Whether what is done changes something.
    pub(crate) fn changes(&self) -> bool {
        changes(self.does)
    }

    /// What is done, and for how long already; `None` where that isn't worth a word yet.
    pub(crate) fn told(&self, soon: Duration) -> Option<String> {
        told(self.does, self.since.elapsed(), soon)
    }
}

fn told(does: &str, waited: Duration, soon: Duration) -> Option<String> {
    match waited.as_secs() {
        _ if waited < soon => None,
        0 => Some(format!("{does} …")),
        seconds => Some(format!("{does}, {seconds} s …")),
    }
}

/// What a request lets be worked on.
fn doing(request: &Request) -> &'static str {
    match request {
        Request::Grab { .. }
        | Request::Drag { .. }
        | Request::Drop
        | Request::Radius { .. }
        | Request::Wheel { .. }
        | Request::Add { .. }
        | Request::Move { .. }
        | Request::Pull { .. }
        | Request::Remove { .. }
        | Request::Pin { .. }
        | Request::Release { .. }
        | Request::Stiffness { .. }
        | Request::Material { .. }
        | Request::Solver { .. }
        | Request::Map { .. }
        | Request::Depth { .. }
        | Request::Reset => "moving",
        Request::Incise { .. } | Request::Stroke { .. } | Request::Open { .. } => "cutting",
        Request::Close { .. } => "closing the cut",
        Request::Clip { .. }
        | Request::ClipHere { .. }
        | Request::ClipBox { .. }
        | Request::MoveClip { .. }
        | Request::ClipIn { .. }
        | Request::Unclip { .. } => "clipping",
        Request::Turn { .. } => "turning a bone",
        Request::DrawBone { .. }
        | Request::Bone { .. }
        | Request::SetBone { .. }
        | Request::Joint { .. }
        | Request::RemoveBone { .. } => "changing a bone",
        Request::Abandon => "giving it up",
        Request::Undo => "undoing",
        Request::Redo => "doing it again",
        Request::Level { .. } => "changing the level",
        Request::Save { .. } => SAVING,
        _ => DRAWING,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_worked_on_is_told_with_how_long_that_has_taken() {
        let after = |ms| told("cutting", Duration::from_millis(ms), Duration::from_millis(300));
        assert_eq!([after(299), after(300)], [None, Some("cutting …".to_owned())]);
        assert_eq!(after(3900).as_deref(), Some("cutting, 3 s …"));
        let mut waits = Waits::begin();
        let hover = Request::Hover { pane: ivd_frames::Pane::Axial, at: [0.5; 2] };
        for (n, request, does) in
            [(1, hover.clone(), DRAWING), (2, Request::Undo, "undoing"), (3, hover, "undoing")]
        {
            if waits.ask(&request) {
                waits.until(n);
            }
            assert_eq!(waits.does, does);
        }
        // Frames of what only looked don't answer it.
        assert!(!waits.is_answered(1) && waits.is_answered(2));
    }
}
