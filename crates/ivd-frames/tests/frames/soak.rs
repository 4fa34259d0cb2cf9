//! Hands that don't rest: gestures of twenty requests and more through the service, whose worker is held up now and then. In the end the log gives the same bytes, so does the
//! scene through the pipeline, and undoing gives the beginning.

use std::time::{Duration, Instant};

use ivd_core::Exec;
use ivd_frames::{Log, Model, Pane, Request, Saved};
use ivd_pipeline::scene::{self, WindowSection};
use ivd_session::Entry;

use super::common::{BALL, Draw, model};
use super::hands::Hands;
use super::scripts::assert_as_piped;

/// Requests of a gesture at least.
const EVENTS: usize = 20;
/// Memory is looked at after so long, and may grow by so much from then on (bytes).
const WARM: Duration = Duration::from_mins(10);
const GROWS: f64 = 1024.0 * 1024.0;

/// A gesture: twenty requests and more.
fn gesture(draw: &mut Draw) -> Vec<Request> {
    let panes = [Pane::Volume, Pane::Axial, Pane::Coronal, Pane::Sagittal];
    let pane = panes[draw.below(4)];
    let at = [0, 1].map(|_| 0.35 + 0.3 * draw.unit());
    let by = [0, 1].map(|_| 0.06 * (draw.unit() - 0.5));
    let to = |share: f64| [at[0] + share * by[0], at[1] + share * by[1]];
    let share = |i: usize| (i + 1) as f64 / EVENTS as f64;
    let all = (0..EVENTS).map(share);
    match draw.below(10) {
        0 => all.map(|_| Request::Orbit { by }).collect(),
        1 => all
            .map(|_| Request::Slice { pane: panes[1 + draw.below(3)], steps: draw.below(5) as i32 - 2 })
            .collect(),
        2 => {
            let from = 20.0 + 40.0 * draw.unit();
            let slid = all.map(|share| Request::Stiffness { stiffness: from + 20.0 * share });
            [Request::Adjust].into_iter().chain(slid).chain([Request::Drop]).collect()
        }
        3 => all.map(|share| Request::Hover { pane, at: to(share) }).chain([Request::Undo]).collect(),
        4 => all.map(|_| [Request::Undo, Request::Redo][draw.below(2)].clone()).collect(),
        kind => {
            let ends = if kind == 5 { Request::Abandon } else { Request::Drop };
            let wheel = Request::Wheel { steps: draw.below(3) as i32 - 1 };
            let mut held: Vec<Request> =
                all.map(|share| Request::Drag { to: to(share), lock: None }).collect();
            held.insert(EVENTS / 2, wheel);
            [Request::Grab { pane, at }].into_iter().chain(held).chain([ends]).collect()
        }
    }
}

/// Bytes of this process in memory, where the system tells.
fn resident() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(text.split(' ').nth(1)?.parse::<f64>().ok()? * 4096.0)
}

/// By how much a line through points rises from the first to the last.
fn rise(points: &[[f64; 2]]) -> f64 {
    let count = points.len() as f64;
    let mean = [0, 1].map(|a| points.iter().map(|p| p[a]).sum::<f64>() / count);
    let over =
        |f: fn([f64; 2]) -> f64| points.iter().map(|p| f([p[0] - mean[0], p[1] - mean[1]])).sum::<f64>();
    let length = points[points.len() - 1][0] - points[0][0];
    over(|[x, y]| x * y) / over(|[x, _]| x * x).max(f64::MIN_POSITIVE) * length
}

/// Works for so many gestures, and so long at least; the log then gives the same bytes. What memory was, by seconds.
fn work(seed: u64, gestures: usize, at_least: Duration, held_up: Duration) -> Vec<[f64; 2]> {
    let (hands, mut draw, begun) = (Hands::at_work(BALL, seed, held_up), Draw(seed), Instant::now());
    let (mut done, mut memory) = (0, Vec::new());
    while done < gestures || begun.elapsed() < at_least {
        for request in gesture(&mut draw) {
            hands.ask(&request);
            // A hand moves fifty times a second, or faster.
            std::thread::sleep(held_up.mul_f64(0.2 * draw.unit()));
        }
        done += 1;
        // Spread over the time that there is.
        let due = at_least.mul_f64(done as f64 / gestures as f64);
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
        if done % 12 == 0 {
            // So that there aren't ever more handles.
            hands.ask(&Request::Reset);
        }
        if done % 20 == 0 {
            hands.kept(Saved::Scene);
            memory.extend(resident().map(|bytes| [begun.elapsed().as_secs_f64(), bytes]));
        }
    }
    let log = String::from_utf8(hands.kept(Saved::Log).bytes.clone()).unwrap();
    // A log doesn't say how it was seen; a scene does.
    hands.ask(&Request::ResetView);
    let unseen = |bytes: &[u8]| {
        let mut scene = scene::parse(std::str::from_utf8(bytes).unwrap(), &[]).unwrap();
        scene.set_window(WindowSection::default()).unwrap();
        scene.to_text().unwrap()
    };
    let scene = unseen(&hands.kept(Saved::Scene).bytes);
    let log: Log = log.parse().unwrap();
    let steps = log.entries.iter().filter(|entry| matches!(entry, Entry::Step(_))).count();
    assert!(steps * 4 > done, "{steps} steps of {done} gestures");
    let mut again = model(BALL);
    let start = again.session().deformed().clone();
    again.replay(&log.entries).unwrap();
    assert_eq!(
        unseen(&again.save(Saved::Scene, String::new(), &Exec::default()).unwrap().bytes),
        scene,
        "seed {seed}"
    );
    assert_eq!(
        again.session().steps().last().map(|step| step.name.clone()),
        hands.frame().and_then(|frame| frame.figures.undo.clone())
    );
    assert_as_piped(&again);
    undo_all(&mut again);
    assert_eq!(again.session().deformed(), &start);
    memory
}

fn undo_all(model: &mut Model) {
    while model.session().steps().next().is_some() {
        model.follow(&Request::Undo).unwrap();
    }
}

#[test]
fn gestures_through_a_worker_that_is_held_up_are_done_again_from_the_log() {
    for seed in [1, 2] {
        work(seed, 25, Duration::ZERO, Duration::from_millis(6));
    }
}

#[test]
#[ignore = "an hour: just soak"]
fn an_hour_of_gestures_leaves_memory_as_it_was() {
    let number = |name: &str, usual: u64| {
        std::env::var(name)
            .map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is no number")))
    };
    let [seconds, gestures] = [number("IVD_SOAK_SECONDS", 3600), number("IVD_SOAK_GESTURES", 3000)];
    let memory = work(
        number("IVD_SOAK_SEED", 1),
        gestures as usize,
        Duration::from_secs(seconds),
        Duration::from_millis(20),
    );
    let warm = if Duration::from_secs(seconds) > 2 * WARM { WARM } else { Duration::from_secs(seconds / 4) };
    let from = memory.partition_point(|[time, _]| *time < warm.as_secs_f64());
    let rise = rise(&memory[from..]);
    for [time, bytes] in &memory {
        println!("{time:.0} s: {:.2} MiB", bytes / GROWS);
    }
    println!(
        "{} points; memory rises by {:.2} MiB after {:.0} s",
        memory.len(),
        rise / GROWS,
        warm.as_secs_f64()
    );
    assert!(rise < GROWS, "memory rises by {:.2} MiB", rise / GROWS);
}
