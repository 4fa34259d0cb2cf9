//! Times the kernels of a device beside the processor's, on a generated volume: `measure_gpu [SIDE] [WIDTH HEIGHT] [FRAMES] [joined]`, `joined`
//! where products may be joined with the sums that they go into. Prints a JSON object for
//! each picture, and one for the device. Needs no file and no network.

mod kernels;

use std::error::Error;
use std::time::Instant;

use ivd_core::{Displacement, Exec, FieldBricks, Grid, NO_BRICK, TransferFunction, Volume, Voxels};
use ivd_gpu::{Choice, Gpu, Options, SharedGpu};
use ivd_render::{Mode, Prepared, Radiance, RenderParams, Scene, View};

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<usize> = std::env::args()
        .skip(1)
        .filter(|word| word != "joined")
        .map(|word| word.parse())
        .collect::<Result<_, _>>()?;
    let number = |i: usize, otherwise: usize| numbers.get(i).copied().unwrap_or(otherwise);
    let (side, size, frames) = (number(0, 512), [number(1, 1920), number(2, 1080)], number(3, 20));
    let joined = std::env::args().any(|word| word == "joined");
    let planted =
        if joined { vec![(" ^ params.part.w", ""), (" ^ vec3<u32>(params.part.w)", "")] } else { Vec::new() };
    let opening = Instant::now();
    let gpu = Gpu::open(Options { choice: Choice::from_env(), timed: true, planted, ..Options::default() })?;
    let opened_ms = opening.elapsed().as_secs_f64() * 1e3;
    let adapter = gpu.adapter().clone();
    let copy = gpu.copy_bandwidth((side * side * side) as u64)?;
    println!(
        "{{\"adapter\":{:?},\"driver\":{:?},\"kind\":{:?},\"opened_ms\":{opened_ms:.1},\"copy_gb_s\":{:.1},\"threads\":{}}}",
        adapter.name,
        adapter.driver,
        adapter.kind,
        copy / 1e9,
        Exec::default().threads()
    );
    let volume = head(side)?;
    let moved = pushed(volume.grid())?;
    let transfer = transfer()?;
    let caster = SharedGpu::new(gpu);
    if !joined {
        let small = SharedGpu::new(Gpu::open(Options { choice: Choice::from_env(), ..Options::default() })?);
        let head = head(64)?;
        let scene = Scene { transfer: Some(&transfer), ..Scene::new(&head) };
        let params = RenderParams { size: [512; 2], annotate: false, ..RenderParams::default() };
        let prepared = Prepared::new(&scene, &params, &Exec::default())?;
        // A card that has nothing to do runs at a fraction of its pace, and takes a while to come back to it.
        let is_software = adapter.is_software();
        let pace = || -> Result<(), Box<dyn Error>> {
            let start = Instant::now();
            // Software has no such pace.
            while !is_software && start.elapsed().as_secs_f64() < 0.15 {
                prepared.with_plan(params.view, |plan| small.cast(plan, &Exec::default()))??;
            }
            Ok(())
        };
        kernels::measure(&caster, &volume, &moved, copy, &pace)?;
    }
    let (device, processor) = (Exec::default(), Exec::default());
    for (moves, displacement) in [("rest", None), ("deformed", Some(&moved))] {
        for (look, mode, shading) in [
            ("dvr", Mode::Dvr, false),
            ("dvr shaded", Mode::Dvr, true),
            ("mip", Mode::Mip, false),
            ("iso", Mode::Iso { value: 100.0 }, true),
        ] {
            let scene = Scene { transfer: Some(&transfer), displacement, ..Scene::new(&volume) };
            let params = RenderParams { size, mode, shading, annotate: false, ..RenderParams::default() };
            let prepared = Prepared::new(&scene, &params, &processor)?;
            let view = |i: usize| View { angles: [30.0 + 10.0 * i as f64, 15.0], ..params.view };
            // The first brings everything and makes the pipeline.
            let first = Instant::now();
            prepared.with_plan(view(0), |plan| caster.cast(plan, &device))??;
            let first_ms = first.elapsed().as_secs_f64() * 1e3;
            let (mut device_ns, mut wall_ns) = (Vec::new(), Vec::new());
            let mut last: Option<Radiance> = None;
            for i in 0..frames {
                let (radiance, timed) = prepared.with_plan(view(i), |plan| caster.timed(plan, &device))??;
                device_ns.push(timed.device_ns);
                wall_ns.push(timed.wall_ns);
                last = Some(radiance);
            }
            let start = Instant::now();
            let plain = prepared.radiance(view(frames - 1), &processor)?;
            let processor_ms = start.elapsed().as_secs_f64() * 1e3;
            let last = last.ok_or("no frame")?;
            let apart = worst(&plain, &last);
            device_ns.sort_unstable();
            wall_ns.sort_unstable();
            let middle = |ns: &[u64]| ns[ns.len() / 2] as f64 / 1e6;
            println!(
                "{{\"picture\":\"{look}\",\"volume\":\"{side}^3 u8, {moves}\",\"size\":\"{}x{}\",\"first_ms\":{first_ms:.2},\"device_ms\":{:.3},\"with_read_back_ms\":{:.2},\"processor_ms\":{processor_ms:.1},\"samples_m\":{:.1},\"ns_a_sample\":{:.4},\"frames_s\":{:.1},\"worst\":{:.2e},\"beyond_1e-6_1e-4_1/255\":{:?}}}",
                size[0],
                size[1],
                middle(&device_ns),
                middle(&wall_ns),
                last.samples as f64 / 1e6,
                middle(&device_ns) * 1e6 / last.samples as f64,
                1e3 / middle(&device_ns),
                apart.0,
                apart.1,
            );
        }
    }
    Ok(())
}

