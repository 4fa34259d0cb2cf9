//! The scene file: what a user asks for, in TOML, `schema = 1`.
//!
//! An unknown key is an error with a suggestion; paths are relative to the scene's folder. [`load`] reads a
//! file with overrides (`--set stage.key=value`) applied before anything is checked.

mod load;
mod read;
mod schema;
mod sections;
mod stage_sections;
mod targets;
mod written;

use std::path::{Path, PathBuf};

use ivd_core::op::{Op, Stage, Want};
use ivd_field::clip::{SceneClip, Whose};
use ivd_field::combine::SceneCombine;
use ivd_map::space::SpaceParams;
use ivd_motion::deform::Asked;
use ivd_render::RenderParams;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};

use crate::pictures::{check_pictures, is_animation};
use crate::{Error, Section, ending};

pub use load::{Loaded, MAX_SCENE_BYTES, Override, load, parse, read_text_limited, truncate_lines};
pub use sections::{
    Body, InputFiles, InputSection, Inside, MeshSpace, OutputSection, Over, Picture, RawSection,
    RulerSection, WindowSection,
};
pub(crate) use sections::{OF_FRAMES, PICTURES, REPORT, SERIES, SIDE_BY_SIDE, WIPE, picture_file};
pub(crate) use stage_sections::Written;
use stage_sections::stage_sections;
pub(crate) use targets::{Target, targets};
pub use written::triple;

/// The name of a stage of the list.
fn stage_name(stage: &Stage) -> &'static str {
    crate::list::stage(stage.name).map_or("scene", |stage| stage.name)
}

/// A scene: every section is optional but `input` and `output`.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Scene {
    /// Version of the scene file; 1.
    pub schema: u32,
    /// Where the volume comes from.
    pub input: InputSection,
    /// What is wanted; nothing else is computed.
    pub output: OutputSection,
    /// What windows show.
    pub window: Option<WindowSection>,
    /// Every section as it is written.
    #[schemars(skip)]
    pub(crate) written: Written,
    /// The stages of the list, in its order.
    #[schemars(skip)]
    pub(crate) sections: Vec<Section>,
}

impl Scene {
    /// The scene's JSON Schema.
    pub fn json_schema() -> serde_json::Value {
        schema::with_stages(schemars::schema_for!(Scene).to_value())
    }

    /// The section of a stage, or what it is where the scene has none.
    pub fn section(&self, stage: &Stage) -> Option<&Section> {
        self.sections.iter().find(|section| section.stage().name == stage.name)
    }

    /// The sections of all stages, written or not.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// The parameters of a stage, where the scene chooses the method that has them.
    pub fn get<O: Op>(&self, stage: &Stage) -> Option<&O> {
        self.section(stage)?.get()
    }

    /// Parameters that all methods of a stage have, as its crate declares them.
    pub fn common<T: DeserializeOwned>(&self, stage: &Stage) -> Option<T> {
        serde_json::from_value(Json::Object(self.section(stage)?.job().params())).ok()
    }

    /// The value in force under a stage's key; `None` where its method has no such key, or nothing is said and that is its default.
    pub fn param(&self, stage: &Stage, key: &str) -> Option<Json> {
        self.section(stage)?.job().params().remove(key).filter(|value| !value.is_null())
    }

    /// Writes keys into a stage's section, without what is null in their values; `None` takes one out.
    ///
    /// # Errors
    /// A key or a value that the section doesn't take.
    pub fn set(&mut self, stage: &Stage, keys: &[(&str, Option<Json>)]) -> Result<(), Error> {
        let section = self.written.entry(stage.name.to_owned()).or_insert_with(|| Json::Object(Map::new()));
        if let Json::Object(section) = section {
            for (key, value) in keys {
                match value.clone() {
                    Some(mut value) => {
                        drop_nulls(&mut value);
                        section.insert((*key).to_owned(), value)
                    }
                    None => section.remove(*key),
                };
            }
        }
        self.sections = stage_sections(&self.written)
            .map_err(|problem| Error::usage(stage_name(stage), problem.told_of("")))?;
        Ok(())
    }

    /// Takes a stage's section out.
    ///
    /// # Errors
    /// A section that can't do without it.
    pub fn remove(&mut self, stage: &Stage) -> Result<(), Error> {
        self.written.remove(stage.name);
        self.sections = stage_sections(&self.written)
            .map_err(|problem| Error::usage(stage_name(stage), problem.told_of("")))?;
        Ok(())
    }

    /// The files that the input is read from.
    pub fn input_files(&self) -> InputFiles {
        let InputSection { file, labels, start, grid_of, series, .. } = self.input.clone();
        InputFiles { file, labels, start, grid_of, series }
    }

