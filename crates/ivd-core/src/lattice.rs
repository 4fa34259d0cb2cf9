use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{Buffer, Error, Grid, VoxelCoord, World};

/// Least distance of a stored crossing from the ends of its grid edge, as a fraction of the edge (2⁻¹⁰).
/// It keeps triangles from collapsing where the surface touches a voxel, at the price of ≤ 2⁻¹⁰ voxel of displacement.
pub const MIN_EDGE_FRACTION: f32 = 1.0 / 1024.0;

/// Address of a lattice vertex: an element of the grid padded by one voxel on every side.
///
/// Elements 0, 1, 2 are the edges from the voxel along x, y, z; 3, 4, 5 the faces normal to x, y, z; 6 and 7 the cell, which
/// may have two vertices.
/// The padded voxel `p` is the voxel `p - 1`, so that a surface closed one layer outside the volume has addresses.
/// This is the thesis's internal index relation (IIR): it names the voxel a vertex belongs to and survives refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct ElementKey(pub u64);

impl ElementKey {
    /// Key of element `element` (0…7) at padded voxel `padded` (each 0 … n + 1) of a grid of `dims` voxels.
    #[inline]
    pub fn new(dims: [usize; 3], padded: [usize; 3], element: u8) -> Self {
        let [px, py] = [dims[0] as u64 + 2, dims[1] as u64 + 2];
        let voxel = padded[0] as u64 + px * (padded[1] as u64 + py * padded[2] as u64);
        Self(voxel * 8 + u64::from(element))
    }

    /// The element: 0…2 edge, 3…5 face, 6 and 7 cell.
    #[inline]
    pub fn element(self) -> u8 {
        (self.0 & 7) as u8
    }

    /// The padded voxel.
    #[inline]
    pub fn padded(self, dims: [usize; 3]) -> [usize; 3] {
        let [px, py] = [dims[0] as u64 + 2, dims[1] as u64 + 2];
        let voxel = self.0 >> 3;
        // Of numbers that fit, the shorter division is the same and takes a fraction of the time.
        if (voxel | px | py) >> 32 == 0 {
            let (voxel, px, py) = (voxel as u32, px as u32, py as u32);
            let row = voxel / px;
            return [voxel % px, row % py, row / py].map(|p| p as usize);
        }
        let row = voxel / px;
        [voxel % px, row % py, row / py].map(|p| p as usize)
    }

    /// The voxel that the element starts from; −1 and n lie in the border layer.
    #[inline]
    pub fn voxel(self, dims: [usize; 3]) -> [i64; 3] {
        self.padded(dims).map(|p| p as i64 - 1)
    }
}

/// How a lattice was cut, kept for reports.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum LatticeSource {
    /// The surface where the real value is `iso`; inside is above.
    Iso(f64),
    /// The surface of the real values between `lower` and `upper`; a missing end is open.
    Interval {
        /// Lower crossing.
        lower: Option<f64>,
        /// Upper crossing.
        upper: Option<f64>,
    },
    /// The border of a mask or of its level function.
    Mask,
    /// Not cut from a volume: another program's mesh, put on the grid.
    Foreign,
}

/// A model-fitting lattice: a closed triangle mesh whose every vertex lies on an element of a grid.
///
/// Positions are not stored: vertex `i` is at voxel coordinate `key.voxel + place`, so that an origin 10⁶ mm away
/// costs no precision. Refinement keeps a subset of the vertices with unchanged keys and places.
/// Triangles are counter-clockwise seen from outside (in world space, whatever the handedness of the grid).
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    grid: Grid,
    source: LatticeSource,
    keys: Buffer<ElementKey>,
    places: Buffer<[f32; 3]>,
    triangles: Buffer<[u32; 3]>,
    level: u8,
    max_error_mm: f64,
    coarser: Vec<CoarseLevel>,
}

/// A coarser level of a lattice, in the numbers of its vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct CoarseLevel {
    /// Vertex indices of each triangle.
    pub triangles: Buffer<[u32; 3]>,
    /// As [`Lattice::level`].
    pub level: u8,
    /// As [`Lattice::max_error_mm`].
    pub max_error_mm: f64,
}

