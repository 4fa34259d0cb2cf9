//! What is under the pointer, and what is held.

use std::time::Instant;

use ivd_core::{NO_DATA, VoxelIndex};
use ivd_motion::handles::{Action, Anchor, Handle, find_picks};
use ivd_session::{Event, Id};
use nalgebra::Vector3;

use super::{Drag, Model, no_more_than, nothing_there, sheet};
use crate::figures::{Hovered, Refused, Spot, value_at, voxel_at};
use crate::panes::Across;
use crate::request::MOST_HANDLES;
use crate::{Axis, Error, Overlay, Pane, SEEN_ASIDE, ShownBy};

/// A handle is taken hold of from so far away (shares of the pane).
const NEAR: f64 = 0.025;
/// Less of the way to a hand that is ahead isn't tried.
const LEAST_SHARE: f64 = 0.02;
/// Of a way that is longer than this share of the radius no more is tried to be gone at once.
const FARTHEST: f64 = 0.5;
/// What lies in another part is meant to be of the one that moves where that is no farther than so many voxel diagonals.
const BESIDE: f64 = 2.0;
/// So often what is held is tried to come closer at a time.
const TRIES: usize = 4;
/// An axis that is seen this nearly end on can't be dragged along (squared sine).
const END_ON: f64 = 0.01;
/// Elsewhere than where a surface is seen from in front it goes with the hand, and so many times as far at most.
const LONGER: f64 = 2.0;

impl Model {
    /// Where what is now at a place was at rest (mm, RAS); see [`ivd_field::place::at_rest`].
    pub fn rest_of(&self, place: [f64; 3]) -> [f64; 3] {
        self.session.rest_of(place)
    }

    /// What lies under the pointer.
    pub(super) fn hover(&self, pane: Pane, at: [f64; 2]) -> Result<Option<Hovered>, Error> {
        let [place, surface] = self.look_through(pane, at)?;
        let Some(place) = place else { return Ok(None) };
        if self.compared.is_rest_at(at) {
            let volume = self.session.rest();
            let shares = self.panes.shares(volume.grid(), &self.lens, place);
            let hovered = Hovered::at_rest(pane, place, volume, shares);
            return Ok(Some(Hovered { class: self.class_at(place), ..hovered }));
        }
        let rest = self.rest_of(place);
        let surface = surface.unwrap_or(place);
        let seen = self.side_seen(pane, surface);
        let vertex = sheet::pick(self.session.lattice(), self.rest_of(surface), seen);
        let now = vertex.map(|pick| self.now_at(&pick));
        let volume = self.session.whole();
        let grid = volume.grid();
        // In slices that a handle there wouldn't reach nothing would be seen of it.
        let shown_at = now.map_or([None; 4], |now| {
            let reached = self.panes.planes.reached(grid, self.panes.planes.off(grid, now), self.radius);
            let at = self.panes.shares(grid, &self.lens, now);
            Pane::ALL.map(|in_pane| {
                let is_shown = in_pane == Pane::Volume || in_pane == pane || reached[in_pane.number()];
                at[in_pane.number()].filter(|_| is_shown)
            })
        });
        Ok(Some(Hovered {
            pane,
            place,
            rest,
            value: value_at(volume, place),
            class: self.class_at(rest),
            times: self.times_at(place),
            handle: self.handle_at(pane, at),
            vertex: vertex.map(|pick| pick.at),
            vertex_at: shown_at,
            away_mm: vertex.map(|pick| pick.away()),
            at: self.panes.shares(grid, &self.lens, place),
        }))
    }

    /// By how many times the volume of what is now at a place (mm, RAS) has grown, while colours tell of that.
    pub(super) fn times_at(&self, place: [f64; 3]) -> Option<f64> {
        let told = self.overlay.filter(|of| *of == Overlay::Volume)?;
        let displacement = self.session.displacement();
        let VoxelIndex(voxel) = voxel_at(displacement.grid(), place)?;
        told.value(displacement, voxel)
    }

    /// The place that a pane shows, and that on its surface (mm, RAS): in the volume where what is seen begins.
    pub(super) fn look_through(&self, pane: Pane, at: [f64; 2]) -> Result<[Option<[f64; 3]>; 2], Error> {
        self.panes.look_through(pane, at, self.seen(at), &self.exec)
    }