    /// Names other files, in the place of those that it is read from or generated.
    pub fn set_input_files(&mut self, files: InputFiles) {
        let input = self.written.entry("input".to_owned()).or_insert_with(|| Json::Object(Map::new()));
        if let Json::Object(input) = input {
            for (key, file) in files.named() {
                match file {
                    Some(file) => input.insert(key.to_owned(), file.to_string_lossy().into()),
                    None => input.remove(key),
                };
            }
            match &files.series {
                Some(series) => input.insert("series".to_owned(), series.as_str().into()),
                None => input.remove("series"),
            };
            if files.file.is_some() {
                input.remove("phantom");
            }
        }
        let InputFiles { file, labels, start, grid_of, series } = files;
        let phantom = self.input.phantom.filter(|_| file.is_none());
        self.input =
            InputSection { file, start, labels, series, grid_of, phantom, ..std::mem::take(&mut self.input) };
    }

    /// Names a file of labels, in the place of what would find them.
    ///
    /// # Errors
    /// A scene that can't do without that.
    pub fn set_labels(&mut self, labels: PathBuf) -> Result<(), Error> {
        self.set_input_files(InputFiles { labels: Some(labels), ..self.input_files() });
        self.remove(&ivd_segment::STAGE)
    }

    /// Says what windows show; nothing where that is what they show unasked.
    ///
    /// # Errors
    /// What no window shows.
    pub fn set_window(&mut self, window: WindowSection) -> Result<(), Error> {
        window.check().map_err(|problem| Error::usage("scene", problem))?;
        self.written.remove("window");
        self.window = Some(window).filter(|window| *window != WindowSection::default());
        if let Some(window) = &self.window {
            self.written.insert("window".to_owned(), serde_json::json!(window));
        }
        Ok(())
    }

    /// Asks for pictures, what becomes of the volume and its displacement; of a scene that moves nothing for no displacement, and of one
    /// that neither combines nor clips it either for a picture alone.
    pub fn set_output(&mut self, still: bool) {
        let same = still && !self.has_result();
        let images = if same { vec![Picture::Before] } else { vec![Picture::Before, Picture::After] };
        let file = |name: &str, made: bool| made.then(|| name.into());
        let (volume, displacement) = (file("deformed.nii.gz", !same), file("inverse.nrrd", !still));
        self.output = OutputSection { images, volume, displacement, ..OutputSection::default() };
        let names: Vec<&str> = self.output.images.iter().map(|picture| picture.name()).collect();
        let mut output = Map::new();
        output.insert("images".to_owned(), names.into());
        output.extend(
            self.output
                .files()
                .into_iter()
                .map(|(key, file)| (key.to_owned(), file.to_string_lossy().into())),
        );
        self.written.insert("output".to_owned(), Json::Object(output));
    }

    /// The scene as a text that [`parse`] makes the same scene of: its sections as they were written, and set since.
    ///
    /// # Errors
    /// A value that TOML doesn't have.
    pub fn to_text(&self) -> Result<String, Error> {
        let table = toml::Table::try_from(&self.written);
        table.and_then(|table| toml::to_string(&table)).map_err(|e| Error::usage("scene", e.to_string()))
    }

