//! Bones, what moves them, and where they are at any part of the way.

use ivd_core::{Ball, Labels, Lattice};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::fit::{self, Unsure};
use super::holders::{Holders, holders};
use super::inner;
use super::turn::Pose;
use super::{BoneSpec, Drive, RigidTransform};
use crate::Error;
use crate::handles::{Action, Handle};

/// A bone with its motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Bone {
    /// Its name.
    pub name: String,
    /// The bone that carries it, by its number.
    pub parent: Option<usize>,
    /// Vertices that it holds, ascending.
    pub vertices: Vec<u32>,
    /// Its motion after its parent's; pivot relative to the grid's origin.
    turn: RigidTransform,
    /// Whether it can move at all.
    moves: bool,
    /// Voxels within it that a map is told of (voxel coordinates).
    inner: Vec<Vector3<f64>>,
    /// The ball that its vertices lie in, widened by its reach; relative to the grid's origin (mm).
    ball: (Vector3<f64>, f64),
    /// Root mean square of what the fit leaves at its handles (mm); `None` where the motion is given.
    left: Option<f64>,
}

/// What a bone's motion is as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct BoneMotion {
    /// Its name.
    pub name: String,
    /// Vertices that it holds.
    pub vertices: usize,
    /// Axis of its turn against rest, its parents' included; z where it doesn't turn.
    pub axis: [f64; 3],
    /// Angle of that turn (degrees), 0 … 180.
    pub angle: f64,
    /// Where the middle of its vertices' box is at rest (mm), RAS.
    pub centre: [f64; 3],
    /// How far that goes (mm).
    pub shift: [f64; 3],
    /// Root mean square of what the fit leaves at its handles (mm); `None` where the motion is given.
    pub left_mm: Option<f64>,
    /// Largest relative change of a distance between two of its vertices, of those looked at: rounding.
    pub strain: f64,
    /// Force that holds it against the tissue at the end (mN).
    pub force_mn: [f64; 3],
}

/// All bones of a lattice; none by default.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Skeleton {
    parts: Vec<BoneSpec>,
    bones: Vec<Bone>,
    /// The bones, each after its parent.
    order: Vec<usize>,
    holder: Holders,
    origin: Vector3<f64>,
}

/// The bones' motions, without what they hold.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rig {
    turns: Vec<RigidTransform>,
    parents: Vec<Option<usize>>,
}

impl Rig {
    /// Where the bones are after the part `s` (0 … 1) of the way.
    pub(crate) fn poses(&self, s: f64) -> Poses {
        Poses { poses: self.turns.iter().map(|turn| turn.after(s)).collect(), parents: self.parents.clone() }
    }
}

/// Where the bones are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Poses {
    poses: Vec<Pose>,
    parents: Vec<Option<usize>>,
}

impl Poses {
    /// Displacement (mm) of a point (mm, relative to the grid's origin) that a bone carries: its own turn's, then its parents',
    /// one after another, so that a joint goes exactly where the parent takes it.
    pub(crate) fn displacement(&self, bone: usize, point: Vector3<f64>) -> Vector3<f64> {
        let (mut by, mut at) = (Vector3::zeros(), Some(bone));
        while let Some(b) = at {
            by += self.poses[b].displacement(point + by);
            at = self.parents[b];
        }
        by
    }

    /// Where a point came from.
    fn back(&self, bone: usize, mut point: Vector3<f64>) -> Vector3<f64> {
        let (mut chain, mut at) = (Vec::new(), Some(bone));
        while let Some(b) = at {
            chain.push(b);
            at = self.parents[b];
        }
        for b in chain.into_iter().rev() {
            point = self.poses[b].back(point);
        }
        point
    }

    /// Its turn against rest.
    fn rotation(&self, bone: usize) -> Rotation3<f64> {
        let turned = |v: Vector3<f64>| {
            let (mut v, mut at) = (v, Some(bone));
            while let Some(b) = at {
                v += self.poses[b].turned(v);
                at = self.parents[b];
            }
            v
        };
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(turned);
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns))
    }
}

