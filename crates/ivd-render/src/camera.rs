use ivd_core::{Grid, VoxelCoord};
use nalgebra::{Matrix3, Vector3};

use crate::cut::HalfSpace;
use crate::fit::{self, Extents, Held};
use crate::{Projection, RenderParams, View};

/// Turns pixels into rays in voxel coordinates.
pub(crate) struct Camera {
    /// World direction from the scene to the eye, and the picture's right and up, all unit.
    pub(crate) towards_eye: Vector3<f64>,
    pub(crate) right: Vector3<f64>,
    pub(crate) up: Vector3<f64>,
    /// Size of a pixel in the plane through what the camera looks at (mm).
    pub(crate) pixel_mm: f64,
    centre: Vector3<f64>,
    /// Distance of the eye, or of the plane that parallel rays start from, to what the camera looks at (mm).
    distance: f64,
    projection: Projection,
    size: [usize; 2],
    /// In voxel coordinates: where the middle of the picture lies that rays start from (the eye for perspective), and a millimetre to the picture's right, up, and
    /// away from the eye.
    start: Vector3<f64>,
    voxels_right: Vector3<f64>,
    voxels_up: Vector3<f64>,
    voxels_away: Vector3<f64>,
    dims: [usize; 3],
    step_mm: f64,
    /// What is shown.
    cuts: Vec<HalfSpace>,
    /// Steps that begin within a voxel of a cut.
    steps_behind_cut: usize,
}

/// The part of a ray inside the volume, in voxel coordinates: sample `i` is at `start + i · delta`, never accumulated.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ray {
    /// The middle of the first step.
    pub(crate) start: [f32; 3],
    pub(crate) delta: [f32; 3],
    /// One over `delta`.
    pub(crate) inverse: [f32; 3],
    /// Number of whole steps.
    pub(crate) steps: usize,
    /// What is left after them: its middle, and its length in steps (0 for none).
    pub(crate) rest_at: [f32; 3],
    pub(crate) rest: f32,
    /// Where it begins at a plane that the picture is clipped by.
    pub(crate) cut: Option<Cut>,
}

/// The plane that a ray begins at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cut {
    /// Unit, in the world, out of what is shown.
    pub(crate) normal: [f32; 3],
    /// First steps of the ray that begin within a voxel of the plane: gradients there reach to its other side.
    pub(crate) steps: usize,
}

impl Ray {
    /// Position of sample `i`; each coordinate is monotone in `i`, as rounding is.
    #[inline(always)]
    pub(crate) fn at(&self, i: usize) -> [f32; 3] {
        let t = i as f32;
        std::array::from_fn(|a| self.start[a] + t * self.delta[a])
    }

    /// Where step `i` begins and the one before it ends.
    #[inline(always)]
    pub(crate) fn end(&self, i: usize) -> [f32; 3] {
        let t = i as f32 - 0.5;
        std::array::from_fn(|a| self.start[a] + t * self.delta[a])
    }

    /// Where it begins.
    pub(crate) fn first(&self) -> [f32; 3] {
        if self.steps > 0 {
            return self.end(0);
        }
        std::array::from_fn(|a| self.rest_at[a] - 0.5 * self.rest * self.delta[a])
    }
}

impl Camera {
    pub(crate) fn new(grid: &Grid, params: &RenderParams, held: &Held) -> Self {
        let [(sin_a, cos_a), (sin_e, cos_e)] = params.view.angles.map(|angle| angle.to_radians().sin_cos());
        let towards_eye = Vector3::new(-sin_a * cos_e, cos_a * cos_e, sin_e);
        let up = Vector3::new(sin_a * sin_e, -cos_a * sin_e, cos_e);
        let right = up.cross(&towards_eye);
        let (sin_r, cos_r) = params.view.roll.to_radians().sin_cos();
        let (right, up) = (right * cos_r - up * sin_r, up * cos_r + right * sin_r);
        let placed = match held {
            Held::Volume => Placed::round_volume(grid, params),
            Held::Places(places) => Placed::round_places(grid, params, places, [right, up, towards_eye]),
        };
        let Placed { centre, distance, pixel_mm } = placed.where_asked(grid, params);
        let to_voxel = grid.inverse_linear_part();
        // Differences to the grid's origin first: an origin 10⁶ mm away costs no precision.
        let start = to_voxel * ((centre - Vector3::from(grid.origin())) + towards_eye * distance);
        Self {
            towards_eye,
            right,
            up,
            pixel_mm: pixel_mm / params.view.zoom,
            centre,
            distance,
            projection: params.view.projection,
            size: params.size,
            start,
            voxels_right: to_voxel * right,
            voxels_up: to_voxel * up,
            voxels_away: to_voxel * -towards_eye,
            dims: grid.dims(),
            step_mm: step_mm(grid, params),
            cuts: HalfSpace::all(&params.clip, grid),
            steps_behind_cut: (1.0 / params.step).ceil() as usize,
        }
    }

