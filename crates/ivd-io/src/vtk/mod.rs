//! What VTK's XML files of volumes and of meshes have in common.

mod appended;
mod base64;

pub(crate) use appended::{Appended, Broken, Parts, split};
pub(crate) use base64::Base64;
