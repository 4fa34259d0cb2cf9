//! Projections: a ray becomes one number, made of the values along it.

mod attenuated;
mod bounds;
mod first_peak;
mod greatest;
mod mean;

use std::ops::ControlFlow;

use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::samples::Stored;

pub(crate) use attenuated::Attenuated;
#[cfg(target_arch = "x86_64")]
pub(crate) use attenuated::{FARTHEST, ROUNDED, SERIES};
pub(crate) use bounds::{BLOCK_BRICKS, Bounds};
pub(crate) use first_peak::FirstPeak;
pub(crate) use greatest::Greatest;
pub(crate) use mean::Mean;

/// What a ray makes of its values, which are `sign · value`: sample by sample from front to back.
pub(crate) trait Project: Sync {
    /// What is known of the values so far.
    type Seen: Copy;

    /// What is known before the first sample.
    fn nothing(&self) -> Self::Seen;

    /// Takes a sample that stands for so many steps; `None` where there is no data.
    fn take(&self, seen: &mut Self::Seen, value: Option<f32>, steps: f32);

    /// Whether no later sample changes anything.
    fn is_settled(&self, seen: &Self::Seen) -> bool;

    /// Whether samples that don't exceed `bound`, of which any number may be missing, change nothing.
    fn passes(&self, seen: &Self::Seen, bound: f32) -> bool;

    /// What becomes of the values; −∞ where there is none.
    fn shown(&self, seen: &Self::Seen) -> f32;
}

/// Projects the values along a ray. `bound` holds for every brick a value that no sample in it exceeds; `sign` is −1 where what is projected
/// falls as the fast value rises. The plain twin of [`crate::packet::project`].
pub(crate) fn project<T: Stored, P: Project>(
    field: &Field<'_, T>,
    projection: &P,
    bound: &[f32],
    sign: f32,
    skip: bool,
    ray: &Ray,
) -> (f32, Cast) {
    let mut seen = projection.nothing();
    let (mut taken, mut passed) = (0, 0);
    let skipped = field.space.walk(ray, |brick, range| {
        if skip && projection.passes(&seen, bound[brick]) {
            passed += range.len();
            return ControlFlow::Continue(());
        }
        let moves = field.moves(brick);
        for i in range {
            taken += 1;
            projection.take(&mut seen, signed(field, ray.at(i), moves, sign), 1.0);
            if projection.is_settled(&seen) {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    if ray.rest > 0.0 && !projection.is_settled(&seen) {
        taken += 1;
        let moves = field.moves(field.space.brick(ray.rest_at));
        projection.take(&mut seen, signed(field, ray.rest_at, moves, sign), ray.rest);
    }
    (projection.shown(&seen), Cast { rgba: [0.0; 4], taken, skipped: skipped + passed })
}

/// The sample that decides what a ray's values become, of equal ones the nearest.
pub(crate) fn decisive<T: Stored, P: Project>(
    field: &Field<'_, T>,
    projection: &P,
    sign: f32,
    ray: &Ray,
) -> Option<[f32; 3]> {
    let rest = (ray.rest > 0.0).then_some((ray.rest_at, ray.rest));
    let mut seen = projection.nothing();
    let mut decisive = None;
    for (at, steps) in (0..ray.steps).map(|i| (ray.at(i), 1.0)).chain(rest) {
        let before = projection.shown(&seen);
        let value = signed(field, at, field.moves(field.space.brick(at)), sign);
        projection.take(&mut seen, value, steps);
        if projection.shown(&seen) > before {
            decisive = Some(at);
        }
        if projection.is_settled(&seen) {
            break;
        }
    }
    decisive
}

/// `sign · value` of a sample; `None` where there is no data.
#[inline(always)]
fn signed<T: Stored>(field: &Field<'_, T>, at: [f32; 3], moves: bool, sign: f32) -> Option<f32> {
    let place = field.before(at, moves).map(|before| field.samples.shape.place(before));
    place.and_then(|place| field.value(&place)).map(|value| sign * value)
}
