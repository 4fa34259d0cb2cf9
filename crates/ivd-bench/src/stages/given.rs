//! The experiments on a given volume: those whose truth is a finer result on the same volume.

use std::sync::Arc;

use ivd_core::{Exec, Grid, Lattice, Volume, VoxelCoord, VoxelIndex, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams};
use ivd_segment::{KmvsParams, kmvs};
use nalgebra::Vector3;

use super::{atf, clusters, deform, deformation, map, methods, refine, render, segment, solvers};
use crate::distance::Truth;
use crate::experiment::{Experiment, Problem, Setting};
use crate::inputs::{judged, root_mean_square};

/// Every n-th voxel is kept, finest last.
const STRIDES: [usize; 6] = [8, 6, 4, 3, 2, 1];
/// Largest motion and radius of the handle, as parts of the diagonal of the part's box.
const MOVE: f64 = 0.03;
const RADIUS: f64 = 0.25;

/// A volume to bench on.
#[derive(Debug, Clone)]
pub struct Given {
    /// What it is called.
    pub name: String,
    /// The volume.
    pub volume: Arc<Volume>,
}

/// The experiment of a stage on a given volume; `None` where its truth is a formula that no scan has.
pub(super) fn experiment(stage: &str, given: &Given, exec: &Exec) -> Result<Option<Experiment>, Problem> {
    let (volume, name) = (&given.volume, &given.name);
    let of = |what: &str| format!("{what} of {name}, {:?} voxels", volume.grid().dims());
    let whole = || -> Result<Arc<Lattice>, Problem> { Ok(Arc::new(map::part(volume, exec)?)) };
    Ok(Some(match stage {
        "segment" => segment::on(volume, of("values")),
        "atf" => atf::on(volume, of("four classes"), exec)?,
        "render" => render::on(volume, of("picture, shaded"), exec)?,
        "lattice" => lattice(volume, of("surface below the densest class"), exec)?,
        "refine" => {
            let whole = whole()?;
            let truth = whole.clone();
            let measure: refine::Measure = Arc::new(move |found, exec| distance(found, &truth, exec));
            refine::on(&whole, of("the lattice of the densest part"), "the unrefined lattice", &measure)
        }
        "refine-methods" => {
            let whole = whole()?;
            let truth = Truth::lattice(&whole, exec)?;
            let measure: refine::Measure = Arc::new(move |found, exec| truth.apart(found, exec));
            methods::on(
                &whole,
                of("the lattice of the densest part"),
                "the unrefined lattice",
                &measure,
                exec,
            )?
        }
        "deform" => {
            let (whole, stiffness) = (whole()?, RingParams::default().stiffness);
            let (place, way, length) = front_of(&whole)?;
            // N/m times mm is mN.
            let pull = way * (stiffness * MOVE * length);
            let handle = Handle { at: place, action: Action::Force(pull.into()), radius: RADIUS * length };
            deform::on(&whole, handle, of("the lattice of the densest part, pulled,"), exec)?
        }
        "solvers" => {
            let (whole, handle) = pushed(volume, exec)?;
            solvers::on(&whole, &handle, &[], 0.0, of("the lattice of the densest part, pushed,"), exec)?
        }
        "map" => {
            let (whole, handle) = pushed(volume, exec)?;
            map::on(&whole, &handle, of("the densest part, pushed,"), exec)?
        }
        "map-methods" => {
            let (whole, handle) = pushed(volume, exec)?;
            let motion = ring::solve(&whole, &[handle], &[], &RingParams::default(), exec)?.motion;
            let tasks = vec![("push".to_owned(), motion)];
            deformation::on_maps(&whole, tasks, handle.radius, of("the densest part"), exec)?
        }
        "deformation" => {
            let (whole, handle) = pushed(volume, exec)?;
            deformation::on_whole(&whole, &handle, of("the densest part, pushed,"), exec)?
        }
        _ => match clusters::on(stage, volume, of("values"), exec) {
            Some(made) => made?,
            None => return Ok(None),
        },
    }))
}

