use std::io::{self, Write};

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::{GENERATOR, ROOT};
use crate::Error;
use crate::formats::{Placed, f32_rounding, put};

const HEAD: u64 = 12;
const CHUNK_HEAD: u64 = 8;
/// Column-major matrix from mm, RAS, to glTF's metres with y up: left is +x, the head +y, the front +z.
pub(super) const TO_GLTF: [f64; 16] =
    [-1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// GLB counts bytes in 32 bits. Returns what f32 rounds away (mm) of the positions relative to their node.
pub(in crate::formats) fn check(mesh: &Placed) -> Result<f64, Error> {
    let bytes = binary_bytes(mesh) + 4096;
    if u32::try_from(bytes).is_err() {
        return Err(Error::Unwritable {
            format: "GLB",
            problem: format!("it counts bytes in 32 bits, and the lattice needs {bytes}"),
        });
    }
    let centre = centre(mesh);
    let relative: Vec<_> = mesh.positions.iter().map(|p| p - centre).collect();
    Ok(f32_rounding(relative.iter()))
}

/// One mesh under two nodes: the inner one carries the offset (mm), the root turns mm, RAS, to metres, y up.
pub(in crate::formats) fn write(file: &mut dyn Write, mesh: &Placed) -> io::Result<()> {
    let centre = centre(mesh);
    let mut description = serde_json::to_vec(&describe(mesh, centre))?;
    description.resize(description.len().next_multiple_of(4), b' ');
    let binary = binary_bytes(mesh);
    let text = description.len() as u64;
    let chunk = if binary == 0 { 0 } else { CHUNK_HEAD + binary };
    file.write_all(b"glTF")?;
    put(file, [2, HEAD + CHUNK_HEAD + text + chunk, text], |n: u64| (n as u32).to_le_bytes())?;
    file.write_all(b"JSON")?;
    file.write_all(&description)?;
    if binary == 0 {
        return Ok(());
    }
    file.write_all(&(binary as u32).to_le_bytes())?;
    file.write_all(b"BIN\0")?;
    for p in &mesh.positions {
        put(file, (p - centre).into(), |c: f64| (c as f32).to_le_bytes())?;
    }
    for triangle in &mesh.lattice.triangles {
        put(file, *triangle, u32::to_le_bytes)?;
    }
    Ok(())
}

/// Bytes of all positions and indices.
fn binary_bytes(mesh: &Placed) -> u64 {
    12 * (mesh.positions.len() as u64 + mesh.lattice.triangles.len() as u64)
}

/// Middle of the bounding box (mm).
fn centre(mesh: &Placed) -> Vector3<f64> {
    let Some(first) = mesh.positions.first() else { return Vector3::zeros() };
    let (lo, hi) = mesh.positions.iter().fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
    (lo + hi) / 2.0
}

fn describe(mesh: &Placed, centre: Vector3<f64>) -> Value {
    let asset = json!({"version": "2.0", "generator": GENERATOR});
    let root = json!({"name": ROOT, "matrix": TO_GLTF, "children": [1]});
    // An empty mesh isn't valid glTF: the nodes alone are.
    if mesh.lattice.triangles.is_empty() {
        let inner = json!({"name": "lattice", "translation": centre.as_slice()});
        return json!({"asset": asset, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [root, inner]});
    }
    let (vertices, indices) = (mesh.positions.len(), 3 * mesh.lattice.triangles.len());
    let rounded = || mesh.positions.iter().map(|p| (p - centre).map(|c| c as f32));
    let lo = rounded().fold(Vector3::repeat(f32::INFINITY), |lo, p| lo.inf(&p));
    let hi = rounded().fold(Vector3::repeat(f32::NEG_INFINITY), |hi, p| hi.sup(&p));
    let inner = json!({"name": "lattice", "mesh": 0, "translation": centre.as_slice()});
    json!({
        "asset": asset,
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [root, inner],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
             "min": lo.as_slice(), "max": hi.as_slice()},
            {"bufferView": 1, "componentType": 5125, "count": indices, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 12 * vertices, "target": 34962},
            {"buffer": 0, "byteOffset": 12 * vertices, "byteLength": 4 * indices, "target": 34963},
        ],
        "buffers": [{"byteLength": binary_bytes(mesh)}],
    })
}
