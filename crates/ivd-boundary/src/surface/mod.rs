//! An active surface: from a start to the boundary of the part that it lies in.
//!
//! For fixed statistics of either side the set of least energy is that of a convex problem (Chan, Esedoglu & Nikolova 2006), which
//! Chambolle and Pock's iteration solves in sweeps over the voxels; every ten sweeps the statistics follow the set. A coarse resolution
//! is worked through whole; finer ones only in bricks round the front.
//!
//! - `level`: resolutions of a volume. `band`: the bricks in work. `sweep`: the iteration on one brick.
//! - `look`: what a set is: values, area, front. `descent`: the whole at one resolution.
//! - `model`: what values cost on either side; `mixture`: the same of two values and what lies between them. `bessel`: what Rice's distribution needs.
//! - `evidence`: whether a set is more than noise gives.
//! - `local`: statistics of what is nearby, at the finest resolution.
//! - `certify`: how far from the lowest energy a set can be; `graph`: the lowest set where area is counted by cut edges.
//! - `start`: what it begins with.

mod band;
mod bessel;
mod certify;
mod descent;
mod evidence;
mod graph;
mod level;
mod local;
mod look;
mod mixture;
mod model;
mod params;
mod start;
mod sweep;
#[cfg(test)]
mod tests;

use ivd_core::op::Op as _;
use ivd_core::{BRICK, Exec, Grid, Labels, Mask, Volume, VoxelIndex};

use band::Band;
use descent::{Descent, Settings, descend};
use level::{CUBE, Level, Unit, levels, within_brick};
use look::{Bits, Tally, is_inside};
use model::Model;
pub use params::{AreaMeasure, DataTerm, Distribution, StartShape, SurfaceParams};
use start::Start;

use crate::{Error, part};

/// Most voxels of the resolution that is worked through whole.
const WHOLE: usize = 64 * 64 * 64;

/// A part that a surface has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// The part, with a level function that places its border between voxels.
    pub mask: Mask,
    /// Voxels of the mask.
    pub voxels: u64,
    /// Connected pieces of the side that the start lies in; the part is one of them.
    pub components: usize,
    /// Voxels that were enclosed.
    pub filled: u64,
    /// Energies of the pairs of set and statistics that were accepted at the finest resolution, falling: what values cost, and μ times the
    /// area \[value² mm³, or nats mm³ of a likelihood\].
    pub energies: Vec<f64>,
    /// Sweeps over all resolutions.
    pub sweeps: u32,
    /// Voxels worked on, over all sweeps.
    pub updates: u64,
    /// Share of the finest resolution's voxels that were worked on.
    pub active_fraction: f64,
    /// Weight of the border's area \[value² mm, or nats mm of a likelihood\].
    pub mu: f64,
    /// Mean values inside and outside of the set (real units).
    pub means: [f64; 2],
    /// Noise from voxel to voxel over the contrast.
    pub noise: f64,
    /// Energy of a cut, less that of the outside alone \[value² mm³, or nats mm³\]; `None` where no certificate was asked.
    pub energy: Option<f64>,
    /// How far the energy of the set can be above the lowest for its statistics, over μ times its area; `None` where that wasn't asked.
    pub gap: Option<f64>,
    /// The same of shares of voxels, where the area is that of forward differences: no set has as low an energy as shares have.
    pub relaxed_gap: Option<f64>,
}

