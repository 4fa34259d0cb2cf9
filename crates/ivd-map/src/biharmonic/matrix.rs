//! Sparse matrices over nodes, with three right-hand sides at once.

use std::cell::RefCell;

use rayon::prelude::*;

/// A value for each axis of space.
pub(super) type Triple = [f64; 3];

/// Rows that one task does: enough to be worth its start.
const ROWS: usize = 512;

/// A sparse matrix by rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Matrix {
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
    width: usize,
}

impl Matrix {
    /// A matrix of `height` rows and `width` columns; `row` calls back with each column, at most once, and its value.
    pub(super) fn new(
        height: usize,
        width: usize,
        row: impl Fn(usize, &mut dyn FnMut(usize, f64)) + Sync,
    ) -> Self {
        let parts: Vec<(Vec<usize>, Vec<u32>, Vec<f64>)> = (0..height.div_ceil(ROWS))
            .into_par_iter()
            .map(|part| {
                let (mut ends, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
                for i in part * ROWS..((part + 1) * ROWS).min(height) {
                    row(i, &mut |column, value| {
                        columns.push(column as u32);
                        values.push(value);
                    });
                    ends.push(columns.len());
                }
                (ends, columns, values)
            })
            .collect();
        let mut out = Self { starts: vec![0], width, ..Self::default() };
        for (ends, columns, values) in parts {
            let base = out.columns.len();
            out.starts.extend(ends.iter().map(|e| base + e));
            out.columns.extend(columns);
            out.values.extend(values);
        }
        out
    }

    pub(super) fn height(&self) -> usize {
        self.starts.len() - 1
    }

    /// Columns and values of a row.
    pub(super) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[i]..self.starts[i + 1];
        self.columns[range.clone()].iter().zip(&self.values[range]).map(|(&c, &v)| (c as usize, v))
    }

    fn times_row(&self, i: usize, x: &[Triple]) -> Triple {
        let mut sum = [0.0; 3];
        for (c, v) in self.row(i) {
            let x = &x[c];
            sum = [sum[0] + v * x[0], sum[1] + v * x[1], sum[2] + v * x[2]];
        }
        sum
    }

    /// `each(yᵢ, (A x)ᵢ)` for every row.
    pub(super) fn apply(&self, x: &[Triple], y: &mut [Triple], each: impl Fn(&mut Triple, Triple) + Sync) {
        debug_assert_eq!((x.len(), y.len()), (self.width, self.height()));
        y.par_chunks_mut(ROWS).enumerate().for_each(|(part, y)| {
            for (k, y) in y.iter_mut().enumerate() {
                each(y, self.times_row(part * ROWS + k, x));
            }
        });
    }

    /// The transposed matrix; rows ascending in their columns.
    pub(super) fn transposed(&self) -> Self {
        let mut starts = vec![0; self.width + 1];
        for &c in &self.columns {
            starts[c as usize + 1] += 1;
        }
        for i in 0..self.width {
            starts[i + 1] += starts[i];
        }
        let mut at = starts.clone();
        let (mut columns, mut values) = (vec![0; self.columns.len()], vec![0.0; self.columns.len()]);
        for i in 0..self.height() {
            for (c, v) in self.row(i) {
                (columns[at[c]], values[at[c]]) = (i as u32, v);
                at[c] += 1;
            }
        }
        Self { starts, columns, values, width: self.height() }
    }

    /// The product with another matrix, summed in the order of this one's rows (Gustavson 1978).
    pub(super) fn times(&self, other: &Self) -> Self {
        Self::new(self.height(), other.width, |i, give| {
            SCRATCH.with_borrow_mut(|(slots, sums)| {
                if slots.len() < other.width {
                    slots.resize(other.width, u32::MAX);
                }
                sums.clear();
                for (k, a) in self.row(i) {
                    for (c, b) in other.row(k) {
                        if slots[c] == u32::MAX {
                            slots[c] = sums.len() as u32;
                            sums.push((c, 0.0));
                        }
                        sums[slots[c] as usize].1 += a * b;
                    }
                }
                for (c, sum) in sums.iter() {
                    slots[*c] = u32::MAX;
                    give(*c, *sum);
                }
            });
        })
    }

