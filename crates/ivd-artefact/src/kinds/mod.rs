//! One codec a kind: which sections it has, and what it keeps beside them as JSON.

pub(crate) mod displacement;
mod encoded;
pub(crate) mod image;
pub(crate) mod labels;
pub(crate) mod lattice;
pub(crate) mod mask;
pub(crate) mod motion;
pub(crate) mod octree;
mod real;
mod sections;
pub(crate) mod transfer;
pub(crate) mod tree;
pub(crate) mod volume;

pub(crate) use encoded::Encoded;
pub(crate) use sections::{Decoder, SectionBytes};

use crate::error::Problem;
use crate::{Artefact, ArtefactRef, Kind};

/// Encodes a value. What can't be written (not a number, parts that don't fit) is told in words.
pub(crate) fn encode(artefact: ArtefactRef<'_>) -> Result<Encoded<'_>, String> {
    match artefact {
        ArtefactRef::Volume(value) => volume::encode(value),
        ArtefactRef::Labels(value) => labels::encode(value),
        ArtefactRef::Mask(value) => mask::encode(value),
        ArtefactRef::Transfer(value) => transfer::encode(value),
        ArtefactRef::Lattice(value) => lattice::encode(value),
        ArtefactRef::Octree(value) => octree::encode(value),
        ArtefactRef::Motion(value) => motion::encode(value),
        ArtefactRef::Displacement(value) => displacement::encode(value),
        ArtefactRef::Image(value) => image::encode(value),
        ArtefactRef::Tree(value) => tree::encode(value),
    }
}

/// Decodes a value of a kind; every section must be used.
pub(crate) fn decode(kind: Kind, decoder: &mut Decoder<'_>) -> Result<Artefact, Problem> {
    let artefact = match kind {
        Kind::Volume => volume::decode(decoder)?.into(),
        Kind::Labels => labels::decode(decoder)?.into(),
        Kind::Mask => mask::decode(decoder)?.into(),
        Kind::Transfer => transfer::decode(decoder)?.into(),
        Kind::Lattice => lattice::decode(decoder)?.into(),
        Kind::Octree => octree::decode(decoder)?.into(),
        Kind::Motion => motion::decode(decoder)?.into(),
        Kind::Displacement => displacement::decode(decoder)?.into(),
        Kind::Image => image::decode(decoder)?.into(),
        Kind::Tree => tree::decode(decoder)?.into(),
    };
    decoder.finish()?;
    Ok(artefact)
}