/// Finds the boundary of the part that a start lies in.
///
/// - `labels`: needed where the start is a class, else not looked at.
/// - `start`: a drawn start on the volume's grid, instead of the one that the parameters tell.
/// - Foreground is the side of which the start covers the larger share.
/// - Voxels without data (NaN, infinite) belong to neither side.
///
/// # Errors
/// [`Error::NoBoundary`] where the start is empty, the sides are alike or differ no more than those of noise, or nothing is left of the part; a start outside the volume; inputs
/// on different grids; the memory limit, cancelled.
pub fn active_surface(
    volume: &Volume,
    labels: Option<&Labels>,
    start: Option<&Mask>,
    params: &SurfaceParams,
    exec: &Exec,
) -> Result<Surface, Error> {
    params.check()?;
    exec.run(|| {
        let grid = volume.grid();
        let start = Start::of(volume, labels, start, params, exec)?;
        let unit = Unit::of(volume, params.window)
            .ok_or_else(|| Error::no_boundary("all values are alike", "give another volume or window"))?;
        let levels = levels(Level::finest(volume, unit, params.edge), WHOLE, exec)?;
        let finest = levels.last().expect("there is the finest");
        let frozen =
            (params.data == DataTerm::Start).then(|| frozen_model(finest, &start, grid, exec)).transpose()?;
        let settings = Settings { params, frozen, exec };
        let mut found = first(&levels[0], &start, volume, &settings)?;
        let mut evidence = found.evidence;
        let (mut sweeps, mut updates) = (found.sweeps, found.updates);
        for pair in levels.windows(2) {
            found = at_level(&pair[1], refined(&pair[0], &found, &pair[1], exec)?, &settings)?;
            sweeps += found.sweeps;
            updates += found.updates;
            evidence = evidence.max(found.evidence);
        }
        if evidence < evidence::LEAST {
            let problem = "what differs is no more than noise would give";
            return Err(Error::no_boundary(problem, "start elsewhere, or with another radius or data term"));
        }
        let mut inside = draw(finest, &found, exec)?;
        let edge = finest.finest_edge();
        let mut certificate = None;
        if params.certify || params.area != AreaMeasure::Smooth {
            let mut shown =
                certify::certify(finest, &inside, &found.force, found.mu * edge, params.area, exec)?;
            if let Some(lower) = shown.inside.take() {
                inside = with_data(lower, finest);
            }
            sweeps += shown.sweeps;
            certificate = Some(shown);
        }
        let holds = start.at_resolution(grid, grid.dims(), [1; 3]);
        let chosen = |i: usize| holds(grid.index(i).0);
        let fill: Option<&part::Chosen> = if params.fill_holes { Some(&|_| true) } else { None };
        let part = part::part(inside, volume, &chosen, params.open, fill, exec)?;
        let mask = part::levelled(part.inside, grid, exec)?;
        // The energy is in units of the range squared; a likelihood's is in nats.
        let value =
            if matches!(params.data, DataTerm::Means | DataTerm::Local) { unit.one * unit.one } else { 1.0 };
        Ok(Surface {
            voxels: mask.count(),
            mask,
            components: part.components,
            filled: part.filled,
            energies: found.energies.iter().map(|e| e * value * grid.voxel_volume()).collect(),
            sweeps,
            updates,
            active_fraction: found.band.len() as f64 / found.band.all() as f64,
            mu: found.mu * value * edge,
            means: found.means.map(|m| unit.real(m)),
            noise: found.noise,
            energy: certificate.as_ref().map(|shown| shown.energy * value * grid.voxel_volume()),
            gap: certificate.as_ref().map(|shown| shown.gap),
            relaxed_gap: certificate.as_ref().and_then(|shown| shown.relaxed_gap),
        })
    })
}

/// What values are expected to be, by those of the start and by all others.
fn frozen_model(finest: &Level, start: &Start, grid: &Grid, exec: &Exec) -> Result<Model, Error> {
    let mut inside = Tally::new(true);
    let mut value = [0.0];
    start.each(grid, start.bounds(grid), |voxel| {
        finest.row(grid.linear(VoxelIndex(voxel)), &mut value);
        inside.count_in(value[0]);
    });
    let [mut others, _] = look::tallies(finest, &|_| false, true, exec)?;
    others.plus(-1.0, &inside);
    if inside.count < 2.0 || others.count < 1.0 {
        let problem = "the start has too few values, or all there are, to tell what is like it";
        return Err(Error::no_boundary(
            problem,
            "start with a larger radius, or leave some of the volume out",
        ));
    }
    Ok(Model::frozen(&inside, &others))
}

/// The coarsest resolution, worked through whole; the side that the start lies in becomes the inside.
fn first(level: &Level, start: &Start, volume: &Volume, settings: &Settings) -> Result<Descent, Error> {
    let exec = settings.exec;
    let begins = start.at_resolution(volume.grid(), level.dims, level.factor);
    let mut band = Band::whole(level, &begins, exec)?;
    let started: Vec<Bits> = band.primal.iter().map(|state| bits(&state.u)).collect();
    if !split_if_whole(level, &mut band, &started) {
        return Err(Error::no_boundary("the start holds no voxel", "draw or place it within the volume"));
    }
    let mut found = at_level(level, band, settings)?;
    if settings.frozen.is_some() || settings.params.data == DataTerm::Local {
        return Ok(found);
    }
    let [inside, outside] = shares(level, &found, &started);
    let is_swapped = if inside[0] * outside[1] == outside[0] * inside[1] {
        if inside[2] == outside[2] {
            let problem = "the start lies in neither side more than in the other";
            return Err(Error::no_boundary(problem, "start elsewhere, or with another radius"));
        }
        inside[2] > outside[2]
    } else {
        inside[0] * outside[1] < outside[0] * inside[1]
    };
    if is_swapped {
        found.swap_sides(level);
    }
    Ok(found)
}

