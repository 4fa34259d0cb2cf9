use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_deform::freeform::{self, Shape};
use ivd_deform::spring::{self, Action, Fix, Handle, HandleAt, RingParams};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{DeformSection, HandleSection, ShapeSection, Solver};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Moves a lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct Deform {
    /// What moves.
    pub handles: Vec<Handle>,
    /// What stays.
    pub fixed: Vec<Fix>,
    /// How.
    pub params: RingParams,
    /// Changes of shape, after that.
    pub shapes: Vec<Shape>,
}

impl Deform {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// A handle without exactly one place and one action; a shape with a key missing, or out of its domain.
    pub fn from_section(section: &DeformSection) -> Result<Self, Error> {
        let Solver::Ring = section.solver;
        let handles = section.handle.iter().map(handle).collect::<Result<_, _>>()?;
        let fixed =
            section.fix.iter().map(|f| Fix { at: HandleAt::Pick(f.pick), radius: f.radius }).collect();
        let params = RingParams {
            stiffness: section.stiffness,
            duration: section.duration,
            dt: section.dt,
            ground: section.ground,
            damping: section.damping,
            density: section.density,
            vertex_mass: section.vertex_mass,
            epsilon: section.epsilon,
            literal: section.literal,
        };
        let shape =
            |shape: &ShapeSection| shape.shape().map_err(|e| Error::usage("deform", format!("shape: {e}")));
        let shapes = section.shape.iter().map(shape).collect::<Result<_, _>>()?;
        Ok(Self { handles, fixed, params, shapes })
    }
}

/// The stage crate's handle for a scene's.
fn handle(section: &HandleSection) -> Result<Handle, Error> {
    section.check().map_err(|e| Error::usage("deform", format!("handle: {e}")))?;
    let at = match (section.pick, section.vertex) {
        (Some(point), _) => HandleAt::Pick(point),
        (None, vertex) => HandleAt::Vertex(vertex.expect("checked: pick or vertex")),
    };
    let action = match (section.displace, section.force) {
        (Some(vector), _) => Action::Move(vector),
        (None, force) => Action::Force(force.expect("checked: move or force")),
    };
    Ok(Handle { at, action, radius: section.radius })
}

impl Stage for Deform {
    fn name(&self) -> &'static str {
        "deform"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("lattice", &[Kind::Lattice])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Motion)
    }

    fn params(&self) -> Value {
        json!({
            "solver": "ring",
            "handles": super::json(&self.handles),
            "fixed": super::json(&self.fixed),
            "ring": super::json(&self.params),
            "shapes": super::json(&self.shapes),
        })
    }

    fn accuracy_knobs(&self) -> &'static [&'static str] {
        &["dt"]
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let lattice = inputs.lattice("lattice").expect("checked by the runner");
        if self.handles.is_empty() && !self.shapes.is_empty() {
            let shaped =
                freeform::lattice(lattice, None, &self.shapes, exec).map_err(stage_error!("deform"))?;
            let metrics = json!({
                "vertices_moved": shaped.vertices_moved,
                "steps": 0,
                "residual": 0.0,
                "energy_first": 0.0,
                "energy_last": 0.0,
                "max_displacement_mm": shaped.max_displacement_mm,
            });
            return Ok(Product::new(Artefact::Motion(shaped.motion), metrics));
        }
        let solved = spring::ring(lattice, &self.handles, &self.fixed, &self.params, exec)
            .map_err(stage_error!("deform"))?;
        let (mut moved, mut farthest) = (solved.vertices_moved, solved.max_displacement_mm);
        let mut motion = solved.motion;
        if !self.shapes.is_empty() {
            let shaped = freeform::lattice(lattice, Some(&motion), &self.shapes, exec)
                .map_err(stage_error!("deform"))?;
            (moved, farthest) = (shaped.vertices_moved, shaped.max_displacement_mm);
            motion = shaped.motion;
        }
        let metrics = json!({
            "vertices_moved": moved,
            "steps": solved.steps,
            "residual": solved.residual,
            "energy_first": solved.energy_first,
            "energy_last": solved.energy_last,
            "max_displacement_mm": farthest,
        });
        Ok(Product::new(Artefact::Motion(motion), metrics))
    }
}
