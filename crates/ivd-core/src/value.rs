use crate::{
    Displacement, Image, Kind, Labels, Lattice, Mask, Motion, Octree, TransferFunction, Tree, Volume,
};

/// A value of any kind, on its way from one stage to the next. Bulk data may view a mapped file.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a handful exist at a time; a box would only be in the way")]
pub enum Artefact {
    /// A scalar volume.
    Volume(Volume),
    /// A segmentation.
    Labels(Labels),
    /// A part of a volume.
    Mask(Mask),
    /// A transfer function.
    Transfer(TransferFunction),
    /// A lattice.
    Lattice(Lattice),
    /// An octree.
    Octree(Octree),
    /// A motion of a lattice.
    Motion(Motion),
    /// A deformation of space.
    Displacement(Displacement),
    /// A picture.
    Image(Image),
    /// A tree of merges.
    Tree(Tree),
}

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

macro_rules! values {
    ($($variant:ident($type:ty)),* $(,)?) => {
        impl Artefact {
            /// What it holds.
            pub fn kind(&self) -> Kind {
                match self {
                    $(Self::$variant(_) => Kind::$variant,)*
                }
            }
        }

        $(
            impl Value for $type {
                const KIND: Kind = Kind::$variant;

                fn of(artefact: &Artefact) -> Option<&Self> {
                    match artefact {
                        Artefact::$variant(value) => Some(value),
                        _ => None,
                    }
                }

                fn into_artefact(self) -> Artefact {
                    Artefact::$variant(self)
                }
            }
        )*
    };
}
values! {
    Volume(Volume), Labels(Labels), Mask(Mask), Transfer(TransferFunction), Lattice(Lattice), Octree(Octree), Motion(Motion),
    Displacement(Displacement), Image(Image), Tree(Tree),
}
