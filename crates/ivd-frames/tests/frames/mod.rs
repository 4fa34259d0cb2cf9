#![allow(clippy::unwrap_used, reason = "a test ends where something is missing")]

mod bones;
mod common;
mod compared;
mod depth;
mod gestures;
mod hands;
mod labelled;
mod parts;
mod rulers;
mod scans;
mod scenes;
mod scripts;
mod service;
mod soak;
mod surface;
mod undone;
mod verbs;
