use std::path::PathBuf;

use clap::Args;
use ivd_pipeline::scene::Override;

/// `ivd view`.
#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// Scan, scene (.toml), saved log (.jsonl), or the word demo. Without it the window asks for a file.
    #[arg(value_name = "FILE|SCENE|SESSION|demo")]
    pub(crate) file: Option<PathBuf>,
    /// Use this scan instead of the scene's.
    #[arg(long, value_name = "FILE", requires = "file")]
    pub(crate) input: Option<PathBuf>,
    /// Labels of the scan by another program, such as a file of organs; boundary.class says which of them moves.
    #[arg(long, value_name = "FILE", requires = "file")]
    pub(crate) labels: Option<PathBuf>,
    /// Override a key of the scene, or of the default scene that a bare scan is opened with, such as lattice.iso=60.
    #[arg(long = "set", value_name = "stage.key=value", requires = "file")]
    pub(crate) overrides: Vec<Override>,
}
