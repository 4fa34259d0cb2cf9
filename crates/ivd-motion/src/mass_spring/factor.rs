//! A sparse symmetric matrix, factored once.
//!
//! `A = L D Lᵀ`, row by row along the elimination tree (Davis 2005, LDL), after nested dissection by coordinates: a surface
//! of `n` vertices is cut by about `√n` of them, which fills the factor with `n log n` entries.
//!
//! The argument for the `unsafe` block: what needs AVX2 is called only where it was found. It does the plain loops' operations in
//! their order, and gives the same bytes.

use super::spring::{Spring, Vectors};

/// Parts of so few vertices aren't cut further.
const LEAF: usize = 32;
/// A pivot is at least this fraction of its diagonal entry.
const LEAST_PIVOT: f64 = 1e-14;

/// The factor of a matrix of which the off-diagonal entries are minus the springs' stiffness.
#[derive(Debug, Clone)]
pub(super) struct Factor {
    /// Which vertex each row is.
    vertex: Vec<u32>,
    first: Vec<usize>,
    row: Vec<u32>,
    value: Vec<f64>,
    pivot: Vec<f64>,
}

impl Factor {
    /// - `extra`: what is added to each diagonal entry, beyond the stiffness of the vertex's springs (g/s²).
    pub(super) fn new(rest: &Vectors, springs: &[Spring], extra: &[f64]) -> Self {
        let n = extra.len();
        let (first, other, stiffness) = neighbours(springs, n);
        let around = |v: usize| first[v]..first[v + 1];
        let vertex = dissected(&rest[..n], |v| &other[around(v)]);
        let mut row_of = vec![0_u32; n];
        for (row, &v) in vertex.iter().enumerate() {
            row_of[v as usize] = row as u32;
        }
        let mut diagonal = extra.to_vec();
        for spring in springs {
            for v in spring.ends.map(|v| v as usize).into_iter().filter(|v| *v < n) {
                diagonal[v] += spring.stiffness;
            }
        }
        // The entries of row `k` before its diagonal.
        let entries = |k: usize| {
            around(vertex[k] as usize)
                .map(|e| (row_of[other[e] as usize] as usize, -stiffness[e]))
                .filter(move |(i, _)| *i < k)
        };
        let none = usize::MAX;
        let (mut parent, mut flag, mut count) = (vec![none; n], vec![none; n], vec![0; n]);
        for k in 0..n {
            flag[k] = k;
            for (mut i, _) in entries(k) {
                while flag[i] != k {
                    if parent[i] == none {
                        parent[i] = k;
                    }
                    count[i] += 1;
                    flag[i] = k;
                    i = parent[i];
                }
            }
        }
        let mut first = vec![0; n + 1];
        for k in 0..n {
            first[k + 1] = first[k] + count[k];
        }
        let (mut row, mut value) = (vec![0_u32; first[n]], vec![0.0; first[n]]);
        let (mut next, mut pivot, mut dense) = (first.clone(), vec![0.0; n], vec![0.0; n]);
        let (mut path, mut pattern) = (Vec::new(), Vec::new());
        flag.fill(none);
        for k in 0..n {
            flag[k] = k;
            pattern.clear();
            for (i, a) in entries(k) {
                dense[i] += a;
                let mut at = i;
                path.clear();
                while flag[at] != k {
                    path.push(at);
                    flag[at] = k;
                    at = parent[at];
                }
                // Paths are met leaf first; what is nearer to the root comes later.
                pattern.extend(path.drain(..).rev());
            }
            let own = diagonal[vertex[k] as usize];
            let mut d = own;
            for &i in pattern.iter().rev() {
                let y = std::mem::take(&mut dense[i]);
                for e in first[i]..next[i] {
                    dense[row[e] as usize] -= value[e] * y;
                }
                let l = y / pivot[i];
                d -= l * y;
                (row[next[i]], value[next[i]]) = (k as u32, l);
                next[i] += 1;
            }
            pivot[k] = d.max(LEAST_PIVOT * own).max(f64::MIN_POSITIVE);
        }
        Self { vertex, first, row, value, pivot }
    }

    /// Number of entries below the diagonal.
    #[cfg(test)]
    pub(super) fn entries(&self) -> usize {
        self.row.len()
    }

