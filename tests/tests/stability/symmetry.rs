//! Mirrored and turned input gives the mirrored and turned result, stage by stage.
//!
//! The scene has no ties: smooth values in single precision on which no two voxels agree.

use ivd_core::{ClassChoice, Displacement, Exec, Grid, Lattice, Volume, VoxelIndex, Voxels, World};
use ivd_field::warp::WarpParams;
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures::measure;
use ivd_lattice::refine::{RefineParams, Target, collapse};
use ivd_map::{Band, OctreeParams, Outside};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams, RingResult};
use ivd_render::{Fit, RenderParams, Scene, View};
use ivd_segment::{KmvsParams, Segmentation, ThresholdParams};
use ivd_tests::stability::symmetry::{RigidTransform, TURNS};
use nalgebra::Vector3;

const DIMS: [usize; 3] = [15, 13, 17];

/// A lopsided blob with ripples; its value falls from the middle to the sides.
fn blob() -> Volume {
    let grid = Grid::with_spacing(DIMS, [0.9, 1.0, 1.2]).unwrap();
    let value = |i: usize| {
        let [x, y, z] = grid.index(i).0.map(|c| c as f64);
        let r = ((x - 6.63) / 1.21).powi(2) + ((y - 6.11) / 0.97).powi(2) + ((z - 8.37) / 1.33).powi(2);
        let ripple = (0.61 * x + 0.23).sin() + (0.47 * y + 0.71).sin() + (0.53 * z + 0.37).cos();
        (100.0 - 14.0 * r.sqrt() + 3.1 * ripple) as f32
    };
    let values: Vec<f32> = (0..grid.len()).map(value).collect();
    let mut sorted = values.clone();
    sorted.sort_by(f32::total_cmp);
    assert!(sorted.windows(2).all(|w| w[0] < w[1]), "no ties");
    Volume::new(grid, Voxels::from(values)).unwrap()
}

fn turned(turn: RigidTransform, volume: &Volume) -> Volume {
    turn.volume(volume, &turn.grid(volume.grid()))
}

fn kmvs(volume: &Volume) -> Segmentation {
    ivd_segment::kmvs(volume, None, &KmvsParams { k: 3, ..KmvsParams::default() }, &Exec::default()).unwrap()
}

fn lattice(volume: &Volume) -> Lattice {
    extract(volume, None, &ExtractParams { iso: Iso::Value(55.3) }, &Exec::default()).unwrap().lattice
}

#[test]
fn labels_masks_and_transfer_functions_turn_with_the_volume() {
    let (volume, exec) = (blob(), Exec::default());
    let (found, grid) = (kmvs(&volume), volume.grid());
    let params = ivd_boundary::ComponentParams {
        class: Some(ClassChoice::Densest),
        ..ivd_boundary::ComponentParams::default()
    };
    let part = ivd_boundary::component(&volume, Some(&found.labels), &params, &exec).unwrap();
    let at = ThresholdParams { values: vec![20.5, 60.5] };
    let cut = ivd_segment::threshold(&volume, None, &at, &exec).unwrap();
    let transfer =
        ivd_atf::transfer(&volume, &found.labels, &ivd_atf::Params::default(), &exec).unwrap().transfer;
    for turn in TURNS {
        let other = turned(turn, &volume);
        let labels = kmvs(&other);
        assert_eq!(labels.labels.ids(), turn.array(grid, found.labels.ids()), "{turn:?}");
        // The values are sorted before they are summed, so that their order is no matter.
        assert_eq!(labels.labels.classes(), found.labels.classes(), "{turn:?}");
        assert_eq!(labels.objective.to_bits(), found.objective.to_bits(), "{turn:?}");
        let again = ivd_segment::threshold(&other, None, &at, &exec).unwrap();
        assert_eq!(again.labels.ids(), turn.array(grid, cut.labels.ids()), "{turn:?}");
        for (a, b) in again.labels.classes().iter().zip(cut.labels.classes()) {
            // Sums of n values in another order: n roundings of the sum of their sizes.
            let slack = f64::EPSILON * a.voxels as f64 * 200.0;
            assert!((a.mean - b.mean).abs() <= slack && (a.sd - b.sd).abs() <= slack, "{a:?} {b:?}");
        }
        let mask = ivd_boundary::component(&other, Some(&labels.labels), &params, &exec).unwrap();
        assert_eq!(mask.mask.inside(), turn.array(grid, part.mask.inside()), "{turn:?}");
        let table =
            ivd_atf::transfer(&other, &labels.labels, &ivd_atf::Params::default(), &exec).unwrap().transfer;
        // Class statistics summed in another order, stored in single precision.
        let off = table.table().iter().flatten().zip(transfer.table().iter().flatten());
        assert!(off.clone().all(|(a, b)| (a - b).abs() <= 4.0 * f32::EPSILON), "{turn:?}");
    }
}

