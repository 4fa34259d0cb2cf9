//! Several labels at once: a closed manifold lattice for each, whose seams coincide vertex for vertex.
//!
//! A lattice of one label after another would leave gaps where three labels meet, and where two cross on a face each would cut
//! its own corners off. Here every cell's faces are divided between all labels at once, and every triangle inside belongs to the
//! two labels on its sides:
//!
//! - A grid edge between two labels has a vertex in its middle.
//! - A face on which three or four labels meet has a vertex in its middle. Where two labels lie on its two diagonals the one that was
//!   named first goes through and the other is cut off. What is outside goes first of all, so that parts that touch along an
//!   edge stay apart, as on a mask's border.
//! - In the cell, labels that meet along a curve have a sheet between them; where several meet they do so in a vertex inside.
//!
//! Marching cubes for several materials, after Hege, Seebass, Stalling and Zöckler 1997; here every label's lattice is a
//! closed manifold for every input. Vertices stand halfway between voxels, as labels say no more.
//!
//! ```
//! use ivd_core::{Exec, Grid, Labels};
//! use ivd_lattice::extract::extract_parts;
//!
//! let labels = Labels::new(Grid::with_spacing([2, 1, 1], [1.0; 3])?, vec![3_u16, 5].into(), Vec::new())?;
//! let parts = extract_parts(&labels, &[3, 5], &Exec::default())?;
//! // Six vertices round each voxel, and eight where both meet the outside: on four faces, in four cells.
//! assert!(parts.iter().all(|part| part.lattice.keys().len() == 14));
//! let shared = parts[0].lattice.keys().iter().filter(|key| parts[1].lattice.vertex_at(**key).is_some());
//! assert_eq!(shared.count(), 9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod fill;
mod network;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, PoisonError, RwLock};

use ivd_core::{ElementKey, Exec, Labels, Lattice, LatticeSource, NO_DATA, ParamError, parallel};
use rayon::prelude::*;

use super::cell::{self, FACES};
use crate::Error;
use fill::{APEX, Filling};
use network::{FACE, Pattern};

/// Task name for observers.
const TASK: &str = "extract parts";

/// Bytes of a triangle while the keys of its corners have no indices yet, with its share of vertices, twice for two sides.
const TRIANGLE_BYTES: u64 = 2 * (24 + 12 + 24);

/// The lattice of a label.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The label.
    pub id: u16,
    /// Its lattice, empty where no voxel has the label.
    pub lattice: Lattice,
}

/// Cuts the lattices of several labels at once; every label that isn't named, 0 (no data) and what lies beyond the volume are
/// outside.
///
/// - `ids`: the labels, by priority; none means all that occur, ascending. Where two of them cross on a face, the earlier one
///   is joined across it. Outside is as if it were named first of all.
///
/// Each lattice is closed and manifold. Wherever two parts touch, both lattices have the same vertices there (same voxel,
/// same place) and the same triangles, turned over. Same input, same lattices, for any number of threads.
///
/// # Errors
/// [`ivd_core::Error::Param`] where a label is named twice or is 0, [`Error::TooManyVertices`], and in [`Error::Core`] the memory limit
/// and cancelling.
pub fn extract_parts(labels: &Labels, ids: &[u16], exec: &Exec) -> Result<Vec<Part>, Error> {
    let bad = |problem: String| {
        Err(ParamError::new("labels", problem, "name each label once, none for all of them").into())
    };
    if ids.contains(&NO_DATA) {
        return bad(format!("{NO_DATA} stands for no data and has no lattice"));
    }
    let mut named = BTreeSet::new();
    if let Some(twice) = ids.iter().find(|id| !named.insert(**id)) {
        return bad(format!("{twice} is named twice"));
    }
    exec.run(|| {
        let ids = if ids.is_empty() { labels_present(labels) } else { ids.to_vec() };
        Sweep::new(labels, &ids).run(labels, &ids, exec)
    })
}

/// The labels that voxels have, ascending, without [`NO_DATA`], on the calling pool.
pub fn labels_present(labels: &Labels) -> Vec<u16> {
    let seen = labels.ids().par_chunks(1 << 16).fold(
        || vec![false; 1 << 16],
        |mut seen, ids| {
            for id in ids {
                seen[usize::from(*id)] = true;
            }
            seen
        },
    );
    let seen = seen.reduce(
        || vec![false; 1 << 16],
        |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
            a
        },
    );
    (1..=u16::MAX).filter(|id| seen[usize::from(*id)]).collect()
}