impl Lattice {
    /// A lattice of another program's making ([`LatticeSource::Foreign`]) on the grid, at level 0: vertices as in [`Lattice::keys`] and
    /// [`Lattice::places`], triangles as in [`Lattice::triangles`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first thing that doesn't fit: lengths, the order of keys, a key beyond the padded grid, a
    /// place outside 0…1, a triangle of a vertex that isn't there.
    pub fn new(
        grid: Grid,
        keys: Buffer<ElementKey>,
        places: Buffer<[f32; 3]>,
        triangles: Buffer<[u32; 3]>,
    ) -> Result<Self, Error> {
        check_vertices(&grid, &keys, &places)?;
        check_corners(&triangles, keys.len(), "")?;
        let (source, level, max_error_mm, coarser) = (LatticeSource::Foreign, 0, 0.0, Vec::new());
        Ok(Self { grid, source, keys, places, triangles, level, max_error_mm, coarser })
    }

    /// Cut in another way: see [`Lattice::source`].
    #[must_use]
    pub fn with_source(self, source: LatticeSource) -> Self {
        Self { source, ..self }
    }

    /// At another level: see [`Lattice::level`].
    #[must_use]
    pub fn with_level(self, level: u8) -> Self {
        Self { level, ..self }
    }

    /// With another bound: see [`Lattice::max_error_mm`].
    #[must_use]
    pub fn with_max_error_mm(self, max_error_mm: f64) -> Self {
        Self { max_error_mm, ..self }
    }

    /// With coarser levels: see [`Lattice::coarser`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first triangle of a vertex that isn't there.
    pub fn with_coarser(self, coarser: Vec<CoarseLevel>) -> Result<Self, Error> {
        for (k, level) in coarser.iter().enumerate() {
            check_corners(&level.triangles, self.keys.len(), &format!(" of coarser level {k}"))?;
        }
        Ok(Self { coarser, ..self })
    }

    /// The same vertices under other triangles.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first triangle of a vertex that isn't there.
    pub fn with_triangles(self, triangles: Buffer<[u32; 3]>) -> Result<Self, Error> {
        check_corners(&triangles, self.keys.len(), "")?;
        Ok(Self { triangles, ..self })
    }

    /// Some of its vertices, ascending, and triangles between them in this lattice's numbers; without coarser levels.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where the vertices don't ascend or a triangle names another.
    ///
    /// # Panics
    /// Where there is no such vertex.
    pub fn subset(&self, kept: &[u32], mut triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        let mut rank = vec![u32::MAX; self.keys.len()];
        for (new, &old) in kept.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        for corner in triangles.as_flattened_mut() {
            *corner = rank.get(*corner as usize).copied().unwrap_or(u32::MAX);
        }
        let (keys, places) = (self.keys(), self.places());
        let part = Self::new(
            self.grid.clone(),
            kept.iter().map(|&v| keys[v as usize]).collect(),
            kept.iter().map(|&v| places[v as usize]).collect(),
            triangles.into(),
        )?;
        let part = part.with_source(self.source.clone());
        Ok(part.with_level(self.level).with_max_error_mm(self.max_error_mm))
    }

    /// Keys, places and triangles, to be used again.
    pub fn into_parts(self) -> (Buffer<ElementKey>, Buffer<[f32; 3]>, Buffer<[u32; 3]>) {
        (self.keys, self.places, self.triangles)
    }

    /// The grid it was cut from.
    #[inline]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// How it was cut.
    pub fn source(&self) -> &LatticeSource {
        &self.source
    }

    /// Address of each vertex, strictly ascending.
    #[inline]
    pub fn keys(&self) -> &[ElementKey] {
        &self.keys
    }

    /// Offset of each vertex from its key's voxel (voxels), 0 ≤ p < 1. In an extracted lattice, on an edge only its own axis
    /// is not 0 and lies in `[MIN_EDGE_FRACTION, 1 - MIN_EDGE_FRACTION]`; in a foreign one the element is no more than the nearest free one.
    #[inline]
    pub fn places(&self) -> &[[f32; 3]] {
        &self.places
    }

    /// Vertex indices of each triangle.
    #[inline]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Refinement level: about a quarter of the vertices is kept per level; 0 as extracted.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Bound on the distance to the extracted lattice (mm); 0 at level 0.
    pub fn max_error_mm(&self) -> f64 {
        self.max_error_mm
    }

