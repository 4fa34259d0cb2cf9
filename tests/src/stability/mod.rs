//! The harness for numerical stability: awkward cases, random scenes, and what must hold of every stage's result.
//!
//! - [`backend`]: where stages run. A backend overrides the stages that it has; the CPU is the default of each.
//! - [`subject`]: a stage under test; [`chain`]: a case carried through all stages, each checked as soon as it has run.
//! - [`invariants`]: what must hold, against analytic answers and plain twins.
//! - [`nasty`]: the table of cases that must not break anything; [`scene`]: random ones from a seed.
//! - [`spaces`]: random steps in space.
//! - [`symmetry`]: the same case mirrored, turned, scaled or moved.

pub mod backend;
mod bodies;
pub mod case;
pub mod chain;
mod clusters;
pub mod determinism;
mod inputs;
pub mod invariants;
pub mod meshes;
mod motions;
pub mod nasty;
pub mod scene;
pub mod seeded;
pub mod spaces;
pub mod subject;
pub mod subjects;
mod surfaces;
pub mod symmetry;
