//! What every stage looks like from outside: a name, a revision, parameters that say *what*, and a function.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use ivd_artefact::{Artefact, ContentHash, Kind, Loaded, Opened};
use ivd_core::Exec;
use ivd_core::op::{self, Output, Slot, Slots, Values};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::{Error, list};

/// What makes a grid's values of other grids' values and is no stage of the list.
const OTHERS: op::Memory = op::Memory { voxel: 20, reached: 0, triangle: 100 };

/// Figures of a stage's work, by the names that `--json` prints. As JSON they are one object.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Map<String, Value>", into = "Map<String, Value>")]
pub struct Metrics {
    /// What every run gives again for the same inputs and parameters: kept with the result.
    pub figures: Map<String, Value>,
    /// Times (s) and rates (1/s) of one run: told of it, and kept nowhere, so that the same work gives the same file.
    pub times: BTreeMap<String, f64>,
}

impl Metrics {
    /// The figures as the crate of a stage declares them.
    ///
    /// # Errors
    /// [`Error::Figure`] where one is missing or of another type: nothing that is decided by figures may go on without.
    pub fn read<F: DeserializeOwned>(&self, stage: &str) -> Result<F, Error> {
        serde_json::from_value(Value::Object(self.figures.clone()))
            .map_err(|problem| Error::figures(stage, problem))
    }
}

impl From<Metrics> for Map<String, Value> {
    fn from(metrics: Metrics) -> Self {
        let mut all = metrics.figures;
        all.extend(metrics.times.into_iter().map(|(name, time)| (name, Value::from(time))));
        all
    }
}

impl From<Map<String, Value>> for Metrics {
    /// Read back, times can't be told from figures.
    fn from(figures: Map<String, Value>) -> Self {
        Self { figures, times: BTreeMap::new() }
    }
}

/// A value on its way from one stage to the next.
#[derive(Debug, Clone)]
pub struct Input {
    /// The value.
    pub artefact: Arc<Artefact>,
    /// Its content hash.
    pub hash: ContentHash,
    /// The file that it is read from, where it is mapped.
    pub file: Option<Arc<Opened>>,
}

impl From<Loaded> for Input {
    fn from(loaded: Loaded) -> Self {
        Self { artefact: Arc::new(loaded.artefact), hash: loaded.hash, file: Some(loaded.file) }
    }
}

/// The inputs of one run of a stage, by slot.
#[derive(Debug, Clone, Default)]
pub struct Inputs(BTreeMap<&'static str, Input>);

impl Inputs {
    /// Fills a slot.
    #[must_use]
    pub fn with(mut self, slot: &'static str, input: Input) -> Self {
        self.0.insert(slot, input);
        self
    }

    /// Only what fills slots that are wanted.
    #[must_use]
    pub fn only(mut self, wanted: impl Fn(&str) -> bool) -> Self {
        self.0.retain(|slot, _| wanted(slot));
        self
    }

    /// Content hash of each filled slot.
    pub fn hashes(&self) -> BTreeMap<String, ContentHash> {
        self.0.iter().map(|(slot, input)| ((*slot).to_owned(), input.hash)).collect()
    }

    /// What fills a slot.
    pub fn input(&self, slot: &str) -> Option<Input> {
        self.0.get(slot).cloned()
    }

    /// The value in a slot, of whatever kind.
    pub fn get(&self, slot: &str) -> Option<&Artefact> {
        self.0.get(slot).map(|i| i.artefact.as_ref())
    }

    /// The value in a slot, where it is filled with one of that type.
    pub fn value<T: ivd_core::Value>(&self, slot: &str) -> Option<&T> {
        T::of(self.get(slot)?)
    }

    /// The values.
    pub(crate) fn artefacts(&self) -> impl Iterator<Item = &Artefact> {
        self.0.values().map(|input| input.artefact.as_ref())
    }

    /// The values, as methods take them.
    pub(crate) fn values(&self) -> Values<'_> {
        self.0.iter().map(|(slot, input)| (*slot, input.artefact.as_ref())).collect()
    }

    /// The values as a stage declares them.
    ///
    /// # Errors
    /// A usage error that names the slot which is empty, or filled with another kind.
    pub(crate) fn take<'a, S: Slots<'a>>(&'a self, stage: &'static str) -> Result<S, Error> {
        S::take(&self.values()).map_err(|failure| Error::failed(stage, failure))
    }

    /// Bytes that were read so far of the files behind the values.
    pub(crate) fn bytes_read(&self) -> u64 {
        self.0.values().filter_map(|input| input.file.as_ref()).map(|file| file.bytes_verified()).sum()
    }

    /// # Errors
    /// [`Error::Damaged`] where a file that was read in parts isn't what its hashes say.
    pub(crate) fn check_damage(&self) -> Result<(), Error> {
        let damage = self.0.values().find_map(|input| input.file.as_ref()?.damage());
        damage.map_or(Ok(()), |damage| Err(Error::Damaged(damage.to_string())))
    }

    /// Checks kinds and presence against a stage's slots.
    ///
    /// # Errors
    /// [`Error::WrongKind`], or a usage error that names the missing slot.
    pub fn check(&self, stage: &dyn Stage) -> Result<(), Error> {
        for slot in stage.facts().inputs {
            match self.0.get(slot.name) {
                None if slot.optional => {}
                None => {
                    return Err(Error::usage(stage.name(), format!("its input {} is missing", slot.name)));
                }
                Some(input) if !slot.kinds.contains(&input.artefact.kind()) => {
                    return Err(Error::WrongKind {
                        stage: stage.name(),
                        slot: slot.name,
                        expected: slot.kinds.iter().map(|k| k.name()).collect::<Vec<_>>().join(" or "),
                        found: input.artefact.kind().name(),
                    });
                }
                Some(_) => {}
            }
        }
        Ok(())
    }
}

