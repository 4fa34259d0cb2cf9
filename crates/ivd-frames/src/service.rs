//! The service that makes frames: one thread owns the model, follows requests and draws, newest first.
//!
//! Requests that come while it works are merged: of many moves the last counts. A solve runs to its end unless it is stopped by hand; what is drawn anew to be finer is given up when
//! something happens. While things move, the volume's picture is coarser, as much as its time asks for; soon after they stop it is whole.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ivd_core::{Cancel, Classified as _, ErrorClass, Exec, Image};

use crate::log::Lines;
use crate::model::Outlines;
use crate::opening::{Begun, Tell, Told};
use crate::preview::{Preview, Scan};
use crate::queue::{Client, Next, Queue};
use crate::save::File;
use crate::{Error, Figures, Model, Outline, Pane, Request, Saved, Sight};

/// After so long without a request the picture is made whole.
const SETTLED: Duration = Duration::from_millis(60);
/// A coarse picture that takes longer is made coarser, ...
const SLOW: Duration = Duration::from_millis(40);
/// ... or longer than what is left of this from what happened to what shows it, ...
const SOON: Duration = Duration::from_millis(62);
/// ... where that is no less than this; ...
const LEAST: Duration = Duration::from_millis(20);
/// ... and one that takes less, finer.
const QUICK: Duration = Duration::from_millis(12);
/// Requests are followed for so long at most before what has changed is drawn.
const UNSEEN: Duration = Duration::from_millis(100);
/// So many requests wait until something is opened.
const MOST_LATER: usize = 256;
/// What is said of those that don't.
pub const TOO_MUCH: &str = "too much at once: wait for what was asked before";
/// By how much the sides of a picture are divided at most.
const COARSEST: usize = 4;

/// A picture of a pane.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Of which.
    pub pane: Pane,
    /// Rises with every change of what the pane shows.
    pub version: u64,
    /// By how much its sides are divided: 1 for a whole one.
    pub coarser: usize,
    /// It.
    pub image: Image,
    png: OnceLock<Vec<u8>>,
}

impl Picture {
    /// A picture of a pane.
    pub fn new(pane: Pane, version: u64, coarser: usize, image: Image) -> Self {
        Self { pane, version, coarser, image, png: OnceLock::new() }
    }

    /// As the bytes of a PNG file, soon made rather than small; made once.
    ///
    /// # Errors
    /// A size that PNG files don't have.
    pub fn png(&self) -> Result<&[u8], Error> {
        if self.png.get().is_none() {
            let _ = self.png.set(ivd_pipeline::quick_png_bytes(&self.image)?);
        }
        Ok(self.png.get().map_or(&[], Vec::as_slice))
    }
}

/// All that a window shows at a time.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Rises with every frame.
    pub number: u64,
    /// Number of the last request that was followed before it ([`Service::asked`]).
    pub followed: u64,
    /// A picture for each of [`Pane::ALL`].
    pub pictures: [Arc<Picture>; 4],
    /// What is told beside them.
    pub figures: Figures,
    /// Where each slice cuts the surface that moves, where that is [asked for](Model::outline).
    pub outlines: [Outline; 3],
}

/// What the service gives.
#[derive(Debug, Clone)]
pub enum Output {
    /// Something to read while the subject is opened.
    Note(String),
    /// A stage begins, while the subject is opened.
    Stage(&'static str),
    /// The scan that is opened, until there are frames.
    Scan(Arc<Scan>),
    /// A frame.
    Frame(Arc<Frame>),
    /// A file that was asked for, or why there is none: one answer to each [`Request::Save`] that is taken, unless whoever asked is gone.
    File(Client, Result<Arc<File>, String>),
    /// Why a request was refused.
    Problem(Client, String),
    /// Why there will be no more frames.
    Failed(Arc<Error>),
}

/// What is followed: what stops it, and whose drag it is, where it is one.
#[derive(Debug, Default)]
struct Following {
    stop: Cancel,
    drags: Option<Client>,
}

/// A running service. Dropped, it ends.
pub struct Service {
    queue: Arc<Queue>,
    refining: Arc<Mutex<Cancel>>,
    following: Arc<Mutex<Following>>,
    thread: Option<JoinHandle<()>>,
}

impl Service {
    /// Starts a thread that makes frames of a model; `publish` is called with all that comes, on that thread.
    ///
    /// - `open`: makes the model, on a thread beside it, and tells what it does meanwhile.
    ///
    /// # Errors
    /// Where the system starts no thread.
    pub fn start<B: Into<Begun>>(
        open: impl FnOnce(&Tell) -> Result<B, Error> + Send + 'static,
        exec: Exec,
        publish: impl FnMut(Output) + Send + 'static,
    ) -> Result<Self, Error> {
        Self::start_seen(None, open, exec, publish)
    }

