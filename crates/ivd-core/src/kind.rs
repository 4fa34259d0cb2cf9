use std::fmt;
use std::str::FromStr;

/// What a value is: each type that stages hand on has one.
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

/// The name of each kind, in the order of the enumeration.
const NAMES: [(Kind, &str); 10] = [
    (Kind::Volume, "volume"),
    (Kind::Labels, "labels"),
    (Kind::Mask, "mask"),
    (Kind::Transfer, "transfer"),
    (Kind::Lattice, "lattice"),
    (Kind::Octree, "octree"),
    (Kind::Motion, "motion"),
    (Kind::Displacement, "displacement"),
    (Kind::Image, "image"),
    (Kind::Tree, "tree"),
];

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 10] = {
        let mut all = [Self::Volume; 10];
        let mut n = 0;
        while n < all.len() {
            all[n] = NAMES[n].0;
            n += 1;
        }
        all
    };

    /// Name as in a file's ending or a report: `volume`, `labels`, …
    pub fn name(self) -> &'static str {
        NAMES[self as usize].1
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
    fn the_names_list_every_kind_at_its_own_row() {
        for (i, kind) in Kind::ALL.into_iter().enumerate() {
            assert_eq!(kind as usize, i);
            assert_eq!(kind.name().parse(), Ok(kind));
        }
    }
}
