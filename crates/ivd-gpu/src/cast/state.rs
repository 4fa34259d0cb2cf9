//! What pictures leave on the device for those that come after.

use std::collections::HashMap;

use super::resident::Resident;
use crate::buffers::Room;

/// What pictures have in common.
#[derive(Default)]
pub(crate) struct State {
    pub(crate) resident: Resident,
    pub(super) rooms: Option<Rooms>,
    /// Of each kind of picture, time of a pixel (s) in its slowest part when one was last made.
    pub(super) pace: HashMap<String, f64>,
}

impl State {
    /// Lets go of everything on the device.
    pub(crate) fn forget(&mut self) {
        self.resident = Resident::default();
        self.rooms = None;
    }
}

/// What a part of a picture needs.
pub(super) struct Rooms {
    pub(super) pixels: usize,
    pub(super) tiles: usize,
    pub(super) params: Room,
    pub(super) camera: Room,
    pub(super) part: Room,
    pub(super) rays: Room,
    pub(super) picture: Room,
    pub(super) result: Room,
}
