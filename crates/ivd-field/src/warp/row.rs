//! Eight voxels of a row at a time, linear: what [`Source::sample`](super::sample::Source::sample) does, in lanes.
//!
//! Each lane does the operations of the plain path in their order, so that both give the same bytes. A lane that needs more than
//! eight voxels of data leaves its voxel to the plain path and says so. The compiler makes vectors of the loops; with AVX2 four lanes
//! at a time.
//!
//! The argument for the `unsafe` block: it calls a function that is safe but for the processor that it needs, and only where that
//! processor is there.

use ivd_core::{Grid, Scalar};

use super::sample::{SNAP, Source};

/// Voxels of a row: those of a brick.
pub(super) const LANES: usize = 8;

/// 1.5 · 2⁵²: a sum with it has no bits after the point.
const SHIFT: f64 = 6_755_399_441_055_744.0;

/// What rows are read from.
pub(super) struct Rows<'a, T> {
    source: &'a Source<'a, T>,
    /// From world vectors to voxels.
    to_voxel: [[f64; 3]; 3],
    /// Above what coordinates a voxel's neighbours may be beyond the last.
    most: [f64; 3],
    avx2: bool,
}

impl<'a, T: Scalar> Rows<'a, T> {
    /// Rows of `source`, on `grid`. `native`: whether AVX2 may be used where it is there.
    pub(super) fn new(source: &'a Source<'a, T>, grid: &Grid, native: bool) -> Self {
        let to_voxel = grid.inverse_linear_part();
        let avx2 = native && ivd_core::has_avx2();
        Self {
            most: source.dims.map(|n| n as f64 - (1.0 + 2.0 * SNAP)),
            to_voxel: [0, 1, 2].map(|a| [0, 1, 2].map(|b| to_voxel[(a, b)])),
            source,
            avx2,
        }
    }

    /// Rows of the matrix from world vectors to voxels, and above what coordinate along each axis there is no room.
    pub(super) fn frame(&self) -> ([[f64; 3]; 3], [f64; 3]) {
        (self.to_voxel, self.most)
    }

