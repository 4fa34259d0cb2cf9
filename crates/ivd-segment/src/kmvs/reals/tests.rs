use super::*;
use ivd_core::noise;

/// Least inertia over all partitions of sorted values, each interval summed directly about its mean.
fn brute_force(values: &[f64], k: usize) -> f64 {
    let direct = |part: &[f64]| {
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        part.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
    };
    if k == 1 || values.len() <= k {
        return if values.len() <= k && k > 1 { 0.0 } else { direct(values) };
    }
    (1..values.len())
        .map(|cut| direct(&values[..cut]) + brute_force(&values[cut..], k - 1))
        .fold(f64::INFINITY, f64::min)
}

/// The optimum with every border present: no stretches, no pruning.
fn plain(values: &[f32], k: usize) -> f64 {
    let sorted = Sorted::new(values);
    let borders = at(&sorted, &(0..=values.len()).map(|i| [i, i]).collect::<Vec<_>>());
    optimal::rows(borders.len(), k, true, &|p, q| inertia(&borders[p], &borders[q])).cost[k - 1][values.len()]
}

fn noise(i: u64) -> f64 {
    noise::unit(0, i)
}

#[test]
fn small_samples_reach_the_brute_force_optimum() {
    for case in 0..256_u64 {
        let roll = |i: u64, below: u64| noise::below(case, i, below);
        let mut values: Vec<f32> =
            (0..=roll(0, 11)).map(|i| (100.0 * noise::unit(case, 10 + i) - 50.0) as f32).collect();
        let k = 1 + roll(1, 4) as usize;
        values.sort_by(f32::total_cmp);
        let wide: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        let found = partition(&values, k, &Exec::default()).unwrap();
        let best = brute_force(&wide, k);
        assert!(
            (found.inertia() - best).abs() <= 1e-11 * best.max(1e-12),
            "case {case}: {} for {best}",
            found.inertia()
        );
        assert_eq!(found.gap, 0.0, "case {case}");
    }
}

#[test]
fn narrow_groups_in_a_wide_sample_keep_their_inertia() {
    // Thirty groups of spread 1 over 4·10⁹: the square of a value is 10¹⁹ times that of its distance from its mean.
    let value = |i: i64| -2_000_000_000 + (i % 30) * 133_000_000 + i / 30 * 7919 % 5;
    let mut values: Vec<i32> = (0..900).map(|i| value(i) as i32).collect();
    values.sort_unstable();
    let direct = |group: &[i32]| {
        let mean = group.iter().map(|&v| f64::from(v - group[0])).sum::<f64>() / group.len() as f64;
        group.iter().map(|&v| (f64::from(v - group[0]) - mean).powi(2)).sum::<f64>()
    };
    let expected: f64 = values.chunk_by(|a, b| b - a < 1000).map(direct).sum();
    let found = partition(&values, 30, &Exec::default()).unwrap().inertia();
    assert!((found - expected).abs() <= 1e-12 * expected, "{found} where {expected}");
}

#[test]
fn bounds_with_stretches_give_the_same_optimum_as_every_border() {
    for (name, shape) in [
        ("uniform", (|u: f64, _: f64| u) as fn(f64, f64) -> f64),
        ("heavy tail", |u, _| 1.0 / (u + 1e-6)),
        ("two scales", |u, v| if v < 0.5 { u * 1e-3 } else { 5.0 + u }),
        ("outlier", |u, v| if v < 1e-4 { 1e30 } else { u }),
    ] {
        let mut values: Vec<f32> =
            (0..20_000).map(|i| shape(noise(2 * i), noise(2 * i + 1)) as f32).collect();
        values.sort_by(f32::total_cmp);
        for k in [2, 3, 5] {
            let found = partition(&values, k, &Exec::default()).unwrap();
            let best = plain(&values, k);
            assert!(found.converged && found.gap == 0.0, "{name}, k {k}");
            assert!(
                (found.inertia() - best).abs() <= 1e-11 * best,
                "{name}, k {k}: {} for {best}",
                found.inertia()
            );
        }
    }
}

#[test]
fn outliers_at_both_ends_of_f32_leave_the_middle_its_digits() {
    let mut values: Vec<f32> =
        (0..9000).map(|i| (noise(i) + if i % 2 == 0 { 0.0 } else { 10.0 }) as f32).collect();
    values.extend([-3e38, 3e38, 3e38]);
    values.sort_by(f32::total_cmp);
    let found = partition(&values, 4, &Exec::default()).unwrap();
    let counts: Vec<u64> = found.groups.iter().map(|g| g.count).collect();
    assert_eq!(counts, [1, 4500, 4500, 2]);
    assert!((found.groups[1].sd - 1.0 / 12.0_f64.sqrt()).abs() < 0.01);
}

#[test]
fn ends_of_f64_neither_overflow_nor_vanish() {
    for scale in [1e-320, 1e-200, 1e200, 1e307] {
        let values = [1.0, 2.0, 3.0, 11.0, 12.0].map(|v| v * scale);
        let found = partition(&values, 2, &Exec::default()).unwrap();
        let counts: Vec<u64> = found.groups.iter().map(|g| g.count).collect();
        assert_eq!(counts, [3, 2], "{scale:e}");
        assert!(found.groups.iter().all(|g| g.mean.is_finite() && g.sd.is_finite()));
        assert!((found.groups[0].mean / (2.0 * scale) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn an_offset_of_ten_million_does_not_hide_a_spread_of_one() {
    let mut values: Vec<f32> =
        (0..30_000).map(|i| (1e7 + if i % 3 == 0 { 0.0 } else { 12.0 } + 2.0 * noise(i)) as f32).collect();
    values.sort_by(f32::total_cmp);
    let found = partition(&values, 2, &Exec::default()).unwrap();
    assert_eq!(found.groups[0].count, 10_000);
    assert!((found.groups[0].mean - 10_000_001.0).abs() < 0.05, "{}", found.groups[0].mean);
}
