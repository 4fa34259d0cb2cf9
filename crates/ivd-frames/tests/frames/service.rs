//! Frames come, the newest first; nothing is lost that counts.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ivd_artefact::Cache;
use ivd_core::{Exec, Observer};
use ivd_frames::{
    Begun, Error, Figures, Frame, MapName, Model, Output, Pane, Request, Saved, Service, Sight, Source,
    Subject, Tell,
};

use super::common::{BALL, Draw, loaded, model};
use super::scripts::assert_as_piped;

const LONG: Duration = Duration::from_mins(1);

fn service() -> (Service, Receiver<Output>) {
    let (sender, receiver) = channel();
    let publish = move |output| _ = sender.send(output);
    (Service::start(|_| Ok(model(BALL)), Exec::default(), publish).unwrap(), receiver)
}

/// The next whole frame for which something holds.
fn frame(outputs: &Receiver<Output>, holds: impl Fn(&Frame) -> bool) -> Arc<Frame> {
    loop {
        match outputs.recv_timeout(LONG).unwrap() {
            Output::Frame(frame) if frame.pictures[0].coarser == 1 && holds(&frame) => return frame,
            Output::Failed(why) => panic!("{why}"),
            _ => {}
        }
    }
}

#[test]
fn a_drag_in_many_requests_ends_where_the_same_without_a_service_does() {
    let (service, outputs) = service();
    let first = frame(&outputs, |_| true);
    assert_eq!((first.pictures[0].image.width(), first.figures.handles.len()), (128, 0));
    let mut alone = model(BALL);
    let mut requests = vec![Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] }];
    requests.extend((1..=60).map(|i| Request::Drag { to: [0.5 + 0.0005 * f64::from(i), 0.49], lock: None }));
    requests.push(Request::Drop);
    for request in requests {
        alone.follow(&request).unwrap();
        assert!(service.ask(1, request));
    }
    let last = frame(&outputs, |frame| frame.figures.held.is_none() && frame.figures.undo.is_some());
    assert_eq!(last.figures.handles, alone.figures().handles);
    assert_eq!(last.pictures[0].image, alone.draw(Pane::Volume, 1, &Exec::default()).unwrap());
    assert!(last.number < 63, "requests that come meanwhile are merged");
    assert!(last.pictures[0].png().unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn slices_have_the_line_of_the_surface_as_it_lies_now_where_that_is_asked_for() {
    let (plain, outputs) = service();
    assert!(frame(&outputs, |_| true).outlines.iter().all(|line| line.is_empty()), "nobody asked for it");
    drop(plain);
    let (sender, outputs) = channel();
    let open = |_: &Tell| {
        let mut model = model(BALL);
        model.outline();
        Ok(model)
    };
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    // How far to the top of the axial pane the line reaches.
    let top = |frame: &Frame| {
        let ends = frame.outlines[0].iter().flatten();
        ends.map(|end| f64::from(end[1])).fold(f64::INFINITY, f64::min)
    };
    let first = frame(&outputs, |_| true);
    assert!(first.outlines.iter().all(|line| line.len() > 20));
    // The ball's front is pressed in by 3 of 32 mm.
    assert!(service.ask(1, Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -3.0, 0.0] }));
    let pressed = frame(&outputs, |frame| !frame.figures.handles.is_empty());
    assert!(top(&pressed) > top(&first) + 0.02, "{} {}", top(&pressed), top(&first));
    for (request, is_gone) in [(Request::Undo, true), (Request::Redo, false)] {
        assert!(service.ask(1, request));
        let then = frame(&outputs, |frame| frame.figures.handles.is_empty() == is_gone);
        assert_eq!(then.outlines[0], if is_gone { &first } else { &pressed }.outlines[0]);
    }
    let count = pressed.outlines[0].len();
    assert!(service.ask(1, Request::Level { level: 3 }));
    let coarser = frame(&outputs, |frame| frame.figures.level == 3);
    assert!(coarser.outlines[0].len() < count, "{} {count}", coarser.outlines[0].len());
}

