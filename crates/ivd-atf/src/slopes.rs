use ivd_core::{Grid, Scalar};
use nalgebra::{Matrix3, Vector3};

/// Stored values between voxels, and their gradients.
pub(crate) struct Slopes<'a, T> {
    stored: &'a [T],
    pub(crate) dims: [usize; 3],
    /// Turns a gradient per voxel into one per mm.
    to_world: Matrix3<f64>,
}

impl<'a, T: Scalar> Slopes<'a, T> {
    pub(crate) fn new(grid: &Grid, stored: &'a [T]) -> Self {
        Self { stored, dims: grid.dims(), to_world: grid.inverse_linear_part().transpose() }
    }

    /// The value at a voxel; `None` for one without data.
    pub(crate) fn value(&self, at: [usize; 3]) -> Option<f64> {
        let value = self.stored[self.place(at).0];
        value.is_data().then(|| value.to_f64())
    }

    /// Gradient in world space [stored values / mm] at a voxel with data: central differences, one-sided beside sides and missing data.
    pub(crate) fn gradient(&self, at: [usize; 3]) -> Vector3<f64> {
        let (i, strides) = self.place(at);
        let here = self.stored[i].to_f64();
        let per_voxel = Vector3::from_fn(|a, _| {
            let neighbour = |inside: bool, j: usize| {
                (inside && self.stored[j].is_data()).then(|| self.stored[j].to_f64())
            };
            let below = neighbour(at[a] > 0, i.wrapping_sub(strides[a]));
            let above = neighbour(at[a] + 1 < self.dims[a], i + strides[a]);
            match (below, above) {
                (Some(below), Some(above)) => 0.5 * (above - below),
                (Some(below), None) => here - below,
                (None, Some(above)) => above - here,
                (None, None) => 0.0,
            }
        });
        self.to_world * per_voxel
    }

    /// The trilinear value at a voxel coordinate; `None` outside the outermost voxel centres and beside missing data.
    pub(crate) fn between(&self, at: Vector3<f64>) -> Option<f64> {
        let mut first = [0; 3];
        let mut within = [0.0; 3];
        for a in 0..3 {
            let top = (self.dims[a] - 1) as f64;
            if !(0.0..=top).contains(&at[a]) {
                return None;
            }
            first[a] = (at[a] as usize).min(self.dims[a].saturating_sub(2));
            within[a] = at[a] - first[a] as f64;
        }
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let up = [0, 1, 2].map(|a| corner >> a & 1);
            let weight: f64 = (0..3).map(|a| if up[a] == 1 { within[a] } else { 1.0 - within[a] }).product();
            if weight > 0.0 {
                sum += weight * self.value(std::array::from_fn(|a| first[a] + up[a]))?;
            }
        }
        Some(sum)
    }

    /// Linear index of a voxel, and the distance in memory to the next one along each axis.
    pub(crate) fn place(&self, [x, y, z]: [usize; 3]) -> (usize, [usize; 3]) {
        let [nx, ny, _] = self.dims;
        (x + nx * (y + ny * z), [1, nx, nx * ny])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_met_exactly_and_missing_data_not_at_all() {
        let grid = Grid::with_spacing([4, 3, 3], [1.0, 2.0, 0.5]).unwrap();
        let mut stored: Vec<f32> =
            (0..grid.len()).map(|i| grid.index(i).0).map(|[x, y, z]| (x + 10 * y + 100 * z) as f32).collect();
        stored[35] = f32::NAN;
        let slopes = Slopes::new(&grid, &stored);
        assert_eq!(slopes.gradient([1, 1, 1]), Vector3::new(1.0, 5.0, 200.0));
        assert_eq!(slopes.gradient([0, 2, 0]), Vector3::new(1.0, 5.0, 200.0));
        assert!((slopes.between(Vector3::new(1.5, 0.25, 1.5)).unwrap() - 154.0).abs() < 1e-9);
        assert_eq!(slopes.between(Vector3::new(3.0, 2.0, 2.0)), None);
        assert_eq!(slopes.between(Vector3::new(3.1, 0.0, 0.0)), None);
        assert_eq!(slopes.between(Vector3::new(3.0, 0.0, 0.0)), Some(3.0));
    }
}
