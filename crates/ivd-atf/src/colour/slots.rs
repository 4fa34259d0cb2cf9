//! Which slot in a palette a class of values has: one that it mostly keeps when there is a class more, if classes are intervals of values.

/// Most classes whose slots follow from the values; more than these have theirs by rank.
const MOST: usize = 16;

/// Slots of `classes` classes in the order of their means, each a number below `classes` of its own.
///
/// The best division of the values into k intervals (least squares, by dynamic programming over `histogram`) is found for every k up to
/// `classes`. From k − 1 to k each interval keeps the slot of the one that it shares most voxels with, and what is left over gets the
/// next free one. So the slots of k classes don't depend on how many more there will be. Classes that are no intervals of values, or that
/// lie elsewhere than the best intervals, have slots of their own too, which they keep less well: where another interval is split first,
/// slots change.
pub(super) fn slots(histogram: &[u64], classes: usize) -> Vec<usize> {
    let by_rank = (0..classes).collect();
    if !(2..=MOST).contains(&classes) {
        return by_rank;
    }
    let divisions = divisions(histogram, classes);
    if divisions.len() < classes {
        return by_rank;
    }
    let below = |bin: usize| -> u64 { histogram[..bin].iter().sum() };
    let mut places = vec![0];
    for k in 2..=classes {
        let (old, new) = (&divisions[k - 2], &divisions[k - 1]);
        let mut shared: Vec<(u64, usize, usize)> = Vec::new();
        for i in 0..k {
            for j in 0..k - 1 {
                let (from, to) = (new[i].max(old[j]), new[i + 1].min(old[j + 1]));
                if from < to {
                    shared.push((below(to) - below(from), i, j));
                }
            }
        }
        shared.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        let (mut next, mut given) = (vec![usize::MAX; k], vec![false; k - 1]);
        for (_, i, j) in shared {
            if next[i] == usize::MAX && !given[j] {
                next[i] = places[j];
                given[j] = true;
            }
        }
        // Old intervals that no new one was matched with leave their places free too.
        let mut free = (0..k).filter(|place| !next.contains(place)).collect::<Vec<_>>().into_iter();
        places = next.iter().map(|&p| if p == usize::MAX { free.next().unwrap_or(0) } else { p }).collect();
    }
    places
}

/// Bounds of the best 1, 2, … intervals of bins: of k intervals k + 1 bounds; as many divisions as there are different values, at most `most`.
fn divisions(histogram: &[u64], most: usize) -> Vec<Vec<usize>> {
    let bins: Vec<usize> = (0..histogram.len()).filter(|&i| histogram[i] > 0).collect();
    let n = bins.len();
    let mut sums = vec![[0.0_f64; 3]];
    for &bin in &bins {
        let (count, x) = (histogram[bin] as f64, bin as f64);
        let [n, first, second] = sums[sums.len() - 1];
        sums.push([n + count, first + count * x, second + count * x * x]);
    }
    let cost = |from: usize, to: usize| {
        let [n, first, second] = [0, 1, 2].map(|i| sums[to][i] - sums[from][i]);
        (second - first * first / n).max(0.0)
    };
    let mut best: Vec<f64> = (0..=n).map(|to| if to == 0 { 0.0 } else { cost(0, to) }).collect();
    let mut last_start: Vec<Vec<usize>> = vec![vec![0; n + 1]];
    for k in 2..=most.min(n) {
        let (mut next, mut starts) = (vec![f64::INFINITY; n + 1], vec![0; n + 1]);
        for to in k..=n {
            for from in k - 1..to {
                let all = best[from] + cost(from, to);
                if all < next[to] {
                    (next[to], starts[to]) = (all, from);
                }
            }
        }
        best = next;
        last_start.push(starts);
    }
    let bound = |i: usize| {
        if i == n {
            histogram.len()
        } else if i == 0 {
            0
        } else {
            bins[i]
        }
    };
    let division = |k: usize| {
        let mut bounds = vec![n];
        for starts in last_start[..k].iter().rev() {
            bounds.push(starts[bounds[bounds.len() - 1]]);
        }
        bounds.reverse();
        bounds.into_iter().map(bound).collect()
    };
    (1..=most.min(n)).map(division).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hills of equal width: (middle, height).
    fn hills(of: &[(usize, u64)]) -> Vec<u64> {
        let mut histogram = vec![0; 200];
        for &(middle, height) in of {
            for i in 0..9 {
                histogram[middle + i - 4] += height * (5 - i.abs_diff(4)) as u64;
            }
        }
        histogram
    }

    #[test]
    fn the_best_intervals_part_hills() {
        let histogram = hills(&[(20, 100), (60, 50), (150, 30)]);
        let found = divisions(&histogram, 3);
        assert_eq!(found[0], [0, 200]);
        assert!((65..=146).contains(&found[1][1]), "{:?}", found[1]);
        assert!((25..=56).contains(&found[2][1]) && (65..=146).contains(&found[2][2]), "{:?}", found[2]);
        assert_eq!(divisions(&[0, 3, 0, 5], 4).len(), 2, "no more intervals than values");
    }

    #[test]
    fn a_class_keeps_its_place_when_another_is_split() {
        let histogram = hills(&[(20, 1000), (60, 300), (100, 90), (150, 200), (180, 50)]);
        let two = slots(&histogram, 2);
        assert_eq!(two, [0, 1], "the larger part keeps the first place");
        for k in 2..5 {
            let (few, more) = (slots(&histogram, k), slots(&histogram, k + 1));
            let mut sorted = more.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..=k).collect::<Vec<_>>());
            // Hills only split here: without the new place the order is the old one.
            let kept: Vec<usize> = more.into_iter().filter(|&place| place < k).collect();
            assert_eq!(kept, few, "{k}");
        }
    }

    #[test]
    fn too_many_or_too_few_values_go_by_rank() {
        assert_eq!(slots(&[5], 3), [0, 1, 2]);
        assert_eq!(slots(&vec![1; 400], 20), (0..20).collect::<Vec<_>>());
    }
}
