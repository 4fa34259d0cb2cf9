use std::path::PathBuf;

use clap::Args;
use ivd_pipeline::scene::Override;

/// `ivd serve`.
#[derive(Debug, Args)]
pub(crate) struct ServeArgs {
    /// Scan, or scene (.toml). Default: the generated head of `ivd demo`.
    #[arg(value_name = "FILE|SCENE")]
    pub(crate) file: Option<PathBuf>,
    /// Use this scan instead of the scene's.
    #[arg(long, value_name = "FILE")]
    pub(crate) input: Option<PathBuf>,
    /// Labels of the scan by another program, such as a file of organs; boundary.class says which of them moves.
    #[arg(long, value_name = "FILE", requires = "file")]
    pub(crate) labels: Option<PathBuf>,
    /// Override a key of the scene, or of the default scene that a bare scan is opened with, such as lattice.iso=60.
    #[arg(long = "set", value_name = "stage.key=value")]
    pub(crate) overrides: Vec<Override>,
    /// Port on 127.0.0.1; 0 for any that is free. From another machine: ssh -L PORT:127.0.0.1:PORT.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) port: u16,
    /// Listen at a socket in the file system instead, which only you can open: ssh -L PORT:PATH.
    #[arg(long, value_name = "PATH", conflicts_with = "port")]
    pub(crate) socket: Option<PathBuf>,
}
