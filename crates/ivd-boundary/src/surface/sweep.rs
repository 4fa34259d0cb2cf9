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

use ivd_core::BRICK;

use super::band::{Brick, Primal};

/// What a sweep goes by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    /// Weight of the border's area, in the force's units and shortest edges.
    pub(super) mu: f32,
    /// Shortest edge of a voxel over that along each axis.
    pub(super) slope: [f32; 3],
    pub(super) tau: f32,
    pub(super) sigma: f32,
}

impl Steps {
    /// Steps that converge, τ σ ‖∇‖² = 1, in the proportion that does so quickly: a share is worth 1, a flow μ.
    pub(super) fn new(mu: f64, edges: [f64; 3]) -> Self {
        let finest = edges.iter().copied().fold(f64::INFINITY, f64::min);
        let slope = edges.map(|edge| finest / edge);
        let norm = (4.0 * slope.iter().map(|g| g * g).sum::<f64>()).sqrt();
        let ratio = 0.5 / mu.max(1e-6);
        Self {
            mu: mu as f32,
            slope: slope.map(|g| g as f32),
            tau: (ratio / norm) as f32,
            sigma: (1.0 / (ratio * norm)) as f32,
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

#[inline(always)]
fn row(brick: &Brick, first: usize) -> &Row {
    brick[first..first + BRICK].try_into().expect("a row is 8 voxels")
}

impl Faces<'_> {
    /// The rows one voxel further along x, y and z; where that is beyond the volume, the voxels themselves.
    #[inline(always)]
    pub(super) fn next(&self, of: &Brick, y: usize, z: usize) -> [Row; 3] {
        let first = BRICK * (y + BRICK * z);
        let own = row(of, first);
        let mut x = [0.0; BRICK];
        x[..BRICK - 1].copy_from_slice(&own[1..]);
        x[BRICK - 1] = match self.above[0] {
            Some(above) => above[first],
            None => own[BRICK - 1],
        };
        if self.above[0].is_none() {
            x[self.extent[0] - 1] = own[self.extent[0] - 1];
        }
        let y_row = if y + 1 < self.extent[1] {
            row(of, first + BRICK)
        } else {
            self.above[1].map_or(own, |above| row(above, LAYER * z))
        };
        let z_row = if z + 1 < self.extent[2] {
            row(of, first + LAYER)
        } else {
            self.above[2].map_or(own, |above| row(above, BRICK * y))
        };
        [x, *y_row, *z_row]
    }
}

/// The step of the flow.
#[inline(always)]
pub(super) fn dual(flow: &mut [Brick; 3], ahead: &Brick, faces: &Faces, steps: &Steps) {
    let [sx, sy, sz] = steps.slope.map(|g| g * steps.sigma);
    let mu = steps.mu.max(f32::MIN_POSITIVE);
    let [fx, fy, fz] = flow;
    for z in 0..faces.extent[2] {
        for y in 0..faces.extent[1] {
            let first = BRICK * (y + BRICK * z);
            let own = row(ahead, first);
            let [nx, ny, nz] = faces.next(ahead, y, z);
            let range = first..first + BRICK;
            let (fx, fy, fz) = (&mut fx[range.clone()], &mut fy[range.clone()], &mut fz[range]);
            for i in 0..BRICK {
                let x = fx[i] + sx * (nx[i] - own[i]);
                let y = fy[i] + sy * (ny[i] - own[i]);
                let z = fz[i] + sz * (nz[i] - own[i]);
                let scale = mu / (x * x + y * y + z * z).sqrt().max(mu);
                fx[i] = x * scale;
                fy[i] = y * scale;
                fz[i] = z * scale;
            }
        }
    }
}

/// The step of the shares.
#[inline(always)]
pub(super) fn primal(
    state: &mut Primal,
    flow: &[Brick; 3],
    below: [&Brick; 3],
    force: &Brick,
    steps: &Steps,
) {
    let [gx, gy, gz] = steps.slope;
    let tau = steps.tau;
    for z in 0..BRICK {
        for y in 0..BRICK {
            let first = BRICK * (y + BRICK * z);
            let [x_row, y_row, z_row] = [0, 1, 2].map(|a| row(&flow[a], first));
            let mut x_before = [0.0; BRICK];
            x_before[1..].copy_from_slice(&x_row[..BRICK - 1]);
            x_before[0] = below[0][first + BRICK - 1];
            let y_before = if y > 0 { row(&flow[1], first - BRICK) } else { row(below[1], LAYER * z + LAYER - BRICK) };
            let z_before =
                if z > 0 { row(&flow[2], first - LAYER) } else { row(below[2], LAYER * (BRICK - 1) + BRICK * y) };
            let force = row(force, first);
            let range = first..first + BRICK;
            let (u, ahead) = (&mut state.u[range.clone()], &mut state.ahead[range]);
            for i in 0..BRICK {
                let div =
                    gx * (x_row[i] - x_before[i]) + gy * (y_row[i] - y_before[i]) + gz * (z_row[i] - z_before[i]);
                let before = u[i];
                let now = (before + tau * (div - force[i])).clamp(0.0, 1.0);
                u[i] = now;
                ahead[i] = 2.0 * now - before;
            }
        }
    }
}
