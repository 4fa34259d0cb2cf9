//! Distances to a set, exact, along one axis after the other (Felzenszwalb & Huttenlocher 2012).

use ivd_core::{Error, Exec, parallel};

/// Greatest squared distance (mm²) that is within a radius: the same steps along the axes may be rounded in another order.
pub(crate) fn limit(radius: f64) -> f32 {
    (radius * radius * (1.0 + 1e-6)) as f32
}

/// Squared distance (mm²) of every voxel of a box to the nearest one that `holds`; infinite where none does.
///
/// # Errors
/// Memory, cancelled.
pub(crate) fn squared_distances(
    size: [usize; 3],
    edges: [f64; 3],
    holds: &(dyn Fn(usize) -> bool + Sync),
    exec: &Exec,
) -> Result<Vec<f32>, Error> {
    let [nx, ny, nz] = size;
    let layer = nx * ny;
    exec.check_memory("distances to a part", 8 * (layer * nz) as u64)?;
    let mut out = vec![0.0_f32; layer * nz];
    parallel::try_for_each_piece_mut(&mut out, layer, &|z, out| {
        exec.check_cancelled()?;
        for (i, out) in out.iter_mut().enumerate() {
            *out = if holds(i + layer * z) { 0.0 } else { f32::INFINITY };
        }
        let mut work = Envelope::default();
        for row in out.chunks_mut(nx) {
            work.of(row, edges[0]);
        }
        let mut column = vec![0.0; ny];
        for x in 0..nx {
            (0..ny).for_each(|y| column[y] = out[x + nx * y]);
            work.of(&mut column, edges[1]);
            (0..ny).for_each(|y| out[x + nx * y] = column[y]);
        }
        Ok::<_, Error>(())
    })?;
    // Along z: rows of x at a time, each thread its own.
    let columns = parallel::try_map(ny, &|y| {
        exec.check_cancelled()?;
        let mut work = Envelope::default();
        let mut block = vec![0.0_f32; nx * nz];
        let mut column = vec![0.0; nz];
        for x in 0..nx {
            (0..nz).for_each(|z| column[z] = out[x + nx * (y + ny * z)]);
            work.of(&mut column, edges[2]);
            (0..nz).for_each(|z| block[x + nx * z] = column[z]);
        }
        Ok::<_, Error>(block)
    })?;
    parallel::for_each_piece_mut(&mut out, layer, &|z, out| {
        for (y, row) in out.chunks_mut(nx).enumerate() {
            row.copy_from_slice(&columns[y][nx * z..nx * (z + 1)]);
        }
    });
    Ok(out)
}

/// Lower envelope of parabolas.
#[derive(Default)]
struct Envelope {
    /// Where the parabolas stand, and from where on each is the lowest.
    at: Vec<usize>,
    from: Vec<f64>,
    heights: Vec<f64>,
}

impl Envelope {
    fn of(&mut self, values: &mut [f32], edge: f64) {
        self.at.clear();
        self.from.clear();
        self.heights.clear();
        self.heights.extend(values.iter().map(|&v| f64::from(v) / (edge * edge)));
        let f = &self.heights;
        for q in (0..f.len()).filter(|&q| f[q].is_finite()) {
            let meets = |p: usize| {
                let (p_at, q_at) = (p as f64, q as f64);
                ((f[q] + q_at * q_at) - (f[p] + p_at * p_at)) / (2.0 * (q_at - p_at))
            };
            let mut from = f64::NEG_INFINITY;
            while let Some(&last) = self.at.last() {
                from = meets(last);
                if from > *self.from.last().expect("one for each") {
                    break;
                }
                self.at.pop();
                self.from.pop();
                from = f64::NEG_INFINITY;
            }
            self.at.push(q);
            self.from.push(from);
        }
        if self.at.is_empty() {
            return;
        }
        let mut k = 0;
        for (i, out) in values.iter_mut().enumerate() {
            while k + 1 < self.at.len() && self.from[k + 1] <= i as f64 {
                k += 1;
            }
            let p = self.at[k];
            *out = (((i as f64 - p as f64).powi(2) + f[p]) * edge * edge) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::noise;

    use super::*;

    #[test]
    fn distances_equal_those_found_by_asking_every_voxel() {
        for case in 0..30 {
            let size: [usize; 3] = std::array::from_fn(|a| 1 + noise::below(case, a as u64, 9) as usize);
            let edges = [1.0, 0.5 + noise::unit(case, 5), 3.0 * noise::unit(case, 6) + 0.1];
            let n: usize = size.iter().product();
            let set: Vec<bool> = (0..n as u64).map(|i| noise::below(case, 10 + i, 12) == 0).collect();
            let found = squared_distances(size, edges, &|i| set[i], &Exec::default()).unwrap();
            let at = |i: usize| [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
            for (i, found) in found.iter().enumerate() {
                let plain = (0..n)
                    .filter(|&j| set[j])
                    .map(|j| {
                        (0..3).map(|a| ((at(i)[a] as f64 - at(j)[a] as f64) * edges[a]).powi(2)).sum::<f64>()
                    })
                    .fold(f64::INFINITY, f64::min) as f32;
                assert!(
                    (found - plain).abs() <= 1e-4 * plain || *found == plain,
                    "case {case}: {found} {plain}"
                );
            }
        }
    }
}
