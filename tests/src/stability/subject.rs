//! A stage under test, and what the stages have given.

use std::collections::BTreeMap;

use ivd_artefact::{ArtefactRef, ContentHash};
use ivd_core::{Exec, Labels, Lattice, Mask, Octree};
use ivd_field::inverse::Inverse;
use ivd_field::warp::Warped;
use ivd_lattice::extract::Part;
use ivd_lattice::refine::Refined;
use ivd_map::MapResult;
use ivd_motion::freeform::Shaped;
use ivd_motion::handles::{Anchor, Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::ring::RingResult;
use ivd_render::{Radiance, Rendered};
use ivd_segment::Segmentation;

use super::backend::{Answer, Backend};
use super::case::{Case, Stage};
use super::invariants::Verdict;

/// What the stages of a case have given so far.
#[derive(Debug, Default)]
#[allow(missing_docs, reason = "named after the stages")]
pub struct Values {
    pub segmentation: Option<Segmentation>,
    pub thresholds: Option<Segmentation>,
    /// What the other methods found, by name.
    pub clusterings: BTreeMap<&'static str, Segmentation>,
    pub transfer: Option<ivd_atf::Built>,
    pub part: Option<ivd_boundary::Component>,
    pub lattice: Option<Lattice>,
    /// Lattices of all classes at once.
    pub parts: Vec<Part>,
    pub refined: Option<Refined>,
    /// What the other methods of refinement gave, by name.
    pub refinements: BTreeMap<&'static str, Refined>,
    pub octree: Option<Octree>,
    /// Voxels inside the refined lattice.
    pub inside: Option<Mask>,
    pub solved: Option<RingResult>,
    /// Motions by masses on springs, by solver.
    pub sprung: BTreeMap<&'static str, mass_spring::MassSpringResult>,
    pub shaped: Option<Shaped>,
    pub mapped: Option<MapResult>,
    /// What the other methods made of the rings' motion, by name.
    pub maps: BTreeMap<&'static str, MapResult>,
    pub inverse: Option<Inverse>,
    pub volume: Option<Warped<ivd_core::Volume>>,
    pub labels: Option<Warped<Labels>>,
    pub mask: Option<Warped<Mask>>,
    pub light: Option<Radiance>,
    pub picture: Option<Rendered>,
}

impl Values {
    /// The handles of a case, with vertices of this lattice.
    pub fn handles(&self, case: &Case) -> Vec<Handle> {
        case.setup.handles.iter().map(|h| Handle { at: self.vertex(h.at), ..*h }).collect()
    }

    /// The fixed vertices of a case.
    pub fn fixed(&self, case: &Case) -> Vec<Pin> {
        case.setup.fixed.iter().map(|f| Pin { at: self.vertex(f.at), ..*f }).collect()
    }

    fn vertex(&self, at: Anchor) -> Anchor {
        let count = self.refined.as_ref().map_or(0, |r| r.lattice.keys().len() as u32);
        match at {
            Anchor::Vertex(v) if count > 0 => Anchor::Vertex(v % count),
            other => other,
        }
    }

    /// Content hash of everything that is there, with the picture's linear light bit for bit.
    ///
    /// # Errors
    /// A value that no artefact can hold.
    pub fn hashes(&self) -> Result<Vec<(&'static str, ContentHash)>, String> {
        let mut all = Vec::new();
        let mut add = |name, value: Option<ArtefactRef<'_>>| {
            if let Some(value) = value {
                all.push((name, ivd_artefact::content_hash(value).map_err(|e| format!("{name}: {e}"))?));
            }
            Ok::<_, String>(())
        };
        add("segment", self.segmentation.as_ref().map(|s| (&s.labels).into()))?;
        add("threshold", self.thresholds.as_ref().map(|s| (&s.labels).into()))?;
        for (name, found) in &self.clusterings {
            add(name, Some((&found.labels).into()))?;
        }
        add("atf", self.transfer.as_ref().map(|t| (&t.transfer).into()))?;
        add("boundary", self.part.as_ref().map(|p| (&p.mask).into()))?;
        add("lattice", self.lattice.as_ref().map(Into::into))?;
        add("refine", self.refined.as_ref().map(|r| (&r.lattice).into()))?;
        for part in &self.parts {
            add("part", Some((&part.lattice).into()))?;
        }
        for (name, found) in &self.refinements {
            add(name, Some((&found.lattice).into()))?;
        }
        add("octree", self.octree.as_ref().map(Into::into))?;
        add("inside", self.inside.as_ref().map(Into::into))?;
        add("deform", self.solved.as_ref().map(|s| (&s.motion).into()))?;
        for (name, found) in &self.sprung {
            add(name, Some((&found.motion).into()))?;
        }
        add("deform by shapes", self.shaped.as_ref().map(|s| (&s.motion).into()))?;
        add("map", self.mapped.as_ref().map(|m| (&m.displacement).into()))?;
        for (name, found) in &self.maps {
            add(name, Some((&found.displacement).into()))?;
        }
        add("warp", self.volume.as_ref().map(|v| (&v.output).into()))?;
        add("warp labels", self.labels.as_ref().map(|v| (&v.output).into()))?;
        add("warp mask", self.mask.as_ref().map(|v| (&v.output).into()))?;
        add("render", self.picture.as_ref().map(|p| (&p.image).into()))?;
        Ok(all)
    }
}

/// A stage under test.
pub trait Subject: Sync {
    /// Which.
    fn stage(&self) -> Stage;

    /// Runs it on what the earlier stages gave; `Ok(false)` where its input is missing, or it has no turn.
    ///
    /// # Errors
    /// What the stage said.
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool>;

    /// What must hold of its result.
    ///
    /// # Errors
    /// The first thing that doesn't.
    fn check(&self, on: &dyn Backend, case: &Case, values: &Values, exec: &Exec) -> Verdict;
}
