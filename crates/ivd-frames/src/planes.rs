//! Three slices that meet at a place.

use ivd_core::{Grid, Image, Volume, VoxelCoord, VoxelIndex, World};
use ivd_report::{Plane, planes};
use nalgebra::Vector3;

use crate::colours::Window;
use crate::figures::Slice;
use crate::{Error, Pane};

/// A place lies in a slice up to so many slices beside it, and isn't hidden in the volume up to so many voxels behind what is seen.
pub(crate) const BESIDE: f64 = 2.0;

/// The planes of the slices' panes, and where they meet.
#[derive(Debug, Clone)]
pub(crate) struct Planes {
    planes: [Plane; 3],
    /// Where they meet (voxel coordinates); each shows the voxels nearest to it.
    pub(crate) cross: [f64; 3],
}

impl Planes {
    /// They meet in the middle.
    pub(crate) fn new(grid: &Grid) -> Self {
        Self { planes: planes(grid), cross: grid.dims().map(|n| (n / 2) as f64) }
    }

    /// The plane of a slice's pane.
    pub(crate) fn plane(&self, pane: Pane) -> Option<&Plane> {
        pane.number().checked_sub(1).and_then(|number| self.planes.get(number))
    }

    /// The voxel of the cut axis that a slice shows.
    pub(crate) fn slice(&self, plane: &Plane, dims: [usize; 3]) -> usize {
        (self.cross[plane.cut()].round().max(0.0) as usize).min(dims[plane.cut()] - 1)
    }

    /// The slices: their panes, the axis of the grid that each cuts, and where.
    pub(crate) fn slices(&self, dims: [usize; 3]) -> [(Pane, usize, usize); 3] {
        [0, 1, 2].map(|n| (Pane::ALL[n + 1], self.planes[n].cut(), self.slice(&self.planes[n], dims)))
    }

    /// Goes through the slices of a pane.
    pub(crate) fn step(&mut self, pane: Pane, steps: i32, dims: [usize; 3]) -> Result<(), Error> {
        let plane = *self.plane(pane).ok_or_else(|| Error::Request {
            what: "slice",
            problem: "the volume's pane has no slices".into(),
            remedy: "name another",
        })?;
        let last = (dims[plane.cut()] - 1) as f64;
        let place = self.cross[plane.cut()].round() + f64::from(steps);
        self.cross[plane.cut()] = place.clamp(0.0, last);
        Ok(())
    }

    /// Lets them meet at a place (mm, RAS); gives the panes that show another slice then.
    pub(crate) fn meet(&mut self, place: [f64; 3], grid: &Grid) -> Vec<Pane> {
        let VoxelCoord(voxel) = grid.voxel(World(place.into()));
        let before = self.slices(grid.dims());
        self.cross = std::array::from_fn(|a| voxel[a].clamp(0.0, (grid.dims()[a] - 1) as f64));
        let after = self.slices(grid.dims());
        before.iter().zip(after).filter(|(a, b)| **a != *b).map(|(_, b)| b.0).collect()
    }

    /// Where they meet (mm, RAS).
    pub(crate) fn place(&self, grid: &Grid) -> [f64; 3] {
        let World(place) = grid.world(VoxelCoord(self.cross.into()));
        place.into()
    }

    /// The place that a slice shows at a share of its pane (mm, RAS); `None` beside the volume, and in the volume's own pane.
    pub(crate) fn look(&self, pane: Pane, at: [f64; 2], grid: &Grid) -> Option<[f64; 3]> {
        let plane = self.plane(pane)?;
        let voxel = plane.voxel(grid.dims(), self.cross[plane.cut()], at);
        let inside = (0..3).all(|a| (-0.5..grid.dims()[a] as f64 - 0.5).contains(&voxel[a]));
        inside.then(|| grid.world(VoxelCoord(voxel.into())).0.into())
    }

    /// Where a slice's pane shows a place, as shares of it.
    pub(crate) fn share(&self, pane: Pane, grid: &Grid, place: [f64; 3]) -> Option<[f64; 2]> {
        let VoxelCoord(voxel) = grid.voxel(World(place.into()));
        self.plane(pane).map(|plane| plane.place(grid.dims(), voxel.into()))
    }

