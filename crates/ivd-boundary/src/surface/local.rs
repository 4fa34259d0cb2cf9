//! Means of what is near each voxel, in place of those of the whole (Lankton & Tannenbaum 2008). They move the front that is there: a voxel
//! with one side alone near it stays where it is.

use ivd_core::{BRICK, Iteration, parallel};

use super::band::Band;
use super::descent::{Descent, Settings, complete, grow};
use super::evidence::evidence;
use super::level::{CUBE, Level};
use super::look::{Look, Tally, look_at_all, tallies};
use super::sweep::Steps;
use crate::Error;

/// Sweeps between two looks.
const BETWEEN: u32 = 10;
/// Looks without a lower energy after which the descent ends.
const PATIENCE: usize = 3;
/// Mean edges of a voxel that are near where nothing else is said.
const NEAR: f64 = 4.0;

/// Lowers the energy at one resolution by the means of what is nearby.
///
/// # Errors
/// Memory, cancelled.
pub(super) fn descend_nearby(level: &Level, found: Descent, settings: &Settings) -> Result<Descent, Error> {
    let (params, exec) = (settings.params, settings.exec);
    let reach = params.reach.unwrap_or(NEAR * level.mean_edge());
    // Further than the volume there is nothing.
    let voxels = |a: usize| (reach / level.edges[a]).round().clamp(1.0, level.dims[a] as f64) as usize;
    let reach: [usize; 3] = std::array::from_fn(voxels);
    let whole = found.band.len() == found.band.all();
    let slope = Steps::new(1.0, level.edges_of_axes(), false).slope;
    let steps = Steps::new(found.mu, level.edges_of_axes(), exec.simd);
    let contrast = (found.means[0] - found.means[1]).powi(2);
    let mut own = Descent { energies: Vec::new(), ..found };
    let [total, mut inner] = tallies(level, &|brick| own.band.is_inner(brick), false, exec)?;
    let mut looks = look_at_all(&own.band, slope, false, exec)?;
    let (mut stalled, mut sweeps) = (0, 0);
    loop {
        let fit = act(level, &mut own.band, reach, contrast, exec)?;
        let energy = fit + own.mu * looks.iter().map(|look| look.area).sum::<f64>();
        if energy < own.energies.last().copied().unwrap_or(f64::INFINITY) {
            own.energies.push(energy);
            own.best = looks.iter().map(|look| look.bits).collect();
            own.evidence = evidence_of(level, &own, &looks, &inner, total.count);
            stalled = 0;
        } else {
            stalled += 1;
        }
        exec.observer().iteration(Iteration {
            method: "surface",
            index: u64::from(own.sweeps),
            value: energy,
        });
        if stalled >= PATIENCE || sweeps >= params.sweeps {
            break;
        }
        for _ in 0..BETWEEN.min(params.sweeps - sweeps) {
            own.band.sweep(&steps, exec)?;
            sweeps += 1;
            own.sweeps += 1;
            own.updates += (own.band.len() * CUBE) as u64;
        }
        looks = look_at_all(&own.band, slope, false, exec)?;
        if !whole && grow(level, &mut own.band, &looks, &mut inner, false, exec)? {
            looks = look_at_all(&own.band, slope, false, exec)?;
            // What is summed over has grown: energies before can't be compared.
            own.energies.clear();
        }
    }
    complete(&mut own.best, &own.band);
    Ok(own)
}

/// Evidence of the set that is looked at.
fn evidence_of(level: &Level, own: &Descent, looks: &[Look], inner: &Tally, total: f64) -> f64 {
    let inside = inner.count + looks.iter().map(|look| look.inside.count).sum::<f64>();
    let faces = looks.iter().map(|look| look.faces).sum();
    evidence(level, &own.band, &own.best, [inside, total - inside], faces)
}

