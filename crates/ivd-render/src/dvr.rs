use crate::camera::{Cut, Ray};
use crate::cast::{Cast, Field};
use crate::classify::{Classifier, of_part};
use crate::empty_space::{Home, NOWHERE};
use crate::samples::{Place, Stored};

/// What the steps of a ray look like, one ray at a time.
pub(crate) trait Optics<T: Stored> {
    /// What is known where a step ends, which the next one begins with.
    type End;

    /// Premultiplied colour and opacity of a step, and its end. `front`: the end of the step before, unless that was leapt over.
    fn step(
        &self,
        field: &Field<'_, T>,
        ray: &Ray,
        step: &Step,
        front: Option<Self::End>,
    ) -> ([f32; 4], Self::End);

    /// The shorter step at a ray's end.
    fn rest(&self, field: &Field<'_, T>, ray: &Ray) -> [f32; 4];

    /// The same without light; `None` where there is none.
    fn unlit(&self) -> Option<impl Optics<T, End = Self::End>>;

    /// A colour of the unlit ones, lit at a place whose normal is known.
    fn lit(&self, field: &Field<'_, T>, entry: [f32; 4], _: [f32; 3], normal: [f32; 3]) -> [f32; 4] {
        field.light.lit(entry, Some(normal))
    }
}

/// A step of a ray.
pub(crate) struct Step {
    pub(crate) number: usize,
    /// Its middle.
    pub(crate) at: [f32; 3],
    pub(crate) place: Place,
    /// The brick that holds the middle.
    pub(crate) brick: usize,
    /// Share of its light that what lies before it lets through.
    pub(crate) through: f32,
}

/// Direct volume rendering: the premultiplied over operator from front to back, until `termination` (Engel et al. 2004;
/// thesis eqs 2.4–2.7 read as accumulated opacity).
///
/// The plain twin of [`crate::packet`], which casts eight rays at a time. One loop over the steps: one in another brick than the one
/// before first asks whether that brick may be leapt over.
#[inline(always)]
pub(crate) fn dvr<T: Stored, O: Optics<T>>(
    field: &Field<'_, T>,
    optics: &O,
    termination: f32,
    ray: &Ray,
) -> Cast {
    let space = field.space;
    let Begun { mut rgba, steps: mut number } = behind_cut(field, optics, termination, ray);
    let (mut taken, mut skipped) = (number, 0);
    if rgba[3] >= termination {
        return Cast { rgba, taken, skipped };
    }
    let (mut home, mut brick) = (NOWHERE, 0);
    let mut front = None;
    while number < ray.steps {
        let at = ray.at(number);
        let place = field.samples.shape.place(at);
        if !home.holds(place.cell()) {
            let reach;
            (brick, reach) = space.enter(place.cell());
            if let Some(reach) = reach {
                let end = space.leap(ray, number, place.cell(), reach);
                skipped += end - number;
                (number, front) = (end, None);
                continue;
            }
            home = Home::of(place.cell());
        }
        taken += 1;
        let step = Step { number, at, place, brick, through: 1.0 - rgba[3] };
        let (entry, end) = optics.step(field, ray, &step, front);
        over(&mut rgba, entry);
        (number, front) = (number + 1, Some(end));
        if rgba[3] >= termination {
            return Cast { rgba, taken, skipped };
        }
    }
    if ray.rest > 0.0 {
        taken += 1;
        let cut = ray.cut.filter(|cut| ray.steps < cut.steps);
        let entry = match cut.and_then(|cut| Some((cut, optics.unlit()?))) {
            Some((cut, unlit)) => optics.lit(field, unlit.rest(field, ray), ray.rest_at, cut.normal),
            None => optics.rest(field, ray),
        };
        over(&mut rgba, entry);
    }
    Cast { rgba, taken, skipped }
}

/// What a ray has come to behind the cut that it begins at.
pub(crate) struct Begun {
    pub(crate) rgba: [f32; 4],
    /// Whole steps taken.
    pub(crate) steps: usize,
}

/// The steps of a ray within a voxel of the cut that it begins at, lit as the cut lies; none of a ray that begins at none, or isn't lit.
#[inline(always)]
pub(crate) fn behind_cut<T: Stored, O: Optics<T>>(
    field: &Field<'_, T>,
    optics: &O,
    termination: f32,
    ray: &Ray,
) -> Begun {
    let mut begun = Begun { rgba: [0.0; 4], steps: 0 };
    if let Some(cut) = ray.cut
        && let Some(unlit) = optics.unlit()
    {
        let lit = |entry, at| optics.lit(field, entry, at, cut.normal);
        begin(&mut begun, field, (&unlit, lit), cut, termination, ray);
    }
    begun
}

#[inline(never)]
fn begin<T: Stored, O: Optics<T>>(
    begun: &mut Begun,
    field: &Field<'_, T>,
    (unlit, lit): (&O, impl Fn([f32; 4], [f32; 3]) -> [f32; 4]),
    cut: Cut,
    termination: f32,
    ray: &Ray,
) {
    let mut front = None;
    while begun.steps < cut.steps.min(ray.steps) && begun.rgba[3] < termination {
        let at = ray.at(begun.steps);
        let place = field.samples.shape.place(at);
        let (brick, through) = (field.space.brick(at), 1.0 - begun.rgba[3]);
        let step = Step { number: begun.steps, at, place, brick, through };
        let (entry, end) = unlit.step(field, ray, &step, front);
        let entry = if entry[3] > 0.0 { lit(entry, at) } else { entry };
        over(&mut begun.rgba, entry);
        (begun.steps, front) = (begun.steps + 1, Some(end));
    }
}

/// Puts what lies behind under what was gathered before it.
#[inline(always)]
pub(crate) fn over(rgba: &mut [f32; 4], entry: [f32; 4]) {
    let through = 1.0 - rgba[3];
    for (sum, c) in rgba.iter_mut().zip(entry) {
        *sum += through * c;
    }
}

/// A step looks like the value at its middle.
#[derive(Clone, Copy)]
pub(crate) struct AtMiddle<'a, const LABELLED: bool, const SHADED: bool>(pub(crate) &'a Classifier);

impl<T: Stored, const LABELLED: bool, const SHADED: bool> Optics<T> for AtMiddle<'_, LABELLED, SHADED> {
    type End = ();

    #[inline(always)]
    fn step(&self, field: &Field<'_, T>, _: &Ray, step: &Step, _: Option<()>) -> ([f32; 4], ()) {
        let Step { at, place, brick, .. } = step;
        let entry = if field.moves(*brick) {
            field.classified_before::<LABELLED, SHADED>(self.0, *at, true)
        } else {
            field.classified::<LABELLED, SHADED>(self.0, *at, *at, place, false)
        };
        (entry, ())
    }

    #[inline(always)]
    fn rest(&self, field: &Field<'_, T>, ray: &Ray) -> [f32; 4] {
        let moves = field.moves(field.space.brick(ray.rest_at));
        of_part(field.classified_before::<LABELLED, SHADED>(self.0, ray.rest_at, moves), ray.rest)
    }

    fn unlit(&self) -> Option<impl Optics<T, End = ()>> {
        SHADED.then_some(AtMiddle::<LABELLED, false>(self.0))
    }
}
