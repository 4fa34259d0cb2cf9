use ivd_core::ParamError;
use ivd_core::op::check_fields;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which vertices within a handle's radius follow it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Couple {
    /// Those to which a way through the part leads that is at most one and a half times the straight line: the far side of a wall follows, the
    /// other lip doesn't.
    #[default]
    Inside,
    /// All of them.
    Straight,
    /// Those that edges lead to (the thesis's rings).
    Edges,
}

/// The material and the clock of the ring solver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RingParams {
    /// Which vertices within a handle's radius follow it. Those that don't are carried along by what surrounds them.
    pub couple: Couple,
    /// Stiffness of every structural spring.
    #[schemars(range(min = 1e-9, max = 1e15), extend("x-unit" = "N/m"))]
    pub stiffness: f64,
    /// Time over which the handles act.
    #[schemars(range(min = 1e-9, max = 1e6), extend("x-unit" = "s"))]
    pub duration: f64,
    /// Time step. Without it a 200th of the duration. At least 32 and at most 20 000 steps are made.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0, "x-knob" = "accuracy"))]
    pub dt: Option<f64>,
    /// Stiffness of the spring that ties each vertex to its place, as a fraction of `stiffness`.
    #[schemars(range(min = 1e-3, max = 1e3), extend("x-unit" = "1"))]
    pub ground: f64,
    /// Viscous drag, as a fraction of the critical damping of the ground springs.
    #[schemars(range(min = 0.0, max = 100.0), extend("x-unit" = "1"))]
    pub damping: f64,
    /// Mass of the surface; vertices share the mass of their triangles.
    #[schemars(range(min = 1e-12, max = 1e6), extend("x-unit" = "g/mm²"))]
    pub density: f64,
    /// Mass of every vertex, instead of `density`.
    #[schemars(range(min = 1e-12, max = 1e9), extend("x-unit" = "g"))]
    pub vertex_mass: Option<f64>,
    /// Fraction of the handle's force below which a vertex passes none on.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub epsilon: f64,
    /// Reproduce the thesis exactly, including its errors: masses of 1 g, signed cosines, ring sums free to grow, no ground
    /// springs, springs that push as well as pull, followers along edges alone. The result may diverge, which is an error.
    pub literal: bool,
}

impl Default for RingParams {
    fn default() -> Self {
        Self {
            couple: Couple::Inside,
            stiffness: 50.0,
            duration: 0.2,
            dt: None,
            ground: 1.0,
            damping: 1.0,
            density: 1e-3,
            vertex_mass: None,
            epsilon: 0.0,
            literal: false,
        }
    }
}

impl RingParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)
    }

    /// How followers are found: along edges where the thesis is reproduced.
    pub fn followers_by(&self) -> Couple {
        if self.literal { Couple::Edges } else { self.couple }
    }

    /// Number of steps, and their length (s).
    pub(super) fn clock(&self) -> (usize, f64) {
        let wanted = (self.duration / self.dt.unwrap_or(self.duration / 200.0)).ceil();
        let steps = wanted.clamp(32.0, 20_000.0) as usize;
        (steps, self.duration / steps as f64)
    }
}
