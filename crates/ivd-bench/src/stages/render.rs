use std::sync::Arc;

use ivd_core::{Exec, TransferFunction, Volume};
use ivd_render::{Fit, Radiance, RenderParams, Scene, View, radiance};
use ivd_segment::{KmvsParams, kmvs};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::{judged, root_mean_square};

/// Steps (of the smallest spacing) and opacities at which rays end; above 1 none does.
const STEPS: [f64; 9] = [0.125, 0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0];
const TERMINATIONS: [f64; 5] = [0.8, 0.95, 0.99, 0.999, 2.0];
/// The truth's step.
const FINEST: f64 = 0.03125;

/// The step, and the opacity at which a ray ends, against what a very short step gives.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let volume =
        ivd_phantom::generate(&ivd_phantom::Params { size, ..ivd_phantom::Params::default() }, exec)?.volume;
    on(&Arc::new(volume), format!("head phantom of {size}³ voxels, u8, shaded, {SIDE}² pixels"), exec)
}

/// The same on any volume.
pub(super) fn on(volume: &Arc<Volume>, input: String, exec: &Exec) -> Result<Experiment, Problem> {
    let edge = (volume.grid().len() as f64).cbrt();
    let labels = kmvs(volume, None, &KmvsParams::default(), exec)?.labels;
    let transfer = ivd_atf::transfer(volume, &labels, &ivd_atf::Params::default(), exec)?.transfer;
    let scene = Arc::new((volume.clone(), transfer));
    let finest = Arc::new(seen(&scene, FINEST, 2.0, exec)?);
    let defaults = RenderParams::default();
    let pairs = STEPS.into_iter().flat_map(|step| TERMINATIONS.map(|end| (step, end)));
    let settings = pairs.map(|(step, termination)| {
        let (scene, finest) = (scene.clone(), finest.clone());
        let default = step == defaults.step && termination == defaults.termination;
        let knobs = [("step", step.to_string()), ("termination", termination.to_string())];
        Setting::new(knobs, default, move |exec| {
            let found = seen(&scene, step, termination, exec)?;
            let finest = finest.clone();
            Ok(Box::new(move || {
                let counters = [("samples", found.samples as f64), ("skipped", found.skipped as f64)];
                Ok(judged(apart(&found, &finest), counters))
            }))
        })
    });
    Ok(Experiment {
        stage: "render",
        input,
        truth: "a step of 1/32 voxel, no ray ended early",
        measure: "difference of linear light, root mean square",
        unit: "of 1",
        counted: Some("samples"),
        voxel_mm: None,
        work: ("pixels × voxels along an edge", (SIDE * SIDE) as f64 * edge),
        settings: settings.collect(),
    })
}

/// Pixels along the picture's side.
const SIDE: usize = 192;

fn seen(
    scene: &(Arc<Volume>, TransferFunction),
    step: f64,
    termination: f64,
    exec: &Exec,
) -> Result<Radiance, Problem> {
    let view = View { angles: [40.0, 15.0], ..View::FRONT };
    // By the volume, so that rays are as long whatever is seen.
    let fit = Fit::Volume;
    let params = RenderParams { size: [SIDE; 2], step, termination, view, fit, ..RenderParams::default() };
    let scene = Scene { transfer: Some(&scene.1), ..Scene::new(&scene.0) };
    Ok(radiance(&scene, &params, exec)?)
}

fn apart(a: &Radiance, b: &Radiance) -> f64 {
    let pairs = a.rgba.iter().flatten().zip(b.rgba.iter().flatten());
    root_mean_square(pairs.map(|(a, b)| f64::from(a - b).powi(2)))
}
