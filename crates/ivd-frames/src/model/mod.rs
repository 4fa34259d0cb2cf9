//! A session with what a window shows of it: requests change it, and it says which panes that touches.

mod told;

use std::time::{Duration, Instant};

use ivd_core::{BRICK, Classified as _, ErrorClass, Exec, Image, TransferFunction, VoxelCoord, World};
use ivd_field::sampler::{Sampler, gradient};
use ivd_map::{BiharmonicParams, OctreeParams};
use ivd_motion::handles::{Action, Anchor, Handle, Pin, find_picks};
use ivd_render::Lens;
use ivd_session::{Event, Id, MapChoice, Session, Update};
use nalgebra::{Matrix3, Vector3};

use crate::colours::{Turned, Window};
use crate::figures::{Figures, Hovered, Refused, Spot};
use crate::panes::{Across, Panes};
use crate::request::MOST_HANDLES;
use crate::{Axis, Error, MapName, Pane, Request, Subject};

/// A solve that takes longer is refused: a window that doesn't answer is worse.
const MOST_WORK: Duration = Duration::from_secs(15);
/// A handle is taken hold of from so far away (shares of the pane).
const NEAR: f64 = 0.025;
/// Newton's steps at most: two or three are enough.
const NEWTON: usize = 6;
/// An axis that is seen this nearly end on can't be dragged along (squared sine).
const END_ON: f64 = 0.01;

/// What is shown and worked on.
pub struct Model {
    subject: Subject,
    session: Session,
    panes: Panes,
    lens: Lens,
    transfer: Option<TransferFunction>,
    turned: Turned,
    window: Window,
    first_window: Window,
    /// Of the next handle (mm).
    radius: f64,
    drag: Option<Drag>,
    hovered: Option<Hovered>,
    refused: Option<Refused>,
    last: Update,
    spots: Vec<Spot>,
    pins: Vec<Spot>,
    /// Rise with every change of what a pane shows.
    versions: [u64; 4],
    exec: Exec,
}

/// A handle that is held.
#[derive(Debug, Clone, Copy)]
struct Drag {
    handle: Id,
    from: [f64; 2],
    /// How far it was moved then.
    by: Vector3<f64>,
    across: Across,
    /// Where it was wanted last.
    wanted: Vector3<f64>,
}

impl Model {
    /// At its first settings.
    ///
    /// # Errors
    /// Those of [`Session::new`], and of pictures.
    pub fn new(subject: Subject, size: [usize; 2], exec: Exec) -> Result<Self, Error> {
        let (volume, transfer) = (&subject.volume, subject.transfer.clone());
        volume.find_bricks(&exec)?;
        let panes = Panes::new(volume, transfer.as_ref(), &subject.picture, size, &exec)?;
        let lens = panes.lens(volume, transfer.as_ref(), &exec)?;
        let window = Window::of(volume);
        let extent = volume.grid().extent();
        let side = (0..3).map(|a| extent[1][a] - extent[0][a]).fold(f64::INFINITY, f64::min);
        let session = Session::new(
            volume.clone(),
            subject.lattice.clone(),
            subject.labels.clone(),
            subject.settings.clone(),
            &exec,
        )?;
        session.deformed().find_bricks(&exec)?;
        let largest = session.settings().handles.iter().map(|one| one.radius).fold(0.0, f64::max);
        let mut model = Self {
            session,
            panes,
            lens,
            transfer,
            turned: Turned::NONE,
            window,
            first_window: window,
            radius: if largest > 0.0 { largest } else { (0.15 * side).max(f64::MIN_POSITIVE) },
            drag: None,
            hovered: None,
            refused: None,
            last: Update { min_det_j: 1.0, ..Update::default() },
            spots: Vec::new(),
            pins: Vec::new(),
            versions: [1; 4],
            exec,
            subject,
        };
        model.find_spots()?;
        Ok(model)
    }

    /// What it shows.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The same, to be recorded.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// What it began with.
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// Rise with every change of what a pane shows.
    pub fn versions(&self) -> [u64; 4] {
        self.versions
    }

    /// Whether something is held.
    pub fn is_held(&self) -> bool {
        self.drag.is_some()
    }

