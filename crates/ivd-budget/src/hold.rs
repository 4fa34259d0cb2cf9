//! The search for an error on a scene: trials of refinement and time steps, each measured.

use std::collections::BTreeMap;

use ivd_artefact::Artefact;
use ivd_core::{Classified, ErrorClass, Exec, Lattice, counted};
use ivd_lattice::refine::RefineFigures;
use ivd_map::MapFigures;
use ivd_pipeline::plan::{NodeId, Plan};
use ivd_pipeline::{Error, Runner, StageResult, run_node};

use crate::controller::Controller;
use crate::knobs::{Knob, Setting, along, between, level_errors};
use crate::measure::{fields, motions, surfaces};
use crate::search::{Candidate, Learned, PARTS};
use crate::{LEVELS, rate_name};

const LATTICE: NodeId = NodeId::of(&ivd_lattice::extract::STAGE);
const REFINE: NodeId = NodeId::of(&ivd_lattice::refine::STAGE);
const OCTREE: NodeId = NodeId::of(&ivd_octree::STAGE);
const DEFORM: NodeId = NodeId::of(&ivd_motion::deform::STAGE);
const MAP: NodeId = NodeId::of(&ivd_map::STAGE);

/// What a trial measured (mm), and its results.
#[derive(Default)]
struct Trial {
    parts: BTreeMap<&'static str, f64>,
    done: BTreeMap<NodeId, StageResult>,
}

impl Trial {
    fn error(&self) -> f64 {
        self.parts.values().sum()
    }

    fn summary(&self) -> String {
        let parts = self.parts.iter().map(|(name, mm)| format!("{name} {mm:.4}"));
        parts.collect::<Vec<_>>().join(", ")
    }
}

