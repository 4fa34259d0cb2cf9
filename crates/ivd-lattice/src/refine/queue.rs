use rayon::prelude::*;

use super::surface::Surface;

/// Bits of a cost that its class leaves out: costs of a class differ by less than a sixteenth.
const CLASS_SHIFT: u32 = 19;
/// Classes of costs from 0 to infinity.
const CLASSES: usize = (f32::INFINITY.to_bits() >> CLASS_SHIFT) as usize + 1;
/// Entries counted as one piece.
const PIECE: usize = 1 << 14;
/// A queue isn't made shorter than this.
const LEAST: usize = 64;

/// The vertices that a pass may remove.
pub(super) struct Queue {
    /// Bits of the cost above the index of each vertex, in the order of vertices.
    pub(super) entries: Vec<u64>,
    /// What a collapse may cost (mm²).
    pub(super) dearest: f32,
    /// Whether vertices of the share asked for were left out because they would have been too many.
    pub(super) cut: bool,
}

/// Cost of an entry (mm²).
pub(super) fn cost_of(entry: u64) -> f32 {
    f32::from_bits((entry >> 32) as u32)
}

impl Queue {
    /// The cheapest `share` of the vertices that are worth a try, rounded up to whole classes of equal or nearly equal
    /// cost, but at most `most`, ties by index.
    pub(super) fn new(surface: &Surface, shape_weight: f32, share: f64, most: usize) -> Self {
        Self::cheapest(&entries(surface, shape_weight), share, most)
    }

    /// All free vertices, whatever they cost.
    pub(super) fn all(surface: &Surface, shape_weight: f32) -> Self {
        Self { entries: entries(surface, shape_weight), dearest: f32::INFINITY, cut: false }
    }

    fn cheapest(all: &[u64], share: f64, most: usize) -> Self {
        let counts = classes(all);
        let worth: usize = counts[..CLASSES - 1].iter().sum();
        let wanted = ((worth as f64 * share).ceil() as usize).max(LEAST);
        let (mut class, mut taken) = (0, 0);
        while class < CLASSES - 1 && taken < wanted {
            taken += counts[class];
            class += 1;
        }
        let mut entries = Vec::with_capacity(taken);
        entries.extend(all.iter().filter(|&&entry| class_of(entry) < class));
        let mut dearest = f32::from_bits(((class as u32) << CLASS_SHIFT) - 1);
        let cut = entries.len() > most;
        if cut {
            let (_, last, _) = entries.select_nth_unstable(most - 1);
            dearest = cost_of(*last);
            entries.truncate(most);
        }
        Self { entries, dearest, cut }
    }
}

/// An entry for each free vertex.
fn entries(surface: &Surface, shape_weight: f32) -> Vec<u64> {
    // Costs are not negative: their bits sort like their values.
    let entry = |&v| u64::from(surface.least_cost(v, shape_weight).to_bits()) << 32 | u64::from(v);
    surface.free.par_iter().map(entry).collect()
}

#[inline]
fn class_of(entry: u64) -> usize {
    (entry >> (32 + CLASS_SHIFT)) as usize
}

/// Number of entries of each class.
fn classes(all: &[u64]) -> Vec<usize> {
    let none = || vec![0; CLASSES];
    let count = |piece: &[u64]| {
        let mut counts = none();
        for &entry in piece {
            counts[class_of(entry)] += 1;
        }
        counts
    };
    let add = |mut a: Vec<usize>, b: Vec<usize>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    };
    all.par_chunks(PIECE).map(count).reduce(none, add)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costing(costs: &[f32]) -> Vec<u64> {
        costs.iter().enumerate().map(|(v, c)| u64::from(c.to_bits()) << 32 | v as u64).collect()
    }

    #[test]
    fn a_share_is_rounded_up_to_a_class_and_leaves_out_what_is_not_worth_a_try() {
        let costs: Vec<f32> =
            (0..1000).map(|i| if i % 2 == 0 { f32::INFINITY } else { ((i * 37) % 1000) as f32 }).collect();
        let queue = Queue::cheapest(&costing(&costs), 0.5, usize::MAX);
        let worth = costs.iter().filter(|c| c.is_finite()).count();
        assert!((worth / 2..worth * 9 / 16 + 1).contains(&queue.entries.len()), "{}", queue.entries.len());
        let mut taken = queue.entries.iter().map(|&e| cost_of(e)).collect::<Vec<_>>();
        assert!(taken.iter().all(|&c| c <= queue.dearest));
        assert_eq!(costs.iter().filter(|&&c| c <= queue.dearest).count(), taken.len());
        taken.sort_unstable_by(f32::total_cmp);
        let few = Queue::cheapest(&costing(&costs), 0.5, 10);
        let mut kept = few.entries.iter().map(|&e| cost_of(e)).collect::<Vec<_>>();
        kept.sort_unstable_by(f32::total_cmp);
        assert_eq!((&kept[..], few.dearest), (&taken[..10], taken[9]));
        assert!(few.cut && !queue.cut);
    }

    #[test]
    fn costs_of_nothing_and_one_all_the_same_are_taken_whole() {
        assert!(Queue::cheapest(&[], 0.5, 10).entries.is_empty());
        assert!(Queue::cheapest(&costing(&[f32::INFINITY; 5]), 0.5, 10).entries.is_empty());
        let queue = Queue::cheapest(&costing(&[0.0; 500]), 0.5, usize::MAX);
        assert_eq!(queue.entries.len(), 500);
    }
}
