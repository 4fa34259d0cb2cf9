//! A cut as plain data: for backends other than the processor.

use ivd_core::{ElementKey, Exec, Kernel, Volume, parallel};

use super::place::Cell;
use super::samples::Samples;
pub use super::surface::Surface;
use super::table::{CASES, CrossingId};
use crate::Error;

/// Vertices whose places one task works out.
const CHUNK: usize = 1 << 14;
/// Words of a case in [`Cut::cases`].
pub const CASE_WORDS: usize = 4;
/// The first word of a case whose signs leave open how the surface crosses the cell.
pub const OPEN: u32 = 0x100;

/// The pass that makes the surface between voxels inside and outside, and puts its vertices in place.
pub struct Cutting;

impl Kernel for Cutting {
    const NAME: &'static str = "lattice/cut";
    type Args<'a> = Cut<'a>;
    type Out = Surface;
    type Error = Error;

    fn on_processor(cut: &Cut<'_>, exec: &Exec) -> Result<Surface, Error> {
        (cut.on_processor)(exec)
    }
}

/// Where the voxels' signs come from.
#[derive(Clone, Copy)]
pub enum Signs<'a> {
    /// Of the stored values `first ..= last` are inside, none where `first` is the greater.
    Stored {
        /// What is cut.
        volume: &'a Volume,
        /// Smallest stored value inside.
        first: f64,
        /// Largest stored value inside.
        last: f64,
    },
    /// They are read already: rows of words, `n + 2` rows a layer and as many layers. Bit p of a row is the padded voxel p; the last word of a
    /// row is 0.
    Read {
        /// Words a row.
        words: usize,
        /// All rows.
        rows: &'a [u32],
    },
}

/// What is cut.
pub struct Cut<'a> {
    /// Voxels along each axis.
    pub dims: [usize; 3],
    /// Whether every triangle is turned over: on grids that are left-handed.
    pub flip: bool,
    /// Which voxels are inside.
    pub signs: Signs<'a>,
    pub(super) field: &'a dyn Field,
    pub(super) on_processor: &'a dyn Fn(&Exec) -> Result<Surface, Error>,
}

/// A cell whose signs leave open how the surface crosses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpenCell {
    /// The padded voxel at its first corner.
    pub padded: [usize; 3],
    /// Its corners' signs.
    pub case: u8,
}

/// How the surface crosses an open cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decided {
    /// Vertices of its own.
    pub own: u32,
    /// The crossing, of those in [`Cut::crossings`].
    pub crossing: u16,
}

/// What only the field's values tell.
pub(super) trait Field {
    fn crossing(&self, cell: &OpenCell) -> CrossingId;
    fn places(
        &self,
        keys: &[ElementKey],
        places: &mut [[f32; 3]],
        own: &[(u64, CrossingId)],
        exec: &Exec,
    ) -> Result<(), ivd_core::Error>;
}

/// Samples on a grid.
pub(super) struct Sampled<'a, S> {
    pub(super) samples: &'a S,
    pub(super) dims: [usize; 3],
}

impl<S: Samples> Field for Sampled<'_, S> {
    fn crossing(&self, cell: &OpenCell) -> CrossingId {
        Cell { dims: self.dims, first: cell.padded }.crossing(self.samples, cell.case)
    }

    fn places(
        &self,
        keys: &[ElementKey],
        places: &mut [[f32; 3]],
        own: &[(u64, CrossingId)],
        exec: &Exec,
    ) -> Result<(), ivd_core::Error> {
        // The first edge of a cell along each axis starts at its first corner.
        const FIRST: [u8; 3] = [0, 4, 8];
        parallel::try_map_pieces_mut(places, CHUNK, &|i, places| {
            exec.check_cancelled()?;
            for (key, place) in keys[i * CHUNK..].iter().zip(places) {
                let cell = Cell { dims: self.dims, first: key.padded(self.dims) };
                let element = usize::from(key.element());
                *place = [0.0; 3];
                if element < 3 {
                    place[element] = cell.fraction(self.samples, FIRST[element]);
                } else if let Ok(at) = own.binary_search_by_key(&(key.0 >> 3), |(voxel, _)| *voxel) {
                    *place = cell.centre_place(self.samples, &CASES.fans(own[at].1)[element - 6]);
                }
            }
            Ok::<_, ivd_core::Error>(())
        })
        .map(|_| ())
    }
}

