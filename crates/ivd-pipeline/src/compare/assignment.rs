//! The columns that rows get where the sum of their weights is largest.

/// Weights of rows (first index) and columns.
pub(super) struct Weights {
    columns: usize,
    values: Vec<i64>,
}

impl Weights {
    /// All zero; there must be no more rows than columns.
    pub(super) fn zero(rows: usize, columns: usize) -> Self {
        assert!(rows <= columns, "each row gets a column");
        Self { columns, values: vec![0; rows * columns] }
    }

    pub(super) fn set(&mut self, row: usize, column: usize, weight: i64) {
        self.values[row * self.columns + column] = weight;
    }

    pub(super) fn at(&self, row: usize, column: usize) -> i64 {
        self.values[row * self.columns + column]
    }

    fn row(&self, row: usize) -> &[i64] {
        &self.values[row * self.columns..][..self.columns]
    }

    fn rows(&self) -> usize {
        self.values.len().checked_div(self.columns).unwrap_or(0)
    }

    /// A column for each row, none twice, of the largest sum of weights (Kuhn 1955, Munkres 1957): rows join one by one, each by the
    /// cheapest path that alternates between given and taken pairs, in `rows² · columns` steps. Among equal paths the one that ends
    /// in the first column wins.
    ///
    /// Labels hold a bound: `rows[r] + columns[c] ≥ weight(r, c)`, with equality for the pairs that are given. Once all rows have one,
    /// the sum of labels proves that no other is larger.
    pub(super) fn best(&self) -> Vec<(usize, usize)> {
        let mut row_label: Vec<i64> =
            (0..self.rows()).map(|r| self.row(r).iter().copied().max().unwrap_or(0)).collect();
        let mut column_label = vec![0_i64; self.columns];
        let mut column_of: Vec<Option<usize>> = vec![None; self.rows()];
        let mut row_of: Vec<Option<usize>> = vec![None; self.columns];
        for joining in 0..self.rows() {
            // What a column lacks to the bound, least over the rows that the search has reached, and from which of them.
            let mut lack = vec![i64::MAX; self.columns];
            let mut lacks_from = vec![joining; self.columns];
            let mut from: Vec<Option<usize>> = vec![None; self.columns];
            let (mut rows, mut columns) = (vec![joining], Vec::new());
            let mut newest = joining;
            let mut step = 0;
            let mut end = loop {
                // One pass: the labels' last step, what the row reached last offers, and which column is nearest now.
                let mut nearest = (i64::MAX, usize::MAX);
                for (c, &weight) in self.row(newest).iter().enumerate() {
                    if from[c].is_some() {
                        continue;
                    }
                    let offered = row_label[newest] + column_label[c] - weight;
                    lack[c] -= step;
                    if offered < lack[c] {
                        (lack[c], lacks_from[c]) = (offered, newest);
                    }
                    if lack[c] < nearest.0 {
                        nearest = (lack[c], c);
                    }
                }
                let column;
                (step, column) = nearest;
                for &r in &rows {
                    row_label[r] -= step;
                }
                for &c in &columns {
                    column_label[c] += step;
                }
                from[column] = Some(lacks_from[column]);
                columns.push(column);
                let Some(next) = row_of[column] else { break column };
                rows.push(next);
                newest = next;
            };
            // Along the path every row takes the column by which it was left.
            while let Some(row) = from[end] {
                row_of[end] = Some(row);
                let Some(before) = column_of[row].replace(end) else { break };
                end = before;
            }
        }
        column_of.into_iter().enumerate().filter_map(|(row, column)| Some((row, column?))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest sum over all choices of columns for the rows from `row` on.
    fn largest(weights: &Weights, row: usize, taken: u32) -> i64 {
        if row == weights.rows() {
            return 0;
        }
        (0..weights.columns)
            .filter(|c| taken & (1 << c) == 0)
            .map(|c| weights.at(row, c) + largest(weights, row + 1, taken | 1 << c))
            .max()
            .unwrap()
    }

    /// Whole numbers below `below`, from an integer hash.
    fn random(i: u64, below: u64) -> u64 {
        let x = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (x ^ (x >> 32)) % below
    }

    #[test]
    fn every_small_table_reaches_the_best_of_all_assignments() {
        for case in 0..600 {
            let rows = 1 + random(case, 6) as usize;
            let columns = rows + random(case + 1000, 3) as usize;
            // Few different weights make ties.
            let below = [2, 5, 1000][case as usize % 3];
            let mut weights = Weights::zero(rows, columns);
            for i in 0..rows * columns {
                let weight = random(1000 * case + i as u64, below) as i64 - i64::from(case % 2 == 0);
                weights.set(i / columns, i % columns, weight);
            }
            let found = weights.best();
            let sum: i64 = found.iter().map(|&(r, c)| weights.at(r, c)).sum();
            assert_eq!(sum, largest(&weights, 0, 0), "case {case}");
            let mut different: Vec<usize> = found.iter().map(|(_, column)| *column).collect();
            different.sort_unstable();
            different.dedup();
            assert_eq!(different.len(), rows, "case {case}: a column twice");
        }
    }

    #[test]
    fn a_row_gives_way_along_a_path() {
        // Row 0 would take column 0; row 2 has no other, row 1 only columns 0 and 1.
        let mut weights = Weights::zero(3, 3);
        for (row, column, weight) in [(0, 0, 9), (0, 1, 8), (0, 2, 7), (1, 0, 9), (1, 1, 8), (2, 0, 9)] {
            weights.set(row, column, weight);
        }
        assert_eq!(weights.best(), [(0, 2), (1, 1), (2, 0)]);
        assert!(Weights::zero(0, 0).best().is_empty());
    }
}
