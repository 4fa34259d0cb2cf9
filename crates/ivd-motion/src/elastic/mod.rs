//! A lattice moved by the body that it lies in: elastic matter in its inside and round it, which handles take hold of.
//!
//! Springs on a surface have no inside: they can't press a brain through a scalp. Here space is matter, soft or stiff by class, and the lattice
//! goes along with it. So do the voxels: their motion is found with the lattice's, and [`Motion::space`] has it.
//!
//! - Matter is neo-Hookean on hexahedra ([`ivd_elastic`]); by class, or the same inside the lattice and next to nothing outside.
//! - Ω is the union of the handles' balls and those of the bones that move. Its border is held: nothing moves beyond a radius.
//! - A handle has a *grip*: the matter of the part in a small ball round its vertex. The inner half goes where the handle does, as one, or shares
//!   its force; the rest is the softer the farther it is. A point has no hold on matter: the finer the cells, the less would follow it.
//! - Bones, and classes that are rigid, go where their motion takes them or stay, to the bit; soft matter that touches them goes with
//!   them.
//! - The way is gone in as many parts as it takes. Where no balance is found the motion is refused, with the share that was reached, or stops there.
//!
//! Sources: the thesis, 6.5 and 3.2.2 (masses and springs in voxels; there without a law of matter); Bonet & Wood 2008.

mod grip;
mod holds;
mod params;
mod tissues;

use ivd_core::{
    Ball, Exec, FieldBricks, Frame, Labels, Lattice, Motion, ParamError, Role, Volume, VoxelCoord,
    op::check_fields, slots, vertex_class,
};
use ivd_elastic::{Body, Cells, Course, Hexahedron, Lame, Triple};
use ivd_field::param::{Limit, is_cell};
use ivd_field::sampler::interpolate;
use ivd_field::vectors::sampled;
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;
use crate::handles::{Action, Handle, Pin, check_pull, find_targets, lies_on_rigid, pinned};
use crate::rigid::{BoneMotion, BoneSpec, Skeleton};

use grip::Grip;
use holds::{Asks, Hold, Holds};
pub use params::{ElasticParams, Material};
use tissues::{Matter, Tissues};

/// What a handle grips: a part of its radius, a number of cells and a multiple of its way at least, and a part of its radius at most. Round a ball
/// that goes as one motion falls off as the ball's radius over the distance: one smaller than its way would fold what it leaves.
const GRIP: f64 = 0.2;
const GRIP_CELLS: f64 = 3.0;
const GRIP_WAY: f64 = 2.0;
const GRIP_MOST: f64 = 0.5;
/// Longest cell (voxels), and cells across the smallest ball's radius.
const LONGEST: f64 = 16.0;
const ACROSS: f64 = 4.0;
/// Share of its volume below which matter resists being pressed at the corners of cells.
const PRESSED: f64 = 0.3;
/// What matter resists with there at least, relative to the inside of the lattice: air that is pressed between tissue becomes a cushion.
const RESISTS: f64 = 0.02;
/// nJ in a kPa mm³.
const NANOJOULE: f64 = 1e3;

/// What moves, and what of it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct ElasticResult {
    /// One frame, with the motion of space.
    pub motion: Motion,
    /// Vertices whose displacement isn't 0.
    pub vertices_moved: usize,
    /// Largest displacement of a vertex (mm).
    pub max_displacement_mm: f64,
    /// Parts that the way was gone in.
    pub parts: usize,
    /// The share of the way that was gone: less than 1 only where it may stop.
    pub share: f64,
    /// Forces left, relative to those that cancel.
    pub residual: f64,
    /// Energy (nJ) after the first part and at the end.
    pub energies: [f64; 2],
    /// Nodes that are free to move, and cells.
    pub nodes: usize,
    /// Cells.
    pub cells: usize,
    /// Iterations of the equations, of all steps.
    pub iterations: usize,
    /// Force of each handle at the end (mN): what it pulls with, or what it takes to hold its grip. 0 of one on a bone.
    pub handle_forces_mn: Vec<[f64; 3]>,
    /// Sum of the sizes of the forces (mN) by which the border of Ω holds the matter.
    pub border_mn: f64,
    /// What bones have done.
    pub bones: Vec<BoneMotion>,
}

slots! {
    /// What is read: the lattice; labels, where classes have a material or are bones; the volume, where its values say what matter is.
    pub struct ElasticInputs<'a> { lattice: &'a Lattice, labels: Option<&'a Labels>, volume: Option<&'a Volume> }
}

