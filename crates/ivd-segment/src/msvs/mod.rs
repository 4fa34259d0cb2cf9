//! Mean shift on a grid of cells over space and intensity.
//!
//! Mean shift moves a point to the weighted mean of the data around it until it stands on a mode of the density; points that
//! reach the same mode are one class (Comaniciu & Meer 2002, <https://doi.org/10.1109/34.1000236>). Every point moving over
//! every other costs O(N²) a step. Here the voxels are first counted into cells of (x, y, z, value), a fraction of the
//! bandwidth wide; the density is blurred out of the counts once; and it is the cells that climb, not the voxels (the idea
//! of MeanShift++, Jang & Jiang 2021, and GridShift, Kumar et al. 2022). O(N + cells):
//!
//! - `range_axis`: the cells' places along the value, with long gaps shortened;
//! - `cells`: the grid, and how many voxels each cell holds;
//! - `density`: the kernel density of the cells;
//! - `ascent`: the basin of every cell;
//! - `modes`: which modes persist, and what becomes of the others;
//! - `paint`: the voxels' labels.

mod ascent;
mod bandwidth;
mod cells;
pub(crate) mod chain;
mod density;
mod modes;
mod paint;
mod params;
mod range_axis;
#[cfg(test)]
mod tests;

use ivd_core::{Exec, Iteration, Labels, Mask, Volume};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Error, Segmentation, classes, segmentation, selection};
use cells::Cells;
use modes::Peak;
pub use params::{Kernel, MsvsParams};

/// A mode of the density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mode {
    /// Class of the voxels that climb to it.
    #[schemars(extend("x-unit" = "1"))]
    pub class: u16,
    /// Place along the voxel axes, from the centre of the first voxel; the volume's middle where space doesn't count.
    #[schemars(extend("x-unit" = "mm"))]
    pub position: [f64; 3],
    /// Value at the mode.
    #[schemars(extend("x-unit" = "real units"))]
    pub value: f64,
    /// Mean over all voxels of the kernel's weight at the mode, 0…1; the flat kernel's density is that of its shadow.
    #[schemars(extend("x-unit" = "1"))]
    pub density: f64,
    /// `1 - saddle / density`, with the density of the highest saddle that leads to a higher mode; 1 where none does.
    #[schemars(extend("x-unit" = "1"))]
    pub persistence: f64,
    /// Number of voxels that climb to it, or to a mode that was given up to it.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels: u64,
}

/// What mean shift found.
#[derive(Debug, Clone, PartialEq)]
pub struct Msvs {
    /// A class a mode. The objective is the inertia of the classes' values (real units²).
    pub segmentation: Segmentation,
    /// The modes, those that stand highest above their saddles (density × persistence) first.
    pub modes: Vec<Mode>,
    /// Number of modes that persist, before [`MsvsParams::k_max`] cuts them down.
    pub k_proposed: usize,
    /// Bandwidth of the values (real units). Where none was given, the largest of half of Silverman's rule, `0.45 s n^(-1/5)`
    /// with `s` the lesser of standard deviation and interquartile range / 1.349 (half, because the values of several classes
    /// spread further than any class); a hundredth of the range from the first to the 99th percentile; and the usual step
    /// from one value to the next.
    pub range_bandwidth: f64,
    /// Bandwidth in space (mm); 0 where space doesn't count.
    pub spatial_bandwidth: f64,
    /// Number of cells of the grid.
    pub cells: u64,
    /// Cells across a bandwidth of the values: fewer than asked where the grid would have more than 2²⁶ cells.
    pub cells_per_bandwidth: f64,
}

