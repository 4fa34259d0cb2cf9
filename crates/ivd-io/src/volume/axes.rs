//! What the axes of a file's voxels are in the patient, where a person says it.

use std::fmt;
use std::str::FromStr;

use ivd_core::{Exec, Grid, ParamError, Volume};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// The letters of both ways along each of the patient's axes, RAS first.
const LETTERS: [[char; 2]; 3] = [['R', 'L'], ['A', 'P'], ['S', 'I']];

/// The orders of three axes.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Where each axis of the voxels leads: a letter for x, y and z, of right or left, anterior or posterior, superior or inferior.
///
/// ```
/// use ivd_io::volume::VoxelAxes;
///
/// let axes: VoxelAxes = "lpi".parse()?;
/// assert_eq!(axes.to_string(), "LPI");
/// assert_eq!(axes.direction()[2], [0.0, 0.0, -1.0]);
/// assert!("LRS".parse::<VoxelAxes>().is_err());
/// # Ok::<(), ivd_core::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct VoxelAxes([Way; 3]);

/// Where an axis leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Way {
    /// Which of the patient's axes it is along.
    along: usize,
    /// Whether to the left, the back or the feet.
    back: bool,
}

impl Way {
    fn of(letter: char) -> Option<Self> {
        let along = LETTERS.iter().position(|letters| letters.contains(&letter))?;
        Some(Self { along, back: letter == LETTERS[along][1] })
    }
}

impl VoxelAxes {
    /// Those of a grid: where each axis leads for the most part, of the ways to give each a part of the patient's axes.
    pub fn nearest(grid: &Grid) -> Self {
        let ways = grid.direction();
        let share = |along: &[usize; 3]| -> f64 { (0..3).map(|a| ways[a][along[a]].abs()).sum() };
        let along = ORDERS.into_iter().max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(ORDERS[0]);
        Self(std::array::from_fn(|a| Way { along: along[a], back: ways[a][along[a]] <= 0.0 }))
    }

    /// The letters of where the axes lead to.
    fn letters(self) -> [char; 3] {
        self.0.map(|way| LETTERS[way.along][usize::from(way.back)])
    }

    /// The letters of where they come from, as MetaImage has them.
    pub(crate) fn opposite(self) -> [char; 3] {
        self.0.map(|way| LETTERS[way.along][usize::from(!way.back)])
    }

    /// Unit direction of each axis, RAS.
    pub fn direction(self) -> [[f64; 3]; 3] {
        self.0.map(|way| {
            let mut direction = [0.0; 3];
            direction[way.along] = if way.back { -1.0 } else { 1.0 };
            direction
        })
    }

    /// The volume with its axes along these, and known to lie in the patient so: its first voxel stays where it is.
    ///
    /// # Errors
    /// As [`Grid::new`], which no grid gives that was one.
    pub(crate) fn lay(self, volume: &Volume, exec: &Exec) -> Result<Volume, ivd_core::Error> {
        let grid = volume.grid();
        let differs = Matrix3::from(grid.direction()) - Matrix3::from(self.direction());
        if grid.in_patient() && differs.amax() > 1e-6 {
            exec.observer().note(&format!(
                "the file says where the patient lies, but axes = {self} is what is taken: left and right, front and back, head and feet are as that says"
            ));
        }
        let laid = Grid::new(grid.dims(), grid.spacing(), grid.origin(), self.direction())?;
        let turned = Volume::with_scale(laid, volume.voxels().clone(), volume.slope(), volume.intercept())?;
        Ok(turned.with_modality(volume.modality()))
    }
}

impl FromStr for VoxelAxes {
    type Err = ParamError;
    fn from_str(text: &str) -> Result<Self, ParamError> {
        let ways: Option<Vec<Way>> = text.trim().to_uppercase().chars().map(Way::of).collect();
        let ways = ways.and_then(|ways| <[Way; 3]>::try_from(ways).ok());
        let all = |ways: &[Way; 3]| (0..3).all(|axis| ways.iter().any(|way| way.along == axis));
        ways.filter(all).map(Self).ok_or_else(|| {
            let problem = format!("`{}` isn't where three axes lead", text.escape_debug());
            let remedy = "give a letter each for x, y and z, one of R and L, one of A and P, one of S and I: LPS where x grows to the \
                          patient's left, y to the back and z to the head";
            ParamError::new("axes", problem, remedy)
        })
    }
}

impl fmt::Display for VoxelAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&String::from_iter(self.letters()))
    }
}

impl TryFrom<String> for VoxelAxes {
    type Error = ParamError;
    fn try_from(text: String) -> Result<Self, ParamError> {
        text.parse()
    }
}

impl From<VoxelAxes> for String {
    fn from(axes: VoxelAxes) -> Self {
        axes.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_48_ways_to_lie_are_told_from_their_directions_and_no_others() {
        let letters = ['R', 'L', 'A', 'P', 'S', 'I'];
        let mut known = 0;
        for x in letters {
            for y in letters {
                for z in letters {
                    let Ok(axes) = String::from_iter([x, y, z]).parse::<VoxelAxes>() else { continue };
                    known += 1;
                    let grid = Grid::new([2; 3], [1.0; 3], [0.0; 3], axes.direction()).unwrap();
                    assert_eq!(VoxelAxes::nearest(&grid), axes);
                }
            }
        }
        assert_eq!(known, 48);
        for bad in ["", "LP", "LPSS", "LLS", "LRS", "xyz", "L P"] {
            assert!(bad.parse::<VoxelAxes>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_letters_of_metaimage_are_those_of_where_axes_come_from() {
        // As ITK writes its identity, LPS.
        assert_eq!("LPS".parse::<VoxelAxes>().unwrap().opposite(), ['R', 'A', 'I']);
    }
}