    /// The handle that a pane shows at a place; before those that lie beside its slice, or behind what is seen, one that doesn't.
    fn handle_at(&self, pane: Pane, at: [f64; 2]) -> Option<Id> {
        let away = |spot: &Spot| {
            let there = spot.at[pane.number()]?;
            Some((there[0] - at[0]).hypot(there[1] - at[1]))
        };
        let rank = |spot: &Spot| match pane.number() {
            0 => f64::from(u8::from(spot.beside[0])),
            slice => spot.off[slice - 1].abs().floor(),
        };
        self.spots
            .iter()
            .filter(|spot| spot.seen[pane.number()])
            .filter_map(|spot| Some((away(spot)?, spot)))
            .filter(|(away, _)| *away <= NEAR)
            .min_by(|a, b| rank(a.1).total_cmp(&rank(b.1)).then(a.0.total_cmp(&b.0)))
            .map(|(_, spot)| spot.id)
    }

    /// Takes hold of a handle, or makes one.
    pub(super) fn grab(&mut self, pane: Pane, at: [f64; 2]) -> Result<(), Error> {
        self.let_go()?;
        self.check_seen_now("grab", &[at])?;
        let grid = self.session.rest().grid().clone();
        self.find_hidden();
        let taken = self.handle_at(pane, at);
        let (handle, place) = if let Some(id) = taken {
            self.session.begin("drag")?;
            let spot = self.spots.iter().find(|spot| spot.id == id);
            (id, spot.map_or([0.0; 3], |spot| spot.now))
        } else {
            no_more_than(MOST_HANDLES, self.session.settings().handles.len())?;
            let [_, Some(place)] = self.look_through(pane, at)? else { return Err(nothing_there("grab")) };
            let at = self.anchor(pane, place);
            let Some(at) = self.or_refused(at) else { return Ok(()) };
            let handle = Handle { at, action: Action::Move([0.0; 3]), radius: self.radius };
            self.session.begin("drag a new handle")?;
            self.apply_within(Event::Add { id: None, handle }, self.patience.held)?;
            let Some(added) = self.session.settings().handles.last().filter(|_| self.refused.is_none())
            else {
                self.session.abandon(&self.exec)?;
                return Ok(());
            };
            (added.id, place)
        };
        let held = self.session.settings().handles.iter().find(|one| one.id == handle);
        let by = match held.map(|held| held.action) {
            Some(Action::Move(by)) => Vector3::from(by),
            // Where the force has taken it: from there it goes with the hand.
            Some(Action::Force(_)) | None => {
                let picks = find_picks(self.session.lattice(), "handle", held.map(|held| &held.at))?;
                picks.first().map_or_else(Vector3::zeros, |pick| self.gone_by(pick.vertex))
            }
        };
        if let Some(held) = held {
            self.radius = held.radius;
        }
        let across = self.panes.across(pane, &grid, &self.lens, place);
        let is_new = taken.is_none();
        let (wanted, share, late, meets) = (by, 0.5, false, pane == Pane::Volume);
        self.drag =
            Some(Drag { handle, from: at, by, across, is_new, out: None, wanted, share, late, meets });
        Ok(())
    }

