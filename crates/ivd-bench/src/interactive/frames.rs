//! The same through the frame service: how long a picture takes to follow.

use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use ivd_artefact::Cache;
use ivd_core::{Exec, Image};
use ivd_frames::{Frame, Model, Output, Pane, Request, Service, Source, Subject, Tell};
use serde::Serialize;

use super::{FARTHEST, RADIUS, rank};
use crate::experiment::Problem;

/// Pixels of the volume's pane.
const PANE: [usize; 2] = [512; 2];
/// Events of a drag, and of a quick one.
pub(super) const EVENTS: [usize; 2] = [400, 60];
/// Events of one loop.
const LOOP: f64 = 200.0;
/// Whoever waits longer for a picture has no service.
const NEVER: Duration = Duration::from_mins(5);
/// A handle is put where the surface that is seen is so near (mm): a lattice of something within is none to pull a picture by.
const NEAR: f64 = 4.0;

/// Pictures that follow a drag: each event waits for the picture of the one before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameBench {
    /// What was opened.
    pub input: String,
    /// Voxels of it.
    pub dims: [usize; 3],
    /// Vertices of its lattice.
    pub vertices: usize,
    /// Level of refinement.
    pub level: u8,
    /// Worker threads.
    pub threads: usize,
    /// What the machine had to do in the minute before, beside this, where it says so.
    pub load: Option<f64>,
    /// Pixels of the volume's pane.
    pub pane: [usize; 2],
    /// From the start to the scan's slices, to the volume's picture, and to the first that follows hands (s).
    pub opened_s: [f64; 3],
    /// From asking for a handle to the picture with it (ms).
    pub placed_ms: f64,
    /// From every event to the picture that shows it (ms).
    pub event_ms: Vec<f64>,
    /// Of these the middle one, the 99th of a hundred, the longest.
    pub picture_ms: [f64; 3],
    /// Processor time of an event, all threads, on average (ms).
    pub cpu_ms: f64,
    /// Of an event on average: the lattice, the voxels' motion, their values, the pictures (ms).
    pub parts_ms: [f64; 4],
    /// From the last event to the whole picture (ms); 0 where the last was whole.
    pub whole_ms: f64,
    /// How many pictures had their sides divided by 1, 2, 3, 4.
    pub divided: [usize; 4],
    /// Root mean square and largest difference of the last coarse picture from the whole one, pixel by pixel in the largest channel (of 255); `None` where it was whole.
    pub coarse_error: Option<[f64; 2]>,
    /// Events that were refused.
    pub refused: usize,
}