    /// Coarser levels on the same vertices, each on a subset of those of the one before: a viewer switches between them.
    /// Empty for most.
    pub fn coarser(&self) -> &[CoarseLevel] {
        &self.coarser
    }

    /// Number of levels, this one included.
    pub fn levels(&self) -> usize {
        self.coarser.len() + 1
    }

    /// A level as a lattice of its own, 0 this one; `None` beyond the last.
    pub fn at_level(&self, level: usize) -> Option<Self> {
        let Some(at) = level.checked_sub(1) else {
            return Some(Self { coarser: Vec::new(), ..self.clone() });
        };
        let CoarseLevel { triangles, level: own, max_error_mm } = self.coarser.get(at)?;
        let part = self.subset(&self.vertices_at_level(level), triangles.to_vec());
        let part = part.expect("the level's vertices ascend, and its triangles name no other");
        Some(part.with_level(*own).with_max_error_mm(*max_error_mm))
    }

    /// Vertices of a level, ascending: those that its triangles name, and those that no triangle of the finest names.
    /// Empty beyond the last level.
    pub fn vertices_at_level(&self, level: usize) -> Vec<u32> {
        let mut named = vec![true; self.keys.len()];
        if let Some(at) = level.checked_sub(1) {
            let Some(coarser) = self.coarser.get(at) else { return Vec::new() };
            for &v in self.triangles.as_flattened() {
                named[v as usize] = false;
            }
            for &v in coarser.triangles.as_flattened() {
                named[v as usize] = true;
            }
        }
        (0..named.len() as u32).filter(|&v| named[v as usize]).collect()
    }

    /// Voxel coordinate of vertex `i`.
    #[inline]
    pub fn voxel(&self, i: usize) -> VoxelCoord {
        voxel(self.keys[i], self.places[i], self.grid.dims())
    }

    /// World position of vertex `i` (mm).
    pub fn world(&self, i: usize) -> World {
        self.grid.world(self.voxel(i))
    }

    /// World positions (mm) of all vertices, shape `[vertex_count, 3]`.
    pub fn positions(&self) -> Vec<Vector3<f64>> {
        use rayon::prelude::*;
        let (linear, origin, dims) =
            (self.grid.linear_part(), Vector3::from(self.grid.origin()), self.grid.dims());
        let vertices = self.keys().par_iter().zip(self.places());
        vertices.map(|(&key, &place)| origin + linear * voxel(key, place, dims).0).collect()
    }

    /// World positions (mm) relative to the grid's origin: exact differences even 10⁶ mm away from 0.
    pub fn local_positions(&self) -> Vec<Vector3<f64>> {
        use rayon::prelude::*;
        let (linear, dims) = (self.grid.linear_part(), self.grid.dims());
        let vertices = self.keys().par_iter().zip(self.places());
        vertices.map(|(&key, &place)| linear * voxel(key, place, dims).0).collect()
    }

    /// The vertex at an address, by binary search.
    pub fn vertex_at(&self, key: ElementKey) -> Option<u32> {
        self.keys.binary_search(&key).ok().map(|i| i as u32)
    }
}

/// Voxel coordinate of a vertex.
#[inline]
fn voxel(key: ElementKey, place: [f32; 3], dims: [usize; 3]) -> VoxelCoord {
    let v = key.voxel(dims);
    VoxelCoord(Vector3::from_fn(|a, _| v[a] as f64 + f64::from(place[a])))
}

/// Values looked at as one piece: without an early end within it the compiler looks at several at a time.
const PIECE: usize = 1 << 14;

