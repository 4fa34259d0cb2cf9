use serde::{Deserialize, Serialize};

use crate::{Buffer, Error, Grid};

/// Label of a voxel that is no data.
pub const NO_DATA: u16 = 0;

/// One class of a segmentation. Values are real values (slope and intercept applied).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Class {
    /// Label of the class. Segmentations number classes from 1 in the order of their means; 0 is no data.
    pub id: u16,
    /// Name, where one is known ("skull").
    pub name: Option<String>,
    /// Mean of the class's voxels.
    pub mean: f64,
    /// Standard deviation of the class's voxels, ≥ 0.
    pub sd: f64,
    /// Number of voxels.
    pub voxels: u64,
    /// Crossing with the class below in intensity; `None` for the lowest class, or where classes aren't intervals.
    pub lower: Option<f64>,
    /// Crossing with the class above in intensity; `None` for the highest class, or where classes aren't intervals.
    pub upper: Option<f64>,
}

/// A label for every voxel, and what the labels mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    grid: Grid,
    ids: Buffer<u16>,
    classes: Vec<Class>,
}

impl Labels {
    /// Labels on `grid`; `ids` linear, x fastest. `classes` may list fewer ids than occur, never one id twice.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where lengths differ or an id is listed twice.
    pub fn new(grid: Grid, ids: Buffer<u16>, classes: Vec<Class>) -> Result<Self, Error> {
        if ids.len() != grid.len() {
            return Err(Error::Inconsistent {
                what: "labels",
                problem: format!("{} labels for a grid of {:?}", ids.len(), grid.dims()),
            });
        }
        let mut listed = std::collections::HashSet::new();
        for class in &classes {
            if !listed.insert(class.id) {
                return Err(Error::Inconsistent {
                    what: "labels",
                    problem: format!("class {} is listed twice", class.id),
                });
            }
        }
        Ok(Self { grid, ids, classes })
    }

    /// Where the voxels lie.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Label of every voxel, linear, x fastest.
    pub fn ids(&self) -> &[u16] {
        &self.ids
    }

    /// The buffer behind [`Labels::ids`].
    pub fn buffer(&self) -> &Buffer<u16> {
        &self.ids
    }

    /// The classes, in the order of their means.
    pub fn classes(&self) -> &[Class] {
        &self.classes
    }

    /// The class of an id.
    pub fn class(&self, id: u16) -> Option<&Class> {
        self.classes.iter().find(|c| c.id == id)
    }
}
