//! Parameters that may be written in several ways; one of them is kept.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::Side;

/// Most pixels along a side of a picture, as the schema says below.
pub(crate) const LONGEST: usize = 32768;

/// What a view may be written as.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Angles {
    Side(Side),
    Angles([f64; 2]),
}

/// Azimuth and elevation of a view.
pub(crate) fn angles<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
    Ok(match Angles::deserialize(deserializer)? {
        Angles::Side(side) => side.angles(),
        Angles::Angles(angles) => angles,
    })
}

/// What the size of a picture may be written as.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Size {
    Square(#[schemars(range(min = 1, max = LONGEST))] usize),
    Sides(#[schemars(inner(range(min = 1, max = LONGEST)))] [usize; 2]),
}

/// Width and height of a picture.
pub(crate) fn size<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[usize; 2], D::Error> {
    Ok(match Size::deserialize(deserializer)? {
        Size::Square(side) => [side; 2],
        Size::Sides(sides) => sides,
    })
}
