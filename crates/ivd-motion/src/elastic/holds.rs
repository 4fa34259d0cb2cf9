//! Which nodes are told where to go: by handles, by what is fixed, by bones.

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::Lattice;
use ivd_elastic::{Cells, Mesh, Triple};
use nalgebra::Vector3;

use super::tissues::{Matter, Tissues};
use crate::Error;
use crate::handles::{Action, Handle};

/// What tells a node where to go, or pulls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hold {
    Still,
    Bone(usize),
    Handle(usize),
}

/// The nodes that are told where to go, and by what.
#[derive(Debug, Clone, Default)]
pub(super) struct Holds {
    /// By node.
    pub(super) told: BTreeMap<u32, Hold>,
    /// For every handle that pulls, the nodes that share its force.
    pub(super) pulled: Vec<(usize, Vec<u32>)>,
}

/// What asks for something of nodes.
pub(super) struct Asks<'a> {
    pub(super) lattice: &'a Lattice,
    /// Places of the vertices (mm).
    pub(super) rest: &'a [Vector3<f64>],
    /// Handles with their numbers and vertices, in the order of the grips; those on bones left out.
    pub(super) handles: &'a [(usize, Handle, usize)],
    /// For every vertex, whether it stays.
    pub(super) fixed: &'a [bool],
}

impl Holds {
    /// # Errors
    /// [`Error::Mismatch`]: a handle that has hold of nothing.
    pub(super) fn new(
        asks: &Asks<'_>,
        mesh: &Mesh,
        cells: &Cells,
        tissues: &Tissues<'_>,
    ) -> Result<Self, Error> {
        let mut holds = Self::default();
        let voxel = |node: u32| cells.voxel(mesh.nodes[node as usize].map(f64::from));
        for node in 0..mesh.nodes.len() as u32 {
            let Some((index, number)) = tissues.nearest(voxel(node)) else { continue };
            if let Some(hold) = rigid(tissues.matter(index, number)) {
                holds.told.insert(node, hold);
            }
        }
        holds.tell_thin_parts(mesh, cells, tissues);
        let of_vertex = |vertex: usize| corners(mesh, cells, asks.lattice.voxel(vertex).0);
        for vertex in (0..asks.fixed.len()).filter(|&v| asks.fixed[v] && cells.holds(asks.rest[v])) {
            for node in of_vertex(vertex) {
                holds.told.entry(node).or_insert(Hold::Still);
            }
        }
        // Of several handles the nearest has a node.
        let mut gripped: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
        for (i, &(_, _, target)) in asks.handles.iter().enumerate() {
            let (middle, grip) = (asks.rest[target], &tissues.grips()[i]);
            // The surface goes with its inside, so that what holds it outside does too; but not another part.
            let near = |v: &usize| (asks.rest[*v] - middle).norm() <= grip.core();
            let on_part = |v: &usize| *v == target || grip.touches(asks.lattice, *v);
            let skin: BTreeSet<u32> =
                (0..asks.rest.len()).filter(near).filter(on_part).flat_map(of_vertex).collect();
            for node in 0..mesh.nodes.len() as u32 {
                if mesh.held[node as usize] || holds.told.contains_key(&node) {
                    continue;
                }
                let far = (cells.local(mesh.nodes[node as usize].map(f64::from)) - middle).norm();
                let at = tissues.nearest(voxel(node));
                let of_part = at.is_some_and(|(index, _)| grip.holds(index));
                let outside = at.is_none_or(|(_, number)| !tissues.is_inside(number));
                let holds = (far <= grip.core() && of_part) || (skin.contains(&node) && (of_part || outside));
                if holds && gripped.get(&node).is_none_or(|(other, _)| far < *other) {
                    gripped.insert(node, (far, i));
                }
            }
        }
        for (i, (number, handle, target)) in asks.handles.iter().enumerate() {
            let own: Vec<u32> =
                gripped.iter().filter(|(_, (_, handle))| *handle == i).map(|(node, _)| *node).collect();
            // What another handle has hold of already, at the same vertex, goes the same way.
            let shared = asks.handles[..i].iter().any(|(_, _, other)| other == target);
            let has_matter = !own.is_empty() && tissues.grips()[i].touches(asks.lattice, *target);
            if !has_matter && !shared {
                return Err(Error::Mismatch {
                    what: "handle",
                    problem: format!("handle {number} has hold of nothing that can move"),
                    remedy: "give it a larger radius or grip, or smaller cells (cell = 1), or pick soft matter",
                });
            }
            match handle.action {
                Action::Move(_) => {
                    holds.told.extend(own.into_iter().map(|node| (node, Hold::Handle(*number))));
                }
                Action::Force(_) => holds.pulled.push((*number, own)),
            }
        }
        Ok(holds)
    }

    /// What is rigid and lies in a finest cell between its corners holds these: a plate that is thinner than a cell isn't walked through.
    fn tell_thin_parts(&mut self, mesh: &Mesh, cells: &Cells, tissues: &Tissues<'_>) {
        if !tissues.has_rigid() {
            return;
        }
        for (number, cell) in mesh.cells.iter().enumerate().filter(|(_, cell)| cell.size == 1) {
            let corners = || (0..8).flat_map(|c| mesh.corner(number, c)).map(|(node, _)| *node);
            if corners().any(|node| self.told.contains_key(&node)) {
                continue;
            }
            let low = cells.voxel(cell.low.map(f64::from));
            let high = cells.voxel(cell.corner(7).map(f64::from));
            let many: [usize; 3] = std::array::from_fn(|a| (high[a] - low[a]).round() as usize + 1);
            let inner = (0..many.iter().product::<usize>()).find_map(|i| {
                let step = [i % many[0], i / many[0] % many[1], i / many[0] / many[1]];
                let (index, number) = tissues.nearest(low + Vector3::from(step).map(|c| c as f64))?;
                rigid(tissues.matter(index, number))
            });
            if let Some(hold) = inner {
                self.told.extend(corners().map(|node| (node, hold)));
            }
        }
    }

    /// Forces of the handles at the nodes (mN).
    pub(super) fn loads(&self, handles: &[Handle], nodes: usize) -> Vec<Triple> {
        let mut loads = vec![[0.0; 3]; nodes];
        for (number, own) in &self.pulled {
            if let Action::Force(force) = handles[*number].action {
                for node in own {
                    let load = &mut loads[*node as usize];
                    *load = std::array::from_fn(|a| load[a] + force[a] / own.len() as f64);
                }
            }
        }
        loads
    }
}

/// What tells matter where to go.
fn rigid(matter: Matter) -> Option<Hold> {
    match matter {
        Matter::Soft => None,
        Matter::Bone(bone) => Some(Hold::Bone(bone)),
        Matter::Still => Some(Hold::Still),
    }
}

/// The nodes that a place's motion depends on.
fn corners(mesh: &Mesh, cells: &Cells, voxel: Vector3<f64>) -> BTreeSet<u32> {
    let Some((cell, _)) = mesh.locate(cells.place(voxel)) else { return BTreeSet::new() };
    (0..8).flat_map(|corner| mesh.corner(cell, corner).iter().map(|(node, _)| *node)).collect()
}
