//! The set of least energy where area is counted by the edges between neighbouring voxels that the border cuts: a minimum cut, with a
//! bound from below that shows it.
//!
//! ```text
//! E(S) = Σ in S force + μ Σ over cut edges weight,   weight = solid angle / (π length)
//! ```
//!
//! An edge stands for all lines of about its direction, by which area is counted (Cauchy and Crofton; Boykov & Kolmogorov 2003). Its share
//! relaxes to 0 … 1 without loss, so that the iteration of `sweep` closes on the cut: flows along edges stay within μ · weight, and
//! whatever they are, Σ min(0, force − div flow) is below every set's energy.

use std::f64::consts::PI;

use ivd_core::{Exec, Iteration, parallel};

use super::level::Level;
use super::model::Force;
use crate::Error;

/// An edge to a neighbour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    pub(super) step: [isize; 3],
    /// Area that a crossing of it stands for, over a voxel's volume (1 / mm).
    pub(super) weight: f64,
}

/// Directions by which solid angles are counted.
const POINTS: usize = 40_000;

/// Half of the 6 or 26 neighbours of a voxel with edges of these lengths (mm), with their weights.
pub(super) fn edges(neighbours: u8, lengths: [f64; 3]) -> Vec<Edge> {
    let steps: Vec<[isize; 3]> = (14_isize..27)
        .map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1])
        .filter(|step| neighbours == 26 || step.iter().map(|s| s.abs()).sum::<isize>() == 1)
        .collect();
    let vectors: Vec<[f64; 3]> =
        steps.iter().map(|step| std::array::from_fn(|a| step[a] as f64 * lengths[a])).collect();
    let norms: Vec<f64> = vectors.iter().map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt()).collect();
    // Directions to which an edge is the nearest, on a spiral over the half sphere (even in area).
    let mut nearest = vec![0_usize; steps.len()];
    for i in 0..POINTS {
        let z = (i as f64 + 0.5) / POINTS as f64;
        let turn = i as f64 * PI * (3.0 - 5.0_f64.sqrt());
        let r = (1.0 - z * z).sqrt();
        let direction = [r * turn.cos(), r * turn.sin(), z];
        let along = |k: usize| (0..3).map(|a| vectors[k][a] * direction[a]).sum::<f64>().abs() / norms[k];
        let best = (0..steps.len()).max_by(|&a, &b| along(a).total_cmp(&along(b)));
        nearest[best.expect("there are edges")] += 1;
    }
    (0..steps.len())
        .map(|k| {
            let angle = 2.0 * PI * nearest[k] as f64 / POINTS as f64;
            Edge { step: steps[k], weight: angle / (PI * norms[k]) }
        })
        .collect()
}

/// A cut and its bound.
pub(super) struct Cut {
    pub(super) inside: Vec<u8>,
    /// Energy of the cut, and what no set is below.
    pub(super) energy: f64,
    pub(super) bound: f64,
    /// μ times the area.
    pub(super) border: f64,
    pub(super) sweeps: u32,
}

impl Cut {
    /// How far the energy can be above the lowest, over μ times the area.
    pub(super) fn gap(&self) -> f64 {
        (self.energy - self.bound).max(0.0) / self.border.max(f64::MIN_POSITIVE)
    }
}

/// Sweeps between two looks at the bound.
const BETWEEN: u32 = 25;

/// The volume as the iteration sees it.
struct State {
    dims: [usize; 3],
    u: Vec<f32>,
    ahead: Vec<f32>,
    force: Vec<f32>,
    /// By edge.
    flows: Vec<Vec<f32>>,
    edges: Vec<Edge>,
    /// Most that flows along each edge.
    most: Vec<f32>,
}

