//! Where places lie in the panes, and what panes show where.

use ivd_core::{Exec, Grid, Image, Labels, TransferFunction, Volume, VoxelCoord};
use ivd_render::{Clip, Fit, Lens, Prepared, RenderParams, Scene, View};
use nalgebra::Vector3;

use crate::planes::Planes;
use crate::{Error, Pane, Request};

/// Step of a coarse picture's rays, in those of a whole one's.
const COARSE_STEP: f64 = 2.0;
/// Share of a ray's opacity before where what is seen begins: less may be noise before it.
const FRONT: f32 = 0.1;

/// A volume in its colours.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    pub(crate) volume: &'a Volume,
    pub(crate) transfer: Option<&'a TransferFunction>,
    /// By which it is coloured, where a person's labels are; else by its values alone.
    pub(crate) labels: Option<&'a Labels>,
    /// Whether what those leave out is seen as well.
    pub(crate) unlabelled: bool,
}

impl<'a> Seen<'a> {
    fn scene(self) -> Scene<'a> {
        let Self { volume, transfer, labels, unlabelled } = self;
        Scene { transfer, labels, unlabelled, ..Scene::new(volume) }
    }
}

/// What of a picture is looked for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Depth {
    /// What it is said to show.
    Shown,
    /// Where that begins: of a translucent body its skin.
    Front,
}

/// How the panes look at a volume.
pub(crate) struct Panes {
    pub(crate) planes: Planes,
    /// Of the volume's pane.
    pub(crate) size: [usize; 2],
    pub(crate) view: View,
    /// As it began, ...
    first: View,
    /// ... and one that shows the whole.
    whole: View,
    /// How pictures are drawn, but for size and view.
    picture: RenderParams,
    /// Along which pane the volume's picture is cut open there.
    pub(crate) cut: Option<Pane>,
}

/// A pane about a place, as directions and lengths of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Across {
    /// What the pane's width and height are there (mm, RAS): to the right and down.
    pub(crate) right: Vector3<f64>,
    pub(crate) down: Vector3<f64>,
}

impl Panes {
    /// The slices meet in the middle.
    pub(crate) fn new(
        seen: Seen<'_>,
        picture: &RenderParams,
        size: [usize; 2],
        exec: &Exec,
    ) -> Result<Self, Error> {
        let grid = seen.volume.grid();
        let picture = RenderParams { annotate: false, picks: Vec::new(), size, ..picture.clone() };
        let mut panes = Self {
            planes: Planes::new(grid),
            size,
            view: picture.view,
            first: picture.view,
            whole: View { zoom: 1.0, target: None, ..picture.view },
            picture,
            cut: None,
        };
        // What fits at first stays so: a camera that follows what is seen would move while that is deformed.
        let views = [panes.first, panes.whole];
        let prepared = panes.prepared(seen, size, false, exec)?;
        let lenses = [prepared.lens(views[0])?, prepared.lens(views[1])?];
        drop(prepared);
        panes.picture.fit = Fit::Volume;
        let by_volume = |view: View, lens: &Lens| {
            let whole = panes.lens_of(grid, view)?;
            let zoom = view.zoom * whole.pixel_at(whole.middle()) / lens.pixel_at(lens.middle());
            Ok::<_, Error>(View { target: Some(lens.middle()), zoom, ..view })
        };
        let [first, whole] = [by_volume(views[0], &lenses[0])?, by_volume(views[1], &lenses[1])?];
        (panes.first, panes.view, panes.whole) = (first, first, whole);
        Ok(panes)
    }

    /// Where the volume is seen from, unless that is as it began.
    pub(crate) fn turned(&self) -> Option<View> {
        Some(self.view).filter(|view| *view != self.first)
    }

