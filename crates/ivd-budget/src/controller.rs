//! What a run asks before each stage: which settings the budget takes, and how it ended.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Duration, Instant};

use ivd_artefact::{Artefact, ContentHash, Kind};
use ivd_core::{Classified, ErrorClass, Exec};
use ivd_motion::deform::RingMethod;
use ivd_pipeline::plan::{NodeId, Plan, PlanNode};
use ivd_pipeline::scene::Loaded;
use ivd_pipeline::{Control, Decisions, Error, PipelineOptions, Runner, StageRecord, StageResult, State};

use crate::choose::{Fit, KnobValues, fit};
use crate::knobs::{Knob, Setting};
use crate::predict::Model;
use crate::work::Amounts;
use crate::{Budget, BudgetReport, Choice, rate_name};

/// Predictions are this much too short now and then: what is there is divided by it.
const MARGIN: f64 = 1.1;

/// Chooses settings while a scene runs.
pub(crate) struct Controller<'a> {
    pub(crate) options: &'a PipelineOptions,
    budget: &'a Budget,
    /// The scene as it was requested.
    pub(crate) requested: &'a Loaded,
    /// The settings taken so far; those still open may change.
    pub(crate) setting: Setting,
    pub(crate) model: Model,
    /// Results that the search for an error made on the way.
    pub(crate) ready: BTreeMap<NodeId, StageResult>,
    pub(crate) report: BudgetReport,
    start: Instant,
    hashes: BTreeMap<NodeId, ContentHash>,
    /// Knobs that can't change any more.
    settled: BTreeSet<Knob>,
    whys: BTreeMap<Knob, String>,
    /// The place that is being worked on; `None` once only files are left.
    running: Option<NodeId>,
    /// Whether it was said that nothing is predicted to fit.
    warned: bool,
}

impl Budget {
    /// The context with the deadline of a run that began at `start`.
    pub(crate) fn bounded(&self, exec: &Exec, start: Instant) -> Exec {
        let limit = self.max_time_s.and_then(|s| Duration::try_from_secs_f64(s).ok());
        match limit.and_then(|limit| start.checked_add(limit)) {
            Some(deadline) => exec.clone().with_deadline(deadline),
            None => exec.clone(),
        }
    }
}

impl Control for Controller<'_> {
    /// Before the stage at `at` runs: sets the plan's stages to what the budget allows. Gives the stage's result where the
    /// search for an error has made it already.
    fn before(
        &mut self,
        at: usize,
        plan: &mut Plan,
        done: &BTreeMap<NodeId, StageResult>,
        runner: Runner<'_>,
    ) -> Result<Option<StageResult>, Error> {
        let (id, is_own) = (plan.nodes()[at].id, plan.nodes()[at].is_own());
        self.running = Some(id);
        let budget = self.budget;
        self.measure_work(done);
        if let Some(most) = budget.max_error_mm.filter(|_| id == NodeId::of(&ivd_lattice::refine::STAGE)) {
            self.hold_error(most, plan, done, runner)?;
            self.settled.extend([Knob::Level, Knob::Steps]);
        }
        let knob = Knob::ALL.into_iter().find(|k| k.stage() == id.stage && is_own);
        if let (Some(most), Some(knob)) = (budget.max_time_s, knob) {
            self.fit_time(most, at, plan, runner)?;
            self.settle(knob, runner.exec);
        }
        Ok(self.ready.remove(&id))
    }

    /// After a stage: learns from its time.
    fn after(&mut self, id: NodeId, done: &StageResult) {
        self.running = None;
        self.hashes.insert(id, done.hash);
        if done.record.state == State::Ran {
            self.model.learn(&rate_name(id.stage, id.variant), &self.setting, done.record.wall_s);
        }
    }

    /// What was chosen so far, and the error that was measured.
    fn summary(&self) -> Decisions {
        let so_far = BudgetReport { choices: self.choices(), max_time_s: None, ..self.report.clone() };
        Decisions { title: "Budget", lines: so_far.summary() }
    }

    /// Makes the end of a deadline out of an error that it caused.
    fn explain(&self, error: Error, exec: &Exec, stages: &[StageRecord]) -> Error {
        let late = exec.cancel.is_late() && !exec.cancel.is_asked();
        let (Some(most), true, ErrorClass::Limit) = (self.budget.max_time_s, late, error.error_class())
        else {
            return error;
        };
        let took = self.start.elapsed().as_secs_f64();
        let ended: Vec<&str> =
            stages.iter().filter(|r| r.state != State::NotNeeded).map(|r| r.stage.as_str()).collect();
        let ended = if ended.is_empty() { "nothing".to_owned() } else { ended.join(", ") };
        let running = self.running.map_or("the outputs", |id| id.stage);
        Error::Limit(format!(
            "--max-time {most}: the time is up after {took:.3} s, in {running}; done: {ended}; what was written is whole. \
             Give it more time, a cache (`--cache DIR`, so that the next run goes on from there), or fewer outputs"
        ))
    }
}

