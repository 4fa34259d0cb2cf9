//! Voxels coupled to their neighbours.

use super::*;

#[test]
fn neighbours_mend_a_noisy_phantom_and_the_energy_never_rises() {
    for (dims, spacing, missing) in [([33, 30, 28], [1.0; 3], false), ([32, 31, 9], [1.0, 1.0, 4.0], true)] {
        let (values, mut truth) = layers(dims, &[60.0, 100.0, 140.0], 22.0, 4);
        let mut reals: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        if missing {
            for i in (0..reals.len()).step_by(37) {
                reals[i] = f32::NAN;
                truth[i] = 0;
            }
        }
        for volume in [
            volume(dims, spacing, reals),
            volume(dims, spacing, values.iter().map(|v| *v as u8).collect::<Vec<_>>()),
        ] {
            for shape in SHAPES {
                let plain = run(&volume, &EmvsParams { covariance: shape, ..with_k(3) });
                let params = EmvsParams { covariance: shape, smoothing: 1.0, tolerance: 0.0, ..with_k(3) };
                let (coupled, maps) = emvs_with_posteriors(&volume, None, &params, &Exec::default()).unwrap();
                // On intensity the external field is still sought in the first half of the sweeps.
                assert_eq!(coupled.energies.len(), if shape == Covariance::Intensity { 10 } else { 20 });
                assert!(
                    coupled.energies.windows(2).all(|w| w[1] <= w[0] + 1e-12 * w[0].abs()),
                    "{:?}",
                    coupled.energies
                );
                for id in 1..=3 {
                    let [before, after] =
                        [&plain, &coupled].map(|f| dice(f.segmentation.labels.ids(), &truth, id));
                    assert!(after > before + 0.005 && after > 0.85, "{shape:?} class {id}: {before} {after}");
                }
                let sum: f32 = maps.iter().map(|map| map[1]).sum();
                assert!((sum - 1.0).abs() < 1e-5);
            }
        }
    }
}

#[test]
fn coupled_voxels_are_told_apart_where_plain_em_loses_a_rare_class() {
    // Two classes 2.5 standard deviations apart, and a third between them in place and in value: a slab, a tenth of the whole.
    let dims = [40; 3];
    let mut noise = Noise(15);
    let truth: Vec<u16> = (0..40 * 40 * 40_usize)
        .map(|i| match i % 40 {
            0..18 => 1,
            18..22 => 2,
            _ => 3,
        })
        .collect();
    let values: Vec<u8> = truth
        .iter()
        .map(|t| (80.0 + 25.0 * f64::from(*t - 1) + 20.0 * noise.normal()).round() as u8)
        .collect();
    let volume = volume(dims, [1.0; 3], values);
    let found = run(&volume, &EmvsParams { smoothing: 0.5, ..with_k(3) });
    let plain = run(&volume, &with_k(3));
    for id in 1..=3 {
        let [before, after] = [&plain, &found].map(|f| dice(f.segmentation.labels.ids(), &truth, id));
        assert!(after > before + 0.1 && after > 0.5, "class {id}: {before} {after}");
    }
    // The weights are the voxels' shares.
    for (id, weight) in (1..=3).zip(&found.mixture.weights) {
        let size = found.segmentation.labels.ids().iter().filter(|t| **t == id).count() as f64;
        assert!((weight - size / truth.len() as f64).abs() < 0.03, "class {id}: {weight} {size}");
    }
}
