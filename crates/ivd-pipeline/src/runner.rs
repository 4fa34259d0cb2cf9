//! Runs one stage: from the cache where an entry for the same work verifies, else by doing the work.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use ivd_artefact::{
    Artefact, Cache, CacheKey, ContentHash, Kind, Loaded, Lookup, Opened, Provenance, SectionHashes,
    section_hashes,
};
use ivd_core::op::{self, Failure, Values};
use ivd_core::{Classified, ErrorClass, Exec, ServedBy};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::need;
use crate::resource::{self, MemoryWatch};
use crate::{Error, Input, Inputs, Metrics, Section, Stage, StageOutput};

/// What became of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// It did its work.
    Ran,
    /// Its result came from the cache.
    Cached,
    /// No output needs it.
    NotNeeded,
    /// An output needs it: what a dry run tells of a stage that would run or come from the cache.
    Planned,
}

impl State {
    /// The state in words, as tables show it.
    pub fn words(self) -> &'static str {
        match self {
            Self::Ran => "ran",
            Self::Cached => "cached",
            Self::NotNeeded => "not needed",
            Self::Planned => "planned",
        }
    }
}

/// Where a stage's result lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutputRecord {
    /// Its file; `None` where the cache is off and nobody asked for one.
    pub path: Option<PathBuf>,
    /// Kind of artefact.
    pub kind: String,
    /// Content hash.
    pub hash: String,
}

/// What a stage did: the object that `--json` prints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    /// Name of the stage.
    pub stage: String,
    /// Which of several uses of the stage in a pipeline (`before`, `after`); empty for the only one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub variant: String,
    /// Whether it ran, came from the cache or wasn't needed.
    pub state: State,
    /// Why.
    pub why: String,
    /// Revision of the stage.
    pub revision: u32,
    /// Class of the result: `"gpu"` where a device made a part of it that is close to the processor's and not the same bytes, else `"cpu"`.
    pub backend: String,
    /// Who made which pass ([`ivd_core::Kernel`]): `"cpu"`, `"gpu"` or `"cpu and gpu"`; absent where the result came from the cache.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub kernels: BTreeMap<String, String>,
    /// Parameters.
    pub params: Value,
    /// Content hash of each input.
    pub inputs: BTreeMap<String, String>,
    /// The result; `None` where the stage wasn't needed.
    pub output: Option<OutputRecord>,
    /// Whether the result came from the cache.
    pub cached: bool,
    /// Wall time (s) of this run: the work's, or the cache's.
    pub wall_s: f64,
    /// Processor time (s) of all threads, where the system tells.
    pub cpu_s: Option<f64>,
    /// Peak resident memory while it ran (MiB), where the system tells.
    pub peak_rss_mb: Option<f64>,
    /// Most memory of the process's own while it ran (MiB), mapped files apart: what a memory limit is held against.
    #[serde(default)]
    pub peak_own_mb: Option<f64>,
    /// Bytes of files that were read for it: of its source files, of its cached result, and of what it looked at in the
    /// mapped files behind its inputs.
    #[serde(default)]
    pub bytes_read: u64,
    /// What a person should know of the result beside its figures, where there is something: that it isn't all that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// Figures of the work.
    pub metrics: Metrics,
}

impl StageRecord {
    /// What a person should know of the result, with whose it is.
    pub fn told_remark(&self) -> Option<String> {
        self.remark.as_ref().map(|remark| format!("{}: {remark}", self.stage))
    }

    /// Of a stage that has done nothing yet.
    pub(crate) fn new(stage: &str, state: State) -> Self {
        Self {
            stage: stage.to_owned(),
            variant: String::new(),
            state,
            why: String::new(),
            revision: 0,
            backend: CPU.to_owned(),
            kernels: BTreeMap::new(),
            params: Value::Null,
            inputs: BTreeMap::new(),
            output: None,
            cached: false,
            wall_s: 0.0,
            cpu_s: None,
            peak_rss_mb: None,
            peak_own_mb: None,
            bytes_read: 0,
            remark: None,
            metrics: Metrics::default(),
        }
    }

    /// Its parameters, as the stage's crate declares them.
    ///
    /// # Errors
    /// Where one is missing or of another type.
    pub fn params<P: DeserializeOwned>(&self) -> Result<P, Error> {
        serde_json::from_value(self.params.clone())
            .map_err(|problem| Error::Figure { stage: self.stage.clone(), problem: problem.to_string() })
    }

    /// The figures of its work, as the stage's crate declares them.
    ///
    /// # Errors
    /// [`Error::Figure`] where one is missing or of another type: nothing that is decided by figures may go on without.
    pub fn figures<F: DeserializeOwned>(&self) -> Result<F, Error> {
        self.metrics.read(&self.stage)
    }
}

