//! Files that are replaced at once, or not at all.
//!
//! [`replace`] writes beside the target and renames: a reader sees the old file, the new one, or none, whenever the
//! writer fails, is killed or loses power. It is the only place of the project that does so, so that every file an IVD
//! program writes keeps these promises.
//!
//! An unfinished file is named `.ivd-unfinished-…` and locked by its writer for as long as it lives. The system drops
//! the lock of a process that was killed: a file that can be locked has been abandoned, and the next write into the
//! folder removes it. Process numbers would say less: they come round again, and those of another container or machine
//! mean nothing here.
#![forbid(unsafe_code)]

mod abandoned;
mod replace;

pub use abandoned::{is_unfinished, remove_abandoned, sweep};
pub use replace::{Sink, folder_of, replace};

/// How the names of unfinished files begin.
const UNFINISHED: &str = ".ivd-unfinished-";
