//! What moves a lattice, as one method of several: solvers for its handles and bones, then changes of shape.
//!
//! [`RingMethod`], [`DynamicsMethod`], [`ProjectiveMethod`], [`XpbdMethod`] and [`ElasticMethod`] hold all that scenes and commands can say of the work;
//! [`crate::ring`], [`crate::mass_spring`], [`crate::elastic`], [`crate::rigid`] and [`crate::freeform`] do it.

mod asked;
mod bone;
mod figures;
mod handle;
mod params;
mod stage;

pub use asked::Asked;
pub use bone::Bone;
pub use figures::{BoneFigures, ElasticFigures, Figures, PickFigures, SpringFigures};
pub use handle::{Handle, Pin};
pub use params::{Body, DynamicsMethod, ElasticMethod, Moves, ProjectiveMethod, RingMethod, XpbdMethod};
pub use stage::{Inputs, RingInputs, STAGE};
