use ivd_core::{Classified as _, ErrorClass, Grid, VoxelIndex, Voxels};
use ivd_elastic::Tissue;
use ivd_lattice::extract::{ExtractParams, Iso, extract};

use super::*;
use crate::handles::Anchor;
use crate::rigid::{Drive, Region, RigidTransform};

/// The lattice of what lies where a function of a place (mm, from the middle of the grid) is positive, and the volume's labels: 1 there, 2 where
/// it lies within another.
fn part(n: usize, of: impl Fn(Vector3<f64>) -> f64, core: impl Fn(Vector3<f64>) -> f64) -> (Lattice, Labels) {
    let grid = Grid::with_spacing([n; 3], [1.0; 3]).unwrap();
    let middle = Vector3::repeat((n as f64 - 1.0) / 2.0);
    let at = |i: usize| VoxelCoord::from(grid.index(i)).0 - middle;
    let voxels: Vec<f32> = (0..grid.len()).map(|i| of(at(i)) as f32).collect();
    let ids: Vec<u16> =
        (0..grid.len()).map(|i| if core(at(i)) >= 0.0 { 2 } else { u16::from(of(at(i)) >= 0.0) }).collect();
    let class = |id: u16| ivd_core::Class {
        id,
        name: None,
        mean: 0.0,
        sd: 0.0,
        voxels: ids.iter().filter(|own| **own == id).count() as u64,
        lower: None,
        upper: None,
    };
    let classes = vec![class(1), class(2)];
    let labels = Labels::new(grid.clone(), ids.into(), classes).unwrap();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    let params = ExtractParams { iso: Iso::Value(0.0) };
    (extract(&volume, None, &params, &Exec::default()).unwrap().lattice, labels)
}

fn ball(radius: f64) -> impl Fn(Vector3<f64>) -> f64 {
    move |at| radius - at.norm()
}

fn nowhere(_: Vector3<f64>) -> f64 {
    -1.0
}

fn handle(at: [f64; 3], by: [f64; 3], radius: f64) -> Handle {
    Handle { at: Anchor::NearestTo(at), action: Action::Move(by), radius }
}

fn run(
    (lattice, labels): &(Lattice, Labels),
    handles: &[Handle],
    bones: &[BoneSpec],
    params: &ElasticParams,
) -> Result<ElasticResult, Error> {
    let inputs = ElasticInputs { lattice, labels: Some(labels), volume: None };
    solve(inputs, handles, &[], bones, params, &Exec::default())
}

#[test]
fn the_grip_goes_where_the_handle_does_and_nothing_beyond_the_radius_moves() {
    let scene = part(41, ball(14.0), nowhere);
    let solved =
        run(&scene, &[handle([20.0, 20.0, 34.0], [0.5, 0.0, 2.0], 12.0)], &[], &ElasticParams::default())
            .unwrap();
    let lattice = &scene.0;
    let top = (0..lattice.keys().len()).min_by(|a, b| {
        let far = |v: &usize| (lattice.world(*v).0 - Vector3::new(20.0, 20.0, 34.0)).norm();
        far(a).total_cmp(&far(b))
    });
    let target = top.unwrap();
    let displacement = &solved.motion.frames()[0].displacement;
    assert_eq!(displacement[target], [0.5, 0.0, 2.0]);
    let centre = lattice.world(target).0;
    let far = |v: usize| (lattice.world(v).0 - centre).norm();
    for v in 0..lattice.keys().len() {
        if far(v) >= 12.0 {
            assert_eq!(displacement[v], [0.0; 3]);
        }
        // Within the grip matter goes as one, and falls off from there.
        if far(v) < 1.0 {
            assert!(
                (Vector3::from(displacement[v]) - Vector3::new(0.5, 0.0, 2.0)).norm() < 1e-12,
                "{}",
                far(v)
            );
        }
    }
    let field = &solved.motion.space()[0];
    let grid = lattice.grid();
    for i in 0..grid.len() {
        let away = (grid.world(VoxelCoord::from(grid.index(i))).0 - centre).norm();
        assert!(away < 12.0 || field.at(grid.index(i)) == [0.0; 3]);
    }
    // The lattice goes where the voxels do.
    let sampler = ivd_field::sampler::Sampler::new(field, grid);
    for v in 0..lattice.keys().len() {
        let space = grid.linear_part() * sampler.at(lattice.voxel(v).0);
        assert!((space - Vector3::from(displacement[v])).norm() < 1e-5);
    }
    assert!(solved.residual <= 1e-3 && solved.vertices_moved > 100, "{solved:?}");
    let force = Vector3::from(solved.handle_forces_mn[0]);
    assert!(force.z > 0.0 && force.x > 0.0, "{force}");
}

