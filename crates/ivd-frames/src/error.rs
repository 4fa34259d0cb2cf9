use ivd_core::{Classified, ErrorClass};
use ivd_pipeline::Offer;

/// Why a window can't show something, or a request wasn't followed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The scene or one of its stages.
    #[error(transparent)]
    Pipeline(#[from] ivd_pipeline::Error),
    /// The session.
    #[error(transparent)]
    Session(#[from] ivd_session::Error),
    /// A picture.
    #[error(transparent)]
    Render(#[from] ivd_render::Error),
    /// Values that don't fit, a limit, cancellation.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// A scene with a part that a session doesn't have.
    #[error("scene: {part}: a session has none; `ivd pipeline` runs this scene")]
    NotInSessions {
        /// Section or key.
        part: String,
    },
    /// A request that can't be followed here.
    #[error("{what}: {problem}; {remedy}")]
    Request {
        /// Which.
        what: &'static str,
        /// What is wrong.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
    /// A file that couldn't be written or read.
    #[error("{what}: {problem}")]
    Io {
        /// What of.
        what: &'static str,
        /// What the system says.
        problem: String,
    },
}

impl Error {
    /// What else of the scan could be opened, where that would help, and why.
    pub fn offer(&self) -> Option<(&Offer, &str)> {
        match self {
            Self::Pipeline(error) => error.offer(),
            _ => None,
        }
    }
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Pipeline(error) => error.error_class(),
            Self::Session(error) => error.error_class(),
            Self::Render(error) => error.error_class(),
            Self::Core(error) => error.error_class(),
            Self::NotInSessions { .. } | Self::Request { .. } => ErrorClass::Usage,
            Self::Io { .. } => ErrorClass::Io,
        }
    }
}
