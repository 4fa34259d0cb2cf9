//! Cuts: fields with two sides.
//!
//! A cut is made of two maps of the whole space, one for what lies above its plane and one for what lies below; each is smooth,
//! proven free of folds, and inverted by itself. A voxel at rest moves with the map of its side. A deformed voxel comes from
//! where the map of one side has it, if that place lies on this side; where neither does, the cut has opened and there is
//! nothing; where both do, two pieces would lie on one another, and the cut is refused.

use ivd_core::op::check_fields;
use ivd_core::{Buffer, Error, Exec, FieldBricks, Grid, NO_BRICK, ParamError, VoxelCoord, VoxelIndex};
use ivd_field::falloff::within_ball;
use ivd_field::inverse::{Inverse, from_bricks};
use ivd_field::param::{half, is_direction, is_finite, is_near};
use ivd_field::sampler::{brick_at, brick_voxels};
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A cut through the centre of a ball that opens: what lies above its plane goes up, what lies below goes down, whole within
/// `core · radius` of the centre and fading out to nothing at `radius`, where the cut ends. The discontinuous deflector of Kurzion
/// and Yagel 1997.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Centre of the ball, on the plane, RAS.
    #[schemars(extend("x-unit" = "mm"))]
    pub centre: [f64; 3],
    /// Normal of the plane, RAS; any length but 0. Above is where it points.
    #[schemars(extend("x-unit" = "1"))]
    pub normal: [f64; 3],
    /// Distance from the centre at which the cut ends and from which on nothing moves.
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Fraction of the radius within which the cut opens whole.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1", "exclusiveMaximum" = 1.0))]
    pub core: f64,
    /// Distance of the two sides at the centre, once open; a cut doesn't close.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub open: f64,
}

/// Steps by which a place goes back: where nothing folds each leaves less than half of what is left, or nearly so.
const ITERATIONS: usize = 64;

/// A side of a cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Below,
    Above,
}

impl Cut {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    /// What the schema of a single field can't say.
    pub(super) fn check_together(&self) -> Result<(), ParamError> {
        is_finite("centre", &self.centre)?;
        is_near("radius", self.radius)?;
        is_near("open", self.open)?;
        is_direction("normal", &self.normal)
    }

    /// Where it takes a point (mm, RAS) that goes with a side, whichever it lies on.
    pub(super) fn apply(&self, point: Vector3<f64>, amount: f64, side: Side) -> Vector3<f64> {
        let distance = (point - Vector3::from(self.centre)).norm();
        let weight = within_ball(distance, self.radius, self.core) * amount;
        if weight == 0.0 || self.open == 0.0 {
            return point;
        }
        let half = Vector3::from(self.normal).normalize() * (0.5 * self.open * weight);
        if side == Side::Above { point + half } else { point - half }
    }

    /// Where a place (mm, RAS) that is seen with the cut open lies with it closed; of a place between its lips, one of the plane.
    pub fn closed(&self, seen: [f64; 3]) -> [f64; 3] {
        let (seen, normal) = (Vector3::from(seen), Vector3::from(self.normal).normalize());
        let side = if self.height(seen) >= 0.0 { Side::Above } else { Side::Below };
        let up = if side == Side::Above { 1.0 } else { -1.0 };
        let mut closed = seen;
        for _ in 0..ITERATIONS {
            let next = closed + seen - self.apply(closed, 1.0, side);
            // Nothing comes from beyond the plane.
            let beyond = (up * self.height(next)).min(0.0);
            closed = next - normal * (up * beyond);
        }
        closed.into()
    }

    /// Distance from the plane (mm); above it ≥ 0.
    pub(super) fn height(&self, point: Vector3<f64>) -> f64 {
        (point - Vector3::from(self.centre)).dot(&Vector3::from(self.normal).normalize())
    }
}

/// The map of one side, all over space.
pub(super) struct Whole {
    pub(super) field: FieldBricks,
    pub(super) inverse: Inverse,
}

/// Both sides put together.
pub(super) struct TwoSided {
    pub(super) forward: FieldBricks,
    pub(super) inverse: FieldBricks,
    pub(super) vacated: Buffer<u8>,
    pub(super) sides: Buffer<u8>,
}

/// What is put together of a brick.
struct Brick {
    forward: Box<[[f32; 3]]>,
    inverse: Box<[[f32; 3]]>,
    /// By voxel of the brick, whether it is vacated, and its sides, as a displacement keeps them.
    flags: Box<[(u8, u8)]>,
    /// The deepest overlap (mm) and its slot.
    overlap: Option<(f64, usize)>,
}

