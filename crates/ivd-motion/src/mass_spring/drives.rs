//! What handles do to the vertices of a body.

use ivd_core::sets;
use nalgebra::Vector3;

use super::body::Body;
use super::params::Params;
use crate::Error;
use crate::handles::{Action, Handle};
use crate::rigid::{Rig, Skeleton};

/// Force of 1 mN (µN).
pub(super) const MILLINEWTON: f64 = 1e3;

/// Part of its radius that a handle grips, unless it is told, and the most, where neighbours are farther.
const GRIP: f64 = 0.1;
const GRIP_MOST: f64 = 0.3;
/// How far beyond its neighbours a force's grip reaches, in their distance: at its border it has no part of the force.
const SHARING: f64 = 1.5;

/// Prescribed motions and forces.
#[derive(Debug, Clone)]
pub(super) struct Drives {
    /// Moved vertices, ascending, with where they go in the end (mm) and by which handle.
    pub(super) moved: Vec<(usize, [f64; 3], usize)>,
    /// For every loose vertex, whether it is one of them.
    pub(super) is_moved: Vec<bool>,
    /// Force in the end on each loose vertex that isn't moved (µN).
    pub(super) force: Vec<[f64; 3]>,
    /// What bones carry.
    pub(super) bones: Carried,
}

/// The vertices of the body that bones carry.
#[derive(Debug, Clone, Default)]
pub(super) struct Carried {
    rig: Rig,
    /// Vertex, its bone, and where it is at rest (mm).
    vertices: Vec<(usize, usize, Vector3<f64>)>,
}

impl Carried {
    fn new(body: &Body, skeleton: &Skeleton) -> Self {
        let bone = |v: usize| skeleton.holder(body.vertices[v] as usize).expect("a bone carries it");
        let vertices = body.carried.iter().map(|&v| (v, bone(v), body.rest[v].into())).collect();
        Self { rig: skeleton.rig(), vertices }
    }

    /// Where they are when handles have reached a fraction of their motion: displacements (mm).
    pub(super) fn at(&self, reached: f64) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        let poses = (!self.vertices.is_empty()).then(|| self.rig.poses(reached));
        self.vertices.iter().filter_map(move |&(v, bone, rest)| {
            Some((v, poses.as_ref()?.displacement(bone, rest).map(|c| c + 0.0).into()))
        })
    }
}

impl Drives {
    /// - `targets`: the lattice's vertex of each handle. Those on a bone have done their work in its fit.
    pub(super) fn new(
        body: &Body,
        handles: &[Handle],
        targets: &[usize],
        fixed: &[bool],
        skeleton: &Skeleton,
        params: &Params,
    ) -> Result<Self, Error> {
        let own = targets.iter().zip(handles).map(|(&t, handle)| match body.loose_vertex(t) {
            None if !fixed[t] => Err(Error::Mismatch {
                what: "handle",
                problem: format!(
                    "vertex {t} lies outside the reach that was prepared ({} mm)",
                    handle.radius
                ),
                remedy: "prepare again with this handle",
            }),
            at => Ok(at),
        });
        let own: Vec<Option<usize>> = own.collect::<Result<_, Error>>()?;
        // Two handles on a vertex do the same, once: as far as the wider does.
        let wider = |h: usize, other: usize| {
            let [radius, others] = [h, other].map(|h| handles[h].radius);
            own[h] == own[other] && (others > radius || (others == radius && other < h))
        };
        let mut mover: Vec<Option<(f64, usize)>> = vec![None; body.loose];
        let mut pulls = Vec::new();
        for (h, handle) in handles.iter().enumerate() {
            let Some(target) = own[h] else { continue };
            if (0..own.len()).any(|other| wider(h, other)) {
                continue;
            }
            let is_pull = matches!(handle.action, Action::Force(_));
            let near = body.neighbour[target] * if is_pull { SHARING } else { 1.0 + 1e-9 };
            let reach = (GRIP * handle.radius).max(near).min(GRIP_MOST * handle.radius);
            let grip = gripped(body, target, params.springs.grip.unwrap_or(reach));
            match handle.action {
                Action::Move(_) => {
                    // What another handle has hold of itself is that one's.
                    let is_others = |v: usize| v != target && own.contains(&Some(v));
                    for (v, hold) in grip.into_iter().filter(|(v, _)| !is_others(*v)) {
                        if mover[v].is_none_or(|(other, _)| hold > other) {
                            mover[v] = Some((hold, h));
                        }
                    }
                }
                Action::Force(pull) => pulls.push((pull, grip)),
            }
        }
        // Where vertices are moved no force counts: the others of its grip share all of it.
        let mut force = vec![[0.0; 3]; body.loose];
        for (pull, mut grip) in pulls {
            grip.retain(|(v, _)| mover[*v].is_none());
            let total: f64 = grip.iter().map(|(_, hold)| hold).sum();
            for (v, hold) in grip {
                for a in 0..3 {
                    force[v][a] += pull[a] * MILLINEWTON * (hold / total);
                }
            }
        }
        let moved = mover.iter().enumerate().filter_map(|(v, mover)| {
            let (_, h) = (*mover)?;
            let Action::Move(by) = handles[h].action else { unreachable!("a force moves nothing by itself") };
            Some((v, by, h))
        });
        let moved: Vec<_> = moved.collect();
        let bones = Carried::new(body, skeleton);
        Ok(Self { is_moved: mover.iter().map(Option::is_some).collect(), moved, force, bones })
    }