/// The figures of a stage among the records of a run; `None` where it wasn't needed.
///
/// # Errors
/// As [`StageRecord::figures`].
pub fn figures_of<F: DeserializeOwned>(records: &[StageRecord], stage: &str) -> Result<Option<F>, Error> {
    let found = records.iter().find(|record| record.stage == stage && record.output.is_some());
    found.map(StageRecord::figures).transpose()
}

/// A stage's result with its record.
#[derive(Debug, Clone)]
pub struct StageResult {
    /// The value.
    pub artefact: Arc<Artefact>,
    /// Its content hash.
    pub hash: ContentHash,
    /// The file behind the value, where it came from the cache.
    pub file: Option<Arc<Opened>>,
    /// Hashes of its sections, where it was made just now.
    pub sections: Option<SectionHashes>,
    /// What was done.
    pub record: StageRecord,
}

impl StageResult {
    /// The value, as one of a type.
    ///
    /// # Errors
    /// [`Error::Figure`] where it is of another.
    pub fn value<T: ivd_core::Value>(&self) -> Result<&T, Error> {
        let (stage, kind) = (self.record.stage.clone(), self.artefact.kind().name());
        T::of(&self.artefact)
            .ok_or_else(|| Error::Figure { stage, problem: format!("it gave a {kind} artefact") })
    }

    /// The value on its way to the next stage.
    pub fn input(&self) -> Input {
        Input { artefact: self.artefact.clone(), hash: self.hash, file: self.file.clone() }
    }
}

/// Runs stages in one context.
#[derive(Debug, Clone, Copy)]
pub struct Runner<'a> {
    /// Threads, memory, observer.
    pub exec: &'a Exec,
    /// Where results are kept; may be off.
    pub cache: &'a Cache,
    /// Whether a volume in the cache is verified as it is touched; what isn't touched is then never read. An entry that
    /// turns out to be damaged is [`Error::Damaged`], and who asked runs it again without.
    pub lazy: bool,
}

/// Least bytes of a result that is read from the cache rather than kept in memory.
const WORTH_MAPPING: u64 = 1 << 20;

/// A result's hashes, and what the cache holds of it where that is to be read from there.
struct Kept {
    hash: ContentHash,
    sections: SectionHashes,
    file: Option<Loaded>,
}

/// A run that has begun.
struct Begun {
    clock: Clock,
    read_before: u64,
    provenance: Provenance,
    source_bytes: u64,
    key: CacheKey,
    /// Memory of its own that the process held (MiB), and about how much the work takes beside it (bytes).
    memory: (Option<f64>, Option<u64>),
}

impl Begun {
    /// Its failure, with the limit that would do where a memory limit ended it.
    fn explained(&self, error: Error, exec: &Exec) -> Error {
        need::explained(error, exec, self.memory.0, self.memory.1)
    }
}