/// Positions (mm) of a lattice's vertices in ascending order of address.
fn close(a: &Lattice, b: &Lattice, tolerance: f64) {
    assert_eq!(a.keys(), b.keys());
    for i in 0..a.keys().len() {
        let off = (a.voxel(i).0 - b.voxel(i).0).norm();
        assert!(off <= tolerance, "vertex {i}: {off} voxels");
    }
}

#[test]
fn lattices_and_octrees_turn_with_the_volume() {
    let (volume, exec) = (blob(), Exec::default());
    let straight = lattice(&volume);
    let figures = measure(&straight);
    for turn in TURNS {
        let other = lattice(&turned(turn, &volume));
        let (expected, _) = turn.lattice(&straight);
        // A crossing is stored as a fraction in single precision, from either end of its edge: two roundings of at most
        // 2⁻²⁵, and one of 1 − t.
        close(&other, &expected, 4.0 * 2.0_f64.powi(-25));
        let (found, mirrored) = (measure(&other), measure(&expected));
        assert!(mirrored.is_closed_manifold() && found.is_closed_manifold());
        let topology = |f: &ivd_lattice::figures::Figures| (f.vertices, f.triangles, f.euler, f.components);
        assert_eq!(topology(&found), topology(&figures), "{turn:?}");
        // Where four crossings don't lie in one plane, the diagonal may be the other: the surface differs by what lies
        // between the two, of second order in the turn of the surface across a cell.
        let share = (found.area_mm2 / figures.area_mm2 - 1.0).abs();
        assert!(share < 2e-3, "{turn:?}: areas differ by {share}");
        let share = (mirrored.area_mm2 / figures.area_mm2 - 1.0).abs();
        assert!(share < 1e-6, "{turn:?}: the same triangles, areas differ by {share}");
        let inside = ivd_octree::inside(&straight, &exec).unwrap();
        let turned_inside = ivd_octree::inside(&other, &exec).unwrap();
        assert_eq!(turned_inside.inside(), turn.array(volume.grid(), inside.inside()), "{turn:?}");
    }
}

#[test]
fn a_refined_lattice_stays_within_its_bound_whichever_way_it_is_turned() {
    let exec = Exec::default();
    let straight = lattice(&blob());
    let params = RefineParams { target: Target::Level(1).into(), ..RefineParams::default() };
    let refined = collapse(&straight, &params, &exec).unwrap();
    for turn in TURNS {
        let (other, _) = turn.lattice(&straight);
        let found = collapse(&other, &params, &exec).unwrap();
        assert_eq!(found.lattice.keys().len(), refined.lattice.keys().len());
        // Costs are equal but for rounding, which decides between near equals: another subset may be kept. Both are within
        // their bounds of the same surface, hence of each other within the sum.
        let (expected, _) = turn.lattice(&refined.lattice);
        let octree = ivd_octree::build(&found.lattice, &ivd_octree::Params::default(), &exec).unwrap();
        let index = ivd_octree::prepare(&found.lattice, &octree).unwrap();
        let bound = refined.max_error_mm + found.max_error_mm;
        for p in expected.local_positions() {
            let d = index.nearest(p, f64::INFINITY).unwrap().distance_mm;
            assert!(d <= bound + 1e-6, "{turn:?}: {d} mm apart, bounds {bound}");
        }
        let share = found.max_error_mm / refined.max_error_mm;
        assert!(
            (0.3..3.0).contains(&share),
            "{turn:?}: bounds {} and {}",
            found.max_error_mm,
            refined.max_error_mm
        );
    }
}

/// The motion of a lattice by a handle that moves and one that pulls, given in the straight scene.
fn motion(straight: &Grid, turn: Option<RigidTransform>, lattice: &Lattice) -> RingResult {
    let (place, way) = (Vector3::new(5.4, 6.0, 14.9), Vector3::new(0.5, -0.4, 0.9));
    let (other, pull) = (Vector3::new(10.5, 6.4, 9.7), Vector3::new(30.0, 14.0, -11.0));
    let at = |p: Vector3<f64>| turn.map_or(p, |t| t.world(straight, p)).into();
    let along = |v: Vector3<f64>| turn.map_or(v, |t| t.direction(v)).into();
    let handles = [
        Handle { at: Anchor::NearestTo(at(place)), action: Action::Move(along(way)), radius: 6.3 },
        Handle { at: Anchor::NearestTo(at(other)), action: Action::Force(along(pull)), radius: 5.2 },
    ];
    ring::solve(lattice, &handles, &[], &RingParams::default(), &Exec::default()).unwrap()
}

