//! `tree`: leaves of the voxels, merges, heights, and the leaves' figures.

use ivd_core::{LeafMeans, Linkage, Tree, TreeParts};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::real::{GridContent, voxel_shape};
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    linkage: Linkage,
    bridges: u32,
    spread: bool,
}

pub(super) fn encode(tree: &Tree) -> Result<Encoded<'_>, String> {
    let content = Content {
        grid: (&tree.grid).into(),
        linkage: tree.linkage,
        bridges: tree.bridges,
        spread: tree.squares.is_some(),
    };
    let list = |len: usize| vec![len as u64];
    let leaves = list(tree.leaf_count());
    let mut sections = vec![
        SectionBytes::new("leaves", Element::U32, voxel_shape(tree.grid.dims()), &tree.leaves),
        SectionBytes::new("merges", Element::U32, vec![tree.merges.len() as u64, 2], &tree.merges),
        SectionBytes::new("heights", Element::F64, list(tree.heights.len()), &tree.heights),
        SectionBytes::new("ends", Element::U32, list(tree.ends.len()), &tree.ends),
        SectionBytes::new("counts", Element::U32, leaves.clone(), &tree.counts),
        match &tree.means {
            LeafMeans::F32(means) => SectionBytes::new("means", Element::F32, leaves.clone(), means),
            LeafMeans::F64(means) => SectionBytes::new("means", Element::F64, leaves.clone(), means),
        },
    ];
    let squares = tree.squares.iter();
    sections
        .extend(squares.map(|squares| SectionBytes::new("squares", Element::F64, leaves.clone(), squares)));
    Encoded::new(&content, sections)
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Tree, Problem> {
    let content: Content = decoder.content()?;
    let grid = content.grid.grid()?;
    let parts = TreeParts {
        linkage: content.linkage,
        bridges: content.bridges,
        leaves: decoder.take("leaves", Element::U32, &voxel_shape(grid.dims()))?,
        merges: decoder.take_rows("merges", Element::U32, &[2])?,
        heights: decoder.take_rows("heights", Element::F64, &[])?,
        ends: decoder.take_rows("ends", Element::U32, &[])?,
        counts: decoder.take_rows("counts", Element::U32, &[])?,
        means: if decoder.holds("means", Element::F32) {
            LeafMeans::F32(decoder.take_rows("means", Element::F32, &[])?)
        } else {
            LeafMeans::F64(decoder.take_rows("means", Element::F64, &[])?)
        },
        squares: content.spread.then(|| decoder.take_rows("squares", Element::F64, &[])).transpose()?,
        grid,
    };
    Ok(Tree::new(parts)?)
}
