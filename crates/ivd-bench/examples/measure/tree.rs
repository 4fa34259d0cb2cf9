//! Grows and cuts a tree over voxels from a raw file, and says what it took: for comparisons with other programs.
//!
//!     measure tree FILE TYPE NX NY NZ [--linkage single|ward] [--alpha A] [--regions R] [--threads T] [--classes K]
//!             [--order persistence|height|area] [--smallest S] [--heights OUT] [--labels OUT]
//!
//! FILE holds the voxels, x fastest, little-endian; TYPE is u8, i16, u16, i32 or f32. OUT gets the merge heights as f64, or the
//! labels as u16. Prints one line of JSON.

use std::collections::HashMap;
use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::{Exec, Linkage};
use ivd_segment::{CutParams, HvsParams, Ranking, cut, region_tree};

use crate::anything::Anything;
use crate::raw;

pub(crate) const USAGE: &str = "FILE TYPE NX NY NZ [--linkage …] [--alpha …] [--regions …] [--threads …] [--classes …] [--order …] [--smallest …] [--heights …] [--labels …]";

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let mut words = words.iter();
    let (mut plain, mut named) = (Vec::new(), HashMap::new());
    while let Some(word) = words.next() {
        match word.strip_prefix("--") {
            Some(name) => drop(named.insert(name, words.next().ok_or("a value is missing")?)),
            None => plain.push(word),
        }
    }
    let [file, kind, nx, ny, nz] = &plain[..] else {
        return Err(USAGE.into());
    };
    let volume = raw::volume(file, kind, [nx.parse()?, ny.parse()?, nz.parse()?], [1.0; 3])?;
    let named = |name: &str| named.get(name).map(|value| value.as_str());
    let mut params = HvsParams { alpha: named("alpha").map(str::parse).transpose()?, ..HvsParams::default() };
    if named("linkage") == Some("single") {
        params.linkage = Linkage::Single;
    }
    if let Some(regions) = named("regions") {
        params.max_regions = regions.parse()?;
    }
    let ranking = match named("order") {
        Some("height") => Ranking::Height,
        Some("area") => Ranking::Area,
        _ => Ranking::Persistence,
    };
    let exec = Exec::default().with_threads(named("threads").unwrap_or("2").parse()?);

    let (start, cpu) = (Instant::now(), ProcessTime::now());
    let found = region_tree(&volume, None, &params, &exec)?;
    let (grown, cpu_grown) = (start.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
    let peak = raw::peak_mib();
    let classes = named("classes").unwrap_or("6").parse()?;
    let least_part = named("smallest").unwrap_or("1").parse()?;
    let start = Instant::now();
    let params = CutParams { k: classes, ranking, least_part, ..CutParams::default() };
    let segments = cut(&found.tree, &params, &exec)?;
    let cut_seconds = start.elapsed().as_secs_f64();

    if let Some(out) = named("heights") {
        let heights = (0..found.tree.merges.len()).flat_map(|m| found.tree.height(m).to_le_bytes());
        std::fs::write(out, heights.collect::<Vec<u8>>())?;
    }
    if let Some(out) = named("labels") {
        raw::write_labels(out, segments.labels.ids())?;
    }
    let sizes: Vec<u64> = segments.labels.classes().iter().map(|c| c.voxels).take(12).collect();
    println!(
        "{{\"voxels\": {}, \"leaves\": {}, \"grow_s\": {grown:.4}, \"grow_cpu_s\": {cpu_grown:.4}, \"cut_s\": {cut_seconds:.4}, \
         \"tree_mib\": {}, \"peak_grow_mib\": {peak:.0}, \"peak_mib\": {:.0}, \"excess\": {:e}, \"inversions\": {}, \"bridges\": {}, \
         \"k\": {}, \"inertia\": {:e}, \"sizes\": {sizes:?}}}",
        volume.grid().len(),
        found.regions,
        found.tree.bytes() >> 20,
        raw::peak_mib(),
        found.excess,
        found.inversions,
        found.tree.bridges,
        segments.k,
        segments.objective,
    );
    Ok(())
}
