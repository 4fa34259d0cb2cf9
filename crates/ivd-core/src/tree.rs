use std::ops::Deref;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Buffer, Error, Grid, sets};

/// How unlike two neighbouring parts of a volume are taken to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Linkage {
    /// What merging them adds to the sum of squared deviations from the means (real units²; Ward 1963).
    #[default]
    Ward,
    /// The smallest difference of two neighbouring voxels, one on either side (real units): the minimum spanning tree.
    Single,
}

impl Linkage {
    /// Name as in a scene: `ward` or `single`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ward => "ward",
            Self::Single => "single",
        }
    }
}

/// Means of a tree's leaves, in the smallest type that holds them exactly.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum LeafMeans {
    F32(Buffer<f32>),
    F64(Buffer<f64>),
}

impl LeafMeans {
    /// Number of means.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The mean of the leaf `index + 1`.
    #[inline]
    pub fn get(&self, index: usize) -> f64 {
        match self {
            Self::F32(values) => f64::from(values[index]),
            Self::F64(values) => values[index],
        }
    }
}

/// The merges of a tree by themselves: who joined whom, and at what height.
#[derive(Debug, Clone, Copy)]
pub struct Merged<'a> {
    /// How heights were measured.
    pub linkage: Linkage,
    /// See [`TreeParts::merges`].
    pub merges: &'a [[u32; 2]],
    /// See [`TreeParts::heights`].
    pub heights: &'a [f64],
    /// See [`TreeParts::ends`].
    pub ends: &'a [u32],
}

impl Merged<'_> {
    /// Height of a merge.
    ///
    /// # Panics
    /// Where there is no such merge.
    pub fn height(&self, merge: usize) -> f64 {
        self.heights[self.ends.partition_point(|end| *end as usize <= merge)]
    }

    /// Number of merges at or below a height.
    pub fn up_to(&self, height: f64) -> usize {
        let steps = self.heights.partition_point(|h| *h <= height);
        steps.checked_sub(1).map_or(0, |last| self.ends[last] as usize)
    }
}

/// A binary tree of merges over the voxels of a grid: who joined whom, and at what height. Every cut of it is a partition of
/// the volume into connected parts.
///
/// A leaf is a connected set of voxels. With L leaves there are L − 1 merges, ascending in height; a merge names one leaf on
/// either side of the border that it removes, so a union of the leaves of the first merges gives the parts after them, and
/// leaving single merges out cuts the volume exactly there. Parts that touch nowhere (islands between missing data) are joined
/// by the last [`TreeParts::bridges`] merges.
///
/// Its parts are read as fields; they fit together, and can't be changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree(TreeParts);

/// What a [`Tree`] is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeParts {
    /// Where the voxels lie.
    pub grid: Grid,
    /// How heights were measured.
    pub linkage: Linkage,
    /// Leaf of a voxel, 1…L; 0 is no data. Linear, x fastest.
    pub leaves: Buffer<u32>,
    /// The two leaves of each merge, 1…L, shape `[L − 1, 2]`.
    pub merges: Buffer<[u32; 2]>,
    /// The heights that occur, strictly ascending (real units for [`Linkage::Single`], real units² for [`Linkage::Ward`]).
    pub heights: Buffer<f64>,
    /// `ends[i]` merges lie at or below `heights[i]`; ascending, the last is L − 1.
    pub ends: Buffer<u32>,
    /// Voxels of each leaf, shape `[L]`.
    pub counts: Buffer<u32>,
    /// Mean of each leaf (real units), shape `[L]`.
    pub means: LeafMeans,
    /// Sum of squared deviations from the leaf's mean (real units²), shape `[L]`; `None` where every leaf has one value.
    pub squares: Option<Buffer<f64>>,
    /// Merges, at the end, of parts that don't touch.
    pub bridges: u32,
}

impl Deref for Tree {
    type Target = TreeParts;

    fn deref(&self) -> &TreeParts {
        &self.0
    }
}

impl Tree {
    /// The tree of these parts: it can be cut without a bound check failing.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first thing that doesn't fit.
    pub fn new(parts: TreeParts) -> Result<Self, Error> {
        match parts.problem() {
            None => Ok(Self(parts)),
            Some(problem) => Err(Error::Inconsistent { what: "tree", problem }),
        }
    }

