//! What rays see, and what those of the modes other than direct volume rendering make of it.

use std::ops::ControlFlow;

use crate::camera::Ray;
use crate::classify::{Classifier, Steep};
use crate::empty_space::Space;
use crate::light::Light;
use crate::samples::{Place, Samples, Stored};
use crate::warp::Warp;

/// Colour of a ray and what it cost.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Cast {
    /// Premultiplied linear RGB and opacity.
    pub(crate) rgba: [f32; 4],
    /// Samples taken.
    pub(crate) taken: usize,
    /// Samples passed over because their brick is empty.
    pub(crate) skipped: usize,
}

/// The volume as rays see it.
pub(crate) struct Field<'a, T> {
    pub(crate) samples: Samples<'a, T>,
    /// Labels by voxel; empty for none.
    pub(crate) ids: &'a [u16],
    pub(crate) warp: Option<&'a Warp<'a>>,
    pub(crate) space: &'a Space,
    pub(crate) light: Light,
}

impl<T: Stored> Field<'_, T> {
    /// Whether samples of a brick come from elsewhere.
    #[inline(always)]
    pub(crate) fn moves(&self, brick: usize) -> bool {
        self.warp.as_ref().is_some_and(|warp| warp.moves(brick))
    }

    /// Where a sample is taken: its coordinate before the deformation.
    #[inline(always)]
    pub(crate) fn before(&self, at: [f32; 3], moves: bool) -> Option<[f32; 3]> {
        match (self.warp, moves) {
            (Some(warp), true) => warp.before(at),
            _ => Some(at),
        }
    }

    /// Value at a place, `None` where there is no data.
    #[inline(always)]
    pub(crate) fn value(&self, place: &Place) -> Option<f32> {
        let value = self.samples.value(place);
        (T::TYPE.is_integer() || value.is_finite()).then_some(value)
    }

    /// World normal at a place of the deformed volume; `before` is where it was.
    #[inline(always)]
    fn normal(&self, at: [f32; 3], before: [f32; 3], moves: bool) -> Option<[f32; 3]> {
        let mut gradient = self.samples.gradient(before);
        if let (Some(warp), true) = (self.warp, moves) {
            gradient = warp.pull_back(at, gradient);
        }
        self.light.normal(gradient)
    }

    /// A colour under the lamp, at a place that may have moved.
    #[inline(never)]
    pub(crate) fn lit_before(&self, entry: [f32; 4], at: [f32; 3], moves: bool) -> [f32; 4] {
        let before = self.before(at, moves);
        self.light.lit(entry, before.and_then(|before| self.normal(at, before, moves)))
    }

    /// Emission and absorption at a place that was at `before`, whose cell is `place`.
    #[inline(always)]
    pub(crate) fn classified<const LABELLED: bool, const SHADED: bool>(
        &self,
        classifier: &Classifier,
        at: [f32; 3],
        before: [f32; 3],
        place: &Place,
        moves: bool,
    ) -> [f32; 4] {
        let Some(value) = self.value(place) else { return [0.0; 4] };
        let entry = if LABELLED {
            classifier.of_labelled(value, self.ids[self.samples.shape.nearest(place)])
        } else {
            classifier.of(value)
        };
        if let Some(steep) = classifier.steep()
            && entry[3] > 0.0
        {
            return self.classified_steep::<SHADED>(steep, value, at, before, moves);
        }
        if SHADED && entry[3] > 0.0 { self.light.lit(entry, self.normal(at, before, moves)) } else { entry }
    }

    /// The same by value and gradient. How steep a place is doesn't change as it is deformed: a tissue looks like itself.
    #[inline(never)]
    fn classified_steep<const SHADED: bool>(
        &self,
        steep: &Steep,
        value: f32,
        at: [f32; 3],
        before: [f32; 3],
        moves: bool,
    ) -> [f32; 4] {
        let gradient = self.samples.gradient(before);
        let entry = steep.of(value, self.light.magnitude(gradient));
        if !SHADED || entry[3] <= 0.0 {
            return entry;
        }
        let gradient = match (self.warp, moves) {
            (Some(warp), true) => warp.pull_back(at, gradient),
            _ => gradient,
        };
        self.light.lit(entry, self.light.normal(gradient))
    }

    /// The same at a place that may have moved.
    #[inline(never)]
    pub(crate) fn classified_before<const LABELLED: bool, const SHADED: bool>(
        &self,
        classifier: &Classifier,
        at: [f32; 3],
        moves: bool,
    ) -> [f32; 4] {
        let Some(before) = self.before(at, moves) else { return [0.0; 4] };
        let place = self.samples.shape.place(before);
        self.classified::<LABELLED, SHADED>(classifier, at, before, &place, moves)
    }
}

