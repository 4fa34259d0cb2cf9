//! Rays as fast as the processor allows: eight rays at a time where there is AVX2, else one by one.
//!
//! The argument for the `unsafe` blocks: packets need AVX2, which not every processor has, and [`Wide`] is only true where it was
//! found at run time.

use crate::camera::Ray;
use crate::cast::{self, Cast, Field};
use crate::dvr;
#[cfg(not(target_arch = "x86_64"))]
use crate::dvr::Optics as Looks;
use crate::frame::{LANES, Packet, one_by_one};
#[cfg(target_arch = "x86_64")]
use crate::packet;
#[cfg(not(target_arch = "x86_64"))]
use crate::project::Project as ProjectLanes;
use crate::project::{self, Bounds};
#[cfg(not(target_arch = "x86_64"))]
use crate::samples::Stored as Pairs;
#[cfg(target_arch = "x86_64")]
pub(crate) use packet::{Looks, Pairs, ProjectLanes};

/// Whether packets serve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Wide(bool);

impl Wide {
    /// For a grid on this processor, if `simd` may be used.
    pub(crate) fn detected(dims: [usize; 3], simd: bool) -> Self {
        #[cfg(target_arch = "x86_64")]
        return Self(simd && packet::serves(dims) && is_x86_feature_detected!("avx2"));
        #[cfg(not(target_arch = "x86_64"))]
        {
            let _ = (dims, simd);
            Self(false)
        }
    }

    /// The version for any processor.
    #[cfg(test)]
    pub(crate) fn none() -> Self {
        Self(false)
    }
}

/// [`dvr::dvr`] of each ray of a packet.
#[inline(always)]
pub(crate) fn dvr<T: Pairs, L: Looks<T>>(
    wide: Wide,
    field: &Field<'_, T>,
    looks: &L,
    termination: f32,
    rays: &Packet,
) -> [Cast; LANES] {
    #[cfg(target_arch = "x86_64")]
    if wide.0 && packet::serves_rays(rays) {
        // SAFETY: AVX2 was found.
        return unsafe { packet::dvr(field, looks, termination, rays) };
    }
    let _ = wide;
    one_by_one(rays, |ray| dvr::dvr(field, looks, termination, ray))
}

/// [`project::project`] of each ray of a packet.
#[inline(always)]
pub(crate) fn project<T: Pairs, P: ProjectLanes>(
    wide: Wide,
    field: &Field<'_, T>,
    projection: &P,
    bounds: &Bounds,
    sign: f32,
    skip: bool,
    rays: &Packet,
) -> [(f32, Cast); LANES] {
    #[cfg(target_arch = "x86_64")]
    if wide.0 && packet::serves_rays(rays) {
        // SAFETY: AVX2 was found.
        return unsafe { packet::project(field, projection, bounds, sign, skip, rays) };
    }
    let _ = wide;
    let nothing = (f32::NEG_INFINITY, Cast::default());
    let bounds = &bounds.of_bricks;
    let alone = |ray: &Ray| project::project(field, projection, bounds, sign, skip, ray);
    std::array::from_fn(|lane| rays[lane].as_ref().map_or(nothing, alone))
}

