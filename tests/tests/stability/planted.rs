//! Faults planted on purpose: a suite that can't fail proves nothing.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ivd_core::{
    Displacement, Exec, FieldBricks, Grid, Labels, Lattice, Mask, Motion, Octree, Volume, Voxels,
};
use ivd_field::inverse::Inverse;
use ivd_field::warp::{WarpParams, Warped};
use ivd_lattice::extract::{ExtractParams, Extracted};
use ivd_lattice::refine::{RefineParams, Refined};
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::ring::{RingParams, RingResult};
use ivd_render::{Radiance, RenderParams, Scene};
use ivd_segment::{KmvsParams, Segmentation};
use ivd_tests::stability::backend::{Answer, Backend, Cpu};
use ivd_tests::stability::case::{Case, Stage};
use ivd_tests::stability::chain::examine;
use ivd_tests::stability::determinism::same_bytes;
use ivd_tests::stability::invariants::motion::Asked;

/// A motion with another last frame.
fn with_last(motion: &Motion, change: impl FnOnce(&mut [[f64; 3]])) -> Answer<Motion> {
    let mut frames = motion.frames().to_vec();
    change(frames.last_mut().unwrap().displacement.make_mut());
    let moved = Motion::new(motion.grid().clone(), motion.vertex_count(), frames)
        .and_then(|moved| moved.with_reach(motion.reach().to_vec())?.with_inner(motion.inner().clone()));
    Ok(moved?)
}

/// A ball in single precision with a handle.
fn case() -> Case {
    let grid = Grid::with_spacing([14; 3], [1.0, 1.1, 0.9]).unwrap();
    let value = |i: usize| {
        let r = grid.index(i).0.iter().map(|c| (*c as f64 - 6.6).powi(2)).sum::<f64>().sqrt();
        (100.0 - 11.0 * r) as f32
    };
    let voxels: Vec<f32> = (0..grid.len()).map(value).collect();
    let mut case = Case::new("planted", Volume::new(grid, Voxels::from(voxels)).unwrap());
    case.setup.k = 2;
    case.setup.octree.leaf_size = 1;
    case.setup.boundary.class = Some(ivd_core::ClassChoice::Densest);
    case.setup.handles =
        vec![Handle { at: Anchor::Vertex(7), action: Action::Move([0.8, 0.2, -0.3]), radius: 7.0 }];
    case
}

/// What a spoiled backend does to one stage's result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Spoil {
    NanInVolume,
    NanInLight,
    HandleOff,
    LabelBeyondK,
    LabelShifted,
    VertexMoved,
    HoleInLattice,
    BoundTooSmall,
    TreeOfAnother,
    InverseOff,
    ValueBeyondRange,
    StillVoxelChanged,
    BrightPixel,
}

struct Spoiled(Spoil);

impl Spoiled {
    fn is(&self, what: Spoil) -> bool {
        self.0 == what
    }
}

