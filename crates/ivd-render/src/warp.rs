use ivd_core::{BRICK, Displacement, FieldBricks, NO_BRICK};
use nalgebra::{Matrix3, Vector3};

use crate::cell::{Corners, between, slopes, turned};
use crate::cut::HalfSpace;
use crate::samples::{Place, Shape};

/// Room for the rounding of `f32` positions (voxels).
const PAD: f64 = 1e-2;

/// A displacement made ready for sampling: where a place of the deformed volume was before, `ψ(y) = y + v(y)`, in voxel coordinates.
pub(crate) struct Warp<'a> {
    inverse: &'a FieldBricks,
    vacated: &'a [u8],
    shape: Shape,
    to_voxel: Matrix3<f64>,
    /// Its rows.
    rows: [[f32; 3]; 3],
    /// For each brick of cells: whether its samples may come from elsewhere.
    moved: Vec<bool>,
    /// What is shown, by where it was before.
    cuts: Vec<RestCut>,
}

/// A half space that is shown, for samples by where they were before.
struct RestCut {
    /// Rise of the height with a voxel along each axis (mm), and that of voxel 0.
    along: [f32; 3],
    offset: f32,
}

impl RestCut {
    #[inline(always)]
    fn height(&self, [x, y, z]: [f32; 3]) -> f32 {
        self.along[0] * x + self.along[1] * y + self.along[2] * z + self.offset
    }
}

impl<'a> Warp<'a> {
    /// `to_voxel`: the grid's world-to-voxel matrix.
    pub(crate) fn new(displacement: &'a Displacement, to_voxel: Matrix3<f64>) -> Self {
        let shape = Shape::new(displacement.inverse().dims());
        let bricks = displacement.inverse().brick_dims();
        let mut moved = vec![false; bricks.iter().product()];
        let table = displacement.inverse().table();
        for (b, moved) in moved.iter_mut().enumerate() {
            *moved = beside(bricks, b).any(|voxel_brick| table[voxel_brick] != NO_BRICK);
        }
        let vacated = displacement.vacated();
        for i in (0..vacated.len()).filter(|&i| vacated[i] != 0) {
            let voxel = displacement.grid().index(i).0;
            // A voxel on a brick's low side is nearest to samples of the brick below as well.
            for corner in 0..8_usize {
                let at: [usize; 3] =
                    std::array::from_fn(|a| voxel[a].saturating_sub(corner >> a & 1) / BRICK);
                moved[at[0] + bricks[0] * (at[1] + bricks[1] * at[2])] = true;
            }
        }
        let rows = std::array::from_fn(|r| std::array::from_fn(|c| to_voxel[(r, c)] as f32));
        Self { inverse: displacement.inverse(), vacated, shape, to_voxel, rows, moved, cuts: Vec::new() }
    }

    /// The same, of which samples are hidden that were outside of half spaces before.
    pub(crate) fn with_cuts(mut self, cuts: &[HalfSpace]) -> Self {
        let bricks = self.inverse.brick_dims();
        for (b, moved) in self.moved.iter_mut().enumerate() {
            let at = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
            let corner = |corner: usize| {
                let side = |a: usize| if corner >> a & 1 == 1 { BRICK as f64 + 1.0 } else { -1.0 };
                Vector3::from_fn(|a, _| (at[a] * BRICK) as f64 + side(a))
            };
            *moved |= cuts.iter().any(|cut| (0..8).any(|i| cut.height(corner(i)) < 0.0));
        }
        let rest = |cut: &HalfSpace| RestCut {
            along: std::array::from_fn(|a| cut.along[a] as f32),
            offset: cut.height(Vector3::zeros()) as f32,
        };
        self.cuts = cuts.iter().map(rest).collect();
        self
    }

    /// Whether samples are hidden by where they were before.
    pub(crate) fn is_cut(&self) -> bool {
        !self.cuts.is_empty()
    }

    /// Whether a place that was at `before` is hidden.
    #[inline(always)]
    pub(crate) fn hides(&self, before: [f32; 3]) -> bool {
        self.cuts.iter().any(|cut| cut.height(before) < 0.0)
    }

