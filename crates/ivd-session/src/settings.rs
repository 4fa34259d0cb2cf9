//! What a session's state follows from, and the events that change it.

use ivd_core::ParamError;
use ivd_core::op::Op as _;
use ivd_field::shape::Shape;
use ivd_field::warp::WarpParams;
use ivd_map::{BiharmonicParams, FemParams, OctreeParams};
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring::{self, Material};
use ivd_motion::ring::RingParams;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::numbered::{Id, Numbered, add, at, take};

/// Highest level of refinement: 4⁻¹⁶ of any lattice is nothing.
const COARSEST: u8 = 16;

/// How a lattice follows its handles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Physics {
    /// The thesis's rings.
    Ring(RingParams),
    /// Masses on springs.
    Springs(Box<mass_spring::Params>),
}

impl Default for Physics {
    fn default() -> Self {
        Self::Ring(RingParams::default())
    }
}

/// How the lattice's motion is carried to the voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "lowercase")]
pub enum MapChoice {
    /// Through the octree.
    Octree(OctreeParams),
    /// The smoothest motion.
    Biharmonic(BiharmonicParams),
    /// Elastic matter.
    Fem(FemParams),
}

impl Default for MapChoice {
    fn default() -> Self {
        Self::Octree(OctreeParams::default())
    }
}

impl MapChoice {
    /// # Errors
    /// Names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        match self {
            Self::Octree(params) => params.check(),
            Self::Biharmonic(params) => params.check(),
            Self::Fem(params) => params.check(),
        }
    }
}

/// All that a session's state follows from, beside its volume and lattice.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Level of refinement of the lattice that is deformed: 4⁻ᴸ of its vertices.
    pub level: u8,
    /// What moves.
    pub handles: Vec<Numbered<Handle>>,
    /// What stays.
    pub fixed: Vec<Numbered<Pin>>,
    /// How the lattice follows.
    pub physics: Physics,
    /// Changes of shape, after that.
    pub shapes: Vec<Numbered<Shape>>,
    /// How the voxels follow.
    pub map: MapChoice,
    /// How their values are found.
    pub warp: WarpParams,
}

/// A change of a session. Its JSON is the log's. Handles, fixes and shapes are called by numbers that stay while others come and go.
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
    /// Nothing moves: handles, fixes and shapes go.
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
            Self::Physics(_) => "choose a solver",
            Self::Stiffness { .. } => "change the stiffness",
            Self::Material { .. } => "change a material",
            Self::Map(_) => "choose a map",
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
            (Self::Stiffness { .. }, Self::Stiffness { .. })
            | (Self::Map(_), Self::Map(_))
            | (Self::Warp(_), Self::Warp(_))
            | (Self::Level(_), Self::Level(_)) => true,
            _ => false,
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

impl Settings {
    /// Checks every part by itself.
    ///
    /// # Errors
    /// [`ParamError`] names the first that is outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        if self.level > COARSEST {
            let problem = format!("{}", self.level);
            return Err(ParamError::new("level", problem, format!("use 0 to {COARSEST}")).into());
        }
        for handle in &self.handles {
            handle.check()?;
        }
        for fix in &self.fixed {
            fix.check()?;
        }
        match &self.physics {
            Physics::Ring(params) => params.check()?,
            Physics::Springs(params) => {
                params.check()?;
                if params.springs.frames != 1 {
                    let problem = format!("{} of them", params.springs.frames);
                    return Err(ParamError::new("frames", problem, "a session shows one").into());
                }
            }
        }
        for shape in &self.shapes {
            shape.check()?;
        }
        self.map.check()?;
        Ok(self.warp.check()?)
    }

    /// The settings after an event.
    ///
    /// # Errors
    /// An event that names what isn't there, or that the solver can't follow; settings outside their domain.
    pub fn after(&self, event: &Event) -> Result<Self, Error> {
        let mut next = self.clone();
        match event {
            Event::Add { id, handle } => add("handle", &mut next.handles, *id, *handle)?,
            Event::Remove { handle } => take("remove", "handle", &mut next.handles, *handle)?,
            Event::Move { handle, by } => {
                at("move", "handle", &mut next.handles, *handle)?.action = Action::Move(*by);
            }
            Event::Pull { handle, with } => {
                at("pull", "handle", &mut next.handles, *handle)?.action = Action::Force(*with);
            }
            Event::Place { handle, at: place } => {
                at("place", "handle", &mut next.handles, *handle)?.at = *place;
            }
            Event::Radius { handle, radius } => {
                at("radius", "handle", &mut next.handles, *handle)?.radius = *radius;
            }
            Event::Pin { id, pin } => add("fix", &mut next.fixed, *id, *pin)?,
            Event::Release { fix } => take("release", "fix", &mut next.fixed, *fix)?,
            Event::Shape { id, shape } => add("shape", &mut next.shapes, *id, *shape)?,
            Event::Unshape { shape } => take("unshape", "shape", &mut next.shapes, *shape)?,
            Event::Physics(physics) => next.physics = physics.clone(),
            Event::Stiffness { newton_per_metre } => match &mut next.physics {
                Physics::Ring(params) => params.stiffness = *newton_per_metre,
                Physics::Springs(params) => {
                    params.springs.stiffness = *newton_per_metre;
                    params.springs.youngs_kpa = None;
                }
            },
            Event::Material { class, material } => match &mut next.physics {
                Physics::Springs(params) => {
                    params.springs.material.insert(*class, *material);
                }
                Physics::Ring(_) => {
                    return Err(Error::Event {
                        event: "material",
                        problem: format!("class {class}, where rings know no classes"),
                        remedy: "choose masses on springs first",
                    });
                }
            },
            Event::Map(map) => next.map = map.clone(),
            Event::Warp(warp) => next.warp = warp.clone(),
            Event::Level(level) => next.level = *level,
            Event::Reset => {
                next.handles.clear();
                next.fixed.clear();
                next.shapes.clear();
            }
        }
        next.check()?;
        Ok(next)
    }
}
