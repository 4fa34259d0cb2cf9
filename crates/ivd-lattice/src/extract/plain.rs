//! Extraction as one would write it down: every cell in turn, vertices found by their keys.

use std::collections::BTreeMap;

use ivd_core::ElementKey;

use super::cell::{self, CENTRE, CENTRES, EDGES};
use super::place::Cell;
use super::samples::Samples;
use super::surface::Surface;
use super::table::CASES;

/// The surface of `samples` on a grid of `dims` voxels. `flip` turns every triangle over (left-handed grids).
pub(super) fn extract(samples: &impl Samples, dims: [usize; 3], flip: bool) -> Surface {
    let mut places: BTreeMap<ElementKey, [f32; 3]> = BTreeMap::new();
    let mut triangles: Vec<[ElementKey; 3]> = Vec::new();
    for z in 0..=dims[2] {
        for y in 0..=dims[1] {
            for x in 0..=dims[0] {
                let cell = Cell { dims, first: [x, y, z] };
                let id = cell.crossing(samples, cell.case(samples));
                for &[a, b, c] in CASES.triangles(id) {
                    for element in [a, b, c] {
                        places.entry(cell.key(element)).or_insert_with(|| match element {
                            centre if CENTRES.contains(&centre) => {
                                cell.centre_place(samples, &CASES.fans(id)[usize::from(centre - CENTRE)])
                            }
                            edge => cell.edge_place(samples, edge),
                        });
                    }
                    triangles.push((if flip { [a, c, b] } else { [a, b, c] }).map(|e| cell.key(e)));
                }
            }
        }
    }
    let keys: Vec<ElementKey> = places.keys().copied().collect();
    let index = |key: ElementKey| keys.binary_search(&key).expect("every corner was entered") as u32;
    let triangles = triangles.into_iter().map(|t| t.map(index)).collect();
    Surface { keys, places: places.into_values().collect(), triangles }
}

impl Cell {
    /// Signs of the eight corners, a bit each, set inside.
    fn case(&self, samples: &impl Samples) -> u8 {
        (0..8).fold(0, |case, corner| {
            case | u8::from(self.voxel(corner).is_some_and(|v| samples.inside(v))) << corner
        })
    }

    /// Address of a vertex of this cell: that of a crossed edge, or of the cell itself.
    fn key(&self, element: u8) -> ElementKey {
        if CENTRES.contains(&element) {
            return ElementKey::new(self.dims, self.first, 6 + element - CENTRE);
        }
        let low = EDGES[usize::from(element)][0];
        ElementKey::new(self.dims, self.padded(low), cell::axis(element) as u8)
    }

    /// Offset of a crossed edge's vertex from its own voxel.
    fn edge_place(&self, samples: &impl Samples, edge: u8) -> [f32; 3] {
        let mut place = [0.0; 3];
        place[cell::axis(edge)] = self.fraction(samples, edge);
        place
    }
}
