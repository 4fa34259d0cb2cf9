//! Seeds that compete for a volume.

mod flood;
mod params;

use std::collections::BTreeMap;

use ivd_core::op::Op as _;
use ivd_core::{Class, Exec, Grid, Labels, Mask, NO_DATA, Volume, VoxelCoord, World, parallel, slots};
use nalgebra::Vector3;

pub use params::{CompeteParams, Seed};

use crate::{Error, component, part};

slots! {
    /// What seeds compete for.
    ///
    /// - `seeds`: labels above 0 at voxels of seeds, beside those of the parameters, which lie over them.
    /// - `start`: more seeds of [`CompeteParams::label`], else of 1, such as an earlier result to go on from.
    /// - `blocked`: voxels that nobody gets.
    pub struct SeedInputs<'a> {
        volume: &'a Volume, seeds: Option<&'a Labels>, start: Option<&'a Mask>, blocked: Option<&'a Mask>
    }
}

/// A part that was competed for.
#[derive(Debug, Clone, PartialEq)]
pub struct Won {
    /// The part, with a level function.
    pub mask: Mask,
    /// Voxels of the mask.
    pub voxels: u64,
    /// Connected pieces of what the part's seeds have; the mask is that with most of the seeds.
    pub components: usize,
    /// Voxels that were enclosed.
    pub filled: u64,
}

/// Shares a volume out among seeds, all labels at once: each voxel goes to the seed that comes to it over the lowest pass of the gradient's
/// magnitude (Meyer's flooding), of ways that are alike the one that comes first. Voxels without data, those that are blocked and those that
/// no seed comes to have label 0.
///
/// # Errors
/// [`Error::NoBoundary`] with seeds of fewer than two labels; seeds outside the volume; other grids; memory, cancelled.
pub fn compete(inputs: &SeedInputs<'_>, params: &CompeteParams, exec: &Exec) -> Result<Labels, Error> {
    params.check()?;
    let seeds = seeds(inputs, params)?;
    exec.run(|| {
        let ids = shared_out(inputs, &seeds, params, exec)?;
        let classes = classes(inputs.volume, &ids);
        Ok(Labels::new(inputs.volume.grid().clone(), ids.into(), classes)?)
    })
}

/// The part of one label, which [`CompeteParams::label`] tells, against those of the others: see [`compete()`].
///
/// # Errors
/// As [`compete()`]; [`Error::NoBoundary`] too where nothing is left of the part.
pub fn part_of_seeds(inputs: &SeedInputs<'_>, params: &CompeteParams, exec: &Exec) -> Result<Won, Error> {
    params.check()?;
    let own = params.label.unwrap_or(1);
    let seeds = seeds(inputs, params)?;
    let chosen: Vec<usize> = (0..seeds.len()).filter(|&i| seeds[i] == own).collect();
    if chosen.is_empty() {
        return Err(Error::NoBoundary { problem: format!("no seed has the part's label, {own}") });
    }
    exec.run(|| {
        let ids = shared_out(inputs, &seeds, params, exec)?;
        let inside = ids.iter().map(|id| u8::from(*id == own)).collect();
        let part = part::part(inside, inputs.volume, &chosen, params.open, params.fill_holes, exec)?;
        let mask = part::levelled(part.inside, inputs.volume.grid(), exec)?;
        Ok(Won { voxels: mask.count(), mask, components: part.components, filled: part.filled })
    })
}

/// The label of every voxel that is a seed.
fn seeds(inputs: &SeedInputs<'_>, params: &CompeteParams) -> Result<Vec<u16>, Error> {
    let grid = inputs.volume.grid();
    let mut ids = match inputs.seeds {
        Some(drawn) => {
            grid.require(drawn.grid(), "volume", "seeds")?;
            drawn.ids().to_vec()
        }
        None => vec![0; grid.len()],
    };
    if let Some(start) = inputs.start {
        grid.require(start.grid(), "volume", "start")?;
        let own = params.label.unwrap_or(1);
        ids.iter_mut().zip(start.inside()).filter(|(_, inside)| **inside != 0).for_each(|(id, _)| *id = own);
    }
    if params.border {
        // A label that nobody has.
        let given = params.seeds.iter().map(|seed| seed.label.unwrap_or(1)).chain(params.label);
        let others = ids.iter().copied().chain(given).max().unwrap_or(0).saturating_add(1);
        draw_border(&mut ids, grid.dims(), others);
    }
    for seed in &params.seeds {
        draw_seed(&mut ids, inputs.volume, seed)?;
    }
    Ok(ids)
}

