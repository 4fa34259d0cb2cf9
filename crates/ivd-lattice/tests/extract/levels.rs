//! The topology of a trilinear field, found without cutting it: what lattices of small integer fields are held against.

/// Voxels and saddles on the isovalue are inside: as if it were less by a hair.
const HAIR: f64 = 1e-5;

/// Euler characteristic of where a bilinear function with these corners, in turn, is at least 0.
fn slice_euler(v: [f64; 4], on_saddle: bool) -> i64 {
    let inside = v.map(|v| v >= 0.0);
    let edges = (0..4).filter(|&i| inside[i] && inside[(i + 1) % 4]).count() as i64;
    let joins = v[0] * v[2] - v[1] * v[3];
    let face = match inside {
        [true, true, true, true] => 1,
        [true, false, true, false] if on_saddle || joins >= 0.0 => -1,
        [false, true, false, true] if on_saddle || joins <= 0.0 => -1,
        _ => 0,
    };
    inside.iter().filter(|inside| **inside).count() as i64 - edges + face
}

/// The same of a trilinear function: that of the slices, integrated over z with the Euler characteristic as measure. A slice at
/// which something changes counts 1, the slices between two of them count -1.
fn cell_euler(corners: [f64; 8]) -> i64 {
    let [low, high] = [0, 4].map(|z| [0, 1, 3, 2].map(|i| corners[i + z]));
    let at = |t: f64| -> [f64; 4] {
        // A corner that crosses 0 here is 0 here.
        std::array::from_fn(|i| {
            if zero(low[i], high[i]) == Some(t) { 0.0 } else { low[i] + (high[i] - low[i]) * t }
        })
    };
    let joins = |v: [f64; 4]| v[0] * v[2] - v[1] * v[3];
    let [c0, c1, half] = [joins(low), joins(high), joins(at(0.5))];
    let square = 2.0 * c0 + 2.0 * c1 - 4.0 * half;
    let slope = c1 - c0 - square;
    let q = -0.5 * (slope + (slope * slope - 4.0 * square * c0).sqrt().copysign(slope));
    let mut cuts: Vec<(f64, bool)> = vec![(0.0, false), (1.0, false)];
    cuts.extend((0..4).filter_map(|i| zero(low[i], high[i])).map(|t| (t, false)));
    let far = |t: f64, cuts: &[(f64, bool)]| cuts.iter().all(|(other, _)| (t - other).abs() > 1e-13);
    for t in [q / square, c0 / q] {
        if 0.0 < t && t < 1.0 && far(t, &cuts) {
            cuts.push((t, true));
        }
    }
    cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
    cuts.dedup_by_key(|cut| cut.0);
    let slices: i64 = cuts.iter().map(|&(t, on_saddle)| slice_euler(at(t), on_saddle)).sum();
    slices - cuts.windows(2).map(|w| slice_euler(at(0.5 * (w[0].0 + w[1].0)), false)).sum::<i64>()
}

/// Where a line from `low` at 0 to `high` at 1 crosses 0.
fn zero(low: f64, high: f64) -> Option<f64> {
    ((low > 0.0) != (high > 0.0)).then(|| low / (low - high))
}

/// A small field with its levels doubled, so that half isovalues stay integers; everything around it is outside.
pub(crate) struct Levels {
    dims: [i64; 3],
    doubled: Vec<i64>,
}

impl Levels {
    pub(crate) fn new<T: Copy + Into<i64>>(dims: [usize; 3], voxels: &[T], iso: f64) -> Self {
        let doubled = voxels.iter().map(|&v| 2 * v.into() - (2.0 * iso) as i64).collect();
        Self { dims: dims.map(|d| d as i64), doubled }
    }

    fn at(&self, v: [i64; 3]) -> Option<i64> {
        let inside = (0..3).all(|a| (0..self.dims[a]).contains(&v[a]));
        inside.then(|| self.doubled[(v[0] + self.dims[0] * (v[1] + self.dims[1] * v[2])) as usize])
    }

    pub(crate) fn inside(&self, v: [i64; 3]) -> bool {
        self.at(v).is_some_and(|level| level >= 0)
    }

    /// Levels of a cell's corners, x fastest; of one beyond the border, far below all others.
    fn corners(&self, first: [i64; 3]) -> [f64; 8] {
        let corner = |i: usize| std::array::from_fn(|a| first[a] + (i >> a & 1) as i64);
        std::array::from_fn(|i| self.at(corner(i)).map_or(-1000.0, |level| level as f64) + HAIR)
    }

    /// Euler characteristic of the solid: by inclusion and exclusion over cells, faces, edges and voxels.
    pub(crate) fn solid_euler(&self) -> i64 {
        let mut sum = 0;
        for z in -1..=self.dims[2] {
            for y in -1..=self.dims[1] {
                for x in -1..=self.dims[0] {
                    for (extent, sign) in [
                        ([1, 1, 1], 1),
                        ([1, 1, 0], -1),
                        ([1, 0, 1], -1),
                        ([0, 1, 1], -1),
                        ([1, 0, 0], 1),
                        ([0, 1, 0], 1),
                        ([0, 0, 1], 1),
                        ([0, 0, 0], -1),
                    ] {
                        let corners = self.corners([x, y, z]);
                        let step: Vec<usize> = (0..3).filter(|a| extent[*a] == 1).map(|a| 1 << a).collect();
                        sum += sign
                            * match *step.as_slice() {
                                [u, v] => slice_euler([0, u, u | v, v].map(|i| corners[i]), false),
                                [] => i64::from(corners[0] > 0.0),
                                [u] => i64::from(corners[0] > 0.0 || corners[u] > 0.0),
                                _ => cell_euler(corners),
                            };
                    }
                }
            }
        }
        sum
    }
}
