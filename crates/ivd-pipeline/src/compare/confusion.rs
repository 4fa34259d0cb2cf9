//! The confusion table of two label volumes.

use std::collections::BTreeMap;

/// Voxels that classes of two label volumes share.
#[derive(Debug)]
pub(super) struct Confusion {
    /// Voxels of each class of the first that are of a class of the second; pairs without any are left out.
    pub(super) shared: BTreeMap<(u16, u16), u64>,
    /// Voxels of each class of the first.
    pub(super) rows: BTreeMap<u16, u64>,
    /// Voxels of each class of the second.
    pub(super) columns: BTreeMap<u16, u64>,
}

impl Confusion {
    /// Counts voxels by the classes that both give them.
    pub(super) fn of(a: &[u16], b: &[u16]) -> Self {
        let mut shared = BTreeMap::new();
        // Labels come in runs: count a run at once.
        let mut i = 0;
        while i < a.len() {
            let start = i;
            while i < a.len() && a[i] == a[start] && b[i] == b[start] {
                i += 1;
            }
            *shared.entry((a[start], b[start])).or_default() += (i - start) as u64;
        }
        Self::from_shared(shared)
    }

    /// From the voxels of each pair.
    pub(super) fn from_shared(shared: BTreeMap<(u16, u16), u64>) -> Self {
        let (mut rows, mut columns) = (BTreeMap::new(), BTreeMap::new());
        for (&(p, q), &n) in &shared {
            *rows.entry(p).or_default() += n;
            *columns.entry(q).or_default() += n;
        }
        Self { shared, rows, columns }
    }

    /// Dice of two classes that share voxels.
    pub(super) fn dice(&self, p: u16, q: u16) -> f64 {
        2.0 * self.shared[&(p, q)] as f64 / (self.rows[&p] + self.columns[&q]) as f64
    }

    /// 1 for equal partitions, about 0 for unrelated ones; 1 where both put everything into one class.
    pub(super) fn adjusted_rand(&self) -> f64 {
        let pairs = |n: u64| n as f64 * (n as f64 - 1.0) / 2.0;
        let both: f64 = self.shared.values().map(|&n| pairs(n)).sum();
        let in_a: f64 = self.rows.values().map(|&n| pairs(n)).sum();
        let in_b: f64 = self.columns.values().map(|&n| pairs(n)).sum();
        let expected = in_a * in_b / pairs(self.rows.values().sum()).max(1.0);
        let most = f64::midpoint(in_a, in_b);
        if most == expected { 1.0 } else { (both - expected) / (most - expected) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adjusted_rand_index_of_a_worked_example() {
        // Confusion rows (2, 1), (0, 3): sum of pairs 1 + 3 = 4, margins 3, 3 → 6 and 2, 4 → 7 of 15.
        let ari = Confusion::of(&[1, 1, 1, 2, 2, 2], &[1, 1, 2, 2, 2, 2]).adjusted_rand();
        let expected = 6.0 * 7.0 / 15.0;
        assert!((ari - (4.0 - expected) / (6.5 - expected)).abs() < 1e-12);
    }
}
