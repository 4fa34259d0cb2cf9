//! How long stages take: the recorded rates, times the scene's work, times what this machine was found to take.

use std::collections::BTreeMap;

use ivd_core::op::PlaceKind;
use ivd_lattice::refine;
use ivd_motion::deform;
use ivd_pipeline::stages::IMPORT;
use ivd_pipeline::{Error, list};
use ivd_render::RenderParams;

use crate::fronts::{Front, Rates, recorded_rates};
use crate::knobs::{Known, STEPS, Setting, along, between, picture};
use crate::work::Amounts;

/// Shorter times say nothing of the machine (s).
const TELLING: f64 = 1e-3;
/// The record is believed as much as this much time at its own pace (s). What a stage takes depends on the volume too: the
/// bonsai's first stages take 0.4 s and were recorded as 0.15 s, while the whole run took as long as was recorded. With 0
/// they alone would triple every prediction; with 5 a slow machine would be learnt too late.
const BELIEF: f64 = 0.5;

/// The level of a refinement that says nothing else.
const DEFAULT_LEVEL: f64 = 2.0;
/// Share of the lattice that it keeps.
const DEFAULT_LEVEL_SHARE: f64 = 1.0 / 16.0;

/// Predicts times, and learns from those that were taken.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    rates: &'static Rates,
    pub(crate) known: Known,
    /// How much there is to do where nothing is refined away.
    pub(crate) amounts: Amounts,
    /// Stages that ran: name, what the record said, what it took (s).
    taken: Vec<(String, f64, f64)>,
    /// Times at the default settings that stand instead of what is recorded and learnt (s).
    times: Option<BTreeMap<String, f64>>,
}

impl Model {
    /// # Errors
    /// What is recorded of the stages can't be read.
    pub(crate) fn new(times: Option<BTreeMap<String, f64>>) -> Result<Self, Error> {
        let (rates, known) = (recorded_rates()?, Known::recorded()?);
        Ok(Self { rates, known, amounts: Amounts::default(), taken: Vec::new(), times })
    }

    /// Wall time (s) of a stage, or of writing an output, with a setting.
    pub(crate) fn seconds(&self, rate: &str, setting: &Setting) -> f64 {
        match &self.times {
            Some(times) => times
                .get(rate)
                .map_or(0.0, |s| s * self.share(rate, setting) * ratio(rate, setting, &self.known)),
            None => self.recorded(rate, setting) * self.factor(rate),
        }
    }

    /// What the record says for this scene's work.
    fn recorded(&self, rate: &str, setting: &Setting) -> f64 {
        let amounts = self.amounts.refined(setting.share());
        self.rates.seconds(rate, amounts.of(rate).1) * ratio(rate, setting, &self.known)
    }

    /// A refinement's work over the default's, where the stage's work depends on it.
    fn share(&self, rate: &str, setting: &Setting) -> f64 {
        let work = |share: f64| self.amounts.refined(share).of(rate).1;
        let default = work(DEFAULT_LEVEL_SHARE);
        if default > 0.0 { work(setting.share()) / default } else { 1.0 }
    }

    /// Remembers what a stage took.
    pub(crate) fn learn(&mut self, rate: &str, setting: &Setting, seconds: f64) {
        let recorded = self.recorded(rate, setting);
        // A volume may be read, unpacked or generated: that says nothing of the other stages.
        if recorded > TELLING && rate != IMPORT {
            self.taken.push((rate.to_owned(), recorded, seconds));
        }
    }

    /// This machine and scene against the record: the stage's own where it ran before, else that of all that ran.
    fn factor(&self, rate: &str) -> f64 {
        let stage = |name: &str| name.split(' ').next().map(str::to_owned);
        let own = self.taken.iter().filter(|t| stage(&t.0) == stage(rate));
        let all = self.taken.iter();
        let of = |(recorded, taken): (f64, f64)| if recorded > 0.0 { Some(taken / recorded) } else { None };
        let sum = |(a, b): (f64, f64), t: &(String, f64, f64)| (a + t.1, b + t.2);
        of(own.fold((0.0, 0.0), sum)).or_else(|| of(all.fold((BELIEF, BELIEF), sum))).unwrap_or(1.0)
    }
}

/// A setting's cost over the default's, of the stages whose cost a knob changes.
type Ratio = fn(&Known, &Setting) -> f64;

