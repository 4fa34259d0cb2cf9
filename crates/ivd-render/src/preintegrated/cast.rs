use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::classify::of_part;
use crate::dvr::over;
use crate::empty_space::{Home, NOWHERE};
use crate::samples::Stored;

use super::Preintegrated;

/// Emission and absorption from front to back, until `termination`: step `i` lies between the values at its two ends, and is lit at its middle.
///
/// A brick may be leapt over only if the values of all bricks about it are clear too: a step whose middle it holds may end in them.
#[inline(always)]
pub(crate) fn cast<T: Stored, const SHADED: bool>(
    field: &Field<'_, T>,
    table: &Preintegrated,
    termination: f32,
    ray: &Ray,
) -> Cast {
    let space = field.space;
    let mut rgba = [0.0_f32; 4];
    let (mut taken, mut skipped) = (0, 0);
    let (mut home, mut brick) = (NOWHERE, 0);
    // The place in the table of the value where the step before ended.
    let mut front = None;
    let mut i = 0;
    while i < ray.steps {
        let at = ray.at(i);
        let cell = field.samples.shape.place(at).cell();
        if !home.holds(cell) {
            let reach;
            (brick, reach) = space.enter(cell);
            if let Some(reach) = reach {
                let end = space.leap(ray, i, cell, reach);
                skipped += end - i;
                (i, front) = (end, None);
                continue;
            }
            home = Home::of(cell);
        }
        taken += 1;
        let from = front.unwrap_or_else(|| field.end(table, ray.end(i)));
        let to = field.end(table, ray.end(i + 1));
        over(&mut rgba, field.stretch::<SHADED>(table, [from, to], at, field.moves(brick)));
        (i, front) = (i + 1, Some(to));
        if rgba[3] >= termination {
            return Cast { rgba, taken, skipped };
        }
    }
    if ray.rest > 0.0 {
        taken += 1;
        over(&mut rgba, field.rest::<SHADED>(table, ray));
    }
    Cast { rgba, taken, skipped }
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

    /// The shorter step at a ray's end.
    #[inline(never)]
    pub(super) fn rest<const SHADED: bool>(&self, table: &Preintegrated, ray: &Ray) -> [f32; 4] {
        let ends = [-0.5, 0.5].map(|side| {
            let t = side * ray.rest;
            self.end(table, std::array::from_fn(|a| ray.rest_at[a] + t * ray.delta[a]))
        });
        let moves = self.moves(self.space.brick(ray.rest_at));
        of_part(self.stretch::<SHADED>(table, ends, ray.rest_at, moves), ray.rest)
    }
}
