//! The part of a lattice that handles can move, as masses on springs.

use std::collections::BTreeMap;

use ivd_core::vertex_class;
use ivd_core::{Labels, Lattice, sets};
use nalgebra::Vector3;

use super::forces::{Springs, pull};
use super::links::{Kind, Link, links};
use super::params::{Material, Params};
use super::spring::{LIMITED, Law, Spring, Vectors};
use crate::Error;
use crate::rigid::Skeleton;

/// Stiffness of 1 N/m (g/s²).
const NEWTON_PER_METRE: f64 = 1e3;

/// Masses on springs: the loose vertices, then those that hold them.
#[derive(Debug, Clone)]
pub(super) struct Body {
    /// The lattice's vertex of each vertex: the loose ones ascending, then the held ones ascending.
    pub(super) vertices: Vec<u32>,
    /// Number of loose vertices.
    pub(super) loose: usize,
    /// Rest position of every vertex (mm), relative to the grid's origin.
    pub(super) rest: Vec<[f64; 3]>,
    /// Mass of each loose vertex (g).
    pub(super) mass: Vec<f64>,
    /// Stiffness of each loose vertex's ground spring (g/s²).
    pub(super) ground: Vec<f64>,
    /// How far the farthest neighbour of each loose vertex is, along an edge (mm).
    pub(super) neighbour: Vec<f64>,
    /// Every spring with a loose end, once.
    pub(super) list: Vec<Spring>,
    /// The same, as their forces are summed.
    pub(super) springs: Springs,
    /// The springs that lead out of the handles' reach.
    pub(super) leading_out: Vec<Spring>,
    /// The vertices that bones carry, ascending; they come after the loose ones.
    pub(super) carried: Vec<usize>,
    /// The springs that tie loose vertices to them.
    pub(super) to_bones: Vec<Spring>,
}

/// Which vertices may move, by the lattice's numbers.
pub(super) struct Region<'a> {
    /// Within a handle's ball, or its target.
    pub(super) near: Vec<bool>,
    /// Isn't moved by any spring: it stays, or a bone holds it.
    pub(super) fixed: Vec<bool>,
    /// Is carried by a bone that moves; fixed, too.
    pub(super) carried: Vec<bool>,
    /// Where motion starts from, beside what is carried.
    pub(super) targets: &'a [usize],
}

