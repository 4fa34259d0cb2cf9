use ivd_core::{FieldBricks, Volume, VoxelIndex};
use ivd_field::falloff::within_ball;
use ivd_field::fixtures::{middle, sheared_grid, voxels};
use ivd_field::warp::{WarpParams, labels as warp_labels, volume as warp_volume};
use nalgebra::Matrix3;

use super::*;

/// The middle of a grid (mm, RAS).
fn centre(grid: &Grid) -> [f64; 3] {
    (middle(grid) + Vector3::from(grid.origin())).into()
}

fn shape(grid: &Grid, kind: Kind) -> Shape {
    Shape { kind, centre: centre(grid), axis: [0.2, -0.1, 1.0], radius: 7.0, core: 0.3 }
}

fn curve(over: Over, way: Way, knots: &[[f64; 2]]) -> Curve {
    let (centre, axis) = ([0.0; 3], [0.0, 0.0, 2.0]);
    Curve { centre, axis, radius: 100.0, core: 0.9, over, way, knots: knots.to_vec() }
}

fn cube(side: usize) -> Grid {
    Grid::with_spacing([side; 3], [1.0; 3]).unwrap()
}

fn made(grid: &Grid, steps: &[Step]) -> Made {
    displace(grid, steps, &Start::default(), &Exec::default()).unwrap()
}

/// Where a voxel is, from the origin (mm).
fn place(grid: &Grid, voxel: VoxelIndex) -> Vector3<f64> {
    grid.linear_part() * VoxelCoord::from(voxel).0
}

/// Largest difference of a field from a function of the world position (mm).
fn worst(grid: &Grid, field: &FieldBricks, expected: impl Fn(Vector3<f64>) -> Vector3<f64>) -> f64 {
    let origin = Vector3::from(grid.origin());
    let off = |v: VoxelIndex| {
        (Vector3::from(field.at(v)).map(f64::from) - expected(place(grid, v) + origin)).norm()
    };
    voxels(grid).map(off).fold(0.0, f64::max)
}

#[test]
fn a_deflector_moves_every_voxel_as_its_shape_says() {
    let grid = sheared_grid([40, 32, 14]);
    let kinds = [
        Kind::Translate { by: [0.5, -0.4, 0.6] },
        Kind::Rotate { angle: 25.0 },
        Kind::Scale { along: Some(1.2), across: Some(0.9) },
        Kind::Stretch { factor: 1.1 },
        Kind::Squeeze { factor: 0.9 },
        Kind::Twist { rate: 3.0, length: None },
        Kind::Taper { rate: 0.02, length: None },
        Kind::Bend { rate: 2.0, spine: [1.0, 0.0, 0.0], length: None },
    ];
    for kind in kinds {
        let shape = shape(&grid, kind);
        let made = made(&grid, &[Step::Shape(shape)]);
        assert_eq!((made.figures.parts, made.figures.folds), (1, 0), "{kind:?}");
        // The origin is 10 m away: what is left is the rounding of the centre.
        let off = worst(&grid, made.displacement.forward(), |p| shape.apply(p, 1.0) - p);
        assert!(off < 1e-6, "{kind:?}: {off}");
        assert!(
            made.figures.voxels_moved > 1000 && made.figures.bricks_touched < made.figures.bricks_total,
            "{kind:?}: {made:?}"
        );
        assert!(
            made.figures.min_det_j > 0.0 && made.figures.inverse_residual_max_voxel < 1e-4,
            "{kind:?}: {made:?}"
        );
        let mut all = Exec::default();
        all.skip = false;
        let plain = displace(&grid, &[Step::Shape(shape)], &Start::default(), &all).unwrap();
        assert_eq!(plain, made, "{kind:?}: nothing is skipped that matters");
    }
}

