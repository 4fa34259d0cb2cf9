//! Hands at a service whose worker is held up by chance. Tests of the program have them, too.

use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use ivd_core::Exec;
use ivd_frames::{File, Frame, Output, Request, Saved, Service};

use super::common::{Draw, model};

/// What the service said last.
#[derive(Default)]
struct Said {
    frame: Option<Arc<Frame>>,
    file: Option<Arc<File>>,
    failed: Option<String>,
}

/// Hands at a service.
pub(crate) struct Hands {
    service: Service,
    said: Arc<(Mutex<Said>, Condvar)>,
}

impl Hands {
    /// At a scene; the worker is held up for up to so long at every third thing that it says.
    pub(crate) fn at_work(scene: &str, seed: u64, held_up: Duration) -> Self {
        let said = Arc::<(Mutex<Said>, Condvar)>::default();
        let (there, mut draw) = (said.clone(), Draw(seed));
        let publish = move |output| {
            if draw.below(3) == 0 {
                std::thread::sleep(held_up.mul_f64(draw.unit()));
            }
            let mut said = there.0.lock().unwrap();
            match output {
                Output::Frame(frame) => said.frame = Some(frame),
                Output::File(_, file) => said.file = Some(file.unwrap()),
                Output::Failed(error) => said.failed = Some(error.to_string()),
                _ => {}
            }
            there.1.notify_all();
        };
        let scene = scene.to_owned();
        let service = Service::start(move |_| Ok(model(&scene)), Exec::default(), publish).unwrap();
        Self { service, said }
    }

    /// Asks until there is room.
    pub(crate) fn ask(&self, request: &Request) {
        while !self.service.ask(1, request.clone()) {
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// What was kept of a kind, after all that was asked before.
    pub(crate) fn kept(&self, what: Saved) -> Arc<File> {
        self.said.0.lock().unwrap().file = None;
        self.ask(&Request::Save { what });
        let (said, changed) = &*self.said;
        let waits = |said: &mut Said| said.file.is_none() && said.failed.is_none();
        let (said, late) =
            changed.wait_timeout_while(said.lock().unwrap(), Duration::from_mins(2), waits).unwrap();
        assert!(!late.timed_out(), "nothing is kept in two minutes");
        assert_eq!(said.failed, None);
        said.file.clone().unwrap()
    }

    /// The newest frame.
    pub(crate) fn frame(&self) -> Option<Arc<Frame>> {
        self.said.0.lock().unwrap().frame.clone()
    }
}
