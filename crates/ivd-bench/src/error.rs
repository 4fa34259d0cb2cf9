/// Why a bench could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A stage that has no experiment.
    #[error("stage `{name}` has no bench; there are {}", known.join(", "))]
    UnknownStage {
        /// The name asked for.
        name: String,
        /// The stages there are.
        known: Vec<String>,
    },
    /// A setting failed.
    #[error("{stage} with {knobs}: {problem}")]
    Failed {
        /// The stage.
        stage: String,
        /// The setting.
        knobs: String,
        /// What went wrong.
        problem: String,
    },
    /// The error of a result is no number.
    #[error("{stage} with {knobs}: its error is {value}; the result holds what is no number")]
    NoNumber {
        /// The stage.
        stage: String,
        /// The setting.
        knobs: String,
        /// The error found.
        value: f64,
    },
    /// The run was cancelled, or memory is short.
    #[error(transparent)]
    Core(#[from] ivd_core::Error),
}