#[test]
fn steps_go_on_from_where_the_ones_before_left() {
    let grid = sheared_grid([40, 32, 14]);
    let [first, second] =
        [Kind::Translate { by: [0.9, 0.0, 0.8] }, Kind::Rotate { angle: 40.0 }].map(|k| shape(&grid, k));
    let both = made(&grid, &[Step::Shape(first), Step::Shape(second)]);
    let off = worst(&grid, both.displacement.forward(), |p| second.apply(first.apply(p, 1.0), 1.0) - p);
    assert!(off < 1e-6, "{off}");
    let alone = made(&grid, &[Step::Shape(first)]).displacement;
    let start = Start { after: Some(&alone), labels: None };
    let after = displace(&grid, &[Step::Shape(second)], &start, &Exec::default()).unwrap();
    let off = voxels(&grid)
        .map(|v| {
            let [a, b] = [&after, &both].map(|m| Vector3::from(m.displacement.forward().at(v)));
            (a - b).norm()
        })
        .fold(0.0, f32::max);
    assert!(off < 1e-5, "{off}");
    let nothing = displace(&grid, &[], &start, &Exec::default()).unwrap();
    assert_eq!(nothing.displacement.forward(), alone.forward(), "no step: what was before");
}

#[test]
fn a_push_that_folds_at_once_is_done_in_parts() {
    let grid = cube(41);
    let push = |by: f64| {
        let kind = Kind::Translate { by: [0.0, 0.0, by] };
        Step::Shape(Shape { radius: 12.0, core: 0.0, ..shape(&grid, kind) })
    };
    // The fade's slope is at most 3/2 over 12 mm: 8 mm is where it folds.
    assert_eq!(made(&grid, &[push(6.0)]).figures.parts, 1);
    let far = made(&grid, &[push(10.0)]);
    assert!(far.figures.parts > 1 && far.figures.min_det_j > 0.0, "{far:?}");
    let top = f64::from(far.displacement.forward().at(VoxelIndex([20; 3]))[2]);
    assert!(
        (0.1..3.0).contains(&far.figures.short_mm) && (top + far.figures.short_mm - 10.0).abs() < 0.1,
        "{top} {far:?}"
    );
    let moves = |u: &[f32; 3]| u[0] == 0.0 && u[1] == 0.0;
    assert!(far.displacement.forward().vectors().iter().all(moves), "a flow along the push");
    // Within reach of the push nothing passes what was ahead of it.
    for z in 8..31 {
        let [here, next] =
            [z, z + 1].map(|z| z as f32 + far.displacement.forward().at(VoxelIndex([20, 20, z]))[2]);
        assert!(next > here, "{z}: {here} {next}");
    }
    let bend = Kind::Bend { rate: 40.0, spine: [1.0, 0.0, 0.0], length: None };
    let error = displace(
        &grid,
        &[Step::Shape(Shape { radius: 18.0, ..shape(&grid, bend) })],
        &Start::default(),
        &Exec::default(),
    );
    assert!(matches!(error, Err(Error::Folded { .. })), "a bend isn't made of smaller ones: {error:?}");
}

#[test]
fn a_curve_keeps_its_knots_its_order_and_its_ends() {
    let knots = [[-4.0, 1.0], [-1.0, 1.0], [0.0, 3.0], [5.0, 3.5], [6.0, 0.5]];
    let curve = curve(Over::Along, Way::Shift, &knots);
    curve.check().unwrap();
    assert!(knots.iter().all(|k| (curve.value(k[0]) - k[1]).abs() < 1e-12));
    assert_eq!((curve.value(-1e9), curve.value(1e9)), (1.0, 0.5));
    for pair in knots.windows(2) {
        let values: Vec<f64> = (0..=50)
            .map(|i| curve.value(pair[0][0] + (pair[1][0] - pair[0][0]) * f64::from(i) / 50.0))
            .collect();
        let rises = pair[1][1] >= pair[0][1];
        assert!(
            values.windows(2).all(|v| (v[1] - v[0]) * if rises { 1.0 } else { -1.0 } >= -1e-12),
            "{values:?}"
        );
    }
    // One slope everywhere: a line, but for the last pieces, which level out.
    let line: Vec<[f64; 2]> = (0..9).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
    let line = self::curve(Over::Along, Way::Turn, &line);
    assert!((10..=70).all(|i| (line.value(f64::from(i) / 10.0) - f64::from(i) / 5.0).abs() < 1e-12));
}