    /// Follows a request. What can't be deformed as asked isn't an error: the last state stays, and the figures say why.
    ///
    /// # Errors
    /// A request that makes no sense here; cancellation.
    pub fn follow(&mut self, request: &Request) -> Result<(), Error> {
        request.check()?;
        let grid = self.session.rest().grid().clone();
        match request {
            Request::Resize { size } => {
                self.panes.size = *size;
                self.moved_camera()
            }
            Request::Orbit { by } => {
                self.panes.orbit(*by);
                self.moved_camera()
            }
            Request::Pan { by } => {
                self.panes.pan(&grid, &self.lens, *by);
                self.moved_camera()
            }
            Request::Zoom { factor, at } => {
                self.panes.zoom(&grid, &self.lens, *factor, *at);
                self.moved_camera()
            }
            Request::Look { side } => {
                self.panes.look_from(*side);
                self.moved_camera()
            }
            Request::ResetView => {
                self.panes.reset_view();
                self.moved_camera()
            }
            Request::Window { by } => {
                let least = 1e-6 * (self.first_window.high - self.first_window.low);
                self.window = self.window.dragged(*by, least);
                self.touch(&Pane::ALL[1..]);
                Ok(())
            }
            Request::Transfer { by } => {
                self.turn(self.turned.dragged(*by));
                Ok(())
            }
            Request::ResetColours => {
                self.window = self.first_window;
                self.turn(Turned::NONE);
                self.touch(&Pane::ALL[1..]);
                Ok(())
            }
            Request::Slice { pane, steps } => {
                let plane = *self.panes.plane(*pane).ok_or_else(|| no_slice("slice"))?;
                let last = (grid.dims()[plane.cut()] - 1) as f64;
                let place = self.panes.cross[plane.cut()].round() + f64::from(*steps);
                self.panes.cross[plane.cut()] = place.clamp(0.0, last);
                self.touch(&[*pane]);
                self.moved_cross()
            }
            Request::Cross { pane, at } => {
                if let Some(place) = self.look(*pane, *at)? {
                    let VoxelCoord(voxel) = grid.voxel(World(place.into()));
                    let before = self.slices();
                    let last = grid.dims().map(|n| (n - 1) as f64);
                    self.panes.cross = std::array::from_fn(|a| voxel[a].clamp(0.0, last[a]));
                    let moved: Vec<Pane> = before
                        .iter()
                        .zip(self.slices())
                        .filter(|(a, b)| **a != *b)
                        .map(|(_, b)| b.0)
                        .collect();
                    self.touch(&moved);
                }
                self.moved_cross()
            }
            Request::Cut { along } => {
                self.panes.cut = *along;
                self.moved_camera()
            }
            Request::Hover { pane, at } => {
                self.hovered = self.hover(*pane, *at)?;
                Ok(())
            }
            Request::Grab { pane, at } => self.grab(*pane, *at),
            Request::Drag { to, lock } => self.drag(*to, *lock),
            Request::Drop => {
                self.drag = None;
                self.refused = None;
                if self.session.in_gesture() {
                    self.session.commit()?;
                }
                Ok(())
            }
            Request::Abandon => {
                (self.drag, self.refused) = (None, None);
                if self.session.in_gesture() {
                    let update = self.session.abandon(&self.exec)?;
                    self.show(update)?;
                }
                Ok(())
            }
            Request::Radius { handle, radius } => self.set_radius(*handle, *radius),
            Request::Wheel { steps } => {
                let held = self.drag.map(|drag| drag.handle);
                self.set_radius(held, (self.radius * 1.1_f64.powi(*steps)).clamp(1e-3, 1e6))
            }
            Request::Add { place, by } => {
                let handle =
                    Handle { at: Anchor::NearestTo(*place), action: Action::Move(*by), radius: self.radius };
                self.no_more_than(MOST_HANDLES)?;
                self.apply(Event::Add { id: None, handle })
            }
            Request::Move { handle, by } => self.apply(Event::Move { handle: *handle, by: *by }),
            Request::Remove { handle } => {
                self.let_go()?;
                self.apply(Event::Remove { handle: *handle })
            }
            Request::Pin { pane, at } => {
                self.no_more_than(MOST_HANDLES)?;
                let Some(place) = self.look(*pane, *at)? else { return Err(nothing_there("pin")) };
                let pin = Pin { at: Anchor::NearestTo(self.rest_of(place)), radius: 0.5 * self.radius };
                self.apply(Event::Pin { id: None, pin })
            }
            Request::Release { fix } => self.apply(Event::Release { fix: *fix }),
            Request::Undo => {
                self.let_go()?;
                let update = self.session.undo(&self.exec)?;
                update.map_or(Ok(()), |update| self.show(update))
            }
            Request::Redo => {
                self.let_go()?;
                let update = self.session.redo(&self.exec)?;
                update.map_or(Ok(()), |update| self.show(update))
            }
            Request::Reset => {
                self.let_go()?;
                self.apply(Event::Reset)
            }
            Request::Level { level } => self.apply(Event::Level(*level)),
            Request::Stiffness { stiffness } => self.apply(Event::Stiffness { newton_per_metre: *stiffness }),
            Request::Map { map } => {
                let map = match map {
                    MapName::Octree => MapChoice::Octree(OctreeParams::default()),
                    MapName::Biharmonic => MapChoice::Biharmonic(BiharmonicParams::default()),
                };
                self.apply(Event::Map(map))
            }
            Request::Save { .. } => Ok(()),
        }
    }

