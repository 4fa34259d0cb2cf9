use serde::{Deserialize, Serialize};

/// Order of a number's bytes in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Least significant byte first.
    #[default]
    Little,
    /// Most significant byte first.
    Big,
}

impl ByteOrder {
    /// The order of the machine that runs this.
    pub const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };

    /// Whether numbers in this order must be swapped to be used here.
    pub(crate) fn is_foreign(self) -> bool {
        self != Self::NATIVE
    }
}

/// Reverses the bytes of every number of `width` bytes in place. `bytes` is a whole number of them.
pub(crate) fn swap_in_place(bytes: &mut [u8], width: usize) {
    match width {
        2 => bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|b| b.reverse()),
        4 => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(|b| b.reverse()),
        8 => bytes.as_chunks_mut::<8>().0.iter_mut().for_each(|b| b.reverse()),
        _ => debug_assert_eq!(width, 1, "voxels are 1, 2, 4 or 8 bytes wide"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_width_is_reversed_number_by_number() {
        let mut bytes = [1, 2, 3, 4, 5, 6, 7, 8];
        swap_in_place(&mut bytes, 1);
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6, 7, 8]);
        swap_in_place(&mut bytes, 2);
        assert_eq!(bytes, [2, 1, 4, 3, 6, 5, 8, 7]);
        swap_in_place(&mut bytes, 4);
        assert_eq!(bytes, [3, 4, 1, 2, 7, 8, 5, 6]);
        swap_in_place(&mut bytes, 8);
        assert_eq!(bytes, [6, 5, 8, 7, 2, 1, 4, 3]);
    }
}
