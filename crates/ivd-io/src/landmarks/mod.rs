//! Landmarks that someone placed in 3D Slicer.
//!
//! | ending | holds |
//! |---|---|
//! | `.mrk.json` | one or more markups, each with its coordinate system (LPS where it names none) and unit; the points of all are read, in their order |
//! | `.fcsv` | a line for every point; comments name the coordinate system and the columns |
//!
//! Points come out in RAS, in mm, whatever the file's system and unit. A point that isn't placed (its status is `undefined`, `missing` or
//! `preview`, or it has no position) is left out and counted.
//!
//! ```
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("nose.mrk.json");
//! std::fs::write(&file, r#"{"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": [
//!     {"label": "tip", "position": [1.5, -92.0, 30.0]}]}]}"#)?;
//!
//! let landmarks = ivd_io::landmarks::read(&file)?;
//! assert_eq!(landmarks.named("tip")?.position.0.as_slice(), [-1.5, 92.0, 30.0]);
//! assert!(landmarks.named("chin").unwrap_err().to_string().contains("tip"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod fcsv;
mod markups;
#[cfg(test)]
mod tests;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use ivd_core::{Classified, ErrorClass, World};

use crate::{FileError, Space};

/// Most bytes of a file that is read; a markup of 3D Slicer takes about 500 a point.
const MAX_BYTES: u64 = 4 << 20;

/// Most points of a file.
const MAX_POINTS: usize = 100_000;

/// A point with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Landmark {
    /// Its label as the file has it; may be empty, and several points may share one.
    pub label: String,
    /// Where it is (mm, RAS). Finite.
    pub position: World,
}

/// What a file of landmarks holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Landmarks {
    /// The points that are placed, in the file's order; at least one.
    pub points: Vec<Landmark>,
    /// How many points the file lists that aren't placed.
    pub unplaced: usize,
}

impl Landmarks {
    /// The one point of this label.
    ///
    /// # Errors
    /// [`LabelError`] where no point or several have it.
    pub fn named(&self, label: &str) -> Result<&Landmark, LabelError> {
        let mut found = self.points.iter().filter(|point| point.label == label);
        match (found.next(), found.count()) {
            (Some(one), 0) => Ok(one),
            (Some(_), more) => Err(LabelError::Ambiguous { label: label.to_owned(), count: more + 1 }),
            (None, _) => Err(LabelError::Unknown { label: label.to_owned(), known: self.known() }),
        }
    }

    /// The labels, as many as fit a message.
    fn known(&self) -> String {
        const SHOWN: usize = 12;
        let labels: Vec<String> =
            self.points.iter().take(SHOWN).map(|point| format!("`{}`", point.label)).collect();
        let more = self.points.len().saturating_sub(SHOWN);
        labels.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
    }
}

/// Why a label names no point.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LabelError {
    /// None has it.
    #[error("no landmark is labelled `{label}`; there are {known}")]
    Unknown {
        /// The label that was asked for.
        label: String,
        /// Those that there are.
        known: String,
    },
    /// Several have it.
    #[error(
        "{count} landmarks are labelled `{label}`; give each a label of its own in the program that placed them"
    )]
    Ambiguous {
        /// The label that was asked for.
        label: String,
        /// How many have it.
        count: usize,
    },
}

impl Classified for LabelError {
    fn error_class(&self) -> ErrorClass {
        ErrorClass::Usage
    }
}

/// A format of landmarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `.mrk.json`: markups of 3D Slicer.
    Markups,
    /// `.fcsv`: a table of fiducials, from older versions of it.
    Fcsv,
}

impl Format {
    /// The format of a file's ending; `None` of one that isn't known. Every `.json` is taken for markups.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_string_lossy().to_lowercase().as_str() {
            "json" => Some(Self::Markups),
            "fcsv" => Some(Self::Fcsv),
            _ => None,
        }
    }
}

