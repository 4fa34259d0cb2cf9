use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Labels, NO_DATA, TransferEntry, TransferFunction, Volume};

use crate::edges::{Hill, Window, windows};
use crate::statistics::{ClassStatistics, measure};
use crate::{Error, Params, palette};

/// A transfer function and what is worth telling about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Built {
    /// The table and its entries.
    pub transfer: TransferFunction,
    /// Number of entries: one for each class that occurs.
    pub entries: usize,
    /// Least and greatest opacity of the entries over the reference length (no unit); `[0, 0]` without entries.
    pub opacity_range: [f32; 2],
}

/// Number of reference lengths in the side of a cube of the volume's size: the same scan at twice the resolution gives the
/// same picture, and a 256³ volume has a reference of two voxels.
const REFERENCES: f64 = 128.0;

/// Length over which opacities hold on a grid [mm].
pub(crate) fn reference_mm(grid: &Grid) -> f64 {
    (grid.voxel_volume() * grid.len() as f64).cbrt() / REFERENCES
}

/// Largest magnitude of a value: the squares of 2⁵⁰ such values have a sum.
const MOST: f64 = 1e140;

/// Smallest and largest real value; zeros without data.
pub(crate) fn range_of(volume: &Volume) -> Result<[f64; 2], Error> {
    let [low, high] = volume.range().unwrap_or([0.0, 0.0]);
    if low >= -MOST && high <= MOST { Ok([low, high]) } else { Err(Error::TooWide { low, high, most: MOST }) }
}

/// A class on its way to an entry.
struct Candidate {
    statistics: ClassStatistics,
    clear: bool,
}

/// The automatic transfer function of a segmented volume (thesis 4.2.2).
///
/// Every label above 0 that occurs gives an entry, in the order of means (ties by label); statistics are measured, so
/// that labels from elsewhere, without classes, do as well. Label 0 on voxels with data is a background: it gives no entry
/// but competes for the value axis in row 0, as a clear class.
///
/// **Air** is the class of the lowest mean if there are at least two, the labels have no background, and no other
/// class holds more voxels of the volume's outermost layer. It is clear.
///
/// **Opacity** over `reference_mm` of a class with border strength `g` (real units per mm) and share `n` of the voxels:
///
/// ```text
/// opacity = clamp(max_opacity · s / max s, min_opacity, max_opacity),   s = g · n^(-size_exponent)
/// ```
///
/// where classes all without border (a constant volume) have `g = 1`. **Reference length**: the cube root of the volume's size in mm³, over 128.
///
/// # Errors
/// [`Error::Core`] where volume and labels lie on different grids or the work was cancelled; [`ivd_core::Error::Param`];
/// [`Error::TooManyClasses`] above 1,024; [`Error::TooWide`] for values beyond ±10¹⁴⁰.
pub fn transfer(volume: &Volume, labels: &Labels, params: &Params, exec: &Exec) -> Result<Built, Error> {
    params.check()?;
    volume.grid().require(labels.grid(), "volume", "labels")?;
    exec.run(|| {
        let range = range_of(volume)?;
        let candidates = candidates(measure(volume, labels, exec)?);
        let windows = value_windows(&candidates, labels, range, params);
        let entries = entries(&candidates, &windows, range, params);
        Ok(tabulate(volume, &candidates, &windows, entries, range, params)?)
    })
}

/// The classes in the order of their means, with those that stay clear marked.
fn candidates(mut classes: Vec<ClassStatistics>) -> Vec<Candidate> {
    classes.sort_by(|a, b| a.mean.total_cmp(&b.mean).then(a.id.cmp(&b.id)));
    let background = classes.iter().any(|c| c.id == NO_DATA);
    let most_on_sides = classes.iter().map(|c| c.on_sides).max().unwrap_or(0);
    let air =
        (!background && classes.len() > 1 && classes[0].on_sides == most_on_sides).then(|| classes[0].id);
    classes
        .into_iter()
        .map(|statistics| Candidate {
            clear: statistics.id == NO_DATA || Some(statistics.id) == air,
            statistics,
        })
        .collect()
}

fn value_windows(candidates: &[Candidate], labels: &Labels, range: [f64; 2], params: &Params) -> Vec<Window> {
    // A spread below half a table step can't be seen, and 0 has no posterior.
    let floor = (0.5 * (range[1] - range[0]) / (params.resolution - 1) as f64).max(f64::MIN_POSITIVE);
    let hills: Vec<Hill> = candidates
        .iter()
        .map(|Candidate { statistics: s, .. }| {
            let class = labels.class(s.id);
            Hill {
                mean: s.mean,
                sd: s.sd.max(floor),
                voxels: s.voxels as f64,
                lower: class.and_then(|c| c.lower),
                upper: class.and_then(|c| c.upper),
            }
        })
        .collect();
    windows(&hills, params.softness)
}