/// Classes by mean shift: a class for each mode of the density of the values, or of places and values.
///
/// Cells climb along the density's gradient, and voxels go where their cell goes; so labels are exact up to a cell at the
/// borders between basins. Plateaus have one mode, at the first of their cells.
///
/// Voxels that are no data, or outside `mask`, get label 0. Classes are in the order of their means; on values alone they are
/// intervals, and meet where the density is least. A volume without data has no class. The same labels come from any number
/// of threads and from any storage type that holds the same values; the last digit of `ln` and `exp` decides ties, so other
/// platforms than Linux on x86 may differ there.
///
/// # Errors
/// [`Error`]: a bad parameter, bandwidths so small that the cells are too many, a mask on another grid, the memory
/// limit, or cancelled.
pub fn msvs(volume: &Volume, mask: Option<&Mask>, params: &MsvsParams, exec: &Exec) -> Result<Msvs, Error> {
    params.check()?;
    exec.run(|| {
        let scope = selection::of(volume, mask, params.within, exec)?;
        let mask = scope.as_deref();
        let Some(bandwidths) = bandwidth::of(volume, mask, params, exec)? else {
            return nothing(volume, mask, params);
        };
        let cells = Cells::new(volume, mask, params, &bandwidths, exec)?;
        let counts = cells.count(volume, mask, exec)?;
        let voxels = counts.iter().map(|n| u64::from(*n)).sum::<u64>();
        let height = density::of(&cells, &counts, params.kernel, exec)?;
        drop(counts);
        let basins = ascent::basins(&cells, &height, exec)?;
        let peaks = modes::of(&cells, &height, &basins, params, exec)?;
        exec.observer().iteration(Iteration { method: "msvs", index: 1, value: peaks.k_proposed as f64 });
        drop(height);
        let found = paint::voxels(volume, mask, &cells, &basins, &peaks, exec)?;
        finish(volume, mask, &cells, bandwidths.range, voxels, &peaks, found)
    })
}

/// The result of a volume without data.
fn nothing(volume: &Volume, mask: Option<&Mask>, params: &MsvsParams) -> Result<Msvs, Error> {
    let ids = vec![ivd_core::NO_DATA; volume.grid().len()];
    let labels = Labels::new(volume.grid().clone(), ids.into(), Vec::new())?;
    Ok(Msvs {
        segmentation: Segmentation {
            labels,
            k: 0,
            iterations: 1,
            converged: true,
            objective: 0.0,
            visited_fraction: segmentation::visited(volume, mask),
            gap: 0.0,
        },
        modes: Vec::new(),
        k_proposed: 0,
        range_bandwidth: params.range_bandwidth,
        spatial_bandwidth: params.spatial_bandwidth,
        cells: 0,
        cells_per_bandwidth: params.cells_per_bandwidth,
    })
}

fn finish(
    volume: &Volume,
    mask: Option<&Mask>,
    cells: &Cells,
    range_bandwidth: f64,
    voxels: u64,
    peaks: &modes::Peaks,
    found: classes::Described,
) -> Result<Msvs, Error> {
    let mode = |(i, peak): (usize, &Peak)| {
        let class = found.order.iter().position(|old| usize::from(*old) == i + 1)?;
        Some(Mode {
            class: class as u16 + 1,
            position: cells.position(&peak.place, volume),
            value: cells.range.value(peak.place[3]).clamp(f64::MIN, f64::MAX),
            // The quadratic through the cells may overshoot.
            density: (peak.density / voxels as f64).min(1.0),
            persistence: peak.persistence,
            voxels: found.classes[class].voxels,
        })
    };
    let modes: Vec<Mode> = peaks.kept.iter().enumerate().filter_map(mode).collect();
    let objective = found.classes.iter().map(|c| c.sd * c.sd * c.voxels as f64).sum::<f64>();
    let k = found.classes.len();
    Ok(Msvs {
        segmentation: Segmentation {
            labels: Labels::new(volume.grid().clone(), found.ids, found.classes)?,
            k,
            iterations: 1,
            converged: true,
            objective: objective.min(f64::MAX),
            visited_fraction: segmentation::visited(volume, mask),
            gap: 0.0,
        },
        modes,
        k_proposed: peaks.k_proposed,
        range_bandwidth,
        spatial_bandwidth: cells.spatial_bandwidth,
        cells: cells.len() as u64,
        cells_per_bandwidth: cells.sigma[3],
    })
}
