//! The three planes that a radiologist looks at, whatever the axes of a grid.

use ivd_core::{Error, Grid, Image};

/// One step of a picture, as steps of voxels: which axis of the grid, and whether its numbers rise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Step {
    axis: usize,
    rises: bool,
}

/// A plane of a grid as it is shown: from the patient's feet, front or left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plane {
    /// What it is called.
    pub name: &'static str,
    /// What lies to the left, right, top and bottom of the picture.
    pub letters: [&'static str; 4],
    right: Step,
    up: Step,
    cut: usize,
}

/// A direction of the world: its axis, and whether it rises.
type Way = (usize, bool);

/// Names, letters, and the direction that pictures have to the right and upwards: an axis of the world, and whether it rises.
const PLANES: [(&str, [&str; 4], Way, Way); 3] = [
    ("axial", ["R", "L", "A", "P"], (0, false), (1, true)),
    ("coronal", ["R", "L", "S", "I"], (0, false), (2, true)),
    ("sagittal", ["A", "P", "S", "I"], (1, false), (2, true)),
];

/// The planes of a grid, along those of its axes that are nearest to the patient's.
pub fn planes(grid: &Grid) -> [Plane; 3] {
    let linear = grid.linear_part();
    let share = |world: usize, axis: usize| linear[(world, axis)] / linear.column(axis).norm();
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let fit = |order: &[usize; 3]| (0..3).map(|world| share(world, order[world]).abs()).sum::<f64>();
    let best =
        orders.into_iter().reduce(|a, b| if fit(&b) > fit(&a) + 1e-9 { b } else { a }).unwrap_or([0, 1, 2]);
    let step = |(world, rises): Way| {
        let axis = best[world];
        Step { axis, rises: (share(world, axis) > 0.0) == rises }
    };
    PLANES.map(|(name, letters, right, up)| {
        let (right, up) = (step(right), step(up));
        Plane { name, letters, right, up, cut: 3 - right.axis - up.axis }
    })
}

impl Plane {
    /// The axis of the grid that it cuts.
    pub fn cut(&self) -> usize {
        self.cut
    }

    /// Width and height of what a slice shows (mm).
    pub fn extent(&self, grid: &Grid) -> [f64; 2] {
        [self.right.axis, self.up.axis].map(|axis| grid.dims()[axis] as f64 * grid.spacing()[axis])
    }

    /// Unit directions to the right and down in its pictures (RAS).
    pub fn ways(&self, grid: &Grid) -> [[f64; 3]; 2] {
        let way = |step: Step, sign: f64| {
            let sign = if step.rises { sign } else { -sign };
            grid.direction()[step.axis].map(|c| sign * c)
        };
        [way(self.right, 1.0), way(self.up, -1.0)]
    }

    /// Where a place of the slice's picture lies in the grid (voxel coordinates): from 0, 0 at its top left corner to 1, 1 at its bottom right one.
    pub fn voxel(&self, dims: [usize; 3], at: f64, [across, down]: [f64; 2]) -> [f64; 3] {
        let along = |step: Step, share: f64| {
            let n = dims[step.axis] as f64;
            (if step.rises { share } else { 1.0 - share }) * n - 0.5
        };
        let mut voxel = [at; 3];
        voxel[self.right.axis] = along(self.right, across);
        voxel[self.up.axis] = along(self.up, 1.0 - down);
        voxel
    }

    /// The other way round: where the slice's picture shows a place of the grid, whichever slice that lies in.
    pub fn place(&self, dims: [usize; 3], voxel: [f64; 3]) -> [f64; 2] {
        let along = |step: Step| {
            let share = (voxel[step.axis] + 0.5) / dims[step.axis] as f64;
            if step.rises { share } else { 1.0 - share }
        };
        [along(self.right), 1.0 - along(self.up)]
    }

    /// The slice at a voxel of the cut axis, with a pixel for every voxel.
    ///
    /// # Errors
    /// Those of a picture's constructor.
    pub fn slice(
        &self,
        dims: [usize; 3],
        at: usize,
        pixel: impl Fn([usize; 3]) -> [u8; 4],
    ) -> Result<Image, Error> {
        let (width, height) = (dims[self.right.axis], dims[self.up.axis]);
        let along = |step: Step, i: usize| if step.rises { i } else { dims[step.axis] - 1 - i };
        let mut rgba = Vec::with_capacity(4 * width * height);
        for j in (0..height).rev() {
            for i in 0..width {
                let mut voxel = [at; 3];
                (voxel[self.right.axis], voxel[self.up.axis]) = (along(self.right, i), along(self.up, j));
                rgba.extend(pixel(voxel));
            }
        }
        Image::new(width, height, rgba)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::VoxelIndex;

    /// Where the one voxel at the patient's left, front and head ends up in each plane: left or right third, top or bottom.
    fn seen(grid: &Grid, lfh: [usize; 3]) -> Vec<(bool, bool)> {
        planes(grid)
            .iter()
            .map(|plane| {
                let image = plane
                    .slice(grid.dims(), lfh[plane.cut()], |v| [if v == lfh { 255 } else { 0 }; 4])
                    .unwrap();
                let at = image.rgba().iter().step_by(4).position(|r| *r == 255).unwrap();
                (2 * (at % image.width()) > image.width(), 2 * (at / image.width()) < image.height())
            })
            .collect()
    }

    #[test]
    fn places_of_pictures_and_of_grids_convert_both_ways() {
        let dims = [5, 7, 9];
        let grid =
            Grid::new(dims, [1.0, 2.0, 3.0], [0.0; 3], [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
                .unwrap();
        for plane in planes(&grid) {
            let shown = [4, 1, 6];
            let image =
                plane.slice(dims, shown[plane.cut()], |v| [if v == shown { 255 } else { 0 }; 4]).unwrap();
            let at = image.rgba().iter().step_by(4).position(|r| *r == 255).unwrap();
            let share = [
                ((at % image.width()) as f64 + 0.5) / image.width() as f64,
                ((at / image.width()) as f64 + 0.5) / image.height() as f64,
            ];
            let voxel = shown.map(|c| c as f64);
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
            assert!(near(&plane.voxel(dims, voxel[plane.cut()], share), &voxel), "{}", plane.name);
            assert!(near(&plane.place(dims, voxel), &share), "{}", plane.name);
        }
    }

    #[test]
    fn the_patients_left_is_on_the_right_whatever_the_axes() {
        let dims = [9, 9, 9];
        // Columns are voxel axes in RAS: a plain one, LPS, and one stored from the head along front, left.
        let ways = [
            ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [1, 7, 7]),
            ([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], [7, 1, 7]),
            ([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], [1, 7, 7]),
        ];
        for (columns, lfh) in ways {
            let grid = Grid::new(dims, [1.0; 3], [0.0; 3], columns).unwrap();
            // The voxel is that of the least x, the greatest y and the greatest z of those inside the border.
            let world = grid.world(VoxelIndex(lfh).into()).0;
            let middle = grid.world(VoxelIndex([4; 3]).into()).0;
            assert!(world.x < middle.x && world.y > middle.y && world.z > middle.z, "{columns:?}");
            // Left lies to the right and the front at the top; left to the right and the head at the top; front to the left.
            assert_eq!(seen(&grid, lfh), [(true, true), (true, true), (false, true)], "{columns:?}");
        }
    }
}
