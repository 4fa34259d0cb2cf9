//! One small value of every kind, awkward where it can be: oblique grids, NaN voxels, open intervals.

#![allow(clippy::unwrap_used, reason = "test values are sound")]

use ivd_artefact::{Artefact, ContentHash, Kind, Provenance};
use ivd_core::{
    Ball, Class, ClassRole, Displacement, ElementKey, FieldBricks, Frame, GradientTable, Grid, Image, Labels,
    Lattice, LatticeSource, LeafMeans, Linkage, Mask, Modality, Motion, NO_BRICK, Octree, OctreeNode,
    OctreeParts, TransferEntry, TransferFunction, Tree, TreeParts, Volume, Voxels,
};

/// A provenance with nested parameters and two inputs.
pub(crate) fn provenance() -> Provenance {
    Provenance::new("sample", serde_json::json!({"k": 5, "nested": {"b": [1.5, null], "a": "µ"}}))
        .with_input("volume", ContentHash([0x11; 32]))
        .with_input("labels", ContentHash([0x22; 32]))
}

/// A sheared grid with a left-handed, rotated frame and an odd origin.
pub(crate) fn grid(dims: [usize; 3]) -> Grid {
    let (s, c) = (0.6, 0.8);
    Grid::new(dims, [0.4, 0.5, 6.5], [1e6, -20.125, -0.0], [[-c, -s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])
        .unwrap()
}

/// The value of a kind.
pub(crate) fn sample(kind: Kind) -> Artefact {
    match kind {
        Kind::Volume => volume().into(),
        Kind::Labels => labels().into(),
        Kind::Mask => mask().into(),
        Kind::Transfer => transfer().into(),
        Kind::Lattice => lattice().into(),
        Kind::Octree => octree().into(),
        Kind::Motion => motion().into(),
        Kind::Displacement => displacement().into(),
        Kind::Image => image().into(),
        Kind::Tree => tree().into(),
    }
}

fn image() -> Image {
    let light = (0..48).map(|i| if i == 5 { f32::INFINITY } else { 0.1 * i as f32 }).collect();
    Image::of_frames([3, 2], 2, (0..48).collect()).unwrap().with_light(light).unwrap()
}

fn volume() -> Volume {
    let values: Vec<f32> = (0..180).map(|i| if i == 17 { f32::NAN } else { i as f32 * 0.25 - 3.0 }).collect();
    Volume::with_scale(grid([10, 9, 2]), Voxels::from(values), -0.5, 1024.0)
        .unwrap()
        .with_modality(Some(Modality::MagneticResonance))
}

fn labels() -> Labels {
    let class = |id, name: Option<&str>, lower, upper| Class {
        id,
        name: name.map(str::to_owned),
        mean: f64::from(id) * 100.1,
        sd: 0.1,
        voxels: 12,
        lower,
        upper,
    };
    let classes =
        vec![class(1, None, None, Some(49.3)), class(2, Some("Schädel"), Some(49.3), Some(f64::INFINITY))];
    Labels::new(grid([4, 3, 2]), (0..24).map(|i| i % 3).collect::<Vec<u16>>().into(), classes).unwrap()
}

fn mask() -> Mask {
    let inside: Vec<u8> = (0..24).map(|i| u8::from(i % 5 == 0)).collect();
    let level: Vec<f32> = (0..24).map(|i| if i % 5 == 0 { 0.75 } else { -1.25 }).collect();
    Mask::new(grid([4, 3, 2]), inside.into()).unwrap().with_level(level.into()).unwrap()
}

fn transfer() -> TransferFunction {
    let entry = TransferEntry {
        class: 2,
        role: ClassRole::Transition,
        rgb: [0.1, 0.2, 0.3],
        opacity: 0.7,
        lower: f64::NEG_INFINITY,
        upper: 0.1 + 0.2,
        softness: 0.0,
    };
    let table = (0..6).map(|i| [i as f32 / 6.0, 0.1, 1.0, 0.0]).collect();
    let by_gradient = (0..4).map(|i| [0.5, i as f32 / 4.0, 0.0, 1.0]).collect();
    TransferFunction::new([-1000.0, 3071.5], 3, 1.25, vec![0, 2], table, vec![entry])
        .unwrap()
        .with_gradient(GradientTable::new(0.125, [2, 2], by_gradient).unwrap())
}

/// An octahedron round voxel (1, 1, 1) of a 3 × 3 × 3 grid.
fn lattice() -> Lattice {
    let dims = [3, 3, 3];
    let mut corners: Vec<(ElementKey, [f32; 3], usize)> = (0..3_usize)
        .flat_map(|axis| [(axis, 0_usize), (axis, 1)])
        .map(|(axis, far)| {
            let mut padded = [2, 2, 2];
            padded[axis] -= 1 - far;
            let mut place = [0.0; 3];
            place[axis] = 0.5;
            (ElementKey::new(dims, padded, axis as u8), place, 2 * axis + far)
        })
        .collect();
    corners.sort_by_key(|c| c.0);
    let at = |which: usize| corners.iter().position(|c| c.2 == which).unwrap() as u32;
    let triangles: ivd_core::Buffer<_> = (0..8_usize)
        .map(|octant| {
            let [x, y, z] = [octant & 1, octant >> 1 & 1, octant >> 2];
            let corner = [at(x), at(2 + y), at(4 + z)];
            if (x + y + z) % 2 == 1 { corner } else { [corner[0], corner[2], corner[1]] }
        })
        .collect();
    Lattice::new(
        Grid::with_spacing(dims, [1.0, 2.0, 3.0]).unwrap(),
        corners.iter().map(|c| c.0).collect(),
        corners.iter().map(|c| c.1).collect(),
        triangles,
    )
    .unwrap()
    .with_source(LatticeSource::Interval { lower: Some(0.1), upper: None })
    .with_level(1)
    .with_max_error_mm(0.125)
}

fn octree() -> Octree {
    let mut nodes = vec![Octree::pack(OctreeNode::Internal { first_child: 1 })];
    nodes.extend((0..6).map(|_| Octree::pack(OctreeNode::Outside)));
    nodes.push(Octree::pack(OctreeNode::Inside));
    nodes.push(Octree::pack(OctreeNode::Surface { slot: 0 }));
    Octree::new(OctreeParts {
        grid: Grid::with_spacing([3, 3, 3], [1.0, 2.0, 3.0]).unwrap(),
        depth: 3,
        nodes: nodes.into(),
        leaf_start: vec![0, 3].into(),
        leaf_triangles: vec![0, 2, 7].into(),
        triangle_count: 8,
        vertex_count: 6,
    })
    .unwrap()
}

fn motion() -> Motion {
    let frame = |time: f64| Frame { time, displacement: vec![[0.0, -0.0, time], [0.1, 1e-300, -7.5]].into() };
    Motion::new(grid([4, 3, 2]), 2, vec![frame(0.0), frame(0.1)])
        .unwrap()
        .with_reach(vec![Ball { centre: [1.0, 2.0, 3.0], radius: 25.0 }])
        .unwrap()
        .with_space([1.5_f32, -2.0].map(|x| space([4, 3, 2], x)).to_vec())
        .unwrap()
}

/// A field whose vectors tell the bits of numbers apart.
fn space(dims: [usize; 3], x: f32) -> FieldBricks {
    let vectors: Vec<[f32; 3]> = (0..512).map(|i| [x * i as f32, -0.0, 1e-30]).collect();
    FieldBricks::new(dims, vec![0], vectors.into()).unwrap()
}

fn displacement() -> Displacement {
    let dims = [9, 3, 2];
    let vectors: Vec<[f32; 3]> = (0..512).map(|i| [i as f32, 0.0, -0.5]).collect();
    let forward = FieldBricks::new(dims, vec![NO_BRICK, 0], vectors.into()).unwrap();
    let mut vacated = vec![0; 54];
    vacated[8] = 1;
    Displacement::new(grid(dims), forward, FieldBricks::zero(dims))
        .unwrap()
        .with_time(0.2)
        .with_inverse_residual_max(1e-4)
        .with_min_det_j(0.25)
        .with_vacated(vacated.into())
        .unwrap()
}

/// Three leaves, one of them an island beyond missing voxels.
fn tree() -> Tree {
    Tree::new(TreeParts {
        grid: grid([4, 3, 2]),
        linkage: Linkage::Ward,
        leaves: (0..24).map(|i| if i == 23 { 3 } else { [1, 2, 2, 0][i % 4] }).collect::<Vec<u32>>().into(),
        merges: vec![[2, 1], [3, 2]].into(),
        heights: vec![0.1, 1e300].into(),
        ends: vec![1, 2].into(),
        counts: vec![6, 12, 1].into(),
        means: LeafMeans::F64(vec![-0.1, 7.25, 1e6 + 0.1].into()),
        squares: Some(vec![0.3, 0.0, 1e-300].into()),
        bridges: 1,
    })
    .unwrap()
}