impl Body {
    /// The vertices that springs connect to a target or a bone that moves within the reach, without passing a fixed vertex.
    pub(super) fn new(
        lattice: &Lattice,
        labels: Option<&Labels>,
        rest: &[Vector3<f64>],
        region: &Region,
        params: &Params,
    ) -> Result<Self, Error> {
        labels.map_or(Ok(()), |labels| vertex_class::check(lattice, labels))?;
        // Springs across an edge need both triangles, though only a corner may be near.
        let mut close = region.near.clone();
        for t in lattice.triangles() {
            if t.iter().any(|&v| region.near[v as usize]) {
                for &v in t {
                    close[v as usize] = true;
                }
            }
        }
        let mut links = links(lattice.triangles(), rest, |v| close[v as usize]);
        links.retain(|link| link.ends.iter().any(|&v| region.near[v as usize]));
        let number = numbers(&links, rest.len(), region);
        let vertices: Vec<u32> = {
            let mut all: Vec<u32> =
                (0..rest.len() as u32).filter(|&v| number[v as usize] != u32::MAX).collect();
            all.sort_by_key(|&v| number[v as usize]);
            all
        };
        let loose =
            vertices.iter().filter(|&&v| region.near[v as usize] && !region.fixed[v as usize]).count();
        let (area, outward) = shares(lattice, rest, &close);
        let material: Vec<Resolved> = vertices
            .iter()
            .map(|&v| {
                let class = labels
                    .map(|labels| vertex_class::inside(lattice, labels, v as usize, outward[v as usize]));
                Resolved::of(params, class)
            })
            .collect();
        let mass = masses(vertices[..loose].iter().map(|&v| area[v as usize]), &material, params);
        let mut list = Vec::new();
        let mut structural = vec![(0.0, 0.0); loose];
        let mut neighbour = vec![0.0_f64; loose];
        for link in &links {
            let ends = link.ends.map(|v| number[v as usize]);
            if ends.iter().all(|&v| v == u32::MAX || v as usize >= loose) {
                continue;
            }
            let [a, b] = ends.map(|v| material[v as usize].stiffness(link, params));
            let stiffness = if a + b > 0.0 { 2.0 * a * (b / (a + b)) } else { 0.0 };
            let length = (rest[link.ends[1] as usize] - rest[link.ends[0] as usize]).norm();
            if link.kind == Kind::Structural {
                for v in ends.into_iter().map(|v| v as usize).filter(|v| *v < loose) {
                    structural[v] = (structural[v].0 + stiffness, structural[v].1 + 1.0);
                    neighbour[v] = neighbour[v].max(length);
                }
            }
            if stiffness > 0.0 {
                list.push(Spring { ends, length, stiffness });
            }
        }
        let ground = structural
            .iter()
            .zip(&material)
            .map(|(&(sum, n), own)| params.springs.ground * if n > 0.0 { sum / n } else { own.alone(params) })
            .collect();
        let law = Law { push: params.springs.push.unwrap_or(true), limit: params.springs.strain_limit };
        let outside = |v: u32| v as usize >= loose && !region.fixed[vertices[v as usize] as usize];
        let on_bone = |v: u32| region.carried[vertices[v as usize] as usize];
        let rest: Vec<[f64; 3]> = vertices.iter().map(|&v| rest[v as usize].into()).collect();
        Ok(Self {
            carried: (loose..vertices.len()).filter(|&v| on_bone(v as u32)).collect(),
            to_bones: list.iter().filter(|s| s.ends.iter().any(|&v| on_bone(v))).copied().collect(),
            loose,
            mass,
            ground,
            neighbour,
            springs: Springs::new(&list, &rest, loose, law),
            leading_out: list.iter().filter(|s| s.ends.iter().any(|&v| outside(v))).copied().collect(),
            list,
            rest,
            vertices,
        })
    }

    /// Whether springs push from now on.
    pub(super) fn pushes(&mut self, push: bool) {
        self.springs.obey(Law { push, ..self.springs.law() });
    }

    /// The loose vertex of a lattice's vertex.
    pub(super) fn loose_vertex(&self, vertex: usize) -> Option<usize> {
        self.vertices[..self.loose].binary_search(&(vertex as u32)).ok()
    }

    /// Bound on the stiffness at each loose vertex (g/s²): Gershgorin's, for the sum of all springs at any strain.
    pub(super) fn stiffness_bound(&self) -> Vec<f64> {
        let limited = if self.springs.law().limit.is_some() { 1.0 + LIMITED } else { 1.0 };
        let mut bound = self.ground.clone();
        for spring in &self.list {
            for v in spring.ends.map(|v| v as usize).into_iter().filter(|v| *v < self.loose) {
                bound[v] += 2.0 * limited * spring.stiffness;
            }
        }
        bound
    }

    /// For each loose vertex, whether springs tie it to one that never moves or that has a ground spring.
    pub(super) fn held(&self) -> Vec<bool> {
        let part = self.parts();
        let mut held = vec![false; self.loose];
        for spring in &self.list {
            let [a, b] = spring.ends.map(|v| v as usize);
            if a.max(b) >= self.loose {
                held[part[a.min(b)] as usize] = true;
            }
        }
        for v in 0..self.loose {
            held[part[v] as usize] |= self.ground[v] > 0.0;
        }
        part.into_iter().map(|p| held[p as usize]).collect()
    }

    /// The lowest vertex that springs connect each loose vertex to, over loose ones.
    pub(super) fn parts(&self) -> Vec<u32> {
        let mut parts = sets::singles(self.loose);
        for [a, b] in self.list.iter().map(|spring| spring.ends) {
            if (a.max(b) as usize) < self.loose {
                sets::join(&mut parts, a, b);
            }
        }
        sets::flatten(&mut parts);
        parts
    }

