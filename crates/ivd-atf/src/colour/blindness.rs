//! Colours as people see them who lack one kind of cone (Machado, Oliveira & Fernandes 2009, severity 1), over linear RGB.

use super::difference::{apply, ciede2000, lab};

/// Normal vision, protanopia, deuteranopia, tritanopia.
pub(super) const VISIONS: [[[f64; 3]; 3]; 4] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152_286, 1.052_583, -0.204_868],
        [0.114_503, 0.786_281, 0.099_216],
        [-0.003_882, -0.048_116, 1.051_998],
    ],
    [
        [0.367_322, 0.860_646, -0.227_968],
        [0.280_085, 0.672_501, 0.047_413],
        [-0.011_820, 0.042_940, 0.968_881],
    ],
    [
        [1.255_528, -0.076_749, -0.178_779],
        [-0.078_411, 0.930_809, 0.147_602],
        [0.004_733, 0.691_367, 0.303_900],
    ],
];

/// A colour (linear RGB) to each of the visions, in L*, a*, b*.
pub(super) fn seen(rgb: [f32; 3]) -> [[f64; 3]; 4] {
    VISIONS.each_ref().map(|vision| lab(apply(vision, rgb.map(f64::from)).map(|c| c.clamp(0.0, 1.0))))
}

/// Least ΔE₀₀ over the visions of two colours that [`seen`] gave.
pub(super) fn least_difference(a: &[[f64; 3]; 4], b: &[[f64; 3]; 4]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| ciede2000(a, b)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_stays_grey_and_red_meets_green_for_those_who_lack_either_cone() {
        for vision in &VISIONS {
            let found = apply(vision, [0.5; 3]);
            assert!(found.iter().all(|c| (c - 0.5).abs() < 1e-5), "{found:?}");
        }
        // Of the published matrix: pure red to a protanope.
        assert_eq!(apply(&VISIONS[1], [1.0, 0.0, 0.0]), [0.152_286, 0.114_503, -0.003_882]);
        let (red, green) = ([0.5, 0.1, 0.05], [0.13, 0.2, 0.05]);
        let wide = ciede2000(lab(red), lab(green));
        assert!(least_difference(&seen(red.map(|c| c as f32)), &seen(green.map(|c| c as f32))) < 0.5 * wide);
    }
}