#[test]
fn a_rigid_class_stays_and_a_bone_goes_as_one_and_soft_matter_follows() {
    let scene = part(41, ball(15.0), ball(6.0));
    let rigid = Material { rigid: true, ..Material::default() };
    let params = ElasticParams { material: [(2, rigid)].into(), ..ElasticParams::default() };
    let push = [handle([20.0, 20.0, 35.0], [0.0, 0.0, -2.0], 30.0)];
    let solved = run(&scene, &push, &[], &params).unwrap();
    let field = &solved.motion.space()[0];
    let grid = scene.0.grid();
    let core: Vec<VoxelIndex> =
        (0..grid.len()).filter(|i| scene.1.ids()[*i] == 2).map(|i| grid.index(i)).collect();
    assert!(core.len() > 800 && core.iter().all(|v| field.at(*v) == [0.0; 3]));
    // What lies between is pressed, what lies behind hardly moves.
    let above = field.at(VoxelIndex([20, 20, 30]));
    assert!(above[2] < -0.4 && above[2] > -2.1, "{above:?}");
    assert!(field.at(VoxelIndex([20, 20, 8]))[2].abs() < 0.2);

    // The core turned: no handle.
    let turn = RigidTransform { pivot: [20.0; 3], axis: [0.0, 0.0, 1.0], angle: 20.0, by: [0.0, 0.5, 1.0] };
    let bone = BoneSpec {
        name: "core".into(),
        parent: None,
        region: Some(Region::Ball { centre: [20.0; 3], radius: 7.0 }),
        class: None,
        drive: Drive::Prescribed(turn),
        reach: 12.0,
    };
    let scene = part(41, |at| (10.0 - at.norm()).min(0.5 + 1e-3 * at.norm()), nowhere);
    let solved = run(&scene, &[], std::slice::from_ref(&bone), &ElasticParams::default());
    // A bone that holds no vertex is refused by name.
    assert!(solved.unwrap_err().to_string().contains("core"));
    let bone = BoneSpec { region: Some(Region::Ball { centre: [20.0; 3], radius: 11.0 }), ..bone };
    let solved = run(&scene, &[], std::slice::from_ref(&bone), &ElasticParams::default()).unwrap();
    let displacement = &solved.motion.frames()[0].displacement;
    let expected = |at: Vector3<f64>| {
        let arm = at - Vector3::repeat(20.0);
        nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 20_f64.to_radians()) * arm - arm
            + Vector3::new(0.0, 0.5, 1.0)
    };
    for v in 0..scene.0.keys().len() {
        let wanted = expected(scene.0.world(v).0);
        assert!((Vector3::from(displacement[v]) - wanted).norm() < 1e-9);
    }
    let field = &solved.motion.space()[0];
    let inner = field.at(VoxelIndex([23, 20, 20]));
    assert!((Vector3::from(inner).map(f64::from) - expected(Vector3::new(23.0, 20.0, 20.0))).norm() < 1e-6);
}

