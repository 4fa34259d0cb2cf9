//! Springs side by side: their forces, four lanes at a time, and how their energies grow.
//!
//! What [`pull`](super::forces::pull) says of a spring, side by side. The plain loops, which the compiler makes vectors of where
//! it can, and the vectors written for AVX2 do the same operations in the same order, so that lanes change no bit.
//!
//! The arguments for the `unsafe` blocks: what needs AVX2 is called only where [`Block::add_wide`] is, of which the caller has shown
//! the processor; and pointers lie within their lists, since the ends of a block's springs are less than the bounds that it was
//! made for, and the lists are at least as long.

use super::spring::{LIMITED, NO_DIRECTION, Spring, Vectors};

/// Springs of a block.
pub(super) const LANES: usize = 8;

/// Vectors as wide as the processor's: the last component is 0.
pub(super) type Padded = [[f64; 4]];

/// A list of vectors, padded.
pub(super) fn padded(of: &Vectors) -> Vec<[f64; 4]> {
    of.iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect()
}

/// The same without what was padded.
pub(super) fn unpadded(of: &Padded) -> Vec<[f64; 3]> {
    of.iter().map(|&[x, y, z, _]| [x, y, z]).collect()
}

/// Springs side by side: eight of one kind, fewer at the end of a kind. A kind acts on both ends, or on the first alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Block {
    count: usize,
    ends: [[u32; 2]; LANES],
    /// No vertex that it acts on comes before it.
    first: u32,
    /// The way from the first end to the other at rest (mm).
    at: [[f64; LANES]; 3],
    length: [f64; LANES],
    stiffness: [f64; LANES],
}

impl Block {
    /// - `first`: no vertex that it acts on comes before it.
    pub(super) fn new(springs: &[Spring], rest: &Vectors, first: usize) -> Self {
        let mut block = Self {
            count: springs.len(),
            ends: [springs[0].ends; LANES],
            first: first as u32,
            at: [[0.0; LANES]; 3],
            length: [1.0; LANES],
            stiffness: [0.0; LANES],
        };
        for (lane, spring) in springs.iter().enumerate() {
            let [i, j] = spring.ends.map(|v| v as usize);
            for a in 0..3 {
                block.at[a][lane] = rest[j][a] - rest[i][a];
            }
            (block.ends[lane], block.length[lane], block.stiffness[lane]) =
                (spring.ends, spring.length, spring.stiffness);
        }
        block
    }

    /// Adds the springs' force (µN) to that on their vertices: on both ends, or on the first alone.
    #[inline(always)]
    pub(super) fn add<const PUSH: bool, const LIMIT: bool, const BOTH: bool, const W: usize>(
        &self,
        limit: f64,
        moved: &[[f64; W]],
        force: &mut [[f64; W]],
    ) {
        let (at, length, stiffness) = (&self.at, &self.length, &self.stiffness);
        let mut by = [[0.0; LANES]; 3];
        for (lane, ends) in self.ends.iter().enumerate() {
            let [i, j] = ends.map(|v| moved[v as usize]);
            for a in 0..3 {
                by[a][lane] = j[a] - i[a];
            }
        }
        let mut to = [[0.0; LANES]; 3];
        for a in 0..3 {
            for lane in 0..LANES {
                to[a][lane] = at[a][lane] + by[a][lane];
            }
        }
        let mut scale = [0.0; LANES];
        for lane in 0..LANES {
            // The difference of the squared lengths, without their cancellation.
            let grown = (at[0][lane] + to[0][lane]) * by[0][lane]
                + (at[1][lane] + to[1][lane]) * by[1][lane]
                + (at[2][lane] + to[2][lane]) * by[2][lane];
            let now =
                (to[0][lane] * to[0][lane] + to[1][lane] * to[1][lane] + to[2][lane] * to[2][lane]).sqrt();
            let directed = now > NO_DIRECTION * length[lane];
            let now = if directed { now } else { 1.0 };
            let mut pull = stiffness[lane] * grown;
            if LIMIT {
                let over = grown - limit * length[lane] * (now + length[lane]);
                pull += LIMITED * stiffness[lane] * if over > 0.0 { over } else { 0.0 };
            }
            let acts = directed && (PUSH || grown > 0.0);
            let pull = pull / ((now + length[lane]) * now);
            scale[lane] = if acts { pull } else { 0.0 };
        }
        for a in 0..3 {
            for lane in 0..LANES {
                to[a][lane] *= scale[lane];
            }
        }
        for (lane, ends) in self.ends.iter().enumerate().take(self.count) {
            let [i, j] = ends.map(|v| v.wrapping_sub(self.first) as usize);
            for a in 0..3 {
                force[i][a] += to[a][lane];
            }
            if BOTH {
                for a in 0..3 {
                    force[j][a] -= to[a][lane];
                }
            }
        }
    }

