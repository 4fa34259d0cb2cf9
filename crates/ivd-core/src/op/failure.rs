use crate::{Classified, ErrorClass};

/// Why a method failed: its crate's own error, and what kind of failure that is.
#[derive(Debug)]
pub struct Failure {
    /// The error.
    pub source: Box<dyn std::error::Error + Send + Sync>,
    /// Its kind.
    pub class: ErrorClass,
}

impl Failure {
    /// A wrong combination of parameters and inputs, in the words of a scene or a command line.
    pub fn usage(problem: impl Into<String>) -> Self {
        Self { source: problem.into().into(), class: ErrorClass::Usage }
    }
}

impl<E: Classified + Send + Sync + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        let class = error.error_class();
        Self { source: Box::new(error), class }
    }
}
