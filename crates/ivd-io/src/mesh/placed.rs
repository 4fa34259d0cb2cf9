use std::io::{self, Write};

use ivd_core::{Frame, Lattice};
use nalgebra::Vector3;

use super::Error;
use crate::Space;

/// Vertices and triangles on their way into a file.
pub(super) struct Placed<'a> {
    pub(super) lattice: &'a Lattice,
    /// World positions (mm), in `space`.
    pub(super) positions: Vec<Vector3<f64>>,
    /// Which way the file's axes run.
    pub(super) space: Space,
    /// How they move from there, RAS; only formats with an animation, whose axes are their own, hold it.
    pub(super) frames: &'a [Frame],
}

/// Times of rest and of every frame (s), growing.
pub(super) fn times(frames: &[Frame]) -> Vec<f64> {
    let own: Vec<f64> = [0.0].into_iter().chain(frames.iter().map(|frame| frame.time)).collect();
    // As 32-bit numbers, which glTF has.
    let grow = own.windows(2).all(|pair| (pair[0] as f32) < pair[1] as f32 && (pair[1] as f32).is_finite());
    if grow { own } else { (0..own.len()).map(|i| i as f64).collect() }
}

/// Refuses a grid whose voxels 32-bit numbers can't name; else nothing is rounded.
pub(super) fn voxels_fit(mesh: &Placed, format: &'static str) -> Result<f64, Error> {
    let dims = mesh.lattice.grid().dims();
    if dims.iter().any(|&n| n >= i32::MAX as usize) {
        let problem = format!("its integers have 32 bits, and the grid has {dims:?} voxels");
        return Err(Error::Unwritable { format, problem });
    }
    Ok(0.0)
}

/// Writes an array of numbers as its little-endian bytes.
pub(super) fn put<const N: usize, const B: usize, T: Copy>(
    file: &mut dyn Write,
    values: [T; N],
    bytes: impl Fn(T) -> [u8; B],
) -> io::Result<()> {
    file.write_all(values.map(bytes).as_flattened())
}

/// Largest change (mm) of a coordinate by rounding it to f32.
pub(super) fn f32_rounding<'a>(positions: impl Iterator<Item = &'a Vector3<f64>>) -> f64 {
    positions.flat_map(|p| p.iter()).map(|&c| (f64::from(c as f32) - c).abs()).fold(0.0, f64::max)
}
