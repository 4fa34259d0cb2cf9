//! A session in a browser, on this machine alone: one page with no build step, frames out and gestures in over one WebSocket.
//!
//! Who may do what:
//!
//! - It listens on 127.0.0.1, or on a socket in the file system that only its owner opens; nothing else is possible. From elsewhere `ssh -L` leads there.
//! - `Host` names this machine (`localhost`, `127.0.0.1`, `[::1]`, any port: a tunnel has its own), and a socket's `Origin` is that host: pages of
//!   other sites, and host names that were made to resolve to this machine (DNS rebinding), are refused.
//! - A token of 128 bits from the system stands in the link's fragment, which no request holds, and is the socket's first message, within five seconds. A second
//!   token allows watching only.
//! - One drives, others watch. The driver hands over, or may be replaced after half a minute of silence; what a disconnected driver held goes back to where it was.
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
pub use hub::Links;
pub use server::{Options, Place, serve};