impl Controller<'_> {
    /// Finds the cheapest refinement and time steps whose measured error is at most `most` (mm), and keeps their results.
    pub(crate) fn hold_error(
        &mut self,
        most: f64,
        plan: &mut Plan,
        done: &BTreeMap<NodeId, StageResult>,
        runner: Runner<'_>,
    ) -> Result<(), Error> {
        if !plan.needs(REFINE) {
            return Ok(());
        }
        let candidates = self.candidates(voxel_mm(done)?);
        let mut learned = Learned::new();
        let mut whole: Option<(f64, BTreeMap<NodeId, StageResult>)> = None;
        let mut least: Option<(Candidate, Trial)> = None;
        while let Some(at) = learned.next(&candidates, most) {
            let candidate = candidates[at];
            let (trial, ended) = match self.trial(&candidate, most, plan, done, &mut whole, runner) {
                // A coarse lattice may fold where a finer one doesn't.
                Err(error)
                    if error.error_class() == ErrorClass::Untrusted
                        && !matches!(error, Error::Figure { .. })
                        && learned.tried.len() + 1 < candidates.len() =>
                {
                    runner.exec.observer().note(&format!("budget: {}: {error}", named(&candidate)));
                    learned.trial(at, &candidate, [Some(2.0 * most), None, None], 0.0);
                    continue;
                }
                found => found?,
            };
            let (error, told) = (trial.error(), trial.summary());
            if ended && error <= most {
                return self.keep(&candidate, trial, most, plan, runner.exec);
            }
            runner.exec.observer().note(&format!(
                "budget: {} errs by {}{error:.4} mm of {most} mm ({told}); trying a finer one",
                named(&candidate),
                if ended { "" } else { "at least " }
            ));
            let part = |name: &str| trial.parts.get(name).copied();
            let fixed = ["inverse_mm", "map_mm"].iter().filter_map(|name| part(name)).sum();
            learned.trial(at, &candidate, ["lattice_mm", "motion_mm", "steps_mm"].map(part), fixed);
            if least.as_ref().is_none_or(|(_, t)| error < t.error()) {
                least = Some((candidate, trial));
            }
        }
        let (candidate, trial) =
            least.ok_or_else(|| Error::Limit(format!("--max-error {most}: nothing to try")))?;
        Err(Error::Limit(format!(
            "--max-error {most}: the least error found is {:.4} mm, with {} ({}); allow more, or free the knobs that --set \
             holds",
            trial.error(),
            named(&candidate),
            trial.summary()
        )))
    }

    /// Every refinement with every number of steps that may be chosen, with what the record predicts; `voxel` is the
    /// longest edge of a voxel (mm).
    fn candidates(&self, voxel: f64) -> Vec<Candidate> {
        let requested = Setting::of(&self.requested.scene);
        let free = |knob: Knob| !self.pinned(knob);
        let levels = if free(Knob::Level) { LEVELS.to_vec() } else { vec![requested.level.unwrap_or(2.0)] };
        let deform = self.requested.scene.asked().filter(|asked| !asked.is_still());
        let solver = along(self.model.known.deform, "steps");
        let steps = match deform {
            Some(deform) if free(Knob::Steps) && !deform.moves.handle.is_empty() => {
                solver.iter().map(|(steps, _)| *steps).collect()
            }
            _ => vec![requested.steps],
        };
        let push = deform.map_or(0.0, |asked| asked.balls().map(|(_, _, motion)| motion).fold(0.0, f64::max));
        let errors = level_errors(&self.model.known);
        let error = |level: f64, steps: f64| -> [f64; PARTS] {
            let known = solver.iter().filter_map(|(x, p)| Some((x.ln(), p.error_voxels?)));
            let stepping = between(known, steps.ln());
            [
                voxel * between(errors.iter().map(|e| (e.0, e.1)), level),
                push * between(errors.iter().map(|e| (e.0, e.2)), level),
                if deform.is_some() { voxel * stepping } else { 0.0 },
            ]
        };
        let candidate = |level: f64, steps: f64| {
            let setting = Setting { level: Some(level), steps, ..requested };
            let seconds =
                ["refine", "octree", "deform", "map"].map(|rate| self.model.seconds(rate, &setting));
            Candidate { level, steps, seconds: seconds.iter().sum(), parts: error(level, steps) }
        };
        levels
            .iter()
            .flat_map(|&level| steps.iter().map(move |&s| (level, s)))
            .map(|(l, s)| candidate(l, s))
            .collect()
    }

    /// Runs a candidate and measures it, part by part, the cheap ones first; ends early where it errs too much already.
    /// Tells whether every part was measured.
    fn trial(
        &mut self,
        candidate: &Candidate,
        most: f64,
        plan: &mut Plan,
        done: &BTreeMap<NodeId, StageResult>,
        whole: &mut Option<(f64, BTreeMap<NodeId, StageResult>)>,
        runner: Runner<'_>,
    ) -> Result<(Trial, bool), Error> {
        let mut trial = Trial::default();
        let setting = self.setting_of(candidate.level, candidate.steps);
        self.tune(plan, &setting)?;
        self.step(REFINE, plan, done, &mut trial.done, runner)?;
        let bound = trial.done[&REFINE].record.figures::<RefineFigures>()?.last.max_error_mm;
        trial.parts.insert("lattice_mm", bound);
        let moves = plan.needs(DEFORM);
        if bound > most || !moves {
            return Ok((trial, !moves && bound <= most));
        }
        self.step(DEFORM, plan, done, &mut trial.done, runner)?;
        let finer = self.stepped_finer(&setting, plan, done, &trial, runner)?;
        let apart = motions(trial.done[&DEFORM].value()?, finer.value()?);
        // The method is of first order: half the step leaves half the error, so the difference is the other half.
        trial.parts.insert("steps_mm", 2.0 * apart);
        if trial.error() > most {
            return Ok((trial, false));
        }
        self.tune(plan, &setting)?;
        self.carry(plan, done, &mut trial, runner)?;
        if trial.error() > most {
            return Ok((trial, false));
        }
        let apart = if setting.level == Some(0.0) {
            0.0
        } else {
            let made = match whole.take() {
                Some((steps, made)) if steps == setting.steps => made,
                _ => self.unrefined(setting.steps, plan, done, runner)?,
            };
            let (_, reference) = whole.insert((setting.steps, made));
            difference(reference, &trial.done, runner.exec)?
        };
        trial.parts.insert("motion_mm", apart);
        Ok((trial, true))
    }

    /// A setting with the knobs that aren't pinned.
    fn setting_of(&self, level: f64, steps: f64) -> Setting {
        let level = if self.pinned(Knob::Level) { self.setting.level } else { Some(level) };
        let steps = if self.pinned(Knob::Steps) { self.setting.steps } else { steps };
        Setting { level, steps, ..self.setting }
    }

    fn tune(&self, plan: &mut Plan, setting: &Setting) -> Result<(), Error> {
        plan.retune(&self.scene_with(setting)?, self.options.input.as_deref())
    }

    /// Runs a place of the plan on a trial's results, and on those of the run so far.
    fn step(
        &mut self,
        id: NodeId,
        plan: &Plan,
        done: &BTreeMap<NodeId, StageResult>,
        trial: &mut BTreeMap<NodeId, StageResult>,
        runner: Runner<'_>,
    ) -> Result<(), Error> {
        if let Some(result) = self.made(id, plan, done, trial, runner)? {
            trial.insert(id, result);
        }
        Ok(())
    }

    /// What a place of the plan gives on a trial's results, and on those of the run so far.
    fn made(
        &self,
        id: NodeId,
        plan: &Plan,
        done: &BTreeMap<NodeId, StageResult>,
        trial: &BTreeMap<NodeId, StageResult>,
        runner: Runner<'_>,
    ) -> Result<Option<StageResult>, Error> {
        let Some(node) = plan.node(id) else { return Ok(None) };
        let inputs = node.inputs.iter().filter_map(|(_, from)| {
            trial.get(from).or_else(|| done.get(from)).map(|value| (*from, value.clone()))
        });
        run_node(node, &inputs.collect(), runner, self.options).map(Some)
    }

    /// The trial's motion in twice the steps.
    fn stepped_finer(
        &mut self,
        setting: &Setting,
        plan: &mut Plan,
        done: &BTreeMap<NodeId, StageResult>,
        trial: &Trial,
        runner: Runner<'_>,
    ) -> Result<StageResult, Error> {
        self.tune(plan, &Setting { steps: 2.0 * setting.steps, ..*setting })?;
        let refined = BTreeMap::from([(REFINE, trial.done[&REFINE].clone())]);
        self.made(DEFORM, plan, done, &refined, runner)?.ok_or_else(|| nothing(DEFORM))
    }

    /// Carries a trial's motion to the voxels, where the scene needs that, and measures what the map leaves.
    fn carry(
        &mut self,
        plan: &Plan,
        done: &BTreeMap<NodeId, StageResult>,
        trial: &mut Trial,
        runner: Runner<'_>,
    ) -> Result<(), Error> {
        if !plan.needs(MAP) {
            return Ok(());
        }
        if plan.needs(OCTREE) {
            self.step(OCTREE, plan, done, &mut trial.done, runner)?;
        }
        self.step(MAP, plan, done, &mut trial.done, runner)?;
        let map: MapFigures = trial.done[&MAP].record.figures()?;
        trial.parts.insert("inverse_mm", map.inverse_residual_max_voxel * voxel_mm(done)?);
        // A map that was diffused or halved to keep it free of folds has left the lattice behind.
        if map.relaxations + map.halvings > 0 {
            trial.parts.insert("map_mm", map.followed.misfit_max_mm);
        }
        Ok(())
    }

    /// The unrefined lattice's motion, carried to the voxels where the scene needs that.
    fn unrefined(
        &mut self,
        steps: f64,
        plan: &mut Plan,
        done: &BTreeMap<NodeId, StageResult>,
        runner: Runner<'_>,
    ) -> Result<BTreeMap<NodeId, StageResult>, Error> {
        self.tune(plan, &Setting { level: Some(0.0), steps, ..self.setting })?;
        let mut made = BTreeMap::new();
        for id in [REFINE, DEFORM, OCTREE, MAP] {
            if plan.needs(id) {
                self.step(id, plan, done, &mut made, runner)?;
            }
        }
        Ok(made)
    }

    /// Takes a candidate that holds, with its results.
    fn keep(
        &mut self,
        candidate: &Candidate,
        trial: Trial,
        most: f64,
        plan: &mut Plan,
        exec: &Exec,
    ) -> Result<(), Error> {
        let error = trial.error();
        self.report.error_mm = Some(error);
        self.report.error_parts = trial.parts.iter().map(|(name, mm)| ((*name).to_owned(), *mm)).collect();
        let setting = self.setting_of(candidate.level, candidate.steps);
        self.take(plan, |_| true, &setting)?;
        let why = format!(
            "as the cheapest that was predicted to stay within {most} mm and does, with {error:.4} mm"
        );
        for knob in [Knob::Level, Knob::Steps] {
            self.because(knob, &why, exec);
        }
        for (id, done) in trial.done {
            self.model.learn(&rate_name(id.stage, id.variant), &setting, done.record.wall_s);
            self.ready.insert(id, done);
        }
        Ok(())
    }
}