/// A head's worth of values: a skull round something soft, with the noise of a scan.
fn head(side: usize) -> Result<Volume, Box<dyn Error>> {
    let grid = Grid::with_spacing([side; 3], [1.0; 3])?;
    let middle = 0.5 * (side as f32 - 1.0);
    let mut voxels = vec![0_u8; grid.len()];
    ivd_core::parallel::for_each_piece_mut(&mut voxels, side * side, &|z, layer| {
        for (i, voxel) in layer.iter_mut().enumerate() {
            let at = [i % side, i / side, z].map(|c| (c as f32 - middle) / middle);
            let r = (at[0] * at[0] / 0.6 + at[1] * at[1] / 0.8 + at[2] * at[2] / 0.9).sqrt();
            let folds = 0.02 * ((at[0] * 40.0).sin() * (at[1] * 37.0).sin() * (at[2] * 43.0).sin());
            let value = match r + folds {
                r if r > 0.95 => 8.0,
                r if r > 0.90 => 110.0,
                r if r > 0.84 => 220.0,
                r if r > 0.80 => 60.0,
                _ => 130.0 + 40.0 * (at[0] * 25.0).sin() * (at[1] * 25.0).cos() * (at[2] * 25.0).sin(),
            };
            let hash = ((z * side * side + i) as u32).wrapping_mul(2_654_435_761) >> 24;
            *voxel = (value + (hash as f32 - 127.5) / 32.0).clamp(0.0, 255.0) as u8;
        }
    });
    Ok(Volume::new(grid, Voxels::from(voxels))?)
}

/// Skin that is seen through, bone, and what lies within.
fn transfer() -> Result<TransferFunction, ivd_core::Error> {
    let entry = |i: usize| match i {
        0..90 => [0.0; 4],
        90..125 => [0.9, 0.7, 0.6, 0.02],
        125..180 => [0.8, 0.3, 0.3, 0.08],
        _ => [0.95, 0.93, 0.85, 0.35],
    };
    TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0], (0..256).map(entry).collect(), vec![])
}

/// A push that falls to nothing at a third of the volume's side: about a seventh of its bricks move.
fn pushed(grid: &Grid) -> Result<Displacement, ivd_core::Error> {
    let dims = grid.dims();
    let bricks = dims.map(|n| n.div_ceil(8));
    let (reach, centre) = (dims[0] as f32 / 3.0, dims.map(|n| n as f32 * 0.6));
    let vector = |v: [usize; 3]| -> [f32; 3] {
        let square: f32 = (0..3).map(|a| ((v[a] as f32 - centre[a]) / reach).powi(2)).sum();
        let near = (1.0 - square).max(0.0);
        [0.08 * reach * near * near, -0.05 * reach * near * near, 0.02 * reach * near]
    };
    let (mut table, mut vectors) = (Vec::new(), Vec::new());
    for b in 0..bricks.iter().product::<usize>() {
        let at = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
        let inside = |v: &[usize; 3]| (0..3).all(|a| v[a] < dims[a]);
        let place = |i: usize| [8 * at[0] + i % 8, 8 * at[1] + i / 8 % 8, 8 * at[2] + i / 64];
        let brick: Vec<[f32; 3]> =
            (0..512).map(place).map(|v| if inside(&v) { vector(v) } else { [0.0; 3] }).collect();
        if brick.iter().any(|v| *v != [0.0; 3]) {
            table.push((vectors.len() / 512) as u32);
            vectors.extend(brick);
        } else {
            table.push(NO_BRICK);
        }
    }
    let inverse = FieldBricks::new(dims, table, vectors.into())?;
    Displacement::new(grid.clone(), FieldBricks::zero(dims), inverse)
}

/// The greatest difference of a channel, and the shares of the pixels with one of more than 1e-6, 1e-4 and 1/255.
fn worst(a: &Radiance, b: &Radiance) -> (f32, [f64; 3]) {
    let far = |(p, q): (&[f32; 4], &[f32; 4])| (0..4).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
    let all: Vec<f32> = a.rgba.iter().zip(&b.rgba).map(far).collect();
    let beyond = [1e-6, 1e-4, 1.0 / 255.0]
        .map(|least| all.iter().filter(|d| **d > least).count() as f64 / all.len() as f64);
    (all.into_iter().fold(0.0, f32::max), beyond)
}