/// Checks lengths, the order of keys, and that keys and places lie where they may.
fn check_vertices(grid: &Grid, keys: &[ElementKey], places: &[[f32; 3]]) -> Result<(), Error> {
    use rayon::prelude::*;
    let bad = |problem: String| Err(Error::Inconsistent { what: "lattice", problem });
    if keys.len() != places.len() {
        return bad(format!("{} keys, {} places", keys.len(), places.len()));
    }
    let next = keys.get(1..).unwrap_or_default();
    let ascends = |(a, b): (&[ElementKey], &[ElementKey])| {
        a.iter().zip(b).fold(0, |falls, (this, next)| falls + u32::from(this >= next)) == 0
    };
    let before = &keys[..next.len()];
    if !before.par_chunks(PIECE).zip(next.par_chunks(PIECE)).all(ascends) {
        let i = keys.windows(2).position(|w| w[0] >= w[1]).unwrap_or_default();
        return bad(format!("keys of vertices {i} and {} are not ascending", i + 1));
    }
    let padded: u64 = grid.dims().iter().map(|&d| d as u64 + 2).product();
    if keys.last().is_some_and(|k| k.0 >= padded * 8) {
        return bad("a key lies outside the padded grid".into());
    }
    let within = |c: &f32| (0.0..=1.0).contains(c);
    let sound = |values: &[f32]| values.iter().fold(true, |all, c| all & within(c));
    if !places.as_flattened().par_chunks(PIECE).all(sound) {
        let i = places.iter().position(|p| !p.iter().all(within)).unwrap_or_default();
        return bad(format!("place of vertex {i} leaves 0…1"));
    }
    Ok(())
}

/// Checks that triangles name vertices that are there; `whose` says which triangles they are.
fn check_corners(triangles: &[[u32; 3]], vertices: usize, whose: &str) -> Result<(), Error> {
    use rayon::prelude::*;
    let named = |corners: &[u32]| (corners.iter().fold(0, |most, &v| v.max(most)) as usize) < vertices;
    if triangles.as_flattened().par_chunks(PIECE).all(named) {
        return Ok(());
    }
    let i = triangles.iter().position(|t| !named(t)).unwrap_or_default();
    let problem = format!("triangle {i}{whose} names a vertex beyond {vertices}");
    Err(Error::Inconsistent { what: "lattice", problem })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_out_of_order_or_place_and_triangles_of_no_vertex_are_refused_by_number() {
        let grid = Grid::with_spacing([3; 3], [1.0; 3]).unwrap();
        let key = |x| ElementKey::new([3; 3], [x, 1, 1], 6);
        let made = |keys: &[ElementKey], places: &[[f32; 3]], triangles: &[[u32; 3]]| {
            Lattice::new(
                grid.clone(),
                keys.to_vec().into(),
                places.to_vec().into(),
                triangles.to_vec().into(),
            )
        };
        let refused = |made: Result<Lattice, Error>, part: &str| {
            let error = made.unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        let (keys, places) = ([key(1), key(2), key(3)], [[0.0, 0.5, 1.0]; 3]);
        refused(made(&keys, &places[..2], &[]), "3 keys, 2 places");
        refused(made(&[key(1), key(3), key(3)], &places, &[]), "vertices 1 and 2");
        refused(made(&[key(1), key(2), ElementKey(1000)], &places, &[]), "padded grid");
        for bad in [-0.1, 1.5, f32::NAN] {
            refused(made(&keys, &[places[0], places[0], [0.0, bad, 0.0]], &[]), "place of vertex 2");
        }
        refused(made(&keys, &places, &[[0, 1, 2], [0, 3, 1]]), "triangle 1 names");
        let whole = made(&keys, &places, &[[0, 1, 2]]).unwrap();
        let level =
            |triangles: Vec<_>| CoarseLevel { triangles: triangles.into(), level: 1, max_error_mm: 0.5 };
        let levels = vec![level(vec![]), level(vec![[0, 0, 7]])];
        refused(whole.clone().with_coarser(levels), "triangle 0 of coarser level 1");
        refused(whole.subset(&[0, 2], vec![[0, 2, 1]]), "triangle 0 names");
        refused(whole.subset(&[2, 0], vec![]), "ascending");
        let part = whole.with_level(2).subset(&[0, 2], vec![[0, 2, 2]]).unwrap();
        assert_eq!(
            (part.keys(), part.triangles(), part.level()),
            (&[key(1), key(3)][..], &[[0, 1, 1]][..], 2)
        );
    }

    #[test]
    fn keys_name_voxel_and_element_up_to_the_far_border() {
        let dims = [5, 6, 7];
        for padded in [[0, 0, 0], [6, 7, 8], [3, 0, 8]] {
            for element in 0..8 {
                let key = ElementKey::new(dims, padded, element);
                assert_eq!((key.padded(dims), key.element()), (padded, element));
            }
        }
        assert_eq!(ElementKey::new(dims, [0, 1, 2], 3).voxel(dims), [-1, 0, 1]);
    }
}
