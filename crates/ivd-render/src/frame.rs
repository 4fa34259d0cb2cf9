use ivd_core::{Exec, parallel};
use rayon::prelude::*;

use crate::camera::{Camera, Ray};
use crate::cast::Cast;

/// Pixels along a tile's edge: the unit that threads steal, small enough that its rays share the cache.
const TILE: usize = 16;
/// Rays that are cast together: a block of pixels, so that they stay close to each other.
const ACROSS: usize = 4;
const DOWN: usize = 2;
/// Rays of a packet.
pub(crate) const LANES: usize = ACROSS * DOWN;

/// Rays of neighbouring pixels; `None` for one that misses the volume or the picture.
pub(crate) type Packet = [Option<Ray>; LANES];

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

impl Radiance {
    /// The mean light of blocks of so many pixels a side; sides are multiples of it.
    pub(crate) fn averaged(self, side: usize) -> Self {
        if side == 1 {
            return self;
        }
        let bands = self.rgba.par_chunks_exact(self.width * side);
        let rgba = bands.flat_map_iter(|band| means(band, self.width, side)).collect();
        let width = self.width / side;
        Self { width, height: self.height / side, rgba, ..self }
    }
}

/// A row of pixels, each the mean of so many samples a side: from as many rows of samples.
pub(crate) fn means(samples: &[[f32; 4]], width: usize, side: usize) -> Vec<[f32; 4]> {
    let pixel = |x: usize| {
        let mut sum = [0.0; 4];
        for row in samples.chunks(width) {
            for sample in &row[side * x..side * (x + 1)] {
                sum = std::array::from_fn(|c| sum[c] + sample[c]);
            }
        }
        sum.map(|c| c / (side * side) as f32)
    };
    (0..width / side).map(pixel).collect()
}

/// A part of the picture.
#[derive(Clone)]
struct Tile {
    rgba: [[f32; 4]; TILE * TILE],
    samples: u64,
    skipped: u64,
}

/// Casts every pixel's ray, tile by tile, in parallel.
pub(crate) fn tiles(
    camera: &Camera,
    exec: &Exec,
    cast: impl Fn(&Packet) -> [Cast; LANES] + Sync,
) -> Result<Radiance, ivd_core::Error> {
    let [width, height] = camera.size();
    let across = width.div_ceil(TILE);
    let count = across * height.div_ceil(TILE);
    exec.check_memory("picture", (32 * width * height) as u64)?;
    exec.observer().begin("render", count as u64);
    let mut tiles = vec![Tile::default(); count];
    parallel::try_for_each_piece_mut(&mut tiles, 1, &|i, tile| {
        exec.check_cancelled()?;
        tile[0].cast(camera, [i % across * TILE, i / across * TILE], &cast);
        exec.observer().advance("render", 1);
        Ok::<_, ivd_core::Error>(())
    })?;
    exec.observer().end("render");
    let mut rgba = vec![[0.0; 4]; width * height];
    parallel::for_each_piece_mut(&mut rgba, width * TILE, &|i, band| {
        for (y, row) in band.chunks_mut(width).enumerate() {
            for (pixels, tile) in row.chunks_mut(TILE).zip(&tiles[i * across..]) {
                pixels.copy_from_slice(&tile.rgba[y * TILE..][..pixels.len()]);
            }
        }
    });
    let samples = tiles.iter().map(|tile| tile.samples).sum();
    let skipped = tiles.iter().map(|tile| tile.skipped).sum();
    Ok(Radiance { width, height, rgba, samples, skipped })
}

impl Default for Tile {
    fn default() -> Self {
        Self { rgba: [[0.0; 4]; TILE * TILE], samples: 0, skipped: 0 }
    }
}

impl Tile {
    /// Casts the rays of the tile whose first pixel is `first`.
    fn cast(&mut self, camera: &Camera, first: [usize; 2], cast: &impl Fn(&Packet) -> [Cast; LANES]) {
        let [width, height] = camera.size();
        for y in (0..TILE).step_by(DOWN).take_while(|y| first[1] + y < height) {
            for x in (0..TILE).step_by(ACROSS).take_while(|x| first[0] + x < width) {
                let place = |lane: usize| [x + lane % ACROSS, y + lane / ACROSS];
                let rays: Packet = std::array::from_fn(|lane| {
                    let at = [first[0] + place(lane)[0], first[1] + place(lane)[1]];
                    (at[0] < width && at[1] < height).then(|| camera.ray(at[0], at[1])).flatten()
                });
                if rays.iter().all(Option::is_none) {
                    continue;
                }
                for (lane, cast) in cast(&rays).into_iter().enumerate() {
                    let [x, y] = place(lane);
                    self.rgba[x + TILE * y] = cast.rgba;
                    self.samples += cast.taken as u64;
                    self.skipped += cast.skipped as u64;
                }
            }
        }
    }
}

/// Casts the rays of a packet one after the other.
#[inline(always)]
pub(crate) fn one_by_one(rays: &Packet, cast: impl Fn(&Ray) -> Cast) -> [Cast; LANES] {
    std::array::from_fn(|lane| rays[lane].as_ref().map_or(Cast::default(), &cast))
}
