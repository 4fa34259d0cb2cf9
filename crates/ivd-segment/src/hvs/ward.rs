//! Ward's criterion over the leaves: each merge adds least to the sum of squared deviations from the means (Ward 1963), among
//! parts that touch.

use ivd_core::{Error, Exec, Linkage, Volume};

use super::agglomerate::Regions;
use super::figures::Figures;
use super::graph::Graph;
use super::merges::{Merges, Parts};
use crate::moments::Frame;

/// Merges between two looks at whether to stop.
const CHUNK: usize = 1 << 8;

pub(super) fn merges(volume: &Volume, graph: &Graph, figures: &Figures, exec: &Exec) -> Result<Parts, Error> {
    let frame = Frame::of(volume);
    // Costs are found in a frame in which nothing overflows.
    let height = |cost| height(cost, frame.scale(), volume.slope());
    let mut regions = Regions::default();
    for leaf in 0..figures.counts.len() {
        let count = f64::from(figures.counts[leaf]);
        regions.add(count, frame.place(volume.stored(figures.means.get(leaf))) * count, graph.of(leaf));
    }
    let mut merges = Merges::of(figures.counts.len(), exec)?;
    let mut done = 0_usize;
    let mut look = |merges: &Merges| {
        done += 1;
        if done.is_multiple_of(CHUNK) {
            exec.check_cancelled()?;
        }
        if done.is_multiple_of(CHUNK * CHUNK) {
            merges.tell(exec);
        }
        Ok::<_, Error>(())
    };
    regions.run(|regions, merge| {
        // The leaves on either side of the border, so that whoever leaves this merge out cuts there.
        let near = regions.between(merge.pair);
        let other = if regions.root(near) == merge.pair[0] { merge.pair[1] } else { merge.pair[0] };
        let across = graph.of(near as usize).iter().copied().find(|leaf| regions.root(*leaf) == other);
        merges.push([near + 1, across.unwrap_or(other) + 1], height(merge.cost));
        look(&merges)
    })?;
    if !merges.full() {
        regions.line_up();
        regions.run(|_, merge| {
            merges.push(merge.pair.map(|leaf| leaf + 1), height(merge.cost));
            merges.bridges += 1;
            look(&merges)
        })?;
    }
    Ok(merges.into_parts(Linkage::Ward))
}

/// A cost in real units²; `scale` is a power of two, so that nothing is rounded away by it.
fn height(cost: f64, scale: f64, slope: f64) -> f64 {
    (cost / scale / scale * slope * slope).min(f64::MAX)
}
