//! The other ways to cluster: each knob that trades time for closeness to the method's own exact or finest answer.

use std::sync::{Arc, LazyLock};

use ivd_core::{Exec, Labels, Volume, VoxelType};
use ivd_phantom::{Params, generate};
use ivd_segment::{
    CutParams, EmvsParams, HvsParams, KmvsParams, MsvsParams, cut, emvs, kmvs_spatial, msvs, region_tree,
};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::judged;

/// Lloyd iterations of k-means with positions; the last is the default, which goes on until no label changes.
const ITERATIONS: [u64; 8] = [1, 2, 4, 8, 16, 32, 64, 300];
/// Changes of the mean log-likelihood at which a mixture stops.
const TOLERANCES: [f64; 7] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Cells of mean shift along a window; the last is the truth of the others.
const CELLS: [f64; 7] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 12.0];
/// A window of a multiple of this many voxels is cut into whole voxels by every one of [`CELLS`].
const WHOLE: f64 = 12.0;
/// Heads are rounded to a multiple of this many voxels; 24, 48, 72, 96 and 144 are cut into whole windows and cells.
const EVEN: usize = 24;
/// Regions that a tree starts from; the last is the truth of the others.
const REGIONS: [usize; 7] = [1_000, 4_000, 16_000, 64_000, 200_000, 400_000, 2_000_000];
/// Classes that a tree is judged by.
const TREE_CLASSES: usize = 64;

/// A noisy head in bytes.
fn head(size: usize, exec: &Exec) -> Result<(Arc<Volume>, String), Problem> {
    let params = Params { size, voxel_type: VoxelType::U8, ..Params::default() };
    Ok((Arc::new(generate(&params, exec)?.volume), format!("head phantom of {size}³ voxels, u8, with noise")))
}

/// The experiment of one of the methods; `None` for other names.
pub(super) fn experiment(stage: &str, size: usize, exec: &Exec) -> Option<Result<Experiment, Problem>> {
    let on: fn(&Arc<Volume>, String, &Exec) -> Result<Experiment, Problem> = match stage {
        "segment-kmvs" => kmeans,
        "segment-emvs" => mixture,
        "segment-msvs" => |volume, input, exec| Ok(modes(volume, input, exec)),
        "segment-hvs" => tree,
        _ => return None,
    };
    // Cells that the border cuts would make one setting err more than a coarser one.
    let size = if stage == "segment-msvs" { (size / EVEN).max(1) * EVEN } else { size };
    Some(head(size, exec).and_then(|(volume, input)| on(&volume, input, exec)))
}

/// The same on any volume.
pub(super) fn on(
    stage: &str,
    volume: &Arc<Volume>,
    input: String,
    exec: &Exec,
) -> Option<Result<Experiment, Problem>> {
    Some(match stage {
        "segment-kmvs" => kmeans(volume, input, exec),
        "segment-emvs" => mixture(volume, input, exec),
        "segment-msvs" => Ok(modes(volume, input, exec)),
        "segment-hvs" => tree(volume, input, exec),
        _ => return None,
    })
}