/// Corners of triangles by their keys, and the places of vertices in cells: one part in one layer of cells.
#[derive(Debug, Default)]
struct Piece {
    triangles: Vec<[u64; 3]>,
    apexes: Vec<(u64, [f32; 3])>,
}

/// The input of the sweep.
struct Sweep<'a> {
    ids: &'a [u16],
    dims: [usize; 3],
    /// Number of each label's part: 0 outside, else its place among those named, from 1.
    number: Vec<u16>,
    flip: bool,
    /// What was found for the patterns met so far.
    fillings: RwLock<HashMap<u32, Arc<Filled>>>,
}

impl<'a> Sweep<'a> {
    fn new(labels: &'a Labels, ids: &[u16]) -> Self {
        let mut number = vec![0; 1 << 16];
        for (i, id) in ids.iter().enumerate() {
            number[usize::from(*id)] = i as u16 + 1;
        }
        let flip = labels.grid().linear_part().determinant() < 0.0;
        Self { ids: labels.ids(), dims: labels.grid().dims(), number, flip, fillings: RwLock::default() }
    }

    fn run(&self, labels: &Labels, ids: &[u16], exec: &Exec) -> Result<Vec<Part>, Error> {
        let layers = self.dims[2] + 1;
        exec.observer().begin(TASK, 2 * layers as u64);
        let begin = || {
            exec.check_cancelled()?;
            exec.observer().advance(TASK, 1);
            Ok::<_, ivd_core::Error>(())
        };
        let counted = parallel::try_map(layers, &|z| begin().map(|()| self.count(z)))?;
        let triangles: u64 = counted.into_iter().sum();
        exec.check_memory("the lattices of the labels", triangles * TRIANGLE_BYTES)?;
        let mut pieces = parallel::try_map(layers, &|z| begin().map(|()| self.pieces(z)))?;
        let mut parts = Vec::with_capacity(ids.len());
        for (i, &id) in ids.iter().enumerate() {
            exec.check_cancelled()?;
            let own: Vec<Piece> =
                pieces.iter_mut().map(|layer| layer.remove(&(i as u16 + 1)).unwrap_or_default()).collect();
            parts.push(Part { id, lattice: assemble(labels, own)? });
        }
        exec.observer().end(TASK);
        Ok(parts)
    }

    /// Triangles in a layer of cells.
    fn count(&self, z: usize) -> u64 {
        let mut count = 0;
        self.each_mixed_cell(z, |_, _, filled| count += filled.filling.walls.len() as u64);
        count
    }

    /// The triangles of a layer of cells, by part.
    fn pieces(&self, z: usize) -> BTreeMap<u16, Piece> {
        let mut pieces: BTreeMap<u16, Piece> = BTreeMap::new();
        self.each_mixed_cell(z, |[x, y], parts, filled| {
            let first = [x, y, z];
            for wall in &filled.filling.walls {
                for (side, turned) in [(wall.inside, false), (wall.outside, true)] {
                    let part = parts[usize::from(side)];
                    if part == 0 {
                        continue;
                    }
                    let mut keys = wall.corners.map(|corner| filled.key(self.dims, first, corner, side).0);
                    if turned != self.flip {
                        keys.swap(1, 2);
                    }
                    pieces.entry(part).or_default().triangles.push(keys);
                }
            }
            for &(side, apex, element) in &filled.elements {
                let part = parts[usize::from(side)];
                if part != 0 {
                    let key = ElementKey::new(self.dims, first, element).0;
                    let place = filled.filling.apexes[usize::from(apex - APEX)];
                    pieces.entry(part).or_default().apexes.push((key, place));
                }
            }
        });
        pieces
    }

