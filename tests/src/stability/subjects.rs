//! The stages as subjects: how each is run and what is checked of it.

use ivd_core::{Exec, Mask, Volume};
use ivd_lattice::extract::{ExtractParams, Iso};
use ivd_render::{Mode, RenderParams, Scene};
use ivd_segment::{KmvsParams, ThresholdParams};
use ivd_session::MapChoice;

use super::backend::{Answer, Backend};
use super::case::{Case, Cut, Stage};
use super::clusters;
use super::invariants::motion::{self, Asked};
use super::invariants::{Verdict, field, mesh, picture, segments, values as voxels};
use super::subject::{Subject, Values};
use super::{motions, surfaces};

/// Every stage, in the order in which they run. A new stage is a line here.
pub static SUBJECTS: [&dyn Subject; 34] = [
    &Segment,
    &Threshold,
    &clusters::KMEANS,
    &clusters::MIXTURE,
    &clusters::SMOOTH,
    &clusters::DIAGONAL,
    &clusters::FULL,
    &clusters::MODES,
    &clusters::JOINT,
    &clusters::CHAIN,
    &clusters::WARD,
    &clusters::SINGLE,
    &Atf,
    &Boundary,
    &Extract,
    &surfaces::Parts,
    &Refine,
    &surfaces::DECIMATE,
    &surfaces::LOOP,
    &surfaces::MERGE,
    &surfaces::SAMPLE,
    &Tree,
    &Deform,
    &motions::DYNAMICS,
    &motions::BALANCE,
    &motions::IMPLICIT,
    &motions::XPBD,
    &motions::Shapes,
    &Map,
    &motions::BIHARMONIC,
    &motions::FEM,
    &Invert,
    &Warp,
    &Render,
];

struct Segment;
struct Threshold;
struct Atf;
struct Boundary;
struct Extract;
struct Refine;
struct Tree;
struct Deform;
struct Map;
struct Invert;
struct Warp;
struct Render;

const RAN: &str = "checked after it ran";