/// Reads the landmarks of a file in the format of its ending, `.mrk.json` or `.fcsv`.
///
/// # Errors
/// [`FileError::Unreadable`] with the place in the file: an ending that isn't known, no placed point, a position that isn't three
/// finite numbers, a coordinate system or unit that isn't known, more than 4 MiB or 100,000 points; [`FileError::Io`].
pub fn read(path: &Path) -> Result<Landmarks, FileError> {
    let failed = |source| FileError::io("read", path, source);
    let Some(format) = Format::of(path) else {
        let problem = Problem::new("the name", "its ending tells no format of landmarks");
        return Err(problem.with_remedy("give a .mrk.json or .fcsv file of 3D Slicer").of(path));
    };
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(failed(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    parse(format, &bytes).map_err(|problem| problem.of(path))
}

/// Reads landmarks from the bytes of a file; errors call it `bytes.fcsv` and so on.
///
/// # Errors
/// As [`read()`], without [`FileError::Io`].
pub fn read_bytes(format: Format, bytes: &[u8]) -> Result<Landmarks, FileError> {
    let name = match format {
        Format::Markups => "bytes.mrk.json",
        Format::Fcsv => "bytes.fcsv",
    };
    parse(format, bytes).map_err(|problem| problem.of(&PathBuf::from(name)))
}

fn parse(format: Format, bytes: &[u8]) -> Result<Landmarks, Problem> {
    if bytes.len() as u64 > MAX_BYTES {
        let problem = Problem::new("the file", format!("more than {MAX_BYTES} bytes"));
        return Err(problem.with_remedy("save fewer points in a file"));
    }
    let landmarks = match format {
        Format::Markups => markups::read(bytes)?,
        Format::Fcsv => fcsv::read(bytes)?,
    };
    if landmarks.points.is_empty() {
        let problem = match landmarks.unplaced {
            0 => "no control point".to_owned(),
            n => format!("none of its {n} control points is placed"),
        };
        return Err(Problem::new("the file", problem).with_remedy("place a point and save it again"));
    }
    Ok(landmarks)
}

impl Landmarks {
    /// Adds a point of a file whose world is `space` in units of `unit_mm`.
    fn add(
        &mut self,
        place: &str,
        label: String,
        position: [f64; 3],
        (space, unit_mm): (Space, f64),
    ) -> Result<(), Problem> {
        if !position.iter().all(|c| c.is_finite()) {
            return Err(Problem::new(place, format!("the position {position:?} is not finite")));
        }
        if self.points.len() >= MAX_POINTS {
            let problem = Problem::new(place, format!("more than {MAX_POINTS} points"));
            return Err(problem.with_remedy("save fewer points in a file"));
        }
        let position = World(space.turn(position.map(|c| c * unit_mm)).into());
        self.points.push(Landmark { label, position });
        Ok(())
    }
}

/// The coordinate system that a word or an old file's number names.
fn space(word: &str, place: &str) -> Result<Space, Problem> {
    match word {
        "RAS" | "0" => Ok(Space::Ras),
        "LPS" | "1" => Ok(Space::Lps),
        other => {
            let other: String = other.chars().take(40).collect();
            let problem = Problem::new(place, format!("the coordinate system `{other}` is not known"));
            Err(problem.with_remedy("save the points in RAS or LPS"))
        }
    }
}

/// What is wrong in a file, where, and what to do.
#[derive(Debug)]
struct Problem {
    place: String,
    what: String,
    remedy: &'static str,
}

impl Problem {
    fn new(place: impl Into<String>, what: impl Into<String>) -> Self {
        let remedy = "save it again from the program that wrote it";
        Self { place: place.into(), what: what.into(), remedy }
    }

    fn with_remedy(mut self, remedy: &'static str) -> Self {
        self.remedy = remedy;
        self
    }

    fn of(self, path: &Path) -> FileError {
        let Self { place, what: problem, remedy } = self;
        FileError::Unreadable { path: path.to_owned(), place, problem, remedy }
    }
}
