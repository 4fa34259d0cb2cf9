use std::path::Path;

use super::Error;

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
