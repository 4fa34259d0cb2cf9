//! What goes wrong on purpose at every event of a picture: the picture is right all the same, or there is a clear error, and nothing stays held.

use ivd_core::{Classified as _, ErrorClass, Exec};
use ivd_gpu::{Fault, Gpu, Meter, Options};
use ivd_render::{Mode, Prepared, Radiance, RenderParams, Scene, View};

use super::common::{hills, twisted};
use super::equal::{KERNELS, volumes};
use super::gpu;
use super::pictures::{params, transfer};
use super::sides::on;

/// A device that makes two parts of a picture, whatever its speed.
fn of_parts(faults: Vec<(u64, Fault)>) -> Options {
    Options { faults, part: Some(64 * 150), ..Options::default() }
}

/// Two views of a scene, of several parts each, on a device; and what the device did after each.
fn two_views(gpu: Gpu) -> ([Result<Radiance, ivd_render::Error>; 2], [u64; 2], Meter) {
    let volume = hills::<u8>();
    let moved = twisted(volume.grid());
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), displacement: Some(&moved), ..Scene::new(&volume) };
    let meter = gpu.meter();
    let exec = on(gpu);
    let params = RenderParams { size: [150, 100], ..params(Mode::Dvr) };
    let prepared = Prepared::new(&scene, &params, &exec).unwrap();
    let view = |azimuth: f64| View { angles: [azimuth, 10.0], ..params.view };
    let first = prepared.radiance(view(30.0), &exec);
    let events = meter.counters().events;
    let second = prepared.radiance(view(140.0), &exec);
    ([first, second], [events, meter.counters().events], meter)
}

/// One event of so many is tried, all where `IVD_STRESS_EVERY` is 1; `usual`: without it.
fn every(usual: u64) -> u64 {
    std::env::var("IVD_STRESS_EVERY")
        .map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("IVD_STRESS_EVERY={text} is no number")))
}

#[test]
fn every_way_to_fail_at_every_event_gives_the_right_pictures() {
    let every = every(8);
    let Some(sound) = gpu(of_parts(Vec::new())) else { return };
    let (right, [first, all], meter) = two_views(sound);
    let right = right.map(Result::unwrap);
    assert_eq!(meter.counters().held, 0, "nothing is held once the device is gone");
    assert!(right[0].rgba != right[1].rgba && all > first + 1, "{first} events, then {all}");
    for fault in [Fault::Loss, Fault::NoRoom, Fault::Late, Fault::Garbage] {
        // Two of them are told before anything happens, and are tried at a third of the events at most.
        let step = if matches!(fault, Fault::NoRoom | Fault::Late) { every.max(3) } else { every };
        for at in (fault as u64 % step..all).step_by(step as usize) {
            let once = gpu(of_parts(vec![(at, fault)])).unwrap();
            let (made, _, meter) = two_views(once);
            for (made, right) in made.into_iter().zip(&right) {
                let made = made.unwrap_or_else(|error| panic!("{fault:?} at {at}: {error}"));
                assert_eq!(made.rgba, right.rgba, "{fault:?} at {at}");
            }
            let told = meter.counters();
            let opened = if matches!(fault, Fault::Loss | Fault::Late) { 2 } else { 1 };
            assert!(told.opened >= opened && told.held == 0, "{fault:?} at {at}: {told:?}");
        }
    }
}

#[test]
fn a_device_that_fails_twice_is_an_error_and_one_without_room_is_none() {
    let always = |fault| of_parts((0..200).map(|at| (at, fault)).collect());
    for fault in [Fault::Loss, Fault::Late] {
        let Some(broken) = gpu(always(fault)) else { return };
        let error = two_views(broken).0.map(Result::unwrap_err);
        assert_eq!(error[0].error_class(), ErrorClass::NoGpu, "{}", error[0]);
        assert!(error[0].to_string().contains("render/cast"), "{}", error[0]);
    }
    let Some(full) = gpu(always(Fault::NoRoom)) else { return };
    let (made, ..) = two_views(full);
    let plain = Exec::default();
    let volume = hills::<u8>();
    let moved = twisted(volume.grid());
    let soft = transfer(false);
    let scene = Scene { transfer: Some(&soft), displacement: Some(&moved), ..Scene::new(&volume) };
    let params = RenderParams { size: [150, 100], ..params(Mode::Dvr) };
    let view = View { angles: [30.0, 10.0], ..params.view };
    let right = Prepared::new(&scene, &params, &plain).unwrap().radiance(view, &plain).unwrap();
    assert_eq!(made[0].as_ref().unwrap(), &right, "the processor's own");
}

#[test]
fn every_way_to_fail_within_every_kernel_gives_the_right_bytes() {
    // Of 16 bits, which are counted by pages, and of floats.
    let volumes = volumes([31, 17, 9], false, 2);
    for (i, (name, of)) in KERNELS.into_iter().enumerate() {
        let volume = &volumes[if i % 2 == 0 { 4 } else { 2 }];
        let Some(sound) = gpu(of_parts(Vec::new())) else { return };
        let meter = sound.meter();
        let exec = on(sound);
        assert!(of(volume, &exec), "{name}");
        drop(exec);
        let all = meter.counters().events;
        assert!(meter.counters().held == 0 && all > 6, "{name}: {all} events");
        for fault in [Fault::Loss, Fault::NoRoom, Fault::Late, Fault::Garbage] {
            // What does nothing is found where something should have been done: at a submission, which one event in some is.
            let less = every(2).min(2);
            let (tries, mut found) = if fault == Fault::Garbage { (24 / less, 0) } else { (4 / less, 5) };
            for at in (0..tries).map(|i| i * all / tries) {
                let once = gpu(of_parts(vec![(at, fault)])).unwrap();
                let meter = once.meter();
                let exec = on(once);
                assert!(of(volume, &exec), "{name}: {fault:?} at {at} of {all}");
                drop(exec);
                let told = meter.counters();
                let opened = if matches!(fault, Fault::Loss | Fault::Late) { 2 } else { 1 };
                assert!(told.opened >= opened && told.held == 0, "{name}: {fault:?} at {at}: {told:?}");
                found += u64::from(fault == Fault::Garbage && told.opened == 2);
            }
            assert!(found * less >= 2, "{name}: {fault:?} was met {found} times in {all} events");
        }
    }
}
