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
    pub handles: Vec<Handle>,
    /// What stays.
    pub fixed: Vec<Pin>,
    /// How the lattice follows.
    pub physics: Physics,
    /// Changes of shape, after that.
    pub shapes: Vec<Shape>,
    /// How the voxels follow.
    pub map: MapChoice,
    /// How their values are found.
    pub warp: WarpParams,
}

/// A change of a session. Its JSON is the log's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// A handle more, behind the others.
    Add(Handle),
    /// Handle `handle` goes; those behind it move up.
    Remove {
        /// Number of the handle, from 0.
        handle: usize,
    },
    /// A handle moves its vertex by a vector, counted from rest.
    Move {
        /// Number of the handle, from 0.
        handle: usize,
        /// The vector (mm, RAS).
        by: [f64; 3],
    },
    /// A handle pulls its vertex with a force.
    Pull {
        /// Number of the handle, from 0.
        handle: usize,
        /// The force (mN, RAS).
        with: [f64; 3],
    },
    /// A handle takes another vertex.
    Place {
        /// Number of the handle, from 0.
        handle: usize,
        /// The vertex.
        at: Anchor,
    },
    /// A handle reaches further, or less far.
    Radius {
        /// Number of the handle, from 0.
        handle: usize,
        /// Radius (mm), > 0.
        radius: f64,
    },
    /// Vertices stay.
    Pin(Pin),
    /// What stayed by fix `fix` may move again; those behind it move up.
    Release {
        /// Number of the fix, from 0.
        fix: usize,
    },
    /// A change of shape more, after the others.
    Shape(Shape),
    /// Shape `shape` goes; those behind it move up.
    Unshape {
        /// Number of the shape, from 0.
        shape: usize,
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
            Event::Add(handle) => next.handles.push(*handle),
            Event::Remove { handle } => {
                at("remove", "handle", &mut next.handles, *handle)?;
                next.handles.remove(*handle);
            }
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
            Event::Pin(fix) => next.fixed.push(*fix),
            Event::Release { fix } => {
                at("release", "fix", &mut next.fixed, *fix)?;
                next.fixed.remove(*fix);
            }
            Event::Shape(shape) => next.shapes.push(*shape),
            Event::Unshape { shape } => {
                at("unshape", "shape", &mut next.shapes, *shape)?;
                next.shapes.remove(*shape);
            }
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

/// The one of a number.
fn at<'a, T>(event: &'static str, what: &str, all: &'a mut [T], number: usize) -> Result<&'a mut T, Error> {
    let count = all.len();
    all.get_mut(number).ok_or_else(|| Error::Event {
        event,
        problem: format!("{what} {number} where there are {count}"),
        remedy: "count from 0, in the order in which they came",
    })
}