    /// Moves what is held.
    pub(super) fn drag(&mut self, to: [f64; 2], lock: Option<Axis>) -> Result<(), Error> {
        // Nothing was taken hold of, or it was let go meanwhile: why was said then.
        let Some(mut drag) = self.drag else { return Ok(()) };
        let Across { right, down } = drag.across;
        let way = right * (to[0] - drag.from[0]) + down * (to[1] - drag.from[1]);
        let normal = right.cross(&down);
        let way = match lock.map(of_patient) {
            None => way,
            Some(Some(axis)) => along(axis, way, normal, END_ON).unwrap_or_default(),
            Some(None) => {
                let spot = || self.spots.iter().find(|spot| spot.id == drag.handle);
                drag.out = drag.out.or_else(|| Some(spot()?.out?.into()));
                let Some(out) = drag.out else {
                    let why = "it has no in and out: its vertex lies on no side of the surface, or on another than at a lower level";
                    self.refused = Some(self.refusal(why.to_owned()));
                    return Ok(());
                };
                in_and_out(out, way, normal).unwrap_or_else(|| out * ((to[1] - drag.from[1]) * down.norm()))
            }
        };
        let wanted = drag.by + way;
        // Another place is another chance.
        if (wanted - drag.wanted).norm() > self.noticeable() {
            (drag.share, drag.late) = (0.5, false);
        }
        let meets = drag.meets && (wanted - drag.by).norm() > self.noticeable();
        drag.wanted = wanted;
        drag.meets &= !meets;
        self.drag = Some(drag);
        if meets {
            // What is pressed from outside is watched in the slices.
            self.meet_at_held();
        }
        if self.is_ahead() {
            self.follow_hand()
        } else {
            self.apply(Event::Move { handle: drag.handle, by: drag.wanted.into() })
        }
    }

    /// Moves what is held to where the hand is, or closer to it where that is refused.
    pub(super) fn follow_hand(&mut self) -> Result<(), Error> {
        let Some(drag) = self.drag else { return Ok(()) };
        let began = Instant::now();
        let late = self
            .apply_within(Event::Move { handle: drag.handle, by: drag.wanted.into() }, self.patience.drag)?;
        self.drag = self.drag.map(|drag| Drag { late, ..drag });
        self.try_closer(began + self.patience.tries)
    }

    /// Tries a few times to come closer to a hand that is ahead, once it is late no more than once.
    fn try_closer(&mut self, late: Instant) -> Result<(), Error> {
        for tried in 0..TRIES {
            let goes_on = tried == 0 || Instant::now() < late;
            if goes_on && self.drag.is_some() && self.refused.is_some() {
                self.come_closer()?;
            }
        }
        Ok(())
    }

    /// What is held comes closer to a hand that it can't follow all the way: half as far, half of half the radius at most, or less where that was refused before.
    /// Why it can't stays told.
    fn come_closer(&mut self) -> Result<(), Error> {
        let Some(((drag, handle, by), refused)) = self.held().zip(self.refused.clone()) else {
            return Ok(());
        };
        if drag.share < LEAST_SHARE || !self.is_ahead() {
            return Ok(());
        }
        // How far can be gone goes by the radius: from a hand that is far away it would be found late.
        let way = drag.wanted - by;
        let there = by + way * (drag.share * (FARTHEST * handle.radius / way.norm()).min(1.0));
        self.apply_within(Event::Move { handle: drag.handle, by: there.into() }, self.patience.one_try)?;
        let share = match self.drag {
            // It was stopped meanwhile.
            Some(Drag { share: 0.0, .. }) => 0.0,
            _ if self.refused.is_none() => 0.5,
            _ => 0.5 * drag.share,
        };
        self.drag = Some(Drag { share, ..drag });
        self.refused = Some(Refused { ahead_mm: self.ahead(), ..refused });
        Ok(())
    }

    /// The slices meet at what is held and was moved: seen from outside alone it would be seen in none of them.
    pub(super) fn meet_at_held(&mut self) {
        let moved = self.drag.filter(|drag| drag.is_new || drag.wanted != drag.by);
        let held = moved.and_then(|drag| self.spots.iter().find(|spot| spot.id == drag.handle));
        let Some(place) = held.map(|spot| spot.now) else { return };
        let moved = self.panes.planes.meet(place, self.session.rest().grid());
        self.touch(&moved);
        self.moved_cross();
    }

