//! What is skipped changes nothing: with every skip off the results are the same, byte for byte.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::collections::BTreeMap;

use ivd_core::{BRICK, BrickIndex, Exec, Grid, Volume, Voxels};
use ivd_pipeline::{PipelineOptions, PipelineReport, State};
use ivd_render::{Mode, RenderParams, Scene, View, radiance};
use ivd_tests::Bench;

const HEAD: &str = "schema = 1\n[input]\nphantom = \"head\"\nsize = 40\n";
const CHEEK: &str = "[[deform.handle]]\npick = [32.0, 13.0, 12.0]\nmove = [-3.0, 0.0, 0.0]\nradius = 10.0\n";
const ALL: &str = "[[deform.handle]]\npick = [32.0, 13.0, 12.0]\nmove = [-3.0, 0.0, 0.0]\nradius = 400.0\n";

fn with_skips(skip: bool) -> Exec {
    let mut exec = Exec::default();
    exec.skip = skip;
    exec
}

/// What a scene asks for, and its text.
fn scenes() -> Vec<(&'static str, String)> {
    let part = "[boundary]\nclass = \"densest\"\n";
    let size = "[render]\nsize = [64, 64]\n";
    let moved = "[output]\nvolume = \"deformed.nrrd\"\nimages = [\"after\"]\n";
    let input = |phantom: &str| format!("schema = 1\n[input]\nphantom = \"{phantom}\"\nsize = 40\n");
    vec![
        ("a picture", format!("{HEAD}{size}[output]\nimages = [\"before\"]\n")),
        ("a lattice", format!("{HEAD}{part}[output]\nlattice = \"lattice.ply\"\n")),
        ("one cheek", format!("{HEAD}[lattice]\niso = 60.0\n{CHEEK}{size}{moved}")),
        ("everything moves", format!("{HEAD}[lattice]\niso = 60.0\n{ALL}{size}{moved}")),
        (
            "one class isolated",
            format!("{HEAD}{part}{CHEEK}{size}{moved}").replace("60.0, 0.0, 0.0", "42.0, 0.0, 0.0"),
        ),
        (
            "thin shells",
            format!(
                "{}[lattice]\niso = 100.0\n{size}[output]\nlattice = \"l.ply\"\nimages = [\"before\"]\n",
                input("shell")
            ),
        ),
        (
            "an isosurface",
            format!(
                "{}[lattice]\niso = 100.0\n[render]\nsize = [64, 64]\nmode = \"iso\"\n[output]\nimages = [\"before\"]\n",
                input("spheres")
            ),
        ),
        (
            "the greatest values",
            format!("{HEAD}[render]\nsize = [64, 64]\nmode = \"mip\"\n[output]\nimages = [\"before\"]\n"),
        ),
    ]
}

/// Content hash of every result.
fn hashes(report: &PipelineReport) -> BTreeMap<String, String> {
    let results = report.stages.iter().filter(|r| r.stage != "report");
    results
        .filter_map(|r| Some((format!("{} {}", r.stage, r.variant), r.output.as_ref()?.hash.clone())))
        .collect()
}

#[test]
fn every_result_is_the_same_with_every_skip_off() {
    for (name, text) in scenes() {
        let skipping = Bench::new(&text).run(&[]).unwrap_or_else(|e| panic!("{name}: {e}"));
        let plain = with_skips(false);
        let plain = Bench::new(&text).run_with(&[], &PipelineOptions::default(), &plain).unwrap();
        let (skipping_hashes, plain_hashes) = (hashes(&skipping), hashes(&plain));
        for (stage, hash) in &skipping_hashes {
            assert_eq!(plain_hashes.get(stage), Some(hash), "{name}: {stage}");
        }
        assert!(
            plain_hashes.len() > skipping_hashes.len() || name == "one class isolated",
            "{name}: nothing was skipped"
        );
        let ran = |report: &PipelineReport| report.stages.iter().filter(|r| r.state == State::Ran).count();
        assert!(ran(&plain) >= ran(&skipping));
    }
}

/// A box that fills one brick's own voxels: on three sides its border lies in the cells of the bricks before.
fn filled_brick() -> Volume {
    let grid = Grid::with_spacing([33, 33, 33], [1.0; 3]).unwrap();
    let inside = |i: usize| grid.index(i).0.iter().all(|c| c / BRICK == 2);
    let voxels: Vec<u8> = (0..grid.len()).map(|i| if inside(i) { 200 } else { 0 }).collect();
    Volume::new(grid, Voxels::from(voxels)).unwrap()
}

/// The index with bricks of 8³ voxels, without the layer that the next bricks share: off by one.
fn without_apron(volume: &Volume) -> BrickIndex {
    let (dims, n) = (BrickIndex::dims_for(volume.grid().dims()), volume.grid().dims());
    let (mut min, mut max) = (Vec::new(), Vec::new());
    for b in 0..dims.iter().product::<usize>() {
        let at = [b % dims[0], b / dims[0] % dims[1], b / dims[0] / dims[1]];
        let inside = |v: [usize; 3]| (0..3).all(|a| v[a] / BRICK == at[a] && v[a] < n[a]);
        let own = (0..volume.grid().len()).filter(|&i| inside(volume.grid().index(i).0));
        let values: Vec<f32> = own.map(|i| volume.voxels().get(i) as f32).collect();
        min.push(values.iter().copied().fold(f32::INFINITY, f32::min));
        max.push(values.iter().copied().fold(f32::NEG_INFINITY, f32::max));
    }
    let missing = vec![0_u8; min.len()];
    BrickIndex::from_parts(dims, min.into(), max.into(), missing.into()).unwrap()
}

#[test]
fn an_apron_that_is_off_by_one_is_caught() {
    let seen = |volume: &Volume, value: f64, skip: bool| {
        let params = RenderParams {
            size: [48; 2],
            view: View::FRONT,
            mode: Mode::Iso { value },
            ..RenderParams::default()
        };
        radiance(&Scene::new(volume), &params, &with_skips(skip)).unwrap().rgba
    };
    let isovalues = [60.0, 100.0, 140.0, 180.0];
    let sound = filled_brick();
    assert!(isovalues.iter().all(|&iso| seen(&sound, iso, true) == seen(&sound, iso, false)));
    let planted = filled_brick();
    planted.attach_bricks(without_apron(&sound)).unwrap();
    assert!(isovalues.iter().any(|&iso| seen(&planted, iso, true) != seen(&planted, iso, false)));
}