/// Moves a lattice, and the space round it, by handles and bones.
///
/// - `inputs`: all on the lattice's grid.
/// - `fixed`: vertices that stay, with the matter round them.
/// - `bones`: as [`crate::mass_spring::with_bones`] has them.
///
/// # Errors
/// [`Error::Param`]: a parameter, handle or vertex number outside its domain. [`Error::Mismatch`]: a pick with no vertex near, contradicting
/// handles, a class that isn't there, materials without labels, a lattice that isn't closed. [`Error::Untrusted`]: no balance is found;
/// it tells the share of the way for which there is one. The memory limit, cancelled.
pub fn solve(
    inputs: ElasticInputs<'_>,
    handles: &[Handle],
    fixed: &[Pin],
    bones: &[BoneSpec],
    params: &ElasticParams,
    exec: &Exec,
) -> Result<ElasticResult, Error> {
    params.check()?;
    check_pull(handles, fixed)?;
    let labels = known(inputs.lattice, inputs.labels, bones, params)?;
    let volume = inputs.volume.filter(|_| params.hounsfield);
    let off_grid = volume.filter(|volume| volume.grid() != inputs.lattice.grid());
    if params.hounsfield && (volume.is_none() || off_grid.is_some()) {
        let lies = |volume: &Volume| {
            let dims = [volume.grid().dims(), inputs.lattice.grid().dims()];
            format!(
                "the volume's grid of {:?} voxels isn't the lattice's of {:?}, or lies elsewhere",
                dims[0], dims[1]
            )
        };
        return Err(Error::Mismatch {
            what: "hounsfield",
            problem: off_grid.map_or_else(|| "there is no volume to read values from".into(), lies),
            remedy: "give the volume that the lattice was cut from (--volume)",
        });
    }
    let inputs = ElasticInputs { labels, volume, ..inputs };
    exec.run(|| Scene::new(inputs, handles, fixed, bones, params)?.solve(exec))
}

impl ElasticParams {
    /// # Errors
    /// [`ParamError`] names the field that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        is_cell("cell", self.cell)
    }

    /// Whether classes are looked at.
    pub(crate) fn knows_classes(&self) -> bool {
        !self.material.is_empty()
    }
}

/// The labels, where classes matter; all that are named are there.
fn known<'a>(
    lattice: &Lattice,
    labels: Option<&'a Labels>,
    bones: &[BoneSpec],
    params: &ElasticParams,
) -> Result<Option<&'a Labels>, Error> {
    if !params.knows_classes() && bones.iter().all(|bone| bone.class.is_none()) {
        return Ok(None);
    }
    let Some(labels) = labels else {
        return Err(Error::Mismatch {
            what: "material",
            problem: "there are no labels to know classes by".into(),
            remedy: "give labels (--labels), or no material or bone by class",
        });
    };
    vertex_class::check(lattice, labels)?;
    labels.require_classes(params.material.keys().copied(), "material")?;
    Ok(Some(labels))
}

/// What is asked of a lattice.
struct Scene<'a> {
    lattice: &'a Lattice,
    labels: Option<&'a Labels>,
    volume: Option<&'a Volume>,
    handles: &'a [Handle],
    targets: Vec<usize>,
    fixed: Vec<bool>,
    bones: &'a [BoneSpec],
    skeleton: Skeleton,
    /// Places of the vertices (mm), relative to the grid's origin.
    rest: Vec<Vector3<f64>>,
    params: &'a ElasticParams,
}

impl<'a> Scene<'a> {
    fn new(
        ElasticInputs { lattice, labels, volume }: ElasticInputs<'a>,
        handles: &'a [Handle],
        fixed: &[Pin],
        bones: &'a [BoneSpec],
        params: &'a ElasticParams,
    ) -> Result<Self, Error> {
        let rest = lattice.local_positions();
        let targets = find_targets(lattice, &rest, handles, bones.is_empty())?;
        let fixed = pinned(lattice, &rest, fixed)?;
        let aimed: Vec<(Handle, usize)> = handles.iter().copied().zip(targets.iter().copied()).collect();
        let skeleton = Skeleton::new(lattice, labels, bones, &aimed, &fixed)?;
        Ok(Self { lattice, labels, volume, handles, targets, fixed, bones, skeleton, rest, params })
    }