/// What a stage gives.
#[derive(Debug)]
pub struct StageOutput {
    /// The value.
    pub artefact: Artefact,
    /// Figures of the work.
    pub metrics: Metrics,
}

impl StageOutput {
    /// A value with its figures.
    pub(crate) fn new(value: impl Output, figures: &impl Serialize) -> Self {
        let op::Product { artefact, figures } = op::Product::new(value, figures);
        Self { artefact, metrics: Metrics::from(figures) }
    }
}

/// What is known of a stage without running it.
#[derive(Debug, Clone, Copy)]
pub struct Facts {
    /// Name, as in `--json` and in scenes.
    pub name: &'static str,
    /// Raised whenever the same input and parameters may give another result.
    pub revision: u32,
    /// What it reads.
    pub inputs: &'static [Slot],
    /// Kind of what it writes; `None` where that is the kind that it read in its first slot.
    pub output: Option<Kind>,
    /// JSON Schema of its figures.
    pub figures: fn() -> &'static Value,
}

/// One stage with its parameters: a thin adapter over a stage crate's function.
pub trait Stage: Send + Sync {
    /// What is known of it without running it.
    fn facts(&self) -> Facts;

    /// See [`Facts::name`].
    fn name(&self) -> &'static str {
        self.facts().name
    }

    /// Kernels whose results on a device are close to the processor's and not the same bytes; see [`op::Op::close`].
    fn close(&self) -> &'static [&'static str] {
        &[]
    }

    /// About how much memory it takes; see [`op::Stage::memory`].
    fn memory(&self) -> op::Memory {
        list::stage(self.name()).map_or(OTHERS, |stage| stage.memory)
    }

    /// What a person should know of a result with these figures beside them, where there is something.
    ///
    /// # Errors
    /// A figure that is missing or of another type.
    fn remark(&self, figures: &Metrics) -> Result<Option<String>, Error> {
        let _ = figures;
        Ok(None)
    }

    /// Checks what can be checked against a value that the one in a slot is still to be made from, before work goes into that.
    ///
    /// # Errors
    /// What would be an error with the value in the slot as well.
    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Error> {
        let _ = (slot, value);
        Ok(())
    }

    /// Its parameters, by the names that a scene gives them.
    fn params(&self) -> Value;

    /// Those of them that say what the result is; hashed, in canonical form, for the cache.
    fn identity(&self) -> Value {
        self.params()
    }

    /// Files that it reads and that are no artefacts (those of an import); their content and endings are part of what
    /// the result is made from, where they lie isn't.
    ///
    /// # Errors
    /// Where they can't be listed.
    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        Ok(Vec::new())
    }

    /// Does the work.
    ///
    /// # Errors
    /// The stage crate's error under the stage's name.
    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error>;
}
