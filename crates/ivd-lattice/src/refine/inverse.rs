//! One step of subdivision taken back exactly.
//!
//! Subdivision cuts each triangle into a **tile** of four: a centre, whose corners are the middles of the three sides, and
//! three corners. Whether a surface came about so is found by covering it with tiles (Taubin 2001). One triangle is either
//! the centre of its tile, or one of the corners, the centre lying across one of its three sides: four hypotheses. Each
//! fixes the tile, its sides fix the tiles beyond them, and so on through the component. A hypothesis holds if the tiles
//! cover it without contradiction: no triangle in two tiles, no vertex both a middle and a corner, each middle that of one
//! side and each side with one middle, and no two tiles on the same three vertices. Of several that hold, as on a torus
//! whose vertices all have six neighbours, that one is taken whose middles lie nearest to the middles of their sides.

use nalgebra::Vector3;
use rayon::prelude::*;

type Point = Vector3<f64>;

/// No triangle, half-edge or vertex.
const NONE: u32 = u32::MAX;

/// A surface before subdivision.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Coarser {
    /// Its triangles, by the vertices of the subdivided one, in the order of their centres.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Vertices that the subdivision made, ascending.
    pub(super) odd: Vec<u32>,
}

/// Why a surface isn't a subdivided one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NotSubdivided {
    /// It is empty.
    Empty,
    /// An edge hasn't two triangles that run along it in opposite directions.
    Open,
    /// No covering by tiles of the component that this triangle is in holds.
    Uncovered(u32),
}

/// Takes back one subdivision of a closed surface.
///
/// - `positions`: places (mm) of the vertices that the triangles name; they only choose between coverings that both hold.
pub(super) fn coarser(triangles: &[[u32; 3]], positions: &[Point]) -> Result<Coarser, NotSubdivided> {
    if triangles.is_empty() {
        return Err(NotSubdivided::Empty);
    }
    let mesh = HalfEdges::new(triangles).ok_or(NotSubdivided::Open)?;
    let mut cover = Cover::new(&mesh, positions);
    let mut centres = Vec::new();
    for seed in 0..triangles.len() as u32 {
        if cover.tile_of[seed as usize] == NONE {
            if !cover.component(seed) {
                return Err(NotSubdivided::Uncovered(seed));
            }
            centres.append(&mut cover.laid);
        }
    }
    centres.sort_unstable();
    let triangles = centres.iter().map(|&c| mesh.tile(c).corners).collect();
    let is_odd = |v: &u32| cover.ends[*v as usize] != [NONE; 2];
    let odd = (0..positions.len() as u32).filter(is_odd).collect();
    Ok(Coarser { triangles, odd })
}

/// Triangles whose half-edge `3 t + i` runs from corner `i` of triangle `t` to the next.
struct HalfEdges<'a> {
    triangles: &'a [[u32; 3]],
    twins: Vec<u32>,
}

/// A centre and what is round it.
struct Tile {
    /// Corners of the triangle that the tile was cut from; corner `i` lies across side `i` of the centre.
    corners: [u32; 3],
    /// Triangles at the corners.
    outer: [u32; 3],
    /// Half-edges of each outer triangle into its corner and out of it: halves of the tile's sides.
    halves: [[u32; 2]; 3],
}

impl<'a> HalfEdges<'a> {
    /// `None` unless each side of each triangle has one twin.
    fn new(triangles: &'a [[u32; 3]]) -> Option<Self> {
        let mut sides: Vec<(u32, u32, u32)> = (0..triangles.len() as u32 * 3)
            .into_par_iter()
            .map(|h| {
                let t = triangles[h as usize / 3];
                let (from, to) = (t[h as usize % 3], t[(h as usize + 1) % 3]);
                (from.min(to), from.max(to), h)
            })
            .collect();
        sides.par_sort_unstable();
        let mut twins = vec![NONE; sides.len()];
        for pair in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let &[(low, high, h), (_, _, g)] = pair else { return None };
            let from = |h: u32| triangles[h as usize / 3][h as usize % 3];
            if low == high || from(h) == from(g) {
                return None;
            }
            (twins[h as usize], twins[g as usize]) = (g, h);
        }
        Some(Self { triangles, twins })
    }

    fn from(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    fn twin(&self, h: u32) -> u32 {
        self.twins[h as usize]
    }

    /// The tile of a centre.
    fn tile(&self, centre: u32) -> Tile {
        let inner = [0, 1, 2].map(|i| self.twin(3 * centre + i));
        let halves = inner.map(|g| [next(g), next(next(g))]);
        Tile { corners: halves.map(|h| self.from(h[1])), outer: inner.map(|g| g / 3), halves }
    }
}

fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}

/// Tiles laid over a surface.
struct Cover<'a> {
    mesh: &'a HalfEdges<'a>,
    positions: &'a [Point],
    /// Centre of the tile that each triangle is in.
    tile_of: Vec<u32>,
    /// Ends, ascending, of the side that each vertex is the middle of; `[NONE; 2]` for others.
    ends: Vec<[u32; 2]>,
    /// Whether a vertex is a tile's corner.
    is_corner: Vec<bool>,
    /// Centres of the tiles laid on the component at hand.
    laid: Vec<u32>,
}