    /// Centres and radii (mm) of the balls that Ω is the union of.
    fn balls(&self) -> Vec<(Vector3<f64>, f64)> {
        let of = |(&target, handle): (&usize, &Handle)| (self.rest[target], handle.radius);
        self.targets.iter().zip(self.handles).map(of).chain(self.skeleton.balls()).collect()
    }

    /// Radius of a handle's grip (mm), where a cell is `length` long.
    fn grip(&self, handle: &Handle, length: f64) -> f64 {
        let way = Vector3::from(handle.way()).norm();
        let least = (GRIP * handle.radius).max(GRIP_CELLS * length);
        let radius = least.max((GRIP_WAY * way).min(GRIP_MOST * handle.radius));
        self.params.grip.unwrap_or(radius).min(handle.radius)
    }

    fn solve(&self, exec: &Exec) -> Result<ElasticResult, Error> {
        let grid = self.lattice.grid();
        let inside = match ivd_octree::inside(self.lattice, exec) {
            Ok(inside) => inside,
            Err(ivd_octree::Error::Core(error)) => return Err(error),
            Err(error) => {
                return Err(Error::Mismatch {
                    what: "lattice",
                    problem: error.to_string(),
                    remedy: "a body has an inside: give a closed lattice, or use solver = \"ring\"",
                });
            }
        };
        let balls = self.balls();
        let least = balls.iter().map(|ball| ball.1).fold(f64::INFINITY, f64::min);
        let longest = (LONGEST * grid.shortest_edge()).min(least / ACROSS);
        // Half as long as a map's: cells are to bend round the grip.
        let edge = self.params.cell.or_else(|| {
            let most = (0..3).map(|a| grid.cell_steps(None, least / 2.0)[a]).max();
            most.map(|edge| edge as u8)
        });
        let cells = Cells::new(grid, balls, edge, longest);
        let tissues = Tissues::new(&inside, (self.labels, self.volume), self.bones, self.params);
        let asked: Vec<(usize, Handle, usize)> = (0..self.handles.len())
            .filter(|&h| self.skeleton.holder(self.targets[h]).is_none())
            .map(|h| (h, self.handles[h], self.targets[h]))
            .collect();
        if let Some((number, ..)) = asked.iter().find(|(_, _, target)| self.is_rigid(*target, &tissues)) {
            return Err(lies_on_rigid(*number));
        }
        if let Some((number, ..)) = asked.iter().find(|(_, _, target)| self.fixed[*target]) {
            return Err(Error::Mismatch {
                what: "handle",
                problem: format!("handle {number} lies on a vertex that is fixed"),
                remedy: "fix less, or pick another vertex",
            });
        }
        let grip = |(_, handle, target): &(usize, Handle, usize)| {
            // What has hold of a thin layer on bone is thinner.
            let middle = self.rest[*target];
            let radius = tissues.nearest_rigid(middle, self.grip(handle, cells.length()));
            Grip::new(self.lattice, |voxel| tissues.is_inside(voxel), *target, (middle, radius), exec)
        };
        let grips = asked.iter().map(grip).collect::<Result<_, _>>()?;
        self.check_bones(&cells, &tissues)?;
        let tissues = tissues.gripped(grips);
        let fine: Vec<Vector3<f64>> = (0..self.rest.len()).map(|v| self.lattice.voxel(v).0).collect();
        let mesh = cells.mesh(&fine, &tissues, exec)?;
        let matter = cells.matter(&mesh, &tissues);
        let asks = Asks { lattice: self.lattice, rest: &self.rest, handles: &asked, fixed: &self.fixed };
        let holds = Holds::new(&asks, &mesh, &cells, &tissues)?;
        let resists = RESISTS * Lame::new(self.params.kpa, self.params.poisson).bulk();
        let element = Hexahedron::new(&cells.edges()).guarded(PRESSED, resists);
        let mut body = Body::new(mesh, element, matter, Vec::new());
        exec.check_memory("the equations of the body", body.bytes())?;
        let border: Vec<bool> = body.mesh.held.clone();
        let nodes: Vec<u32> = holds.told.keys().copied().collect();
        let places: Vec<Vector3<f64>> =
            nodes.iter().map(|n| cells.local(body.mesh.nodes[*n as usize].map(f64::from))).collect();
        for node in &nodes {
            body.mesh.held[*node as usize] = true;
        }
        let goals = |share: f64| -> Vec<Triple> {
            let poses = self.skeleton.rig().poses(share);
            let of = |(hold, place): (&Hold, &Vector3<f64>)| match *hold {
                Hold::Still => [0.0; 3],
                Hold::Bone(bone) => poses.displacement(bone, *place).into(),
                Hold::Handle(h) => self.handles[h].way().map(|c| c * share),
            };
            holds.told.values().zip(&places).map(of).collect()
        };
        let loads = holds.loads(self.handles, body.mesh.nodes.len());
        let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
        let (tolerance, stops) = (self.params.tolerance, self.params.limit == Limit::Stop);
        let course = Course { nodes: &nodes, goals: &goals, loads: &loads, tolerance, stops };
        if nodes.is_empty() && !body.mesh.held.contains(&true) {
            return Err(Error::Mismatch {
                what: "handle",
                problem: "nothing holds the body against the force: its radius reaches beyond the volume on all sides".into(),
                remedy: "fix something, or give the handle a smaller radius",
            });
        }
        let arrival = body.go(&mut u, &course, exec)?;
        let share = arrival.share;
        if share < 1.0 && !(stops && share > 0.0) {
            return Err(Error::Untrusted {
                what: "the deformed body",
                problem: format!(
                    "no balance of forces is found beyond {:.0} % of the way: matter can't be pressed, pulled or turned any further",
                    100.0 * share
                ),
                remedy: if stops {
                    "give it a larger radius, lower poisson and the contrast of classes, or raise tolerance"
                } else {
                    "move the handle less, give it a larger radius, lower poisson and the contrast of classes, or go as far as can be gone (limit = stop)"
                },
            });
        }
        let still: Vec<bool> =
            (0..self.rest.len()).map(|v| self.fixed[v] || self.is_rigid(v, &tissues)).collect();
        let frame = self.frame(&body, &cells, &u, &still, share);
        let space = self.space(&body, &cells, &u, &tissues, share, exec)?;
        let forces = body.reactions(&u);
        let free = body.mesh.held.iter().filter(|held| !**held).count();
        let border_mn =
            (0..forces.len()).filter(|&n| border[n]).map(|n| Vector3::from(forces[n]).norm()).sum();
        let motion = self.motion(frame, space, &cells, &still)?;
        let displacement = &motion.frames()[0].displacement;
        Ok(ElasticResult {
            vertices_moved: displacement.iter().filter(|d| **d != [0.0; 3]).count(),
            max_displacement_mm: motion.max_displacement(),
            parts: arrival.parts as usize,
            share,
            residual: arrival.balance.residual,
            energies: arrival.energies.map(|energy| energy * NANOJOULE),
            nodes: free,
            cells: body.mesh.cells.len(),
            iterations: arrival.balance.iterations as usize,
            handle_forces_mn: self.handle_forces(&holds, &forces, share),
            border_mn,
            bones: self.bones_moved(&holds, &forces, displacement, share),
            motion,
        })
    }

