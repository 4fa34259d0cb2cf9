use std::sync::Arc;

use ivd_core::{Exec, Volume, VoxelType};
use ivd_phantom::{Params, generate};
use ivd_segment::{KmvsParams, kmvs};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::judged;

/// Numbers of classes.
const CLASSES: [usize; 11] = [2, 3, 4, 6, 8, 12, 16, 32, 64, 128, 256];

/// How well K classes stand for the values: the number of classes against their spread. The partition itself is exact.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let params = Params { size, voxel_type: VoxelType::U16, ..Params::default() };
    let volume = Arc::new(generate(&params, exec)?.volume);
    Ok(on(&volume, format!("head phantom of {size}³ voxels, u16, with noise")))
}

/// The same on any volume.
pub(super) fn on(volume: &Arc<Volume>, input: String) -> Experiment {
    let voxels = volume.grid().len();
    let settings = CLASSES.map(|k| {
        let volume = volume.clone();
        Setting::new([("k", k.to_string())], k == KmvsParams::default().k, move |exec| {
            let found = kmvs(&volume, None, &KmvsParams { k, ..KmvsParams::default() }, exec)?;
            let count = volume.grid().len() as f64;
            Ok(Box::new(move || {
                let visited = found.visited_fraction * count;
                Ok(judged((found.objective / count).sqrt(), [("voxels", visited), ("gap", found.gap)]))
            }))
        })
    });
    Experiment {
        stage: "segment",
        input,
        truth: "the voxels' own values",
        measure: "distance of a value from its class's mean, root mean square",
        unit: "grey value",
        counted: None,
        voxel_mm: None,
        work: ("voxels", voxels as f64),
        settings: settings.into(),
    }
}