/// Works on the minimum cut from a set until the gap is closed or the sweeps are used up.
///
/// # Errors
/// Memory, cancelled.
pub(super) fn cut(
    level: &Level,
    start: &[u8],
    force: &Force,
    mu: f64,
    neighbours: u8,
    [tolerance, most]: [f64; 2],
    exec: &Exec,
) -> Result<Cut, Error> {
    let edges = edges(neighbours, level.edges);
    exec.check_memory("the flows of a certificate", (level.len() * 4 * (edges.len() + 5)) as u64)?;
    let layer = level.dims[0] * level.dims[1];
    let mut costs = vec![0.0_f32; level.len()];
    parallel::for_each_piece_mut(&mut costs, layer, &|z, out| {
        let mut values = vec![0.0; layer];
        level.row(layer * z, &mut values);
        force.of(&values, out);
    });
    let most_flow: Vec<f64> = edges.iter().map(|edge| mu * edge.weight).collect();
    let u: Vec<f32> = start.iter().map(|&inside| f32::from(inside)).collect();
    let mut state = State {
        dims: level.dims,
        ahead: u.clone(),
        u,
        force: costs,
        flows: vec![vec![0.0; level.len()]; edges.len()],
        most: most_flow.iter().map(|m| *m as f32).collect(),
        edges,
    };
    // As in `sweep`: a share is worth 1, a flow as much as flows through a voxel's edges.
    let mean = most_flow.iter().sum::<f64>() / most_flow.len() as f64;
    let ratio = 0.5 / mean.max(1e-6);
    let norm = (4.0 * state.edges.len() as f64).sqrt();
    let (tau, sigma) = ((ratio / norm) as f32, (1.0 / (ratio * norm)) as f32);
    let mut best: Option<Cut> = None;
    let mut sweeps = 0;
    loop {
        let [energy, border, bound] = state.look(&|u| u > 0.5, exec)?;
        let now = Cut { inside: Vec::new(), energy, bound, border, sweeps };
        exec.observer().iteration(Iteration { method: "cut", index: u64::from(sweeps), value: energy });
        let bound = best.as_ref().map_or(bound, |before| before.bound.max(bound));
        if best.as_ref().is_none_or(|before| energy < before.energy) {
            let inside = state.u.iter().map(|&u| u8::from(u > 0.5)).collect();
            best = Some(Cut { inside, bound, ..now });
        }
        let kept = best.as_mut().expect("the first is kept");
        (kept.bound, kept.sweeps) = (bound, sweeps);
        if kept.gap() <= tolerance || f64::from(sweeps) >= most {
            break;
        }
        for _ in 0..BETWEEN {
            exec.check_cancelled()?;
            state.sweep(tau, sigma);
            sweeps += 1;
        }
    }
    Ok(best.expect("the first is kept"))
}

/// Rows of a box that an edge leads on from within it: x from, x to, and whether y and z stay inside.
fn reach(step: isize, n: usize) -> std::ops::Range<usize> {
    match step {
        1 => 0..n.saturating_sub(1),
        -1 => 1.min(n)..n,
        _ => 0..n,
    }
}

impl State {
    fn offset(&self, edge: usize) -> isize {
        let [nx, ny, _] = self.dims.map(|n| n as isize);
        let [x, y, z] = self.edges[edge].step;
        x + nx * (y + ny * z)
    }

    /// Ranges of linear indices, a row each in a layer, from which an edge leads to a voxel of the volume.
    fn rows(&self, edge: usize, z: usize) -> Vec<std::ops::Range<usize>> {
        let [nx, ny, nz] = self.dims;
        let [sx, sy, sz] = self.edges[edge].step;
        if !reach(sz, nz).contains(&z) {
            return Vec::new();
        }
        let x = reach(sx, nx);
        reach(sy, ny).map(|y| nx * (y + ny * z)).map(|row| row + x.start..row + x.end).collect()
    }

