use ivd_core::{BrickRange, Exec, Labels};
use rayon::prelude::*;

use crate::camera::{Camera, Ray};
use crate::cast::{Cast, Field, dvr, first_hit, mip};
use crate::classify::Classifier;
use crate::light::Light;
use crate::samples::{Fast, Samples, Shape, Stored, fast};
use crate::skip::{rows_of_bricks, through_warp};
use crate::space::Space;
use crate::warp::Warp;
use crate::{Error, Mode, RenderParams, Scene, picture};

/// Pixels along a tile's edge: the unit that threads steal, small enough that its rays share the cache.
const TILE: usize = 16;

/// The light of a picture before it is encoded, and what it cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Radiance {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Premultiplied linear RGB and opacity without background, rows from the top, shape `[height, width]`.
    pub rgba: Vec<[f32; 4]>,
    /// Samples taken.
    pub samples: u64,
    /// Samples passed over because their brick is empty.
    pub skipped: u64,
}

/// Casts a ray through every pixel and returns linear light, without background, letters and encoding: for measuring, and for callers who compose
/// pictures themselves. See [`crate::render`] for the rest.
///
/// # Errors
/// As [`crate::render`].
pub fn radiance(scene: &Scene, params: &RenderParams, exec: &Exec) -> Result<Radiance, Error> {
    params.check()?;
    scene.check()?;
    if params.mode == Mode::Dvr && scene.transfer.is_none() {
        return Err(Error::NoTransfer);
    }
    exec.run(|| {
        let (voxels, shift) = fast(scene.volume, exec)?;
        match &voxels {
            Fast::U8(slice) => typed(scene, params, exec, slice, shift),
            Fast::U16(slice) => typed(scene, params, exec, slice, shift),
            Fast::I16(slice) => typed(scene, params, exec, slice, shift),
            Fast::F32(slice) => typed(scene, params, exec, slice, shift),
        }
    })
}

/// What every mode needs, before the skipping is known.
struct Stage<'a> {
    scene: &'a Scene<'a>,
    params: &'a RenderParams,
    exec: &'a Exec,
    camera: Camera,
    /// `stored = fast + shift`.
    shift: f64,
    /// −1 where the real value falls as the stored one rises.
    sign: f64,
}

impl Stage<'_> {
    fn real(&self, fast: f64) -> f64 {
        self.scene.volume.real(fast + self.shift)
    }

    fn fast(&self, stored: f32) -> f32 {
        (f64::from(stored) - self.shift) as f32
    }

    fn ranges(&self) -> Vec<BrickRange> {
        let index = self.scene.volume.bricks();
        (0..index.len()).map(|b| index.range(b)).collect()
    }

    /// A value that no interpolated `sign · fast` of the range exceeds, with room for rounding.
    fn bound(&self, range: BrickRange) -> f32 {
        if range.min > range.max {
            return f32::NEG_INFINITY;
        }
        let (low, high) = (self.fast(range.min), self.fast(range.max));
        let top = if self.sign < 0.0 { -low } else { high };
        top + 1e-5 * (low.abs() + high.abs())
    }
}

fn typed<T: Stored>(
    scene: &Scene,
    params: &RenderParams,
    exec: &Exec,
    voxels: &[T],
    shift: f64,
) -> Result<Radiance, Error> {
    let grid = scene.volume.grid();
    let shape = Shape::new(grid.dims());
    let sign = scene.volume.slope().signum();
    let camera = Camera::new(grid, params);
    let to_voxel = grid.inverse_linear_part();
    let warp = scene.displacement.filter(|d| !is_still(d)).map(|d| Warp::new(d, to_voxel));
    let light = Light::new(&camera, to_voxel, sign);
    let field = Field {
        samples: Samples::new(voxels, shape),
        ids: scene.labels.map_or(&[], Labels::ids),
        warp,
        space: Space::full(shape),
        light,
    };
    let stage = Stage { scene, params, exec, camera, shift, sign };
    match params.mode {
        Mode::Dvr => stage.dvr(field),
        Mode::Mip => stage.mip(&field),
        Mode::Iso { value } => stage.iso(field, value),
    }
}

/// Whether a displacement changes no pixel.
fn is_still(displacement: &ivd_core::Displacement) -> bool {
    displacement.inverse.stored() == 0 && displacement.vacated.iter().all(|&v| v == 0)
}

