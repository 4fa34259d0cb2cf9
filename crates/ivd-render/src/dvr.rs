use crate::camera::Ray;
use crate::cast::{Cast, Field};
use crate::classify::{Classifier, of_part};
use crate::empty_space::{Home, NOWHERE};
use crate::samples::Stored;

/// Direct volume rendering: the premultiplied over operator from front to back, until `termination` (Engel et al. 2004;
/// thesis eqs 2.4–2.7 read as accumulated opacity).
///
/// The plain twin of [`crate::packet`], which casts eight rays at a time. One loop over the samples: a sample in another brick than the one
/// before first asks whether that brick may be leapt over.
#[inline(always)]
pub(crate) fn dvr<T: Stored, const LABELLED: bool, const SHADED: bool>(
    field: &Field<'_, T>,
    classifier: &Classifier,
    termination: f32,
    ray: &Ray,
) -> Cast {
    let space = field.space;
    let mut rgba = [0.0_f32; 4];
    let (mut taken, mut skipped) = (0, 0);
    let (mut home, mut brick) = (NOWHERE, 0);
    let mut i = 0;
    while i < ray.steps {
        let at = ray.at(i);
        let place = field.samples.shape.place(at);
        if !home.holds(place.cell()) {
            let reach;
            (brick, reach) = space.enter(place.cell());
            if let Some(reach) = reach {
                let end = space.leap(ray, i, place.cell(), reach);
                skipped += end - i;
                i = end;
                continue;
            }
            home = Home::of(place.cell());
        }
        i += 1;
        taken += 1;
        let entry = if field.moves(brick) {
            field.classified_before::<LABELLED, SHADED>(classifier, at, true)
        } else {
            field.classified::<LABELLED, SHADED>(classifier, at, at, &place, false)
        };
        over(&mut rgba, entry);
        if rgba[3] >= termination {
            return Cast { rgba, taken, skipped };
        }
    }
    if ray.rest > 0.0 {
        taken += 1;
        let moves = field.moves(space.brick(ray.rest_at));
        let entry = field.classified_before::<LABELLED, SHADED>(classifier, ray.rest_at, moves);
        over(&mut rgba, of_part(entry, ray.rest));
    }
    Cast { rgba, taken, skipped }
}

#[inline(always)]
pub(crate) fn over(rgba: &mut [f32; 4], entry: [f32; 4]) {
    let through = 1.0 - rgba[3];
    for (sum, c) in rgba.iter_mut().zip(entry) {
        *sum += through * c;
    }
}