    /// [`Service::start`], with what is seen from the first picture on, however soon that comes.
    ///
    /// # Errors
    /// As for [`Service::start`]. A sight that can't be had there is told.
    pub fn start_seen<B: Into<Begun>>(
        sight: Option<Sight>,
        open: impl FnOnce(&Tell) -> Result<B, Error> + Send + 'static,
        exec: Exec,
        publish: impl FnMut(Output) + Send + 'static,
    ) -> Result<Self, Error> {
        let queue = Arc::new(Queue::default());
        let refining = Arc::new(Mutex::new(Cancel::default()));
        let following = Arc::new(Mutex::new(Following::default()));
        let worker = Worker {
            queue: queue.clone(),
            refining: refining.clone(),
            following: following.clone(),
            sight,
            exec,
            publish,
        };
        let thread = std::thread::Builder::new().name("frames".to_owned()).spawn(move || worker.run(open));
        let thread =
            thread.map_err(|e| Error::Io { what: "the thread that draws", problem: e.to_string() })?;
        Ok(Self { queue, refining, following, thread: Some(thread) })
    }

    /// Asks for something. Answers come to `publish`. Whether that is taken: not where too much waits already, but for what lets go of something.
    /// [`Request::Stop`] doesn't wait for its turn, and what a hand gives up isn't followed any further.
    pub fn ask(&self, client: Client, request: Request) -> bool {
        if request == Request::Stop {
            self.stop_following(|_| true);
            return true;
        }
        let gives_up = request == Request::Abandon;
        let taken = self.queue.push(client, request);
        if gives_up && self.queue.gives_up(client) {
            self.stop_following(|drags| drags == Some(client));
        }
        self.stop_refining();
        taken
    }

    /// Number of the request that was asked for last, from 1; those that were merged have one together.
    pub fn asked(&self) -> u64 {
        self.queue.pushed()
    }

    /// Lets go of all that somebody asked for and that wasn't begun.
    pub fn forget(&self, client: Client) {
        self.queue.forget(client);
    }

    /// Stops what is followed, where that is meant by whose drag it is.
    fn stop_following(&self, is_meant: impl Fn(Option<Client>) -> bool) {
        let following = self.following.lock().unwrap_or_else(PoisonError::into_inner);
        if is_meant(following.drags) {
            following.stop.cancel();
        }
    }

