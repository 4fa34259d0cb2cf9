//! What must not change a single byte: skipping, threads, the stored type; and what missing data must not do.

use crate::pictures::common::{hills, twisted};
use ivd_core::{Exec, Labels, Scalar, TransferFunction, Volume, Voxels};
use ivd_render::{Mode, Radiance, RenderParams, Scene, View, radiance};

fn transfer() -> TransferFunction {
    // Clear below 90 of 0…255, with a clear gap, in row 0; other windows for classes 2 and 3.
    let row = |low: usize, high: usize, rgb: [f32; 3]| {
        (0..256).map(move |i| {
            let alpha =
                if i > low && i < high && !(i > 150 && i < 160) { 0.05 + i as f32 / 1000.0 } else { 0.0 };
            [rgb[0], rgb[1], rgb[2], alpha]
        })
    };
    let table =
        row(90, 256, [0.9, 0.4, 0.1]).chain(row(190, 256, [0.1, 0.8, 0.3])).chain(row(120, 150, [0.2; 3]));
    TransferFunction::new([0.0, 255.0], 256, 1.0, vec![0, 2, 3], table.collect(), vec![]).unwrap()
}

fn params() -> RenderParams {
    let view = View { angles: [28.0, 17.0], zoom: 1.3, ..View::FRONT };
    RenderParams { size: [70, 50], view, annotate: false, ..RenderParams::default() }
}

fn with_holes(volume: &Volume) -> Volume {
    let mut values: Vec<f32> = volume.to_array().t().iter().map(|&v| v as f32).collect();
    for i in (0..values.len()).filter(|i| i % 613 < 3) {
        values[i] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3];
    }
    Volume::new(volume.grid().clone(), Voxels::from(values)).unwrap()
}

fn bits(picture: &Radiance) -> Vec<[u32; 4]> {
    picture.rgba.iter().map(|c| c.map(f32::to_bits)).collect()
}

#[test]
fn skipping_changes_no_bit_of_any_mode_with_labels_holes_and_deformation() {
    let solid = hills::<u8>();
    let holed = with_holes(&solid);
    let grid = solid.grid().clone();
    let ids: Vec<u16> = (0..grid.len()).map(|i| (grid.index(i).0[2] / 9) as u16).collect();
    let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
    let displacement = twisted(&grid);
    let transfer = transfer();
    for volume in [&solid, &holed] {
        for labels in [None, Some(&labels)] {
            for (displacement, framing) in
                [(None, None), (Some(&displacement), None), (None, Some(&displacement))]
            {
                let scene =
                    Scene { transfer: Some(&transfer), labels, displacement, framing, ..Scene::new(volume) };
                for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 170.0 }] {
                    let on = radiance(&scene, &RenderParams { mode, ..params() }, &Exec::default()).unwrap();
                    let off = RenderParams { mode, skip: false, ..params() };
                    let off = radiance(&scene, &off, &Exec::default()).unwrap();
                    assert_eq!(bits(&on), bits(&off), "{mode:?}");
                    assert!(on.rgba.iter().all(|c| c.iter().all(|v| v.is_finite())));
                    assert!(on.skipped > 0 && off.skipped == 0, "{mode:?}: {} skipped", on.skipped);
                    assert!(on.rgba.iter().any(|c| c[3] > 0.0));
                }
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_byte_nor_count() {
    let volume = hills::<u16>();
    let transfer = transfer();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let one = radiance(&scene, &params(), &Exec::default().with_threads(1)).unwrap();
    let three = radiance(&scene, &params(), &Exec::default().with_threads(3)).unwrap();
    assert_eq!(one, three);
}

#[test]
fn equal_values_of_any_stored_type_give_one_picture() {
    fn picture<T: Scalar>() -> Vec<[u32; 4]>
    where
        Voxels: From<Vec<T>>,
    {
        let volume = hills::<T>();
        let transfer = transfer();
        bits(
            &radiance(
                &Scene { transfer: Some(&transfer), ..Scene::new(&volume) },
                &params(),
                &Exec::default(),
            )
            .unwrap(),
        )
    }
    let reference = picture::<u8>();
    assert_eq!(picture::<u16>(), reference);
    assert_eq!(picture::<i16>(), reference);
    assert_eq!(picture::<f32>(), reference);
}

#[test]
fn a_displacement_of_nothing_is_the_undeformed_picture() {
    let volume = hills::<u8>();
    let transfer = transfer();
    let still = crate::pictures::common::displacement(volume.grid(), |_| None);
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    let moved = Scene { displacement: Some(&still), ..scene };
    let rest = radiance(&scene, &params(), &Exec::default()).unwrap();
    assert_eq!(radiance(&moved, &params(), &Exec::default()).unwrap(), rest);
    // Stored bricks of zeros as well.
    let zero = crate::pictures::common::displacement(volume.grid(), |_| Some(nalgebra::Vector3::zeros()));
    let moved = Scene { displacement: Some(&zero), ..scene };
    assert_eq!(bits(&radiance(&moved, &params(), &Exec::default()).unwrap()), bits(&rest));
}

#[test]
fn a_volume_of_missing_voxels_is_clear() {
    let grid = hills::<u8>().grid().clone();
    let volume = Volume::new(grid.clone(), Voxels::from(vec![f32::NAN; grid.len()])).unwrap();
    let transfer = transfer();
    let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
    for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 0.0 }] {
        let picture = radiance(&scene, &RenderParams { mode, ..params() }, &Exec::default()).unwrap();
        assert!(picture.rgba.iter().all(|c| *c == [0.0; 4]), "{mode:?}");
    }
}

#[test]
fn a_falling_scale_shows_the_real_values() {
    // Stored 255 - v with slope -1 and intercept 255 is the same volume.
    let volume = hills::<u8>();
    let flipped: Vec<u8> = volume.to_array().t().iter().map(|&v| 255 - v as u8).collect();
    let flipped = Volume::with_scale(volume.grid().clone(), Voxels::from(flipped), -1.0, 255.0).unwrap();
    let transfer = transfer();
    for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 170.0 }] {
        let picture = |volume| {
            let scene = Scene { transfer: Some(&transfer), ..Scene::new(volume) };
            radiance(&scene, &RenderParams { mode, ..params() }, &Exec::default()).unwrap()
        };
        let (a, b) = (picture(&volume), picture(&flipped));
        let far =
            a.rgba.iter().zip(&b.rgba).filter(|(p, q)| (0..4).any(|c| (p[c] - q[c]).abs() > 2e-2)).count();
        assert!(far <= a.rgba.len() / 200, "{mode:?}: {far} pixels differ");
    }
}
