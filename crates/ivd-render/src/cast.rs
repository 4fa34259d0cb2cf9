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

    /// Whether a sample is hidden by where it was before the deformation.
    pub(crate) fn hides(&self, at: [f32; 3]) -> bool {
        self.warp
            .is_some_and(|warp| warp.is_cut() && warp.source(at).is_some_and(|before| warp.hides(before)))
    }

    /// Value at a place, `None` where there is no data.
    #[inline(always)]
    pub(crate) fn value(&self, place: &Place) -> Option<f32> {
        let value = self.samples.value(place);
        (T::TYPE.is_integer() || value.is_finite()).then_some(value)
    }

    /// Whether a sample reaches a surface; `None` where there is no data.
    #[inline(always)]
    pub(crate) fn reaches(&self, iso: f32, sign: f32, at: [f32; 3]) -> Option<bool> {
        self.value_there(at).map(|value| sign * value >= iso)
    }

    /// Value at a place that may have moved; `None` where there is no data.
    #[inline(always)]
    pub(crate) fn value_there(&self, at: [f32; 3]) -> Option<f32> {
        let moves = self.moves(self.space.brick(at));
        let place = self.before(at, moves).map(|before| self.samples.shape.place(before));
        place.and_then(|place| self.value(&place))
    }

    /// World normal at a place of the deformed volume; `before` is where it was.
    #[inline(always)]
    fn normal(&self, at: [f32; 3], before: [f32; 3], moves: bool) -> Option<[f32; 3]> {
        self.normal_of(self.samples.gradient(before), at, before, moves)
    }

    /// The same from the gradient there before the deformation; behind a cut that of the cut.
    #[inline(always)]
    fn normal_of(&self, gradient: [f32; 3], at: [f32; 3], before: [f32; 3], moves: bool) -> Option<[f32; 3]> {
        let (Some(warp), true) = (self.warp, moves) else { return self.light.normal(gradient) };
        match warp.rise_behind_cut(before, self.light.voxel()) {
            None => self.light.normal(warp.pull_back(at, gradient)),
            Some(rise) => self.light.normal_along(warp.pull_back(at, rise)),
        }
    }

    /// World normal at a place that may have moved.
    pub(crate) fn normal_there(&self, at: [f32; 3], moves: bool) -> Option<[f32; 3]> {
        self.before(at, moves).and_then(|before| self.normal(at, before, moves))
    }

    /// The label at a place that may have moved: that of the voxel nearest to where it was.
    pub(crate) fn label_there(&self, at: [f32; 3]) -> Option<u16> {
        let before = self.before(at, self.moves(self.space.brick(at)))?;
        Some(self.ids[self.samples.shape.nearest(&self.samples.shape.place(before))])
    }

    /// World normal, at a place that may have moved, out of the part that has a label: by which of the voxels about it have that. `None` where all do.
    pub(crate) fn part_normal_there(&self, at: [f32; 3], label: u16, moves: bool) -> Option<[f32; 3]> {
        /// So many voxels to each side are looked at, ...
        const REACH: usize = 2;
        /// ... so many along each axis.
        const SIDE: usize = 2 * REACH + 1;
        let before = self.before(at, moves)?;
        let dims = self.samples.shape.dims;
        // Beyond the volume its outermost voxels go on.
        let near = |a: usize, i: usize| {
            (before[a].round().max(0.0) as usize + i).saturating_sub(REACH).min(dims[a] - 1)
        };
        let mut rise = [0.0; 3];
        for i in 0..SIDE.pow(3) {
            let step = [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)];
            let [x, y, z] = [0, 1, 2].map(|a| near(a, step[a]));
            if self.ids[x + dims[0] * (y + dims[1] * z)] == label {
                for (rise, step) in rise.iter_mut().zip(step) {
                    *rise += step as f32 - REACH as f32;
                }
            }
        }
        self.normal_of(rise, at, before, moves)
    }

    /// A colour under the lamp, at a place that may have moved.
    #[inline(never)]
    pub(crate) fn lit_before(&self, entry: [f32; 4], at: [f32; 3], moves: bool) -> [f32; 4] {
        self.light.lit(entry, self.normal_there(at, moves))
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
        self.light.lit(entry, self.normal_of(gradient, at, before, moves))
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

/// Halvings of the step in which a surface was met: its place is good to 2⁻¹⁶ of a step.
pub(crate) const HALVINGS: usize = 16;

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    pub(crate) at: [f32; 3],
    /// Of a face that the picture is cut at: its normal.
    pub(crate) cut: Option<[f32; 3]>,
}

