//! What windows read and are asked: logs, and requests.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ivd_artefact::Cache;
use ivd_core::{Exec, Lattice, Volume};
use ivd_frames::{Log, Model, Pane, Request, Saved, Subject, Tell};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_pipeline::scene::{self, Loaded};
use ivd_session::{Entry, Session, Settings};

use crate::{exec, stages};

/// Lines that are followed of one input, and how long at most.
const LINES: usize = 24;
const TIME: Duration = Duration::from_secs(3);
/// What requests are asked of.
const BALL: &str = "schema = 1\n[input]\nphantom = \"sphere\"\nsize = 16\n[lattice]\niso = 127.5\n[refine]\nlevel = 0\n\
    [render]\nmode = \"iso\"\niso = 127.5\n[output]\nimages = [\"before\"]\n";

fn in_time() -> Exec {
    exec().clone().with_deadline(Instant::now() + TIME)
}

/// What a volume holds, to the bit: the ball has a voxel that is no number, and equals nothing.
fn bytes_of(volume: &Volume) -> &[u8] {
    volume.voxels().as_bytes()
}

/// Reads a log and does again what it says, of a ball: what can't be done changes nothing, what was done is undone without a trace, and what is recorded meanwhile gives the
/// same voxels.
pub fn log(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(log) = text.parse::<Log>() else { return };
    let _ = scene::parse(&log.scene, &[]);
    let exec = in_time();
    let ball = stages::ball();
    let cut = ExtractParams { iso: Iso::Value(50.0) };
    let lattice = extract(&ball, None, &cut, &exec).expect("a ball has a surface").lattice;
    let begun = |volume: &Volume, lattice: &Lattice| {
        Session::new(volume.clone(), lattice.clone(), None, Settings::default(), &exec)
            .expect("nothing is moved")
    };
    let mut session = begun(&ball, &lattice);
    let recorded = Arc::new(Mutex::new(Vec::<Entry>::new()));
    let lines = recorded.clone();
    session.record(move |entry| lines.lock().unwrap_or_else(PoisonError::into_inner).push(entry.clone()));
    for entry in log.entries.into_iter().take(LINES) {
        let (settings, voxels) = (session.settings().clone(), session.deformed().clone());
        if session.replay(entry, &exec).is_err() {
            assert!(
                *session.settings() == settings && bytes_of(session.deformed()) == bytes_of(&voxels),
                "a refusal changes nothing"
            );
        }
    }
    let recorded = recorded.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let mut again = begun(&ball, &lattice);
    // As lines of a file.
    let written = recorded.iter().map(|entry| serde_json::to_string(entry).expect("JSON"));
    let read =
        written.map(|line| serde_json::from_str::<Entry>(&line).expect("what was written can be read"));
    if read.map(|entry| again.replay(entry, &exec)).all(|done| done.is_ok()) {
        assert!(bytes_of(again.deformed()) == bytes_of(session.deformed()), "a log gives the same voxels");
    } else {
        assert!(exec.cancel.is_late(), "what was done can be done again");
    }
    while let Ok(Some(_)) = session.undo(&exec) {}
    if !exec.cancel.is_late() {
        assert!(bytes_of(session.deformed()) == bytes_of(session.rest()), "undone is undone");
    }
}

/// Follows requests, a line of JSON each, draws what has changed, and saves the scene, which can be read.
pub fn requests(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let asked: Vec<Request> =
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).take(LINES).collect();
    if asked.is_empty() {
        return;
    }
    let exec = in_time();
    let scene = scene::parse(BALL, &[]).expect("a scene");
    let loaded = Loaded { scene, folder: PathBuf::new(), file: PathBuf::from("scene.toml") };
    let subject = Subject::open(&loaded, false, &Cache::disabled(), &exec, &Tell::default()).expect("a ball");
    let mut model = Model::new(subject, [32, 32], exec.clone()).expect("a picture of it");
    for request in &asked {
        // A picture of 2048² pixels is no fault, but takes the fuzzer too long.
        if matches!(request, Request::Resize { size } if size.iter().any(|n| *n > 128)) {
            let _ = request.check();
            continue;
        }
        let _ = model.follow(request);
        let _ = serde_json::to_string(&model.figures()).expect("figures are JSON");
    }
    for pane in Pane::ALL {
        if let Err(error) = model.draw(pane, 2, &exec) {
            assert!(exec.cancel.is_late(), "{error}");
        }
    }
    match model.save(Saved::Scene, String::new(), &exec) {
        Ok(file) => {
            let text = String::from_utf8(file.bytes).expect("text");
            scene::parse(&text, &[]).unwrap_or_else(|problem| panic!("{problem}: {text}"));
        }
        Err(error) => assert!(exec.cancel.is_late(), "{error}"),
    }
}
