//! Every stage on something tiny, and what its result promises.

use std::sync::{Arc, OnceLock};

use ivd_artefact::{Artefact, ContentHash};
use ivd_core::{
    Displacement, ElementKey, Grid, Labels, Lattice, LatticeSource, Motion, TransferFunction, Volume, Voxels,
};
use ivd_pipeline::scene::{
    AtfSection, BoundarySection, DeformSection, IsoChoice, MapMethod, MapSection, OctreeSection, RefineSection,
    RenderSection, SegmentSection, WarpSection,
};
use ivd_pipeline::stages::{
    Atf, Boundary, Deform, Lattice as Cut, Map, Octree, Refine, Render, Segment, SegmentTree, Warp,
};
use ivd_pipeline::{Input, Inputs, Stage};

use crate::exec;

/// What the stages read, made once.
struct Made {
    volume: Arc<Artefact>,
    labels: Arc<Artefact>,
    transfer: Arc<Artefact>,
    lattice: Arc<Artefact>,
    octree: Arc<Artefact>,
    motion: Arc<Artefact>,
    displacement: Arc<Artefact>,
}

fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let volume = Arc::new(Artefact::Volume(ball()));
        let just = |stage: &dyn Stage, slots: &[(&'static str, &Arc<Artefact>)]| {
            Arc::new(run(stage, slots).expect("the defaults work on a ball"))
        };
        let segmentation = Segment::from_section(&SegmentSection::default()).expect("sound");
        let labels = just(&segmentation, &[("volume", &volume)]);
        let atf = Atf::from_section(&AtfSection::default(), None);
        let transfer = just(&atf, &[("volume", &volume), ("labels", &labels)]);
        let lattice = just(&Cut { iso: IsoChoice::Value(50.0), class: None }, &[("volume", &volume)]);
        let octree = just(&Octree::default(), &[("lattice", &lattice)]);
        let handle = "pick=4,4,7;move=0,0,0.5;radius=6".parse().expect("a handle");
        let section = DeformSection { handle: vec![handle], ..DeformSection::default() };
        let motion = just(&Deform::from_section(&section).expect("sound"), &[("lattice", &lattice)]);
        let slots = [("lattice", &lattice), ("octree", &octree), ("motion", &motion)];
        let displacement = just(&Map::default(), &slots);
        Made { labels, transfer, octree, motion, displacement, lattice, volume }
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

/// Runs a stage; its result must be sound.
fn run(stage: &dyn Stage, slots: &[(&'static str, &Arc<Artefact>)]) -> Option<Artefact> {
    let inputs = slots.iter().fold(Inputs::default(), |inputs, (slot, artefact)| {
        inputs.with(slot, Input { artefact: Arc::clone(artefact), hash: ContentHash([0; 32]), file: None })
    });
    inputs.check(stage).ok()?;
    let product = stage.run(&inputs, exec()).ok()?;
    sound(&product.artefact);
    Some(product.artefact)
}

/// What a value that was read promises: only what its own check holds.
pub fn sound_enough(artefact: &Artefact) {
    match artefact {
        Artefact::Lattice(lattice) => lattice.check().expect("a lattice"),
        Artefact::Octree(octree) => octree.check().expect("an octree"),
        Artefact::Motion(motion) => motion.check().expect("a motion"),
        Artefact::Tree(tree) => tree.check().expect("a tree"),
        _ => {}
    }
}

/// What a stage's result promises.
fn sound(artefact: &Artefact) {
    sound_enough(artefact);
    match artefact {
        Artefact::Displacement(displacement) => finite(displacement),
        Artefact::Transfer(transfer) => opacities(transfer),
        _ => {}
    }
}

fn finite(displacement: &Displacement) {
    assert!(displacement.min_det_j > 0.0, "folded: {}", displacement.min_det_j);
    let all = [&displacement.forward, &displacement.inverse];
    assert!(all.iter().all(|f| f.vectors().as_flattened().iter().all(|c| c.is_finite())), "not finite");
}

fn opacities(transfer: &TransferFunction) {
    let table = transfer.table();
    assert!(table.as_flattened().iter().all(|c| (0.0..=1.0).contains(c)), "a colour outside 0…1");
}

/// Segments the ball.
pub fn segment(section: &SegmentSection) {
    if let Ok(stage) = Segment::from_section(section) {
        run(&stage, &[("volume", &made().volume)]);
    }
    if let (Some(tree), Ok(cut)) = (SegmentTree::from_section(section), Segment::cut_of_section(section))
        && let Some(tree) = run(&tree, &[("volume", &made().volume)])
    {
        run(&cut, &[("tree", &Arc::new(tree)), ("volume", &made().volume)]);
    }
}

/// Colours the ball.
pub fn atf(section: &AtfSection) {
    let Made { volume, labels, .. } = made();
    run(&Atf::from_section(section, None), &[("volume", volume), ("labels", labels)]);
    run(&Atf::from_section(section, Some(50.0)), &[("volume", volume)]);
}

/// Isolates a part of the ball.
pub fn boundary(section: &BoundarySection) {
    let Made { volume, labels, .. } = made();
    run(&Boundary::from_section(section, None), &[("volume", volume), ("labels", labels)]);
}

/// Refines the ball's lattice.
pub fn refine(section: &RefineSection) {
    let Ok(stage) = Refine::from_section(section) else { return };
    run(&stage, &[("lattice", &made().lattice)]);
}

/// Builds the ball's octree.
pub fn octree(section: &OctreeSection) {
    run(&Octree::from_section(section), &[("lattice", &made().lattice)]);
}

/// Moves the ball. Steps are the only work that parameters can ask for without end; they are few here.
pub fn deform(mut section: DeformSection) {
    section.dt = section.dt.map(|dt| dt.max(section.duration / 1000.0));
    let Ok(stage) = Deform::from_section(&section) else { return };
    run(&stage, &[("lattice", &made().lattice)]);
}

/// Carries the ball's motion.
pub fn map(section: &MapSection) {
    let Made { lattice, octree, motion, .. } = made();
    let Ok(stage) = Map::from_section(section) else { return };
    let mut inputs = vec![("lattice", lattice), ("motion", motion)];
    if section.method == MapMethod::Octree {
        inputs.insert(1, ("octree", octree));
    }
    run(&stage, &inputs);
}

/// Resamples the ball.
pub fn warp(section: &WarpSection) {
    let Made { volume, displacement, .. } = made();
    run(&Warp::from_section(section), &[("volume", volume), ("displacement", displacement)]);
}

/// Draws the ball, 8 × 8 pixels at most.
pub fn render(mut section: RenderSection) {
    section.size = section.size.map(|side| if side > 32768 { side } else { side.min(8) });
    let Made { volume, transfer, labels, displacement, .. } = made();
    let Ok(stage) = Render::from_section(&section, None) else { return };
    run(
        &stage,
        &[("volume", volume), ("transfer", transfer), ("labels", labels), ("displacement", displacement)],
    );
}

/// A transfer function over a volume with classes, drawn 4 × 4 in every mode.
pub fn draw(
    volume: &Volume,
    transfer: &TransferFunction,
    labels: Option<&Labels>,
    displacement: Option<&Displacement>,
) {
    use ivd_render::{Mode, RenderParams, Scene, render};
    for mode in [Mode::Dvr, Mode::Mip, Mode::Iso { value: 0.5 }] {
        let scene = Scene { volume, transfer: Some(transfer), labels, displacement, lattice: None };
        let params = RenderParams { width: 4, height: 4, mode, ..RenderParams::default() };
        if let Ok(rendered) = render(&scene, &params, exec()) {
            assert!(rendered.samples_per_pixel.is_finite());
        }
    }
}

/// Moves a lattice by handles and carries the motion to voxels and volume.
pub fn move_lattice(
    lattice: &Lattice,
    octree: &ivd_core::Octree,
    handles: &[ivd_deform::spring::Handle],
    fixed: &[ivd_deform::spring::Fix],
    params: &ivd_deform::spring::RingParams,
) {
    let Ok(solved) = ivd_deform::spring::ring(lattice, handles, fixed, params, exec()) else { return };
    carry(lattice, octree, &solved.motion);
}

/// An octahedron round voxel (1, 1, 1) of a 3 × 3 × 3 grid, as in fixtures/artefacts.
pub fn octahedron() -> Lattice {
    let dims = [3, 3, 3];
    let mut corners: Vec<(ElementKey, [f32; 3], usize)> = (0..3_usize)
        .flat_map(|axis| [(axis, 0_usize), (axis, 1)])
        .map(|(axis, far)| {
            let mut padded = [2, 2, 2];
            padded[axis] -= 1 - far;
            let mut place = [0.0; 3];
            place[axis] = 0.5;
            (ElementKey::new(dims, padded, axis as u8), place, 2 * axis + far)
        })
        .collect();
    corners.sort_by_key(|c| c.0);
    let at = |which: usize| corners.iter().position(|c| c.2 == which).expect("one of six") as u32;
    let triangles = (0..8_usize)
        .map(|octant| {
            let [x, y, z] = [octant & 1, octant >> 1 & 1, octant >> 2];
            let corner = [at(x), at(2 + y), at(4 + z)];
            if (x + y + z) % 2 == 1 { corner } else { [corner[0], corner[2], corner[1]] }
        })
        .collect();
    Lattice {
        grid: Grid::with_spacing(dims, [1.0, 2.0, 3.0]).expect("a grid"),
        source: LatticeSource::Mask,
        keys: corners.iter().map(|c| c.0).collect(),
        places: corners.iter().map(|c| c.1).collect(),
        triangles,
        level: 1,
        max_error_mm: 0.125,
 coarser: Vec::new(),
    }
}

/// Carries a motion to voxels and volume.
pub fn carry(lattice: &Lattice, octree: &ivd_core::Octree, motion: &Motion) {
    motion.check().expect("a motion");
    let params = ivd_deform::map::OctreeParams::default();
    let Ok(mapped) = ivd_deform::map::octree(lattice, octree, motion, 0, &params, exec()) else { return };
    finite(&mapped.displacement);
    let voxels: Vec<u8> = (0..lattice.grid.len()).map(|i| i as u8).collect();
    let volume = Volume::new(lattice.grid.clone(), Voxels::from(voxels)).expect("as many as the grid has");
    let warped = ivd_deform::warp::volume(
        &volume,
        &mapped.displacement,
        &ivd_deform::warp::WarpParams::default(),
        exec(),
    );
    assert!(warped.is_ok(), "a sound displacement warps its own grid");
}
