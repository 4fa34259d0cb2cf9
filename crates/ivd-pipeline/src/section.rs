//! The parameters of one stage, read from a scene's section, a file or a command line.

use std::collections::BTreeSet;
use std::fmt;
use std::path::PathBuf;

use ivd_core::op::{
    self, Failure, Field, Job, Memory, Method, Op, PlaceKind, Stage, Values, Want, check, fields, is_default,
    rename, unknown,
};
use ivd_core::{Artefact, Exec, ParamError};
use serde_json::{Map, Value as Json};

use crate::{Error, Inputs, Metrics, StageOutput};

/// A stage with the method that was chosen and its parameters.
pub struct Section {
    stage: &'static Stage,
    method: &'static Method,
    variant: &'static str,
    written: Option<Map<String, Json>>,
    job: Box<dyn Job>,
}

impl Clone for Section {
    fn clone(&self) -> Self {
        let (written, job) = (self.written.clone(), self.job.again());
        Self { stage: self.stage, method: self.method, variant: self.variant, written, job }
    }
}

impl PartialEq for Section {
    fn eq(&self, other: &Self) -> bool {
        let same = |a: &Self, b: &Self| (a.stage.name, a.variant) == (b.stage.name, b.variant);
        same(self, other)
            && self.written.is_some() == other.written.is_some()
            && self.object(false) == other.object(false)
    }
}

impl fmt::Debug for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} {}", self.stage.name, self.variant, self.object(false))
    }
}

impl Section {
    /// Reads the keys of a section; `None` where a scene hasn't it.
    ///
    /// # Errors
    /// The first key that is unknown, belongs to another method or has a value that doesn't fit, with its place in the section.
    pub fn parse(stage: &'static Stage, written: Option<Map<String, Json>>) -> Result<Self, ParamError> {
        Self::parse_with(stage, written, |_| Map::new())
    }

    /// As [`Section::parse`], in a scene, of which `given` tells what is written under a section's key: fields that take the value
    /// of another section's key where they aren't given themselves do so, if it is one that they may have.
    ///
    /// # Errors
    /// As [`Section::parse`].
    pub fn parse_adopting<'a>(
        stage: &'static Stage,
        written: Option<Map<String, Json>>,
        given: impl Fn(&str, &str) -> Option<&'a Json>,
    ) -> Result<Self, ParamError> {
        let adopted = |field: Field<'_>| {
            let (section, key) = field.from()?;
            let kept_from_it = field.unless().is_some_and(|(section, key)| given(section, key).is_some());
            let mut value = given(section, key).filter(|_| !kept_from_it).cloned()?;
            check(&mut value, field.schema).is_ok().then(|| (field.name.to_owned(), value))
        };
        Self::parse_with(stage, written, |schema| fields(schema).filter_map(adopted).collect())
    }

    /// Reads the keys of a section, with those that `otherwise` gives for the chosen method's schema where the section says nothing.
    fn parse_with(
        stage: &'static Stage,
        written: Option<Map<String, Json>>,
        otherwise: impl FnOnce(&Json) -> Map<String, Json>,
    ) -> Result<Self, ParamError> {
        let mut keys = written.clone().unwrap_or_default();
        let method = choose(stage, &mut keys)?;
        let schema = (method.schema)();
        rename(&mut keys, schema)?;
        drop_foreign_defaults(stage, method, schema, &mut keys)?;
        for (key, value) in otherwise(schema) {
            keys.entry(key).or_insert(value);
        }
        let mut keys = Json::Object(keys);
        check(&mut keys, schema).map_err(|problem| with_takers(stage, method, &keys, problem))?;
        let job = (method.parse)(keys).map_err(|e| ParamError::at_itself(e, "give what the schema says"))?;
        job.check()?;
        Ok(Self { stage, method, variant: "", written, job })
    }

    /// The stage.
    pub fn stage(&self) -> &'static Stage {
        self.stage
    }

    /// The method that was chosen.
    pub fn method(&self) -> &'static Method {
        self.method
    }

    /// The keys as they were written; `None` where the scene has no such section.
    pub fn written(&self) -> Option<&Map<String, Json>> {
        self.written.as_ref()
    }

    /// The job.
    pub fn job(&self) -> &dyn Job {
        self.job.as_ref()
    }

    /// The parameters, where the method is the one asked for.
    pub fn get<O: Op>(&self) -> Option<&O> {
        self.job.as_any().downcast_ref()
    }

    /// Whether the job has a use for a slot.
    pub fn wants(&self, slot: &str) -> Want {
        self.job.wants(slot)
    }

    /// Its product, and what else `work` gives beside: it is given the inputs by slot, and does what the job would do.
    pub(crate) fn run_with<T>(
        &self,
        inputs: &Inputs,
        work: impl FnOnce(&Values<'_>) -> Result<(op::Product, T), Failure>,
    ) -> Result<(StageOutput, T), Error> {
        let (product, beside) =
            work(&inputs.values()).map_err(|failure| Error::failed(self.stage.name, failure))?;
        let schema = (self.method.figures)();
        let mut metrics = Metrics { figures: product.figures, times: std::collections::BTreeMap::new() };
        for field in fields(schema).filter(|field| field.is_time()) {
            if let Some(time) = metrics.figures.remove(field.name).and_then(|time| time.as_f64()) {
                metrics.times.insert(field.name.to_owned(), time);
            }
        }
        Ok((StageOutput { artefact: product.artefact, metrics }, beside))
    }

    /// The stage at one of its places; `None` where the scene gives that nothing to do.
    pub fn at(&self, place: &ivd_core::op::Place) -> Option<Self> {
        let (method, job) = match place.kind {
            PlaceKind::Own => (self.method, self.job.again()),
            PlaceKind::Precursor { method } => (method, self.job.precursor()?),
            PlaceKind::Beside { method } => (method, self.job.beside()?),
            PlaceKind::Fixed { method } => (method, (method.parse)(Json::Object(Map::new())).ok()?),
        };
        let written = self.written.clone();
        Some(Self { stage: self.stage, method, variant: place.variant, written, job })
    }

    /// The parameters with the word that chooses the method; without those that say how the work is done where it is the key of a
    /// cache that is asked for.
    fn object(&self, is_key: bool) -> Json {
        let mut params = self.job.params();
        if is_key {
            let schema = (self.method.schema)();
            fields(schema).filter(|field| field.is_how()).for_each(|field| {
                params.remove(field.name);
            });
        }
        if !self.stage.selector.is_empty() && !self.method.name.is_empty() {
            params.insert(self.stage.selector.to_owned(), Json::String(self.method.name.to_owned()));
        }
        Json::Object(params)
    }
}