    /// Rise per voxel into what is shown, where a place was within `depth` (mm) of a cut: of the nearest.
    #[inline(always)]
    pub(crate) fn rise_behind_cut(&self, before: [f32; 3], depth: f32) -> Option<[f32; 3]> {
        let heights = self.cuts.iter().map(|cut| (cut.height(before), cut.along));
        heights
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(height, _)| *height < depth)
            .map(|(_, along)| along)
    }

    /// Whether samples of a brick may come from elsewhere, or are hidden. Elsewhere the map is the identity, exactly.
    #[inline(always)]
    pub(crate) fn moves(&self, brick: usize) -> bool {
        self.moved[brick]
    }

    /// Where the place `at` was before; `None` where it was outside the volume or is hidden, or is vacated.
    #[inline(always)]
    pub(crate) fn before(&self, at: [f32; 3]) -> Option<[f32; 3]> {
        self.source(at).filter(|&before| !self.hides(before))
    }

    /// The same of what is hidden as well.
    #[inline(always)]
    pub(crate) fn source(&self, at: [f32; 3]) -> Option<[f32; 3]> {
        let place = self.shape.place(at);
        if self.is_vacated(&place) {
            return None;
        }
        let shift = turned(&self.rows, between(&self.corners(place.cell()), place.within()));
        let before = std::array::from_fn(|a| at[a] + shift[a]);
        self.shape.holds(before).then_some(before)
    }

    /// Whether the voxel nearest to a place is left behind.
    #[inline(always)]
    pub(crate) fn is_vacated(&self, place: &Place) -> bool {
        !self.vacated.is_empty() && self.vacated[self.shape.nearest(place)] != 0
    }

    /// Whether any voxel is left behind.
    pub(crate) fn vacates(&self) -> bool {
        !self.vacated.is_empty()
    }

    /// Gradient of the deformed volume at `at` from that of the undeformed one at `ψ(at)`, both per voxel: `(∇ψ)ᵀ ∇f = J⁻ᵀ ∇f`, with the derivatives
    /// of the displacement in its own cell.
    #[inline(always)]
    pub(crate) fn pull_back(&self, at: [f32; 3], gradient: [f32; 3]) -> [f32; 3] {
        let place = self.shape.place(at);
        let slopes =
            slopes(&self.corners(place.cell()), place.within()).map(|slope| turned(&self.rows, slope));
        std::array::from_fn(|a| {
            let [x, y, z] = slopes[a];
            gradient[a] + (x * gradient[0] + y * gradient[1] + z * gradient[2])
        })
    }

    /// The stored vectors (mm) at the corners of a cell.
    #[inline(always)]
    pub(crate) fn corners(&self, cell: [usize; 3]) -> Corners {
        let bricks = self.inverse.brick_dims();
        let (table, vectors) = (self.inverse.table(), self.inverse.vectors());
        let slot =
            |[x, y, z]: [usize; 3]| table[x / BRICK + bricks[0] * (y / BRICK + bricks[1] * (z / BRICK))];
        let within = |[x, y, z]: [usize; 3]| x % BRICK + BRICK * (y % BRICK + BRICK * (z % BRICK));
        let far: [usize; 3] = std::array::from_fn(|a| (cell[a] + 1).min(self.shape.dims[a] - 1));
        if (0..3).all(|a| cell[a] / BRICK == far[a] / BRICK) {
            let slot = slot(cell);
            if slot == NO_BRICK {
                return [[0.0; 3]; 8];
            }
            let all = &vectors[slot as usize * FieldBricks::VOXELS..][..FieldBricks::VOXELS];
            return std::array::from_fn(|i| all[within(corner(cell, far, i))]);
        }
        std::array::from_fn(|i| {
            let at = corner(cell, far, i);
            match slot(at) {
                NO_BRICK => [0.0; 3],
                slot => vectors[slot as usize * FieldBricks::VOXELS + within(at)],
            }
        })
    }

    /// For every brick whether its samples may come from elsewhere.
    pub(crate) fn all_moves(&self) -> &[bool] {
        &self.moved
    }

    /// Rows of the world-to-voxel matrix.
    pub(crate) fn rows(&self) -> &[[f32; 3]; 3] {
        &self.rows
    }

    /// Bricks of the undeformed volume that samples of `brick` can come from, as inclusive ranges along each axis. `None`
    /// where all come from outside the volume.
    pub(crate) fn sources(&self, brick: usize) -> Option<[[usize; 2]; 3]> {
        let bricks = self.inverse.brick_dims();
        let at = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
        let [low, high] = self.shifts(brick);
        let mut ranges = [[0; 2]; 3];
        for a in 0..3 {
            let top = (self.shape.dims[a] - 1) as f64;
            let from = (at[a] * BRICK) as f64 - if at[a] == 0 { 0.5 } else { 0.0 } + low[a] - PAD;
            let to = (at[a] * BRICK + BRICK) as f64 + 0.5 + high[a] + PAD;
            if to < -0.5 || from > top + 0.5 {
                return None;
            }
            let brick_of = |x: f64| ((x.clamp(0.0, top) as usize) / BRICK).min(bricks[a] - 1);
            ranges[a] = [brick_of(from), brick_of(to)];
        }
        Some(ranges)
    }

    /// The same without room for rounding: a brick of which nothing comes from elsewhere comes from itself alone.
    pub(crate) fn nearest_sources(&self, brick: usize) -> Option<[[usize; 2]; 3]> {
        let bricks = self.inverse.brick_dims();
        let at = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
        let [low, high] = self.shifts(brick);
        let mut ranges = [[0; 2]; 3];
        for a in 0..3 {
            let (from, to) = ((at[a] * BRICK) as f64 + low[a], ((at[a] + 1) * BRICK) as f64 + high[a]);
            let end = (bricks[a] * BRICK) as f64;
            if to <= 0.0 || from >= end {
                return None;
            }
            let first = (from.max(0.0) as usize) / BRICK;
            ranges[a] = [first, (to.min(end).ceil() as usize).div_ceil(BRICK).max(first + 1) - 1];
        }
        Some(ranges)
    }

    /// The least and the greatest displacement of samples of a brick, 0 among them (voxels).
    fn shifts(&self, brick: usize) -> [Vector3<f64>; 2] {
        let (mut low, mut high) = (Vector3::zeros(), Vector3::zeros());
        for vectors in beside(self.inverse.brick_dims(), brick).filter_map(|b| self.inverse.brick(b)) {
            for v in vectors {
                let shift = self.to_voxel * Vector3::from(v.map(f64::from));
                low = low.inf(&shift);
                high = high.sup(&shift);
            }
        }
        [low, high]
    }
}

/// Voxel of a cell's corner.
#[inline(always)]
fn corner(cell: [usize; 3], far: [usize; 3], i: usize) -> [usize; 3] {
    std::array::from_fn(|a| if i >> a & 1 == 1 { far[a] } else { cell[a] })
}

/// The bricks of voxels that the cells of a brick touch: itself and those above it along each axis.
fn beside(bricks: [usize; 3], brick: usize) -> impl Iterator<Item = usize> {
    let at = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
    (0..8_usize).filter_map(move |corner| {
        let there: [usize; 3] = std::array::from_fn(|a| at[a] + (corner >> a & 1));
        (0..3).all(|a| there[a] < bricks[a]).then(|| there[0] + bricks[0] * (there[1] + bricks[1] * there[2]))
    })
}
