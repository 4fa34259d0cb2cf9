//! The files of an output folder: written when their source changed, left alone when it didn't.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use ivd_artefact::{Artefact, ContentHash};
use ivd_core::{Exec, Image, Labels, Lattice, Motion, Value as _, Volume};
use ivd_field::class_volume::by_class;
use ivd_io::Space;
use ivd_report::{MovedSlices, Outlines, ResultSlices};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::control::Decisions;
use crate::export::{ExportOptions, ending, export, export_with, whole, write_text};
use crate::pictures::{is_animation, joined};
use crate::plan::{NodeId, PlanNode};
use crate::report::{self, ReportData};
use crate::resource::MemoryWatch;
use crate::runner::{Clock, OutputRecord, StageRecord, StageResult, State};
use crate::scene::{Loaded, OF_FRAMES, Picture, REPORT, SIDE_BY_SIDE, Scene, WIPE, picture_file};
use crate::{Error, Metrics, frame_file};

/// Name of the file that remembers what the last run wrote.
const MANIFEST: &str = ".ivd-run.json";

/// Raised whenever the same result is written to other bytes: outputs of older programs are then written anew.
const EXPORT_REVISION: u32 = 2;

/// One file of the output folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Key in the scene: `volume`, `image before`, `report`.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// Content hash of what it was made from.
    pub source: String,
    /// Hash of its bytes.
    pub blake3: String,
    /// Whether this run wrote it; false where it already was as it should be.
    #[serde(skip_deserializing)]
    pub written: bool,
    /// Wall time (s) of writing it, or of finding it as it should be.
    #[serde(default)]
    pub wall_s: f64,
    /// Peak resident memory (MiB) meanwhile, where the system tells.
    #[serde(default)]
    pub peak_rss_mb: Option<f64>,
    /// Most memory of the process's own meanwhile (MiB), mapped files apart.
    #[serde(default)]
    pub peak_own_mb: Option<f64>,
}

/// What the last run into a folder did.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Manifest {
    stages: Vec<StageRecord>,
    outputs: Vec<OutputFile>,
}

impl Manifest {
    /// The manifest of a folder; empty where there is none that can be read.
    pub(crate) fn load(out: &Path) -> Self {
        let text = std::fs::read_to_string(out.join(MANIFEST)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// The files that it wrote, with their keys.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&str, &Path)> {
        self.outputs.iter().map(|file| (&*file.name, &*file.path))
    }

    fn stage(&self, stage: &str, variant: &str) -> Option<&StageRecord> {
        self.stages.iter().find(|r| r.stage == stage && r.variant == variant && r.output.is_some())
    }

    /// What differs from the last run of the same stage: changed parameters, changed inputs.
    pub(crate) fn change_since(&self, record: &StageRecord) -> Option<String> {
        let old = self.stage(&record.stage, &record.variant)?;
        let mut changes = Vec::new();
        differing("", &old.params, &record.params, &mut changes);
        let inputs = record.inputs.iter().filter(|(slot, hash)| old.inputs.get(*slot) != Some(*hash));
        changes.extend(inputs.map(|(slot, _)| format!("its {slot} changed")));
        if old.revision != record.revision {
            changes.push(format!("the stage is revision {} now", record.revision));
        }
        (!changes.is_empty()).then(|| changes.join(", "))
    }
}

/// Names the leaves that differ between two parameter objects.
fn differing(path: &str, old: &Value, new: &Value, changes: &mut Vec<String>) {
    match (old, new) {
        (Value::Object(a), Value::Object(b)) => {
            for (key, value) in b {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                differing(&path, a.get(key).unwrap_or(&Value::Null), value, changes);
            }
        }
        _ if old != new => changes.push(format!("{path}: {old} → {new}")),
        _ => {}
    }
}

/// Writes outputs while a scene runs.
pub(crate) struct Writer<'a> {
    scene: &'a Scene,
    out: &'a Path,
    manifest: &'a Manifest,
    exec: &'a Exec,
    files: Vec<OutputFile>,
    data: ReportData,
    /// Pictures of an animation, with their hashes.
    shown: Vec<(ContentHash, Arc<Artefact>)>,
}