    /// The diagonal.
    pub(super) fn diagonal(&self) -> Vec<f64> {
        (0..self.height()).map(|i| self.row(i).filter(|(c, _)| *c == i).map(|(_, v)| v).sum()).collect()
    }

    /// The largest sum of a row's absolute values over its diagonal: no eigenvalue of `D⁻¹ A` is larger (Gershgorin).
    pub(super) fn bound(&self, diagonal: &[f64]) -> f64 {
        let row = |i: usize| self.row(i).map(|(_, v)| v.abs()).sum::<f64>() / diagonal[i];
        (0..self.height()).into_par_iter().map(row).reduce(|| 0.0, f64::max)
    }
}

/// Values for the axes of space, and one more that fills a processor's lane.
pub(super) type Quad = [f32; 4];

/// A matrix of fewer digits, for what needs to be right in its direction only.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Single {
    starts: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f32>,
}

impl Single {
    pub(super) fn new(matrix: &Matrix) -> Self {
        Self {
            starts: matrix.starts.iter().map(|s| *s as u32).collect(),
            columns: matrix.columns.clone(),
            values: matrix.values.iter().map(|v| *v as f32).collect(),
        }
    }

    pub(super) fn height(&self) -> usize {
        self.starts.len() - 1
    }

    /// `each(yᵢ, (A x)ᵢ)` for every row.
    pub(super) fn apply(&self, x: &[Quad], y: &mut [Quad], each: impl Fn(&mut Quad, Quad) + Sync) {
        debug_assert_eq!(y.len(), self.height());
        let times = |i: usize| {
            let range = self.starts[i] as usize..self.starts[i + 1] as usize;
            let (columns, values) = (&self.columns[range.clone()], &self.values[range]);
            // Four sums, so that none waits for the one before.
            let mut sums = [Quad::default(); 4];
            let add = |sum: &mut Quad, c: u32, v: f32| {
                let x = &x[c as usize];
                *sum = std::array::from_fn(|a| sum[a] + v * x[a]);
            };
            let (fours, left) = columns.as_chunks::<4>();
            let (of_fours, of_left) = values.as_chunks::<4>();
            for (c, v) in fours.iter().zip(of_fours) {
                for k in 0..4 {
                    add(&mut sums[k], c[k], v[k]);
                }
            }
            for (c, v) in left.iter().zip(of_left) {
                add(&mut sums[0], *c, *v);
            }
            std::array::from_fn(|a| (sums[0][a] + sums[1][a]) + (sums[2][a] + sums[3][a]))
        };
        y.par_chunks_mut(ROWS).enumerate().for_each(|(part, y)| {
            for (k, y) in y.iter_mut().enumerate() {
                each(y, times(part * ROWS + k));
            }
        });
    }
}

/// Room for a row of a product: the place of each column in the sums, and the sums.
type Scratch = (Vec<u32>, Vec<(usize, f64)>);

thread_local! {
    static SCRATCH: RefCell<Scratch> = const { RefCell::new((Vec::new(), Vec::new())) };
}

/// Sums of products, an axis at a time, in a fixed order.
pub(super) fn dot(a: &[Triple], b: &[Triple]) -> Triple {
    let part = |(a, b): (&[Triple], &[Triple])| {
        let mut sum = [0.0; 3];
        for (a, b) in a.iter().zip(b) {
            sum = [sum[0] + a[0] * b[0], sum[1] + a[1] * b[1], sum[2] + a[2] * b[2]];
        }
        sum
    };
    let parts: Vec<Triple> = a.par_chunks(4 * ROWS).zip(b.par_chunks(4 * ROWS)).map(part).collect();
    parts.iter().fold([0.0; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]])
}

/// A dense `L Lᵀ` of a small symmetric positive matrix (Cholesky).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Dense {
    n: usize,
    /// The rows of `L`, each to its diagonal.
    lower: Vec<f64>,
}

