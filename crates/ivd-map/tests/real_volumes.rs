//! Real scans, from the file to the deformed volume: handles that move by three voxels or more, with a radius of eight
//! times their motion, are mapped without a fold, pulled out and pushed in.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use std::path::{Path, PathBuf};

use ivd_core::{Exec, FieldBricks, Scalar, Volume, with_voxels};
use ivd_field::warp;
use ivd_lattice::{extract, refine};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams};

/// A scan, an isovalue of its surface, and a handle on it: place, motion (mm).
struct Scan {
    file: &'static str,
    iso: f64,
    pick: [f64; 3],
    motion: [f64; 3],
}

const SCANS: [Scan; 4] = [
    Scan { file: "bonsai/bonsai.nii.gz", iso: 100.0, pick: [87.0, -58.0, -93.0], motion: [6.0, 0.0, 0.0] },
    Scan { file: "engine/engine.nii.gz", iso: 100.0, pick: [-16.0, 103.0, 40.0], motion: [0.0, -5.0, 0.0] },
    Scan {
        file: "mni152/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz",
        iso: 150.0,
        pick: [68.0, -36.0, -5.0],
        motion: [-4.0, 0.0, 0.0],
    },
    Scan { file: "tooth/tooth.nhdr", iso: 1000.0, pick: [-64.0, -9.0, 128.0], motion: [0.0, 4.0, 0.0] },
];

/// Skin, brain and all between: a surface of hundreds of pieces.
const HEAD: Scan = Scan {
    file: "mri_head_seg3d/MR.nii.gz",
    iso: 60.0,
    pick: [-316.0, 124.0, 430.0],
    motion: [0.0, 8.0, 0.0],
};

pub(crate) fn data() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    if folder.is_dir() {
        return Some(folder.to_owned());
    }
    eprintln!("no real volumes beside the checkout: skipped");
    None
}

#[test]
fn handles_on_scans_are_mapped_without_a_fold() {
    assert_mapped_without_a_fold(&SCANS);
}

/// The same on a head, by `just stress`; its scene is among those whose hashes are kept.
#[test]
#[ignore = "as long as all the others together; run it with --ignored"]
fn a_handle_on_a_head_is_mapped_without_a_fold() {
    assert_mapped_without_a_fold(&[HEAD]);
}

fn assert_mapped_without_a_fold(scans: &[Scan]) {
    let Some(folder) = data() else { return };
    let exec = Exec::default();
    for scan in scans {
        let volume =
            ivd_io::volume::read(&folder.join(scan.file), &ivd_io::volume::ReadOptions::default(), &exec)
                .unwrap();
        let surface = extract::ExtractParams { iso: extract::Iso::Value(scan.iso) };
        let lattice = extract::extract(&volume, None, &surface, &exec).unwrap().lattice;
        let lattice = refine::collapse(&lattice, &refine::RefineParams::default(), &exec).unwrap().lattice;
        let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec).unwrap();
        let radius = 8.0 * scan.motion.iter().map(|c| c * c).sum::<f64>().sqrt();
        let handle = Handle { at: Anchor::NearestTo(scan.pick), action: Action::Move(scan.motion), radius };
        let solved = ring::solve(&lattice, &[handle], &[], &RingParams::default(), &exec).unwrap();
        for method in ["octree", "biharmonic"] {
            let begin = std::time::Instant::now();
            let mapped = if method == "octree" {
                ivd_map::octree(
                    &lattice,
                    &octree,
                    &solved.motion,
                    0,
                    &ivd_map::OctreeParams::default(),
                    &exec,
                )
            } else {
                ivd_map::biharmonic(&lattice, &solved.motion, 0, &ivd_map::BiharmonicParams::default(), &exec)
            };
            let mapped = mapped.unwrap_or_else(|error| panic!("{}, {method}: {error}", scan.file));
            let (followed, spent) = (&mapped.figures.followed, begin.elapsed().as_secs_f64());
            eprintln!(
                "{}, {method}: {spent:.2} s, misfit {:.4}, {:.3} voxels at most, {:.4} rms; {} rounds of repair, {:?}",
                scan.file,
                followed.misfit,
                followed.misfit_max_voxel,
                followed.misfit_rms_voxel,
                mapped.figures.relaxations,
                mapped.figures.solved
            );
            let warped =
                warp::volume(&volume, &mapped.displacement, &warp::WarpParams::default(), &exec).unwrap();
            assert!(mapped.figures.min_det_j > 0.0 && mapped.figures.folds == 0, "{}", scan.file);
            assert!(mapped.figures.inverse_residual_max_voxel < 1e-4, "{}, {method}", scan.file);
            assert!(followed.misfit < 0.1, "{}, {method}: {followed:?}", scan.file);
            let asked = solved.motion.max_displacement();
            let most = mapped.figures.largest_mm;
            assert!(most <= 1.02 * asked, "{}, {method}: {most} mm for {asked}", scan.file);
            assert!(followed.misfit_p95_voxel <= 0.25 && followed.misfit_p999_voxel <= 1.0, "{followed:?}");
            assert!(warped.voxels_resampled > 10_000);
            // The band that moves along is narrower than the reach, which the smooth field fills.
            let most = if method == "octree" { 4 } else { 1 };
            assert!(warped.voxels_resampled < warped.voxels_total / most);
            unmoved_is_untouched(&volume, &warped.output, mapped.displacement.inverse());
        }
    }
}

fn unmoved_is_untouched(before: &Volume, after: &Volume, inverse: &FieldBricks) {
    let bits =
        |volume: &Volume, i: usize| with_voxels!(volume.voxels(), slice => slice[i].to_f64().to_bits());
    let grid = before.grid();
    let still = (0..grid.len()).filter(|&i| inverse.at(grid.index(i)) == [0.0; 3]);
    assert_eq!(still.filter(|&i| bits(before, i) != bits(after, i)).count(), 0);
}