impl<'a> Writer<'a> {
    pub(crate) fn new(scene: &'a Scene, out: &'a Path, manifest: &'a Manifest, exec: &'a Exec) -> Self {
        Self { scene, out, manifest, exec, files: Vec::new(), data: ReportData::default(), shown: Vec::new() }
    }

    /// Writes what the scene wants of a place's result, and keeps what the report will want.
    pub(crate) fn stage_done(
        &mut self,
        node: &PlanNode,
        done: &StageResult,
        earlier: &BTreeMap<NodeId, StageResult>,
    ) -> Result<(), Error> {
        let scene = self.scene;
        let files = scene.output.files().into_iter();
        // Those of a series come frame by frame.
        let named = files.filter(|(key, _)| node.outputs.contains(key) && !OF_FRAMES.contains(key));
        for (key, path) in named {
            let space = scene.output.space.map(Space::from);
            let source = match (&*done.artefact, space) {
                (Artefact::Lattice(_) | Artefact::Motion(_), Some(space)) => {
                    format!("{} {}", done.hash, space.name())
                }
                _ => done.hash.to_string(),
            };
            if key == SIDE_BY_SIDE || key == WIPE {
                let Some((before, hash)) = beside::<Image>(node, earlier) else { continue };
                let Some(after) = Image::of(&done.artefact) else { continue };
                self.file(key, path, &format!("{source} {hash}"), |to, exec| {
                    let made = if key == WIPE { ivd_render::wipe } else { ivd_render::side_by_side };
                    let made = made(before, after, exec).map_err(Error::in_stage("export"))?;
                    export(&made.into(), to, exec)
                })?;
            } else if let Some(motion) = Motion::of(&done.artefact)
                && let Some((lattice, hash)) = beside(node, earlier)
            {
                let source = format!("{source} {hash}");
                let write = if key == "animation" { moving_lattice } else { deformed_lattice };
                self.file(key, path, &source, |to, _| write(lattice, motion, space, to))?;
            } else {
                let options = ExportOptions { space, ..ExportOptions::default() };
                self.file(key, path, &source, |to, exec| export_with(&done.artefact, to, &options, exec))?;
            }
        }
        for picture in Picture::ALL {
            if node.outputs.contains(&picture.name()) {
                let (name, file) = picture_file(picture);
                self.file(&name, &file, &done.hash.to_string(), |to, exec| export(&done.artefact, to, exec))?;
            }
        }
        if scene.output.report {
            self.collect(node, done, earlier)?;
        }
        Ok(())
    }

    /// Writes an output of a frame, counted from 0, or keeps it for an animation.
    pub(crate) fn frame(&mut self, key: &str, frame: usize, done: &StageResult) -> Result<(), Error> {
        let Some((_, path)) = self.scene.output.files().into_iter().find(|(known, _)| *known == key) else {
            return Ok(());
        };
        if is_animation(path) {
            self.shown.push((done.hash, done.artefact.clone()));
            return Ok(());
        }
        let (name, file) = (format!("{key} {frame:04}"), frame_file(path, frame));
        self.file(&name, &file, &done.hash.to_string(), |to, exec| export(&done.artefact, to, exec))
    }

    /// Writes the frames that were kept, as an animation.
    pub(crate) fn animation(&mut self, key: &str) -> Result<(), Error> {
        let path = self.scene.output.files().into_iter().find(|(known, _)| *known == key);
        let Some((_, path)) = path.filter(|(_, path)| is_animation(path)) else { return Ok(()) };
        let shown = std::mem::take(&mut self.shown);
        let hashes: Vec<String> = shown.iter().map(|(hash, _)| hash.to_string()).collect();
        self.file(key, path, &hashes.join(" "), |to, exec| {
            let all = joined(shown.iter().filter_map(|(_, artefact)| Image::of(artefact)))?;
            export(&all.into(), to, exec)
        })
    }