impl Backend for Spoiled {
    fn name(&self) -> &'static str {
        "spoiled"
    }

    fn kmvs(&self, volume: &Volume, params: &KmvsParams, exec: &Exec) -> Answer<Segmentation> {
        let mut found = Cpu.kmvs(volume, params, exec)?;
        let mut ids = found.labels.ids().to_vec();
        match self.0 {
            Spoil::LabelBeyondK => ids[5] = params.k as u16 + 1,
            Spoil::LabelShifted => ids.rotate_right(1),
            _ => {}
        }
        let classes = found.labels.classes().to_vec();
        found.labels = Labels::new(volume.grid().clone(), ids.into(), classes).unwrap();
        Ok(found)
    }

    fn extract(
        &self,
        volume: &Volume,
        mask: Option<&Mask>,
        params: &ExtractParams,
        exec: &Exec,
    ) -> Answer<Extracted> {
        let mut cut = Cpu.extract(volume, mask, params, exec)?;
        if self.is(Spoil::HoleInLattice) {
            let left = cut.lattice.triangles()[1..].to_vec();
            cut.lattice = cut.lattice.with_triangles(left.into()).map_err(ivd_lattice::Error::from)?;
        }
        Ok(cut)
    }

    fn collapse(&self, lattice: &Lattice, params: &RefineParams, exec: &Exec) -> Answer<Refined> {
        let mut refined = Cpu.collapse(lattice, params, exec)?;
        match self.0 {
            Spoil::VertexMoved => {
                let grid = refined.lattice.grid().clone();
                let (keys, mut places, triangles) = refined.lattice.into_parts();
                let axis = places[3].iter().position(|p| *p > 0.0).unwrap();
                places.make_mut()[3][axis] += 1e-6;
                refined.lattice =
                    Lattice::new(grid, keys, places, triangles).map_err(ivd_lattice::Error::from)?;
            }
            Spoil::BoundTooSmall => refined.max_error_mm *= 0.05,
            _ => {}
        }
        Ok(refined)
    }

    fn octree(&self, lattice: &Lattice, params: &ivd_octree::Params, exec: &Exec) -> Answer<Octree> {
        let mut tree = Cpu.octree(lattice, params, exec)?;
        if self.is(Spoil::TreeOfAnother) {
            let mut parts = tree.into_parts();
            let leaf = parts.nodes.iter().position(|n| n & 3 == 2).unwrap();
            parts.nodes.make_mut()[leaf] = 1;
            tree = Octree::new(parts).map_err(ivd_octree::Error::from)?;
        }
        Ok(tree)
    }

    fn ring(
        &self,
        lattice: &Lattice,
        handles: &[Handle],
        fixed: &[Pin],
        params: &RingParams,
        exec: &Exec,
    ) -> Answer<RingResult> {
        let mut solved = Cpu.ring(lattice, handles, fixed, params, exec)?;
        if self.is(Spoil::HandleOff) {
            solved.motion = with_last(&solved.motion, |moved| moved[7][2] = moved[7][2].next_up())?;
        }
        Ok(solved)
    }

    fn invert(&self, forward: &FieldBricks, grid: &Grid, exec: &Exec) -> Answer<Inverse> {
        let mut inverse = Cpu.invert(forward, grid, exec)?;
        if self.is(Spoil::InverseOff) {
            let mut vectors = inverse.field.vectors().to_vec();
            let some = vectors.iter().position(|v| *v != [0.0; 3]).unwrap();
            vectors[some][0] += 1e-3;
            let table = inverse.field.table().to_vec();
            inverse.field = FieldBricks::new(grid.dims(), table, vectors.into()).unwrap();
        }
        Ok(inverse)
    }

    fn warp_volume(
        &self,
        volume: &Volume,
        moved: &Displacement,
        params: &WarpParams,
        exec: &Exec,
    ) -> Answer<Warped<Volume>> {
        let mut warped = Cpu.warp_volume(volume, moved, params, exec)?;
        let mut values: Vec<f32> =
            (0..volume.grid().len()).map(|i| warped.output.voxels().get(i) as f32).collect();
        let vector = |i: usize| moved.inverse().at(volume.grid().index(i));
        let moving = (0..values.len()).position(|i| vector(i) != [0.0; 3]).unwrap();
        let still = (0..values.len()).position(|i| vector(i) == [0.0; 3]).unwrap();
        match self.0 {
            Spoil::NanInVolume => values[moving] = f32::NAN,
            Spoil::ValueBeyondRange => values[moving] = 1e6,
            Spoil::StillVoxelChanged => values[still] = values[still].next_up(),
            _ => {}
        }
        warped.output = Volume::new(volume.grid().clone(), Voxels::from(values)).unwrap();
        Ok(warped)
    }

    fn radiance(&self, scene: &Scene<'_>, params: &RenderParams, exec: &Exec) -> Answer<Radiance> {
        let mut light = Cpu.radiance(scene, params, exec)?;
        match self.0 {
            Spoil::NanInLight => light.rgba[9][1] = f32::NAN,
            Spoil::BrightPixel => light.rgba[9] = [0.9, 0.9, 0.9, 0.5],
            _ => {}
        }
        Ok(light)
    }
}

