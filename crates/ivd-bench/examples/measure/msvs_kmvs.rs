//! How many classes mean shift proposes and how many are kept: `measure msvs-kmvs FILE NX NY NZ`, u8.

use ivd_core::Exec;
use ivd_segment::{ChainParams, msvs_kmvs};

use crate::anything::Anything;
use crate::raw;

pub(crate) const USAGE: &str = "FILE NX NY NZ";

pub(crate) fn run(args: &[String]) -> Anything<()> {
    let [file, nx, ny, nz] = args else { return Err(USAGE.into()) };
    let volume = raw::volume(file, "u8", [nx.parse()?, ny.parse()?, nz.parse()?], [1.0; 3])?;
    let found = msvs_kmvs(&volume, None, &ChainParams::default(), &Exec::default())?;
    println!(
        "msvs {:.3} s, {} proposed; kmvs {:.3} s, {} kept",
        found.times.msvs.as_secs_f64(),
        found.k_proposed,
        found.times.kmvs.as_secs_f64(),
        found.k_kept
    );
    for point in &found.curve {
        println!("  {:3} classes: inertia {:.4e}, bic {:.4e}", point.k, point.objective, point.bic);
    }
    for class in found.segmentation.labels.classes() {
        println!(
            "  class {}: mean {:.1}, spread {:.1}, {} voxels",
            class.id, class.mean, class.sd, class.voxels
        );
    }
    Ok(())
}
