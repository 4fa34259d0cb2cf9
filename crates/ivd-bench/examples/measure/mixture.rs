//! Fits a Gaussian mixture to raw voxels and prints it as JSON, for comparisons with other programs.
//!
//! `measure mixture FILE TYPE NX,NY,NZ SX,SY,SZ PARAMS [THREADS [REPEATS [LABELS]]]`: little-endian voxels of TYPE (u8, i16, u16, f32), spacing in mm,
//! PARAMS the JSON of `EmvsParams`, or `@file` that holds it.

use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::Exec;
use ivd_segment::{EmvsParams, emvs};

use crate::anything::Anything;
use crate::raw;

pub(crate) const USAGE: &str = "FILE TYPE NX,NY,NZ SX,SY,SZ PARAMS [THREADS [REPEATS [LABELS]]]";

pub(crate) fn run(args: &[String]) -> Anything<()> {
    let [file, kind, dims, spacing, params, rest @ ..] = args else { return Err(USAGE.into()) };
    let params = match params.strip_prefix('@') {
        Some(path) => std::fs::read_to_string(path)?,
        None => params.clone(),
    };
    let params: EmvsParams = serde_json::from_str(&params)?;
    let volume = raw::volume(file, kind, raw::three(dims)?, raw::three(spacing)?)?;
    let threads = rest.first().map_or(Ok(2), |t| t.parse())?;
    let repeats = rest.get(1).map_or(Ok(1), |t| t.parse())?;
    let exec = Exec::default().with_threads(threads);
    let mut times = Vec::new();
    let mut found = None;
    for _ in 0..repeats {
        let (wall, processor) = (Instant::now(), ProcessTime::now());
        found = Some(emvs(&volume, None, &params, &exec)?);
        times.push([wall.elapsed().as_secs_f64(), processor.elapsed().as_secs_f64()]);
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
            "peak_mib": raw::peak_mib(),
        })
    );
    if let Some(path) = rest.get(2) {
        raw::write_labels(path, found.segmentation.labels.ids())?;
    }
    Ok(())
}
