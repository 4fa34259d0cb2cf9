use std::io::{self, Write};

use crate::mesh::Error;
use crate::mesh::placed::{Placed, put, voxels_fit};
use crate::vtk::codes;

/// Bytes of the count before each array.
const COUNT: u64 = 8;

/// The addresses are 32-bit numbers.
pub(in crate::mesh) fn check(mesh: &Placed) -> Result<f64, Error> {
    voxels_fit(mesh, "VTP")
}

/// One piece, appended raw bytes, little endian: f64 positions, the address of each vertex, triangles.
///
/// VTK's world has no anatomy. Where no space is asked for positions are LPS, as in the volumes that are written for VTK, so that both
/// lie on each other; the fields `SPACE` and `UNIT` say what they are in to programs that look for it.
pub(in crate::mesh) fn write(file: &mut dyn Write, mesh: &Placed) -> io::Result<()> {
    let (vertices, triangles) = (mesh.positions.len() as u64, mesh.lattice.triangles().len() as u64);
    let sizes = [24 * vertices, 12 * vertices, vertices, 24 * triangles, 8 * triangles];
    head(file, mesh, sizes)?;
    put(file, [sizes[0]], u64::to_le_bytes)?;
    for p in &mesh.positions {
        put(file, (*p).into(), f64::to_le_bytes)?;
    }
    let dims = mesh.lattice.grid().dims();
    put(file, [sizes[1]], u64::to_le_bytes)?;
    for key in mesh.lattice.keys() {
        put(file, key.voxel(dims), |v| (v as i32).to_le_bytes())?;
    }
    put(file, [sizes[2]], u64::to_le_bytes)?;
    for key in mesh.lattice.keys() {
        file.write_all(&[key.element()])?;
    }
    put(file, [sizes[3]], u64::to_le_bytes)?;
    for triangle in mesh.lattice.triangles() {
        put(file, triangle.map(i64::from), i64::to_le_bytes)?;
    }
    put(file, [sizes[4]], u64::to_le_bytes)?;
    for end in 1..=triangles {
        put(file, [3 * end], u64::to_le_bytes)?;
    }
    file.write_all(b"\n  </AppendedData>\n</VTKFile>\n")
}

/// Everything before the appended bytes; `sizes` of the arrays in their order.
fn head(file: &mut dyn Write, mesh: &Placed, sizes: [u64; 5]) -> io::Result<()> {
    let mut offset = 0;
    let [points, voxel, element, connectivity, offsets] = sizes.map(|size| {
        let at = offset;
        offset += COUNT + size;
        format!("format=\"appended\" offset=\"{at}\"")
    });
    write!(
        file,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n  \
         <PolyData>\n    \
         <FieldData>\n      \
         <Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">{}</Array>\n      \
         <Array type=\"String\" Name=\"UNIT\" NumberOfTuples=\"1\" format=\"ascii\">{}</Array>\n    \
         </FieldData>\n    \
         <Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n      \
         <PointData>\n        \
         <DataArray type=\"Int32\" Name=\"voxel\" NumberOfComponents=\"3\" {voxel}/>\n        \
         <DataArray type=\"UInt8\" Name=\"element\" {element}/>\n      \
         </PointData>\n      \
         <Points>\n        \
         <DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" {points}/>\n      \
         </Points>\n      \
         <Polys>\n        \
         <DataArray type=\"Int64\" Name=\"connectivity\" {connectivity}/>\n        \
         <DataArray type=\"Int64\" Name=\"offsets\" {offsets}/>\n      \
         </Polys>\n    \
         </Piece>\n  \
         </PolyData>\n  \
         <AppendedData encoding=\"raw\">\n   _",
        codes(mesh.space.name()),
        codes("mm"),
        mesh.positions.len(),
        mesh.lattice.triangles().len()
    )
}
