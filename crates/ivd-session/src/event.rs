//! The events that change what a session's state follows from.

use ivd_field::shape::Shape;
use ivd_field::warp::WarpParams;
use ivd_map::space;
use ivd_motion::deform::Bone;
use ivd_motion::handles::{Anchor, Handle, Pin};
use ivd_motion::mass_spring::Material;
use ivd_motion::rigid::RigidTransform;
use serde::{Deserialize, Serialize};

use crate::clip::{ClipPart, ClipRule};
use crate::numbered::Id;
use crate::{MapChoice, Physics};

/// A change of a session. Its JSON is the log's. Members of lists, such as handles, are called by numbers that stay while others come and go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// A handle more, behind the others.
    Add {
        /// Its number; without it a new one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<Id>,
        /// The handle.
        #[serde(flatten)]
        handle: Handle,
    },
    /// A handle goes.
    Remove {
        /// Its number.
        handle: Id,
    },
    /// A handle moves its vertex by a vector, counted from rest.
    Move {
        /// Its number.
        handle: Id,
        /// The vector (mm, RAS).
        by: [f64; 3],
    },
    /// A handle pulls its vertex with a force.
    Pull {
        /// Its number.
        handle: Id,
        /// The force (mN, RAS).
        with: [f64; 3],
    },
    /// A handle takes another vertex.
    Place {
        /// Its number.
        handle: Id,
        /// The vertex.
        at: Anchor,
    },
    /// A handle reaches further, or less far.
    Radius {
        /// Its number.
        handle: Id,
        /// Radius (mm), > 0.
        radius: f64,
    },
    /// Vertices stay.
    Pin {
        /// The fix's number; without it a new one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<Id>,
        /// Which vertices.
        #[serde(flatten)]
        pin: Pin,
    },
    /// What stayed by a fix may move again.
    Release {
        /// The fix's number.
        fix: Id,
    },
    /// A change of shape more, after the others.
    Shape {
        /// Its number; without it a new one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<Id>,
        /// The change.
        #[serde(flatten)]
        shape: Shape,
    },
    /// A change of shape goes.
    Unshape {
        /// Its number.
        shape: Id,
    },
    /// A bone more: a part that moves as one; only for masses on springs.
    Bone {
        /// Its number; without it a new one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<Id>,
        /// The bone; without a name it is called by its number.
        bone: Box<Bone>,
    },
    /// A bone is moved by a motion that is given, counted from rest.
    Turn {
        /// Its number.
        bone: Id,
        /// The motion.
        to: RigidTransform,
    },
    /// A ball or capsule of bone holds more, or less.
    SetBone {
        /// Its number.
        bone: Id,
        /// How far from its middle, or its line (mm), > 0.
        radius: f64,
        /// How far from its vertices others may follow (mm).
        reach: f64,
    },
    /// A bone becomes soft again.
    RemoveBone {
        /// Its number.
        bone: Id,
    },
    /// A step in space more, after the map and the steps before it.
    Space {
        /// Its number; without it a new one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<Id>,
        /// What it does.
        step: space::Step,
    },
    /// A step in space does something else.
    SetSpace {
        /// Its number.
        space: Id,
        /// What it does.
        step: space::Step,
    },
    /// A step in space goes: a cut closes.
    RemoveSpace {
        /// Its number.
        space: Id,
    },
    /// The deformed volume is clipped by a plane or a box more.
    Clip {
        /// Its number; without it a new one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<Id>,
        /// What is kept.
        part: ClipPart,
    },
    /// A plane or a box lies elsewhere.
    MoveClip {
        /// Its number.
        clip: Id,
        /// What is kept.
        part: ClipPart,
    },
    /// A plane or a box clips no more.
    Unclip {
        /// Its number.
        clip: Id,
    },
    /// What planes and boxes are about.
    ClipRule(ClipRule),
    /// Another solver, or other parameters of it.
    Physics(Physics),
    /// Stiffness of the springs.
    Stiffness {
        /// Stiffness (N/m).
        newton_per_metre: f64,
    },
    /// What a class is made of; only for masses on springs.
    Material {
        /// Label of the class.
        class: u16,
        /// What it is made of.
        material: Material,
    },
    /// Another way to carry the motion to the voxels.
    Map(MapChoice),
    /// Another way to find values.
    Warp(WarpParams),
    /// Another level of refinement.
    Level(u8),
    /// Nothing moves: handles, fixes, shapes, bones and steps in space go.
    Reset,
}

