//! What is shown until a subject is opened: the slices of its scan as soon as that is read, and the volume at rest as soon as its colours are known.

use std::sync::Arc;

use ivd_core::{Exec, Labels, NoObserver, TransferFunction, Volume, VoxelCoord};
use ivd_pipeline::scene::WindowSection;
use ivd_render::{Lens, RenderParams};

use crate::colours::Window;
use crate::figures::{Hovered, Slice, letters, value_at};
use crate::panes::{Panes, Seen};
use crate::planes::Planes;
use crate::{Error, Model, Pane, Picture, Request, Sight};

/// Pixels of the volume's pane until somebody says how large it is.
const SIZE: [usize; 2] = [512; 2];
/// By how much the sides of the volume's picture are divided while hands turn it.
const COARSE: usize = 2;

/// A scan that is opened.
#[derive(Debug, Clone)]
pub struct Scan {
    /// A picture for each slice, in the order of [`Pane::ALL`].
    pub pictures: [Arc<Picture>; 3],
    /// The volume at rest, once its colours are known.
    pub volume: Option<VolumeAtRest>,
    /// What is told of the slices.
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

impl Scan {
    /// All that there are.
    pub fn all_pictures(&self) -> impl Iterator<Item = &Picture> {
        let volume = self.volume.iter().map(|volume| &volume.picture);
        self.pictures.iter().chain(volume).map(Arc::as_ref)
    }
}

/// What is shown of a volume that can't be moved yet.
#[derive(Debug, Clone)]
pub struct VolumeAtRest {
    /// Its picture.
    pub picture: Arc<Picture>,
    /// Of its pane (pixels).
    pub size: [usize; 2],
    /// Azimuth and elevation (degrees).
    pub angles: [f64; 2],
    /// What its pane is wide, where the camera looks (mm).
    pub width_mm: f64,
    /// What lies to the left, right, top and bottom.
    pub letters: Option<[&'static str; 4]>,
}

/// What a volume is drawn by before it can be moved.
pub(crate) struct AtRest {
    pub(crate) volume: Volume,
    pub(crate) transfer: Option<TransferFunction>,
    /// See [`Seen::labels`].
    pub(crate) labels: Option<Labels>,
    /// See [`Seen::unlabelled`].
    pub(crate) unlabelled: bool,
    pub(crate) picture: RenderParams,
}

impl AtRest {
    pub(crate) fn of(seen: Seen<'_>, picture: &RenderParams) -> Self {
        let Seen { volume, transfer, labels, unlabelled } = seen;
        Self {
            volume: volume.clone(),
            transfer: transfer.cloned(),
            labels: labels.cloned(),
            unlabelled,
            picture: picture.clone(),
        }
    }

    fn seen(&self) -> Seen<'_> {
        Seen {
            volume: &self.volume,
            transfer: self.transfer.as_ref(),
            labels: self.labels.as_ref(),
            unlabelled: self.unlabelled,
        }
    }
}

/// A volume at rest, as hands turn it.
struct Turned {
    at_rest: AtRest,
    panes: Panes,
    lens: Lens,
    version: u64,
}

/// The slices of a scan that is opened, and its volume once that can be drawn, as hands move them.
pub(crate) struct Preview {
    volume: Volume,
    planes: Planes,
    window: Window,
    first: Window,
    hovered: Option<Hovered>,
    versions: [u64; 3],
    /// Of the volume's pane, where somebody has said it.
    size: Option<[usize; 2]>,
    /// What is to be seen, where somebody has said it.
    sight: Option<Sight>,
    turned: Option<Turned>,
    /// Whether its scene says how the volume's colours are shifted.
    says_colours: bool,
    exec: Exec,
}

impl Preview {
    pub(crate) fn new(volume: Volume, said: &WindowSection, exec: &Exec) -> Self {
        let first = Window::of(&volume);
        let mut planes = Planes::new(volume.grid());
        if let Some(cross) = said.cross {
            planes.meet(cross, volume.grid());
        }
        // On threads of its own: those of what is opened are busy with that, for long at a time.
        // Nobody waits for what they do.
        let exec = exec.clone().with_threads(exec.threads()).with_observer(Arc::new(NoObserver));
        Self {
            planes,
            window: first.or_said(said),
            first,
            volume,
            hovered: None,
            versions: [1; 3],
            size: None,
            sight: None,
            turned: None,
            says_colours: said.colours.is_some(),
            exec,
        }
    }

