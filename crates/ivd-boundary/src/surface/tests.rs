//! The parts against plain twins.

use ivd_core::{BRICK, Exec, Grid, Volume, noise};

use super::band::Band;
use super::descent::{Settings, descend};
use super::level::{Level, Unit};
use super::sweep::Steps;
use super::*;

fn volume(dims: [usize; 3], spacing: [f64; 3], of: impl Fn([usize; 3]) -> f32) -> Volume {
    let grid = Grid::with_spacing(dims, spacing).unwrap();
    let voxels: Vec<f32> = (0..grid.len()).map(|i| of(grid.index(i).0)).collect();
    Volume::new(grid, voxels.into()).unwrap()
}

fn finest(volume: &Volume) -> Level<'_> {
    Level::finest(volume, Unit::of(volume, None).unwrap(), None)
}

/// The iteration as it is written, over the whole volume.
struct Plain {
    dims: [usize; 3],
    u: Vec<f64>,
    ahead: Vec<f64>,
    flow: Vec<[f64; 3]>,
}

impl Plain {
    fn stride(&self, a: usize) -> usize {
        [1, self.dims[0], self.dims[0] * self.dims[1]][a]
    }

    fn at(&self, i: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [i % nx, i / nx % ny, i / nx / ny]
    }

    fn sweep(&mut self, force: &[f64], steps: &Steps) {
        for i in 0..self.u.len() {
            for a in 0..3 {
                if self.at(i)[a] + 1 < self.dims[a] {
                    let step = f64::from(steps.sigma) * f64::from(steps.slope[a]);
                    self.flow[i][a] += step * (self.ahead[i + self.stride(a)] - self.ahead[i]);
                }
            }
            let length = self.flow[i].iter().map(|f| f * f).sum::<f64>().sqrt();
            let scale = f64::from(steps.mu) / length.max(f64::from(steps.mu));
            self.flow[i] = self.flow[i].map(|f| f * scale);
        }
        for i in 0..self.u.len() {
            let div: f64 = (0..3)
                .map(|a| {
                    let below = if self.at(i)[a] > 0 { self.flow[i - self.stride(a)][a] } else { 0.0 };
                    f64::from(steps.slope[a]) * (self.flow[i][a] - below)
                })
                .sum();
            let before = self.u[i];
            self.u[i] = (before + f64::from(steps.tau) * (div - force[i])).clamp(0.0, 1.0);
            self.ahead[i] = 2.0 * self.u[i] - before;
        }
    }
}

#[test]
fn sweeps_in_bricks_are_those_over_the_whole_volume() {
    for (case, dims) in [[13, 9, 17], [8, 8, 8], [1, 20, 3], [16, 7, 1]].into_iter().enumerate() {
        let volume = volume(dims, [1.0, 1.5, 4.0], |[x, y, z]| {
            noise::unit(case as u64, (x + 100 * y + 10_000 * z) as u64) as f32
        });
        let level = finest(&volume);
        let begins = |v: [usize; 3]| noise::below(9, (v[0] + 100 * v[1] + 10_000 * v[2]) as u64, 2) == 0;
        let exec = Exec::default();
        let mut band = Band::whole(&level, &begins, &exec).unwrap();
        for (force, values) in band.force.iter_mut().zip(&band.values) {
            for (force, value) in force.iter_mut().zip(values) {
                *force = if value.is_nan() { 0.0 } else { value - 0.5 };
            }
        }
        let steps = Steps::new(0.3, level.edges, true);
        let grid = volume.grid();
        let u: Vec<f64> = (0..grid.len()).map(|i| f64::from(u8::from(begins(grid.index(i).0)))).collect();
        let mut plain = Plain { dims, ahead: u.clone(), u, flow: vec![[0.0; 3]; grid.len()] };
        let mut row = vec![0.0_f32; grid.len()];
        level.row(0, &mut row);
        let force: Vec<f64> = row.iter().map(|v| f64::from(v - 0.5)).collect();
        for _ in 0..25 {
            band.sweep(&steps, &exec).unwrap();
            plain.sweep(&force, &steps);
        }
        for i in 0..grid.len() {
            let at = grid.index(i).0;
            let slot = band.slot(at.map(|v| v / BRICK)).unwrap();
            let [x, y, z] = at.map(|v| v % BRICK);
            let found = f64::from(band.primal[slot].u[x + BRICK * (y + BRICK * z)]);
            assert!((found - plain.u[i]).abs() < 2e-3, "case {case} at {at:?}: {found}, {}", plain.u[i]);
        }
    }
}