fn mapped(lattice: &Lattice, solved: &RingResult, outside: Outside) -> ivd_map::MapResult {
    let exec = Exec::default();
    let octree = ivd_octree::build(lattice, &ivd_octree::Params::default(), &exec).unwrap();
    let params =
        OctreeParams { band: Band { outside, tolerance: 1.0, ..Band::default() }, ..OctreeParams::default() };
    ivd_map::octree(lattice, &octree, &solved.motion, 0, &params, &exec).unwrap()
}

#[test]
fn motions_and_maps_turn_with_the_lattice() {
    let volume = blob();
    let grid = volume.grid();
    let straight = lattice(&volume);
    let solved = motion(grid, None, &straight);
    let most = solved.max_displacement_mm;
    assert!(most > 0.5);
    let map = mapped(&straight, &solved, Outside::Band);
    assert!(map.figures.voxels_moved > 100);
    for turn in TURNS {
        let (other, number) = turn.lattice(&straight);
        let again = motion(grid, Some(turn), &other);
        // Places that were taken from 1 differ by 2⁻²⁵ of a voxel; the taper turns that into as much of the motion for each
        // radius, and the springs' stretch (some hundredths) carries it to their neighbours.
        let slack = most * 2.0_f64.powi(-25) * 64.0;
        for (v, d) in solved.motion.frames()[0].displacement.iter().enumerate() {
            let expected = turn.direction(Vector3::from(*d));
            let got = Vector3::from(again.motion.frames()[0].displacement[number[v] as usize]);
            assert!((got - expected).norm() <= slack, "{turn:?}, vertex {v}: {got} for {expected}");
        }
        let mapped = mapped(&other, &again, Outside::Band);
        let expected = turn.field(map.displacement.forward());
        let (mut worst, dims) = (0.0_f64, other.grid().dims());
        for i in 0..other.grid().len() {
            let v = other.grid().index(i);
            let off = Vector3::from(mapped.displacement.forward().at(v)) - Vector3::from(expected.at(v));
            worst = worst.max(f64::from(off.norm()));
        }
        assert_eq!(dims, turn.grid(grid).dims());
        // The motion's own difference, carried with weights that change by 3/2 over a margin of four motions, and `f32`.
        let slack = 4.0 * slack + 4.0 * f64::from(f32::EPSILON) * most;
        assert!(worst <= slack, "{turn:?}: fields differ by {worst} mm, {slack} are explained");
        assert!(
            (mapped.figures.min_det_j - map.figures.min_det_j).abs() < 1e-4,
            "{} {}",
            mapped.figures.min_det_j,
            map.figures.min_det_j
        );
    }
}

#[test]
fn inverses_warps_and_pictures_turn_with_the_field() {
    let (volume, exec) = (blob(), Exec::default());
    let grid = volume.grid();
    let straight = lattice(&volume);
    let map = mapped(&straight, &motion(grid, None, &straight), Outside::Band);
    let warp = |volume: &Volume, moved: &Displacement| {
        ivd_field::warp::volume(volume, moved, &WarpParams::default(), &exec).unwrap().output
    };
    let warped = warp(&volume, &map.displacement);
    for turn in TURNS {
        let other = turned(turn, &volume);
        let forward = turn.field(map.displacement.forward());
        let inverse = ivd_field::inverse::invert(&forward, other.grid(), &exec).unwrap();
        let expected = turn.field(map.displacement.inverse());
        for i in 0..other.grid().len() {
            let v = other.grid().index(i);
            let off = Vector3::from(inverse.field.at(v)) - Vector3::from(expected.at(v));
            // Newton ends below 1e-10 voxel; then both are rounded to `f32`, and the determinant is above 0.05.
            let most = 2.0 * f32::EPSILON * Vector3::from(expected.at(v)).amax() + 2e-9;
            assert!(off.amax() <= most, "{turn:?}, voxel {v:?}: {off}");
        }
        let moved = Displacement::new(other.grid().clone(), forward, inverse.field).unwrap();
        let got = warp(&other, &moved);
        let expected = turned(turn, &warped);
        let range = volume.range().unwrap();
        for i in 0..other.grid().len() {
            let off = (got.voxels().get(i) - expected.voxels().get(i)).abs();
            // The steepest value per voxel times the inverse's difference, a snap to a voxel's centre, and `f32`.
            assert!(off <= 1e-5 * (range[1] - range[0]), "{turn:?}, voxel {i}: {off}");
        }
    }
}