/// Lowers the energy at one resolution, by the statistics that are asked for.
fn at_level(level: &Level, band: Band, settings: &Settings) -> Result<Descent, Error> {
    if settings.params.data != DataTerm::Local {
        return descend(level, band, settings);
    }
    // What those of the whole say of contrast and noise; they move nothing.
    let still = SurfaceParams { sweeps: 0, ..settings.params.clone() };
    let found = descend(level, band, &Settings { params: &still, frozen: None, exec: settings.exec })?;
    local::descend_nearby(level, found, settings)
}

/// A start that holds every voxel tells nothing: the brighter half is taken in its place. False where the start is empty.
fn split_if_whole(level: &Level, band: &mut Band, started: &[Bits]) -> bool {
    let count: u64 = started.iter().flatten().map(|b| u64::from(b.count_ones())).sum();
    if count as usize == level.len() {
        let (mut sum, mut n) = (0.0, 0.0);
        for &v in band.values.iter().flatten().filter(|v| !v.is_nan()) {
            sum += f64::from(v);
            n += 1.0;
        }
        let mean = (sum / f64::max(n, 1.0)) as f32;
        for (state, values) in band.primal.iter_mut().zip(&band.values) {
            for (u, v) in state.u.iter_mut().zip(values) {
                *u = f32::from(u8::from(*v > mean));
            }
            state.ahead = state.u;
        }
    }
    count > 0
}

/// Of either side: voxels of the start, voxels, and voxels on the volume's border.
fn shares(level: &Level, found: &Descent, started: &[Bits]) -> [[u64; 3]; 2] {
    let mut sides = [[0_u64; 3]; 2];
    for (slot, (bits, started)) in found.best.iter().zip(started).enumerate() {
        let brick = found.band.place(slot);
        for i in 0..CUBE {
            let local = within_brick(i);
            let voxel: [usize; 3] = std::array::from_fn(|a| brick[a] * BRICK + local[a]);
            if found.band.values[slot][i].is_nan() {
                continue;
            }
            let side = &mut sides[usize::from(!is_inside(bits, i))];
            side[0] += u64::from(is_inside(started, i));
            side[1] += 1;
            side[2] += u64::from((0..3).any(|a| voxel[a] == 0 || voxel[a] + 1 == level.dims[a]));
        }
    }
    sides
}

impl Descent {
    /// Makes the outside the inside.
    fn swap_sides(&mut self, level: &Level) {
        for (slot, bits) in self.best.iter_mut().enumerate() {
            let extent = self.band.extent(self.band.place(slot));
            let state = &mut self.band.primal[slot];
            for i in 0..CUBE {
                let local = within_brick(i);
                if (0..3).all(|a| local[a] < extent[a]) {
                    bits[i / 64] ^= 1 << (i % 64);
                    state.u[i] = 1.0 - state.u[i];
                    state.ahead[i] = state.u[i];
                }
            }
        }
        self.means.reverse();
        self.force = self.force.negated();
        debug_assert_eq!(
            level.bricks().iter().product::<usize>(),
            self.best.len(),
            "a whole level's sides are swapped"
        );
    }
}

fn bits(u: &sweep::Brick) -> Bits {
    let mut bits = [0; BRICK];
    u.iter().enumerate().filter(|(_, u)| **u > 0.5).for_each(|(i, _)| bits[i / 64] |= 1 << (i % 64));
    bits
}

/// The next finer resolution's bricks round the front, with the shares of the coarser one.
fn refined(coarse: &Level, found: &Descent, fine: &Level, exec: &Exec) -> Result<Band, Error> {
    let step: [usize; 3] = std::array::from_fn(|a| coarse.factor[a] / fine.factor[a]);
    let share = |voxel: [usize; 3]| found.band.share(voxel);
    let middle = |brick: [usize; 3]| {
        std::array::from_fn(|a| ((brick[a] * BRICK + BRICK / 2) / step[a]).min(coarse.dims[a] - 1))
    };
    let mut band = Band::new(fine, &|brick| share(middle(brick)) > 0.5);
    let mut wanted = Vec::new();
    for slot in 0..found.band.len() {
        let brick = found.band.place(slot);
        let extent = found.band.extent(brick);
        let u = &found.band.primal[slot].u;
        let faces = sweep::Faces { above: found.band.above(brick), extent };
        let next_x = faces.next_x(u);
        for z in 0..extent[2] {
            for y in 0..extent[1] {
                let next = [
                    sweep::row(&next_x, BRICK * (y + BRICK * z)),
                    faces.next_y(u, y, z),
                    faces.next_z(u, y, z),
                ];
                for x in 0..extent[0] {
                    let here = u[x + BRICK * (y + BRICK * z)];
                    for a in (0..3).filter(|&a| (next[a][x] > 0.5) != (here > 0.5)) {
                        // The border lies between the middles of two coarse voxels.
                        let mut low: [usize; 3] =
                            std::array::from_fn(|b| (brick[b] * BRICK + [x, y, z][b]) * step[b]);
                        let mut wide = step.map(|s| s - 1);
                        low[a] += step[a] / 2;
                        wide[a] = step[a];
                        let within: [usize; 3] = low.map(|v| v % BRICK);
                        let high = std::array::from_fn(|b| within[b] + wide[b]);
                        wanted.extend(band.around(low.map(|v| v / BRICK), [within, high]));
                    }
                }
            }
        }
    }
    let fill = |brick: [usize; 3], _: bool, u: &mut [f32; CUBE]| {
        for (i, u) in u.iter_mut().enumerate() {
            let local = within_brick(i);
            let voxel: [usize; 3] = std::array::from_fn(|a| brick[a] * BRICK + local[a]);
            if (0..3).all(|a| voxel[a] < fine.dims[a]) {
                *u = share(std::array::from_fn(|a| voxel[a] / step[a]));
            }
        }
    };
    band.take(fine, wanted, &fill, exec)?;
    carry_flow(&mut band, found, fine.dims, step);
    Ok(band)
}