    /// What lies in the middle of the picture (mm, RAS).
    pub(crate) fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    /// Unit direction from a place towards the eye (RAS): the line of sight through it.
    pub(crate) fn sight(&self, place: Vector3<f64>) -> Vector3<f64> {
        match self.projection {
            Projection::Orthographic => self.towards_eye,
            Projection::Perspective => {
                let eye = self.centre + self.towards_eye * self.distance;
                (eye - place).try_normalize(0.0).unwrap_or(self.towards_eye)
            }
        }
    }

    /// In voxel coordinates: where rays start, and a millimetre to the right, up, and away from the eye.
    pub(crate) fn axes(&self) -> [Vector3<f64>; 4] {
        [self.start, self.voxels_right, self.voxels_up, self.voxels_away]
    }

    pub(crate) fn projection(&self) -> Projection {
        self.projection
    }

    /// From the eye, or the plane that parallel rays start from, to what the camera looks at (mm).
    pub(crate) fn distance(&self) -> f64 {
        self.distance
    }

    /// Distance of samples along a ray (mm).
    pub(crate) fn step(&self) -> f64 {
        self.step_mm
    }

    /// Width and height (pixels).
    pub(crate) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Pixel coordinates of a world position: the middle of the top left pixel is (0, 0). `None` behind the eye.
    pub(crate) fn project(&self, world: Vector3<f64>) -> Option<[f64; 2]> {
        let from_centre = world - self.centre;
        let scale = match self.projection {
            Projection::Orthographic => 1.0,
            Projection::Perspective => {
                let depth = self.depth(world);
                if depth <= 1e-6 * self.distance {
                    return None;
                }
                self.distance / depth
            }
        };
        let x = from_centre.dot(&self.right) * scale / self.pixel_mm;
        let y = from_centre.dot(&self.up) * scale / self.pixel_mm;
        let [width, height] = self.size.map(|n| 0.5 * (n as f64 - 1.0));
        Some([width + x, height - y])
    }

    /// Distance of a world position from the eye, or from the plane that parallel rays start from, along the view (mm).
    pub(crate) fn depth(&self, world: Vector3<f64>) -> f64 {
        self.distance - (world - self.centre).dot(&self.towards_eye)
    }

    /// Whether a triangle, counter-clockwise seen from outside, turns its outside to the eye.
    pub(crate) fn faces_eye(&self, corners: [Vector3<f64>; 3]) -> bool {
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let towards = match self.projection {
            Projection::Orthographic => self.towards_eye,
            Projection::Perspective => self.centre + self.towards_eye * self.distance - corners[0],
        };
        normal.dot(&towards) > 0.0
    }

    /// The line of sight through a place of the picture, whose pixels' middles are whole: where it begins (voxel coordinate), and its change over a millimetre.
    pub(crate) fn line(&self, x: f64, y: f64) -> (Vector3<f64>, Vector3<f64>) {
        let across = (x - 0.5 * (self.size[0] as f64 - 1.0)) * self.pixel_mm;
        let upward = (0.5 * (self.size[1] as f64 - 1.0) - y) * self.pixel_mm;
        match self.projection {
            Projection::Orthographic => {
                (self.start + self.voxels_right * across + self.voxels_up * upward, self.voxels_away)
            }
            Projection::Perspective => {
                let length = across.hypot(upward).hypot(self.distance);
                let through =
                    self.voxels_right * across + self.voxels_up * upward + self.voxels_away * self.distance;
                (self.start, through / length)
            }
        }
    }

    /// The ray through the middle of a pixel, or `None` where it misses the volume. A voxel reaches half a voxel round its centre, so
    /// that even a volume of one layer has a thickness.
    pub(crate) fn ray(&self, x: usize, y: usize) -> Option<Ray> {
        let (from, direction) = self.line(x as f64, y as f64);
        let (near, far, cut) = self.clip(from, direction)?;
        Some(self.part(from, direction, [near, far], cut))
    }

    /// The ray from a place (voxel coordinate) along a direction of the world, from one distance to another (mm), as far as it is in the volume and in what is
    /// shown.
    pub(crate) fn ray_along(
        &self,
        from: Vector3<f64>,
        direction: Vector3<f64>,
        ends: [f64; 2],
    ) -> Option<Ray> {
        let direction = self.in_voxels(direction);
        let (near, far, _) = self.clip(from, direction)?;
        let (near, far) = (near.max(ends[0]), far.min(ends[1]));
        (near < far).then(|| self.part(from, direction, [near, far], None))
    }

