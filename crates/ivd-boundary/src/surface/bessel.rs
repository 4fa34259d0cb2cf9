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