    /// The tree of parts that fit together by the way they were made. Looking whether they do takes 4 bytes a leaf, which is not
    /// always to be had; debug builds look.
    pub fn of_sound(parts: TreeParts) -> Self {
        debug_assert_eq!(parts.problem(), None, "the parts fit together");
        Self(parts)
    }

    /// Its merges.
    pub fn merged(&self) -> Merged<'_> {
        Merged { linkage: self.linkage, merges: &self.merges, heights: &self.heights, ends: &self.ends }
    }

    /// Number of leaves L.
    pub fn leaf_count(&self) -> usize {
        self.counts.len()
    }

    /// Number of nodes: the leaves and the merges.
    pub fn nodes(&self) -> usize {
        self.counts.len() + self.merges.len()
    }

    /// Height of a merge.
    ///
    /// # Panics
    /// Where there is no such merge.
    pub fn height(&self, merge: usize) -> f64 {
        self.merged().height(merge)
    }

    /// Number of merges at or below a height.
    pub fn merges_up_to(&self, height: f64) -> usize {
        self.merged().up_to(height)
    }

    /// Smallest and largest height, where there are merges.
    pub fn height_range(&self) -> Option<[f64; 2]> {
        Some([*self.heights.first()?, *self.heights.last()?])
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> u64 {
        let means = match &self.means {
            LeafMeans::F32(values) => size_of_val(values.as_slice()),
            LeafMeans::F64(values) => size_of_val(values.as_slice()),
        };
        let rest = self.leaves.as_bytes().len()
            + self.merges.as_bytes().len()
            + self.heights.as_bytes().len()
            + self.ends.as_bytes().len()
            + self.counts.as_bytes().len()
            + self.squares.as_ref().map_or(0, |s| s.as_bytes().len());
        (rest + means) as u64
    }

    /// Parent of each node: nodes 0…L − 1 are the leaves 1…L, node L + i is merge i, and the root (the last node) is its own.
    pub fn parents(&self) -> Vec<u32> {
        let leaves = self.leaf_count();
        let mut parents: Vec<u32> = (0..self.nodes() as u32).collect();
        let mut parts = sets::singles(leaves);
        // The node that stands for a part, at its root.
        let mut top = parts.clone();
        for (i, pair) in self.merges.iter().enumerate() {
            let [a, b] = pair.map(|leaf| sets::root(&mut parts, leaf - 1));
            let node = (leaves + i) as u32;
            parents[top[a as usize] as usize] = node;
            parents[top[b as usize] as usize] = node;
            let (low, high) = (a.min(b), a.max(b));
            parts[high as usize] = low;
            top[low as usize] = node;
        }
        parents
    }
}

impl TreeParts {
    /// The first thing that doesn't fit.
    fn problem(&self) -> Option<String> {
        let (leaves, merges) = (self.counts.len(), self.merges.len());
        let lengths = self.leaves.len() == self.grid.len()
            && self.means.len() == leaves
            && self.squares.as_ref().is_none_or(|s| s.len() == leaves)
            && self.heights.len() == self.ends.len()
            && merges == leaves.saturating_sub(1)
            && self.bridges as usize <= merges;
        if !lengths {
            return Some(format!("{leaves} leaves and {merges} merges, and other lengths don't fit to them"));
        }
        let rising =
            self.heights.windows(2).all(|w| w[0] < w[1]) && self.ends.windows(2).all(|w| w[0] < w[1]);
        let bounded = self.heights.iter().all(|h| h.is_finite() && *h >= 0.0);
        if !rising || !bounded || self.ends.last().copied().unwrap_or(0) as usize != merges {
            return Some("its heights don't ascend from 0, or don't cover the merges".to_owned());
        }
        if self.ends.first() == Some(&0) {
            return Some("a height without a merge".to_owned());
        }
        self.problem_of_leaves().or_else(|| self.problem_of_merges())
    }

    fn problem_of_leaves(&self) -> Option<String> {
        let leaves = self.counts.len();
        let mut counts = vec![0_u32; leaves];
        for &leaf in self.leaves.iter().filter(|leaf| **leaf > 0) {
            match counts.get_mut(leaf as usize - 1) {
                Some(count) => *count += 1,
                None => return Some(format!("a voxel of leaf {leaf} of {leaves}")),
            }
        }
        if let Some(at) = (0..leaves).find(|&i| counts[i] != self.counts[i] || counts[i] == 0) {
            return Some(format!("leaf {} has {} voxels, not {}", at + 1, counts[at], self.counts[at]));
        }
        let deviation = |i: usize| self.squares.as_ref().map_or(0.0, |s| s[i]);
        let odd = (0..leaves)
            .find(|&i| !self.means.get(i).is_finite() || !deviation(i).is_finite() || deviation(i) < 0.0);
        odd.map(|at| format!("leaf {} has no finite mean and spread", at + 1))
    }

