//! Devices with less than others, and what crosses between memory and device.

use std::sync::Arc;

use ivd_core::{Exec, Volume, Voxels};
use ivd_gpu::{Options, SharedGpu};
use ivd_render::{Mode, Prepared, RenderParams, Scene, View};

use super::common::{hills, twisted};
use super::gpu;
use super::pictures::{params, transfer};
use super::sides::{apart, by_device, by_processor, on};

#[test]
fn a_device_with_little_room_a_submission_gives_the_same_bits() {
    let Some(wide) = gpu(Options::default()) else { return };
    // Room for the volume and the displacement, and for rays of a few rows.
    let narrow = gpu(Options { max_buffer: Some(256 << 10), ..Options::default() }).unwrap();
    let (wide, narrow) = (on(wide), on(narrow));
    let volume = hills::<u8>();
    let moved = twisted(volume.grid());
    let soft = transfer(false);
    for displacement in [None, Some(&moved)] {
        let scene = Scene { transfer: Some(&soft), displacement, ..Scene::new(&volume) };
        for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 120.0 }] {
            let params = RenderParams { size: [150, 111], ..params(mode) };
            assert_eq!(
                by_device(&scene, &params, &wide).0,
                by_device(&scene, &params, &narrow).0,
                "{mode:?}"
            );
        }
    }
}

#[test]
fn a_volume_that_no_buffer_holds_is_the_processors() {
    let Some(narrow) = gpu(Options { max_buffer: Some(16 << 10), ..Options::default() }) else { return };
    let exec = on(narrow);
    let volume = hills::<u8>();
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), ..Scene::new(&volume) };
    let made = ivd_render::radiance(&scene, &params(Mode::Dvr), &exec).unwrap();
    assert_eq!(exec.take_served()["render/cast"].name(), "cpu");
    assert_eq!(made, by_processor(&scene, &params(Mode::Dvr)).0);
}

#[test]
fn pictures_of_one_row_or_one_column_and_of_odd_sizes_are_close() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    let volume = hills::<u8>();
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), ..Scene::new(&volume) };
    for size in [[1, 3000], [3000, 1], [7, 9], [1, 1], [641, 3]] {
        let params = RenderParams { size, ..params(Mode::Dvr) };
        let apart = apart(&by_processor(&scene, &params), &by_device(&scene, &params, &exec));
        assert!(apart.is_close(&exec), "{size:?}: {apart:?}");
    }
}

#[test]
fn each_optional_feature_can_be_missing() {
    let volume = hills::<u8>();
    let moved = twisted(volume.grid());
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), displacement: Some(&moved), ..Scene::new(&volume) };
    for without in [vec!["f64"], vec!["int64"], vec!["timestamps"], vec!["f64", "int64", "timestamps"]] {
        let Some(gpu) = gpu(Options { without, timed: true, ..Options::default() }) else { return };
        let exec = on(gpu);
        let apart =
            apart(&by_processor(&scene, &params(Mode::Dvr)), &by_device(&scene, &params(Mode::Dvr), &exec));
        assert!(apart.is_close(&exec), "{apart:?}");
    }
}

#[test]
fn a_volume_is_brought_once_for_all_views_and_a_second_picture_brings_next_to_nothing() {
    let Some(gpu) = gpu(Options { part: Some(1 << 20), ..Options::default() }) else { return };
    let caster = SharedGpu::new(gpu);
    let device = ivd_core::Device::new("shared").with::<ivd_render::plan::Casting>(caster.clone());
    let exec = Exec::default().with_device(Arc::new(device));
    let grid = ivd_core::Grid::with_spacing([64; 3], [1.0; 3]).unwrap();
    let voxels: Vec<u8> = (0..grid.len()).map(|i| (i % 251) as u8).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    let (labels, moved, soft) = (labels_of(&volume), twisted(volume.grid()), transfer(false));
    let scene = Scene {
        transfer: Some(&soft),
        labels: Some(&labels),
        displacement: Some(&moved),
        ..Scene::new(&volume)
    };
    let prepared = Prepared::new(&scene, &params(Mode::Dvr), &exec).unwrap();
    let mut before = caster.counters();
    // A turntable, of as small pictures as will do.
    for i in 0..36 {
        let view = View { angles: [10.0 * f64::from(i), 17.0], ..params(Mode::Dvr).view };
        prepared.radiance(view, &exec).unwrap();
        let now = caster.counters();
        let up = now.uploaded - before.uploaded;
        let whole = (64 * 64 * 64 * 3) as u64;
        if i == 0 {
            assert!(up > whole && up < whole + (4 << 20), "{up}");
        } else {
            assert!(up < 4096, "picture {i}: {up} bytes");
            assert_eq!(now.held, before.held);
        }
        assert!(now.dispatches > before.dispatches);
        before = now;
    }
    // Another scene of the same volume brings its colours and bricks alone.
    let other = Scene { labels: None, displacement: None, ..scene };
    Prepared::new(&other, &params(Mode::Dvr), &exec)
        .unwrap()
        .radiance(params(Mode::Dvr).view, &exec)
        .unwrap();
    let up = caster.counters().uploaded - before.uploaded;
    assert!(up < 80 << 10, "{up}");
    drop(exec);
    drop(prepared);
}

fn labels_of(volume: &Volume) -> ivd_core::Labels {
    let ids: Vec<u16> = (0..volume.grid().len()).map(|i| [2, 3, 0][i % 3]).collect();
    ivd_core::Labels::new(volume.grid().clone(), ids.into(), Vec::new()).unwrap()
}

#[test]
fn a_picture_wider_than_a_part_is_cut_across_too() {
    let Some(gpu) = gpu(Options { part: Some(1 << 14), ..Options::default() }) else { return };
    let exec = on(gpu);
    let volume = hills::<u8>();
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), ..Scene::new(&volume) };
    // A row of tiles has more pixels than the first part of a picture.
    let params = RenderParams { size: [5000, 19], ..params(Mode::Dvr) };
    let apart = apart(&by_processor(&scene, &params), &by_device(&scene, &params, &exec));
    assert!(apart.is_close(&exec), "{apart:?}");
}

#[test]
fn pictures_asked_for_by_many_threads_at_once_wait_for_each_other_and_not_for_themselves() {
    for without in [vec![], vec!["f64"]] {
        let Some(gpu) = gpu(Options { without, ..Options::default() }) else { return };
        let (done, all_done) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let exec = on(gpu).with_threads(3);
            let volume = hills::<u8>();
            let soft = transfer(false);
            let scene = Scene { transfer: Some(&soft), ..Scene::new(&volume) };
            let prepared = Prepared::new(&scene, &params(Mode::Dvr), &exec).unwrap();
            let pieces = vec![(); 8];
            let view = params(Mode::Dvr).view;
            exec.run(|| {
                ivd_core::parallel::for_each_piece_mut(&mut pieces.clone(), 1, &|_, _| {
                    prepared.radiance(view, &exec).unwrap();
                });
            });
            done.send(()).unwrap();
        });
        all_done.recv_timeout(std::time::Duration::from_secs(100)).expect("nobody waits for himself");
    }
}
