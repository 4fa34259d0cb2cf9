//! A session in a window: what [`ivd_frames`] draws and follows, shown by egui.
//!
//! The window computes nothing: it sends requests to a service on another thread and shows the frames that come. All that a pointer can do a keyboard can
//! do as well, by the list of handles and the fields beside the pictures, and every part has a name of its own for those who read the window by ear.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]

mod again;
mod awaited;
mod bar;
mod bones;
mod classes;
mod clips;
mod compare;
mod cut;
mod dialogs;
mod error;
mod files;
mod gestures;
mod handles;
mod inbox;
mod journal;
mod keys;
mod layout;
mod made;
mod matter;
mod number;
mod offered;
mod opened;
mod over;
mod pane;
mod pending;
mod received;
mod record;
mod rulers;
mod run;
mod shown;
mod side;
mod status;
mod system;
mod waits;
mod window;
mod work;
mod writing;

pub use error::Error;
pub use run::{Options, run, source};
pub use system::{Chooser, Choosing, Kind, Wanted};
pub use window::Window;
