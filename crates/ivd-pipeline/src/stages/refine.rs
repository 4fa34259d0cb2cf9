use ivd_artefact::{Artefact, Kind};
use ivd_core::{Exec, Lattice, World};
use ivd_lattice::figures;
use ivd_lattice::refine::{
    Locks, Method, RefineParams, Refined, Target, chain, distances, refine, vertices_within, with_levels,
};
use ivd_lattice::repair::{RepairParams, repair};
use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{FixSection, RefineMethod, RefineSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Simplifies a lattice without a new vertex.
#[derive(Debug, Clone, PartialEq)]
pub struct Refine {
    /// Method and target.
    pub params: RefineParams,
    /// Places whose vertices stay.
    pub locks: Vec<FixSection>,
    /// What goes before.
    pub repair: RepairParams,
    /// Levels to keep beside the lattice, in place of the target; empty for one refined lattice.
    pub levels: Vec<u8>,
}

impl Refine {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// Where more than one target is given, or a lock's radius is no length.
    pub fn from_section(section: &RefineSection) -> Result<Self, Error> {
        let target = match (section.level, section.ratio, section.count, section.max_error) {
            (None, None, None, None) => Target::Level(2),
            (Some(level), None, None, None) => Target::Level(level),
            (None, Some(ratio), None, None) => Target::Ratio(ratio),
            (None, None, Some(count), None) => Target::Count(count),
            (None, None, None, Some(error)) => Target::MaxError(error),
            _ => {
                let problem = "give one of level, ratio, count and max_error, not several";
                return Err(Error::usage("refine", problem));
            }
        };
        let method = match section.method {
            RefineMethod::Collapse => Method::Collapse,
            RefineMethod::Decimate => Method::Decimate,
            RefineMethod::Loop => Method::Loop,
            RefineMethod::Merge => Method::Merge,
            RefineMethod::Sample => Method::Sample,
        };
        let is_place = |lock: &FixSection| {
            lock.pick.iter().all(|c| c.is_finite()) && lock.radius.is_finite() && lock.radius >= 0.0
        };
        if let Some(lock) = section.lock.iter().find(|lock| !is_place(lock)) {
            let problem =
                format!("lock: {:?} with radius {}: give finite numbers, radius ≥ 0", lock.pick, lock.radius);
            return Err(Error::usage("refine", problem));
        }
        let targets = [
            section.level.is_some(),
            section.ratio.is_some(),
            section.count.is_some(),
            section.max_error.is_some(),
        ];
        if !section.chain.is_empty() && targets.contains(&true) {
            let problem = "chain gives levels of its own; leave out level, ratio, count and max_error";
            return Err(Error::usage("refine", problem));
        }
        let params = RefineParams {
            method,
            target,
            max_turn_degrees: section.max_turn_degrees,
            shape_weight: section.shape_weight,
            allow_topology: section.allow_topology,
            feature_degrees: section.feature_degrees,
        };
        let repair = RepairParams { min_triangles: section.min_component, ..RepairParams::default() };
        Ok(Self { params, locks: section.lock.clone(), repair, levels: section.chain.clone() })
    }

    /// Vertices that stay, ascending. A place without one is a mistake.
    fn locked(&self, lattice: &Lattice, exec: &Exec) -> Result<Vec<u32>, Error> {
        let mut locked = Vec::new();
        for lock in &self.locks {
            let pick = World(Vector3::from(lock.pick));
            let within = exec.run(|| vertices_within(lattice, pick, lock.radius));
            if within.is_empty() {
                let off = |i: usize| (lattice.world(i).0 - pick.0).norm();
                let nearest = (0..lattice.keys.len()).map(off).fold(f64::INFINITY, f64::min);
                let problem = format!(
                    "lock: no vertex lies within {} mm of {:?}; the nearest is {nearest:.3} mm away",
                    lock.radius, lock.pick
                );
                return Err(Error::usage("refine", problem));
            }
            locked.extend(within);
        }
        locked.sort_unstable();
        locked.dedup();
        Ok(locked)
    }
}

impl Stage for Refine {
    fn name(&self) -> &'static str {
        "refine"
    }

    fn revision(&self) -> u32 {
        6
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("lattice", &[Kind::Lattice])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Lattice)
    }

    fn params(&self) -> Value {
        let mut params = super::json(&self.params);
        params["lock"] = super::json(&self.locks);
        params["min_component"] = json!(self.repair.min_triangles);
        if !self.levels.is_empty() {
            params["chain"] = json!(self.levels);
            params.as_object_mut().map(|params| params.remove("target"));
        }
        params
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let lattice = inputs.lattice("lattice").expect("checked by the runner");
        let repaired = if self.repair == RepairParams::default() {
            None
        } else {
            Some(repair(lattice, &self.repair, exec).map_err(stage_error!("refine"))?)
        };
        let sound = repaired.as_ref().map_or(lattice, |repaired| &repaired.lattice);
        let locked = self.locked(sound, exec)?;
        let locks = Locks { vertices: &locked };
        if !self.levels.is_empty() {
            let steps =
                chain(sound, &self.params, &self.levels, locks, exec).map_err(stage_error!("refine"))?;
            let mut metrics = chain_metrics(lattice, sound, &steps, exec)?;
            metrics["components_removed"] = json!(repaired.as_ref().map_or(0, |r| r.done.components_removed));
            metrics["locked"] = json!(locked.len());
            let whole = with_levels(sound.clone(), &steps).map_err(stage_error!("refine"))?;
            return Ok(Product::new(Artefact::Lattice(whole), metrics));
        }
        let refined = refine(sound, &self.params, locks, exec).map_err(stage_error!("refine"))?;
        exec.check_cancelled()?;
        let f = exec.run(|| figures::measure(&refined.lattice));
        let metrics = json!({
            "vertices_in": lattice.keys.len(),
            "vertices": f.vertices,
            "triangles": f.triangles,
            "max_error_mm": refined.max_error_mm,
            "mean_error_mm": refined.mean_error_mm,
            "boundary_edges": f.boundary_edges,
            "non_manifold_edges": f.non_manifold_edges,
            "bow_tie_vertices": f.bow_tie_vertices,
            "euler": f.euler,
            "components": f.components,
            "components_removed": repaired.as_ref().map_or(0, |r| r.done.components_removed),
            "locked": locked.len(),
            "subset": is_subset(&refined.lattice, lattice),
            "level": refined.lattice.level,
            "reached": super::json(&refined.reached),
        });
        Ok(Product::new(Artefact::Lattice(refined.lattice), metrics))
    }
}

