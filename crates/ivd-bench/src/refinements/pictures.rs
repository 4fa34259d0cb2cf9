//! How refinements look: all from one side, in one scale of colours.

use ivd_core::{Exec, Image, Lattice, srgb};
use ivd_render::{RenderParams, SurfaceStyle, View, surface};
use nalgebra::Vector3;

use crate::distance::Search;
use crate::experiment::Problem;

/// Edge of a picture (pixels).
const SIDE: usize = 240;
/// Share of a picture's half that the lattice fills.
const FILL: f64 = 0.96;
/// The distances (voxels) that the first and the last colour stand for; between them by the logarithm.
pub(super) const SCALE: [f64; 2] = [0.01, 10.0];
/// Colours of distances, sRGB, dark to light: steps of viridis, which prints and is read with any colour vision.
pub(super) const COLOURS: [[u8; 3]; 7] = [
    [68, 1, 84],
    [68, 57, 131],
    [49, 104, 142],
    [33, 145, 140],
    [53, 183, 121],
    [144, 215, 67],
    [253, 231, 37],
];
/// Faces of a wire-frame, linear.
const PAPER: [f64; 3] = [1.0; 3];

/// Draws refinements of one lattice.
pub(super) struct Painter {
    input: Search,
    frame: [[f64; 3]; 2],
    view: View,
    voxel_mm: f64,
}

impl Painter {
    /// - `view`: turn and height of the camera (degrees).
    pub(super) fn new(lattice: &Lattice, input: Search, view: [f64; 2], voxel_mm: f64) -> Self {
        let positions = lattice.positions();
        let first = positions.first().copied().unwrap_or_default();
        let (low, high) = positions.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        // At zoom 1 a picture holds the sphere round the box, whichever way that is turned.
        let [azimuth, elevation] = view.map(f64::to_radians);
        let to_eye =
            Vector3::new(-azimuth.sin() * elevation.cos(), azimuth.cos() * elevation.cos(), elevation.sin());
        let middle = (low + high) * 0.5;
        let aside = |p: &Vector3<f64>| (p - middle).cross(&to_eye).norm();
        let widest = positions.iter().map(aside).fold(f64::MIN_POSITIVE, f64::max);
        let zoom = FILL * 0.5 * (high - low).norm() / widest;
        let view = View { angles: view, zoom, ..View::FRONT };
        Self { input, frame: [low.into(), high.into()], view, voxel_mm }
    }

    /// A lattice lit; coloured by its distance from the input; and as a wire-frame.
    pub(super) fn pictures(&self, lattice: &Lattice, exec: &Exec) -> Result<[Image; 3], Problem> {
        let lit = RenderParams {
            size: [SIDE; 2],
            view: self.view,
            annotate: false,
            background: [1.0; 4],
            ..RenderParams::default()
        };
        let plain = RenderParams { shading: false, surface: PAPER, ..lit.clone() };
        let coloured = |p: [f64; 3]| colour(self.input.distance(p.into()) / self.voxel_mm);
        let look = SurfaceStyle { frame: Some(self.frame), ..SurfaceStyle::default() };
        Ok([
            surface(lattice, &look, &lit, exec)?,
            surface(lattice, &SurfaceStyle { colour: Some(&coloured), ..look }, &plain, exec)?,
            surface(lattice, &SurfaceStyle { edges: true, ..look }, &plain, exec)?,
        ])
    }
}

/// Colour of a distance (voxels), linear RGB.
fn colour(voxels: f64) -> [f32; 3] {
    let [low, high] = SCALE;
    let last = (COLOURS.len() - 1) as f64;
    let at = ((voxels / low).max(1.0).ln() / (high / low).ln()).min(1.0) * last;
    let below = at.min(last - 1.0) as usize;
    let part = (at - below as f64) as f32;
    let linear = srgb::linear_of_byte;
    std::array::from_fn(|c| linear(COLOURS[below][c]) * (1.0 - part) + linear(COLOURS[below + 1][c]) * part)
}

/// Columns of two pictures each in one: wire-frames above, colours below.
pub(super) fn sheet(columns: &[&[Image; 3]]) -> Image {
    let (width, height) = (SIDE * columns.len().max(1), 2 * SIDE);
    let mut rgba = vec![255; 4 * width * height];
    for (across, [_, coloured, wires]) in columns.iter().enumerate() {
        for (down, image) in [wires, coloured].into_iter().enumerate() {
            for (y, row) in image.rgba().chunks(4 * SIDE).enumerate() {
                let at = 4 * (across * SIDE + width * (down * SIDE + y));
                rgba[at..at + 4 * SIDE].copy_from_slice(row);
            }
        }
    }
    Image::new(width, height, rgba).expect("four bytes a pixel")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_grow_lighter_with_the_distance_and_end_with_the_scale() {
        let light = |voxels: f64| colour(voxels).iter().sum::<f32>();
        let steps: Vec<f32> = (0..=60).map(|i| light(0.01 * 10_f64.powf(f64::from(i) / 20.0))).collect();
        assert!(steps.windows(2).all(|w| w[0] < w[1]), "{steps:?}");
        assert_eq!(colour(0.0), colour(SCALE[0]));
        assert_eq!(colour(1e9), colour(SCALE[1]));
    }
}