    /// A scene that is ready to be drawn, in so many pixels.
    fn prepared<'a>(
        &self,
        seen: Seen<'a>,
        size: [usize; 2],
        coarse: bool,
        exec: &Exec,
    ) -> Result<Prepared<'a>, Error> {
        let step = self.picture.step * if coarse && self.picture.step <= 2.0 { COARSE_STEP } else { 1.0 };
        let mut params = RenderParams { size, step, view: self.view, ..self.picture.clone() };
        params.clip.extend(self.clip(seen.volume.grid())?);
        Ok(Prepared::new(&seen.scene(), &params, exec)?)
    }

    /// What is left of the volume's picture where it is cut open: the side away from the viewer.
    fn clip(&self, grid: &Grid) -> Result<Option<Clip>, Error> {
        let Some(along) = self.cut else { return Ok(None) };
        let (point, normal) = self.here(grid, along)?;
        Ok(Some(Clip::plane(point, normal)))
    }

    /// The plane where the slices meet, along the slice of a pane, or square to the line of sight for the volume's own: a point of it, and the direction away
    /// from the viewer.
    pub(crate) fn here(&self, grid: &Grid, along: Pane) -> Result<([f64; 3], [f64; 3]), Error> {
        let towards_eye = Vector3::from(self.lens(grid)?.axes()[2]);
        let normal = match self.planes.plane(along) {
            None => -towards_eye,
            Some(plane) => {
                let [right, down] = plane.ways(grid).map(Vector3::from);
                let across = right.cross(&down);
                across * -across.dot(&towards_eye).signum()
            }
        };
        let point = grid.world(VoxelCoord(self.planes.cross.into())).0;
        Ok((point.into(), normal.into()))
    }

    /// As [`Panes::here`], half a voxel on the side that goes: a slice that it lies along stays to be seen.
    pub(crate) fn beside_here(&self, grid: &Grid, along: Pane) -> Result<([f64; 3], [f64; 3]), Error> {
        let (point, normal) = self.here(grid, along)?;
        let half = self.planes.plane(along).map_or_else(Vector3::zeros, |plane| {
            let across = Vector3::from(normal).normalize();
            across * (0.5 * grid.linear_part().column(plane.cut()).dot(&across).abs())
        });
        Ok(((Vector3::from(point) - half).into(), normal))
    }

    /// The volume's picture; `coarser`: by how many its sides are divided.
    pub(crate) fn draw(&self, seen: Seen<'_>, coarser: usize, exec: &Exec) -> Result<Image, Error> {
        let size = self.size.map(|n| (n / coarser).max(1));
        let prepared = self.prepared(seen, size, coarser > 1, exec)?;
        Ok(prepared.render(self.view, exec)?.image)
    }

    /// How the volume's pane turns places into pixels.
    pub(crate) fn lens(&self, grid: &Grid) -> Result<Lens, Error> {
        self.lens_of(grid, self.view)
    }

    fn lens_of(&self, grid: &Grid, view: View) -> Result<Lens, Error> {
        let params = RenderParams { size: self.size, view, ..self.picture.clone() };
        Ok(Lens::of_volume(grid, &params)?)
    }

    /// The place that a pane shows at a share of it (mm, RAS); `None` where there is nothing.
    pub(crate) fn look(
        &self,
        pane: Pane,
        at: [f64; 2],
        seen: Seen<'_>,
        exec: &Exec,
    ) -> Result<Option<[f64; 3]>, Error> {
        if self.planes.plane(pane).is_some() {
            return Ok(self.planes.look(pane, at, seen.volume.grid()));
        }
        Ok(self.look_at_all(&[(at, Depth::Shown)], seen, exec)?[0])
    }

    /// The same, and where that begins; in slices it begins where it is.
    pub(crate) fn look_through(
        &self,
        pane: Pane,
        at: [f64; 2],
        seen: Seen<'_>,
        exec: &Exec,
    ) -> Result<[Option<[f64; 3]>; 2], Error> {
        if self.planes.plane(pane).is_some() {
            return Ok([self.planes.look(pane, at, seen.volume.grid()); 2]);
        }
        let both = [Depth::Shown, Depth::Front].map(|depth| (at, depth));
        let places = self.look_at_all(&both, seen, exec)?;
        Ok([places[0], places[1]])
    }

    /// The places that the volume's pane shows at shares of it (mm, RAS).
    pub(crate) fn look_at_all(
        &self,
        at: &[([f64; 2], Depth)],
        seen: Seen<'_>,
        exec: &Exec,
    ) -> Result<Vec<Option<[f64; 3]>>, Error> {
        let prepared = self.prepared(seen, self.size, false, exec)?;
        let look = |(at, depth): &([f64; 2], Depth)| {
            let pixel = [0, 1].map(|a| (at[a] * self.size[a] as f64).floor());
            if (0..2).any(|a| !(0.0..self.size[a] as f64).contains(&pixel[a])) {
                return Ok(None);
            }
            let pixel = pixel.map(|c| c as usize);
            let pick = match depth {
                Depth::Shown => prepared.pick(self.view, pixel)?,
                Depth::Front => prepared.pick_at(self.view, pixel, FRONT)?,
            };
            Ok(pick.map(|pick| pick.place))
        };
        at.iter().map(look).collect()
    }

    /// Where each pane shows a place, as shares of it.
    pub(crate) fn shares(&self, grid: &Grid, lens: &Lens, place: [f64; 3]) -> [Option<[f64; 2]>; 4] {
        Pane::ALL.map(|pane| match pane {
            Pane::Volume => {
                lens.project(place).map(|pixel| [0, 1].map(|a| (pixel[a] + 0.5) / self.size[a] as f64))
            }
            slice => self.planes.share(slice, grid, place),
        })
    }

    /// What a pane's width and height are at a place.
    pub(crate) fn across(&self, pane: Pane, grid: &Grid, lens: &Lens, place: [f64; 3]) -> Across {
        match self.planes.plane(pane) {
            None => {
                let [right, up, _] = lens.axes().map(Vector3::from);
                let [width, height] = self.size.map(|n| n as f64 * lens.pixel_at(place));
                Across { right: right * width, down: up * -height }
            }
            Some(plane) => {
                let world = |at| grid.world(VoxelCoord(plane.voxel(grid.dims(), 0.0, at).into())).0;
                let corner = world([0.0; 2]);
                Across { right: world([1.0, 0.0]) - corner, down: world([0.0, 1.0]) - corner }
            }
        }
    }

    /// What the volume's pane is wide, where the camera looks (mm).
    pub(crate) fn width_mm(&self, lens: &Lens) -> f64 {
        self.size[0] as f64 * lens.pixel_at(lens.middle())
    }

    /// Follows what moves the camera; whether a request is of that kind.
    pub(crate) fn turn(&mut self, grid: &Grid, lens: &Lens, request: &Request) -> bool {
        match request {
            Request::Resize { size } => self.size = *size,
            Request::Orbit { by } => self.orbit(*by),
            Request::Pan { by } => self.pan(grid, lens, *by),
            Request::Zoom { factor, at } => self.zoom(grid, lens, *factor, *at),
            Request::Look { side } => self.look_from(*side),
            Request::ResetView => self.view = self.whole,
            Request::Show { sight } => self.view = sight.view(self.view, grid),
            _ => return false,
        }
        true
    }

    /// Turns the camera by a drag across so much of the pane: half of it is a quarter turn.
    fn orbit(&mut self, [right, down]: [f64; 2]) {
        let [azimuth, elevation] = self.view.angles;
        let azimuth = (azimuth - 180.0 * right).rem_euclid(360.0);
        self.view.angles = [azimuth, (elevation + 180.0 * down).clamp(-90.0, 90.0)];
    }

    /// Moves what lies in the middle, so that what is seen follows a drag.
    fn pan(&mut self, grid: &Grid, lens: &Lens, [right, down]: [f64; 2]) {
        let middle = lens.middle();
        let across = self.across(Pane::Volume, grid, lens, middle);
        let moved = Vector3::from(middle) - across.right * right - across.down * down;
        // Not so far that what there is can't be found again.
        let [low, high] = grid.extent();
        self.view.target = Some(std::array::from_fn(|a| moved[a].clamp(low[a], high[a])));
    }

    /// Magnifies; the place at a share of the pane stays where it is.
    fn zoom(&mut self, grid: &Grid, lens: &Lens, factor: f64, at: [f64; 2]) {
        let zoom = (self.view.zoom * factor).clamp(0.1, 200.0);
        let factor = zoom / self.view.zoom;
        let share = 1.0 - 1.0 / factor;
        self.pan(grid, lens, [(0.5 - at[0]) * share, (0.5 - at[1]) * share]);
        self.view.zoom = zoom;
    }

    /// Looks from a side, at the same place.
    fn look_from(&mut self, side: ivd_render::Side) {
        (self.view.angles, self.view.roll) = (side.angles(), 0.0);
    }
}
