//! What an artefact holds, as figures.

use ivd_artefact::Artefact;
use ivd_core::{Grid, Labels, Mesh, VoxelCoord};
use ivd_io::volume::{FieldDirection, GivenField};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::distribution::distribution;

/// Where a grid lies: places are in mm, RAS (x to the right, y to the front, z to the head), and its extent is that of the voxels' outer
/// faces.
fn grid_facts(grid: &Grid) -> Value {
    let middle = grid.dims().map(|n| (n as f64 - 1.0) / 2.0);
    let mut told = json!({
        "dims": grid.dims(), "spacing": grid.spacing(), "origin": grid.origin(), "direction": grid.direction(), "in_patient": grid.in_patient(),
        "units": "mm", "space": "RAS", "extent_mm": told_box(grid.extent()),
        "centre_mm": <[f64; 3]>::from(grid.world(VoxelCoord(middle.into())).0),
    });
    if let (_, Some(reference)) = grid.reference().written() {
        told["reference"] = json!(reference);
    }
    if !grid.in_patient() {
        told["hint"] = json!(NOWHERE);
    }
    told
}

/// What a person should know of a file that doesn't say where the patient lies.
const NOWHERE: &str = "the file doesn't say where the patient lies, and is taken for LPS: places (picks, --at) are in RAS, so that their x and y have the other \
    sign; extent_mm tells where they are, and --axes of import (input.axes of a scene) says how the axes run";

/// The box of places, as its least and greatest coordinates; null where there are none.
fn extent(places: impl IntoIterator<Item = Vector3<f64>>) -> Value {
    let both = places.into_iter().map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.inf(&p), high.sup(&p)));
    both.map_or(Value::Null, |(low, high)| told_box([low.into(), high.into()]))
}

fn told_box([low, high]: [[f64; 3]; 2]) -> Value {
    json!({ "low": low, "high": high })
}

/// Where the voxels of a class lie.
#[derive(Clone, Copy)]
struct Whereabouts {
    low: [usize; 3],
    high: [usize; 3],
    /// Sum of the voxels' indices.
    sum: [u64; 3],
    voxels: u64,
}

impl Whereabouts {
    const NONE: Self = Self { low: [usize::MAX; 3], high: [0; 3], sum: [0; 3], voxels: 0 };

    fn with(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|a| self.low[a].min(other.low[a])),
            high: std::array::from_fn(|a| self.high[a].max(other.high[a])),
            sum: std::array::from_fn(|a| self.sum[a] + other.sum[a]),
            voxels: self.voxels + other.voxels,
        }
    }
}

/// The classes, each with its volume (ml), the middle of its voxels and the box round them, to the voxels' outer faces (mm, RAS).
fn classes(labels: &Labels) -> Vec<Value> {
    let (grid, known) = (labels.grid(), labels.classes());
    let mut number = vec![usize::MAX; 1 << 16];
    known.iter().enumerate().for_each(|(i, class)| number[usize::from(class.id)] = i);
    let [nx, ny, _] = grid.dims();
    let slice = |(z, ids): (usize, &[u16])| {
        let mut found = vec![Whereabouts::NONE; known.len()];
        for (y, row) in ids.chunks(nx).enumerate() {
            for (x, id) in row.iter().enumerate() {
                if let Some(class) = found.get_mut(number[usize::from(*id)]) {
                    let at = [x, y, z];
                    *class =
                        class.with(Whereabouts { low: at, high: at, sum: at.map(|c| c as u64), voxels: 1 });
                }
            }
        }
        found
    };
    let found = labels.ids().par_chunks(nx * ny).enumerate().map(slice).reduce(
        || vec![Whereabouts::NONE; known.len()],
        |all, slice| all.into_iter().zip(slice).map(|(a, b)| a.with(b)).collect(),
    );
    known.iter().zip(found).map(|(class, at)| told_of(class, at, grid)).collect()
}

fn told_of(class: &ivd_core::Class, at: Whereabouts, grid: &Grid) -> Value {
    let mut told = json!(class);
    if let Value::Object(told) = &mut told
        && at.voxels > 0
    {
        let middle = at.sum.map(|sum| sum as f64 / at.voxels as f64);
        let faces: [[f64; 2]; 3] = std::array::from_fn(|a| [at.low[a] as f64 - 0.5, at.high[a] as f64 + 0.5]);
        told.insert("ml".to_owned(), json!(at.voxels as f64 * grid.voxel_volume() / 1000.0));
        told.insert("centre_mm".to_owned(), json!(<[f64; 3]>::from(grid.world(VoxelCoord(middle.into())).0)));
        told.insert("extent_mm".to_owned(), told_box(grid.extent_of(faces)));
    }
    told
}

