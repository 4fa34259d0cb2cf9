//! The exponential from additions and multiplications alone: the same bits on every machine, many at a time.

/// Rounds to an integer in its low bits when added: 1.5 · 2⁵².
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts; the first has trailing zeros, so that its product with an exponent is exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
/// Below this the result would leave the normal numbers.
const LEAST: f64 = -708.0;

/// `eˣ` for `x` up to 709, to 2 units in the last place; below -708 it stays at e⁻⁷⁰⁸ ≈ 3e-308.
///
/// `x = n ln 2 + r`; the series of `eʳ` up to `r¹³`, which is 4e-18 off at most; `n` goes into the exponent's bits.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    let x = if x < LEAST { LEAST } else { x };
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN_2[0]) - n * LN_2[1];
    let mut sum = 1.0 / 6_227_020_800.0;
    for inverse in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        sum = sum * r + inverse;
    }
    f64::from_bits(sum.to_bits().wrapping_add(shifted.to_bits() << 52))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential_to_its_last_digits() {
        for i in 0..200_000 {
            let x = -707.9 + f64::from(i) * 0.007_08;
            let expected = x.exp();
            assert!((exp(x) - expected).abs() <= 4.5e-16 * expected, "{x}: {} {expected}", exp(x));
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f64::NEG_INFINITY), exp(-708.0));
        assert!(exp(-1e300) < 1e-307);
    }
}