fn built(
    stage: &'static str,
    volume: &Volume,
    input: String,
    [truth, measure, unit]: [&'static str; 3],
    settings: Vec<Setting>,
) -> Experiment {
    let work = ("voxels", volume.grid().len() as f64);
    Experiment { stage, input, truth, measure, unit, counted: None, voxel_mm: None, work, settings }
}

/// k-means on position and intensity, stopped early.
fn kmeans(volume: &Arc<Volume>, input: String, exec: &Exec) -> Result<Experiment, Problem> {
    let grid = volume.grid();
    let edge = (0..3).map(|a| grid.dims()[a] as f64 * grid.spacing()[a]).fold(0.0, f64::max);
    let width = volume.range().map_or(1.0, |[low, high]| high - low);
    // An edge counts as a quarter of the range of values.
    let params = KmvsParams { spatial_weight: 0.25 * width / edge, ..KmvsParams::default() };
    let best = kmvs_spatial(volume, None, &params, exec)?.segmentation.objective;
    let settings = ITERATIONS.map(|most| {
        let (volume, params) = (volume.clone(), KmvsParams { max_iterations: most, ..params.clone() });
        let default = most == KmvsParams::default().max_iterations;
        Setting::new([("max_iterations", most.to_string())], default, move |exec| {
            let found = kmvs_spatial(&volume, None, &params, exec)?.segmentation;
            let count = volume.grid().len() as f64;
            Ok(Box::new(move || {
                let excess = (found.objective / best - 1.0).max(0.0);
                Ok(judged(
                    excess,
                    [("voxels", found.visited_fraction * count), ("iterations", found.iterations as f64)],
                ))
            }))
        })
    });
    let words =
        ["Lloyd's iteration until no label changes", "inertia above the truth's", "of the truth's inertia"];
    Ok(built("segment-kmvs", volume, input, words, settings.into()))
}

/// A mixture on intensity, stopped early.
fn mixture(volume: &Arc<Volume>, input: String, exec: &Exec) -> Result<Experiment, Problem> {
    let params = EmvsParams { k: Some(4), ..EmvsParams::default() };
    let long = EmvsParams { tolerance: 1e-12, max_iterations: 20_000, ..params.clone() };
    let best = emvs(volume, None, &long, exec)?.log_likelihood;
    let settings = TOLERANCES.map(|tolerance| {
        let (volume, params) = (volume.clone(), EmvsParams { tolerance, ..params.clone() });
        let default = tolerance == EmvsParams::default().tolerance;
        Setting::new([("tolerance", tolerance.to_string())], default, move |exec| {
            let found = emvs(&volume, None, &params, exec)?;
            Ok(Box::new(move || {
                let short = (best - found.log_likelihood).max(0.0);
                Ok(judged(short, [("iterations", found.segmentation.iterations as f64)]))
            }))
        })
    });
    let words = ["the same at tolerance 1e-12", "log-likelihood below the truth's, a voxel", "nat"];
    Ok(built("segment-emvs", volume, input, words, settings.into()))
}

/// Mean shift on position and intensity, on coarser cells.
fn modes(volume: &Arc<Volume>, input: String, exec: &Exec) -> Experiment {
    let (dims, spacing) = (volume.grid().dims(), volume.grid().spacing());
    let voxels = dims.into_iter().max().unwrap_or(1) as f64;
    let bandwidth = WHOLE * (0.2 * voxels / WHOLE).round().max(1.0);
    let voxel = spacing.into_iter().fold(f64::INFINITY, f64::min);
    let base = MsvsParams { spatial_bandwidth: bandwidth * voxel, ..MsvsParams::default() };
    let finest = MsvsParams { cells_per_bandwidth: CELLS[CELLS.len() - 1], ..base.clone() };
    // Found when the first result is held against it: who only asks what settings there are doesn't wait for it.
    let (of, exec) = (volume.clone(), exec.clone());
    let truth = Arc::new(LazyLock::new(move || {
        let found = msvs(&of, None, &finest, &exec).map_err(|problem| problem.to_string())?;
        Ok::<_, String>(found.segmentation.labels)
    }));
    let settings = CELLS.map(|cells| {
        let (volume, truth) = (volume.clone(), truth.clone());
        let params = MsvsParams { cells_per_bandwidth: cells, ..base.clone() };
        let default = cells == MsvsParams::default().cells_per_bandwidth;
        Setting::new([("cells_per_bandwidth", cells.to_string())], default, move |exec| {
            let found = msvs(&volume, None, &params, exec)?;
            let truth = truth.clone();
            Ok(Box::new(move || {
                let truth = LazyLock::force(&truth).as_ref().map_err(String::clone)?;
                let apart = 1.0 - agreement(&found.segmentation.labels, truth)?;
                Ok(judged(apart, [("cells", found.cells as f64)]))
            }))
        })
    });
    let words = ["twelve cells a bandwidth", "1 − adjusted Rand index to the truth", "of 1"];
    built("segment-msvs", volume, input, words, settings.into())
}

/// Ward's tree from fewer regions.
fn tree(volume: &Arc<Volume>, input: String, exec: &Exec) -> Result<Experiment, Problem> {
    let params = |max_regions| HvsParams { max_regions, ..HvsParams::default() };
    let classes =
        CutParams { k: TREE_CLASSES, ranking: ivd_segment::Ranking::Height, ..CutParams::default() };
    let squares = move |volume: &Volume, max_regions: usize, exec: &Exec| -> Result<(f64, f64), Problem> {
        let found = region_tree(volume, None, &params(max_regions), exec)?;
        Ok((cut(&found.tree, &classes, exec)?.objective, found.regions as f64))
    };
    let best = squares(volume, REGIONS[REGIONS.len() - 1], exec)?.0;
    let mut settings = Vec::new();
    let default = HvsParams::default().max_regions;
    for regions in crate::inputs::each_once(REGIONS.into_iter().chain([default])) {
        let volume = volume.clone();
        settings.push(Setting::new(
            [("max_regions", regions.to_string())],
            regions == default,
            move |exec| {
                let (found, count) = squares(&volume, regions, exec)?;
                Ok(Box::new(move || Ok(judged((found / best - 1.0).max(0.0), [("regions", count)]))))
            },
        ));
    }
    let words = [
        "the tree of two million regions",
        "sum of squares of 64 classes above the truth's",
        "of the truth's",
    ];
    Ok(built("segment-hvs", volume, input, words, settings))
}

/// Adjusted Rand index of two labellings.
fn agreement(a: &Labels, b: &Labels) -> Result<f64, Problem> {
    let artefact = |labels: &Labels| ivd_artefact::Artefact::Labels(labels.clone());
    let found = ivd_pipeline::compare(&artefact(a), &artefact(b), &Exec::default())?;
    Ok(found["ari"].as_f64().ok_or("labels have an adjusted Rand index")?)
}
