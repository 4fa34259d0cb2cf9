#![allow(clippy::unwrap_used, reason = "a test ends where something is missing")]

mod common;
mod gestures;
mod parts;
mod scenes;
mod scripts;
mod service;
mod soak;
