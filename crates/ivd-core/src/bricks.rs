use crate::{Buffer, Error, Exec, Grid, Kernel, Scalar, Voxels, parallel, with_voxels};

/// Cells along a brick's edge. A brick of cells `[8b, 8b + 8)` spans the voxels `8b ..= 8b + 8`.
pub const BRICK: usize = 8;

/// What a brick's voxels hold, in stored values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrickRange {
    /// Smallest stored value, rounded down to `f32`; `+inf` where the brick holds no data.
    pub min: f32,
    /// Largest stored value, rounded up to `f32`; `-inf` where the brick holds no data.
    pub max: f32,
    /// Whether some voxel is no data.
    pub missing: bool,
}

/// Min–max of the stored values by brick of [`BRICK`]³ *cells*: the range of brick `b` covers the voxels
/// `8b ..= 8b + 8`, so it bounds every trilinear sample in its cells. The ranges are conservative for types that
/// `f32` can't hold exactly.
///
/// There are `ceil(n / 8)` bricks along an axis of `n` voxels; brick `(x, y, z)` is at `x + bx * (y + by * z)`.
#[derive(Debug, Clone, PartialEq)]
pub struct BrickIndex {
    dims: [usize; 3],
    min: Buffer<f32>,
    max: Buffer<f32>,
    missing: Buffer<u8>,
}

impl BrickIndex {
    /// Number of bricks along each axis of a grid of `dims` voxels.
    pub fn dims_for(dims: [usize; 3]) -> [usize; 3] {
        dims.map(|n| n.div_ceil(BRICK))
    }

    /// The index over `voxels` on `grid`, one pass, parallel over layers of bricks.
    pub fn build(grid: &Grid, voxels: &Voxels) -> Self {
        let dims = Self::dims_for(grid.dims());
        let ranges: Vec<BrickRange> = with_voxels!(voxels, slice => {
            parallel::map(dims[2], &|bz| layer(grid.dims(), dims, slice, bz)).concat()
        });
        Self {
            dims,
            min: ranges.iter().map(|r| r.min).collect::<Vec<_>>().into(),
            max: ranges.iter().map(|r| r.max).collect::<Vec<_>>().into(),
            missing: ranges.iter().map(|r| u8::from(r.missing)).collect::<Vec<_>>().into(),
        }
    }

    /// Finds the ranges anew of bricks in which voxels changed, given as blocks of [`BRICK`]³ *voxels* (linear, as bricks are): a block's
    /// voxels lie in its own brick, and those on its low sides in the bricks below as well. Others are left as they are.
    ///
    /// # Panics
    /// A block that the grid doesn't have, or other voxels than the index was made for.
    pub fn update(&mut self, grid: &Grid, voxels: &Voxels, blocks: &[usize]) {
        let dims = self.dims;
        let mut touched = Vec::with_capacity(2 * blocks.len());
        for &block in blocks {
            let at = [block % dims[0], block / dims[0] % dims[1], block / (dims[0] * dims[1])];
            touched.extend((0..8_usize).filter_map(|side| {
                let below: Option<Vec<usize>> = (0..3).map(|a| at[a].checked_sub(side >> a & 1)).collect();
                below.map(|b| b[0] + dims[0] * (b[1] + dims[1] * b[2]))
            }));
        }
        touched.sort_unstable();
        touched.dedup();
        let ranges = with_voxels!(voxels, slice => {
            parallel::map(touched.len(), &|i| one(grid.dims(), dims, slice, touched[i]))
        });
        let (min, max, missing) = (self.min.make_mut(), self.max.make_mut(), self.missing.make_mut());
        for (brick, range) in touched.into_iter().zip(ranges) {
            (min[brick], max[brick], missing[brick]) = (range.min, range.max, u8::from(range.missing));
        }
    }

