use ivd_core::op::Failure;
use ivd_core::{Artefact, Lattice, ParamError, Value as _, Volume};
use ivd_field::shape::Shape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::elastic::ElasticParams;
use crate::handles::{self, Anchor, Pick};
use crate::mass_spring::{self, Closeness, Descent, Solver, Springs};
use crate::rigid::BoneSpec;
use crate::ring::RingParams;

use super::bone::Bone;
use super::handle::{Handle, Pin};

/// What moves a lattice and what holds it, whichever way it follows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Moves {
    /// Vertices that are moved or pulled, and how far round them the lattice follows.
    pub handle: Vec<Handle>,
    /// Vertices that stay where they are.
    pub fix: Vec<Pin>,
    /// Changes of shape, each after what the solver does with the handles and the shapes before it.
    pub shape: Vec<Shape>,
}

/// The thesis's rings: a handle moves or pulls one vertex, and rings of neighbours round it follow.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RingMethod {
    /// The springs.
    #[serde(flatten)]
    pub ring: RingParams,
    /// What moves.
    #[serde(flatten)]
    pub moves: Moves,
}

/// Masses on springs with all that any of their solvers reads.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Body {
    /// The springs.
    #[serde(flatten)]
    pub springs: Springs,
    /// What moves.
    #[serde(flatten)]
    pub moves: Moves,
    /// Bones: what moves as one.
    pub rigid: Vec<Bone>,
}

/// Masses on springs, stepped explicitly through time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DynamicsMethod {
    /// The body.
    #[serde(flatten)]
    pub body: Body,
}

/// Masses on springs, taken to the balance of forces, or stepped implicitly.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ProjectiveMethod {
    /// The body.
    #[serde(flatten)]
    pub body: Body,
    /// How closely.
    #[serde(flatten)]
    pub closeness: Closeness,
    /// In which steps.
    #[serde(flatten)]
    pub descent: Descent,
}

/// Masses on springs, stepped implicitly, constraint by constraint; to compare.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct XpbdMethod {
    /// The body.
    #[serde(flatten)]
    pub body: Body,
    /// How closely.
    #[serde(flatten)]
    pub closeness: Closeness,
}

/// The body that the lattice lies in, as elastic matter: it moves with the lattice (`map.method = "body"`).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ElasticMethod {
    /// The matter.
    #[serde(flatten)]
    pub elastic: ElasticParams,
    /// What moves.
    #[serde(flatten)]
    pub moves: Moves,
    /// Bones: what moves as one.
    pub rigid: Vec<Bone>,
}

impl ElasticMethod {
    /// The bones as solvers take them.
    ///
    /// # Errors
    /// One whose keys don't go together.
    pub fn bones(&self) -> Result<Vec<BoneSpec>, ParamError> {
        read_bones(&self.rigid)
    }

    /// Whether classes are looked at.
    pub(super) fn knows_classes(&self) -> bool {
        self.elastic.knows_classes() || self.rigid.iter().any(|bone| bone.class.is_some())
    }
}

impl DynamicsMethod {
    /// What the solver is told.
    pub fn params(&self) -> mass_spring::Params {
        let springs = self.body.springs.clone();
        mass_spring::Params { solver: Solver::Dynamics, springs, ..mass_spring::Params::default() }
    }
}

impl ProjectiveMethod {
    /// What the solver is told.
    pub fn params(&self) -> mass_spring::Params {
        let (springs, closeness) = (self.body.springs.clone(), self.closeness);
        mass_spring::Params { solver: Solver::Projective, springs, closeness, descent: self.descent }
    }
}

impl XpbdMethod {
    /// What the solver is told.
    pub fn params(&self) -> mass_spring::Params {
        let (springs, closeness) = (self.body.springs.clone(), self.closeness);
        mass_spring::Params { solver: Solver::Xpbd, springs, closeness, descent: Descent::default() }
    }
}

