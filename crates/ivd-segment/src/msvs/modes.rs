//! Which modes persist, and what the others are given up to.
//!
//! Two basins meet at a saddle, the highest of the cells on their border. Taking saddles from the highest down, the lower of
//! the two peaks that it joins ends there: its persistence is how far it stood above (Edelsbrunner, Letscher & Zomorodian 2002;
//! for clusters, Chazal et al. 2013).

use std::collections::HashMap;

use ivd_core::{Error, Exec, parallel, sets};
use rayon::prelude::*;

use super::ascent::{Axis, Basins, NO_BASIN, axes};
use super::cells::Cells;
use super::density::Heights;
use super::params::MsvsParams;

/// Cells that one task looks at.
const CHUNK: usize = 1 << 16;
/// A saddle this close to its peak, relatively, is a plateau in single precision.
const PLATEAU: f64 = 1e-5;
/// With places too: counts in cells of a voxel leave the density ripples of up to a quarter of a per cent.
const RIPPLE: f64 = 5e-3;
/// Standard deviations of a count by which a peak must stand above its saddle.
const CHANCE: f64 = 3.0;

/// A mode that is kept.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Peak {
    /// Place among the cells, x, y, z and value; a cell's middle has whole numbers.
    pub(super) place: [f64; 4],
    /// Sum of the kernel's weights.
    pub(super) density: f64,
    pub(super) persistence: f64,
}

/// The modes that are kept, and which of them every basin belongs to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Peaks {
    /// Those that stand highest above their saddles first.
    pub(super) kept: Vec<Peak>,
    /// Index of the mode that each basin goes to.
    pub(super) of: Vec<u16>,
    pub(super) k_proposed: usize,
}

/// Where a peak ends: the density of the saddle, and the basin on the other side of it.
#[derive(Debug, Clone, Copy)]
struct End {
    saddle: f64,
    into: Option<u32>,
}

pub(super) fn of(
    cells: &Cells,
    heights: &Heights,
    basins: &Basins,
    params: &MsvsParams,
    exec: &Exec,
) -> Result<Peaks, Error> {
    let density: Vec<f64> =
        basins.peaks.iter().map(|cell| heights.density(f64::from(heights.of[*cell as usize]))).collect();
    let ends = ends(density.len(), &saddles(cells, heights, basins, exec)?, heights);
    let persistence = |m: usize| 1.0 - ends[m].saddle / density[m];
    let above = |m: usize| density[m] - ends[m].saddle;
    let mut ranked: Vec<usize> = (0..density.len())
        .filter(|m| {
            let exact = if params.spatial_bandwidth > 0.0 { RIPPLE } else { PLATEAU };
            let least = params.persistence.max(exact);
            let chance = if params.persistence > 0.0 { CHANCE * density[*m].sqrt() } else { 0.0 };
            *m == 0 || (persistence(*m) > least && above(*m) >= chance)
        })
        .collect();
    ranked.sort_by(|a, b| above(*b).total_cmp(&above(*a)).then(a.cmp(b)));
    let k_proposed = ranked.len();
    ranked.truncate(params.k_max);
    let mut kept: Vec<(Peak, usize)> = ranked
        .iter()
        .map(|m| {
            let (place, density) = refined(cells, heights, basins.peaks[*m] as usize);
            let persistence = (1.0 - ends[*m].saddle / density).clamp(0.0, 1.0);
            (Peak { place, density, persistence }, *m)
        })
        .collect();
    // Between cells a peak stands a little higher than its cell.
    let above = |peak: &Peak| peak.density * peak.persistence;
    kept.sort_by(|a, b| above(&b.0).total_cmp(&above(&a.0)).then(a.1.cmp(&b.1)));
    let (kept, ranked): (Vec<Peak>, Vec<usize>) = kept.into_iter().unzip();
    Ok(Peaks { kept, of: owners(cells, basins, &ends, &ranked), k_proposed })
}

/// The highest saddle of every two basins that meet: `(height, lower id, higher id)`, the highest first.
fn saddles(
    cells: &Cells,
    heights: &Heights,
    basins: &Basins,
    exec: &Exec,
) -> Result<Vec<(f32, u32, u32)>, Error> {
    if basins.peaks.len() == 1 {
        return Ok(Vec::new());
    }
    let strides = cells.strides();
    let looked: Vec<(usize, usize)> =
        (0..4).filter(|a| cells.dims[*a] > 1).map(|a| (strides[a], cells.dims[a])).collect();
    let pieces = parallel::pieces(basins.of.len(), CHUNK);
    let parts = parallel::try_gather(pieces, &HashMap::new, &|found: &mut HashMap<(u32, u32), f32>, i| {
        exec.check_cancelled()?;
        for cell in parallel::piece(basins.of.len(), CHUNK, i).filter(|c| basins.of[*c] != NO_BASIN) {
            let a = basins.of[cell];
            for &(stride, len) in &looked {
                // The other cell's basin first: nearly always it settles the matter without a division.
                let Some(&b) = basins.of.get(cell + stride) else { continue };
                if b == a || b == NO_BASIN || cell / stride % len + 1 == len {
                    continue;
                }
                let height = heights.of[cell].min(heights.of[cell + stride]);
                let most = found.entry((a.min(b), a.max(b))).or_insert(height);
                *most = most.max(height);
            }
        }
        Ok::<_, Error>(())
    })?;
    let mut found: HashMap<(u32, u32), f32> = HashMap::new();
    for (pair, height) in parts.into_iter().flatten() {
        let most = found.entry(pair).or_insert(height);
        *most = most.max(height);
    }
    let mut saddles: Vec<_> = found.into_iter().map(|((a, b), height)| (height, a, b)).collect();
    saddles.par_sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    Ok(saddles)
}