    /// Checks what the type system can't: ranges and combinations. The text names section and key.
    ///
    /// # Errors
    /// A sentence with the key, what is wrong and what to do.
    pub fn check(&self) -> Result<(), String> {
        if self.schema != 1 {
            return Err(format!("schema = {}: this program reads schema = 1", self.schema));
        }
        match (&self.input.file, self.input.phantom) {
            (Some(_), Some(_)) => return Err("input: give file or phantom, not both".into()),
            (None, None) => {
                return Err(
                    "input: give file = \"…\" or phantom = \"head\", also where --input gives the file"
                        .into(),
                );
            }
            _ => {}
        }
        if let Some(file) = &self.input.file {
            check_beside("input.file", file).map_err(|problem| problem + ", or use --input")?;
        }
        if let Some(window) = &self.window {
            window.check()?;
        }
        self.check_grid_of()?;
        self.check_start()?;
        self.check_labels()?;
        self.check_parts()?;
        let (deforms, result, input) = (self.deforms(), self.has_result(), self.clips_input());
        let moved = [
            ("output.volume", self.output.volume.is_some() && !result && !input),
            ("output.labels_deformed", self.output.labels_deformed.is_some()),
            ("output.mask_deformed", self.output.mask_deformed.is_some()),
            ("output.displacement", self.output.displacement.is_some()),
            ("output.images \"moved\"", self.output.images.contains(&Picture::Moved)),
            (
                "output.images \"after\" or \"difference\"",
                self.output.images.iter().any(|p| *p != Picture::Before) && !result,
            ),
            ("output.side_by_side", self.output.side_by_side.is_some() && !result),
            ("output.wipe", self.output.wipe.is_some() && !result),
        ];
        let still = self.asked().is_none_or(|asked| asked.is_still());
        if let Some((name, _)) = moved.iter().find(|(_, wanted)| !deforms && *wanted) {
            return Err(format!(
                "{name} shows a deformation, but there is no [[deform.handle]], [[deform.rigid]], [[deform.shape]] or [[space.step]]; \
                 add one or drop the output"
            ));
        }
        if self.output.images.contains(&Picture::Moved) && !self.shows_a_surface() {
            return Err("output.images \"moved\" is for render.mode = \"dvr\" or \"iso\", which show a surface; drop it, or choose one of them".to_owned());
        }
        let in_motion = [
            ("lattice_deformed", &self.output.lattice_deformed),
            ("animation", &self.output.animation),
            (SERIES, &self.output.volume_series),
            (PICTURES, &self.output.picture_series),
        ];
        if let Some((name, _)) = in_motion.iter().find(|(_, wanted)| wanted.is_some() && still) {
            return Err(format!(
                "output.{name} shows the lattice's motion, but there is no [[deform.handle]], [[deform.rigid]] or \
                 [[deform.shape]]; a [[space.step]] moves voxels only"
            ));
        }
        self.check_frames()?;
        self.output.check_endings()?;
        targets::check_outputs(&self.output)?;
        for (name, path) in self.output.files() {
            if path.is_absolute() || path.components().any(|c| matches!(c, std::path::Component::ParentDir)) {
                return Err(format!(
                    "output.{name} = {}: name a file inside the output folder",
                    path.display()
                ));
            }
            if self.output.space.is_some() && crate::export::ending(path) == "glb" {
                return Err(format!(
                    "output.{name} = {}: glb has axes of its own, metres with y up; drop output.space, or name a ply, obj, stl or vtp",
                    path.display()
                ));
            }
        }
        let steps = self.steps();
        ivd_map::space::check(steps, !still).map_err(|e| format!("space: {e}"))?;
        if !steps.is_empty() && !still && self.map_is_free() {
            return Err(
                "map.outside = \"free\": a part that moved alone leaves a gap, and no [[space.step]] goes on across that; drop \
                 one of them"
                    .into(),
            );
        }
        Ok(())
    }

    /// Frames are written to what holds frames, and asked for once.
    fn check_frames(&self) -> Result<(), String> {
        let RenderParams { turntable, keep_light, .. } = self.common(&ivd_render::STAGE).unwrap_or_default();
        if self.output.wipe.is_some() && turntable > 1 {
            return Err("output.wipe is of two pictures, and render.turntable asks for turns of them; leave one of the two out".to_owned());
        }
        if let Some(path) = &self.output.animation
            && !["glb", "pvd"].contains(&&*ending(path))
        {
            return Err(format!(
                "output.animation = {}: a motion is written as .glb or .pvd; other meshes stand still (output.lattice_deformed)",
                path.display()
            ));
        }
        let frame =
            self.section(&ivd_map::STAGE).and_then(|section| section.job().params().get("frame").cloned());
        if let Some(path) = self.output.picture_series.as_deref() {
            check_pictures(path, turntable, keep_light)
                .map_err(|error| format!("output.{PICTURES}: {error}"))?;
            if is_animation(path) && turntable > 1 {
                return Err(format!(
                    "output.{PICTURES} = {}: an animation of turntables; write .png, or leave render.turntable out",
                    path.display()
                ));
            }
        }
        let names_one = frame.is_some_and(|frame| !frame.is_null());
        let files = self.output.files();
        let series = OF_FRAMES.into_iter().find(|key| files.iter().any(|(known, _)| known == key));
        if let Some(key) = series.filter(|_| names_one) {
            return Err(format!(
                "output.{key} is of every frame, and map.frame names one; leave one of them out"
            ));
        }
        Ok(())
    }

    /// A section that clips or combines says by what, with files beside the scene.
    fn check_parts(&self) -> Result<(), String> {
        for (stage, slot) in [(&ivd_field::combine::STAGE, "with"), (&ivd_field::clip::STAGE, "tag")] {
            let Some(section) = self.section(stage).filter(|section| section.written().is_some()) else {
                continue;
            };
            if let Some(idle) = section.job().idle() {
                return Err(format!("{}: {idle}; say what, or drop the section", stage.name));
            }
            if let Some(Json::String(file)) = self.param(stage, slot) {
                check_beside(&format!("{}.{slot}", stage.name), Path::new(&file))?;
            }
        }
        Ok(())
    }

    /// Whether the input is clipped before anything else.
    fn clips_input(&self) -> bool {
        let clip: Option<&SceneClip> = self.get(&ivd_field::clip::STAGE);
        clip.is_some_and(|clip| clip.idle().is_none() && clip.of == Whose::Input)
    }

