//! Where the slices cut the surface that moves.

use std::sync::Arc;

use ivd_core::Lattice;
use ivd_report::Plane;
use nalgebra::{Matrix3, Vector3};

use super::Model;
use crate::{Pane, Shows};

/// The line in which a slice cuts the surface: its pieces, each from one place to another, as shares of the pane.
pub type Outline = Arc<[[[f32; 2]; 2]]>;

/// The slices' lines, each kept for as long as it is right.
#[derive(Default)]
pub(crate) struct Outlines([(Option<Key>, Outline); 3]);

/// What a line hangs on: the version of its slice's picture, the level, and whether the surface is at rest.
type Key = (u64, u8, bool);

impl Outlines {
    /// The lines as they are now.
    pub(crate) fn update(&mut self, model: &Model) -> [Outline; 3] {
        if model.outlines {
            self.bring_up_to_date(model);
        }
        self.0.each_ref().map(|(_, outline)| outline.clone())
    }

    fn bring_up_to_date(&mut self, model: &Model) {
        let mut places = None;
        let at_rest = model.compared.shows == Shows::Rest;
        for (slice, (known, outline)) in self.0.iter_mut().enumerate() {
            let key = (model.versions[slice + 1], model.session.settings().level, at_rest);
            if *known == Some(key) {
                continue;
            }
            let lattice = model.session.lattice();
            let planes = &model.panes.planes;
            let dims = lattice.grid().dims();
            let Some(plane) = planes.plane(Pane::ALL[slice + 1]) else { continue };
            let moved = if at_rest { None } else { model.moved() };
            let places = places.get_or_insert_with(|| places_of(lattice, moved));
            *outline = cut(plane, dims, planes.slice(plane, dims), places, lattice.triangles()).into();
            *known = Some(key);
        }
    }
}

impl Model {
    /// Frames have the line in which each slice cuts the surface from now on.
    pub fn outline(&mut self) {
        self.outlines = true;
    }
}

/// Where the vertices lie (voxel coordinates).
///
/// - `moved`: how far each has gone (mm), where any has.
fn places_of(lattice: &Lattice, moved: Option<&[[f64; 3]]>) -> Vec<Vector3<f64>> {
    let to_voxels: Matrix3<f64> = lattice.grid().inverse_linear_part();
    let place = |v: usize| {
        let gone = moved.map_or_else(Vector3::zeros, |moved| to_voxels * Vector3::from(moved[v]));
        lattice.voxel(v).0 + gone
    };
    (0..lattice.keys().len()).map(place).collect()
}

/// The pieces of the line in which the slice at `at` (a voxel of the axis that the plane cuts) cuts triangles. A vertex in the slice counts as above it, so that
/// the line of a closed surface is closed.
fn cut(
    plane: &Plane,
    dims: [usize; 3],
    at: usize,
    places: &[Vector3<f64>],
    triangles: &[[u32; 3]],
) -> Vec<[[f32; 2]; 2]> {
    let (axis, at) = (plane.cut(), at as f64);
    let cut = |triangle: &[u32; 3]| {
        let corners = triangle.map(|v| places[v as usize]);
        let mut ends = [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(a, b)| {
            let [a, b] = [corners[a], corners[b]];
            let is_cut = (a[axis] >= at) != (b[axis] >= at);
            is_cut.then(|| {
                let place = a + (b - a) * ((at - a[axis]) / (b[axis] - a[axis]));
                plane.place(dims, place.into()).map(|c| c as f32)
            })
        });
        Some([ends.next()?, ends.next()?])
    };
    triangles.iter().filter_map(cut).collect()
}

#[cfg(test)]
mod tests {
    use ivd_core::{Exec, Grid, Volume};
    use ivd_lattice::extract::{ExtractParams, Iso, extract};
    use ivd_report::planes;

    use super::*;

    #[test]
    fn the_lines_of_a_ball_are_closed_circles_that_go_with_it() {
        // Voxels 2 mm long along z; a ball of 9 mm about 12, 11, 10 mm.
        let grid = Grid::with_spacing([24, 22, 11], [1.0, 1.0, 2.0]).unwrap();
        let far = |i: usize| {
            let [x, y, z] = grid.index(i).0.map(|c| c as f64);
            (Vector3::new(x, y, 2.0 * z) - Vector3::new(12.0, 11.0, 10.0)).norm()
        };
        let voxels: Vec<f32> = (0..grid.len()).map(|i| (9.0 - far(i)) as f32).collect();
        let volume = Volume::new(grid.clone(), voxels.into()).unwrap();
        let lattice = extract(&volume, None, &ExtractParams { iso: Iso::Value(0.0) }, &Exec::default())
            .unwrap()
            .lattice;
        let moved = vec![[2.0, 0.0, 4.0]; lattice.keys().len()];
        for (by, moved) in [([0.0; 3], None), ([2.0, 0.0, 4.0], Some(&moved[..]))] {
            let places = places_of(&lattice, moved);
            for plane in planes(&grid) {
                let at = [13, 11, 6][plane.cut()];
                let pieces = cut(&plane, grid.dims(), at, &places, lattice.triangles());
                assert!(pieces.len() > 20, "{}", pieces.len());
                let mut ends: Vec<[i32; 2]> =
                    pieces.iter().flatten().map(|end| end.map(|c| (1e5 * c).round() as i32)).collect();
                ends.sort_unstable();
                assert!(
                    ends.chunks(2)
                        .all(|two| two.len() == 2 && (0..2).all(|a| (two[0][a] - two[1][a]).abs() < 3))
                );
                for end in pieces.iter().flatten() {
                    let voxel = plane.voxel(grid.dims(), at as f64, end.map(f64::from));
                    let place = Vector3::new(voxel[0], voxel[1], 2.0 * voxel[2]);
                    let far = (place - Vector3::from(by) - Vector3::new(12.0, 11.0, 10.0)).norm();
                    assert!((far - 9.0).abs() < 0.15, "{far}");
                }
            }
        }
    }
}