    /// Calls `visit` for each cell of layer `z` whose corners aren't all of one part: padded x and y, the cell's parts in
    /// the order of its pattern, and how they meet.
    fn each_mixed_cell(&self, z: usize, mut visit: impl FnMut([usize; 2], &[u16; 8], &Filled)) {
        let width = self.dims[0] + 2;
        let layers = [self.layer(z), self.layer(z + 1)];
        let mut known: HashMap<u32, Arc<Filled>> = HashMap::new();
        for y in 0..=self.dims[1] {
            let rows: [&[u16]; 4] = std::array::from_fn(|r| {
                let start = (y + (r & 1)) * width;
                &layers[r >> 1][start..start + width]
            });
            for x in 0..=self.dims[0] {
                let first = rows[0][x];
                if rows.iter().all(|row| row[x] == first && row[x + 1] == first) {
                    continue;
                }
                let corners: [u16; 8] = std::array::from_fn(|c| rows[c >> 1][x + (c & 1)]);
                let (pattern, parts) = numbered(&corners);
                let code = code(pattern, &parts);
                let filled = known.entry(code).or_insert_with(|| self.filled(code, pattern));
                visit([x, y], &parts, filled);
            }
        }
    }

    /// The parts of the voxels of padded layer `z`, padded.
    fn layer(&self, z: usize) -> Vec<u16> {
        let [nx, ny, nz] = self.dims;
        let mut layer = vec![0; (nx + 2) * (ny + 2)];
        if !(1..=nz).contains(&z) {
            return layer;
        }
        let ids = &self.ids[nx * ny * (z - 1)..][..nx * ny];
        for (row, ids) in layer[nx + 2..].chunks_mut(nx + 2).zip(ids.chunks(nx)) {
            for (part, id) in row[1..].iter_mut().zip(ids) {
                *part = self.number[usize::from(*id)];
            }
        }
        layer
    }

    fn filled(&self, code: u32, pattern: Pattern) -> Arc<Filled> {
        let known = self.fillings.read().unwrap_or_else(PoisonError::into_inner).get(&code).cloned();
        known.unwrap_or_else(|| {
            let filled = Arc::new(Filled::new(pattern, (code >> 24) as u8));
            let mut fillings = self.fillings.write().unwrap_or_else(PoisonError::into_inner);
            fillings.entry(code).or_insert(filled).clone()
        })
    }
}

/// Eight corners as a pattern, and the part that each of its numbers stands for.
fn numbered(corners: &[u16; 8]) -> (Pattern, [u16; 8]) {
    let (mut parts, mut count) = ([0; 8], 0);
    let pattern = corners.map(|corner| {
        let at = parts[..count].iter().position(|&part| part == corner);
        at.unwrap_or_else(|| {
            parts[count] = corner;
            count += 1;
            count - 1
        }) as u8
    });
    (pattern, parts)
}

/// A pattern as a number: three bits a corner, then for each face whether its first corner's part is joined across it.
fn code(pattern: Pattern, parts: &[u16; 8]) -> u32 {
    let corners = pattern.iter().rev().fold(0, |code, &p| code << 3 | u32::from(p));
    let joined = (0..6).filter(|&f| network::is_crossed(pattern, f)).fold(0, |joined, f| {
        let [first, second] = [0, 1].map(|i| parts[usize::from(pattern[usize::from(FACES[f][i])])]);
        joined | u32::from(first < second) << f
    });
    corners | joined << 24
}

/// A filling with the elements of its apexes.
#[derive(Debug)]
struct Filled {
    filling: Filling,
    /// Part, apex, and the element under which that part's lattice has the apex.
    elements: Vec<(u8, u8, u8)>,
}

impl Filled {
    fn new(pattern: Pattern, first_joined: u8) -> Self {
        let filling = fill::fill(pattern, first_joined);
        let mut used: BTreeSet<(u8, u8)> = BTreeSet::new();
        for wall in &filling.walls {
            for corner in wall.corners.into_iter().filter(|&corner| corner >= APEX) {
                used.extend([(wall.inside, corner), (wall.outside, corner)]);
            }
        }
        // The cell's two elements, then those of its low faces that have no vertex.
        let is_node = |face: u8| filling.walls.iter().any(|w| w.corners.contains(&(FACE + face)));
        let free: Vec<u8> =
            [6, 7].into_iter().chain((0..3).filter(|axis| !is_node(2 * axis)).map(|axis| 3 + axis)).collect();
        let mut taken = [0; 8];
        let elements = used
            .into_iter()
            .map(|(part, apex)| {
                let next = &mut taken[usize::from(part)];
                let element =
                    free.get(*next).expect("a part has no more apexes than a cell has free elements");
                *next += 1;
                (part, apex, *element)
            })
            .collect();
        Self { filling, elements }
    }