    /// An index from its stored parts, each of length `dims[0] * dims[1] * dims[2]`; `None` where they differ.
    pub fn from_parts(
        dims: [usize; 3],
        min: Buffer<f32>,
        max: Buffer<f32>,
        missing: Buffer<u8>,
    ) -> Option<Self> {
        let len = dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d))?;
        (min.len() == len && max.len() == len && missing.len() == len).then_some(Self {
            dims,
            min,
            max,
            missing,
        })
    }

    /// Bricks along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.min.len()
    }

    /// Whether there is no brick (never, for an index over a grid).
    pub fn is_empty(&self) -> bool {
        self.min.is_empty()
    }

    /// Range of the brick at a linear brick index.
    #[inline]
    pub fn range(&self, brick: usize) -> BrickRange {
        BrickRange { min: self.min[brick], max: self.max[brick], missing: self.missing[brick] != 0 }
    }

    /// The stored parts: minima, maxima, flags of missing data.
    pub fn parts(&self) -> (&Buffer<f32>, &Buffer<f32>, &Buffer<u8>) {
        (&self.min, &self.max, &self.missing)
    }

    /// Range of all voxels; `None` where none holds data.
    pub fn total(&self) -> Option<(f32, f32)> {
        let lo = self.min.iter().copied().fold(f32::INFINITY, f32::min);
        let hi = self.max.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        (lo <= hi).then_some((lo, hi))
    }
}

/// The pass that makes an index.
pub struct BrickRanges;

impl Kernel for BrickRanges {
    const NAME: &'static str = "volume/ranges";
    type Args<'a> = (&'a Grid, &'a Voxels);
    type Out = BrickIndex;
    type Error = Error;

    fn on_processor((grid, voxels): &(&Grid, &Voxels), _: &Exec) -> Result<BrickIndex, Error> {
        Ok(BrickIndex::build(grid, voxels))
    }
}

/// Ranges of the bricks of layer `bz`: voxels are first merged along y and z, element by element, in the order in which they
/// lie in memory and so that the compiler vectorises it; the merged rows are then cut into bricks.
fn layer<T: Scalar>(n: [usize; 3], b: [usize; 3], voxels: &[T], bz: usize) -> Vec<BrickRange> {
    let mut rows = vec![Merged::<T>::new(n[0]); b[1]];
    for z in bz * BRICK..(bz * BRICK + BRICK + 1).min(n[2]) {
        for (by, merged) in rows.iter_mut().enumerate() {
            // A row on a brick's border belongs to both bricks.
            let [start, end] = [by * BRICK, (by * BRICK + BRICK + 1).min(n[1])];
            merged.add(&voxels[n[0] * (start + n[1] * z)..n[0] * (end + n[1] * z)]);
        }
    }
    let ranges = rows
        .iter()
        .flat_map(|row| (0..b[0]).map(|bx| row.range(bx * BRICK..(bx * BRICK + BRICK + 1).min(n[0]))));
    ranges.collect()
}

/// Range of one brick.
fn one<T: Scalar>(n: [usize; 3], b: [usize; 3], voxels: &[T], brick: usize) -> BrickRange {
    let at = [brick % b[0], brick / b[0] % b[1], brick / (b[0] * b[1])];
    let [x, y, z] = [0, 1, 2].map(|a| at[a] * BRICK..(at[a] * BRICK + BRICK + 1).min(n[a]));
    let mut merged = Merged::<T>::new(x.len());
    for z in z {
        for y in y.clone() {
            merged.add(&voxels[n[0] * (y + n[1] * z)..][x.clone()]);
        }
    }
    merged.range(0..x.len())
}

/// Extremes of several rows of voxels, element by element.
#[derive(Debug, Clone)]
struct Merged<T> {
    min: Vec<T>,
    max: Vec<T>,
    /// Not 0 where a voxel was no data. Of the voxels' own type, so that all three are vectors of one width.
    missing: Vec<T>,
}

impl<T: Scalar> Merged<T> {
    /// Nothing merged yet.
    fn new(len: usize) -> Self {
        Self {
            min: vec![T::from_f64(f64::INFINITY); len],
            max: vec![T::from_f64(f64::NEG_INFINITY); len],
            missing: vec![T::default(); len],
        }
    }

