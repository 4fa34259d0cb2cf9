use std::io;
use std::path::{Path, PathBuf};

use ivd_core::{Classified, ErrorClass};

/// Why a volume can't be read or written. Every variant names the file; those about a header name the field.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet: cancelled, memory limit, impossible grid.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// The operating system refused to read or write.
    #[error("{}: can't {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried, such as `"open"`.
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// Neither the first bytes nor the ending tell the format.
    #[error("{}: {problem}; {remedy}", path.display())]
    Unknown {
        /// The file or folder.
        path: PathBuf,
        /// What was found.
        problem: String,
        /// What to do instead.
        remedy: String,
    },
    /// A header field that is malformed or contradicts the rest.
    #[error("{}: field `{field}`: {problem}", path.display())]
    Field {
        /// The file that holds the header.
        path: PathBuf,
        /// The field by its name in the format.
        field: String,
        /// What is wrong, with the value.
        problem: String,
    },
    /// A sound file of a kind that isn't read or written.
    #[error("{}: {what} is not supported; {remedy}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The feature, by its name in the format.
        what: String,
        /// What to do instead.
        remedy: String,
    },
    /// Less data than the header declares.
    #[error("{}: {what}: {needed} bytes needed, {found} found; the file is cut short or its header is wrong", path.display())]
    Truncated {
        /// The file that holds the data.
        path: PathBuf,
        /// Which data.
        what: String,
        /// Bytes that the header declares.
        needed: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// Compressed or encoded data that doesn't decode.
    #[error("{}: {what} is damaged: {problem}", path.display())]
    Corrupt {
        /// The file that holds the data.
        path: PathBuf,
        /// Which data.
        what: String,
        /// What the decoder says.
        problem: String,
    },
    /// The file holds several volumes and none, or none that exists, was chosen; or an option is missing.
    #[error("{}: {problem}; {remedy}", path.display())]
    Choice {
        /// The file or folder.
        path: PathBuf,
        /// What is there.
        problem: String,
        /// How to choose.
        remedy: String,
        /// What there is to choose from, where a person may be asked.
        offer: Option<Offer>,
    },
}

/// What else would be read, for whoever can ask a person: each is a field of [`ReadOptions`](crate::volume::ReadOptions).
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Offer {
    /// `frame`: one of so many, from 0.
    Frames(usize),
    /// `series`: one of these.
    Series {
        /// All that there are.
        all: Vec<OfferedSeries>,
        /// Whether one was asked for that isn't there.
        is_asked: bool,
    },
    /// `resample_slices`.
    EvenSlices,
}

/// A series that there is to choose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OfferedSeries {
    /// What chooses it.
    pub series: String,
    /// What it is, without anything that names its patient.
    pub told: String,
    /// Images.
    pub slices: usize,
    /// Whether it can be chosen, and is one of plain slices.
    pub is_readable: bool,
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::Io { .. } => ErrorClass::Io,
            Self::Unknown { .. }
            | Self::Field { .. }
            | Self::Unsupported { .. }
            | Self::Truncated { .. }
            | Self::Corrupt { .. }
            | Self::Choice { .. } => ErrorClass::Input,
        }
    }
}

impl Error {
    pub(crate) fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    pub(crate) fn field(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Field { path: path.to_owned(), field: field.into(), problem: problem.into() }
    }

    pub(crate) fn unsupported(path: &Path, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), what: what.into(), remedy: remedy.into() }
    }

    pub(crate) fn truncated(path: &Path, what: impl Into<String>, needed: u64, found: u64) -> Self {
        Self::Truncated { path: path.to_owned(), what: what.into(), needed, found }
    }

    /// The same without the names of folders below one: they are often patients'. What lies there is named by its file.
    pub(crate) fn without_folders_below(mut self, dir: &Path) -> Self {
        let shortened = |path: &mut PathBuf| {
            if let (Ok(below), Some(name)) = (path.strip_prefix(dir), path.file_name())
                && below.components().count() > 1
            {
                *path = dir.join("…").join(name);
            }
        };
        match &mut self {
            Self::Core(_) => {}
            Self::Io { path, .. }
            | Self::Unknown { path, .. }
            | Self::Field { path, .. }
            | Self::Unsupported { path, .. }
            | Self::Truncated { path, .. }
            | Self::Corrupt { path, .. }
            | Self::Choice { path, .. } => shortened(path),
        }
        self
    }

    #[allow(clippy::needless_pass_by_value, reason = "callers hand over an error that ends here")]
    pub(crate) fn corrupt(path: &Path, what: impl Into<String>, problem: impl ToString) -> Self {
        Self::Corrupt { path: path.to_owned(), what: what.into(), problem: problem.to_string() }
    }

    pub(crate) fn choice(path: &Path, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Choice { path: path.to_owned(), problem: problem.into(), remedy: remedy.into(), offer: None }
    }

    /// The same with what there is to choose from.
    pub(crate) fn offering(mut self, what: Offer) -> Self {
        if let Self::Choice { offer, .. } = &mut self {
            *offer = Some(what);
        }
        self
    }

    /// What there is to choose from, where that would help, and why it has to be chosen.
    pub fn offer(&self) -> Option<(&Offer, &str)> {
        match self {
            Self::Choice { offer, problem, .. } => offer.as_ref().map(|offer| (offer, problem.as_str())),
            _ => None,
        }
    }
}
