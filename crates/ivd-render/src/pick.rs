//! What a picture shows at a pixel: from a place in the picture to a place in the patient.

use std::ops::ControlFlow;

use ivd_core::{Labels, VoxelCoord, VoxelIndex};
use nalgebra::Vector3;

use crate::camera::Ray;
use crate::cast::{Field, first_place};
use crate::dvr::{Optics, Step};
use crate::project::{Project, decisive};
use crate::samples::Stored;

/// Share of a ray's opacity behind which lies what a picture is said to show.
pub(crate) const HALF: f32 = 0.5;
/// A ray with less opacity shows nothing: of white on black it changes no pixel of 8 bits, in which the darkest light is 1/12.92 of its number.
const NOTHING: f32 = 0.5 / 255.0 / 12.92;

/// What a picture shows at a pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Pick {
    /// Where it is seen (mm, RAS).
    pub place: [f64; 3],
    /// Where that was before the deformation (mm, RAS): what handles and seeds ask for. The same place where nothing is deformed.
    pub rest: [f64; 3],
    /// The voxel nearest to what is seen there: to the middle of the step, or the sample, that shows it.
    pub voxel: [usize; 3],
    /// The trilinear value of that sample, real; `None` where data is missing.
    pub value: Option<f64>,
    /// The label of that voxel, of a scene with labels.
    pub label: Option<u16>,
}

/// A place of the picture in voxel coordinates, and the sample that shows it.
pub(crate) struct Seen {
    pub(crate) place: [f32; 3],
    pub(crate) sample: [f32; 3],
}

impl Seen {
    /// A sample that is seen where it lies.
    fn at(sample: [f32; 3]) -> Self {
        Self { place: sample, sample }
    }
}

/// A ray that lets no more than this through is as opaque as one that lets nothing through: 1 − 2⁻²⁵ is 1.
const CLOSED: f32 = 0.5 * 0.5 * f32::EPSILON;

/// Where the opacity of a ray passes a share of what it has in all: a step's opacity is spread over its length, from its middle on where what lies before it is clear.
pub(crate) fn part_way<T: Stored, O: Optics<T>>(
    field: &Field<'_, T>,
    optics: &O,
    ray: &Ray,
    share: f32,
) -> Option<Seen> {
    let mut clear = if ray.rest > 0.0 { 1.0 - optics.rest(field, ray)[3] } else { 1.0 };
    // The steps that take light, and how much.
    let mut taking = Vec::new();
    let (mut front, mut behind) = (None, 1.0);
    field.space.walk(ray, |brick, steps| {
        for number in steps {
            let at = ray.at(number);
            let place = field.samples.shape.place(at);
            let step = Step { number, at, place, brick, through: 1.0 };
            // The end of the step before, unless that was leapt over.
            let known = front.take().filter(|(before, _)| before + 1 == number).map(|(_, end)| end);
            let (entry, end) = optics.step(field, ray, &step, known);
            front = Some((number, end));
            if entry[3] > 0.0 {
                taking.push((number, entry[3]));
                clear *= 1.0 - entry[3];
                behind *= 1.0 - entry[3];
                if behind <= CLOSED {
                    return ControlFlow::Break(());
                }
            }
        }
        ControlFlow::Continue(())
    });
    if 1.0 - clear < NOTHING {
        return None;
    }
    let wanted = 1.0 - share * (1.0 - clear);
    let (mut through, mut last) = (1.0_f32, None);
    for (number, opacity) in taking {
        let after = through * (1.0 - opacity);
        if after <= wanted {
            let share = if opacity < 1.0 { (wanted / through).ln() / (1.0 - opacity).ln() } else { 0.0 };
            let least = if last.is_some_and(|last| last + 1 == number) { 0.0 } else { 0.5 };
            let t = number as f32 - 0.5 + share.clamp(least, 1.0);
            let place = std::array::from_fn(|a| ray.start[a] + t * ray.delta[a]);
            return Some(Seen { place, sample: ray.at(number) });
        }
        (through, last) = (after, Some(number));
    }
    Some(Seen::at(ray.rest_at))
}

/// Where a ray meets a surface.
pub(crate) fn on_surface<T: Stored>(field: &Field<'_, T>, iso: f32, sign: f32, ray: &Ray) -> Option<Seen> {
    first_place(field, iso, sign, ray).0.map(|hit| Seen::at(hit.at))
}

/// Where the sample lies that a projection shows, of equal ones the nearest.
pub(crate) fn projected<T: Stored, P: Project>(
    field: &Field<'_, T>,
    projection: &P,
    sign: f32,
    ray: &Ray,
) -> Option<Seen> {
    decisive(field, projection, sign, ray).map(Seen::at)
}

/// What is seen, of the patient; `real` makes a fast value real.
pub(crate) fn picked<T: Stored>(
    field: &Field<'_, T>,
    grid: &ivd_core::Grid,
    labels: Option<&Labels>,
    real: impl Fn(f32) -> f64,
    Seen { place, sample }: Seen,
) -> Option<Pick> {
    let before = |at: [f32; 3]| field.before(at, field.moves(field.space.brick(at)));
    let shown = before(sample)?;
    // Beside what is left behind the place may have come from nowhere, and the sample is where it is seen.
    let (place, rest) = before(place).map_or((sample, shown), |rest| (place, rest));
    let world = |at: [f32; 3]| grid.world(VoxelCoord(Vector3::from(at).map(f64::from))).0.into();
    let dims = grid.dims();
    let voxel = std::array::from_fn(|a| (shown[a].round().max(0.0) as usize).min(dims[a] - 1));
    Some(Pick {
        place: world(place),
        rest: world(rest),
        voxel,
        value: field.value(&field.samples.shape.place(shown)).map(real),
        label: labels.map(|labels| labels.ids()[grid.linear(VoxelIndex(voxel))]),
    })
}