const RATIOS: [(&str, Ratio); 6] = [
    (refine::STAGE.name, |known, setting| {
        let refine = known.refine;
        let default = refine.points.iter().find(|p| p.default).map(|p| &p.knobs);
        let at_default = refine.points.iter().filter(|p| Some(&p.knobs) == default);
        let mut points: Vec<(f64, f64)> = at_default
            .filter_map(|p| Some((p.task.strip_prefix("level ")?.parse().ok()?, p.cpu_s.least)))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        over(&points, setting.level.unwrap_or(DEFAULT_LEVEL), DEFAULT_LEVEL)
    }),
    (ivd_octree::STAGE.name, by_level),
    (ivd_map::STAGE.name, by_level),
    (ivd_atf::STAGE.name, |known, setting| {
        let default = ivd_atf::Params::default().resolution as f64;
        over(&times(known.atf, "resolution"), setting.resolution, default)
    }),
    (deform::STAGE.name, |_, setting| setting.steps / STEPS),
    (ivd_render::STAGE.name, |known, setting| {
        let RenderParams { step, termination, .. } = RenderParams::default();
        picture(known.render, setting.step, setting.termination).0
            / picture(known.render, step, termination).0
    }),
];

/// Of what is carried to the voxels.
fn by_level(known: &Known, setting: &Setting) -> f64 {
    over(&times(known.map, "refine.level"), setting.level.unwrap_or(DEFAULT_LEVEL), DEFAULT_LEVEL)
}

/// Times along a knob.
fn times(front: &Front, knob: &str) -> Vec<(f64, f64)> {
    along(front, knob).iter().map(|(x, p)| (*x, p.cpu_s.least)).collect()
}

/// What is recorded at one place over what is at another.
fn over(points: &[(f64, f64)], at: f64, default: f64) -> f64 {
    between(points.iter().copied(), at) / between(points.iter().copied(), default)
}

/// A setting's cost over the default's; 1 of a job without parameters, and of what writes.
fn ratio(rate: &str, setting: &Setting, known: &Known) -> f64 {
    let Some((stage, place)) = list::place(rate) else { return 1.0 };
    let own = RATIOS.iter().find(|(name, _)| {
        *name == stage.name && matches!(place.kind, PlaceKind::Own | PlaceKind::Beside { .. })
    });
    own.map_or(1.0, |(_, ratio)| ratio(known, setting))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn requested() -> Setting {
        Setting { level: Some(2.0), steps: 200.0, resolution: 1024.0, step: 0.5, termination: 0.99 }
    }

    fn model() -> Model {
        let mut model = Model::new(None).unwrap();
        model.amounts = Amounts {
            voxels: 1e6,
            edge: 100.0,
            triangles: 1e5,
            refined: 6e3,
            moved: 1e3,
            reach: 1e5,
            pixels: 1e5,
            rays: 1e5,
        };
        model
    }

    #[test]
    fn time_grows_with_the_work_and_falls_with_coarser_settings() {
        let (mut model, requested) = (model(), requested());
        let once = model.seconds("segment", &requested);
        model.amounts.voxels *= 3.0;
        assert!((model.seconds("segment", &requested) - 3.0 * once).abs() < 1e-9 * once && once > 0.0);
        let coarse = Setting { step: 2.0, ..requested };
        assert!(model.seconds("render before", &coarse) < 0.6 * model.seconds("render before", &requested));
        let few = Setting { steps: 50.0, ..requested };
        assert!((model.seconds("deform", &few) * 4.0 - model.seconds("deform", &requested)).abs() < 1e-12);
        assert_eq!(model.seconds("no such stage", &requested), 0.0);
    }

    /// Seconds by the record, whatever it is.
    fn learn(model: &mut Model, rate: &str, recorded: f64, taken: f64) {
        model.taken.push((rate.to_owned(), recorded, taken));
    }

    #[test]
    fn a_machine_that_takes_twice_as_long_is_learnt_and_a_stage_knows_itself_best() {
        let mut model = model();
        assert_eq!(model.factor("render after"), 1.0);
        learn(&mut model, "segment", 0.02, 0.04);
        let learnt = model.factor("render after");
        assert!(learnt > 1.0 && learnt < 1.1, "{learnt}: a short stage says little");
        for _ in 0..40 {
            learn(&mut model, "map", 0.5, 1.0);
        }
        let learnt = model.factor("render after");
        assert!(learnt > 1.9 && learnt < 2.0, "{learnt}: long ones do");
        learn(&mut model, "render before", 0.1, 0.5);
        assert!((model.factor("render after") - 5.0).abs() < 1e-12);
        assert!((model.factor("segment") - 2.0).abs() < 1e-12);
    }

    #[test]
    fn stages_that_tell_nothing_of_the_machine_are_not_learnt_from() {
        let (mut model, requested) = (model(), requested());
        model.amounts.voxels = 1e9;
        model.learn("import", &requested, 9.0 * model.seconds("import", &requested));
        assert!(model.taken.is_empty(), "a volume may come from anywhere");
        model.learn("no such stage", &requested, 9.0);
        assert!(model.taken.is_empty(), "what takes no time by the record has no ratio");
        model.learn("segment", &requested, 2.0 * model.seconds("segment", &requested));
        assert_eq!(model.factor("segment"), 2.0);
    }
}
