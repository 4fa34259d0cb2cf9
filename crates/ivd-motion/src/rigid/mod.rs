//! Rigid parts: bones in soft tissue (thesis, 6.4).
//!
//! A [`BoneSpec`] holds vertices of a lattice, by their place ([`Region`]), by the class of the voxels beside them, or both, and
//! moves them by one rigid motion. The motion is given ([`RigidTransform`]) or fitted to the handles that lie on the bone. A bone with a
//! parent goes with it and turns about their joint: the motions of both agree there, exactly. [`Skeleton`] says which bone
//! holds which vertex and where each bone is at any part of the way.
//!
//! The solvers of [`crate::mass_spring`] take the bones' vertices as held at places that move, so that soft tissue has the same
//! displacement at the interface; the force that it takes is told for each bone. The thesis maps displacements onto the soft
//! part "in the opposite direction"; that would open a gap. It is the reaction force that is opposite.
//!
//! Every frame is a rigid motion by itself: a part of the angle is a true rotation, and no place is interpolated.
//!
//! ```
//! use ivd_motion::rigid::{Drive, BoneSpec, Region, RigidTransform};
//!
//! let vertebra = BoneSpec {
//!     name: "C5".into(),
//!     parent: None,
//!     region: Some(Region::Box { low: [0.0, 0.0, 40.0], high: [64.0, 64.0, 48.0] }),
//!     class: Some(4),
//!     drive: Drive::Prescribed(RigidTransform { pivot: [32.0, 28.0, 38.0], axis: [1.0, 0.0, 0.0], angle: -6.0, by: [0.0; 3] }),
//!     reach: 30.0,
//! };
//! vertebra.check()?;
//! # Ok::<(), ivd_core::ParamError>(())
//! ```

mod bone_spec;
mod fit;
mod holders;
mod inner;
mod skeleton;
#[cfg(test)]
mod tests;
mod turn;

pub use bone_spec::{BoneSpec, Drive, Region};
pub(crate) use skeleton::Rig;
pub use skeleton::{Bone, BoneMotion, Skeleton};
pub use turn::RigidTransform;
