//! An observer that keeps what is noted.
//!
//! It takes part by `#[path]`, in the unit tests as in any suite.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::sync::Mutex;

use ivd_core::Observer;

#[derive(Default)]
pub(crate) struct Notes(pub(crate) Mutex<Vec<String>>);

impl Observer for Notes {
    fn note(&self, message: &str) {
        self.0.lock().unwrap().push(message.to_owned());
    }
}
