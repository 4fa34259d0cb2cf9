//! sRGB components and linear light (IEC 61966-2-1), both in 0…1.

use nalgebra::{RealField, convert};

/// Linear light of an sRGB component, in single or double precision.
pub fn linear<F: RealField + Copy>(encoded: F) -> F {
    let number = convert::<f64, F>;
    if encoded <= number(0.040_45) {
        encoded / number(12.92)
    } else {
        ((encoded + number(0.055)) / number(1.055)).powf(number(2.4))
    }
}

/// Linear light of an sRGB byte.
pub fn linear_of_byte(byte: u8) -> f32 {
    linear(f64::from(byte) / 255.0) as f32
}

/// sRGB component of linear light.
pub fn encoded(light: f64) -> f64 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// Byte of an sRGB component of linear light; light below 0 or above 1 is taken as 0 or 1.
pub fn byte(linear: f32) -> u8 {
    (encoded(f64::from(linear).clamp(0.0, 1.0)) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_inverts_decoding_for_every_byte() {
        assert!((0..=255).all(|b| byte(linear_of_byte(b)) == b));
        assert_eq!([0, 255].map(linear_of_byte), [0.0, 1.0]);
        assert_eq!([-1.0, 0.214, 7.0].map(byte), [0, 127, 255]);
    }
}