    /// The surface that a pane shows at a place: in the volume a side that faces the eye; slices show either.
    fn side_seen(&self, pane: Pane, place: [f64; 3]) -> Option<sheet::Seen<'_>> {
        (pane == Pane::Volume)
            .then(|| sheet::Seen { eye: self.lens.sight(place).into(), moved: self.moved() })
    }

    /// What is put on what a pane shows at a place is anchored there; else why it can't be.
    pub(super) fn anchor(&self, pane: Pane, place: [f64; 3]) -> Result<Anchor, String> {
        self.anchor_at(self.rest_of(place), self.side_seen(pane, place))
    }

    /// The same at a place at rest.
    pub(super) fn anchor_at(&self, rest: [f64; 3], seen: Option<sheet::Seen<'_>>) -> Result<Anchor, String> {
        let lattice = self.session.lattice();
        let near = BESIDE * lattice.grid().voxel_diagonal();
        let found = sheet::anchor(lattice, rest, seen);
        match (self.other_part_at(rest), found) {
            (Some((class, part)), found) if found.is_none_or(|(_, pick)| pick.away() > near) => Err(format!(
                "class {class} lies there, and the part that moves is class {part}; point at that, or let another part move (boundary.class)"
            )),
            (_, Some((anchor, _))) => Ok(anchor),
            (_, None) => Err("the surface that moves is far from there; point at it".to_owned()),
        }
    }

    /// The part that a person gave that lies at a place at rest (mm, RAS), where that is another than the one that moves, and that one.
    fn other_part_at(&self, rest: [f64; 3]) -> Option<(u16, u16)> {
        let both = self.class_at(rest).zip(self.subject.made.class);
        let is_given = self.subject.shown_by == ShownBy::Labels;
        both.filter(|(class, part)| is_given && class != part && *class != NO_DATA)
    }

    /// What is let go of while the hand is ahead comes there, where that only took longer than a hand waits for; else as close as a few tries bring it.
    pub(super) fn come_closest(&mut self) -> Result<(), Error> {
        // What was stopped stays where it is.
        if self.drag.is_some_and(|drag| drag.share == 0.0) {
            return Ok(());
        }
        if let Some(drag) = self.drag.filter(|drag| drag.late && self.is_ahead()) {
            self.apply_within(
                Event::Move { handle: drag.handle, by: drag.wanted.into() },
                self.patience.work,
            )?;
            if self.refused.is_none() || self.drag.is_some_and(|drag| drag.share == 0.0) {
                return Ok(());
            }
        }
        self.drag = self.drag.map(|drag| Drag { share: drag.share.max(2.0 * LEAST_SHARE), ..drag });
        self.try_closer(Instant::now() + self.patience.dropped)
    }
}

/// An axis of the patient; `None` for the surface's own.
fn of_patient(axis: Axis) -> Option<Vector3<f64>> {
    match axis {
        Axis::X => Some(Vector3::x()),
        Axis::Y => Some(Vector3::y()),
        Axis::Z => Some(Vector3::z()),
        Axis::N => None,
    }
}

/// The way in or out of a surface that looks most like a way across a pane, not much longer than that; `None` where the pane shows the surface from in front.
fn in_and_out(out: Vector3<f64>, way: Vector3<f64>, normal: Vector3<f64>) -> Option<Vector3<f64>> {
    let along = along(out, way, normal, SEEN_ASIDE * SEEN_ASIDE)?;
    Some(if along.norm() > LONGER * way.norm() {
        along * (LONGER * way.norm() / along.norm())
    } else {
        along
    })
}

/// The way along an axis that looks most like a way across a pane, whose normal is given by its direction; `None` where the axis is seen end on.
fn along(axis: Vector3<f64>, way: Vector3<f64>, normal: Vector3<f64>, end_on: f64) -> Option<Vector3<f64>> {
    let normal = normal.normalize();
    let seen = axis - normal * normal.dot(&axis);
    let length = seen.norm_squared();
    (length >= end_on).then(|| axis * (way.dot(&seen) / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locked_drag_keeps_to_its_axis_and_follows_the_pointer() {
        let normal = Vector3::new(1.0, 2.0, 0.5).normalize();
        let across = Vector3::z().cross(&normal).normalize();
        let way = across * 3.0 + across.cross(&normal) * 2.0;
        let locked = along(Vector3::x(), way, normal, END_ON).unwrap();
        assert_eq!((locked.y, locked.z), (0.0, 0.0));
        // What is left of the way is seen square to the axis.
        let seen = Vector3::x() - normal * normal.x;
        assert!((way - locked).dot(&seen).abs() < 1e-12);
        assert_eq!(along(Vector3::y(), Vector3::x(), Vector3::y(), END_ON), None, "end on");
    }
}
