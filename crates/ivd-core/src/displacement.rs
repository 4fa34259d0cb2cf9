use std::ops::Range;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::{Buffer, Error, Grid, VoxelIndex, parallel};

/// Mark in [`FieldBricks::table`] of a brick that isn't stored: its vectors are 0.
pub const NO_BRICK: u32 = u32::MAX;

/// A sparse vector field on the voxels of a grid: bricks of [`FieldBricks::SIDE`]³ *voxels*; absent bricks are 0.
///
/// Brick `b` holds the voxels `[8b, 8b + 8)`; within a brick x is fastest. Voxels of a brick beyond the grid are 0.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldBricks {
    dims: [usize; 3],
    table: Vec<u32>,
    vectors: Buffer<[f32; 3]>,
}

impl FieldBricks {
    /// Voxels along a brick's edge.
    pub const SIDE: usize = 8;
    /// Voxels of a brick.
    pub const VOXELS: usize = 512;

    /// A field on a grid of `dims` voxels. `table` gives each brick's slot, or [`NO_BRICK`]; slots count up in the
    /// order of the table. `vectors` has shape `[slots, 8, 8, 8, 3]` (mm).
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where lengths or slots don't fit or a vector isn't finite.
    pub fn new(dims: [usize; 3], table: Vec<u32>, vectors: Buffer<[f32; 3]>) -> Result<Self, Error> {
        let bad = |problem: String| Error::Inconsistent { what: "displacement bricks", problem };
        let bricks = dims.map(|n| n.div_ceil(Self::SIDE));
        if table.len() != bricks.iter().product::<usize>() {
            return Err(bad(format!("a table of {} for {bricks:?} bricks", table.len())));
        }
        let mut next = 0;
        for &slot in &table {
            if slot != NO_BRICK {
                if slot != next {
                    return Err(bad(format!("slot {slot} where {next} was due")));
                }
                next += 1;
            }
        }
        if vectors.len() != next as usize * Self::VOXELS {
            return Err(bad(format!("{} vectors for {next} bricks", vectors.len())));
        }
        // Without an early end the compiler looks at several at a time.
        let finite = |values: &[f32]| values.iter().fold(true, |all, c| all & c.is_finite());
        let sound = vectors.as_flattened().chunks(1 << 12).all(finite);
        if !sound {
            let at = vectors.iter().position(|v| !v.iter().all(|c| c.is_finite())).unwrap_or_default();
            return Err(bad(format!("vector {at} is not finite")));
        }
        Ok(Self { dims, table, vectors })
    }

    /// A field that stores these bricks, ascending, whether anything moves in them or not.
    ///
    /// # Errors
    /// As [`FieldBricks::new`].
    ///
    /// # Panics
    /// Where there are fewer bricks.
    pub fn of_bricks(dims: [usize; 3], bricks: &[usize], vectors: Buffer<[f32; 3]>) -> Result<Self, Error> {
        let mut table = vec![NO_BRICK; dims.iter().map(|n| n.div_ceil(Self::SIDE)).product()];
        for (slot, &brick) in bricks.iter().enumerate() {
            table[brick] = slot as u32;
        }
        Self::new(dims, table, vectors)
    }

    /// A field that is 0 everywhere.
    pub fn zero(dims: [usize; 3]) -> Self {
        let bricks: usize = dims.iter().map(|n| n.div_ceil(Self::SIDE)).product();
        Self { dims, table: vec![NO_BRICK; bricks], vectors: Vec::new().into() }
    }

    /// Voxels of the grid.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Bricks along x, y, z.
    #[inline]
    pub fn brick_dims(&self) -> [usize; 3] {
        self.dims.map(|n| n.div_ceil(Self::SIDE))
    }

    /// Slot of each brick, x fastest.
    pub fn table(&self) -> &[u32] {
        &self.table
    }

    /// Vectors of the stored bricks (mm).
    pub fn vectors(&self) -> &[[f32; 3]] {
        &self.vectors
    }

    /// Length of the longest vector (mm).
    pub fn longest(&self) -> f64 {
        let square = |v: &[f32; 3]| Vector3::from(v.map(f64::from)).norm_squared();
        self.vectors.par_iter().map(square).reduce(|| 0.0, f64::max).sqrt()
    }

    /// The buffer behind [`FieldBricks::vectors`].
    pub fn buffer(&self) -> &Buffer<[f32; 3]> {
        &self.vectors
    }

