use std::collections::BTreeSet;

use super::super::figures::{self, Leaves};
use super::super::{cells, grown};
use super::*;
use crate::hvs::field::Field;
use crate::moments::Frame;

/// Ward's criterion by looking at every pair of neighbouring regions at every step: costs, and the inertia of each number of
/// regions, from all voxels on their own down to one region.
fn plain(volume: &Volume) -> (Vec<f64>, Vec<f64>) {
    let n = volume.grid().len();
    // The same frame, so that ties are the same ties.
    let frame = Frame::of(volume);
    let mut sums: Vec<[f64; 2]> = (0..n).map(|i| [1.0, frame.place(volume.voxels().get(i))]).collect();
    let mut pairs: BTreeSet<[usize; 2]> = neighbours(volume, None).into_iter().collect();
    let (mut costs, mut inertia) = (Vec::new(), vec![0.0]);
    while !pairs.is_empty() {
        let cost = |pair: &[usize; 2]| {
            let [[n, s], [m, t]] = pair.map(|i| sums[i]);
            n * m / (n + m) * (s / n - t / m).powi(2)
        };
        let [a, b] = *pairs.iter().min_by(|p, q| cost(p).total_cmp(&cost(q)).then(p.cmp(q))).unwrap();
        costs.push(cost(&[a, b]));
        inertia.push(inertia.last().unwrap() + costs.last().unwrap());
        sums[a] = [sums[a][0] + sums[b][0], sums[a][1] + sums[b][1]];
        let moved: Vec<[usize; 2]> = pairs.iter().copied().filter(|p| p.contains(&b)).collect();
        for pair in moved {
            pairs.remove(&pair);
            let [x, y] = pair.map(|i| if i == b { a } else { i });
            if x != y {
                pairs.insert([x.min(y), x.max(y)]);
            }
        }
    }
    let back = |v: Vec<f64>| v.iter().map(|v| v / frame.scale() / frame.scale()).collect();
    (back(costs), back(inertia))
}

/// A tree over leaves from blocks of another size.
fn capped(volume: &Volume, block: usize, most: usize) -> Hvs {
    let Voxels::U8(voxels) = volume.voxels() else { panic!("bytes") };
    let (exec, field) = (Exec::default(), Field::new(volume, &voxels[..], None));
    let (leaves, count) = cells::cells(&field, &Frame::of(volume), block, most, &exec).unwrap();
    let figures =
        figures::spread(&Leaves { volume, voxels: &voxels[..], ids: &leaves, count }, &exec).unwrap();
    grown::by_ward(volume, leaves, figures, &exec).unwrap().into_hvs(volume, &exec).unwrap()
}

fn cut_inertia(volume: &Volume, tree: &Tree, k: usize) -> f64 {
    let found = cut(tree, &classes(k, Ranking::Persistence), &Exec::default()).unwrap();
    assert_eq!(found.k, k);
    let exact = inertia(volume, found.labels.ids());
    assert!((found.objective - exact).abs() <= 1e-9 * exact, "{} {exact}", found.objective);
    exact
}

#[test]
fn merges_are_those_of_a_plain_search() {
    let mut next = noise(7);
    let bytes: Vec<u8> = (0..1331).map(|i| ((i / 11 % 11) as u32 * 9 + next() % 30) as u8).collect();
    let few: Vec<u8> = (0..1331).map(|_| (next() % 3) as u8).collect();
    for voxels in [bytes, few] {
        let volume = volume([11, 11, 11], voxels);
        let (costs, expected) = plain(&volume);
        let found = grow(&volume, &HvsParams::default());
        let mut highest = 0.0;
        let lifted: Vec<f64> = costs
            .iter()
            .map(|cost| {
                highest = f64::max(highest, *cost);
                highest
            })
            .collect();
        let flat = 1331 - found.regions;
        let own = heights(&found.tree);
        assert!(own.iter().zip(&lifted[flat..]).all(|(a, b)| (a - b).abs() <= 1e-9 * b));
        assert_eq!(
            found.inversions,
            costs
                .windows(2)
                .fold((0, costs[0]), |(n, high), w| { (n + u64::from(w[1] < high), high.max(w[1])) })
                .0
        );
        for k in [1, 2, 3, 7, 20, 100] {
            let (got, want) = (cut_inertia(&volume, &found.tree, k), expected[1331 - k]);
            assert!((got - want).abs() <= 1e-9 * want, "{k} classes: {got}, not {want}");
        }
    }
}

#[test]
fn a_cap_on_the_leaves_costs_little() {
    let (volume, _) = head(16, 6.0);
    let (_, exact) = plain(&volume);
    for (most, worst) in [(2000, 0.01), (1000, 0.01), (500, 0.05)] {
        let found = capped(&volume, 4, most);
        assert!(found.regions <= most, "{}", found.regions);
        for k in [2, 4, 5, 8, 16, 50] {
            let excess = cut_inertia(&volume, &found.tree, k) / exact[4096 - k] - 1.0;
            println!(
                "cap {most} ({} leaves, {:.4} within): {k} classes {excess:+.5}",
                found.regions, found.excess
            );
            assert!(excess < worst, "cap {most}, {k} classes: {excess}");
        }
    }
    for alpha in [1.0, 2.0, 3.0] {
        let found = grow(&volume, &HvsParams { alpha: Some(alpha), ..HvsParams::default() });
        for k in [2, 4, 5, 8, 16, 50] {
            if k <= found.regions {
                let excess = cut_inertia(&volume, &found.tree, k) / exact[4096 - k] - 1.0;
                println!(
                    "alpha {alpha} ({} leaves, {:.4} within): {k} classes {excess:+.5}",
                    found.regions, found.excess
                );
            }
        }
    }
}

#[test]
fn a_cap_that_no_block_can_meet_leaves_one_leaf_a_block() {
    let (volume, _) = head(16, 6.0);
    assert_eq!(capped(&volume, 4, 1).regions, 64);
    assert_eq!(grow(&volume, &HvsParams { max_regions: 1, ..HvsParams::default() }).regions, 1);
    let zones = HvsParams { alpha: Some(0.0), max_regions: 5, ..HvsParams::default() };
    let error = region_tree(&volume, None, &zones, &Exec::default()).unwrap_err().to_string();
    assert!(error.contains("alpha") && error.contains("max_regions"), "{error}");
}

#[test]
fn islands_end_in_one_tree() {
    let nan = f32::NAN;
    let volume = volume([7, 1, 1], vec![50.0, nan, 1.0, 2.0, nan, 44.0, nan]);
    let tree = grow(&volume, &HvsParams::default()).tree;
    assert_eq!(tree.bridges, 2);
    assert_eq!(heights(&tree)[..2], [0.5, 18.0]);
    let halves = cut(&tree, &classes(2, Ranking::Persistence), &Exec::default()).unwrap();
    assert_eq!(halves.labels.ids(), [2, 0, 1, 1, 0, 2, 0]);
}
