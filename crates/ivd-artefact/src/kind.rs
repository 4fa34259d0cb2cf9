use ivd_core::Kind;

/// Code in the prelude, and newest version that this crate writes and reads, of each kind. Codes are never reused.
const TABLE: [(Kind, u16, u16); 10] = [
    (Kind::Volume, 1, 2),
    (Kind::Labels, 2, 1),
    (Kind::Mask, 3, 1),
    (Kind::Transfer, 4, 3),
    (Kind::Lattice, 5, 1),
    (Kind::Octree, 6, 1),
    (Kind::Motion, 7, 2),
    (Kind::Displacement, 8, 1),
    (Kind::Image, 9, 2),
    (Kind::Tree, 10, 1),
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
}
