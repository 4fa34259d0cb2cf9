use ivd_render::plan::{Plan, PlanCamera, PlanLook, PlanRay};

/// Pixels along a tile's edge: a workgroup.
pub(super) const TILE: usize = 8;

/// Quadruples of the shader's `Params`.
const PARAMS: usize = 21;
pub(super) const PARAMS_BYTES: u64 = 16 * PARAMS as u64;
/// Numbers of the camera.
const CAMERA: usize = 15;
pub(super) const CAMERA_BYTES: u64 = 8 * CAMERA as u64;
/// Bytes of a ray.
pub(super) const RAY_BYTES: u64 = 48;

/// A rectangle of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part {
    /// First column and row.
    pub(super) first: [usize; 2],
    /// Columns and rows.
    pub(super) size: [usize; 2],
}

impl Part {
    pub(super) fn pixels(self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Tiles across and down.
    pub(super) fn tiles(self) -> [usize; 2] {
        self.size.map(|n| n.div_ceil(TILE))
    }
}

/// The shader's `Params`, word for word; `number` is the submission's.
pub(super) fn params(plan: &Plan<'_>, part: Part, number: u32) -> [[u32; 4]; PARAMS] {
    let [width, rows] = part.size;
    let tiles = part.tiles()[0];
    let whole = |[x, y, z]: [usize; 3]| [x as u32, y as u32, z as u32, 0];
    let bits = |v: [f32; 4]| v.map(f32::to_bits);
    let vector = |[x, y, z]: [f32; 3]| bits([x, y, z, 0.0]);
    let (none, mut axis, mut steep_axis, mut steep) = ([0.0_f32; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
    let (mut look, mut colour, mut flags) = ([0.0_f32; 4], none, [0, 0, 0, number]);
    let mut bricks = whole(plan.bricks);
    flags[0] = (2 * plan.bricks.iter().product::<usize>()) as u32;
    match plan.look {
        PlanLook::Classified { table, axis: of_values, steep: by_gradient, termination, .. } => {
            (axis, look[0]) = (of_values, termination);
            flags[1] = table.len() as u32;
            if let Some(by) = by_gradient {
                (steep_axis, steep) = (by.axis, [by.gradient[0], by.gradient[1], plan.lamp.unit]);
                bricks[3] = by.values as u32;
            }
        }
        PlanLook::Maximum { sign, skip, .. } => {
            look[1] = sign;
            flags[2] |= if skip { 2 } else { 0 };
        }
        PlanLook::Surface { iso, sign, colour: of_surface } => {
            (look, colour) = ([iso, sign, 0.0, 0.0], of_surface);
        }
    }
    let vacates = plan.moved.is_some_and(|moved| !moved.displacement.vacated().is_empty());
    flags[2] |= u32::from(vacates);
    let rows_of_warp = plan.moved.map_or([none; 3], |moved| moved.rows);
    let [x, y, z] = plan.lamp.to_world;
    let [wx, wy, wz] = rows_of_warp;
    let [top, end] = plan.ends;
    [
        whole(plan.dims()),
        whole(plan.next),
        bricks,
        [width as u32, rows as u32, tiles as u32, 0],
        vector(top),
        vector(end),
        vector(axis),
        vector(steep_axis),
        vector(steep),
        bits(look),
        vector(colour),
        vector(plan.lamp.lamp),
        vector(plan.lamp.halfway),
        vector(plan.lamp.shares),
        vector(x),
        vector(y),
        vector(z),
        vector(wx),
        vector(wy),
        vector(wz),
        flags,
    ]
}

/// Words that say which part of which picture.
const PICTURE: usize = 10;
pub(super) const PICTURE_BYTES: u64 = 4 * PICTURE as u64;

/// What the shader makes rays of: the camera, and which part of which picture.
pub(super) fn camera(plan: &Plan<'_>, part: Part) -> ([f64; CAMERA], [u32; PICTURE]) {
    let PlanCamera { start, right, up, away, distance, pixel, step, perspective } = plan.camera();
    let mut numbers = [0.0; CAMERA];
    for (into, v) in numbers.chunks_mut(3).zip([start, right, up, away, [distance, pixel, step]]) {
        into.copy_from_slice(&v);
    }
    let ([width, height], [nx, ny, nz]) = (plan.size(), plan.dims());
    let ([x, y], [columns, rows]) = (part.first, part.size);
    let words = [width, height, usize::from(perspective), nx, ny, nz, x, y, columns, rows];
    (numbers, words.map(|n| n as u32))
}

/// A ray as it lies in memory.
pub(super) type RayWords = [u32; RAY_BYTES as usize / 4];

/// The rays of a part's pixels, rows from the top; one that misses the volume has no steps. By one thread: whoever calls holds a lock.
pub(super) fn rays(plan: &Plan<'_>, part: Part) -> Vec<RayWords> {
    let ([x, y], [columns, rows]) = (part.first, part.size);
    let pixels = (0..rows).flat_map(|j| (0..columns).map(move |i| [x + i, y + j]));
    let words = pixels.map(|[x, y]| {
        let Some(PlanRay { start: s, delta: d, steps, rest_at: r, rest }) = plan.ray(x, y) else {
            return [0; 12];
        };
        let b = f32::to_bits;
        [b(s[0]), b(s[1]), b(s[2]), steps, b(d[0]), b(d[1]), b(d[2]), b(rest), b(r[0]), b(r[1]), b(r[2]), 0]
    });
    words.collect()
}
