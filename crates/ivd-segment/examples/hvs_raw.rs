//! Grows and cuts a tree over voxels from a raw file, and says what it took: for comparisons with other programs.
//!
//!     hvs_raw FILE TYPE NX NY NZ [--linkage single|ward] [--alpha A] [--regions R] [--threads T] [--classes K]
//!             [--order persistence|height|area] [--smallest S] [--heights OUT] [--labels OUT]
//!
//! FILE holds the voxels, x fastest, little-endian; TYPE is u8, i16, u16, i32 or f32. OUT gets the merge heights as f64, or the
//! labels as u16. Prints one line of JSON.

use std::collections::HashMap;
use std::time::Instant;

use ivd_core::{Exec, Grid, Linkage, Volume, Voxels};
use ivd_segment::{Cut, CutParams, HvsParams, Ranking, cut, hvs_tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let (mut plain, mut named) = (Vec::new(), HashMap::new());
    while let Some(word) = words.next() {
        match word.strip_prefix("--") {
            Some(name) => drop(named.insert(name.to_owned(), words.next().ok_or("a value is missing")?)),
            None => plain.push(word),
        }
    }
    let [file, kind, nx, ny, nz] = &plain[..] else {
        return Err("hvs_raw FILE TYPE NX NY NZ [--…]".into());
    };
    let volume = read(file, kind, [nx.parse()?, ny.parse()?, nz.parse()?])?;
    let named = |name: &str| named.get(name).map(String::as_str);
    let mut params = HvsParams { alpha: named("alpha").map(str::parse).transpose()?, ..HvsParams::default() };
    if named("linkage") == Some("single") {
        params.linkage = Linkage::Single;
    }
    if let Some(regions) = named("regions") {
        params.max_regions = regions.parse()?;
    }
    let order = match named("order") {
        Some("height") => Ranking::Height,
        Some("area") => Ranking::Area,
        _ => Ranking::Persistence,
    };
    let exec = Exec::default().with_threads(named("threads").unwrap_or("2").parse()?);

    let (start, cpu) = (Instant::now(), cpu_seconds());
    let found = hvs_tree(&volume, None, &params, &exec)?;
    let (grown, cpu_grown, peak) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu, peak_mib());
    let classes = named("classes").unwrap_or("6").parse()?;
    let smallest = named("smallest").unwrap_or("1").parse()?;
    let start = Instant::now();
    let segments = cut(&found.tree, &CutParams { cut: Cut::Classes(classes), order, smallest }, &exec)?;
    let cut_seconds = start.elapsed().as_secs_f64();

    if let Some(out) = named("heights") {
        let heights = (0..found.tree.merges.len()).flat_map(|m| found.tree.height(m).to_le_bytes());
        std::fs::write(out, heights.collect::<Vec<u8>>())?;
    }
    if let Some(out) = named("labels") {
        let labels = segments.labels.ids().iter().flat_map(|id| id.to_le_bytes());
        std::fs::write(out, labels.collect::<Vec<u8>>())?;
    }
    let sizes: Vec<u64> = segments.labels.classes().iter().map(|c| c.voxels).take(12).collect();
    println!(
        "{{\"voxels\": {}, \"leaves\": {}, \"grow_s\": {grown:.4}, \"grow_cpu_s\": {cpu_grown:.4}, \"cut_s\": {cut_seconds:.4}, \
         \"tree_mib\": {}, \"peak_grow_mib\": {peak}, \"peak_mib\": {}, \"excess\": {:e}, \"inversions\": {}, \"bridges\": {}, \
         \"k\": {}, \"inertia\": {:e}, \"sizes\": {sizes:?}}}",
        volume.grid().len(),
        found.regions,
        found.tree.bytes() >> 20,
        peak_mib(),
        found.excess,
        found.inversions,
        found.tree.bridges,
        segments.k,
        segments.objective,
    );
    Ok(())
}

fn read(file: &str, kind: &str, dims: [usize; 3]) -> Result<Volume, Box<dyn std::error::Error>> {
    let bytes = std::fs::read(file)?;
    let voxels = match kind {
        "u8" => Voxels::from(bytes),
        "u16" => {
            Voxels::from(bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect::<Vec<_>>())
        }
        "i16" => {
            Voxels::from(bytes.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect::<Vec<_>>())
        }
        "i32" => Voxels::from(
            bytes.chunks_exact(4).map(|b| i32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect::<Vec<_>>(),
        ),
        "f32" => Voxels::from(
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect::<Vec<_>>(),
        ),
        _ => return Err("types: u8, i16, u16, i32, f32".into()),
    };
    Ok(Volume::new(Grid::with_spacing(dims, [1.0; 3])?, voxels)?)
}

/// Most memory that the process has held (MiB); 0 where the system doesn't say.
fn peak_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) >> 10
}

/// Processor time of the process so far (s), user and system; 0 where the system doesn't say.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(") ").next().unwrap_or("").split(' ').collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}
