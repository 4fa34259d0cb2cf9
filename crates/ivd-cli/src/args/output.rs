use std::path::PathBuf;

use clap::Args as ClapArgs;

/// Where a stage's artefact goes.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct Output {
    /// Artefact file.
    #[arg(short = 'o', long = "output", value_name = "FILE.ivd")]
    pub(crate) path: PathBuf,
}
