//! What is isolated first: a part of one piece gives a lattice of one piece, which is the whole's but where it is cut.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::collections::BTreeMap;

use ivd_boundary::{ComponentParams, EditInputs, EditParams, component, edit};
use ivd_core::{ElementKey, Exec, Grid, Lattice, Mask, Volume, noise};
use ivd_lattice::extract::{ExtractParams, IsoChoice, IsoWord, LatticeFigures, LatticeParams, extract};

/// Values of 0 … 1, alike nearby.
fn field(case: u64, dims: [usize; 3]) -> Volume {
    let grid = Grid::with_spacing(dims, [1.0, 1.3, 0.8]).unwrap();
    let mut values: Vec<f32> = (0..grid.len()).map(|i| noise::unit(case, i as u64) as f32).collect();
    for stride in [1, dims[0], dims[0] * dims[1]] {
        let before = values.clone();
        for i in stride..values.len() - stride {
            values[i] = 0.25 * (before[i - stride] + before[i + stride]) + 0.5 * before[i];
        }
    }
    Volume::new(grid, values.into()).unwrap()
}

fn lattice(volume: &Volume, mask: Option<&Mask>, iso: IsoChoice) -> (Lattice, u64) {
    let params = LatticeParams { iso, ..LatticeParams::default() };
    let iso = params.crossings(volume.grid(), None, mask).unwrap();
    let lattice = extract(volume, mask, &ExtractParams { iso }, &Exec::default()).unwrap().lattice;
    let components = LatticeFigures::of(&lattice).components;
    (lattice, components)
}

#[test]
fn a_part_of_one_piece_of_a_random_field_gives_one_lattice() {
    for case in 0..100 {
        let volume = field(case, [17, 13, 15]);
        let above = 0.42 + 0.1 * noise::unit(case, u64::MAX);
        let params = ComponentParams { above: Some(above), ..ComponentParams::default() };
        let part = component(&volume, None, &params, &Exec::default()).unwrap().mask;
        let smooth = EditParams { fill_holes: true, ..EditParams::default() };
        let smooth =
            edit(&EditInputs { volume: &volume, part: &part, other: None }, &smooth, &Exec::default())
                .unwrap()
                .mask;
        assert!(smooth.level().is_some() && smooth.inside() == part.inside(), "case {case}");
        let cut = |mask: &Mask, iso| lattice(&volume, Some(mask), iso).1;
        assert_eq!(cut(&part, IsoChoice::Value(above)), 1, "case {case}, by value");
        assert_eq!(cut(&part, IsoChoice::Word(IsoWord::Boundary)), 1, "case {case}, by the mask");
        assert_eq!(cut(&smooth, IsoChoice::Word(IsoWord::Boundary)), 1, "case {case}, by the level");
    }
}

fn vertices(lattice: &Lattice) -> BTreeMap<ElementKey, [u64; 3]> {
    let places = lattice.positions().into_iter().map(|v| [v[0].to_bits(), v[1].to_bits(), v[2].to_bits()]);
    lattice.keys().iter().copied().zip(places).collect()
}

#[test]
fn a_part_that_is_cut_out_has_the_vertices_of_the_whole_but_at_the_cut() {
    let grid = Grid::with_spacing([60, 32, 32], [1.0, 1.1, 0.9]).unwrap();
    let length = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let dumbbell = |at: [usize; 3]| {
        let [x, y, z] = [at[0] as f64, at[1] as f64 - 15.5, at[2] as f64 - 15.5];
        let balls = [15.0, 44.0].map(|middle| 10.0 - length([x - middle, y, z]));
        balls[0].max(balls[1]).max((3.5 - length([0.0, y, z])).min(15.0 - (x - 29.5).abs()))
    };
    let values: Vec<f32> = (0..grid.len()).map(|i| dumbbell(grid.index(i).0) as f32).collect();
    let volume = Volume::new(grid.clone(), values.into()).unwrap();
    let whole = ComponentParams { above: Some(0.0), ..ComponentParams::default() };
    let whole = component(&volume, None, &whole, &Exec::default()).unwrap().mask;
    // One ball, cut off in the middle of the bridge.
    let one = |voxel: usize| u8::from(whole.inside()[voxel] != 0 && grid.index(voxel).0[0] < 28);
    let one: Vec<u8> = (0..grid.len()).map(one).collect();
    let one = Mask::new(grid.clone(), one.into()).unwrap();
    let value = IsoChoice::Value(0.0);
    let (all, part) =
        (vertices(&lattice(&volume, None, value).0), vertices(&lattice(&volume, Some(&one), value).0));

    // Voxels of the whole that the mask leaves out.
    let cut: Vec<[usize; 3]> = (0..grid.len())
        .filter(|&i| one.inside()[i] == 0 && volume.voxels().get(i) > 0.0)
        .map(|i| grid.index(i).0)
        .collect();
    let away = |key: &ElementKey| {
        let at = key.voxel(grid.dims());
        cut.iter().all(|v| (0..3).any(|a| (v[a] as i64 - at[a]).abs() > 2))
    };
    let mut compared = 0;
    for (key, place) in part.iter().filter(|(key, _)| away(key)) {
        assert_eq!(all.get(key), Some(place), "{key:?}");
        compared += 1;
    }
    let theirs = all.keys().filter(|key| away(key) && key.voxel(grid.dims())[0] < 28).count();
    assert_eq!(compared, theirs, "no vertex of the whole is missing from the part");
    assert!(compared > 1000, "{compared} of {}", part.len());
}