    fn sweep(&mut self, tau: f32, sigma: f32) {
        let layer = self.dims[0] * self.dims[1];
        for k in 0..self.edges.len() {
            let mut flow = std::mem::take(&mut self.flows[k]);
            let (offset, most) = (self.offset(k), self.most[k]);
            parallel::for_each_piece_mut(&mut flow, layer, &|z, out| {
                for row in self.rows(k, z) {
                    let from = &self.ahead[row.clone()];
                    let to = &self.ahead[row.start.wrapping_add_signed(offset)..][..row.len()];
                    let out = &mut out[row.start - layer * z..][..row.len()];
                    for ((out, from), to) in out.iter_mut().zip(from).zip(to) {
                        *out = (*out + sigma * (to - from)).clamp(-most, most);
                    }
                }
            });
            self.flows[k] = flow;
        }
        let divergences = parallel::map(self.dims[2], &|z| self.divergence(z));
        self.ahead.copy_from_slice(&self.u);
        let force = &self.force;
        parallel::for_each_piece_mut(&mut self.u, layer, &|z, u| {
            for ((u, div), force) in u.iter_mut().zip(&divergences[z]).zip(&force[layer * z..]) {
                *u = (*u + tau * (div - force)).clamp(0.0, 1.0);
            }
        });
        let u = &self.u;
        parallel::for_each_piece_mut(&mut self.ahead, layer, &|z, ahead| {
            ahead.iter_mut().zip(&u[layer * z..]).for_each(|(before, now)| *before = 2.0 * now - *before);
        });
    }

    /// What flows into each voxel of a layer, less what flows out.
    fn divergence(&self, z: usize) -> Vec<f32> {
        let layer = self.dims[0] * self.dims[1];
        let mut sum = vec![0.0_f32; layer];
        for k in 0..self.edges.len() {
            let (flow, offset) = (&self.flows[k], self.offset(k));
            for row in self.rows(k, z) {
                let out = &mut sum[row.start - layer * z..][..row.len()];
                out.iter_mut().zip(&flow[row]).for_each(|(sum, flow)| *sum += flow);
            }
            // Edges that end in this layer begin in it or in the one below.
            let below = self.edges[k].step[2];
            let Some(from) = z.checked_add_signed(-below) else { continue };
            if from >= self.dims[2] {
                continue;
            }
            for row in self.rows(k, from) {
                let first = row.start.wrapping_add_signed(offset) - layer * z;
                let out = &mut sum[first..][..row.len()];
                out.iter_mut().zip(&flow[row]).for_each(|(sum, flow)| *sum -= flow);
            }
        }
        sum
    }

    /// Energy of a set of shares, the border's part of it, and the bound.
    fn look(&self, inside: &(dyn Fn(f32) -> bool + Sync), exec: &Exec) -> Result<[f64; 3], Error> {
        let layer = self.dims[0] * self.dims[1];
        let parts = parallel::try_map(self.dims[2], &|z| {
            exec.check_cancelled()?;
            let own = layer * z..layer * (z + 1);
            let force: f64 = self.u[own.clone()]
                .iter()
                .zip(&self.force[own.clone()])
                .filter(|(u, _)| inside(**u))
                .map(|(_, force)| f64::from(*force))
                .sum();
            let mut border = 0.0;
            for k in 0..self.edges.len() {
                let offset = self.offset(k);
                let cuts: usize = self
                    .rows(k, z)
                    .into_iter()
                    .map(|row| {
                        let to = &self.u[row.start.wrapping_add_signed(offset)..][..row.len()];
                        self.u[row].iter().zip(to).filter(|(a, b)| inside(**a) != inside(**b)).count()
                    })
                    .sum();
                border += f64::from(self.most[k]) * cuts as f64;
            }
            let bound: f64 = self.force[own]
                .iter()
                .zip(self.divergence(z))
                .map(|(force, div)| f64::from((force - div).min(0.0)))
                .sum();
            Ok::<_, Error>([force + border, border, bound])
        })?;
        let mut sums = [0.0; 3];
        for part in &parts {
            for (sum, own) in sums.iter_mut().zip(part) {
                *sum += own;
            }
        }
        Ok(sums)
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Volume, noise};

    use super::super::level::Unit;
    use super::*;