    /// The volume can be drawn.
    pub(crate) fn show_volume(&mut self, at_rest: AtRest) -> Result<(), Error> {
        let (size, grid) = (self.size.unwrap_or(SIZE), at_rest.volume.grid());
        let mut panes = Panes::new(at_rest.seen(), &at_rest.picture, size, &self.exec)?;
        if let Some(sight) = self.sight {
            panes.view = sight.view(panes.view, grid);
        }
        let lens = panes.lens(grid)?;
        self.turned = Some(Turned { at_rest, panes, lens, version: 1 });
        Ok(())
    }

    /// Whether it can follow a request.
    pub(crate) fn can_follow(&self, request: &Request) -> bool {
        let sees = |pane: &Pane| *pane != Pane::Volume || self.turned.is_some();
        match request {
            Request::Slice { pane, .. } => *pane != Pane::Volume,
            Request::Cross { pane, .. } | Request::Hover { pane, .. } => sees(pane),
            Request::Window { .. } | Request::Resize { .. } | Request::Show { .. } => true,
            // What a scene says of the volume's is reset once that can be.
            Request::ResetColours => !self.says_colours,
            request => self.turned.is_some() && request.turns_camera(),
        }
    }

    /// Follows what it can follow.
    pub(crate) fn follow(&mut self, request: &Request) -> Result<(), Error> {
        request.check()?;
        let grid = self.volume.grid();
        match request {
            Request::Slice { pane, steps } => {
                self.planes.step(*pane, *steps, grid.dims())?;
                self.touch(&[*pane]);
            }
            Request::Cross { pane, at } => {
                if let Some(place) = self.look(*pane, *at)? {
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
                let place = self.look(*pane, *at)?;
                self.hovered =
                    place.map(|place| Hovered::at_rest(*pane, place, &self.volume, self.shares(place)));
            }
            camera => {
                match camera {
                    Request::Resize { size } => self.size = Some(*size),
                    Request::Show { sight } => {
                        self.planes.meet(sight.cross, grid);
                        (self.window, self.sight) = (sight.window(), Some(*sight));
                        self.touch(&Pane::ALL[1..]);
                    }
                    _ => {}
                }
                if let Some(turned) = &mut self.turned {
                    let grid = turned.at_rest.volume.grid();
                    if turned.panes.turn(grid, &turned.lens, camera) {
                        turned.lens = turned.panes.lens(grid)?;
                        turned.version += 1;
                    }
                }
            }
        }
        Ok(())
    }

    fn touch(&mut self, panes: &[Pane]) {
        for number in panes.iter().filter_map(|pane| pane.number().checked_sub(1)) {
            self.versions[number] += 1;
        }
    }

    /// The place that a pane shows (mm, RAS).
    fn look(&self, pane: Pane, at: [f64; 2]) -> Result<Option<[f64; 3]>, Error> {
        match &self.turned {
            Some(turned) if pane == Pane::Volume => {
                turned.panes.look(pane, at, turned.at_rest.seen(), &self.exec)
            }
            _ => Ok(self.planes.look(pane, at, self.volume.grid())),
        }
    }

    fn shares(&self, place: [f64; 3]) -> [Option<[f64; 2]>; 4] {
        let grid = self.volume.grid();
        let mut shares = Pane::ALL.map(|pane| self.planes.share(pane, grid, place));
        if let Some(turned) = &self.turned {
            shares[0] = turned.panes.shares(grid, &turned.lens, place)[0];
        }
        shares
    }

    /// Shows slices alone, where the volume can't be drawn.
    pub(crate) fn hide_volume(&mut self) {
        self.turned = None;
    }

    /// Whether the volume's picture could be finer than what was shown.
    pub(crate) fn could_be_finer(&self, shown: Option<&Scan>) -> bool {
        let volume = shown.and_then(|shown| shown.volume.as_ref());
        self.turned.is_some() && volume.is_some_and(|volume| volume.picture.coarser > 1)
    }

    /// What it shows; of the pictures before those that are still right.
    ///
    /// - `fine`: whether the volume's picture is to be whole.
    pub(crate) fn scan(&self, before: Option<&Scan>, fine: bool) -> Result<Scan, Error> {
        let picture = |number: usize| {
            let (pane, version) = (Pane::ALL[number + 1], self.versions[number]);
            let same = before.map(|before| &before.pictures[number]);
            if let Some(same) = same.filter(|picture| picture.version == version) {
                return Ok(same.clone());
            }
            let image = match self.planes.plane(pane) {
                Some(plane) => self.planes.draw(plane, &self.volume, self.window, |_, grey| [grey; 3])?,
                None => ivd_core::Image::new(1, 1, vec![0; 4])?,
            };
            Ok::<_, Error>(Arc::new(Picture::new(pane, version, 1, image)))
        };
        let grid = self.volume.grid();
        let cross: [f64; 3] = grid.world(VoxelCoord(self.planes.cross.into())).0.into();
        let volume = before.and_then(|before| before.volume.as_ref()).map(|volume| &volume.picture);
        let volume = self.turned.as_ref().map(|turned| turned.shown(volume, fine, &self.exec)).transpose()?;
        Ok(Scan {
            pictures: [picture(0)?, picture(1)?, picture(2)?],
            volume,
            slices: self.planes.told(grid),
            cross,
            cross_value: value_at(&self.volume, cross),
            cross_at: self.shares(cross),
            hovered: self.hovered.clone(),
            window: [self.window.low, self.window.high],
        })
    }

    /// Lets a model show what was shown last.
    pub(crate) fn hand_over(self, model: &mut Model) -> Result<(), Error> {
        let view = self.turned.and_then(|turned| turned.panes.turned());
        let radius = self.sight.map(|sight| sight.radius);
        model.show_as(self.planes.cross, self.window, (view, self.size), radius)
    }
}

impl Request {
    /// Whether it moves the camera, and nothing else.
    fn turns_camera(&self) -> bool {
        matches!(
            self,
            Self::Resize { .. }
                | Self::Orbit { .. }
                | Self::Pan { .. }
                | Self::Zoom { .. }
                | Self::Look { .. }
                | Self::ResetView
                | Self::Show { .. }
        )
    }

