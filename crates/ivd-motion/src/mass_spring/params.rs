use std::collections::BTreeMap;

use ivd_core::ParamError;
use ivd_core::op::{by_class, check_fields};
use ivd_elastic::Tissue;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::handles::{Action, Handle};

/// How the equations of motion or of balance are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// Symplectic Euler in time, with as many sub-steps as stability asks for.
    #[default]
    Dynamics,
    /// Quasi-Newton on the factored matrix of projective dynamics: the balance of forces, or implicit Euler in time.
    Projective,
    /// Gauss–Seidel over the springs as compliant constraints, implicit Euler in time; to compare.
    Xpbd,
}

/// How handles come to their full motion or force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LoadRamp {
    /// `3τ² − 2τ³`: it starts and ends without a jerk.
    #[default]
    Smooth,
    /// `τ`.
    Linear,
}

/// What a class is made of. A value that isn't given is that of the whole lattice.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// What it is: gives its Young's modulus where neither that nor a stiffness is given. Vertices beside bone stay where they are, unless
    /// a bone of the scene moves them.
    pub tissue: Option<Tissue>,
    /// Stiffness of a structural spring.
    #[schemars(range(min = 1e-9, max = 1e15), extend("x-unit" = "N/m"))]
    pub stiffness: Option<f64>,
    /// Young's modulus, instead of `stiffness`.
    #[schemars(range(min = 1e-9, max = 1e15), extend("x-unit" = "kPa"))]
    pub youngs_kpa: Option<f64>,
    /// Mass of the surface.
    #[schemars(range(min = 1e-12, max = 1e6), extend("x-unit" = "g/mm²"))]
    pub density: Option<f64>,
}

impl Material {
    /// Whether its vertices stay: of bone that has been given neither modulus nor stiffness.
    pub(super) fn is_rigid(&self) -> bool {
        self.tissue == Some(Tissue::Bone) && self.youngs_kpa.is_none() && self.stiffness.is_none()
    }

    /// Young's modulus (kPa), as far as it is given.
    pub(super) fn young(&self) -> Option<f64> {
        let named = self.tissue.filter(|_| self.stiffness.is_none()).and_then(Tissue::moduli);
        self.youngs_kpa.or(named.map(|n| n.0))
    }
}

/// What the springs are, and how the body moves, whichever way that is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Springs {
    /// Stiffness of a structural spring.
    #[schemars(range(min = 1e-9, max = 1e15), extend("x-unit" = "N/m"))]
    pub stiffness: f64,
    /// Young's modulus, instead of `stiffness`; what a spring makes of it goes by the triangles beside it and `thickness`.
    #[schemars(range(min = 1e-9, max = 1e15), extend("x-unit" = "kPa"))]
    pub youngs_kpa: Option<f64>,
    /// Thickness of the sheet that the lattice stands for; only with a Young's modulus.
    #[schemars(range(min = 1e-6, max = 1e6), extend("x-unit" = "mm"))]
    pub thickness: f64,
    /// Stiffness of a shear spring, as a fraction of a structural one's.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1"))]
    pub shear: f64,
    /// Stiffness of a flexion spring, as a fraction of a structural one's.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1"))]
    pub flexion: f64,
    /// Stiffness of the spring that ties a vertex to its place, as a fraction of its structural springs' mean.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1"))]
    pub ground: f64,
    /// Whether springs push when they are shorter than at rest. Default: where a handle pulls with a force, which they bear, and where bones move. Where
    /// handles alone move vertices, a sheet that is pressed gives way as skin does in folds; springs that push would buckle, and throw what lies about the
    /// handle aside. One force or bone decides for the whole lattice.
    pub push: Option<bool>,
    /// Strain beyond which a hundredfold stiffness more pulls. Without it there is no such limit.
    #[schemars(range(min = 0.0, max = 1e3), extend("x-unit" = "1"))]
    pub strain_limit: Option<f64>,
    /// Mass of the surface; vertices share the mass of their triangles.
    #[schemars(range(min = 1e-12, max = 1e6), extend("x-unit" = "g/mm²"))]
    pub density: f64,
    /// Mass of every vertex, instead of any density.
    #[schemars(range(min = 1e-12, max = 1e9), extend("x-unit" = "g"))]
    pub vertex_mass: Option<f64>,
    /// What classes are made of, where labels are given: a vertex takes that of the voxel just inside the surface.
    #[serde(deserialize_with = "by_class")]
    pub material: BTreeMap<u16, Material>,
    /// Viscous drag: a vertex loses this fraction of its velocity a second.
    #[schemars(range(min = 0.0, max = 1e9), extend("x-unit" = "1/s"))]
    pub drag: f64,
    /// Radius within which a handle grips the vertices connected to its own; they move as one. Default: a tenth of the handle's radius,
    /// but at least as far as its neighbours if they lie within three tenths. 0 grips that vertex alone, which pulls a spike out of a fine mesh that voxels can't follow.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub grip: Option<f64>,
    /// Time of the motion.
    #[schemars(range(min = 1e-9, max = 1e6), extend("x-unit" = "s"))]
    pub duration: f64,
    /// Time step. Without it as the solver chooses; dynamics divides it where it isn't stable.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0, "x-knob" = "accuracy"))]
    pub dt: Option<f64>,
    /// Time in which handles come to their full motion or force. Without it the duration.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "s"))]
    pub ramp: Option<f64>,
    /// How handles come to their full motion or force.
    pub course: LoadRamp,
    /// Frames of the motion, evenly in time.
    #[schemars(range(min = 1, max = 10_000), extend("x-unit" = "1"))]
    pub frames: usize,
}

