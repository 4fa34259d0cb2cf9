use std::fmt;
use std::str::FromStr;

/// What an artefact holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// A scalar volume with its brick min–max index.
    Volume,
    /// A label for every voxel, and the classes.
    Labels,
    /// A part of a volume, with an optional level function.
    Mask,
    /// A transfer function.
    Transfer,
    /// A model-fitting lattice.
    Lattice,
    /// A linear octree over a lattice's grid.
    Octree,
    /// Displacements of a lattice's vertices, one or many frames.
    Motion,
    /// A sparse deformation of space, forward and inverse.
    Displacement,
    /// A picture.
    Image,
    /// A tree of merges over a volume's voxels.
    Tree,
}

/// Code in the prelude, newest version that this crate writes and reads, and name of each kind. Codes are never reused.
const TABLE: [(Kind, u16, u16, &str); 10] = [
    (Kind::Volume, 1, 1, "volume"),
    (Kind::Labels, 2, 1, "labels"),
    (Kind::Mask, 3, 1, "mask"),
    (Kind::Transfer, 4, 1, "transfer"),
    (Kind::Lattice, 5, 1, "lattice"),
    (Kind::Octree, 6, 1, "octree"),
    (Kind::Motion, 7, 1, "motion"),
    (Kind::Displacement, 8, 1, "displacement"),
    (Kind::Image, 9, 1, "image"),
    (Kind::Tree, 10, 1, "tree"),
];

impl Kind {
    /// Every kind, in the order of their codes.
    pub const ALL: [Self; 10] = [
        Self::Volume,
        Self::Labels,
        Self::Mask,
        Self::Transfer,
        Self::Lattice,
        Self::Octree,
        Self::Motion,
        Self::Displacement,
        Self::Image,
        Self::Tree,
    ];

    fn row(self) -> (Self, u16, u16, &'static str) {
        TABLE[self as usize]
    }

    /// Name as in a file's ending or a report: `volume`, `labels`, …
    pub fn name(self) -> &'static str {
        self.row().3
    }

    /// Code in the prelude.
    pub fn code(self) -> u16 {
        self.row().1
    }

    /// Version of its sections and metadata that this crate writes.
    pub fn version(self) -> u16 {
        self.row().2
    }

    /// The kind of a code.
    pub fn from_code(code: u16) -> Option<Self> {
        TABLE.iter().find(|row| row.1 == code).map(|row| row.0)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Kind {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|k| k.name() == name)
            .ok_or_else(|| format!("`{name}` is no artefact kind"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_lists_every_kind_at_its_own_row() {
        for (i, kind) in Kind::ALL.into_iter().enumerate() {
            assert_eq!(TABLE[i].0, kind);
            assert_eq!(Kind::from_code(kind.code()), Some(kind));
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        assert_eq!(Kind::from_code(0), None);
    }
}