    /// A difference in the world (mm) as one of voxel coordinates.
    pub(crate) fn in_voxels(&self, world: Vector3<f64>) -> Vector3<f64> {
        let part = |axis: Vector3<f64>| axis.dot(&world);
        self.voxels_right * part(self.right) + self.voxels_up * part(self.up)
            - self.voxels_away * part(self.towards_eye)
    }

    /// What turns a difference of voxel coordinates into millimetres to the right, up, and away from the eye.
    pub(crate) fn voxels_to_mm(&self) -> Matrix3<f64> {
        let axes = Matrix3::from_columns(&[self.voxels_right, self.voxels_up, self.voxels_away]);
        // A grid's axes span the space.
        axes.try_inverse().unwrap_or_else(Matrix3::zeros)
    }

    /// How far the middle of the view runs along each axis of the grid, as cosines.
    pub(crate) fn along_axes(&self) -> [f64; 3] {
        let to_mm = self.voxels_to_mm();
        std::array::from_fn(|a| to_mm[(2, a)] / to_mm.column(a).norm())
    }

    /// Voxels along each axis.
    pub(crate) fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Whether a voxel coordinate lies in the volume and in what is shown.
    pub(crate) fn shows(&self, at: Vector3<f64>) -> bool {
        (0..3).all(|a| at[a] >= -0.5 && at[a] <= self.dims[a] as f64 - 0.5)
            && self.cuts.iter().all(|cut| cut.height(at) >= 0.0)
    }

    /// The normal of a plane that the picture is clipped by, where a voxel coordinate lies within so much behind it as gradients reach.
    pub(crate) fn cut_before(&self, at: Vector3<f64>) -> Option<[f32; 3]> {
        let reach = self.step_mm * self.steps_behind_cut as f64;
        let near =
            self.cuts.iter().find(|cut| cut.height(at) < reach && cut.outward.dot(&self.towards_eye) > 0.0);
        near.map(|cut| std::array::from_fn(|a| cut.outward[a] as f32))
    }

    fn part(
        &self,
        from: Vector3<f64>,
        direction: Vector3<f64>,
        [near, far]: [f64; 2],
        cut: Option<Vector3<f64>>,
    ) -> Ray {
        let length = far - near;
        // Not negative: the cast rounds down.
        let whole = (length / self.step_mm + 1e-9) as usize;
        let steps = whole as f64;
        let rest = (length - steps * self.step_mm).max(0.0);
        let at = |t: f64| -> [f32; 3] { std::array::from_fn(|a| (from[a] + t * direction[a]) as f32) };
        let delta: [f32; 3] = std::array::from_fn(|a| (direction[a] * self.step_mm) as f32);
        Ray {
            start: at(near + 0.5 * self.step_mm),
            delta,
            inverse: delta.map(|d| 1.0 / d),
            steps: whole,
            rest_at: at(far - 0.5 * rest),
            rest: if rest > 1e-6 * self.step_mm { (rest / self.step_mm) as f32 } else { 0.0 },
            cut: cut.map(|normal| Cut {
                normal: std::array::from_fn(|a| normal[a] as f32),
                steps: self.steps_behind_cut,
            }),
        }
    }

    /// Where the ray is inside the box of voxels, and in all that is shown [mm along the ray]; the normal of the plane that it begins at, if it does.
    fn clip(&self, from: Vector3<f64>, direction: Vector3<f64>) -> Option<(f64, f64, Option<Vector3<f64>>)> {
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for a in 0..3 {
            let (low, high) = (-0.5, self.dims[a] as f64 - 0.5);
            if direction[a].abs() < 1e-12 {
                if from[a] < low || from[a] > high {
                    return None;
                }
                continue;
            }
            let (t0, t1) = ((low - from[a]) / direction[a], (high - from[a]) / direction[a]);
            near = near.max(t0.min(t1));
            far = far.min(t0.max(t1));
        }
        let mut cut = None;
        for plane in &self.cuts {
            let (height, rise) = (plane.height(from), plane.along.dot(&direction));
            if rise.abs() < 1e-12 {
                if height < 0.0 {
                    return None;
                }
                continue;
            }
            let there = -height / rise;
            if rise < 0.0 {
                far = far.min(there);
            } else if there > near {
                (near, cut) = (there, Some(plane.outward));
            }
        }
        (far.is_finite() && near < far).then_some((near, far, cut))
    }
}

