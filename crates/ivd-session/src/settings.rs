//! What a session's state follows from.

use ivd_core::ParamError;
use ivd_core::op::Op as _;
use ivd_field::shape::Shape;
use ivd_field::warp::WarpParams;
use ivd_lattice::refine::{RefineParams, Target};
use ivd_map::space::{self, Step};
use ivd_map::{BiharmonicParams, FemParams, OctreeParams, Outside};
use ivd_motion::deform::Bone;
use ivd_motion::handles::{Action, Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::rigid::BoneSpec;
use ivd_motion::ring::RingParams;
use serde::{Deserialize, Serialize};

use crate::clip::{Clip, ClipRule};
use crate::event::List;
use crate::numbered::{Id, Numbered, add, at, next_id, plain, take};
use crate::{Error, Event};

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

    /// Whether the part moves alone.
    fn is_free(&self) -> bool {
        let band = match self {
            Self::Octree(params) => &params.band,
            Self::Biharmonic(params) => &params.band,
            Self::Fem(params) => &params.band,
        };
        band.outside == Outside::Free
    }
}

/// All that a session's state follows from, beside its volume and lattice.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Level of refinement of the lattice that is deformed: 4⁻ᴸ of its vertices.
    pub level: u8,
    /// Longest edge (mm) that refinement to that level makes; none where any may be. With each level more it is twice as long.
    pub max_edge: Option<f64>,
    /// What moves.
    pub handles: Vec<Numbered<Handle>>,
    /// What stays.
    pub fixed: Vec<Numbered<Pin>>,
    /// How the lattice follows.
    pub physics: Physics,
    /// Changes of shape, after that.
    pub shapes: Vec<Numbered<Shape>>,
    /// What moves as one; only with masses on springs.
    pub bones: Vec<Numbered<Bone>>,
    /// How the voxels follow.
    pub map: MapChoice,
    /// Steps in space, after that.
    pub space: Vec<Numbered<Step>>,
    /// How their values are found.
    pub warp: WarpParams,
    /// What of the deformed volume is kept.
    pub clip: Clip,
}

impl Settings {
    /// How the lattice is refined to a level.
    pub(crate) fn refinement(&self, level: u8) -> RefineParams {
        let target = Target::Level(level).into();
        RefineParams { target, max_edge: self.max_edge_at(level), ..RefineParams::default() }
    }

    /// The longest edge that refinement to a level makes (mm).
    fn max_edge_at(&self, level: u8) -> Option<f64> {
        self.max_edge.map(|mm| mm * 2.0_f64.powi(i32::from(level) - i32::from(self.level)))
    }

