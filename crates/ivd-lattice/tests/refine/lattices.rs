//! Lattices to refine, cut from volumes.

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use nalgebra::Vector3;

/// The surface where `value` is 0.5, on a cube of `n` voxels.
pub(crate) fn cut(grid: Grid, value: impl Fn(Vector3<f64>) -> f64) -> Lattice {
    let voxels: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.index(i).0;
            value(Vector3::new(x as f64, y as f64, z as f64)) as f32
        })
        .collect();
    at(&Volume::new(grid, Voxels::from(voxels)).expect("one value a voxel"), 0.5)
}

/// The surface of a volume at a value.
pub(crate) fn at(volume: &Volume, iso: f64) -> Lattice {
    let params = ExtractParams { iso: Iso::Value(iso) };
    extract(volume, None, &params, &Exec::default()).expect("the isovalue is finite").lattice
}

/// A cube of `n` voxels of 1 mm.
pub(crate) fn cube(n: usize) -> Grid {
    Grid::with_spacing([n; 3], [1.0; 3]).expect("a cube of voxels is a grid")
}

pub(crate) fn sphere(n: usize) -> Lattice {
    let middle = Vector3::repeat(n as f64 / 2.0 - 0.4);
    cut(cube(n), |p| 0.5 + 0.35 * n as f64 - (p - middle).norm())
}

/// The sphere without the triangles that lie wholly above a height (voxels); their vertices stay.
pub(crate) fn open_sphere(n: usize, height: f64) -> Lattice {
    let whole = sphere(n);
    let above = |&v: &u32| whole.voxel(v as usize).0.z > height;
    let triangles: Vec<_> = whole.triangles().iter().filter(|t| !t.iter().all(above)).copied().collect();
    whole.clone().with_triangles(triangles.into()).expect("vertices stay")
}

pub(crate) fn torus(grid: Grid) -> Lattice {
    let n = grid.dims()[0] as f64;
    cut(grid, |p| {
        let q = p - Vector3::repeat(n / 2.0 - 0.4);
        0.5 + 0.12 * n - (q.x.hypot(q.y) - 0.28 * n).hypot(q.z)
    })
}

/// Two periods of the gyroid, closed at the volume's border: genus in the tens.
pub(crate) fn gyroid(n: usize) -> Lattice {
    let w = 4.0 * std::f64::consts::PI / n as f64;
    cut(cube(n), |p| {
        let (s, c) = (p.map(|v| (w * v).sin()), p.map(|v| (w * v).cos()));
        0.5 + s.x * c.y + s.y * c.z + s.z * c.x
    })
}

/// A spherical shell thinner than a voxel and a half: two sheets close together.
pub(crate) fn shell(n: usize) -> Lattice {
    let middle = Vector3::repeat(n as f64 / 2.0 - 0.4);
    cut(cube(n), |p| 0.5 + 0.75 - ((p - middle).norm() - 0.35 * n as f64).abs())
}

/// A ball and, round it, thousands of specks far smaller than a voxel: of six vertices, where one voxel is hardly above the
/// isovalue, or of ten, where two are.
pub(crate) fn ball_and_specks(n: usize) -> Lattice {
    let middle = Vector3::repeat(n as f64 / 2.0);
    let radius = 0.21 * n as f64;
    cut(cube(n), |p| {
        let off = (p - middle).norm();
        let cell = p.map(|c| c as u64);
        let pair = hash((p.y * 64.0 + p.z) as u64 * 64 + cell.x / 4).is_multiple_of(8);
        if off < 1.27 * radius {
            (0.5 + (radius - off) * 0.2).clamp(0.0, 1.0)
        } else if off > 1.36 * radius
            && (cell.x % 4 == 1 || pair && cell.x % 4 == 2)
            && (cell.y % 4, cell.z % 4) == (1, 1)
        {
            0.51
        } else {
            0.0
        }
    })
}

pub(crate) fn hash(i: u64) -> u64 {
    ivd_core::noise::bits(0, i)
}

/// Of so many seeds a fifth, of each five in a row the next; all where `IVD_STRESS_EVERY` is 1, one of so many where it is more. Sizes and
/// isovalues go round with the seed, and all of them occur.
pub(crate) fn seeds(count: u64) -> impl Iterator<Item = u64> {
    let every = std::env::var("IVD_STRESS_EVERY")
        .map_or(5, |text| text.parse().unwrap_or_else(|_| panic!("IVD_STRESS_EVERY={text} is no number")));
    (0..count).filter(move |seed| seed % every == seed / every % every)
}

/// Random integers 0…3 cut at 1, 1.5 or 2: specks, tunnels and touching corners everywhere.
pub(crate) fn random(seed: u64) -> Lattice {
    let dims = [4 + seed as usize % 5, 5, 4 + seed as usize % 3];
    let grid = Grid::with_spacing(dims, [1.0, 0.5, 3.0]).expect("small grids exist");
    let voxels: Vec<u8> = (0..grid.len() as u64).map(|i| (hash(seed * 4096 + i) % 4) as u8).collect();
    let iso = [1.0, 1.5, 2.0][seed as usize % 3];
    at(&Volume::new(grid, Voxels::from(voxels)).expect("one value a voxel"), iso)
}

/// A cube with square tunnels along all three axes: genus 325 at 30 voxels.
pub(crate) fn sponge(n: usize) -> Lattice {
    cut(cube(n), |p| {
        let inside = p.iter().all(|&c| c >= 1.0 && c < n as f64 - 1.0);
        let open = p.iter().filter(|&&c| (c as u64) % 5 >= 3).count();
        f64::from(u8::from(inside && open < 2))
    })
}