#[test]
fn tissues_and_hounsfield_values_say_what_moduli_do() {
    let scene = part(41, ball(15.0), ball(6.0));
    let (lattice, labels) = (&scene.0, &scene.1);
    let push = [handle([20.0, 20.0, 35.0], [0.0, 0.0, -1.5], 30.0)];
    let with = |own: Material| ElasticParams { material: [(2, own)].into(), ..ElasticParams::default() };
    let named = |tissue| Material { tissue: Some(tissue), ..Material::default() };
    let moved = |own: Material| run(&scene, &push, &[], &with(own)).unwrap().motion;
    let rigid = Material { rigid: true, ..Material::default() };
    assert_eq!(moved(named(Tissue::Bone)), moved(rigid));
    let lung = Material { kpa: Some(0.74), poisson: Some(0.3), ..Material::default() };
    assert_eq!(moved(named(Tissue::Lung)), moved(lung));
    // What is given goes before what the tissue says: bone of 100 kPa yields.
    let given = |tissue| Material { tissue, kpa: Some(100.0), poisson: Some(0.3), ..Material::default() };
    assert_eq!(moved(given(Some(Tissue::Bone))), moved(given(None)));

    // The same core by its values: 700 HU in flesh of 50, nothing beyond the ball.
    let value = |id: &u16| [-1000.0, 50.0, 700.0][usize::from(*id)];
    let mut values: Vec<f32> = labels.ids().iter().map(value).collect();
    // What has no value is flesh.
    values[labels.grid().linear(VoxelIndex([20, 20, 31]))] = f32::NAN;
    let volume = Volume::new(labels.grid().clone(), Voxels::from(values)).unwrap();
    let by_value = ElasticParams { hounsfield: true, ..ElasticParams::default() };
    let solve_with = |volume, handles: &[Handle], params: &ElasticParams| {
        let inputs = ElasticInputs { lattice, labels: None, volume };
        solve(inputs, handles, &[], &[], params, &Exec::default())
    };
    let (found, told) = (solve_with(Some(&volume), &push, &by_value).unwrap().motion, moved(rigid));
    let core = (0..labels.grid().len()).filter(|i| labels.ids()[*i] == 2).map(|i| labels.grid().index(i));
    assert!(core.into_iter().all(|voxel| found.space()[0].at(voxel) == [0.0; 3]));
    let pairs = found.frames()[0].displacement.iter().zip(told.frames()[0].displacement.iter());
    let apart = pairs.map(|(a, b)| (Vector3::from(*a) - Vector3::from(*b)).norm()).fold(0.0, f64::max);
    assert!(apart < 0.05, "{apart} mm");
    // Specks of noise aren't bone.
    let mut noisy: Vec<f32> = labels.ids().iter().map(|id| if *id == 0 { -1000.0 } else { 50.0 }).collect();
    let specks = (0..noisy.len()).filter(|i| i % 37 == 0 && labels.ids()[*i] != 0).collect::<Vec<_>>();
    let plain = Volume::new(labels.grid().clone(), Voxels::from(noisy.clone())).unwrap();
    for i in &specks {
        noisy[*i] = 400.0;
    }
    let noisy = Volume::new(labels.grid().clone(), Voxels::from(noisy)).unwrap();
    let [with, without] = [&noisy, &plain].map(|of| solve_with(Some(of), &push, &by_value).unwrap().motion);
    assert!(specks.len() > 100 && with == without);
    let error = solve_with(None, &push, &by_value).unwrap_err().to_string();
    assert!(error.contains("hounsfield") && error.contains("--volume"), "{error}");
    // Without the key the volume isn't looked at.
    let plain = ElasticParams::default();
    assert_eq!(solve_with(Some(&volume), &push, &plain).unwrap(), solve_with(None, &push, &plain).unwrap());
    // A part of bone can't be pushed at.
    let bone: Vec<f32> = labels.ids().iter().map(|id| if *id == 0 { -1000.0 } else { 700.0 }).collect();
    let bone = Volume::new(labels.grid().clone(), Voxels::from(bone)).unwrap();
    let error = solve_with(Some(&bone), &push, &by_value).unwrap_err().to_string();
    assert!(error.contains("lies on what is rigid"), "{error}");
}