    /// Adds to every lane's sum how much its spring's energy (nJ) grows where the vertices go on by `way` (mm) from `moved`: of
    /// every spring, or of those alone whose first end comes before the other.
    #[inline(always)]
    pub(super) fn add_growth<const PUSH: bool, const LIMIT: bool, const ALL: bool>(
        &self,
        limit: f64,
        moved: &Vectors,
        way: &Vectors,
        sums: &mut [f64; LANES],
    ) {
        let (at, length, stiffness) = (&self.at, &self.length, &self.stiffness);
        let (mut by, mut on, mut counts) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3], [false; LANES]);
        for (lane, ends) in self.ends.iter().enumerate() {
            counts[lane] = lane < self.count && (ALL || ends[0] < ends[1]);
            let [i, j] = ends.map(|v| v as usize);
            for a in 0..3 {
                by[a][lane] = moved[j][a] - moved[i][a];
                on[a][lane] = way[j][a] - way[i][a];
            }
        }
        let squares = |of: &[[f64; LANES]; 3], lane: usize| {
            of[0][lane] * of[0][lane] + of[1][lane] * of[1][lane] + of[2][lane] * of[2][lane]
        };
        // A quotient of lengths that are 0 is 0.
        let over = |of: f64, lengths: f64| if lengths > 0.0 { of / lengths } else { 0.0 };
        let (mut here, mut there) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for a in 0..3 {
            for lane in 0..LANES {
                here[a][lane] = at[a][lane] + by[a][lane];
                there[a][lane] = here[a][lane] + on[a][lane];
            }
        }
        let (mut stretch, mut more) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            // Differences of squared lengths, without their cancellation.
            let so_far = (at[0][lane] + here[0][lane]) * by[0][lane]
                + (at[1][lane] + here[1][lane]) * by[1][lane]
                + (at[2][lane] + here[2][lane]) * by[2][lane];
            let further = (here[0][lane] + there[0][lane]) * on[0][lane]
                + (here[1][lane] + there[1][lane]) * on[1][lane]
                + (here[2][lane] + there[2][lane]) * on[2][lane];
            let (now, then) = (squares(&here, lane).sqrt(), squares(&there, lane).sqrt());
            stretch[lane] = over(so_far, now + length[lane]);
            more[lane] = over(further, now + then);
        }
        // Where both lie on the same side, their difference is the growth itself.
        let grown = |now: f64, then: f64, more: f64| {
            (if now != 0.0 && then != 0.0 { more } else { then - now }) * (now + then)
        };
        let above = |stretch: f64, least: f64| if stretch > least { stretch - least } else { 0.0 };
        for lane in 0..LANES {
            let (now, more) = (stretch[lane], more[lane]);
            let then = now + more;
            let mut sum =
                if PUSH { more * (now + then) } else { grown(above(now, 0.0), above(then, 0.0), more) };
            if LIMIT {
                let least = limit * length[lane];
                sum += LIMITED * grown(above(now, least), above(then, least), more);
            }
            let energy = 0.5 * stiffness[lane] * sum;
            sums[lane] += if counts[lane] { energy } else { 0.0 };
        }
    }

    /// The same for many blocks, four lanes at a time.
    ///
    /// # Safety
    ///
    /// Both ends of every spring are vertices of `moved`; the first, and with `BOTH` the second, less the block's first
    /// vertex is one of `force`.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    pub(super) unsafe fn add_wide<const PUSH: bool, const LIMIT: bool, const BOTH: bool>(
        blocks: &[Self],
        limit: f64,
        moved: &Padded,
        force: &mut Padded,
    ) {
        let (moved, force) = (moved.as_ptr().cast::<f64>(), force.as_mut_ptr().cast::<f64>());
        for block in blocks {
            // Counted from vertex 0, as ends are.
            let force = force.wrapping_sub(4 * block.first as usize);
            let mut left = block.count;
            for lanes in 0..block.count.div_ceil(4) {
                // SAFETY: the caller's, and the lanes are within the block.
                unsafe {
                    // Counted in numbers, not in vertices.
                    let end = |lane: usize, end: usize| 4 * block.ends[4 * lanes + lane][end] as usize;
                    let ends = [
                        [end(0, 0), end(0, 1)],
                        [end(1, 0), end(1, 1)],
                        [end(2, 0), end(2, 1)],
                        [end(3, 0), end(3, 1)],
                    ];
                    let add = block.four::<PUSH, LIMIT>(4 * lanes, ends, limit, moved);
                    act::<BOTH>(ends[0], add[0], force);
                    if left >= 4 {
                        act::<BOTH>(ends[1], add[1], force);
                        act::<BOTH>(ends[2], add[2], force);
                        act::<BOTH>(ends[3], add[3], force);
                    } else {
                        for lane in 1..left {
                            act::<BOTH>(ends[lane], add[lane], force);
                        }
                    }
                }
                left = left.saturating_sub(4);
            }
        }
    }

    /// The forces of four springs on their first ends.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    #[inline]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn four<const PUSH: bool, const LIMIT: bool>(
        &self,
        lane: usize,
        ends: [[usize; 2]; 4],
        limit: f64,
        moved: *const f64,
    ) -> [std::arch::x86_64::__m256d; 4] {
        use std::arch::x86_64::{
            __m256d, _CMP_GT_OQ, _mm256_add_pd, _mm256_and_pd, _mm256_blendv_pd, _mm256_cmp_pd,
            _mm256_div_pd, _mm256_loadu_pd, _mm256_max_pd, _mm256_mul_pd, _mm256_permute2f128_pd,
            _mm256_set1_pd, _mm256_setzero_pd, _mm256_sqrt_pd, _mm256_sub_pd, _mm256_unpackhi_pd,
            _mm256_unpacklo_pd,
        };
        // SAFETY: the caller's.
        let apart = |[i, j]: [usize; 2]| unsafe {
            _mm256_sub_pd(_mm256_loadu_pd(moved.add(j)), _mm256_loadu_pd(moved.add(i)))
        };
        // SAFETY: eight lanes, of which four from `lane` on.
        let lanes = |of: &[f64; LANES]| unsafe { _mm256_loadu_pd(of.as_ptr().add(lane)) };
        let sum = |[x, y, z]: [__m256d; 3]| _mm256_add_pd(_mm256_add_pd(x, y), z);
        let [a, b, c, d] = [apart(ends[0]), apart(ends[1]), apart(ends[2]), apart(ends[3])];
        let (ab, cd) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
        let by = [
            _mm256_permute2f128_pd::<0x20>(ab, cd),
            _mm256_permute2f128_pd::<0x20>(_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d)),
            _mm256_permute2f128_pd::<0x31>(ab, cd),
        ];
        let at = [lanes(&self.at[0]), lanes(&self.at[1]), lanes(&self.at[2])];
        let (length, stiffness) = (lanes(&self.length), lanes(&self.stiffness));
        let of = |a: usize| {
            let to = _mm256_add_pd(at[a], by[a]);
            (to, _mm256_mul_pd(_mm256_add_pd(at[a], to), by[a]))
        };
        let [(x, grown_x), (y, grown_y), (z, grown_z)] = [of(0), of(1), of(2)];
        let grown = sum([grown_x, grown_y, grown_z]);
        let now = _mm256_sqrt_pd(sum([_mm256_mul_pd(x, x), _mm256_mul_pd(y, y), _mm256_mul_pd(z, z)]));
        let least = _mm256_mul_pd(_mm256_set1_pd(NO_DIRECTION), length);
        let directed = _mm256_cmp_pd::<_CMP_GT_OQ>(now, least);
        let now = _mm256_blendv_pd(_mm256_set1_pd(1.0), now, directed);
        let both = _mm256_add_pd(now, length);
        let mut pull = _mm256_mul_pd(stiffness, grown);
        if LIMIT {
            let allowed = _mm256_mul_pd(_mm256_mul_pd(_mm256_set1_pd(limit), length), both);
            let over = _mm256_max_pd(_mm256_sub_pd(grown, allowed), _mm256_setzero_pd());
            let stiff = _mm256_mul_pd(_mm256_set1_pd(LIMITED), stiffness);
            pull = _mm256_add_pd(pull, _mm256_mul_pd(stiff, over));
        }
        let pull = _mm256_div_pd(pull, _mm256_mul_pd(both, now));
        let acts = if PUSH {
            directed
        } else {
            _mm256_and_pd(directed, _mm256_cmp_pd::<_CMP_GT_OQ>(grown, _mm256_setzero_pd()))
        };
        let scale = _mm256_and_pd(pull, acts);
        let [x, y, z] = [_mm256_mul_pd(x, scale), _mm256_mul_pd(y, scale), _mm256_mul_pd(z, scale)];
        let none = _mm256_setzero_pd();
        let (xy, yx) = (_mm256_unpacklo_pd(x, y), _mm256_unpackhi_pd(x, y));
        let (zw, wz) = (_mm256_unpacklo_pd(z, none), _mm256_unpackhi_pd(z, none));
        [
            _mm256_permute2f128_pd::<0x20>(xy, zw),
            _mm256_permute2f128_pd::<0x20>(yx, wz),
            _mm256_permute2f128_pd::<0x31>(xy, zw),
            _mm256_permute2f128_pd::<0x31>(yx, wz),
        ]
    }
}

/// Adds a force to that on the first end, and takes it from that on the other; ends are counted in numbers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
#[inline]
#[allow(unsafe_code, reason = "argued in the module's head")]
unsafe fn act<const BOTH: bool>([i, j]: [usize; 2], add: std::arch::x86_64::__m256d, force: *mut f64) {
    use std::arch::x86_64::{_mm256_add_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_sub_pd};
    // SAFETY: the caller's.
    unsafe {
        let on = force.wrapping_add(i);
        _mm256_storeu_pd(on, _mm256_add_pd(_mm256_loadu_pd(on), add));
        if BOTH {
            let on = force.wrapping_add(j);
            _mm256_storeu_pd(on, _mm256_sub_pd(_mm256_loadu_pd(on), add));
        }
    }
}