    /// The same field with every vector times a factor.
    #[must_use]
    pub fn times(&self, factor: f32) -> Self {
        let vectors = self.vectors.iter().map(|v| v.map(|c| c * factor + 0.0)).collect();
        Self { vectors, ..self.clone() }
    }

    /// Number of stored bricks.
    pub fn stored(&self) -> usize {
        self.vectors.len() / Self::VOXELS
    }

    /// The vectors of a brick, where it is stored.
    #[inline]
    pub fn brick(&self, brick: usize) -> Option<&[[f32; 3]]> {
        let slot = self.table[brick];
        (slot != NO_BRICK).then(|| &self.vectors[slot as usize * Self::VOXELS..][..Self::VOXELS])
    }

    /// Refuses the field `a` beside `b`, which has so many voxels, unless they have as many along each axis.
    ///
    /// # Errors
    /// [`Error::GridMismatch`].
    pub fn require(&self, dims: [usize; 3], a: &'static str, b: &'static str) -> Result<(), Error> {
        if self.dims == dims {
            return Ok(());
        }
        Err(Error::GridMismatch { a, a_dims: self.dims, b, b_dims: dims })
    }

    /// The bricks, ascending, in which two fields on one grid differ by a bit; an absent brick is one of zeros.
    ///
    /// # Errors
    /// [`Error::GridMismatch`] where their grids differ.
    pub fn changed(&self, other: &Self) -> Result<Vec<usize>, Error> {
        self.require(other.dims, "field", "other field")?;
        let still = |vectors: &[[f32; 3]]| vectors.iter().flatten().all(|c| c.to_bits() == 0);
        let differs = |&brick: &usize| match (self.brick(brick), other.brick(brick)) {
            (None, None) => false,
            (Some(vectors), None) | (None, Some(vectors)) => !still(vectors),
            (Some(a), Some(b)) => {
                bytemuck::cast_slice::<_, u32>(a) != bytemuck::cast_slice::<[f32; 3], u32>(b)
            }
        };
        Ok((0..self.table.len()).filter(differs).collect())
    }

    /// The vector at a voxel (mm); 0 where its brick is absent.
    #[inline]
    pub fn at(&self, index: VoxelIndex) -> [f32; 3] {
        let [x, y, z] = index.0;
        let [bx, by, _] = self.brick_dims();
        match self.brick(x / 8 + bx * (y / 8 + by * (z / 8))) {
            Some(vectors) => vectors[x % 8 + 8 * (y % 8 + 8 * (z % 8))],
            None => [0.0; 3],
        }
    }

    /// The vector (mm) at a voxel coordinate, trilinear between voxels; outside the grid the nearest border voxel's.
    pub fn sample(&self, voxel: Vector3<f64>) -> Vector3<f64> {
        let mut base = [0_usize; 3];
        let mut frac = [0.0; 3];
        for a in 0..3 {
            let at = voxel[a].clamp(0.0, (self.dims[a] - 1) as f64);
            base[a] = (at as usize).min(self.dims[a].saturating_sub(2));
            frac[a] = at - base[a] as f64;
        }
        let mut sum = Vector3::zeros();
        for corner in 0..8_usize {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3).map(|a| if offset[a] == 1 { frac[a] } else { 1.0 - frac[a] }).product();
            if weight != 0.0 {
                let v = self.at(VoxelIndex(std::array::from_fn(|a| base[a] + offset[a])));
                sum += Vector3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2])) * weight;
            }
        }
        sum
    }
}

/// The bits of [`Displacement::sides`] that are of the voxel at rest, and those of where the deformed voxel comes from.
const REST_SIDE: u8 = 0b0011;
const ORIGIN_SIDE: u8 = 0b1100;

/// Whether flags differ in some bits of a mask; where there are none they are 0.
fn differ(a: &[u8], b: &[u8], voxels: Range<usize>, mask: u8) -> bool {
    // Without an early end the compiler looks at several at a time.
    match (a.get(voxels.clone()), b.get(voxels)) {
        (Some(a), Some(b)) => a.iter().zip(b).fold(0, |all, (a, b)| all | (a ^ b)) & mask != 0,
        (Some(flags), None) | (None, Some(flags)) => flags.iter().fold(0, |all, flag| all | flag) & mask != 0,
        (None, None) => false,
    }
}

