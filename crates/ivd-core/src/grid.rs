use std::ops::{Range, RangeInclusive};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::{Error, GridError};

/// Integer index of a voxel, `[x, y, z]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct VoxelIndex(pub [usize; 3]);

/// Continuous voxel coordinate; a voxel's centre has integer coordinates, the volume's first voxel spans −0.5…0.5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelCoord(pub Vector3<f64>);

/// Position in world space (mm), RAS.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct World(pub Vector3<f64>);

impl From<VoxelIndex> for VoxelCoord {
    fn from(index: VoxelIndex) -> Self {
        let [x, y, z] = index.0;
        Self(Vector3::new(x as f64, y as f64, z as f64))
    }
}

/// A regular grid of voxels in world space.
///
/// `world = origin + direction · (spacing ∘ voxel)`. The columns of `direction` are unit vectors in RAS; they are
/// orthogonal in nearly every scan, but a sheared affine (a tilted gantry) is kept, not straightened.
/// Grids are equal where their voxels are, whatever is known of the patient.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Grid {
    dims: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    /// Column `a` is the world direction of voxel axis `a`.
    direction: [[f64; 3]; 3],
    reference: Reference,
}

/// What is known of world space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// Not even that its axes are the patient's.
    Unknown,
    /// That its axes are the patient's.
    #[default]
    Patient,
    /// That it is another scan's, to which this one was aligned.
    Aligned,
    /// That of Talairach's atlas.
    Talairach,
    /// That of the mean brain MNI 152.
    Mni,
    /// That of another template.
    Template,
}

impl Reference {
    /// As it is written: whether world space is the patient's, where that isn't known, and what else is known. Of what is the rule nothing is.
    pub fn written(self) -> (Option<bool>, Option<Self>) {
        match self {
            Self::Unknown => (Some(false), None),
            Self::Patient => (None, None),
            other => (None, Some(other)),
        }
    }

    /// What is known by what was [written](Self::written).
    pub fn of_written(in_patient: Option<bool>, reference: Option<Self>) -> Self {
        if in_patient == Some(false) { Self::Unknown } else { reference.unwrap_or_default() }
    }
}

impl PartialEq for Grid {
    fn eq(&self, other: &Self) -> bool {
        let places = |grid: &Self| (grid.dims, grid.spacing, grid.origin, grid.direction);
        places(self) == places(other)
    }
}

/// A grid as it is written, before its parts are checked.
#[derive(Serialize, Deserialize)]
struct Written {
    dims: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    direction: [[f64; 3]; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    in_patient: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reference: Option<Reference>,
}

impl From<Grid> for Written {
    fn from(grid: Grid) -> Self {
        let (in_patient, reference) = grid.reference.written();
        let Grid { dims, spacing, origin, direction, .. } = grid;
        Self { dims, spacing, origin, direction, in_patient, reference }
    }
}

impl TryFrom<Written> for Grid {
    type Error = GridError;
    fn try_from(grid: Written) -> Result<Self, GridError> {
        let Written { dims, spacing, origin, direction, in_patient, reference } = grid;
        let reference = Reference::of_written(in_patient, reference);
        Ok(Self::new(dims, spacing, origin, direction)?.with_reference(reference))
    }
}

/// Spacings that a grid may have (mm), from far below an atom to beyond the planets. Within them the volume of a voxel,
/// squares of distances in single precision and the inverse of the affine are numbers.
const SPACINGS: RangeInclusive<f64> = 1e-12..=1e12;
/// Largest coordinate of an origin (mm).
const FURTHEST: f64 = 1e15;

impl Grid {
    /// A grid of `dims` voxels.
    ///
    /// - `spacing`: distance of voxel centres along each axis (mm), 1e-12 to 1e12.
    /// - `origin`: world position of the centre of voxel (0, 0, 0) (mm), RAS, at most 1e15 from 0 along each axis.
    /// - `direction`: column `a` is the unit world direction of voxel axis `a`; `direction[a]` is that column.
    ///
    /// # Errors
    /// [`GridError`] names the part that is out of its domain.
    pub fn new(
        dims: [usize; 3],
        spacing: [f64; 3],
        origin: [f64; 3],
        direction: [[f64; 3]; 3],
    ) -> Result<Self, GridError> {
        let voxels = dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
        // Room for any voxel type and for the padded grid of the lattice's element keys.
        if dims.contains(&0) || voxels.is_none_or(|n| n > (isize::MAX as usize) / 64) {
            return Err(GridError::Dims(dims));
        }
        if !spacing.iter().all(|s| SPACINGS.contains(s)) {
            return Err(GridError::Spacing(spacing));
        }
        if !origin.iter().all(|o| o.abs() <= FURTHEST) {
            return Err(GridError::Origin(origin));
        }
        let matrix = Matrix3::from_columns(&direction.map(Vector3::from));
        let unit = matrix.column_iter().all(|c| (c.norm() - 1.0).abs() < 1e-3);
        if !unit || matrix.determinant().abs() < 1e-3 {
            return Err(GridError::Direction(direction));
        }
        Ok(Self { dims, spacing, origin, direction, reference: Reference::Patient })
    }