    /// Energy of springs and ground springs (nJ).
    pub(super) fn energy(&self, moved: &Vectors) -> f64 {
        let ground: f64 =
            self.ground.iter().zip(moved).map(|(g, u)| 0.5 * g * Vector3::from(*u).norm_squared()).sum();
        self.springs.energy(&self.rest, moved) + ground
    }

    /// The springs' force (µN) on every vertex that a bone carries, in their order.
    pub(super) fn on_bones(&self, moved: &Vectors) -> Vec<[f64; 3]> {
        let mut force = vec![[0.0; 3]; self.carried.len()];
        let mut add = |v: usize, pull: Vector3<f64>| {
            if let Ok(at) = self.carried.binary_search(&v) {
                for a in 0..3 {
                    force[at][a] += pull[a];
                }
            }
        };
        for spring in &self.to_bones {
            let [i, j] = spring.ends.map(|v| v as usize);
            let on_first = pull(spring, self.springs.law(), &self.rest, moved);
            add(i, on_first);
            add(j, -on_first);
        }
        force
    }

    /// Sum of the sizes of the forces by which the vertices outside the reach hold the others (µN).
    pub(super) fn held_back(&self, moved: &Vectors) -> f64 {
        let mut force = vec![Vector3::zeros(); self.vertices.len() - self.loose];
        for spring in &self.leading_out {
            let [i, j] = spring.ends.map(|v| v as usize);
            let on_first = pull(spring, self.springs.law(), &self.rest, moved);
            if j >= self.loose {
                force[j - self.loose] -= on_first;
            } else {
                force[i - self.loose] += on_first;
            }
        }
        force.iter().map(Vector3::norm).sum()
    }
}

/// Numbers of the vertices in the body: the loose ones first, then those that a spring ties them to; `u32::MAX` for others.
fn numbers(links: &[Link], vertices: usize, region: &Region) -> Vec<u32> {
    let may_move = |v: usize| region.near[v] && !region.fixed[v];
    let mut first = vec![0_u32; vertices + 1];
    let ends = || links.iter().flat_map(|link| [link.ends, [link.ends[1], link.ends[0]]]);
    ends().for_each(|[a, _]| first[a as usize + 1] += 1);
    for v in 0..vertices {
        first[v + 1] += first[v];
    }
    let (mut next, mut other) = (first.clone(), vec![0_u32; 2 * links.len()]);
    for [a, b] in ends() {
        other[next[a as usize] as usize] = b;
        next[a as usize] += 1;
    }
    let mut seen = vec![false; vertices];
    let beside_bones = ends().filter(|[a, _]| region.carried[*a as usize]).map(|[_, b]| b as usize);
    let mut stack: Vec<usize> =
        region.targets.iter().copied().chain(beside_bones).filter(|&t| may_move(t)).collect();
    for &t in &stack {
        seen[t] = true;
    }
    while let Some(v) = stack.pop() {
        for &u in &other[first[v] as usize..first[v + 1] as usize] {
            if !std::mem::replace(&mut seen[u as usize], true) && may_move(u as usize) {
                stack.push(u as usize);
            }
        }
    }
    let mut number = vec![u32::MAX; vertices];
    let loose = (0..vertices).filter(|&v| seen[v] && may_move(v));
    let held = (0..vertices).filter(|&v| seen[v] && !may_move(v));
    loose.chain(held).zip(0..).for_each(|(v, n)| number[v] = n);
    number
}

/// The classes of matter along a lattice, as springs take them, with how much of its area each has (mm²): to every vertex belongs what lies within it, and a
/// third of the triangles round it. Under 0 stands what has no label, or no side.
pub fn classes_along(lattice: &Lattice, labels: &Labels) -> BTreeMap<u16, f64> {
    let rest: Vec<Vector3<f64>> = (0..lattice.keys().len()).map(|v| lattice.world(v).0).collect();
    let (area, outward) = shares(lattice, &rest, &vec![true; rest.len()]);
    let mut classes = BTreeMap::new();
    for (v, way) in outward.iter().enumerate() {
        *classes.entry(vertex_class::inside(lattice, labels, v, *way)).or_default() += area[v];
    }
    classes
}

