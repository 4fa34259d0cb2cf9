//! Volumes as stacks of slices: other ways to the pictures that rays give, which they are held against.
//!
//! - Object-aligned slices (thesis 2.3) lie across the grid's axis that the view runs along most, view-aligned ones across the view. Either is met where a
//!   pixel's line of sight crosses it.
//! - Shear-warp (Lacroute and Levoy 1994; thesis 2.4) gathers object-aligned slices in a picture of its own, that lies in the foremost of them: each is sheared,
//!   in perspective scaled as well, to where it is seen from there. That picture is then warped to what the camera sees. The thesis's eqs 2.12 and 2.13 don't invert
//!   each other; here both are the one projection from the eye, or along the view, onto the foremost slice.
//!
//! A slice stands for what lies half way to the next, so that a homogeneous slab across it is exact; the opacity of its values is corrected for the length of the line of
//! sight there (thesis eqs 2.4–2.7). Values, colours and light are those of the rays; where they are asked for isn't.

use ivd_core::{Exec, parallel};
use nalgebra::{Matrix3, Vector3};

use crate::camera::Camera;
use crate::cast::{Cast, Field};
use crate::classify::{Classifier, of_part};
use crate::dvr::over;
use crate::frame::Radiance;
use crate::samples::Stored;
use crate::{Across, Error};

/// Slices across a direction.
struct Stack {
    /// Rise of the height with a voxel along each axis; heights run along the view.
    along: Vector3<f64>,
    /// Height of voxel 0.
    offset: f64,
    /// Heights of the first slice's near side and of the last one's far side.
    ends: [f64; 2],
    count: usize,
}

impl Stack {
    /// Across the grid's axis that the view runs along most.
    fn across_axis(camera: &Camera, count: Option<usize>) -> (Self, usize) {
        let lengths = camera.along_axes();
        let axis = (0..3).max_by(|&a, &b| lengths[a].abs().total_cmp(&lengths[b].abs())).unwrap_or(2);
        let size = camera.dims()[axis] as f64;
        let forward = lengths[axis] >= 0.0;
        let mut along = Vector3::zeros();
        along[axis] = if forward { 1.0 } else { -1.0 };
        let ends = if forward { [-0.5, size - 0.5] } else { [0.5 - size, 0.5] };
        (Self { along, offset: 0.0, ends, count: count.unwrap_or(2 * camera.dims()[axis]) }, axis)
    }

    /// Across the view.
    fn across_view(camera: &Camera, count: Option<usize>) -> Self {
        let along = camera.voxels_to_mm().row(2).transpose();
        let mut stack = Self { along, offset: -along.dot(&camera.axes()[0]), ends: [0.0; 2], count: 1 };
        let heights: Vec<f64> = corners(camera.dims()).map(|corner| stack.height(corner)).collect();
        stack.ends = [f64::min, f64::max].map(|pick| heights.iter().copied().reduce(pick).unwrap_or(0.0));
        let voxels = camera.dims().iter().map(|&n| (n * n) as f64).sum::<f64>().sqrt();
        stack.count = count.unwrap_or(2 * voxels.ceil() as usize);
        stack
    }

    fn height(&self, at: Vector3<f64>) -> f64 {
        self.along.dot(&at) + self.offset
    }

    fn thickness(&self) -> f64 {
        (self.ends[1] - self.ends[0]) / self.count as f64
    }

    fn slice(&self, number: usize) -> f64 {
        self.ends[0] + (number as f64 + 0.5) * self.thickness()
    }
}

/// Corners of the box of voxels.
fn corners(dims: [usize; 3]) -> impl Iterator<Item = Vector3<f64>> {
    (0..8_usize).map(move |corner| {
        Vector3::from_fn(|a, _| if corner >> a & 1 == 1 { dims[a] as f64 - 0.5 } else { -0.5 })
    })
}

/// Looks of what slices are gathered of.
pub(crate) struct Looks<'a, T> {
    pub(crate) field: &'a Field<'a, T>,
    pub(crate) classifier: &'a Classifier,
    pub(crate) is_shaded: bool,
    pub(crate) termination: f32,
}

