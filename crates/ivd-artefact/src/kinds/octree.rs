//! `octree`: `nodes`, `leaf_start` and `leaf_triangles`, all `u32`.

use ivd_core::{Octree, OctreeParts};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::GridContent;
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    depth: u8,
    triangle_count: u32,
    vertex_count: u32,
}

pub(super) fn encode(octree: &Octree) -> Result<Encoded<'_>, String> {
    let content = Content {
        grid: octree.grid().into(),
        depth: octree.depth(),
        triangle_count: octree.triangle_count(),
        vertex_count: octree.vertex_count(),
    };
    let sections = vec![
        list("nodes", octree.nodes()),
        list("leaf_start", octree.leaf_start()),
        list("leaf_triangles", octree.leaf_triangles()),
    ];
    Encoded::new(&content, sections)
}

fn list<'a>(name: &'static str, values: &'a [u32]) -> SectionBytes<'a> {
    SectionBytes::new(name, Element::U32, vec![values.len() as u64], values)
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Octree, Problem> {
    let content: Content = decoder.content()?;
    let mut list = |name| decoder.take_rows::<u32>(name, Element::U32, &[]);
    Ok(Octree::new(OctreeParts {
        nodes: list("nodes")?,
        leaf_start: list("leaf_start")?,
        leaf_triangles: list("leaf_triangles")?,
        grid: content.grid.grid()?,
        depth: content.depth,
        triangle_count: content.triangle_count,
        vertex_count: content.vertex_count,
    })?)
}