    fn problem_of_merges(&self) -> Option<String> {
        let leaves = self.counts.len() as u32;
        let mut parts = sets::singles(leaves as usize);
        for (i, pair) in self.merges.iter().enumerate() {
            if pair.iter().any(|leaf| *leaf == 0 || *leaf > leaves) {
                return Some(format!("merge {i} names the leaves {pair:?} of {leaves}"));
            }
            if !sets::join(&mut parts, pair[0] - 1, pair[1] - 1) {
                return Some(format!("merge {i} joins the leaves {pair:?}, which were joined before"));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four leaves in a row, merged as ((1 2) (3 4)).
    fn parts() -> TreeParts {
        TreeParts {
            grid: Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap(),
            linkage: Linkage::Single,
            leaves: vec![1, 1, 2, 0, 3, 4].into(),
            merges: vec![[1, 2], [4, 3], [2, 3]].into(),
            heights: vec![1.0, 2.5].into(),
            ends: vec![2, 3].into(),
            counts: vec![2, 1, 1, 1].into(),
            means: LeafMeans::F32(vec![0.0, 1.0, 5.0, 4.0].into()),
            squares: None,
            bridges: 1,
        }
    }

    #[test]
    fn parents_and_heights_follow_from_the_merges() {
        let tree = Tree::new(parts()).unwrap();
        assert_eq!(tree.parents(), [4, 4, 5, 5, 6, 6, 6]);
        assert_eq!([0, 1, 2].map(|i| tree.height(i)), [1.0, 1.0, 2.5]);
        assert_eq!([0.5, 1.0, 2.0, 3.0].map(|h| tree.merges_up_to(h)), [0, 2, 2, 3]);
        assert_eq!(tree.height_range(), Some([1.0, 2.5]));
        assert_eq!(tree.nodes(), 7);
    }

    #[test]
    fn what_is_no_tree_is_refused_by_name() {
        let refused = |change: &dyn Fn(&mut TreeParts), part: &str| {
            let mut parts = parts();
            change(&mut parts);
            let error = Tree::new(parts).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        refused(&|t| t.merges = vec![[1, 2], [2, 1], [2, 3]].into(), "joined before");
        refused(&|t| t.merges = vec![[1, 2], [4, 5], [2, 3]].into(), "names the leaves");
        refused(&|t| t.merges = vec![[1, 2]].into(), "lengths");
        refused(&|t| t.heights = vec![2.5, 1.0].into(), "ascend");
        refused(&|t| t.heights = vec![1.0, f64::INFINITY].into(), "ascend");
        refused(&|t| t.ends = vec![2, 4].into(), "cover");
        refused(&|t| t.ends = vec![0, 3].into(), "without a merge");
        refused(&|t| t.leaves = vec![1, 1, 2, 0, 3, 5].into(), "leaf 5 of 4");
        refused(&|t| t.counts = vec![1, 1, 1, 1].into(), "leaf 1 has 2 voxels");
        refused(&|t| t.squares = Some(vec![0.0, f64::NAN, 0.0, 0.0].into()), "leaf 2");
        refused(&|t| t.bridges = 9, "lengths");
    }

    #[test]
    fn a_tree_of_nothing_and_of_one_leaf_are_trees() {
        let mut parts = parts();
        parts.leaves = vec![0; 6].into();
        parts.merges = Vec::new().into();
        (parts.heights, parts.ends, parts.bridges) = (Vec::new().into(), Vec::new().into(), 0);
        (parts.counts, parts.means) = (Vec::new().into(), LeafMeans::F64(Vec::new().into()));
        let tree = Tree::new(parts.clone()).unwrap();
        assert_eq!((tree.height_range(), tree.parents()), (None, vec![]));
        parts.leaves = vec![1; 6].into();
        (parts.counts, parts.means) = (vec![6].into(), LeafMeans::F64(vec![0.1].into()));
        assert_eq!(Tree::new(parts).unwrap().parents(), [0]);
    }
}
