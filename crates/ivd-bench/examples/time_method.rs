//! Times one way to cluster on raw voxels, for comparisons with other programs and for plots of growth.
//!
//! `time_method METHOD FILE TYPE NX,NY,NZ PARAMS [REPEATS [LABELS]]`: METHOD is kmvs, emvs, msvs, msvs+kmvs or hvs; the file
//! holds little-endian voxels of TYPE (u8, u16, f32), 1 mm apart; PARAMS is the JSON of the method's parameters (kmvs weighs
//! places where they say so; hvs takes `classes` beside them). Prints JSON: wall and processor time of each run (s), peak
//! memory (MiB), the method's own figure, K, iterations. LABELS gets the labels as u16.

use std::error::Error;
use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_segment::{
    Cut, CutParams, HvsParams, KmvsParams, Segmentation, cut, emvs, hvs_tree, kmvs, kmvs_spatial, msvs,
    msvs_kmvs,
};
use serde::de::DeserializeOwned;

type Anything<T> = Result<T, Box<dyn Error>>;
type Method<'a> = Box<dyn Fn(&Exec) -> Anything<Segmentation> + 'a>;

fn voxels(path: &str, kind: &str) -> Anything<Voxels> {
    let bytes = std::fs::read(path)?;
    Ok(match kind {
        "u8" => bytes.into(),
        "u16" => bytes.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "f32" => bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        _ => return Err(format!("{kind}: use u8, u16 or f32").into()),
    })
}

fn params<P: DeserializeOwned>(text: &str) -> Anything<P> {
    Ok(serde_json::from_str(text)?)
}

/// The method as something to run again and again.
fn method<'a>(name: &str, text: &str, volume: &'a Volume) -> Anything<Method<'a>> {
    Ok(match name {
        "kmvs" => {
            let params: KmvsParams = params(text)?;
            Box::new(move |exec| {
                Ok(if params.spatial_weight > 0.0 {
                    kmvs_spatial(volume, None, &params, exec)?.segmentation
                } else {
                    kmvs(volume, None, &params, exec)?
                })
            })
        }
        "emvs" => {
            let params = params(text)?;
            Box::new(move |exec| Ok(emvs(volume, None, &params, exec)?.segmentation))
        }
        "msvs" => {
            let params = params(text)?;
            Box::new(move |exec| Ok(msvs(volume, None, &params, exec)?.segmentation))
        }
        "msvs+kmvs" => {
            let params = params(text)?;
            Box::new(move |exec| Ok(msvs_kmvs(volume, None, &params, exec)?.segmentation))
        }
        "hvs" => {
            let mut value: serde_json::Value = serde_json::from_str(text)?;
            let classes = value.as_object_mut().and_then(|o| o.remove("classes")).unwrap_or(4.into());
            let classes = classes.as_u64().ok_or("classes: a whole number is expected")?;
            let params: HvsParams = serde_json::from_value(value)?;
            let classes = CutParams { cut: Cut::Classes(classes as usize), ..CutParams::default() };
            Box::new(move |exec| Ok(cut(&hvs_tree(volume, None, &params, exec)?.tree, &classes, exec)?))
        }
        _ => return Err(format!("{name}: use kmvs, emvs, msvs, msvs+kmvs or hvs").into()),
    })
}

/// Largest memory so far (MiB).
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn main() -> Anything<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, file, kind, dims, text, rest @ ..] = &arguments[..] else {
        return Err("time_method METHOD FILE TYPE NX,NY,NZ PARAMS [REPEATS [LABELS]]".into());
    };
    let dims: Vec<usize> = dims.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let dims: [usize; 3] = dims.try_into().map_err(|_| "NX,NY,NZ: three numbers are expected")?;
    let volume = Volume::new(Grid::with_spacing(dims, [1.0; 3])?, voxels(file, kind)?)?;
    let run = method(name, text, &volume)?;
    let exec = Exec::default().with_threads(2);
    let before = peak();
    let (mut times, mut found) = (Vec::new(), None);
    for _ in 0..rest.first().map_or(Ok(1), |n| n.parse())? {
        drop(found.take());
        let (wall, processor) = (Instant::now(), ProcessTime::now());
        found = Some(run(&exec)?);
        times.push([wall.elapsed().as_secs_f64(), processor.elapsed().as_secs_f64()]);
    }
    let found = found.ok_or("at least one repeat")?;
    println!(
        "{}",
        serde_json::json!({
            "times": times, "peak_mib": peak(), "volume_mib": before, "objective": found.objective, "k": found.k,
            "iterations": found.iterations, "visited_fraction": found.visited_fraction,
        })
    );
    if let Some(path) = rest.get(1) {
        std::fs::write(path, found.labels.ids().iter().flat_map(|id| id.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    Ok(())
}
