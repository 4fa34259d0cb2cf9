//! A bench as records: what the defaults are held to and budgets choose by.

use ivd_budget::fronts::{Front, FrontPoint};

use crate::record::{Bench, Point, StageBench};

/// The fronts of a bench's stages, to be kept in `fixtures/fronts`.
pub fn fronts(bench: &Bench) -> Vec<Front> {
    bench.stages.iter().map(|stage| front(stage, bench)).collect()
}

fn front(stage: &StageBench, bench: &Bench) -> Front {
    Front {
        schema: 1,
        stage: stage.stage.clone(),
        input: stage.input.clone(),
        truth: stage.truth.clone(),
        measure: stage.measure.clone(),
        unit: stage.unit.clone(),
        counted: stage.counted.clone(),
        voxel_mm: stage.voxel_mm,
        work: stage.work.clone(),
        threads: bench.threads,
        repeats: bench.repeats,
        points: stage.points.iter().map(|p| recorded(p, stage)).collect(),
    }
}

fn recorded(point: &Point, stage: &StageBench) -> FrontPoint {
    let counter = |name: &String| point.counters.get(name).copied();
    FrontPoint {
        task: point.task.clone(),
        knobs: point.knobs.clone(),
        default: point.default,
        cpu_s: point.cpu_s,
        wall_s: point.wall_s,
        counted: stage.counted.as_ref().and_then(counter),
        error: point.error,
        error_voxels: stage.voxel_mm.map(|voxel| point.error / voxel),
        counters: point.counters.clone(),
    }
}
