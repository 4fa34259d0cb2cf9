//! The body of a scene: cells round the lattice, what they are made of, and the vertices' pulls.

use ivd_core::{Error, Exec, Lattice};
use ivd_elastic::{Body, Cells, Hexahedron, Pull, weights};
use nalgebra::Vector3;

use super::super::region::Region;
use super::materials::Materials;

/// Stiffness of a cell's springs together, in units of the stiffest modulus in it, 1 at least, times its edge. Multipliers do
/// the rest; stiffer ones need fewer of these and more iterations.
const SPRING: f64 = 10.0;
/// Cells across the margin.
const ACROSS: f64 = 4.0;

/// The cells of Ω, at most a quarter of the margin long.
pub(super) fn cells(lattice: &Lattice, region: &Region, edge: Option<u8>) -> Cells {
    Cells::new(lattice.grid(), region.balls().collect(), edge, region.margin() / ACROSS)
}

/// The body of a scene; the pulls' goals are 0 yet.
///
/// `constrains`: whether a vertex pulls.
pub(super) fn body(
    cells: &Cells,
    lattice: &Lattice,
    materials: &Materials<'_>,
    constrains: &(dyn Fn(usize) -> bool + Sync),
    exec: &Exec,
) -> Result<Body, Error> {
    let voxels: Vec<Vector3<f64>> = (0..lattice.keys().len()).map(|v| lattice.voxel(v).0).collect();
    let mesh = cells.mesh(&voxels, materials, exec)?;
    let matter = cells.matter(&mesh, materials);
    let mut pulls: Vec<Pull> = voxels
        .iter()
        .enumerate()
        .filter(|(vertex, _)| constrains(*vertex))
        .filter_map(|(vertex, voxel)| {
            let (cell, inner) = mesh.locate(cells.place(*voxel))?;
            Some(Pull {
                cell: cell as u32,
                vertex: vertex as u32,
                weights: weights(inner),
                spring: 0.0,
                goal: Vector3::zeros(),
                multiplier: Vector3::zeros(),
            })
        })
        .collect();
    let mut many = vec![0_u32; mesh.cells.len()];
    for pull in &pulls {
        many[pull.cell as usize] += 1;
    }
    let edges = cells.edges();
    let edge = edges.determinant().abs().cbrt();
    for pull in &mut pulls {
        let cell = pull.cell as usize;
        let length = edge * f64::from(mesh.cells[cell].size);
        let stiffest = matter[cell].iter().map(|lame| materials.modulus(lame)).fold(1.0, f64::max);
        pull.spring = SPRING * stiffest * length / f64::from(many[cell]);
    }
    Ok(Body::new(mesh, Hexahedron::new(&edges), matter, pulls))
}