/// Sets the force of every voxel in work by the means nearby; gives what the values cost on the sides that they are on.
fn act(
    level: &Level,
    band: &mut Band,
    reach: [usize; 3],
    contrast: f64,
    exec: &ivd_core::Exec,
) -> Result<f64, Error> {
    let of = |slot: usize| {
        exec.check_cancelled()?;
        let sums = box_sums(level, band, band.place(slot), reach);
        let mut force = [0.0; CUBE];
        let mut fit = 0.0;
        for (i, (force, [within, inside, all, total])) in force.iter_mut().zip(&sums).enumerate() {
            let value = f64::from(band.values[slot][i]);
            if value.is_nan() {
                continue;
            }
            let is_inside = band.primal[slot].u[i] > 0.5;
            let square = |sum: f32, count: f32| (value - f64::from(sum / count)).powi(2);
            let costs = if *within < 0.5 || all - within < 0.5 {
                let own = square(*total, *all);
                if is_inside { [own, own + contrast] } else { [own + contrast, own] }
            } else {
                [square(*inside, *within), square(total - inside, all - within)]
            };
            *force = (costs[0] - costs[1]) as f32;
            fit += costs[usize::from(!is_inside)];
        }
        Ok::<_, Error>((force, fit))
    };
    let found = parallel::try_map(band.len(), &of)?;
    let fit = found.iter().map(|(_, fit)| fit).sum();
    band.force = found.into_iter().map(|(force, _)| force).collect();
    Ok(fit)
}

/// About every voxel of a brick, in a box of `reach` voxels to either side: how many lie inside, the sum of their values, and both of all.
pub(super) fn box_sums(level: &Level, band: &Band, brick: [usize; 3], reach: [usize; 3]) -> Vec<[f32; 4]> {
    let dims = level.dims;
    let low: [usize; 3] = std::array::from_fn(|a| (brick[a] * BRICK).saturating_sub(reach[a]));
    let high: [usize; 3] = std::array::from_fn(|a| (brick[a] * BRICK + BRICK + reach[a]).min(dims[a]));
    let size: [usize; 3] = std::array::from_fn(|a| high[a] - low[a]);
    let mut cells = vec![[0.0_f32; 4]; size.iter().product()];
    let mut row = vec![0.0_f32; size[0]];
    for z in 0..size[2] {
        for y in 0..size[1] {
            level.row(low[0] + dims[0] * (low[1] + y + dims[1] * (low[2] + z)), &mut row);
            for (x, &value) in row.iter().enumerate().filter(|(_, value)| !value.is_nan()) {
                let share = band.share([low[0] + x, low[1] + y, low[2] + z]);
                let inside = f32::from(u8::from(share > 0.5));
                cells[x + size[0] * (y + size[1] * z)] = [inside, inside * value, 1.0, value];
            }
        }
    }
    // Sums along one axis after the other; of the axis, only those about the brick's own voxels stay.
    let mut size = size;
    for a in 0..3 {
        cells = summed(&cells, &mut size, a, brick[a] * BRICK - low[a], reach[a]);
    }
    cells
}

/// Sums over `reach` cells to either side along an axis, about the eight cells from `first` on.
fn summed(
    cells: &[[f32; 4]],
    size: &mut [usize; 3],
    axis: usize,
    first: usize,
    reach: usize,
) -> Vec<[f32; 4]> {
    let stride: usize = size[..axis].iter().product();
    let (count, outer) = (size[axis], size[axis + 1..].iter().product::<usize>());
    let mut out = vec![[0.0_f32; 4]; stride * BRICK * outer];
    for block in 0..outer {
        for i in 0..BRICK.min(count.saturating_sub(first)) {
            let range = (first + i).saturating_sub(reach)..(first + i + reach + 1).min(count);
            for within in 0..stride {
                let mut sum = [0.0_f32; 4];
                for j in range.clone() {
                    let cell = &cells[within + stride * (j + count * block)];
                    sum.iter_mut().zip(cell).for_each(|(sum, cell)| *sum += cell);
                }
                out[within + stride * (i + BRICK * block)] = sum;
            }
        }
    }
    size[axis] = BRICK;
    out
}
