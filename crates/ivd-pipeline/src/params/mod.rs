//! Parameters from outside: read from tables and from words, as the schema of a method says ([`ivd_core::op`]).

mod landmarks;
mod table;
mod written;

pub use landmarks::{landmarks_at, place_landmarks, tell_landmarks, with_landmarks};
pub use table::from_toml;
pub use written::{read, read_entry, short};
