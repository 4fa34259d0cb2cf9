//! Random scenes: a tiny volume of any kind and any questions, from a seed.

use ivd_core::{ClassChoice, ErrorClass, Grid, Scalar, Volume, VoxelCoord, Voxels};
use ivd_field::shape::{Kind, Shape};
use ivd_field::warp::{Order, WarpParams};
use ivd_lattice::refine::{RefineParams, Target};
use ivd_map::{Band, DepthWeight, Limit, OctreeParams, Outside};
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::ring::{Couple, RingParams};
use ivd_render::{Fit, Mode, Projection, RenderParams, View};
use nalgebra::{Rotation3, Vector3};

use super::case::{Case, Cut, Setup, Stage, TURNS};
use super::seeded::Seeded;

/// Refusals that a random scene may end with: a limit or a result that can't be trusted; and a handle that has no vertex
/// to hold, or two that contradict each other on one.
pub const ALLOWED: [(Stage, ErrorClass); 5] = [
    (Stage::DeformShapes, ErrorClass::Untrusted),
    (Stage::Deform, ErrorClass::Untrusted),
    (Stage::Deform, ErrorClass::Usage),
    (Stage::Map, ErrorClass::Untrusted),
    (Stage::Map, ErrorClass::Limit),
];

/// The scene of a seed.
pub fn scene(seed: u64) -> Case {
    let mut random = Seeded::new(seed);
    let grid = grid(&mut random);
    let field = field(&mut random, &grid);
    let volume = volume(&mut random, &grid, &field);
    let mut setup = setup(&mut random, &volume);
    setup.turn = Some(seed as usize % TURNS);
    let handles = 1 + random.below(3);
    let (length, handle) = (grid.voxel_diagonal(), &mut random);
    setup.springs = springs(&mut Seeded::new(seed ^ 0x5b71), setup.ring.stiffness);
    setup.shapes = shapes(&mut Seeded::new(seed ^ 0x5a4e), &grid);
    setup.handles = (0..handles).map(|_| grip(handle, length, setup.ring.stiffness)).collect();
    let mut case = Case::new(format!("scene {seed}"), volume).may(&ALLOWED);
    case.setup = setup;
    case
}

/// A grid of 6³ to 20³ voxels, in any place, turned, mirrored and stretched.
pub(super) fn grid(random: &mut Seeded) -> Grid {
    let most = random.pick(&[6, 9, 12, 12, 16]);
    let dims = std::array::from_fn(|_| 6 + random.below(most - 5 + 4));
    let scale = if random.one_in(4) { random.spread(1e-3, 1e3) } else { random.between(0.4, 2.0) };
    let stretch = random.pick(&[1.0, 1.0, 1.5, 3.0, 50.0]);
    let mut spacing: [f64; 3] = [scale; 3];
    spacing[random.below(3)] *= stretch;
    let far = random.pick(&[0.0, 100.0, 100.0, 1e6]);
    let origin = std::array::from_fn(|_| random.between(-far, far));
    Grid::new(dims, spacing, origin, direction(random)).expect("a sound grid")
}

/// The identity, an axis order, a rotation; now and then left-handed.
fn direction(random: &mut Seeded) -> [[f64; 3]; 3] {
    let mut columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    match random.below(4) {
        0 => {}
        1 => columns.rotate_left(1 + random.below(2)),
        _ => {
            let axis = nalgebra::Unit::new_normalize(Vector3::from(random.vector(1.0)));
            let turn = Rotation3::from_axis_angle(&axis, random.between(-3.0, 3.0));
            columns = columns.map(|c| (turn * Vector3::from(c)).into());
        }
    }
    if random.one_in(3) {
        columns[0] = columns[0].map(|c| -c);
    }
    columns
}

