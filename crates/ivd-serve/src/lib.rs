//! A session in a browser, on this machine alone: one page without build step, frames out and gestures in over one WebSocket.
//!
//! Who may do what:
//!
//! - It listens on 127.0.0.1, or on a socket in the file system that only its owner opens; nothing else is possible. From elsewhere `ssh -L` leads there.
//! - `Host` names this machine (`localhost`, `127.0.0.1`, `[::1]`, any port: a tunnel has its own), and a socket's `Origin` is that host: pages of
//!   other sites, and names that were made to mean this machine, are refused.
//! - A token of 128 bits from the system stands in the link's fragment, which no request holds, and is the socket's first message, within five seconds. Another
//!   one lets watch, and do nothing.
//! - One drives, others watch. Whoever drives hands over, or may be relieved after half a minute without a word; what a lost driver held is abandoned.
//! - Messages have at most 64 KiB, connections are at most eight, and each has at most one frame waiting here. What is asked for is a list of its own
//!   ([`ivd_frames::Request`]) whose costs are bounded before anything is computed; it names no file, and no frame does.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]

mod error;
mod guard;
mod hub;
mod page;
mod server;
mod socket;
mod token;
mod wheel;

pub use error::Error;
pub use server::{Links, Options, Place, serve};