/// A deformation of space, sampled on a grid, trilinear between voxels.
///
/// `forward` takes rest to deformed, `φ(x) = x + forward(x)`; `inverse` takes deformed to rest,
/// `ψ(y) = y + inverse(y)`, sampled at deformed positions. Vectors are world millimetres, RAS.
#[derive(Debug, Clone, PartialEq)]
pub struct Displacement {
    grid: Grid,
    time: f64,
    forward: FieldBricks,
    inverse: FieldBricks,
    inverse_residual_max: f64,
    min_det_j: f64,
    vacated: Buffer<u8>,
    sides: Buffer<u8>,
}

impl Displacement {
    /// A displacement on the grid whose voxels carry the vectors, at the time 0. Nothing is known yet of how well the fields agree
    /// ([`Displacement::inverse_residual_max`] is ∞) and of folds ([`Displacement::min_det_j`] is −∞); nothing is left behind or cut.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where a field doesn't lie on the grid.
    pub fn new(grid: Grid, forward: FieldBricks, inverse: FieldBricks) -> Result<Self, Error> {
        let n = grid.dims();
        if forward.dims() != n || inverse.dims() != n {
            let problem = format!("fields of {:?} and {:?} on {n:?}", forward.dims(), inverse.dims());
            return Err(Error::Inconsistent { what: "displacement", problem });
        }
        Ok(Self {
            grid,
            time: 0.0,
            forward,
            inverse,
            inverse_residual_max: f64::INFINITY,
            min_det_j: f64::NEG_INFINITY,
            vacated: Vec::new().into(),
            sides: Vec::new().into(),
        })
    }

    /// The displacement that moves nothing, at the time 0.
    pub fn identity(grid: Grid) -> Self {
        let still = FieldBricks::zero(grid.dims());
        Self {
            grid,
            time: 0.0,
            forward: still.clone(),
            inverse: still,
            inverse_residual_max: 0.0,
            min_det_j: 1.0,
            vacated: Vec::new().into(),
            sides: Vec::new().into(),
        }
    }

    /// At another time: see [`Displacement::time`].
    #[must_use]
    pub fn with_time(self, time: f64) -> Self {
        Self { time, ..self }
    }

    /// With what was measured: see [`Displacement::inverse_residual_max`].
    #[must_use]
    pub fn with_inverse_residual_max(self, inverse_residual_max: f64) -> Self {
        Self { inverse_residual_max, ..self }
    }

    /// With what was certified: see [`Displacement::min_det_j`].
    #[must_use]
    pub fn with_min_det_j(self, min_det_j: f64) -> Self {
        Self { min_det_j, ..self }
    }

    /// With what is left behind: see [`Displacement::vacated`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where there is neither one flag a voxel nor none at all.
    pub fn with_vacated(self, vacated: Buffer<u8>) -> Result<Self, Error> {
        self.check_length("vacated flags", &vacated)?;
        Ok(Self { vacated, ..self })
    }

    /// With a cut: see [`Displacement::sides`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where there is neither one a voxel nor none at all, or one names another side than 0, 1 and 2.
    pub fn with_sides(self, sides: Buffer<u8>) -> Result<Self, Error> {
        self.check_length("sides", &sides)?;
        if let Some(at) = sides.iter().position(|side| side & 3 == 3 || side >> 2 > 2) {
            let problem =
                format!("side {} at voxel {:?}; sides are 0, 1 and 2", sides[at], self.grid.index(at).0);
            return Err(Error::Inconsistent { what: "displacement", problem });
        }
        Ok(Self { sides, ..self })
    }

    fn check_length(&self, name: &str, flags: &[u8]) -> Result<(), Error> {
        if flags.is_empty() || flags.len() == self.grid.len() {
            return Ok(());
        }
        let problem = format!("{} {name} on {:?}", flags.len(), self.grid.dims());
        Err(Error::Inconsistent { what: "displacement", problem })
    }

    /// The grid whose voxels carry the vectors.
    #[inline]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Time of the frame (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Rest → deformed.
    #[inline]
    pub fn forward(&self) -> &FieldBricks {
        &self.forward
    }

    /// Deformed → rest.
    #[inline]
    pub fn inverse(&self) -> &FieldBricks {
        &self.inverse
    }

    /// Largest |φ(ψ(y)) − y| over the voxels of the inverse (voxels).
    pub fn inverse_residual_max(&self) -> f64 {
        self.inverse_residual_max
    }

