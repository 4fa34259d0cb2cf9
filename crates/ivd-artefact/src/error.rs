use std::path::{Path, PathBuf};

use ivd_core::{Classified, ErrorClass};

/// Why an artefact can't be read or written. Every message names the file.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("{}: can't {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file doesn't begin with the magic `IVDA`.
    #[error("{}: not an IVD artefact: it doesn't begin with `IVDA`", path.display())]
    NotAnArtefact {
        /// The file.
        path: PathBuf,
    },
    /// The file was written by a newer program.
    #[error("{}: {what} version {found} is newer than version {supported}, the newest that this program reads; use a newer program or make the file again", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// The container, or the kind's name.
        what: &'static str,
        /// Version in the file.
        found: u16,
        /// Newest version that is read.
        supported: u16,
    },
    /// The prelude names a kind that this program doesn't know.
    #[error("{}: unknown artefact kind {code}; use a newer program", path.display())]
    UnknownKind {
        /// The file.
        path: PathBuf,
        /// Code in the prelude.
        code: u16,
    },
    /// The file is shorter or longer than its prelude and section table say.
    #[error("{}: {part} needs the file to hold {needed} bytes, it holds {found}; the file was cut or is damaged: make it again", path.display())]
    Length {
        /// The file.
        path: PathBuf,
        /// What doesn't fit: the prelude, the metadata, the payload or a section.
        part: String,
        /// Bytes that the file must hold.
        needed: u64,
        /// Bytes that it holds.
        found: u64,
    },
    /// Prelude or metadata don't have the hash that the prelude states.
    #[error("{}: the hash of its prelude and metadata doesn't match; the file is damaged: make it again", path.display())]
    HeadHash {
        /// The file.
        path: PathBuf,
    },
    /// A section doesn't have the hash that the metadata state.
    #[error("{}: section `{section}`, chunk {chunk}: the hash doesn't match; the file is damaged: make it again", path.display())]
    SectionHash {
        /// The file.
        path: PathBuf,
        /// Name of the section.
        section: String,
        /// Chunk of 4 MiB, from 0.
        chunk: usize,
    },
    /// A byte between two sections isn't 0.
    #[error("{}: byte {offset} of the padding isn't 0; the file is damaged: make it again", path.display())]
    Padding {
        /// The file.
        path: PathBuf,
        /// Offset of the byte in the file.
        offset: u64,
    },
    /// Metadata that can't be decoded or don't fit the sections.
    #[error("{}: bad {part}: {problem}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// Prelude, metadata, section table or content.
        part: &'static str,
        /// What doesn't fit.
        problem: String,
    },
    /// The parts are sound but don't make a value of their kind.
    #[error("{}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What the value's own check said.
        source: ivd_core::Error,
    },
    /// A value that has no place in an artefact was to be written.
    #[error("{}: this {kind} can't be written: {problem}", path.display())]
    Unwritable {
        /// The file that was to be written.
        path: PathBuf,
        /// Name of the kind.
        kind: &'static str,
        /// What has no place.
        problem: String,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Io { .. } => ErrorClass::Io,
            Self::Content { source, .. } => source.error_class(),
            Self::Unwritable { .. } => ErrorClass::Untrusted,
            _ => ErrorClass::Input,
        }
    }
}

impl Error {
    /// The file or folder that it is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Io { path, .. }
            | Self::NotAnArtefact { path }
            | Self::Newer { path, .. }
            | Self::UnknownKind { path, .. }
            | Self::Length { path, .. }
            | Self::HeadHash { path }
            | Self::SectionHash { path, .. }
            | Self::Padding { path, .. }
            | Self::Metadata { path, .. }
            | Self::Content { path, .. }
            | Self::Unwritable { path, .. } => path,
        }
    }

    /// Turns an [`std::io::Error`] about `path` into this error.
    pub(crate) fn io(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, action, source }
    }
}

/// What a kind's codec found wrong; the file's name is added by the reader.
#[derive(Debug)]
pub(crate) enum Problem {
    /// Metadata and sections don't fit.
    Text(String),
    /// The value's own check failed.
    Core(ivd_core::Error),
}

impl Problem {
    /// The error about `path`.
    pub(crate) fn at(self, path: &Path) -> Error {
        match self {
            Self::Text(problem) => Error::Metadata { path: path.to_owned(), part: "content", problem },
            Self::Core(source) => Error::Content { path: path.to_owned(), source },
        }
    }
}

impl From<String> for Problem {
    fn from(problem: String) -> Self {
        Self::Text(problem)
    }
}

impl From<ivd_core::Error> for Problem {
    fn from(source: ivd_core::Error) -> Self {
        Self::Core(source)
    }
}

impl From<ivd_core::GridError> for Problem {
    fn from(source: ivd_core::GridError) -> Self {
        Self::Core(source.into())
    }
}
