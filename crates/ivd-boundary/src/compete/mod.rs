//! Seeds that compete for a volume.

mod flood;
mod params;

use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Labels, Mask, NO_DATA, Volume, VoxelCoord, World};
use nalgebra::Vector3;

pub use params::{CompeteParams, Stroke};

use crate::{Error, component, part};

/// What seeds have shared out.
#[derive(Debug, Clone, PartialEq)]
pub struct Shared {
    /// The seed that has each voxel, by its number; 0 where none came to.
    pub ids: Vec<u16>,
    /// Numbers of the seeds, ascending, and how many voxels each has.
    pub counts: Vec<(u16, u64)>,
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
    /// Who has what.
    pub shared: Shared,
}

/// Shares a volume out among seeds, all numbers at once: each voxel goes to the seed that comes to it over the lowest pass of the gradient's
/// magnitude (Meyer's flooding), of ways that are alike the one that comes first.
///
/// - `seeds`: a number above 0 at voxels that are taken from the start, 0 elsewhere; linear, x fastest.
/// - `blocked`: voxels that nobody gets.
/// - `window`: least and greatest value that count.
///
/// # Errors
/// Seeds or blocked voxels of another grid; memory, cancelled.
pub fn compete(
    volume: &Volume,
    seeds: &Labels,
    blocked: Option<&Mask>,
    window: Option<[f64; 2]>,
    exec: &Exec,
) -> Result<Shared, Error> {
    volume.grid().require(seeds.grid(), "volume", "strokes")?;
    if let Some(blocked) = blocked {
        volume.grid().require(blocked.grid(), "volume", "blocked")?;
    }
    exec.run(|| {
        let ids = flood::flood(volume, seeds.ids(), blocked.map(Mask::inside), window, exec)?;
        let mut counts = std::collections::BTreeMap::<u16, u64>::new();
        ids.iter().filter(|id| **id != NO_DATA).for_each(|id| *counts.entry(*id).or_default() += 1);
        Ok(Shared { ids, counts: counts.into_iter().collect() })
    })
}

/// The part of one's own strokes against others.
///
/// - `drawn`: numbers above 0 at voxels of strokes, each number a seed; [`CompeteParams::label`] is the part's.
/// - `start`: a mask in the part, such as an earlier result to go on from.
/// - `blocked`: voxels that nobody gets.
///
/// # Errors
/// [`Error::NoBoundary`] without a stroke of one's own and one of others, or where nothing is left of the part; strokes outside the volume;
/// other grids; memory, cancelled.
pub fn part_of_strokes(
    volume: &Volume,
    drawn: Option<&Labels>,
    start: Option<&Mask>,
    blocked: Option<&Mask>,
    params: &CompeteParams,
    exec: &Exec,
) -> Result<Won, Error> {
    params.check()?;
    let grid = volume.grid();
    let own = params.label.unwrap_or(1);
    let mut ids = match drawn {
        Some(drawn) => {
            grid.require(drawn.grid(), "volume", "strokes")?;
            drawn.ids().to_vec()
        }
        None => vec![0; grid.len()],
    };
    if let Some(start) = start {
        grid.require(start.grid(), "volume", "start")?;
        ids.iter_mut().zip(start.inside()).filter(|(_, inside)| **inside != 0).for_each(|(id, _)| *id = own);
    }
    // A number that nobody drew.
    let others = ids.iter().copied().max().unwrap_or(0).max(own).saturating_add(1);
    if params.border {
        draw_border(&mut ids, grid.dims(), others);
    }
    for stroke in &params.other {
        draw_stroke(&mut ids, volume, stroke, others)?;
    }
    for stroke in &params.own {
        draw_stroke(&mut ids, volume, stroke, own)?;
    }
    let chosen: Vec<usize> = (0..ids.len()).filter(|&i| ids[i] == own).collect();
    if chosen.is_empty() {
        return Err(Error::NoBoundary { problem: "no stroke lies in the part".into() });
    }
    if ids.iter().all(|id| *id == 0 || *id == own) {
        return Err(Error::NoBoundary { problem: "no stroke competes with the part's".into() });
    }
    let seeds = Labels::new(grid.clone(), ids.into(), Vec::new())?;
    let shared = compete(volume, &seeds, blocked, params.window, exec)?;
    exec.run(|| {
        let inside = shared.ids.iter().map(|id| u8::from(*id == own)).collect();
        let part = part::part(inside, volume, &chosen, params.open, !params.keep_holes, exec)?;
        let level = part::level(&part.inside, grid.dims(), exec)?;
        let mask = Mask::new(grid.clone(), part.inside.into())?.with_level(level.into())?;
        Ok(Won { voxels: mask.count(), mask, components: part.components, filled: part.filled, shared })
    })
}

/// Gives the volume's outermost voxels a number, where they have none.
fn draw_border(ids: &mut [u16], dims: [usize; 3], number: u16) {
    let [nx, ny, _] = dims;
    for (i, id) in ids.iter_mut().enumerate() {
        let at = [i % nx, i / nx % ny, i / nx / ny];
        if *id == 0 && (0..3).any(|a| dims[a] > 2 && (at[a] == 0 || at[a] + 1 == dims[a])) {
            *id = number;
        }
    }
}

/// Gives the voxels of a stroke a number.
fn draw_stroke(ids: &mut [u16], volume: &Volume, stroke: &Stroke, number: u16) -> Result<(), Error> {
    let grid = volume.grid();
    let dims = grid.dims();
    let from = Vector3::from(stroke.at);
    let to = Vector3::from(stroke.to.unwrap_or(stroke.at));
    // The voxels that it goes through: those of points half a voxel apart.
    let steps = ((to - from).norm() / (0.5 * grid.shortest_edge())).ceil().max(1.0) as usize;
    for i in 0..=steps {
        let point = from + (to - from) * (i as f64 / steps as f64);
        let voxel = component::seed_voxel(volume, point.into())?;
        ids[grid.linear(ivd_core::VoxelIndex(voxel))] = number;
    }
    let Some(radius) = stroke.radius.filter(|radius| *radius > 0.0) else { return Ok(()) };
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
    let inverse = grid.inverse_linear_part();
    let ends = ends.map(|end| grid.voxel(World(end)).0);
    let limit = |a: usize, v: f64| v.clamp(0.0, grid.dims()[a] as f64) as usize;
    let reach = |a: usize| radius * inverse.row(a).norm();
    [
        std::array::from_fn(|a| limit(a, (ends[0][a].min(ends[1][a]) - reach(a)).floor())),
        std::array::from_fn(|a| limit(a, (ends[0][a].max(ends[1][a]) + reach(a)).ceil() + 1.0)),
    ]
}