impl<T: Stored> Looks<'_, T> {
    /// Emission and absorption at a place over a length [steps]; `None` where it is passed over.
    fn of(&self, camera: &Camera, at: Vector3<f64>, length: f64) -> Option<[f32; 4]> {
        let at32: [f32; 3] = std::array::from_fn(|a| at[a] as f32);
        let field = self.field;
        let (brick, reach) = field.space.enter(field.samples.shape.place(at32).cell());
        if reach.is_some() {
            return None;
        }
        let moves = field.moves(brick);
        let cut = camera.cut_before(at).filter(|_| self.is_shaded);
        let classified = match (field.ids.is_empty(), self.is_shaded && cut.is_none()) {
            (true, false) => field.classified_before::<false, false>(self.classifier, at32, moves),
            (true, true) => field.classified_before::<false, true>(self.classifier, at32, moves),
            (false, false) => field.classified_before::<true, false>(self.classifier, at32, moves),
            (false, true) => field.classified_before::<true, true>(self.classifier, at32, moves),
        };
        let entry = match cut {
            Some(normal) if classified[3] > 0.0 => field.light.lit(classified, Some(normal)),
            _ => classified,
        };
        Some(of_part(entry, length as f32))
    }

    /// Gathers the slices that a line of sight crosses, from a place along a direction (a voxel coordinate, and its change over a mm).
    fn gathered(&self, camera: &Camera, stack: &Stack, from: Vector3<f64>, direction: Vector3<f64>) -> Cast {
        let mut cast = Cast::default();
        let rise = stack.along.dot(&direction);
        if rise.abs() < 1e-9 {
            return cast;
        }
        let length = stack.thickness() / rise.abs() / camera.step();
        for k in 0..stack.count {
            // A line that runs against the others, as in wide perspectives, meets the last slice first.
            let number = if rise > 0.0 { k } else { stack.count - 1 - k };
            let t = (stack.slice(number) - stack.height(from)) / rise;
            let at = from + direction * t;
            if t <= 0.0 || !camera.shows(at) {
                continue;
            }
            match self.of(camera, at, length) {
                Some(entry) => {
                    cast.taken += 1;
                    over(&mut cast.rgba, entry);
                }
                None => cast.skipped += 1,
            }
            if cast.rgba[3] >= self.termination {
                break;
            }
        }
        cast
    }
}

/// A picture of so many pixels, row by row.
fn rows(
    [width, height]: [usize; 2],
    exec: &Exec,
    cast: impl Fn(usize, usize) -> Cast + Sync,
) -> Result<Radiance, ivd_core::Error> {
    // What is cast, and what is kept of it.
    exec.check_memory("picture", (48 * width * height) as u64)?;
    exec.observer().begin("render", height as u64);
    let mut casts = vec![Cast::default(); width * height];
    parallel::try_for_each_piece_mut(&mut casts, width, &|y, row| {
        for (x, pixel) in row.iter_mut().enumerate() {
            exec.check_cancelled()?;
            *pixel = cast(x, y);
        }
        exec.observer().advance("render", 1);
        Ok::<_, ivd_core::Error>(())
    })?;
    exec.observer().end("render");
    Ok(Radiance {
        width,
        height,
        samples: casts.iter().map(|cast| cast.taken as u64).sum(),
        skipped: casts.iter().map(|cast| cast.skipped as u64).sum(),
        rgba: casts.into_iter().map(|cast| cast.rgba).collect(),
    })
}

/// A picture by slices, across the view or across the grid's axis that it runs along most.
pub(crate) fn slices<T: Stored>(
    looks: &Looks<'_, T>,
    camera: &Camera,
    count: Option<usize>,
    across: Across,
    exec: &Exec,
) -> Result<Radiance, ivd_core::Error> {
    let stack = match across {
        Across::View => Stack::across_view(camera, count),
        Across::Axis => Stack::across_axis(camera, count).0,
    };
    rows(camera.size(), exec, |x, y| {
        let (from, direction) = camera.line(x as f64, y as f64);
        looks.gathered(camera, &stack, from, direction)
    })
}

/// Most pixels along a side of the picture that sheared slices are gathered in.
const LONGEST: f64 = 4096.0;