#[test]
fn matter_that_is_pressed_keeps_its_volume_and_air_gives_way() {
    let scene = part(41, ball(14.0), nowhere);
    let push = [handle([20.0, 20.0, 34.0], [0.0, 0.0, -3.0], 20.0)];
    let volume = |poisson: f64| {
        let params = ElasticParams { poisson, ..ElasticParams::default() };
        let solved = run(&scene, &push, &[], &params).unwrap();
        let at = |v: u32| scene.0.world(v as usize).0;
        let moved = |v: u32| at(v) + Vector3::from(solved.motion.frames()[0].displacement[v as usize]);
        let of = |place: &dyn Fn(u32) -> Vector3<f64>| -> f64 {
            let six = |t: &[u32; 3]| place(t[0]).dot(&place(t[1]).cross(&place(t[2])));
            scene.0.triangles().iter().map(six).sum::<f64>() / 6.0
        };
        of(&moved) / of(&at)
    };
    let (stiff, soft) = (volume(0.45), volume(0.0));
    assert!((stiff - 1.0).abs() < 0.01 && soft < stiff - 0.002, "{stiff} {soft}");
}

#[test]
fn a_push_into_bone_is_refused_with_the_share_that_holds() {
    // Six millimetres of tissue on bone, pushed by eight.
    let slab = |at: Vector3<f64>| 12.0 - at.z.abs().max(at.x.abs()).max(at.y.abs());
    let scene = part(41, slab, move |at| 6.0 - at.z.max(at.x.abs() - 6.0).max(at.y.abs() - 6.0));
    let rigid = Material { rigid: true, ..Material::default() };
    let params = ElasticParams { material: [(2, rigid)].into(), ..ElasticParams::default() };
    let push = |by: f64| run(&scene, &[handle([20.0, 20.0, 32.0], [0.0, 0.0, -by], 14.0)], &[], &params);
    let error = push(8.0).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Untrusted, "{error}");
    assert!(error.to_string().contains("% of the way"), "{error}");
    let whole = push(1.0).unwrap();
    assert_eq!(whole.share, 1.0);

    // Or it stops there: in balance, with the handle where the share says.
    let stopping = ElasticParams {
        limit: Limit::Stop,
        grip: Some(5.0),
        cell: Some(2),
        tolerance: 1e-4,
        ..params.clone()
    };
    let far = [handle([20.0, 20.0, 32.0], [0.0, 0.0, -8.0], 14.0)];
    let stopped = run(&scene, &far, &[], &stopping).unwrap();
    assert!(stopped.share > 0.2 && stopped.share < 1.0 && stopped.residual <= 1e-4, "{stopped:?}");
    let most = stopped.max_displacement_mm / (8.0 * stopped.share);
    assert!((1.0..1.2).contains(&most), "{most}");
    // As far as it goes it goes as one that was to go there.
    let by = [0.0, 0.0, -8.0 * stopped.share];
    let there = run(&scene, &[handle([20.0, 20.0, 32.0], by, 14.0)], &[], &stopping).unwrap();
    assert_eq!(there.share, 1.0);
    for (own, other) in
        stopped.motion.frames()[0].displacement.iter().zip(there.motion.frames()[0].displacement.iter())
    {
        assert!((Vector3::from(*own) - Vector3::from(*other)).norm() < 0.05, "{own:?} {other:?}");
    }
}

#[test]
fn a_plate_that_is_thinner_than_a_cell_is_not_walked_through() {
    // One voxel thick, between the nodes of cells of two.
    let at = |z: f64| move |p: Vector3<f64>| 0.4 - (p.z - z).abs();
    for z in [5.0, 6.0] {
        let scene = part(41, ball(16.0), at(z));
        let rigid = Material { rigid: true, ..Material::default() };
        let params =
            ElasticParams { cell: Some(2), material: [(2, rigid)].into(), ..ElasticParams::default() };
        let solved =
            run(&scene, &[handle([20.0, 20.0, 36.0], [0.0, 0.0, -2.0], 30.0)], &[], &params).unwrap();
        let field = &solved.motion.space()[0];
        let below = field.at(VoxelIndex([20, 20, 22]))[2];
        let above = field.at(VoxelIndex([20, 20, 31]))[2];
        assert!(below.abs() < 0.02 && above < -0.3, "{below} {above}");
    }
}

