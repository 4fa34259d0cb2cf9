//! Drags through the frame service and says how long a picture takes to follow: `measure frames SCENE|SCAN [EVENTS] [stage.key=value …]`.
//!
//! A handle with a radius of 25 voxels is put where the volume's picture is seen in its middle, and dragged along a loop of an eighth of its radius; each event waits for the
//! frame that shows it. Pictures are those of a pane of 512² pixels, as coarse as the service makes them while things move; then it is waited until the picture is whole.

use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_frames::{Frame, Model, Output, Pane, Request, Service, Subject, Tell, bare_scene};
use ivd_pipeline::scene;

use crate::anything::Anything;

pub(crate) const USAGE: &str = "SCENE|SCAN [EVENTS] [stage.key=value …]";

const PANE: [usize; 2] = [512; 2];

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let (file, rest) = words.split_first().ok_or(USAGE)?;
    let count: usize = rest.iter().find_map(|word| word.parse().ok()).unwrap_or(400);
    let overrides: Result<Vec<_>, _> =
        rest.iter().filter(|word| word.contains('=')).map(|word| word.parse()).collect();
    let path = Path::new(file);
    let is_scene = path.extension().is_some_and(|ending| ending == "toml");
    let loaded = if is_scene { scene::load(path, &overrides?)? } else { bare_scene(path, &overrides?)? };
    let exec = Exec::default();
    let start = Instant::now();
    let subject = Subject::open(&loaded, !is_scene, &Cache::disabled(), &exec, &Tell::default())?;
    let opened = start.elapsed();
    let spacing = subject.volume.grid().spacing();
    let radius = 25.0 * spacing.iter().product::<f64>().cbrt();
    let (sender, outputs) = channel();
    let model = Model::new(subject, PANE, exec.clone())?;
    let service = Service::start(move |_| Ok(model), exec, move |output| _ = sender.send(output))?;
    let first = next(&outputs, |_| true)?;
    println!(
        "opened in {:.2} s, the first picture after {:.2} s; {} vertices at level {}",
        opened.as_secs_f64(),
        start.elapsed().as_secs_f64(),
        first.figures.vertices,
        first.figures.level
    );
    for one in &first.figures.handles {
        service.ask(1, Request::Remove { handle: one.id });
    }
    service.ask(1, Request::Radius { handle: None, radius });
    let width = first.figures.width_mm;
    let at = middle(&service, &outputs)?;
    let start = Instant::now();
    service.ask(1, Request::Grab { pane: Pane::Volume, at });
    next(&outputs, |frame| frame.figures.held.is_some())?;
    println!("placing the handle: {:.0} ms", 1e3 * start.elapsed().as_secs_f64());

    let (mut times, mut coarse, mut refused, mut is_whole) = (Vec::new(), [0; 5], 0, false);
    let mut parts = [0.0; 4];
    let busy = ProcessTime::now();
    for event in 1..=count {
        let t = std::f64::consts::TAU * (event as f64 / 200.0);
        let way = [(2.0 * t).sin() * 0.5, t.sin()].map(|c| 0.125 * radius * c / width);
        // What was made whole meanwhile isn't the answer.
        while outputs.try_recv().is_ok() {}
        let start = Instant::now();
        service.ask(1, Request::Drag { to: [at[0] + way[0], at[1] + way[1]], lock: None });
        let frame = next(&outputs, |_| true)?;
        is_whole = frame.pictures[0].coarser == 1;
        times.push(1e3 * start.elapsed().as_secs_f64());
        coarse[frame.pictures[0].coarser.min(4)] += 1;
        refused += usize::from(frame.figures.refused.is_some());
        let [solve, map, warp] = frame.figures.times;
        for (sum, took) in parts.iter_mut().zip([solve, map, warp, frame.figures.draw_s]) {
            *sum += 1e3 * took / count as f64;
        }
    }
    let processor = 1e3 * busy.elapsed().as_secs_f64() / count as f64;
    let start = Instant::now();
    if !is_whole {
        next(&outputs, |frame| frame.pictures[0].coarser == 1)?;
    }
    let whole = 1e3 * start.elapsed().as_secs_f64();
    times.sort_by(f64::total_cmp);
    let share = |share: f64| times[((count - 1) as f64 * share).round() as usize];
    println!(
        "event to picture: {:.0} ms in the middle, {:.0} at 99 %, {:.0} at most; {processor:.0} ms of the processor",
        share(0.5),
        share(0.99),
        share(1.0)
    );
    println!(
        "of it on average: lattice {:.0}, map {:.0}, voxels {:.0}, pictures {:.0} ms; whole {whole:.0} ms after the last",
        parts[0], parts[1], parts[2], parts[3]
    );
    println!("sides of the picture divided by 1, 2, 3, 4 in {:?} events; {refused} refused", &coarse[1..]);
    Ok(())
}

/// The next frame for which something holds.
fn next(outputs: &Receiver<Output>, holds: impl Fn(&Frame) -> bool) -> Anything<std::sync::Arc<Frame>> {
    loop {
        match outputs.recv_timeout(Duration::from_mins(2))? {
            Output::Frame(frame) if holds(&frame) => return Ok(frame),
            Output::Failed(error) => return Err(error.to_string().into()),
            _ => {}
        }
    }
}

/// A place near the middle of the volume's picture where a handle can be put.
fn middle(service: &Service, outputs: &Receiver<Output>) -> Anything<[f64; 2]> {
    for step in 0..200_u32 {
        let turn = f64::from(step) * 2.4;
        let out = 0.03 * f64::from(step).sqrt();
        let at = [0.5 + out * turn.cos(), 0.5 + out * turn.sin()];
        service.ask(1, Request::Hover { pane: Pane::Volume, at });
        let frame = next(outputs, |_| true)?;
        let found = frame.figures.hovered.as_ref().and_then(|hovered| hovered.away_mm);
        // Near the surface that is seen: a lattice of something within is none to pull the picture by.
        if found.is_some_and(|away| away < 4.0) {
            return Ok(at);
        }
    }
    Err("nothing is seen near the lattice".into())
}