    /// Merges rows of voxels that follow each other, 64 bytes at a time: the extremes of so many stay in vector registers.
    fn add(&mut self, rows: &[T]) {
        match size_of::<T>() {
            1 => self.add_by::<64>(rows),
            2 => self.add_by::<32>(rows),
            4 => self.add_by::<16>(rows),
            _ => self.add_by::<8>(rows),
        }
    }

    fn add_by<const N: usize>(&mut self, rows: &[T]) {
        let len = self.min.len();
        if len < N {
            (0..len).for_each(|start| self.add_lanes::<1>(rows, start));
            return;
        }
        // What is merged twice stays as it is, so that the last lanes may begin within those before.
        for start in (0..len - N).step_by(N).chain([len - N]) {
            self.add_lanes::<N>(rows, start);
        }
    }

    /// The same for `N` elements from `start` on.
    #[inline(always)]
    fn add_lanes<const N: usize>(&mut self, rows: &[T], start: usize) {
        let (high, low, one) = (T::from_f64(f64::INFINITY), T::from_f64(f64::NEG_INFINITY), T::from_f64(1.0));
        let len = self.min.len();
        let [mut min, mut max, mut missing] = [[high; N], [low; N], [T::default(); N]];
        for row in rows.chunks_exact(len) {
            let values = &row[start..start + N];
            for i in 0..N {
                let value = values[i];
                let data = value.is_data();
                let (below, above) = if data { (value, value) } else { (high, low) };
                min[i] = if below < min[i] { below } else { min[i] };
                max[i] = if above > max[i] { above } else { max[i] };
                missing[i] = if data { missing[i] } else { one };
            }
        }
        let range = start..start + N;
        let merged = self.min[range.clone()].iter_mut().zip(&mut self.max[range.clone()]);
        for (i, ((least, greatest), gap)) in merged.zip(&mut self.missing[range]).enumerate() {
            *least = if min[i] < *least { min[i] } else { *least };
            *greatest = if max[i] > *greatest { max[i] } else { *greatest };
            *gap = if missing[i] > *gap { missing[i] } else { *gap };
        }
    }

    /// Range of a stretch of the merged rows.
    fn range(&self, of: std::ops::Range<usize>) -> BrickRange {
        let min = self.min[of.clone()].iter().map(|v| v.to_f64()).fold(f64::INFINITY, f64::min);
        let max = self.max[of.clone()].iter().map(|v| v.to_f64()).fold(f64::NEG_INFINITY, f64::max);
        let missing = self.missing[of].iter().any(|v| *v != T::default());
        BrickRange { min: f32_below(min), max: f32_above(max), missing }
    }
}

fn f32_below(value: f64) -> f32 {
    // −0 is 0: which of them comes first in a brick says nothing.
    let near = value as f32 + 0.0;
    if f64::from(near) > value { near.next_down() } else { near }
}

