use std::path::{Path, PathBuf};

use ivd_core::op::Failure;
use ivd_core::{Classified, ErrorClass};
use ivd_io::volume::Offer;

/// Why a pipeline or one of its stages failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The scene is wrong: unknown key, bad value, an output that nothing makes.
    #[error("scene {}: {problem}", file.display())]
    Scene {
        /// The scene file.
        file: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A stage failed.
    #[error("{stage}: {source}")]
    Stage {
        /// Name of the stage.
        stage: &'static str,
        /// Its own error.
        source: Box<dyn std::error::Error + Send + Sync>,
        /// What kind of failure it is.
        class: ErrorClass,
    },
    /// An input of a stage is of another kind than it reads.
    #[error("{stage} reads {expected} as its {slot}, but was given a {found} artefact")]
    WrongKind {
        /// Name of the stage.
        stage: &'static str,
        /// Input slot.
        slot: &'static str,
        /// Kinds it reads.
        expected: String,
        /// Kind it got.
        found: &'static str,
    },
    /// An artefact or cache file failed.
    #[error(transparent)]
    Artefact(#[from] ivd_artefact::Error),
    /// Anything that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A volume that was read in parts isn't what its file's hashes say: what was made from it is thrown away.
    #[error("{0}")]
    Damaged(String),
    /// Work ended while a memory limit was set; where the limit ended it, about this much (MiB) would have done.
    #[error("{source}")]
    OverMemory {
        /// A limit that would do (MiB).
        about_mib: u64,
        /// How the work ended.
        source: Box<Error>,
    },
    /// A limit that was set to the run could not be kept.
    #[error("{0}")]
    Limit(String),
    /// A figure that a certificate or a choice rests on isn't in a stage's record. Nothing may be taken in its place.
    #[error(
        "{stage}: {problem}, so that nothing can be said of its result; run it again with --force {stage}, or without the \
         cache"
    )]
    Figure {
        /// Name of the stage.
        stage: String,
        /// Which figure is missing, or not what it should be.
        problem: String,
    },
    /// A file could not be read or written.
    #[error("{action} {}: {source}", path.display())]
    Io {
        /// What was attempted: "reading", "writing".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Scene { .. } | Self::WrongKind { .. } => ErrorClass::Usage,
            Self::Stage { class, .. } => *class,
            Self::Artefact(error) => error.error_class(),
            Self::Core(error) => error.error_class(),
            Self::Damaged(_) => ErrorClass::Input,
            Self::Limit(_) => ErrorClass::Limit,
            Self::OverMemory { source, .. } => source.error_class(),
            Self::Figure { .. } => ErrorClass::Untrusted,
            Self::Io { .. } => ErrorClass::Io,
        }
    }
}

impl Error {
    pub(crate) fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Self::Io { action, path: path.to_owned(), source }
    }

    /// Figures that can't be read, with what the reader says of them.
    pub(crate) fn figures(stage: &str, problem: impl std::fmt::Display) -> Self {
        Self::Figure { stage: stage.to_owned(), problem: format!("{problem} among its figures") }
    }

    /// The failure of a stage.
    pub(crate) fn failed(stage: &'static str, failure: Failure) -> Self {
        Self::Stage { stage, source: failure.source, class: failure.class }
    }

    /// Puts a stage's own error under the stage's name.
    pub fn in_stage<E>(stage: &'static str) -> impl FnOnce(E) -> Self
    where
        E: Classified + std::error::Error + Send + Sync + 'static,
    {
        move |error| Self::Stage { stage, class: error.error_class(), source: Box::new(error) }
    }

    /// What else of its scan would be read, where that would help, and why.
    pub fn offer(&self) -> Option<(&Offer, &str)> {
        match self {
            Self::Stage { source, .. } => source.downcast_ref::<OfScan>()?.0.offer(),
            Self::OverMemory { .. }
            | Self::Scene { .. }
            | Self::WrongKind { .. }
            | Self::Artefact(_)
            | Self::Core(_)
            | Self::Damaged(_)
            | Self::Limit(_)
            | Self::Figure { .. }
            | Self::Io { .. } => None,
        }
    }

    /// Puts what a reader says of the scan itself, not of another file, under the stage's name.
    pub(crate) fn of_scan(stage: &'static str) -> impl FnOnce(ivd_io::volume::Error) -> Self {
        move |error| Self::Stage { stage, class: error.error_class(), source: Box::new(OfScan(error)) }
    }

    /// A wrong combination of parameters, in the words of the program and the scene.
    pub fn usage(stage: &'static str, problem: impl Into<String>) -> Self {
        Self::Stage { stage, source: problem.into().into(), class: ErrorClass::Usage }
    }
}

/// What a reader says of the scan itself.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
struct OfScan(ivd_io::volume::Error);