/// A picture by shear and warp. The picture in between has as many pixels a voxel as there are slices a voxel, at least one.
///
/// # Errors
/// [`Error::EyeAmongSlices`] where the eye lies among or behind the slices; memory.
pub(crate) fn shear_warp<T: Stored>(
    looks: &Looks<'_, T>,
    camera: &Camera,
    count: Option<usize>,
    exec: &Exec,
) -> Result<Radiance, Error> {
    let (stack, axis) = Stack::across_axis(camera, count);
    let foremost = stack.slice(0);
    let dims = camera.dims();
    // From where a place is projected onto the foremost slice.
    let sight = Sight::new(camera, &stack).ok_or(Error::EyeAmongSlices)?;
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let onto = |place: Vector3<f64>| {
        let t = (foremost - stack.height(place)) / stack.along.dot(&sight.towards(place));
        place + sight.towards(place) * t
    };
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in corners(dims) {
        // The outermost slices lie half a thickness within the box.
        let mut corner = corner;
        let ends = [foremost, stack.slice(stack.count - 1)];
        corner[axis] = stack.height(corner).clamp(ends[0], ends[1]) * stack.along[axis];
        let at = onto(corner);
        for (i, a) in [u, v].into_iter().enumerate() {
            low[i] = low[i].min(at[a]);
            high[i] = high[i].max(at[a]);
        }
    }
    let longest = (high[0] - low[0]).max(high[1] - low[1]);
    let wanted = (stack.count as f64 / dims[axis] as f64).max(1.0);
    let scale = f64::min(wanted, LONGEST / longest);
    // A pixel more on every side: what is warped is interpolated.
    let sides = [0, 1].map(|i| ((high[i] - low[i]) * scale).ceil() + 3.0);
    let of_pixel = |x: f64, y: f64| {
        let mut at = Vector3::zeros();
        at[axis] = foremost * stack.along[axis];
        at[u] = low[0] + (x - 1.0) / scale;
        at[v] = low[1] + (y - 1.0) / scale;
        at
    };
    let size = sides.map(|side| side as usize);
    let sheared = rows(size, exec, |x, y| {
        let at = of_pixel(x as f64, y as f64);
        let direction = sight.along(at);
        // Back a little, so that the foremost slice lies ahead.
        let back = direction * (0.5 * stack.thickness() / stack.along.dot(&direction).abs());
        looks.gathered(camera, &stack, at - back, direction)
    })?;
    let mut warped = rows(camera.size(), exec, |x, y| {
        let (from, direction) = camera.line(x as f64, y as f64);
        let t = (foremost - stack.height(from)) / stack.along.dot(&direction);
        let at = from + direction * t;
        let place = [(at[u] - low[0]) * scale + 1.0, (at[v] - low[1]) * scale + 1.0];
        let is_ahead = t.is_finite() && (t > 0.0 || !sight.is_from_eye());
        Cast { rgba: if is_ahead { interpolated(&sheared, place) } else { [0.0; 4] }, taken: 0, skipped: 0 }
    })?;
    (warped.samples, warped.skipped) = (sheared.samples, sheared.skipped);
    Ok(warped)
}

/// Where lines of sight come from.
enum Sight {
    /// Parallel ones: their direction, a mm in voxel coordinates.
    Parallel(Vector3<f64>),
    /// From the eye; with it how long a voxel coordinate's difference is (mm).
    Eye(Vector3<f64>, Matrix3<f64>),
}

impl Sight {
    /// `None` where the eye lies among the slices, or behind them.
    fn new(camera: &Camera, stack: &Stack) -> Option<Self> {
        let [start, _, _, away] = camera.axes();
        if camera.projection() == crate::Projection::Orthographic {
            return Some(Self::Parallel(away));
        }
        (stack.height(start) < stack.slice(0)).then(|| Self::Eye(start, camera.voxels_to_mm()))
    }

    fn is_from_eye(&self) -> bool {
        matches!(self, Self::Eye(..))
    }

    /// Along the line of sight through a place, whatever its length.
    fn towards(&self, place: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Parallel(away) => *away,
            Self::Eye(eye, _) => place - eye,
        }
    }

    /// The same over a millimetre.
    fn along(&self, place: Vector3<f64>) -> Vector3<f64> {
        let towards = self.towards(place);
        match self {
            Self::Parallel(_) => towards,
            Self::Eye(_, to_mm) => towards / (to_mm * towards).norm(),
        }
    }
}

/// Colour and opacity between pixels; nothing beyond the outermost.
fn interpolated(picture: &Radiance, place: [f64; 2]) -> [f32; 4] {
    let sides = [picture.width, picture.height];
    if !(0..2).all(|a| place[a] >= 0.0 && place[a] < (sides[a] - 1) as f64) {
        return [0.0; 4];
    }
    let whole = place.map(|c| c as usize);
    let part: [f32; 2] = std::array::from_fn(|a| (place[a] - whole[a] as f64) as f32);
    let at = |x: usize, y: usize| picture.rgba[whole[0] + x + picture.width * (whole[1] + y)];
    std::array::from_fn(|c| {
        let along = |y: usize| at(0, y)[c] + part[0] * (at(1, y)[c] - at(0, y)[c]);
        along(0) + part[1] * (along(1) - along(0))
    })
}