impl Dense {
    pub(super) fn new(matrix: &Matrix) -> Self {
        let n = matrix.height();
        let start = |i: usize| i * (i + 1) / 2;
        let mut lower = vec![0.0; start(n)];
        for i in 0..n {
            for (c, v) in matrix.row(i).filter(|(c, _)| *c <= i) {
                lower[start(i) + c] += v;
            }
        }
        for i in 0..n {
            let (done, rest) = lower.split_at_mut(start(i));
            let row = &mut rest[..=i];
            let whole = row[i];
            for j in 0..i {
                let other = &done[start(j)..=start(j) + j];
                let sum: f64 = row[..j].iter().zip(other).map(|(a, b)| a * b).sum();
                row[j] = (row[j] - sum) / other[j];
            }
            let pivot = whole - row[..i].iter().map(|v| v * v).sum::<f64>();
            // What rounding has left of a direction that nothing holds: it isn't moved.
            row[i] = if pivot > 1e-14 * whole { pivot.sqrt() } else { 1e150 };
        }
        Self { n, lower }
    }

    pub(super) fn solve(&self, b: &[Triple]) -> Vec<Triple> {
        let start = |i: usize| i * (i + 1) / 2;
        let mut x = b.to_vec();
        for i in 0..self.n {
            let row = &self.lower[start(i)..=start(i) + i];
            for j in 0..i {
                let y = x[j];
                for a in 0..3 {
                    x[i][a] -= row[j] * y[a];
                }
            }
            x[i] = x[i].map(|v| v / row[i]);
        }
        for i in (0..self.n).rev() {
            let row = &self.lower[start(i)..=start(i) + i];
            x[i] = x[i].map(|v| v / row[i]);
            let y = x[i];
            for j in 0..i {
                for a in 0..3 {
                    x[j][a] -= row[j] * y[a];
                }
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(i: usize, j: usize) -> f64 {
        let hash = (i * 31 + j * 17) % 11;
        if hash < 4 { hash as f64 - 1.5 } else { 0.0 }
    }

    fn sparse(height: usize, width: usize) -> Matrix {
        Matrix::new(height, width, |i, give| {
            for j in (0..width).filter(|j| entry(i, *j) != 0.0) {
                give(j, entry(i, j));
            }
        })
    }

    fn dense(m: &Matrix) -> Vec<Vec<f64>> {
        let mut out = vec![vec![0.0; m.width]; m.height()];
        for i in 0..m.height() {
            m.row(i).for_each(|(j, v)| out[i][j] += v);
        }
        out
    }

    #[test]
    fn products_and_transposes_are_those_of_dense_matrices() {
        let (a, b) = (sparse(13, 700), sparse(700, 9));
        let product = dense(&a.times(&b));
        for i in 0..13 {
            for j in 0..9 {
                let expected: f64 = (0..700).map(|k| entry(i, k) * entry(k, j)).sum();
                assert!((product[i][j] - expected).abs() < 1e-10);
            }
        }
        let back = dense(&b.transposed());
        assert!((0..9).all(|i| (0..700).all(|j| back[i][j] == entry(j, i))));
    }

    #[test]
    fn cholesky_solves_what_the_matrix_multiplies() {
        let a = sparse(40, 40);
        let square = a.transposed().times(&a);
        let spd = Matrix::new(40, 40, |i, give| {
            for (j, v) in square.row(i) {
                give(j, v + f64::from(u8::from(i == j)));
            }
        });
        let x: Vec<Triple> = (0..40).map(|i| [f64::from(i), 1.0, -0.1 * f64::from(i)]).collect();
        let mut b = vec![[0.0; 3]; 40];
        spd.apply(&x, &mut b, |b, v| *b = v);
        let found = Dense::new(&spd).solve(&b);
        let worst = found
            .iter()
            .zip(&x)
            .flat_map(|(p, q)| (0..3).map(move |a| (p[a] - q[a]).abs()))
            .fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst}");
    }
}