impl Stage<'_> {
    fn dvr<T: Stored>(&self, mut field: Field<'_, T>) -> Result<Radiance, Error> {
        let transfer = self.scene.transfer.ok_or(Error::NoTransfer)?;
        let index = self.scene.volume.bricks();
        let range = index.total().map_or([0.0; 2], |(lo, hi)| [self.fast(lo), self.fast(hi)]);
        let step = self.camera.step_mm() / transfer.reference_mm();
        let labelled = !field.ids.is_empty();
        let classifier = Classifier::new(transfer, range, |v| self.real(v), step, labelled);
        if self.params.skip {
            let rows = if labelled {
                rows_of_bricks(self.scene.volume.grid().dims(), field.ids, &classifier)
            } else {
                vec![1; index.len()]
            };
            let clear = |(range, rows): (BrickRange, u64)| classifier.is_clear(range, self.shift, rows);
            let empty = self.ranges().into_iter().zip(rows).map(clear).collect();
            field.space = self.space(&field, empty);
        }
        // A termination above 1 is never reached; f32 sums stay below 1 + ulp.
        let end = self.params.termination as f32;
        match (labelled, self.params.shading) {
            (false, false) => self.tiles(|ray| dvr::<T, false, false>(&field, &classifier, end, ray)),
            (false, true) => self.tiles(|ray| dvr::<T, false, true>(&field, &classifier, end, ray)),
            (true, false) => self.tiles(|ray| dvr::<T, true, false>(&field, &classifier, end, ray)),
            (true, true) => self.tiles(|ray| dvr::<T, true, true>(&field, &classifier, end, ray)),
        }
    }

    fn mip<T: Stored>(&self, field: &Field<'_, T>) -> Result<Radiance, Error> {
        let bounds = self.ranges().into_iter().map(|range| self.bound(range)).collect();
        let bricks = self.scene.volume.bricks().dims();
        let bounds = through_warp(field.warp.as_ref(), bricks, bounds, f32::NEG_INFINITY, f32::max);
        let [low, high] = self.scene.volume.range().unwrap_or([0.0; 2]);
        self.tiles(|ray| {
            let (greatest, cast) = mip(field, &bounds, self.sign as f32, self.params.skip, ray);
            let Some(greatest) = greatest else { return cast };
            let value = self.real(self.sign * f64::from(greatest));
            let share = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
            let grey = picture::linear(share as f32);
            Cast { rgba: [grey, grey, grey, 1.0], ..cast }
        })
    }

    fn iso<T: Stored>(&self, mut field: Field<'_, T>, value: f64) -> Result<Radiance, Error> {
        let iso = (self.sign * (self.scene.volume.stored(value) - self.shift)) as f32;
        if self.params.skip {
            let empty = self.ranges().into_iter().map(|range| self.bound(range) < iso).collect();
            field.space = self.space(&field, empty);
        }
        self.tiles(|ray| first_hit(&field, iso, self.sign as f32, self.params.surface, ray))
    }

    fn space<T: Stored>(&self, field: &Field<'_, T>, empty: Vec<bool>) -> Space {
        let bricks = self.scene.volume.bricks().dims();
        let empty = through_warp(field.warp.as_ref(), bricks, empty, true, |a, b| a && b);
        Space::new(field.samples.shape, &empty)
    }

    /// Casts every pixel's ray, tile by tile, in parallel.
    fn tiles(&self, cast: impl Fn(&Ray) -> Cast + Sync) -> Result<Radiance, Error> {
        let (width, height) = (self.params.width, self.params.height);
        let across = width.div_ceil(TILE);
        let count = across * height.div_ceil(TILE);
        self.exec.check_memory("picture", 2 * 16 * (width * height) as u64)?;
        self.exec.observer().begin("render", count as u64);
        let tiles: Vec<Vec<Cast>> = (0..count)
            .into_par_iter()
            .map(|tile| {
                self.exec.check_cancelled()?;
                let casts = pixels(tile, across, width, height)
                    .map(|(x, y)| self.camera.ray(x, y).map_or(Cast::default(), |ray| cast(&ray)))
                    .collect();
                self.exec.observer().advance("render", 1);
                Ok(casts)
            })
            .collect::<Result<_, ivd_core::Error>>()?;
        self.exec.observer().end("render");
        let mut picture =
            Radiance { width, height, rgba: vec![[0.0; 4]; width * height], samples: 0, skipped: 0 };
        for (tile, casts) in tiles.iter().enumerate() {
            for ((x, y), cast) in pixels(tile, across, width, height).zip(casts) {
                picture.rgba[x + width * y] = cast.rgba;
                picture.samples += cast.taken as u64;
                picture.skipped += cast.skipped as u64;
            }
        }
        Ok(picture)
    }
}

/// The pixels of a tile.
fn pixels(tile: usize, across: usize, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    let (left, top) = (tile % across * TILE, tile / across * TILE);
    let (right, bottom) = ((left + TILE).min(width), (top + TILE).min(height));
    (top..bottom).flat_map(move |y| (left..right).map(move |x| (x, y)))
}