    /// An axis-aligned grid: voxel axes along RAS, origin at 0.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn with_spacing(dims: [usize; 3], spacing: [f64; 3]) -> Result<Self, GridError> {
        Self::new(dims, spacing, [0.0; 3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    }

    /// A grid from a voxel-to-world affine given by its linear part (columns) and translation (mm), RAS.
    ///
    /// # Errors
    /// As [`Grid::new`]; a zero column is a bad spacing.
    pub fn from_affine(
        dims: [usize; 3],
        linear: Matrix3<f64>,
        translation: Vector3<f64>,
    ) -> Result<Self, GridError> {
        let spacing: [f64; 3] = std::array::from_fn(|a| linear.column(a).norm());
        if !spacing.iter().all(|s| s.is_finite() && *s > 0.0) {
            return Err(GridError::Spacing(spacing));
        }
        let direction = std::array::from_fn(|a| (linear.column(a) / spacing[a]).into());
        Self::new(dims, spacing, translation.into(), direction)
    }

    /// The same, known to lie in the patient's space or not.
    #[must_use]
    pub fn with_patient_space(self, in_patient: bool) -> Self {
        match (in_patient, self.reference) {
            (false, _) => self.with_reference(Reference::Unknown),
            (true, Reference::Unknown) => self.with_reference(Reference::Patient),
            (true, _) => self,
        }
    }

    /// The same, with what is known of world space.
    #[must_use]
    pub fn with_reference(self, reference: Reference) -> Self {
        Self { reference, ..self }
    }

    /// What is known of world space; a file that is written of it says the same, where its format can.
    pub fn reference(&self) -> Reference {
        self.reference
    }

    /// Whether the axes of world space are known to be the patient's: to the right, to the front, to the head. Where a file doesn't say so,
    /// pictures have no letters. Grids [match](Self::matches) whether or not they say so.
    pub fn in_patient(&self) -> bool {
        self.reference != Reference::Unknown
    }

    /// Voxels along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Distance of voxel centres along each axis (mm).
    pub fn spacing(&self) -> [f64; 3] {
        self.spacing
    }

    /// World position of voxel (0, 0, 0) (mm), RAS.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Unit world directions of the voxel axes; `direction()[a]` is that of axis `a`.
    pub fn direction(&self) -> [[f64; 3]; 3] {
        self.direction
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// A grid always holds at least one voxel.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Linear index of a voxel, x fastest.
    #[inline]
    pub fn linear(&self, index: VoxelIndex) -> usize {
        let [x, y, z] = index.0;
        debug_assert!(x < self.dims[0] && y < self.dims[1] && z < self.dims[2]);
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    /// The voxel at a linear index.
    #[inline]
    pub fn index(&self, linear: usize) -> VoxelIndex {
        let [nx, ny, _] = self.dims;
        VoxelIndex([linear % nx, linear / nx % ny, linear / (nx * ny)])
    }

    /// Linear part of the voxel-to-world affine: column `a` is `spacing[a] * direction[a]`.
    pub fn linear_part(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&std::array::from_fn::<_, 3, _>(|a| {
            Vector3::from(self.direction[a]) * self.spacing[a]
        }))
    }

    /// Inverse of [`Grid::linear_part`]: world displacement (mm) to voxel displacement.
    pub fn inverse_linear_part(&self) -> Matrix3<f64> {
        self.linear_part().try_inverse().expect("checked in Grid::new: the direction is invertible")
    }

    /// How far a ball goes along each of the voxel axes, from its middle (voxels): it is the image of the unit ball, so that its extent
    /// along an axis is the norm of the matrix's row.
    ///
    /// - `radius`: (mm).
    pub fn ball_extent(&self, radius: f64) -> [f64; 3] {
        let to_voxel = self.inverse_linear_part();
        std::array::from_fn(|a| radius * to_voxel.row(a).norm())
    }

    /// The voxel at a place, unless that is beyond the grid.
    pub fn voxel_at(&self, at: [i64; 3]) -> Option<VoxelIndex> {
        let there = (0..3).all(|a| (0..self.dims()[a] as i64).contains(&at[a]));
        there.then(|| VoxelIndex(at.map(|c| c as usize)))
    }

    /// The voxel nearest to a voxel coordinate, unless that is beyond the grid.
    pub fn nearest_voxel(&self, voxel: Vector3<f64>) -> Option<VoxelIndex> {
        self.voxel_at(voxel.map(|c| c.round() as i64).into())
    }

    /// The voxels of the box round a ball.
    ///
    /// - `centre`: relative to the grid's origin; `radius`: (mm).
    pub fn voxels_of_ball(&self, centre: Vector3<f64>, radius: f64) -> [Range<usize>; 3] {
        let (at, extent) = (self.inverse_linear_part() * centre, self.ball_extent(radius));
        std::array::from_fn(|a| {
            let top = |v: f64| v.clamp(0.0, self.dims()[a] as f64) as usize;
            let low = top((at[a] - extent[a]).floor());
            low..top((at[a] + extent[a]).ceil() + 1.0).max(low)
        })
    }

    /// The bricks of 8³ voxels that balls may meet, ascending.
    ///
    /// - `balls`: centres, relative to the grid's origin, and radii (mm).
    pub fn bricks_of_balls(&self, balls: impl Iterator<Item = (Vector3<f64>, f64)>) -> Vec<usize> {
        let bricks = self.dims().map(|n| n.div_ceil(8));
        let mut hit = vec![false; bricks.iter().product()];
        let half = 3.5 * self.voxel_diagonal();
        for (centre, radius) in balls {
            let (lo, hi) = self.brick_range(centre, radius);
            for bz in lo[2]..hi[2] {
                for by in lo[1]..hi[1] {
                    for bx in lo[0]..hi[0] {
                        let middle =
                            Vector3::new(bx as f64, by as f64, bz as f64) * 8.0 + Vector3::repeat(3.5);
                        if (self.linear_part() * middle - centre).norm() <= radius + half {
                            hit[bx + bricks[0] * (by + bricks[1] * bz)] = true;
                        }
                    }
                }
            }
        }
        (0..hit.len()).filter(|&b| hit[b]).collect()
    }

    /// Bricks that the box round a ball spans, half open.
    fn brick_range(&self, centre: Vector3<f64>, radius: f64) -> ([usize; 3], [usize; 3]) {
        let at = self.inverse_linear_part() * centre;
        let extent = self.ball_extent(radius);
        let (mut lo, mut hi) = ([0; 3], [0; 3]);
        for a in 0..3 {
            let top = self.dims()[a].div_ceil(8) as f64;
            lo[a] = ((at[a] - extent[a]) / 8.0).floor().clamp(0.0, top) as usize;
            hi[a] = (((at[a] + extent[a]) / 8.0).floor() + 1.0).clamp(0.0, top) as usize;
        }
        (lo, hi)
    }

    /// World position (mm) of a voxel coordinate.
    pub fn world(&self, voxel: VoxelCoord) -> World {
        World(Vector3::from(self.origin) + self.linear_part() * voxel.0)
    }

    /// Voxel coordinate of a world position (mm).
    pub fn voxel(&self, world: World) -> VoxelCoord {
        VoxelCoord(self.inverse_linear_part() * (world.0 - Vector3::from(self.origin)))
    }

    /// The box in world space (mm) round the voxels, to their outer faces: its least and greatest coordinates.
    pub fn extent(&self) -> [[f64; 3]; 2] {
        self.extent_of(self.dims.map(|n| [-0.5, n as f64 - 0.5]))
    }

    /// The box in world space (mm) round a box of voxel coordinates: its least and greatest coordinates.
    ///
    /// - `faces`: where the box begins and ends along each voxel axis.
    pub fn extent_of(&self, faces: [[f64; 2]; 3]) -> [[f64; 3]; 2] {
        let corner =
            |corner: usize| self.world(VoxelCoord(Vector3::from_fn(|a, _| faces[a][corner >> a & 1]))).0;
        let first = corner(0);
        let both = (1..8).map(corner).fold([first, first], |[low, high], p| [low.inf(&p), high.sup(&p)]);
        both.map(Into::into)
    }

    /// What to say of a place (mm) that lies outside of the voxels: where they are, and the place with x, y or both of the other sign where that
    /// lies inside, which is how it is written in LPS. `None` of a place inside.
    pub fn told_outside(&self, place: [f64; 3]) -> Option<String> {
        let inside = |place: [f64; 3]| self.nearest_voxel(self.voxel(World(place.into())).0).is_some();
        if inside(place) {
            return None;
        }
        let [low, high] = self.extent();
        let spans: [String; 3] =
            std::array::from_fn(|a| format!("{} {:.1} to {:.1}", ["x", "y", "z"][a], low[a], high[a]));
        let [x, y, z] = place;
        let mirrored = [[-x, -y, z], [-x, y, z], [x, -y, z]].into_iter().find(|place| inside(*place));
        let meant = mirrored.map_or_else(String::new, |[x, y, z]| {
            let taken = if self.in_patient() { "" } else { ", as which this file is taken, that doesn't say where the patient lies" };
            format!("; did you mean x = {x}, y = {y}, z = {z}? Places are in RAS: x and y have the other sign in LPS{taken}")
        });
        Some(format!("the volume spans {} mm{meant}", spans.join(", ")))
    }

    /// Voxels along a cell's edges: at most eight, powers of two, about as long (mm) along every axis.
    ///
    /// - `edge`: along the shortest voxels; without it four, eight where voxels are as long as that along another axis, since cells that are
    ///   finer one way than they can be the other cost much and tell nothing; and fewer where a ball of radius `least` (mm) would have less
    ///   than a dozen cells across.
    pub fn cell_steps(&self, edge: Option<u8>, least: f64) -> [usize; 3] {
        let shortest = self.shortest_edge();
        let usual = || (4.0 * shortest).max(self.longest_edge()).min(least / 6.0);
        let length = edge.map_or_else(usual, |edge| f64::from(edge) * shortest);
        self.spacing().map(|h| [8, 4, 2].into_iter().find(|s| *s as f64 * h <= 1.001 * length).unwrap_or(1))
    }

    /// Length of a voxel's diagonal (mm) (the longest one, where the grid is sheared).
    pub fn voxel_diagonal(&self) -> f64 {
        let m = self.linear_part();
        [[1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]]
            .iter()
            .map(|&d| (m * Vector3::from(d)).norm())
            .fold(0.0, f64::max)
    }

    /// Length of a voxel's shortest edge (mm).
    pub fn shortest_edge(&self) -> f64 {
        self.spacing.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Length of a voxel's longest edge (mm).
    pub fn longest_edge(&self) -> f64 {
        self.spacing.into_iter().fold(0.0, f64::max)
    }

    /// Volume of one voxel (mm³).
    pub fn voxel_volume(&self) -> f64 {
        self.linear_part().determinant().abs()
    }

    /// Whether two grids place their voxels alike: same dims, and no corner further apart than 1e-3 of a voxel.
    pub fn matches(&self, other: &Self) -> bool {
        if self.dims != other.dims {
            return false;
        }
        let tolerance = 1e-3 * self.shortest_edge();
        (0..8_usize).all(|corner| {
            let at = VoxelCoord(Vector3::from_fn(|a, _| {
                if corner >> a & 1 == 1 { (self.dims[a] - 1) as f64 } else { 0.0 }
            }));
            (self.world(at).0 - other.world(at).0).norm() <= tolerance
        })
    }

    /// Refuses `b`, which lies on `other`, beside `a`, which lies on this grid, unless the two grids match.
    ///
    /// # Errors
    /// [`Error::GridMismatch`].
    pub fn require(&self, other: &Self, a: &'static str, b: &'static str) -> Result<(), Error> {
        if self.matches(other) {
            return Ok(());
        }
        Err(Error::GridMismatch { a, a_dims: self.dims, b, b_dims: other.dims })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_about_as_long_along_every_axis() {
        let steps = |spacing: [f64; 3], edge, least| {
            Grid::with_spacing([64; 3], spacing).unwrap().cell_steps(edge, least)
        };
        assert_eq!(steps([1.0; 3], None, 100.0), [4; 3]);
        assert_eq!(steps([1.0; 3], None, 12.0), [2; 3]);
        assert_eq!(steps([1.0; 3], Some(4), 12.0), [4; 3]);
        assert_eq!(steps([0.5, 0.5, 2.0], None, 100.0), [4, 4, 1]);
        assert_eq!(steps([0.5, 0.5, 1.0], None, 100.0), [4, 4, 2]);
        // Slices far apart: cells as long as these, unless a ball is small.
        assert_eq!(steps([0.43, 0.43, 6.5], None, 100.0), [8, 8, 1]);
        assert_eq!(steps([0.43, 0.43, 6.5], None, 12.0), [4, 4, 1]);
        assert_eq!(steps([0.43, 0.43, 6.5], Some(4), 100.0), [4, 4, 1]);
    }

    #[test]
    fn what_is_known_of_the_patient_is_written_only_where_it_is_not_the_rule() {
        let known = Grid::with_spacing([2; 3], [1.0; 3]).unwrap();
        let unknown = known.clone().with_patient_space(false);
        let mean = known.clone().with_reference(Reference::Mni).with_patient_space(true);
        assert!(
            known.in_patient() && !unknown.in_patient() && known.matches(&unknown) && known.matches(&mean)
        );
        assert_eq!(known, unknown);
        for grid in [&known, &unknown, &mean] {
            let written = serde_json::to_string(grid).unwrap();
            assert_eq!(written.contains("in_patient"), !grid.in_patient());
            assert_eq!(written.contains("reference"), grid.reference() == Reference::Mni);
            let read: Grid = serde_json::from_str(&written).unwrap();
            assert_eq!((&read, read.reference()), (grid, grid.reference()));
        }
    }

    #[test]
    fn world_and_voxel_are_inverse_on_an_oblique_left_handed_grid() {
        let (s, c) = 0.27_f64.sin_cos();
        let grid = Grid::new(
            [5, 6, 7],
            [0.4, 0.5, 6.5],
            [1e6, -20.0, 3.0],
            [[-c, -s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]],
        )
        .unwrap();
        let v = VoxelCoord(Vector3::new(1.25, 4.0, 5.5));
        assert!((grid.voxel(grid.world(v)).0 - v.0).norm() < 1e-8);
        assert_eq!(grid.world(VoxelCoord(Vector3::zeros())).0.x, 1e6);
        let rebuilt = Grid::from_affine([5, 6, 7], grid.linear_part(), Vector3::from(grid.origin())).unwrap();
        assert!(grid.matches(&rebuilt));
    }

    #[test]
    fn a_place_outside_is_told_with_the_one_that_may_be_meant() {
        // As a file without a space is taken: LPS, so that RAS has it on the other side of 0.
        let lps = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
        let grid = Grid::new([10, 20, 30], [1.0; 3], [0.0; 3], lps).unwrap().with_patient_space(false);
        assert_eq!(grid.extent(), [[-9.5, -19.5, -0.5], [0.5, 0.5, 29.5]]);
        assert_eq!(grid.told_outside([-4.0, -12.0, 3.0]), None);
        let told = grid.told_outside([4.0, 12.0, 3.0]).unwrap();
        assert!(told.contains("x -9.5 to 0.5, y -19.5 to 0.5, z -0.5 to 29.5 mm"), "{told}");
        assert!(told.contains("x = -4, y = -12, z = 3?") && told.contains("doesn't say"), "{told}");
        assert!(grid.told_outside([-4.0, 12.0, 3.0]).unwrap().contains("x = -4, y = -12, z = 3?"));
        let far = grid.told_outside([4.0, 12.0, 40.0]).unwrap();
        assert!(!far.contains("did you mean") && far.contains("spans"), "{far}");
        let stated = grid.with_patient_space(true).told_outside([4.0, 12.0, 3.0]).unwrap();
        assert!(stated.contains("x = -4") && !stated.contains("doesn't say"), "{stated}");
    }

    #[test]
    fn linear_index_round_trips() {
        let grid = Grid::with_spacing([3, 4, 5], [1.0; 3]).unwrap();
        for i in 0..grid.len() {
            assert_eq!(grid.linear(grid.index(i)), i);
        }
        assert_eq!(grid.linear(VoxelIndex([1, 0, 0])), 1, "x is fastest");
    }

    #[test]
    fn the_smallest_and_the_largest_spacing_can_be_inverted_and_beyond_them_is_no_grid() {
        for spacing in [[1e-12; 3], [1e12; 3], [1e-12, 1e12, 1.0]] {
            let grid = Grid::with_spacing([2; 3], spacing).unwrap();
            assert!((grid.inverse_linear_part() * grid.linear_part() - Matrix3::identity()).amax() < 1e-9);
            assert!(grid.voxel_volume() > 0.0 && grid.voxel_diagonal().is_finite());
        }
        // Their product is 0 or infinite: the affine has no inverse.
        for spacing in [[1e-120; 3], [1e120; 3], [5e-324, 1.0, 1.0]] {
            assert!(matches!(Grid::with_spacing([2; 3], spacing), Err(GridError::Spacing(_))), "{spacing:?}");
        }
    }

    #[test]
    fn impossible_grids_are_refused_by_part() {
        let id = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(matches!(Grid::with_spacing([0, 1, 1], [1.0; 3]), Err(GridError::Dims(_))));
        assert!(matches!(Grid::with_spacing([usize::MAX, 2, 1], [1.0; 3]), Err(GridError::Dims(_))));
        assert!(matches!(Grid::with_spacing([1, 1, 1], [1.0, -1.0, 1.0]), Err(GridError::Spacing(_))));
        for far in [f64::NAN, f64::INFINITY, 1e300] {
            assert!(matches!(Grid::new([1; 3], [1.0; 3], [0.0, far, 0.0], id), Err(GridError::Origin(_))));
        }
        let flat = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(matches!(Grid::new([1; 3], [1.0; 3], [0.0; 3], flat), Err(GridError::Direction(_))));
    }

    #[test]
    fn grids_that_do_not_match_are_refused_by_the_names_of_what_lies_on_them() {
        let grid = |dims| Grid::with_spacing(dims, [0.5, 1.0, 4.0]).unwrap();
        let (a, b) = (grid([4, 3, 2]), grid([4, 3, 3]));
        assert_eq!(
            (a.require(&a.clone(), "volume", "labels"), a.shortest_edge(), a.longest_edge()),
            (Ok(()), 0.5, 4.0)
        );
        let said = a.require(&b, "volume", "labels").unwrap_err().to_string();
        assert!(
            said.starts_with("volume ([4, 3, 2]) and labels ([4, 3, 3]) lie on different grids")
                && !said.contains("--grid-of"),
            "{said}"
        );
        let wrong = Grid::with_spacing([4, 3, 2], [1.0; 3]).unwrap();
        let said = a.require(&wrong, "volume", "labels").unwrap_err().to_string();
        assert!(said.contains("axes differ") && said.contains("--grid-of"), "{said}");
    }
}