#[test]
fn what_is_seen_first_is_so_from_the_first_picture_on() {
    let model_told = |tell: &Tell| {
        let exec = Exec::default();
        let subject = Subject::open(&loaded(BALL), false, &Cache::disabled(), &exec, tell)?;
        Model::new(subject, [128, 128], exec)
    };
    let other = model(BALL).figures().sight();
    let sight = Sight { angles: [90.0, 0.0], zoom: 2.0, window: [10.0, 90.0], ..other };
    let cross = sight.cross.map(|mm| mm + 3.0);
    let sight = Sight { cross, radius: 1.5 * sight.radius, ..sight };
    for is_told in [false, true] {
        let (sender, outputs) = channel();
        let open = move |tell: &Tell| if is_told { model_told(tell) } else { Ok(model(BALL)) };
        let publish = move |output| _ = sender.send(output);
        let service = Service::start_seen(Some(sight), open, Exec::default(), publish).unwrap();
        let first = loop {
            match outputs.recv_timeout(LONG).unwrap() {
                Output::Frame(frame) => break frame,
                Output::Scan(scan) => assert_eq!(scan.cross, sight.cross),
                Output::Failed(why) => panic!("{why}"),
                _ => {}
            }
        };
        assert_eq!((first.number, first.figures.sight()), (1, sight), "{is_told}");
        drop(service);
    }
}

#[test]
fn answers_find_those_who_asked() {
    let (service, outputs) = service();
    service.ask(7, Request::Slice { pane: Pane::Volume, steps: 1 });
    service.ask(8, Request::Save { what: Saved::Scene });
    let (mut problem, mut file) = (None, None);
    while problem.is_none() || file.is_none() {
        match outputs.recv_timeout(LONG).unwrap() {
            Output::Problem(client, text) => problem = Some((client, text)),
            Output::File(client, found) => file = Some((client, found.unwrap().name)),
            _ => {}
        }
    }
    assert!(problem.is_some_and(|(client, text)| client == 7 && text.contains("has no slices")));
    assert_eq!(file, Some((8, "scene.toml")));
}

#[test]
fn merged_requests_do_what_they_do_one_by_one() {
    let (service, outputs) = service();
    frame(&outputs, |_| true);
    // One of them is no number: the others count.
    for by in [[0.1, 0.0], [f64::NAN, 0.0], [0.15, 0.1]] {
        service.ask(1, Request::Orbit { by });
    }
    let turned = frame(&outputs, |frame| frame.figures.angles != [0.0, 0.0]);
    let turned = if turned.figures.angles == [315.0, 18.0] {
        turned
    } else {
        frame(&outputs, |frame| frame.figures.angles == [315.0, 18.0])
    };
    assert_eq!(turned.figures.size, [128, 128]);
}

#[test]
fn what_cannot_be_opened_says_so_and_ends() {
    let (sender, outputs) = channel();
    let open = |_: &Tell| Err::<Model, _>(Error::NotInSessions { part: "[space]".into() });
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    assert!(
        matches!(outputs.recv_timeout(LONG).unwrap(), Output::Failed(why) if why.to_string().contains("[space]"))
    );
    service.ask(1, Request::Undo);
    drop(service);
}

