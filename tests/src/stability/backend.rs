//! Where stages run.

use super::invariants::motion::Asked;
use ivd_core::{
    Classified, Displacement, ErrorClass, Exec, FieldBricks, Grid, Labels, Lattice, Mask, Motion, Octree,
    Volume,
};
use ivd_field::inverse::Inverse;
use ivd_field::shape::Shape;
use ivd_field::warp::{WarpParams, Warped};
use ivd_lattice::extract::{ExtractParams, Extracted, Part};
use ivd_lattice::refine::{Locks, RefineParams, Refined};
use ivd_map::MapResult;
use ivd_motion::freeform::{self, Shaped};
use ivd_motion::handles::{Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::ring::{RingParams, RingResult};
use ivd_render::{Radiance, RenderParams, Rendered, Scene};
use ivd_segment::{
    ChainParams, CutParams, EmvsParams, HvsParams, KmvsParams, MsvsParams, Segmentation, ThresholdParams,
};
use ivd_session::MapChoice;

/// Why a stage gave nothing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Its kind.
    pub fault: ErrorClass,
    /// What it said.
    pub why: String,
}

macro_rules! refusal_of {
    ($($error:ty),*) => {$(
        impl From<$error> for Refusal {
            fn from(error: $error) -> Self {
                Self { fault: error.error_class(), why: error.to_string() }
            }
        }
    )*};
}
refusal_of!(
    ivd_atf::Error,
    ivd_boundary::Error,
    ivd_lattice::Error,
    ivd_octree::Error,
    ivd_core::Error,
    ivd_map::Error,
    ivd_render::Error
);

/// What a stage gave.
pub type Answer<T> = Result<T, Refusal>;

/// The stages on some machine. Every method is the CPU's unless a backend has its own, so that a backend joins all suites
/// with its stages alone, and a fake may spoil one.
#[allow(missing_docs, clippy::missing_errors_doc, reason = "the stages' own names and errors")]
pub trait Backend: Sync {
    /// Name, for messages.
    fn name(&self) -> &'static str;

    fn kmvs(&self, volume: &Volume, params: &KmvsParams, exec: &Exec) -> Answer<Segmentation> {
        Ok(ivd_segment::kmvs(volume, None, params, exec)?)
    }

    fn emvs(&self, volume: &Volume, params: &EmvsParams, exec: &Exec) -> Answer<Segmentation> {
        Ok(ivd_segment::emvs(volume, None, params, exec)?.segmentation)
    }

    fn msvs(&self, volume: &Volume, params: &MsvsParams, exec: &Exec) -> Answer<Segmentation> {
        Ok(ivd_segment::msvs(volume, None, params, exec)?.segmentation)
    }

    fn msvs_kmvs(&self, volume: &Volume, params: &ChainParams, exec: &Exec) -> Answer<Segmentation> {
        Ok(ivd_segment::msvs_kmvs(volume, None, params, exec)?.segmentation)
    }

    fn hvs(&self, volume: &Volume, params: &HvsParams, cut: &CutParams, exec: &Exec) -> Answer<Segmentation> {
        let tree = ivd_segment::region_tree(volume, None, params, exec)?.tree;
        Ok(ivd_segment::cut(&tree, cut, exec)?)
    }

    fn threshold(&self, volume: &Volume, params: &ThresholdParams, exec: &Exec) -> Answer<Segmentation> {
        Ok(ivd_segment::threshold(volume, None, params, exec)?)
    }

    fn transfer(
        &self,
        volume: &Volume,
        labels: &Labels,
        params: &ivd_atf::Params,
        exec: &Exec,
    ) -> Answer<ivd_atf::Built> {
        Ok(ivd_atf::transfer(volume, labels, params, exec)?)
    }

    fn component(
        &self,
        volume: &Volume,
        labels: &Labels,
        params: &ivd_boundary::ComponentParams,
        exec: &Exec,
    ) -> Answer<ivd_boundary::Component> {
        Ok(ivd_boundary::component(volume, Some(labels), params, exec)?)
    }

    fn extract(
        &self,
        volume: &Volume,
        mask: Option<&Mask>,
        params: &ExtractParams,
        exec: &Exec,
    ) -> Answer<Extracted> {
        Ok(ivd_lattice::extract::extract(volume, mask, params, exec)?)
    }