    /// Whether it must wait behind another that waits: what hands do goes by what they saw then.
    pub(crate) fn is_behind(&self, other: &Self) -> bool {
        let goes_by_what_is_seen = matches!(
            other,
            Self::Grab { .. }
                | Self::Drag { .. }
                | Self::Pin { .. }
                | Self::Stroke { .. }
                | Self::DrawBone { .. }
                | Self::Joint { .. }
                | Self::ClipHere { .. }
                | Self::Cross { .. }
        );
        goes_by_what_is_seen || (self.turns_camera() && other.turns_camera())
    }
}

impl Turned {
    fn shown(&self, before: Option<&Arc<Picture>>, fine: bool, exec: &Exec) -> Result<VolumeAtRest, Error> {
        let right =
            |picture: &&Arc<Picture>| picture.version == self.version && (picture.coarser == 1 || !fine);
        let picture = if let Some(same) = before.filter(right) {
            same.clone()
        } else {
            let coarser = if fine { 1 } else { COARSE };
            let image = self.panes.draw(self.at_rest.seen(), coarser, exec)?;
            Arc::new(Picture::new(Pane::Volume, self.version, coarser, image))
        };
        let lettered = self.at_rest.volume.grid().in_patient();
        Ok(VolumeAtRest {
            picture,
            size: self.panes.size,
            angles: self.panes.view.angles,
            width_mm: self.panes.width_mm(&self.lens),
            letters: lettered.then(|| letters(&self.lens)),
        })
    }
}
