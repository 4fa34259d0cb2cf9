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

impl ArtefactRef<'_> {
    /// What it holds.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Volume(_) => Kind::Volume,
            Self::Labels(_) => Kind::Labels,
            Self::Mask(_) => Kind::Mask,
            Self::Transfer(_) => Kind::Transfer,
            Self::Lattice(_) => Kind::Lattice,
            Self::Octree(_) => Kind::Octree,
            Self::Motion(_) => Kind::Motion,
            Self::Displacement(_) => Kind::Displacement,
            Self::Image(_) => Kind::Image,
            Self::Tree(_) => Kind::Tree,
        }
    }
}

impl<'a> From<&'a Artefact> for ArtefactRef<'a> {
    fn from(artefact: &'a Artefact) -> Self {
        match artefact {
            Artefact::Volume(value) => Self::Volume(value),
            Artefact::Labels(value) => Self::Labels(value),
            Artefact::Mask(value) => Self::Mask(value),
            Artefact::Transfer(value) => Self::Transfer(value),
            Artefact::Lattice(value) => Self::Lattice(value),
            Artefact::Octree(value) => Self::Octree(value),
            Artefact::Motion(value) => Self::Motion(value),
            Artefact::Displacement(value) => Self::Displacement(value),
            Artefact::Image(value) => Self::Image(value),
            Artefact::Tree(value) => Self::Tree(value),
        }
    }
}

macro_rules! from_value {
    ($($variant:ident($type:ty),)*) => {$(
        impl<'a> From<&'a $type> for ArtefactRef<'a> {
            fn from(value: &'a $type) -> Self {
                Self::$variant(value)
            }
        }
    )*};
}

from_value! {
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