/// One entry for each class; label 0 has none.
fn entries(
    candidates: &[Candidate],
    windows: &[Window],
    range: [f64; 2],
    params: &Params,
) -> Vec<TransferEntry> {
    let total: u64 = candidates.iter().map(|c| c.statistics.voxels).sum();
    let seen = || candidates.iter().filter(|c| !c.clear);
    let borderless = seen().all(|c| c.statistics.border_strength == 0.0);
    let score = |c: &Candidate| {
        let strength = if borderless { 1.0 } else { c.statistics.border_strength };
        strength * (c.statistics.voxels as f64 / total as f64).powf(-params.size_exponent)
    };
    let greatest = seen().map(score).fold(0.0, f64::max);
    let mut rank = 0;
    let mut entries = Vec::new();
    for (candidate, window) in candidates.iter().zip(windows) {
        if candidate.statistics.id == NO_DATA {
            continue;
        }
        let opacity = if candidate.clear {
            0.0
        } else {
            let relative = (score(candidate) / greatest) as f32;
            let [least, most] = [params.min_opacity, params.max_opacity].map(|opacity| opacity as f32);
            (most * relative).clamp(least, most)
        };
        let rgb = if candidate.clear { [0.0; 3] } else { palette::colour(rank) };
        rank += usize::from(!candidate.clear);
        let half = |edge: Option<(f64, f64)>| edge.map_or(0.0, |(_, half)| half);
        entries.push(TransferEntry {
            class: candidate.statistics.id,
            rgb,
            opacity,
            lower: window.lower.map_or(range[0], |(at, _)| at),
            upper: window.upper.map_or(range[1], |(at, _)| at),
            softness: half(window.lower).max(half(window.upper)),
        });
    }
    entries
}

fn tabulate(
    volume: &Volume,
    candidates: &[Candidate],
    windows: &[Window],
    entries: Vec<TransferEntry>,
    range: [f64; 2],
    params: &Params,
) -> Result<Built, ivd_core::Error> {
    // Entries skip label 0, windows don't: pair them up once.
    let of_entries: Vec<&Window> = candidates
        .iter()
        .zip(windows)
        .filter(|(c, _)| c.statistics.id != NO_DATA)
        .map(|(_, window)| window)
        .collect();
    let resolution = params.resolution;
    let value = |i: usize| range[0] + (range[1] - range[0]) * (i as f64 / (resolution - 1) as f64);
    let mut table = Vec::with_capacity((entries.len() + 1) * resolution);
    for i in 0..resolution {
        let all: f64 = windows.iter().map(|w| w.weight(value(i))).sum();
        table.push(union(&entries, &of_entries, value(i), all));
    }
    for (entry, window) in entries.iter().zip(&of_entries) {
        let [r, g, b] = entry.rgb;
        table.extend((0..resolution).map(|i| [r, g, b, entry.opacity * window.weight(value(i)) as f32]));
    }
    let classes = std::iter::once(NO_DATA).chain(entries.iter().map(|e| e.class)).collect();
    let reference = reference_mm(volume.grid());
    let opacities = || entries.iter().map(|e| e.opacity);
    let lowest = opacities().fold(f32::INFINITY, f32::min);
    let opacity_range = if entries.is_empty() { [0.0; 2] } else { [lowest, opacities().fold(0.0, f32::max)] };
    let count = entries.len();
    let transfer = TransferFunction::new(range, resolution, reference, classes, table, entries)?;
    Ok(Built { transfer, entries: count, opacity_range })
}

/// Straight RGBA of row 0 at a value: the windows' mean opacity, and the colours weighed by opacity.
fn union(entries: &[TransferEntry], windows: &[&Window], value: f64, all: f64) -> [f32; 4] {
    let (mut rgb, mut alpha) = ([0.0_f64; 3], 0.0);
    for (entry, window) in entries.iter().zip(windows) {
        let a = window.weight(value) * f64::from(entry.opacity);
        alpha += a;
        for (sum, c) in rgb.iter_mut().zip(entry.rgb) {
            *sum += a * f64::from(c);
        }
    }
    if alpha <= 0.0 {
        return [0.0; 4];
    }
    let [r, g, b] = rgb.map(|c| ((c / alpha) as f32).clamp(0.0, 1.0));
    [r, g, b, ((alpha / all.max(1.0)) as f32).clamp(0.0, 1.0)]
}
