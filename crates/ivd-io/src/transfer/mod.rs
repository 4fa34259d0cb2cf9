//! Transfer functions of other programs: 3D Slicer's volume properties and ParaView's presets; and all that ours hold.
//!
//! | ending | holds | opacities over |
//! |---|---|---|
//! | `.vp.json` | 3D Slicer (volume-property-schema-v1.0.0): points of colour and opacity | `scalarOpacityUnitDistance` |
//! | `.paraview.json` | a preset of ParaView: `RGBPoints`, `Points` | `ScalarOpacityUnitDistance`, which ParaView leaves to the representation |
//! | `.json` | every row of the table, its classes, what each contributes, the table by value and gradient | `reference_mm` |
//!
//! Both programs know one function for all labels: the row of label 0 is written. Neither knows a table over values and gradients together (3D Slicer
//! multiplies an opacity by value with one by gradient): a transfer function that has one is refused. Their colours are what the screen shows (sRGB) and are mixed as
//! that, ours are linear light: points are set so that no colour and no opacity differs by more than half of 1/255.
//!
//! [`read()`] tells the formats by what a file holds.

mod json;
mod paraview;
mod points;
mod slicer;
#[cfg(test)]
mod tests;

use std::io::Write as _;
use std::path::Path;

use ivd_core::TransferFunction;
use serde_json::Value;

use points::Points;

use crate::FileError;

/// Most bytes of a file that is read.
const MAX_BYTES: u64 = 256 << 20;

/// A format that a transfer function is written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// 3D Slicer's volume property.
    Slicer,
    /// A preset of ParaView.
    ParaView,
    /// All that a transfer function holds.
    Own,
}

impl Format {
    /// The format of a file's ending; `None` of one that isn't known.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let ends = |ending: &str| name.ends_with(ending);
        if ends(".vp.json") {
            Some(Self::Slicer)
        } else if ends(".paraview.json") {
            Some(Self::ParaView)
        } else {
            ends(".json").then_some(Self::Own)
        }
    }
}

/// All that a transfer function holds, as JSON.
pub fn to_json(transfer: &TransferFunction) -> Value {
    json::write(transfer)
}

/// Writes a transfer function; a file whose bytes would not change isn't touched. Returns whether it was.
///
/// # Errors
/// [`FileError::Unwritable`] for a table by value and gradient in a format of another program; [`FileError::Io`].
pub fn write(path: &Path, transfer: &TransferFunction, format: Format) -> Result<bool, FileError> {
    let by_value = |program: &'static str| match transfer.gradient() {
        None => Ok(Points::of(transfer)),
        Some(_) => Err(FileError::Unwritable {
            path: path.to_owned(),
            format: program,
            what: "colours and opacities by value and gradient",
            remedy: "export it as .json, which holds all of it, or make a transfer function with axes value",
        }),
    };
    let value = match format {
        Format::Slicer => slicer::write(&by_value("3D Slicer's volume property")?),
        Format::ParaView => paraview::write(&by_value("a preset of ParaView")?),
        Format::Own => to_json(transfer),
    };
    let text = format!("{value:#}\n");
    let failed = |source| FileError::io("write", path, source);
    ivd_fs::replace(path, |_, source| failed(source), |to| to.write_all(text.as_bytes()).map_err(failed))
}

/// Reads a transfer function of any of the formats.
///
/// # Errors
/// [`FileError::Unreadable`] names the place in the file; [`FileError::Io`].
pub fn read(path: &Path) -> Result<TransferFunction, FileError> {
    let failed = |source| FileError::io("read", path, source);
    let bad = |place: String, problem: String, remedy| FileError::Unreadable {
        path: path.to_owned(),
        place,
        problem,
        remedy,
    };
    let size = std::fs::metadata(path).map_err(failed)?.len();
    if size > MAX_BYTES {
        let problem = format!("{size} bytes, at most {MAX_BYTES} are read");
        return Err(bad("the file".into(), problem, "give a transfer function"));
    }
    let text = std::fs::read(path).map_err(failed)?;
    let value: Value = serde_json::from_slice(&text).map_err(|error| {
        bad(format!("line {}", error.line()), format!("no JSON: {error}"), "give a JSON file")
    })?;
    let read = if value.get("volumeProperties").is_some() {
        slicer::read(&value)
    } else if paraview::preset(&value).is_some() {
        paraview::read(&value)
    } else if value.get("table").is_some() {
        json::read(&value)
    } else {
        Err(Problem::new(
            "the file",
            "neither a volume property of 3D Slicer, a preset of ParaView, nor a transfer function of ours",
        ))
    };
    read.map_err(|Problem { place, problem }| {
        bad(place, problem, "export it anew from the program that wrote it")
    })
}

/// What is wrong in a file, and where.
#[derive(Debug)]
struct Problem {
    place: String,
    problem: String,
}

impl Problem {
    fn new(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { place: place.into(), problem: problem.into() }
    }
}

/// A number of a file.
fn number(value: Option<&Value>, place: &str) -> Result<f64, Problem> {
    let found = value.and_then(Value::as_f64).filter(|v| v.is_finite());
    found.ok_or_else(|| Problem::new(place, "a number is missing"))
}
