use std::path::Path;

use super::Error;
use crate::{FileError, Space};

/// Mesh formats, by the file's ending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Stanford polygon file, binary little endian.
    Ply,
    /// Wavefront object, text.
    Obj,
    /// Stereolithography, binary.
    Stl,
    /// glTF 2.0, binary container.
    Glb,
    /// VTK's XML polygon data, appended raw.
    Vtp,
}

impl Format {
    /// Every format, in the order in which messages list them.
    pub const ALL: [Self; 5] = [Self::Ply, Self::Obj, Self::Stl, Self::Glb, Self::Vtp];

    /// The ending, without its dot.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Stl => "stl",
            Self::Glb => "glb",
            Self::Vtp => "vtp",
        }
    }

    /// The axes of a file of this format: those that are wanted, else its own. GLB's root node turns RAS to glTF's axes, and leaves
    /// no choice.
    pub(super) fn space(self, path: &Path, wanted: Option<Space>) -> Result<Space, Error> {
        match (self, wanted) {
            (Self::Glb, Some(_)) => Err(Error::from(FileError::Unwritable {
                path: path.to_owned(),
                format: "GLB",
                what: "axes of one's choice: its standard has metres with y up",
                remedy: "leave the space out, or write .ply, .obj, .stl or .vtp",
            })),
            (_, Some(space)) => Ok(space),
            (Self::Vtp, None) => Ok(Space::Lps),
            (Self::Ply | Self::Obj | Self::Stl | Self::Glb, None) => Ok(Space::Ras),
        }
    }

    /// The format of a file's name, in upper or lower case; `None` where the ending is another's.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.ending() == ending)
    }
}

/// The format of a file's ending.
pub(super) fn format_of(path: &Path) -> Result<Format, Error> {
    Format::of(path).ok_or_else(|| Error::Format {
        path: path.to_owned(),
        problem: path.extension().map_or_else(
            || "the name has no ending".to_owned(),
            |ending| format!("the ending .{} isn't a mesh format's", ending.to_string_lossy()),
        ),
    })
}