impl Runner<'_> {
    /// Runs a stage on its inputs; with `force` even where the cache has its result.
    ///
    /// # Errors
    /// The stage's own error, or what the cache's files ran into while writing (an unreadable entry is no error:
    /// the work is done again).
    pub fn run(&self, stage: &dyn Stage, inputs: &Inputs, force: bool) -> Result<StageResult, Error> {
        self.run_with(stage, inputs, force, &mut || stage.run(inputs, self.exec))
    }

    /// As [`Runner::run`], where the work may be shared with that of other stages.
    pub(crate) fn run_with(
        &self,
        stage: &dyn Stage,
        inputs: &Inputs,
        force: bool,
        work: &mut dyn FnMut() -> Result<StageOutput, Error>,
    ) -> Result<StageResult, Error> {
        let begun = self.begin(stage, inputs)?;
        let why = if force {
            "forced".to_owned()
        } else {
            match self.exec.run(|| self.look_up(&begun.key)) {
                Lookup::Hit(entry) => {
                    let record =
                        self.record(stage, &begun.provenance, &entry.artefact, entry.hash, &begun.key);
                    let metrics = Metrics::from(entry.metrics.as_object().cloned().unwrap_or_default());
                    let bytes_read = begun.source_bytes + entry.file.bytes_verified();
                    let remark = stage.remark(&metrics)?;
                    let record = StageRecord { bytes_read, remark, metrics, ..begun.clock.stop(record) };
                    let record = StageRecord { state: State::Cached, cached: true, ..record };
                    let artefact = Arc::new(entry.artefact);
                    let file = Some(entry.file);
                    return Ok(StageResult { artefact, hash: entry.hash, file, sections: None, record });
                }
                Lookup::Absent => "nothing cached for these inputs and parameters".to_owned(),
                Lookup::Unusable(reason) => format!("its cached entry can't be trusted: {reason}"),
            }
        };
        tracing::info!(stage = stage.name(), why, "running");
        self.exec.observer().begin(stage.name(), 0);
        let product = work().map_err(|error| begun.explained(error, self.exec));
        self.exec.observer().end(stage.name());
        // Before anything is believed of it, its failure too.
        inputs.check_damage()?;
        self.end(stage, inputs, begun, why, product?)
    }

    /// Does a stage's work by `work`, which gives something beside its product; that is in no cache, so it is always done.
    ///
    /// # Errors
    /// Those of [`Runner::run`].
    pub fn run_beside<T>(
        &self,
        stage: &Section,
        inputs: &Inputs,
        work: impl FnOnce(&Values<'_>) -> Result<(op::Product, T), Failure>,
    ) -> Result<(StageResult, T), Error> {
        let begun = self.begin(stage, inputs)?;
        let worked = stage.run_with(inputs, work).map_err(|error| begun.explained(error, self.exec));
        inputs.check_damage()?;
        let (product, beside) = worked?;
        let why = "what it gives beside its result is in no cache".to_owned();
        Ok((self.end(stage, inputs, begun, why, product)?, beside))
    }

    fn begin(&self, stage: &dyn Stage, inputs: &Inputs) -> Result<Begun, Error> {
        inputs.check(stage)?;
        self.exec.check_cancelled()?;
        let clock = Clock::start();
        // Who served a stage that failed is nothing of this one's.
        self.exec.take_served();
        let read_before = inputs.bytes_read();
        let (provenance, source_bytes) = self.provenance(stage, inputs.hashes())?;
        let first = stage.facts().inputs.first().and_then(|slot| inputs.get(slot.name)).map(Artefact::kind);
        let kind = stage.facts().output.or(first);
        let kind = kind.ok_or_else(|| Error::usage(stage.name(), "its first input is missing"))?;
        let key = CacheKey::new(kind, &provenance);
        let memory = (resource::own_mb(), need::about(stage.memory(), need::Size::of(inputs)));
        Ok(Begun { clock, read_before, provenance, source_bytes, key, memory })
    }

    fn end(
        &self,
        stage: &dyn Stage,
        inputs: &Inputs,
        begun: Begun,
        why: String,
        product: StageOutput,
    ) -> Result<StageResult, Error> {
        // Work that didn't notice that the limit was passed is told of before anything is kept of it.
        if self.exec.memory_limit.is_some() {
            let passed = self.exec.check_cancelled().map_err(Error::from);
            passed.map_err(|error| begun.explained(error, self.exec))?;
        }
        let Begun { clock, read_before, mut provenance, source_bytes, mut key, .. } = begun;
        // What did the work, whatever was asked for.
        let served = self.exec.take_served();
        let made_by = class(stage, |kernel| served.get(kernel).is_some_and(|served| served.gpu > 0));
        if made_by != provenance.backend {
            provenance.backend = made_by;
            key = CacheKey::new(product.artefact.kind(), &provenance);
        }
        let kept = self.exec.run(|| self.keep(&key, &product, &provenance))?;
        let Kept { hash, sections, file } = kept;
        // What the cache holds is read from there: from here on it takes no memory of its own.
        let (artefact, file) = match file {
            Some(file) => (file.artefact, Some(file.file)),
            None => (product.artefact, None),
        };
        let mut record = self.record(stage, &provenance, &artefact, hash, &key);
        record.kernels = names(&served);
        let bytes_read = source_bytes + inputs.bytes_read() - read_before;
        let (remark, metrics) = (stage.remark(&product.metrics)?, product.metrics);
        let record = StageRecord { why, bytes_read, remark, metrics, ..clock.stop(record) };
        Ok(StageResult { artefact: Arc::new(artefact), hash, file, sections: Some(sections), record })
    }

    fn look_up(&self, key: &CacheKey) -> Lookup<Loaded> {
        if self.lazy { self.cache.lookup_lazily(key) } else { self.cache.lookup(key) }
    }

    /// Content hash of a stage's result for inputs of these hashes, where the cache has it. Nothing is read but the head of its
    /// entry. `first` is the kind of the first input.
    pub fn foresee(
        &self,
        stage: &dyn Stage,
        inputs: BTreeMap<String, ContentHash>,
        first: Kind,
    ) -> Option<ContentHash> {
        let (provenance, _) = self.provenance(stage, inputs).ok()?;
        self.cache.lookup_hash(&CacheKey::new(stage.facts().output.unwrap_or(first), &provenance))
    }

    /// Where a result comes from, everything that a cache key is made of; and the bytes that were read to know it.
    fn provenance(
        &self,
        stage: &dyn Stage,
        mut hashes: BTreeMap<String, ContentHash>,
    ) -> Result<(Provenance, u64), Error> {
        let mut bytes = 0;
        if let Some((hash, read)) = self.sources(stage)? {
            hashes.insert("source".to_owned(), hash);
            bytes = read;
        }
        let provenance = Provenance {
            stage: stage.name().to_owned(),
            revision: stage.facts().revision,
            params: stage.identity(),
            inputs: hashes,
            backend: class(stage, |kernel| {
                self.exec.device.as_ref().is_some_and(|device| device.knows(kernel))
            }),
        };
        Ok((provenance, bytes))
    }

    /// One hash of a stage's source files, and the bytes that were read to know it; `None` where it has none.
    fn sources(&self, stage: &dyn Stage) -> Result<Option<(ContentHash, u64)>, Error> {
        let files = stage.sources()?;
        let (mut hasher, mut bytes) = (blake3::Hasher::new(), 0);
        for file in &files {
            let found = self.exec.run(|| self.cache.file_hash(file))?;
            bytes += found.bytes_read;
            hasher.update(&found.hash.0);
            // The ending decides the format where the bytes don't.
            hasher.update(file.extension().map_or(&[][..], |e| e.as_encoded_bytes()));
            hasher.update(&[0]);
        }
        Ok((!files.is_empty()).then(|| (ContentHash(*hasher.finalize().as_bytes()), bytes)))
    }

    /// Puts a product into the cache and gives its hashes. A cache that can't be written to is only slow.
    fn keep(&self, key: &CacheKey, product: &StageOutput, provenance: &Provenance) -> Result<Kept, Error> {
        let metrics = Value::Object(product.metrics.figures.clone());
        match self.cache.put_with_metrics(key, &product.artefact, provenance, &metrics) {
            Ok(Some(written)) => {
                let is_large = written.bytes >= WORTH_MAPPING;
                let file = is_large.then(|| self.cache.mapped(key, &written, self.lazy)).flatten();
                return Ok(Kept { hash: written.hash, sections: written.sections, file });
            }
            Ok(None) => {}
            Err(error) if error.error_class() == ErrorClass::Io => {
                self.exec.observer().note(&format!("result not cached: {error}"));
            }
            Err(error) => return Err(error.into()),
        }
        let (hash, sections) = section_hashes(&product.artefact)?;
        Ok(Kept { hash, sections, file: None })
    }

    fn record(
        &self,
        stage: &dyn Stage,
        provenance: &Provenance,
        artefact: &Artefact,
        hash: ContentHash,
        key: &CacheKey,
    ) -> StageRecord {
        StageRecord {
            why: "same inputs and parameters as before".to_owned(),
            revision: provenance.revision,
            backend: provenance.backend.clone(),
            params: stage.params(),
            inputs: provenance.inputs.iter().map(|(slot, hash)| (slot.clone(), hash.to_string())).collect(),
            output: Some(OutputRecord {
                path: self.cache.path_of(key),
                kind: artefact.kind().name().to_owned(),
                hash: hash.to_string(),
            }),
            ..StageRecord::new(stage.name(), State::Ran)
        }
    }
}

