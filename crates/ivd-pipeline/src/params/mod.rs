//! Parameters from outside: read from tables and from words, as the schema of a method says ([`ivd_core::op`]).

mod table;
mod written;

pub use table::from_toml;
pub use written::{read, read_entry, short};
