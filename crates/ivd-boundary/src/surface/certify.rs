//! How far a set can be from the lowest energy for its statistics.

use ivd_core::{BRICK, Exec, parallel};

use super::band::Band;
use super::graph;
use super::level::{CUBE, Level, within_brick};
use super::model::Force;
use super::params::AreaMeasure;
use super::sweep::{Faces, Steps, row};
use crate::Error;

/// What is known of a set's energy.
pub(super) struct Certificate {
    /// Its energy, less that of the outside alone (voxels of the functional).
    pub(super) energy: f64,
    /// Its energy less what no set is below, over μ times its area.
    pub(super) gap: f64,
    /// The same of the shares 0 … 1, where area is that of forward differences: those have no set as their optimum.
    pub(super) relaxed_gap: Option<f64>,
    pub(super) sweeps: u32,
    /// The set, where a lower one was found.
    pub(super) inside: Option<Vec<u8>>,
}

/// Gap at which the work ends.
const CLOSED: f64 = 1e-4;
/// The same of cuts, whose gap closes.
const CUT_CLOSED: f64 = 5e-7;
/// Most sweeps.
const MOST: u32 = 4000;
/// Sweeps between two looks.
const BETWEEN: u32 = 50;

/// Shows how low a set's energy is; of a cut, the lowest set is taken in its place.
///
/// `mu`: weight of the area (mm, in the force's units).
///
/// # Errors
/// Memory, cancelled.
pub(super) fn certify(
    level: &Level,
    inside: &[u8],
    force: &Force,
    mu: f64,
    area: AreaMeasure,
    exec: &Exec,
) -> Result<Certificate, Error> {
    let neighbours = match area {
        AreaMeasure::Smooth => return smooth(level, inside, force, mu, exec),
        AreaMeasure::Faces => 6,
        AreaMeasure::Corners => 26,
    };
    let limits = [CUT_CLOSED, f64::from(MOST)];
    let cut = graph::cut(level, inside, force, mu, neighbours, limits, exec)?;
    Ok(Certificate {
        energy: cut.energy,
        gap: cut.gap(),
        relaxed_gap: None,
        sweeps: cut.sweeps,
        inside: Some(cut.inside),
    })
}

fn smooth(level: &Level, inside: &[u8], force: &Force, mu: f64, exec: &Exec) -> Result<Certificate, Error> {
    let [nx, ny, _] = level.dims;
    let mut band = Band::whole(level, &|[x, y, z]| inside[x + nx * (y + ny * z)] != 0, exec)?;
    band.act(force);
    let steps = Steps::new(mu / level.finest_edge(), level.edges_of_axes(), exec.simd);
    let [own, own_border] = energy(&band, &steps);
    let mut lowest = f64::NEG_INFINITY;
    let mut sweeps = 0;
    let relaxed = loop {
        let [reached, border] = energy(&band, &steps);
        lowest = lowest.max(bound(&band, &steps));
        let gap = (reached - lowest).max(0.0) / border.max(f64::MIN_POSITIVE);
        if gap <= CLOSED || sweeps >= MOST {
            break gap;
        }
        for _ in 0..BETWEEN {
            band.sweep(&steps, exec)?;
        }
        sweeps += BETWEEN;
    };
    let gap = (own - lowest).max(0.0) / own_border.max(f64::MIN_POSITIVE);
    Ok(Certificate { energy: own, gap, relaxed_gap: Some(relaxed), sweeps, inside: None })
}

/// Energy of shares, and the border's part of it (voxels of the functional).
pub(super) fn energy(band: &Band, steps: &Steps) -> [f64; 2] {
    let of = |slot: usize| {
        let brick = band.place(slot);
        let faces = Faces { above: band.above(brick), extent: band.extent(brick) };
        let (u, force) = (&band.primal[slot].u, &band.force[slot]);
        let next_x = faces.next_x(u);
        let mut sums = [0.0; 2];
        for z in 0..faces.extent[2] {
            for y in 0..faces.extent[1] {
                let first = BRICK * (y + BRICK * z);
                let next = [row(&next_x, first), faces.next_y(u, y, z), faces.next_z(u, y, z)];
                for x in 0..faces.extent[0] {
                    let here = u[first + x];
                    let square: f64 = (0..3)
                        .map(|a| (f64::from(steps.slope[a]) * f64::from(next[a][x] - here)).powi(2))
                        .sum();
                    sums[0] += f64::from(force[first + x]) * f64::from(here);
                    sums[1] += f64::from(steps.mu) * square.sqrt();
                }
            }
        }
        sums
    };
    let [fit, border] = summed(&parallel::map(band.len(), &of));
    [fit + border, border]
}

/// What no shares are below, by the flows (each within μ).
fn bound(band: &Band, steps: &Steps) -> f64 {
    let of = |slot: usize| {
        let brick = band.place(slot);
        let (below, flow, extent) = (band.below(brick), &band.flow[slot], band.extent(brick));
        let mut sum = 0.0;
        for i in 0..CUBE {
            let at = within_brick(i);
            if (0..3).any(|a| at[a] >= extent[a]) {
                continue;
            }
            let div: f64 = (0..3)
                .map(|a| {
                    let stride = BRICK.pow(a as u32);
                    let before =
                        if at[a] > 0 { flow[a][i - stride] } else { below[a][i + (BRICK - 1) * stride] };
                    f64::from(steps.slope[a]) * f64::from(flow[a][i] - before)
                })
                .sum();
            sum += (f64::from(band.force[slot][i]) - div).min(0.0);
        }
        [sum, 0.0]
    };
    summed(&parallel::map(band.len(), &of))[0]
}

fn summed(parts: &[[f64; 2]]) -> [f64; 2] {
    parts.iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]])
}
