#![allow(clippy::unwrap_used, reason = "a test ends where something is missing")]

mod common;
mod hostile;
mod refused;
mod shared;
