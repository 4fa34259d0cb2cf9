use std::io::{self, Write};

use crate::mesh::Error;
use crate::mesh::placed::{Placed, put, voxels_fit};

/// PLY names a voxel by 32-bit numbers.
pub(in crate::mesh) fn check(mesh: &Placed) -> Result<f64, Error> {
    voxels_fit(mesh, "PLY")
}

/// Binary little endian: f64 positions, the address of each vertex, triangles as lists of three.
pub(in crate::mesh) fn write(file: &mut dyn Write, mesh: &Placed) -> io::Result<()> {
    let dims = mesh.lattice.grid().dims();
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\n\
         comment SPACE={}\n\
         comment positions in mm\n\
         comment voxel and element: where on the grid of {} x {} x {} voxels a vertex was cut;\n\
         comment element 0 1 2: edge along x y z, 3 4 5: face normal to x y z, 6 7: cell\n\
         element vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property int voxel_x\nproperty int voxel_y\nproperty int voxel_z\nproperty uchar element\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.space.name(),
        dims[0],
        dims[1],
        dims[2],
        mesh.positions.len(),
        mesh.lattice.triangles().len()
    )?;
    for (position, key) in mesh.positions.iter().zip(mesh.lattice.keys()) {
        put(file, (*position).into(), f64::to_le_bytes)?;
        put(file, key.voxel(dims), |v| (v as i32).to_le_bytes())?;
        file.write_all(&[key.element()])?;
    }
    for triangle in mesh.lattice.triangles() {
        file.write_all(&[3])?;
        put(file, *triangle, u32::to_le_bytes)?;
    }
    Ok(())
}