/// The label that gets each voxel.
fn shared_out(
    inputs: &SeedInputs<'_>,
    seeds: &[u16],
    params: &CompeteParams,
    exec: &Exec,
) -> Result<Vec<u16>, Error> {
    let SeedInputs { volume, blocked, .. } = *inputs;
    if let Some(blocked) = blocked {
        volume.grid().require(blocked.grid(), "volume", "blocked")?;
    }
    let first = seeds.iter().find(|id| **id != 0);
    if first.is_none_or(|first| seeds.iter().all(|id| *id == 0 || id == first)) {
        let problem = match first {
            None => "there are no seeds".to_owned(),
            Some(label) => format!("all seeds have label {label}: none competes with it"),
        };
        return Err(Error::NoBoundary { problem });
    }
    flood::flood(volume, seeds, blocked.map(Mask::inside), params.window, exec)
}

/// What the voxels of each label are like.
fn classes(volume: &Volume, ids: &[u16]) -> Vec<Class> {
    let [nx, ny, nz] = volume.grid().dims();
    let slices = parallel::map(nz, &|z| {
        let mut sums = BTreeMap::<u16, [f64; 3]>::new();
        for i in nx * ny * z..nx * ny * (z + 1) {
            let value = volume.real(volume.voxels().get(i));
            if ids[i] != NO_DATA {
                let own = sums.entry(ids[i]).or_default();
                *own = [own[0] + 1.0, own[1] + value, own[2] + value * value];
            }
        }
        sums
    });
    let mut sums = BTreeMap::<u16, [f64; 3]>::new();
    for (id, part) in slices.into_iter().flatten() {
        let own = sums.entry(id).or_default();
        *own = std::array::from_fn(|i| own[i] + part[i]);
    }
    let mut classes: Vec<Class> = sums
        .into_iter()
        .map(|(id, [count, sum, squares])| {
            let mean = sum / count;
            let sd = (squares / count - mean * mean).max(0.0).sqrt();
            Class { id, name: None, mean, sd, voxels: count as u64, lower: None, upper: None }
        })
        .collect();
    classes.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    classes
}

/// Gives the volume's outermost voxels a label, where they have none.
fn draw_border(ids: &mut [u16], dims: [usize; 3], number: u16) {
    let [nx, ny, _] = dims;
    for (i, id) in ids.iter_mut().enumerate() {
        let at = [i % nx, i / nx % ny, i / nx / ny];
        if *id == 0 && (0..3).any(|a| dims[a] > 2 && (at[a] == 0 || at[a] + 1 == dims[a])) {
            *id = number;
        }
    }
}

/// Gives the voxels of a seed its label.
fn draw_seed(ids: &mut [u16], volume: &Volume, seed: &Seed) -> Result<(), Error> {
    let number = seed.label.unwrap_or(1);
    let grid = volume.grid();
    let dims = grid.dims();
    let from = Vector3::from(seed.at);
    let to = Vector3::from(seed.to.unwrap_or(seed.at));
    // The voxels that it goes through: those of points half a voxel apart.
    let steps = ((to - from).norm() / (0.5 * grid.shortest_edge())).ceil().max(1.0) as usize;
    for i in 0..=steps {
        let point = from + (to - from) * (i as f64 / steps as f64);
        let voxel = component::seed_voxel(volume, point.into())?;
        ids[grid.linear(ivd_core::VoxelIndex(voxel))] = number;
    }
    let Some(radius) = seed.radius.filter(|radius| *radius > 0.0) else { return Ok(()) };
    let [low, high] = near(grid, [from, to], radius);
    for z in low[2]..high[2] {
        for y in low[1]..high[1] {
            for x in low[0]..high[0] {
                let world = grid.world(VoxelCoord(Vector3::new(x as f64, y as f64, z as f64))).0;
                let along = to - from;
                let t = (world - from).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
                if (world - from - along * t.clamp(0.0, 1.0)).norm() <= radius {
                    ids[x + dims[0] * (y + dims[1] * z)] = number;
                }
            }
        }
    }
    Ok(())
}

/// Lowest and one past the highest voxel within a radius (mm) of the points between two.
fn near(grid: &Grid, ends: [Vector3<f64>; 2], radius: f64) -> [[usize; 3]; 2] {
    let reach = grid.ball_extent(radius);
    let ends = ends.map(|end| grid.voxel(World(end)).0);
    let limit = |a: usize, v: f64| v.clamp(0.0, grid.dims()[a] as f64) as usize;
    [
        std::array::from_fn(|a| limit(a, (ends[0][a].min(ends[1][a]) - reach[a]).floor())),
        std::array::from_fn(|a| limit(a, (ends[0][a].max(ends[1][a]) + reach[a]).ceil() + 1.0)),
    ]
}