    /// Applies an event. What can't be deformed is told by the figures; whatever else is wrong is an error.
    fn apply(&mut self, event: Event) -> Result<(), Error> {
        let exec = self.exec.clone().with_deadline(Instant::now() + MOST_WORK);
        match self.session.apply(event, &exec) {
            Ok(update) => self.show(update),
            Err(error) if error.error_class() == ErrorClass::Cancelled => Err(error.into()),
            Err(error) => {
                self.refused = Some(Refused { why: error.to_string(), ahead_mm: self.ahead() });
                Ok(())
            }
        }
    }

    /// How far the hand is from what it holds (mm).
    fn ahead(&self) -> f64 {
        let Some(drag) = &self.drag else { return 0.0 };
        let held = self.session.settings().handles.iter().find(|one| one.id == drag.handle);
        held.map_or(0.0, |held| (drag.wanted - by_of(&held.what)).norm())
    }

    /// Takes what an event changed into account.
    fn show(&mut self, update: Update) -> Result<(), Error> {
        if !update.dirty.is_empty() {
            let bricks = self.session.displacement().inverse().brick_dims();
            let at = |brick: usize| {
                [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]]
            };
            let cut: Vec<Pane> = self
                .slices()
                .iter()
                .filter(|(_, axis, slice)| {
                    update.dirty.iter().any(|&brick| at(brick)[*axis] == slice / BRICK)
                })
                .map(|(pane, ..)| *pane)
                .collect();
            self.touch(&cut);
            self.touch(&[Pane::Volume]);
        }
        (self.last, self.refused) = (update, None);
        self.find_spots()
    }

    /// The slices: their panes, the axis of the grid that each cuts, and where.
    fn slices(&self) -> [(Pane, usize, usize); 3] {
        let dims = self.session.rest().grid().dims();
        [Pane::Axial, Pane::Coronal, Pane::Sagittal].map(|pane| match self.panes.plane(pane) {
            Some(plane) => (pane, plane.cut(), self.panes.slice(plane, dims)),
            None => (pane, 0, 0),
        })
    }

    fn touch(&mut self, panes: &[Pane]) {
        for pane in panes {
            self.versions[pane.number()] += 1;
        }
    }

    fn turn(&mut self, turned: Turned) {
        self.turned = turned;
        self.transfer = self.subject.transfer.as_ref().map(|transfer| turned.of(transfer));
        self.touch(&[Pane::Volume]);
    }

    fn moved_camera(&mut self) -> Result<(), Error> {
        self.lens = self.panes.lens(self.session.deformed(), self.transfer.as_ref(), &self.exec)?;
        self.touch(&[Pane::Volume]);
        Ok(())
    }

    /// The cut goes where the slices meet.
    fn moved_cross(&mut self) -> Result<(), Error> {
        if self.panes.cut.is_some() { self.moved_camera() } else { Ok(()) }
    }

    /// Lets go of what is held, as it is.
    fn let_go(&mut self) -> Result<(), Error> {
        self.drag = None;
        if self.session.in_gesture() {
            self.session.commit()?;
        }
        Ok(())
    }

    fn no_more_than(&self, most: usize) -> Result<(), Error> {
        let settings = self.session.settings();
        let count = settings.handles.len().max(settings.fixed.len());
        if count < most {
            return Ok(());
        }
        Err(Error::Request { what: "add", problem: format!("there are {count}"), remedy: "remove one first" })
    }

    fn set_radius(&mut self, handle: Option<Id>, radius: f64) -> Result<(), Error> {
        self.radius = radius;
        handle.map_or(Ok(()), |handle| self.apply(Event::Radius { handle, radius }))
    }

    /// The place that a pane shows (mm, RAS).
    fn look(&self, pane: Pane, at: [f64; 2]) -> Result<Option<[f64; 3]>, Error> {
        self.panes.look(pane, at, self.session.deformed(), self.transfer.as_ref(), &self.exec)
    }

    /// Where what is now at a place was at rest (mm, RAS): between voxels closer than the inverse field, by Newton's steps on the forward one from there.
    pub fn rest_of(&self, place: [f64; 3]) -> [f64; 3] {
        let displacement = self.session.displacement();
        let grid = displacement.grid();
        let VoxelCoord(voxel) = grid.voxel(World(place.into()));
        let forward = Sampler::new(displacement.forward(), grid);
        let mut rest = voxel + Sampler::new(displacement.inverse(), grid).at(voxel);
        let mut off = rest + forward.at(rest) - voxel;
        for _ in 0..NEWTON {
            let (cell, within) = forward.locate(rest);
            let slope = Matrix3::identity() + gradient(&forward.corners(cell), within);
            let Some(step) = slope.try_inverse().map(|inverse| inverse * off) else { break };
            let next = rest - step;
            let left = next + forward.at(next) - voxel;
            // Where nothing has gone from, as beside what is left behind, no step comes nearer.
            if left.norm() >= off.norm() {
                break;
            }
            (rest, off) = (next, left);
        }
        grid.world(VoxelCoord(rest)).0.into()
    }

    /// What lies under the pointer.
    fn hover(&self, pane: Pane, at: [f64; 2]) -> Result<Option<Hovered>, Error> {
        let Some(place) = self.look(pane, at)? else { return Ok(None) };
        let rest = self.rest_of(place);
        let found = find_picks(self.session.lattice(), "handle", [&Anchor::NearestTo(rest)]);
        let vertex = found.ok().and_then(|picks| picks.first().map(|pick| (pick.at, pick.away())));
        let volume = self.session.deformed();
        let grid = volume.grid();
        let VoxelCoord(voxel) = grid.voxel(World(place.into()));
        let value =
            grid.nearest_voxel(voxel).map(|voxel| volume.value(voxel)).filter(|value| value.is_finite());
        Ok(Some(Hovered {
            pane,
            place,
            rest,
            value,
            handle: self.handle_at(pane, at),
            vertex: vertex.map(|(at, _)| at),
            away_mm: vertex.map(|(_, away)| away),
            at: self.panes.shares(grid, &self.lens, place),
        }))
    }

    /// The handle that a pane shows at a place.
    fn handle_at(&self, pane: Pane, at: [f64; 2]) -> Option<Id> {
        let away = |spot: &Spot| {
            let there = spot.at[pane.number()]?;
            Some((there[0] - at[0]).hypot(there[1] - at[1]))
        };
        let near = self.spots.iter().filter_map(|spot| Some((away(spot)?, spot.id)));
        near.filter(|(away, _)| *away <= NEAR).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, id)| id)
    }

    /// Takes hold of a handle, or makes one.
    fn grab(&mut self, pane: Pane, at: [f64; 2]) -> Result<(), Error> {
        self.let_go()?;
        let grid = self.session.rest().grid().clone();
        let taken = self.handle_at(pane, at);
        let (handle, place) = if let Some(id) = taken {
            self.session.begin("drag")?;
            let spot = self.spots.iter().find(|spot| spot.id == id);
            (id, spot.map_or([0.0; 3], |spot| spot.now))
        } else {
            self.no_more_than(MOST_HANDLES)?;
            let Some(place) = self.look(pane, at)? else { return Err(nothing_there("grab")) };
            let handle = Handle {
                at: Anchor::NearestTo(self.rest_of(place)),
                action: Action::Move([0.0; 3]),
                radius: self.radius,
            };
            self.session.begin("drag a new handle")?;
            self.apply(Event::Add { id: None, handle })?;
            let Some(added) = self.session.settings().handles.last().filter(|_| self.refused.is_none())
            else {
                self.session.abandon(&self.exec)?;
                return Ok(());
            };
            (added.id, place)
        };
        let held = self.session.settings().handles.iter().find(|one| one.id == handle);
        let by = held.map_or_else(Vector3::zeros, |held| by_of(&held.what));
        if let Some(held) = held {
            self.radius = held.radius;
        }
        let across = self.panes.across(pane, &grid, &self.lens, place);
        self.drag = Some(Drag { handle, from: at, by, across, wanted: by });
        Ok(())
    }

    /// Moves what is held.
    fn drag(&mut self, to: [f64; 2], lock: Option<Axis>) -> Result<(), Error> {
        let Some(mut drag) = self.drag else {
            return Err(Error::Request {
                what: "drag",
                problem: "nothing is held".into(),
                remedy: "take hold of a handle first",
            });
        };
        let Across { right, down } = drag.across;
        let way = right * (to[0] - drag.from[0]) + down * (to[1] - drag.from[1]);
        let way = lock.map_or(way, |axis| along(axis, way, right.cross(&down)));
        drag.wanted = drag.by + way;
        self.drag = Some(drag);
        self.apply(Event::Move { handle: drag.handle, by: drag.wanted.into() })
    }

    /// Finds where handles and pins are.
    fn find_spots(&mut self) -> Result<(), Error> {
        let settings = self.session.settings();
        let lattice = self.session.lattice();
        let picks = find_picks(lattice, "handle", settings.handles.iter().map(|one| &one.at))?;
        let moved = self.session.motion().and_then(|motion| motion.frames().last());
        let spots = settings.handles.iter().zip(picks).map(|(one, pick)| {
            let by = moved.map_or([0.0; 3], |frame| frame.displacement[pick.vertex]);
            let now = std::array::from_fn(|a| pick.at[a] + by[a]);
            Spot { id: one.id, rest: pick.at, now, by, radius: one.radius, at: [None; 4], off: [0.0; 3] }
        });
        let spots = spots.collect();
        let picks = find_picks(lattice, "fixed vertex", settings.fixed.iter().map(|one| &one.at))?;
        let pins = settings.fixed.iter().zip(picks).map(|(one, pick)| Spot {
            id: one.id,
            rest: pick.at,
            now: pick.at,
            by: [0.0; 3],
            radius: one.radius,
            at: [None; 4],
            off: [0.0; 3],
        });
        (self.pins, self.spots) = (pins.collect(), spots);
        self.place_spots();
        Ok(())
    }

    /// Finds where the panes show them.
    fn place_spots(&mut self) {
        let grid = self.session.rest().grid();
        for spot in self.spots.iter_mut().chain(&mut self.pins) {
            spot.at = self.panes.shares(grid, &self.lens, spot.now);
            spot.off = self.panes.off(grid, spot.now);
        }
    }

    /// Draws a pane; `coarser`: by how many the sides of the volume's are divided.
    ///
    /// # Errors
    /// Those of pictures; cancellation.
    pub fn draw(&self, pane: Pane, coarser: usize, exec: &Exec) -> Result<Image, Error> {
        let volume = self.session.deformed();
        match self.panes.plane(pane) {
            Some(plane) => self.panes.draw_slice(plane, volume, self.window),
            None => self.panes.draw(volume, self.transfer.as_ref(), coarser, exec),
        }
    }

    /// What is told beside the pictures.
    pub fn figures(&mut self) -> Figures {
        self.place_spots();
        Figures::of(self)
    }
}

