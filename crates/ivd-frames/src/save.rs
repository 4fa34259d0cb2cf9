//! What is written to be kept, as the bytes of files.

use std::path::{Path, PathBuf};

use ivd_core::{Artefact, Exec, Value as _};
use ivd_pipeline::scene::{InputFiles, Scene, parse};
use ivd_pipeline::{ExportOptions, export_with};

use crate::{Error, Log, Model, Saved};

/// A file to be kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// What it holds.
    pub what: Saved,
    /// What it may be called.
    pub name: &'static str,
    /// What is in it.
    pub bytes: Vec<u8>,
    /// Where the files lie that what is shown was read from, which isn't told in it.
    from: InputFiles,
}

/// How a scene from a window begins.
const MADE: &str = "# Made by hand in a window.";
/// What the name of a scan may end in, in a scene that leaves the window: what it is called here stays untold.
const ENDINGS: [&str; 13] =
    ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif", "tiff", "raw", "dcm", "png", "ivd"];

impl Model {
    /// Writes what was asked for; `log`: its text so far, where it is asked for.
    ///
    /// # Errors
    /// Settings that no scene has, a file that can't be written.
    pub fn save(&self, what: Saved, log: String, exec: &Exec) -> Result<File, Error> {
        let name = what.name();
        let bytes = match what {
            Saved::Scene => self.scene_text()?.into_bytes(),
            Saved::Log => log.into_bytes(),
            Saved::Picture => ivd_pipeline::png_bytes(&self.draw(crate::Pane::Volume, 1, exec)?)?,
            Saved::Volume | Saved::Whole => {
                let session = self.session();
                let volume = if what == Saved::Whole { session.whole() } else { session.deformed() };
                let volume = volume.clone().into_artefact();
                written(name, &volume, ExportOptions::default(), exec)?
            }
            Saved::Labels => {
                let labels = self.session().shown_labels().ok_or_else(|| Error::Request {
                    what: "save",
                    problem: "no labels of its parts are shown".to_owned(),
                    remedy: "open it with labels (--labels FILE, or File ▸ Open labels of a window), and let one of these parts move (boundary.class)",
                })?;
                written(name, &labels.clone().into_artefact(), ExportOptions::default(), exec)?
            }
            Saved::Displacement => {
                let field = self.session().displacement().clone().into_artefact();
                written(name, &field, ExportOptions::default(), exec)?
            }
            Saved::Lattice => {
                let lattice = self.session().lattice();
                let options = ExportOptions { lattice: Some(lattice), ..ExportOptions::default() };
                let artefact = match self.session().motion() {
                    Some(motion) => motion.clone().into_artefact(),
                    None => lattice.clone().into_artefact(),
                };
                written(name, &artefact, options, exec)?
            }
        };
        Ok(File { what, name, bytes, from: self.subject().files.clone() })
    }

    /// The first line of the log: the scene that it began with.
    pub(crate) fn log_head(&self) -> Result<String, Error> {
        Ok(Log::head(&told(self.subject().scene.clone())?))
    }

    /// The scene that `ivd pipeline` makes the same voxels and displacement of as are shown.
    fn scene_text(&self) -> Result<String, Error> {
        let mut scene = self.subject().scene_of(self.session().settings())?;
        self.write_looks(&mut scene)?;
        self.write_view(&mut scene)?;
        scene.set_window(self.section())?;
        scene.set_output(self.session().displacement().is_identity());
        told(scene)
    }
}

/// The text of a scene that leaves the window.
fn told(mut scene: Scene) -> Result<String, Error> {
    let mut head = String::from(MADE);
    let files = scene.input_files();
    if !files.is_empty() {
        head += if files.file.is_some() {
            " The scan's path is given by --input or below, that of other files of its input below."
        } else {
            " The path of its labels, or of other files of its input, is given below."
        };
        if files.series.is_some() {
            head += " Which series of the folder it is has to be said again (--set input.series=).";
        }
        let files = files.renamed(|key, file| {
            let (ending, name) = (ivd_pipeline::ending(file), if key == "file" { "scan" } else { key });
            // A folder's name may end in anything.
            if ENDINGS.contains(&&*ending) { format!("{name}.{ending}").into() } else { name.into() }
        });
        scene.set_input_files(InputFiles { series: None, ..files });
    }
    Ok(format!("{head}\n{}", scene.to_text()?))
}

impl File {
    /// The same where it may say what the files are called that what is shown was read from: a scene or a log.
    ///
    /// - `name`: by what path a file is found from the folder that this is written into. Scenes with absolute paths aren't read.
    ///
    /// # Errors
    /// Bytes that aren't those of a scene or a log.
    pub fn naming(mut self, name: impl Fn(&Path) -> PathBuf) -> Result<Self, Error> {
        if self.from.is_empty() {
            return Ok(self);
        }
        let wrong = |problem: String| Error::Io { what: "a file to be kept", problem };
        let named = |text: &str| {
            let mut scene = parse(text, &[]).map_err(wrong)?;
            scene.set_input_files(self.from.clone().renamed(|_, file| name(file)));
            Ok::<_, Error>(format!("{MADE}\n{}", scene.to_text()?))
        };
        let text = || String::from_utf8(self.bytes.clone()).map_err(|error| wrong(error.to_string()));
        self.bytes = match self.what {
            Saved::Scene => named(&text()?)?.into_bytes(),
            Saved::Log => {
                let text = text()?;
                let (head, lines) = text.split_once('\n').unwrap_or((&text, ""));
                let scene = Log::scene_of(head).map_err(wrong)?;
                format!("{}\n{lines}", Log::head(&named(&scene)?)).into_bytes()
            }
            _ => return Ok(self),
        };
        Ok(self)
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