    /// The solution `x` of `A x = b`, one for each component of the vectors.
    ///
    /// - `simd`: whether to use what not every processor of its kind has, where this one does.
    pub(super) fn solve(&self, b: &Vectors, simd: bool) -> Vec<[f64; 3]> {
        #[cfg(target_arch = "x86_64")]
        if simd && ivd_core::has_avx2() {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            #[cfg_attr(not(test), allow(unused_mut, reason = "a test spoils it"))]
            let mut x = unsafe { self.solve_avx2(b) };
            #[cfg(test)]
            crate::mass_spring::planted::spoil(x.as_flattened_mut());
            return x;
        }
        self.solve_any(b)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn solve_avx2(&self, b: &Vectors) -> Vec<[f64; 3]> {
        self.solve_any(b)
    }

    /// The plain twin, which is compiled for AVX2 too.
    #[inline(always)]
    pub(super) fn solve_any(&self, b: &Vectors) -> Vec<[f64; 3]> {
        let n = self.vertex.len();
        // As wide as the processor's vectors: the last component is 0.
        let mut x = vec![[0.0; 4]; n];
        for (x, &v) in x.iter_mut().zip(&self.vertex) {
            x[..3].copy_from_slice(&b[v as usize]);
        }
        for k in 0..n {
            let own = x[k];
            let column = self.first[k]..self.first[k + 1];
            for (&i, &l) in self.row[column.clone()].iter().zip(&self.value[column]) {
                let x = &mut x[i as usize];
                for a in 0..4 {
                    x[a] -= l * own[a];
                }
            }
        }
        for k in (0..n).rev() {
            let column = self.first[k]..self.first[k + 1];
            let mut own = x[k];
            for c in &mut own {
                *c /= self.pivot[k];
            }
            for (&i, &l) in self.row[column.clone()].iter().zip(&self.value[column]) {
                let x = &x[i as usize];
                for a in 0..4 {
                    own[a] -= l * x[a];
                }
            }
            x[k] = own;
        }
        let mut solution = vec![[0.0; 3]; n];
        for (&v, x) in self.vertex.iter().zip(x) {
            solution[v as usize].copy_from_slice(&x[..3]);
        }
        solution
    }
}

/// The springs between the first `n` vertices, by vertex: where each one's begin, the other ends, the stiffnesses.
fn neighbours(springs: &[Spring], n: usize) -> (Vec<usize>, Vec<u32>, Vec<f64>) {
    let between = springs.iter().filter(|s| s.ends.iter().all(|&v| (v as usize) < n));
    let both = || between.clone().flat_map(|s| [(s.ends[0], s.ends[1], s), (s.ends[1], s.ends[0], s)]);
    let mut first = vec![0; n + 1];
    for (a, ..) in both() {
        first[a as usize + 1] += 1;
    }
    for v in 0..n {
        first[v + 1] += first[v];
    }
    let (mut other, mut stiffness) = (vec![0; first[n]], vec![0.0; first[n]]);
    let mut next = first.clone();
    for (a, b, spring) in both() {
        let at = &mut next[a as usize];
        (other[*at], stiffness[*at]) = (b, spring.stiffness);
        *at += 1;
    }
    (first, other, stiffness)
}

/// The vertices in the order of elimination: both halves, then the vertices that separate them, each half likewise.
fn dissected<'a>(rest: &Vectors, around: impl Fn(usize) -> &'a [u32]) -> Vec<u32> {
    let mut order = Vec::with_capacity(rest.len());
    // Backwards: separators first, so that a stack of parts will do.
    let mut parts = vec![(0..rest.len() as u32).collect::<Vec<u32>>()];
    let mut half = vec![0_u32; rest.len()];
    let mut label = 0;
    while let Some(mut part) = parts.pop() {
        if part.len() <= LEAF {
            order.extend(part);
            continue;
        }
        let extent = |a: usize| {
            let along = part.iter().map(|&v| rest[v as usize][a]);
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
            high - low
        };
        let axis = (1..3).fold(0, |best, a| if extent(a) > extent(best) { a } else { best });
        part.sort_unstable_by(|&a, &b| {
            rest[a as usize][axis].total_cmp(&rest[b as usize][axis]).then(a.cmp(&b))
        });
        let upper = part.split_off(part.len() / 2);
        label += 2;
        for (part, label) in [(&part, label), (&upper, label + 1)] {
            for &v in part {
                half[v as usize] = label;
            }
        }
        let split = |own: &[u32], other: u32| -> (Vec<u32>, Vec<u32>) {
            own.iter().partition(|&&v| around(v as usize).iter().any(|&u| half[u as usize] == other))
        };
        let (below, above) = (split(&part, label + 1), split(&upper, label));
        if below.0.len() <= above.0.len() {
            order.extend(below.0);
            parts.extend([below.1, upper]);
        } else {
            order.extend(above.0);
            parts.extend([part, above.1]);
        }
    }
    order.reverse();
    order
}
