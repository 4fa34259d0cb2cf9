use serde_json::Value as Json;

use super::{FiguresOf, Gives, Job, Op, Output, Slot, Slots, schema_of};
use crate::Kind;

/// One method of a stage, without its type.
#[derive(Debug, Clone, Copy)]
pub struct Method {
    /// Its name, as the stage's selector chooses it; empty for the only one.
    pub name: &'static str,
    /// [`Op::REVISION`].
    pub revision: u32,
    /// What it reads.
    pub slots: &'static [Slot],
    /// The slot of other methods without which a command takes this one, where none is chosen; empty for none.
    pub without: &'static str,
    /// The slot or key with which this one is taken, where none is chosen; empty for none.
    pub with: &'static str,
    /// Kind of what it gives; `None` where the first input or a parameter decides that.
    pub output: Option<Kind>,
    /// JSON Schema of its parameters, without references.
    pub schema: fn() -> &'static Json,
    /// JSON Schema of its figures, without references.
    pub figures: fn() -> &'static Json,
    /// [`Op::REMARK`] of figures by their names; an error where one is missing or of another type.
    pub remark: fn(Json) -> Result<Option<String>, String>,
    /// The job with these parameters; those that aren't given have their defaults.
    pub parse: fn(Json) -> Result<Box<dyn Job>, String>,
}

/// Declares a method of a stage.
pub const fn method<O: Op>(name: &'static str) -> Method {
    Method {
        name,
        revision: O::REVISION,
        slots: <O::Inputs<'static> as Slots<'static>>::SLOTS,
        without: "",
        with: "",
        output: <<O::Gives as Gives>::Output as Output>::KIND,
        schema: schema_of::<O>,
        figures: schema_of::<FiguresOf<O>>,
        remark: |json| {
            let Some(remark) = O::REMARK else { return Ok(None) };
            let figures = serde_json::from_value(json).map_err(|error| error.to_string())?;
            Ok(remark(&figures))
        },
        parse: |json| {
            let op: O = serde_json::from_value(json).map_err(|error| error.to_string())?;
            Ok(Box::new(op))
        },
    }
}

impl Method {
    /// The method that a command takes without a slot, where none is chosen.
    #[must_use]
    pub const fn without(self, slot: &'static str) -> Self {
        Self { without: slot, ..self }
    }

    /// The method that is taken with a slot or key that no other has, where none is chosen.
    #[must_use]
    pub const fn with(self, name: &'static str) -> Self {
        Self { with: name, ..self }
    }

    /// Whether it has a slot of this name.
    #[must_use]
    pub fn has_slot(&self, name: &str) -> bool {
        self.slots.iter().any(|slot| slot.name == name)
    }
}

/// A use of a stage in a scene. Its slots are filled with the values of their names that are made last before it.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// What tells it from the stage's other uses; empty for the one that the stage is named by.
    pub variant: &'static str,
    /// Name of the value that it gives.
    pub gives: &'static str,
    /// Which job it does.
    pub kind: PlaceKind,
    /// Values without which there is nothing to do, whatever its method reads.
    pub needs: &'static [&'static str],
    /// Slots that stay empty.
    pub empty: &'static [&'static str],
    /// Slots that are filled with a value of another name, with that name; of several names of a slot the first that is made counts.
    pub from: &'static [(&'static str, &'static str)],
    /// Slots that are filled with what the parameter of the same name says, with the values of a scene that it may name; anything else
    /// that it says is a file.
    pub named: &'static [(&'static str, &'static [&'static str])],
    /// Slots that are filled only where a value is made, with that value's name.
    pub with: &'static [(&'static str, &'static str)],
    /// Slots that stay empty where a value is made, with that value's name; what they would hold is then no longer needed either.
    pub unless: &'static [(&'static str, &'static str)],
    /// The parameter, and what it must be, for this place to have something to do.
    pub when: Option<(&'static str, &'static str)>,
    /// Whether it runs before the places of all other stages.
    pub is_first: bool,
    /// Slots that are filled only with what something else of the scene needs anyway: nothing is made for them.
    pub if_made: &'static [&'static str],
    /// Whether it has nothing to do where no other place of the scene reads its value; a value that an output may be made from stays
    /// something to do.
    pub for_readers: bool,
    /// Whether it has nothing to do where no output is named by what it gives; a scene that doesn't ask for it doesn't tell of it.
    pub for_outputs: bool,
    /// Why it isn't needed where no other reads its value.
    pub unread: &'static str,
    /// What its time grows with.
    pub amount: Amount,
}