    /// Key of a wall's corner in a part's lattice.
    #[inline]
    fn key(&self, dims: [usize; 3], first: [usize; 3], corner: u8, part: u8) -> ElementKey {
        let moved = |offset: [usize; 3]| std::array::from_fn(|a| first[a] + offset[a]);
        if corner < FACE {
            let low = cell::EDGES[usize::from(corner)][0];
            return ElementKey::new(dims, moved(cell::offset(low)), corner / 4);
        }
        if corner < APEX {
            let (axis, side) = ((corner - FACE) / 2, usize::from(corner - FACE) % 2);
            let mut offset = [0; 3];
            offset[usize::from(axis)] = side;
            return ElementKey::new(dims, moved(offset), 3 + axis);
        }
        let element = self.elements.iter().find(|e| (e.0, e.1) == (part, corner));
        ElementKey::new(dims, first, element.expect("an apex of a part has an element").2)
    }
}

/// Numbers the vertices of one part, layer by layer.
fn assemble(labels: &Labels, mut pieces: Vec<Piece>) -> Result<Lattice, Error> {
    let grid = labels.grid();
    let dims = grid.dims();
    let of_layer = |z: usize| ElementKey::new(dims, [0, 0, z], 0).0;
    // The keys in each layer of cells, sorted, and how many of them belong to that layer; the others to the next.
    let keys: Vec<(Vec<u64>, usize)> = pieces
        .par_iter_mut()
        .enumerate()
        .map(|(z, piece)| {
            let mut keys: Vec<u64> = piece.triangles.as_flattened().to_vec();
            keys.sort_unstable();
            keys.dedup();
            piece.apexes.sort_unstable_by_key(|apex| apex.0);
            let own = keys.partition_point(|&key| key < of_layer(z + 1));
            (keys, own)
        })
        .collect();
    let layers: Vec<Vec<u64>> = (0..=keys.len())
        .into_par_iter()
        .map(|z| {
            let own = keys.get(z).map_or(&[][..], |(keys, own)| &keys[..*own]);
            let below = z.checked_sub(1).map_or(&[][..], |z| &keys[z].0[keys[z].1..]);
            let mut all = [own, below].concat();
            all.sort_unstable();
            all.dedup();
            all
        })
        .collect();
    let mut firsts = vec![0_u64];
    for layer in &layers {
        firsts.push(firsts[firsts.len() - 1] + layer.len() as u64);
    }
    let vertices = firsts[layers.len()];
    if vertices > u64::from(u32::MAX) {
        return Err(Error::TooManyVertices { vertices });
    }
    let triangles: Vec<Vec<[u32; 3]>> = pieces
        .par_iter()
        .enumerate()
        .map(|(z, piece)| {
            let index = |key: u64| {
                let layer = z + usize::from(key >= of_layer(z + 1));
                let at = layers[layer].binary_search(&key).expect("every corner's key is listed");
                (firsts[layer] + at as u64) as u32
            };
            piece.triangles.iter().map(|keys| keys.map(index)).collect()
        })
        .collect();
    let places: Vec<Vec<[f32; 3]>> = layers
        .par_iter()
        .enumerate()
        .map(|(z, layer)| {
            let apexes = pieces.get(z).map_or(&[][..], |piece| &piece.apexes);
            let place = |&key: &u64| match apexes.binary_search_by_key(&key, |apex| apex.0) {
                Ok(at) => apexes[at].1,
                Err(_) => middle(ElementKey(key).element()),
            };
            layer.iter().map(place).collect()
        })
        .collect();
    Ok(Lattice::new(
        grid.clone(),
        bytemuck::cast_vec(layers.concat()).into(),
        places.concat().into(),
        triangles.concat().into(),
    )?
    .with_source(LatticeSource::Mask))
}

/// The middle of an edge or of a face.
fn middle(element: u8) -> [f32; 3] {
    let axis = usize::from(element % 3);
    std::array::from_fn(|a| if (a == axis) == (element < 3) { 0.5 } else { 0.0 })
}
