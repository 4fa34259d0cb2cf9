//! Morton codes: the bits of x, y and z in turn, x lowest (Morton 1966).

/// The code of a cell, each coordinate below 2²¹.
pub(super) fn encode(cell: [u32; 3]) -> u64 {
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

/// The cell of a code.
pub(super) fn decode(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

/// Moves bit i to bit 3 i.
fn spread(value: u32) -> u64 {
    let mut v = u64::from(value) & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Moves bit 3 i to bit i.
fn gather(code: u64) -> u32 {
    let mut v = code & 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    ((v | v >> 32) & 0x1f_ffff) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_interleave_bits_one_by_one_and_decode() {
        for cell in [[0, 0, 0], [1, 2, 4], [0x1f_ffff, 0, 0x1f_ffff], [0x15_5555, 0x0a_aaaa, 0x12_3456]] {
            let plain = (0..21).fold(0_u64, |code, bit| {
                (0..3).fold(code, |code, a| code | u64::from(cell[a] >> bit & 1) << (3 * bit + a))
            });
            assert_eq!(encode(cell), plain);
            assert_eq!(decode(plain), cell);
        }
    }
}