impl Skeleton {
    /// Finds every bone's vertices and its motion.
    ///
    /// - `labels`: on the lattice's grid, where a part has a class.
    /// - `handles`: with the vertex of each; those on a bone say where it should go.
    /// - `fixed`: for every vertex, whether it is to stay.
    ///
    /// # Errors
    /// [`Error::Param`]: a part outside its domain. [`Error::Mismatch`]: names that aren't there or are there twice, a circle of
    /// parents, a bone without a vertex, a vertex that two bones hold or that is to stay on a bone that moves, a handle on a bone
    /// whose motion is given, a bone to be fitted without a handle, handles that leave its turn open.
    pub fn new(
        lattice: &Lattice,
        labels: Option<&Labels>,
        parts: &[BoneSpec],
        handles: &[(Handle, usize)],
        fixed: &[bool],
    ) -> Result<Self, Error> {
        let rest = lattice.local_positions();
        let mut skeleton = Self::at_rest(lattice, labels, &rest, parts)?;
        skeleton.drive(&rest, handles)?;
        skeleton.check_free(fixed)?;
        Ok(skeleton)
    }

    /// Finds every bone's vertices, as [`Skeleton::new`], and no motion.
    pub(crate) fn at_rest(
        lattice: &Lattice,
        labels: Option<&Labels>,
        rest: &[Vector3<f64>],
        parts: &[BoneSpec],
    ) -> Result<Self, Error> {
        parts.iter().try_for_each(BoneSpec::check)?;
        let parents = parents(parts)?;
        let order = order(parts, &parents)?;
        let holder = holders(lattice, labels, rest, parts)?;
        let bone = |(b, part): (usize, &BoneSpec)| {
            let held = |v: &usize| holder[*v] == Some(b);
            let vertices: Vec<u32> = (0..rest.len()).filter(held).map(|v| v as u32).collect();
            let (centre, radius) = ball(vertices.iter().map(|&v| rest[v as usize]));
            Bone {
                name: part.name.clone(),
                parent: parents[b],
                vertices,
                turn: RigidTransform::NONE,
                moves: false,
                inner: inner::voxels(lattice, labels, part),
                ball: (centre, radius + part.reach),
                left: None,
            }
        };
        let bones = parts.iter().enumerate().map(bone).collect();
        let origin = Vector3::from(lattice.grid().origin());
        Ok(Self { parts: parts.to_vec(), bones, order, holder, origin })
    }

    /// Finds every bone's motion, as [`Skeleton::new`].
    pub(crate) fn drive(&mut self, rest: &[Vector3<f64>], handles: &[(Handle, usize)]) -> Result<(), Error> {
        for b in self.order.clone() {
            let own: Vec<(Vector3<f64>, Vector3<f64>)> = targets(&self.holder, b, &self.parts, handles)?
                .into_iter()
                .map(|(v, by)| (rest[v], rest[v] + by))
                .collect();
            let (turn, left) = self.turn_of(b, &own)?;
            let carried = self.bones[b].parent.is_some_and(|p| self.bones[p].moves);
            let fits = matches!(self.parts[b].drive, Drive::Fitted { .. });
            let bone = &mut self.bones[b];
            (bone.turn, bone.left, bone.moves) = (turn, left, carried || fits || !turn.is_none());
        }
        Ok(())
    }

    /// A bone that moves holds no vertex that is to stay.
    pub(crate) fn check_free(&self, fixed: &[bool]) -> Result<(), Error> {
        for bone in self.bones.iter().filter(|bone| bone.moves) {
            if let Some(v) = bone.vertices.iter().find(|&&v| fixed[v as usize]) {
                return Err(Error::Mismatch {
                    what: "rigid",
                    problem: format!("vertex {v} is fixed and lies on bone {}, which moves", bone.name),
                    remedy: "fix less, or let the bone stay",
                });
            }
        }
        Ok(())
    }

