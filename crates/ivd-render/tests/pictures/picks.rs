//! What a picture shows at a pixel.

use ivd_core::{Exec, Grid, Labels, TransferFunction, Volume, VoxelIndex, World};
use ivd_render::{Classification, Clip, Fit, Mode, Pick, Prepared, Projection, RenderParams, Scene, View};
use nalgebra::Vector3;

use super::common::{hills, twisted};

const SIZE: [usize; 2] = [90, 70];

fn picks(scene: &Scene<'_>, params: &RenderParams) -> Vec<([usize; 2], Pick)> {
    let prepared = Prepared::new(scene, params, &Exec::default()).unwrap();
    let pixels = (0..SIZE[1]).step_by(2).flat_map(|y| (0..SIZE[0]).step_by(2).map(move |x| [x, y]));
    pixels.filter_map(|pixel| Some((pixel, prepared.pick(params.view, pixel).unwrap()?))).collect()
}

fn params(mode: Mode, view: View) -> RenderParams {
    RenderParams { mode, view, size: SIZE, fit: Fit::Volume, ..RenderParams::default() }
}

fn oblique() -> Grid {
    let (sin, cos) = 0.4_f64.sin_cos();
    let axes = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
    Grid::new([50, 44, 36], [1.0, 1.2, 1.5], [300.0, -7.0, 12.0], axes).unwrap()
}

#[test]
fn a_surface_is_picked_where_it_lies_from_wherever_it_is_seen() {
    let grid = oblique();
    let centre = grid.world(VoxelIndex([25, 22, 18]).into()).0;
    let distance = |i| (grid.world(grid.index(i).into()).0 - centre).norm() as f32;
    let volume = Volume::new(
        grid.clone(),
        (0..grid.len()).map(distance).map(|d| 30.0 - d).collect::<Vec<f32>>().into(),
    )
    .unwrap();
    for projection in [Projection::Orthographic, Projection::Perspective] {
        for angles in [[0.0, 0.0], [37.0, 25.0], [200.0, -70.0]] {
            let view = View { angles, projection, roll: 20.0, ..View::FRONT };
            let found = picks(&Scene::new(&volume), &params(Mode::Iso { value: 14.0 }, view));
            assert!(found.len() > 60, "{}", found.len());
            for (pixel, pick) in found {
                let radius = (Vector3::from(pick.place) - centre).norm();
                // What trilinear values of a distance are off by between voxels, and 2⁻¹⁶ of a step.
                assert!((radius - 16.0).abs() < 0.04, "{pixel:?}: {radius}");
                assert!((pick.value.unwrap() - 14.0).abs() < 1e-3);
                assert_eq!(pick.rest, pick.place);
                let there = grid.voxel(World(Vector3::from(pick.rest))).0.map(f64::round);
                assert_eq!(pick.voxel.map(|v| v as f64), <[f64; 3]>::from(there));
                assert_eq!(pick.label, None);
            }
        }
    }
}

#[test]
fn of_what_is_seen_through_the_place_is_taken_behind_which_half_of_it_lies() {
    // Matter that thickens from a plane on: its opacity from there is 1 − exp(−c s² / 2).
    let grid = Grid::with_spacing([40, 60, 40], [1.0; 3]).unwrap();
    let edge = 45.0;
    let depth = |i| (255.0 / 45.0 * (edge - grid.index(i).0[1] as f64)).max(0.0) as f32;
    let volume = Volume::new(grid.clone(), (0..grid.len()).map(depth).collect::<Vec<f32>>().into()).unwrap();
    for c in [0.02, 0.1] {
        let entry = |i: usize| {
            let s = i as f64 * 45.0 / 255.0;
            [1.0, 1.0, 1.0, (1.0 - (-c * s).exp()) as f32]
        };
        let table: Vec<[f32; 4]> = (0..256).map(entry).collect();
        let transfer = TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0], table, vec![]).unwrap();
        let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
        let found = picks(&scene, &params(Mode::Dvr, View::FRONT));
        assert!(found.len() > 100, "{}", found.len());
        let expected = edge - (2.0 * 2.0_f64.ln() / c).sqrt();
        for (pixel, pick) in found {
            assert!((pick.place[1] - expected).abs() < 0.1, "{pixel:?}: {} for {expected}", pick.place[1]);
        }
        // Hardly any of it lies before where it begins, and all before its end but what shows no more.
        let prepared = Prepared::new(&scene, &params(Mode::Dvr, View::FRONT), &Exec::default()).unwrap();
        for share in [0.01_f32, 0.1, 0.9] {
            let expected = edge - (2.0 * -(1.0 - f64::from(share)).ln() / c).sqrt();
            let pick = prepared.pick_at(View::FRONT, SIZE.map(|n| n / 2), share).unwrap().unwrap();
            assert!((pick.place[1] - expected).abs() < 0.2, "{share}: {} for {expected}", pick.place[1]);
        }
    }
}