    /// What the report shows of decisions that were taken while the scene ran.
    pub(crate) fn set_decisions(&mut self, decisions: Decisions) {
        self.data.decisions = decisions;
    }

    /// Values that are black and white in slices of the report.
    fn window(&self, volume: &Volume) -> Option<[f64; 2]> {
        self.exec.run(|| report::slice_window(self.scene, volume))
    }

    /// Keeps what the report shows of a result: small things only.
    fn collect(
        &mut self,
        node: &PlanNode,
        done: &StageResult,
        earlier: &BTreeMap<NodeId, StageResult>,
    ) -> Result<(), Error> {
        match done.artefact.as_ref() {
            Artefact::Image(_) => {
                self.data.pictures.insert(node.id.variant.to_owned(), done.artefact.clone());
            }
            Artefact::Transfer(transfer) => {
                let mut inputs = node.inputs.iter().filter_map(|(_, id)| earlier.get(id));
                let labels = inputs.find_map(|done| Labels::of(&done.artefact));
                if let Some(labels) = labels {
                    self.data.class_slices = report::class_slices(labels, Some(transfer))?;
                }
                self.data.transfer = Some(transfer.clone());
            }
            Artefact::Motion(motion) => self.data.displacements = report::motion_lengths(motion),
            Artefact::Labels(labels) if node.gives() == "labels" => {
                // Slices of the labels that a transfer function was made of stay, in its colours.
                if self.data.transfer.is_none() || self.data.class_slices.is_empty() {
                    self.data.class_slices = report::class_slices(labels, None)?;
                }
            }
            // That which the scene deforms: the input, or what is left of it.
            Artefact::Volume(_) if node.gives() == "volume" => {
                self.data.volume = Some(done.artefact.clone());
            }
            Artefact::Volume(result) if node.outputs.contains(&"report") => {
                if let Some(Artefact::Volume(volume)) = self.data.volume.as_deref() {
                    for volume in [volume, result] {
                        self.exec.run(|| whole(volume))?;
                    }
                    let at = self.data.moved.as_ref().map(|moved| moved.at);
                    self.data.result = Some(ResultSlices::of((volume, self.window(volume)), result, at)?);
                }
            }
            Artefact::Displacement(displacement) if node.outputs.contains(&"report") => {
                let labels = beside(node, earlier).map(|(labels, _): (&Labels, _)| labels);
                if let Some(Artefact::Volume(volume)) = self.data.volume.as_deref() {
                    self.exec.run(|| whole(volume))?;
                    // Labels that another program drew are what a person knows the scan by.
                    let drawn = labels.filter(|labels| {
                        self.scene.input.labels.is_some() && labels.grid().dims() == volume.grid().dims()
                    });
                    let colour = drawn.map(|labels| report::colour_of(labels, self.data.transfer.as_ref()));
                    let outlines =
                        drawn.zip(colour.as_ref()).map(|(labels, colour)| Outlines { labels, colour });
                    self.data.moved = MovedSlices::of((volume, self.window(volume)), displacement, outlines)?;
                }
                self.data.specks_moved =
                    beside(node, earlier).map(|(lattice, _)| report::specks_moved(lattice, displacement));
                if let Some(labels) = labels {
                    self.data.class_volumes =
                        by_class(displacement, labels, self.exec).map_err(Error::in_stage("report"))?;
                }
            }
            Artefact::Volume(_)
            | Artefact::Labels(_)
            | Artefact::Mask(_)
            | Artefact::Lattice(_)
            | Artefact::Octree(_)
            | Artefact::Displacement(_)
            | Artefact::Tree(_) => {}
        }
        Ok(())
    }