impl Subject for Segment {
    fn stage(&self) -> Stage {
        Stage::Segment
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        values.segmentation =
            Some(on.kmvs(&case.volume, &KmvsParams { k: case.setup.k, ..KmvsParams::default() }, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        segments::kmeans(&case.volume, case.setup.k, values.segmentation.as_ref().expect(RAN))
    }
}

impl Subject for Threshold {
    fn stage(&self) -> Stage {
        Stage::Threshold
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let params = ThresholdParams { values: case.setup.thresholds.clone() };
        values.thresholds = Some(on.threshold(&case.volume, &params, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        segments::thresholds(&case.volume, &case.setup.thresholds, values.thresholds.as_ref().expect(RAN))
    }
}

impl Subject for Atf {
    fn stage(&self) -> Stage {
        Stage::Atf
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(found) = &values.segmentation else { return Ok(false) };
        values.transfer = Some(on.transfer(&case.volume, &found.labels, &case.setup.atf, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let labels = &values.segmentation.as_ref().expect(RAN).labels;
        segments::transfer(labels, &case.setup.atf, &values.transfer.as_ref().expect(RAN).transfer)
    }
}

impl Subject for Boundary {
    fn stage(&self) -> Stage {
        Stage::Boundary
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(found) = &values.segmentation else { return Ok(false) };
        values.part = Some(on.component(&case.volume, &found.labels, &case.setup.boundary, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        if case.setup.boundary.seed.is_some() {
            return Ok(());
        }
        let labels = &values.segmentation.as_ref().expect(RAN).labels;
        segments::part(&case.volume, labels, &case.setup.boundary, values.part.as_ref().expect(RAN))
    }
}

/// The surface that a case asks for, and the mask that it is cut within.
fn surface<'a>(case: &Case, values: &'a Values) -> Option<(Iso, Option<&'a Mask>)> {
    if let Cut::Value(value) = case.setup.cut {
        return Some((Iso::Value(value), None));
    }
    let part = values.part.as_ref()?;
    let bounds = (part.lower, part.upper);
    let whole = case.setup.cut == Cut::Mask || bounds == (None, None);
    let iso = if whole { Iso::Mask } else { Iso::Interval { lower: bounds.0, upper: bounds.1 } };
    Some((iso, Some(&part.mask)))
}

/// The voxels that must lie inside the lattice.
fn sides(volume: &Volume, iso: &Iso, mask: Option<&Mask>) -> Vec<bool> {
    let values = segments::reals(volume);
    let side = |i: usize| match (mask, iso) {
        (Some(mask), Iso::Mask) => mask.inside()[i] == 1,
        (Some(mask), _) => mask.inside()[i] == 1 && values[i].is_some(),
        (None, Iso::Value(iso)) => values[i].is_some_and(|v| v >= *iso),
        (None, _) => false,
    };
    (0..values.len()).map(side).collect()
}

impl Subject for Extract {
    fn stage(&self) -> Stage {
        Stage::Lattice
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        if case.lattice.is_some() {
            values.lattice.clone_from(&case.lattice);
            return Ok(true);
        }
        let Some((iso, mask)) = surface(case, values) else { return Ok(false) };
        values.lattice = Some(on.extract(&case.volume, mask, &ExtractParams { iso }, exec)?.lattice);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, exec: &Exec) -> Verdict {
        if case.lattice.is_some() {
            return Ok(());
        }
        let (iso, mask) = surface(case, values).expect(RAN);
        mesh::extracted(values.lattice.as_ref().expect(RAN), &sides(&case.volume, &iso, mask), exec)
    }
}

impl Subject for Refine {
    fn stage(&self) -> Stage {
        Stage::Refine
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(lattice) = &values.lattice else { return Ok(false) };
        values.refined = Some(on.collapse(lattice, &case.setup.refine, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, _: &Case, values: &Values, exec: &Exec) -> Verdict {
        mesh::refined(values.lattice.as_ref().expect(RAN), values.refined.as_ref().expect(RAN), exec)
    }
}

impl Subject for Tree {
    fn stage(&self) -> Stage {
        Stage::Octree
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(refined) = &values.refined else { return Ok(false) };
        values.octree = Some(on.octree(&refined.lattice, &case.setup.octree, exec)?);
        values.inside = Some(on.inside(&refined.lattice, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, _: &Case, values: &Values, _: &Exec) -> Verdict {
        let lattice = &values.refined.as_ref().expect(RAN).lattice;
        mesh::octree(lattice, values.inside.as_ref().expect(RAN), values.octree.as_ref().expect(RAN))
    }
}

impl Subject for Deform {
    fn stage(&self) -> Stage {
        Stage::Deform
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(refined) = values.refined.as_ref().filter(|_| !case.setup.handles.is_empty()) else {
            return Ok(false);
        };
        let (handles, fixed) = (values.handles(case), values.fixed(case));
        values.solved = Some(on.ring(&refined.lattice, &handles, &fixed, &case.setup.ring, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let asked = Asked {
            lattice: &values.refined.as_ref().expect(RAN).lattice,
            handles: &values.handles(case),
            fixed: &values.fixed(case),
            labels: None,
            bones: &[],
        };
        motion::solved(&asked, values.solved.as_ref().expect(RAN))
    }
}

impl Subject for Map {
    fn stage(&self) -> Stage {
        Stage::Map
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let (Some(refined), Some(octree), Some(solved)) = (&values.refined, &values.octree, &values.solved)
        else {
            return Ok(false);
        };
        let mapped = on.map(
            &refined.lattice,
            octree,
            &solved.motion,
            &MapChoice::Octree(case.setup.map.clone()),
            exec,
        )?;
        values.mapped = Some(mapped);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let (solved, mapped) = (values.solved.as_ref().expect(RAN), values.mapped.as_ref().expect(RAN));
        field::mapped(&solved.motion, values.inside.as_ref().expect(RAN), &case.setup.map.band, mapped)
    }
}

impl Subject for Invert {
    fn stage(&self) -> Stage {
        Stage::Inverse
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(mapped) = &values.mapped else { return Ok(false) };
        values.inverse = Some(on.invert(mapped.displacement.forward(), case.volume.grid(), exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        if case.setup.map.band.outside == ivd_map::Outside::Free {
            // A part that moves alone has an inverse of its own kind.
            return Ok(());
        }
        let moved = &values.mapped.as_ref().expect(RAN).displacement;
        field::inverted(values.inverse.as_ref().expect(RAN), moved)
    }
}

impl Subject for Warp {
    fn stage(&self) -> Stage {
        Stage::Warp
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(mapped) = &values.mapped else { return Ok(false) };
        let moved = &mapped.displacement;
        values.volume = Some(on.warp_volume(&case.volume, moved, &case.setup.warp, exec)?);
        if let Some(found) = &values.segmentation {
            values.labels = Some(on.warp_labels(&found.labels, moved, exec)?);
        }
        if let Some(part) = &values.part {
            values.mask = Some(on.warp_mask(&part.mask, moved, exec)?);
        }
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let moved = &values.mapped.as_ref().expect(RAN).displacement;
        voxels::warped(&case.volume, moved, &case.setup.warp, values.volume.as_ref().expect(RAN))?;
        if let (Some(found), Some(warped)) = (&values.segmentation, &values.labels) {
            voxels::labels(&found.labels, moved, warped)?;
        }
        if let (Some(part), Some(warped)) = (&values.part, &values.mask) {
            voxels::mask(&part.mask, moved, warped)?;
        }
        Ok(())
    }
}

/// The scene of a case, as far as its stages came.
fn scene<'a>(case: &'a Case, values: &'a Values) -> Option<Scene<'a>> {
    let transfer = values.transfer.as_ref().map(|t| &t.transfer);
    if transfer.is_none() && case.setup.render.mode == Mode::Dvr {
        return None;
    }
    Some(Scene {
        transfer,
        labels: values.segmentation.as_ref().map(|s| &s.labels),
        displacement: values.mapped.as_ref().map(|m| &m.displacement),
        lattice: values.refined.as_ref().map(|r| &r.lattice),
        ..Scene::new(&case.volume)
    })
}

impl Subject for Render {
    fn stage(&self) -> Stage {
        Stage::Render
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let Some(scene) = scene(case, values) else { return Ok(false) };
        let light = on.radiance(&scene, &case.setup.render, exec)?;
        let picture = on.render(&scene, &case.setup.render, exec)?;
        (values.light, values.picture) = (Some(light), Some(picture));
        Ok(true)
    }
    fn check(&self, on: &dyn Backend, case: &Case, values: &Values, exec: &Exec) -> Verdict {
        let (params, found) = (&case.setup.render, values.light.as_ref().expect(RAN));
        picture::light(params, found)?;
        picture::picture(params, values.picture.as_ref().expect(RAN))?;
        let other = RenderParams { skip: !params.skip, ..params.clone() };
        let scene = scene(case, values).expect(RAN);
        picture::same(found, &on.radiance(&scene, &other, exec).map_err(|e| e.why)?)
    }
}
