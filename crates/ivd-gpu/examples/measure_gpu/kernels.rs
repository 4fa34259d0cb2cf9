//! Kernels that give the processor's bytes: how long each takes, what share of the copy bandwidth that is, and the processor's time.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use ivd_core::{BrickRanges, Device, Displacement, Exec, Kernel, Volume, Voxels};
use ivd_field::warp::plan::Warping;
use ivd_field::warp::{self, WarpParams};
use ivd_gpu::SharedGpu;
use ivd_lattice::extract::plan::Cutting;
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_segment::plan::{Counted, Counting, Labelled, Labelling};

const ROUNDS: usize = 7;

/// What a kernel does, on whatever an `Exec` has: something to compare.
type Work<'a> = Box<dyn Fn(&Exec) -> Result<Vec<u8>, Box<dyn Error>> + 'a>;

/// Measures every kernel on a volume, and on the same of 16 bits, and prints an object for each. `warm` brings the card up to its pace.
///
/// # Errors
/// Where the device fails, or gives other bytes than the processor.
pub(crate) fn measure(
    gpu: &SharedGpu,
    bytes: &Volume,
    moved: &Displacement,
    copy: f64,
    warm: &dyn Fn() -> Result<(), Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let device = Device::new("measured")
        .with::<BrickRanges>(gpu.clone())
        .with::<Counting>(gpu.clone())
        .with::<Labelling>(gpu.clone())
        .with::<Cutting>(gpu.clone())
        .with::<Warping<u8>>(gpu.clone())
        .with::<Warping<u16>>(gpu.clone());
    let device = Exec::default().with_device(Arc::new(device.required(true)));
    let wide: Vec<u16> = bytes
        .voxels()
        .as_bytes()
        .iter()
        .enumerate()
        .map(|(i, v)| u16::from(*v) * 16 + (i % 16) as u16)
        .collect();
    let wide = Volume::new(bytes.grid().clone(), Voxels::from(wide))?;
    for volume in [bytes, &wide] {
        let (n, width) = (volume.grid().len() as f64, volume.voxel_type().bytes() as f64);
        let counted = Counted::new(volume.voxels(), None).ok_or("16 bits at most")?;
        let top = volume.stored_range().ok_or("no value")?[1];
        let cuts: Vec<f64> = [0.2, 0.4, 0.7].iter().map(|share| share * top).collect();
        let labelled = Labelled { voxels: volume.voxels(), mask: None, cuts: &cuts, ids: &[1, 2, 3, 4] };
        let params = ExtractParams { iso: Iso::Value(0.6 * top) };
        let of_field = 512.0 * moved.inverse().stored() as f64;
        let kernels: Vec<(&str, &[&str], f64, Work<'_>)> = vec![
            (
                BrickRanges::NAME,
                &["ranges"],
                n * (width + 12.0 / 512.0),
                Box::new(|exec| {
                    let index = exec.launch::<BrickRanges>(&(volume.grid(), volume.voxels()))?;
                    Ok(index.parts().0.as_bytes().to_vec())
                }),
            ),
            (
                Counting::NAME,
                &["counts"],
                n * width,
                Box::new(|exec| Ok(bytemuck::cast_slice(&exec.launch::<Counting>(&counted)?).to_vec())),
            ),
            (
                Labelling::NAME,
                &["labels"],
                n * (width + 2.0),
                Box::new(|exec| Ok(bytemuck::cast_slice(&exec.launch::<Labelling>(&labelled)?).to_vec())),
            ),
            // Signs written and read, counts of three kinds written.
            (
                Cutting::NAME,
                &["signs", "counts of cells"],
                n * (width + (2.0 + 12.0) / 32.0),
                Box::new(|exec| {
                    let cut = extract(volume, None, &params, exec)?;
                    Ok(bytemuck::cast_slice(cut.lattice.places()).to_vec())
                }),
            ),
            (
                Warping::<u8>::NAME,
                &["voxels that move"],
                of_field * (12.0 + 2.0 * width),
                Box::new(|exec| {
                    Ok(warp::volume(volume, moved, &WarpParams::default(), exec)?
                        .output
                        .voxels()
                        .as_bytes()
                        .to_vec())
                }),
            ),
        ];
        for (name, kinds, least, work) in kernels {
            let expected = timed(&Exec::default(), &work)?;
            let first = timed(&device, &work)?;
            if expected.0 != first.0 {
                return Err(format!("{name}: the device's bytes aren't the processor's").into());
            }
            let (mut whole, mut alone, mut all) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
            let mut apart = Vec::new();
            for _ in 0..ROUNDS {
                warm()?;
                let before = (gpu.times(), gpu.counters().busy_ns);
                whole = whole.min(timed(&device, &work)?.1);
                let after = gpu.times();
                let ns = |kind: &str| {
                    let of = |times: &std::collections::BTreeMap<&str, (u64, u64)>| {
                        times.get(kind).map_or(0, |(_, ns)| *ns)
                    };
                    of(&after) - of(&before.0)
                };
                let each: Vec<f64> = kinds.iter().map(|kind| ns(kind) as f64 / 1e6).collect();
                if each.iter().sum::<f64>() < alone {
                    (alone, apart) = (each.iter().sum(), each);
                }
                all = all.min((gpu.counters().busy_ns - before.1) as f64 / 1e6);
            }
            println!(
                "{{\"kernel\":\"{name}\",\"of\":\"{}\",\"type\":\"{}\",\"device_ms\":{alone:.4},\"each\":{apart:.4?},\"all_passes_ms\":{all:.3},\"gb_s\":{:.0},\"share_of_copy\":{:.2},\"with_crossing_ms\":{whole:.1},\"first_ms\":{:.1},\"processor_ms\":{:.1}}}",
                kinds.join(" and "),
                volume.voxel_type().name(),
                least / alone / 1e6,
                least / (alone / 1e3) / copy,
                first.1,
                expected.1,
            );
        }
    }
    Ok(())
}

/// What work gives, and how long it takes (ms).
fn timed(exec: &Exec, work: &Work<'_>) -> Result<(Vec<u8>, f64), Box<dyn Error>> {
    let start = Instant::now();
    let made = work(exec)?;
    Ok((made, start.elapsed().as_secs_f64() * 1e3))
}
