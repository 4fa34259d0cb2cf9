//! Bones that are drawn: what lies round a line moves as one.

use ivd_core::VoxelCoord;
use ivd_motion::deform;
use ivd_motion::rigid::RigidTransform;
use ivd_session::{Event, Id, Numbered, Physics};
use nalgebra::Vector3;

use super::{Model, no_more_than, nothing_there};
use crate::figures::Bone;
use crate::request::MOST_HANDLES;
use crate::{Error, Pane, Shows};

/// A new bone holds what lies as near to its line as this share of its length, ...
const RADIUS: f64 = 0.25;
/// ... and what lies as near to that as this share may follow.
const REACH: f64 = 1.0;
/// A line is no shorter than so many voxel diagonals: a click is none.
const SHORTEST: f64 = 2.0;

fn wrong(problem: &str, remedy: &'static str) -> Error {
    Error::Request { what: "bone", problem: problem.to_owned(), remedy }
}

impl Model {
    /// Makes a bone along a line that is drawn over a picture, which turns in that picture's plane about where the line begins. A line that begins at an end of
    /// another bone makes a joint there: that bone carries the new one.
    pub(super) fn draw_bone(&mut self, pane: Pane, from: [f64; 2], to: [f64; 2]) -> Result<(), Error> {
        self.check_seen_now("bone", &[from, to])?;
        let seen = |at| {
            let place = self.look(pane, at)?;
            place.map(|place| self.rest_of(place)).ok_or_else(|| nothing_there("bone"))
        };
        let (last, joint) = (seen(to)?, self.joint_near(pane, from));
        let (first, carrier) = match joint {
            Some((end, carrier)) => (end, Some(carrier)),
            None => (seen(from)?, None),
        };
        let grid = self.session.rest().grid();
        let towards_eye = match self.panes.planes.plane(pane) {
            None => Vector3::from(self.lens.sight(joint.map_or(first, |(end, id)| self.place_on(id, end)))),
            Some(plane) => {
                let [right, down] = plane.ways(grid).map(Vector3::from);
                -right.cross(&down)
            }
        };
        self.add_bone([first, last], towards_eye, carrier)
    }

    /// Makes a bone between two places as they are shown.
    pub(super) fn place_bone(&mut self, ends: [[f64; 3]; 2]) -> Result<(), Error> {
        let ends = ends.map(|end| self.at_rest(end));
        self.add_bone(ends, Vector3::z(), None)
    }

    /// Makes a bone between two places at rest, which turns about the first.
    fn add_bone(
        &mut self,
        ends: [[f64; 3]; 2],
        axis: Vector3<f64>,
        carrier: Option<Id>,
    ) -> Result<(), Error> {
        self.let_go_of_handles()?;
        let settings = self.session.settings();
        if matches!(settings.physics, Physics::Ring(_)) {
            return Err(wrong("distance alone knows no bones", "let the surface follow by springs first"));
        }
        no_more_than(MOST_HANDLES, settings.bones.len())?;
        let [from, to] = ends;
        let length = (Vector3::from(to) - Vector3::from(from)).norm();
        if length < SHORTEST * self.session.rest().grid().voxel_diagonal() {
            return Err(wrong(
                "the line is too short",
                "draw a line along it, from its joint to its other end",
            ));
        }
        let parent = settings.bones.iter().find(|one| Some(one.id) == carrier);
        // About a joint both would hold the same: between them lies what bends.
        let radius = RADIUS * length;
        let apart = parent.map_or(0.0, |one| one.what.radius.unwrap_or(radius) + radius).min(0.5 * length);
        let begins: [f64; 3] = std::array::from_fn(|a| from[a] + (to[a] - from[a]) * apart / length);
        let bone = deform::Bone {
            parent: parent.map(name),
            from: Some(begins),
            to: Some(to),
            radius: Some(radius),
            pivot: Some(from),
            axis: Some(axis.normalize().into()),
            angle: Some(0.0),
            reach: REACH * length,
            ..deform::Bone::default()
        };
        self.apply(Event::Bone { id: None, bone: Box::new(bone) })
    }