/// Figures of a chain: those of its last level, with the errors from the input on, and each level's own.
fn chain_metrics(input: &Lattice, sound: &Lattice, steps: &[Refined], exec: &Exec) -> Result<Value, Error> {
    let level = |step: &Refined| {
        let f = exec.run(|| figures::measure(&step.lattice));
        let apart = distances(sound, &step.lattice, exec).map_err(stage_error!("refine"))?;
        Ok(json!({
            "level": step.lattice.level,
            "vertices": f.vertices,
            "triangles": f.triangles,
            "max_error_mm": step.lattice.max_error_mm - input.max_error_mm,
            "mean_error_mm": apart.mean_mm,
            "boundary_edges": f.boundary_edges,
            "non_manifold_edges": f.non_manifold_edges,
            "subset": is_subset(&step.lattice, input),
            "reached": super::json(&step.reached),
        }))
    };
    let levels: Vec<Value> = steps.iter().map(level).collect::<Result<_, Error>>()?;
    let mut metrics = levels.last().cloned().unwrap_or_else(|| json!({}));
    metrics["vertices_in"] = json!(input.keys.len());
    metrics["levels"] = Value::Array(levels);
    Ok(metrics)
}

/// Whether every vertex of `part` is one of `whole`, address and place alike. Both lists ascend by address.
fn is_subset(part: &Lattice, whole: &Lattice) -> bool {
    let mut at = 0;
    part.keys.iter().zip(&part.places).all(|(key, place)| {
        while at < whole.keys.len() && whole.keys[at] < *key {
            at += 1;
        }
        at < whole.keys.len() && whole.keys[at] == *key && whole.places[at] == *place
    })
}