impl<'a> Cover<'a> {
    fn new(mesh: &'a HalfEdges<'a>, positions: &'a [Point]) -> Self {
        Self {
            mesh,
            positions,
            tile_of: vec![NONE; mesh.triangles.len()],
            ends: vec![[NONE; 2]; positions.len()],
            is_corner: vec![false; positions.len()],
            laid: Vec::new(),
        }
    }

    /// Covers the component of a triangle; whether a hypothesis holds.
    fn component(&mut self, seed: u32) -> bool {
        let mut best: Option<(f64, u32)> = None;
        let [a, b, c] = [0, 1, 2].map(|i| self.mesh.twin(3 * seed + i) / 3);
        for centre in [seed, a, b, c] {
            self.laid.clear();
            let off = if self.lay(centre) { self.judge() } else { None };
            if let Some(off) = off.filter(|&off| best.is_none_or(|b| off < b.0)) {
                best = Some((off, centre));
            }
            self.lift();
        }
        self.laid.clear();
        best.is_some_and(|(_, centre)| self.lay(centre))
    }

    /// Lays tiles from a centre on until no side is left free; whether none contradicts another.
    fn lay(&mut self, centre: u32) -> bool {
        if !self.put(centre) {
            return false;
        }
        let mut at = 0;
        while at < self.laid.len() {
            let tile = self.mesh.tile(self.laid[at]);
            for (corner, half) in tile.corners.iter().zip(tile.halves).flat_map(|(c, h)| h.map(|h| (*c, h))) {
                // Beyond a half lies an outer triangle of the next tile, at the same corner; across from that its centre.
                let beyond = self.mesh.twin(half);
                let leaving = if self.mesh.from(beyond) == corner { beyond } else { next(beyond) };
                let centre = self.mesh.twin(next(leaving)) / 3;
                let there = self.tile_of[beyond as usize / 3];
                if there != centre && (there != NONE || !self.put(centre)) {
                    return false;
                }
            }
            at += 1;
        }
        true
    }

    /// Lays one tile if it contradicts none.
    fn put(&mut self, centre: u32) -> bool {
        let Tile { corners, outer, .. } = self.mesh.tile(centre);
        let middles = self.mesh.triangles[centre as usize];
        let all = [centre, outer[0], outer[1], outer[2]];
        let ends = [0, 1, 2].map(|i| sorted([corners[(i + 2) % 3], corners[i]]));
        let apart = differ(&all)
            && differ(&[corners, middles].concat())
            && all.iter().all(|&t| self.tile_of[t as usize] == NONE)
            && corners.iter().all(|&v| self.ends[v as usize] == [NONE; 2]);
        let agree = middles.iter().zip(ends).all(|(&m, ends)| {
            let known = self.ends[m as usize];
            !self.is_corner[m as usize] && (known == [NONE; 2] || known == ends)
        });
        if !(apart && agree) {
            return false;
        }
        for t in all {
            self.tile_of[t as usize] = centre;
        }
        for v in corners {
            self.is_corner[v as usize] = true;
        }
        for (m, ends) in middles.into_iter().zip(ends) {
            self.ends[m as usize] = ends;
        }
        self.laid.push(centre);
        true
    }

    /// Takes the tiles of the component at hand away again.
    fn lift(&mut self) {
        for &centre in &self.laid {
            let Tile { corners, outer, .. } = self.mesh.tile(centre);
            self.tile_of[centre as usize] = NONE;
            for t in outer {
                self.tile_of[t as usize] = NONE;
            }
            for v in corners {
                self.is_corner[v as usize] = false;
            }
            for m in self.mesh.triangles[centre as usize] {
                self.ends[m as usize] = [NONE; 2];
            }
        }
    }

    /// Sum of the squared distances (mm²) of the middles from those of their sides, if the tiles are those of a surface: each
    /// side has one middle and two triangles, and no two triangles are on the same vertices.
    fn judge(&self) -> Option<f64> {
        let (mut sides, mut triples) = (Vec::new(), Vec::new());
        for &centre in &self.laid {
            let corners = self.mesh.tile(centre).corners;
            let middles = self.mesh.triangles[centre as usize];
            sides.extend((0..3).map(|i| (sorted([corners[(i + 2) % 3], corners[i]]), middles[i])));
            let mut triple = corners;
            triple.sort_unstable();
            triples.push(triple);
        }
        sides.sort_unstable();
        triples.sort_unstable();
        let mut off = 0.0;
        for side in sides.chunk_by(|a, b| a.0 == b.0) {
            let &[(ends, m), (_, other)] = side else { return None };
            if m != other {
                return None;
            }
            let [a, b, m] = [ends[0], ends[1], m].map(|v| self.positions[v as usize]);
            off += ((a + b) / 2.0 - m).norm_squared();
        }
        triples.windows(2).all(|w| w[0] != w[1]).then_some(off)
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Whether no two are the same.
fn differ(all: &[u32]) -> bool {
    (1..all.len()).all(|i| !all[..i].contains(&all[i]))
}

#[cfg(test)]
mod tests;
