//! Mapping: the motion of a lattice carried to the voxels (I-DOGME), certified free of folds, with its inverse.
//!
//! - [`octree()`], [`biharmonic()`] and [`fem()`] find the field, inside the lattice and round it, each in its own way. What follows is
//!   the same for all: a [`Displacement`](ivd_core::Displacement), forward and inverse.
//! - [`IncrementalMap`] and [`Biharmonic`] do so again and again while a lattice is dragged.
//! - [`space`] displaces voxels without a lattice, or goes on from a displacement: deflectors, spatial transfer functions, chain mail,
//!   cuts.
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, VoxelCoord, VoxelIndex, Voxels};
//! use ivd_field::warp;
//! use ivd_lattice::extract::{ExtractParams, Iso, extract};
//! use ivd_map::OctreeParams;
//! use ivd_motion::handles::{Action, Handle, Anchor};
//! use ivd_motion::ring::{self, RingParams};
//!
//! // A ball of 10 mm, 100 inside and 0 outside.
//! let exec = Exec::default();
//! let grid = Grid::with_spacing([32; 3], [1.0; 3])?;
//! let inside = |i| VoxelCoord::from(grid.index(i)).0.add_scalar(-15.5).norm() < 10.0;
//! let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(i) { 100 } else { 0 }).collect();
//! let volume = Volume::new(grid, Voxels::from(voxels))?;
//! let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(50.0) }, &exec)?.lattice;
//!
//! // Its top is pulled up by 3 mm; the surface within 24 mm follows.
//! let top = Anchor::NearestTo([15.5, 15.5, 25.5]);
//! let handle = Handle { at: top, action: Action::Move([0.0, 0.0, 3.0]), radius: 24.0 };
//! let solved = ring::solve(&lattice, &[handle], &[], &RingParams::default(), &exec)?;
//! let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec)?;
//! let mapped = ivd_map::octree(&lattice, &octree, &solved.motion, 0, &OctreeParams::default(), &exec)?;
//! assert!(mapped.figures.min_det_j > 0.0);
//!
//! let warped = warp::volume(&volume, &mapped.displacement, &warp::WarpParams::default(), &exec)?;
//! let above = VoxelIndex([15, 15, 27]);
//! assert_eq!((volume.value(above), warped.output.value(above)), (0.0, 100.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The field of `octree`
//!
//! Let `Ω` be the union of the handles' balls (centre `cᵢ`, radius `rᵢ`), each widened by the margin `m`, inside the
//! lattice *and outside it*. With `n(x)` the lattice point nearest to voxel `x`, `d = |x − n(x)|`, and `U` the vertices'
//! motion, linear on each triangle:
//!
//! ```text
//! u(x) = ω(x) · w(d / depth)  · U(n(x))      inside the lattice
//! u(x) = ω(x) · s(d / m)      · U(n(x))      outside it (a band that moves along)
//! ω(x) = 1 − Π (1 − s((|x − cᵢ| − rᵢ) / m))
//! s(t) = 1 − 3t² + 2t³ for 0 ≤ t ≤ 1;  1 below, 0 above
//! ```
//!
//! `w` is a [`DepthWeight`]. `u` and its slope fall to 0 on `∂Ω`; beyond it nothing moves, bit for bit. With
//! [`DepthWeight::One`] the inside of the balls moves exactly as the lattice does under a translation. A rotation of the
//! lattice is met on its surface only: inside, the error grows as `‖R − I‖ · d`.
//!
//! Without a given margin or depth each ball has its own, by the motion of its own vertices; balls that overlap adopt one another's by
//! degrees, and where several reach a voxel `m` and `depth` are the means of theirs, weighted by what each contributes to ω.
//!
//! The slope of `s` is at most 3/2, so with the default margin and depth of at least four times the largest motion neither band
//! nor cut-off of one ball can fold by itself; where balls of different motions overlap the certificate tells.
//!
//! # The field of `biharmonic`
//!
//! ```text
//! u = A_ω + ω r,      r minimises  ∫ ‖∇²r‖² + Σ_v ‖A_ω(x_v) + ω(x_v) r(x_v) − U_v‖² / σ²
//! ```
//!
//! `r` is trilinear on cells of some 4³ voxels in the same kind of `Ω`, except that each ball has a margin of its own; 0 with its slope on `∂Ω`; the integral is in world space. `A` is
//! the affine motion of the whole lattice where that explains it to a quarter, and exact in the balls. Motion is smooth through
//! the lattice, rotations are followed inside, and there is no depth or weight to choose. A motion that folds in one step is
//! made in parts, down to a sixteenth of it, each from where the one before has brought the vertices.
//!
//! # The field of `fem`
//!
//! The equilibrium of a neo-Hookean material in the same `Ω`, softer outside the lattice ([`FemParams::filler`]), whose vertices have
//! prescribed motion. The hexahedra are finest around the lattice. See its page.
//!
//! # The field of `body`
//!
//! What `ivd_motion::elastic` found for the voxels as it moved the lattice: nothing is found anew.
//!
//! # No folds
//!
//! 1. The nearest point jumps across the medial axis, and neighbouring pieces of a lattice may move differently. Where
//!    that folds a cell, or squeezes it below a twentieth, the field is diffused round the cell, and only there, in a few
//!    rounds.
//! 2. If cells still fold, the map is replaced by a flow in `2ᵏ` equal steps, `k ≤ 6`, resampled and certified again.
//! 3. The certificate ([`ivd_field::certificate`]) must hold at the end, and the vertices that move most must have followed
//!    to within [`Band::tolerance`]; else the map is refused: nothing can push deeper than what is left to compress.
//!
//! # A part that moves alone
//!
//! With [`Outside::Free`] voxels outside the lattice don't take part, except as the far corners of the cells at its
//! surface: in a layer of two voxel diagonals the field continues the part's. The certificate covers the cells of the
//! part; the inverse is built from them, and what the part left and didn't come to is flagged as vacated.
//!
//! Sources: the thesis, 6.2–6.3 (the nearest lattice point through the octree; it leaves `w` open) and 7.4.

#![forbid(unsafe_code)]

mod alone;
mod biharmonic;
mod body;
mod compose;
mod error;
mod fem;
mod frame;
mod incremental;
mod limit;
mod nearest;
mod nearest_weight;
mod octree;
mod outcome;
mod params;
mod region;
mod relax;
mod settle;
pub mod space;
mod stage;
#[cfg(test)]
mod tests;

pub use biharmonic::{Biharmonic, biharmonic};
pub use body::body;
pub use error::Error;
pub use fem::fem;
pub use incremental::IncrementalMap;
pub use ivd_field::param::Limit;
pub use nearest::nearest;
pub use nearest_weight::{Found, Hit, Nearest};
pub use octree::{Prepared, frames, octree};
pub use outcome::{MapFigures, MapResult, MapUpdate, SolveFigures, SurfaceFit};
pub use params::{
    Band, BiharmonicParams, BodyParams, DepthWeight, Elastic, FemParams, OctreeParams, Outside,
};
pub use stage::STAGE;
