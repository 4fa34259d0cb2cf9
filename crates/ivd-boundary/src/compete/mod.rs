//! Seeds that compete for a volume.

mod flood;
mod params;

use std::collections::BTreeMap;

use ivd_core::op::Op as _;
use ivd_core::{
    Class, Exec, Grid, Labels, Mask, NO_DATA, ParamError, Volume, VoxelCoord, World, parallel, slots,
};
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
/// A parameter's, with seeds of fewer than two labels, and where all seeds of a label are blocked; seeds outside the volume; other
/// grids; memory, cancelled.
pub fn compete(inputs: &SeedInputs<'_>, params: &CompeteParams, exec: &Exec) -> Result<Labels, Error> {
    params.check()?;
    let seeds = seeds(inputs, params, exec)?;
    exec.run(|| {
        let ids = shared_out(inputs, &seeds, params, exec)?;
        let classes = classes(inputs.volume, &ids);
        Ok(Labels::new(inputs.volume.grid().clone(), ids.into(), classes)?)
    })
}

/// The part of one label, which [`CompeteParams::label`] tells, against those of the others: see [`compete()`].
///
/// # Errors
/// As [`compete()`], and where no seed has the part's label; [`Error::NoBoundary`] where nothing is left of the part.
pub fn part_of_seeds(inputs: &SeedInputs<'_>, params: &CompeteParams, exec: &Exec) -> Result<Won, Error> {
    params.check()?;
    let own = params.label.unwrap_or(1);
    let seeds = seeds(inputs, params, exec)?;
    if !seeds.contains(&own) {
        let problem = format!("no seed has the part's label, {own}");
        return Err(ParamError::new("label", problem, "give the label of a seed").into());
    }
    exec.run(|| {
        let ids = shared_out(inputs, &seeds, params, exec)?;
        exec.check_memory("the mask", ids.len() as u64)?;
        let inside: Vec<u8> = ids.iter().map(|id| u8::from(*id == own)).collect();
        let chosen = |i: usize| seeds[i] == own;
        let blocked = inputs.blocked.map(Mask::inside);
        // Enclosed voxels of other labels stay theirs, and what is blocked is nobody's.
        let free = |i: usize| [0, own].contains(&ids[i]) && blocked.is_none_or(|blocked| blocked[i] == 0);
        let fill: Option<&part::Chosen> = if params.fill_holes { Some(&free) } else { None };
        let part = part::part(inside, inputs.volume, &chosen, params.open, fill, exec)?;
        let mask = part::levelled(part.inside, inputs.volume.grid(), exec)?;
        Ok(Won { voxels: mask.count(), mask, components: part.components, filled: part.filled })
    })
}

/// The label of every voxel that is a seed.
fn seeds(inputs: &SeedInputs<'_>, params: &CompeteParams, exec: &Exec) -> Result<Vec<u16>, Error> {
    let grid = inputs.volume.grid();
    exec.check_memory("the seeds", 2 * grid.len() as u64)?;
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
        let given = params.seeds.iter().map(|seed| seed.label.unwrap_or(1)).chain(params.label);
        let others = label_of_nobody(ids.iter().copied().chain(given))?;
        draw_border(&mut ids, grid.dims(), others);
    }
    for seed in &params.seeds {
        draw_seed(&mut ids, inputs.volume, seed)?;
    }
    Ok(ids)
}

/// The label above all of these; where that is none, the lowest that isn't among them.
fn label_of_nobody(labels: impl Iterator<Item = u16>) -> Result<u16, Error> {
    let mut is_taken = vec![false; usize::from(u16::MAX) + 1];
    is_taken[usize::from(NO_DATA)] = true;
    labels.for_each(|label| is_taken[usize::from(label)] = true);
    let last = is_taken.iter().rposition(|taken| *taken).and_then(|last| u16::try_from(last + 1).ok());
    let free = || is_taken.iter().position(|taken| !taken).and_then(|free| u16::try_from(free).ok());
    last.or_else(free).ok_or_else(|| {
        let problem = "every label has seeds already, and the border needs one of its own";
        ParamError::new("border", problem, "leave it out, or give fewer labels").into()
    })
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
    let Some(first) = first else {
        return Err(ParamError::new("seeds", "there are none", "give seeds of two labels or more").into());
    };
    if seeds.iter().all(|id| *id == 0 || id == first) {
        let problem = format!("all have label {first}: none competes with it");
        return Err(ParamError::new("seeds", problem, "give seeds of another label too, or border").into());
    }
    let blocked = blocked.map(Mask::inside);
    check_free(volume, seeds, blocked)?;
    flood::flood(volume, seeds, blocked, params.window, exec)
}

/// Every label has a seed that floods: one that isn't blocked and has data.
fn check_free(volume: &Volume, seeds: &[u16], blocked: Option<&[u8]>) -> Result<(), Error> {
    let labels = usize::from(u16::MAX) + 1;
    let (mut is_there, mut is_free) = (vec![false; labels], vec![false; labels]);
    for (i, &label) in seeds.iter().enumerate().filter(|(_, label)| **label != NO_DATA) {
        is_there[usize::from(label)] = true;
        is_free[usize::from(label)] |=
            blocked.is_none_or(|blocked| blocked[i] == 0) && volume.voxels().get(i).is_finite();
    }
    (0..labels).find(|&label| is_there[label] && !is_free[label]).map_or(Ok(()), |label| {
        let problem = format!("all of label {label} are blocked or lie where there are no data");
        Err(ParamError::new("seeds", problem, "move them, or block less").into())
    })
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