/// Takes the flow over from the coarser resolution, in shares of the area's weight there; the descent scales it to its own.
fn carry_flow(band: &mut Band, found: &Descent, dims: [usize; 3], step: [usize; 3]) {
    let mut flow = std::mem::take(&mut band.flow);
    let scale = (1.0 / found.mu) as f32;
    ivd_core::parallel::for_each_piece_mut(&mut flow, 4, &|piece, flows| {
        for (slot, flow) in (4 * piece..).zip(flows) {
            let brick = band.place(slot);
            for i in 0..CUBE {
                let local = within_brick(i);
                let voxel: [usize; 3] = std::array::from_fn(|a| brick[a] * BRICK + local[a]);
                if (0..3).any(|a| voxel[a] >= dims[a]) {
                    continue;
                }
                let coarse: [usize; 3] = std::array::from_fn(|a| voxel[a] / step[a]);
                if let Some(from) = found.band.slot(coarse.map(|v| v / BRICK)) {
                    let [x, y, z] = coarse.map(|v| v % BRICK);
                    for (flow, from) in flow.iter_mut().zip(&found.band.flow[from]) {
                        flow[i] = from[x + BRICK * (y + BRICK * z)] * scale;
                    }
                }
            }
            // Nothing flows out of the volume.
            let extent = band.extent(brick);
            for a in (0..3).filter(|&a| brick[a] * BRICK + extent[a] == dims[a]) {
                for i in 0..CUBE {
                    if within_brick(i)[a] + 1 == extent[a] {
                        flow[a][i] = 0.0;
                    }
                }
            }
        }
    });
    band.flow = flow;
}

/// A set without the voxels that have no data.
fn with_data(mut inside: Vec<u8>, level: &Level) -> Vec<u8> {
    let width = level.dims[0];
    ivd_core::parallel::for_each_piece_mut(&mut inside, width, &|row, inside| {
        let mut values = vec![0.0_f32; width];
        level.row(width * row, &mut values);
        inside.iter_mut().zip(&values).filter(|(_, v)| v.is_nan()).for_each(|(inside, _)| *inside = 0);
    });
    inside
}

/// The best set of the finest resolution as a mask; voxels without data stay out.
fn draw(level: &Level, found: &Descent, exec: &Exec) -> Result<Vec<u8>, Error> {
    let [nx, ny, _] = level.dims;
    exec.check_memory("the mask", level.len() as u64)?;
    let mut mask = vec![0_u8; level.len()];
    let band = &found.band;
    ivd_core::parallel::try_for_each_piece_mut(&mut mask, nx * ny, &|z, layer| {
        exec.check_cancelled()?;
        let mut values = vec![0.0_f32; nx];
        for (y, row) in layer.chunks_mut(nx).enumerate() {
            let mut asked = false;
            for (bx, out) in row.chunks_mut(BRICK).enumerate() {
                let brick = [bx, y / BRICK, z / BRICK];
                match band.slot(brick) {
                    Some(slot) => {
                        let from = BRICK * (y % BRICK) + 64 * (z % BRICK);
                        for (x, out) in out.iter_mut().enumerate() {
                            *out = u8::from(
                                is_inside(&found.best[slot], from + x)
                                    && !band.values[slot][from + x].is_nan(),
                            );
                        }
                    }
                    None if band.side(brick) == Some(true) => {
                        if !asked {
                            level.row(nx * (y + ny * z), &mut values);
                            asked = true;
                        }
                        for (out, v) in out.iter_mut().zip(&values[bx * BRICK..]) {
                            *out = u8::from(!v.is_nan());
                        }
                    }
                    None => {}
                }
            }
        }
        Ok::<_, Error>(())
    })?;
    Ok(mask)
}
