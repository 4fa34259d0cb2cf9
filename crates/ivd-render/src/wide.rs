//! Direct volume rendering compiled twice: for any processor, and for those with AVX2.
//!
//! The argument for the one `unsafe` block: the wide version needs instructions that not every processor has, and [`Wide`] is only true where
//! they were found at run time. Both are one source, [`dvr::dvr`]; neither contracts multiplication and addition (FMA isn't
//! enabled), so that they give the same bytes.

use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::classify::Classifier;
use crate::dvr;
use crate::samples::Stored;

/// Whether the processor has what the wide version needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Wide(bool);

impl Wide {
    pub(crate) fn detected() -> Self {
        #[cfg(target_arch = "x86_64")]
        return Self(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2"));
        #[cfg(not(target_arch = "x86_64"))]
        Self(false)
    }

    /// The version for any processor.
    #[cfg(test)]
    pub(crate) fn none() -> Self {
        Self(false)
    }
}

/// [`dvr::dvr`] as fast as the processor allows.
#[inline(always)]
pub(crate) fn dvr<T: Stored, const LABELLED: bool, const SHADED: bool>(
    wide: Wide,
    field: &Field<'_, T>,
    classifier: &Classifier,
    termination: f32,
    ray: &Ray,
) -> Cast {
    #[cfg(target_arch = "x86_64")]
    if wide.0 {
        // SAFETY: the features were found.
        return unsafe { with_avx2::<T, LABELLED, SHADED>(field, classifier, termination, ray) };
    }
    for_any::<T, LABELLED, SHADED>(field, classifier, termination, ray)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi2")]
fn with_avx2<T: Stored, const LABELLED: bool, const SHADED: bool>(
    field: &Field<'_, T>,
    classifier: &Classifier,
    termination: f32,
    ray: &Ray,
) -> Cast {
    dvr::dvr::<T, LABELLED, SHADED>(field, classifier, termination, ray)
}

#[inline(never)]
fn for_any<T: Stored, const LABELLED: bool, const SHADED: bool>(
    field: &Field<'_, T>,
    classifier: &Classifier,
    termination: f32,
    ray: &Ray,
) -> Cast {
    dvr::dvr::<T, LABELLED, SHADED>(field, classifier, termination, ray)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::light::Light;
    use crate::samples::{Samples, Shape};
    use crate::space::Space;
    use crate::{RenderParams, View};
    use ivd_core::{Grid, TransferFunction};

    #[test]
    fn both_versions_give_the_same_bytes() {
        let grid = Grid::with_spacing([33, 29, 31], [1.0, 0.9, 1.1]).unwrap();
        let voxels: Vec<u16> =
            (0..grid.len() as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 18) as u16).collect();
        let view = View { azimuth_deg: 31.0, elevation_deg: 12.0, ..View::default() };
        let camera =
            Camera::new(&grid, &RenderParams { view, width: 40, height: 40, ..RenderParams::default() });
        let table = (0..64).map(|i| [0.1, 0.5, 0.9, i as f32 / 500.0]).collect();
        let transfer = TransferFunction::new([0.0, 16384.0], 64, 1.0, vec![0], table, vec![]).unwrap();
        let classifier = Classifier::new(&transfer, [0.0, 16384.0], |v| v, 0.5, false);
        let shape = Shape::new(grid.dims());
        let field = Field {
            samples: Samples::new(&voxels, shape),
            ids: &[],
            warp: None,
            space: &Space::full(shape),
            cells: &[],
            light: Light::new(&camera, grid.inverse_linear_part(), 1.0),
        };
        for ray in (0..1600).filter_map(|i| camera.ray(i % 40, i / 40)) {
            let any = dvr::<u16, false, true>(Wide::none(), &field, &classifier, 0.99, &ray);
            let wide = dvr::<u16, false, true>(Wide::detected(), &field, &classifier, 0.99, &ray);
            assert_eq!(any.rgba.map(f32::to_bits), wide.rgba.map(f32::to_bits));
            assert_eq!(any.taken, wide.taken);
        }
    }
}
