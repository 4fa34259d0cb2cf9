//! Pictures.

use ivd_render::{Radiance, RenderParams, Rendered};

use super::Verdict;
use crate::hold;

/// Room for the rounding of a ray's few hundred additions in `f32`.
const SLACK: f32 = 1e-4;

/// Linear light: of the size asked for, finite, opacity in 0…1, no colour above its opacity.
///
/// # Errors
/// The first pixel that doesn't fit.
pub fn light(params: &RenderParams, found: &Radiance) -> Verdict {
    hold!(found.rgba.len() == params.size[0] * params.size[1], "{} pixels", found.rgba.len());
    for (i, pixel) in found.rgba.iter().enumerate() {
        let alpha = pixel[3];
        let within = |c: &f32| c.is_finite() && (0.0..=alpha + SLACK).contains(c);
        hold!(alpha <= 1.0 + SLACK && pixel.iter().all(within), "pixel {i} is {pixel:?}");
    }
    Ok(())
}

/// A picture: of the size asked for, its counters finite.
///
/// # Errors
/// The first thing that doesn't fit.
pub fn picture(params: &RenderParams, found: &Rendered) -> Verdict {
    let size = [found.image.width(), found.image.height()];
    hold!(size == params.size, "a picture of {size:?}");
    hold!((0.0..=1.0).contains(&found.skipped_fraction), "skipped {}", found.skipped_fraction);
    hold!(found.samples_per_pixel.is_finite(), "samples a pixel {}", found.samples_per_pixel);
    Ok(())
}

/// Two ways to the same picture give the same bits.
///
/// # Errors
/// The first pixel that differs.
pub fn same(a: &Radiance, b: &Radiance) -> Verdict {
    let differs = a.rgba.iter().zip(&b.rgba).position(|(p, q)| p.map(f32::to_bits) != q.map(f32::to_bits));
    match differs {
        Some(i) => Err(format!(
            "pixel {i} is {:?} with empty bricks passed over, {:?} without",
            a.rgba[i], b.rgba[i]
        )),
        None => Ok(()),
    }
}
