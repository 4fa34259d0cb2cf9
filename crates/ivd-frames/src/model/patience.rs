//! How long a hand waits.

use std::time::Duration;

use super::Model;

/// How long a window is at work on what is asked of it before it gives that up. How far a drag comes that can't be followed all the way goes by it, and so by
/// the machine's speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience {
    /// A solve that takes longer is refused: a window that doesn't answer is worse.
    pub work: Duration,
    /// The same while something is held, put by hand or slid.
    pub held: Duration,
    /// A hand that drags isn't followed where that takes longer: what comes closer does.
    pub drag: Duration,
    /// No try to come closer to a hand takes longer.
    pub one_try: Duration,
    /// While it drags, no try but the first begins later than this, ...
    pub tries: Duration,
    /// ... and once it has let go no later than this.
    pub dropped: Duration,
}

impl Patience {
    /// A day: what comes of a drag is the same on every machine.
    pub const ENDLESS: Self = {
        let day = Duration::from_hours(24);
        Self { work: day, held: day, drag: day, one_try: day, tries: day, dropped: day }
    };
}

impl Model {
    /// Waits so long from now on.
    pub fn wait(&mut self, patience: Patience) {
        self.patience = patience;
    }
}

impl Default for Patience {
    /// That of a window.
    fn default() -> Self {
        Self {
            work: Duration::from_secs(15),
            held: Duration::from_secs(15),
            drag: Duration::from_secs(3),
            one_try: Duration::from_secs(2),
            tries: Duration::from_millis(200),
            dropped: Duration::from_secs(2),
        }
    }
}