impl<'a> Controller<'a> {
    /// # Errors
    /// What is recorded of the stages can't be read.
    pub(crate) fn new(
        requested: &'a Loaded,
        options: &'a PipelineOptions,
        budget: &'a Budget,
        start: Instant,
    ) -> Result<Self, Error> {
        let Budget { max_time_s, max_error_mm, .. } = *budget;
        Ok(Self {
            options,
            budget,
            requested,
            setting: Setting::of(&requested.scene),
            model: Model::new(budget.times.clone())?,
            ready: BTreeMap::new(),
            report: BudgetReport { max_time_s, max_error_mm, ..BudgetReport::default() },
            start,
            hashes: BTreeMap::new(),
            settled: BTreeSet::new(),
            whys: BTreeMap::new(),
            running: None,
            warned: false,
        })
    }

    /// What the budget did, at the end of a run that took `wall_s`.
    ///
    /// # Errors
    /// Where it took longer than it may.
    pub(crate) fn finish(mut self, wall_s: f64) -> Result<BudgetReport, Error> {
        let Budget { max_time_s, max_error_mm, .. } = *self.budget;
        if let Some(most) = max_time_s.filter(|most| wall_s > *most) {
            return Err(Error::Limit(format!(
                "--max-time {most}: everything is done and written, but it took {wall_s:.3} s; give it more time, or make \
                 the scene smaller"
            )));
        }
        if max_error_mm.is_some() && self.report.error_mm.is_none() {
            self.report.error_mm = Some(0.0);
        }
        self.report.choices = self.choices();
        self.report.wall_s = wall_s;
        self.report.kept = true;
        Ok(self.report)
    }

    /// The scene's work, as far as it is known by now.
    fn measure_work(&mut self, done: &BTreeMap<NodeId, StageResult>) {
        let scene = &self.requested.scene;
        if let Some(Artefact::Volume(volume)) = done.get(&NodeId::IMPORT).map(|d| d.artefact.as_ref())
            && self.model.amounts.voxels == 0.0
        {
            self.model.amounts = Amounts::of_volume(scene, volume.grid());
        }
        if let Some(Artefact::Lattice(lattice)) =
            done.get(&NodeId::of(&ivd_lattice::extract::STAGE)).map(|d| d.artefact.as_ref())
            && self.model.amounts.triangles == 0.0
        {
            let amounts = std::mem::take(&mut self.model.amounts);
            self.model.amounts = amounts.with_lattice(scene.asked(), lattice);
        }
    }

    /// Whether the user has fixed a knob.
    pub(crate) fn pinned(&self, knob: Knob) -> bool {
        // What a number of steps costs and errs is on record for the rings only.
        let unknown = knob == Knob::Steps
            && self.requested.scene.get::<RingMethod>(&ivd_motion::deform::STAGE).is_none();
        unknown || knob.keys().iter().any(|key| self.budget.pinned.contains(*key))
    }

    /// Takes the settings that are predicted to end in time; those of the scene where they do.
    fn fit_time(&mut self, most: f64, at: usize, plan: &mut Plan, runner: Runner<'_>) -> Result<(), Error> {
        let requested = Setting::of(&self.requested.scene);
        let settled = self.settled.clone();
        self.take(plan, |knob| !settled.contains(&knob), &requested)?;
        let cached = self.foreseen(at, plan, runner);
        let waits = |n: &&PlanNode| n.needed && !cached.contains(&n.id) && !self.ready.contains_key(&n.id);
        let rates = self.rates(at, plan, &cached);
        let open: Vec<Knob> = Knob::ALL
            .into_iter()
            .filter(|knob| !self.settled.contains(knob) && !self.pinned(*knob))
            .filter(|knob| plan.nodes()[at..].iter().filter(waits).any(|n| n.id.stage == knob.stage()))
            .collect();
        let settings: Vec<KnobValues> =
            open.iter().map(|knob| knob.settings(&requested, &self.model.known)).collect();
        let base = self.setting;
        let setting = |places: &[usize]| {
            let moved = open.iter().zip(&settings).zip(places).filter(|(_, place)| **place > 0);
            moved.fold(base, |s, ((knob, settings), place)| s.with(*knob, &settings.0[*place]))
        };
        let seconds = |places: &[usize]| {
            let setting = setting(places);
            rates.iter().map(|rate| self.model.seconds(rate, &setting)).sum::<f64>()
        };
        let elapsed = self.start.elapsed().as_secs_f64();
        let predicted = elapsed + seconds(&vec![0; open.len()]);
        let Fit { at: places, seconds, fits } = fit(&settings, seconds, (most - elapsed) / MARGIN);
        let found = setting(&places);
        let why = format!("as the scene's value is predicted to end after {predicted:.2} s of {most} s");
        for (knob, _) in open.iter().zip(&places).filter(|(_, place)| **place > 0) {
            self.whys.insert(*knob, why.clone());
        }
        self.report.predicted_s = Some(elapsed + seconds);
        if !fits && !std::mem::replace(&mut self.warned, true) {
            runner.exec.observer().note(&format!(
                "budget: even the coarsest settings are predicted to end after {:.2} s, too late or too near to {most} s; going on",
                elapsed + seconds
            ));
        }
        self.take(plan, |_| true, &found)
    }

