//! Noise of whole numbers: the same on every machine, on every thread and in every order, so that a case can be made again from its
//! number alone.

/// 64 bits without a pattern, of a seed and a position (SplitMix64: Steele, Lea & Flood 2014).
pub fn bits(seed: u64, i: u64) -> u64 {
    fn mix(x: u64) -> u64 {
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    mix(mix(seed.wrapping_add(1).wrapping_mul(STEP)).wrapping_add(i.wrapping_add(1).wrapping_mul(STEP)))
}

/// A whole number below `end`, which must not be 0.
pub fn below(seed: u64, i: u64, end: u64) -> u64 {
    bits(seed, i) % end
}

/// A number in [0, 1), in steps of 2⁻⁵³.
pub fn unit(seed: u64, i: u64) -> f64 {
    (bits(seed, i) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_and_positions_give_evenly_spread_numbers() {
        for (seed, i) in [(0, 1), (1, 0), (7, 3)].map(|(a, b)| (a * 1_000_003, b * 77)) {
            let mean = |number: &dyn Fn(u64) -> f64| (0..10_000).map(number).sum::<f64>() / 1e4;
            assert!((mean(&|n| unit(seed, i + n)) - 0.5).abs() < 0.01);
            assert!((mean(&|n| unit(seed + n, i)) - 0.5).abs() < 0.01);
            assert!((mean(&|n| unit(seed + n, i) * unit(seed + n, i + 1)) - 0.25).abs() < 0.01);
        }
        let mut counts = [0; 7];
        (0..7000).for_each(|n| counts[below(5, n, 7) as usize] += 1);
        assert!(counts.iter().all(|c| (850..1150).contains(c)), "{counts:?}");
        assert_eq!(bits(3, 4), bits(3, 4));
        assert_ne!(bits(3, 4), bits(4, 3));
    }
}
