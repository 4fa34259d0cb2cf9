//! What is written to be kept, as the bytes of files.

use std::path::Path;

use ivd_core::{Artefact, Exec, Value as _};
use ivd_pipeline::{ExportOptions, export_with};

use crate::{Error, Model, Saved};

/// A file to be kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// What it may be called.
    pub name: &'static str,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// What the name of a scan may end in, in a scene that leaves the window: what it is called here stays untold.
const ENDINGS: [&str; 13] =
    ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif", "tiff", "raw", "dcm", "png", "ivd"];

impl Model {
    /// Writes what was asked for; `log`: the lines so far.
    ///
    /// # Errors
    /// Settings that no scene has, a file that can't be written.
    pub fn save(&self, what: Saved, log: &[String], exec: &Exec) -> Result<File, Error> {
        let file = |name, bytes| Ok(File { name, bytes });
        match what {
            Saved::Scene => file("scene.toml", self.scene_text()?.into_bytes()),
            Saved::Log => file("session.jsonl", log.join("\n").into_bytes()),
            Saved::Picture => {
                let image = self.draw(crate::Pane::Volume, 1, exec)?;
                file("picture.png", ivd_pipeline::png_bytes(&image)?)
            }
            Saved::Volume => {
                let volume = self.session().deformed().clone().into_artefact();
                file("deformed.nii.gz", written("deformed.nii.gz", &volume, ExportOptions::default(), exec)?)
            }
            Saved::Displacement => {
                let field = self.session().displacement().clone().into_artefact();
                file("inverse.nrrd", written("inverse.nrrd", &field, ExportOptions::default(), exec)?)
            }
            Saved::Lattice => {
                let lattice = self.session().lattice();
                let options = ExportOptions { lattice: Some(lattice), ..ExportOptions::default() };
                let artefact = match self.session().motion() {
                    Some(motion) => motion.clone().into_artefact(),
                    None => lattice.clone().into_artefact(),
                };
                file("lattice.ply", written("lattice.ply", &artefact, options, exec)?)
            }
        }
    }

    /// The scene that `ivd pipeline` makes the same of as is shown.
    fn scene_text(&self) -> Result<String, Error> {
        let mut scene = self.subject().scene_of(self.session().settings())?;
        let mut head = String::from("# Made by hand in a window.");
        if let Some(file) = &scene.input.file {
            let ending = ivd_pipeline::ending(file);
            // A folder's name may end in anything.
            let name = if ENDINGS.contains(&&*ending) { format!("scan.{ending}") } else { "scan".to_owned() };
            head += " Where the scan lies is told by --input, or here.";
            scene.set_input(Path::new(&name));
        }
        scene.set_output(self.session().displacement().is_identity());
        Ok(format!("{head}\n{}", scene.to_text()?))
    }
}

/// The bytes of an artefact's file.
fn written(
    name: &str,
    artefact: &Artefact,
    options: ExportOptions<'_>,
    exec: &Exec,
) -> Result<Vec<u8>, Error> {
    // Where files lie on this machine is said on its terminal alone.
    let failed = |error: &dyn std::fmt::Display| {
        exec.observer().note(&format!("{name} can't be written: {error}"));
        Error::Io {
            what: "a file to be kept",
            problem: format!("{name} can't be written; ivd says why where it runs"),
        }
    };
    let folder = tempfile::tempdir().map_err(|error| failed(&error))?;
    let path = folder.path().join(name);
    export_with(artefact, &path, &options, exec).map_err(|error| failed(&error))?;
    std::fs::read(&path).map_err(|error| failed(&error))
}
