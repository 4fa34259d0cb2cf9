//! How the classes of a cut come together, for drawing.

use ivd_core::{Exec, Tree, sets};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cut::{Classes, CutParams, classes_of};
use crate::Error;

/// The merges that a cut undid, between its classes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Dendrogram {
    /// The classes in the order of their ids.
    pub leaves: Vec<Leaf>,
    /// Two nodes and the height at which they join, ascending: nodes 0…K − 1 are the classes, node K + i is merge i.
    pub merges: Vec<(usize, usize, f64)>,
}

/// A class of a [`Dendrogram`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Leaf {
    /// Mean of its values.
    #[schemars(extend("x-unit" = "real units"))]
    pub mean: f64,
    /// Number of voxels.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels: u64,
}

/// The tree above a cut's classes; `None` where there are more than `most` of them.
///
/// # Errors
/// Those of [`cut`](super::cut()).
pub fn dendrogram(
    tree: &Tree,
    params: &CutParams,
    most: usize,
    exec: &Exec,
) -> Result<Option<Dendrogram>, Error> {
    exec.run(|| Ok(of(&classes_of(tree, params, exec)?, most)))
}

/// How the classes of a cut come together; `None` where there are more than `most` of them.
pub(super) fn of(found: &Classes, most: usize) -> Option<Dendrogram> {
    let count = found.list.len();
    if count > most {
        return None;
    }
    let mut parts = sets::singles(count);
    let mut top: Vec<usize> = (0..count).collect();
    let mut merges = Vec::with_capacity(found.undone.len());
    for undone in &found.undone {
        let [a, b] =
            undone.pair.map(|leaf| sets::root(&mut parts, u32::from(found.groups[leaf as usize - 1]) - 1));
        if a != b {
            merges.push((top[a as usize], top[b as usize], undone.height));
            sets::join(&mut parts, a, b);
            top[a.min(b) as usize] = count + merges.len() - 1;
        }
    }
    let leaves = found.list.iter().map(|c| Leaf { mean: c.mean, voxels: c.voxels }).collect();
    Some(Dendrogram { leaves, merges })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{HvsParams, region_tree};
    use ivd_core::{Grid, Linkage, Volume, Voxels};

    #[test]
    fn the_merges_of_a_row_come_in_the_order_of_their_steps() {
        let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from(vec![1_u8, 1, 5, 5, 20, 20])).unwrap();
        let exec = Exec::default();
        let params = HvsParams { linkage: Linkage::Single, ..HvsParams::default() };
        let tree = region_tree(&volume, None, &params, &exec).unwrap().tree;
        let cut = CutParams { k: 3, ..CutParams::default() };
        let found = dendrogram(&tree, &cut, 10, &exec).unwrap().unwrap();
        assert_eq!(found.merges, [(0, 1, 4.0), (3, 2, 15.0)]);
        assert_eq!(found.leaves.iter().map(|l| l.mean).collect::<Vec<_>>(), [1.0, 5.0, 20.0]);
        assert_eq!(dendrogram(&tree, &cut, 2, &exec).unwrap(), None);
    }
}
