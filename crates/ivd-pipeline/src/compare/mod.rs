//! The error between two artefacts of one kind.

mod agreement;
mod assignment;
mod confusion;
mod distance;
mod matching;

use ivd_artefact::{Artefact, Kind};
use ivd_core::{Displacement, Exec, Image, Volume, VoxelIndex};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::Error;

/// Compares two artefacts of one kind.
///
/// Labels: Dice of each class of `a` with its partner in `b`, adjusted Rand index, confusion table. Partners are one to one
/// and have the largest sum of Dice that is possible; `unproven` counts the classes for which that isn't sure, because a
/// thousand or more overlap in a tangle: they were matched by Dice, the largest first. Masks: Dice. Lattices: Hausdorff and
/// mean distance (mm), both ways, from vertices and triangle centres to the other surface. Volumes, displacements (mm) and
/// images: largest, 95th percentile and root mean square of the difference.
///
/// # Errors
/// A usage error where the kinds differ or the kind has no measure; [`ivd_core::Error::GridMismatch`] where the grids
/// do.
pub fn compare(a: &Artefact, b: &Artefact, exec: &Exec) -> Result<Value, Error> {
    exec.run(|| match (a, b) {
        (Artefact::Volume(a), Artefact::Volume(b)) => volumes(a, b),
        (Artefact::Labels(a), Artefact::Labels(b)) => {
            a.grid().require(b.grid(), "labels", "the other labels")?;
            Ok(agreement::labels(a.ids(), b.ids()))
        }
        (Artefact::Mask(a), Artefact::Mask(b)) => {
            a.grid().require(b.grid(), "mask", "the other mask")?;
            Ok(agreement::masks(a.inside(), b.inside()))
        }
        (Artefact::Lattice(a), Artefact::Lattice(b)) => distance::lattices(a, b, exec),
        (Artefact::Displacement(a), Artefact::Displacement(b)) => fields(a, b),
        (Artefact::Image(a), Artefact::Image(b)) => images(a, b),
        _ if a.kind() == b.kind() => {
            Err(Error::usage("compare", format!("{} artefacts have no error measure", a.kind().name())))
        }
        _ => Err(Error::usage(
            "compare",
            format!(
                "a {} artefact and a {} artefact; give two of one kind{}",
                a.kind(),
                b.kind(),
                made_alike(a.kind(), b.kind())
            ),
        )),
    })
}

/// The command that makes one of two kinds the other.
fn made_alike(a: Kind, b: Kind) -> &'static str {
    let both = [a, b];
    if both.contains(&Kind::Volume) && both.contains(&Kind::Labels) {
        " (`ivd import VOLUME --labels` takes a volume's numbers for labels)"
    } else if both.contains(&Kind::Volume) && both.contains(&Kind::Mask) {
        " (`ivd import VOLUME --mask` takes what isn't 0 for a mask)"
    } else if both.contains(&Kind::Labels) && both.contains(&Kind::Mask) {
        " (`ivd boundary LABELS --class N` cuts the part of a class out as a mask)"
    } else {
        ""
    }
}

fn volumes(a: &Volume, b: &Volume) -> Result<Value, Error> {
    a.grid().require(b.grid(), "volume", "the other volume")?;
    let missing_differs = (0..a.grid().len())
        .into_par_iter()
        .filter(|&i| a.voxels().get(i).is_finite() != b.voxels().get(i).is_finite())
        .count();
    let differences: Vec<f64> = (0..a.grid().len())
        .into_par_iter()
        .map(|i| (a.real(a.voxels().get(i)) - b.real(b.voxels().get(i))).abs())
        .filter(|d| d.is_finite())
        .collect();
    let mut object = spread(differences);
    object["missing_differs"] = json!(missing_differs);
    object["range"] = json!(a.range());
    Ok(object)
}

fn fields(a: &Displacement, b: &Displacement) -> Result<Value, Error> {
    a.grid().require(b.grid(), "displacement", "the other displacement")?;
    let length = |p: [f32; 3], q: [f32; 3]| {
        (0..3).map(|c| (f64::from(p[c]) - f64::from(q[c])).powi(2)).sum::<f64>().sqrt()
    };
    let measure = |p: &ivd_core::FieldBricks, q: &ivd_core::FieldBricks| {
        let all = (0..a.grid().len()).into_par_iter();
        spread(all.map(|i| a.grid().index(i)).map(|v: VoxelIndex| length(p.at(v), q.at(v))).collect())
    };
    Ok(json!({ "kind": "displacement", "unit": "mm", "forward": measure(a.forward(), b.forward()),
        "inverse": measure(a.inverse(), b.inverse()) }))
}

fn images(a: &Image, b: &Image) -> Result<Value, Error> {
    if (a.width(), a.height()) != (b.width(), b.height()) {
        return Err(Error::usage(
            "compare",
            format!("pictures of {}x{} and {}x{} pixels", a.width(), a.height(), b.width(), b.height()),
        ));
    }
    if a.frames() != b.frames() {
        return Err(Error::usage("compare", format!("{} pictures and {}", a.frames(), b.frames())));
    }
    Ok(spread(a.rgba().iter().zip(b.rgba()).map(|(p, q)| f64::from(p.abs_diff(*q))).collect()))
}

/// Largest, 95th percentile, root mean square, and how many differ at all.
fn spread(mut differences: Vec<f64>) -> Value {
    let n = differences.len().max(1);
    // Fixed chunks in a fixed order: the same sum for any number of threads.
    let squares: f64 = differences.chunks(1 << 16).map(|c| c.iter().map(|d| d * d).sum::<f64>()).sum();
    let differing = differences.iter().filter(|d| **d > 0.0).count();
    let max = differences.iter().copied().fold(0.0, f64::max);
    let at = ((n as f64 * 0.95) as usize).min(differences.len().saturating_sub(1));
    let p95 =
        if differences.is_empty() { 0.0 } else { *differences.select_nth_unstable_by(at, f64::total_cmp).1 };
    json!({ "max": max, "p95": p95, "rms": (squares / n as f64).sqrt(), "differing": differing, "count": n })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Voxels};

    #[test]
    fn volumes_tell_largest_p95_and_rms() {
        let grid = Grid::with_spacing([100, 1, 1], [1.0; 3]).unwrap();
        let a = Volume::new(grid.clone(), Voxels::from(vec![0_u8; 100])).unwrap();
        let mut values = vec![0_u8; 100];
        values[3] = 8;
        values[7] = 6;
        let b = Volume::new(grid, Voxels::from(values)).unwrap();
        let error = volumes(&a, &b).unwrap();
        assert_eq!((error["max"].as_f64(), error["p95"].as_f64()), (Some(8.0), Some(0.0)));
        assert_eq!(error["rms"].as_f64(), Some(1.0), "sqrt((64 + 36) / 100)");
        assert_eq!(error["differing"], 2);
    }

    #[test]
    fn different_kinds_and_grids_are_refused() {
        let grid = |n| Grid::with_spacing([n, 1, 1], [1.0; 3]).unwrap();
        let volume = |n: usize| Artefact::Volume(Volume::new(grid(n), Voxels::from(vec![0_u8; n])).unwrap());
        let image = Artefact::Image(Image::new(1, 1, vec![0; 4]).unwrap());
        assert!(compare(&volume(2), &image, &Exec::default()).is_err());
        assert!(compare(&volume(2), &volume(3), &Exec::default()).is_err());
    }
}
