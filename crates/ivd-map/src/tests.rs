use ivd_core::{Ball, Classified, Exec, Frame, Grid, Lattice, Mask, Motion, Role, VoxelCoord, VoxelIndex};
use ivd_field::fixtures::{lattice, middle, sheared_grid, voxels};
use nalgebra::Vector3;

use super::*;

/// The plain twin of the octree's query: every triangle (Ericson 2005, 5.1.5).
struct Brute<'a> {
    lattice: &'a Lattice,
    positions: &'a [Vector3<f64>],
    /// Centre and radius of a ball round each triangle: too far a ball spares the exact distance.
    balls: Vec<(Vector3<f64>, f64)>,
}

impl<'a> Brute<'a> {
    fn new(lattice: &'a Lattice, positions: &'a [Vector3<f64>]) -> Self {
        let ball = |t: &[u32; 3]| {
            let corners = t.map(|v| positions[v as usize]);
            let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
            (centre, corners.iter().map(|c| (c - centre).norm()).fold(0.0, f64::max))
        };
        Self { lattice, positions, balls: lattice.triangles().iter().map(ball).collect() }
    }
}

impl Nearest for Brute<'_> {
    fn nearest(&self, point: Vector3<f64>, bound: f64, _known_still: bool) -> Found {
        let mut best: Option<Hit> = None;
        for (i, t) in self.lattice.triangles().iter().enumerate() {
            let (centre, radius) = self.balls[i];
            let far = best.map_or(bound, |b| b.distance) + radius * 1.000_001;
            if (point - centre).norm_squared() > far * far {
                continue;
            }
            let corners = t.map(|v| self.positions[v as usize]);
            let barycentric = closest(point, corners);
            let at = corners[0] * barycentric[0] + corners[1] * barycentric[1] + corners[2] * barycentric[2];
            let distance = (point - at).norm();
            if distance <= bound && best.is_none_or(|b| distance < b.distance) {
                best = Some(Hit { triangle: i as u32, barycentric, distance });
            }
        }
        best.map_or(Found::Nothing, Found::On)
    }
}

