use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ShapeSection;

/// How the lattice moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// The thesis's rings.
    #[default]
    Ring,
}

/// `[deform]`.
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
    /// Stiffness of the spring that ties each vertex to its place, as a fraction of `stiffness`.
    pub ground: f64,
    /// Viscous drag, as a fraction of the critical damping of those springs.
    pub damping: f64,
    /// Mass of the surface (g/mm²).
    pub density: f64,
    /// Mass of every vertex (g), instead of `density`.
    pub vertex_mass: Option<f64>,
    /// Fraction of the handle's force below which a vertex passes none on, 0…1.
    pub epsilon: f64,
    /// The thesis to the letter, errors and all: it may well end in an error.
    pub literal: bool,
    /// What moves.
    pub handle: Vec<HandleSection>,
    /// What stays.
    pub fix: Vec<FixSection>,
    /// Changes of shape, after what the solver does with the handles.
    pub shape: Vec<ShapeSection>,
}

impl DeformSection {
    /// Whether nothing moves.
    pub fn is_still(&self) -> bool {
        self.handle.is_empty() && self.shape.is_empty()
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
            ground: params.ground,
            damping: params.damping,
            density: params.density,
            vertex_mass: params.vertex_mass,
            epsilon: params.epsilon,
            literal: params.literal,
            handle: Vec::new(),
            fix: Vec::new(),
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
