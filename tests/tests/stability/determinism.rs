//! The same bytes for 1, 2, 3 and 8 threads, again and again (20 times in the long form), with the processor's own instructions and without.

use ivd_core::{Grid, Volume, Voxels};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_tests::stability::backend::BACKENDS;
use ivd_tests::stability::case::Case;
use ivd_tests::stability::determinism::same_bytes;
use ivd_tests::stability::scene::scene;
use ivd_tests::stability::seeded::Seeded;

use crate::stability::asked;

const THREADS: [usize; 4] = [1, 2, 3, 8];

/// A noisy ball in single precision, of enough voxels that work on it is shared out.
fn large(side: usize) -> Case {
    let grid = Grid::with_spacing([side, side, side + 3], [0.7, 0.8, 1.1]).unwrap();
    let mut random = Seeded::new(11);
    let middle = 0.5 * side as f64;
    let values: Vec<f32> = (0..grid.len())
        .map(|i| {
            let r = grid.index(i).0.iter().map(|c| (*c as f64 - middle).powi(2)).sum::<f64>().sqrt();
            (1000.0 - 40.0 * (r - 0.3 * side as f64) + random.between(-60.0, 60.0)) as f32
        })
        .collect();
    let mut case =
        Case::new(format!("noisy ball of {side}"), Volume::new(grid, Voxels::from(values)).unwrap());
    case.setup.k = 3;
    let action = Action::Move([1.5, -1.0, 2.0]);
    case.setup.handles = vec![Handle { at: Anchor::Vertex(40), action, radius: 0.4 * side as f64 }];
    case.setup.render.size = [40, 30];
    case
}

#[test]
fn every_stage_gives_the_same_bytes_on_any_number_of_threads() {
    let runs = asked("IVD_STRESS_RUNS", 1) as usize;
    let scenes = asked("IVD_STRESS_MATRIX", 1);
    for on in BACKENDS {
        for seed in 0..scenes {
            same_bytes(on, &scene(10_000 + seed), &THREADS, runs).unwrap();
        }
        same_bytes(on, &large(17), &THREADS, runs).unwrap();
        // Beyond the 2^16 voxels that one task takes: on all of these numbers in the long form, else on the least and the most.
        let (threads, again) =
            if runs > 1 { (&THREADS[..], (runs * scenes as usize).div_ceil(20)) } else { (&[1, 8][..], 1) };
        same_bytes(on, &large(42), threads, again).unwrap();
    }
}
