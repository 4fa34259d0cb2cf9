//! What an artefact holds, as figures.

use ivd_artefact::Artefact;
use ivd_core::{Grid, VoxelCoord};
use nalgebra::Vector3;
use serde_json::{Value, json};

/// Where a grid lies: places are in mm, RAS (x to the right, y to the front, z to the head), and its extent is that of the voxels' outer
/// faces.
fn grid_facts(grid: &Grid) -> Value {
    let faces = grid.dims().map(|n| [-0.5, n as f64 - 0.5]);
    let corners = (0..8_usize).map(|corner| {
        let place: [f64; 3] = std::array::from_fn(|a| faces[a][corner >> a & 1]);
        grid.world(VoxelCoord(place.into())).0
    });
    let middle = grid.dims().map(|n| (n as f64 - 1.0) / 2.0);
    json!({
        "dims": grid.dims(), "spacing": grid.spacing(), "origin": grid.origin(), "direction": grid.direction(), "in_patient": grid.in_patient(),
        "units": "mm", "space": "RAS", "extent_mm": extent(corners),
        "centre_mm": <[f64; 3]>::from(grid.world(VoxelCoord(middle.into())).0),
    })
}

/// The box of places, as its least and greatest coordinates; null where there are none.
fn extent(places: impl IntoIterator<Item = Vector3<f64>>) -> Value {
    let both = places.into_iter().map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.inf(&p), high.sup(&p)));
    both.map_or(
        Value::Null,
        |(low, high)| json!({ "low": <[f64; 3]>::from(low), "high": <[f64; 3]>::from(high) }),
    )
}

/// What an artefact holds, as JSON: dims, ranges, classes, counts; for motions every displacement.
pub fn describe(artefact: &Artefact) -> Value {
    match artefact {
        Artefact::Volume(v) => json!({
            "kind": "volume", "grid": grid_facts(v.grid()), "type": v.voxel_type().name(), "slope": v.slope(),
            "intercept": v.intercept(), "range": v.range(), "missing": v.missing(),
        }),
        Artefact::Labels(l) => {
            json!({ "kind": "labels", "grid": grid_facts(l.grid()), "classes": l.classes() })
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
        Artefact::Image(i) => json!({ "kind": "image", "width": i.width(), "height": i.height() }),
        Artefact::Tree(t) => json!({
            "kind": "tree", "grid": grid_facts(&t.grid), "linkage": t.linkage.name(), "nodes": t.nodes(), "leaves": t.leaf_count(),
            "heights": t.height_range(), "bridges": t.bridges,
        }),
    }
}