#[test]
fn slices_are_shown_and_moved_before_there_is_a_model() {
    let (sender, outputs) = channel();
    let (go, wait) = channel::<()>();
    let open = move |tell: &Tell| {
        let model = model(BALL);
        tell.stage("import");
        tell.scan(model.session().rest(), None);
        wait.recv_timeout(LONG).unwrap();
        Ok(model)
    };
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    let scan = |holds: &dyn Fn(&ivd_frames::Scan) -> bool| loop {
        match outputs.recv_timeout(LONG).unwrap() {
            Output::Scan(scan) if holds(&scan) => return scan,
            Output::Frame(_) => panic!("it isn't opened yet"),
            _ => {}
        }
    };
    let first = scan(&|_| true);
    assert_eq!((first.pictures[0].image.width(), first.slices[1].slice), (32, 16));
    service.ask(1, Request::Slice { pane: Pane::Coronal, steps: 4 });
    // What slices can't follow waits.
    service.ask(1, Request::Orbit { by: [0.1, 0.0] });
    let moved = scan(&|scan| scan.slices[1].slice == 20);
    assert!(moved.pictures[1].image != first.pictures[1].image);
    assert!(Arc::ptr_eq(&moved.pictures[0], &first.pictures[0]), "what is still right isn't drawn anew");
    go.send(()).unwrap();
    let shown = frame(&outputs, |frame| frame.figures.angles != [0.0, 0.0]);
    assert_eq!(shown.figures.slices[1].slice, 20, "where they were left");
    assert_eq!(shown.pictures[2].image, moved.pictures[1].image);
}

#[test]
fn the_volume_is_shown_and_turned_before_it_can_be_moved() {
    let (sender, outputs) = channel();
    let (go, wait) = channel::<()>();
    let open = move |tell: &Tell| {
        let exec = Exec::default();
        let subject = Subject::open(&loaded(BALL), false, &Cache::disabled(), &exec, tell)?;
        wait.recv_timeout(LONG).unwrap();
        Model::new(subject, [64, 64], exec)
    };
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    // What comes too early waits for the picture.
    service.ask(1, Request::Resize { size: [128, 96] });
    let seen = |holds: &dyn Fn(&ivd_frames::VolumeAtRest) -> bool| loop {
        match outputs.recv_timeout(LONG).unwrap() {
            Output::Scan(scan) => {
                if let Some(volume) = scan.volume.as_ref().filter(|volume| holds(volume)) {
                    return volume.clone();
                }
            }
            Output::Frame(_) => panic!("it isn't opened yet"),
            _ => {}
        }
    };
    let whole = |volume: &ivd_frames::VolumeAtRest| volume.picture.coarser == 1;
    let first = seen(&|volume| whole(volume) && volume.size == [128, 96]);
    assert_eq!((first.picture.image.width(), first.angles), (128, [0.0, 0.0]));
    let mut alone = model(BALL);
    alone.follow(&Request::Resize { size: [128, 96] }).unwrap();
    assert_eq!(first.picture.image, alone.draw(Pane::Volume, 1, &Exec::default()).unwrap());
    service.ask(1, Request::Orbit { by: [0.1, 0.0] });
    let turned = seen(&|volume| whole(volume) && volume.angles == [342.0, 0.0]);
    assert!(turned.picture.image != first.picture.image);
    // What doesn't go by what is seen holds nobody up, nor does what was let go of before it was taken hold of.
    for request in [
        Request::Undo,
        Request::Abandon,
        Request::Grab { pane: Pane::Volume, at: [0.4, 0.5] },
        Request::Drag { to: [0.45, 0.5], lock: None },
        Request::Abandon,
        Request::Orbit { by: [-0.1, 0.0] },
    ] {
        assert!(service.ask(1, request));
    }
    seen(&|volume| volume.angles == [0.0, 0.0]);
    service.ask(1, Request::Orbit { by: [0.1, 0.0] });
    seen(&|volume| volume.angles == [342.0, 0.0]);
    // A hand waits, and what follows it stays behind it: it took hold of what it saw.
    for request in [
        Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] },
        Request::Drag { to: [0.7, 0.5], lock: None },
        Request::Drop,
        Request::Orbit { by: [0.25, 0.0] },
    ] {
        assert!(service.ask(1, request));
    }
    go.send(()).unwrap();
    let shown = frame(&outputs, |frame| !frame.figures.handles.is_empty());
    let [azimuth, _] = shown.figures.angles;
    assert_eq!((azimuth, shown.figures.size), (297.0, [128, 96]));
    let moved = shown.figures.handles[0].by.unwrap();
    // Along the picture's right as it was seen at 342 degrees.
    let right = [18.0_f64.to_radians().cos(), -18.0_f64.to_radians().sin(), 0.0];
    let along: f64 = (0..3).map(|a| moved[a] * right[a]).sum();
    let length = moved.iter().map(|c| c * c).sum::<f64>().sqrt();
    assert!(length > 1.0 && along.abs() > 0.999 * length, "{moved:?}");
}

