//! What goes wrong on purpose at every event of a picture: the picture is right all the same, or there is a clear error, and nothing stays held.

use ivd_core::{Classified as _, ErrorClass};
use ivd_gpu::{Fault, Options};
use ivd_render::{Mode, Scene};

use super::common::{hills, twisted};
use super::gpu;
use super::pictures::{params, transfer};
use super::sides::{by_device, on};

#[test]
fn every_way_to_fail_at_every_event_gives_the_right_picture_or_a_clear_error() {
    let Some(sound) = gpu(Options::default()) else { return };
    let volume = hills::<u8>();
    let moved = twisted(volume.grid());
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), displacement: Some(&moved), ..Scene::new(&volume) };
    let params = params(Mode::Dvr);
    let sound = on(sound);
    let right = by_device(&scene, &params, &sound).0;
    for fault in [Fault::Loss, Fault::NoRoom, Fault::Late, Fault::Garbage] {
        // More events than a picture has; the last ones come to nothing. Two ways are told before anything happens, and are tried at a third of them.
        let step = if matches!(fault, Fault::NoRoom | Fault::Late) { 3 } else { 1 };
        for at in (0..22).step_by(step) {
            let once = gpu(Options { faults: vec![(at, fault)], ..Options::default() }).unwrap();
            let made = by_device(&scene, &params, &on(once)).0;
            assert_eq!(made, right, "{fault:?} at {at}");
        }
    }
    // Twice in a row is more than is borne.
    for fault in [Fault::Loss, Fault::Late] {
        let always = (0..100).map(|at| (at, fault)).collect();
        let exec = on(gpu(Options { faults: always, ..Options::default() }).unwrap());
        let error = ivd_render::radiance(&scene, &params, &exec).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::NoGpu, "{error}");
        assert!(error.to_string().contains("render/cast"), "{error}");
    }
    // Without room the processor does it.
    let always = (0..100).map(|at| (at, Fault::NoRoom)).collect();
    let exec = on(gpu(Options { faults: always, ..Options::default() }).unwrap());
    ivd_render::radiance(&scene, &params, &exec).unwrap();
    assert_eq!(exec.take_served()["render/cast"].name(), "cpu");
}
