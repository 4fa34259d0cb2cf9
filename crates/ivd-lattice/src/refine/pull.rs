//! Half-edge collapses onto chosen neighbours: vertices that go, and vertices that stay and take them in.

use ivd_core::{Cancel, Exec};
use rayon::prelude::*;

use super::blocks::Blocks;
use super::deviation::Deviation;
use super::half_edge::{Limits, collapse};
use super::passes::Done;
use super::refusal::Refused;
use super::star::Fan;
use super::surface::Surface;
use crate::Error;

/// Fewer vertices aren't divided into blocks.
const ALONE: usize = 2048;
/// Vertices between two looks at whether to stop.
const LOOKS: usize = 256;

/// What a pull may do.
pub(super) struct Rules {
    pub(super) limits: Limits,
    /// As in [`RefineParams`](super::RefineParams).
    pub(super) shape_weight: f32,
}

/// What came of a pull.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pulled {
    /// Vertices removed.
    pub(super) count: usize,
    /// Vertices that had a neighbour to go to, and why they are still there.
    pub(super) refused: Refused,
}

/// Collapses vertices onto neighbours, the cheapest first, each onto the cheapest neighbour that can be; at most `most`.
///
/// - `sources`: vertices that are to go; they must be free.
/// - `may`: whether a source may be pulled onto a neighbour. No neighbour for which it says so may be a source itself: only
///   so are the stars of the sources whole throughout.
pub(super) fn pull(
    surface: &mut Surface,
    sources: &[u32],
    may: impl Fn(u32, u32) -> bool + Sync,
    rules: &Rules,
    most: usize,
    exec: &Exec,
) -> Result<Pulled, Error> {
    let hand = Hand { surface, may, rules, cancel: &exec.cancel };
    let mut entries: Vec<u64> = sources.par_iter().filter_map(|&u| hand.entry(u)).collect();
    let mut all = Done::default();
    // Blocks don't know of one another how many they remove: each may remove all that it has, or there is one.
    if entries.len() > ALONE && entries.len() <= most {
        let blocks = Blocks::new(hand.surface, hand.surface.area(), 0);
        let pieces = blocks.group(&mut entries);
        let done: Vec<Done> = pieces
            .into_par_iter()
            .with_max_len(1)
            .map(|(block, piece)| {
                piece.sort_unstable();
                hand.in_order(piece, Some((&blocks, block)), most)
            })
            .collect();
        for block in done {
            all.add(block);
        }
        let mut across = std::mem::take(&mut all.across);
        across.sort_unstable();
        all.add(hand.in_order(&across, None, most));
    } else {
        entries.sort_unstable();
        all.add(hand.in_order(&entries, None, most));
    }
    exec.check_cancelled()?;
    surface.tidy(&all.collapsed);
    Ok(Pulled { count: all.collapsed.len(), refused: all.refused })
}

/// What is needed to collapse a vertex.
struct Hand<'a, F> {
    surface: &'a Surface,
    may: F,
    rules: &'a Rules,
    cancel: &'a Cancel,
}

impl<F: Fn(u32, u32) -> bool + Sync> Hand<'_, F> {
    /// Cost of a vertex's cheapest collapse above its number, if it has a neighbour to go to.
    fn entry(&self, u: u32) -> Option<u64> {
        let surface = self.surface;
        let corners = surface.stars.of(u as usize).iter().flat_map(|&t| surface.triangles.corners(t));
        let least =
            corners.filter(|&y| y != u && self.may(u, y)).map(|y| self.cost(u, y)).reduce(f32::min)?;
        // Costs are not negative: their bits sort like their values.
        Some(u64::from(least.to_bits()) << 32 | u64::from(u))
    }

    fn may(&self, u: u32, y: u32) -> bool {
        self.surface.features.allow(u, y) && (self.may)(u, y)
    }

    fn cost(&self, u: u32, y: u32) -> f32 {
        let offset = self.surface.positions[y as usize] - self.surface.positions[u as usize];
        self.surface.cost(u, &offset, self.rules.shape_weight)
    }

    fn in_order(&self, entries: &[u64], block: Option<(&Blocks, u16)>, most: usize) -> Done {
        let (mut done, mut fan, mut deviation) = (Done::default(), Fan::new(), Deviation::new());
        let mut targets: Vec<(f32, u32)> = Vec::new();
        for (at, &entry) in entries.iter().enumerate() {
            let stopped = at % LOOKS == 0 && self.cancel.is_cancelled();
            if stopped || done.collapsed.len() >= most {
                break;
            }
            let u = entry as u32;
            if !fan.read(u, &self.surface.stars, &self.surface.triangles) {
                done.refused.links += 1;
                continue;
            }
            if block.is_some_and(|(blocks, b)| fan.ring().iter().any(|&r| blocks.of(r) != b)) {
                done.across.push(entry);
                continue;
            }
            targets.clear();
            targets.extend(fan.ring().iter().filter(|&&y| self.may(u, y)).map(|&y| (self.cost(u, y), y)));
            targets.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            fan.locate(&self.surface.positions);
            let mut refusal = None;
            let gone = targets.iter().any(|&(_, y)| {
                let tried = collapse(self.surface, [u, y], &mut fan, &mut deviation, &self.rules.limits);
                refusal = tried.err();
                refusal.is_none()
            });
            match refusal {
                None if gone => done.collapsed.push(u),
                None => {}
                Some(refusal) => done.refused.count(refusal),
            }
        }
        done
    }
}