    /// Whether what comes of the volume is combined or clipped.
    pub fn has_result(&self) -> bool {
        let combine: Option<&SceneCombine> = self.get(&ivd_field::combine::STAGE);
        let clip: Option<&SceneClip> = self.get(&ivd_field::clip::STAGE);
        combine.is_some_and(|combine| combine.idle().is_none())
            || clip.is_some_and(|clip| clip.idle().is_none() && clip.of == Whose::Result)
    }

    /// A file whose grid is taken lies beside the scene, and nothing else says what it says.
    fn check_grid_of(&self) -> Result<(), String> {
        let Some(file) = &self.input.grid_of else { return Ok(()) };
        check_beside("input.grid_of", file)?;
        let others = [
            ("phantom", self.input.phantom.is_some()),
            ("axes", self.input.axes.is_some()),
            ("spacing", self.input.spacing.is_some()),
        ];
        match others.into_iter().find(|(_, given)| *given) {
            Some((key, _)) => Err(format!("input: grid_of says what {key} does; give one of them")),
            None => Ok(()),
        }
    }

    /// A drawn start lies beside the scene, and something reads it.
    fn check_start(&self) -> Result<(), String> {
        let Some(start) = &self.input.start else { return Ok(()) };
        check_beside("input.start", start)?;
        let reads =
            |section: &Section| section.method().has_slot("start") && section.wants("start") != Want::No;
        if self.sections.iter().any(reads) {
            return Ok(());
        }
        let readers: Vec<&str> = ivd_boundary::STAGE
            .methods
            .iter()
            .filter(|method| method.has_slot("start"))
            .map(|method| method.name)
            .collect();
        let readers = readers.join(" or ");
        Err(format!("input.start: nothing reads it; leave it out, or choose boundary.method = {readers}"))
    }

    /// Labels of a file lie beside the scene, and none are looked for.
    fn check_labels(&self) -> Result<(), String> {
        let Some(labels) = &self.input.labels else { return Ok(()) };
        check_beside("input.labels", labels)?;
        if self.section(&ivd_segment::STAGE).is_some_and(|section| section.written().is_some()) {
            return Err(
                "input.labels gives the labels that [segment] would find; give one of them".to_owned()
            );
        }
        if self.clips_input() {
            return Err(
                "input.labels and clip.of = \"input\": labels of the whole scan don't fit what is left of it; clip the result (clip.of = \"result\"), or \
                 clip scan and labels by `ivd clip` first"
                    .to_owned(),
            );
        }
        Ok(())
    }

    /// What it asks the lattice to do.
    pub fn asked(&self) -> Option<Asked<'_>> {
        Asked::of(self.section(&ivd_motion::deform::STAGE)?.job())
    }

    /// Its steps in space.
    fn steps(&self) -> &[ivd_map::space::Step] {
        let params: Option<&SpaceParams> = self.get(&ivd_map::space::STAGE);
        params.map_or(&[], |params| &params.step)
    }

    /// Whether the map leaves what is outside the part where it is.
    fn map_is_free(&self) -> bool {
        let params = self.section(&ivd_map::STAGE).map(|section| section.job().params());
        params.is_some_and(|params| params.get("outside").is_some_and(|outside| outside == "free"))
    }

    /// Whether the voxels move.
    pub fn deforms(&self) -> bool {
        self.asked().is_some_and(|asked| !asked.is_still()) || !self.steps().is_empty()
    }

    /// Whether pictures show a surface, of which can be said how far it has moved.
    fn shows_a_surface(&self) -> bool {
        self.section(&ivd_render::STAGE).is_some_and(|section| section.job().beside().is_some())
    }

    /// Pictures to draw: those named, and those that a report asks for.
    pub fn pictures(&self) -> Vec<Picture> {
        let mut pictures = self.output.images.clone();
        if self.output.report {
            pictures.push(Picture::Before);
            if self.deforms() || self.has_result() {
                pictures.extend([Picture::After, Picture::Difference]);
            }
            if self.deforms() && self.shows_a_surface() {
                pictures.push(Picture::Moved);
            }
        }
        pictures.sort_unstable();
        pictures.dedup();
        pictures
    }
}

/// Takes out what isn't given, which TOML has no word for.
fn drop_nulls(value: &mut Json) {
    match value {
        Json::Object(keys) => {
            keys.retain(|_, value| !value.is_null());
            keys.values_mut().for_each(drop_nulls);
        }
        Json::Array(all) => all.iter_mut().for_each(drop_nulls),
        Json::Null | Json::Bool(_) | Json::Number(_) | Json::String(_) => {}
    }
}

/// Refuses a file that is named by an absolute path.
fn check_beside(key: &str, file: &Path) -> Result<(), String> {
    if file.is_absolute() {
        return Err(format!(
            "{key}: absolute paths tie a scene to one machine; make it relative to the scene's folder"
        ));
    }
    Ok(())
}