    /// The vertices' motion.
    ///
    /// - `still`: vertices that are fixed or rigid; bones' go where these do; `share`: of the way.
    fn frame(&self, body: &Body, cells: &Cells, u: &[Triple], still: &[bool], share: f64) -> Frame {
        let mut displacement: Vec<[f64; 3]> = (0..self.rest.len())
            .map(|v| {
                let Some((cell, place)) = body.mesh.locate(cells.place(self.lattice.voxel(v).0)) else {
                    return [0.0; 3];
                };
                let corners = body.mesh.gather(cell, u).map(Vector3::from);
                // No negative zeros.
                interpolate(&corners, place.into()).map(|c| c + 0.0).into()
            })
            .collect();
        for (u, _) in displacement.iter_mut().zip(still).filter(|(_, still)| **still) {
            *u = [0.0; 3];
        }
        self.skeleton.place(&self.rest, share, &mut displacement);
        for (handle, &target) in self.handles.iter().zip(&self.targets) {
            if let (Action::Move(by), None) = (handle.action, self.skeleton.holder(target)) {
                displacement[target] = by.map(|c| c * share + 0.0);
            }
        }
        Frame { time: 0.0, displacement: displacement.into() }
    }

    /// Whether a vertex lies on a bone, or at a class that stays.
    fn is_rigid(&self, vertex: usize, tissues: &Tissues<'_>) -> bool {
        let stays = |index| tissues.matter(index, self.lattice.grid().linear(index)) == Matter::Still;
        self.skeleton.holder(vertex).is_some()
            || (tissues.has_rigid()
                && vertex_class::round(self.lattice, vertex).any(|(_, index)| stays(index)))
    }