#[test]
fn a_log_is_opened_again_with_its_steps() {
    let folder = tempfile::tempdir().unwrap();
    let (service, outputs) = service();
    service.ask(1, Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, -1.5, 0.0] });
    let before = frame(&outputs, |frame| !frame.figures.handles.is_empty());
    service.ask(1, Request::Save { what: Saved::Log });
    let kept = loop {
        if let Output::File(_, file) = outputs.recv_timeout(LONG).unwrap() {
            break file.unwrap();
        }
    };
    let file = folder.path().join(kept.name);
    std::fs::write(&file, &kept.bytes).unwrap();
    let opened = Source { file: Some(file), ..Source::default() }.read().unwrap();
    assert_eq!(opened.entries.len(), 1);
    let exec = Exec::default();
    let cache = Cache::disabled();
    let subject = Subject::open(&opened.loaded, opened.is_bare, &cache, &exec, &Tell::default()).unwrap();
    let begun = Begun { entries: opened.entries, ..Model::new(subject, [128, 128], exec).unwrap().into() };
    let (sender, outputs) = channel();
    let again =
        Service::start(move |_| Ok(begun), Exec::default(), move |output| _ = sender.send(output)).unwrap();
    let after = frame(&outputs, |_| true);
    assert_eq!(after.figures.handles, before.figures.handles);
    assert_eq!(after.figures.undo.as_deref(), Some("add a handle"));
    drop(again);
}

#[test]
fn another_is_opened_while_a_frame_of_the_one_before_is_made() {
    let mut draw = Draw(5);
    let grab = Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] };
    let drag = |share: f64| Request::Drag { to: [0.5 + 0.03 * share, 0.49], lock: None };
    let other = BALL.replace("size = 32", "size = 24").replace("level = 1", "level = 0");
    let mut alone = model(&other);
    for request in [grab.clone(), drag(1.0), Request::Drop] {
        alone.follow(&request).unwrap();
    }
    for _ in 0..20 {
        let (sender, outputs) = channel();
        let held_up = Duration::from_millis(draw.below(8) as u64);
        let publish = move |output| {
            std::thread::sleep(held_up);
            let _ = sender.send(output);
        };
        let before = Service::start(|_| Ok(model(BALL)), Exec::default(), publish).unwrap();
        if draw.below(4) > 0 {
            frame(&outputs, |_| true);
        }
        before.ask(1, grab.clone());
        for step in 1..=30 {
            before.ask(1, drag(f64::from(step) / 30.0));
        }
        std::thread::sleep(Duration::from_millis(draw.below(60) as u64));
        drop(before);
        assert!(outputs.try_iter().all(|output| !matches!(output, Output::Failed(_))));

        let (sender, outputs) = channel();
        let (begins, publish) = (other.clone(), move |output| _ = sender.send(output));
        let service = Service::start(move |_| Ok(model(&begins)), Exec::default(), publish).unwrap();
        for request in [grab.clone(), drag(1.0), Request::Drop] {
            service.ask(1, request);
        }
        let last = frame(&outputs, |frame| frame.figures.held.is_none() && frame.figures.undo.is_some());
        assert_eq!(last.figures.handles, alone.figures().handles);
        assert_eq!(last.pictures[0].image, alone.draw(Pane::Volume, 1, &Exec::default()).unwrap());
    }
}