/// What the time of a place, or of writing a file, grows with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Amount {
    /// Voxels of the volume.
    Voxels,
    /// Voxels in the reach of what moves.
    VoxelsInReach,
    /// Triangles of the lattice before it is refined.
    TrianglesAsCut,
    /// Triangles of the refined lattice.
    Triangles,
    /// Vertices of the refined lattice in the reach of what moves.
    VerticesInReach,
    /// Pixels of a picture times voxels along an edge of the volume.
    Samples,
    /// Pixels of a picture.
    Pixels,
}

/// Which job a place does.
#[derive(Debug, Clone, Copy)]
pub enum PlaceKind {
    /// The stage's own.
    Own,
    /// The job that the stage's own goes on from ([`Op::precursor`]).
    Precursor {
        /// How it is declared.
        method: &'static Method,
    },
    /// Another job by the same parameters ([`Op::beside`]).
    Beside {
        /// How it is declared.
        method: &'static Method,
    },
    /// A job without parameters.
    Fixed {
        /// How it is declared.
        method: &'static Method,
    },
}

/// A stage: its methods, and how a scene uses it.
#[derive(Debug, Clone, Copy)]
pub struct Stage {
    /// Name: of its section in a scene, of its command, in records.
    pub name: &'static str,
    /// What it does, in one sentence.
    pub about: &'static str,
    /// The key that chooses the method, such as `method`; empty for a stage of one.
    pub selector: &'static str,
    /// Its methods; the first is taken where none is chosen.
    pub methods: &'static [Method],
    /// The inputs that a command takes by their order, the others being flags.
    pub positional: &'static [&'static str],
    /// Its uses in a scene, in the order in which they run.
    pub places: &'static [Place],
    /// Whether a scene that doesn't have its section, or gives it nothing to do ([`Op::idle`]), doesn't tell of it: for a stage that few scenes have.
    pub quiet: bool,
    /// About how much memory its methods take that don't say so themselves ([`crate::op::Op::memory`]).
    pub memory: Memory,
}

/// About how many bytes of memory work takes, generously. Nothing is decided by it: where a memory limit ends a run, the message tells a limit that should do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Memory {
    /// For each voxel of the largest grid among the inputs.
    pub voxel: u64,
    /// For each voxel of the boxes round what a motion among them reaches.
    pub reached: u64,
    /// For each triangle of the largest lattice among them.
    pub triangle: u64,
}

impl Place {
    /// The one use of a stage that has no more, by the value that it gives.
    pub const fn only(gives: &'static str) -> Self {
        Self {
            variant: "",
            gives,
            kind: PlaceKind::Own,
            needs: &[],
            empty: &[],
            from: &[],
            named: &[],
            with: &[],
            unless: &[],
            when: None,
            is_first: false,
            if_made: &[],
            for_readers: false,
            for_outputs: false,
            unread: "no output needs it",
            amount: Amount::Voxels,
        }
    }

    /// Name of the value that fills a slot, where `is_made` tells which values there are: the first of its names that is made, else
    /// the first.
    pub fn value_for<'a>(&self, slot: &'a str, is_made: impl Fn(&str) -> bool) -> &'a str {
        let mut names = self.from.iter().filter(|(renamed, _)| *renamed == slot).map(|(_, value)| *value);
        let first = names.clone().next();
        names.find(|value| is_made(value)).or(first).unwrap_or(slot)
    }

    /// Whether a slot is left empty, where `is_made` tells which values there are.
    pub fn leaves_empty(&self, slot: &str, is_made: impl Fn(&str) -> bool) -> bool {
        let of = |list: &[(&str, &'static str)]| {
            list.iter().find(|(name, _)| *name == slot).map(|(_, value)| is_made(value))
        };
        self.empty.contains(&slot) || of(self.with) == Some(false) || of(self.unless) == Some(true)
    }
}

impl Stage {
    /// The method of a name; the first where it is `None`.
    pub fn method(&self, name: Option<&str>) -> Option<&Method> {
        match name {
            None => self.methods.first(),
            Some(name) => self.methods.iter().find(|method| method.name == name),
        }
    }
}
