//! A tree while it is grown: its merges first, and the figures of its leaves only when they are wanted.

use ivd_core::{Error, Exec, Linkage, Mask, ParamError, SpillVec, Tree, TreeParts, Volume, with_voxels};

use super::cut::{self, CutParams, LeafFigures, Stored};
use super::dendrogram::{self, Dendrogram};
use super::field::{Apart, Field};
use super::figures::{self, Figures, Leaves};
use super::merges::Parts;
use super::{Hvs, HvsParams, cells, excess, forest, graph, single, ward};
use crate::moments::Frame;
use crate::{Segmentation, selection};

/// Voxels between two looks at whether to stop.
const CHUNK: usize = 1 << 16;

/// Who joined whom, and which voxels the leaves hold.
pub(super) struct Grown {
    leaves: SpillVec<u32>,
    count: usize,
    merges: Parts,
    /// `None` where every leaf has one value, which is as quickly read from the volume.
    figures: Option<Figures>,
}

impl Grown {
    pub(super) fn of(
        volume: &Volume,
        mask: Option<&Mask>,
        params: &HvsParams,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let scope = selection::of(volume, mask, params.within, exec)?;
        with_voxels!(volume.voxels(), slice => grow(volume, &Field::new(volume, slice, scope.as_deref()), params, exec))
    }

    /// The whole tree.
    pub(super) fn into_hvs(self, volume: &Volume, exec: &Exec) -> Result<Hvs, Error> {
        let Self { leaves, count, merges, figures } = self;
        let figures = match figures {
            Some(figures) => figures,
            None => flat(volume, &leaves, count, exec)?,
        };
        let excess = excess(&figures);
        let Parts { linkage, merges, heights, ends, bridges, inversions } = merges;
        let tree = Tree::of_sound(TreeParts {
            grid: volume.grid().clone(),
            linkage,
            leaves: leaves.into_buffer(),
            merges,
            heights,
            ends,
            counts: figures.counts.into_buffer(),
            means: figures.means,
            squares: figures.squares.map(SpillVec::into_buffer),
            bridges,
        });
        Ok(Hvs { regions: tree.leaf_count(), tree, excess, inversions })
    }

    /// The classes of a cut, how they come together where they are at most `most`, and the number of leaves.
    pub(super) fn cut(
        self,
        volume: &Volume,
        params: &CutParams,
        most: usize,
        exec: &Exec,
    ) -> Result<(Segmentation, Option<Dendrogram>, usize), Error> {
        let Self { leaves, count, merges, figures } = self;
        let joined = cut::join(merges.merged(), count, || sizes(&leaves, count, exec), params, exec)?;
        // What stays of them is told by the merges that are undone.
        drop(merges);
        let found = if let Some(Figures { counts, means, squares }) = &figures {
            joined.describe(&Stored { counts, means, squares: squares.as_deref() }, exec)?
        } else {
            let counts = &sizes(&leaves, count, exec)?;
            joined.describe(&Flat { volume, leaves: &leaves, counts }, exec)?
        };
        drop(figures);
        let dendrogram = dendrogram::of(&found, most);
        Ok((found.segment(volume.grid(), &leaves, exec)?, dendrogram, count))
    }
}

fn grow<T: Apart>(
    volume: &Volume,
    field: &Field<'_, T>,
    params: &HvsParams,
    exec: &Exec,
) -> Result<Grown, Error> {
    if params.linkage == Linkage::Ward && params.alpha.is_none() {
        let frame = Frame::of(volume);
        let (leaves, count) = cells::cells(field, &frame, cells::BLOCK, params.max_regions, exec)?;
        let figures = figures::spread(&Leaves { volume, voxels: field.voxels, ids: &leaves, count }, exec)?;
        return by_ward(volume, leaves, figures, exec);
    }
    let edges = forest::edges(field, exec)?;
    let alpha = params.alpha.unwrap_or(0.0);
    let (leaves, count, below) = forest::zones(field, edges.ids(), alpha, exec)?;
    let of = Leaves { volume, voxels: field.voxels, ids: &leaves, count };
    let figures = || if alpha == 0.0 { figures::flat(&of, exec) } else { figures::spread(&of, exec) };
    match params.linkage {
        Linkage::Single => {
            let merges = single::merges(field, edges, below, (&leaves, count), figures, exec)?;
            let figures = if alpha == 0.0 { None } else { Some(figures()?) };
            Ok(Grown { leaves, count, merges, figures })
        }
        Linkage::Ward if count > params.max_regions => {
            let problem =
                format!("{alpha} leaves {count} zones, more than max_regions ({})", params.max_regions);
            Err(ParamError::new("alpha", problem, "leave it out, or raise one of the two").into())
        }
        Linkage::Ward => {
            drop(edges);
            let figures = figures()?;
            by_ward(volume, leaves, figures, exec)
        }
    }
}

pub(super) fn by_ward(
    volume: &Volume,
    leaves: SpillVec<u32>,
    figures: Figures,
    exec: &Exec,
) -> Result<Grown, Error> {
    let count = figures.counts.len();
    let graph = graph::graph(&leaves, count, volume.grid().dims(), exec)?;
    let merges = ward::merges(volume, &graph, &figures, exec)?;
    Ok(Grown { leaves, count, merges, figures: Some(figures) })
}

/// Figures of leaves of one value each.
fn flat(volume: &Volume, leaves: &[u32], count: usize, exec: &Exec) -> Result<Figures, Error> {
    with_voxels!(volume.voxels(), voxels => figures::flat(&Leaves { volume, voxels, ids: leaves, count }, exec))
}

/// Voxels of each leaf.
fn sizes(leaves: &[u32], count: usize, exec: &Exec) -> Result<SpillVec<u32>, Error> {
    let mut sizes: SpillVec<u32> = exec.bulk("the sizes of the leaves", count)?;
    let of = &mut *sizes;
    for part in leaves.chunks(CHUNK) {
        exec.check_cancelled()?;
        part.iter().filter(|leaf| **leaf > 0).for_each(|leaf| of[*leaf as usize - 1] += 1);
    }
    Ok(sizes)
}

/// Leaves of one value each, which is that of their first voxels: leaves are numbered in the order of these.
struct Flat<'a> {
    volume: &'a Volume,
    leaves: &'a [u32],
    counts: &'a [u32],
}

impl LeafFigures for Flat<'_> {
    fn each(&self, exec: &Exec, look: &mut dyn FnMut(usize, f64, u32, f64)) -> Result<(), Error> {
        let mut next = 0;
        for (i, part) in self.leaves.chunks(CHUNK).enumerate() {
            exec.check_cancelled()?;
            for (at, leaf) in part.iter().enumerate() {
                if *leaf as usize > next {
                    let value = self.volume.real(self.volume.voxels().get(i * CHUNK + at));
                    look(next, value.clamp(f64::MIN, f64::MAX), self.counts[next], 0.0);
                    next += 1;
                }
            }
        }
        Ok(())
    }
}