/// A third of the area of its triangles (mm²) for each vertex, and the sum of their normals (mm²).
fn shares(lattice: &Lattice, rest: &[Vector3<f64>], close: &[bool]) -> (Vec<f64>, Vec<Vector3<f64>>) {
    let mut area = vec![0.0; rest.len()];
    let mut outward = vec![Vector3::zeros(); rest.len()];
    for t in lattice.triangles().iter().filter(|t| t.iter().any(|&v| close[v as usize])) {
        let [a, b, c] = t.map(|v| rest[v as usize]);
        let normal = (b - a).cross(&(c - a));
        for &v in t {
            area[v as usize] += normal.norm() / 6.0;
            outward[v as usize] += normal;
        }
    }
    (area, outward)
}

/// The vertices beside classes that stay, but for those that a bone of the scene holds.
pub(super) fn rigid_vertices(
    lattice: &Lattice,
    labels: Option<&Labels>,
    params: &Params,
    skeleton: &Skeleton,
) -> Result<Vec<usize>, Error> {
    let rigid = params.springs.material.iter().filter(|(_, own)| own.is_rigid());
    let rigid: Vec<u16> = rigid.map(|(class, _)| *class).collect();
    let Some(labels) = labels.filter(|_| !rigid.is_empty()) else { return Ok(Vec::new()) };
    vertex_class::check(lattice, labels)?;
    let beside = |v: usize| rigid.iter().any(|class| vertex_class::beside(lattice, labels, v, *class));
    let stays = |v: &usize| skeleton.holder(*v).is_none() && beside(*v);
    Ok((0..lattice.keys().len()).filter(stays).collect())
}

/// Mass of each vertex (g), never less than for a tenth of the mean area.
fn masses(areas: impl Iterator<Item = f64> + Clone, material: &[Resolved], params: &Params) -> Vec<f64> {
    let count = areas.clone().count().max(1);
    let mean = areas.clone().sum::<f64>() / count as f64;
    let least = if mean > 0.0 { 0.1 * mean } else { 1.0 };
    areas
        .zip(material)
        .map(|(area, own)| params.springs.vertex_mass.unwrap_or((area.max(least) * own.density).max(1e-15)))
        .collect()
}

/// What a vertex is made of.
struct Resolved {
    stiffness: f64,
    youngs_kpa: Option<f64>,
    density: f64,
}

impl Resolved {
    fn of(params: &Params, class: Option<u16>) -> Self {
        let own = class.and_then(|class| params.springs.material.get(&class).copied()).unwrap_or_default();
        let Material { stiffness, density, .. } = own;
        Self {
            stiffness: stiffness.unwrap_or(params.springs.stiffness),
            // A stiffness that a class is given is meant instead of everybody's Young's modulus.
            youngs_kpa: own.young().or(params.springs.youngs_kpa.filter(|_| stiffness.is_none())),
            density: density.unwrap_or(params.springs.density),
        }
    }

    /// Stiffness of a spring that is all of this material (g/s²).
    fn stiffness(&self, link: &Link, params: &Params) -> f64 {
        let part = match link.kind {
            Kind::Structural => 1.0,
            Kind::Shear => params.springs.shear,
            Kind::Flexion => params.springs.flexion,
        };
        let aspect = if self.youngs_kpa.is_some() { link.aspect } else { 1.0 };
        part * aspect * self.alone(params)
    }

    /// Stiffness of a structural spring of which the aspect is 1 (g/s²). 1 kPa · 1 mm is 1 N/m.
    fn alone(&self, params: &Params) -> f64 {
        self.youngs_kpa.map_or(self.stiffness, |e| e * params.springs.thickness) * NEWTON_PER_METRE
    }
}
