//! Every stage on something tiny, and what its result promises.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use ivd_artefact::{Artefact, ContentHash};
use ivd_core::op;
use ivd_core::{
    Displacement, Grid, Labels, Lattice, LatticeSource, Motion, TransferFunction, Volume, Voxels,
};
use ivd_pipeline::list::{STAGES, stage};
use ivd_pipeline::{Input, Inputs, Section, Stage};
use serde_json::{Map, Value as Json, json};

use crate::exec;

/// What the stages read, by slot, made once.
type Made = BTreeMap<&'static str, Arc<Artefact>>;

fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut made = Made::from([("volume", Arc::new(Artefact::Volume(ball())))]);
        let handle = json!({ "pick": [4, 4, 7], "move": [0, 0, 0.5], "radius": 6 });
        for (slot, name, keys) in [
            ("labels", "segment", json!({})),
            ("mask", "boundary", json!({})),
            ("transfer", "atf", json!({})),
            ("lattice", "lattice", json!({ "iso": 50 })),
            ("octree", "octree", json!({})),
            ("motion", "deform", json!({ "handle": [handle] })),
            ("displacement", "map", json!({})),
        ] {
            let Json::Object(keys) = keys else { continue };
            let section = Section::parse(stage(name).expect("on the list"), Some(keys)).expect("sound");
            let artefact = run(&section, &made).expect("the defaults work on a ball");
            made.insert(slot, Arc::new(artefact));
        }
        made
    })
}

/// A ball of radius 3 in 9³ voxels, with a soft edge and a voxel of no data.
pub fn ball() -> Volume {
    let grid = Grid::with_spacing([9; 3], [1.0; 3]).expect("a grid");
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| grid.index(i).0.map(|c| (c as f32 - 4.0).powi(2)).iter().sum::<f32>().sqrt())
        .map(|r| ((3.5 - r) * 100.0).clamp(0.0, 100.0))
        .enumerate()
        .map(|(i, v)| if i == 5 { f32::NAN } else { v })
        .collect();
    Volume::new(grid, Voxels::from(voxels)).expect("as many voxels as the grid has")
}

/// Runs a stage on what it wants of what there is; its result must be sound.
fn run(section: &Section, made: &Made) -> Option<Artefact> {
    let wanted = section.method().slots.iter().filter(|slot| section.wants(slot.name) != op::Want::No);
    let filled = wanted.filter_map(|slot| Some((slot.name, made.get(slot.name)?)));
    let inputs = filled.fold(Inputs::default(), |inputs, (slot, artefact)| {
        inputs.with(slot, Input { artefact: Arc::clone(artefact), hash: ContentHash([0; 32]), file: None })
    });
    inputs.check(section).ok()?;
    let product = section.run(&inputs, exec()).ok()?;
    sound(&product.artefact);
    Some(product.artefact)
}

/// What a stage's result promises.
fn sound(artefact: &Artefact) {
    match artefact {
        Artefact::Displacement(displacement) => finite(displacement),
        Artefact::Transfer(transfer) => opacities(transfer),
        _ => {}
    }
}

fn finite(displacement: &Displacement) {
    assert!(displacement.min_det_j() > 0.0, "folded: {}", displacement.min_det_j());
    let all = [displacement.forward(), displacement.inverse()];
    assert!(all.iter().all(|f| f.vectors().as_flattened().iter().all(|c| c.is_finite())), "not finite");
}

fn opacities(transfer: &TransferFunction) {
    let table = transfer.table();
    assert!(table.as_flattened().iter().all(|c| (0.0..=1.0).contains(c)), "a colour outside 0…1");
}

/// Runs the stage of a number with these keys, at each of its places.
pub fn parameters(number: usize, mut keys: Map<String, Json>) {
    let stage = STAGES[number % STAGES.len()];
    // The only work that parameters can ask for without end is steps and pixels; there are few of them here.
    if let Some(dt) = keys.get("dt").and_then(Json::as_f64) {
        let duration = keys.get("duration").and_then(Json::as_f64).unwrap_or(0.2);
        keys.insert("dt".to_owned(), json!(dt.max(duration / 1000.0)));
    }
    if let Some(Json::Array(sides)) = keys.get_mut("size") {
        for side in sides {
            let few = side.as_u64().filter(|side| *side <= 32768).map(|side| side.min(8));
            *side = few.map_or(side.take(), Json::from);
        }
    }
    if !keys.contains_key("size") && stage.name == ivd_render::STAGE.name {
        keys.insert("size".to_owned(), json!([8, 8]));
    }
    let Ok(section) = Section::parse(stage, Some(keys)) else { return };
    let written = section.params();
    let Json::Object(written) = written else { panic!("parameters are an object") };
    let again = Section::parse(stage, Some(written)).expect("what was written is read");
    assert_eq!(again.params(), section.params());
    run(&section, made());
    for place in stage.places {
        if let Some(section) = section.at(place) {
            run(&section, made());
        }
    }
}

/// A transfer function over a volume with classes, drawn 4 × 4 in every mode.
pub fn draw(
    volume: &Volume,
    transfer: &TransferFunction,
    labels: Option<&Labels>,
    displacement: Option<&Displacement>,
) {
    use ivd_render::{Mode, RenderParams, Scene, render};
    for mode in [
        Mode::Dvr,
        Mode::Mip,
        Mode::Iso { value: 0.5 },
        Mode::Minip,
        Mode::Mean,
        Mode::Lmip { threshold: None },
        Mode::AttenuatedMip { attenuation: 10.0 },
    ] {
        let scene = Scene { transfer: Some(transfer), labels, displacement, ..Scene::new(volume) };
        let params = RenderParams { size: [4, 4], mode, ..RenderParams::default() };
        if let Ok(rendered) = render(&scene, &params, exec()) {
            assert!(rendered.samples_per_pixel.is_finite());
        }
    }
}

/// Moves a lattice by handles and carries the motion to voxels and volume.
pub fn move_lattice(
    lattice: &Lattice,
    octree: &ivd_core::Octree,
    handles: &[ivd_motion::handles::Handle],
    fixed: &[ivd_motion::handles::Pin],
    params: &ivd_motion::ring::RingParams,
) {
    let Ok(solved) = ivd_motion::ring::solve(lattice, handles, fixed, params, exec()) else { return };
    carry(lattice, octree, &solved.motion);
}

/// The octahedron of fixtures/artefacts, read once.
pub fn octahedron() -> &'static Lattice {
    static READ: OnceLock<Lattice> = OnceLock::new();
    READ.get_or_init(|| {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/artefacts/lattice.v1.ivd");
        match ivd_artefact::read(file).expect("a sound file").artefact {
            Artefact::Lattice(lattice) => lattice.with_source(LatticeSource::Mask),
            other => panic!("no lattice but {:?}", other.kind()),
        }
    })
}

/// Carries a motion to voxels and volume.
pub fn carry(lattice: &Lattice, octree: &ivd_core::Octree, motion: &Motion) {
    let params = ivd_map::OctreeParams::default();
    let Ok(mapped) = ivd_map::octree(lattice, octree, motion, 0, &params, exec()) else { return };
    finite(&mapped.displacement);
    let voxels: Vec<u8> = (0..lattice.grid().len()).map(|i| i as u8).collect();
    let volume = Volume::new(lattice.grid().clone(), Voxels::from(voxels)).expect("as many as the grid has");
    let warped = ivd_field::warp::volume(
        &volume,
        &mapped.displacement,
        &ivd_field::warp::WarpParams::default(),
        exec(),
    );
    assert!(warped.is_ok(), "a sound displacement warps its own grid");
}
