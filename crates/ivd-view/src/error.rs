use ivd_core::{Classified, ErrorClass};

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What was to be opened can't be read.
    #[error(transparent)]
    Frames(#[from] ivd_frames::Error),
    /// The system shows no window.
    #[error(
        "there is no window: {0}; it needs a screen and a driver for Vulkan, Metal or Direct3D 12 (mesa-vulkan-drivers has one for the processor); `ivd serve` needs neither"
    )]
    Screen(String),
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Frames(error) => error.error_class(),
            Self::Screen(_) => ErrorClass::Io,
        }
    }
}
