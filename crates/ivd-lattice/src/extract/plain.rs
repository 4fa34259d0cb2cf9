//! Extraction as one would write it down: every cell in turn, vertices found by their keys.

use std::collections::BTreeMap;

use ivd_core::ElementKey;

use super::Surface;
use super::cell::CENTRE;
use super::place::Cell;
use super::samples::Samples;
use super::table::CASES;

/// The surface of `samples` on a grid of `dims` voxels. `flip` turns every triangle over (left-handed grids).
pub(super) fn extract(samples: &impl Samples, dims: [usize; 3], flip: bool) -> Surface {
    let mut places: BTreeMap<ElementKey, [f32; 3]> = BTreeMap::new();
    let mut triangles: Vec<[ElementKey; 3]> = Vec::new();
    for z in 0..=dims[2] {
        for y in 0..=dims[1] {
            for x in 0..=dims[0] {
                let cell = Cell { dims, first: [x, y, z] };
                let case = cell.case(samples);
                let joined = cell.joined(samples, case, CASES.ambiguous[usize::from(case)]);
                let crossing = CASES.crossing(case, joined);
                for &[a, b, c] in &crossing.triangles {
                    for element in [a, b, c] {
                        places.entry(cell.key(element)).or_insert_with(|| match element {
                            CENTRE => cell.centre_place(samples, &crossing.fan),
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
