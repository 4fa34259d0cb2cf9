/// A parameter outside its domain. Every stage's `Params::check` returns this.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("parameter `{field}`: {problem}; {remedy}")]
pub struct ParamError {
    /// The field as it is written in a scene or on the command line; a dot before what lies inside it.
    pub field: String,
    /// What is wrong, with the value.
    pub problem: String,
    /// What to do instead.
    pub remedy: String,
}

impl ParamError {
    /// A parameter error about `field`.
    pub fn new(field: impl Into<String>, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { field: field.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// A problem of the value that is looked at; [`ParamError::under`] says where that stands.
    pub fn at_itself(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new("", problem, remedy)
    }

    /// The same problem, seen from around it.
    #[must_use]
    pub fn under(mut self, key: &str) -> Self {
        self.field = if self.field.is_empty() { key.to_owned() } else { format!("{key}.{}", self.field) };
        self
    }

    /// What is wrong and what to do, after the place where a user has typed it.
    pub fn told_of(&self, place: &str) -> String {
        let place = if place.is_empty() || self.field.is_empty() {
            format!("{place}{}", self.field)
        } else {
            format!("{place}.{}", self.field)
        };
        format!("{place}: {}; {}", self.problem, self.remedy)
    }
}

/// What kind of failure an error is; programs end with its exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorClass {
    /// Wrong usage, parameters or scene (exit 2).
    Usage,
    /// Input unreadable, inconsistent or hostile (exit 3).
    Input,
    /// A limit on memory, size or time was hit (exit 4).
    Limit,
    /// The result can't be trusted: diverged, folded, not finite (exit 5).
    Untrusted,
    /// A GPU was required and there is none (exit 6).
    NoGpu,
    /// Reading or writing failed (exit 7).
    Io,
    /// Interrupted (exit 130).
    Cancelled,
}

impl ErrorClass {
    /// What a program ends with that fails so.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Usage => 2,
            Self::Input => 3,
            Self::Limit => 4,
            Self::Untrusted => 5,
            Self::NoGpu => 6,
            Self::Io => 7,
            Self::Cancelled => 130,
        }
    }
}

/// An error that knows what kind of failure it is.
pub trait Classified: std::error::Error {
    /// What kind of failure it is.
    fn error_class(&self) -> ErrorClass;
}

impl Classified for ParamError {
    fn error_class(&self) -> ErrorClass {
        ErrorClass::Usage
    }
}

/// Why a grid can't exist.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridError {
    /// A dimension is zero, or their product overflows.
    #[error(
        "grid of {0:?} voxels: every dimension must be at least 1 and the product must fit in memory addresses"
    )]
    Dims([usize; 3]),
    /// A spacing is not a positive number of a size that can be multiplied.
    #[error("spacing {0:?} mm: every spacing must be positive, from 1e-12 to 1e12 mm")]
    Spacing([f64; 3]),
    /// The direction matrix can't be inverted or has columns that aren't unit vectors.
    #[error("direction {0:?} (columns of the voxel axes): must be invertible with unit columns")]
    Direction([[f64; 3]; 3]),
    /// The origin is not finite, or so far off that voxels beside each other would be at one place.
    #[error("origin {0:?} mm: must be finite, at most 1e15 mm from 0")]
    Origin([f64; 3]),
}

