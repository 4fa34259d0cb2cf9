//! VTK's XML files: their elements, how their numbers are encoded, and where each array's bytes are.
//!
//! What the elements mean, an image's reader and a surface's know, and they word what is wrong: a [`Fault`] says it in numbers.

mod appended;
mod array;
mod base64;
mod coding;
mod fault;
mod xml;

pub(crate) use appended::{Appended, Broken};
pub(crate) use array::{Content, codes, number, text_of_codes, type_name, voxel_type};
pub(crate) use base64::Base64;
pub(crate) use coding::{Coding, check_type};
pub(crate) use fault::Fault;
pub(crate) use xml::{DEEPEST, Element, Text, open};
