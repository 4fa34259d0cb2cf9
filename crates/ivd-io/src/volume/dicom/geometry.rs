use std::path::Path;

use ivd_core::{Exec, Grid};
use nalgebra::Vector3;

use super::header::Slice;
use crate::volume::{Error, Offer, bounded, orientation};

/// Largest deviation of a gap between slices from the usual one, as a part of it, …
const GAP_PART: f64 = 0.01;
/// … and in mm, whichever is larger: positions are written with few digits.
const GAP_MM: f64 = 0.01;
/// Largest sideways drift of a slice from the line through the first and last, in pixels.
const DRIFT_PIXELS: f64 = 0.1;

/// Nearer to a slice than this part of a step a resampled layer is that slice.
const ON_A_SLICE: f64 = 1e-3;
/// Most layers that are made of a slice on average: a single narrow gap doesn't decide alone.
const MOST_LAYERS: usize = 4;

/// Where a layer of a resampled volume lies: this part of the way from a slice to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layer {
    pub(super) slice: usize,
    pub(super) part: f64,
}

/// Slices as a grid.
pub(super) struct Stacked {
    pub(super) grid: Grid,
    /// The grid's layers where they aren't the slices.
    pub(super) layers: Option<Vec<Layer>>,
}

/// The stack along its normal.
struct Stack {
    /// Where the first slice is (mm), LPS.
    origin: Vector3<f64>,
    /// From layer to layer (mm), LPS.
    step: Vector3<f64>,
    layers: Option<Vec<Layer>>,
}

/// Sorts the slices along their normal and makes the grid: x along a row, y along a column, z along the normal.
///
/// DICOM's world is LPS. Where the slices are shifted sideways as they go (a tilted gantry), the shear is kept. Slices that aren't
/// evenly spaced are refused, or get layers that are where `resample` says so.
pub(super) fn grid(path: &Path, slices: &mut [Slice], resample: bool, exec: &Exec) -> Result<Stacked, Error> {
    let first = &slices[0];
    let mut dims = [first.columns, first.rows, slices.len()];
    bounded::voxel_count(&first.path, "Rows, Columns", dims)?;
    let [row, column] = directions(first, slices.len())?;
    // The first number is the distance of rows: a step along y.
    let [dy, dx] = first.pixel_spacing.unwrap_or_else(|| {
        exec.observer().note(&format!("{}: no PixelSpacing: 1 mm is taken", path.display()));
        [1.0; 2]
    });
    if !(dx > 0.0 && dy > 0.0) {
        return Err(Error::field(&first.path, "PixelSpacing", format!("{dy}\\{dx} isn't positive")));
    }
    let normal = row.cross(&column).normalize();
    let Stack { origin, step, layers } = if slices.len() == 1 {
        let thickness = first.thickness.filter(|t| *t > 0.0).unwrap_or_else(|| {
            exec.observer()
                .note(&format!("{}: a single slice without thickness: 1 mm is taken", path.display()));
            1.0
        });
        let origin = Vector3::from(first.position.unwrap_or([0.0; 3]));
        Stack { origin, step: normal * thickness, layers: None }
    } else {
        stack(path, slices, &normal, dx.min(dy), resample, exec)?
    };
    if let Some(layers) = &layers {
        dims[2] = layers.len();
        bounded::voxel_count(path, "resampled slices", dims)?;
    }
    let length = step.norm();
    let axes = [row, column, step / length].map(Into::into);
    let grid = orientation::grid_from_lps_parts(path, dims, [dx, dy, length], origin.into(), axes)?;
    Ok(Stacked { grid, layers })
}

/// Unit directions of a row and a column.
fn directions(slice: &Slice, slices: usize) -> Result<[Vector3<f64>; 2], Error> {
    let name = "ImageOrientationPatient";
    let Some([row, column]) = slice.orientation else {
        if slices == 1 {
            return Ok([Vector3::x(), Vector3::y()]);
        }
        return Err(Error::field(&slice.path, name, "missing"));
    };
    let (row, column) = (Vector3::from(row), Vector3::from(column));
    let unit = |v: &Vector3<f64>| (v.norm() - 1.0).abs() < 1e-2;
    if !unit(&row) || !unit(&column) || row.dot(&column).abs() > 1e-2 {
        return Err(Error::field(&slice.path, name, "not two unit vectors at right angles"));
    }
    Ok([row.normalize(), column.normalize()])
}

/// Sorts the slices; gives the first one's position and the step from slice to slice.
fn stack(
    path: &Path,
    slices: &mut [Slice],
    normal: &Vector3<f64>,
    pixel: f64,
    resample: bool,
    exec: &Exec,
) -> Result<Stack, Error> {
    for slice in slices.iter() {
        if slice.position.is_none() {
            return Err(Error::field(&slice.path, "ImagePositionPatient", "missing"));
        }
    }
    let position = |s: &Slice| Vector3::from(s.position.expect("checked above"));
    let along = |s: &Slice| position(s).dot(normal);
    slices.sort_by(|a, b| along(a).total_cmp(&along(b)).then_with(|| a.path.cmp(&b.path)));
    let along: Vec<f64> = slices.iter().map(along).collect();
    let layers = even_layers(slices, &along, resample, exec, path)?;
    let count = layers.as_ref().map_or(slices.len(), Vec::len);
    let origin = position(&slices[0]);
    let way = position(&slices[slices.len() - 1]) - origin;
    for (slice, at) in slices.iter().zip(&along) {
        let off = position(slice) - (origin + way * ((at - along[0]) / way.dot(normal)));
        let sideways = (off - normal * off.dot(normal)).norm();
        if sideways > DRIFT_PIXELS * pixel {
            let problem = format!("{sideways:.3} mm beside the line through the first and last slice");
            return Err(Error::field(&slice.path, "ImagePositionPatient", problem));
        }
    }
    let straight = normal * way.dot(normal);
    let drift = (way - straight).norm();
    let steps = (count - 1) as f64;
    if drift <= DRIFT_PIXELS * pixel {
        return Ok(Stack { origin, step: straight / steps, layers });
    }
    exec.observer().note(&format!(
        "{}: the slices are shifted sideways by {drift:.3} mm from first to last; the shear is kept",
        path.display()
    ));
    Ok(Stack { origin, step: way / steps, layers })
}

