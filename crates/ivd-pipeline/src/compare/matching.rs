//! The best one-to-one matching of the classes of two label volumes: that of the largest sum of Dice.
//!
//! Only classes that share a voxel can be matched, so the pairs of the confusion table are the edges of a graph. It is
//! solved in steps that keep a best matching within reach:
//!
//! 1. A pair is taken whose Dice is at least the best other of its one class and the best other of its other class
//!    together: a matching without it gives these two classes no more than that. Where labels resemble each other, little
//!    is left.
//! 2. What is left falls into connected parts, each of which is matched by Kuhn–Munkres (Kuhn 1955, Munkres 1957).
//! 3. A part too large for that takes its pairs by Dice, the largest first, and is counted in [`Matching::unproven`].
//!
//! Dice is rounded down to whole multiples of 2⁻⁴⁰, so that sums are exact and depend on no order.

use std::collections::BTreeMap;

use ivd_core::sets;

use super::assignment::Weights;
use super::confusion::Confusion;

/// One, in the fixed-point numbers of Dice: 2¹⁶ of them can be added up in 63 bits, whatever the sign.
const ONE: u128 = 1 << 40;

/// Most work of a part by Kuhn–Munkres: the classes of its smaller side, squared, times those of its larger. 1024 by 1024
/// take 0.1 s where weights are random and 3 s where they are products of row and column; 4000 by 4000 take 4 s and
/// 190 s. The matrix has 64 MiB at most.
const MOST_WORK: usize = 1 << 30;

/// Which class of the second volume goes with which of the first.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Matching {
    /// The second's class for each of the first's that has one.
    pub(super) pairs: BTreeMap<u16, u16>,
    /// Classes of the first in parts that were too large to be solved: their matches may not be the best.
    pub(super) unproven: usize,
}

/// Matches the classes of a confusion table.
pub(super) fn matching(table: &Confusion) -> Matching {
    matching_within(table, MOST_WORK)
}

fn matching_within(table: &Confusion, most_work: usize) -> Matching {
    let mut graph = Graph::new(table);
    let mut taken = graph.take_undisputed();
    let mut unproven = 0;
    for part in graph.into_parts() {
        let sides = [0, 1].map(|side| part.classes(side));
        if sides[0].len().min(sides[1].len()) * sides[0].len() * sides[1].len() <= most_work {
            taken.extend(part.best(&sides));
        } else {
            unproven += sides[0].len();
            taken.extend(part.largest_first());
        }
    }
    Matching {
        pairs: taken.into_iter().map(|ends| (ends[0] as u16, (ends[1] - SECOND) as u16)).collect(),
        unproven,
    }
}

/// Number of the second volume's class 0 where the classes of both are counted together.
const SECOND: u32 = 1 << 16;

/// A class of either volume.
type Ends = [u32; 2];

/// Two classes that share voxels.
#[derive(Debug, Clone, Copy)]
struct Pair {
    ends: Ends,
    /// In units of 1 / [`ONE`].
    dice: i64,
}

struct Graph {
    pairs: Vec<Pair>,
    /// The pairs of each class, the largest Dice last; those of a class that is gone are dropped when they are met.
    of: Vec<Vec<u32>>,
    gone: Vec<bool>,
}

impl Graph {
    fn new(table: &Confusion) -> Self {
        let pair = |(&(p, q), &n): (&(u16, u16), &u64)| Pair {
            ends: [u32::from(p), SECOND + u32::from(q)],
            dice: (2 * u128::from(n) * ONE / u128::from(table.rows[&p] + table.columns[&q])) as i64,
        };
        let pairs: Vec<Pair> = table.shared.iter().map(pair).collect();
        let mut of = vec![Vec::new(); 2 * SECOND as usize];
        for (i, pair) in pairs.iter().enumerate() {
            for end in pair.ends {
                of[end as usize].push(i as u32);
            }
        }
        for list in &mut of {
            list.sort_unstable_by_key(|&i| (pairs[i as usize].dice, std::cmp::Reverse(i)));
        }
        Self { pairs, of, gone: vec![false; 2 * SECOND as usize] }
    }

    fn is_left(&self, pair: u32) -> bool {
        self.pairs[pair as usize].ends.iter().all(|&end| !self.gone[end as usize])
    }