/// Values about 0…1 with the surface near a half.
fn field(random: &mut Seeded, grid: &Grid) -> Vec<f64> {
    let dims = grid.dims();
    let least = dims.into_iter().min().expect("three axes") as f64;
    let centre: [f64; 3] = std::array::from_fn(|a| dims[a] as f64 * random.between(0.35, 0.65) - 0.5);
    let radius = least * random.between(0.2, 0.45);
    let kind = random.below(9);
    let blobs: Vec<([f64; 3], f64)> = (0..4)
        .map(|_| (std::array::from_fn(|a| random.between(0.0, dims[a] as f64)), random.between(1.0, 3.0)))
        .collect();
    let steep = random.between(0.1, 1.0);
    let value = |i: usize, random: &mut Seeded| {
        let at = grid.index(i).0;
        let from = |c: &[f64; 3]| (0..3).map(|a| (at[a] as f64 - c[a]).powi(2)).sum::<f64>();
        let distance = from(&centre).sqrt() - radius;
        match kind {
            0 | 1 => 0.5 - steep * distance / 4.0,
            2 => blobs.iter().map(|(c, w)| (-from(c) / (w * w)).exp()).sum(),
            3 => random.unit(),
            4 => f64::from(u8::from(at.iter().sum::<usize>() % 2 == 0)),
            5 => at[0] as f64 / dims[0] as f64,
            6 => f64::from(u8::from(distance.abs() < 0.9)),
            7 => {
                let w = at.map(|c| c as f64 * 6.0 * steep / 3.0);
                0.5 + (w[0].sin() * w[1].cos() + w[1].sin() * w[2].cos() + w[2].sin() * w[0].cos()) / 4.0
            }
            _ => 0.5 - steep * distance / 4.0 + 0.3 * (random.unit() - 0.5),
        }
    };
    (0..grid.len()).map(|i| value(i, random).clamp(0.0, 1.0)).collect()
}

