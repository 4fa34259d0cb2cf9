use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::{BRICK, BrickIndex, Buffer, Error, Grid, Volume, parallel};

/// Label of a voxel that is no data.
pub const NO_DATA: u16 = 0;

/// Bricks that are looked at in one go.
const PIECE: usize = 256;

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
#[derive(Debug, Clone)]
pub struct Labels {
    grid: Grid,
    ids: Buffer<u16>,
    classes: Vec<Class>,
    /// See [`Labels::of_bricks`].
    of_bricks: OnceLock<Vec<Option<u16>>>,
}

impl PartialEq for Labels {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid && self.ids == other.ids && self.classes == other.classes
    }
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
        Ok(Self { grid, ids, classes, of_bricks: OnceLock::new() })
    }

    /// Refuses what is said of a class that there isn't; [`NO_DATA`] any labels may have.
    ///
    /// # Errors
    /// [`Error::Mismatch`] names the first.
    pub fn require_classes(
        &self,
        mut ids: impl Iterator<Item = u16>,
        what: &'static str,
    ) -> Result<(), Error> {
        let there = |id: u16| id == NO_DATA || self.classes.iter().any(|class| class.id == id);
        match ids.find(|id| !there(*id)) {
            None => Ok(()),
            Some(id) => Err(Error::Mismatch {
                what,
                problem: format!("there is no class {id} among the labels"),
                remedy: "name a class that the labels have; `ivd info` lists them",
            }),
        }
    }

    /// The labels that a volume holds as its real values, such as a segmentation that another program wrote. Its classes are the
    /// labels that occur, but 0; their means are the labels themselves.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first voxel whose value isn't a whole number from 0 to 65,535.
    pub fn from_volume(volume: &Volume) -> Result<Self, Error> {
        let grid = volume.grid();
        let voxels = volume.voxels();
        let mut counts = vec![0_u64; 1 << 16];
        let mut ids = Vec::with_capacity(grid.len());
        for linear in 0..grid.len() {
            let value = volume.real(voxels.get(linear));
            let id = value as u16;
            if f64::from(id) != value {
                let at = grid.index(linear).0;
                let problem =
                    format!("voxel {at:?} holds {value}; labels are whole numbers from 0 to {}", u16::MAX);
                return Err(Error::Inconsistent { what: "label volume", problem });
            }
            counts[usize::from(id)] += 1;
            ids.push(id);
        }
        let occurring = counts.iter().enumerate().skip(1).filter(|(_, voxels)| **voxels > 0);
        let classes = occurring.map(|(id, &voxels)| Class {
            id: id as u16,
            name: None,
            mean: id as f64,
            sd: 0.0,
            voxels,
            lower: None,
            upper: None,
        });
        Self::new(grid.clone(), ids.into(), classes.collect())
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

    /// The labels, to be changed: copied first where somebody else holds them. Whoever changes them says how many voxels the classes have then
    /// ([`Labels::count`]).
    pub fn ids_mut(&mut self) -> &mut [u16] {
        self.of_bricks = OnceLock::new();
        self.ids.make_mut()
    }

    /// Changes labels that lie in blocks of [`BRICK`]³ voxels (linear indices, as those of bricks), and no others: as [`Labels::ids_mut`], but what is known of
    /// bricks stays so, and that of the blocks is found anew.
    pub fn change_blocks<R>(&mut self, blocks: &[usize], change: impl FnOnce(&mut [u16]) -> R) -> R {
        // Nobody sees what was where the change doesn't come to its end.
        let known = self.of_bricks.take();
        let changed = change(self.ids.make_mut());
        if let Some(mut known) = known {
            let bricks = BrickIndex::dims_for(self.grid.dims());
            let (row, layer) = (bricks[0], bricks[0] * bricks[1]);
            // Those before a block reach into it.
            let reach = |block: &usize| {
                let at = [block % row, block % layer / row, block / layer];
                let [xs, ys, zs] = at.map(|c| c.saturating_sub(1)..=c);
                zs.flat_map(move |z| ys.clone().map(move |y| row * y + layer * z))
                    .flat_map(move |before| xs.clone().map(move |x| x + before))
            };
            let mut again: Vec<usize> = blocks.iter().flat_map(reach).collect();
            again.sort_unstable();
            again.dedup();
            let only = self.only_labels(&again);
            again.into_iter().zip(only).for_each(|(brick, only)| known[brick] = only);
            let _ = self.of_bricks.set(known);
        }
        changed
    }

    /// For each brick (linear, x fastest) the label that all its voxels have, with those of the layer behind it along each axis, which samples between voxels
    /// reach; `None` where there are several. Found once.
    pub fn of_bricks(&self) -> &[Option<u16>] {
        self.of_bricks.get_or_init(|| {
            let bricks = BrickIndex::dims_for(self.grid.dims()).iter().product();
            self.only_labels(&(0..bricks).collect::<Vec<_>>())
        })
    }

    /// The labels of a brick's voxels, with those of the layer behind it along each axis.
    pub fn about_brick(&self, brick: usize) -> impl Iterator<Item = u16> {
        let (dims, bricks) = (self.grid.dims(), BrickIndex::dims_for(self.grid.dims()));
        let at = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
        let [xs, ys, zs] = [0, 1, 2].map(|a| BRICK * at[a]..dims[a].min(BRICK * (at[a] + 1) + 1));
        let rows = zs.flat_map(move |z| ys.clone().map(move |y| dims[0] * (y + dims[1] * z)));
        rows.flat_map(move |row| &self.ids[row + xs.start..row + xs.end]).copied()
    }

    /// Of bricks, the labels of [`Labels::of_bricks`].
    fn only_labels(&self, bricks: &[usize]) -> Vec<Option<u16>> {
        let only = |brick: usize| {
            let mut labels = self.about_brick(brick);
            let first = labels.next()?;
            labels.all(|id| id == first).then_some(first)
        };
        let mut found = vec![None; bricks.len()];
        parallel::for_each_piece_mut(&mut found, PIECE, &|piece, found| {
            let bricks = bricks[PIECE * piece..].iter();
            found.iter_mut().zip(bricks).for_each(|(found, brick)| *found = only(*brick));
        });
        found
    }

    /// Says anew how many voxels each class has.
    pub fn count(&mut self, voxels: impl Fn(u16) -> u64) {
        self.classes.iter_mut().for_each(|class| class.voxels = voxels(class.id));
    }

    /// The classes: as they were found in the order of their means, of a volume of another program in that of their ids.
    pub fn classes(&self) -> &[Class] {
        &self.classes
    }

    /// The class of an id.
    pub fn class(&self, id: u16) -> Option<&Class> {
        self.classes.iter().find(|c| c.id == id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Voxels;

    #[test]
    fn what_is_known_of_bricks_goes_along_with_what_changes() {
        let grid = Grid::with_spacing([19, 9, 17], [1.0; 3]).unwrap();
        let ids: Vec<u16> = (0..grid.len()).map(|voxel| u16::from(voxel % 19 > 16)).collect();
        let mut labels = Labels::new(grid.clone(), ids.into(), Vec::new()).unwrap();
        // A layer beyond a brick counts as its own.
        assert_eq!(labels.of_bricks()[..3], [Some(0), Some(0), None]);
        let at = |[x, y, z]: [usize; 3]| x + 19 * (y + 9 * z);
        for (blocks, voxel, id) in [
            (vec![10], [8, 8, 8], 5),
            (vec![10], [8, 8, 8], 0),
            (vec![13, 17], [18, 8, 16], 7),
            (vec![0], [0; 3], 2),
        ] {
            let changed = labels.change_blocks(&blocks, |ids| std::mem::replace(&mut ids[at(voxel)], id));
            assert_ne!(changed, id);
            let plain = Labels::new(grid.clone(), labels.ids().to_vec().into(), Vec::new()).unwrap();
            assert_eq!(labels.of_bricks(), plain.of_bricks(), "{voxel:?}");
            assert_eq!(labels, plain);
        }
        labels.ids_mut().fill(3);
        assert!(labels.of_bricks().iter().all(|only| *only == Some(3)));
    }

    #[test]
    fn a_volume_of_whole_numbers_is_labels_and_another_is_not() {
        let grid = Grid::with_spacing([2, 2, 1], [1.0; 3]).unwrap();
        let volume = |voxels: Vec<f32>, slope| {
            Volume::with_scale(grid.clone(), Voxels::from(voxels), slope, 0.0).unwrap()
        };
        let labels = Labels::from_volume(&volume(vec![0.0, 3.0, 0.5, 3.0], 2.0)).unwrap();
        assert_eq!(labels.ids(), [0, 6, 1, 6]);
        let classes: Vec<_> = labels.classes().iter().map(|c| (c.id, c.voxels)).collect();
        assert_eq!(classes, [(1, 1), (6, 2)]);
        for bad in [0.5, -1.0, 65536.0, f32::NAN] {
            let error = Labels::from_volume(&volume(vec![0.0, 1.0, bad, 0.0], 1.0)).unwrap_err().to_string();
            assert!(error.contains("voxel [0, 1, 0]"), "{error}");
        }
    }
}