    /// The best pair of a class that is left, if any, and the Dice of its second best (0 where there is none).
    fn best_two(&mut self, class: u32) -> Option<(u32, i64)> {
        let best = self.pop(class)?;
        let second = self.pop(class);
        let list = &mut self.of[class as usize];
        list.extend(second);
        list.push(best);
        Some((best, second.map_or(0, |i| self.pairs[i as usize].dice)))
    }

    fn pop(&mut self, class: u32) -> Option<u32> {
        loop {
            let pair = self.of[class as usize].pop()?;
            if self.is_left(pair) {
                return Some(pair);
            }
        }
    }

    /// Takes pairs that some best matching has, as long as one shows.
    fn take_undisputed(&mut self) -> Vec<Ends> {
        let mut taken = Vec::new();
        let mut waiting: Vec<u32> = (0..2 * SECOND).rev().collect();
        while let Some(class) = waiting.pop() {
            let Some((pair, other)) = self.best_two(class) else { continue };
            let Pair { ends, dice } = self.pairs[pair as usize];
            let partner = ends[usize::from(class < SECOND)];
            let Some((theirs, rival)) = self.best_two(partner) else { continue };
            if theirs == pair && dice >= other + rival {
                taken.push(ends);
                for end in ends {
                    self.gone[end as usize] = true;
                }
                // Those who have lost a rival may be undisputed now.
                for end in ends {
                    let lost = std::mem::take(&mut self.of[end as usize]);
                    let others = lost.iter().flat_map(|&i| self.pairs[i as usize].ends);
                    waiting.extend(others.filter(|&other| !self.gone[other as usize]));
                }
            }
        }
        taken
    }

    /// The connected parts of what is left, in the order of their first classes.
    fn into_parts(self) -> Vec<Part> {
        let mut parts_of = sets::singles(2 * SECOND as usize);
        let left: Vec<Pair> = (0..self.pairs.len() as u32)
            .filter(|&i| self.is_left(i))
            .map(|i| self.pairs[i as usize])
            .collect();
        for pair in &left {
            sets::join(&mut parts_of, pair.ends[0], pair.ends[1]);
        }
        let mut parts = BTreeMap::<u32, Vec<Pair>>::new();
        for pair in left {
            parts.entry(sets::root(&mut parts_of, pair.ends[0])).or_default().push(pair);
        }
        parts.into_values().map(Part).collect()
    }
}

/// The pairs of a connected part.
struct Part(Vec<Pair>);

impl Part {
    /// Its classes of one volume, ascending.
    fn classes(&self, side: usize) -> Vec<u32> {
        let mut classes: Vec<u32> = self.0.iter().map(|pair| pair.ends[side]).collect();
        classes.sort_unstable();
        classes.dedup();
        classes
    }

    /// The best matching, by Kuhn–Munkres.
    fn best(&self, sides: &[Vec<u32>; 2]) -> Vec<Ends> {
        // Each row gets a column, so rows are the side with fewer classes.
        let row = usize::from(sides[0].len() > sides[1].len());
        let (rows, columns) = (&sides[row], &sides[1 - row]);
        let mut dice = Weights::zero(rows.len(), columns.len());
        for pair in &self.0 {
            let place = |classes: &[u32], end| classes.partition_point(|class| *class < end);
            dice.set(place(rows, pair.ends[row]), place(columns, pair.ends[1 - row]), pair.dice);
        }
        let shared = dice.best().into_iter().filter(|&(r, c)| dice.at(r, c) > 0);
        shared.map(|(r, c)| if row == 0 { [rows[r], columns[c]] } else { [columns[c], rows[r]] }).collect()
    }