/// First hit of the surface where `sign · value` reaches `iso`, refined by bisection; samples taken, and samples passed over.
#[inline(always)]
pub(crate) fn first_place<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    ray: &Ray,
) -> (Option<Hit>, usize, usize) {
    let mut taken = 0;
    let mut hit = None;
    let skipped = field.space.walk(ray, |_, range| {
        for i in range {
            taken += 1;
            if field.reaches(iso, sign, ray.at(i)) == Some(true) {
                hit = Some((i, ray.at(i)));
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    if hit.is_none() && ray.rest > 0.0 {
        taken += 1;
        if field.reaches(iso, sign, ray.rest_at) == Some(true) {
            hit = Some((ray.steps, ray.rest_at));
        }
    }
    let Some((index, at)) = hit else { return (None, taken, skipped) };
    let (hit, more) = refined(field, iso, sign, ray, index, at);
    (Some(hit), taken + more, skipped)
}

/// Where a surface lies whose first sample inside is `at`: between the sample before, or the cut that the ray begins at, and this one, unless there is none or it
/// is no data. What was hidden before the deformation is data. With it the samples taken.
#[inline(never)]
pub(crate) fn refined<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    ray: &Ray,
    index: usize,
    at: [f32; 3],
) -> (Hit, usize) {
    let before = if index > 0 { Some(ray.at(index - 1)) } else { ray.cut.map(|_| ray.first()) };
    let Some(outside) = before else { return (Hit { at, cut: None }, 0) };
    let there = field.reaches(iso, sign, outside);
    if let (0, Some(true), Some(cut)) = (index, there, ray.cut) {
        return (Hit { at: outside, cut: Some(cut.normal) }, 1);
    }
    if there != Some(false) && !field.hides(outside) {
        return (Hit { at, cut: None }, 1);
    }
    (Hit { at: halved(field, iso, sign, [outside, at]), cut: None }, 1 + HALVINGS)
}

/// The place between one outside of a surface and one inside where the surface lies, on its inner side: [`HALVINGS`] samples.
#[inline(always)]
pub(crate) fn halved<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    [mut outside, mut inside]: [[f32; 3]; 2],
) -> [f32; 3] {
    for _ in 0..HALVINGS {
        let middle = std::array::from_fn(|a| 0.5 * (outside[a] + inside[a]));
        if field.reaches(iso, sign, middle) == Some(true) { inside = middle } else { outside = middle }
    }
    inside
}

/// The same, lit.
pub(crate) fn first_hit<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    [r, g, b]: [f32; 3],
    ray: &Ray,
) -> Cast {
    first_hit_by(field, iso, sign, ray, |_, normal| field.light.lit([r, g, b, 1.0], normal))
}

/// The same, lit by what its place and normal say.
#[inline(always)]
pub(crate) fn first_hit_by<T: Stored>(
    field: &Field<'_, T>,
    iso: f32,
    sign: f32,
    ray: &Ray,
    lit: impl FnOnce([f32; 3], Option<[f32; 3]>) -> [f32; 4],
) -> Cast {
    let (hit, taken, skipped) = first_place(field, iso, sign, ray);
    let Some(Hit { at, cut }) = hit else { return Cast { rgba: [0.0; 4], taken, skipped } };
    let moves = field.moves(field.space.brick(at));
    let normal = cut.or_else(|| field.normal_there(at, moves));
    Cast { rgba: lit(at, normal), taken, skipped }
}