    /// Lets a bone turn about where the slices meet.
    pub(super) fn join(&mut self, bone: Id) -> Result<(), Error> {
        let there = self.session.settings().bones.iter().find(|one| one.id == bone);
        let there = there.ok_or_else(|| wrong("there is none of that number", "name one that is told"))?;
        if there.what.fit {
            return Err(wrong("it goes where its handles go", "turn it by them"));
        }
        let Bone { axis, angle, by, .. } = self.told_bone(there);
        let cross = VoxelCoord(self.panes.planes.cross.into());
        let pivot = self.at_rest(self.session.rest().grid().world(cross).0.into());
        self.apply(Event::Turn { bone, to: RigidTransform { pivot, axis, angle, by } })
    }

    /// Where a place that is shown lies at rest.
    fn at_rest(&self, place: [f64; 3]) -> [f64; 3] {
        if self.compared.shows == Shows::Rest { place } else { self.rest_of(place) }
    }

    /// The end of a bone that a pane shows at a place, at rest, and that bone; the newest first.
    fn joint_near(&self, pane: Pane, at: [f64; 2]) -> Option<([f64; 3], Id)> {
        let bones = self.session.settings().bones.iter().rev();
        let ends = bones.flat_map(|one| ends(&one.what).into_iter().flatten().map(move |end| (end, one.id)));
        let near = ends.filter_map(|(end, id)| {
            let away = self.away(pane, self.place_on(id, end), at)?;
            Some((away, end, id))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, end, id)| (end, id))
    }

    /// Where a place of a bone is shown that lies so at rest: as what carries it goes, and it on that; where handles say how that goes, as the voxels there.
    fn place_on(&self, bone: Id, rest: [f64; 3]) -> [f64; 3] {
        if self.compared.shows == Shows::Rest {
            return rest;
        }
        let bones = &self.session.settings().bones;
        let mut next = bones.iter().find(|one| one.id == bone);
        let mut place = rest;
        for _ in 0..bones.len() {
            let Some(one) = next else { return place };
            if one.what.fit {
                return self.session.moved(rest);
            }
            place = motion(&one.what).carries(place);
            next = bones.iter().find(|carrier| Some(name(carrier)) == one.what.parent);
        }
        place
    }

    /// What is told of the bones.
    pub(crate) fn told_bones(&self) -> Vec<Bone> {
        self.session.settings().bones.iter().map(|one| self.told_bone(one)).collect()
    }

    /// A bone; one without a point to turn about turns about the middle of where it is said to lie.
    fn told_bone(&self, one: &Numbered<deform::Bone>) -> Bone {
        let told = &one.what;
        let grid = self.session.rest().grid();
        let ends = ends(told).map(|ends| ends.map(|end| self.place_on(one.id, end)));
        let at = ends.map(|ends| ends.map(|end| self.panes.shares(grid, &self.lens, end)));
        let RigidTransform { axis, angle, by, .. } = motion(told);
        Bone {
            id: one.id,
            name: name(one),
            pivot: told.pivot.or(told.ball().0),
            axis,
            angle,
            by,
            carried: told.parent.is_some(),
            fitted: told.fit,
            radius: told.radius,
            reach: told.reach,
            at: [0, 1, 2, 3].map(|pane| at.and_then(|[from, to]| Some([from[pane]?, to[pane]?]))),
            beside: ends.map_or([false; 4], |ends| self.panes.planes.beside(grid, &ends)),
        }
    }
}

/// How a bone is told to move, from where what carries it has brought it.
fn motion(bone: &deform::Bone) -> RigidTransform {
    let none = RigidTransform::NONE;
    RigidTransform {
        pivot: bone.pivot.unwrap_or(none.pivot),
        axis: bone.axis.unwrap_or(none.axis),
        angle: bone.angle.unwrap_or(none.angle),
        by: bone.by.unwrap_or(none.by),
    }
}

/// What a bone is called.
fn name(one: &Numbered<deform::Bone>) -> String {
    one.what.name.clone().unwrap_or_else(|| one.id.to_string())
}

/// The ends of the line that a bone lies along, where it does: of one that another carries from their joint on.
fn ends(bone: &deform::Bone) -> Option<[[f64; 3]; 2]> {
    let joint = bone.pivot.filter(|_| bone.parent.is_some());
    bone.from.zip(bone.to).map(|(from, to)| [joint.unwrap_or(from), to])
}