    fn collapse(&self, lattice: &Lattice, params: &RefineParams, exec: &Exec) -> Answer<Refined> {
        Ok(ivd_lattice::refine::collapse(lattice, params, exec)?)
    }

    fn refine(&self, lattice: &Lattice, params: &RefineParams, exec: &Exec) -> Answer<Refined> {
        Ok(ivd_lattice::refine::refine(lattice, params, Locks::NONE, exec)?)
    }

    fn parts(&self, labels: &Labels, exec: &Exec) -> Answer<Vec<Part>> {
        Ok(ivd_lattice::extract::extract_parts(labels, &[], exec)?)
    }

    fn octree(&self, lattice: &Lattice, params: &ivd_octree::Params, exec: &Exec) -> Answer<Octree> {
        Ok(ivd_octree::build(lattice, params, exec)?)
    }

    fn inside(&self, lattice: &Lattice, exec: &Exec) -> Answer<Mask> {
        Ok(ivd_octree::inside(lattice, exec)?)
    }

    fn ring(
        &self,
        lattice: &Lattice,
        handles: &[Handle],
        fixed: &[Pin],
        params: &RingParams,
        exec: &Exec,
    ) -> Answer<RingResult> {
        Ok(ivd_motion::ring::solve(lattice, handles, fixed, params, exec)?)
    }

    fn springs(
        &self,
        asked: &Asked<'_>,
        params: &mass_spring::Params,
        exec: &Exec,
    ) -> Answer<mass_spring::MassSpringResult> {
        let Asked { lattice, handles, fixed, labels, bones } = *asked;
        Ok(mass_spring::with_bones(lattice, labels, handles, fixed, bones, params, exec)?)
    }

    fn shapes(&self, lattice: &Lattice, start: &Motion, shapes: &[Shape], exec: &Exec) -> Answer<Shaped> {
        Ok(freeform::lattice(lattice, Some(start), shapes, exec)?)
    }

    fn map(
        &self,
        lattice: &Lattice,
        octree: &Octree,
        motion: &Motion,
        choice: &MapChoice,
        exec: &Exec,
    ) -> Answer<MapResult> {
        Ok(match choice {
            MapChoice::Octree(params) => ivd_map::octree(lattice, octree, motion, 0, params, exec)?,
            MapChoice::Biharmonic(params) => ivd_map::biharmonic(lattice, motion, 0, params, exec)?,
            MapChoice::Fem(params) => ivd_map::fem(lattice, None, motion, 0, params, exec)?,
        })
    }

    fn invert(&self, forward: &FieldBricks, grid: &Grid, exec: &Exec) -> Answer<Inverse> {
        Ok(ivd_field::inverse::invert(forward, grid, exec)?)
    }

    fn warp_volume(
        &self,
        volume: &Volume,
        displacement: &Displacement,
        params: &WarpParams,
        exec: &Exec,
    ) -> Answer<Warped<Volume>> {
        Ok(ivd_field::warp::volume(volume, displacement, params, exec)?)
    }

    fn warp_labels(
        &self,
        labels: &Labels,
        displacement: &Displacement,
        exec: &Exec,
    ) -> Answer<Warped<Labels>> {
        Ok(ivd_field::warp::labels(labels, displacement, &WarpParams::default(), exec)?)
    }

    fn warp_mask(&self, mask: &Mask, displacement: &Displacement, exec: &Exec) -> Answer<Warped<Mask>> {
        Ok(ivd_field::warp::mask(mask, displacement, exec)?)
    }

    fn radiance(&self, scene: &Scene<'_>, params: &RenderParams, exec: &Exec) -> Answer<Radiance> {
        Ok(ivd_render::radiance(scene, params, exec)?)
    }

    fn render(&self, scene: &Scene<'_>, params: &RenderParams, exec: &Exec) -> Answer<Rendered> {
        Ok(ivd_render::render(scene, params, exec)?)
    }
}

/// The processor.
#[derive(Debug, Clone, Copy)]
pub struct Cpu;

impl Backend for Cpu {
    fn name(&self) -> &'static str {
        "cpu"
    }
}

/// Every backend that this build has: the suites run on each. A new one is a line here.
pub static BACKENDS: [&dyn Backend; 1] = [&Cpu];