/// Where a camera looks, from how far, and the size of a pixel there at zoom 1 (mm).
struct Placed {
    centre: Vector3<f64>,
    distance: f64,
    pixel_mm: f64,
}

impl Placed {
    /// The sphere round the volume fits across the shorter side.
    fn round_volume(grid: &Grid, params: &RenderParams) -> Self {
        let radius = radius(grid);
        let half_angle = half_angle(params);
        let (distance, half_height) = match params.view.projection {
            Projection::Orthographic => (2.0 * radius, radius),
            Projection::Perspective => (radius / half_angle.sin(), radius / half_angle.cos()),
        };
        let pixel_mm = 2.0 * half_height / params.size[0].min(params.size[1]) as f64;
        Self { centre: centre(grid), distance, pixel_mm }
    }

    /// Places about the middle of the volume fit, seen along these axes: to the right, up, towards the eye.
    fn round_places(
        grid: &Grid,
        params: &RenderParams,
        places: &[Vector3<f64>],
        axes: [Vector3<f64>; 3],
    ) -> Self {
        let extents = Extents::new(places, axes);
        let off_centre: Vector3<f64> =
            axes.iter().zip(extents.middle().iter()).map(|(axis, m)| axis * *m).sum();
        let centre = centre(grid) + off_centre;
        let (distance, half) = match params.view.projection {
            Projection::Orthographic => (off_centre.norm() + 2.0 * radius(grid), extents.half()),
            Projection::Perspective => {
                let far = places.iter().map(|p| (p - off_centre).norm()).fold(0.0, f64::max);
                let distance = far / half_angle(params).sin();
                let mut half = [0.0_f64; 2];
                for place in places {
                    let [x, y, near] = axes.map(|axis| axis.dot(&(place - off_centre)));
                    let scale = distance / (distance - near);
                    half = [half[0].max((x * scale).abs()), half[1].max((y * scale).abs())];
                }
                (distance, half)
            }
        };
        Self { centre, distance, pixel_mm: fit::pixel(half, params.size) }
    }

    /// The same where the view says what lies in the middle, or how far that is.
    fn where_asked(self, grid: &Grid, params: &RenderParams) -> Self {
        let View { target, distance, projection, .. } = params.view;
        let Self { mut centre, distance: mut far, mut pixel_mm } = self;
        if let Some(target) = target {
            centre = Vector3::from(target);
            if projection == Projection::Orthographic {
                // Rays begin outside the volume.
                let off = (centre - self::centre(grid)).norm();
                far = far.max(off + 2.0 * radius(grid));
            }
        }
        if let (Some(asked), Projection::Perspective) = (distance, projection) {
            far = asked;
            let across = params.size[0].min(params.size[1]) as f64;
            pixel_mm = 2.0 * asked * half_angle(params).tan() / across;
        }
        Self { centre, distance: far, pixel_mm }
    }
}

/// Half the angle across the shorter side at zoom 1 [radians].
fn half_angle(params: &RenderParams) -> f64 {
    0.5 * params.view.field_of_view.to_radians()
}

/// Distance of samples along a ray (mm).
pub(crate) fn step_mm(grid: &Grid, params: &RenderParams) -> f64 {
    params.step * grid.shortest_edge()
}

/// The middle of the volume (mm).
pub(crate) fn centre(grid: &Grid) -> Vector3<f64> {
    let dims = grid.dims();
    grid.world(VoxelCoord(Vector3::from_fn(|a, _| 0.5 * (dims[a] - 1) as f64))).0
}

/// The longest way through the volume (mm).
pub(crate) fn diagonal(grid: &Grid) -> f64 {
    2.0 * radius(grid)
}

