use std::fmt;
use std::str::FromStr;

use crate::{Displacement, Image, Labels, Lattice, Mask, Motion, Octree, TransferFunction, Tree, Volume};

/// A type that stages hand on.
pub trait Value: Sized + 'static {
    /// Its kind.
    const KIND: Kind;

    /// The value of this type, where the artefact holds one.
    fn of(artefact: &Artefact) -> Option<&Self>;

    /// The artefact that holds it.
    fn into_artefact(self) -> Artefact;
}

impl<T: Value> From<T> for Artefact {
    fn from(value: T) -> Self {
        value.into_artefact()
    }
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident($type:ty) = $name:literal,)*) => {
        /// What a value is: each type that stages hand on has one.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Kind {
            $($(#[$doc])* $kind,)*
        }

        impl Kind {
            /// Every kind.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$kind),*];

            /// Name as in a file's ending or a report: `volume`, `labels`, …
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)*
                }
            }
        }

        /// A value of any kind, on its way from one stage to the next. Bulk data may view a mapped file.
        #[derive(Debug, Clone, PartialEq)]
        #[allow(clippy::large_enum_variant, reason = "a handful exist at a time; a box would only be in the way")]
        pub enum Artefact {
            $($(#[$doc])* $kind($type),)*
        }

        impl Artefact {
            /// What it holds.
            pub fn kind(&self) -> Kind {
                ArtefactRef::from(self).kind()
            }
        }

        /// A borrowed value to write: nothing is copied on its way to the file.
        #[derive(Debug, Clone, Copy)]
        pub enum ArtefactRef<'a> {
            $($(#[$doc])* $kind(&'a $type),)*
        }

        impl ArtefactRef<'_> {
            /// What it holds.
            pub fn kind(&self) -> Kind {
                match self {
                    $(Self::$kind(_) => Kind::$kind,)*
                }
            }
        }

        impl<'a> From<&'a Artefact> for ArtefactRef<'a> {
            fn from(artefact: &'a Artefact) -> Self {
                match artefact {
                    $(Artefact::$kind(value) => Self::$kind(value),)*
                }
            }
        }

        $(
            impl<'a> From<&'a $type> for ArtefactRef<'a> {
                fn from(value: &'a $type) -> Self {
                    Self::$kind(value)
                }
            }

            impl Value for $type {
                const KIND: Kind = Kind::$kind;

                fn of(artefact: &Artefact) -> Option<&Self> {
                    match artefact {
                        Artefact::$kind(value) => Some(value),
                        _ => None,
                    }
                }

                fn into_artefact(self) -> Artefact {
                    Artefact::$kind(self)
                }
            }
        )*
    };
}
kinds! {
    /// A scalar volume with its brick min–max index.
    Volume(Volume) = "volume",
    /// A label for every voxel, and the classes.
    Labels(Labels) = "labels",
    /// A part of a volume, with an optional level function.
    Mask(Mask) = "mask",
    /// A transfer function.
    Transfer(TransferFunction) = "transfer",
    /// A model-fitting lattice.
    Lattice(Lattice) = "lattice",
    /// A linear octree over a lattice's grid.
    Octree(Octree) = "octree",
    /// Displacements of a lattice's vertices, one or many frames.
    Motion(Motion) = "motion",
    /// A sparse deformation of space, forward and inverse.
    Displacement(Displacement) = "displacement",
    /// A picture.
    Image(Image) = "image",
    /// A tree of merges over a volume's voxels.
    Tree(Tree) = "tree",
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Kind {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| format!("`{name}` is no artefact kind"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_found_by_its_name() {
        for (i, kind) in Kind::ALL.into_iter().enumerate() {
            assert_eq!(kind as usize, i);
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        assert!("volumes".parse::<Kind>().is_err());
    }
}
