//! A volume whose file says wrongly where it lies, on the grid of another file with as many voxels.

use std::path::Path;

use ivd_artefact::Artefact;
use ivd_core::{Exec, Grid, Volume};
use ivd_io::volume::{ReadOptions, VoxelAxes};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::IMPORT;
use crate::Error;

/// What a file said of its grid, and what was taken in its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GridTaken {
    /// Spacing that the file said, and that of the other.
    #[schemars(extend("x-unit" = "mm"))]
    pub spacing: [[f64; 3]; 2],
    /// First voxel as the file said, and as the other does, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub origin: [[f64; 3]; 2],
    /// Where x, y and z lead for the most part, as the file said and as the other does.
    pub axes: [String; 2],
    /// Whether both are one grid: then nothing was mended.
    pub same: bool,
}

impl GridTaken {
    pub(super) fn of(own: &Grid, taken: &Grid) -> Self {
        let both = [own, taken];
        Self {
            spacing: both.map(Grid::spacing),
            origin: both.map(Grid::origin),
            axes: both.map(|grid| VoxelAxes::nearest(grid).to_string()),
            same: own.matches(taken) && own.reference() == taken.reference(),
        }
    }

    /// What a person should know of it.
    pub(super) fn told(&self) -> String {
        if self.same {
            return "the file lies on the grid of the other already; nothing is changed".to_owned();
        }
        let triple = |v: [f64; 3]| v.map(|c| format!("{}", (c * 1e4).round() / 1e4)).join(", ");
        let mut parts = Vec::new();
        let [own, taken] = self.spacing.map(triple);
        if own != taken {
            parts.push(format!("spacing {taken} mm instead of {own} mm"));
        }
        let [own, taken] = self.origin.map(triple);
        if own != taken {
            parts.push(format!("first voxel at {taken} mm instead of {own} mm"));
        }
        let [own, taken] = &self.axes;
        if own != taken {
            parts.push(format!("axes {taken} instead of {own}"));
        }
        if parts.is_empty() {
            parts.push("axes turned a little, or known to lie in the patient".to_owned());
        }
        format!(
            "the grid of the other file is taken: {}. The voxels stay in their order; look at a place or two (`ivd info SCAN --at x,y,z --labels FILE`) \
             whether they lie right",
            parts.join(", ")
        )
    }
}

/// A volume on the grid of a file that holds one, labels or a mask.
pub(super) fn on_grid_of(volume: &Volume, path: &Path, other: &Path, exec: &Exec) -> Result<Volume, Error> {
    let grid = read_grid(other, exec)?;
    let [own, wanted] = [volume.grid().dims(), grid.dims()];
    if own != wanted {
        let dims = |dims: [usize; 3]| dims.map(|n| n.to_string()).join(" × ");
        return Err(Error::usage(
            IMPORT,
            format!(
                "{} has {} voxels, and {}, whose grid is to be taken, has {}; give a file with as many along x, y and z (--like puts labels or a \
                 mask onto another grid by where they lie)",
                path.display(),
                dims(own),
                other.display(),
                dims(wanted)
            ),
        ));
    }
    let laid = Volume::with_scale(grid, volume.voxels().clone(), volume.slope(), volume.intercept())?;
    Ok(laid.with_modality(volume.modality()))
}

/// The grid of a file.
fn read_grid(path: &Path, exec: &Exec) -> Result<Grid, Error> {
    if !ivd_artefact::is_artefact(path) {
        let read = ivd_io::volume::read(path, &ReadOptions::default(), exec);
        return Ok(read.map_err(Error::in_stage(IMPORT))?.grid().clone());
    }
    match exec.run(|| ivd_artefact::read(path)).map_err(Error::in_stage(IMPORT))?.artefact {
        Artefact::Volume(volume) => Ok(volume.grid().clone()),
        Artefact::Labels(labels) => Ok(labels.grid().clone()),
        Artefact::Mask(mask) => Ok(mask.grid().clone()),
        Artefact::Displacement(displacement) => Ok(displacement.grid().clone()),
        other @ (Artefact::Lattice(_)
        | Artefact::Octree(_)
        | Artefact::Motion(_)
        | Artefact::Transfer(_)
        | Artefact::Image(_)
        | Artefact::Tree(_)) => {
            let kind = other.kind();
            Err(Error::usage(
                IMPORT,
                format!(
                    "{}: a {kind} artefact; the grid is taken of a volume, labels or a mask",
                    path.display()
                ),
            ))
        }
    }
}