/// Radius of the sphere round the volume (mm).
fn radius(grid: &Grid) -> f64 {
    let half = grid.dims().map(|n| 0.5 * n as f64);
    let linear = grid.linear_part();
    [[1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]]
        .iter()
        .map(|sign| (linear * Vector3::from_fn(|a, _| half[a] * sign[a])).norm())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::new(
            [20, 30, 10],
            [1.0, 0.5, 3.0],
            [1e6, 5.0, -7.0],
            [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        )
        .unwrap()
    }

    fn camera(view: View) -> Camera {
        Camera::new(&grid(), &RenderParams { view, size: [64, 48], ..RenderParams::default() }, &Held::Volume)
    }

    #[test]
    fn the_default_view_is_from_the_front_with_the_head_up() {
        let c = camera(View::FRONT);
        assert!((c.towards_eye - Vector3::y()).norm() < 1e-12);
        assert!((c.up - Vector3::z()).norm() < 1e-12);
        assert!((c.right + Vector3::x()).norm() < 1e-12, "the patient's left is at the picture's right");
        let feet = camera(View { angles: [0.0, -90.0], ..View::FRONT });
        assert!((feet.up - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn places_lie_within_the_picture_and_one_of_them_at_its_margin() {
        let places: Vec<Vector3<f64>> = [[3.0, 1.0, -2.0], [9.0, -4.0, 1.0], [4.0, 6.0, 12.0]]
            .map(|p| Vector3::from(grid().origin()) + Vector3::from(p))
            .to_vec();
        let held = Held::Places(places.iter().map(|p| p - centre(&grid())).collect());
        for (projection, angles) in [
            (Projection::Orthographic, [0.0, 0.0]),
            (Projection::Orthographic, [211.0, -40.0]),
            (Projection::Perspective, [70.0, 20.0]),
            (Projection::Perspective, [0.0, 90.0]),
        ] {
            let view = View { angles, projection, ..View::FRONT };
            let params = RenderParams { view, size: [640, 480], ..RenderParams::default() };
            let camera = Camera::new(&grid(), &params, &held);
            // Room that is left to the margin of a twenty-fifth of the shorter side, over all places and edges.
            let mut room = f64::INFINITY;
            for place in &places {
                let [x, y] = camera.project(*place).unwrap();
                let margin = 0.04 * 480.0 - 0.5;
                let edges = [x, 639.0 - x, y, 479.0 - y].map(|distance| distance - margin);
                room = edges.into_iter().fold(room, f64::min);
            }
            assert!(room.abs() < 1e-6, "{projection:?} {angles:?}: {room}");
        }
    }

    #[test]
    fn rays_pass_where_their_pixel_projects() {
        for projection in [Projection::Orthographic, Projection::Perspective] {
            let c = camera(View { angles: [33.0, 21.0], zoom: 1.7, projection, ..View::FRONT });
            let ray = c.ray(30, 25).unwrap();
            for i in [0, ray.steps / 2, ray.steps - 1] {
                let voxel = Vector3::from_fn(|a, _| f64::from(ray.at(i)[a]));
                let world = grid().world(VoxelCoord(voxel)).0;
                let [x, y] = c.project(world).unwrap();
                assert!((x - 30.0).abs() < 1e-3 && (y - 25.0).abs() < 1e-3, "{x} {y}");
            }
        }
    }

    #[test]
    fn the_steps_and_the_rest_fill_the_chord() {
        let c = camera(View::FRONT);
        // Along the world's y, which is the grid's x of 20 mm.
        let ray = c.ray(32, 24).unwrap();
        let length = (ray.steps as f64 + f64::from(ray.rest)) * c.step_mm;
        assert!((length - 20.0).abs() < 1e-5, "{length}");
    }

    #[test]
    fn what_the_view_names_lies_in_the_middle_as_far_away_as_it_says() {
        let target = [1e6 + 3.0, 9.0, -2.0];
        for projection in [Projection::Orthographic, Projection::Perspective] {
            let view = View { angles: [33.0, 21.0], projection, target: Some(target), ..View::FRONT };
            let c = camera(view);
            let at = c.project(Vector3::from(target)).unwrap();
            assert!((at[0] - 31.5).abs() < 1e-6 && (at[1] - 23.5).abs() < 1e-6, "{at:?}");
            // Where nothing else is said, everything is as large as without a target.
            assert_eq!(c.pixel_mm, camera(View { target: None, ..view }).pixel_mm);
            assert!(c.ray(31, 23).is_some());
        }
        let view = View {
            projection: Projection::Perspective,
            target: Some(target),
            distance: Some(40.0),
            field_of_view: 60.0,
            ..View::FRONT
        };
        let c = camera(view);
        assert!((c.depth(Vector3::from(target)) - 40.0).abs() < 1e-6);
        // 48 pixels, the shorter side, are 2 · 40 mm · tan 30°.
        assert!((48.0 * c.pixel_mm - 80.0 * 30_f64.to_radians().tan()).abs() < 1e-9);
    }

    #[test]
    fn a_camera_that_rolls_clockwise_leans_what_was_up_to_the_left() {
        let c = camera(View { roll: 90.0, ..View::FRONT });
        let middle = Vector3::from([1e6, 5.0, -7.0]);
        let [x, y] = c.project(middle).unwrap();
        let [right, below] = c.project(middle + Vector3::z()).unwrap();
        assert!(right < x - 0.1 && (below - y).abs() < 1e-6);
    }
}