fn closest(p: Vector3<f64>, [a, b, c]: [Vector3<f64>; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(&(p - a)), ac.dot(&(p - a)));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (ab.dot(&(p - b)), ac.dot(&(p - b)));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let (d5, d6) = (ab.dot(&(p - c)), ac.dot(&(p - c)));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

/// A scene: a part, the motion of its vertices by their position, and the handles' balls (relative to the origin).
pub(super) struct Scene {
    pub(super) lattice: Lattice,
    pub(super) mask: Mask,
    pub(super) motion: Motion,
}

pub(super) fn scene(
    grid: &Grid,
    level: impl Fn(Vector3<f64>) -> f64,
    moves: impl Fn(Vector3<f64>) -> Vector3<f64>,
    balls: &[(Vector3<f64>, f64)],
) -> Scene {
    let (lattice, mask) = lattice(grid, level);
    let displacement = lattice.local_positions().into_iter().map(|p| moves(p).into()).collect();
    let origin = Vector3::from(grid.origin());
    let reach = balls.iter().map(|(c, r)| Ball { centre: (c + origin).into(), radius: *r }).collect();
    let motion = Motion::new(grid.clone(), lattice.keys().len(), vec![Frame { time: 0.5, displacement }]);
    Scene { lattice, mask, motion: motion.unwrap().with_reach(reach).unwrap() }
}

/// A motion of the same reach in other frames.
pub(super) fn with_frames(motion: &Motion, frames: Vec<Frame>) -> Motion {
    let moved = Motion::new(motion.grid().clone(), frames[0].displacement.len(), frames).unwrap();
    moved.with_reach(motion.reach().to_vec()).unwrap()
}

impl Scene {
    pub(super) fn map(&self, params: &OctreeParams, exec: &Exec) -> Result<MapResult, Error> {
        let tree = ivd_octree::build(&self.lattice, &ivd_octree::Params::default(), exec)?;
        octree(&self.lattice, &tree, &self.motion, 0, params, exec)
    }

    /// The plain twin.
    fn map_brute(&self, params: &OctreeParams, exec: &Exec) -> Result<MapResult, Error> {
        let positions = self.lattice.local_positions();
        let brute = Brute::new(&self.lattice, &positions);
        nearest(&self.lattice, &self.mask, &brute, &self.motion, 0, params, exec)
    }

    fn mapped(&self, params: &OctreeParams) -> MapResult {
        self.map(params, &Exec::default()).unwrap()
    }
}

/// A bump of a surface: `push` at `at`, 0 from `radius` on.
fn pushed(at: Vector3<f64>, radius: f64, push: Vector3<f64>) -> impl Fn(Vector3<f64>) -> Vector3<f64> {
    ivd_field::fixtures::bump(at, radius, push)
}

pub(super) fn ball(centre: Vector3<f64>, radius: f64) -> impl Fn(Vector3<f64>) -> f64 {
    move |p| radius - (p - centre).norm()
}

/// A ball of 10 mm with a dent or bump at its top, on a grid of 1 mm × `scale`.
pub(super) fn dented(scale: f64, push: f64) -> Scene {
    let grid = Grid::with_spacing([32, 32, 32], [scale; 3]).unwrap();
    let centre = middle(&grid);
    let top = centre + Vector3::new(0.0, 0.0, 10.0 * scale);
    let (radius, push) = (8.0 * push.abs() * scale, Vector3::new(0.0, 0.0, push * scale));
    scene(&grid, ball(centre, 10.0 * scale), pushed(top, radius, push), &[(top, radius)])
}

/// A bar with a push of some lengths (mm) at each end.
pub(super) fn both_ends_pushed(lengths: [f64; 2]) -> Scene {
    pushed_apart(lengths, 24.0)
}

/// The same with pushes whose balls come to overlap as they grow.
pub(super) fn near_pushed(lengths: [f64; 2]) -> Scene {
    pushed_apart(lengths, 10.0)
}

/// The same with pushes so far (mm) from the middle.
fn pushed_apart(lengths: [f64; 2], off: f64) -> Scene {
    let grid = Grid::with_spacing([72, 30, 30], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let bar = move |p: Vector3<f64>| {
        let (along, across) = ((p - centre).x.abs(), (p - centre).yz().norm());
        (32.0 - along).min(7.0 - across)
    };
    let ends = [-1.0, 1.0].map(|way| centre + Vector3::new(way * off, 0.0, 7.0));
    let pushes = [0, 1].map(|i| pushed(ends[i], 6.0, Vector3::z() * -lengths[i]));
    let moves = move |p: Vector3<f64>| pushes.iter().map(|push| push(p)).sum();
    scene(&grid, bar, moves, &ends.map(|end| (end, 6.0)))
}

/// The maps of both pushes, a short and a long one, and of each alone: what one moves the other doesn't change by a bit.
pub(super) fn mapped_apart(of: impl Fn([f64; 2]) -> MapResult) -> [MapResult; 3] {
    let [both, one, other] = [of([0.7, 2.5]), of([0.7, 0.0]), of([0.0, 2.5])];
    let forward = |mapped: &MapResult, v| mapped.displacement.forward().at(v);
    let inverse = |mapped: &MapResult, v| mapped.displacement.inverse().at(v);
    let mut moved = [0; 2];
    for voxel in voxels(both.displacement.grid()) {
        let alone = if forward(&one, voxel) == [0.0; 3] { &other } else { &one };
        let at = forward(&both, voxel);
        assert_eq!(at, forward(alone, voxel), "{voxel:?}");
        assert!(forward(&one, voxel) == [0.0; 3] || forward(&other, voxel) == [0.0; 3], "{voxel:?}");
        let alone = if inverse(&one, voxel) == [0.0; 3] { &other } else { &one };
        assert_eq!(inverse(&both, voxel), inverse(alone, voxel), "{voxel:?}");
        moved[usize::from(voxel.0[0] > 36)] += usize::from(at != [0.0; 3]);
    }
    // The longer way takes more room.
    assert!(moved[0] > 500 && moved[1] > 2 * moved[0], "{moved:?}");
    [both, one, other]
}

#[test]
fn no_motion_is_the_identity_without_a_brick() {
    let grid = sheared_grid([20, 20, 10]);
    let still = scene(&grid, ball(middle(&grid), 4.0), |_| Vector3::zeros(), &[(middle(&grid), 5.0)]);
    let mapped = still.mapped(&OctreeParams::default());
    assert!(mapped.displacement.is_identity());
    assert_eq!(
        (mapped.figures.voxels_moved, mapped.figures.bricks_touched, mapped.figures.bricks_total),
        (0, 0, 18)
    );
    assert_eq!(
        (mapped.figures.min_det_j, mapped.figures.folds, mapped.figures.inverse_residual_max_voxel),
        (1.0, 0, 0.0)
    );
}

#[test]
fn translation_with_weight_one_moves_every_inside_voxel_exactly() {
    for (grid, push) in [
        (Grid::with_spacing([36, 32, 32], [1.0; 3]).unwrap(), Vector3::new(3.0, -1.0, 0.7)),
        (sheared_grid([40, 32, 16]), Vector3::new(1.1, -0.3, 0.4)),
    ] {
        let radius = 0.2 * (grid.linear_part() * Vector3::new(1.0, 0.0, 0.0)).norm() * 40.0;
        let centre = middle(&grid);
        let all = scene(&grid, ball(centre, radius), |_| push, &[(centre, 2.0 * radius)]);
        let mapped = all.mapped(&OctreeParams { weight: DepthWeight::One, ..OctreeParams::default() });
        assert_eq!((mapped.figures.relaxations, mapped.figures.halvings), (0, 0));
        let expected: [f32; 3] = push.map(|c| c as f32).into();
        for v in voxels(&grid).filter(|v| all.mask.inside()[grid.linear(*v)] == 1) {
            assert_eq!(mapped.displacement.forward().at(v), expected, "{v:?}");
        }
        let [rest, deformed] = mapped.figures.followed.volume_mm3;
        assert!(rest > 0.0 && (deformed / rest - 1.0).abs() < 0.02, "{rest} → {deformed} mm³");
    }
}

#[test]
fn what_is_squeezed_is_told_with_the_cell_that_the_certificate_finds_worst() {
    let pressed = dented(0.7, -3.0);
    let mapped = pressed.mapped(&OctreeParams::default());
    let (grid, field) = (mapped.displacement.grid(), mapped.displacement.forward());
    let proof = ivd_field::certificate::certify(field, grid, 0.05, |_| true, &Exec::default()).unwrap();
    let worst = proof.worst.unwrap();
    let at = mapped.figures.min_det_j_at_mm.unwrap();
    assert_eq!(at, worst.cell.map(|c| 0.7 * (c as f64 + 0.5)));
    assert!(worst.lower < 1.0, "pressed in, something gives way");
    assert_eq!(mapped.figures.squeezed.unwrap().voxels, 0, "pressed in gently");
    let figures = MapFigures { min_det_j: 0.05, ..mapped.figures };
    let told = figures.remark().unwrap();
    let place = at.map(|c| format!("{c:.1}")).join(", ");
    for words in [
        "no voxel as a whole is squeezed to less than a tenth of its volume",
        &format!("a corner of one is, to 5.0 % at {place} mm (at rest)"),
    ] {
        assert!(told.contains(words), "{words}: {told}");
    }
    assert!(figures.is_plain(), "a corner alone");
    let older = MapFigures { min_det_j_at_mm: None, squeezed: None, ..figures };
    assert!(!older.is_plain());
    assert!(older.remark().unwrap().contains("space is squeezed to less than"));
}

#[test]
fn what_is_squeezed_is_counted_as_every_cell_by_itself() {
    // Pressed in further and further, until whole voxels give way.
    let grid = Grid::with_spacing([40; 3], [0.7; 3]).unwrap();
    let (centre, up) = (middle(&grid), Vector3::new(0.0, 0.0, 8.4));
    let (top, radius) = (centre + up, 7.0);
    let pressed = |by: f64| {
        let scene = scene(&grid, ball(centre, 8.4), pushed(top, radius, -by * up), &[(top, radius)]);
        scene.map(&OctreeParams::default(), &Exec::default()).ok()
    };
    let is_squeezed = |mapped: &MapResult| mapped.figures.squeezed.unwrap().voxels > 0;
    let mapped = [0.6, 0.8, 1.0, 1.2, 1.4].into_iter().filter_map(pressed).find(is_squeezed).unwrap();
    let (grid, field) = (mapped.displacement.grid(), mapped.displacement.forward());
    let squeezed = mapped.figures.squeezed.unwrap();
    // By differences of the motion at the middle of each cell, from its eight voxels.
    let [nx, ny, nz] = grid.dims().map(|n| n as i64);
    let at = |x: i64, y: i64, z: i64| {
        let clamped = [x.clamp(0, nx - 1), y.clamp(0, ny - 1), z.clamp(0, nz - 1)];
        Vector3::from(field.at(VoxelIndex(clamped.map(|c| c as usize)))).map(f64::from)
    };
    let (mut thin, mut moving) = (0, 0);
    for (z, y, x) in (-1..nz).flat_map(|z| (-1..ny).flat_map(move |y| (-1..nx).map(move |x| (z, y, x)))) {
        let corners: [Vector3<f64>; 8] =
            std::array::from_fn(|i| at(x + (i & 1) as i64, y + (i >> 1 & 1) as i64, z + (i >> 2) as i64));
        if corners.iter().all(|u| *u == Vector3::zeros()) {
            continue;
        }
        let along = |axis: usize| -> Vector3<f64> {
            let sign = |i: usize| if i >> axis & 1 == 1 { 0.25 } else { -0.25 };
            (0..8).map(|i| corners[i] * sign(i)).sum()
        };
        let jacobian = nalgebra::Matrix3::identity()
            + nalgebra::Matrix3::from_columns(&[0, 1, 2].map(along)) / grid.spacing()[0];
        moving += 1;
        thin += u64::from(jacobian.determinant() < 0.1);
    }
    assert!(thin > 0, "pressed in hard: {:?}", mapped.figures.min_det_j);
    assert_eq!(squeezed.voxels, thin);
    assert!((squeezed.volume_mm3 - thin as f64 * 0.7_f64.powi(3)).abs() < 1e-9 * thin as f64);
    assert!((squeezed.share - thin as f64 / f64::from(moving)).abs() < 1e-12);
    let told = mapped.figures.remark().unwrap();
    assert!(told.contains(&format!("space of {thin} voxels (")), "{told}");
    assert!(told.contains("% of what moves) is squeezed to less than a tenth"), "{told}");
    assert!(!mapped.figures.is_plain());
}

#[test]
fn handle_with_eight_times_the_radius_passes_inwards_and_outwards_in_every_weight() {
    for push in [-3.0, 3.0] {
        for weight in [DepthWeight::Smooth, DepthWeight::Linear, DepthWeight::Exponential, DepthWeight::One] {
            let mapped = dented(1.0, push).mapped(&OctreeParams { weight, ..OctreeParams::default() });
            assert!(mapped.figures.min_det_j > 0.0 && mapped.figures.folds == 0);
            assert!(mapped.figures.inverse_residual_max_voxel < 1e-5);
            assert!(
                mapped.figures.followed.misfit < 0.15,
                "{weight:?} {push}: misfit {}",
                mapped.figures.followed.misfit
            );
            let [rest, deformed] = mapped.figures.followed.volume_mm3;
            assert_eq!(deformed > rest, push > 0.0);
        }
    }
}

#[test]
fn nothing_moves_beyond_the_reach_and_its_margin() {
    let grid = sheared_grid([48, 40, 16]);
    let centre = middle(&grid);
    let at = centre + Vector3::new(6.0, 0.0, 0.0);
    let dent = scene(&grid, ball(centre, 6.0), pushed(at, 5.0, Vector3::new(-0.8, 0.3, 0.0)), &[(at, 5.0)]);
    let params =
        OctreeParams { band: Band { margin: Some(3.0), ..Band::default() }, ..OctreeParams::default() };
    let mapped = dent.mapped(&params);
    assert!(mapped.figures.voxels_moved > 100);
    for v in voxels(&grid) {
        if (grid.linear_part() * VoxelCoord::from(v).0 - at).norm() >= 8.0 {
            assert_eq!(mapped.displacement.forward().at(v), [0.0; 3]);
            assert_eq!(mapped.displacement.inverse().at(v), [0.0; 3]);
        }
    }
}

#[test]
fn two_handles_and_one_outside_the_lattice_move_only_their_own_places() {
    let grid = Grid::with_spacing([56, 32, 32], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let bar = move |p: Vector3<f64>| {
        20.0 - (p - centre).abs().x.max(3.0 * (p - centre).abs().y.max((p - centre).abs().z))
    };
    let ends = [centre + Vector3::new(20.0, 0.0, 0.0), centre - Vector3::new(20.0, 0.0, 0.0)];
    let far = centre + Vector3::new(0.0, 40.0, 0.0);
    let moves = move |p| {
        pushed(ends[0], 12.0, Vector3::new(0.0, 1.5, 0.0))(p)
            + pushed(ends[1], 12.0, Vector3::new(0.0, 0.0, -1.5))(p)
    };
    let two = scene(&grid, bar, moves, &[(ends[0], 12.0), (ends[1], 12.0), (far, 3.0)]);
    let mapped = two.mapped(&OctreeParams::default());
    let at = |p: Vector3<f64>| {
        mapped.displacement.forward().at(VoxelIndex([0, 1, 2].map(|a| p[a].round() as usize)))
    };
    assert!(at(ends[0] - Vector3::x() * 2.0)[1] > 1.0 && at(ends[1] + Vector3::x() * 2.0)[2] < -1.0);
    assert_eq!(at(centre), [0.0; 3]);
}

#[test]
fn still_piece_beside_a_moving_one_is_pushed_aside_instead_of_folding() {
    // Two plates three voxels apart; the upper comes down by three.
    let grid = Grid::with_spacing([40, 40, 32], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let plates = move |p: Vector3<f64>| {
        let q = p - centre;
        let upper = 2.6 - (q.z - 4.0).abs();
        let lower = 2.6 - (q.z + 4.0).abs();
        upper.max(lower).min(15.0 - q.x.abs().max(q.y.abs()))
    };
    let top = centre + Vector3::new(0.0, 0.0, 6.0);
    let push = pushed(top, 24.0, Vector3::new(0.0, 0.0, -3.0));
    let moves = move |p: Vector3<f64>| if p.z > centre.z { push(p) } else { Vector3::zeros() };
    let scene = scene(&grid, plates, moves, &[(top, 24.0)]);
    let mapped = scene.mapped(&OctreeParams::default());
    assert!(mapped.figures.relaxations > 0 || mapped.figures.halvings > 0);
    assert!(mapped.figures.min_det_j > 0.0 && mapped.figures.followed.misfit < 0.5);
    assert!(mapped.figures.inverse_residual_max_voxel < 1e-3);
}

#[test]
fn push_deeper_than_the_part_is_refused_with_the_place_and_a_remedy() {
    // The upper face of a plate four voxels thick comes down by twelve, the lower stays.
    let grid = Grid::with_spacing([40, 40, 32], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let plate = move |p: Vector3<f64>| 2.0 - (p - centre).z.abs();
    let top = centre + Vector3::new(0.0, 0.0, 2.0);
    let moves = move |p: Vector3<f64>| {
        if p.z > centre.z { pushed(top, 10.0, Vector3::new(0.0, 0.0, -12.0))(p) } else { Vector3::zeros() }
    };
    let error = scene(&grid, plate, moves, &[(top, 10.0)])
        .map(&OctreeParams::default(), &Exec::default())
        .unwrap_err();
    assert_eq!(error.error_class(), ivd_core::ErrorClass::Untrusted, "{error}");
    assert!(error.to_string().contains("larger radius"), "{error}");
}

#[test]
fn a_way_that_ends_is_told_and_gone_as_far_as_it_leads() {
    // A ball pressed flat on its far half, which stays.
    let grid = Grid::with_spacing([40; 3], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let top = centre + Vector3::new(0.0, 0.0, 8.0);
    let push = pushed(top, 14.0, Vector3::new(0.0, 0.0, -24.0));
    let pressed = scene(&grid, ball(centre, 8.0), &push, &[(top, 14.0)]);
    let limit = |limit| OctreeParams { band: Band { limit, ..Band::default() }, ..OctreeParams::default() };
    let error = pressed.map(&limit(Limit::Refuse), &Exec::default()).unwrap_err();
    let Error::Beyond { share, .. } = &error else { panic!("{error}") };
    assert!(*share > 0.0 && *share < 1.0 && error.to_string().contains("% of the way"), "{error}");
    let stopped = pressed.map(&limit(Limit::Stop), &Exec::default()).unwrap();
    assert_eq!(stopped.figures.share, *share);
    let part = scene(&grid, ball(centre, 8.0), move |p| push(p) * *share, &[(top, 14.0)]);
    let part = part.mapped(&OctreeParams::default());
    assert_eq!((part.figures.share, part.displacement), (1.0, stopped.displacement));
}

#[test]
fn what_nothing_reaches_goes_along_and_what_is_held_stays() {
    // A speck over a ball that is pulled up; without a role it would stand in the way.
    let grid = Grid::with_spacing([48; 3], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let speck = centre + Vector3::new(0.0, 0.0, 16.0);
    let both = move |p: Vector3<f64>| (8.0 - (p - centre).norm()).max(4.0 - (p - speck).norm());
    let top = centre + Vector3::new(0.0, 0.0, 8.0);
    let push = pushed(top, 22.0, Vector3::new(0.0, 0.0, 1.5));
    let is_speck = move |p: Vector3<f64>| (p - speck).norm() < 5.0;
    let moves = move |p: Vector3<f64>| if is_speck(p) { Vector3::zeros() } else { push(p) };
    let mut scene = scene(&grid, both, moves, &[(top, 22.0)]);
    for (role, least, most) in [(Role::Carried, 0.2, 1.5), (Role::Held, -0.4, 0.4)] {
        let roles: Vec<u8> = scene
            .lattice
            .local_positions()
            .iter()
            .map(|p| if is_speck(*p) { role as u8 } else { Role::Driven as u8 })
            .collect();
        scene.motion = scene.motion.clone().with_roles(roles.clone().into()).unwrap();
        let specks = roles.iter().filter(|r| **r != 0).count() as u64;
        let biharmonic =
            || biharmonic(&scene.lattice, &scene.motion, 0, &BiharmonicParams::default(), &Exec::default());
        let fem = || fem(&scene.lattice, None, &scene.motion, 0, &FemParams::default(), &Exec::default());
        for mapped in [scene.mapped(&OctreeParams::default()), biharmonic().unwrap(), fem().unwrap()] {
            let fit = &mapped.figures.followed;
            let counted = if role == Role::Carried { fit.vertices_carried } else { fit.vertices_held };
            assert_eq!(counted, specks);
            let voxel = VoxelIndex(speck.map(|c| c.round() as usize).into());
            let up = f64::from(mapped.displacement.forward().at(voxel)[2]);
            assert!(least <= up && up <= most, "{role:?}: {up}");
        }
    }
}

#[test]
fn scale_of_the_scene_changes_lengths_and_nothing_else() {
    let one = dented(1.0, -3.0).mapped(&OctreeParams::default());
    for scale in [1.0 / 1024.0, 1024.0, 1e-3, 1e3] {
        let other = dented(scale, -3.0).mapped(&OctreeParams::default());
        assert_eq!(other.figures.bricks_touched, one.figures.bricks_touched);
        // A power of two scales without rounding; else ties between nearest points may fall differently.
        if scale.log2().fract() == 0.0 {
            assert!(
                (other.figures.min_det_j - one.figures.min_det_j).abs() < 1e-6,
                "{} for {}",
                other.figures.min_det_j,
                one.figures.min_det_j
            );
        }
        assert!((other.figures.followed.misfit - one.figures.followed.misfit).abs() < 0.02);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for params in [
        OctreeParams::default(),
        OctreeParams { band: Band { outside: Outside::Free, ..Band::default() }, ..OctreeParams::default() },
    ] {
        let scene = dented(1.0, 3.0);
        let one = scene.map(&params, &Exec::default().with_threads(1)).unwrap();
        for threads in [2, 3] {
            assert_eq!(one, scene.map(&params, &Exec::default().with_threads(threads)).unwrap());
        }
    }
}

#[test]
fn free_part_moves_alone_and_leaves_background() {
    let grid = Grid::with_spacing([40, 32, 32], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    let push = Vector3::new(4.0, 0.0, 0.0);
    let whole = scene(&grid, ball(centre, 9.0), |_| push, &[(centre, 20.0)]);
    let params = OctreeParams {
        weight: DepthWeight::One,
        band: Band { outside: Outside::Free, ..Band::default() },
        ..OctreeParams::default()
    };
    let mapped = whole.mapped(&params);
    let inside = |x: i64, v: VoxelIndex| {
        let at = [v.0[0] as i64 + x, v.0[1] as i64, v.0[2] as i64];
        (0..40).contains(&at[0]) && whole.mask.inside()[grid.linear(VoxelIndex(at.map(|c| c as usize)))] == 1
    };
    for v in voxels(&grid) {
        let (here, comes) = (inside(0, v), inside(-4, v));
        let expected = if comes { [-4.0, 0.0, 0.0] } else { [0.0; 3] };
        assert_eq!(mapped.displacement.inverse().at(v), expected, "{v:?}");
        assert_eq!(mapped.displacement.vacated()[grid.linear(v)] == 1, here && !comes, "{v:?}");
    }
    let warped = ivd_field::warp::mask(&whole.mask, &mapped.displacement, &Exec::default()).unwrap().output;
    assert_eq!(warped.count(), whole.mask.count());
}

#[test]
fn octree_and_plain_loop_give_the_same_map() {
    for scene in [dented(1.0, 3.0), dented(0.3, -2.0)] {
        for outside in [Outside::Band, Outside::Free] {
            let params =
                OctreeParams { band: Band { outside, ..Band::default() }, ..OctreeParams::default() };
            let (fast, plain) = (scene.mapped(&params), scene.map_brute(&params, &Exec::default()).unwrap());
            let worst = fast
                .displacement
                .forward()
                .vectors()
                .iter()
                .zip(plain.displacement.forward().vectors())
                .map(|(a, b)| (Vector3::from(*a) - Vector3::from(*b)).norm())
                .fold(0.0, f32::max);
            assert_eq!(fast.displacement.forward().table(), plain.displacement.forward().table());
            assert!(worst < 1e-6, "{outside:?}: {worst} mm");
        }
    }
}

#[test]
fn all_frames_are_mapped_as_each_alone() {
    let mut scene = dented(1.0, 2.0);
    let whole = scene.motion.frames()[0].clone();
    let half = whole.displacement.iter().map(|d| d.map(|c| c / 2.0)).collect();
    scene.motion = with_frames(&scene.motion, vec![Frame { time: 0.25, displacement: half }, whole]);
    let exec = Exec::default();
    let tree = ivd_octree::build(&scene.lattice, &ivd_octree::Params::default(), &exec).unwrap();
    let all = frames(&scene.lattice, &tree, &scene.motion, &OctreeParams::default(), &exec).unwrap();
    let second = octree(&scene.lattice, &tree, &scene.motion, 1, &OctreeParams::default(), &exec).unwrap();
    assert_eq!((all.len(), all[0].displacement.time()), (2, 0.25));
    assert_eq!(all[1], second);
    assert!(octree(&scene.lattice, &tree, &scene.motion, 2, &OctreeParams::default(), &exec).is_err());
}

#[test]
fn a_motion_of_another_lattice_is_refused() {
    let mut scene = dented(1.0, 3.0);
    let Frame { time, displacement } = &scene.motion.frames()[0];
    let one_more = displacement.iter().copied().chain([[0.0; 3]]).collect();
    scene.motion = with_frames(&scene.motion, vec![Frame { time: *time, displacement: one_more }]);
    let error = scene.map(&OctreeParams::default(), &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("vertices"), "{error}");
}

#[test]
fn voxels_that_a_free_part_leaves_in_place_are_their_own_origin_exactly() {
    let grid = sheared_grid([24, 22, 20]);
    let centre = middle(&grid);
    let side = centre + Vector3::new(5.0, 0.0, 0.0);
    let (reach, margin, push) = (1.8, 1.2, Vector3::new(0.2, 0.15, -0.1));
    let part = scene(&grid, ball(centre, 5.0), pushed(side, reach, push), &[(side, reach)]);
    let params = OctreeParams {
        band: Band { outside: Outside::Free, margin: Some(margin), tolerance: 1.0, ..Band::default() },
        ..OctreeParams::default()
    };
    let moved = part.mapped(&params).displacement;
    assert!(!moved.is_identity());
    for v in voxels(&grid) {
        let from_reach = (grid.linear_part() * VoxelCoord::from(v).0 - side).norm() - reach;
        if from_reach > margin + 1e-9 {
            assert_eq!((moved.forward().at(v), moved.inverse().at(v)), ([0.0; 3], [0.0; 3]), "{v:?}");
        }
    }
}

#[test]
fn a_motion_that_no_vector_holds_is_refused_as_untrusted() {
    let grid = Grid::with_spacing([12; 3], [1.0; 3]).unwrap();
    let centre = middle(&grid);
    for far in [1e38, 1e100, 1e200] {
        let part = scene(&grid, ball(centre, 4.0), |_| Vector3::new(far, 0.0, 0.0), &[(centre, 5.0)]);
        let error = part.map(&OctreeParams::default(), &Exec::default()).unwrap_err();
        assert_eq!(error.error_class(), ivd_core::ErrorClass::Untrusted, "{error}");
        assert!(error.to_string().contains("move the handle less"), "{error}");
    }
}
