use std::path::Path;

use ivd_core::{Exec, Grid};
use nalgebra::Vector3;

use super::header::Slice;
use crate::volume::{Error, bounded, orientation};

/// Largest deviation of a gap between slices from the usual one, as a part of it, …
const GAP_PART: f64 = 0.01;
/// … and in mm, whichever is larger: positions are written with few digits.
const GAP_MM: f64 = 0.01;
/// Largest sideways drift of a slice from the line through the first and last, in pixels.
const DRIFT_PIXELS: f64 = 0.1;

/// Sorts the slices along their normal and makes the grid: x along a row, y along a column, z along the normal.
///
/// DICOM's world is LPS. Where the slices are shifted sideways as they go (a tilted gantry), the shear is kept.
pub(super) fn grid(path: &Path, slices: &mut [Slice], exec: &Exec) -> Result<Grid, Error> {
    let first = &slices[0];
    let dims = [first.columns, first.rows, slices.len()];
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
    let (origin, step) = if slices.len() == 1 {
        let thickness = first.thickness.filter(|t| *t > 0.0).unwrap_or_else(|| {
            exec.observer()
                .note(&format!("{}: a single slice without thickness: 1 mm is taken", path.display()));
            1.0
        });
        (Vector3::from(first.position.unwrap_or([0.0; 3])), normal * thickness)
    } else {
        stack(path, slices, &normal, dx.min(dy), exec)?
    };
    let length = step.norm();
    let axes = [row, column, step / length].map(Into::into);
    orientation::grid_from_lps_parts(path, dims, [dx, dy, length], origin.into(), axes)
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
    exec: &Exec,
) -> Result<(Vector3<f64>, Vector3<f64>), Error> {
    for slice in slices.iter() {
        if slice.position.is_none() {
            return Err(Error::field(&slice.path, "ImagePositionPatient", "missing"));
        }
    }
    let position = |s: &Slice| Vector3::from(s.position.expect("checked above"));
    let along = |s: &Slice| position(s).dot(normal);
    slices.sort_by(|a, b| along(a).total_cmp(&along(b)).then_with(|| a.path.cmp(&b.path)));
    let count = slices.len();
    let step = (position(&slices[count - 1]) - position(&slices[0])) / (count - 1) as f64;
    check_gaps(slices, &slices.iter().map(along).collect::<Vec<_>>(), exec, path)?;
    let origin = position(&slices[0]);
    for (i, slice) in slices.iter().enumerate() {
        let off = position(slice) - (origin + step * i as f64);
        let sideways = (off - normal * off.dot(normal)).norm();
        if sideways > DRIFT_PIXELS * pixel {
            let problem = format!("{sideways:.3} mm beside the line through the first and last slice");
            return Err(Error::field(&slice.path, "ImagePositionPatient", problem));
        }
    }
    let straight = normal * step.dot(normal);
    let drift = (step - straight).norm() * (count - 1) as f64;
    if drift <= DRIFT_PIXELS * pixel {
        return Ok((origin, straight));
    }
    exec.observer().note(&format!(
        "{}: the slices are shifted sideways by {drift:.3} mm from first to last; the shear is kept",
        path.display()
    ));
    Ok((origin, step))
}

/// Refuses slices at the same place, and gaps that differ.
fn check_gaps(slices: &[Slice], along: &[f64], exec: &Exec, path: &Path) -> Result<(), Error> {
    let gaps: Vec<f64> = along.windows(2).map(|w| w[1] - w[0]).collect();
    let mut sorted = gaps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let tolerance = (GAP_PART * usual).max(GAP_MM);
    let mut worst = 0.0_f64;
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
        if (gap - usual).abs() > tolerance {
            let problem = format!(
                "{} are {gap:.4} mm apart, but slices usually {usual:.4} mm (from {:.3} to {:.3} mm along the \
                 normal): a slice is missing or the spacing varies",
                names(),
                along[i],
                along[i + 1]
            );
            return Err(Error::field(path, "ImagePositionPatient", problem));
        }
        worst = worst.max((gap - usual).abs());
    }
    if worst > 1e-3 * usual {
        exec.observer().note(&format!(
            "{}: the distances of slices vary by up to {worst:.4} mm; their mean is taken",
            path.display()
        ));
    }
    Ok(())
}