    /// Checks every part by itself, and what goes together.
    ///
    /// # Errors
    /// [`ParamError`] names the first that is outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        if self.level > COARSEST {
            let problem = format!("{}", self.level);
            return Err(ParamError::new("level", problem, format!("use 0 to {COARSEST}")).into());
        }
        self.refinement(self.level).check()?;
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
        self.check_bones()?;
        self.check_space()?;
        self.clip.check()?;
        Ok(self.warp.check()?)
    }

    fn check_bones(&self) -> Result<(), Error> {
        self.bone_specs()?;
        match &self.physics {
            Physics::Ring(_) if !self.bones.is_empty() => Err(Error::Event {
                event: "bone",
                problem: "rings know no bones".into(),
                remedy: "choose masses on springs, or take the bones away",
            }),
            _ => Ok(()),
        }
    }

    fn check_space(&self) -> Result<(), Error> {
        space::check(&plain(&self.space), self.moves_lattice())?;
        if !self.space.is_empty() && self.moves_lattice() && self.map.is_free() {
            return Err(Error::Event {
                event: "space",
                problem: "a part that moves alone leaves a gap, and no step in space goes on across that"
                    .into(),
                remedy: "let a band move along (map.outside = \"band\"), or take the steps away",
            });
        }
        Ok(())
    }

    /// Whether there is something that moves the lattice.
    pub(crate) fn moves_lattice(&self) -> bool {
        !(self.handles.is_empty() && self.bones.is_empty() && self.shapes.is_empty())
    }

    /// Whether the lattice moves as with other settings.
    pub(crate) fn move_alike(&self, other: &Self) -> bool {
        let Self {
            level,
            max_edge,
            handles,
            fixed,
            shapes,
            bones,
            physics,
            map: _,
            space: _,
            warp: _,
            clip: _,
        } = self;
        (*level, *max_edge, handles, fixed) == (other.level, other.max_edge, &other.handles, &other.fixed)
            && (shapes, bones, physics) == (&other.shapes, &other.bones, &other.physics)
    }

    /// Whether something goes by classes, and labels are needed.
    pub fn knows_classes(&self) -> bool {
        let by_material = match (&self.physics, &self.map) {
            (Physics::Springs(params), _) if !params.springs.material.is_empty() => true,
            (_, MapChoice::Fem(params)) => !params.material.is_empty(),
            _ => false,
        };
        let by_links = |step: &Step| matches!(step, Step::Chain(mail) if !mail.material.is_empty());
        by_material
            || self.bones.iter().any(|bone| bone.class.is_some())
            || self.space.iter().any(|step| by_links(step))
    }

    /// The bones as solvers take them.
    pub(crate) fn bone_specs(&self) -> Result<Vec<BoneSpec>, Error> {
        let read = |(i, bone): (usize, &Numbered<Bone>)| Ok(bone.read(i)?);
        self.bones.iter().enumerate().map(read).collect()
    }

    /// Gives each bone a name of its own: what it is called by doesn't change when another goes.
    pub(crate) fn name_bones(&mut self) {
        for (i, bone) in self.bones.iter_mut().enumerate() {
            bone.what.name.get_or_insert_with(|| i.to_string());
        }
    }

    /// By list, the first number that is above all others.
    pub(crate) fn next_ids(&self) -> [Id; List::COUNT] {
        let mut next = [0; List::COUNT];
        next[List::Handles as usize] = next_id(&self.handles);
        next[List::Fixed as usize] = next_id(&self.fixed);
        next[List::Shapes as usize] = next_id(&self.shapes);
        next[List::Bones as usize] = next_id(&self.bones);
        next[List::Space as usize] = next_id(&self.space);
        next[List::Clips as usize] = next_id(&self.clip.parts);
        next
    }

    /// The settings after an event.
    ///
    /// # Errors
    /// An event that names what isn't there, or that the solver can't follow; settings outside their domain.
    pub fn after(&self, event: &Event) -> Result<Self, Error> {
        let next = self.changed(event)?;
        next.check()?;
        Ok(next)
    }

    /// The settings after several events, of which the last state counts alone: the ways there may not even be possible.
    ///
    /// # Errors
    /// As [`Settings::after`].
    pub(crate) fn after_all<'a>(&self, events: impl IntoIterator<Item = &'a Event>) -> Result<Self, Error> {
        let next = events.into_iter().try_fold(self.clone(), |settings, event| settings.changed(event))?;
        next.check()?;
        Ok(next)
    }

    /// The settings after an event, unchecked.
    fn changed(&self, event: &Event) -> Result<Self, Error> {
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
            Event::Bone { id, bone } => add("bone", &mut next.bones, *id, (**bone).clone())?,
            Event::Turn { bone, to } => {
                let bone = at("turn", "bone", &mut next.bones, *bone)?;
                (bone.pivot, bone.axis, bone.angle) = (Some(to.pivot), Some(to.axis), Some(to.angle));
                (bone.by, bone.fit) = ((to.by != [0.0; 3]).then_some(to.by), false);
            }
            Event::SetBone { bone, radius, reach } => {
                let bone = at("set_bone", "bone", &mut next.bones, *bone)?;
                if bone.radius.is_none() {
                    return Err(Error::Event {
                        event: "set_bone",
                        problem: "what it holds goes by no radius".into(),
                        remedy: "name a bone that is a ball or a capsule",
                    });
                }
                (bone.radius, bone.reach) = (Some(*radius), *reach);
            }
            Event::RemoveBone { bone } => take("remove_bone", "bone", &mut next.bones, *bone)?,
            Event::Space { id, step } => add("step in space", &mut next.space, *id, step.clone())?,
            Event::SetSpace { space, step } => {
                step.clone_into(at("set_space", "step in space", &mut next.space, *space)?);
            }
            Event::RemoveSpace { space } => take("remove_space", "step in space", &mut next.space, *space)?,
            Event::Clip { id, part } => add("clip", &mut next.clip.parts, *id, *part)?,
            Event::MoveClip { clip, part } => *at("move_clip", "clip", &mut next.clip.parts, *clip)? = *part,
            Event::Unclip { clip } => {
                take("unclip", "clip", &mut next.clip.parts, *clip)?;
                if next.clip.parts.is_empty() {
                    next.clip.rule = ClipRule::default();
                }
            }
            Event::ClipRule(rule) => next.clip.rule = *rule,
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
            Event::Level(level) => (next.max_edge, next.level) = (next.max_edge_at(*level), *level),
            Event::Reset => {
                next.handles.clear();
                next.fixed.clear();
                next.shapes.clear();
                next.bones.clear();
                next.space.clear();
            }
        }
        Ok(next)
    }
}