    fn stop_refining(&self) {
        self.refining.lock().unwrap_or_else(PoisonError::into_inner).cancel();
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.queue.end();
        self.stop_refining();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Worker<P> {
    queue: Arc<Queue>,
    refining: Arc<Mutex<Cancel>>,
    following: Arc<Mutex<Following>>,
    /// What is seen first.
    sight: Option<Sight>,
    exec: Exec,
    publish: P,
}

/// What waits until something is opened.
type Later = Vec<(Client, Request)>;

/// Lets a request wait, with the one before where that does the work of both. Whether it does: of too many the last are let go.
fn wait(later: &mut Later, client: Client, request: Request) -> bool {
    let merged = later.last_mut().is_some_and(|(who, last)| *who == client && last.merge(&request));
    let waits = merged || later.len() < MOST_LATER;
    if waits && !merged {
        later.push((client, request));
    }
    waits
}

/// Lets go of what waits to be taken hold of, and of nothing where nothing does.
fn let_go(client: Client, request: Request, later: &mut Later) {
    let holds = |(who, other): &(Client, Request)| {
        *who == client && matches!(other, Request::Grab { .. } | Request::Adjust)
    };
    match later.iter().rposition(holds) {
        None => {}
        Some(held) if request == Request::Abandon => {
            let rest = later.split_off(held);
            let stays = |(who, request): &(Client, Request)| {
                *who != client || matches!(request, Request::Save { .. })
            };
            later.extend(rest.into_iter().filter(stays));
        }
        Some(_) => _ = wait(later, client, request),
    }
}

/// How long the volume's coarse picture may take, after so long: where the rest takes longer than a picture could make up for, no less of it is drawn.
fn longest(before: Duration) -> Duration {
    let left = SOON.saturating_sub(before);
    if left < LEAST { SLOW } else { left.min(SLOW) }
}

/// What is drawn, and how well.
struct Drawn {
    pictures: [Arc<Picture>; 4],
    /// What the coarse ones are divided by.
    coarser: usize,
    /// Whether there is nothing finer to be drawn.
    settled: bool,
    number: u64,
    outlines: Outlines,
}

impl<P: FnMut(Output)> Worker<P> {
    fn run<B: Into<Begun>>(mut self, open: impl FnOnce(&Tell) -> Result<B, Error> + Send) {
        let worked = catch_unwind(AssertUnwindSafe(|| self.work(open)));
        let failed = match worked {
            Ok(Ok(())) => return,
            Ok(Err(error)) => error,
            // What went wrong was said by the panic itself.
            Err(_) => {
                Error::Io { what: "the thread that draws", problem: "it has ended by a fault of ivd".into() }
            }
        };
        (self.publish)(Output::Failed(Arc::new(failed)));
    }

    fn work<B: Into<Begun>>(
        &mut self,
        open: impl FnOnce(&Tell) -> Result<B, Error> + Send,
    ) -> Result<(), Error> {
        let Some((begun, later)) = self.open(open)? else { return Ok(()) };
        let Begun { mut model, entries, line: mut next } = begun;
        let log = Arc::new(Mutex::new(Lines::new()));
        let lines = log.clone();
        let mut write = move |line: &str| {
            if let Some(next) = &mut next {
                next(line);
            }
            lines.lock().unwrap_or_else(PoisonError::into_inner).push(line);
        };
        write(&model.log_head()?);
        model.session_mut().record(move |entry| write(&serde_json::to_string(entry).unwrap_or_default()));
        match model.replay(&entries) {
            Err(error) if error.error_class() == ErrorClass::Cancelled => return Err(error),
            Err(error) => (self.publish)(Output::Note(error.to_string())),
            Ok(()) => {}
        }
        let picture = |pane: Pane, coarser| {
            let (version, image) = (model.versions()[pane.number()], model.draw(pane, coarser, &self.exec)?);
            Ok::<_, Error>(Arc::new(Picture::new(pane, version, coarser, image)))
        };
        let [volume, axial, coronal, sagittal] = Pane::ALL;
        let pictures = [picture(volume, 2)?, picture(axial, 1)?, picture(coronal, 1)?, picture(sagittal, 1)?];
        let mut drawn =
            Drawn { pictures, coarser: 2, settled: false, number: 0, outlines: Outlines::default() };
        self.publish_frame(&mut model, &mut drawn, Duration::ZERO);
        if !later.is_empty() {
            for (client, request) in later {
                self.follow(client, &request, &mut model, &log)?;
            }
            self.draw_stale(&mut model, &mut drawn, Duration::ZERO)?;
        }
        loop {
            match self.queue.next((!drawn.settled).then_some(SETTLED)) {
                Next::End => return Ok(()),
                Next::Woken => {}
                Next::Nothing => self.refine(&mut model, &mut drawn)?,
                Next::Request(client, request) => {
                    let start = Instant::now();
                    self.follow(client, &request, &mut model, &log)?;
                    while start.elapsed() < UNSEEN {
                        let Next::Request(client, request) = self.queue.next(Some(Duration::ZERO)) else {
                            break;
                        };
                        self.follow(client, &request, &mut model, &log)?;
                    }
                    self.draw_stale(&mut model, &mut drawn, start.elapsed())?;
                }
            }
        }
    }

    /// Opens a model on a thread beside this one, and shows the slices of the scan meanwhile; `None` where the end comes first.
    fn open<B: Into<Begun>>(
        &mut self,
        open: impl FnOnce(&Tell) -> Result<B, Error> + Send,
    ) -> Result<Option<(Begun, Later)>, Error> {
        let tell = Tell::through(self.queue.clone());
        let (mut preview, mut later) = (None::<Preview>, Later::new());
        self.queue.opens(true);
        let opened = std::thread::scope(|scope| {
            let done = tell.done();
            let opening = || {
                let _done = done;
                open(&tell).map(Into::into)
            };
            let opener = std::thread::Builder::new().name("opening".to_owned()).spawn_scoped(scope, opening);
            let opener =
                opener.map_err(|e| Error::Io { what: "the thread that opens", problem: e.to_string() })?;
            let ended = self.meanwhile(&tell, &mut preview, &mut later)?;
            let begun: Result<Begun, Error> = opener.join().unwrap_or_else(|fault| resume_unwind(fault));
            Ok::<_, Error>(if ended { None } else { Some(begun?) })
        })?;
        let gone = self.queue.opens(false);
        later.retain(|(client, _)| !gone.contains(client));
        let Some(mut begun) = opened else { return Ok(None) };
        if let Some(preview) = preview {
            preview.hand_over(&mut begun.model)?;
        } else if let Some(sight) = self.sight {
            begun.model.follow(&Request::Show { sight }).or_else(|error| self.told(error))?;
        }
        Ok(Some((begun, later)))
    }

    /// Shows slices, and the volume at rest, until it is opened; whether the end came first. What they can't follow waits.
    fn meanwhile(
        &mut self,
        tell: &Tell,
        preview: &mut Option<Preview>,
        later: &mut Later,
    ) -> Result<bool, Error> {
        let mut shown: Option<Arc<Scan>> = None;
        loop {
            let finer = preview.as_ref().is_some_and(|preview| preview.could_be_finer(shown.as_deref()));
            let mut fine = false;
            match self.queue.next(finer.then_some(SETTLED)) {
                Next::End => return Ok(true),
                Next::Woken => {}
                Next::Nothing => fine = true,
                Next::Request(client, request) => self.follow_or_wait(client, request, preview, later),
            }
            let mut sees_more = false;
            while let Some(told) = tell.next() {
                match told {
                    Told::Done => return Ok(false),
                    Told::Stage(name) => (self.publish)(Output::Stage(name)),
                    Told::Note(text) => (self.publish)(Output::Note(text)),
                    Told::Scan(scan) => {
                        let (volume, said) = *scan;
                        let made = preview.insert(Preview::new(volume, &said, &self.exec));
                        if let Some(sight) = self.sight {
                            made.follow(&Request::Show { sight }).or_else(|error| self.told(error))?;
                        }
                        sees_more = true;
                    }
                    Told::AtRest(seen) => {
                        if let Some(Err(error)) = preview.as_mut().map(|preview| preview.show_volume(*seen)) {
                            self.told(error)?;
                        }
                        sees_more = true;
                    }
                }
            }
            if sees_more {
                for (client, request) in std::mem::take(later) {
                    self.follow_or_wait(client, request, preview, later);
                }
            }
            let Some(preview) = preview else { continue };
            match preview.scan(shown.as_deref(), fine) {
                Ok(scan) => {
                    let scan = Arc::new(scan);
                    shown = Some(scan.clone());
                    (self.publish)(Output::Scan(scan));
                }
                Err(error) => {
                    self.told(error)?;
                    preview.hide_volume();
                }
            }
        }
    }

    /// Follows a request before there is a model, or lets it wait.
    fn follow_or_wait(
        &mut self,
        client: Client,
        request: Request,
        preview: &mut Option<Preview>,
        later: &mut Later,
    ) {
        if matches!(request, Request::Drop | Request::Abandon) {
            return let_go(client, request, later);
        }
        let waits = later.iter().any(|(_, other)| request.is_behind(other));
        match preview {
            Some(preview) if !waits && preview.can_follow(&request) => {
                if let Err(error) = preview.follow(&request) {
                    (self.publish)(Output::Problem(client, error.to_string()));
                }
            }
            // Where a pointer once was is nothing to come back to.
            _ if matches!(request, Request::Hover { .. }) => {}
            _ => {
                let saves = matches!(request, Request::Save { .. });
                if !wait(later, client, request) && saves {
                    (self.publish)(Output::File(client, Err(TOO_MUCH.to_owned())));
                }
            }
        }
    }

    /// Follows a request.
    fn follow(
        &mut self,
        client: Client,
        request: &Request,
        model: &mut Model,
        log: &Mutex<Lines>,
    ) -> Result<(), Error> {
        if let Request::Save { what } = request {
            let file = match self.save(*what, model, log) {
                Err(error) if error.error_class() == ErrorClass::Cancelled => return Err(error),
                made => made.map(Arc::new).map_err(|error| error.to_string()),
            };
            (self.publish)(Output::File(client, file));
            return Ok(());
        }
        let stop = Cancel::default();
        let drags = matches!(request, Request::Grab { .. } | Request::Drag { .. }).then_some(client);
        *self.following.lock().unwrap_or_else(PoisonError::into_inner) =
            Following { stop: stop.clone(), drags };
        // It may have been given up since it was taken from what waits.
        if drags.is_some() && self.queue.gives_up(client) {
            stop.cancel();
        }
        model.stops_by(stop);
        match model.follow(request) {
            Err(error) if error.error_class() == ErrorClass::Cancelled => return Err(error),
            Err(error) => (self.publish)(Output::Problem(client, error.to_string())),
            Ok(()) => {}
        }
        Ok(())
    }

    /// Makes a file.
    fn save(&self, what: Saved, model: &mut Model, log: &Mutex<Lines>) -> Result<File, Error> {
        let lines = if what == Saved::Log {
            log.lock().unwrap_or_else(PoisonError::into_inner).text()?
        } else {
            String::new()
        };
        let file = model.save(what, lines, &self.exec)?;
        if what == Saved::Scene {
            model.keep();
        }
        Ok(file)
    }

    /// A picture that can't be drawn is told; the one before stays. What the user interrupts ends.
    fn told(&mut self, error: Error) -> Result<(), Error> {
        if error.error_class() == ErrorClass::Cancelled {
            return Err(error);
        }
        (self.publish)(Output::Note(format!("no picture: {error}")));
        Ok(())
    }

    /// Draws what has changed, the volume coarsely. `before`: since what happened was begun to be followed.
    fn draw_stale(&mut self, model: &mut Model, drawn: &mut Drawn, before: Duration) -> Result<(), Error> {
        let mut took = Duration::ZERO;
        for pane in Pane::ALL {
            let version = model.versions()[pane.number()];
            if drawn.pictures[pane.number()].version == version {
                continue;
            }
            let coarser = if pane == Pane::Volume { drawn.coarser } else { 1 };
            let start = Instant::now();
            let image = match model.draw(pane, coarser, &self.exec) {
                Ok(image) => image,
                Err(error) => {
                    self.told(error)?;
                    continue;
                }
            };
            drawn.pictures[pane.number()] = Arc::new(Picture::new(pane, version, coarser, image));
            took += start.elapsed();
            if pane == Pane::Volume {
                drawn.settled = coarser == 1;
                drawn.coarser = match start.elapsed() {
                    slow if slow > longest(before) => (coarser + 1).min(COARSEST),
                    quick if quick < QUICK => (coarser - 1).max(1),
                    _ => coarser,
                };
            }
        }
        self.publish_frame(model, drawn, took);
        Ok(())
    }

    /// Draws the volume whole, unless something comes.
    fn refine(&mut self, model: &mut Model, drawn: &mut Drawn) -> Result<(), Error> {
        let cancel = Cancel::default();
        self.refining.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&cancel);
        // What came before that could not stop it.
        if !self.queue.is_empty() {
            return Ok(());
        }
        let mut exec = self.exec.clone();
        exec.cancel = cancel;
        let (start, version) = (Instant::now(), model.versions()[0]);
        match model.draw(Pane::Volume, 1, &exec) {
            Ok(image) => {
                drawn.pictures[0] = Arc::new(Picture::new(Pane::Volume, version, 1, image));
                drawn.settled = true;
                self.publish_frame(model, drawn, start.elapsed());
                Ok(())
            }
            Err(error) if error.error_class() == ErrorClass::Cancelled => {
                // By a request, which waits; or by whoever stops everything.
                self.exec.check_cancelled().map_err(Error::from)
            }
            Err(error) => {
                drawn.settled = true;
                self.told(error)
            }
        }
    }

    fn publish_frame(&mut self, model: &mut Model, drawn: &mut Drawn, took: Duration) {
        drawn.number += 1;
        let figures = Figures { draw_s: took.as_secs_f64(), ..model.figures() };
        let (number, followed) = (drawn.number, self.queue.left());
        let outlines = drawn.outlines.update(model);
        let frame = Frame { number, followed, pictures: drawn.pictures.clone(), figures, outlines };
        (self.publish)(Output::Frame(Arc::new(frame)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_takes_what_is_left_of_the_time_where_that_is_enough_to_be_in_it() {
        let of = |before| longest(Duration::from_millis(before)).as_millis();
        assert_eq!([0, 10, 22, 30, 42, 43, 500].map(of), [40, 40, 40, 32, 20, 40, 40]);
    }
}
