//! Pre-integrated classification (Engel, Kraus & Ertl 2001): a step looks the way it would if its value went evenly from that at its one end to
//! that at its other, so that a thin layer of visible values isn't stepped over.
//!
//! - `table`: light and opacity by the values at both ends.
//! - `cast`: what the steps of a ray look like; the plain twin of
//! - `lanes`, for eight at a time.

mod cast;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "unchecked reads of the table, argued in the module's head")]
mod lanes;
mod table;

pub(crate) use cast::AtEnds;
pub(crate) use table::Preintegrated;
