//! Who drives.

use std::time::{Duration, Instant};

use ivd_frames::Client;

/// Whoever drives and says nothing for so long may be relieved.
pub(crate) const IDLE: Duration = Duration::from_secs(30);

/// The one wheel.
#[derive(Debug, Default)]
pub(crate) struct Wheel {
    driver: Option<(Client, Instant)>,
    /// Who let go of it, and doesn't take it by a mere gesture.
    left: Option<Client>,
}

/// What became of somebody's wish to drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turn {
    /// They drive, as before.
    Drives,
    /// They do from now on; whoever did before lost it with what they held.
    Took {
        /// Whether there was somebody.
        from_another: bool,
    },
    /// Somebody else drives.
    Refused,
}

impl Wheel {
    /// Somebody does something; `asks`: for the wheel, rather than with it.
    pub(crate) fn turn(&mut self, client: Client, asks: bool, now: Instant) -> Turn {
        match self.driver {
            Some((driver, _)) if driver == client => {
                self.driver = Some((client, now));
                Turn::Drives
            }
            Some((_, last)) if now.duration_since(last) < IDLE => Turn::Refused,
            _ if !asks && self.left == Some(client) => Turn::Refused,
            before => {
                (self.driver, self.left) = (Some((client, now)), None);
                Turn::Took { from_another: before.is_some() }
            }
        }
    }

    /// Somebody lets go; whether they drove.
    pub(crate) fn let_go(&mut self, client: Client) -> bool {
        let drove = self.driver.is_some_and(|(driver, _)| driver == client);
        if drove {
            (self.driver, self.left) = (None, Some(client));
        }
        drove
    }

    /// Who drives.
    pub(crate) fn driver(&self) -> Option<Client> {
        self.driver.map(|(driver, _)| driver)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_drives_until_they_let_go_or_fall_asleep() {
        let (mut wheel, start) = (Wheel::default(), Instant::now());
        assert_eq!(wheel.turn(1, false, start), Turn::Took { from_another: false });
        assert_eq!(wheel.turn(2, true, start), Turn::Refused);
        assert!(!wheel.let_go(2) && wheel.let_go(1));
        assert_eq!(
            wheel.turn(1, false, start),
            Turn::Refused,
            "who let go doesn't take it by moving the mouse"
        );
        assert_eq!(wheel.turn(2, false, start), Turn::Took { from_another: false });
        assert_eq!(wheel.turn(1, true, start + IDLE / 2), Turn::Refused);
        assert_eq!(wheel.turn(2, false, start + IDLE / 2), Turn::Drives);
        assert_eq!(wheel.turn(1, true, start + IDLE), Turn::Refused);
        assert_eq!(wheel.turn(1, true, start + IDLE * 2), Turn::Took { from_another: true });
        assert_eq!(wheel.driver(), Some(1));
    }
}
