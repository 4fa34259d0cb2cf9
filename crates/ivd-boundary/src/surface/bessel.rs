//! Modified Bessel functions of the first kind, as Rice's distribution needs them.

/// ln(I₀(x) e^(−x)), within 2e-7 (Abramowitz & Stegun 9.8.1, 9.8.2).
pub(super) fn ln_scaled_bessel(x: f64) -> f64 {
    if x < 3.75 {
        let t = (x / 3.75).powi(2);
        let i0 = [0.004_581_3, 0.036_076_8, 0.265_973_2, 1.206_749_2, 3.089_942_4, 3.515_622_9, 1.0];
        return i0.iter().fold(0.0, |sum, c| sum * t + c).ln() - x;
    }
    let t = 3.75 / x;
    let series = [
        0.003_923_77,
        -0.016_476_33,
        0.026_355_37,
        -0.020_577_06,
        0.009_162_81,
        -0.001_575_65,
        0.002_253_19,
        0.013_285_92,
        0.398_942_28,
    ];
    (series.iter().fold(0.0, |sum, c| sum * t + c) / x.sqrt()).ln()
}

/// I₁(x) e^(−x) (Abramowitz & Stegun 9.8.3, 9.8.4).
pub(super) fn scaled_bessel_1(x: f64) -> f64 {
    if x < 3.75 {
        let t = (x / 3.75).powi(2);
        let i1 = [0.000_324_11, 0.003_015_32, 0.026_587_33, 0.150_849_34, 0.514_988_69, 0.878_905_94, 0.5];
        return x * i1.iter().fold(0.0, |sum, c| sum * t + c) * (-x).exp();
    }
    let t = 3.75 / x;
    let series = [
        -0.004_200_59,
        0.017_876_54,
        -0.028_953_12,
        0.022_829_67,
        -0.010_315_55,
        0.001_638_01,
        -0.003_620_18,
        -0.039_880_24,
        0.398_942_28,
    ];
    series.iter().fold(0.0, |sum, c| sum * t + c) / x.sqrt()
}

/// I₁(x) / I₀(x).
pub(super) fn bessel_ratio(x: f64) -> f64 {
    scaled_bessel_1(x) / ln_scaled_bessel(x).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_tables_come_out_on_either_side_of_where_the_series_meet() {
        // I₀(x) and I₁(x) (Abramowitz & Stegun, tables 9.8 and 9.11).
        for (x, zero, one) in [
            (0.0, 1.0, 0.0),
            (1.0, 1.266_065_878, 0.565_159_104),
            (3.0, 4.880_792_586, 3.953_370_217),
            (5.0, 27.239_871_82, 24.335_642_14),
            (10.0, 2_815.716_628, 2_670.988_304),
        ] {
            assert!((ln_scaled_bessel(x) - (f64::ln(zero) - x)).abs() < 3e-7, "{x}");
            assert!((bessel_ratio(x) - one / zero).abs() < 3e-7, "{x}");
        }
        // For large x the ratio is 1 − 1/(2x).
        assert!((bessel_ratio(1e5) - (1.0 - 0.5e-5)).abs() < 1e-6);
    }
}
