use std::io::{self, Write};

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::{GENERATOR, ROOT};
use crate::mesh::Error;
use crate::mesh::placed::{Placed, f32_rounding, put, times};

const HEAD: u64 = 12;
const CHUNK_HEAD: u64 = 8;
/// Column-major matrix from mm, RAS, to glTF's metres with y up: left is +x, the head +y, the front +z.
pub(super) const TO_GLTF: [f64; 16] =
    [-1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// GLB counts bytes in 32 bits. Returns what f32 rounds away (mm) of the positions relative to their node.
pub(in crate::mesh) fn check(mesh: &Placed) -> Result<f64, Error> {
    // The description of a frame is shorter than this.
    let bytes = binary_bytes(mesh) + 4096 + 1024 * mesh.frames.len() as u64;
    if u32::try_from(bytes).is_err() {
        return Err(Error::Unwritable {
            format: "GLB",
            problem: format!("it counts bytes in 32 bits, and the lattice needs {bytes}"),
        });
    }
    let centre = centre(mesh);
    let relative: Vec<_> = mesh.positions.iter().map(|p| p - centre).collect();
    let moved = mesh.frames.iter().map(|frame| {
        let moves: Vec<_> = frame.displacement.iter().map(|d| Vector3::from(*d)).collect();
        f32_rounding(moves.iter())
    });
    Ok(f32_rounding(relative.iter()) + moved.fold(0.0, f64::max))
}

/// One mesh under two nodes: the inner one carries the offset (mm), the root turns mm, RAS, to metres, y up.
pub(in crate::mesh) fn write(file: &mut dyn Write, mesh: &Placed) -> io::Result<()> {
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
    for triangle in mesh.lattice.triangles() {
        put(file, *triangle, u32::to_le_bytes)?;
    }
    if !is_animated(mesh) {
        return Ok(());
    }
    for frame in mesh.frames {
        for d in &frame.displacement[..] {
            put(file, *d, |c: f64| (c as f32).to_le_bytes())?;
        }
    }
    for time in times(mesh.frames) {
        file.write_all(&(time as f32).to_le_bytes())?;
    }
    // At rest no target counts, then one after the other.
    for key in 0..=mesh.frames.len() {
        for target in 1..=mesh.frames.len() {
            let weight: f32 = if key == target { 1.0 } else { 0.0 };
            file.write_all(&weight.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Whether there is something to animate, and an animation of it.
fn is_animated(mesh: &Placed) -> bool {
    !mesh.frames.is_empty() && !mesh.lattice.triangles().is_empty()
}

/// Bytes of positions, indices, morph targets, times and weights.
fn binary_bytes(mesh: &Placed) -> u64 {
    let [vertices, triangles, frames] =
        [mesh.positions.len(), mesh.lattice.triangles().len(), mesh.frames.len()].map(|n| n as u64);
    let still = 12 * (vertices + triangles);
    if is_animated(mesh) { still + 12 * vertices * frames + 4 * (frames + 1) * (1 + frames) } else { still }
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
    if mesh.lattice.triangles().is_empty() {
        let inner = json!({"name": "lattice", "translation": centre.as_slice()});
        return json!({"asset": asset, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [root, inner]});
    }
    let (vertices, indices) = (mesh.positions.len(), 3 * mesh.lattice.triangles().len());
    let (lo, hi) = range(mesh.positions.iter().map(|p| p - centre));
    let inner = json!({"name": "lattice", "mesh": 0, "translation": centre.as_slice()});
    let mut description = json!({
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
    });
    if is_animated(mesh) {
        animate(&mut description, mesh);
    }
    description
}

/// Adds a morph target for every frame, and an animation of their weights.
fn animate(description: &mut Value, mesh: &Placed) {
    let (vertices, frames) = (mesh.positions.len(), mesh.frames.len());
    let mut offset = 12 * (vertices + mesh.lattice.triangles().len());
    let mut add = |mut accessor: Value, bytes: usize| {
        let mut view = json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes});
        if accessor["type"] == "VEC3" {
            view["target"] = 34962.into();
        }
        offset += bytes;
        let views = description["bufferViews"].as_array_mut().expect("written above");
        accessor["bufferView"] = views.len().into();
        accessor["componentType"] = 5126.into();
        views.push(view);
        let accessors = description["accessors"].as_array_mut().expect("written above");
        accessors.push(accessor);
        accessors.len() - 1
    };
    let mut targets = Vec::with_capacity(frames);
    for frame in mesh.frames {
        let (lo, hi) = range(frame.displacement.iter().map(|d| Vector3::from(*d)));
        let accessor = json!({"count": vertices, "type": "VEC3", "min": lo.as_slice(), "max": hi.as_slice()});
        targets.push(json!({"POSITION": add(accessor, 12 * vertices)}));
    }
    let times = times(mesh.frames);
    let (start, end) = (times[0] as f32, times[frames] as f32);
    let keys = json!({"count": frames + 1, "type": "SCALAR", "min": [start], "max": [end]});
    let input = add(keys, 4 * (frames + 1));
    let output = add(json!({"count": (frames + 1) * frames, "type": "SCALAR"}), 4 * (frames + 1) * frames);
    let shape = &mut description["meshes"][0];
    shape["primitives"][0]["targets"] = targets.into();
    shape["weights"] = vec![0.0; frames].into();
    description["animations"] = json!([{
        "name": "motion",
        "samplers": [{"input": input, "output": output, "interpolation": "LINEAR"}],
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "weights"}}],
    }]);
}

/// Least and largest of each coordinate, as they are written.
fn range(vectors: impl Iterator<Item = Vector3<f64>>) -> (Vector3<f32>, Vector3<f32>) {
    let none = (Vector3::repeat(f32::INFINITY), Vector3::repeat(f32::NEG_INFINITY));
    vectors.map(|v| v.map(|c| c as f32)).fold(none, |(lo, hi), v| (lo.inf(&v), hi.sup(&v)))
}
