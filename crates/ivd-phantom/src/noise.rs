//! Rician noise from a counter: every voxel has its own numbers, whoever computes it.

use std::f64::consts::TAU;

/// Magnitude of `value` plus a complex Gaussian of standard deviation `sd` in each part: what an MR magnitude image shows
/// (Gudbjartsson & Patz 1995).
pub(super) fn rician(value: f64, sd: f64, seed: u64, counter: u64) -> f64 {
    let (a, b) = gaussian_pair(seed, counter);
    (value + sd * a).hypot(sd * b)
}

/// Two independent standard normal numbers (Box & Muller 1958) that depend on seed and counter alone.
fn gaussian_pair(seed: u64, counter: u64) -> (f64, f64) {
    let key = mix(seed ^ 0x9e37_79b9_7f4a_7c15);
    let first = mix(key ^ counter.wrapping_mul(2).wrapping_add(1));
    let second = mix(first ^ key.rotate_left(32));
    let radius = (-2.0 * open_unit(first).ln()).sqrt();
    let (sin, cos) = (TAU * open_unit(second)).sin_cos();
    (radius * cos, radius * sin)
}

/// A number in (0, 1] from the upper 53 bits.
fn open_unit(bits: u64) -> f64 {
    ((bits >> 11) + 1) as f64 / (1_u64 << 53) as f64
}

/// Bijective scrambling of 64 bits: the finaliser of SplitMix64 (Steele, Lea & Flood 2014), twice.
fn mix(x: u64) -> u64 {
    let once = |x: u64| {
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    };
    once(once(x.wrapping_add(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x9e37_79b9_7f4a_7c15))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_standard_normal_and_uncorrelated_with_their_neighbours() {
        let n = 200_000;
        let numbers: Vec<f64> = (0..n)
            .flat_map(|i| {
                let (a, b) = gaussian_pair(7, i);
                [a, b]
            })
            .collect();
        let count = numbers.len() as f64;
        let moment = |k: i32| numbers.iter().map(|v| v.powi(k)).sum::<f64>() / count;
        assert!(moment(1).abs() < 0.006, "mean {}", moment(1));
        assert!((moment(2) - 1.0).abs() < 0.01, "variance {}", moment(2));
        assert!(moment(3).abs() < 0.03, "skewness {}", moment(3));
        assert!((moment(4) - 3.0).abs() < 0.06, "kurtosis {}", moment(4));
        for lag in [1, 2, 3, 256] {
            let r = numbers.windows(lag + 1).map(|w| w[0] * w[lag]).sum::<f64>() / count;
            assert!(r.abs() < 0.007, "correlation {r} at lag {lag}");
        }
    }

    #[test]
    fn seeds_give_different_noise_and_extremes_stay_finite() {
        assert_ne!(gaussian_pair(1, 5), gaussian_pair(2, 5));
        assert!(open_unit(0) > 0.0 && open_unit(u64::MAX) == 1.0);
        assert!(rician(0.5, 1e3, u64::MAX, u64::MAX).is_finite());
    }
}
