use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{RigidSection, ShapeSection};

/// How the lattice moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// The thesis's rings.
    #[default]
    Ring,
    /// Masses on springs, stepped explicitly through time.
    Dynamics,
    /// The same, taken to the balance of forces, or stepped implicitly.
    Projective,
    /// The same, constraint by constraint; to compare.
    Xpbd,
}

/// How handles come to their full motion or force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CourseChoice {
    /// Without a jerk.
    Smooth,
    /// Evenly.
    Linear,
}

/// `[deform.material.<class>]`: what isn't given is as everywhere else.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MaterialSection {
    /// Stiffness of a structural spring (N/m).
    pub stiffness: Option<f64>,
    /// Young's modulus (kPa), instead of `stiffness`.
    pub youngs_kpa: Option<f64>,
    /// Mass of the surface (g/mm²).
    pub density: Option<f64>,
}

/// `[deform]`. A key says which solvers read it; the others refuse it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DeformSection {
    /// Solver.
    pub solver: Solver,
    /// Stiffness of a spring (N/m).
    pub stiffness: f64,
    /// Time of the motion (s).
    pub duration: f64,
    /// Time step (s); chosen where it isn't given.
    pub dt: Option<f64>,
    /// Stiffness of the spring that ties each vertex to its place, as a fraction of `stiffness`: 1 with `ring`, else 0.
    pub ground: Option<f64>,
    /// Viscous drag, as a fraction of the critical damping of those springs (`ring`).
    pub damping: Option<f64>,
    /// Mass of the surface (g/mm²).
    pub density: f64,
    /// Mass of every vertex (g), instead of `density`.
    pub vertex_mass: Option<f64>,
    /// Fraction of the handle's force below which a vertex passes none on, 0…1 (`ring`).
    pub epsilon: Option<f64>,
    /// The thesis to the letter, errors and all: it may well end in an error (`ring`).
    pub literal: bool,
    /// Young's modulus (kPa), instead of `stiffness` (not `ring`, nor any key below it but `handle` and `fix`).
    pub youngs_kpa: Option<f64>,
    /// Thickness of the sheet that the lattice stands for (mm), with a Young's modulus.
    pub thickness: Option<f64>,
    /// Stiffness of a shear spring, as a fraction of a structural one's.
    pub shear: Option<f64>,
    /// Stiffness of a flexion spring, as a fraction of a structural one's.
    pub flexion: Option<f64>,
    /// Whether springs push when they are shorter than at rest.
    pub push: Option<bool>,
    /// Strain beyond which a spring is a hundred times as stiff.
    pub strain_limit: Option<f64>,
    /// Viscous drag (1/s).
    pub drag: Option<f64>,
    /// Radius of the vertices that a handle grips (mm).
    pub grip: Option<f64>,
    /// Time in which handles come to their full motion or force (s).
    pub ramp: Option<f64>,
    /// How they do.
    pub course: Option<CourseChoice>,
    /// Frames of the motion, evenly in time.
    pub frames: Option<usize>,
    /// Whether masses count (`projective`): steps through time instead of the balance of forces at each frame.
    pub inertia: bool,
    /// Relative gradient at which a step or frame is done (`projective`, `xpbd`).
    pub tolerance: Option<f64>,
    /// Most iterations for a step or frame (`projective`, `xpbd`).
    pub max_iterations: Option<usize>,
    /// Steps that the quasi-Newton method remembers (`projective`); 0 is plain local–global iteration.
    pub history: Option<usize>,
    /// What classes are made of, by their ids.
    pub material: BTreeMap<String, MaterialSection>,
    /// What moves.
    pub handle: Vec<HandleSection>,
    /// What stays.
    pub fix: Vec<FixSection>,
    /// What moves as one: bones (not `ring`).
    pub rigid: Vec<RigidSection>,
    /// Changes of shape, after what the solver does with the handles.
    pub shape: Vec<ShapeSection>,
}

impl DeformSection {
    /// Whether nothing moves.
    pub fn is_still(&self) -> bool {
        self.handle.is_empty() && self.rigid.is_empty() && self.shape.is_empty()
    }
}

impl Default for DeformSection {
    fn default() -> Self {
        let params = ivd_deform::spring::RingParams::default();
        Self {
            solver: Solver::Ring,
            stiffness: params.stiffness,
            duration: params.duration,
            dt: params.dt,
            ground: None,
            damping: None,
            density: params.density,
            vertex_mass: params.vertex_mass,
            epsilon: None,
            literal: params.literal,
            youngs_kpa: None,
            thickness: None,
            shear: None,
            flexion: None,
            push: None,
            strain_limit: None,
            drag: None,
            grip: None,
            ramp: None,
            course: None,
            frames: None,
            inertia: false,
            tolerance: None,
            max_iterations: None,
            history: None,
            material: BTreeMap::new(),
            handle: Vec::new(),
            fix: Vec::new(),
            rigid: Vec::new(),
            shape: Vec::new(),
        }
    }
}

/// `[[deform.handle]]`: pick or vertex, move or force, radius.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandleSection {
    /// A point (mm), RAS; the nearest vertex is taken.
    #[serde(default)]
    pub pick: Option<[f64; 3]>,
    /// A vertex of the lattice that deform reads.
    #[serde(default)]
    pub vertex: Option<u32>,
    /// Where the vertex goes (mm), relative.
    #[serde(default, rename = "move")]
    pub displace: Option<[f64; 3]>,
    /// The force on it (mN).
    #[serde(default)]
    pub force: Option<[f64; 3]>,
    /// Reach in rest space (mm).
    pub radius: f64,
}

impl HandleSection {
    /// Checks that exactly one place and one action are given, and that they are finite.
    ///
    /// # Errors
    /// A sentence with the key and the remedy.
    pub fn check(&self) -> Result<(), String> {
        if self.pick.is_some() == self.vertex.is_some() {
            return Err("give pick = [x, y, z] (mm) or vertex = N, one of them".into());
        }
        if self.displace.is_some() == self.force.is_some() {
            return Err("give move = [x, y, z] (mm) or force = [x, y, z] (mN), one of them".into());
        }
        if !(self.radius.is_finite() && self.radius > 0.0) {
            return Err(format!("radius = {}: must be a positive length in mm", self.radius));
        }
        let vectors = [("pick", self.pick), ("move", self.displace), ("force", self.force)];
        for (key, vector) in vectors {
            if vector.is_some_and(|v| !v.iter().all(|c| c.is_finite())) {
                return Err(format!("{key}: not a finite vector"));
            }
        }
        Ok(())
    }
}

/// `[[deform.fix]]`: vertices that stay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixSection {
    /// Centre (mm), RAS.
    pub pick: [f64; 3],
    /// Radius (mm).
    pub radius: f64,
}
