//! How errors of single precision grow with an offset of the values, against double precision.

use ivd_core::{Displacement, Exec, FieldBricks, Grid, Volume, VoxelIndex, Voxels};
use ivd_field::warp::WarpParams;
use ivd_segment::{KmvsParams, ThresholdParams};
use ivd_tests::stability::seeded::Seeded;

const SIDE: usize = 16;

/// Values of spread 1 in two heaps five apart.
fn heaps() -> Vec<f64> {
    let mut random = Seeded::new(5);
    let normal = |random: &mut Seeded| (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
    (0..SIDE * SIDE * SIDE).map(|i| normal(&mut random) + if i % 3 == 0 { 5.0 } else { 0.0 }).collect()
}

/// Mean and sum of squared distances from it, in two passes of double precision about the first value.
fn moments(of: &[f64]) -> (f64, f64) {
    let mean = of.iter().map(|v| v - of[0]).sum::<f64>() / of.len() as f64;
    (of[0] + mean, of.iter().map(|v| (v - of[0] - mean).powi(2)).sum())
}

/// A shift by some of a voxel everywhere.
fn shifted(grid: &Grid, by: [f32; 3]) -> Displacement {
    let bricks: usize = grid.dims().map(|n| n.div_ceil(8)).iter().product();
    let field = |v: [f32; 3]| {
        let vectors = vec![v; bricks * FieldBricks::VOXELS];
        FieldBricks::new(grid.dims(), (0..bricks as u32).collect(), vectors.into()).unwrap()
    };
    Displacement::new(grid.clone(), field(by.map(|c| -c)), field(by)).unwrap()
}

/// The trilinear value between voxels of values in double precision.
fn between(grid: &Grid, values: &[f64], at: [usize; 3], by: [f64; 3]) -> f64 {
    (0..8_usize)
        .map(|corner| {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2];
            let w: f64 = (0..3).map(|a| if offset[a] == 1 { by[a] } else { 1.0 - by[a] }).product();
            w * values[grid.linear(VoxelIndex(std::array::from_fn(|a| at[a] + offset[a])))]
        })
        .sum()
}

#[test]
fn errors_of_single_precision_grow_with_the_offset_as_its_rounding_does() {
    let (grid, exec, plain) = (Grid::with_spacing([SIDE; 3], [1.0; 3]).unwrap(), Exec::default(), heaps());
    println!("offset      stored      mean        inertia     warp        threshold mean");
    for power in 0..=7 {
        let offset = 10.0_f64.powi(power);
        let stored: Vec<f32> = plain.iter().map(|v| (v + offset) as f32).collect();
        let exact: Vec<f64> = stored.iter().map(|v| f64::from(*v)).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(stored)).unwrap();
        // Half the distance of neighbouring numbers at the largest value: what storing costs before any stage.
        let unit = f64::from(f32::EPSILON) * (offset + 12.0);
        let storing = plain.iter().zip(&exact).map(|(p, s)| (p + offset - s).abs()).fold(0.0, f64::max);
        assert!(storing <= 0.5 * unit, "{storing}");

        // Sums: against the stored values in double precision, nothing but the rounding of doubles may be left.
        let found =
            ivd_segment::kmvs(&volume, None, &KmvsParams { k: 2, ..KmvsParams::default() }, &exec).unwrap();
        let at = ThresholdParams { values: vec![offset + 2.5] };
        let cut = ivd_segment::threshold(&volume, None, &at, &exec).unwrap();
        let worst = |labels: &ivd_core::Labels| {
            let of = |c: &ivd_core::Class| {
                let own: Vec<f64> =
                    exact.iter().zip(labels.ids()).filter(|(_, id)| **id == c.id).map(|(v, _)| *v).collect();
                let (mean, squares) = moments(&own);
                ((c.mean - mean).abs(), squares)
            };
            let each: Vec<(f64, f64)> = labels.classes().iter().map(of).collect();
            (each.iter().map(|e| e.0).fold(0.0, f64::max), each.iter().map(|e| e.1).sum::<f64>())
        };
        let (mean, inertia) = worst(&found.labels);
        let (threshold_mean, _) = worst(&cut.labels);
        let inertia = (found.objective / inertia - 1.0).abs();
        // k-means takes its means about one of the values: n roundings of the spread, and one of the offset. A threshold
        // keeps running means, which are rounded at their own size once a value.
        let about = f64::EPSILON * (4.0 * offset + 12.0 * plain.len() as f64);
        let running = 0.5 * f64::EPSILON * plain.len() as f64 * (offset + 12.0);
        assert!(mean <= about && threshold_mean <= running, "{mean} {threshold_mean} at {offset}");
        // Squares are taken about a nearby value, so that their error doesn't grow with the offset at all.
        assert!(inertia <= 1e-9, "{inertia} at {offset}");

        // Interpolation: the double-precision value rounded once to single precision.
        let by = [0.375_f32, 0.25, 0.625];
        let warped = ivd_field::warp::volume(&volume, &shifted(&grid, by), &WarpParams::default(), &exec)
            .unwrap()
            .output;
        let mut warp = 0.0_f64;
        for i in 0..grid.len() {
            let v = grid.index(i).0;
            if v.iter().all(|c| c + 1 < SIDE) {
                let expected = between(&grid, &exact, v, by.map(f64::from));
                warp = warp.max((warped.voxels().get(i) - expected).abs());
            }
        }
        assert!(warp <= 0.5 * unit + 16.0 * f64::EPSILON * offset, "{warp} at {offset}");
        println!(
            "{offset:<10e}  {storing:<10.2e}  {mean:<10.2e}  {inertia:<10.2e}  {warp:<10.2e}  {threshold_mean:<10.2e}"
        );
    }
}