    /// A pull needs something to pull against.
    pub(super) fn check_held(&self, body: &Body) -> Result<(), Error> {
        let (part, mut held) = (body.parts(), body.held());
        for &(moved, ..) in &self.moved {
            held[part[moved] as usize] = true;
        }
        let loose = |v: &usize| self.force[*v] != [0.0; 3] && !held[*v] && !held[part[*v] as usize];
        (0..body.loose).find(loose).map_or(Ok(()), |v| {
            Err(Error::Mismatch {
                what: "handle",
                problem: format!("nothing holds the part that it pulls at vertex {}", body.vertices[v]),
                remedy: "fix vertices, add ground springs, make the radius smaller, or let time pass",
            })
        })
    }

    /// Takes the moved and the carried vertices to where they are when handles have reached a fraction of their motion.
    pub(super) fn place<const W: usize>(&self, displacement: &mut [[f64; W]], reached: f64) {
        for &(v, by, _) in &self.moved {
            displacement[v][..3].copy_from_slice(&by.map(|c| c * reached));
        }
        for (v, by) in self.bones.at(reached) {
            displacement[v][..3].copy_from_slice(&by);
        }
    }
}

/// The vertices that a handle grips, ascending, with how firmly: those within a radius (mm) of its own that springs join to it there, so that
/// a lip isn't gripped with the other.
fn gripped(body: &Body, target: usize, radius: f64) -> Vec<(usize, f64)> {
    if radius == 0.0 {
        return vec![(target, 1.0)];
    }
    let middle = Vector3::from(body.rest[target]);
    let hold = |v: usize| {
        let t = if v == target { 0.0 } else { (Vector3::from(body.rest[v]) - middle).norm() / radius };
        (v, if t < 1.0 { (1.0 - t * t).powi(2) } else { 0.0 })
    };
    let near: Vec<(usize, f64)> = (0..body.loose).map(hold).filter(|(_, hold)| *hold > 0.0).collect();
    // Where each is among them.
    let mut place = vec![None; body.vertices.len()];
    for (i, (v, _)) in near.iter().enumerate() {
        place[*v] = Some(i as u32);
    }
    let mut joined = sets::singles(near.len());
    for spring in &body.list {
        if let [Some(a), Some(b)] = spring.ends.map(|v| place[v as usize]) {
            sets::join(&mut joined, a, b);
        }
    }
    let own = sets::root(&mut joined, place[target].expect("it is nearest to itself"));
    let with_it = |(i, _): &(usize, &(usize, f64))| sets::root(&mut joined, *i as u32) == own;
    near.iter().enumerate().filter(with_it).map(|(_, gripped)| *gripped).collect()
}
