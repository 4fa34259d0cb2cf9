use ivd_core::srgb;

use super::difference::{from_lab, lab};

/// Colours that any eye tells apart.
pub(super) const DISTINCT: usize = 8;

/// Eight colours of which any two differ by a ΔE₀₀ of at least 21, in normal vision and to people who lack one kind of cone; found by
/// random search for that, with L* of 33 … 97 and a chroma of at most 80. The quiet ones come first: the first two are those of most of what a
/// scan shows. sRGB, 8 bit.
const SAFE: [[u8; 3]; DISTINCT] = [
    [217, 231, 255], // ice
    [183, 148, 155], // dusty rose
    [245, 240, 138], // pale yellow
    [241, 92, 63],   // vermilion
    [45, 148, 255],  // blue
    [102, 55, 146],  // purple
    [79, 93, 90],    // slate
    [154, 31, 0],    // dark red
];

/// How often the eight are dimmed before they turn.
const DIMMED: usize = 4;
/// By how much hues turn after that (degrees): of 104 colours any two differ by a ΔE₀₀ of 3.
const TURN: f64 = 50.0;
/// Chroma with which even grey ones turn.
const LEAST_CHROMA: f64 = 20.0;

/// Colour of a place in the palette for any colour vision, linear RGB in 0…1. From the ninth place on the palette repeats, each time at 0.7 of
/// the brightness; from the 33rd on it begins again with other hues: colours that differ, but no longer by as much.
pub(crate) fn safe(place: usize) -> [f32; 3] {
    let round = place / DISTINCT;
    let dim = 0.7_f32.powi((round % DIMMED) as i32);
    let rgb = SAFE[place % DISTINCT].map(|c| srgb::linear_of_byte(c) * dim);
    let turns = round / DIMMED;
    if turns == 0 {
        return rgb;
    }
    let [l, a, b] = lab(rgb.map(f64::from));
    let (chroma, hue) = (a.hypot(b).max(LEAST_CHROMA), b.atan2(a) + (TURN * turns as f64).to_radians());
    linear([l, chroma * hue.cos(), chroma * hue.sin()])
}

/// Hounsfield values, and the colours that tissue of these has to the eye.
const HOUNSFIELD: [(f64, [u8; 3]); 9] = [
    (-500.0, [214, 164, 160]), // lung, collapsed
    (-150.0, [240, 205, 120]),
    (-60.0, [240, 200, 105]),  // fat
    (0.0, [170, 130, 120]),    // water
    (40.0, [150, 55, 42]),     // muscle
    (130.0, [190, 80, 60]),    // blood with contrast medium
    (300.0, [226, 190, 140]),  // spongy bone
    (700.0, [246, 232, 203]),  // bone
    (1800.0, [255, 253, 247]), // enamel
];

/// Shares of a scan's range, and colours of soft tissue from dark to bright: what is bright in a T1 image is fat.
const SHARES: [(f64, [u8; 3]); 6] = [
    (0.0, [52, 18, 20]),
    (0.2, [112, 42, 36]),
    (0.4, [172, 92, 74]),
    (0.6, [214, 152, 122]),
    (0.8, [240, 208, 160]),
    (1.0, [253, 246, 226]),
];

/// The thesis's figures: yellow, green, blue.
const THESIS: [(f64, [u8; 3]); 5] = [
    (0.0, [255, 244, 120]),
    (0.25, [190, 214, 60]),
    (0.5, [60, 170, 75]),
    (0.75, [30, 120, 160]),
    (1.0, [40, 60, 190]),
];

/// Colour of tissue by its Hounsfield value, in L*, a*, b*.
pub(super) fn of_hounsfield(value: f64) -> [f64; 3] {
    along(&HOUNSFIELD, value)
}

/// Colour of soft tissue by its share of a scan's range, in L*, a*, b*.
pub(super) fn of_share(share: f64) -> [f64; 3] {
    along(&SHARES, share)
}

/// Colour of the thesis's figures by a share of the range, in L*, a*, b*.
pub(super) fn of_thesis(share: f64) -> [f64; 3] {
    along(&THESIS, share)
}

/// Between the colours of a list, in L*, a*, b*.
fn along(list: &[(f64, [u8; 3])], at: f64) -> [f64; 3] {
    let colour = |i: usize| lab(list[i].1.map(|byte| f64::from(srgb::linear_of_byte(byte))));
    let above = list.iter().position(|(place, _)| *place >= at).unwrap_or(list.len() - 1);
    if above == 0 || list[above].0 <= at {
        return colour(above);
    }
    let (low, high) = (list[above - 1].0, list[above].0);
    let (a, b, t) = (colour(above - 1), colour(above), (at - low) / (high - low));
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

/// Linear RGB in 0…1.
pub(super) fn linear(colour: [f64; 3]) -> [f32; 3] {
    from_lab(colour).map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::blindness::{least_difference, seen};
    use crate::colour::difference::ciede2000;

    #[test]
    fn any_two_of_the_safe_colours_are_told_apart_by_everybody() {
        for i in 0..SAFE.len() {
            for j in 0..i {
                let apart = least_difference(&seen(safe(i)), &seen(safe(j)));
                assert!(apart >= 21.0, "{i} and {j}: {apart}");
            }
        }
    }

    #[test]
    fn places_are_distinct_and_in_range() {
        // As many as there are organs in a whole body.
        let all: Vec<_> = (0..104).map(safe).collect();
        let seen = all.iter().map(|rgb| lab(rgb.map(f64::from))).collect::<Vec<_>>();
        for (i, a) in seen.iter().enumerate() {
            assert!(all[i].iter().all(|c| (0.0..=1.0).contains(c)));
            assert!(a[0] > 15.0, "colour {i} is black");
            for (j, b) in seen[..i].iter().enumerate() {
                let apart = ciede2000(*a, *b);
                assert!(apart >= 3.0, "{i} and {j}: {apart}");
            }
        }
    }

    #[test]
    fn lists_are_followed_and_held_at_their_ends() {
        assert_eq!(of_hounsfield(-3000.0), of_hounsfield(-500.0));
        assert_eq!(of_hounsfield(5000.0), of_hounsfield(1800.0));
        let (fat, muscle, bone) = (of_hounsfield(-100.0), of_hounsfield(50.0), of_hounsfield(900.0));
        assert!(fat[2] > 40.0, "fat is yellow");
        assert!(muscle[1] > 30.0 && muscle[0] < 45.0, "muscle is red-brown");
        assert!(bone[0] > 88.0 && bone[1].abs() < 5.0, "bone is ivory");
        assert!(of_share(0.1)[0] < of_share(0.9)[0]);
        assert!(linear(of_thesis(0.5)).iter().all(|c| (0.0..=1.0).contains(c)));
    }
}
