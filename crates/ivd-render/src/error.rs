use ivd_core::{Classified, ErrorClass};

/// Why a picture could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A failure that any stage can meet.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
    /// Direct volume rendering without a transfer function.
    #[error(
        "direct volume rendering of this scene needs a transfer function; give one, or use mode mip or iso"
    )]
    NoTransfer,
    /// Pre-integration with colours by label or gradient.
    #[error(
        "pre-integrated pictures need a transfer function of the value alone, and this one goes by label or gradient; render without labels, by a table of values, or with classification post"
    )]
    NotByValue,
    /// A legend of colours that don't go by value alone.
    #[error(
        "a legend tells colours by value, and this transfer function goes by label or gradient, or shows nothing; leave `legend` out, or make a table of values (axes = \"value\")"
    )]
    NoLegend,
    /// Shear-warp from among the slices.
    #[error(
        "mode shear-warp looks at slices from before them, and the eye lies among or behind them; look from further away, or use mode slices or dvr"
    )]
    EyeAmongSlices,
    /// Pictures of different size can't be compared.
    #[error("pictures of {a:?} and {b:?} pixels can't be compared; render both at one size")]
    SizeMismatch {
        /// Width and height of the first.
        a: [usize; 2],
        /// Width and height of the second.
        b: [usize; 2],
    },
    /// A turntable and one of more or fewer pictures can't be compared.
    #[error("{a} pictures and {b} can't be compared; render both with one turntable")]
    FramesMismatch {
        /// Pictures of the first.
        a: usize,
        /// Pictures of the second.
        b: usize,
    },
}

ivd_core::from_param_error!(Error);

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Core(error) => error.error_class(),
            Self::NoTransfer
            | Self::NotByValue
            | Self::NoLegend
            | Self::EyeAmongSlices
            | Self::SizeMismatch { .. }
            | Self::FramesMismatch { .. } => ErrorClass::Usage,
        }
    }
}
