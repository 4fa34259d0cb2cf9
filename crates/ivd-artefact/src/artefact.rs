use ivd_core::{
    Artefact, Displacement, Image, Kind, Labels, Lattice, Mask, Motion, Octree, TransferFunction, Tree,
    Volume,
};

/// A borrowed value to write: nothing is copied on its way to the file.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs, reason = "the variants of Artefact, borrowed")]
pub enum ArtefactRef<'a> {
    Volume(&'a Volume),
    Labels(&'a Labels),
    Mask(&'a Mask),
    Transfer(&'a TransferFunction),
    Lattice(&'a Lattice),
    Octree(&'a Octree),
    Motion(&'a Motion),
    Displacement(&'a Displacement),
    Image(&'a Image),
    Tree(&'a Tree),
}

macro_rules! of_values {
    ($($variant:ident($type:ty),)*) => {
        impl ArtefactRef<'_> {
            /// What it holds.
            pub fn kind(&self) -> Kind {
                match self {
                    $(Self::$variant(_) => Kind::$variant,)*
                }
            }
        }

        impl<'a> From<&'a Artefact> for ArtefactRef<'a> {
            fn from(artefact: &'a Artefact) -> Self {
                match artefact {
                    $(Artefact::$variant(value) => Self::$variant(value),)*
                }
            }
        }

        $(
            impl<'a> From<&'a $type> for ArtefactRef<'a> {
                fn from(value: &'a $type) -> Self {
                    Self::$variant(value)
                }
            }
        )*
    };
}

of_values! {
    Volume(Volume),
    Labels(Labels),
    Mask(Mask),
    Transfer(TransferFunction),
    Lattice(Lattice),
    Octree(Octree),
    Motion(Motion),
    Displacement(Displacement),
    Image(Image),
    Tree(Tree),
}