#[test]
fn stiffness_level_and_map_changed_in_mid_drag_are_in_the_next_frame() {
    let springs = format!("{BALL}\n[deform]\nsolver = \"projective\"\ntolerance = 0.01\nground = 0.5\n");
    // What is moved goes where the hand is however stiff it is; what is pulled by a force doesn't.
    let pulled = [
        Request::Add { place: [5.5, 16.0, 16.0], by: [0.0; 3] },
        Request::Pull { handle: 0, with: [-100.0, 0.0, 0.0] },
    ];
    let level = Request::Level { level: 0 };
    changed_in_mid_drag(&springs, &pulled, &[Request::Stiffness { stiffness: 400.0 }, level.clone()]);
    changed_in_mid_drag(BALL, &[], &[Request::Map { map: MapName::Biharmonic }, level]);
}

/// Follows requests while a handle is held: each is in the frame that comes next, as without a service.
fn changed_in_mid_drag(scene: &str, before: &[Request], changes: &[Request]) {
    let (sender, outputs) = channel();
    let (begins, publish) = (scene.to_owned(), move |output| _ = sender.send(output));
    let service = Service::start(move |_| Ok(model(&begins)), Exec::default(), publish).unwrap();
    let mut alone = model(scene);
    // Every frame is waited for, so that the one behind a request is the next.
    let next = || loop {
        match outputs.recv_timeout(LONG).unwrap() {
            Output::Frame(frame) => return frame,
            Output::Failed(why) => panic!("{why}"),
            _ => {}
        }
    };
    let settled = |mut frame: Arc<Frame>| {
        while frame.pictures[0].coarser > 1 {
            frame = next();
        }
        frame
    };
    let mut shown = settled(next());
    let held = [
        Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] },
        Request::Drag { to: [0.51, 0.49], lock: None },
    ];
    let wide = Request::Radius { handle: None, radius: 12.0 };
    for request in [&wide].into_iter().chain(before).chain(&held).chain(changes) {
        let was = alone.session().displacement().clone();
        alone.follow(request).unwrap();
        service.ask(1, request.clone());
        let frame = next();
        assert_eq!(frame.figures.refused, None, "{request:?}");
        let of = |figures: &Figures| (figures.stiffness, figures.level, figures.map, figures.handles.clone());
        assert_eq!(of(&frame.figures), of(&alone.figures()), "{request:?}");
        if changes.contains(request) {
            assert!(frame.figures.held.is_some(), "{request:?} lets go");
            let changed = alone.session().displacement().changed(&was).unwrap();
            assert!(!changed.is_empty(), "{request:?} changes nothing");
            assert!(frame.pictures[0].version > shown.pictures[0].version, "{request:?} isn't seen");
        }
        shown = settled(frame);
        assert_eq!(shown.pictures[0].image, alone.draw(Pane::Volume, 1, &Exec::default()).unwrap());
    }
    assert_as_piped(&alone);
}

/// Asks a service to stop as soon as a solve begins.
#[derive(Default)]
struct StopsSolves {
    service: Mutex<Option<Service>>,
    stopped: AtomicUsize,
}

