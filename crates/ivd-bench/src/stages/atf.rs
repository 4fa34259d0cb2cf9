use std::sync::Arc;

use ivd_atf::{Params, transfer};
use ivd_core::{Exec, TransferFunction, Volume};
use ivd_segment::{KmvsParams, kmvs};

use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::judged;

/// Samples of a row.
const RESOLUTIONS: [usize; 12] = [2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 4096, 16384];
/// The truth's.
const FINEST: usize = 65536;
/// Places along the value axis where tables are compared.
const PLACES: usize = 20_011;

/// Samples of a table against what they miss of the function.
pub(super) fn experiment(size: usize, exec: &Exec) -> Result<Experiment, Problem> {
    let phantom =
        ivd_phantom::generate(&ivd_phantom::Params { size, ..ivd_phantom::Params::default() }, exec)?;
    on(&Arc::new(phantom.volume), format!("head phantom of {size}³ voxels, u8, four classes"), exec)
}

/// The same on any volume.
pub(super) fn on(volume: &Arc<Volume>, input: String, exec: &Exec) -> Result<Experiment, Problem> {
    let voxels = volume.grid().len();
    let labels = Arc::new(kmvs(volume, None, &KmvsParams::default(), exec)?.labels);
    let params = |resolution| Params { resolution, ..Params::default() };
    let finest = Arc::new(transfer(volume, &labels, &params(FINEST), exec)?.transfer);
    let settings = RESOLUTIONS.map(|resolution| {
        let (volume, labels, finest) = (volume.clone(), labels.clone(), finest.clone());
        let default = resolution == Params::default().resolution;
        Setting::new([("resolution", resolution.to_string())], default, move |exec| {
            let found = transfer(&volume, &labels, &params(resolution), exec)?.transfer;
            let finest = finest.clone();
            Ok(Box::new(move || {
                Ok(judged(apart(&found, &finest), [("samples", found.table().len() as f64)]))
            }))
        })
    });
    Ok(Experiment {
        stage: "atf",
        input,
        truth: "the same function in 65,536 samples",
        measure: "difference of colour or opacity, mean over the value axis",
        unit: "of 1",
        counted: Some("samples"),
        voxel_mm: None,
        work: ("voxels", voxels as f64),
        settings: settings.into(),
    })
}

/// Mean over the value axis of the largest difference of a component, in row 0.
fn apart(a: &TransferFunction, b: &TransferFunction) -> f64 {
    let [low, high] = b.range();
    let differences = (0..PLACES).map(|i| {
        let value = low + (high - low) * i as f64 / (PLACES - 1) as f64;
        let (a, b) = (a.sample(0, value), b.sample(0, value));
        a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
    });
    differences.sum::<f64>() / PLACES as f64
}
