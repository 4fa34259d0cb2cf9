//! What a method of a stage declares, once.
//!
//! A method is a plain struct of parameters that implements [`Op`]. Its fields are at the same time the keys of a scene's section, the
//! flags of the command, the properties of the schema, the parameters in a record and what a cache key is made of; doc, unit, range
//! and default stand at the field and nowhere else:
//!
//! - `///` is its description, in help, editors and reports;
//! - `#[schemars(extend("x-unit" = "mm"))]` its unit, `"1"` where a number has none;
//! - `#[schemars(range(min = 0.0, max = 0.45))]` or `extend("exclusiveMinimum" = 0.0)` its range;
//! - `impl Default` with `#[serde(default)]` its default;
//! - `extend("x-alias" = ["old_name"])` names that it had before, which keep working;
//! - `extend("x-from" = "lattice.iso")` the key of a scene whose value it takes where it isn't given, unless the key of
//!   `extend("x-unless" = "boundary.class")` is;
//! - `extend("x-how" = true)` that it says how the work is done and not what comes of it: left out of cache keys.
//!
//! - `extend("x-knob" = "accuracy")` that it trades time for exactness: told in the schema.
//!
//! A field may be a number, a boolean, a list, or of a type that derives `JsonSchema`:
//!
//! - a word of several: an enum (`#[serde(rename_all = "lowercase")]`);
//! - a list of entries by kind: a `Vec` of an enum with `#[serde(tag = "kind")]`, as `[[space.step]]` is;
//! - a map by class: a `BTreeMap<u16, T>`. A map has no unit or range itself; `T` says them: a struct at its fields, as `Material` of ivd-motion, a number
//!   or text as a type of its own, as `Opacity` of ivd-render: the unit at the type, the range at what it holds. It is read by
//!   `deserialize_with = "ivd_core::op::by_class"` where its struct is flattened into another, and may be anywhere.
//!
//! What can't be done without is an `Option` that [`Op::check_together`] asks for. A new field changes the parameters that a cache key is made of: what is
//! kept of the method is made again, so that `REVISION` need not be raised for it. It is where the same parameters and inputs give another result.
//!
//! Of the things of a list, `extend("x-short" = ["at", "label"])` at their struct names two keys whose values may be written on a command
//! line without them: `x,y,z=2`. A key may have the name of a slot: on a command line what isn't a value of the key is a file for the slot.
//!
//! A figure has `extend("x-headline" = 1)` where it is the first that a person wants, `2` the second, and `"x-time" = true` where it is a
//! time or a rate of one run.
//!
//! Its inputs are a struct made by [`slots!`](crate::slots), its output a value, its figures a struct too: a figure that is renamed
//! no longer compiles where it is read. [`Stage`] lists the methods of a stage; nothing else names them.

mod by_class;
mod check;
mod declare;
mod failure;
mod field;
mod finite;
mod job;
mod schema;
mod slots;

pub use by_class::by_class;
pub use check::{check, check_fields, is_default, rename, unknown};
pub use declare::{Amount, Memory, Method, Place, PlaceKind, Stage, method};
pub use failure::Failure;
pub use field::{Field, alternatives, domain, fields, is_nullable, is_vector, kind, map_values, words};
pub use job::{FiguresOf, Gives, Job, Op, Output, Product, Remark, Want, object};
pub use schema::schema_of;
pub use slots::{Fill, Slot, Slots, Values, Voxelwise, unfit};