#[test]
fn curves_shift_turn_swell_and_grow() {
    let p = Vector3::new(3.0, 4.0, 5.0);
    let at = |over, way, knots: &[[f64; 2]]| curve(over, way, knots).apply(p, 1.0);
    let shifted = at(Over::Across, Way::Shift, &[[0.0, 0.0], [5.0, 2.0], [9.0, 0.0]]);
    assert!((shifted - Vector3::new(3.0, 4.0, 7.0)).norm() < 1e-12, "{shifted}");
    let turned = at(Over::Along, Way::Turn, &[[0.0, 0.0], [5.0, 90.0], [9.0, 90.0]]);
    assert!((turned - Vector3::new(-4.0, 3.0, 5.0)).norm() < 1e-12, "{turned}");
    let swollen = at(Over::Along, Way::Swell, &[[4.0, 2.0], [6.0, 2.0]]);
    assert!((swollen - Vector3::new(6.0, 8.0, 5.0)).norm() < 1e-12, "{swollen}");
    let grown = at(Over::Distance, Way::Grow, &[[0.0, 3.0]]);
    assert!((grown - p * 3.0).norm() < 1e-12, "{grown}");
    // Half of it is a turn by half the angle, and a growth by the root.
    let half = curve(Over::Distance, Way::Grow, &[[0.0, 4.0]]).apply(p, 0.5);
    assert!((half - p * 2.0).norm() < 1e-12, "{half}");
    let grid = cube(32);
    let twist = Curve {
        centre: centre(&grid),
        radius: 14.0,
        core: 0.4,
        ..curve(Over::Along, Way::Turn, &[[-8.0, -20.0], [8.0, 20.0]])
    };
    let made = made(&grid, &[Step::Curve(twist.clone())]);
    let off = worst(&grid, made.displacement.forward(), |p| twist.apply(p, 1.0) - p);
    assert!(off < 1e-6 && made.figures.min_det_j > 0.0, "{off} {made:?}");
}

#[test]
fn chain_mail_that_cannot_fold_does_not() {
    let grid = cube(48);
    let links = Links { shrink: 0.5, stretch: 1.5, shear: 0.2 };
    let mail =
        ChainMail { centre: centre(&grid), grip: 4.0, by: [2.0, 1.0, 3.0], links, material: [].into() };
    let made = made(&grid, &[Step::Chain(mail.clone())]);
    // ∇φ has at least 0.5 on its diagonal and at most 0.2 twice beside it; the determinant is least where both are reached.
    let least = Matrix3::from_fn(|r, c| if r == c { 0.5 } else { -0.2 }).determinant();
    assert!(
        made.figures.min_det_j >= least - 1e-6 && made.figures.parts == 1,
        "{} {least}",
        made.figures.min_det_j
    );
    let grip = made.displacement.forward().at(VoxelIndex([24; 3]));
    assert!((Vector3::from(grip) - Vector3::new(2.0, 1.0, 3.0)).norm() < 1e-6, "{grip:?}");
    // Straight ahead of the grip every link is squeezed to a half: 3 mm are used up after 6.
    let ahead = |z: usize| made.displacement.forward().at(VoxelIndex([24, 24, z]))[2];
    let edge = (24..40).find(|&z| ahead(z) < 2.9).unwrap();
    assert!((0..5).all(|i| (ahead(edge + i) - 2.5 + 0.5 * i as f32).abs() < 1e-5), "{edge}");
    let threads = |n| {
        let exec = Exec::default().with_threads(n);
        displace(&grid, &[Step::Chain(mail.clone())], &Start::default(), &exec).unwrap()
    };
    assert_eq!(threads(1), threads(8));
}

fn cut(grid: &Grid) -> Cut {
    Cut { centre: centre(grid), normal: [0.0, 0.0, 3.0], radius: 16.0, core: 0.25, open: 5.0 }
}

