//! Drags the outermost vertex of a surface through a closed loop and says what a frame takes: `measure drag VOLUME ISO LEVEL [THREADS]`.
//!
//! The radius is 25 voxels, the way an eighth of it at most, as in `ivd bench interactive`; here one drag alone can be profiled.

use std::time::Instant;

use ivd_core::{Exec, Lattice};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_session::{Event, Session, Settings};

use crate::anything::Anything;

pub(crate) const USAGE: &str = "VOLUME ISO LEVEL [THREADS]";

const FRAMES: usize = 200;

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let (path, iso, level, threads) = match words {
        [path, iso, level] => (path, iso, level, 1),
        [path, iso, level, threads] => (path, iso, level, threads.parse()?),
        _ => return Err(USAGE.into()),
    };
    let exec = Exec::default().with_threads(threads);
    let volume = ivd_io::volume::read(path.as_ref(), &ivd_io::volume::ReadOptions::default(), &exec)?;
    let radius = 25.0 * volume.grid().spacing().iter().product::<f64>().cbrt();
    let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(iso.parse()?) }, &exec)?.lattice;
    let at = Anchor::NearestTo(outermost(&lattice));
    let settings = Settings { level: level.parse()?, ..Settings::default() };
    let mut session = Session::new(volume, lattice, None, settings, &exec)?;
    let handle = Handle { at, action: Action::Move([0.0; 3]), radius };
    session.apply(Event::Add { id: None, handle }, &exec)?;
    let mut times = Vec::new();
    for frame in 1..=FRAMES {
        let t = std::f64::consts::TAU * (frame as f64 / FRAMES as f64);
        let by =
            [0.5 * (2.0 * t).sin(), t.sin(), 0.3 * (3.0 * t).cos() * t.cos()].map(|c| 0.125 * radius * c);
        let start = Instant::now();
        let update = session.apply(Event::Move { handle: 0, by }, &exec)?;
        let ms = 1e3 * start.elapsed().as_secs_f64();
        if frame < 4 || frame % 20 == 0 {
            println!(
                "frame {frame}: {ms:.1} ms, {} voxels in {} bricks, {} relaxations",
                update.voxels,
                update.dirty.len(),
                update.relaxations
            );
        }
        times.push(ms);
    }
    times.sort_by(f64::total_cmp);
    println!("{:.1} ms in the middle, {:.1} at 99 %, {:.1} at most", times[99], times[197], times[199]);
    Ok(())
}

/// The vertex furthest along y of those within a tenth of the surface's size of its middle in x and z (mm).
fn outermost(lattice: &Lattice) -> [f64; 3] {
    let places = lattice.positions();
    let bound =
        |axis: usize, pick: fn(f64, f64) -> f64| places.iter().map(|p| p[axis]).reduce(pick).unwrap_or(0.0);
    let ends: [[f64; 2]; 3] = std::array::from_fn(|a| [bound(a, f64::min), bound(a, f64::max)]);
    let near = 0.1 * ends.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let off = |p: &[f64; 3], a: usize| (p[a] - f64::midpoint(ends[a][0], ends[a][1])).abs();
    let all = places.iter().map(|p| [p[0], p[1], p[2]]);
    let central = all.filter(|p| off(p, 0).max(off(p, 2)) <= near);
    central.max_by(|a, b| a[1].total_cmp(&b[1])).unwrap_or_default()
}
