//! Chambolle and Pock's iteration on a brick, for the sum of a force inside and the smooth length of the border:
//!
//! ```text
//! min over 0 ≤ u ≤ 1 of  Σ force · u + μ Σ |∇u|
//! flow  ← flow + σ ∇(ahead), brought back to length μ where it is longer
//! u     ← u + τ (div flow − force), kept within 0 … 1;  ahead ← 2 u − u before
//! ```
//!
//! The gradient is that of forward differences, along each axis times shortest edge / its edge; nothing flows through the volume's
//! border.
//!
//! Rows of eight voxels are the compiler's to make vectors of; where the processor has AVX2, of eight lanes. Every operation is one of
//! IEEE 754, rounded by itself, so that both give the same bytes.
//!
//! The argument for the `unsafe` blocks: they call functions that are safe but for the processor that they need, and only where that
//! processor is there.

use ivd_core::{BRICK, has_avx2};

use super::level::CUBE;

/// A number at every voxel of a brick, x fastest.
pub(super) type Brick = [f32; CUBE];

/// The state of one brick's primal variable.
#[derive(Clone, Copy, bytemuck::Zeroable)]
pub(super) struct Primal {
    /// Share of the part in each voxel, 0 … 1.
    pub(super) u: Brick,
    /// The same, carried on by the last step once more.
    pub(super) ahead: Brick,
}

/// What a sweep goes by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    /// Weight of the border's area, in the force's units and shortest edges.
    pub(super) mu: f32,
    /// Shortest edge of a voxel over that along each axis.
    pub(super) slope: [f32; 3],
    pub(super) tau: f32,
    pub(super) sigma: f32,
    /// Whether AVX2 is there and may be used.
    wide: bool,
}

impl Steps {
    /// Steps that converge, τ σ ‖∇‖² = 1, in the proportion that does so quickly: a share is worth 1, a flow μ.
    /// `native`: whether the processor's widest registers may be used.
    pub(super) fn new(mu: f64, edges: [f64; 3], native: bool) -> Self {
        let finest = edges.iter().copied().fold(f64::INFINITY, f64::min);
        let slope = edges.map(|edge| finest / edge);
        let norm = (4.0 * slope.iter().map(|g| g * g).sum::<f64>()).sqrt();
        let ratio = 0.5 / mu.max(1e-6);
        Self {
            mu: mu as f32,
            slope: slope.map(|g| g as f32),
            tau: (ratio / norm) as f32,
            sigma: (1.0 / (ratio * norm)) as f32,
            wide: native && has_avx2(),
        }
    }
}

/// What lies above a brick.
pub(super) struct Faces<'a> {
    /// The neighbours along x, y and z; `None` beyond the volume.
    pub(super) above: [Option<&'a Brick>; 3],
    /// Voxels of the brick that are the volume's.
    pub(super) extent: [usize; 3],
}

/// Eight voxels along x.
type Row = [f32; BRICK];
const LAYER: usize = BRICK * BRICK;

/// Eight voxels from one on.
#[inline(always)]
pub(super) fn row(brick: &Brick, first: usize) -> &Row {
    brick[first..first + BRICK].try_into().expect("a row is 8 voxels")
}

impl Faces<'_> {
    /// The brick one voxel further along x; where that is beyond the volume, the voxel itself.
    #[inline(always)]
    pub(super) fn next_x(&self, of: &Brick) -> Brick {
        let mut next = [0.0; CUBE];
        next[..CUBE - 1].copy_from_slice(&of[1..]);
        let last = self.extent[0] - 1;
        match self.above[0].filter(|_| last == BRICK - 1) {
            Some(above) => next.chunks_mut(BRICK).zip(above.chunks(BRICK)).for_each(|(n, a)| n[last] = a[0]),
            None => next.chunks_mut(BRICK).zip(of.chunks(BRICK)).for_each(|(n, own)| n[last] = own[last]),
        }
        next
    }

    /// A row of [`next_x`](Self::next_x).
    #[inline(always)]
    fn next_in_row(&self, of: &Brick, whole: Option<&Brick>, first: usize) -> Row {
        if let Some(whole) = whole {
            return *row(whole, first);
        }
        let last = self.above[0].map_or(of[first + BRICK - 1], |above| above[first]);
        if first + BRICK == CUBE {
            return std::array::from_fn(|x| if x + 1 < BRICK { of[first + x + 1] } else { last });
        }
        let further = row(of, first + 1);
        std::array::from_fn(|x| if x + 1 < BRICK { further[x] } else { last })
    }

    /// The row one voxel further along y; where that is beyond the volume, the row itself.
    #[inline(always)]
    pub(super) fn next_y<'a>(&'a self, of: &'a Brick, y: usize, z: usize) -> &'a Row {
        let first = BRICK * (y + BRICK * z);
        if y + 1 < self.extent[1] {
            return row(of, first + BRICK);
        }
        self.above[1].map_or_else(|| row(of, first), |above| row(above, LAYER * z))
    }

    /// The row one voxel further along z; where that is beyond the volume, the row itself.
    #[inline(always)]
    pub(super) fn next_z<'a>(&'a self, of: &'a Brick, y: usize, z: usize) -> &'a Row {
        let first = BRICK * (y + BRICK * z);
        if z + 1 < self.extent[2] {
            return row(of, first + LAYER);
        }
        self.above[2].map_or_else(|| row(of, first), |above| row(above, BRICK * y))
    }
}