impl Default for Springs {
    fn default() -> Self {
        Self {
            stiffness: 50.0,
            youngs_kpa: None,
            thickness: 1.0,
            shear: 0.5,
            flexion: 0.5,
            ground: 0.0,
            push: None,
            strain_limit: None,
            density: 1e-3,
            vertex_mass: None,
            material: BTreeMap::new(),
            drag: 100.0,
            grip: None,
            duration: 0.2,
            dt: None,
            ramp: None,
            course: LoadRamp::Smooth,
            frames: 1,
        }
    }
}

/// How closely an implicit solver comes to what it looks for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Closeness {
    /// Relative gradient at which a step or frame is done.
    #[schemars(range(min = 1e-14, max = 1.0), extend("x-unit" = "1", "x-knob" = "accuracy"))]
    pub tolerance: f64,
    /// Most iterations for a step or frame.
    #[schemars(range(min = 1, max = 1_000_000), extend("x-unit" = "1"))]
    pub max_iterations: usize,
}

impl Default for Closeness {
    fn default() -> Self {
        Self { tolerance: 1e-3, max_iterations: 1000 }
    }
}

/// What [`Solver::Projective`] alone is told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Descent {
    /// Whether masses count: implicit Euler in time instead of the balance of forces at each frame.
    pub inertia: bool,
    /// Steps that the quasi-Newton method remembers; 0 is plain local–global iteration.
    #[schemars(range(min = 0, max = 100), extend("x-unit" = "1"))]
    pub history: usize,
}

impl Default for Descent {
    fn default() -> Self {
        Self { inertia: false, history: 8 }
    }
}

/// A solver with all that any of them is told.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Params {
    /// Solver.
    pub solver: Solver,
    /// The body.
    #[serde(flatten)]
    pub springs: Springs,
    /// For the implicit solvers.
    #[serde(flatten)]
    pub closeness: Closeness,
    /// For [`Solver::Projective`].
    #[serde(flatten)]
    pub descent: Descent,
}

impl Springs {
    /// What the schema of a single field can't say.
    pub(crate) fn check_together(&self) -> Result<(), ParamError> {
        ivd_field::param::is_near("grip", self.grip.unwrap_or_default())?;
        for (class, own) in &self.material {
            if own.stiffness.is_some() && own.youngs_kpa.is_some() {
                let remedy = "give stiffness or youngs_kpa, one of them";
                let problem = ParamError::new("stiffness", "a class has a Young's modulus too", remedy);
                return Err(problem.under(&class.to_string()).under("material"));
            }
        }
        Ok(())
    }

    /// Whether springs push, with such handles.
    pub(super) fn pushes(&self, handles: &[Handle], bones_move: bool) -> bool {
        let bears = |handle: &Handle| matches!(handle.action, Action::Force(_));
        self.push.unwrap_or_else(|| bones_move || handles.iter().any(bears))
    }

    /// Fraction of their motion or force that handles have reached at a time (s).
    pub(super) fn reached(&self, time: f64) -> f64 {
        let ramp = self.ramp.unwrap_or(self.duration);
        let t = if time >= ramp { 1.0 } else { time / ramp };
        match self.course {
            LoadRamp::Smooth => t * t * (3.0 - 2.0 * t),
            LoadRamp::Linear => t,
        }
    }

    /// Number of steps for a step of `dt` (s) at most, so that every frame falls on one; infinite where it overflows.
    pub(super) fn steps(&self, dt: f64) -> f64 {
        let frames = self.frames as f64;
        // A duration that is a whole number of steps stays so in spite of rounding.
        (self.duration / dt / frames * (1.0 - 1e-12)).ceil().max(1.0) * frames
    }
}

impl Params {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.springs.check_together()
    }
}
