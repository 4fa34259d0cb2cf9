use std::any::Any;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};

use super::{Failure, Memory, Slots, Values, check_fields};
use crate::{Artefact, Exec, Kind, ParamError, Value};

/// Whether a method with its parameters has a use for one of its slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// It doesn't look at it.
    No,
    /// It reads it.
    Yes,
    /// It reads it in a scene that has the section of the stage which gives it.
    IfWritten,
    /// It reads it where a person gives it as a file. In a scene the part that the lattice is cut at must come of that file, too.
    IfGiven,
}

/// What figures say beside themselves.
pub type Remark<F> = fn(&F) -> Option<String>;

/// One method of one stage: its parameters, and the work.
pub trait Op: Serialize + DeserializeOwned + JsonSchema + Default + Clone + Send + Sync + 'static {
    /// Raised whenever the same inputs and parameters may give another result.
    const REVISION: u32;
    /// What a person should know of a result beside its figures, where there is something: that it isn't all that was asked for.
    const REMARK: Option<Remark<FiguresOf<Self>>> = None;
    /// What it reads.
    type Inputs<'a>: Slots<'a>;
    /// What it gives: a value, and its figures.
    type Gives: Gives;

    /// Checks every field against its schema, and then what goes together.
    ///
    /// # Errors
    /// Names the field as it is typed.
    fn check(&self) -> Result<(), ParamError> {
        check_fields(self)?;
        self.check_together()
    }

    /// Checks what the schema of a single field can't say.
    ///
    /// # Errors
    /// Names the field as it is typed.
    fn check_together(&self) -> Result<(), ParamError> {
        Ok(())
    }

    /// Whether it has a use for an optional slot.
    fn wants(&self, slot: &str) -> Want {
        let _ = slot;
        Want::Yes
    }

    /// Kernels ([`crate::Kernel::NAME`]) that it uses and whose results on a device are close to the processor's and not the same bytes: what a
    /// device made by one of them is kept apart from what the processor made.
    fn close(&self) -> &'static [&'static str] {
        &[]
    }

    /// Why there is nothing to do, where there isn't.
    fn idle(&self) -> Option<&'static str> {
        None
    }

    /// What it takes where that is other than its stage says; see [`crate::op::Stage::memory`].
    fn memory(&self) -> Option<Memory> {
        None
    }

    /// Checks what can be checked against a value that the one in a slot is still to be made from, before work goes into that; in no slot against the volume
    /// that all is made from.
    ///
    /// # Errors
    /// What would be an error with the value in the slot as well.
    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure> {
        let _ = (slot, value);
        Ok(())
    }

    /// A job whose result this one goes on from, where there is one that is worth keeping.
    fn precursor(&self) -> Option<Box<dyn Job>> {
        None
    }

    /// Another job that a scene may want by the same parameters, where there is one.
    fn beside(&self) -> Option<Box<dyn Job>> {
        None
    }

    /// Kind of what it gives, where its parameters decide that; `None` where it is that of the first input.
    fn output(&self) -> Option<Kind> {
        <Self::Gives as Gives>::Output::KIND
    }

    /// Files that it reads and that are no artefacts; their content and endings are part of what the result is made from, where they
    /// lie isn't.
    ///
    /// # Errors
    /// Where they can't be listed.
    fn sources(&self) -> Result<Vec<PathBuf>, Failure> {
        Ok(Vec::new())
    }

    /// Does the work.
    ///
    /// # Errors
    /// The stage crate's own.
    fn run(&self, inputs: Self::Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure>;
}

/// A value, and its figures.
pub trait Gives {
    /// The value.
    type Output: Output;
    /// What is told of the work: `--json`, the report's rows, what budgets read.
    type Figures: Serialize + DeserializeOwned + JsonSchema + Send;

    /// Both.
    fn into_parts(self) -> (Self::Output, Self::Figures);
}

impl<O: Output, F: Serialize + DeserializeOwned + JsonSchema + Send> Gives for (O, F) {
    type Output = O;
    type Figures = F;

    fn into_parts(self) -> Self {
        self
    }
}

/// The figures of a method.
pub type FiguresOf<O> = <<O as Op>::Gives as Gives>::Figures;

/// What a method can give: a value of one kind, or an [`Artefact`] of the kind that [`Op::output`] tells.
pub trait Output {
    /// Its kind; `None` of an artefact.
    const KIND: Option<Kind>;