/// Puts the maps of two sides together.
///
/// - `height`: distance of a place at rest (mm from the grid's origin) from the cut, above it ≥ 0.
/// - `slack`: distance from the cut up to which rounding may decide (mm).
pub(super) fn join(
    grid: &Grid,
    [below, above]: [&Whole; 2],
    height: impl Fn(Vector3<f64>) -> f64 + Sync,
    slack: f64,
    exec: &Exec,
) -> Result<TwoSided, Error> {
    let stored = |b: usize| [below, above].iter().any(|side| side.field.table()[b] != NO_BRICK);
    let bricks: Vec<usize> = (0..above.field.table().len()).filter(|&b| stored(b)).collect();
    let brick_dims = above.field.brick_dims();
    exec.check_memory("the sides of the cut", 2 * grid.len() as u64 + 26 * 512 * bricks.len() as u64)?;
    let joined = bricks
        .par_iter()
        .map(|&b| {
            exec.check_cancelled()?;
            Ok(join_brick(grid, [below, above], brick_at(brick_dims, b), &height, slack))
        })
        .collect::<Result<Vec<Brick>, Error>>()?;
    let (mut vacated, mut sides) = (vec![0; grid.len()], vec![0; grid.len()]);
    let mut deepest: Option<(f64, [usize; 3])> = None;
    for (&b, brick) in bricks.iter().zip(&joined) {
        for (slot, voxel) in brick_voxels(grid.dims(), brick_at(brick_dims, b)) {
            let i = grid.linear(voxel);
            (vacated[i], sides[i]) = brick.flags[slot];
            if let Some((depth, at)) = brick.overlap
                && at == slot
                && deepest.is_none_or(|(other, _)| depth > other)
            {
                deepest = Some((depth, voxel.0));
            }
        }
    }
    if let Some((depth, voxel)) = deepest {
        return Err(Error::Untrusted {
            what: "the cut",
            problem: format!("its sides lie on one another at voxel {voxel:?}, {depth:.3} mm deep"),
            remedy: "cut where the steps before it don't turn space round, or open it less",
        });
    }
    let (forward, inverse): (Vec<_>, Vec<_>) = joined.into_iter().map(|b| (b.forward, b.inverse)).unzip();
    widen(grid, &mut sides, |voxel| own_side(height(grid.linear_part() * VoxelCoord::from(voxel).0), slack));
    let some = |flags: Vec<u8>, there: bool| if there { flags } else { Vec::new() };
    let opens = vacated.iter().any(|f| *f != 0);
    // Where the grid has one side of the cut only, it has no cut.
    let cuts = [1, 2].iter().all(|side| sides.iter().any(|s| s & 3 == *side));
    Ok(TwoSided {
        forward: from_bricks(grid.dims(), &bricks, forward.into_iter())?,
        inverse: from_bricks(grid.dims(), &bricks, inverse.into_iter())?,
        vacated: some(vacated, opens).into(),
        sides: some(sides, cuts).into(),
    })
}

/// The side on which a height is, 1 below and 2 above: above from the plane on, up to rounding.
fn own_side(height: f64, slack: f64) -> u8 {
    1 + u8::from(height >= -slack)
}

/// Whether a voxel's flags have a side at rest.
fn has_side(flags: u8) -> bool {
    [1, 2].contains(&(flags & 3))
}

/// Gives the voxels next to those that a cut moves apart their sides too, so that a cell with a voxel that is moved apart has a side at
/// every corner.
fn widen(grid: &Grid, sides: &mut [u8], side: impl Fn(VoxelIndex) -> u8) {
    let dims = grid.dims();
    let mut rim = Vec::new();
    for i in (0..sides.len()).filter(|&i| has_side(sides[i])) {
        let at = grid.index(i).0;
        let range = |a: usize| at[a].saturating_sub(1)..(at[a] + 2).min(dims[a]);
        for z in range(2) {
            for y in range(1) {
                let row = dims[0] * (y + dims[1] * z);
                rim.extend(range(0).map(|x| x + row).filter(|&near| !has_side(sides[near])));
            }
        }
    }
    rim.sort_unstable();
    rim.dedup();
    for i in rim {
        sides[i] |= side(grid.index(i));
    }
}

fn join_brick(
    grid: &Grid,
    sides: [&Whole; 2],
    at: [usize; 3],
    height: &impl Fn(Vector3<f64>) -> f64,
    slack: f64,
) -> Brick {
    let zeros = || vec![[0.0_f32; 3]; FieldBricks::VOXELS].into_boxed_slice();
    let mut out = Brick {
        forward: zeros(),
        inverse: zeros(),
        flags: vec![(0, 0); FieldBricks::VOXELS].into_boxed_slice(),
        overlap: None,
    };
    // At rest as deformed: what lies on the plane belongs to one side only.
    let is_above = |height: f64| own_side(height, slack) == 2;
    for (slot, voxel) in brick_voxels(grid.dims(), at) {
        let place = grid.linear_part() * VoxelCoord::from(voxel).0;
        let forward = sides.map(|side| side.field.at(voxel));
        let own = usize::from(is_above(height(place)));
        out.forward[slot] = forward[own];
        out.flags[slot].1 = if forward[0] == forward[1] { 0 } else { 1 + own as u8 };
        let inverse = sides.map(|side| side.inverse.field.at(voxel));
        if inverse[0] == inverse[1] {
            out.inverse[slot] = inverse[0];
            continue;
        }
        let [below, above] = inverse.map(|vector| height(place + Vector3::from(vector).map(f64::from)));
        let comes = [!is_above(below), is_above(above)];
        // Where nothing is left the inverse goes on from the nearer side, so that what is sampled beside it is smooth.
        let from = match comes {
            [true, false] => 0,
            [false, true] => 1,
            _ => usize::from(above >= -below),
        };
        out.inverse[slot] = inverse[from];
        if comes == [false, false] {
            out.flags[slot].0 = 1;
        } else {
            out.flags[slot].1 |= (1 + from as u8) << 2;
        }
        let both = above.min(-below);
        if both > slack && out.overlap.is_none_or(|(most, _)| both > most) {
            out.overlap = Some((both, slot));
        }
    }
    out
}