/// Where each peak ends. Peaks are numbered from the highest down.
fn ends(peaks: usize, saddles: &[(f32, u32, u32)], heights: &Heights) -> Vec<End> {
    let mut ends = vec![End { saddle: 0.0, into: None }; peaks];
    let mut parts = sets::singles(peaks);
    for &(height, a, b) in saddles {
        let (first, second) = (sets::root(&mut parts, a), sets::root(&mut parts, b));
        if first != second {
            let (lower, into) = if first > second { (first, b) } else { (second, a) };
            ends[lower as usize] = End { saddle: heights.density(f64::from(height)), into: Some(into) };
            sets::join(&mut parts, first, second);
        }
    }
    ends
}

/// The kept mode of each basin: its own, else that of the basin across its saddle, else the nearest.
fn owners(cells: &Cells, basins: &Basins, ends: &[End], ranked: &[usize]) -> Vec<u16> {
    let mut owner: Vec<Option<u16>> = vec![None; ends.len()];
    for (rank, &m) in ranked.iter().enumerate() {
        owner[m] = Some(rank as u16);
    }
    for start in 0..ends.len() {
        // Across a saddle lies a part that was joined before, then its higher peak: the way never comes back.
        let (mut at, mut way) = (start, Vec::new());
        while let (None, Some(into)) = (owner[at], ends[at].into) {
            way.push(at);
            at = into as usize;
        }
        let end = owner[at].unwrap_or_else(|| nearest(cells, basins, at, ranked));
        owner[at] = Some(end);
        for m in way {
            owner[m] = Some(end);
        }
    }
    owner.into_iter().map(|o| o.expect("every basin got an owner")).collect()
}

fn nearest(cells: &Cells, basins: &Basins, m: usize, ranked: &[usize]) -> u16 {
    let strides = cells.strides();
    let place = |m: usize, axis: usize| basins.peaks[m] as usize / strides[axis] % cells.dims[axis];
    let distance = |other: usize| {
        let along = |axis: usize| {
            let apart = place(m, axis) as f64 - place(other, axis) as f64;
            if apart == 0.0 { 0.0 } else { (apart / cells.sigma[axis]).powi(2) }
        };
        (0..4).map(along).sum::<f64>()
    };
    let by_distance =
        |a: &usize, b: &usize| distance(ranked[*a]).total_cmp(&distance(ranked[*b])).then(a.cmp(b));
    (0..ranked.len()).min_by(by_distance).unwrap_or(0) as u16
}

/// Place and density of the peak of the quadratic function through a cell and its neighbours.
fn refined(cells: &Cells, heights: &Heights, cell: usize) -> ([f64; 4], f64) {
    let strides = cells.strides();
    let mut place: [f64; 4] = std::array::from_fn(|a| (cell / strides[a] % cells.dims[a]) as f64);
    let inner: Vec<Axis> = axes(cells)
        .into_iter()
        .filter(|axis| place[axis.index] > 0.0 && place[axis.index] + 1.0 < cells.dims[axis.index] as f64)
        .collect();
    let height = |offset: isize| heights.slope_height((cell as isize + offset) as usize);
    let stride = |i: usize| inner[i].stride as isize;
    let n = inner.len();
    let slope: Vec<f64> = (0..n).map(|i| 0.5 * (height(stride(i)) - height(-stride(i)))).collect();
    let curve = |i: usize, j: usize| {
        if i == j {
            return height(stride(i)) - 2.0 * height(0) + height(-stride(i));
        }
        let (a, b) = (stride(i), stride(j));
        0.25 * (height(a + b) - height(a - b) - height(b - a) + height(-a - b))
    };
    let curves: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| curve(i, j)).collect()).collect();
    let shift = newton(&curves, &slope).unwrap_or_else(|| vec![0.0; n]);
    let rise = 0.5 * shift.iter().zip(&slope).map(|(d, g)| d * g).sum::<f64>();
    for (axis, shift) in inner.iter().zip(&shift) {
        place[axis.index] += shift;
    }
    (place, heights.density(height(0) + rise))
}

/// The shift to where the slope vanishes, within a cell; `None` where the curvature isn't that of a peak (a plateau).
fn newton(curves: &[Vec<f64>], slope: &[f64]) -> Option<Vec<f64>> {
    let n = slope.len();
    // Cholesky of the negated curvature.
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest: f64 = -curves[i][j] - sum;
            if i == j && rest <= 1e-9 {
                return None;
            }
            lower[i][j] = if i == j { rest.sqrt() } else { rest / lower[j][j] };
        }
    }
    let mut shift = slope.to_vec();
    for i in 0..n {
        let sum: f64 = (0..i).map(|k| lower[i][k] * shift[k]).sum();
        shift[i] = (shift[i] - sum) / lower[i][i];
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| lower[k][i] * shift[k]).sum();
        shift[i] = (shift[i] - sum) / lower[i][i];
    }
    shift.iter().all(|s| s.abs() <= 1.0).then_some(shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newton_finds_the_top_of_a_tilted_parabola_and_refuses_plateaus() {
        // -(x - 0.3)² - (y + 0.2)² + 0.5 (x - 0.3)(y + 0.2): slopes at 0.
        let curves = vec![vec![-2.0, 0.5], vec![0.5, -2.0]];
        let slope = [0.6 + 0.1, -0.4 - 0.15];
        let shift = newton(&curves, &slope).unwrap();
        assert!((shift[0] - 0.3).abs() < 1e-12 && (shift[1] + 0.2).abs() < 1e-12, "{shift:?}");
        assert_eq!(newton(&[vec![0.0]], &[0.0]), None);
        assert_eq!(newton(&[vec![-0.1]], &[0.5]), None, "further than a cell");
    }
}
