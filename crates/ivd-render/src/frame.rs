use ivd_core::Exec;
use rayon::prelude::*;

use crate::camera::{Camera, Ray};
use crate::cast::Cast;

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

/// Casts every pixel's ray, tile by tile, in parallel.
pub(crate) fn tiles(
    camera: &Camera,
    exec: &Exec,
    cast: impl Fn(&Ray) -> Cast + Sync,
) -> Result<Radiance, ivd_core::Error> {
    let [width, height] = camera.size();
    let across = width.div_ceil(TILE);
    let count = across * height.div_ceil(TILE);
    exec.check_memory("picture", (48 * width * height) as u64)?;
    exec.observer().begin("render", count as u64);
    let tiles: Vec<Vec<Cast>> = (0..count)
        .into_par_iter()
        .map(|tile| {
            exec.check_cancelled()?;
            let casts = pixels(tile, across, width, height)
                .map(|(x, y)| camera.ray(x, y).map_or(Cast::default(), |ray| cast(&ray)))
                .collect();
            exec.observer().advance("render", 1);
            Ok(casts)
        })
        .collect::<Result<_, ivd_core::Error>>()?;
    exec.observer().end("render");
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

/// The pixels of a tile.
fn pixels(tile: usize, across: usize, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    let (left, top) = (tile % across * TILE, tile / across * TILE);
    let (right, bottom) = ((left + TILE).min(width), (top + TILE).min(height));
    (top..bottom).flat_map(move |y| (left..right).map(move |x| (x, y)))
}