    /// The bones, as they were declared.
    pub fn bones(&self) -> &[Bone] {
        &self.bones
    }

    /// The bone that holds a vertex.
    pub fn holder(&self, vertex: usize) -> Option<usize> {
        self.holder[vertex]
    }

    /// Whether a bone can move.
    pub fn moves(&self, bone: usize) -> bool {
        self.bones[bone].moves
    }

    /// Displacement (mm) of a point (mm, RAS) that a bone carries, after the part `s` (0 … 1) of the way.
    pub fn displacement(&self, bone: usize, point: Vector3<f64>, s: f64) -> Vector3<f64> {
        self.poses(s).displacement(bone, point - self.origin)
    }

    /// The bones' motions.
    pub(crate) fn rig(&self) -> Rig {
        Rig {
            turns: self.bones.iter().map(|bone| bone.turn).collect(),
            parents: self.bones.iter().map(|bone| bone.parent).collect(),
        }
    }

    fn poses(&self, s: f64) -> Poses {
        self.rig().poses(s)
    }

    /// Balls round the bones that move, relative to the grid's origin: centres and radii (mm).
    pub(crate) fn balls(&self) -> impl Iterator<Item = (Vector3<f64>, f64)> + '_ {
        self.bones.iter().filter(|bone| bone.moves).map(|bone| bone.ball)
    }

    /// The same in the world.
    pub fn reach(&self) -> impl Iterator<Item = Ball> + '_ {
        self.balls().map(|(centre, radius)| Ball { centre: (centre + self.origin).into(), radius })
    }

    /// Writes the bones' displacements after a part of the way into those of all vertices (mm).
    ///
    /// - `rest`: vertices (mm), relative to the grid's origin.
    pub(crate) fn place(&self, rest: &[Vector3<f64>], s: f64, displacement: &mut [[f64; 3]]) {
        let poses = self.poses(s);
        for (b, bone) in self.bones.iter().enumerate().filter(|(_, bone)| bone.moves) {
            for v in bone.vertices.iter().map(|&v| v as usize) {
                // No negative zeros.
                displacement[v] = poses.displacement(b, rest[v]).map(|c| c + 0.0).into();
            }
        }
    }

    /// The voxels of all bones (voxel coordinates); none where no bone can move.
    pub(crate) fn inner(&self) -> Vec<[f64; 3]> {
        if self.bones.iter().all(|bone| !bone.moves) {
            return Vec::new();
        }
        self.bones.iter().flat_map(|bone| &bone.inner).map(|at| (*at).into()).collect()
    }

    /// Their displacements after a part of the way (mm).
    ///
    /// - `linear`: from voxels to mm.
    pub(crate) fn inner_displacement(&self, linear: &Matrix3<f64>, s: f64) -> Vec<[f64; 3]> {
        let poses = self.poses(s);
        let of = |(b, bone): (usize, &'_ Bone)| -> Vec<[f64; 3]> {
            bone.inner.iter().map(|at| poses.displacement(b, linear * at).map(|c| c + 0.0).into()).collect()
        };
        self.bones.iter().enumerate().flat_map(of).collect()
    }

    /// What the bones have done after a part of the way.
    ///
    /// - `displacement`: of every vertex then (mm), for the strain that is left in it.
    pub(crate) fn moved(&self, rest: &[Vector3<f64>], s: f64, displacement: &[[f64; 3]]) -> Vec<BoneMotion> {
        let poses = self.poses(s);
        let of = |(b, bone): (usize, &Bone)| {
            let turn = UnitQuaternion::from_rotation_matrix(&poses.rotation(b));
            let (centre, _) = ball(bone.vertices.iter().map(|&v| rest[v as usize]));
            BoneMotion {
                name: bone.name.clone(),
                vertices: bone.vertices.len(),
                axis: turn.axis().map_or([0.0, 0.0, 1.0], |axis| axis.into_inner().into()),
                angle: turn.angle().to_degrees(),
                centre: (centre + self.origin).into(),
                shift: poses.displacement(b, centre).map(|c| c + 0.0).into(),
                left_mm: bone.left,
                strain: strain(&bone.vertices, rest, displacement),
                force_mn: [0.0; 3],
            }
        };
        self.bones.iter().enumerate().map(of).collect()
    }

    /// The turn of a bone, and what a fit leaves (mm).
    ///
    /// - `own`: its handles, where they are and where they go (mm).
    fn turn_of(
        &self,
        b: usize,
        own: &[(Vector3<f64>, Vector3<f64>)],
    ) -> Result<(RigidTransform, Option<f64>), Error> {
        let part = &self.parts[b];
        let pivot = match part.drive {
            Drive::Prescribed(turn) => return Ok((turn.relative_to(self.origin), None)),
            Drive::Fitted { pivot } => pivot.map(|pivot| Vector3::from(pivot) - self.origin),
        };
        if own.is_empty() {
            return Err(Error::Mismatch {
                what: "rigid",
                problem: format!("bone {} is to be fitted, and no handle lies on it", part.name),
                remedy: "pick vertices that it holds, or give its angle or move",
            });
        }
        // What its parents do comes after its own turn.
        let before: Vec<(Vector3<f64>, Vector3<f64>)> = match self.bones[b].parent {
            None => own.to_vec(),
            Some(parent) => {
                let poses = self.poses(1.0);
                own.iter().map(|&(x, y)| (x, poses.back(parent, y))).collect()
            }
        };
        let n = before.len() as f64;
        let (at, goal): (Vec<Vector3<f64>>, Vec<Vector3<f64>>) = before.iter().copied().unzip();
        let (from, to) = pivot.map_or_else(|| (middle(&at), middle(&goal)), |pivot| (pivot, pivot));
        let arms: Vec<_> = before.iter().map(|(x, y)| (x - from, y - to)).collect();
        let turn = fit::turn(&arms).map_err(|unsure| open(unsure, &part.name))?;
        let angle = turn.norm();
        let axis = if angle > 0.0 { (turn / angle).into() } else { RigidTransform::NONE.axis };
        let turn =
            RigidTransform { pivot: from.into(), axis, angle: angle.to_degrees(), by: (to - from).into() };
        let pose = turn.after(1.0);
        let left = before.iter().map(|(x, y)| (x + pose.displacement(*x) - y).norm_squared()).sum::<f64>();
        Ok((turn, Some((left / n).sqrt())))
    }
}

