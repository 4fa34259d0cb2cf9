//! Lattices made by hand, which no volume would give: the awkward ones.

use ivd_core::{ElementKey, Grid, Lattice, LatticeSource};

/// A lattice with corners at voxel coordinates. Vertices get the addresses of the voxels below them, several in one voxel
/// its several elements; the order of the corners is kept as far as addresses allow.
///
/// # Panics
/// If more than seven corners share a voxel, or one lies outside the padded grid.
pub fn mesh(grid: &Grid, corners: &[[f64; 3]], triangles: &[[usize; 3]]) -> Lattice {
    let dims = grid.dims();
    let mut taken: Vec<(ElementKey, [f32; 3], usize)> = Vec::new();
    for (i, corner) in corners.iter().enumerate() {
        let base = corner.map(f64::floor);
        let padded: [usize; 3] = std::array::from_fn(|a| (base[a] + 1.0) as usize);
        let place = std::array::from_fn(|a| (corner[a] - base[a]) as f32);
        let free =
            (0..7).rev().map(|e| ElementKey::new(dims, padded, e)).find(|k| taken.iter().all(|t| t.0 != *k));
        taken.push((free.expect("seven corners a voxel"), place, i));
    }
    taken.sort_by_key(|t| t.0);
    let mut number = vec![0_u32; corners.len()];
    taken.iter().enumerate().for_each(|(new, t)| number[t.2] = new as u32);
    Lattice::new(
        grid.clone(),
        taken.iter().map(|t| t.0).collect(),
        taken.iter().map(|t| t.1).collect(),
        triangles.iter().map(|t| t.map(|v| number[v])).collect(),
    )
    .expect("corners within the padded grid")
    .with_source(LatticeSource::Mask)
}

/// Corners and outward triangles of an octahedron.
fn octahedron(centre: [f64; 3], radius: f64, first: usize) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let corner = |axis: usize, side: f64| {
        let mut c = centre;
        c[axis] += side * radius;
        c
    };
    let corners = (0..3).flat_map(|a| [corner(a, -1.0), corner(a, 1.0)]).collect();
    let triangles = (0..8_usize).map(|o| {
        let (x, y, z) = (first + (o & 1), first + 2 + (o >> 1 & 1), first + 4 + (o >> 2));
        if o.count_ones() % 2 == 1 { [x, y, z] } else { [x, z, y] }
    });
    (corners, triangles.collect())
}

/// Octahedra apart from each other.
pub fn islands(grid: &Grid, centres: &[[f64; 3]], radius: f64) -> Lattice {
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for centre in centres {
        let (c, t) = octahedron(*centre, radius, corners.len());
        corners.extend(c);
        triangles.extend(t);
    }
    mesh(grid, &corners, &triangles)
}

/// An octahedron and vertices that no triangle names.
pub fn loose(grid: &Grid, centre: [f64; 3], radius: f64) -> Lattice {
    let (mut corners, triangles) = octahedron(centre, radius, 0);
    corners.extend([[1.25, 1.0, 1.0], [2.0, 1.5, 1.0], [1.0, 1.0, 2.75]]);
    mesh(grid, &corners, &triangles)
}

/// An octahedron whose first corner is there twice, at one place, with triangles without area between.
pub fn zero_length(grid: &Grid, centre: [f64; 3], radius: f64) -> Lattice {
    let (mut corners, mut triangles) = octahedron(centre, radius, 0);
    corners.push(corners[0]);
    // The edge from corner 0 to corner 2 opens into a slit without width.
    let twin = 6;
    for t in &mut triangles {
        if t.contains(&0) && t.contains(&3) {
            t.iter_mut().filter(|v| **v == 0).for_each(|v| *v = twin);
        }
    }
    triangles.extend([[0, twin, 4], [twin, 0, 5]]);
    mesh(grid, &corners, &triangles)
}

/// An octahedron and a triangle that is there twice, front and back.
pub fn doubled(grid: &Grid, centre: [f64; 3], radius: f64) -> Lattice {
    let (mut corners, mut triangles) = octahedron(centre, radius, 0);
    corners.extend([[1.0, 1.0, 1.0], [3.5, 1.0, 1.0], [1.0, 3.5, 1.0]]);
    triangles.extend([[6, 7, 8], [6, 8, 7]]);
    mesh(grid, &corners, &triangles)
}

/// Two tetrahedra that share `shared` corners: 1 is a bow tie, 2 an edge with four triangles.
pub fn joined(grid: &Grid, centre: [f64; 3], radius: f64, shared: usize) -> Lattice {
    let at = |d: [f64; 3]| std::array::from_fn(|a| centre[a] + radius * d[a]);
    let corners = [
        [0.0, 0.0, -1.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.9, 0.1],
        [1.1, -0.9, 0.0],
        [-1.0, 0.9, 0.0],
        [-1.1, -0.9, 0.1],
    ];
    let mut corners: Vec<[f64; 3]> = corners.map(at).into();
    let faces = |[a, b, c, d]: [usize; 4]| [[a, c, b], [a, b, d], [b, c, d], [c, a, d]];
    let mut second = [0, 1, 4, 5];
    if shared == 1 {
        corners.push(at([-0.9, 0.0, 1.2]));
        second[1] = 6;
    }
    let mut triangles = Vec::new();
    for four in [[0, 1, 2, 3], second] {
        let [a, b, c, d] = four.map(|v| nalgebra::Vector3::from(corners[v]));
        let outward = (b - a).dot(&(c - a).cross(&(d - a))) > 0.0;
        let mut of = faces(four);
        if !outward {
            for t in &mut of {
                t.swap(1, 2);
            }
        }
        triangles.extend(of);
    }
    mesh(grid, &corners, &triangles)
}