    /// Writes one file unless it is already there, made from the same source and intact.
    fn file(
        &mut self,
        name: &str,
        path: &Path,
        source: &str,
        write: impl FnOnce(&Path, &Exec) -> Result<bool, Error>,
    ) -> Result<(), Error> {
        self.exec.check_cancelled()?;
        let (start, memory) = (Instant::now(), MemoryWatch::start());
        let full = self.out.join(path);
        let source = format!("{EXPORT_REVISION} {source}");
        let old =
            self.manifest.outputs.iter().find(|o| o.name == name && o.path == full && o.source == source);
        // Read once: a displacement field alone may be larger than everything in the cache.
        let intact = old.and_then(|o| hash_output(&full).ok().filter(|hash| *hash == o.blake3));
        let (blake3, written) = if let Some(hash) = intact {
            (hash, false)
        } else {
            let folder = full.parent().unwrap_or(self.out);
            std::fs::create_dir_all(folder).map_err(|e| Error::io("making the folder", folder, e))?;
            let written = write(&full, self.exec)?;
            (hash_output(&full).map_err(|e| Error::io("reading back", &full, e))?, written)
        };
        let peak = memory.stop();
        self.files.push(OutputFile {
            name: name.to_owned(),
            path: full,
            source,
            blake3,
            written,
            wall_s: start.elapsed().as_secs_f64(),
            peak_rss_mb: peak.map(|peak| peak.resident),
            peak_own_mb: peak.map(|peak| peak.own),
        });
        Ok(())
    }

    /// Makes the report, where the scene wants it, and tells what was done as any other stage does.
    pub(crate) fn report(
        &mut self,
        loaded: &Loaded,
        stages: &[StageRecord],
        force: bool,
    ) -> Result<StageRecord, Error> {
        let mut record = StageRecord {
            why: "output.report is not asked for".to_owned(),
            revision: report::REVISION,
            ..StageRecord::new("report", State::NotNeeded)
        };
        if !self.scene.output.report {
            return Ok(record);
        }
        let clock = Clock::start();
        let source = report_source(loaded, stages, &self.data.decisions.lines);
        let (name, file) = REPORT;
        if force {
            let _ = std::fs::remove_file(self.out.join(file));
        }
        let data = std::mem::take(&mut self.data);
        // What can't be told is told by the page.
        record.remark = report::remark(stages, data.specks_moved).ok().flatten();
        let (before, written) = (self.files.len(), self.files.clone());
        self.file(name, Path::new(file), &source, |to, exec| {
            if let Some(Artefact::Volume(volume)) = data.volume.as_deref() {
                exec.run(|| whole(volume))?;
            }
            write_text(to, &report::html(loaded, stages, &written, &data, exec)?)
        })?;
        let file = &self.files[before];
        let again =
            self.manifest.outputs.iter().any(|o| o.name == name && o.source == file.source) && !file.written;
        record.state = if again { State::Cached } else { State::Ran };
        record.cached = again;
        let why = if again { "everything it shows is as it was" } else { "what it shows changed" };
        why.clone_into(&mut record.why);
        record.output = Some(OutputRecord {
            path: Some(file.path.clone()),
            kind: "html".to_owned(),
            hash: file.blake3.clone(),
        });
        record.inputs.insert("everything".to_owned(), source);
        Ok(clock.stop(record))
    }