fn f32_above(value: f64) -> f32 {
    let near = value as f32 + 0.0;
    if f64::from(near) < value { near.next_up() } else { near }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each brick's range against one found voxel by voxel.
    fn assert_ranges<T: Scalar>(dims: [usize; 3], value: impl Fn(usize) -> T)
    where
        Voxels: From<Vec<T>>,
    {
        let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
        let values: Vec<T> = (0..grid.len()).map(value).collect();
        let index = BrickIndex::build(&grid, &Voxels::from(values.clone()));
        let bricks = BrickIndex::dims_for(dims);
        assert_eq!(index.dims(), bricks);
        for b in 0..index.len() {
            let at = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
            let (mut lo, mut hi, mut missing) = (f64::INFINITY, f64::NEG_INFINITY, false);
            for i in 0..grid.len() {
                let v = grid.index(i).0;
                if (0..3).all(|a| v[a] >= 8 * at[a] && v[a] <= 8 * at[a] + 8) {
                    if values[i].is_data() {
                        lo = lo.min(values[i].to_f64());
                        hi = hi.max(values[i].to_f64());
                    } else {
                        missing = true;
                    }
                }
            }
            let expected = BrickRange { min: f32_below(lo), max: f32_above(hi), missing };
            assert_eq!(index.range(b), expected, "{dims:?}, brick {b} of {:?}", T::TYPE);
        }
    }

    #[test]
    fn an_index_that_is_updated_is_the_one_that_is_built() {
        for dims in [[19, 17, 9], [64, 3, 2], [8, 8, 8], [9, 25, 16]] {
            let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
            let mut values: Vec<f32> = (0..grid.len()).map(|i| ((i * 7919) % 1013) as f32).collect();
            let mut index = BrickIndex::build(&grid, &Voxels::from(values.clone()));
            let mut blocks = Vec::new();
            for change in 0..7_usize {
                let at = (change * 104_729) % grid.len();
                let value = [-5.0, 2000.0, f32::NAN, 0.0][change % 4];
                values[at] = value;
                let block = grid.index(at).0.map(|c| c / BRICK);
                let bricks = BrickIndex::dims_for(dims);
                blocks.push(block[0] + bricks[0] * (block[1] + bricks[1] * block[2]));
            }
            let voxels = Voxels::from(values);
            index.update(&grid, &voxels, &blocks);
            assert_eq!(index, BrickIndex::build(&grid, &voxels), "{dims:?}");
        }
    }

    #[test]
    fn ranges_equal_a_plain_scan_with_the_high_side_apron() {
        // Rows shorter than the lanes merged at a time, as long, and longer by less and by more than half.
        for dims in [[19, 17, 9], [64, 3, 2], [70, 9, 3], [150, 9, 10]] {
            let value = |i: usize| (i * 7919 + i / 31 * 13) % 1013;
            assert_ranges(dims, |i| (value(i) % 251) as u8);
            assert_ranges(dims, |i| (value(i) % 251) as i8);
            assert_ranges(dims, |i| (value(i) * 60) as u16);
            assert_ranges(dims, |i| value(i) as i16 - 500);
            assert_ranges(dims, |i| value(i) as u32);
            assert_ranges(dims, |i| value(i) as i32 - 500);
            for gap in [5, 40, dims[0] - 1] {
                let gaps = |i: usize| if i % dims[0] == gap { f64::NAN } else { value(i) as f64 - 500.0 };
                assert_ranges(dims, |i| gaps(i) as f32);
                assert_ranges(dims, gaps);
            }
        }
    }

    #[test]
    fn integers_have_the_ranges_of_the_same_numbers_in_floating_point() {
        let grid = Grid::with_spacing([21, 8, 17], [1.0; 3]).unwrap();
        let values = |i: usize| (i * 7919 + i / 31) % 251;
        let bytes: Vec<u8> = (0..grid.len()).map(|i| values(i) as u8).collect();
        let floats: Vec<f32> = bytes.iter().map(|&v| f32::from(v)).collect();
        let shorts: Vec<i16> = bytes.iter().map(|&v| i16::from(v)).collect();
        let expected = BrickIndex::build(&grid, &Voxels::from(floats));
        assert_eq!(BrickIndex::build(&grid, &Voxels::from(bytes)), expected);
        assert_eq!(BrickIndex::build(&grid, &Voxels::from(shorts)), expected);
    }

    #[test]
    fn a_brick_without_data_has_an_empty_range() {
        let grid = Grid::with_spacing([9, 1, 1], [1.0; 3]).unwrap();
        let index = BrickIndex::build(&grid, &Voxels::from(vec![f32::NAN; 9]));
        assert_eq!(index.range(0), BrickRange { min: f32::INFINITY, max: f32::NEG_INFINITY, missing: true });
        assert_eq!(index.total(), None);
    }

    #[test]
    fn ranges_of_wide_types_are_conservative() {
        let grid = Grid::with_spacing([2, 1, 1], [1.0; 3]).unwrap();
        let index = BrickIndex::build(&grid, &Voxels::from(vec![16_777_217_i32, 16_777_219]));
        let range = index.range(0);
        assert!(f64::from(range.min) <= 16_777_217.0 && f64::from(range.max) >= 16_777_219.0);
    }
}