/// The middle of points (mm), exact where they are one.
fn middle(points: &[Vector3<f64>]) -> Vector3<f64> {
    let first = points[0];
    first + points.iter().map(|p| p - first).sum::<Vector3<f64>>() / points.len() as f64
}

fn open(unsure: Unsure, name: &str) -> Error {
    let problem = match unsure {
        Unsure::HalfTurn => {
            format!(
                "the handles of bone {name} lie on a line that they turn round; about which axis isn't said"
            )
        }
        Unsure::Mirrored => {
            format!("the handles of bone {name} go onto a line or a mirror image: several turns come as near")
        }
    };
    Error::Mismatch {
        what: "rigid",
        problem,
        remedy: "give it more handles, off one line, or give its angle",
    }
}

/// The parent of each part.
fn parents(parts: &[BoneSpec]) -> Result<Vec<Option<usize>>, Error> {
    let find = |name: &str| parts.iter().position(|part| part.name == name);
    let mismatch = |problem: String, remedy| Err(Error::Mismatch { what: "rigid", problem, remedy });
    parts
        .iter()
        .enumerate()
        .map(|(b, part)| {
            if find(&part.name) != Some(b) {
                return mismatch(format!("two bones are called {}", part.name), "give each its own name");
            }
            let Some(name) = &part.parent else { return Ok(None) };
            let Some(parent) = find(name) else {
                let problem = format!("bone {} has the parent {name}, which isn't there", part.name);
                return mismatch(problem, "name a bone of the list");
            };
            Ok(Some(parent))
        })
        .collect()
}

