//! `labels`: `ids`, a `u16` a voxel; the classes as JSON.

use ivd_core::{Class, Labels};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::{GridContent, Real, voxel_shape};
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    classes: Vec<ClassContent>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ClassContent {
    id: u16,
    name: Option<String>,
    mean: Real,
    sd: Real,
    voxels: u64,
    lower: Option<Real>,
    upper: Option<Real>,
}

impl From<&Class> for ClassContent {
    fn from(class: &Class) -> Self {
        Self {
            id: class.id,
            name: class.name.clone(),
            mean: Real(class.mean),
            sd: Real(class.sd),
            voxels: class.voxels,
            lower: class.lower.map(Real),
            upper: class.upper.map(Real),
        }
    }
}

impl From<ClassContent> for Class {
    fn from(class: ClassContent) -> Self {
        Self {
            id: class.id,
            name: class.name,
            mean: class.mean.0,
            sd: class.sd.0,
            voxels: class.voxels,
            lower: class.lower.map(|v| v.0),
            upper: class.upper.map(|v| v.0),
        }
    }
}

pub(super) fn encode(labels: &Labels) -> Result<Encoded<'_>, String> {
    let content = Content {
        grid: labels.grid().into(),
        classes: labels.classes().iter().map(ClassContent::from).collect(),
    };
    let ids = SectionBytes::new("ids", Element::U16, voxel_shape(labels.grid().dims()), labels.ids());
    Encoded::new(&content, vec![ids])
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Labels, Problem> {
    let content: Content = decoder.content()?;
    let grid = content.grid.grid()?;
    let ids = decoder.take("ids", Element::U16, &voxel_shape(grid.dims()))?;
    Ok(Labels::new(grid, ids, content.classes.into_iter().map(Class::from).collect())?)
}