/// [`cast::first_hit`] of each ray of a packet.
#[inline(always)]
pub(crate) fn first_hit<T: Pairs>(
    wide: Wide,
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    surface: [f32; 3],
    rays: &Packet,
) -> [Cast; LANES] {
    #[cfg(target_arch = "x86_64")]
    if wide.0 && packet::serves_rays(rays) {
        // SAFETY: AVX2 was found.
        return unsafe { packet::first_hit(field, iso, sign, surface, rays) };
    }
    let _ = wide;
    one_by_one(rays, |ray| cast::first_hit(field, iso, sign, surface, ray))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::classify::{Classifier, Rows};
    use crate::dvr::AtMiddle;
    use crate::empty_space::Space;
    use crate::fit::Held;
    use crate::light::Light;
    use crate::preintegrated::{AtEnds, Preintegrated};
    use crate::project::{Attenuated, FirstPeak, Greatest, Mean};
    use crate::samples::{Samples, Shape};
    use crate::warp::Warp;
    use crate::{Projection, RenderParams, View};
    use ivd_core::{
        Displacement, Exec, FieldBricks, GradientTable, Grid, NO_BRICK, Scalar, TransferFunction, Volume,
    };

    const DIMS: [usize; 3] = [33, 29, 41];

    /// Hills above a plain of noise, with a pit of missing data where the type can hold it.
    fn voxels<T: Scalar>(dims: [usize; 3], scale: f64) -> Vec<T> {
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let value = |i: usize| {
            let [x, y, z] = grid.index(i).0.map(|c| c as f64 * 0.31);
            let noise = f64::from((i as u32).wrapping_mul(2_654_435_761) >> 24) / 256.0;
            let hills = (x.sin() * y.cos() * z.sin()).max(0.0);
            if i.is_multiple_of(997) { f64::NAN } else { scale * (0.2 * noise + 0.8 * hills) }
        };
        (0..grid.len()).map(|i| T::from_f64(value(i))).collect()
    }

    /// Places that come from up to two voxels away in every third brick, and some that are left empty.
    fn shifted(grid: &Grid) -> Displacement {
        let dims = grid.dims();
        let bricks: usize = dims.map(|n| n.div_ceil(FieldBricks::SIDE)).iter().product();
        let (mut table, mut vectors) = (vec![NO_BRICK; bricks], Vec::new());
        for b in (0..bricks).step_by(3) {
            table[b] = (vectors.len() / FieldBricks::VOXELS) as u32;
            vectors.extend(
                (0..FieldBricks::VOXELS).map(|v| [1.9, -0.3, 0.8].map(|c: f32| c * (v as f32).sin())),
            );
        }
        let inverse = FieldBricks::new(dims, table, vectors.into()).unwrap();
        let vacated: Vec<_> = (0..grid.len()).map(|i| u8::from(i.is_multiple_of(211))).collect();
        let moved = Displacement::new(grid.clone(), FieldBricks::zero(dims), inverse).unwrap();
        moved.with_vacated(vacated.into()).unwrap()
    }

    /// Every ray of a picture, cast in packets and one by one: with what is clear passed over or not, and moved.
    fn both_ways<T: Pairs, const LABELLED: bool, const SHADED: bool>(
        dims: [usize; 3],
        scale: f64,
        opacity: f32,
        view: View,
    ) {
        let grid = Grid::with_spacing(dims, [1.0, 0.9, 1.1]).unwrap();
        let voxels: Vec<T> = voxels(dims, scale);
        let ids: Vec<u16> = (0..grid.len()).map(|i| (i / 500 % 3) as u16).collect();
        let camera = Camera::new(
            &grid,
            &RenderParams { view, size: [24, 20], ..RenderParams::default() },
            &Held::Volume,
        );
        let row = |low: usize| {
            (0..64).map(move |i| [0.1, 0.5, 0.9, if i < low { 0.0 } else { opacity * i as f32 / 64.0 }])
        };
        let table = row(20).chain(row(25)).collect();
        let transfer = TransferFunction::new([0.0, scale], 64, 1.0, vec![0, 2], table, vec![]).unwrap();
        let classifier = Classifier::new(
            &transfer,
            [0.0, scale as f32],
            |v| v,
            0.5,
            if LABELLED { Rows::Labelled } else { Rows::Union },
        );
        // What is seen at a value is seen at some gradients.
        let by = (0..64 * 16).map(|i| transfer.table()[i % 64].map(|c| c * ((i / 64) % 3) as f32 / 2.0));
        let by = GradientTable::new(0.2 * scale, [64, 16], by.collect()).unwrap();
        let steep = transfer.clone().with_gradient(by);
        let steep = Classifier::new(&steep, [0.0, scale as f32], |v| v, 0.5, Rows::Union);
        let table = Preintegrated::new(&transfer, [0.0, scale as f32], |v| v, 0.5, &Exec::default()).unwrap();
        let volume = Volume::new(grid.clone(), T::wrap(voxels.clone().into())).unwrap();
        let index = volume.bricks();
        let rows =
            if LABELLED { [0, 1, 2].iter().fold(0, |set, &id| set | classifier.row_bit(id)) } else { 1 };
        let clear: Vec<bool> =
            (0..index.len()).map(|b| classifier.is_clear(index.range(b), 0.0, rows)).collect();
        assert!(dims != DIMS || clear.iter().any(|&c| c) && clear.iter().any(|&c| !c));
        let nothing = vec![false; index.len()];
        let displacement = shifted(&grid);
        let warp = Warp::new(&displacement, grid.inverse_linear_part());
        for (empty, warp) in [(&nothing, None), (&clear, None), (&nothing, Some(&warp))] {
            let shape = Shape::new(dims);
            let field = Field {
                samples: Samples::new(&voxels, shape),
                ids: if LABELLED { &ids } else { &[] },
                warp,
                space: &Space::new(shape, empty),
                light: Light::new(&camera, grid.inverse_linear_part(), 1.0),
            };
            let bounds: Vec<f32> = (0..index.len())
                .map(|b| if warp.is_some() { scale as f32 } else { index.range(b).max })
                .collect();
            let bounds = Bounds::new(field.space.bricks(), bounds);
            let negative = Bounds::new(field.space.bricks(), vec![0.0; index.len()]);
            for skip in [false, true].into_iter().filter(|_| !empty.iter().any(|&is| is)) {
                let dimming = |scale: f64, bias| Attenuated {
                    low: 0.0,
                    scale: (1.0 / scale) as f32,
                    bias,
                    of_step: 0.2,
                };
                for (bounds, sign) in [(&bounds, 1.0), (&negative, -1.0)] {
                    let at = |level: f64| FirstPeak { threshold: sign * (level * scale) as f32 };
                    projected(&camera, &field, &Greatest, bounds, sign, skip);
                    projected(&camera, &field, &Mean, bounds, sign, skip);
                    projected(&camera, &field, &at(0.3), bounds, sign, skip);
                    projected(&camera, &field, &at(0.7), bounds, sign, skip);
                    projected(&camera, &field, &dimming(scale, 0.0), bounds, sign, skip);
                    projected(&camera, &field, &dimming(f64::INFINITY, 1.0), bounds, sign, skip);
                }
            }
            // Bricks that are clear have no value above 20 of 64.
            for level in [0.35, 0.5, 0.9] {
                same(&camera, |wide, rays| {
                    first_hit(wide, &field, (level * scale) as f32, 1.0, [0.9, 0.5, 0.1], rays)
                });
            }
            for end in [0.4, 0.99, 2.0] {
                same(&camera, |wide, rays| {
                    dvr(wide, &field, &AtMiddle::<LABELLED, SHADED>(&classifier), end, rays)
                });
            }
            for end in [0.4, 2.0].into_iter().filter(|_| !LABELLED) {
                same(&camera, |wide, rays| dvr(wide, &field, &AtMiddle::<false, SHADED>(&steep), end, rays));
            }
            if empty.iter().any(|&is| is) {
                continue;
            }
            for end in [0.4, 2.0] {
                same(&camera, |wide, rays| dvr(wide, &field, &AtEnds::<SHADED>(&table), end, rays));
            }
        }
    }

    /// Casts every ray of a projection both ways.
    fn projected<T: Pairs, P: ProjectLanes>(
        camera: &Camera,
        field: &Field<'_, T>,
        projection: &P,
        bounds: &Bounds,
        sign: f32,
        skip: bool,
    ) {
        alike(camera, |wide, rays| {
            project(wide, field, projection, bounds, sign, skip, rays)
                .map(|(value, cast)| Cast { rgba: [value; 4], ..cast })
        });
    }

    /// Casts every ray both ways; packets take samples in clear bricks as well.
    fn same(camera: &Camera, cast: impl Fn(Wide, &Packet) -> [Cast; LANES]) {
        for (any, packet) in alike(camera, cast) {
            assert!(packet.taken >= any.taken);
        }
    }

    /// Casts every ray both ways, to the same bytes.
    fn alike(camera: &Camera, cast: impl Fn(Wide, &Packet) -> [Cast; LANES]) -> Vec<(Cast, Cast)> {
        let mut pairs = Vec::new();
        for i in 0..(24 * 20 / LANES) {
            let rays: Packet = std::array::from_fn(|lane| {
                let at = i * LANES + lane;
                camera.ray(at % 24, at / 24)
            });
            let (any, packet) = (cast(Wide::none(), &rays), cast(Wide::detected([2; 3], true), &rays));
            pairs.extend(any.into_iter().zip(packet));
        }
        for (any, packet) in &pairs {
            assert_eq!(any.rgba.map(f32::to_bits), packet.rgba.map(f32::to_bits));
            assert_eq!(packet.taken + packet.skipped, any.taken + any.skipped);
        }
        pairs
    }

    #[test]
    fn packets_and_single_rays_give_the_same_bytes() {
        for projection in [Projection::Orthographic, Projection::Perspective] {
            let view = |angles| View { angles, zoom: 1.4, projection, ..View::FRONT };
            let oblique = view([31.0, 12.0]);
            both_ways::<u8, false, false>(DIMS, 255.0, 0.9, oblique);
            both_ways::<u8, true, true>(DIMS, 255.0, 0.1, oblique);
            both_ways::<u16, false, true>(DIMS, 60_000.0, 0.1, oblique);
            both_ways::<u16, true, false>(DIMS, 60_000.0, 0.02, oblique);
            both_ways::<i16, false, false>(DIMS, 30_000.0, 0.9, oblique);
            both_ways::<f32, false, true>(DIMS, 1.0, 0.3, oblique);
            both_ways::<f32, true, false>(DIMS, 1.0, 0.02, oblique);
            // Along an axis, and along the diagonal of two.
            for along in [view([0.0, 0.0]), view([90.0, 45.0])] {
                both_ways::<u8, true, true>(DIMS, 255.0, 0.1, along);
                both_ways::<u16, false, true>(DIMS, 60_000.0, 0.1, along);
            }
        }
    }

    #[test]
    fn grids_of_a_few_voxels_are_cast_alike() {
        let view =
            View { angles: [31.0, 12.0], zoom: 1.2, projection: Projection::Perspective, ..View::FRONT };
        // No cell has a cell on every side; one has; one brick and a voxel more.
        for dims in [[2, 3, 2], [4, 4, 4], [8, 9, 2], [9, 5, 17]] {
            both_ways::<u8, false, true>(dims, 255.0, 0.3, view);
            both_ways::<f32, true, true>(dims, 1.0, 0.1, view);
        }
    }

    #[test]
    fn a_ray_of_very_many_steps_is_cast_alone() {
        let grid = Grid::with_spacing([4; 3], [1e-7, 1.0, 1.0]).unwrap();
        // The middle ray runs along the thin volume.
        let params = RenderParams { size: [5, 1], view: View::FRONT, step: 0.9, ..RenderParams::default() };
        let camera = Camera::new(&grid, &params, &Held::Volume);
        let rays: Packet = std::array::from_fn(|lane| camera.ray(lane, 0));
        assert!(rays.iter().flatten().any(|ray| ray.steps > 1 << 24));
        #[cfg(target_arch = "x86_64")]
        assert!(!packet::serves_rays(&rays));
    }
}