    /// How many slices a place lies before or behind each slice.
    pub(crate) fn off(&self, grid: &Grid, place: [f64; 3]) -> [f64; 3] {
        let VoxelCoord(voxel) = grid.voxel(World(place.into()));
        self.planes.map(|plane| voxel[plane.cut()] - self.slice(&plane, grid.dims()) as f64)
    }

    /// Which panes' slices any of the places lies beside; of the volume's pane nothing is said.
    pub(crate) fn beside(&self, grid: &Grid, places: &[[f64; 3]]) -> [bool; 4] {
        let off: Vec<_> = places.iter().map(|place| self.off(grid, *place)).collect();
        let is_beside = |slice: usize| off.iter().any(|off| off[slice].abs() > BESIDE);
        [false, is_beside(0), is_beside(1), is_beside(2)]
    }

    /// Which panes' slices a ball meets, or nearly: those so many voxels away, and no further than its radius (mm); of the volume's pane nothing is said.
    pub(crate) fn reached(&self, grid: &Grid, off: [f64; 3], radius: f64) -> [bool; 4] {
        let mut seen = [false; 4];
        for (slice, plane) in self.planes.iter().enumerate() {
            let away = off[slice].abs();
            seen[slice + 1] = away <= BESIDE || away * grid.spacing()[plane.cut()] <= radius;
        }
        seen
    }

    /// A slice, with a pixel for every voxel.
    ///
    /// - `over`: what is made of the grey of a voxel.
    pub(crate) fn draw(
        &self,
        plane: &Plane,
        volume: &Volume,
        window: Window,
        over: impl Fn([usize; 3], u8) -> [u8; 3],
    ) -> Result<Image, Error> {
        let grid = volume.grid();
        let pixel = |voxel| {
            let [red, green, blue] = over(voxel, window.grey(volume.value(VoxelIndex(voxel))));
            [red, green, blue, 255]
        };
        Ok(plane.slice(grid.dims(), self.slice(plane, grid.dims()), pixel)?)
    }

    /// What is told of the slices.
    pub(crate) fn told(&self, grid: &Grid) -> [Slice; 3] {
        [0, 1, 2].map(|n| {
            let plane = &self.planes[n];
            Slice {
                pane: Pane::ALL[n + 1],
                letters: grid.in_patient().then_some(plane.letters),
                extent_mm: plane.extent(grid),
                slice: self.slice(plane, grid.dims()),
                slices: grid.dims()[plane.cut()],
                clipped: false,
                oblique: oblique(grid, plane, 2 - n).filter(|degrees| *degrees >= OBLIQUE),
            }
        })
    }
}

/// Slices that are turned by less look as those of the patient's own planes (degrees).
const OBLIQUE: f64 = 3.0;

/// By how much slices are turned out of the plane that is square to an axis of the patient (degrees), where that is known.
fn oblique(grid: &Grid, plane: &Plane, axis: usize) -> Option<f64> {
    let [right, down] = plane.ways(grid).map(Vector3::from);
    let normal = right.cross(&down).normalize();
    grid.in_patient().then(|| normal[axis].abs().min(1.0).acos().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_say_how_far_they_are_turned_out_of_the_patients_planes() {
        let (sin, cos) = 15.0_f64.to_radians().sin_cos();
        // Turned about the axis from ear to ear: sagittal slices stay sagittal.
        let tilted = [[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]];
        let grid = Grid::new([8, 8, 8], [1.0, 1.0, 6.0], [0.0; 3], tilted).unwrap();
        let told = |grid: &Grid| Planes::new(grid).told(grid).map(|slice| slice.oblique.map(f64::round));
        assert_eq!(told(&grid), [Some(15.0), Some(15.0), None]);
        assert_eq!(told(&grid.with_patient_space(false)), [None; 3], "nobody knows how it lies");
        let straight = Grid::with_spacing([8, 8, 8], [1.0; 3]).unwrap();
        assert_eq!(told(&straight), [None; 3]);
    }
}