#[test]
fn the_other_lip_hardly_moves() {
    // Two blocks, two voxels apart.
    let lips = |at: Vector3<f64>| {
        let block = 9.0 - at.x.abs().max(at.y.abs() - 3.0);
        block.min(at.z.abs() - 1.0).min(12.0 - at.z.abs())
    };
    let scene = part(42, lips, nowhere);
    let pull = [handle([20.5, 20.5, 32.5], [0.0, 0.0, 2.0], 18.0)];
    let solved =
        run(&scene, &pull, &[], &ElasticParams { cell: Some(1), ..ElasticParams::default() }).unwrap();
    let below = (0..scene.0.keys().len()).filter(|v| scene.0.world(*v).0.z < 20.5);
    let most =
        below.map(|v| Vector3::from(solved.motion.frames()[0].displacement[v]).norm()).fold(0.0, f64::max);
    assert!(most < 0.05 * 2.0, "{most} mm of 2");
}

#[test]
fn bytes_do_not_depend_on_threads_and_what_is_missing_is_named() {
    let scene = part(33, ball(11.0), nowhere);
    let bare = ElasticInputs { lattice: &scene.0, labels: None, volume: None };
    let push = [handle([16.0, 16.0, 27.0], [0.0, 1.0, -2.0], 14.0)];
    let on = |threads: usize| {
        let exec = Exec::default().with_threads(threads);
        solve(bare, &push, &[], &[], &ElasticParams::default(), &exec).unwrap()
    };
    assert_eq!(on(1), on(3));
    let soft = ElasticParams { material: [(7, Material::default())].into(), ..ElasticParams::default() };
    assert!(run(&scene, &push, &[], &soft).unwrap_err().to_string().contains("class 7"));
    let error = solve(bare, &push, &[], &[], &soft, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("--labels"), "{error}");
    // Too small for a cell; on what stays.
    let tiny = [handle([16.0, 16.0, 27.0], [0.0, 0.1, 0.0], 0.5)];
    let error = run(&scene, &tiny, &[], &ElasticParams::default()).unwrap_err();
    assert!(error.to_string().contains("hold of nothing"), "{error}");
    let rigid = Material { rigid: true, ..Material::default() };
    let stone = ElasticParams { material: [(1, rigid)].into(), ..ElasticParams::default() };
    let error = run(&scene, &push, &[], &stone).unwrap_err();
    assert!(error.to_string().contains("rigid and stays"), "{error}");
    let three = ElasticParams { cell: Some(3), ..ElasticParams::default() };
    assert!(run(&scene, &push, &[], &three).unwrap_err().to_string().contains("1, 2 or 4"));
    let pin = Pin { at: push[0].at, radius: 0.0 };
    let error = solve(bare, &push, &[pin], &[], &ElasticParams::default(), &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("is fixed"), "{error}");
    // A force that nothing stands against, however far it reaches.
    let pull = Handle { action: Action::Force([0.0, 0.0, 5.0]), radius: 1e6, ..push[0] };
    let error = run(&scene, &[pull], &[], &ElasticParams::default()).unwrap_err();
    assert!(error.to_string().contains("nothing holds the body"), "{error}");
    let bad = ElasticParams { poisson: 0.5, ..ElasticParams::default() };
    assert!(run(&scene, &push, &[], &bad).unwrap_err().to_string().contains("poisson"));
    let cancelled = Exec::default();
    cancelled.cancel.cancel();
    assert!(solve(bare, &push, &[], &[], &ElasticParams::default(), &cancelled).is_err());
}
