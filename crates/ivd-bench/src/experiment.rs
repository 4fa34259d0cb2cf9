use std::collections::BTreeMap;

use ivd_core::Exec;

/// Knobs of a setting and their values, in the words of the scene file.
pub type Knobs = BTreeMap<String, String>;

/// A failure of a stage, as it says it.
pub type Problem = Box<dyn std::error::Error + Send + Sync>;

/// What a result is worth. Found outside of the time that is taken.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scored {
    /// Distance from the truth, in the experiment's unit.
    pub error: f64,
    /// Work done: voxels visited, triangles, samples.
    pub counters: BTreeMap<String, f64>,
}

/// Judges a result.
pub type Score = Box<dyn FnOnce() -> Result<Scored, Problem>>;

/// Does a setting's work.
pub type Work = Box<dyn Fn(&Exec) -> Result<Score, Problem>>;

/// A value of every knob.
pub struct Setting {
    /// The knobs that say how well the work is done.
    pub knobs: Knobs,
    /// What is asked for; points of different tasks don't compete. Empty where there is one task.
    pub task: String,
    /// Whether this is what a user gets who says nothing.
    pub default: bool,
    /// Does the work; only this is timed. What it returns judges the result.
    pub run: Work,
}

impl Setting {
    /// A setting by its knobs.
    pub fn new(
        knobs: impl IntoIterator<Item = (&'static str, String)>,
        default: bool,
        run: impl Fn(&Exec) -> Result<Score, Problem> + 'static,
    ) -> Self {
        let knobs = knobs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        Self { knobs, task: String::new(), default, run: Box::new(run) }
    }

    /// The same for one of several tasks.
    #[must_use]
    pub fn of_task(mut self, task: String) -> Self {
        self.task = task;
        self
    }

    /// The knobs in one line.
    pub fn label(&self) -> String {
        label(&self.task, &self.knobs)
    }
}

/// A task and knobs in one line.
pub(crate) fn label(task: &str, knobs: &Knobs) -> String {
    let knobs = knobs.iter().map(|(name, value)| format!("{name} {value}"));
    let task = (!task.is_empty()).then(|| task.to_owned());
    task.into_iter().chain(knobs).collect::<Vec<_>>().join(", ")
}

/// The settings of a stage on one input, and what they are held against.
pub struct Experiment {
    /// The stage.
    pub stage: &'static str,
    /// The input, in words.
    pub input: String,
    /// The truth, in words.
    pub truth: &'static str,
    /// What the error measures.
    pub measure: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The counter that tells what a setting costs, where work is counted; without it that is processor time.
    pub counted: Option<&'static str>,
    /// Edge of the input's voxels (mm), where the error is a length.
    pub voxel_mm: Option<f64>,
    /// The input's amount of work: what is counted, and how many.
    pub work: (&'static str, f64),
    /// The settings.
    pub settings: Vec<Setting>,
}
