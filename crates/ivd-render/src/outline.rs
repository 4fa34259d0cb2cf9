use ivd_core::{Image, Lattice};
use nalgebra::Vector3;

use crate::camera::Camera;

/// Colour of an outline, sRGB.
const COLOUR: [u8; 3] = [0xF0, 0xE4, 0x42];

/// Draws the outline of a lattice over a picture: the edges between a triangle that faces the eye and one that doesn't, and those of one
/// triangle only.
pub(crate) fn outline(image: &Image, lattice: &Lattice, camera: &Camera) -> Image {
    let positions = lattice.positions();
    let mut edges: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * lattice.triangles().len());
    for triangle in lattice.triangles() {
        let corners = triangle.map(|v| positions[v as usize]);
        let faces_eye = camera.faces_eye(corners);
        for side in 0..3 {
            let (a, b) = (triangle[side], triangle[(side + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], faces_eye));
        }
    }
    edges.sort_unstable();
    let (width, height) = (image.width(), image.height());
    let mut rgba = image.rgba().to_vec();
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        if group.len() == 1 || group.iter().any(|edge| edge.1 != group[0].1) {
            let [a, b] = group[0].0.map(|v| positions[v as usize]);
            line(&mut rgba, [width, height], camera, a, b);
        }
    }
    Image::new(width, height, rgba).expect("the size didn't change")
}

/// Sets the pixels of a straight line.
fn line(rgba: &mut [u8], size: [usize; 2], camera: &Camera, a: Vector3<f64>, b: Vector3<f64>) {
    let (Some(a), Some(b)) = (camera.project(a), camera.project(b)) else { return };
    let longest = (b[0] - a[0]).abs().max((b[1] - a[1]).abs()).ceil().clamp(1.0, 65536.0);
    for i in 0..=longest as usize {
        let t = i as f64 / longest;
        let [x, y] = [0, 1].map(|c| (a[c] + t * (b[c] - a[c])).round());
        if x >= 0.0 && y >= 0.0 && x < size[0] as f64 && y < size[1] as f64 {
            let at = 4 * (x as usize + size[0] * y as usize);
            rgba[at..at + 3].copy_from_slice(&COLOUR);
            rgba[at + 3] = 255;
        }
    }
}
