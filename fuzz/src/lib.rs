//! What the fuzz targets do with their bytes; each target is one call.
//!
//! A target holds that any input gives a result or an error: no panic, no endless work, no memory beyond the limit, and
//! no result that breaks what its type promises.
#![forbid(unsafe_code)]

pub mod artefacts;
pub mod fields;
pub mod files;
pub mod lattices;
pub mod meshes;
pub mod sessions;
pub mod text;

mod bytes;
mod stages;

use std::sync::OnceLock;

use ivd_core::Exec;

pub use bytes::Bytes;

/// Bytes of bulk data that a target may ask for.
const MEMORY: u64 = 64 << 20;

/// One thread, which the fuzzer can watch, and little memory.
pub fn exec() -> &'static Exec {
    static EXEC: OnceLock<Exec> = OnceLock::new();
    EXEC.get_or_init(|| Exec::default().with_threads(1).with_memory_limit(Some(MEMORY)))
}