/// The lattice of the densest part, and a push at its front.
fn pushed(volume: &Volume, exec: &Exec) -> Result<(Arc<Lattice>, Handle), Problem> {
    let whole = Arc::new(map::part(volume, exec)?);
    let (at, way, length) = front_of(&whole)?;
    let action = Action::Move((way * (MOVE * length)).into());
    Ok((whole, Handle { at, action, radius: RADIUS * length }))
}

/// The vertex furthest to the front, the way out from the middle there, and the diagonal of the lattice's box (mm).
fn front_of(lattice: &Lattice) -> Result<(Anchor, Vector3<f64>, f64), Problem> {
    let positions = lattice.positions();
    let first = positions.first().ok_or("the densest class has no surface")?;
    let (low, high) = positions.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    let front = positions.iter().copied().fold(*first, |a, b| if b.y > a.y { b } else { a });
    let way = (front - (low + high) * 0.5).try_normalize(0.0).ok_or("the densest class is a point")?;
    Ok((Anchor::NearestTo(front.into()), way, (high - low).norm()))
}

/// Distance of a lattice's triangles' middles from another lattice (mm), root mean square.
fn distance(from: &Lattice, to: &Lattice, exec: &Exec) -> Result<f64, Problem> {
    let tree = ivd_octree::build(to, &ivd_octree::Params::default(), exec)?;
    let index = ivd_octree::prepare(to, &tree)?;
    let positions = from.positions();
    let origin = Vector3::from(to.grid().origin());
    let squares = from.triangles().iter().map(|t| {
        let middle = t.iter().map(|&c| positions[c as usize]).sum::<Vector3<f64>>() / 3.0;
        index.nearest(middle - origin, f64::INFINITY).map_or(f64::INFINITY, |n| n.distance_mm.powi(2))
    });
    Ok(root_mean_square(squares))
}

/// Every n-th voxel against the surface that all voxels give.
fn lattice(volume: &Arc<Volume>, input: String, exec: &Exec) -> Result<Experiment, Problem> {
    let classes = kmvs(volume, None, &KmvsParams::default(), exec)?.labels.classes().to_vec();
    let lower = classes.iter().filter_map(|c| c.lower).fold(f64::NEG_INFINITY, f64::max);
    if !lower.is_finite() {
        return Err("the volume has one class only".into());
    }
    let params = ExtractParams { iso: Iso::Value(lower) };
    let truth = Arc::new(extract(volume, None, &params, exec)?.lattice);
    let settings: Result<Vec<Setting>, Problem> = STRIDES
        .into_iter()
        .filter(|stride| volume.grid().dims().iter().all(|n| n / stride >= 4))
        .map(|stride| {
            let (coarse, truth, params) = (strided(volume, stride)?, truth.clone(), params.clone());
            let voxel = format!("{:.3} mm", coarse.grid().longest_edge());
            Ok(Setting::new([("voxel", voxel)], false, move |exec| {
                let found = extract(&coarse, None, &params, exec)?;
                let (truth, exec) = (truth.clone(), exec.clone());
                Ok(Box::new(move || {
                    let triangles = found.lattice.triangles().len() as f64;
                    Ok(judged(distance(&found.lattice, &truth, &exec)?, [("triangles", triangles)]))
                }))
            }))
        })
        .collect();
    Ok(Experiment {
        stage: "lattice",
        input,
        truth: "the lattice of all voxels",
        measure: "distance of the triangles' middles from the truth, root mean square",
        unit: "mm",
        counted: None,
        voxel_mm: Some(volume.grid().longest_edge()),
        work: ("voxels", volume.grid().len() as f64),
        settings: settings?,
    })
}

/// Every n-th voxel along each axis.
fn strided(volume: &Volume, stride: usize) -> Result<Volume, Problem> {
    let grid = volume.grid();
    let dims = grid.dims().map(|n| n.div_ceil(stride));
    let spacing = grid.spacing().map(|s| s * stride as f64);
    let first: [f64; 3] = grid.world(VoxelCoord::from(VoxelIndex([0; 3]))).0.into();
    let coarse = Grid::new(dims, spacing, first, grid.direction())?;
    let at = |i: usize| volume.value(VoxelIndex(coarse.index(i).0.map(|c| c * stride))) as f32;
    let voxels: Vec<f32> = (0..coarse.len()).map(at).collect();
    Ok(Volume::new(coarse, Voxels::from(voxels))?)
}