/// A ball of 1 in 0 with noise, off the grid.
fn ball(n: usize, sigma: f64, seed: u64) -> Volume {
    let middle = [0.13, -0.21, 0.37].map(|s| (n as f64 - 1.0) / 2.0 + s);
    volume([n; 3], [1.0; 3], |at| {
        let r = (0..3).map(|a| (at[a] as f64 - middle[a]).powi(2)).sum::<f64>().sqrt();
        let i = (at[0] + n * (at[1] + n * at[2])) as u64;
        let (u, v) = (noise::unit(seed, 2 * i).max(1e-300), noise::unit(seed, 2 * i + 1));
        let gauss = (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos();
        (f64::from(u8::from(r < 0.35 * n as f64)) + sigma * gauss) as f32
    })
}

#[test]
fn bricks_round_the_front_give_the_set_of_the_whole_volume() {
    let (volume, params, exec) = (ball(72, 0.4, 1), SurfaceParams::default(), Exec::default());
    let unit = Unit::of(&volume, None).unwrap();
    let start = Start::of(&volume, None, None, &params, &exec).unwrap();
    let settings = Settings { params: &params, frozen: None, exec: &exec };
    let of = |whole: usize| {
        let levels = levels(Level::finest(&volume, unit, None), whole, &exec).unwrap();
        let mut found = first(&levels[0], &start, &volume, &settings).unwrap();
        for pair in levels.windows(2) {
            let band = refined(&pair[0], &found, &pair[1], &exec).unwrap();
            found = descend(&pair[1], band, &settings).unwrap();
        }
        let share = found.band.len() as f64 / found.band.all() as f64;
        (draw(levels.last().unwrap(), &found, &exec).unwrap(), share, found.mu)
    };
    let (all, everything, mu) = of(usize::MAX);
    let (banded, share, _) = of(40 * 40 * 40);
    assert!(everything == 1.0 && share < 0.6, "{share}");
    assert!(mu > 0.0);
    let differ = all.iter().zip(&banded).filter(|(a, b)| a != b).count();
    let surface = 4.0 * std::f64::consts::PI * (0.35 * 72.0_f64).powi(2);
    assert!((differ as f64) < 0.02 * surface, "{differ} voxels of a surface of {surface:.0}");
}

#[test]
fn the_energy_lies_within_a_hundredth_of_the_lowest_for_its_statistics() {
    for seed in 0..3 {
        let (volume, params, exec) = (ball(40, 0.5, seed), SurfaceParams::default(), Exec::default());
        let level = finest(&volume);
        let start = Start::of(&volume, None, None, &params, &exec).unwrap();
        let settings = Settings { params: &params, frozen: None, exec: &exec };
        let found = first(&level, &start, &volume, &settings).unwrap();
        // The same problem, its statistics fixed, worked on until nothing moves.
        let mut band = found.band;
        let steps = Steps::new(found.mu, level.edges, true);
        (0..2000).for_each(|_| band.sweep(&steps, &exec).unwrap());
        let relaxed = certify::energy(&band, &steps)[0];
        let mut of_set = |inside: &dyn Fn(usize, usize, f32) -> bool| {
            for (slot, state) in band.primal.iter_mut().enumerate() {
                for (i, u) in state.u.iter_mut().enumerate() {
                    *u = f32::from(u8::from(inside(slot, i, *u)));
                }
            }
            certify::energy(&band, &steps)[0]
        };
        let lowest = of_set(&|_, _, u| u > 0.5);
        let reached = of_set(&|slot, i, _| is_inside(&found.best[slot], i));
        // No set lies below the shares' optimum; the optimum's own set is what a descent can reach.
        assert!(relaxed <= lowest && relaxed <= reached, "seed {seed}: {relaxed} {lowest} {reached}");
        let all = found.energies.last().unwrap();
        assert!(reached - lowest <= 0.01 * all, "seed {seed}: {reached} above {lowest} of {all}");
    }
}

#[test]
fn sums_nearby_are_those_of_a_box_about_every_voxel() {
    let exec = Exec::default();
    let volume =
        volume([21, 11, 9], [1.0; 3], |[x, y, z]| noise::unit(5, (x + 40 * (y + 40 * z)) as u64) as f32);
    let level = finest(&volume);
    let inside = |voxel: [usize; 3]| (voxel[0] + 2 * voxel[1] + voxel[2]) % 5 < 2;
    let band = Band::whole(&level, &inside, &exec).unwrap();
    let reach = [2, 3, 1];
    for brick in [[0, 0, 0], [1, 1, 0], [2, 0, 1]] {
        let found = local::box_sums(&level, &band, brick, reach);
        for (i, sums) in found.iter().enumerate() {
            let at: [usize; 3] = std::array::from_fn(|a| brick[a] * BRICK + within_brick(i)[a]);
            if (0..3).any(|a| at[a] >= level.dims[a]) {
                continue;
            }
            let range = |a: usize| at[a].saturating_sub(reach[a])..(at[a] + reach[a] + 1).min(level.dims[a]);
            let mut plain = [0.0_f32; 4];
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let mut value = [0.0];
                        level.row(x + level.dims[0] * (y + level.dims[1] * z), &mut value);
                        let own = f32::from(u8::from(inside([x, y, z])));
                        let cell = [own, own * value[0], 1.0, value[0]];
                        plain.iter_mut().zip(cell).for_each(|(sum, cell)| *sum += cell);
                    }
                }
            }
            assert!(plain.iter().zip(sums).all(|(a, b)| (a - b).abs() < 1e-4 * (1.0 + a.abs())), "{at:?}");
        }
    }
}
