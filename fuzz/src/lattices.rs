//! Lattices that no volume would give, and what is done with them.

use ivd_core::{ElementKey, Grid, Lattice, Octree, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures;
use ivd_lattice::refine::{RefineParams, Target, collapse};
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::ring::RingParams;
use nalgebra::Vector3;

use crate::{Bytes, exec, stages};

/// Builds a lattice (cut from tiny noise, or any triangles) with handles, and takes it through every stage.
pub fn check(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let Some(grid) = grid(&mut bytes) else { return };
    let handles: Vec<Handle> = (0..bytes.below(4)).map(|_| handle(&mut bytes)).collect();
    let fixed: Vec<Pin> =
        (0..bytes.below(3)).map(|_| Pin { at: at(&mut bytes), radius: bytes.f64() }).collect();
    let target = match bytes.u8() % 3 {
        0 => Target::Level(bytes.u8()),
        1 => Target::Ratio(bytes.f64()),
        _ => Target::MaxError(bytes.f64()),
    };
    let lattice = if bytes.u8() % 2 == 0 { cut(grid, &mut bytes) } else { soup(grid, &mut bytes) };
    let Some(lattice) = lattice else { return };
    take_through(&lattice, &handles, &fixed, target);
}

/// Refines, indexes, moves and maps a lattice.
pub fn take_through(lattice: &Lattice, handles: &[Handle], fixed: &[Pin], target: Target) {
    let closed = figures::measure(lattice).is_closed_manifold();
    let params = RefineParams { target: target.into(), ..RefineParams::default() };
    let refined = collapse(lattice, &params, exec()).map(|refined| refined.lattice);
    for lattice in std::iter::once(lattice).chain(refined.as_ref().ok()) {
        assert!(lattice.max_error_mm() >= 0.0);
        if closed {
            assert!(figures::measure(lattice).is_closed_manifold(), "refinement opened a closed lattice");
        }
        let Some(octree) = octree(lattice) else { continue };
        search(lattice, &octree);
        let params = RingParams { dt: Some(0.01), ..RingParams::default() };
        stages::move_lattice(lattice, &octree, handles, fixed, &params);
    }
}

fn octree(lattice: &Lattice) -> Option<Octree> {
    ivd_octree::build(lattice, &ivd_octree::Params::default(), exec()).ok()
}

/// Holds nearest points against all triangles' corners: none is nearer.
fn search(lattice: &Lattice, octree: &Octree) {
    let _ = ivd_octree::inside(lattice, exec());
    let Ok(index) = ivd_octree::prepare(lattice, octree) else { return };
    let positions = lattice.local_positions();
    for point in [Vector3::zeros(), Vector3::new(1.0, 2.5, -40.0)] {
        let Some(found) = index.nearest(point, f64::INFINITY) else { continue };
        let corners = lattice.triangles().iter().flatten();
        let least = corners.map(|&v| (positions[v as usize] - point).norm()).fold(f64::INFINITY, f64::min);
        assert!(
            found.distance_mm <= least * (1.0 + 1e-9) + 1e-9,
            "{found:?} from {point:?}, a corner at {least}: {lattice:?}"
        );
    }
}

/// A grid of 1 to 6 voxels a side with any spacing, origin and frame that it takes.
pub fn grid(bytes: &mut Bytes) -> Option<Grid> {
    let dims = [0; 3].map(|_: i32| 1 + bytes.below(6));
    match bytes.u8() % 4 {
        0 | 1 => Grid::with_spacing(dims, [1.0, 1.0, 1.5]).ok(),
        2 => Grid::with_spacing(dims, bytes.triple()).ok(),
        _ => {
            let columns = [bytes.triple(), bytes.triple(), bytes.triple()];
            Grid::new(dims, bytes.triple(), bytes.triple(), columns).ok()
        }
    }
}

fn at(bytes: &mut Bytes) -> Anchor {
    if bytes.u8() % 2 == 0 {
        Anchor::NearestTo(bytes.triple())
    } else {
        Anchor::Vertex(bytes.below(64) as u32)
    }
}

fn handle(bytes: &mut Bytes) -> Handle {
    let at = at(bytes);
    let vector = bytes.triple();
    let action = if bytes.u8() % 2 == 0 { Action::Move(vector) } else { Action::Force(vector) };
    Handle { at, action, radius: bytes.f64() }
}

/// The lattice of noise: closed, with every case of a cell.
fn cut(grid: Grid, bytes: &mut Bytes) -> Option<Lattice> {
    let voxels: Vec<u8> = (0..grid.len()).map(|_| bytes.u8()).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).ok()?;
    let params = ExtractParams { iso: Iso::Value(f64::from(bytes.u8())) };
    extract(&volume, None, &params, exec()).map(|cut| cut.lattice).ok()
}

/// Any keys, places and triangles; none where they make no lattice.
fn soup(grid: Grid, bytes: &mut Bytes) -> Option<Lattice> {
    let dims = grid.dims();
    let mut corners: Vec<(ElementKey, [f32; 3])> = (0..bytes.below(24))
        .map(|_| {
            let padded = dims.map(|d| bytes.below(d + 2));
            let element = bytes.u8() % 8;
            let place = match bytes.u8() % 4 {
                0 => [bytes.f32(), bytes.f32(), bytes.f32()],
                _ => [0; 3].map(|_: i32| f32::from(bytes.u8()) / 255.0),
            };
            (ElementKey::new(dims, padded, element), place)
        })
        .collect();
    if bytes.u8() % 8 != 0 {
        corners.sort_by_key(|corner| corner.0);
        corners.dedup_by_key(|corner| corner.0);
    }
    let n = corners.len() + usize::from(bytes.u8() % 16 == 0);
    let triangles = (0..bytes.below(64)).map(|_| [0; 3].map(|_: i32| bytes.below(n) as u32)).collect();
    Lattice::new(
        grid,
        corners.iter().map(|corner| corner.0).collect(),
        corners.iter().map(|corner| corner.1).collect(),
        triangles,
    )
    .ok()
}