/// Largest difference (mm) of a trial's motion from the unrefined lattice's: on the lattice and, where it was carried
/// there, at the voxels.
fn difference(
    whole: &BTreeMap<NodeId, StageResult>,
    trial: &BTreeMap<NodeId, StageResult>,
    exec: &Exec,
) -> Result<f64, Error> {
    let artefact =
        |of: &BTreeMap<NodeId, StageResult>, id| of.get(&id).map(|d: &StageResult| d.artefact.clone());
    let pair = |id| artefact(whole, id).zip(artefact(trial, id));
    let (lattices, motions) = (pair(REFINE), pair(DEFORM));
    let mut most = 0.0_f64;
    if let (Some((a, b)), Some((p, q))) = (lattices, motions)
        && let (Artefact::Lattice(a), Artefact::Lattice(b)) = (a.as_ref(), b.as_ref())
        && let (Artefact::Motion(p), Artefact::Motion(q)) = (p.as_ref(), q.as_ref())
    {
        most = most.max(surfaces((a, p), (b, q), exec)?);
    }
    if let Some((a, b)) = pair(MAP)
        && let (Artefact::Displacement(a), Artefact::Displacement(b)) = (a.as_ref(), b.as_ref())
    {
        most = most.max(fields(a, b, exec));
    }
    Ok(most)
}

/// Longest edge of the volume's voxels (mm).
fn voxel_mm(done: &BTreeMap<NodeId, StageResult>) -> Result<f64, Error> {
    let lattice: &Lattice = done.get(&LATTICE).ok_or_else(|| nothing(LATTICE))?.value()?;
    Ok(lattice.grid().longest_edge())
}

/// A place that gave nothing to go on with.
fn nothing(place: NodeId) -> Error {
    Error::Figure { stage: place.stage.to_owned(), problem: "it gave nothing".to_owned() }
}

fn named(candidate: &Candidate) -> String {
    format!("level {} with {}", candidate.level, counted(candidate.steps, "step", "steps"))
}
