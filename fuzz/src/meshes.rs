//! Mesh files of other programs.

use std::sync::OnceLock;

use ivd_core::Grid;
use ivd_io::mesh::{Format, read_bytes};
use ivd_lattice::figures;
use ivd_lattice::import::{ImportParams, lattice};

use crate::{MEMORY, exec};

/// Most triangles whose lattice is made: a fuzzer's time is better spent on many small meshes.
const MOST: usize = 10_000;

/// Reads the bytes as a mesh file and puts the mesh on a grid. The first byte tells the format, and whether the mesh may be
/// open.
pub fn check(bytes: &[u8]) {
    static GRID: OnceLock<Grid> = OnceLock::new();
    let grid = GRID.get_or_init(|| Grid::with_spacing([8; 3], [1.0; 3]).expect("a cube of voxels is a grid"));
    let Some((&choice, bytes)) = bytes.split_first() else { return };
    let format = Format::ALL[usize::from(choice) % Format::ALL.len()];
    let Ok(mesh) = read_bytes(format, bytes, MEMORY) else { return };
    assert!(mesh.positions.iter().all(|p| p.iter().all(|c| c.is_finite())));
    let vertices = mesh.positions.len();
    assert!(mesh.triangles.as_flattened().iter().all(|v| (*v as usize) < vertices));
    assert!(mesh.addresses.as_ref().is_none_or(|list| list.len() == vertices));
    if mesh.triangles.len() > MOST {
        return;
    }
    let params = ImportParams { weld: f64::from(choice / 100) * 1e-3, allow_open: choice & 64 != 0 };
    let Ok(imported) = lattice(&mesh, grid, &params, exec()) else { return };
    let figures = figures::measure(&imported.lattice);
    assert!(params.allow_open || figures.boundary_edges + figures.non_manifold_edges == 0, "an open lattice");
    assert!(params.weld > 0.0 || imported.moved_mm <= 1e-6 * grid.voxel_diagonal(), "a vertex moved");
    let _ = figures::quality(&imported.lattice);
}
