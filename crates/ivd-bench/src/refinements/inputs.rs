//! Lattices to refine.

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_phantom::{Shape, signed_distance};

use crate::experiment::Problem;
use crate::inputs::EDGE_MM;
use crate::stages::part;
use crate::{Options, plate};

/// A lattice, and what it is, in words.
pub(super) struct Input {
    pub(super) words: String,
    pub(super) lattice: Lattice,
    /// Turn and height of the camera (degrees).
    pub(super) view: [f64; 2],
}

/// From the front, a little from above and from one side.
const VIEW: [f64; 2] = [28.0, 24.0];

/// A plate with creases and a gyroid with many handles, or the volume of `options`.
pub(super) fn inputs(options: &Options, iso: Option<f64>, exec: &Exec) -> Result<Vec<Input>, Problem> {
    let cut = |volume: &Volume, iso: f64| -> Result<Lattice, Problem> {
        Ok(extract(volume, None, &ExtractParams { iso: Iso::Value(iso) }, exec)?.lattice)
    };
    if let Some(given) = &options.input {
        let dims = given.volume.grid().dims();
        let (what, lattice) = match iso {
            Some(iso) => (format!("the surface at {iso}"), cut(&given.volume, iso)?),
            None => ("the densest part".to_owned(), part(&given.volume, exec)?),
        };
        return Ok(vec![Input {
            words: format!("{what} of {}, {dims:?} voxels", given.name),
            lattice,
            view: VIEW,
        }]);
    }
    let (size, half) = (options.size.max(16), options.size.max(32) / 2);
    Ok(vec![
        Input {
            words: format!("{}, {size}³ voxels", plate::WORDS),
            lattice: cut(&plate::volume(size)?, 0.0)?,
            view: plate::view(),
        },
        Input {
            words: format!("four periods of a gyroid, {half}³ voxels"),
            lattice: cut(&gyroid(half)?, 0.0)?,
            view: VIEW,
        },
    ])
}

/// The gyroid's signed distance (voxels), positive inside, in the same cube as the plate.
fn gyroid(n: usize) -> Result<Volume, Problem> {
    let grid = Grid::with_spacing([n; 3], [EDGE_MM / n as f64; 3])?;
    let value = |i: usize| -signed_distance(Shape::Gyroid, grid.index(i).0.map(|c| c as f64), n) as f32;
    let voxels: Vec<f32> = (0..grid.len()).map(value).collect();
    Ok(Volume::new(grid, Voxels::from(voxels))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_lattice::figures::measure;

    #[test]
    fn the_plate_has_three_handles_and_the_gyroid_many() {
        let made = inputs(&Options { size: 64, ..Options::default() }, None, &Exec::default()).unwrap();
        let genus: Vec<_> = made.iter().map(|input| measure(&input.lattice).genus).collect();
        assert!(genus[0] == Some(3) && genus[1] > Some(100), "{genus:?}");
    }
}
