use std::collections::BTreeMap;

use super::Failure;
use crate::{Artefact, Grid, Kind, Labels, Mask, Value, Volume};

/// One input of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slot {
    /// Name, as in a record, on the command line (`--labels`), and of the value that fills it in a scene.
    pub name: &'static str,
    /// Kinds that fit.
    pub kinds: &'static [Kind],
    /// Whether the method works without it.
    pub optional: bool,
}

impl Slot {
    /// An input that must be there.
    pub const fn required(name: &'static str, kinds: &'static [Kind]) -> Self {
        Self { name, kinds, optional: false }
    }

    /// An input that may be absent.
    pub const fn optional(name: &'static str, kinds: &'static [Kind]) -> Self {
        Self { name, kinds, optional: true }
    }
}

/// The inputs of one run, by slot.
#[derive(Debug, Clone, Default)]
pub struct Values<'a>(BTreeMap<&'static str, &'a Artefact>);

impl<'a> Values<'a> {
    /// With a slot filled.
    #[must_use]
    pub fn with(mut self, slot: &'static str, value: &'a Artefact) -> Self {
        self.0.insert(slot, value);
        self
    }

    /// What fills a slot.
    pub fn get(&self, slot: &str) -> Option<&'a Artefact> {
        self.0.get(slot).copied()
    }
}

impl<'a> FromIterator<(&'static str, &'a Artefact)> for Values<'a> {
    fn from_iter<I: IntoIterator<Item = (&'static str, &'a Artefact)>>(pairs: I) -> Self {
        Self(pairs.into_iter().collect())
    }
}

/// The inputs of a method as a struct; made by [`slots!`](crate::slots).
pub trait Slots<'a>: Sized {
    /// The slots, in the order in which they are declared.
    const SLOTS: &'static [Slot];

    /// Takes the values.
    ///
    /// # Errors
    /// A usage error that names the slot which is empty, or filled with another kind.
    fn take(values: &Values<'a>) -> Result<Self, Failure>;
}

/// A type that an input can have.
pub trait Fill<'a>: Sized {
    /// Kinds that fit.
    const KINDS: &'static [Kind];
    /// Whether the slot may be empty.
    const OPTIONAL: bool = false;

    /// The value of a slot.
    ///
    /// # Errors
    /// A usage error that names the slot which is empty, or filled with another kind.
    fn fill(values: &Values<'a>, slot: &'static str) -> Result<Self, Failure>;
}

/// A usage error about what fills a slot, or that nothing does.
pub fn unfit(slot: &str, kinds: &[Kind], found: Option<&Artefact>) -> Failure {
    let Some(found) = found else { return Failure::usage(format!("its input {slot} is missing")) };
    let expected: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
    Failure::usage(format!(
        "its input {slot} is a {} artefact; it reads {}",
        found.kind(),
        expected.join(" or ")
    ))
}

impl<'a, T: Value> Fill<'a> for &'a T {
    const KINDS: &'static [Kind] = &[T::KIND];

    fn fill(values: &Values<'a>, slot: &'static str) -> Result<Self, Failure> {
        let found = values.get(slot);
        found.and_then(T::of).ok_or_else(|| unfit(slot, Self::KINDS, found))
    }
}

impl<'a, F: Fill<'a>> Fill<'a> for Option<F> {
    const KINDS: &'static [Kind] = F::KINDS;
    const OPTIONAL: bool = true;

    fn fill(values: &Values<'a>, slot: &'static str) -> Result<Self, Failure> {
        values.get(slot).map(|_| F::fill(values, slot)).transpose()
    }
}

/// A value with something at every voxel of a grid.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs, reason = "the variants are the types")]
pub enum Voxelwise<'a> {
    Volume(&'a Volume),
    Labels(&'a Labels),
    Mask(&'a Mask),
}

impl<'a> Voxelwise<'a> {
    /// Its grid.
    pub fn grid(self) -> &'a Grid {
        match self {
            Self::Volume(volume) => volume.grid(),
            Self::Labels(labels) => labels.grid(),
            Self::Mask(mask) => mask.grid(),
        }
    }
}

impl<'a> Fill<'a> for Voxelwise<'a> {
    const KINDS: &'static [Kind] = &[Kind::Volume, Kind::Labels, Kind::Mask];

    fn fill(values: &Values<'a>, slot: &'static str) -> Result<Self, Failure> {
        let found = values.get(slot);
        let volume = found.and_then(Volume::of).map(Self::Volume);
        let labels = || found.and_then(Labels::of).map(Self::Labels);
        let mask = || found.and_then(Mask::of).map(Self::Mask);
        volume.or_else(labels).or_else(mask).ok_or_else(|| unfit(slot, Self::KINDS, found))
    }
}

/// Declares the inputs of a method: `&T` must be there, `Option<&T>` may be.
///
/// ```
/// use ivd_core::{Labels, Volume, slots};
/// slots! {
///     /// What it reads.
///     pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels> }
/// }
/// ```
#[macro_export]
macro_rules! slots {
    ($(#[$meta:meta])* $vis:vis struct $name:ident<$l:lifetime> { $($(#[$doc:meta])* $field:ident: $type:ty),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy)]
        #[allow(missing_docs, reason = "fields are named as the slots, which say what fills them")]
        $vis struct $name<$l> { $($(#[$doc])* $vis $field: $type),* }

        impl<$l> $crate::op::Slots<$l> for $name<$l> {
            const SLOTS: &'static [$crate::op::Slot] = &[$($crate::op::Slot {
                name: stringify!($field),
                kinds: <$type as $crate::op::Fill<$l>>::KINDS,
                optional: <$type as $crate::op::Fill<$l>>::OPTIONAL,
            }),*];

            fn take(values: &$crate::op::Values<$l>) -> ::core::result::Result<Self, $crate::op::Failure> {
                Ok(Self { $($field: <$type as $crate::op::Fill<$l>>::fill(values, stringify!($field))?),* })
            }
        }
    };
}
