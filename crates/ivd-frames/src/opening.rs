//! What is shown while a subject is opened: the slices of the scan as soon as it is read.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use ivd_core::{Image, Volume, VoxelCoord};
use ivd_session::Entry;

use crate::colours::Window;
use crate::figures::{Hovered, Slice};
use crate::planes::{Planes, value_at};
use crate::queue::Queue;
use crate::{Error, Model, Pane, Picture, Request};

/// Tells a window what goes on while something is opened. The default tells nobody.
#[derive(Clone, Default)]
pub struct Tell(Option<(Arc<Waiting>, Arc<Queue>)>);

/// What was told and nobody has heard yet.
type Waiting = Mutex<VecDeque<Told>>;

/// Something that was told.
pub(crate) enum Told {
    Stage(&'static str),
    Note(String),
    Scan(Box<Volume>),
    /// There will be no more.
    Done,
}

impl Tell {
    pub(crate) fn through(queue: Arc<Queue>) -> Self {
        Self(Some((Arc::default(), queue)))
    }

    /// A stage begins.
    pub fn stage(&self, name: &'static str) {
        self.push(Told::Stage(name));
    }

    /// Something to read.
    pub fn note(&self, text: String) {
        self.push(Told::Note(text));
    }

    /// The scan is read.
    pub fn scan(&self, volume: &Volume) {
        self.push(Told::Scan(Box::new(volume.clone())));
    }

    fn push(&self, told: Told) {
        let Some((waiting, queue)) = &self.0 else { return };
        waiting.lock().unwrap_or_else(PoisonError::into_inner).push_back(told);
        queue.wake();
    }

    pub(crate) fn next(&self) -> Option<Told> {
        let (waiting, _) = self.0.as_ref()?;
        waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    /// Says that all is told as soon as it is dropped, whatever the reason.
    pub(crate) fn done(&self) -> Done {
        Done(self.clone())
    }
}

pub(crate) struct Done(Tell);

impl Drop for Done {
    fn drop(&mut self) {
        self.0.push(Told::Done);
    }
}

/// A line of the log, without its end, as it is written.
pub type Line = Box<dyn FnMut(&str) + Send + Sync>;

/// A model, and how it goes on.
pub struct Begun {
    /// It.
    pub model: Model,
    /// What is done again first.
    pub entries: Vec<Entry>,
    /// Is given every line of the log.
    pub line: Option<Line>,
}

impl From<Model> for Begun {
    fn from(model: Model) -> Self {
        Self { model, entries: Vec::new(), line: None }
    }
}

/// A scan that is opened: its slices.
#[derive(Debug, Clone)]
pub struct Scan {
    /// A picture for each slice, in the order of [`Pane::ALL`].
    pub pictures: [Arc<Picture>; 3],
    /// What is told of them.
    pub slices: [Slice; 3],
    /// Where they meet (mm, RAS).
    pub cross: [f64; 3],
    /// The value there.
    pub cross_value: Option<f64>,
    /// Where the panes show it.
    pub cross_at: [Option<[f64; 2]>; 4],
    /// What lies under the pointer.
    pub hovered: Option<Hovered>,
    /// Values that are black and white.
    pub window: [f64; 2],
}

/// The slices of a scan that is opened, as hands move them.
pub(crate) struct Slices {
    volume: Volume,
    pub(crate) planes: Planes,
    pub(crate) window: Window,
    first: Window,
    hovered: Option<Hovered>,
    versions: [u64; 3],
}

impl Slices {
    pub(crate) fn new(volume: Volume) -> Self {
        let window = Window::of(&volume);
        let planes = Planes::new(volume.grid());
        Self { volume, planes, window, first: window, hovered: None, versions: [1; 3] }
    }

    /// Whether slices alone can follow it.
    pub(crate) fn can_follow(request: &Request) -> bool {
        let of_slices = |pane: &Pane| *pane != Pane::Volume;
        match request {
            Request::Slice { pane, .. } | Request::Cross { pane, .. } | Request::Hover { pane, .. } => {
                of_slices(pane)
            }
            Request::Window { .. } | Request::ResetColours => true,
            _ => false,
        }
    }

    /// Follows what slices alone can follow.
    pub(crate) fn follow(&mut self, request: &Request) -> Result<(), Error> {
        request.check()?;
        let grid = self.volume.grid();
        match request {
            Request::Slice { pane, steps } => {
                self.planes.step(*pane, *steps, grid.dims())?;
                self.touch(&[*pane]);
            }
            Request::Cross { pane, at } => {
                if let Some(place) = self.planes.look(*pane, *at, grid) {
                    let moved = self.planes.meet(place, grid);
                    self.touch(&moved);
                }
            }
            Request::Window { by } => {
                self.window = self.window.dragged(*by, 1e-6 * (self.first.high - self.first.low));
                self.touch(&Pane::ALL[1..]);
            }
            Request::ResetColours => {
                self.window = self.first;
                self.touch(&Pane::ALL[1..]);
            }
            Request::Hover { pane, at } => {
                let place = self.planes.look(*pane, *at, grid);
                self.hovered = place.map(|place| Hovered {
                    pane: *pane,
                    place,
                    rest: place,
                    value: value_at(&self.volume, place),
                    handle: None,
                    vertex: None,
                    vertex_at: [None; 4],
                    away_mm: None,
                    at: self.shares(place),
                });
            }
            _ => {}
        }
        Ok(())
    }

    fn touch(&mut self, panes: &[Pane]) {
        for number in panes.iter().filter_map(|pane| pane.number().checked_sub(1)) {
            self.versions[number] += 1;
        }
    }

    fn shares(&self, place: [f64; 3]) -> [Option<[f64; 2]>; 4] {
        Pane::ALL.map(|pane| self.planes.share(pane, self.volume.grid(), place))
    }

    /// What they show; of the pictures before those that are still right.
    pub(crate) fn scan(&self, before: Option<&Scan>) -> Result<Scan, Error> {
        let picture = |number: usize| {
            let (pane, version) = (Pane::ALL[number + 1], self.versions[number]);
            let same = before.map(|before| &before.pictures[number]);
            if let Some(same) = same.filter(|picture| picture.version == version) {
                return Ok(same.clone());
            }
            let image = match self.planes.plane(pane) {
                Some(plane) => self.planes.draw(plane, &self.volume, self.window, |_, grey| [grey; 3])?,
                None => Image::new(1, 1, vec![0; 4])?,
            };
            Ok::<_, Error>(Arc::new(Picture::new(pane, version, 1, image)))
        };
        let grid = self.volume.grid();
        let cross: [f64; 3] = grid.world(VoxelCoord(self.planes.cross.into())).0.into();
        Ok(Scan {
            pictures: [picture(0)?, picture(1)?, picture(2)?],
            slices: self.planes.told(grid),
            cross,
            cross_value: value_at(&self.volume, cross),
            cross_at: self.shares(cross),
            hovered: self.hovered.clone(),
            window: [self.window.low, self.window.high],
        })
    }
}
