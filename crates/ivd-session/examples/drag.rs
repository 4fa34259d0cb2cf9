//! Drags a handle over a volume, a hundred frames: `drag VOLUME ISO LEVEL X Y Z RADIUS`, lengths in mm.

use std::time::Instant;

use ivd_core::Exec;
use ivd_deform::spring::{Action, Handle, HandleAt};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_session::{Event, Session, Settings};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [path, iso, level, x, y, z, radius] = &words[..] else {
        return Err("usage: drag VOLUME ISO LEVEL X Y Z RADIUS".into());
    };
    let exec = Exec::default();
    let volume = ivd_volume::read(path.as_ref(), &ivd_volume::ReadOptions::default(), &exec)?;
    let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(iso.parse()?) }, &exec)?.lattice;
    let settings = Settings { level: level.parse()?, ..Settings::default() };
    let mut session = Session::new(volume, lattice, None, settings, &exec)?;
    let (at, radius) = ([x.parse()?, y.parse()?, z.parse()?], radius.parse::<f64>()?);
    session.apply(
        Event::Add(Handle { at: HandleAt::Pick(at), action: Action::Move([0.0; 3]), radius }),
        &exec,
    )?;
    for frame in 0..100 {
        let t = std::f64::consts::TAU * f64::from(frame) / 100.0;
        let by = [0.5 * (2.0 * t).sin(), t.sin(), 0.3 * t.sin()].map(|c| 0.125 * radius * c);
        let start = Instant::now();
        let update = session.apply(Event::Move { handle: 0, by }, &exec)?;
        if frame % 10 == 5 {
            let ms = 1e3 * start.elapsed().as_secs_f64();
            println!("frame {frame}: {ms:.1} ms, {} voxels in {} bricks", update.voxels, update.dirty.len());
        }
    }
    println!("{} events; the last is {:?}", session.events().count(), session.events().last());
    Ok(())
}