    /// Smallest certified bound of det ∇φ.
    pub fn min_det_j(&self) -> f64 {
        self.min_det_j
    }

    /// Voxels whose label (deformed space) must become background: left behind by a part that moved alone, or opened by a cut.
    /// One flag a voxel of the grid, or empty where nothing is left.
    #[inline]
    pub fn vacated(&self) -> &[u8] {
        &self.vacated
    }

    /// Declares a cut, across which the field jumps; one a voxel of the grid, or empty where nothing is cut. The lowest two bits are
    /// of the voxel at rest: where the cut's sides move apart, and a voxel round that, the side that it is on, 1 below and 2 above,
    /// else 0. Between voxels of sides 1 and 2 `forward` means nothing; each side goes on from its own voxels, up to the cut. The next
    /// two bits are of the deformed voxel: the side that its origin is on, 0 where it has none or no side matters.
    #[inline]
    pub fn sides(&self) -> &[u8] {
        &self.sides
    }

    /// Whether nothing moves at all.
    pub fn is_identity(&self) -> bool {
        self.forward.stored() == 0 && self.inverse.stored() == 0
    }

    /// Whether a cut goes through it: see [`Displacement::sides`].
    pub fn has_cut(&self) -> bool {
        !self.sides.is_empty()
    }

    /// The bricks, ascending, whose deformed voxels may differ between two displacements on one grid: where the inverse fields differ by a
    /// bit, other voxels are left behind, or a voxel comes from another side of a cut; and where one comes from a side at all, if the
    /// cut goes another way at rest.
    ///
    /// # Errors
    /// [`Error::GridMismatch`] where their grids differ.
    pub fn changed(&self, before: &Self) -> Result<Vec<usize>, Error> {
        let mut changed = self.inverse.changed(&before.inverse)?;
        if [self, before].iter().all(|one| one.vacated.is_empty() && one.sides.is_empty()) {
            return Ok(changed);
        }
        changed.extend(self.flags_changed(before));
        changed.sort_unstable();
        changed.dedup();
        Ok(changed)
    }

    /// Whether something was left behind in a brick (indices of [`FieldBricks::brick_dims`]).
    pub fn leaves_behind(&self, brick: [usize; 3]) -> bool {
        self.rows_of(brick).any(|row| differ(&self.vacated, &[], row, u8::MAX))
    }

    /// The rows of voxels of a brick.
    fn rows_of(&self, brick: [usize; 3]) -> impl Iterator<Item = Range<usize>> {
        let dims = self.grid.dims();
        let [x, y, z] = std::array::from_fn(|a| {
            let first = FieldBricks::SIDE * brick[a];
            first..(first + FieldBricks::SIDE).min(dims[a])
        });
        z.flat_map(move |z| y.clone().map(move |y| dims[0] * (y + dims[1] * z)))
            .map(move |row| row + x.start..row + x.end)
    }

    /// The bricks in which a deformed voxel's flags say something else than before.
    fn flags_changed(&self, before: &Self) -> Vec<usize> {
        let ([nx, ny, nz], bricks) = (self.grid.dims(), self.inverse.brick_dims());
        let cut_elsewhere = differ(&self.sides, &before.sides, 0..self.grid.len(), REST_SIDE);
        let differs = |voxels: Range<usize>| {
            differ(&self.vacated, &before.vacated, voxels.clone(), u8::MAX)
                || differ(&self.sides, &before.sides, voxels.clone(), ORIGIN_SIDE)
                || cut_elsewhere && differ(&self.sides, &[], voxels, ORIGIN_SIDE)
        };
        let side = FieldBricks::SIDE;
        let of_layer = |bz: usize| {
            let layers = side * bz..(side * (bz + 1)).min(nz);
            if !differs(nx * ny * layers.start..nx * ny * layers.end) {
                return Vec::new();
            }
            let all = (0..bricks[1]).flat_map(|by| (0..bricks[0]).map(move |bx| [bx, by, bz]));
            let changed = all.filter(|brick| self.rows_of(*brick).any(&differs));
            changed.map(|[bx, by, bz]| bx + bricks[0] * (by + bricks[1] * bz)).collect()
        };
        let mut layers = vec![Vec::new(); bricks[2]];
        parallel::for_each_piece_mut(&mut layers, 1, &|bz, found| found[0] = of_layer(bz));
        layers.concat()
    }

