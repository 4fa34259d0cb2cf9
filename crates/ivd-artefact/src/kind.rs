use ivd_core::Kind;

use crate::kinds::{displacement, image, labels, lattice, mask, motion, octree, transfer, tree, volume};

/// Code in the prelude, and newest version that this crate writes and reads, of each kind. Codes are never reused.
const TABLE: [(Kind, u16, u16); 10] = [
    (Kind::Volume, 1, volume::VERSION),
    (Kind::Labels, 2, labels::VERSION),
    (Kind::Mask, 3, mask::VERSION),
    (Kind::Transfer, 4, transfer::VERSION),
    (Kind::Lattice, 5, lattice::VERSION),
    (Kind::Octree, 6, octree::VERSION),
    (Kind::Motion, 7, motion::VERSION),
    (Kind::Displacement, 8, displacement::VERSION),
    (Kind::Image, 9, image::VERSION),
    (Kind::Tree, 10, tree::VERSION),
];

/// How a kind is written in a file.
pub trait KindCode: Sized {
    /// Code in the prelude.
    fn code(self) -> u16;
    /// Newest version of its sections and metadata that this crate writes. A value that an older one holds is written as that.
    fn version(self) -> u16;
    /// The kind of a code.
    fn from_code(code: u16) -> Option<Self>;
}

impl KindCode for Kind {
    fn code(self) -> u16 {
        TABLE[self as usize].1
    }

    fn version(self) -> u16 {
        TABLE[self as usize].2
    }

    fn from_code(code: u16) -> Option<Self> {
        TABLE.iter().find(|row| row.1 == code).map(|row| row.0)
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
        }
        assert_eq!(Kind::from_code(0), None);
    }

    #[test]
    fn the_page_of_bytes_has_every_kind_and_version() {
        let page = include_str!("../../../docs/artefacts.md");
        for kind in Kind::ALL {
            let versions: Vec<String> = (1..=kind.version()).map(|version| version.to_string()).collect();
            let row = format!("| {} | {kind} {} |", kind.code(), versions.join(", "));
            assert!(page.contains(&row), "docs/artefacts.md has no row that begins with `{row}`");
        }
    }
}
