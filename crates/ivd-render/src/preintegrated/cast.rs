use crate::camera::Ray;
use crate::cast::Field;
use crate::classify::of_part;
use crate::dvr::{Optics, Step};
use crate::samples::Stored;

use super::Preintegrated;

/// A step looks like all values between those at its two ends, and is lit at its middle.
///
/// A brick may be leapt over only if the values of all bricks about it are clear too: a step whose middle it holds may end in them.
#[derive(Clone, Copy)]
pub(crate) struct AtEnds<'a, const SHADED: bool>(pub(crate) &'a Preintegrated);

impl<T: Stored, const SHADED: bool> Optics<T> for AtEnds<'_, SHADED> {
    /// Place in the table of the value there.
    type End = Option<u32>;

    #[inline(always)]
    fn step(
        &self,
        field: &Field<'_, T>,
        ray: &Ray,
        step: &Step,
        front: Option<Option<u32>>,
    ) -> ([f32; 4], Option<u32>) {
        let from = front.unwrap_or_else(|| field.end(self.0, ray.end(step.number)));
        let to = field.end(self.0, ray.end(step.number + 1));
        (field.stretch::<SHADED>(self.0, [from, to], step.at, field.moves(step.brick)), to)
    }

    #[inline(never)]
    fn rest(&self, field: &Field<'_, T>, ray: &Ray) -> [f32; 4] {
        let ends = [-0.5, 0.5].map(|side| {
            let t = side * ray.rest;
            field.end(self.0, std::array::from_fn(|a| ray.rest_at[a] + t * ray.delta[a]))
        });
        let moves = field.moves(field.space.brick(ray.rest_at));
        of_part(field.stretch::<SHADED>(self.0, ends, ray.rest_at, moves), ray.rest)
    }

    fn unlit(&self) -> Option<impl Optics<T, End = Option<u32>>> {
        SHADED.then_some(AtEnds::<false>(self.0))
    }
}

impl<T: Stored> Field<'_, T> {
    /// Place in the table of the value at an end of a step; `None` where there is no data.
    #[inline(always)]
    pub(super) fn end(&self, table: &Preintegrated, at: [f32; 3]) -> Option<u32> {
        let moves = self.warp.is_some() && self.moves(self.space.brick(at));
        let before = self.before(at, moves)?;
        self.value(&self.samples.shape.place(before)).map(|value| table.index(value))
    }

    /// Emission and absorption of a step with its middle at `at`. Where one end has no data, half of it has none.
    #[inline(always)]
    pub(super) fn stretch<const SHADED: bool>(
        &self,
        table: &Preintegrated,
        ends: [Option<u32>; 2],
        at: [f32; 3],
        moves: bool,
    ) -> [f32; 4] {
        let entry = match ends {
            [Some(front), Some(back)] => table.between(front, back),
            [Some(end), None] | [None, Some(end)] => of_part(table.between(end, end), 0.5),
            [None, None] => [0.0; 4],
        };
        if SHADED && entry[3] > 0.0 { self.lit_before(entry, at, moves) } else { entry }
    }
}
