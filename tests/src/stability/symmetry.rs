//! The same case mirrored, turned, scaled or moved.

use ivd_core::{
    ElementKey, FieldBricks, Grid, Lattice, Scalar, Volume, VoxelCoord, VoxelIndex, World, with_voxels,
};
use nalgebra::{Matrix3, Vector3};

/// Another order of the axes, some of them reversed: axis `b` of the result is axis `axes[b]` of the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RigidTransform {
    /// Input axis of each axis of the result.
    pub axes: [usize; 3],
    /// Axes of the result that run the other way.
    pub flip: [bool; 3],
}

/// A mirror image in each axis, and quarter turns about each.
pub const TURNS: [RigidTransform; 6] = [
    RigidTransform { axes: [0, 1, 2], flip: [true, false, false] },
    RigidTransform { axes: [0, 1, 2], flip: [false, true, false] },
    RigidTransform { axes: [0, 1, 2], flip: [false, false, true] },
    RigidTransform { axes: [1, 0, 2], flip: [true, false, false] },
    RigidTransform { axes: [2, 1, 0], flip: [false, false, true] },
    RigidTransform { axes: [1, 2, 0], flip: [false, true, true] },
];

impl RigidTransform {
    /// The place of a voxel coordinate of the input in the result.
    pub fn voxel(&self, dims: [usize; 3], at: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|b, _| {
            let c = at[self.axes[b]];
            if self.flip[b] { (dims[self.axes[b]] - 1) as f64 - c } else { c }
        })
    }

    /// The same for a voxel.
    pub fn index(&self, dims: [usize; 3], at: VoxelIndex) -> VoxelIndex {
        VoxelIndex(std::array::from_fn(|b| {
            let c = at.0[self.axes[b]];
            if self.flip[b] { dims[self.axes[b]] - 1 - c } else { c }
        }))
    }

    /// A direction of the input in the result (no unit).
    pub fn direction(&self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|b, _| if self.flip[b] { -v[self.axes[b]] } else { v[self.axes[b]] })
    }

    /// The grid of the result: spacing follows its axis. The scene itself is turned, as the voxel axes stay where they are.
    ///
    /// # Panics
    /// Never: the grid is as sound as the input's.
    pub fn grid(&self, grid: &Grid) -> Grid {
        let of = |v: [f64; 3]| self.axes.map(|a| v[a]);
        let dims = self.axes.map(|a| grid.dims()[a]);
        Grid::new(dims, of(grid.spacing()), grid.origin(), grid.direction()).expect("as sound as the input")
    }

    /// The grid of the result where the scene stays in place and only the array is stored otherwise.
    ///
    /// # Panics
    /// Never: the grid is as sound as the input's.
    pub fn stored(&self, grid: &Grid) -> Grid {
        let dims = self.axes.map(|a| grid.dims()[a]);
        let direction = std::array::from_fn(|b| {
            let sign = if self.flip[b] { -1.0 } else { 1.0 };
            grid.direction()[self.axes[b]].map(|c| sign * c)
        });
        let mut first = Vector3::zeros();
        for b in (0..3).filter(|b| self.flip[*b]) {
            first[self.axes[b]] = (grid.dims()[self.axes[b]] - 1) as f64;
        }
        let World(origin) = grid.world(VoxelCoord(first));
        let spacing = self.axes.map(|a| grid.spacing()[a]);
        Grid::new(dims, spacing, origin.into(), direction).expect("as sound as the input")
    }

    /// An array of voxels of the input in the order of the result.
    pub fn array<T: Copy>(&self, grid: &Grid, values: &[T]) -> Vec<T> {
        let dims = self.axes.map(|a| grid.dims()[a]);
        let mut out = values.to_vec();
        for (i, value) in values.iter().enumerate() {
            let [x, y, z] = self.index(grid.dims(), grid.index(i)).0;
            out[x + dims[0] * (y + dims[1] * z)] = *value;
        }
        out
    }

    /// A volume on a grid that this turn gave.
    ///
    /// # Panics
    /// If the grid is another's.
    pub fn volume(&self, volume: &Volume, grid: &Grid) -> Volume {
        let voxels = with_voxels!(volume.voxels(), slice => wrapped(self.array(volume.grid(), slice)));
        Volume::with_scale(grid.clone(), voxels, volume.slope(), volume.intercept()).expect("a value a voxel")
    }

    /// A world place or displacement of an axis-aligned scene that was turned with [`RigidTransform::grid`].
    pub fn world(&self, grid: &Grid, at: Vector3<f64>) -> Vector3<f64> {
        self.grid(grid).world(VoxelCoord(self.voxel(grid.dims(), grid.voxel(World(at)).0))).0
    }

    /// A lattice turned with [`RigidTransform::grid`], and the number that each of its vertices has in the result. Triangles keep
    /// their order; they are turned over where the turn is a mirror.
    pub fn lattice(&self, lattice: &Lattice) -> (Lattice, Vec<u32>) {
        let (dims, grid) = (lattice.grid().dims(), self.grid(lattice.grid()));
        let mut moved: Vec<(ElementKey, [f32; 3], usize)> = (0..lattice.keys().len())
            .map(|i| {
                let (key, place) = self.vertex(dims, lattice.keys()[i], lattice.places()[i]);
                (key, place, i)
            })
            .collect();
        moved.sort_by_key(|m| m.0);
        let mut number = vec![0; moved.len()];
        moved.iter().enumerate().for_each(|(new, m)| number[m.2] = new as u32);
        let mirror = self.matrix().determinant() < 0.0;
        let turned = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| number[v as usize]);
            if mirror { [a, c, b] } else { [a, b, c] }
        };
        let keys: Vec<_> = moved.iter().map(|m| m.0).collect();
        let places: Vec<_> = moved.iter().map(|m| m.1).collect();
        let triangles: Vec<_> = lattice.triangles().iter().map(turned).collect();
        let result = Lattice::new(grid, keys.into(), places.into(), triangles.into())
            .expect("a turn keeps addresses apart");
        let result = result.with_source(lattice.source().clone()).with_level(lattice.level());
        let result = result.with_max_error_mm(lattice.max_error_mm());
        (result, number)
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&std::array::from_fn::<_, 3, _>(|a| {
            self.direction(Vector3::from_fn(|b, _| f64::from(u8::from(a == b))))
        }))
    }

    /// Address and place of a vertex. Along a reversed axis that its element spans, a place `p` becomes `1 − p`.
    fn vertex(&self, dims: [usize; 3], key: ElementKey, place: [f32; 3]) -> (ElementKey, [f32; 3]) {
        let (element, padded) = (usize::from(key.element()), key.padded(dims));
        let spans = |axis: usize| match element {
            0..=2 => axis == element,
            3..=5 => axis != element - 3,
            _ => true,
        };
        let onto = |axis: usize| self.axes.iter().position(|a| *a == axis).expect("each axis has its place");
        let (mut at, mut new) = ([0; 3], [0.0; 3]);
        for b in 0..3 {
            let a = self.axes[b];
            let across = usize::from(spans(a));
            // Padded voxels run from 0 to n + 1.
            at[b] = if self.flip[b] { dims[a] + 1 - padded[a] - across } else { padded[a] };
            new[b] = if self.flip[b] && across == 1 { 1.0 - place[a] } else { place[a] };
        }
        let turned = match element {
            0..=2 => onto(element),
            3..=5 => 3 + onto(element - 3),
            cell => cell,
        };
        (ElementKey::new(self.axes.map(|a| dims[a]), at, turned as u8), new)
    }

    /// A field of millimetres turned with [`RigidTransform::grid`], for axis-aligned grids.
    ///
    /// # Panics
    /// Never: the vectors are the input's.
    pub fn field(&self, field: &FieldBricks) -> FieldBricks {
        let (from, dims) = (field.dims(), self.axes.map(|a| field.dims()[a]));
        let bricks = dims.map(|n| n.div_ceil(8));
        let mut vectors = vec![[0.0_f32; 3]; bricks.iter().product::<usize>() * FieldBricks::VOXELS];
        for z in 0..from[2] {
            for y in 0..from[1] {
                for x in 0..from[0] {
                    let v = field.at(VoxelIndex([x, y, z]));
                    let [i, j, k] = self.index(from, VoxelIndex([x, y, z])).0;
                    let brick = i / 8 + bricks[0] * (j / 8 + bricks[1] * (k / 8));
                    vectors[brick * FieldBricks::VOXELS + i % 8 + 8 * (j % 8 + 8 * (k % 8))] =
                        std::array::from_fn(
                            |b| if self.flip[b] { -v[self.axes[b]] } else { v[self.axes[b]] },
                        );
                }
            }
        }
        let table = (0..bricks.iter().product::<usize>() as u32).collect();
        FieldBricks::new(dims, table, vectors.into()).expect("a vector a voxel")
    }
}

fn wrapped<T: Scalar>(values: Vec<T>) -> ivd_core::Voxels {
    T::wrap(values.into())
}