#[test]
fn a_cut_opens_between_its_sides_and_nowhere_else() {
    let grid = cube(48);
    // Askew, so that as many voxels' centres lie in the opening as it has room for.
    let cut = Cut { normal: [1.0, 2.0, 3.0], ..cut(&grid) };
    let made = made(&grid, &[Step::Cut(cut)]);
    let d = &made.displacement;
    assert!(d.has_cut() && made.figures.min_det_j > 0.0, "{made:?}");
    let normal = Vector3::from(cut.normal).normalize();
    let side = |p: Vector3<f64>| if cut.height(p) >= -1e-3 { Side::Above } else { Side::Below };
    let mut vacated = 0.0;
    for v in voxels(&grid) {
        let (i, y) = (grid.linear(v), place(&grid, v));
        let goes = cut.apply(y, 1.0, side(y));
        assert!((goes - y - Vector3::from(d.forward().at(v)).map(f64::from)).norm() < 1e-6, "{v:?}");
        let (own, told) = (1 + u8::from(side(y) == Side::Above), d.sides()[i] & 3);
        assert!(told == own || told == 0 && goes == y, "{v:?}: {told}");
        // What lies on the plane goes as far as its weight says: between there and here it is open.
        let opening = cut.height(cut.apply(y - normal * cut.height(y), 1.0, Side::Above));
        let outside = cut.height(y).abs() - opening;
        if outside < -0.02 {
            assert_eq!(d.vacated()[i], 1, "{v:?}");
        } else if outside > 0.02 {
            assert_eq!(d.vacated()[i], 0, "{v:?}");
            let x = y + Vector3::from(d.inverse().at(v)).map(f64::from);
            assert_eq!(side(x), side(y), "{v:?} comes from its own side");
            assert!((cut.apply(x, 1.0, side(y)) - y).norm() < 0.05, "{v:?}");
        }
        vacated += f64::from(d.vacated()[i]);
    }
    // ∫ open · w(r) 2πr dr over the disc, by the midpoint rule.
    let step = 1e-3;
    let volume: f64 = (0..16_000)
        .map(|i| {
            let r = (f64::from(i) + 0.5) * step;
            5.0 * within_ball(r, 16.0, 0.25) * 2.0 * std::f64::consts::PI * r * step
        })
        .sum();
    assert!((vacated / volume - 1.0).abs() < 0.02, "{vacated} voxels, {volume} mm³");
    assert_eq!(made.figures.voxels_vacated as f64, vacated);
}

#[test]
fn cut_labels_stay_on_their_sides_whatever_comes_before_and_after() {
    let grid = sheared_grid([40, 36, 20]);
    let cut = Cut { radius: 9.0, open: 2.0, normal: [0.3, 0.2, 1.0], ..cut(&grid) };
    let [before, after] = [Kind::Rotate { angle: 30.0 }, Kind::Translate { by: [1.0, 0.5, 0.3] }]
        .map(|kind| Step::Shape(Shape { radius: 10.0, ..shape(&grid, kind) }));
    for steps in [vec![Step::Cut(cut)], vec![before, Step::Cut(cut), after]] {
        let prefix = steps.iter().take_while(|s| !matches!(s, Step::Cut(_)));
        let prefix: Vec<Shape> =
            prefix.filter_map(|s| if let Step::Shape(s) = s { Some(*s) } else { None }).collect();
        let origin = Vector3::from(grid.origin());
        let side = |v: VoxelIndex| {
            let p = prefix.iter().fold(place(&grid, v) + origin, |p, shape| shape.apply(p, 1.0));
            1 + u16::from(cut.height(p) >= 0.0)
        };
        let ids: Vec<u16> = voxels(&grid).map(side).collect();
        let labels = Labels::new(grid.clone(), ids.into(), Vec::new()).unwrap();
        let made = made(&grid, &steps);
        assert!(made.figures.voxels_vacated > 200, "{made:?}");
        let d = &made.displacement;
        for v in voxels(&grid).filter(|v| d.sides()[grid.linear(*v)] & 3 != 0) {
            assert_eq!(u16::from(d.sides()[grid.linear(v)] & 3), side(v), "{v:?}");
        }
        let warped = warp_labels(&labels, d, &WarpParams::default(), &Exec::default()).unwrap().output;
        let values: Vec<f32> = labels.ids().iter().map(|id| f32::from(*id)).collect();
        let values = Volume::new(grid.clone(), values.into()).unwrap();
        let params = WarpParams { background: Some(0.0), ..WarpParams::default() };
        let between = warp_volume(&values, d, &params, &Exec::default()).unwrap().output;
        // What is kept comes from the side on which its origin lies, and nothing of the other side bleeds into it.
        let mut kept = 0_u32;
        for v in voxels(&grid) {
            let i = grid.linear(v);
            let (id, from) = (warped.ids()[i], u16::from(d.sides()[i] >> 2));
            assert_eq!(id == 0, d.vacated()[i] == 1, "{v:?}");
            if id != 0 && from != 0 {
                let x = place(&grid, v) + Vector3::from(d.inverse().at(v)).map(f64::from);
                let height = cut.height(prefix.iter().fold(x + origin, |p, shape| shape.apply(p, 1.0)));
                assert!(height.abs() < 2e-3 || 1 + u16::from(height > 0.0) == from, "{v:?}: {height} {from}");
                let value = between.value(v);
                assert!(id == from && (value - f64::from(from)).abs() < 1e-6, "{v:?}: {id}, {value}, {from}");
                kept += 1;
            }
        }
        assert!(kept > 2000, "{kept}");
        let threads =
            |n| displace(&grid, &steps, &Start::default(), &Exec::default().with_threads(n)).unwrap();
        assert_eq!(threads(1), threads(8));
    }
}

