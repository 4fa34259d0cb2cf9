use ivd_core::srgb;

/// Eight colours that people with any kind of colour blindness can tell apart (after Okabe and Ito 2008), sRGB 8 bit,
/// in an order that gives neighbours in intensity strongly different hues.
const PALETTE: [[u8; 3]; 8] = [
    [0x56, 0xB4, 0xE9], // sky blue
    [0xD5, 0x5E, 0x00], // vermilion
    [0xF0, 0xE4, 0x42], // yellow
    [0x00, 0x9E, 0x73], // bluish green
    [0xCC, 0x79, 0xA7], // reddish purple
    [0xE6, 0x9F, 0x00], // orange
    [0x00, 0x72, 0xB2], // blue
    [0xF2, 0xF2, 0xF2], // near white
];

/// Colour of the class of rank `rank` in the order of means (air apart), linear RGB in 0…1. From the ninth class on the
/// palette repeats, each time at 0.7 of the brightness.
pub fn colour(rank: usize) -> [f32; 3] {
    let dim = 0.7_f32.powi((rank / PALETTE.len()).min(8) as i32);
    PALETTE[rank % PALETTE.len()].map(|c| srgb::linear_of_byte(c) * dim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_stable_distinct_and_in_range() {
        let all: Vec<_> = (0..24).map(colour).collect();
        for (i, a) in all.iter().enumerate() {
            assert!(a.iter().all(|c| (0.0..=1.0).contains(c)));
            assert!(all[..i].iter().all(|b| a != b), "colour {i} occurs twice");
        }
    }
}