    /// Whether a cut goes through the cell of eight voxels with this lowest corner; beyond the border the border voxels count.
    pub fn cell_is_cut(&self, cell: [i64; 3]) -> bool {
        if self.sides.is_empty() {
            return false;
        }
        let dims = self.grid.dims();
        let side = |corner: usize| {
            let at = std::array::from_fn(|a| {
                (cell[a] + (corner >> a & 1) as i64).clamp(0, dims[a] as i64 - 1) as usize
            });
            self.sides[self.grid.linear(VoxelIndex(at))] & 3
        };
        let has = |which| (0..8).any(|corner| side(corner) == which);
        has(1) && has(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_field_samples_like_a_dense_one() {
        let dims = [10, 9, 3];
        let mut table = vec![NO_BRICK; 4];
        table[1] = 0;
        table[2] = 1;
        let vectors: Vec<[f32; 3]> = (0..1024).map(|i| [i as f32, -(i as f32), 0.5]).collect();
        let field = FieldBricks::new(dims, table, vectors.into()).unwrap();
        assert_eq!(
            field.at(VoxelIndex([9, 2, 1])),
            [(1 + 8 * 2 + 64) as f32, -((1 + 8 * 2 + 64) as f32), 0.5]
        );
        assert_eq!(field.at(VoxelIndex([0, 0, 0])), [0.0; 3]);
        let mid = field.sample(Vector3::new(8.5, 2.0, 1.0));
        assert!((mid.x - 80.5).abs() < 1e-12);
        let edge = field.sample(Vector3::new(7.5, 2.0, 1.0));
        assert!((edge.z - 0.25).abs() < 1e-12, "half way into a stored brick");
    }

    #[test]
    fn bricks_that_differ_are_named() {
        let dims = [24, 8, 8];
        let zeros = vec![[0.0_f32; 3]; 512];
        let mut moved = zeros.clone();
        moved[511] = [0.0, 0.0, 1.0];
        let field = |table: [u32; 3], bricks: &[&Vec<[f32; 3]>]| {
            FieldBricks::new(
                dims,
                table.to_vec(),
                bricks.iter().flat_map(|b| b.iter().copied()).collect::<Vec<_>>().into(),
            )
            .unwrap()
        };
        let a = field([0, 1, NO_BRICK], &[&moved, &zeros]);
        let b = field([0, NO_BRICK, 1], &[&moved, &moved]);
        assert_eq!(a.changed(&b).unwrap(), [2], "a brick of zeros is an absent one");
        assert_eq!(a.changed(&FieldBricks::zero(dims)).unwrap(), [0]);
        assert_eq!(a.changed(&a).unwrap(), [0; 0]);
        assert!(a.changed(&FieldBricks::zero([8; 3])).is_err());
    }

    #[test]
    fn fields_of_another_grid_and_flags_that_do_not_fit_are_refused() {
        let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
        let still = || FieldBricks::zero([2, 1, 1]);
        assert!(Displacement::new(grid.clone(), still(), FieldBricks::zero([1, 2, 1])).is_err());
        let unknown = Displacement::new(grid.clone(), still(), still()).unwrap();
        assert_eq!((unknown.min_det_j(), unknown.inverse_residual_max()), (f64::NEG_INFINITY, f64::INFINITY));
        let moved = Displacement::identity(grid);
        assert!(moved.clone().with_vacated(vec![1].into()).is_err());
        assert!(moved.clone().with_sides(vec![1].into()).is_err());
        for bad in [3, 3 << 2] {
            let error = moved.clone().with_sides(vec![0, bad].into()).unwrap_err().to_string();
            assert!(error.contains("[1, 0, 0]"), "{error}");
        }
        let cut =
            moved.with_vacated(Vec::new().into()).unwrap().with_sides(vec![1, 2 | (2 << 2)].into()).unwrap();
        assert!(cut.cell_is_cut([0; 3]) && cut.has_cut() && cut.vacated().is_empty());
    }

    #[test]
    fn wrong_tables_are_refused() {
        assert!(FieldBricks::new([8, 8, 8], vec![1], vec![[0.0; 3]; 512].into()).is_err());
        assert!(FieldBricks::new([8, 8, 8], vec![0], vec![[0.0; 3]; 511].into()).is_err());
        assert!(FieldBricks::new([8, 8, 8], vec![0], vec![[f32::NAN; 3]; 512].into()).is_err());
    }
}