/// How far a handle is told to move its vertex.
fn by_of(handle: &Handle) -> Vector3<f64> {
    match handle.action {
        Action::Move(by) => Vector3::from(by),
        Action::Force(_) => Vector3::zeros(),
    }
}

/// The way along an axis that looks most like a way across a pane, whose normal is given by its direction.
fn along(axis: Axis, way: Vector3<f64>, normal: Vector3<f64>) -> Vector3<f64> {
    let axis = match axis {
        Axis::X => Vector3::x(),
        Axis::Y => Vector3::y(),
        Axis::Z => Vector3::z(),
    };
    let normal = normal.normalize();
    let seen = axis - normal * normal.dot(&axis);
    let length = seen.norm_squared();
    if length < END_ON { Vector3::zeros() } else { axis * (way.dot(&seen) / length) }
}

fn nothing_there(what: &'static str) -> Error {
    Error::Request { what, problem: "nothing is seen there".into(), remedy: "point at what is shown" }
}

fn no_slice(what: &'static str) -> Error {
    Error::Request { what, problem: "the volume's pane has no slices".into(), remedy: "name another" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locked_drag_keeps_to_its_axis_and_follows_the_pointer() {
        let normal = Vector3::new(1.0, 2.0, 0.5).normalize();
        let across = Vector3::z().cross(&normal).normalize();
        let way = across * 3.0 + across.cross(&normal) * 2.0;
        let locked = along(Axis::X, way, normal);
        assert_eq!((locked.y, locked.z), (0.0, 0.0));
        // What is left of the way is seen square to the axis.
        let seen = Vector3::x() - normal * normal.x;
        assert!((way - locked).dot(&seen).abs() < 1e-12);
        assert_eq!(along(Axis::Y, Vector3::x(), Vector3::y()), Vector3::zeros(), "end on");
    }
}
