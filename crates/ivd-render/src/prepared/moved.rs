//! How far what is seen has come out of its surface, or gone into it.

use ivd_core::{Exec, Image, NO_DATA, VoxelCoord};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::Prepared;
use super::cast::with_fast;
use crate::annotate::{self, Bar};
use crate::camera::{Camera, Ray};
use crate::cast::Field;
use crate::pick::HALF;
use crate::picture::{self, Background};
use crate::samples::Stored;
use crate::scale::{BLUE_TO_RED, colour_at, rounded_up};
use crate::wide::Pairs;
use crate::{Error, RenderParams, View};

/// How much of a pixel is its colour at most.
const OPAQUE: f32 = 0.85;
/// From this share of the scale on a colour is whole; its first ones are next to white.
const WHOLE: f32 = 0.15;
/// The least of a colour that shade leaves.
const SHADED: f32 = 0.4;
/// Motions are told from this length on (mm).
pub(crate) const LEAST_MOVED: f64 = 1e-3;

/// A picture of how far what is seen has come out of its surface or gone into it.
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// What is seen in greys, red where it has come out and blue where it has gone in, with a bar that says how far.
    pub image: Image,
    /// How far it has come out at most (mm).
    pub out_mm: f64,
    /// How far it has gone in at most (mm).
    pub in_mm: f64,
    /// What the bar's ends mean (mm).
    pub scale_mm: f64,
}

impl Prepared<'_> {
    /// The pictures of a turntable that begins with a view, or the one picture of it, as [`Moved`] says: of each pixel's place, where a pick finds it, how far it has moved
    /// along the normal there that faces the eye; of a labelled part where the ray enters it, along the normal of the part. All have one scale.
    ///
    /// # Errors
    /// As [`crate::render`]; a mode that shows no surface: all but dvr and iso.
    pub fn draw_moved(&self, view: View, exec: &Exec) -> Result<Moved, Error> {
        let RenderParams { size, turntable, .. } = self.params;
        exec.check_memory("pictures", (12 * turntable * size[0] * size[1]) as u64)?;
        let mut frames = Vec::with_capacity(turntable);
        for frame in 0..turntable {
            let params = RenderParams { view: self.turned(view, frame), ..self.params.clone() };
            let came = exec.run(|| with_fast!(&self.voxels, slice => self.came(slice, &params, exec)))?;
            let light = self.radiance(params.view, exec)?;
            let image = picture::compose(&light, &Background::of(&params));
            frames.push((params, image, came));
        }
        let all = frames.iter().flat_map(|(.., came)| came).filter(|mm| mm.is_finite());
        let [least, most] = all.fold([0.0_f32; 2], |[a, b], mm| [a.min(*mm), b.max(*mm)]).map(f64::from);
        let scale_mm = rounded_up((-least).max(most).max(LEAST_MOVED));
        let mut rgba = Vec::with_capacity(4 * turntable * size[0] * size[1]);
        for (params, image, came) in frames {
            let camera = self.camera(&params);
            let pixels = image.rgba().chunks_exact(4).zip(&came);
            let coloured = pixels.flat_map(|(pixel, mm)| coloured(pixel, mm / scale_mm as f32)).collect();
            let image = Image::new(size[0], size[1], coloured)?;
            let bar = Bar::of_length(|share| colour(2.0 * share - 1.0), scale_mm);
            rgba.extend_from_slice(annotate::annotate(image, &camera, &self.marks(Some(&bar))).rgba());
        }
        let image = Image::of_frames(size, turntable, rgba)?;
        Ok(Moved { image, out_mm: most, in_mm: 0.0 - least, scale_mm })
    }

    /// By pixel, how far what is seen has come out of its surface (mm); no number where nothing is seen, or that has no direction.
    fn came<T: Pairs>(&self, voxels: &[T], params: &RenderParams, exec: &Exec) -> Result<Vec<f32>, Error> {
        let camera = self.camera(params);
        let [width, height] = params.size;
        let mut came = vec![f32::NAN; width * height];
        let Some([left, right, top, bottom]) = self.moving(&camera) else { return Ok(came) };
        let field = self.field(voxels, &camera);
        let grid = self.scene.volume.grid();
        let world = |at: [f32; 3]| grid.world(VoxelCoord(Vector3::from(at).map(f64::from))).0;
        let of_ray = |ray: &Ray| {
            let seen = self.seen(&field, ray, HALF)?;
            let part = front_of_part(&field, ray, seen.sample);
            let (sample, shown) = part.map_or((seen.sample, seen.place), |(at, _)| (at, at));
            let moves = field.moves(field.space.brick(shown));
            if !moves {
                return Some(0.0);
            }
            let place = world(shown);
            // What is cut away has no side that could come out.
            if camera.cut_before(place).is_some() {
                return None;
            }
            let by = place - world(field.before(shown, moves)?);
            if let Some(normal) = part.and_then(|(at, label)| field.part_normal_there(at, label, moves)) {
                // Out of the part.
                return Some(Vector3::from(normal).map(f64::from).dot(&by) as f32);
            }
            let normal = Vector3::from(field.normal_there(sample, moves)?).map(f64::from);
            // What is seen faces the eye, whichever way its values go.
            let along = normal.dot(&by);
            Some(if normal.dot(&camera.sight(place)) < 0.0 { -along } else { along } as f32)
        };
        let rows = came.par_chunks_mut(width).enumerate().skip(top).take(bottom - top);
        rows.try_for_each(|(y, row)| {
            exec.check_cancelled()?;
            for (x, pixel) in row.iter_mut().enumerate().take(right).skip(left) {
                *pixel = camera.ray(x, y).and_then(|ray| of_ray(&ray)).unwrap_or(f32::NAN);
            }
            Ok::<_, Error>(())
        })?;
        Ok(came)
    }

    /// The pixels in which something that moves may be seen: columns from and to, rows from and to.
    fn moving(&self, camera: &Camera) -> Option<[usize; 4]> {
        let warp = self.warp.as_ref()?;
        let size = camera.size();
        let grid = self.scene.volume.grid();
        let bricks = self.scene.volume.bricks().dims();
        let mut bounds = [usize::MAX, 0, usize::MAX, 0];
        for brick in warp.all_moves().iter().enumerate().filter(|(_, moves)| **moves).map(|(brick, _)| brick)
        {
            let at = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
            for corner in 0..8_usize {
                let voxel = [0, 1, 2].map(|a| {
                    let high = corner >> a & 1;
                    let side = ((at[a] + high) * ivd_core::BRICK) as f64;
                    if high == 0 { side - 0.5 } else { side.min(grid.dims()[a] as f64 - 0.5) }
                });
                let place = grid.world(VoxelCoord(voxel.into())).0;
                // Behind the eye nothing is known of where it is seen.
                let Some(pixel) = camera.project(place) else { return Some([0, size[0], 0, size[1]]) };
                for a in 0..2 {
                    let from = (pixel[a].floor() - 1.0).clamp(0.0, size[a] as f64) as usize;
                    let to = (pixel[a].ceil() + 2.0).clamp(0.0, size[a] as f64) as usize;
                    bounds[2 * a] = bounds[2 * a].min(from);
                    bounds[2 * a + 1] = bounds[2 * a + 1].max(to);
                }
            }
        }
        (bounds[0] < bounds[1] && bounds[2] < bounds[3]).then_some(bounds)
    }
}

