use ivd_core::{ElementKey, Grid, LatticeSource};

use super::spring::Vectors;
use super::*;
use crate::handles::Anchor;

mod body_of;
mod explicit;
mod extremes;
mod implicit;
mod simd;
mod sums;

/// Parameters with these springs, all else by default, but that a handle grips its vertex alone: what oracles say is of single vertices.
fn with_springs(springs: Springs) -> Params {
    let springs = Springs { grip: springs.grip.or(Some(0.0)), push: springs.push.or(Some(true)), ..springs };
    Params { springs, ..Params::default() }
}

/// Vertices 1 mm apart on the layer z = 0.5, `width` by `height`, in these triangles.
fn flat(width: usize, height: usize, triangles: Vec<[u32; 3]>) -> Lattice {
    let grid = Grid::with_spacing([width, height, 2], [1.0; 3]).unwrap();
    let key = |i: usize| ElementKey::new([width, height, 2], [i % width + 1, i / width + 1, 1], 2);
    Lattice::new(
        grid.clone(),
        (0..width * height).map(key).collect(),
        vec![[0.0, 0.0, 0.5]; width * height].into(),
        triangles.into(),
    )
    .unwrap()
    .with_source(LatticeSource::Mask)
}

/// `count` vertices in a row along x, a spring between every two neighbours.
fn rod(count: usize) -> Lattice {
    // A triangle that names a corner twice is an edge.
    flat(count, 1, (1..count as u32).map(|i| [i - 1, i, i]).collect())
}

/// A sheet of squares, each halved, the diagonals mirrored about the middle.
fn sheet(side: usize) -> Lattice {
    let at = |x: usize, y: usize| (x + side * y) as u32;
    let mut triangles = Vec::new();
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            if x < side / 2 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    flat(side, side, triangles)
}

fn moved(vertex: usize, by: [f64; 3], radius: f64) -> Handle {
    Handle { at: Anchor::Vertex(vertex as u32), action: Action::Move(by), radius }
}

fn pulled(vertex: usize, force: [f64; 3], radius: f64) -> Handle {
    Handle { at: Anchor::Vertex(vertex as u32), action: Action::Force(force), radius }
}

fn pin(vertex: usize) -> Pin {
    Pin { at: Anchor::Vertex(vertex as u32), radius: 0.0 }
}

fn run(
    lattice: &Lattice,
    handles: &[Handle],
    fixed: &[Pin],
    params: &Params,
) -> Result<MassSpringResult, Error> {
    solve(lattice, None, handles, fixed, params, &Exec::default())
}

fn last(solved: &MassSpringResult) -> &Vectors {
    &solved.motion.frames().last().unwrap().displacement
}

/// The body that handles reach.
fn body(lattice: &Lattice, handles: &[Handle], fixed: &[Pin], params: &Params) -> Body {
    Prepared::new(lattice, None, handles, fixed, params, &Exec::default()).unwrap().body
}

/// Numbers in −1…1 without a pattern.
fn noise(count: usize) -> Vec<[f64; 3]> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| [next(), next(), next()]).collect()
}
