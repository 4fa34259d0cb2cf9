//! Runs a program and lets one chosen operation on a file fail, fall short, be interrupted, or be its last.
//!
//! The program is traced (ptrace), so that every system call is seen, whichever library makes it, and the program itself
//! needs no code for it. An *operation* is a call that changes what lies below a folder: create, write, truncate, sync,
//! rename, make a folder, change a mode. Operations are counted from 1 in the order in which they are made.
//!
//! Linux on x86-64 only; elsewhere the crate is empty.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod operation;
mod trace;

pub use operation::Operation;
pub use trace::{Fault, Outcome, run};
