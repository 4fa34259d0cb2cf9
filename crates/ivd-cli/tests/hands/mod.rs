//! Hands in a window, and the program as another process: it makes the same bytes of the scene that they keep.
#![allow(clippy::unwrap_used, reason = "a test ends where something is missing")]

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use ivd_frames::{Request, Saved};

use common::{BALL, Draw};
use hands::Hands;
use verbs::{BONED, Coverage, OPENED, VERBS, every, requests, verbs as verbs_of};

#[path = "../../../ivd-frames/tests/frames/common.rs"]
mod common;
#[path = "../../../ivd-frames/tests/frames/hands.rs"]
#[allow(clippy::module_inception, reason = "the hands themselves")]
mod hands;
#[path = "../../../ivd-frames/tests/frames/verbs.rs"]
mod verbs;

/// Times that another file is opened while a frame of the one before is made.
const OPENED_ANEW: usize = 20;

/// What the program makes of a scene, nothing of it known before.
fn piped(scene: &Path, out: &Path) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_ivd"));
    let done =
        program.arg("pipeline").arg(scene).arg("--out").arg(out).args(["--cache", "off", "-q"]).output();
    let done = done.unwrap();
    let told = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{told}{}", std::fs::read_to_string(scene).unwrap());
}

/// What is kept of these hands is what the program makes of their scene; whether something is deformed.
fn assert_as_piped(hands: &Hands) -> bool {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (hands.kept(Saved::Scene), folder.path().join("out"));
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, &scene.bytes).unwrap();
    piped(&file, &out);
    let deformed = out.join(Saved::Displacement.name());
    if !deformed.exists() {
        let told = hands.frame().unwrap();
        assert_eq!(told.figures.largest_mm, 0.0, "the scene moves nothing");
        return false;
    }
    for what in [Saved::Displacement, Saved::Volume] {
        let (mine, theirs) = (hands.kept(what), std::fs::read(out.join(what.name())).unwrap());
        let hash = |bytes: &[u8]| blake3::hash(bytes);
        let text = String::from_utf8_lossy(&scene.bytes);
        assert_eq!(hash(&mine.bytes), hash(&theirs), "{what:?} of\n{text}");
    }
    true
}

#[test]
fn scripts_through_a_service_that_is_held_up_end_where_another_process_does() {
    let (mut draw, mut coverage) = (Draw(23), Coverage::default());
    let scripts = (200 / every(40)).max(1);
    let (mut deformed, mut anew) = (0, 0);
    for script in 0..scripts {
        let scene = format!("{BALL}{}", ["", BONED, OPENED][script % 3]);
        let held_up = Duration::from_millis(3);
        let mut hands = Hands::at_work(&scene, script as u64, held_up);
        // Another is opened while frames of the one before are made.
        for _ in 0..OPENED_ANEW.div_ceil(scripts) {
            for verb in ["orbit", "drag", "wheel"] {
                for request in requests(verb, &mut draw) {
                    hands.ask(&request);
                }
            }
            hands = Hands::at_work(&scene, draw.below(1 << 20) as u64, held_up);
            anew += 1;
        }
        let verbs = verbs_of(&VERBS, script, scripts);
        coverage.take(&verbs);
        for verb in verbs {
            for request in requests(verb, &mut draw) {
                hands.ask(&request);
                if draw.below(4) == 0 {
                    std::thread::sleep(held_up.mul_f64(draw.unit()));
                }
            }
        }
        deformed += usize::from(assert_as_piped(&hands));
        // Nothing is left of what is undone.
        let before = Hands::at_work(&scene, 0, Duration::ZERO).kept(Saved::Volume);
        hands.undo_all();
        assert!(hands.kept(Saved::Volume).bytes == before.bytes, "undone, it is as it was");
    }
    coverage.assert_all(&VERBS);
    assert!(anew >= OPENED_ANEW && deformed * 2 > scripts, "{anew} anew, {deformed} of {scripts} deformed");
}

impl Hands {
    /// Takes all back that was done.
    fn undo_all(&self) {
        loop {
            self.kept(Saved::Scene);
            let steps = self.frame().and_then(|frame| frame.figures.undo.clone());
            if steps.is_none() {
                return;
            }
            (0..40).for_each(|_| self.ask(&Request::Undo));
        }
    }
}