impl Cut<'_> {
    /// Of each case [`CASE_WORDS`] words: how many triangles it has, or [`OPEN`]; their corners, four bits each, eight a word. A corner is one of the cell's
    /// twelve edges.
    pub fn cases(&self) -> Vec<u32> {
        let words = |case: u8| match CASES.simple[usize::from(self.flip)].get(case) {
            None => [OPEN, 0, 0, 0],
            Some(simple) => {
                let corners = simple.triangles.as_flattened().iter().enumerate();
                let packed =
                    corners.fold(0_u64, |packed, (k, corner)| packed | u64::from(*corner) << (4 * k));
                [u32::from(simple.count), packed as u32, (packed >> 32) as u32, 0]
            }
        };
        (0..=255).flat_map(words).collect()
    }

    /// Of each crossing of an open cell where its triangles begin (24 bits), and how many they are (the 8 below); and the triangles, four bits a corner: the
    /// cell's edges, then its own vertices.
    pub fn crossings(&self) -> [Vec<u32>; 2] {
        let (mut spans, mut packed) = (Vec::new(), Vec::new());
        for id in CASES.all() {
            let triangles = CASES.triangles(id);
            spans.push((packed.len() << 8 | triangles.len()) as u32);
            packed.extend(triangles.iter().map(|&[a, b, c]| {
                let [a, b, c] = if self.flip { [a, c, b] } else { [a, b, c] }.map(u32::from);
                a | b << 4 | c << 8
            }));
        }
        [spans, packed]
    }

    /// How the surface crosses cells that their signs leave open.
    pub fn decide(&self, cells: &[OpenCell]) -> Vec<Decided> {
        let decide = |cell: &OpenCell| {
            let id = self.field.crossing(cell);
            Decided { own: CASES.fans(id).len() as u32, crossing: id.number() }
        };
        cells.iter().map(decide).collect()
    }

    /// The surface of these vertices and triangles, with the vertices in their places; the cells are the open ones, in order.
    ///
    /// # Errors
    /// The memory limit; cancellation.
    pub fn finish(
        &self,
        keys: Vec<u64>,
        triangles: Vec<[u32; 3]>,
        cells: &[(OpenCell, Decided)],
        exec: &Exec,
    ) -> Result<Surface, ivd_core::Error> {
        exec.check_memory("the lattice", (20 * keys.len() + 12 * triangles.len()) as u64)?;
        let keys: Vec<ElementKey> = bytemuck::cast_vec(keys);
        let mut places = vec![[0.0; 3]; keys.len()];
        let with_own = cells.iter().filter(|(_, decided)| decided.own > 0);
        let voxel = |cell: &OpenCell| ElementKey::new(self.dims, cell.padded, 0).0 >> 3;
        let own: Vec<(u64, CrossingId)> =
            with_own.map(|(cell, decided)| (voxel(cell), CrossingId::numbered(decided.crossing))).collect();
        self.field.places(&keys, &mut places, &own, exec)?;
        Ok(Surface { keys, places, triangles })
    }
}

#[cfg(test)]
mod tests {
    use super::super::bounds::Bounds;
    use super::super::cell::{CENTRE, EDGES};
    use super::super::params::Iso;
    use super::super::{plain, samples};
    use super::*;
    use ivd_core::Grid;

    #[test]
    fn vertices_are_put_in_place_by_their_keys_alone() {
        let grid = Grid::with_spacing([9, 8, 7], [1.0; 3]).unwrap();
        let noise = |i: usize| (i.wrapping_mul(2_654_435_761) >> 9) as u8;
        let voxels: Vec<u8> = (0..grid.len()).map(noise).collect();
        let volume = Volume::new(grid.clone(), voxels.clone().into()).unwrap();
        let samples = samples::Field { voxels: &voxels, bounds: Bounds::new(&volume, &Iso::Value(120.0)) };
        let dims = grid.dims();
        let expected = plain::extract(&samples, dims, false);
        let field = Sampled { samples: &samples, dims };
        let mut own = Vec::new();
        for key in expected.keys.iter().filter(|key| key.element() == 6) {
            let padded = key.padded(dims);
            let cell = Cell { dims, first: padded };
            let inside = |corner: u8| cell.voxel(corner).is_some_and(|v| voxels[v] >= 120);
            let case = (0..8).fold(0, |case, corner| case | u8::from(inside(corner)) << corner);
            own.push((key.0 >> 3, field.crossing(&OpenCell { padded, case })));
        }
        assert!(own.len() > 8, "{}", own.len());
        let mut places = vec![[0.0; 3]; expected.keys.len()];
        field.places(&expected.keys, &mut places, &own, &Exec::default()).unwrap();
        assert_eq!(places, expected.places);
    }

    #[test]
    fn the_first_edges_of_a_cell_start_at_its_first_corner() {
        for (edge, end) in [(0, 1), (4, 2), (8, 4)] {
            assert_eq!(EDGES[edge], [0, end]);
        }
        assert_eq!(CENTRE, 12, "a cell's own vertices come after its edges");
        assert!(CASES.all().count() <= 1024, "shaders have room for so many");
    }
}