#[test]
fn an_opening_between_voxels_is_as_wide_as_it_is_said_to_be() {
    let grid = cube(48);
    // On a plane of voxels: those are the upper side's, and four layers are empty.
    let cut = Cut { centre: [24.0; 3], normal: [0.0, 0.0, 1.0], radius: 16.0, core: 0.5, open: 4.0 };
    let d = made(&grid, &[Step::Cut(cut)]).displacement;
    let is_open = |z: &usize| d.vacated()[grid.linear(VoxelIndex([24, 24, *z]))] == 1;
    assert_eq!((0..48).filter(is_open).collect::<Vec<_>>(), [22, 23, 24, 25]);
}

#[test]
fn a_turn_that_reaches_the_border_turns() {
    let grid = cube(32);
    let turn = Shape {
        radius: 100.0,
        core: 0.9,
        axis: [0.0, 0.0, 1.0],
        ..shape(&grid, Kind::Rotate { angle: 120.0 })
    };
    let made = made(&grid, &[Step::Shape(turn)]);
    assert!(
        (made.figures.min_det_j - 1.0).abs() < 1e-4 && made.figures.parts == 1,
        "{}",
        made.figures.min_det_j
    );
    let (d, back) = (&made.displacement, Shape { kind: Kind::Rotate { angle: -120.0 }, ..turn });
    for v in voxels(&grid) {
        let y = place(&grid, v);
        let x = back.apply(y, 1.0);
        let inside = |margin: f64| x.iter().all(|c| (-margin..=31.0 + margin).contains(c));
        let found = y + Vector3::from(d.inverse().at(v)).map(f64::from);
        if inside(-1e-3) {
            assert!((found - x).norm() < 1e-3 && d.vacated()[grid.linear(v)] == 0, "{v:?}: {found} {x}");
        } else if !inside(1e-3) {
            assert_eq!(d.vacated()[grid.linear(v)], 1, "{v:?}");
        }
    }
}

#[test]
fn beyond_its_reach_a_field_moves_nothing_whatever_the_spacing() {
    let grid = Grid::with_spacing([24; 3], [0.9; 3]).unwrap();
    let links = Links { shear: 0.22, ..Links::default() };
    let mail =
        ChainMail { centre: [2.7, 2.7, 0.0], grip: 0.0, by: [0.0, 0.0, 0.9], links, material: [].into() };
    let steps = [Step::Chain(mail)];
    let mut all = Exec::default();
    all.skip = false;
    assert_eq!(displace(&grid, &steps, &Start::default(), &all).unwrap(), made(&grid, &steps));
}