/// What an artefact holds, as JSON: dims, ranges, classes, counts; for motions every displacement.
pub fn describe(artefact: &Artefact) -> Value {
    match artefact {
        Artefact::Volume(v) => {
            let mut told = json!({
                "kind": "volume", "grid": grid_facts(v.grid()), "type": v.voxel_type().name(), "slope": v.slope(),
                "intercept": v.intercept(), "range": v.range(), "missing": v.missing(), "distribution": distribution(v),
            });
            if let Some(modality) = v.modality() {
                told["modality"] = json!(modality.name());
            }
            told
        }
        Artefact::Labels(l) => {
            json!({ "kind": "labels", "grid": grid_facts(l.grid()), "classes": classes(l) })
        }
        Artefact::Mask(m) => json!({
            "kind": "mask", "grid": grid_facts(m.grid()), "voxels": m.count(), "level": m.level().is_some(),
        }),
        Artefact::Transfer(t) => ivd_io::transfer::to_json(t),
        Artefact::Lattice(l) => json!({
            "kind": "lattice", "grid": grid_facts(l.grid()), "vertices": l.keys().len(), "triangles": l.triangles().len(),
            "extent_mm": extent(l.positions()), "source": l.source(), "level": l.level(), "max_error_mm": l.max_error_mm(),
            "coarser": l.coarser().iter().map(|c| json!({
                "level": c.level, "triangles": c.triangles.len(), "max_error_mm": c.max_error_mm,
            })).collect::<Vec<_>>(),
        }),
        Artefact::Octree(o) => json!({
            "kind": "octree", "grid": grid_facts(o.grid()), "depth": o.depth(), "nodes": o.nodes().len(), "leaves": o.leaves(),
            "triangles": o.triangle_count(), "vertices": o.vertex_count(),
        }),
        Artefact::Motion(m) => json!({
            "kind": "motion", "vertices": m.vertex_count(), "reach": m.reach(),
            "frames": m.frames().iter().map(|f| json!({ "time": f.time, "displacement_mm": f.displacement[..] })).collect::<Vec<_>>(),
        }),
        Artefact::Displacement(d) => json!({
            "kind": "displacement", "grid": grid_facts(d.grid()), "time": d.time(), "forward_bricks": d.forward().stored(),
            "inverse_bricks": d.inverse().stored(), "inverse_residual_max_voxel": d.inverse_residual_max(),
            "min_det_j": d.min_det_j(), "two_sided": d.has_cut(),
        }),
        Artefact::Image(i) => json!({
            "kind": "image", "width": i.width(), "height": i.height(), "frames": i.frames(), "light": i.light().is_some(),
        }),
        Artefact::Tree(t) => json!({
            "kind": "tree", "grid": grid_facts(&t.grid), "linkage": t.linkage.name(), "nodes": t.nodes(), "leaves": t.leaf_count(),
            "heights": t.height_range(), "bridges": t.bridges,
        }),
    }
}

/// What a displacement field of another program holds, which is nothing that a stage gives: where it lies, and how far it leads.
pub fn describe_field(field: &GivenField) -> Value {
    let vectors = field.vectors.vectors();
    json!({
        "kind": "displacement field", "grid": grid_facts(&field.grid), "direction": field.direction.map(FieldDirection::name),
        "largest_mm": field.vectors.longest(),
        "voxels_moved": vectors.iter().filter(|vector| **vector != [0.0; 3]).count(),
    })
}

/// What a mesh of another program holds.
pub fn describe_mesh(mesh: &Mesh) -> Value {
    json!({
        "kind": "mesh", "vertices": mesh.positions.len(), "triangles": mesh.triangles.len(), "units": "mm", "space": "RAS",
        "extent_mm": extent(mesh.positions.iter().copied()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_lies_where_its_voxels_do() {
        let grid = Grid::new(
            [4, 3, 2],
            [2.0, 1.0, 5.0],
            [10.0, 0.0, 0.0],
            [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        );
        let grid = grid.unwrap();
        let mut ids = vec![0_u16; 24];
        // Voxels (1, 2, 0) and (2, 2, 1).
        (ids[9], ids[22]) = (5, 5);
        let voxels = ivd_core::Voxels::from(ids);
        let labels = Labels::from_volume(&ivd_core::Volume::new(grid, voxels).unwrap()).unwrap();
        let [told] = &classes(&labels)[..] else { panic!("one class") };
        assert_eq!(told["ml"], 0.02);
        assert_eq!(told["centre_mm"], json!([7.0, 2.0, 2.5]));
        assert_eq!(told["extent_mm"], json!({ "low": [5.0, 1.5, -2.5], "high": [9.0, 2.5, 7.5] }));
    }
}