/// Failures that any stage can meet. Stage crates wrap it in their own `Error` with `#[from]`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The caller asked to stop through [`crate::Cancel`].
    #[error("cancelled")]
    Cancelled,
    /// The deadline of [`crate::Cancel::until`] has passed.
    #[error("the time given is up")]
    Deadline,
    /// The work would need more memory than [`crate::Exec::memory_limit`] allows.
    #[error(
        "{what} needs {needed} bytes, more than the memory limit of {limit} bytes; raise --memory-limit or crop the volume"
    )]
    MemoryLimit {
        /// What was about to be allocated.
        what: String,
        /// Bytes it needs.
        needed: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// Bulk data beyond the memory limit could not be put elsewhere.
    #[error(
        "{what} exceed the memory limit, and there is no room for them elsewhere: {problem}; free some, or raise --memory-limit"
    )]
    Spill {
        /// The data.
        what: &'static str,
        /// What the host says.
        problem: String,
    },
    /// A parameter is outside its domain.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// A grid that can't exist.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Two inputs that must lie on one grid don't.
    #[error(
        "{a} ({a_dims:?}) and {b} ({b_dims:?}) lie on different grids{}; use inputs made from the same volume, or put one onto the grid of the \
         other{}{}",
        if a_dims == b_dims { ": their spacing, origin or axes differ" } else { "" },
        put_by([a, b]),
        if a_dims == b_dims {
            "; a file whose header is wrong takes the other's grid as it is (`ivd import FILE --grid-of OTHER` does)"
        } else {
            ""
        }
    )]
    GridMismatch {
        /// First input.
        a: &'static str,
        /// Its dims.
        a_dims: [usize; 3],
        /// Second input.
        b: &'static str,
        /// Its dims.
        b_dims: [usize; 3],
    },
    /// The labels have no voxel of the class.
    #[error("no voxel has class {id}; the labels have {known}")]
    NoSuchClass {
        /// The class asked for.
        id: u16,
        /// The classes there are, with their means and sizes.
        known: String,
    },
    /// Data whose length doesn't fit its shape, or that breaks an invariant of its type.
    #[error("inconsistent {what}: {problem}")]
    Inconsistent {
        /// The value.
        what: &'static str,
        /// What doesn't fit.
        problem: String,
    },
    /// Two inputs that don't belong together, such as a motion of another lattice.
    #[error("{what}: {problem}; {remedy}")]
    Mismatch {
        /// The input.
        what: &'static str,
        /// What doesn't fit, with the numbers.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
    /// A device that must serve doesn't.
    #[error("{kernel} on the GPU: {problem}; the processor can make it")]
    Device {
        /// The pass.
        kernel: &'static str,
        /// What happened.
        problem: String,
    },
    /// A result that can't be trusted: diverged, not finite.
    #[error("{what} can't be trusted: {problem}; {remedy}")]
    Untrusted {
        /// The result.
        what: &'static str,
        /// The number that shows it, and where.
        problem: String,
        /// What to do instead.
        remedy: &'static str,
    },
}

impl Classified for Error {
    fn error_class(&self) -> ErrorClass {
        match self {
            Self::Cancelled => ErrorClass::Cancelled,
            Self::Spill { .. } => ErrorClass::Io,
            Self::MemoryLimit { .. } | Self::Deadline => ErrorClass::Limit,
            Self::Param(_) | Self::GridMismatch { .. } | Self::Mismatch { .. } | Self::NoSuchClass { .. } => {
                ErrorClass::Usage
            }
            Self::Untrusted { .. } => ErrorClass::Untrusted,
            Self::Device { .. } => ErrorClass::NoGpu,
            Self::Grid(_) | Self::Inconsistent { .. } => ErrorClass::Input,
        }
    }
}

/// The commands that put inputs of these names onto the grid of a volume; nothing where there is none.
fn put_by(names: [&str; 2]) -> String {
    let kinds = [
        (&["labels", "--labels", "seeds"][..], "`ivd import LABELS --labels --like VOLUME`"),
        (&["mask", "part", "other", "start", "blocked"], "`ivd import MASK --mask --like VOLUME`"),
        (&["displacement"], "`ivd import FIELD --displacement --like VOLUME`, with another program's field,"),
    ];
    let commands = kinds.iter().filter(|(known, _)| names.iter().any(|name| known.contains(name)));
    let commands: Vec<&str> = commands.map(|(_, command)| *command).collect();
    match &commands[..] {
        [] => String::new(),
        [only] => format!(" ({only} does)"),
        several => format!(" ({} do)", several.join(" and ")),
    }
}

/// Lets a crate's own error, which has [`Error`] in its `Core`, take a [`ParamError`] too.
#[macro_export]
macro_rules! from_param_error {
    ($error:ty) => {
        impl From<$crate::ParamError> for $error {
            fn from(error: $crate::ParamError) -> Self {
                Self::Core(error.into())
            }
        }
    };
}