/// Where a ray enters the part that it shows at a sample, with the part's label: a part may have the values of what surrounds it, and be seen into, while what comes out or goes in is its surface.
/// `None` without labels, and of what has none.
fn front_of_part<T: Stored>(field: &Field<'_, T>, ray: &Ray, sample: [f32; 3]) -> Option<([f32; 3], u16)> {
    if field.ids.is_empty() {
        return None;
    }
    let label = field.label_there(sample).filter(|label| *label != NO_DATA)?;
    let along = (0..3).max_by(|a, b| ray.delta[*a].abs().total_cmp(&ray.delta[*b].abs()))?;
    let number = ((sample[along] - ray.start[along]) / ray.delta[along]).round().max(0.0) as usize;
    let first = (0..number).rev().find(|i| field.label_there(ray.at(*i)) != Some(label));
    Some((ray.at(first.map_or(0, |before| before + 1)), label))
}

/// A pixel in grey, with the colour of a share of the scale, −1…1, over it.
fn coloured(pixel: &[u8], share: f32) -> [u8; 4] {
    let grey = 0.2126 * f32::from(pixel[0]) + 0.7152 * f32::from(pixel[1]) + 0.0722 * f32::from(pixel[2]);
    let weight = if share.is_finite() { OPAQUE * (share.abs() / WHOLE).min(1.0) } else { 0.0 };
    let shade = SHADED + (1.0 - SHADED) * grey / 255.0;
    let [red, green, blue] = colour(f64::from(if share.is_finite() { share } else { 0.0 }))
        .map(|c| (grey * (1.0 - weight) + f32::from(c) * shade * weight).round() as u8);
    [red, green, blue, pixel[3]]
}

/// The colour of a share of the scale, −1…1.
fn colour(share: f64) -> [u8; 3] {
    colour_at(&BLUE_TO_RED, 0.5 + 0.5 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_not_moved_is_grey_and_what_has_is_red_or_blue() {
        let pixel = [100, 100, 100, 255];
        assert_eq!(coloured(&pixel, f32::NAN), pixel);
        assert_eq!(coloured(&pixel, 0.0), pixel);
        let [out, inwards] = [1.0, -1.0].map(|share| coloured(&pixel, share));
        assert!(out[0] > out[2] + 50 && inwards[2] > inwards[0] + 50, "{out:?} {inwards:?}");
        assert_eq!(colour(0.0), [247; 3]);
        assert_eq!((colour(-3.0), colour(1.0)), (BLUE_TO_RED[0], BLUE_TO_RED[4]));
    }
}