#[test]
fn a_vertex_that_is_pulled_alone_never_has_more_energy_than_the_pull_can_give() {
    use ivd_motion::handles::{Action, Anchor, Handle};
    use ivd_motion::ring::{self, RingParams};
    use ivd_tests::stability::meshes;
    use std::sync::{Arc, Mutex};

    /// Keeps every energy that is reported.
    #[derive(Default)]
    struct Energies(Mutex<Vec<f64>>);
    impl ivd_core::Observer for Energies {
        fn iteration(&self, iteration: ivd_core::Iteration) {
            self.0.lock().unwrap().push(iteration.value);
        }
    }

    let grid = Grid::with_spacing([12; 3], [1.0; 3]).unwrap();
    let lattice = meshes::islands(&grid, &[[5.3, 5.4, 5.6]], 3.0);
    let (force, mut seen) = (0.25, 0);
    for stiffness in [1e-6, 1e-2, 50.0, 1e6, 1e12] {
        for (duration, dt) in [(0.2, 1e-3), (1e-9, 1e-11), (1e3, 1.0), (1e3, 31.0), (1e-3, 1e-5)] {
            for damping in [0.0, 1.0, 100.0] {
                let energies = Arc::new(Energies::default());
                let exec = Exec::default().with_observer(energies.clone());
                // Within the radius lies the target alone: a mass on a spring to the ground, and springs to what is still.
                let handle = Handle {
                    at: Anchor::Vertex(0),
                    action: Action::Force([force * stiffness, 0.5 * force * stiffness, -force * stiffness]),
                    radius: 1.0,
                };
                let params =
                    RingParams { stiffness, duration, dt: Some(dt), damping, ..RingParams::default() };
                let solved = ring::solve(&lattice, &[handle], &[], &params, &exec).unwrap();
                // With H = ½ k u² + springs + ½ m v² − F·u ≤ 0 from rest, |u| ≤ 2 |F| / k and the energy is F·u at most.
                let pull = 1e3 * stiffness * force * 1.5;
                let ground = 1e3 * stiffness;
                let most = 2.0 * pull * pull / ground * (1.0 + 1e-9);
                for energy in energies.0.lock().unwrap().iter() {
                    assert!(
                        (0.0..=most).contains(energy),
                        "{energy} nJ of {most}, stiffness {stiffness}, dt {dt}"
                    );
                    seen += 1;
                }
                let [x, y, z] = solved.motion.frames()[0].displacement[0];
                let work = 1e3 * stiffness * force * (x + 0.5 * y - z);
                let slack = 1e-9 * most;
                assert!(solved.energy_last <= work + slack, "{} nJ of {work} nJ of work", solved.energy_last);
            }
        }
    }
    assert!(seen > 1000);
}