#[test]
fn sides_that_lie_on_one_another_are_refused() {
    let grid = cube(32);
    let cut = Cut { radius: 12.0, ..cut(&grid) };
    let space = Space::new(&grid, &[Step::Cut(cut)], &Start::default(), &Exec::default()).unwrap();
    let whole = |side| {
        let bricks = space.bricks(true);
        let field = space.field(&space.samplers(), &bricks, 1, side, &Exec::default()).unwrap();
        let inverse = invert(&field, &grid, &Exec::default()).unwrap();
        Whole { field, inverse }
    };
    let height = |p: Vector3<f64>| cut.height(p);
    let [below, above] = [Side::Below, Side::Above].map(whole);
    assert!(join(&grid, [&below, &above], height, 1e-3, &Exec::default()).is_ok());
    let error = join(&grid, [&above, &below], height, 1e-3, &Exec::default()).err().unwrap();
    assert!(error.to_string().contains("lie on one another"), "{error}");
}

#[test]
fn what_does_not_fit_together_is_named() {
    let grid = cube(24);
    let exec = Exec::default();
    let cut = Step::Cut(Cut { radius: 8.0, open: 2.0, ..cut(&grid) });
    let told =
        |steps: &[Step], start: &Start<'_>| displace(&grid, steps, start, &exec).unwrap_err().to_string();
    let none = Start::default();
    assert!(told(&[cut.clone(), cut.clone()], &none).contains("one at most"));
    let open = made(&grid, std::slice::from_ref(&cut)).displacement;
    let start = Start { after: Some(&open), labels: None };
    assert!(told(&[], &start).contains("has a cut"));
    let elsewhere = made(&cube(23), &[]).displacement;
    assert!(told(&[], &Start { after: Some(&elsewhere), labels: None }).contains("volume's grid"));
    let far = Step::Shape(Shape { centre: [500.0; 3], ..shape(&grid, Kind::Rotate { angle: 1.0 }) });
    assert!(told(&[far], &none).contains("there is no voxel"));
    let material = [(1, Links::default().into())].into();
    let mail = ChainMail { centre: [12.0; 3], grip: 1.0, by: [1.0; 3], links: Links::default(), material };
    assert!(told(&[Step::Chain(mail.clone())], &none).contains("no labels"));
    let labels = Labels::new(grid.clone(), vec![1_u16; grid.len()].into(), Vec::new()).unwrap();
    let start = Start { after: None, labels: Some(&labels) };
    assert!(told(&[cut, Step::Chain(mail.clone())], &start).contains("first step"));
    assert!(displace(&grid, &[Step::Chain(mail)], &start, &exec).is_ok());
    let bad = curve(Over::Along, Way::Grow, &[[0.0, 0.0]]);
    assert!(told(&[Step::Curve(bad)], &none).contains("factors"));
    let bad = curve(Over::Along, Way::Shift, &[[1.0, 0.0], [1.0, 2.0]]);
    assert!(told(&[Step::Curve(bad)], &none).contains("ascend"));
}

#[test]
fn a_place_beside_an_open_cut_goes_back_to_where_it_was() {
    let cut = Cut { centre: [3.0, -2.0, 1.0], normal: [1.0, 2.0, -0.5], radius: 20.0, core: 0.4, open: 6.0 };
    for i in 0..400 {
        let part = |n: usize| 0.1 * ((i * n) % 401) as f64 - 20.0;
        let place = Vector3::from([part(7), part(31), part(113)]);
        let side = if cut.height(place) >= 0.0 { Side::Above } else { Side::Below };
        let back = Vector3::from(cut.closed(cut.apply(place, 1.0, side).into()));
        assert!((back - place).norm() < 1e-9, "{place} comes back to {back}");
    }
    // Between the lips.
    let between = Vector3::from(cut.centre) + 0.1 * Vector3::from(cut.normal);
    assert!(cut.height(Vector3::from(cut.closed(between.into()))).abs() < 1e-9);
    assert_eq!(cut.closed([100.0; 3]), [100.0; 3]);
}
