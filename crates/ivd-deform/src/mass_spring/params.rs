use std::collections::BTreeMap;

use ivd_core::ParamError;
use serde::{Deserialize, Serialize};

/// How the equations of motion or of balance are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Course {
    /// `3τ² − 2τ³`: it starts and ends without a jerk.
    #[default]
    Smooth,
    /// `τ`.
    Linear,
}

/// What a class is made of; what isn't given is as everywhere else.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Stiffness of a structural spring (N/m), 1e-9…1e15.
    pub stiffness: Option<f64>,
    /// Young's modulus (kPa), 1e-9…1e15, instead of `stiffness`.
    pub youngs_kpa: Option<f64>,
    /// Mass of the surface (g/mm²), 1e-12…1e6.
    pub density: Option<f64>,
}

/// What the springs are, how the body moves, and how closely that is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Solver.
    pub solver: Solver,
    /// Stiffness of a structural spring (N/m), 1e-9…1e15.
    pub stiffness: f64,
    /// Young's modulus (kPa), 1e-9…1e15, instead of `stiffness`: see [`crate::mass_spring`] for what a spring makes of it.
    pub youngs_kpa: Option<f64>,
    /// Thickness of the sheet that the lattice stands for (mm), 1e-6…1e6; only with a Young's modulus.
    pub thickness: f64,
    /// Stiffness of a shear spring, as a fraction of a structural one's, 0…1e6.
    pub shear: f64,
    /// Stiffness of a flexion spring, as a fraction of a structural one's, 0…1e6.
    pub flexion: f64,
    /// Stiffness of the spring that ties a vertex to its place, as a fraction of its structural springs' mean, 0…1e6.
    pub ground: f64,
    /// Whether springs push when they are shorter than at rest.
    pub push: bool,
    /// Strain beyond which a hundredfold stiffness more pulls, 0…1e3; `None`: never.
    pub strain_limit: Option<f64>,
    /// Mass of the surface (g/mm²), 1e-12…1e6; vertices share the mass of their triangles.
    pub density: f64,
    /// Mass of every vertex (g), 1e-12…1e9, instead of any density.
    pub vertex_mass: Option<f64>,
    /// Material by label, where labels are given.
    pub classes: BTreeMap<u16, Material>,
    /// Viscous drag (1/s), 0…1e9: a vertex loses this fraction of its velocity a second.
    pub drag: f64,
    /// Radius round a handle's vertex of the vertices that it grips (mm), 0…1e100: 0 is that vertex alone.
    pub grip: f64,
    /// Time (s), 1e-9…1e6.
    pub duration: f64,
    /// Time step (s), > 0; `None`: as the solver chooses. [`Solver::Dynamics`] divides it where it isn't stable.
    pub dt: Option<f64>,
    /// Time in which handles come to their full motion or force (s), ≥ 0; `None`: the duration.
    pub ramp: Option<f64>,
    /// How they do.
    pub course: Course,
    /// Frames of the motion, evenly in time, 1…10,000.
    pub frames: usize,
    /// Whether masses count in [`Solver::Projective`]: implicit Euler in time instead of balance at each frame.
    pub inertia: bool,
    /// Relative gradient at which an implicit solver is done, 1e-14…1.
    pub tolerance: f64,
    /// Most iterations of an implicit solver for a step or frame, 1…1e6.
    pub max_iterations: usize,
    /// Steps that the quasi-Newton method remembers, 0…100; 0 is plain local–global iteration.
    pub history: usize,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            solver: Solver::Dynamics,
            stiffness: 50.0,
            youngs_kpa: None,
            thickness: 1.0,
            shear: 0.5,
            flexion: 0.5,
            ground: 0.0,
            push: true,
            strain_limit: None,
            density: 1e-3,
            vertex_mass: None,
            classes: BTreeMap::new(),
            drag: 100.0,
            grip: 0.0,
            duration: 0.2,
            dt: None,
            ramp: None,
            course: Course::Smooth,
            frames: 1,
            inertia: false,
            tolerance: 1e-3,
            max_iterations: 1000,
            history: 8,
        }
    }
}

fn within(field: &'static str, value: f64, low: f64, high: f64) -> Result<(), ParamError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(ParamError::new(field, format!("{value}"), format!("use {low:e} to {high:e}")))
}

impl Material {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        if self.stiffness.is_some() && self.youngs_kpa.is_some() {
            let remedy = "give stiffness or youngs_kpa, one of them";
            return Err(ParamError::new("stiffness", "a class has a Young's modulus too", remedy));
        }
        within("stiffness", self.stiffness.unwrap_or(1.0), 1e-9, 1e15)?;
        within("youngs_kpa", self.youngs_kpa.unwrap_or(1.0), 1e-9, 1e15)?;
        within("density", self.density.unwrap_or(1.0), 1e-12, 1e6)
    }
}

impl Params {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        within("stiffness", self.stiffness, 1e-9, 1e15)?;
        within("youngs_kpa", self.youngs_kpa.unwrap_or(1.0), 1e-9, 1e15)?;
        within("thickness", self.thickness, 1e-6, 1e6)?;
        within("shear", self.shear, 0.0, 1e6)?;
        within("flexion", self.flexion, 0.0, 1e6)?;
        within("ground", self.ground, 0.0, 1e6)?;
        within("strain_limit", self.strain_limit.unwrap_or(0.0), 0.0, 1e3)?;
        within("density", self.density, 1e-12, 1e6)?;
        within("vertex_mass", self.vertex_mass.unwrap_or(1.0), 1e-12, 1e9)?;
        self.classes.values().try_for_each(Material::check)?;
        within("drag", self.drag, 0.0, 1e9)?;
        within("grip", self.grip, 0.0, 1e100)?;
        within("duration", self.duration, 1e-9, 1e6)?;
        within("dt", self.dt.unwrap_or(1.0), f64::MIN_POSITIVE, f64::MAX)?;
        within("ramp", self.ramp.unwrap_or(0.0), 0.0, 1e6)?;
        within("frames", self.frames as f64, 1.0, 1e4)?;
        within("tolerance", self.tolerance, 1e-14, 1.0)?;
        within("max_iterations", self.max_iterations as f64, 1.0, 1e6)?;
        within("history", self.history as f64, 0.0, 100.0)
    }

    /// Fraction of their motion or force that handles have reached at a time (s).
    pub(super) fn reached(&self, time: f64) -> f64 {
        let ramp = self.ramp.unwrap_or(self.duration);
        let t = if time >= ramp { 1.0 } else { time / ramp };
        match self.course {
            Course::Smooth => t * t * (3.0 - 2.0 * t),
            Course::Linear => t,
        }
    }

    /// Number of steps for a step of `dt` (s) at most, so that every frame falls on one; infinite where it overflows.
    pub(super) fn steps(&self, dt: f64) -> f64 {
        let frames = self.frames as f64;
        // A duration that is a whole number of steps stays so in spite of rounding.
        (self.duration / dt / frames * (1.0 - 1e-12)).ceil().max(1.0) * frames
    }
}
