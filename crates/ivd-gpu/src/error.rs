use std::time::Duration;

/// What a device does wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// It is gone: unplugged, reset, or its driver gave up.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// It has no room for something.
    #[error("the GPU has no room for {what} ({bytes} bytes)")]
    NoRoom {
        /// What it was.
        what: &'static str,
        /// Its size.
        bytes: u64,
    },
    /// Something is larger than anything that it holds.
    #[error("{what} ({bytes} bytes) is larger than what the GPU takes")]
    TooLarge {
        /// What it is.
        what: &'static str,
        /// Its size.
        bytes: u64,
    },
    /// Voxels of a type that no kernel here knows.
    #[error("voxels of type {0} are known to the processor alone")]
    Unknown(&'static str),
    /// It lacks a feature that a kernel can't do without.
    #[error("the GPU has no {0}")]
    Lacks(&'static str),
    /// It doesn't answer.
    #[error("the GPU didn't answer within {} s", .0.as_secs())]
    Late(Duration),
    /// It refuses a command: an error of this program or of its driver.
    #[error("the GPU refuses a command: {0}")]
    Refused(String),
    /// Its result lacks the words that every result ends in.
    #[error("the GPU's result was never written")]
    NotWritten,
    /// What is the same on a processor: cancelled, over time, short of memory.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
}
