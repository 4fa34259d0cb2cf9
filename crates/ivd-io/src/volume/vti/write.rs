use std::fmt::Write as _;
use std::path::Path;

use ivd_core::{Exec, Volume, VoxelType};

use crate::Space;
use crate::volume::orientation::flip;
use crate::volume::replace::{put, replace};
use crate::volume::values::Values;
use crate::volume::{Error, Written};
use crate::vtk;

/// Writes a `.vti` file: one piece, appended raw bytes, little endian, LPS; the field `SPACE` says so
/// where the places are the patient's.
///
/// A volume with slope and intercept is written as real values. The file is replaced at once, and left alone
/// where it holds the same bytes.
///
/// # Errors
/// [`Error::Io`] where the system refuses, or a cancelled [`Error::Core`].
pub fn write(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let values = Values::without_scale(volume);
    let voxel_type = values.voxel_type(volume);
    replace(path, |to| {
        put(to, path, head(volume, voxel_type).as_bytes())?;
        let bytes = (volume.grid().len() * voxel_type.bytes()) as u64;
        put(to, path, &bytes.to_le_bytes())?;
        values.write(to, path, volume, exec)?;
        put(to, path, b"\n  </AppendedData>\n</VTKFile>\n")
    })
}

fn head(volume: &Volume, voxel_type: VoxelType) -> String {
    let grid = volume.grid();
    let extent = grid.dims().map(|n| format!("0 {}", n - 1)).join(" ");
    let axes = grid.direction().map(flip);
    let direction: Vec<f64> = (0..3).flat_map(|row| axes.map(|axis| axis[row])).collect();
    let mut head = String::from("<?xml version=\"1.0\"?>\n");
    let mut line = |text: String| writeln!(head, "{text}").expect("a String takes all text");
    line(
        "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
            .into(),
    );
    line(format!(
        "  <ImageData WholeExtent=\"{extent}\" Origin=\"{}\" Spacing=\"{}\" Direction=\"{}\">",
        numbers(&flip(grid.origin())),
        numbers(&grid.spacing()),
        numbers(&direction)
    ));
    if grid.in_patient() {
        // As a surface's file says it.
        line(format!(
            "    <FieldData>\n      <Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">{}</Array>\n    </FieldData>",
            vtk::codes(Space::Lps.name())
        ));
    }
    line(format!("    <Piece Extent=\"{extent}\">"));
    line("      <PointData Scalars=\"volume\">".into());
    line(format!(
        "        <DataArray type=\"{}\" Name=\"volume\" format=\"appended\" offset=\"0\"/>",
        vtk::type_name(voxel_type)
    ));
    line("      </PointData>\n      <CellData/>\n    </Piece>\n  </ImageData>".into());
    head + "  <AppendedData encoding=\"raw\">\n   _"
}

/// Shortest text that reads back as the same numbers.
fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}