/// Distances of slices that follow each other (mm).
fn gaps(along: &[f64]) -> Vec<f64> {
    along.windows(2).map(|w| w[1] - w[0]).collect()
}

/// The usual one of some gaps, and how far others may be from it.
fn usual(gaps: &[f64]) -> [f64; 2] {
    let mut sorted = gaps.to_vec();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    [usual, (GAP_PART * usual).max(GAP_MM)]
}

/// The usual distance of a series' slices (mm) and the largest difference from it where they are uneven; `None` where it can't be told.
pub(super) fn distances(slices: &[Slice]) -> Option<[Option<f64>; 2]> {
    let [row, column] = directions(slices.first()?, slices.len()).ok()?;
    if slices.len() == 1 {
        return Some([slices[0].thickness, None]);
    }
    let normal = row.cross(&column).normalize();
    let along: Option<Vec<f64>> =
        slices.iter().map(|s| Some(Vector3::from(s.position?).dot(&normal))).collect();
    let mut along = along?;
    along.sort_by(f64::total_cmp);
    let gaps = gaps(&along);
    let [usual, tolerance] = usual(&gaps);
    let worst = gaps.iter().map(|gap| (gap - usual).abs()).fold(0.0, f64::max);
    Some([Some(usual), (worst > tolerance).then_some(worst)])
}

/// Refuses slices at the same place, and gaps that differ; where they are to be resampled gives the layers of an even spacing.
fn even_layers(
    slices: &[Slice],
    along: &[f64],
    resample: bool,
    exec: &Exec,
    path: &Path,
) -> Result<Option<Vec<Layer>>, Error> {
    let gaps = gaps(along);
    let [usual, tolerance] = usual(&gaps);
    let (mut worst, mut uneven) = (0.0_f64, false);
    for (i, gap) in gaps.iter().enumerate() {
        let names = || {
            let name = |s: &Slice| s.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            format!("{} and {}", name(&slices[i]), name(&slices[i + 1]))
        };
        if *gap < 1e-4 {
            let problem = format!(
                "{} lie at the same place, {:.3} mm along the normal: copies, or several times in one series",
                names(),
                along[i]
            );
            return Err(Error::field(path, "ImagePositionPatient", problem));
        }
        if (gap - usual).abs() > tolerance && !resample {
            let problem = format!(
                "ImagePositionPatient: {} are {gap:.4} mm apart, but slices usually {usual:.4} mm (from {:.3} to {:.3} mm along \
                 the normal): a slice is missing or the spacing varies",
                names(),
                along[i],
                along[i + 1]
            );
            let remedy = "add the slice, or have even spacing interpolated with --resample-slices (in a scene: \
                          input.resample_slices = true)";
            return Err(Error::choice(path, problem, remedy).offering(Offer::EvenSlices));
        }
        uneven |= (gap - usual).abs() > tolerance;
        worst = worst.max((gap - usual).abs());
    }
    if uneven {
        return Ok(Some(resampled(along, &gaps, exec, path)));
    }
    if worst > 1e-3 * usual {
        exec.observer().note(&format!(
            "{}: the distances of slices vary by up to {worst:.4} mm; their mean is taken",
            path.display()
        ));
    }
    Ok(None)
}

/// Layers about as far from each other as the nearest slices, from the first slice to the last.
fn resampled(along: &[f64], gaps: &[f64], exec: &Exec, path: &Path) -> Vec<Layer> {
    let total = along[along.len() - 1] - along[0];
    let [least, most] =
        gaps.iter().fold([f64::INFINITY, 0.0], |[least, most], &gap| [gap.min(least), gap.max(most)]);
    let steps = ((total / least).round() as usize).min(MOST_LAYERS * gaps.len());
    let step = total / steps as f64;
    let mut slice = 0;
    let layers: Vec<Layer> = (0..=steps)
        .map(|z| {
            let at = along[0] + step * z as f64;
            while slice + 1 < along.len() && along[slice + 1] <= at + ON_A_SLICE * step {
                slice += 1;
            }
            let beyond = at - along[slice];
            let part = if beyond.abs() <= ON_A_SLICE * step || slice + 1 == along.len() {
                0.0
            } else {
                beyond / gaps[slice]
            };
            Layer { slice, part }
        })
        .collect();
    let kept = layers.iter().filter(|layer| layer.part == 0.0).count();
    exec.observer().note(&format!(
        "{}: {} slices from {least:.4} to {most:.4} mm apart are resampled onto {}, {step:.4} mm apart: {kept} of those are slices as \
         they were, the others are interpolated between two",
        path.display(),
        along.len(),
        layers.len()
    ));
    layers
}