/// Drags a handle of 25 voxels' radius through the frame service, put where the middle of the picture is seen, along a loop of an eighth of its radius.
///
/// - `source`: a scan or a scene.
/// - `count`: events.
///
/// # Errors
/// What can't be opened, or where nothing is seen near the lattice.
pub fn followed(source: &Source, count: usize, exec: &Exec) -> Result<FrameBench, Problem> {
    let load = load();
    let start = Instant::now();
    let mut opened = source.read()?;
    let is_own = opened.is_bare || source.file.is_none();
    if is_own && !source.overrides.iter().any(|one| one.path.join(".") == "map.method") {
        // By the map that the rest of the bench has, not by the one that windows or the demo choose.
        let mut source = source.clone();
        source.overrides.push("map.method=\"octree\"".parse()?);
        opened = source.read()?;
    }
    let (sender, outputs) = channel();
    let (its, told) = (exec.clone(), Arc::new(OnceLock::new()));
    let tells = told.clone();
    let open = move |tell: &Tell| {
        let cache = Cache::disabled();
        let subject = Subject::open(&opened.loaded, opened.is_bare, &cache, &its, tell)?;
        let _ = tells.set(subject.volume.grid().clone());
        Model::new(subject, PANE, its)
    };
    let service = Service::start(open, exec.clone(), move |output| _ = sender.send(output))?;
    let mut opened_s = [0.0; 3];
    let first = loop {
        match outputs.recv_timeout(NEVER)? {
            Output::Scan(scan) => {
                for (seen, at) in [true, scan.volume.is_some()].into_iter().zip(&mut opened_s) {
                    if seen && *at <= 0.0 {
                        *at = start.elapsed().as_secs_f64();
                    }
                }
            }
            Output::Frame(frame) => break frame,
            Output::Failed(error) => return Err(error.to_string().into()),
            _ => {}
        }
    };
    let all = start.elapsed().as_secs_f64();
    // What was opened too soon to be shown before.
    opened_s.iter_mut().filter(|at| **at <= 0.0).for_each(|at| *at = all);
    let grid = told.get().cloned().ok_or("nothing was opened")?;
    let radius = RADIUS * grid.spacing().iter().product::<f64>().cbrt();
    for one in &first.figures.handles {
        service.ask(1, Request::Remove { handle: one.id });
    }
    service.ask(1, Request::Radius { handle: None, radius });
    let at = middle(&service, &outputs)?;
    let start = Instant::now();
    service.ask(1, Request::Grab { pane: Pane::Volume, at });
    next(&outputs, |frame| frame.figures.held.is_some())?;
    let placed_ms = 1e3 * start.elapsed().as_secs_f64();

    let (mut event_ms, mut divided, mut refused) = (Vec::with_capacity(count), [0; 4], 0);
    let (mut parts_ms, mut last) = ([0.0; 4], first.clone());
    let busy = ProcessTime::now();
    exec.observer().begin("frames", count as u64);
    for event in 1..=count {
        exec.check_cancelled()?;
        let t = std::f64::consts::TAU * (event as f64 / LOOP);
        let way = [(2.0 * t).sin() * 0.5, t.sin()].map(|c| FARTHEST * radius * c / first.figures.width_mm);
        // What was made whole meanwhile isn't the answer.
        while outputs.try_recv().is_ok() {}
        let start = Instant::now();
        service.ask(1, Request::Drag { to: [at[0] + way[0], at[1] + way[1]], lock: None });
        let frame = next(&outputs, |_| true)?;
        event_ms.push(1e3 * start.elapsed().as_secs_f64());
        divided[frame.pictures[0].coarser.clamp(1, divided.len()) - 1] += 1;
        refused += usize::from(frame.figures.refused.is_some());
        let [solve, map, warp] = frame.figures.times;
        for (sum, took) in parts_ms.iter_mut().zip([solve, map, warp, frame.figures.draw_s]) {
            *sum += 1e3 * took / count as f64;
        }
        last = frame;
        exec.observer().advance("frames", 1);
    }
    exec.observer().end("frames");
    let cpu_ms = 1e3 * busy.elapsed().as_secs_f64() / count as f64;
    let start = Instant::now();
    let (mut whole_ms, mut coarse_error) = (0.0, None);
    if last.pictures[0].coarser > 1 {
        let whole = next(&outputs, |frame| frame.pictures[0].coarser == 1)?;
        whole_ms = 1e3 * start.elapsed().as_secs_f64();
        coarse_error = Some(difference(&last.pictures[0].image, &whole.pictures[0].image));
    }
    Ok(FrameBench {
        input: source.file.as_ref().map_or_else(|| "the demo".to_owned(), |file| file.display().to_string()),
        dims: grid.dims(),
        vertices: first.figures.vertices,
        level: first.figures.level,
        threads: exec.threads(),
        load,
        pane: PANE,
        opened_s,
        placed_ms,
        picture_ms: [rank(&event_ms, 0.5), rank(&event_ms, 0.99), rank(&event_ms, 1.0)],
        event_ms,
        cpu_ms,
        parts_ms,
        whole_ms,
        divided,
        coarse_error,
        refused,
    })
}

/// The load of the last minute, where the system tells.
fn load() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split(' ').next()?.parse().ok()
}

/// The next frame for which something holds.
fn next(outputs: &Receiver<Output>, holds: impl Fn(&Frame) -> bool) -> Result<Arc<Frame>, Problem> {
    loop {
        match outputs.recv_timeout(NEVER)? {
            Output::Frame(frame) if holds(&frame) => return Ok(frame),
            Output::Failed(error) => return Err(error.to_string().into()),
            _ => {}
        }
    }
}

/// A place near the middle of the volume's picture where a handle can be put.
fn middle(service: &Service, outputs: &Receiver<Output>) -> Result<[f64; 2], Problem> {
    for step in 0..200_u32 {
        let turn = f64::from(step) * 2.4;
        let out = 0.03 * f64::from(step).sqrt();
        let at = [0.5 + out * turn.cos(), 0.5 + out * turn.sin()];
        service.ask(1, Request::Hover { pane: Pane::Volume, at });
        let frame = next(outputs, |_| true)?;
        let found = frame.figures.hovered.as_ref().and_then(|hovered| hovered.away_mm);
        if found.is_some_and(|away| away < NEAR) {
            return Ok(at);
        }
    }
    Err("nothing is seen near the lattice".into())
}

/// Root mean square and largest difference of a coarse picture from a whole one, each pixel held against the one that covers it.
fn difference(coarse: &Image, whole: &Image) -> [f64; 2] {
    let at = |image: &Image, x: usize, y: usize| -> [u8; 3] {
        let start = image.rgba().len() / (image.width() * image.height()) * (y * image.width() + x);
        std::array::from_fn(|c| image.rgba()[start + c])
    };
    let (mut squares, mut most) = (0.0, 0.0_f64);
    for y in 0..whole.height() {
        for x in 0..whole.width() {
            let [cx, cy] = [x * coarse.width() / whole.width(), y * coarse.height() / whole.height()];
            let (a, b) = (at(coarse, cx, cy), at(whole, x, y));
            let off = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(b))).fold(0.0, f64::max);
            (squares, most) = (squares + off * off, most.max(off));
        }
    }
    [(squares / (whole.width() * whole.height()) as f64).sqrt(), most]
}
