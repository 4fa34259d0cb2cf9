//! Interactive deformation: a [`Session`] holds a volume, its lattice at several levels of refinement, and the deformed volume;
//! an [`Event`] moves a handle, changes a stiffness, a method or a level, and the [`Update`] says which bricks of the volume changed.
//!
//! Work is proportional to the handles' reach. The whole volume is gone through only at the session's beginning, at the first event of a level, for
//! other warp parameters, where a part moves alone, and for every event that is mapped by finite elements. What doesn't change while a
//! handle moves is found once: the lattice of a level, its octree, the springs and their factor, every voxel's nearest point.
//!
//! **The state follows from the settings alone.** Solvers and maps start at rest for every event, so that no result depends on the way
//! to it: what a session shows is to the bit what the functions of [`ivd_motion`], [`ivd_map`] and
//! [`ivd_field`] give, undoing gives the bytes back, and a log of
//! events replayed on another machine of the same kind gives the same volume.
//!
//! ```
//! use ivd_core::{Exec, Grid, Volume, VoxelCoord, VoxelIndex, Voxels};
//! use ivd_motion::handles::{Action, Handle, Anchor};
//! use ivd_lattice::extract::{ExtractParams, Iso, extract};
//! use ivd_session::{Event, Session, Settings};
//!
//! // A ball of 10 mm, 100 inside and 0 outside.
//! let exec = Exec::default();
//! let grid = Grid::with_spacing([32; 3], [1.0; 3])?;
//! let inside = |i| VoxelCoord::from(grid.index(i)).0.add_scalar(-15.5).norm() < 10.0;
//! let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(i) { 100 } else { 0 }).collect();
//! let volume = Volume::new(grid, Voxels::from(voxels))?;
//! let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(50.0) }, &exec)?.lattice;
//!
//! let mut session = Session::new(volume, lattice, None, Settings::default(), &exec)?;
//! let top = Anchor::NearestTo([15.5, 15.5, 25.5]);
//! let handle = Handle { at: top, action: Action::Move([0.0; 3]), radius: 24.0 };
//! session.apply(Event::Add { id: None, handle }, &exec)?;
//! let update = session.apply(Event::Move { handle: 0, by: [0.0, 0.0, 3.0] }, &exec)?;
//! assert!(update.min_det_j > 0.0 && !update.dirty.is_empty());
//! assert_eq!(session.deformed().value(VoxelIndex([15, 15, 27])), 100.0);
//!
//! session.undo(&exec)?;
//! assert_eq!(session.deformed(), session.rest());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod bricks;
mod clip;
mod error;
mod event;
mod follow;
mod history;
mod level;
mod numbered;
mod session;
mod settings;
mod shown;

pub use clip::{Clip, ClipPart, ClipRule};
pub use error::Error;
pub use event::Event;
pub use history::{Entry, Step};
pub use numbered::{Id, Numbered, numbered};
pub use session::{Session, Times, Update};
pub use settings::{MapChoice, Physics, Settings};
