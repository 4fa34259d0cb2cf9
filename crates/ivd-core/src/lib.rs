//! The types that every stage of IVD (interactive volume deformation) shares.
//!
//! A scanned volume enters as a [`Volume`] on a [`Grid`]; stages turn it into [`Labels`], a [`TransferFunction`],
//! a [`Mask`], a [`Tree`], a [`Lattice`], an [`Octree`], a [`Motion`], a [`Displacement`] and an [`Image`]. This crate holds those
//! values, the execution context [`Exec`], how text is [`shown`] to a person, and what several stages work with
//! ([`geometry`], [`noise`], [`parallel`], [`sets`], [`srgb`]): no files, no arguments, no GPU.
//!
//! Conventions, kept everywhere:
//! - World space is millimetres, RAS (x to the patient's right, y to the front, z to the head), `f64`.
//! - [`VoxelIndex`], [`VoxelCoord`] and [`World`] are three types; a voxel's centre has integer voxel coordinates.
//! - Bulk data is linear, x fastest: voxel `(x, y, z)` is at `x + nx * (y + ny * z)`.
//! - A non-finite voxel is *no data*: label 0, outside every mask and lattice.
//!
//! ```
//! use ivd_core::{Grid, Volume, VoxelCoord, VoxelIndex, Voxels};
//!
//! let grid = Grid::with_spacing([4, 3, 2], [0.5, 0.5, 2.0]).unwrap();
//! let volume = Volume::new(grid, Voxels::from(vec![7_u8; 24])).unwrap();
//! assert_eq!(volume.value(VoxelIndex([3, 2, 1])), 7.0);
//! let world = volume.grid().world(VoxelCoord::from(VoxelIndex([2, 0, 1])));
//! assert_eq!(world.0.z, 2.0);
//! ```
#![forbid(unsafe_code)]

mod addressing;
mod bricks;
mod buffer;
mod bulk;
mod class_choice;
mod class_looks;
mod displacement;
mod error;
mod exec;
pub mod geometry;
mod grid;
mod image;
mod kernel;
mod labels;
mod lattice;
mod mask;
mod mesh;
mod motion;
pub mod noise;
mod octree;
pub mod op;
pub mod parallel;
pub mod sets;
mod shown;
mod spill;
pub mod srgb;
mod transfer;
mod tree;
mod value;
pub mod vertex_class;
mod volume;
mod voxels;

pub use addressing::VertexDescription;
pub use bricks::{BRICK, BrickIndex, BrickRange, BrickRanges};
pub use buffer::{Buffer, ByteSource};
pub use bulk::SpillVec;
pub use class_choice::ClassChoice;
pub use class_looks::ClassLook;
pub use displacement::{Displacement, FieldBricks, NO_BRICK};
pub use error::{Classified, Error, ErrorClass, GridError, ParamError};
pub use exec::{Cancel, Exec, Iteration, NoObserver, Observer, has_avx2};
pub use grid::{Grid, Reference, VoxelCoord, VoxelIndex, World};
pub use image::Image;
pub use kernel::{Answer, Device, DeviceForm, Kernel, Served, ServedBy};
pub use labels::{Class, Labels, NO_DATA};
pub use lattice::{CoarseLevel, ElementKey, Lattice, LatticeSource, MIN_EDGE_FRACTION};
pub use mask::Mask;
pub use mesh::{Mesh, MeshAddress};
pub use motion::{Ball, Frame, InteriorPoints, Motion, Role};
pub use octree::{LeafKind, OCTREE_MAX_DEPTH, Octree, OctreeNode, OctreeParts};
pub use shown::{counted, shown};
pub use spill::{Spill, SpillSpace};
pub use transfer::{ClassRole, GradientTable, TransferEntry, TransferFunction};
pub use tree::{LeafMeans, Linkage, Merged, Tree, TreeParts};
pub use value::{Artefact, ArtefactRef, Kind, Value};
pub use volume::{Modality, Volume};
pub use voxels::{Scalar, VoxelType, Voxels};