    /// All voxels of the source.
    pub(super) fn voxels(&self) -> &'a [T] {
        self.source.voxels
    }

    /// Fills a row that begins at voxel `start`: those voxels whose vectors aren't 0, the others as they are in `from`. Returns a
    /// bit for each that moves, and for each of these that is left to the plain path.
    pub(super) fn fill(
        &self,
        start: [usize; 3],
        vectors: &[[f32; 3]; LANES],
        from: &[T; LANES],
        out: &mut [T; LANES],
    ) -> [u8; 2] {
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            return unsafe { self.fill_avx2(start, vectors, from, out) };
        }
        self.fill_any(start, vectors, from, out)
    }

    /// Where voxel `i` of a row that begins at `start` comes from, by its vector.
    pub(super) fn place(&self, start: [usize; 3], i: usize, vector: [f32; 3]) -> [f64; 3] {
        let [u, v, w] = vector.map(f64::from);
        std::array::from_fn(|a| {
            let [p, q, r] = self.to_voxel[a];
            (start[a] + if a == 0 { i } else { 0 }) as f64 + (p * u + q * v + r * w)
        })
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(
        &self,
        start: [usize; 3],
        vectors: &[[f32; 3]; LANES],
        from: &[T; LANES],
        out: &mut [T; LANES],
    ) -> [u8; 2] {
        self.fill_any(start, vectors, from, out)
    }

    #[inline(always)]
    fn fill_any(
        &self,
        start: [usize; 3],
        vectors: &[[f32; 3]; LANES],
        from: &[T; LANES],
        out: &mut [T; LANES],
    ) -> [u8; 2] {
        let [nx, ny, _] = self.source.dims;
        let mut u = [[0.0_f64; LANES]; 3];
        for i in 0..LANES {
            for a in 0..3 {
                u[a][i] = f64::from(vectors[i][a]);
            }
        }
        let moves = moving(vectors);
        if moves == 0 {
            *out = *from;
            return [0, 0];
        }
        // Place by axis: the lower voxel and the weight of the upper one; all in f64, which has lanes on every processor.
        let mut first = [0.0_f64; LANES];
        let mut weight = [[0.0_f64; LANES]; 3];
        let mut room = [f64::INFINITY; LANES];
        let stride = [1.0, nx as f64, (nx * ny) as f64];
        for a in 0..3 {
            let [p, q, r] = self.to_voxel[a];
            let begin = start[a] as f64;
            let step = if a == 0 { 1.0 } else { 0.0 };
            // A loop for each step: that is what the compiler makes lanes of.
            let (mut x, mut low, mut up) = ([0.0_f64; LANES], [0.0_f64; LANES], [0.0_f64; LANES]);
            for i in 0..LANES {
                x[i] = (begin + step * i as f64) + (p * u[0][i] + q * u[1][i] + r * u[2][i]);
            }
            for i in 0..LANES {
                let beyond = self.most[a] - x[i];
                let least = if x[i] < beyond { x[i] } else { beyond };
                room[i] = if least < room[i] { least } else { room[i] };
            }
            // The whole number below, or the one below that where `x` is whole itself: that is put right with the snap.
            for i in 0..LANES {
                low[i] = ((x[i] - 0.5) + SHIFT) - SHIFT;
            }
            for i in 0..LANES {
                up[i] = if 1.0 - (x[i] - low[i]) <= SNAP { 1.0 } else { 0.0 };
            }
            for i in 0..LANES {
                let t = x[i] - low[i];
                let t = if t <= SNAP { 0.0 } else { t };
                weight[a][i] = if up[i] > 0.0 { 0.0 } else { t };
            }
            for i in 0..LANES {
                first[i] += stride[a] * (low[i] + up[i]);
            }
        }
        let mut near = [[T::default(); LANES]; 8];
        let mut rest = 0_u8;
        for i in 0..LANES {
            let span = nx * ny + nx + 2;
            // Where there is room the number is one of 0 … 2⁵¹, and its last bits are that number.
            let at = ((first[i] + SHIFT).to_bits() & ((1 << 51) - 1)) as usize;
            let voxels = if room[i] >= 0.0 { self.source.voxels.get(at..) } else { None };
            let Some(voxels) = voxels.and_then(|voxels| voxels.get(..span)) else {
                rest |= 1 << i;
                continue;
            };
            for (k, row) in [0, nx, nx * ny, nx * ny + nx].into_iter().enumerate() {
                near[2 * k][i] = voxels[row];
                near[2 * k + 1][i] = voxels[row + 1];
            }
        }
        let mut sum = [0.0_f64; LANES];
        for i in 0..LANES {
            let [x, y, z] = [weight[0][i], weight[1][i], weight[2][i]];
            let line = |k: usize| (1.0 - x) * near[2 * k][i].to_f64() + x * near[2 * k + 1][i].to_f64();
            // From 0 on, as the plain sum: −0 alone becomes 0.
            sum[i] = 0.0
                + (1.0 - y) * (1.0 - z) * line(0)
                + y * (1.0 - z) * line(1)
                + (1.0 - y) * z * line(2)
                + y * z * line(3);
        }
        for i in 0..LANES {
            // Infinities and NaN come through any weight, 0 too.
            rest |= u8::from(!T::TYPE.is_integer() && !sum[i].is_finite()) << i;
            let moved = T::from_f64(sum[i]);
            out[i] = if moves >> i & 1 == 1 { moved } else { from[i] };
        }
        [moves, moves & rest]
    }
}

/// A row as it is made already, but for what was left: as [`Rows::fill`].
pub(super) fn take<T: Copy>(
    vectors: &[[f32; 3]; LANES],
    made: &[T; LANES],
    left: u8,
    from: &[T; LANES],
    out: &mut [T; LANES],
) -> [u8; 2] {
    let moves = moving(vectors);
    for i in 0..LANES {
        out[i] = if moves >> i & 1 == 1 { made[i] } else { from[i] };
    }
    [moves, moves & left]
}

/// A bit for each vector that isn't 0.
#[inline(always)]
pub(super) fn moving(vectors: &[[f32; 3]; LANES]) -> u8 {
    let mut bits = 0;
    for (i, vector) in vectors.iter().enumerate() {
        bits |= u8::from(*vector != [0.0; 3]) << i;
    }
    bits
}