    /// A matching by Dice, the largest first.
    fn largest_first(mut self) -> Vec<Ends> {
        self.0.sort_by_key(|pair| (-pair.dice, pair.ends));
        let mut gone = std::collections::BTreeSet::new();
        let mut taken = Vec::new();
        for Pair { ends, .. } in self.0 {
            if ends.iter().all(|end| !gone.contains(end)) {
                gone.extend(ends);
                taken.push(ends);
            }
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table with so many voxels shared by class `row` of the first and class `column` of the second.
    fn table(counts: &[&[u64]]) -> Confusion {
        let rows = (0..).zip(counts);
        let pairs = rows.flat_map(|(p, row)| (0..).zip(*row).map(move |(q, &n)| ((p, q), n)));
        Confusion::from_shared(pairs.filter(|(_, n)| *n > 0).collect())
    }

    fn sum(table: &Confusion, pairs: &BTreeMap<u16, u16>) -> f64 {
        pairs.iter().map(|(&p, &q)| table.dice(p, q)).sum()
    }

    /// The largest sum of Dice over all matchings of rows from `row` on with the columns that are free.
    fn brute(table: &Confusion, size: [u16; 2], row: u16, free: &mut Vec<bool>) -> f64 {
        if row == size[0] {
            return 0.0;
        }
        let mut best = brute(table, size, row + 1, free);
        for column in 0..size[1] {
            if free[usize::from(column)] && table.shared.contains_key(&(row, column)) {
                free[usize::from(column)] = false;
                best = best.max(table.dice(row, column) + brute(table, size, row + 1, free));
                free[usize::from(column)] = true;
            }
        }
        best
    }

    #[test]
    fn the_best_matching_gives_up_the_largest_pair() {
        // Dice: 100 / 160 and 2 · 30 / 120, against 2 · 60 / 160 with nothing beside it.
        let table = table(&[&[60, 30], &[30, 0]]);
        let best = matching(&table);
        assert_eq!(best.pairs, BTreeMap::from([(0, 1), (1, 0)]));
        let greedy = matching_within(&table, 0);
        assert_eq!((greedy.pairs.clone(), greedy.unproven), (BTreeMap::from([(0, 0)]), 2));
        assert!(sum(&table, &best.pairs) > sum(&table, &greedy.pairs) + 0.3);
    }

    #[test]
    fn classes_in_excess_stay_alone_on_either_side() {
        let wide: &[&[u64]] = &[&[5, 5, 0, 9], &[5, 4, 3, 9]];
        let tall: &[&[u64]] = &[&[5, 5], &[5, 4], &[0, 3], &[9, 9]];
        let [wide, tall] = [wide, tall].map(table);
        let [across, along] = [&wide, &tall].map(|t| matching(t).pairs);
        assert_eq!(across.len(), 2);
        assert_eq!(sum(&wide, &across), sum(&tall, &along));
        assert_eq!(sum(&wide, &across), brute(&wide, [2, 4], 0, &mut vec![true; 4]));
        // What shares no voxel is not matched, though both are free.
        assert_eq!(matching(&self::table(&[&[5, 1], &[5, 0]])).pairs.len(), 2);
        assert_eq!(matching(&self::table(&[&[5], &[5]])).pairs.len(), 1);
    }

    #[test]
    fn random_tables_reach_the_best_of_all_matchings() {
        let mut state = 7_u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let mut beaten = 0;
        for _ in 0..500 {
            let (height, width) = (1 + random(6), 1 + random(6));
            let counts: Vec<Vec<u64>> =
                (0..height).map(|_| (0..width).map(|_| random(40).saturating_sub(15)).collect()).collect();
            let table = table(&counts.iter().map(Vec::as_slice).collect::<Vec<_>>());
            let found = matching(&table);
            let best = brute(&table, [height as u16, width as u16], 0, &mut vec![true; width as usize]);
            assert!((sum(&table, &found.pairs) - best).abs() < 1e-10, "{counts:?}");
            assert_eq!(found.unproven, 0);
            beaten += usize::from(sum(&table, &matching_within(&table, 0).pairs) < best - 1e-6);
        }
        assert!(beaten > 50, "{beaten} of 500 tables tell the best from the largest first");
    }

    #[test]
    fn every_class_that_labels_can_have_is_matched_with_its_shifted_self() {
        // 65,535 classes of 4 voxels along a line, renumbered and shifted by one.
        let mirrored = |class: u16| u16::MAX - class % u16::MAX;
        let shared = (0..u16::MAX).flat_map(|c| [((c, mirrored(c)), 3), ((c, mirrored(c + 1)), 1)]);
        let table = Confusion::from_shared(shared.collect());
        let found = matching(&table);
        assert_eq!(found.unproven, 0);
        assert!((0..u16::MAX).all(|class| found.pairs[&class] == u16::MAX - class));
    }
}
