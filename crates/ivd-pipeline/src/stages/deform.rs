use ivd_artefact::{Artefact, Kind};
use ivd_core::{Exec, Labels, Lattice, Motion};
use ivd_deform::freeform::{self, Shape};
use ivd_deform::mass_spring::{self, Course, Material, Params};
use ivd_deform::rigid::{Moved, Part};
use ivd_deform::spring::{self, Action, Fix, Handle, HandleAt, RingParams};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{CourseChoice, DeformSection, HandleSection, RigidSection, ShapeSection, Solver};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Moves a lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct Deform {
    /// What moves.
    pub handles: Vec<Handle>,
    /// What stays.
    pub fixed: Vec<Fix>,
    /// What moves as one.
    pub bones: Vec<Part>,
    /// How.
    pub method: DeformMethod,
    /// Changes of shape, after that.
    pub shapes: Vec<Shape>,
}

/// A solver's parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum DeformMethod {
    /// The thesis's rings.
    Ring(RingParams),
    /// Masses on springs.
    MassSpring(Box<Params>),
}

impl Deform {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// A handle without exactly one place and one action; a bone or a shape with a key missing, or out of its domain; a key that the solver doesn't read, a class that is no number.
    pub fn from_section(section: &DeformSection) -> Result<Self, Error> {
        check_keys(section)?;
        let handles = section.handle.iter().map(handle).collect::<Result<_, _>>()?;
        let fixed =
            section.fix.iter().map(|f| Fix { at: HandleAt::Pick(f.pick), radius: f.radius }).collect();
        let springs = |solver| Ok::<_, Error>(DeformMethod::MassSpring(Box::new(springs(section, solver)?)));
        let method = match section.solver {
            Solver::Ring => DeformMethod::Ring(ring(section)),
            Solver::Dynamics => springs(mass_spring::Solver::Dynamics)?,
            Solver::Projective => springs(mass_spring::Solver::Projective)?,
            Solver::Xpbd => springs(mass_spring::Solver::Xpbd)?,
        };
        let shape =
            |shape: &ShapeSection| shape.shape().map_err(|e| Error::usage("deform", format!("shape: {e}")));
        let shapes = section.shape.iter().map(shape).collect::<Result<_, _>>()?;
        let bone = |(i, bone): (usize, &RigidSection)| {
            bone.part(i).map_err(|e| Error::usage("deform", format!("rigid {i}: {e}")))
        };
        let bones = section.rigid.iter().enumerate().map(bone).collect::<Result<_, _>>()?;
        Ok(Self { handles, fixed, bones, method, shapes })
    }

    fn ring(&self, lattice: &Lattice, params: &RingParams, exec: &Exec) -> Result<(Motion, Value), Error> {
        let solved = spring::ring(lattice, &self.handles, &self.fixed, params, exec)
            .map_err(stage_error!("deform"))?;
        let metrics = json!({
            "vertices_moved": solved.vertices_moved,
            "steps": solved.steps,
            "residual": solved.residual,
            "energy_first": solved.energy_first,
            "energy_last": solved.energy_last,
            "max_displacement_mm": solved.max_displacement_mm,
        });
        Ok((solved.motion, metrics))
    }

    fn springs(
        &self,
        lattice: &Lattice,
        labels: Option<&Labels>,
        params: &Params,
        exec: &Exec,
    ) -> Result<(Motion, Value), Error> {
        let labels = labels.filter(|_| self.knows_classes());
        if labels.is_none() && self.knows_classes() {
            return Err(Error::usage(
                "deform",
                "material, rigid: there are no labels to know classes by; give --labels".to_owned(),
            ));
        }
        let (handles, fixed, bones) = (&self.handles, &self.fixed, &self.bones);
        let solved = mass_spring::with_bones(lattice, labels, handles, fixed, bones, params, exec)
            .map_err(stage_error!("deform"))?;
        let metrics = json!({
            "vertices_moved": solved.vertices_moved,
            "vertices_loose": solved.vertices_loose,
            "springs": solved.springs,
            "steps": solved.steps,
            "dt_s": solved.dt,
            "iterations": solved.iterations,
            "residual": solved.residual,
            "energy_first": solved.energy_first,
            "energy_last": solved.energy_last,
            "max_displacement_mm": solved.max_displacement_mm,
            "handle_forces_mn": solved.handle_forces_mn,
            "truncation_mn": solved.truncation_mn,
            "truncation": solved.truncation,
            "bones": solved.bones.iter().map(bone_moved).collect::<Vec<_>>(),
        });
        Ok((solved.motion, metrics))
    }

    /// Whether it needs labels.
    pub fn knows_classes(&self) -> bool {
        let by_class = matches!(&self.method, DeformMethod::MassSpring(params) if !params.classes.is_empty());
        let solves = !(self.handles.is_empty() && self.bones.is_empty());
        (by_class && solves) || self.bones.iter().any(|bone| bone.class.is_some())
    }
}

/// What a bone has done, for a record.
fn bone_moved(bone: &Moved) -> Value {
    json!({
        "name": bone.name,
        "vertices": bone.vertices,
        "axis": bone.axis,
        "angle_deg": bone.angle,
        "centre_mm": bone.centre,
        "shift_mm": bone.shift,
        "left_mm": bone.left_mm,
        "strain": bone.strain,
        "force_mn": bone.force_mn,
    })
}

fn ring(section: &DeformSection) -> RingParams {
    let plain = RingParams::default();
    RingParams {
        stiffness: section.stiffness,
        duration: section.duration,
        dt: section.dt,
        ground: section.ground.unwrap_or(plain.ground),
        damping: section.damping.unwrap_or(plain.damping),
        density: section.density,
        vertex_mass: section.vertex_mass,
        epsilon: section.epsilon.unwrap_or(plain.epsilon),
        literal: section.literal,
    }
}