    /// Takes the values of some knobs from `from`, in the settings and in the plan.
    pub(crate) fn take(
        &mut self,
        plan: &mut Plan,
        which: impl Fn(Knob) -> bool,
        from: &Setting,
    ) -> Result<(), Error> {
        let mut setting = self.setting;
        for knob in Knob::ALL.into_iter().filter(|knob| which(*knob)) {
            match knob {
                Knob::Level => setting.level = from.level,
                Knob::Steps => setting.steps = from.steps,
                Knob::Resolution => setting.resolution = from.resolution,
                Knob::Picture => (setting.step, setting.termination) = (from.step, from.termination),
            }
        }
        self.setting = setting;
        plan.retune(&self.scene_with(&setting)?, self.options.input.as_deref())
    }

    /// The scene with the knobs that differ from what it requests.
    ///
    /// # Errors
    /// A value that the scene doesn't take.
    pub(crate) fn scene_with(&self, setting: &Setting) -> Result<Loaded, Error> {
        let mut loaded = self.requested.clone();
        let requested = Setting::of(&loaded.scene);
        for knob in Knob::ALL.into_iter().filter(|knob| !knob.moved(&requested, setting).is_empty()) {
            knob.apply(&mut loaded.scene, setting)?;
        }
        Ok(loaded)
    }

    /// A knob's value is final: says what became of it.
    fn settle(&mut self, knob: Knob, exec: &Exec) {
        if self.settled.insert(knob) {
            for choice in self.choices().iter().filter(|c| c.stage == knob.stage()) {
                exec.observer().note(&format!("budget: {}", choice.summary()));
            }
        }
    }

    /// The knobs that differ from what the scene requests.
    fn choices(&self) -> Vec<Choice> {
        let requested = Setting::of(&self.requested.scene);
        let of = |knob: Knob| {
            let why = self.whys.get(&knob).cloned().unwrap_or_default();
            knob.moved(&requested, &self.setting).into_iter().map(move |(name, from, to)| Choice {
                stage: knob.stage().to_owned(),
                knob: name.to_owned(),
                from,
                to,
                why: why.clone(),
            })
        };
        Knob::ALL.into_iter().flat_map(of).collect()
    }

    /// Says why a knob was moved.
    pub(crate) fn because(&mut self, knob: Knob, why: &str, exec: &Exec) {
        self.whys.insert(knob, why.to_owned());
        self.settle(knob, exec);
    }

    /// The places from `at` on whose results the cache has, as far as that can be told from hashes alone.
    fn foreseen(&self, at: usize, plan: &Plan, runner: Runner<'_>) -> BTreeSet<NodeId> {
        let mut hashes = self.hashes.clone();
        let mut found = BTreeSet::new();
        for node in plan.nodes()[at..].iter().filter(|n| n.needed) {
            let Some(stage) = node.stage.as_deref().filter(|s| !self.options.force.contains(s.name())) else {
                continue;
            };
            let known = node.inputs.iter().map(|(slot, from)| Some(((*slot).to_owned(), *hashes.get(from)?)));
            let Some(inputs) = known.collect::<Option<BTreeMap<_, _>>>() else { continue };
            // The one stage of a plan that gives the kind it read is warp, which reads the volume.
            if let Some(hash) = runner.foresee(stage, inputs, Kind::Volume) {
                hashes.insert(node.id, hash);
                found.insert(node.id);
            }
        }
        found
    }

    /// Names of the rates of everything that is still to be done: stages, then files.
    fn rates(&self, at: usize, plan: &Plan, cached: &BTreeSet<NodeId>) -> Vec<String> {
        let ahead: Vec<&PlanNode> = plan.nodes()[at..].iter().filter(|n| n.needed).collect();
        let made = |id: &NodeId| cached.contains(id) || self.ready.contains_key(id);
        let stages = ahead.iter().filter(|n| !made(&n.id)).map(|n| rate_name(n.id.stage, n.id.variant));
        let there = |path: &Path| self.options.out.join(path).exists();
        let output = &self.requested.scene.output;
        let from =
            |key: &str| ahead.iter().find(|n| n.outputs.contains(&key)).map(|n| cached.contains(&n.id));
        let files = output.files().into_iter().filter_map(|(key, path)| {
            let is_cached = from(key)?;
            (!is_cached || !there(path)).then(|| rate_name("write", key))
        });
        let pictures = output.images.iter().filter_map(|picture| {
            let is_cached = from(picture.name())?;
            (!is_cached).then(|| rate_name("write", "image"))
        });
        let all_cached = ahead.iter().all(|n| cached.contains(&n.id));
        let report = (output.report && !all_cached).then(|| "report".to_owned());
        let whole = self.options.until.is_none();
        stages.chain(files.chain(pictures).chain(report).filter(|_| whole)).collect()
    }
}
