use super::*;

/// Kruskal over all edges at once.
fn plain(volume: &Volume, mask: Option<&Mask>) -> Vec<f64> {
    let mut edges: Vec<(f64, [usize; 2])> = neighbours(volume, mask)
        .into_iter()
        .map(|[a, b]| {
            ((volume.voxels().get(a) - volume.voxels().get(b)).abs() * volume.slope().abs(), [a, b])
        })
        .collect();
    edges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut part: Vec<usize> = (0..volume.grid().len()).collect();
    let mut heights = Vec::new();
    for (height, [a, b]) in edges {
        if part[a] != part[b] {
            let (from, to) = (part[a], part[b]);
            part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
            heights.push(height);
        }
    }
    heights.retain(|h| *h > 0.0);
    heights
}

#[test]
fn heights_are_those_of_a_plain_minimum_spanning_tree_for_every_type() {
    let mut next = noise(1);
    let dims = [17, 9, 8];
    let len: usize = dims.iter().product();
    for top in [2, 9, 250] {
        let bytes: Vec<u8> = (0..len).map(|_| (next() % top) as u8).collect();
        let volume = volume(dims, bytes);
        assert_eq!(heights(&grow(&volume, &single()).tree), plain(&volume, None));
    }
    let volumes = [
        volume(dims, (0..len).map(|_| next() as i8).collect::<Vec<_>>()),
        volume(dims, (0..len).map(|_| next() as u16).collect::<Vec<_>>()),
        volume(dims, (0..len).map(|_| next() as i16).collect::<Vec<_>>()),
        volume(dims, (0..len).map(|_| next()).collect::<Vec<_>>()),
        volume(dims, (0..len).map(|_| next() as i32).collect::<Vec<_>>()),
        volume(dims, (0..len).map(|_| next() as f32 * 1e-3).collect::<Vec<_>>()),
        volume(dims, (0..len).map(|_| 1.0 + f64::from(next()) * 1e-20).collect::<Vec<_>>()),
    ];
    for volume in volumes {
        let found = grow(&volume, &single());
        assert_eq!(heights(&found.tree), plain(&volume, None), "{}", volume.voxel_type().name());
        assert_eq!((found.excess, found.inversions, found.tree.bridges), (0.0, 0, 0));
    }
}

#[test]
fn blocks_and_their_borders_make_no_difference() {
    let mut next = noise(2);
    // More than one block along each axis.
    let dims = [35, 18, 19];
    let len: usize = dims.iter().product();
    let voxels: Vec<u8> = (0..len).map(|i| ((i % 35) as u32 / 3 + next() % 20) as u8).collect();
    let volume = volume(dims, voxels);
    assert_eq!(heights(&grow(&volume, &single()).tree), plain(&volume, None));
}

#[test]
fn scaled_values_have_scaled_heights() {
    let mut next = noise(3);
    let grid = Grid::with_spacing([8, 8, 8], [1.0, 1.0, 50.0]).unwrap();
    let voxels: Vec<i16> = (0..512).map(|_| (next() % 4000) as i16 - 2000).collect();
    let volume = Volume::with_scale(grid, Voxels::from(voxels), -0.5, 1e6).unwrap();
    let found = grow(&volume, &single());
    assert_eq!(heights(&found.tree), plain(&volume, None));
    let first = found.tree.means.get(0);
    assert_eq!(first, real(&volume, 0));
}

#[test]
fn quasi_flat_zones_are_what_lies_below_alpha() {
    let mut next = noise(4);
    let voxels: Vec<u8> = (0..1000).map(|_| (next() % 60) as u8).collect();
    let volume = volume([10, 10, 10], voxels);
    let whole = plain(&volume, None);
    let found = grow(&volume, &HvsParams { alpha: Some(3.0), ..single() });
    let above: Vec<f64> = whole.iter().copied().filter(|h| *h > 3.0).collect();
    assert_eq!(heights(&found.tree), above);
    // The spreads of the leaves and those between them make up the whole.
    let all = inertia(&volume, &[1; 1000]);
    let one = cut(&found.tree, &classes(1, Ranking::Height), &Exec::default()).unwrap();
    assert!((one.objective - all).abs() < 1e-9 * all);
    let within: f64 = found.tree.squares.as_ref().unwrap().iter().sum();
    assert!((found.excess - within / all).abs() < 1e-12);
}

#[test]
fn islands_are_joined_in_the_order_of_their_means() {
    let nan = f32::NAN;
    let volume = volume([9, 1, 1], vec![50.0, nan, 1.0, 2.0, nan, 45.0, nan, 9.0, 9.0]);
    let tree = grow(&volume, &single()).tree;
    // 1|2 touch; then 50 with 45, 1.5 with 9, and those with 45.
    assert_eq!(heights(&tree), [1.0, 5.0, 7.5, 36.0]);
    assert_eq!(tree.bridges, 3);
    let halves = cut(&tree, &classes(2, Ranking::Height), &Exec::default()).unwrap();
    assert_eq!(halves.labels.ids(), [2, 0, 1, 1, 0, 2, 0, 1, 1]);
}

#[test]
fn a_mask_and_a_range_leave_voxels_out() {
    let mut next = noise(6);
    let voxels: Vec<u8> = (0..729).map(|_| (next() % 100) as u8).collect();
    let volume = volume([9, 9, 9], voxels);
    let inside: Vec<u8> = (0..729).map(|i| u8::from(i % 9 < 7)).collect();
    let mask = Mask::new(volume.grid().clone(), inside.clone().into()).unwrap();
    let exec = Exec::default();
    let tree = region_tree(&volume, Some(&mask), &single(), &exec).unwrap().tree;
    assert_eq!(heights(&tree), plain(&volume, Some(&mask)));
    let tree = region_tree(
        &volume,
        Some(&mask),
        &HvsParams { within: Within::range(20.0, 60.0), ..single() },
        &exec,
    )
    .unwrap()
    .tree;
    for (i, leaf) in tree.leaves.iter().enumerate() {
        assert_eq!(*leaf > 0, inside[i] == 1 && (20.0..=60.0).contains(&real(&volume, i)));
    }
}