impl Observer for StopsSolves {
    fn begin(&self, task: &'static str, _: u64) {
        let service = self.service.lock().unwrap();
        if task == "ring"
            && self.stopped.load(Ordering::Relaxed) == 0
            && let Some(service) = &*service
        {
            assert!(service.ask(2, Request::Stop));
            self.stopped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

#[test]
fn what_is_stopped_comes_to_nothing_and_what_is_asked_next_is_done() {
    let (sender, outputs) = channel();
    let stops = Arc::new(StopsSolves::default());
    let exec = Exec::default().with_observer(stops.clone());
    let open = move |tell: &Tell| {
        let subject = Subject::open(&loaded(BALL), false, &Cache::disabled(), &exec, tell)?;
        Model::new(subject, [128, 128], exec)
    };
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    let first = frame(&outputs, |_| true);
    // Where nothing is worked on there is nothing to stop, and what comes later isn't.
    assert!(service.ask(2, Request::Stop));
    *stops.service.lock().unwrap() = Some(service);
    let ask = |request| assert!(stops.service.lock().unwrap().as_ref().unwrap().ask(1, request));
    let add = || Request::Add { place: first.figures.middle, by: [0.0, 0.0, 1.0] };
    ask(add());
    let stopped = frame(&outputs, |frame| frame.figures.refused.is_some());
    let why = stopped.figures.refused.as_ref().unwrap();
    assert_eq!((why.why.as_str(), stopped.figures.handles.len()), ("it was stopped", 0));
    assert_eq!((stopped.figures.largest_mm, &stopped.figures.undo), (0.0, &None));
    ask(add());
    let done = frame(&outputs, |frame| !frame.figures.handles.is_empty());
    assert!(done.figures.refused.is_none() && done.figures.largest_mm > 0.9);
    let service = stops.service.lock().unwrap().take();
    drop(service);
}

/// Goes on, and gives up what is held, as soon as a solve begins, once; then counts solves.
#[derive(Default)]
struct GivesUp {
    service: Mutex<Option<Service>>,
    solves: AtomicUsize,
}

impl Observer for GivesUp {
    fn begin(&self, task: &'static str, _: u64) {
        let service = self.service.lock().unwrap();
        if task == "ring"
            && let Some(service) = &*service
            && self.solves.fetch_add(1, Ordering::Relaxed) == 0
        {
            service.ask(1, Request::Drag { to: [0.6, 0.6], lock: None });
            service.ask(1, Request::Abandon);
        }
    }
}

#[test]
fn what_a_hand_gives_up_is_not_followed_to_its_end() {
    let (sender, outputs) = channel();
    let gives = Arc::new(GivesUp::default());
    let exec = Exec::default().with_observer(gives.clone());
    let open = move |tell: &Tell| {
        let subject = Subject::open(&loaded(BALL), false, &Cache::disabled(), &exec, tell)?;
        Model::new(subject, [128, 128], exec)
    };
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    let first = frame(&outputs, |_| true);
    service.ask(1, Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    let held = frame(&outputs, |frame| frame.figures.held.is_some());
    assert_eq!(held.figures.handles.len(), 1);
    *gives.service.lock().unwrap() = Some(service);
    let ask = |request| assert!(gives.service.lock().unwrap().as_ref().unwrap().ask(1, request));
    ask(Request::Drag { to: [0.55, 0.55], lock: None });
    let given_up = frame(&outputs, |frame| frame.figures.held.is_none());
    assert_eq!((given_up.figures.handles.len(), &given_up.figures.refused), (0, &None));
    assert_eq!(given_up.figures.undo, first.figures.undo);
    // The place where the hand had gone on to wasn't tried, nor any closer one.
    assert_eq!(gives.solves.load(Ordering::Relaxed), 1);
    let service = gives.service.lock().unwrap().take();
    drop(service);
}

#[test]
fn a_file_that_is_asked_for_while_something_is_opened_comes_whatever_is_given_up() {
    let (sender, outputs) = channel();
    let (opens, opened) = channel::<()>();
    let open = move |_: &Tell| {
        let _ = opened.recv();
        Ok(model(BALL))
    };
    let service = Service::start(open, Exec::default(), move |output| _ = sender.send(output)).unwrap();
    service.ask(1, Request::Grab { pane: Pane::Volume, at: [0.5, 0.5] });
    service.ask(1, Request::Save { what: Saved::Scene });
    service.ask(1, Request::Abandon);
    opens.send(()).unwrap();
    loop {
        match outputs.recv_timeout(LONG).unwrap() {
            Output::File(1, file) => break assert_eq!(file.unwrap().name, "scene.toml"),
            Output::Frame(frame) => assert!(frame.figures.held.is_none(), "it was given up"),
            _ => {}
        }
    }
}