#[test]
fn a_place_on_a_deformed_picture_leads_back_to_where_it_was() {
    let volume = hills::<u8>();
    let grid = volume.grid();
    let moved = twisted(grid);
    let ids: Vec<u16> = (0..grid.len()).map(|i| 1 + (grid.index(i).0[0] % 3) as u16).collect();
    let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
    let rows = [0, 1, 2, 3]
        .into_iter()
        .flat_map(|_| (0..256).map(|i| [0.5, 0.5, 0.5, if i > 110 { 0.3 } else { 0.0 }]));
    let transfer =
        TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0, 1, 2, 3], rows.collect(), vec![]).unwrap();
    let scene = Scene {
        transfer: Some(&transfer),
        labels: Some(&labels),
        displacement: Some(&moved),
        ..Scene::new(&volume)
    };
    let view = View { angles: [28.0, 17.0], ..View::FRONT };
    let voxel = |world: [f64; 3]| grid.voxel(World(Vector3::from(world))).0;
    for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 120.0 }] {
        let found = picks(&scene, &params(mode, view));
        assert!(found.len() > 60, "{mode:?}: {}", found.len());
        let mut far = 0;
        for (pixel, pick) in &found {
            let back = Vector3::from(pick.place) + moved.inverse().sample(voxel(pick.place));
            assert!((back - Vector3::from(pick.rest)).norm() < 1e-3, "{mode:?} {pixel:?}: {pick:?}");
            far += usize::from((Vector3::from(pick.place) - Vector3::from(pick.rest)).norm() > 0.5);
            assert_eq!(pick.label, Some(1 + (pick.voxel[0] % 3) as u16));
        }
        assert!(far > 20, "{mode:?}: {far}");
    }
}

#[test]
fn behind_a_hard_edge_it_is_what_is_seen_that_is_picked() {
    // Opaque from 100 on; the half of lower x has a label whose row is clear.
    let grid = Grid::with_spacing([40, 40, 40], [1.0; 3]).unwrap();
    let inside = |p: [usize; 3]| p[1] < 20;
    let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(grid.index(i).0) { 200 } else { 20 }).collect();
    let volume = Volume::new(grid.clone(), voxels.into()).unwrap();
    let ids: Vec<u16> = (0..grid.len()).map(|i| if grid.index(i).0[1] < 12 { 1 } else { 2 }).collect();
    let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
    let row = |shown: bool| (0..256).map(move |i| [1.0, 1.0, 1.0, if shown && i >= 100 { 1.0 } else { 0.0 }]);
    let rows = row(false).chain(row(true)).chain(row(false)).collect();
    let transfer = TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0, 1, 2], rows, vec![]).unwrap();
    let scene = Scene { transfer: Some(&transfer), labels: Some(&labels), ..Scene::new(&volume) };
    let found = picks(&scene, &params(Mode::Dvr, View::FRONT));
    assert!(found.len() > 100, "{}", found.len());
    for (pixel, pick) in found {
        assert_eq!((pick.label, pick.value), (Some(1), Some(200.0)), "{pixel:?}");
        // The border of the labels lies half-way between the voxels 11 and 12.
        assert!((pick.place[1] - 11.5).abs() < 0.51, "{pixel:?}: {}", pick.place[1]);
    }
}

#[test]
fn what_is_leapt_over_moves_no_pick() {
    let volume = hills::<u8>();
    let grid = volume.grid();
    let moved = twisted(grid);
    let ids: Vec<u16> = (0..grid.len()).map(|i| 1 + (grid.index(i).0[2] % 2) as u16).collect();
    let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
    // From thin to all but opaque.
    let row = || (0..256).map(|i| [0.5, 0.5, 0.5, if i > 40 { (i - 40) as f32 / 220.0 } else { 0.0 }]);
    let table = |rows: Vec<u16>| {
        let entries = rows.iter().flat_map(|_| row()).collect();
        TransferFunction::new([0.0, 255.0], 256, 1.0, rows, entries, vec![]).unwrap()
    };
    let (plain, labelled) = (table(vec![0]), table(vec![0, 1, 2]));
    let centre = grid.world(VoxelIndex([22, 18, 14]).into()).0;
    for projection in [Projection::Orthographic, Projection::Perspective] {
        for (classification, labels) in [
            (Classification::Post, None),
            (Classification::Post, Some(&labels)),
            (Classification::PreIntegrated, None),
        ] {
            for clip in [vec![], vec![Clip::plane(centre.into(), [0.3, -1.0, 0.2])]] {
                let transfer = Some(if labels.is_some() { &labelled } else { &plain });
                let scene = Scene { transfer, labels, displacement: Some(&moved), ..Scene::new(&volume) };
                let view = View { angles: [28.0, 17.0], projection, ..View::FRONT };
                let leaping = RenderParams { classification, clip, ..params(Mode::Dvr, view) };
                let every = RenderParams { skip: false, ..leaping.clone() };
                let found = picks(&scene, &leaping);
                assert!(found.len() > 100, "{}", found.len());
                assert_eq!(found, picks(&scene, &every), "{projection:?} {classification:?}");
            }
        }
    }
}

#[test]
fn where_nothing_is_seen_nothing_is_picked() {
    let volume = hills::<u8>();
    let clear =
        TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0], vec![[1.0, 1.0, 1.0, 0.0]; 256], vec![])
            .unwrap();
    let scene = Scene { transfer: Some(&clear), ..Scene::new(&volume) };
    assert!(picks(&scene, &params(Mode::Dvr, View::FRONT)).is_empty());
    assert!(picks(&scene, &params(Mode::Iso { value: 1e4 }, View::FRONT)).is_empty());
    let prepared = Prepared::new(&scene, &params(Mode::Mip, View::FRONT), &Exec::default()).unwrap();
    assert_eq!(prepared.pick(View::FRONT, [0, 0]).unwrap(), None, "beside the volume");
    assert!(prepared.pick(View::FRONT, [SIZE[0], 0]).is_err(), "beside the picture");
}