/// The bones, each after its parent.
fn order(parts: &[BoneSpec], parents: &[Option<usize>]) -> Result<Vec<usize>, Error> {
    let mut order = Vec::with_capacity(parts.len());
    let mut done = vec![false; parts.len()];
    while order.len() < parts.len() {
        let ready = (0..parts.len()).find(|&b| !done[b] && parents[b].is_none_or(|p| done[p]));
        let Some(b) = ready else {
            let b = done.iter().position(|done| !done).expect("some bone is left");
            return Err(Error::Mismatch {
                what: "rigid",
                problem: format!("bone {} is carried by itself, through its parents", parts[b].name),
                remedy: "give the first bone of a chain no parent",
            });
        };
        done[b] = true;
        order.push(b);
    }
    Ok(order)
}

/// The handles on a bone: vertices, each once, and their ways (mm).
fn targets(
    holder: &Holders,
    b: usize,
    parts: &[BoneSpec],
    handles: &[(Handle, usize)],
) -> Result<Vec<(usize, Vector3<f64>)>, Error> {
    let mut own: Vec<(usize, Vector3<f64>)> = Vec::new();
    for (h, (handle, vertex)) in handles.iter().enumerate().filter(|(_, (_, v))| holder[*v] == Some(b)) {
        let name = &parts[b].name;
        let mismatch = |problem: String, remedy| Err(Error::Mismatch { what: "handle", problem, remedy });
        match (handle.action, &parts[b].drive) {
            (Action::Move(by), Drive::Fitted { .. }) => {
                if own.iter().all(|(other, _)| other != vertex) {
                    own.push((*vertex, by.into()));
                }
            }
            (Action::Force(_), _) => {
                let problem = format!("handle {h} pulls bone {name}, which no force moves");
                return mismatch(problem, "move it there, or pick soft tissue");
            }
            (Action::Move(_), Drive::Prescribed(_)) => {
                let problem = format!("handle {h} moves bone {name}, whose motion is given");
                return mismatch(problem, "let the bone be fitted (fit = true), or pick soft tissue");
            }
        }
    }
    Ok(own)
}

/// The middle of the points' box, and the distance to the farthest.
fn ball(points: impl Iterator<Item = Vector3<f64>> + Clone) -> (Vector3<f64>, f64) {
    let low = points.clone().fold(Vector3::repeat(f64::INFINITY), |a, b| a.inf(&b));
    let high = points.clone().fold(Vector3::repeat(f64::NEG_INFINITY), |a, b| a.sup(&b));
    let centre = (low + high) / 2.0;
    (centre, points.map(|p| (p - centre).norm()).fold(0.0, f64::max))
}

/// Largest relative change of the distance of each vertex to the next and to the one half the list on.
fn strain(vertices: &[u32], rest: &[Vector3<f64>], displacement: &[[f64; 3]]) -> f64 {
    let n = vertices.len();
    let change = |i: usize, j: usize| {
        let [a, b] = [vertices[i], vertices[j % n]].map(|v| v as usize);
        let before = rest[b] - rest[a];
        let by = Vector3::from(displacement[b]) - Vector3::from(displacement[a]);
        let square = before.norm_squared();
        // Half the change of the squared distance, without its cancellation.
        if square > 0.0 { ((before + by / 2.0).dot(&by) / square).abs() } else { 0.0 }
    };
    (0..n).map(|i| change(i, i + 1).max(change(i, i + n / 2))).fold(0.0, f64::max)
}