/// Maximum intensity projection. `bound` holds for every brick a value that no sample in it exceeds; `sign` is −1
/// where the real value falls as the fast one rises. Returns the greatest `sign · value`, −∞ where there is none.
pub(crate) fn mip<T: Stored>(
    field: &Field<'_, T>,
    bound: &[f32],
    sign: f32,
    skip: bool,
    ray: &Ray,
) -> (f32, Cast) {
    let (mut greatest, mut taken, mut passed) = (f32::NEG_INFINITY, 0, 0);
    let mut look = |at: [f32; 3], moves: bool, greatest: &mut f32| {
        taken += 1;
        let place = field.before(at, moves).map(|before| field.samples.shape.place(before));
        if let Some(value) = place.and_then(|place| field.value(&place)) {
            *greatest = greatest.max(sign * value);
        }
    };
    let skipped = field.space.walk(ray, |brick, range| {
        if skip && bound[brick] <= greatest {
            passed += range.len();
            return ControlFlow::Continue(());
        }
        let moves = field.moves(brick);
        for i in range {
            look(ray.at(i), moves, &mut greatest);
        }
        ControlFlow::Continue(())
    });
    if ray.rest > 0.0 {
        look(ray.rest_at, field.moves(field.space.brick(ray.rest_at)), &mut greatest);
    }
    let cast = Cast { rgba: [0.0; 4], taken, skipped: skipped + passed };
    (greatest, cast)
}

/// Halvings of the step in which a surface was met: its place is good to 2⁻¹⁶ of a step.
pub(crate) const HALVINGS: usize = 16;

/// First hit of the surface where `sign · value` reaches `iso`, refined by bisection; samples taken, and samples passed over.
#[inline(always)]
pub(crate) fn first_place<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    ray: &Ray,
) -> (Option<[f32; 3]>, usize, usize) {
    let mut taken = 0;
    let mut inside = |at: [f32; 3]| {
        taken += 1;
        let moves = field.moves(field.space.brick(at));
        let place = field.before(at, moves).map(|before| field.samples.shape.place(before));
        place.and_then(|place| field.value(&place)).map(|value| sign * value >= iso)
    };
    let mut hit = None;
    let skipped = field.space.walk(ray, |_, range| {
        for i in range {
            if inside(ray.at(i)) == Some(true) {
                hit = Some((i, ray.at(i)));
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    if hit.is_none() && ray.rest > 0.0 && inside(ray.rest_at) == Some(true) {
        hit = Some((ray.steps, ray.rest_at));
    }
    let Some((index, mut at)) = hit else { return (None, taken, skipped) };
    // Between the sample before and this one, unless this is the first or the one before is no data.
    if index > 0 && inside(ray.at(index - 1)) == Some(false) {
        let mut outside = ray.at(index - 1);
        for _ in 0..HALVINGS {
            let middle = std::array::from_fn(|a| 0.5 * (outside[a] + at[a]));
            if inside(middle) == Some(true) { at = middle } else { outside = middle }
        }
    }
    (Some(at), taken, skipped)
}

/// The same, lit.
pub(crate) fn first_hit<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    surface: [f32; 3],
    ray: &Ray,
) -> Cast {
    let (hit, taken, skipped) = first_place(field, iso, sign, ray);
    let Some(at) = hit else { return Cast { rgba: [0.0; 4], taken, skipped } };
    let moves = field.moves(field.space.brick(at));
    let normal = field.before(at, moves).and_then(|before| field.normal(at, before, moves));
    let [r, g, b] = surface;
    Cast { rgba: field.light.lit([r, g, b, 1.0], normal), taken, skipped }
}