fn springs(section: &DeformSection, solver: mass_spring::Solver) -> Result<Params, Error> {
    let plain = Params::default();
    let classes = section.material.iter().map(|(class, own)| {
        let id = class.parse().map_err(|_| {
            Error::usage("deform", format!("material.{class}: a class is named by its number, 0 to 65535"))
        });
        let own = Material { stiffness: own.stiffness, youngs_kpa: own.youngs_kpa, density: own.density };
        Ok((id?, own))
    });
    Ok(Params {
        solver,
        stiffness: section.stiffness,
        youngs_kpa: section.youngs_kpa,
        thickness: section.thickness.unwrap_or(plain.thickness),
        shear: section.shear.unwrap_or(plain.shear),
        flexion: section.flexion.unwrap_or(plain.flexion),
        ground: section.ground.unwrap_or(plain.ground),
        push: section.push.unwrap_or(plain.push),
        strain_limit: section.strain_limit,
        density: section.density,
        vertex_mass: section.vertex_mass,
        classes: classes.collect::<Result<_, Error>>()?,
        drag: section.drag.unwrap_or(plain.drag),
        grip: section.grip.unwrap_or(plain.grip),
        duration: section.duration,
        dt: section.dt,
        ramp: section.ramp,
        course: match section.course {
            Some(CourseChoice::Linear) => Course::Linear,
            Some(CourseChoice::Smooth) | None => Course::Smooth,
        },
        frames: section.frames.unwrap_or(plain.frames),
        inertia: section.inertia,
        tolerance: section.tolerance.unwrap_or(plain.tolerance),
        max_iterations: section.max_iterations.unwrap_or(plain.max_iterations),
        history: section.history.unwrap_or(plain.history),
    })
}

/// A key that the solver doesn't read is a mistake: whoever wrote it expects something of it.
fn check_keys(of: &DeformSection) -> Result<(), Error> {
    use Solver::{Dynamics, Projective, Ring, Xpbd};
    const SPRINGS: &[Solver] = &[Dynamics, Projective, Xpbd];
    let keys: [(&str, bool, &[Solver]); 20] = [
        ("damping", of.damping.is_some(), &[Ring]),
        ("epsilon", of.epsilon.is_some(), &[Ring]),
        ("literal", of.literal, &[Ring]),
        ("youngs_kpa", of.youngs_kpa.is_some(), SPRINGS),
        ("thickness", of.thickness.is_some(), SPRINGS),
        ("shear", of.shear.is_some(), SPRINGS),
        ("flexion", of.flexion.is_some(), SPRINGS),
        ("push", of.push.is_some(), SPRINGS),
        ("strain_limit", of.strain_limit.is_some(), SPRINGS),
        ("drag", of.drag.is_some(), SPRINGS),
        ("grip", of.grip.is_some(), SPRINGS),
        ("ramp", of.ramp.is_some(), SPRINGS),
        ("course", of.course.is_some(), SPRINGS),
        ("frames", of.frames.is_some(), SPRINGS),
        ("material", !of.material.is_empty(), SPRINGS),
        ("rigid", !of.rigid.is_empty(), SPRINGS),
        ("inertia", of.inertia, &[Projective]),
        ("tolerance", of.tolerance.is_some(), &[Projective, Xpbd]),
        ("max_iterations", of.max_iterations.is_some(), &[Projective, Xpbd]),
        ("history", of.history.is_some(), &[Projective]),
    ];
    let unread = keys.into_iter().find(|(_, set, readers)| *set && !readers.contains(&of.solver));
    let Some((key, _, readers)) = unread else { return Ok(()) };
    let name = |solver: &Solver| super::json(solver).as_str().unwrap_or_default().to_owned();
    let readers: Vec<String> = readers.iter().map(name).collect();
    Err(Error::usage(
        "deform",
        format!("{key}: {} doesn't read it; it belongs to {}", name(&of.solver), readers.join(", ")),
    ))
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
        4
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("lattice", &[Kind::Lattice]), Slot::optional("labels", &[Kind::Labels])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Motion)
    }

    fn params(&self) -> Value {
        let (solver, name, method) = match &self.method {
            DeformMethod::Ring(params) => (json!("ring"), "ring", super::json(params)),
            DeformMethod::MassSpring(params) => {
                (super::json(&params.solver), "mass_spring", super::json(params))
            }
        };
        json!({
            "solver": solver,
            "handles": super::json(&self.handles),
            "fixed": super::json(&self.fixed),
            "bones": super::json(&self.bones),
            name: method,
            "shapes": super::json(&self.shapes),
        })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let lattice = inputs.lattice("lattice").expect("checked by the runner");
        if self.handles.is_empty() && self.bones.is_empty() && !self.shapes.is_empty() {
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
        let (mut motion, mut metrics) = match &self.method {
            DeformMethod::Ring(params) => self.ring(lattice, params, exec)?,
            DeformMethod::MassSpring(params) => {
                self.springs(lattice, inputs.labels("labels"), params, exec)?
            }
        };
        if !self.shapes.is_empty() {
            let shaped = freeform::lattice(lattice, Some(&motion), &self.shapes, exec)
                .map_err(stage_error!("deform"))?;
            metrics["vertices_moved"] = json!(shaped.vertices_moved);
            metrics["max_displacement_mm"] = json!(shaped.max_displacement_mm);
            motion = shaped.motion;
        }
        Ok(Product::new(Artefact::Motion(motion), metrics))
    }
}
