//! Fits a Gaussian mixture to raw voxels and prints it as JSON, for comparisons with other programs.
//!
//! `emvs_json FILE TYPE NX,NY,NZ SX,SY,SZ PARAMS [THREADS [REPEATS]]`: little-endian voxels of TYPE (u8, i16, u16, f32), spacing in mm,
//! PARAMS the JSON of `EmvsParams`, or `@file` that holds it.

use std::error::Error;
use std::time::Instant;

use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_segment::{EmvsParams, emvs};

fn numbers<T: std::str::FromStr>(text: &str) -> Result<[T; 3], Box<dyn Error>> {
    let parts: Result<Vec<T>, _> = text.split(',').map(str::parse).collect();
    let parts = parts.map_err(|_| format!("{text}: three numbers are expected"))?;
    parts.try_into().map_err(|_| format!("{text}: three numbers are expected").into())
}

fn voxels(path: &str, kind: &str) -> Result<Voxels, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let pairs = || bytes.as_chunks::<2>().0.iter();
    Ok(match kind {
        "u8" => bytes.into(),
        "i16" => pairs().map(|b| i16::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "u16" => pairs().map(|b| u16::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        "f32" => bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect::<Vec<_>>().into(),
        _ => return Err(format!("{kind}: use u8, i16, u16 or f32").into()),
    })
}

/// Processor time of this process, user and system (s).
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = |field: usize| after_name.split_whitespace().nth(field).and_then(|t| t.parse::<f64>().ok());
    (ticks(11).unwrap_or(0.0) + ticks(12).unwrap_or(0.0)) / 100.0
}

/// Largest memory so far (MiB).
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [file, kind, dims, spacing, params, rest @ ..] = &args[..] else {
        return Err("emvs_json FILE TYPE NX,NY,NZ SX,SY,SZ PARAMS [THREADS [REPEATS]]".into());
    };
    let params = match params.strip_prefix('@') {
        Some(path) => std::fs::read_to_string(path)?,
        None => params.clone(),
    };
    let params: EmvsParams = serde_json::from_str(&params)?;
    let volume = Volume::new(Grid::with_spacing(numbers(dims)?, numbers(spacing)?)?, voxels(file, kind)?)?;
    let threads = rest.first().map_or(Ok(2), |t| t.parse())?;
    let repeats = rest.get(1).map_or(Ok(1), |t| t.parse())?;
    let exec = Exec::default().with_threads(threads);
    let mut times = Vec::new();
    let mut found = None;
    for _ in 0..repeats {
        let (wall, processor) = (Instant::now(), processor_time());
        found = Some(emvs(&volume, None, &params, &exec)?);
        times.push([wall.elapsed().as_secs_f64(), processor_time() - processor]);
    }
    let found = found.ok_or("at least one repeat")?;
    let labels: u64 = found
        .segmentation
        .labels
        .ids()
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, id| (hash ^ u64::from(*id)).wrapping_mul(0x0100_0000_01b3));
    let classes = found.segmentation.labels.classes();
    println!(
        "{}",
        serde_json::json!({
            "mixture": found.mixture,
            "log_likelihood": found.log_likelihood,
            "iterations": found.segmentation.iterations,
            "converged": found.segmentation.converged,
            "bic": found.bic,
            "energies": found.energies,
            "classes": classes,
            "labels": format!("{labels:016x}"),
            "times": times,
            "peak_mib": peak_memory(),
        })
    );
    if let Some(path) = rest.get(2) {
        let bytes: Vec<u8> = found.segmentation.labels.ids().iter().flat_map(|id| id.to_le_bytes()).collect();
        std::fs::write(path, bytes)?;
    }
    Ok(())
}