/// 1 / √x within 5e-6 of it, and large at 0: a guess by the exponent and two steps of Newton's. Multiplications alone: a root and a
/// division take ten times as long on many processors, and the processors' own guesses differ.
#[inline(always)]
fn inverse_root(x: f32) -> f32 {
    let half = 0.5 * x;
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y
}

/// The step of the flow.
///
/// `softness`: share of its weight that area has at each voxel, where that isn't all of it everywhere.
pub(super) fn dual(
    flow: &mut [Brick; 3],
    ahead: &Brick,
    faces: &Faces,
    softness: Option<&Brick>,
    steps: &Steps,
) {
    if let Some(softness) = softness {
        return dual_any(flow, ahead, faces, &softness.map(|share| share * steps.mu), steps);
    }
    #[cfg(target_arch = "x86_64")]
    if steps.wide {
        // SAFETY: AVX2 was found.
        #[allow(unsafe_code, reason = "argued in the module's head")]
        return unsafe { dual_avx2(flow, ahead, faces, steps) };
    }
    dual_any(flow, ahead, faces, &steps.mu, steps);
}

/// The length that a flow may have at each voxel.
trait Length {
    fn at(&self, voxel: usize) -> f32;
}

impl Length for f32 {
    #[inline(always)]
    fn at(&self, _: usize) -> f32 {
        *self
    }
}

impl Length for Brick {
    #[inline(always)]
    fn at(&self, voxel: usize) -> f32 {
        self[voxel]
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn dual_avx2(flow: &mut [Brick; 3], ahead: &Brick, faces: &Faces, steps: &Steps) {
    dual_any(flow, ahead, faces, &steps.mu, steps);
}

#[inline(always)]
fn dual_any(flow: &mut [Brick; 3], ahead: &Brick, faces: &Faces, longest: &impl Length, steps: &Steps) {
    let [sx, sy, sz] = steps.slope.map(|g| g * steps.sigma);
    let [fx, fy, fz] = flow;
    let next_x = (faces.extent[0] < BRICK).then(|| faces.next_x(ahead));
    for z in 0..faces.extent[2] {
        for y in 0..faces.extent[1] {
            let first = BRICK * (y + BRICK * z);
            let (own, nx) = (row(ahead, first), faces.next_in_row(ahead, next_x.as_ref(), first));
            let (ny, nz) = (faces.next_y(ahead, y, z), faces.next_z(ahead, y, z));
            let range = first..first + BRICK;
            let (fx, fy, fz) = (&mut fx[range.clone()], &mut fy[range.clone()], &mut fz[range]);
            for i in 0..BRICK {
                let x = fx[i] + sx * (nx[i] - own[i]);
                let y = fy[i] + sy * (ny[i] - own[i]);
                let z = fz[i] + sz * (nz[i] - own[i]);
                let scale = (longest.at(first + i) * inverse_root(x * x + y * y + z * z)).min(1.0);
                fx[i] = x * scale;
                fy[i] = y * scale;
                fz[i] = z * scale;
            }
        }
    }
}

/// The step of the shares.
pub(super) fn primal(
    state: &mut Primal,
    flow: &[Brick; 3],
    below: [&Brick; 3],
    force: &Brick,
    steps: &Steps,
) {
    #[cfg(target_arch = "x86_64")]
    if steps.wide {
        // SAFETY: AVX2 was found.
        #[allow(unsafe_code, reason = "argued in the module's head")]
        return unsafe { primal_avx2(state, flow, below, force, steps) };
    }
    primal_any(state, flow, below, force, steps);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn primal_avx2(state: &mut Primal, flow: &[Brick; 3], below: [&Brick; 3], force: &Brick, steps: &Steps) {
    primal_any(state, flow, below, force, steps);
}

#[inline(always)]
fn primal_any(state: &mut Primal, flow: &[Brick; 3], below: [&Brick; 3], force: &Brick, steps: &Steps) {
    let [gx, gy, gz] = steps.slope;
    let tau = steps.tau;
    for z in 0..BRICK {
        for y in 0..BRICK {
            let first = BRICK * (y + BRICK * z);
            let [x_row, y_row, z_row] = [0, 1, 2].map(|a| row(&flow[a], first));
            let first_before = below[0][first + BRICK - 1];
            let x_before: Row = if first == 0 {
                std::array::from_fn(|x| if x > 0 { flow[0][x - 1] } else { first_before })
            } else {
                let before = row(&flow[0], first - 1);
                std::array::from_fn(|x| if x > 0 { before[x] } else { first_before })
            };
            let y_before =
                if y > 0 { row(&flow[1], first - BRICK) } else { row(below[1], LAYER * z + LAYER - BRICK) };
            let z_before = if z > 0 {
                row(&flow[2], first - LAYER)
            } else {
                row(below[2], LAYER * (BRICK - 1) + BRICK * y)
            };
            let force = row(force, first);
            let range = first..first + BRICK;
            let (u, ahead) = (&mut state.u[range.clone()], &mut state.ahead[range]);
            for i in 0..BRICK {
                let div = gx * (x_row[i] - x_before[i])
                    + gy * (y_row[i] - y_before[i])
                    + gz * (z_row[i] - z_before[i]);
                let before = u[i];
                let now = (before + tau * (div - force[i])).clamp(0.0, 1.0);
                u[i] = now;
                ahead[i] = 2.0 * now - before;
            }
        }
    }
}