    #[test]
    fn edges_measure_area_in_any_direction_on_any_spacing() {
        for lengths in [[1.0, 1.0, 1.0], [0.7, 1.0, 2.5]] {
            let found = edges(26, lengths);
            assert_eq!(found.len(), 13);
            let volume: f64 = lengths.iter().product();
            // Edges that a plane of this normal cuts, a unit of its area: density of voxels times how far each edge goes through.
            for i in 0..50 {
                let turn = std::f64::consts::TAU * noise::unit(1, i);
                let z = 2.0 * noise::unit(2, i) - 1.0;
                let r = (1.0 - z * z).sqrt();
                let normal = [r * turn.cos(), r * turn.sin(), z];
                let area: f64 = found
                    .iter()
                    .map(|edge| {
                        let through: f64 = (0..3).map(|a| normal[a] * edge.step[a] as f64 * lengths[a]).sum();
                        edge.weight * through.abs()
                    })
                    .sum();
                let allowed = if lengths[2] > 1.0 { 0.25 } else { 0.06 };
                assert!((area - 1.0).abs() < allowed, "{area} along {normal:?} at {lengths:?}, {volume}");
            }
        }
        assert!(edges(6, [1.0; 3]).iter().all(|edge| (edge.weight - 2.0 / 3.0).abs() < 1e-3));
    }

    /// Lowest energy of all sets, by trying each.
    fn lowest(force: &[f64], dims: [usize; 3], weights: &[(Edge, f64)]) -> f64 {
        let at = |i: usize| [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let mut pairs = Vec::new();
        for (edge, weight) in weights {
            for i in 0..force.len() {
                let to: [isize; 3] = std::array::from_fn(|a| at(i)[a] as isize + edge.step[a]);
                if (0..3).all(|a| to[a] >= 0 && to[a] < dims[a] as isize) {
                    let j = to[0] as usize + dims[0] * (to[1] as usize + dims[1] * to[2] as usize);
                    pairs.push((i, j, *weight));
                }
            }
        }
        (0..1_u32 << force.len())
            .map(|set| {
                let inside = |i: usize| set >> i & 1 == 1;
                let fit: f64 = (0..force.len()).filter(|&i| inside(i)).map(|i| force[i]).sum();
                let cut: f64 = pairs
                    .iter()
                    .filter(|(i, j, _)| inside(*i) != inside(*j))
                    .map(|(.., weight)| weight)
                    .sum();
                fit + cut
            })
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_cut_is_the_lowest_of_all_sets_and_the_bound_says_so() {
        for case in 0..30 {
            let dims = [[2, 2, 3], [3, 2, 2], [12, 1, 1], [1, 4, 3]][case % 4];
            let grid = Grid::with_spacing(dims, [1.0, 0.8, 1.6]).unwrap();
            let voxels: Vec<f32> = (0..12).map(|i| noise::unit(case as u64, i) as f32).collect();
            let volume = Volume::new(grid, voxels.into()).unwrap();
            let level = Level::finest(&volume, Unit::of(&volume, None).unwrap(), None);
            let force = Force::Quadratic([-1.0, 2.0, 0.0]);
            let neighbours = if case % 2 == 0 { 26 } else { 6 };
            let mu = 0.02 + 0.4 * noise::unit(99, case as u64);
            let found =
                cut(&level, &[0; 12], &force, mu, neighbours, [1e-5, 20_000.0], &Exec::default()).unwrap();
            let mut values = [0.0; 12];
            level.row(0, &mut values);
            let costs: Vec<f64> = values.iter().map(|v| 2.0 * f64::from(*v) - 1.0).collect();
            let weights: Vec<_> =
                edges(neighbours, level.edges).into_iter().map(|e| (e, mu * e.weight)).collect();
            let lowest = lowest(&costs, dims, &weights);
            assert!((found.energy - lowest).abs() < 1e-5, "case {case}: {} {lowest}", found.energy);
            assert!(
                found.bound <= lowest + 1e-5 && found.bound >= lowest - 1e-3,
                "case {case}: {}",
                found.bound
            );
        }
    }
}
