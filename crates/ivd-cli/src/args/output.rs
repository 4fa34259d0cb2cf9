use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;

/// Where a stage's artefact goes.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct Output {
    /// Artefact file.
    #[arg(short = 'o', long = "output", value_name = "FILE.ivd", value_parser = artefact_file)]
    pub(crate) path: PathBuf,
}

/// A name for an artefact, as it is typed.
pub(crate) fn artefact_file(name: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(name);
    check_artefact_name(&path)?;
    Ok(path)
}

/// Refuses a name for an artefact that says that the file is of another format.
pub(crate) fn check_artefact_name(path: &Path) -> Result<(), String> {
    if !ivd_pipeline::is_of_another_format(path) {
        return Ok(());
    }
    Err(format!(
        "{}: what is written is an artefact of this program, which nothing reads as .{}; name it .ivd, and `ivd export` makes of that what others read",
        path.display(),
        ivd_pipeline::ending(path)
    ))
}
