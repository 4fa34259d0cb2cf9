use std::collections::BTreeMap;

use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_deform::map::{self, Elastic, MapParams};
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{self, MapMethod, MapSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Carries a lattice's motion to the voxels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Map {
    /// Weights, margin, outside.
    pub params: MapParams,
}

impl Map {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// A key that the method doesn't read; a class that is no number.
    pub fn from_section(section: &MapSection) -> Result<Self, Error> {
        check(section)?;
        let method = match section.method {
            MapMethod::Octree => map::MapMethod::Octree,
            MapMethod::Biharmonic => map::MapMethod::Biharmonic,
            MapMethod::Fem => map::MapMethod::Fem,
        };
        let weight = match section.weight {
            scene::DepthWeight::Linear => map::DepthWeight::Linear,
            scene::DepthWeight::Smooth => map::DepthWeight::Smooth,
            scene::DepthWeight::Exponential => map::DepthWeight::Exponential,
            scene::DepthWeight::One => map::DepthWeight::One,
        };
        let outside = match section.outside {
            scene::Outside::Band => map::Outside::Band,
            scene::Outside::Free => map::Outside::Free,
        };
        let default = MapParams::default();
        let mut classes = BTreeMap::new();
        for (class, own) in &section.material {
            let wrong = |problem: &str| Error::usage("map", format!("material.{class}: {problem}"));
            let id = class.parse().map_err(|_| wrong("a class is named by its number, 0 to 65535"))?;
            if classes.insert(id, Elastic { young: own.young, poisson: own.poisson }).is_some() {
                return Err(wrong("the class is named twice"));
            }
        }
        Ok(Self {
            params: MapParams {
                method,
                weight,
                outside,
                depth_mm: section.depth,
                margin_mm: section.margin,
                cell: section.cell,
                poisson: section.poisson.unwrap_or(default.poisson),
                filler: section.filler.unwrap_or(default.filler),
                classes,
                tolerance: section.tolerance.unwrap_or(default.tolerance),
            },
        })
    }

    /// Whether it needs labels.
    pub fn knows_classes(&self) -> bool {
        !self.params.classes.is_empty()
    }
}

/// A key that the method doesn't read is a mistake: whoever wrote it expects something of it.
fn check(section: &MapSection) -> Result<(), Error> {
    let keys = [
        ("weight", section.weight != scene::DepthWeight::default(), &[MapMethod::Octree][..]),
        ("depth", section.depth.is_some(), &[MapMethod::Octree]),
        ("cell", section.cell.is_some(), &[MapMethod::Biharmonic, MapMethod::Fem]),
        ("poisson", section.poisson.is_some(), &[MapMethod::Fem]),
        ("filler", section.filler.is_some(), &[MapMethod::Fem]),
        ("material", !section.material.is_empty(), &[MapMethod::Fem]),
    ];
    let name = |method| match method {
        MapMethod::Octree => "octree",
        MapMethod::Biharmonic => "biharmonic",
        MapMethod::Fem => "fem",
    };
    match keys.into_iter().find(|(_, set, readers)| *set && !readers.contains(&section.method)) {
        None => Ok(()),
        Some((key, _, readers)) => Err(Error::usage(
            "map",
            format!(
                "{key}: {} doesn't read it; it belongs to {}",
                name(section.method),
                readers.iter().map(|r| name(*r)).collect::<Vec<_>>().join(", ")
            ),
        )),
    }
}

impl Stage for Map {
    fn name(&self) -> &'static str {
        "map"
    }

    fn revision(&self) -> u32 {
        6
    }

    fn inputs(&self) -> &'static [Slot] {
        const OCTREE: &[Slot] = &[
            Slot::required("lattice", &[Kind::Lattice]),
            Slot::required("octree", &[Kind::Octree]),
            Slot::required("motion", &[Kind::Motion]),
        ];
        const NO_OCTREE: &[Slot] =
            &[Slot::required("lattice", &[Kind::Lattice]), Slot::required("motion", &[Kind::Motion])];
        const ELASTIC: &[Slot] = &[
            Slot::required("lattice", &[Kind::Lattice]),
            Slot::required("motion", &[Kind::Motion]),
            Slot::optional("labels", &[Kind::Labels]),
        ];
        match self.params.method {
            map::MapMethod::Octree => OCTREE,
            map::MapMethod::Biharmonic => NO_OCTREE,
            map::MapMethod::Fem => ELASTIC,
        }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Displacement)
    }

    fn params(&self) -> Value {
        super::json(&self.params)
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let lattice = inputs.lattice("lattice").expect("checked by the runner");
        let motion = inputs.motion("motion").expect("checked by the runner");
        let labels = inputs.labels("labels");
        if labels.is_none() && self.knows_classes() {
            return Err(Error::usage(
                "map",
                "material: there are no labels to know classes by; give --labels".to_owned(),
            ));
        }
        let last = motion.frames.len().saturating_sub(1);
        let mapped = match self.params.method {
            map::MapMethod::Octree => {
                let octree = inputs.octree("octree").expect("checked by the runner");
                map::octree(lattice, octree, motion, last, &self.params, exec)
            }
            map::MapMethod::Biharmonic => map::biharmonic(lattice, motion, last, &self.params, exec),
            map::MapMethod::Fem => map::fem(lattice, labels, motion, last, &self.params, exec),
        }
        .map_err(stage_error!("map"))?;
        let metrics = json!({
            "voxels_moved": mapped.voxels_moved,
            "bricks_touched": mapped.bricks_touched,
            "bricks_total": mapped.bricks_total,
            "min_det_j": mapped.min_det_j,
            "folds": mapped.folds,
            "relaxations": mapped.relaxations,
            "halvings": mapped.halvings,
            "solved": super::json(&mapped.solved),
            "inverse_residual_max_voxel": mapped.inverse_residual_max_voxel,
            "voxels_vacated": mapped.voxels_vacated,
            "followed": super::json(&mapped.followed),
            "motion_mm_histogram": super::json(&mapped.motion_mm),
            "det_j_histogram": super::json(&mapped.det_j),
        });
        Ok(Product::new(Artefact::Displacement(mapped.displacement), metrics))
    }
}