/// The method that a section chooses, whose key is taken out.
fn choose(stage: &'static Stage, keys: &mut Map<String, Json>) -> Result<&'static Method, ParamError> {
    let chosen = if stage.selector.is_empty() { None } else { keys.remove(stage.selector) };
    let known = || stage.methods.iter().map(|method| method.name);
    let found = match &chosen {
        None => stage.methods.iter().find(|method| keys.contains_key(method.with)).or(stage.method(None)),
        Some(Json::String(name)) => stage.method(Some(name)),
        Some(_) => None,
    };
    found.ok_or_else(|| {
        let word = chosen
            .map_or_else(String::new, |word| word.as_str().map_or_else(|| word.to_string(), str::to_owned));
        unknown("word", &word, known()).under(stage.selector)
    })
}

/// A problem of a key, with the methods that would take what is given for it.
fn with_takers(stage: &Stage, method: &Method, keys: &Json, mut problem: ParamError) -> ParamError {
    let Some(value) = keys.get(&problem.field) else { return problem };
    let takes = |other: &&Method| {
        let schema = (other.schema)();
        let field = fields(schema).find(|field| field.name == problem.field);
        other.name != method.name
            && field.is_some_and(|field| check(&mut value.clone(), field.schema).is_ok())
    };
    let names: Vec<&str> = stage.methods.iter().filter(takes).map(|other| other.name).collect();
    if !names.is_empty() {
        let names = names.join(", ");
        problem.remedy = format!("{}; {} = {value} is for {names}", problem.remedy, problem.field);
    }
    problem
}

/// A key that the method doesn't read is a mistake, whoever wrote it expects something of it; but for one that says what it would say
/// anyway: the default of every method that reads it.
fn drop_foreign_defaults(
    stage: &'static Stage,
    method: &'static Method,
    schema: &Json,
    keys: &mut Map<String, Json>,
) -> Result<(), ParamError> {
    let foreign: Vec<String> =
        keys.keys().filter(|key| fields(schema).all(|field| field.name != *key)).cloned().collect();
    for key in foreign {
        let (mut readers, mut says_nothing) = (Vec::new(), true);
        for other in stage.methods {
            let schema = (other.schema)();
            if let Some(field) = fields(schema).find(|field| field.name == key) {
                readers.push(other.name);
                says_nothing &= keys.get(&key).is_some_and(|value| is_default(value, field));
            }
        }
        if readers.is_empty() {
            // Those of the other methods too: it may be one of them that is meant.
            let all = stage.methods.iter().flat_map(|method| fields((method.schema)()));
            let known: BTreeSet<&str> = all.map(|field| field.name).collect();
            let selector = Some(stage.selector).filter(|selector| !selector.is_empty());
            return Err(unknown("key", &key, known.into_iter().chain(selector)).under(&key));
        }
        if !says_nothing {
            let (problem, remedy) = (
                format!("{} doesn't read it", method.name),
                format!("it belongs to {} {}", stage.selector, readers.join(", ")),
            );
            return Err(ParamError::at_itself(problem, remedy).under(&key));
        }
        keys.remove(&key);
    }
    Ok(())
}

impl crate::Stage for Section {
    fn facts(&self) -> crate::Facts {
        crate::Facts {
            name: self.stage.name,
            revision: self.method.revision,
            inputs: self.method.slots,
            output: self.job.output(),
            figures: self.method.figures,
        }
    }

    fn close(&self) -> &'static [&'static str] {
        self.job.close()
    }

    fn memory(&self) -> Memory {
        self.job.memory().unwrap_or(self.stage.memory)
    }

    fn remark(&self, figures: &Metrics) -> Result<Option<String>, Error> {
        (self.method.remark)(Json::Object(figures.figures.clone()))
            .map_err(|problem| Error::figures(self.stage.name, problem))
    }

    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Error> {
        self.job.look_ahead(slot, value).map_err(|failure| Error::failed(self.stage.name, failure))
    }

    fn params(&self) -> Json {
        self.object(false)
    }

    fn identity(&self) -> Json {
        self.object(true)
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Error> {
        self.job.sources().map_err(|failure| Error::failed(self.stage.name, failure))
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<StageOutput, Error> {
        self.run_with(inputs, |values| Ok((self.job.run(values, exec)?, ()))).map(|(product, ())| product)
    }
}
