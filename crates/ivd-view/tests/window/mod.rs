#![allow(clippy::unwrap_used, reason = "a test ends where something is missing")]

mod bones;
mod common;
mod compared;
mod drawn;
mod files;
mod hands;
mod keyboard;
mod names;
mod opened;
mod parts;
mod recorded;
mod rulers;
mod screen;
