use std::io::{self, Write};

use nalgebra::Vector3;

use super::{Mesh, f32_rounding, put};
use crate::Error;

/// STL counts triangles in 32 bits. Returns what f32 rounds away (mm).
pub(super) fn check(mesh: &Mesh) -> Result<f64, Error> {
    let triangles = mesh.lattice.triangles.len();
    if u32::try_from(triangles).is_err() {
        return Err(Error::Unwritable {
            format: "STL",
            problem: format!("it counts triangles in 32 bits, and there are {triangles}"),
        });
    }
    Ok(f32_rounding(mesh.positions.iter()))
}

/// Binary: 80 bytes of comment, then each triangle's normal and corners as f32.
pub(super) fn write(file: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let mut head = [b' '; 80];
    let comment = b"positions in mm, RAS";
    head[..comment.len()].copy_from_slice(comment);
    file.write_all(&head)?;
    file.write_all(&(mesh.lattice.triangles.len() as u32).to_le_bytes())?;
    for triangle in &mesh.lattice.triangles {
        let corners = triangle.map(|v| mesh.positions[v as usize]);
        for vector in [normal(corners), corners[0], corners[1], corners[2]] {
            put(file, vector.into(), |c: f64| (c as f32).to_le_bytes())?;
        }
        file.write_all(&[0, 0])?;
    }
    Ok(())
}

/// Unit normal; 0 for a triangle without area, as readers expect.
fn normal([a, b, c]: [Vector3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default()
}