    /// The artefact that holds it.
    fn into_artefact(self) -> Artefact;
}

impl<T: Value> Output for T {
    const KIND: Option<Kind> = Some(T::KIND);

    fn into_artefact(self) -> Artefact {
        Value::into_artefact(self)
    }
}

impl Output for Artefact {
    const KIND: Option<Kind> = None;

    fn into_artefact(self) -> Artefact {
        self
    }
}

/// What a job gives.
#[derive(Debug)]
pub struct Product {
    /// The value.
    pub artefact: Artefact,
    /// The figures of the work, by their names.
    pub figures: Map<String, Json>,
}

impl Product {
    /// A value with its figures.
    pub fn new(output: impl Output, figures: &impl Serialize) -> Self {
        Self { artefact: output.into_artefact(), figures: object(figures) }
    }
}

/// An [`Op`] without its type: what scenes, commands, caches and sessions handle.
pub trait Job: Send + Sync + 'static {
    /// Its parameters.
    fn params(&self) -> Map<String, Json>;
    /// As [`Op::check`].
    ///
    /// # Errors
    /// Names the field as it is typed.
    fn check(&self) -> Result<(), ParamError>;
    /// As [`Op::wants`].
    fn wants(&self, slot: &str) -> Want;
    /// As [`Op::close`].
    fn close(&self) -> &'static [&'static str];
    /// As [`Op::idle`].
    fn idle(&self) -> Option<&'static str>;
    /// As [`Op::memory`].
    fn memory(&self) -> Option<Memory>;
    /// As [`Op::look_ahead`].
    ///
    /// # Errors
    /// What would be an error with the value in the slot as well.
    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure>;
    /// As [`Op::beside`].
    fn beside(&self) -> Option<Box<dyn Job>>;
    /// As [`Op::precursor`].
    fn precursor(&self) -> Option<Box<dyn Job>>;
    /// As [`Op::output`].
    fn output(&self) -> Option<Kind>;
    /// As [`Op::sources`].
    ///
    /// # Errors
    /// Where they can't be listed.
    fn sources(&self) -> Result<Vec<PathBuf>, Failure>;
    /// Does the work.
    ///
    /// # Errors
    /// The stage crate's own; a usage error for a slot that is empty or filled with another kind.
    fn run(&self, values: &Values<'_>, exec: &Exec) -> Result<Product, Failure>;
    /// Itself, to be asked for its type.
    fn as_any(&self) -> &dyn Any;
    /// The same job once more.
    fn again(&self) -> Box<dyn Job>;
}

/// A struct of plain fields as JSON.
pub fn object(fields: &impl Serialize) -> Map<String, Json> {
    match serde_json::to_value(fields) {
        Ok(Json::Object(object)) => object,
        // Structs of numbers, words, lists and maps: a test of every method holds it.
        _ => Map::new(),
    }
}

impl<O: Op> Job for O {
    fn params(&self) -> Map<String, Json> {
        object(self)
    }

    fn check(&self) -> Result<(), ParamError> {
        Op::check(self)
    }

    fn wants(&self, slot: &str) -> Want {
        match O::Inputs::SLOTS.iter().find(|known| known.name == slot) {
            None => Want::No,
            Some(known) if !known.optional => Want::Yes,
            Some(_) => Op::wants(self, slot),
        }
    }

    fn close(&self) -> &'static [&'static str] {
        Op::close(self)
    }

    fn idle(&self) -> Option<&'static str> {
        Op::idle(self)
    }

    fn beside(&self) -> Option<Box<dyn Job>> {
        Op::beside(self)
    }

    fn memory(&self) -> Option<Memory> {
        Op::memory(self)
    }

    fn look_ahead(&self, slot: &str, value: &Artefact) -> Result<(), Failure> {
        Op::look_ahead(self, slot, value)
    }

    fn precursor(&self) -> Option<Box<dyn Job>> {
        Op::precursor(self)
    }

    fn output(&self) -> Option<Kind> {
        Op::output(self)
    }

    fn sources(&self) -> Result<Vec<PathBuf>, Failure> {
        Op::sources(self)
    }

    fn run(&self, values: &Values<'_>, exec: &Exec) -> Result<Product, Failure> {
        let (output, figures) = Op::run(self, O::Inputs::take(values)?, exec)?.into_parts();
        Ok(Product::new(output, &figures))
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn again(&self) -> Box<dyn Job> {
        Box::new(self.clone())
    }
}
