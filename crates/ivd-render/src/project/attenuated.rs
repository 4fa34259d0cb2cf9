use super::Project;

/// The greatest grey, where what lies in front of a sample dims it: attenuated maximum intensity projection.
///
/// With the grey `g` of a value, 0…1 over the window, a sample counts for
///
/// ```text
/// g · exp(−attenuation · (∫ g ds from the ray's start to the sample's middle) / reference length)
/// ```
pub(crate) struct Attenuated {
    /// What makes a value grey: `g = (value − low) · scale + bias`, brought into 0…1.
    pub(crate) low: f32,
    pub(crate) scale: f32,
    pub(crate) bias: f32,
    /// What a step of white adds to the exponent.
    pub(crate) of_step: f32,
}

/// Room for the rounding of [`decay`], which isn't monotone in its last bits.
pub(crate) const ROUNDED: f32 = 1.0 + 1e-5;

/// What is known on the way.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Dimmed {
    /// The greatest grey as it is dimmed; −∞ before there is data.
    greatest: f32,
    /// Steps of white that lie before.
    before: f32,
}

impl Attenuated {
    /// Comparisons rather than `clamp`: what is no number is black.
    #[inline(always)]
    fn grey(&self, value: f32) -> f32 {
        let grey = (value - self.low) * self.scale + self.bias;
        let grey = if grey > 0.0 { grey } else { 0.0 };
        if grey < 1.0 { grey } else { 1.0 }
    }
}

impl Project for Attenuated {
    type Seen = Dimmed;

    fn nothing(&self) -> Dimmed {
        Dimmed { greatest: f32::NEG_INFINITY, before: 0.0 }
    }

    #[inline(always)]
    fn take(&self, seen: &mut Dimmed, value: Option<f32>, steps: f32) {
        let Some(value) = value else { return };
        let grey = self.grey(value);
        let own = grey * steps;
        // What isn't brighter before it is dimmed isn't afterwards.
        if grey > seen.greatest {
            let dimmed = grey * decay(self.of_step * (seen.before + 0.5 * own));
            seen.greatest = seen.greatest.max(dimmed);
        }
        seen.before += own;
    }

    #[inline(always)]
    fn is_settled(&self, _: &Dimmed) -> bool {
        false
    }

    /// What is black adds nothing; behind what dims white below the greatest nothing does.
    #[inline(always)]
    fn passes(&self, seen: &Dimmed, bound: f32) -> bool {
        let is_black = self.grey(bound) <= 0.0 && seen.greatest >= 0.0;
        is_black || decay(self.of_step * seen.before) * ROUNDED < seen.greatest
    }

    fn shown(&self, seen: &Dimmed) -> f32 {
        seen.greatest
    }
}

/// Coefficients of the exponential, from the highest power on.
pub(crate) const SERIES: [f32; 7] = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0];
/// Beyond it the exponential is no normal number.
pub(crate) const FARTHEST: f32 = 87.0;

/// `exp(−x)` for x ≥ 0, to 10⁻⁵ of itself, by operations that lanes have too: a power of two times the series of what is left.
#[inline(always)]
fn decay(x: f32) -> f32 {
    let power = (if x < FARTHEST { x } else { FARTHEST }) * -std::f32::consts::LOG2_E;
    let whole = (power - 0.5) as i32;
    let left = (power - whole as f32) * std::f32::consts::LN_2;
    let series = SERIES.into_iter().reduce(|sum, next| sum * left + next).expect("seven terms");
    series * f32::from_bits(((whole + 127) << 23) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_met_from_no_dimming_to_black() {
        assert_eq!(decay(0.0), 1.0);
        for i in 0..870_000 {
            let x = i as f32 * 1e-4;
            let truth = (-f64::from(x)).exp();
            let error = (f64::from(decay(x)) - truth).abs() / truth;
            assert!(error < 1e-5, "{error} at {x}");
        }
        assert!(decay(f32::INFINITY) < 1e-37 && decay(1e9) < 1e-37);
    }
}