/// Names the element of a list that a problem is of.
fn each<T, U>(
    list: &[T],
    key: &str,
    of: impl Fn(usize, &T) -> Result<U, ParamError>,
) -> Result<Vec<U>, ParamError> {
    let one = |(i, item)| of(i, item).map_err(|problem| problem.under(&i.to_string()).under(key));
    list.iter().enumerate().map(one).collect()
}

/// Bones as solvers take them.
fn read_bones(bones: &[Bone]) -> Result<Vec<BoneSpec>, ParamError> {
    each(bones, "rigid", |i, bone| bone.read(i))
}

impl Moves {
    /// The handles as solvers take them.
    ///
    /// # Errors
    /// One without exactly one place and one action.
    pub fn handles(&self) -> Result<Vec<handles::Handle>, ParamError> {
        each(&self.handle, "handle", |_, handle| handle.read())
    }

    /// The fixed places as solvers take them.
    pub fn fixed(&self) -> Vec<handles::Pin> {
        self.fix.iter().map(Pin::read).collect()
    }

    /// The vertices that the handles take, and those in the middle of the fixed places.
    ///
    /// # Errors
    /// Those of [`handles::find_picks`].
    pub(super) fn picks(&self, lattice: &Lattice) -> Result<[Vec<Pick>; 2], Failure> {
        let (handles, fixed) = (self.handles()?, self.fixed());
        Ok([
            handles::find_picks(lattice, "handle", handles.iter().map(|handle| &handle.at))?,
            handles::find_picks(lattice, "fixed vertex", fixed.iter().map(|pin| &pin.at))?,
        ])
    }

    /// Whether points lie near enough to the volume, or to a lattice that the one which will move is made from. Numbers count in that one: they can't be
    /// looked at before.
    ///
    /// # Errors
    /// Those of [`handles::find_picks`] and [`handles::check_within`].
    pub(super) fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure> {
        if let Some(volume) = Volume::of(value) {
            let (handles, fixed) = (self.handles()?, self.fixed());
            handles::check_within(volume.grid(), "handle", handles.iter().map(|handle| &handle.at))?;
            handles::check_within(volume.grid(), "fixed vertex", fixed.iter().map(|pin| &pin.at))?;
            return Ok(());
        }
        let Some(lattice) = Lattice::of(value).filter(|_| slot == "lattice") else { return Ok(()) };
        let points = |of: Vec<Anchor>| {
            of.into_iter().filter(|at| matches!(at, Anchor::NearestTo(_))).collect::<Vec<_>>()
        };
        let handles = points(self.handles()?.iter().map(|handle| handle.at).collect());
        let fixed = points(self.fixed().iter().map(|pin| pin.at).collect());
        handles::find_picks(lattice, "handle", &handles)?;
        handles::find_picks(lattice, "fixed vertex", &fixed)?;
        Ok(())
    }

    /// What the schema of a single field can't say.
    pub(super) fn check_together(&self) -> Result<(), ParamError> {
        self.handles()?;
        each(&self.fix, "fix", |_, fix| fix.read().check())?;
        each(&self.shape, "shape", |_, shape| shape.check_together())?;
        Ok(())
    }
}

impl Body {
    /// The bones as solvers take them.
    ///
    /// # Errors
    /// One whose keys don't go together.
    pub fn bones(&self) -> Result<Vec<BoneSpec>, ParamError> {
        read_bones(&self.rigid)
    }

    /// What the schema of a single field can't say.
    pub(super) fn check_together(&self) -> Result<(), ParamError> {
        self.springs.check_together()?;
        self.moves.check_together()?;
        self.bones().map(|_| ())
    }

    /// Whether classes are looked at.
    pub(super) fn knows_classes(&self) -> bool {
        let solves = !(self.moves.handle.is_empty() && self.rigid.is_empty());
        (solves && !self.springs.material.is_empty()) || self.rigid.iter().any(|bone| bone.class.is_some())
    }
}