/// Class of what the processor makes, and of what a device makes to the same bytes.
const CPU: &str = "cpu";

/// Class of a stage's result where a device makes the kernels that `on_device` names.
fn class(stage: &dyn Stage, on_device: impl Fn(&str) -> bool) -> String {
    if stage.close().iter().any(|kernel| on_device(kernel)) { "gpu".to_owned() } else { CPU.to_owned() }
}

fn names(served: &ServedBy) -> BTreeMap<String, String> {
    served.iter().map(|(kernel, by)| ((*kernel).to_owned(), by.name().to_owned())).collect()
}

/// Time and memory of one stage.
pub(crate) struct Clock {
    wall: Instant,
    cpu: Option<f64>,
    memory: MemoryWatch,
}

impl Clock {
    pub(crate) fn start() -> Self {
        Self { wall: Instant::now(), cpu: resource::cpu_seconds(), memory: MemoryWatch::start() }
    }

    pub(crate) fn stop(self, record: StageRecord) -> StageRecord {
        let peak = self.memory.stop();
        StageRecord {
            wall_s: self.wall.elapsed().as_secs_f64(),
            // Ticks of 1/100 s: more digits would be noise of the subtraction.
            cpu_s: resource::cpu_seconds()
                .zip(self.cpu)
                .map(|(now, then)| ((now - then) * 100.0).round() / 100.0),
            peak_rss_mb: peak.map(|peak| peak.resident),
            peak_own_mb: peak.map(|peak| peak.own),
            ..record
        }
    }
}
