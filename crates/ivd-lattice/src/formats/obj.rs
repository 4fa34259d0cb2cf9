use std::io::{self, Write};

use super::Mesh;

/// Text; each coordinate with the fewest digits that give the same f64 back. Indices count from 1.
pub(super) fn write(file: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    writeln!(file, "# positions in mm, RAS")?;
    for p in &mesh.positions {
        writeln!(file, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in &mesh.lattice.triangles {
        writeln!(file, "f {} {} {}", u64::from(*a) + 1, u64::from(*b) + 1, u64::from(*c) + 1)?;
    }
    Ok(())
}
