//! Optimal partition of an ordered set into intervals by dynamic programming.
//!
//! `F_k(q) = min over p of F_{k-1}(p) + w(p, q)`. Where `w` satisfies the quadrangle inequality the best `p` never falls as
//! `q` rises, so a row is filled by divide and conquer in O(n log n) (Grønlund, Larsen, Mathiasen, Nielsen, Schneider & Song
//! 2017, arXiv:1701.07204; the same program without it is Wang & Song 2011). The inertia of intervals of sorted values does.

/// Rows shorter than this are filled by one thread.
const SPLIT: usize = 2048;

/// Best costs and predecessors: entry `[k - 1][q]` is for the first `q` positions in `k` intervals.
pub(super) struct Rows {
    pub(super) cost: Vec<Vec<f64>>,
    from: Vec<Vec<u32>>,
}

impl Rows {
    /// Positions of the cuts of the best partition of everything into `k` intervals, ascending, `k - 1` of them.
    pub(super) fn cuts(&self, k: usize) -> Vec<usize> {
        let mut at = self.cost[0].len() - 1;
        let mut cuts: Vec<usize> = (1..k)
            .rev()
            .map(|row| {
                at = self.from[row][at] as usize;
                at
            })
            .collect();
        cuts.reverse();
        cuts
    }
}

/// Fills `k` rows over the positions `0 … positions - 1`; `w(p, q)`, `p ≤ q`, is the cost of the interval between two
/// positions. With `proper`, no interval is empty. Among equal costs the lowest cut wins.
pub(super) fn rows(
    positions: usize,
    k: usize,
    proper: bool,
    w: &(impl Fn(usize, usize) -> f64 + Sync),
) -> Rows {
    let least = usize::from(proper);
    let first = (0..positions).map(|q| if q < least { f64::INFINITY } else { w(0, q) }).collect();
    let mut rows = Rows { cost: vec![first], from: vec![vec![0; positions]] };
    for row in 1..k {
        let mut cost = vec![f64::INFINITY; positions];
        let mut from = vec![0; positions];
        fill(&rows.cost[row - 1], w, least, 0, (&mut cost, &mut from), [0, positions - 1]);
        rows.cost.push(cost);
        rows.from.push(from);
    }
    rows
}

/// Fills the part of a row that begins at `start`, whose best predecessors lie in `range`.
fn fill(
    previous: &[f64],
    w: &(impl Fn(usize, usize) -> f64 + Sync),
    least: usize,
    start: usize,
    (cost, from): (&mut [f64], &mut [u32]),
    range: [usize; 2],
) {
    if cost.is_empty() {
        return;
    }
    let middle = cost.len() / 2;
    let q = start + middle;
    let mut best = (f64::INFINITY, range[0]);
    for p in range[0]..(range[1] + 1).min((q + 1).saturating_sub(least)) {
        if previous[p] < best.0 {
            let total = previous[p] + w(p, q);
            if total < best.0 {
                best = (total, p);
            }
        }
    }
    let long = cost.len() > SPLIT;
    let (cost_left, cost_right) = cost.split_at_mut(middle);
    let (from_left, from_right) = from.split_at_mut(middle);
    (cost_right[0], from_right[0]) = (best.0, best.1 as u32);
    let mut left = || fill(previous, w, least, start, (cost_left, from_left), [range[0], best.1]);
    let mut right =
        || fill(previous, w, least, q + 1, (&mut cost_right[1..], &mut from_right[1..]), [best.1, range[1]]);
    if long {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}