/// The field as some stored type, with gaps now and then.
fn volume(random: &mut Seeded, grid: &Grid, field: &[f64]) -> Volume {
    fn of<T: Scalar>(field: &[f64], real: impl Fn(f64) -> f64) -> Voxels {
        T::wrap(field.iter().map(|v| T::from_f64(real(*v))).collect::<Vec<T>>().into())
    }
    let levels = random.pick(&[3.0, 20.0, 100.0, 120.0]);
    let wide = random.pick(&[100.0, 4096.0, 30_000.0]);
    let gaps = random.one_in(3);
    let real = random.pick(&[(1.0, 0.0), (1000.0, -1000.0), (1.0, 1e7), (1e-30, 0.0), (1e30, 0.0)]);
    let pick = random.below(8);
    let mut holed: Vec<f64> = field.iter().map(|v| v * real.0 + real.1).collect();
    if gaps {
        for v in &mut holed {
            if random.one_in(40) {
                *v = random.pick(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
            }
        }
    }
    let voxels = match pick {
        0 => of::<u8>(field, |v| v * levels * 2.0),
        1 => of::<i8>(field, |v| v * levels - 60.0),
        2 => of::<u16>(field, |v| (v * wide / 16.0).floor() * 16.0),
        3 => of::<i16>(field, |v| if v < 0.02 { -2000.0 } else { v * wide }),
        4 => of::<u32>(field, |v| v * 4e9),
        5 => of::<i32>(field, |v| v * 4e9 - 2e9),
        6 => of::<f32>(&holed, |v| v),
        _ => of::<f64>(&holed, |v| v),
    };
    // Scales that are exact for integers, so that a plain comparison of real values is exact too.
    let (slope, intercept) =
        if pick < 6 { random.pick(&[(1.0, 0.0), (2.0, -1024.0), (-0.5, 16.0)]) } else { (1.0, 0.0) };
    Volume::with_scale(grid.clone(), voxels, slope, intercept).expect("a value a voxel")
}

fn setup(random: &mut Seeded, volume: &Volume) -> Setup {
    let range = volume.range().unwrap_or([0.0, 1.0]);
    let length = volume.grid().voxel_diagonal();
    let mut within = || range[0] + (range[1] - range[0]) * random.between(0.1, 0.9);
    let mut thresholds = vec![within(), within(), within()];
    thresholds.sort_by(f64::total_cmp);
    thresholds.dedup();
    let cut_at = within();
    let ring = ring(random);
    let target = match random.below(4) {
        0 => Target::Level(random.below(4) as u8),
        1 => Target::Ratio(random.unit()),
        2 => Target::MaxError(random.spread(1e-3, 2.0) * length),
        _ => Target::Level(1),
    };
    Setup {
        k: 1 + random.below(6),
        turn: None,
        thresholds,
        boundary: ivd_boundary::ComponentParams {
            class: random.pick(&[None, Some(ClassChoice::Densest), Some(ClassChoice::Largest)]),
            fill_holes: !random.one_in(3),
            ..ivd_boundary::ComponentParams::default()
        },
        cut: random.pick(&[Cut::Part, Cut::Part, Cut::Mask, Cut::Value(cut_at)]),
        refine: RefineParams { target: target.into(), ..RefineParams::default() },
        octree: ivd_octree::Params { leaf_size: random.pick(&[1, 2, 4, 4, 8]) },
        fixed: if random.one_in(4) { vec![fix(random, length)] } else { Vec::new() },
        ring,
        map: map(random, length),
        warp: WarpParams {
            order: random.pick(&[Order::Nearest, Order::Linear, Order::Linear, Order::Cubic]),
            background: random.pick(&[None, Some(range[0])]),
        },
        render: render(random, cut_at),
        ..Setup::default()
    }
}

fn ring(random: &mut Seeded) -> RingParams {
    let duration = if random.one_in(4) { random.spread(1e-9, 1e3) } else { 0.2 };
    RingParams {
        stiffness: if random.one_in(4) { random.spread(1e-6, 1e12) } else { 50.0 },
        duration,
        dt: Some(duration / 36.0),
        ground: random.pick(&[1.0, 1.0, 1e-2, 100.0]),
        damping: random.pick(&[1.0, 1.0, 0.1, 30.0]),
        couple: random.pick(&[Couple::Inside, Couple::Inside, Couple::Straight, Couple::Edges]),
        literal: random.one_in(40),
        ..RingParams::default()
    }
}

fn springs(random: &mut Seeded, stiffness: f64) -> mass_spring::Params {
    let wide = |random: &mut Seeded, usual: f64, from: f64, to: f64| {
        if random.one_in(6) { random.spread(from, to) } else { usual }
    };
    let mut params = mass_spring::Params {
        springs: mass_spring::Springs {
            stiffness,
            shear: random.pick(&[0.5, 0.5, 0.0, 2.0]),
            flexion: random.pick(&[0.5, 0.5, 0.0, 2.0]),
            ground: random.pick(&[0.0, 0.0, 1e-3, 1.0, 100.0]),
            push: random.pick(&[None, Some(true), Some(true), Some(false)]),
            strain_limit: random.pick(&[None, None, Some(0.0), Some(0.3)]),
            density: wide(random, 1e-3, 1e-9, 1e3),
            drag: random.pick(&[100.0, 100.0, 0.0, 1e4]),
            duration: wide(random, 0.01, 1e-9, 1e-1),
            dt: random.pick(&[None, Some(0.01), Some(0.001)]),
            ramp: random.pick(&[None, None, Some(0.0)]),
            frames: random.pick(&[1, 1, 1, 3]),
            ..mass_spring::Springs::default()
        },
        closeness: mass_spring::Closeness { tolerance: random.pick(&[1e-3, 1e-3, 1e-8]), max_iterations: 20 },
        descent: mass_spring::Descent {
            history: random.pick(&[8, 8, 0, 3]),
            ..mass_spring::Descent::default()
        },
        ..mass_spring::Params::default()
    };
    params.springs.grip = random.pick(&[Some(0.0), None]);
    params
}

/// Up to two free forms that are mostly moderate.
fn shapes(random: &mut Seeded, grid: &Grid) -> Vec<Shape> {
    let length = grid.voxel_diagonal();
    let count = random.below(3);
    let shape = |_| {
        let amount = if random.one_in(8) { random.spread(1e-9, 1e3) } else { random.between(0.0, 1.0) };
        let mut kind = match random.below(8) {
            0 => Kind::Translate { by: random.vector(amount * length) },
            1 => Kind::Rotate { angle: 40.0 * amount },
            2 => Kind::Scale {
                along: Some(1.0 + amount.min(900.0)),
                across: Some(1.0 / (1.0 + amount.min(900.0))),
            },
            3 => Kind::Stretch { factor: 1.0 + amount.min(900.0) },
            4 => Kind::Squeeze { factor: 1.0 / (1.0 + amount.min(900.0)) },
            5 => Kind::Twist { rate: (20.0 * amount / length).min(1e6), length: None },
            6 => Kind::Taper { rate: (0.1 * amount / length).min(1e6), length: None },
            _ => Kind::Bend { rate: (10.0 * amount / length).min(1e6), spine: [0.0, 0.6, 0.8], length: None },
        };
        let voxel = std::array::from_fn(|a| random.between(0.0, grid.dims()[a] as f64));
        let axis = [1.0, random.between(-0.5, 0.5), 0.0];
        let radius = random.between(1.0, 8.0) * length;
        let core = random.pick(&[0.0, 0.0, 0.5, 0.99]);
        let end = random.pick(&[None, None, Some(3.0 * length)]);
        if let Kind::Twist { length, .. } | Kind::Taper { length, .. } | Kind::Bend { length, .. } = &mut kind
        {
            *length = end;
        }
        Shape { kind, centre: grid.world(VoxelCoord(Vector3::from(voxel))).0.into(), axis, radius, core }
    };
    (0..count).map(shape).collect()
}

fn fix(random: &mut Seeded, length: f64) -> Pin {
    Pin { at: Anchor::Vertex(random.bits() as u32), radius: random.pick(&[0.0, 1.0, 3.0]) * length }
}

/// A handle whose motion is mostly one that its radius can follow, now and then anything.
fn grip(random: &mut Seeded, length: f64, stiffness: f64) -> Handle {
    let radius = random.between(2.0, 7.0) * length;
    let far = match random.below(20) {
        0 => 0.0,
        1 => random.spread(1e-9, 1e30),
        2..=4 => random.between(0.3, 1.5) * radius,
        _ => random.between(0.02, 0.3) * radius,
    };
    let way = random.vector(far);
    // 1 N/m moves a vertex 1 mm for 1 mN; wild stiffnesses make wild forces.
    let pull = way.map(|c| (c * stiffness).clamp(-1e30, 1e30));
    let action = if random.one_in(3) { Action::Force(pull) } else { Action::Move(way) };
    Handle { at: Anchor::Vertex(random.bits() as u32), action, radius }
}

fn map(random: &mut Seeded, length: f64) -> OctreeParams {
    let weights = [DepthWeight::Linear, DepthWeight::Smooth, DepthWeight::Exponential, DepthWeight::One];
    let margin = random.between(1.0, 6.0) * length;
    OctreeParams {
        weight: random.pick(&weights),
        band: Band {
            outside: random.pick(&[Outside::Band, Outside::Band, Outside::Free]),
            margin: random.pick(&[None, None, Some(margin)]),
            tolerance: random.pick(&[0.5, 0.5, 1.0]),
            limit: random.pick(&[Limit::Refuse, Limit::Refuse, Limit::Stop]),
        },
        ..OctreeParams::default()
    }
}

fn render(random: &mut Seeded, value: f64) -> RenderParams {
    let projection = random.pick(&[Mode::Mip, Mode::Minip, Mode::Mean, Mode::Lmip { threshold: None }]);
    RenderParams {
        size: [5 + random.below(20), 5 + random.below(12)],
        mode: random.pick(&[Mode::Dvr, Mode::Dvr, Mode::Dvr, projection, Mode::Iso { value }]),
        view: View {
            angles: [random.between(-180.0, 180.0), random.pick(&[0.0, -90.0, 90.0, 37.0])],
            zoom: random.pick(&[1.0, 1.0, 4.0]),
            projection: random.pick(&[Projection::Orthographic, Projection::Perspective]),
            ..View::FRONT
        },
        fit: random.pick(&[Fit::Visible, Fit::Visible, Fit::Volume]),
        step: random.between(0.3, 1.5),
        termination: random.pick(&[0.99, 2.0]),
        shading: !random.one_in(3),
        annotate: false,
        ..RenderParams::default()
    }
}