    /// Remembers the run beside its outputs.
    pub(crate) fn finish(self, stages: &[StageRecord]) -> Result<Vec<OutputFile>, Error> {
        if self.files.is_empty() {
            return Ok(self.files);
        }
        // Frames of a longer motion would be taken for this one's.
        for key in OF_FRAMES {
            let is_of_it = |file: &&OutputFile| file.name.starts_with(key);
            let made: Vec<&OutputFile> = self.files.iter().filter(is_of_it).collect();
            let named = self.scene.output.files().into_iter().find(|(known, _)| *known == key);
            // Only what has the name of a frame of this series: the record of the last run may name anything.
            let is_frame = |old: &OutputFile| {
                let number = old.name.strip_prefix(key).and_then(|rest| rest.trim().parse().ok());
                let file = named.zip(number).map(|((_, path), number)| frame_file(path, number));
                file.is_some_and(|file| self.out.join(file) == old.path)
            };
            let is_left = |old: &&OutputFile| {
                !made.is_empty() && is_frame(old) && made.iter().all(|file| file.path != old.path)
            };
            for old in self.manifest.outputs.iter().filter(is_of_it).filter(is_left) {
                let _ = std::fs::remove_file(&old.path);
            }
        }
        // Times differ at every run; the manifest keeps what a later run compares.
        let stages = stages
            .iter()
            .map(|r| StageRecord {
                wall_s: 0.0,
                cpu_s: None,
                peak_rss_mb: None,
                peak_own_mb: None,
                bytes_read: 0,
                why: String::new(),
                remark: None,
                metrics: Metrics::default(),
                ..r.clone()
            })
            .collect();
        let outputs = self.files.iter();
        let timeless =
            |o: &OutputFile| OutputFile { wall_s: 0.0, peak_rss_mb: None, peak_own_mb: None, ..o.clone() };
        let outputs = outputs.map(timeless).collect();
        let manifest = Manifest { stages, outputs };
        let file = self.out.join(MANIFEST);
        let text = serde_json::to_string(&manifest).map_err(|e| Error::io("writing", &file, e.into()))?;
        write_text(&file, &text)?;
        Ok(self.files)
    }
}

/// The value of a type, and its hash, among those that are looked at when a place is done.
fn beside<'a, T: ivd_core::Value>(
    node: &PlanNode,
    earlier: &'a BTreeMap<NodeId, StageResult>,
) -> Option<(&'a T, ContentHash)> {
    node.beside
        .iter()
        .filter_map(|id| earlier.get(id))
        .find_map(|done| Some((T::of(&done.artefact)?, done.hash)))
}

fn deformed_lattice(
    lattice: &Lattice,
    motion: &Motion,
    space: Option<Space>,
    to: &Path,
) -> Result<bool, Error> {
    let last = motion.frames().last();
    let written = match last {
        Some(frame) => ivd_io::mesh::write_deformed(to, lattice, &frame.displacement, space),
        None => ivd_io::mesh::write(to, lattice, space),
    };
    written.map(|w| w.touched).map_err(Error::in_stage("export"))
}

/// The lattice with all frames.
fn moving_lattice(
    lattice: &Lattice,
    motion: &Motion,
    space: Option<Space>,
    to: &Path,
) -> Result<bool, Error> {
    ivd_io::mesh::write_motion(to, lattice, motion, space)
        .map(|w| w.touched)
        .map_err(Error::in_stage("export"))
}

/// Hash of everything that a report shows but times.
fn report_source(loaded: &Loaded, stages: &[StageRecord], decisions: &[String]) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&report::REVISION.to_le_bytes());
    hasher.update(serde_json::json!(loaded.scene.written).to_string().as_bytes());
    hasher.update(report::input(loaded).as_bytes());
    for record in stages {
        hasher.update(record.stage.as_bytes());
        hasher.update(record.params.to_string().as_bytes());
        hasher.update(record.output.as_ref().map_or("", |o| &o.hash).as_bytes());
    }
    for line in decisions {
        hasher.update(line.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// Hash of an output: of its one file, of header and data where a format keeps them apart, or of a collection with its members.
fn hash_output(path: &Path) -> std::io::Result<String> {
    let detached = matches!(&*ending(path), "mhd" | "nhdr");
    let files = if &*ending(path) == "pvd" {
        let members = ivd_io::mesh::members(path)?;
        std::iter::once(path.to_owned()).chain(members).collect()
    } else {
        parts_of(path, detached)?
    };
    let mut hasher = blake3::Hasher::new();
    for file in files {
        ivd_artefact::hash_all(&mut hasher, std::fs::File::open(file)?)?;
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// The files of an output that is no collection.
fn parts_of(path: &Path, detached: bool) -> std::io::Result<Vec<PathBuf>> {
    match ivd_io::volume::sources(path, &ivd_io::volume::ReadOptions::default()) {
        Ok(files) if detached => Ok(files),
        Err(_) if detached => Err(std::io::Error::other("its data file can't be found")),
        _ => Ok(vec![path.to_owned()]),
    }
}