impl Event {
    /// What it does, as an entry of a list of what can be undone.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Add { .. } => "add a handle",
            Self::Remove { .. } => "remove a handle",
            Self::Move { .. } => "move a handle",
            Self::Pull { .. } => "pull a handle",
            Self::Place { .. } => "place a handle",
            Self::Radius { .. } => "change a radius",
            Self::Pin { .. } => "pin",
            Self::Release { .. } => "release a pin",
            Self::Shape { .. } => "change a shape",
            Self::Unshape { .. } => "remove a change of shape",
            Self::Bone { .. } => "add a bone",
            Self::Turn { .. } => "turn a bone",
            Self::SetBone { .. } => "change a bone",
            Self::RemoveBone { .. } => "remove a bone",
            Self::Space { step: space::Step::Cut(_), .. } => "cut open",
            Self::Space { .. } => "displace space",
            Self::SetSpace { step: space::Step::Cut(_), .. } => "change a cut",
            Self::SetSpace { .. } => "change a step in space",
            Self::RemoveSpace { .. } => "remove a step in space",
            Self::Clip { .. } => "clip",
            Self::MoveClip { .. } => "change a clip",
            Self::Unclip { .. } => "remove a clip",
            Self::ClipRule(_) => "change how it is clipped",
            Self::Physics(_) => "change how the surface follows",
            Self::Stiffness { .. } => "change the stiffness",
            Self::Material { .. } => "change the stiffness of a class",
            Self::Map(_) => "change how voxels follow",
            Self::Warp(_) => "change how values are found",
            Self::Level(_) => "change the level",
            Self::Reset => "reset",
        }
    }

    /// Whether the settings after it are the same with and without `last` right before it.
    pub(crate) fn replaces(&self, last: &Self) -> bool {
        match (self, last) {
            // A pull is no move: the solver may refuse one of them.
            (Self::Move { handle: a, .. }, Self::Move { handle: b, .. })
            | (Self::Pull { handle: a, .. }, Self::Pull { handle: b, .. })
            | (Self::Place { handle: a, .. }, Self::Place { handle: b, .. })
            | (Self::Radius { handle: a, .. }, Self::Radius { handle: b, .. }) => a == b,
            (Self::Turn { bone: a, .. }, Self::Turn { bone: b, .. })
            | (Self::SetBone { bone: a, .. }, Self::SetBone { bone: b, .. })
            | (Self::SetSpace { space: a, .. }, Self::SetSpace { space: b, .. })
            | (Self::MoveClip { clip: a, .. }, Self::MoveClip { clip: b, .. }) => a == b,
            (Self::Material { class: a, .. }, Self::Material { class: b, .. }) => a == b,
            (Self::Stiffness { .. }, Self::Stiffness { .. })
            | (Self::ClipRule(_), Self::ClipRule(_))
            | (Self::Map(_), Self::Map(_))
            | (Self::Warp(_), Self::Warp(_))
            | (Self::Level(_), Self::Level(_)) => true,
            _ => false,
        }
    }

    /// The number that it gives, and the list that this is of.
    pub(crate) fn number_mut(&mut self) -> Option<(&mut Option<Id>, List)> {
        match self {
            Self::Add { id, .. } => Some((id, List::Handles)),
            Self::Pin { id, .. } => Some((id, List::Fixed)),
            Self::Shape { id, .. } => Some((id, List::Shapes)),
            Self::Bone { id, .. } => Some((id, List::Bones)),
            Self::Space { id, .. } => Some((id, List::Space)),
            Self::Clip { id, .. } => Some((id, List::Clips)),
            _ => None,
        }
    }

    /// Where it picks a vertex, if it does.
    pub(crate) fn anchor_mut(&mut self) -> Option<&mut Anchor> {
        match self {
            Self::Add { handle, .. } => Some(&mut handle.at),
            Self::Place { at, .. } => Some(at),
            Self::Pin { pin, .. } => Some(&mut pin.at),
            _ => None,
        }
    }
}

/// The lists whose members have numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum List {
    Handles,
    Fixed,
    Shapes,
    Bones,
    Space,
    Clips,
}

impl List {
    /// How many there are.
    pub(crate) const COUNT: usize = 6;
}