    /// The voxels' motion.
    fn space(
        &self,
        body: &Body,
        cells: &Cells,
        u: &[Triple],
        tissues: &Tissues<'_>,
        share: f64,
        exec: &Exec,
    ) -> Result<FieldBricks, Error> {
        let grid = self.lattice.grid();
        let bricks = cells.bricks();
        exec.check_memory("the motion of space", 12 * FieldBricks::VOXELS as u64 * bricks.len() as u64)?;
        let poses = self.skeleton.rig().poses(share);
        let linear = grid.linear_part();
        let vectors = sampled("deform", grid.dims(), &bricks, exec, |voxel, (): &mut ()| {
            let at = VoxelCoord::from(voxel).0;
            match tissues.matter(voxel, grid.linear(voxel)) {
                Matter::Bone(bone) => return poses.displacement(bone, linear * at),
                Matter::Still => return Vector3::zeros(),
                Matter::Soft => {}
            }
            let Some((cell, place)) = body.mesh.locate(cells.place(at)) else { return Vector3::zeros() };
            interpolate(&body.mesh.gather(cell, u).map(Vector3::from), place.into())
        })?;
        FieldBricks::of_bricks(grid.dims(), &bricks, vectors.into())
    }

    /// A bone that moves lies where something may: else it would be torn.
    fn check_bones(&self, cells: &Cells, tissues: &Tissues<'_>) -> Result<(), Error> {
        let grid = self.lattice.grid();
        if self.skeleton.balls().next().is_none() {
            return Ok(());
        }
        let out = (0..grid.len()).into_par_iter().find_map_any(|i| {
            let voxel = grid.index(i);
            let Matter::Bone(bone) = tissues.matter(voxel, i) else { return None };
            let beyond = !cells.holds(grid.linear_part() * VoxelCoord::from(voxel).0);
            (beyond && self.skeleton.moves(bone)).then_some(bone)
        });
        match out {
            None => Ok(()),
            Some(bone) => Err(Error::Mismatch {
                what: "rigid",
                problem: format!("bone {} moves and goes on beyond its reach", self.bones[bone].name),
                remedy: "give it a larger reach, or a region",
            }),
        }
    }

    /// What bones have done, and what holds them against the tissue.
    fn bones_moved(
        &self,
        holds: &Holds,
        forces: &[Triple],
        displacement: &[[f64; 3]],
        share: f64,
    ) -> Vec<BoneMotion> {
        let mut bones = self.skeleton.moved(&self.rest, share, displacement);
        for (node, hold) in &holds.told {
            if let Hold::Bone(bone) = hold {
                let sum = &mut bones[*bone].force_mn;
                *sum = std::array::from_fn(|a| sum[a] + forces[*node as usize][a]);
            }
        }
        bones
    }

    /// What each handle pulls with, or what it takes to hold its grip (mN).
    fn handle_forces(&self, holds: &Holds, forces: &[Triple], share: f64) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.handles.len()];
        for (node, hold) in &holds.told {
            if let Hold::Handle(h) = hold {
                out[*h] = std::array::from_fn(|a| out[*h][a] + forces[*node as usize][a]);
            }
        }
        for (h, nodes) in &holds.pulled {
            if let (Action::Force(force), false) = (self.handles[*h].action, nodes.is_empty()) {
                out[*h] = force.map(|c| c * share);
            }
        }
        out
    }

    fn motion(
        &self,
        frame: Frame,
        space: FieldBricks,
        cells: &Cells,
        still: &[bool],
    ) -> Result<Motion, Error> {
        let grid = self.lattice.grid();
        let origin = Vector3::from(grid.origin());
        let balls = self.balls().into_iter();
        let reach = balls.map(|(centre, radius)| Ball { centre: (centre + origin).into(), radius }).collect();
        let role = |v: usize| {
            let moves = frame.displacement[v] != [0.0; 3];
            match (moves, cells.holds(self.rest[v])) {
                (true, _) => Role::Driven,
                (false, true) if still[v] => Role::Held,
                (false, true) => Role::Driven,
                (false, false) => Role::Carried,
            }
        };
        let roles: Vec<u8> = (0..self.rest.len()).map(|v| role(v) as u8).collect();
        Motion::new(grid.clone(), self.rest.len(), vec![frame])?
            .with_reach(reach)?
            .with_roles(roles.into())?
            .with_space(vec![space])
    }
}

#[cfg(test)]
mod tests;