/// Linear light from the front, without the lamp, which stands on the left.
fn light(volume: &Volume, azimuth_deg: f64) -> ivd_render::Radiance {
    let ramp = vec![[0.0; 4], [0.9, 0.5, 0.2, 0.1], [0.3, 0.9, 0.6, 0.3]];
    let transfer = ivd_core::TransferFunction::new([0.0, 110.0], 3, 1.0, vec![0], ramp, vec![]).unwrap();
    let params = RenderParams {
        size: [48, 40],
        shading: false,
        annotate: false,
        termination: 2.0,
        view: View { angles: [azimuth_deg, 0.0], ..View::FRONT },
        // Bricks begin at one corner, wherever the volume is mirrored to.
        fit: Fit::Volume,
        ..RenderParams::default()
    };
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(volume) };
    ivd_render::radiance(&scene, &params, &Exec::default()).unwrap()
}

/// Largest difference of two pictures, the second read by `at`.
fn apart(a: &ivd_render::Radiance, b: &ivd_render::Radiance, at: impl Fn(usize, usize) -> [usize; 2]) -> f32 {
    let mut worst = 0.0_f32;
    for y in 0..a.height {
        for x in 0..a.width {
            let [u, v] = at(x, y);
            for (p, q) in a.rgba[x + a.width * y].iter().zip(b.rgba[u + a.width * v]) {
                worst = worst.max((p - q).abs());
            }
        }
    }
    worst
}

/// What a sample's place, rounded to 2⁻²⁰ voxel, may change of a ray: its value by as much of the steepest slope, which may
/// take the classified entry to its neighbour. The classifier has at least 4,096 entries for a ramp that is 0.5 steep
/// over the range, and a ray has 60 samples of which a twentieth lies that near to a border between entries.
const SAME_LIGHT: f32 = 1e-3;

#[test]
fn a_mirrored_volume_gives_a_mirrored_picture() {
    let volume = blob();
    // Seen from the front, x runs to the left of the picture and z up.
    let straight = light(&volume, 0.0);
    assert!(straight.rgba.iter().any(|p| p[3] > 0.5) && straight.rgba.iter().any(|p| p[3] == 0.0));
    let flipped = |axis: usize| {
        let mut turn = RigidTransform { axes: [0, 1, 2], flip: [false; 3] };
        turn.flip[axis] = true;
        turned(turn, &volume)
    };
    let (w, h) = (straight.width, straight.height);
    let across = apart(&straight, &light(&flipped(0), 0.0), |x, y| [w - 1 - x, y]);
    assert!(across <= SAME_LIGHT, "{across}");
    let upright = apart(&straight, &light(&flipped(2), 0.0), |x, y| [x, h - 1 - y]);
    assert!(upright <= SAME_LIGHT, "{upright}");
    // The comparison can fail.
    assert!(apart(&straight, &light(&flipped(0), 0.0), |x, y| [x, y]) > 0.01);
    assert!(apart(&straight, &straight, |x, y| [(x + 1).min(w - 1), y]) > 0.01);
    // A quarter turn of the scene about the body axis, seen a quarter turn further on.
    let quarter = RigidTransform { axes: [1, 0, 2], flip: [true, false, false] };
    let around = light(&turned(quarter, &volume), 90.0);
    let back = light(&turned(quarter, &volume), -90.0);
    let best = apart(&straight, &around, |x, y| [x, y]).min(apart(&straight, &back, |x, y| [x, y]));
    assert!(best <= SAME_LIGHT, "{best}");
}

#[test]
fn the_way_an_array_is_stored_changes_nothing_of_the_scene() {
    let (volume, exec) = (blob(), Exec::default());
    let grid = volume.grid();
    let (straight, seen) = (lattice(&volume), light(&volume, 20.0));
    for turn in TURNS {
        let other = turn.volume(&volume, &turn.stored(grid));
        for i in [0, 77, 1234, grid.len() - 1] {
            let (World(a), World(b)) = (
                grid.world(grid.index(i).into()),
                other.grid().world(turn.index(DIMS, VoxelIndex(grid.index(i).0)).into()),
            );
            assert!((a - b).norm() < 1e-12, "{turn:?}: the same place");
        }
        let cut = lattice(&other);
        let (mut a, mut b) = (straight.positions(), cut.positions());
        assert_eq!(a.len(), b.len());
        let order = |p: &Vector3<f64>| p.map(|c| (c * 1e5).round() as i64).as_slice().to_vec();
        a.sort_by_key(order);
        b.sort_by_key(order);
        let worst = a.iter().zip(&b).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{turn:?}: vertices {worst} mm apart");
        assert!(measure(&cut).volume_mm3 > 0.0, "{turn:?}: outside stays outside");
        ivd_octree::build(&cut, &ivd_octree::Params::default(), &exec).unwrap();
        let off = apart(&seen, &light(&other, 20.0), |x, y| [x, y]);
        assert!(off <= SAME_LIGHT, "{turn:?}: {off}");
    }
}