#[test]
fn what_is_planted_in_a_stage_is_found_there() {
    examine(&Cpu, &case(), &Exec::default()).unwrap();
    for (spoil, stage) in [
        (Spoil::NanInVolume, Stage::Warp),
        (Spoil::NanInLight, Stage::Render),
        (Spoil::HandleOff, Stage::Deform),
        (Spoil::LabelBeyondK, Stage::Segment),
        (Spoil::LabelShifted, Stage::Segment),
        (Spoil::VertexMoved, Stage::Refine),
        (Spoil::HoleInLattice, Stage::Lattice),
        (Spoil::BoundTooSmall, Stage::Refine),
        (Spoil::TreeOfAnother, Stage::Octree),
        (Spoil::InverseOff, Stage::Inverse),
        (Spoil::ValueBeyondRange, Stage::Warp),
        (Spoil::StillVoxelChanged, Stage::Warp),
        (Spoil::BrightPixel, Stage::Render),
    ] {
        let found = examine(&Spoiled(spoil), &case(), &Exec::default()).expect_err("the fault is found");
        assert_eq!(found.stage, stage, "{spoil:?}: {found}");
    }
}

/// A backend whose class means come from single-precision sums in the order in which threads arrive.
struct Unordered(AtomicU64);

impl Backend for Unordered {
    fn name(&self) -> &'static str {
        "unordered"
    }

    fn kmvs(&self, volume: &Volume, params: &KmvsParams, exec: &Exec) -> Answer<Segmentation> {
        let mut found = Cpu.kmvs(volume, params, exec)?;
        let run = self.0.fetch_add(1, Ordering::Relaxed);
        let values: Vec<f32> = (0..volume.grid().len()).map(|i| volume.voxels().get(i) as f32).collect();
        let sum = Mutex::new(0.0_f32);
        std::thread::scope(|scope| {
            for (i, part) in values.chunks(97).enumerate() {
                let sum = &sum;
                scope.spawn(move || {
                    // Threads of a busy machine start when they can; this makes it sure that they do.
                    std::thread::sleep(Duration::from_micros((i as u64 * 37 + run * 53) % 11 * 300));
                    let own = part.iter().sum::<f32>() * 1.1;
                    *sum.lock().unwrap() += own;
                });
            }
        });
        let mut classes = found.labels.classes().to_vec();
        classes[0].mean += f64::from(sum.into_inner().unwrap());
        found.labels =
            Labels::new(volume.grid().clone(), found.labels.ids().to_vec().into(), classes).unwrap();
        Ok(found)
    }
}

#[test]
fn a_sum_in_the_order_of_arrival_is_found() {
    let found = same_bytes(&Unordered(AtomicU64::new(0)), &case(), &[2, 8], 20).expect_err("it is found");
    // k-means with positions is asked through the same spoilt method.
    assert!(found.contains("segment") || found.contains("kmvs"), "{found}");
    same_bytes(&Cpu, &case(), &[2, 8], 2).unwrap();
}

/// A backend whose springs end one bit elsewhere where the processor's own instructions may be used.
struct WideErrs;

impl Backend for WideErrs {
    fn name(&self) -> &'static str {
        "wide errs"
    }

    fn springs(
        &self,
        asked: &Asked<'_>,
        params: &mass_spring::Params,
        exec: &Exec,
    ) -> Answer<mass_spring::MassSpringResult> {
        let mut solved = Cpu.springs(asked, params, exec)?;
        if exec.simd {
            solved.motion = with_last(&solved.motion, |moved| {
                let first = moved.as_flattened_mut().iter_mut().find(|x| **x != 0.0).unwrap();
                *first = first.next_up();
            })?;
        }
        Ok(solved)
    }
}

#[test]
fn one_bit_between_wide_lanes_and_plain_loops_is_found() {
    let found = same_bytes(&WideErrs, &case(), &[1], 2).expect_err("it is found");
    assert!(found.contains("deform"), "{found}");
}
