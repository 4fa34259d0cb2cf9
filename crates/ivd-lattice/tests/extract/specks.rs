//! Small parts: told, and left out by their volume.

use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{Inputs, IsoChoice, LatticeFigures, LatticeParams};
use nalgebra::Vector3;

/// Balls of these radii [mm] at these places [mm], in a grid of half a millimetre; values are distances to the nearest surface.
fn balls(balls: &[([f64; 3], f64)]) -> Volume {
    let grid = Grid::with_spacing([120, 64, 64], [0.5; 3]).unwrap();
    let value = |i: usize| {
        let at = grid.world(grid.index(i).into()).0;
        let depth = |(centre, radius): &([f64; 3], f64)| radius - (at - Vector3::from(*centre)).norm();
        balls.iter().map(depth).fold(f64::NEG_INFINITY, f64::max) as f32
    };
    let values: Vec<f32> = (0..grid.len()).map(value).collect();
    Volume::new(grid, Voxels::from(values)).unwrap()
}

/// Two large balls, of 9 and 6 mm, and specks of 1, 1.5, 2 and 2 mm.
const SCENE: [([f64; 3], f64); 6] = [
    ([14.0, 16.0, 16.0], 9.0),
    ([40.0, 16.0, 16.0], 6.0),
    ([30.0, 5.0, 5.0], 1.0),
    ([30.2, 27.0, 5.1], 1.5),
    ([54.0, 5.0, 27.3], 2.0),
    ([54.1, 27.0, 5.0], 2.0),
];

fn volume_of(radius: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
}

fn cut(volume: &Volume, min_part: f64) -> (Lattice, LatticeFigures) {
    let params = LatticeParams { iso: IsoChoice::Value(0.0), min_part, ..LatticeParams::default() };
    params.run(Inputs { volume, labels: None, mask: None }, &Exec::default()).unwrap()
}

/// Whether two numbers agree to a share: of a ball of two voxels' radius a seventh is cut off, of larger ones less.
fn near(found: f64, wanted: f64, share: f64) -> bool {
    (found / wanted - 1.0).abs() < share
}

#[test]
fn parts_below_the_volume_that_is_given_are_left_out_and_no_others() {
    let volume = balls(&SCENE);
    let (all, told) = cut(&volume, 0.0);
    assert_eq!((told.components, told.dropped_parts, told.dropped_mm3), (6, None, None));
    // 4.2, 14.1 and twice 33.5 mm³ beside 905 and 3,054 mm³.
    for (min_part, dropped) in [(1.0, 0..0), (9.0, 2..3), (25.0, 2..4), (60.0, 2..6), (2000.0, 1..6)] {
        let (lattice, found) = cut(&volume, min_part);
        let gone = &SCENE[dropped.clone()];
        assert_eq!(found.dropped_parts, Some(gone.len() as u64), "{min_part} mm³");
        assert_eq!(found.components, (SCENE.len() - gone.len()) as u64);
        let wanted: f64 = gone.iter().map(|(_, radius)| volume_of(*radius)).sum();
        let dropped_mm3 = found.dropped_mm3.unwrap();
        assert!(
            gone.is_empty() && dropped_mm3 == 0.0 || near(dropped_mm3, wanted, 0.16),
            "{dropped_mm3} for {wanted}"
        );
        // What is left is what it was, vertex by vertex.
        let left: Vec<([f64; 3], f64)> = SCENE.iter().filter(|ball| !gone.contains(ball)).copied().collect();
        let (alone, _) = cut(&balls(&left), 0.0);
        assert_eq!((lattice.keys(), lattice.places()), (alone.keys(), alone.places()), "{min_part} mm³");
        assert_eq!(lattice.triangles(), alone.triangles());
        assert!(lattice.keys().iter().all(|key| all.vertex_at(*key).is_some()));
    }
    assert_eq!(cut(&volume, 1e9).0.triangles().len(), 0, "nothing is as large");
}

#[test]
fn small_parts_are_told_with_the_key_that_leaves_them_out() {
    let volume = balls(&SCENE);
    let (_, told) = cut(&volume, 0.0);
    // Below 1 % of 3,054 mm³ are the specks of 1 and 1.5 mm alone: too few to be told of.
    assert_eq!(told.small_parts, Some(2));
    assert!(near(told.small_parts_mm3.unwrap(), volume_of(1.0) + volume_of(1.5), 0.16));
    assert_eq!(told.remark(), None);
    // Beside a larger ball all four are, and the number that is named leaves them out.
    let mut scene = SCENE;
    scene[0].1 = 12.0;
    let volume = balls(&scene);
    let (_, told) = cut(&volume, 0.0);
    assert_eq!(told.small_parts, Some(4));
    let remark = told.remark().unwrap();
    assert!(remark.starts_with("4 small parts"), "{remark}");
    let named: f64 = remark.split("min_part = ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((30.0..36.0).contains(&named), "{remark}");
    let (_, found) = cut(&volume, named);
    assert_eq!((found.dropped_parts, found.small_parts, found.remark()), (Some(4), Some(0), None));
}

#[test]
fn a_cavity_that_is_left_out_is_filled() {
    let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
    let value = |i: usize| {
        let off = (grid.world(grid.index(i).into()).0 - Vector3::repeat(19.5)).norm();
        (15.0 - off).min(off - 3.0) as f32
    };
    let volume =
        Volume::new(grid.clone(), Voxels::from((0..grid.len()).map(value).collect::<Vec<_>>())).unwrap();
    let (_, hollow) = cut(&volume, 0.0);
    let (_, filled) = cut(&volume, 500.0);
    assert_eq!((hollow.components, filled.components, filled.dropped_parts), (2, 1, Some(1)));
    let gained = filled.volume_mm3 - hollow.volume_mm3;
    assert!(
        (gained - filled.dropped_mm3.unwrap()).abs() < 1e-6 * gained && near(gained, volume_of(3.0), 0.12)
    );
}
