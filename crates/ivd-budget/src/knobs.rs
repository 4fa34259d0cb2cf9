//! The knobs of a scene that a budget may move: what was requested, the coarser settings on the recorded fronts, and how they are set.

use ivd_core::op::Stage;
use ivd_lattice::refine::{self, Refinement, Target, TargetKeys};
use ivd_motion::deform;
use ivd_pipeline::Error;
use ivd_pipeline::scene::Scene;
use ivd_render::RenderParams;
use serde_json::{Value, json};

use crate::choose::{KnobValue, KnobValues};
use crate::fronts::{Front, FrontPoint, recorded};
use crate::{LEVELS, target};

/// Steps of the ring solver where the scene names none, and the least it makes.
pub(crate) const STEPS: f64 = 200.0;
const LEAST_STEPS: f64 = 32.0;
/// A time makes lattices no coarser than this: the next level loses parts of the surface, and saves little.
const COARSEST: f64 = 3.0;

/// A knob, or knobs of one stage that go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Knob {
    /// How far the lattice is refined.
    Level,
    /// Time steps of the solver.
    Steps,
    /// Samples of the transfer function.
    Resolution,
    /// Step and end of rays.
    Picture,
}

/// The values of all knobs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Setting {
    /// `None` where the scene bounds the refinement's error instead, counts triangles or keeps a chain.
    pub(crate) level: Option<f64>,
    pub(crate) steps: f64,
    pub(crate) resolution: f64,
    pub(crate) step: f64,
    pub(crate) termination: f64,
}

impl Setting {
    /// What a scene asks for.
    pub(crate) fn of(scene: &Scene) -> Self {
        let refine = scene.get::<Refinement>(&refine::STAGE);
        let level = match refine.map(|refine| refine.params.target.get()).unwrap_or_default() {
            _ if refine.is_some_and(|refine| !refine.chain.is_empty()) => None,
            Target::Level(level) => Some(f64::from(level)),
            Target::Ratio(ratio) => Some((-ratio.max(1e-6).log(4.0)).max(0.0)),
            Target::Count(_) | Target::MaxError(_) => None,
        };
        let atf: ivd_atf::Params = scene.get(&ivd_atf::STAGE).cloned().unwrap_or_default();
        let picture: RenderParams = scene.common(&ivd_render::STAGE).unwrap_or_default();
        let seconds = |key: &str| scene.param(&deform::STAGE, key)?.as_f64();
        let steps = seconds("duration").zip(seconds("dt")).map(|(duration, dt)| (duration / dt).ceil());
        Self {
            level,
            steps: steps.unwrap_or(STEPS).max(LEAST_STEPS),
            resolution: atf.resolution as f64,
            step: picture.step,
            termination: picture.termination,
        }
    }

    /// Share of the lattice that is kept.
    pub(crate) fn share(&self) -> f64 {
        0.25_f64.powf(self.level.unwrap_or(2.0))
    }

    /// With a knob at one of its settings.
    pub(crate) fn with(mut self, knob: Knob, place: &KnobValue) -> Self {
        match knob {
            Knob::Level => self.level = Some(place.value),
            Knob::Steps => self.steps = place.value,
            Knob::Resolution => self.resolution = place.value,
            Knob::Picture => (self.step, self.termination) = (place.value, place.other),
        }
        self
    }
}

impl Knob {
    pub(crate) const ALL: [Self; 4] = [Self::Level, Self::Steps, Self::Resolution, Self::Picture];

    /// The stage.
    pub(crate) fn stage(self) -> &'static str {
        let stage = match self {
            Self::Level => &refine::STAGE,
            Self::Steps => &deform::STAGE,
            Self::Resolution => &ivd_atf::STAGE,
            Self::Picture => &ivd_render::STAGE,
        };
        stage.name
    }

    /// Keys of the scene that it moves.
    pub(crate) fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Level => {
                &["refine.level", "refine.ratio", "refine.count", "refine.max_error", "refine.chain"]
            }
            Self::Steps => &["deform.dt"],
            Self::Resolution => &["atf.resolution"],
            Self::Picture => &["render.step", "render.termination"],
        }
    }

    /// From what the scene requests to the coarsest on the front: each costs less and errs more than what was requested.
    pub(crate) fn settings(self, requested: &Setting, known: &Known) -> KnobValues {
        let mut places = match self {
            Self::Level => requested.level.map_or_else(Vec::new, |level| levels(level, known)),
            Self::Steps => line(known.deform, "steps", requested.steps),
            Self::Resolution => line(known.atf, "resolution", requested.resolution),
            Self::Picture => pictures(known.render, requested),
        };
        places.dedup_by(|a, b| a.value == b.value && a.other == b.other);
        KnobValues(places)
    }

    /// Sets the scene's keys.
    ///
    /// # Errors
    /// A value that the scene doesn't take.
    /// A value that a section doesn't take.
    pub(crate) fn apply(self, scene: &mut Scene, setting: &Setting) -> Result<(), Error> {
        match self {
            Self::Level => {
                let Some(level) = setting.level else { return Ok(()) };
                let TargetKeys { level, ratio, count, max_error } = target(level).into();
                let keys = [
                    ("level", level.map(Value::from)),
                    ("ratio", ratio.map(Value::from)),
                    ("count", count.map(Value::from)),
                    ("max_error", max_error.map(Value::from)),
                    ("chain", None),
                ];
                scene.set(&refine::STAGE, &keys)?;
            }
            Self::Steps => {
                let stage = &deform::STAGE;
                let is_written = scene.section(stage).is_some_and(|section| section.written().is_some());
                let duration = scene.param(stage, "duration").and_then(|duration| duration.as_f64());
                if let Some(duration) = duration.filter(|_| is_written) {
                    // A hair longer, so that rounding doesn't make it one step more.
                    scene.set(stage, &[("dt", Some(json!(duration / setting.steps * (1.0 + 1e-9))))])?;
                }
            }
            Self::Resolution => {
                let resolution = json!(setting.resolution as usize);
                scene.set(&ivd_atf::STAGE, &[("resolution", Some(resolution))])?;
            }
            Self::Picture => {
                let (step, termination) = (json!(setting.step), json!(setting.termination));
                let keys = [("step", Some(step)), ("termination", Some(termination))];
                scene.set(&ivd_render::STAGE, &keys)?;
            }
        }
        Ok(())
    }

    /// Name and value before and after, for each of its knobs that differs.
    pub(crate) fn moved(self, from: &Setting, to: &Setting) -> Vec<(&'static str, Value, Value)> {
        let pairs = match self {
            Self::Level => vec![("level", from.level, to.level)],
            Self::Steps => vec![("steps", Some(from.steps), Some(to.steps))],
            Self::Resolution => vec![("resolution", Some(from.resolution), Some(to.resolution))],
            Self::Picture => vec![
                ("step", Some(from.step), Some(to.step)),
                ("termination", Some(from.termination), Some(to.termination)),
            ],
        };
        let told = pairs.into_iter().filter(|(_, a, b)| a != b);
        told.map(|(name, a, b)| (name, number(a), number(b))).collect()
    }
}

/// A value as a user writes it: without a fraction where it has none.
fn number(value: Option<f64>) -> Value {
    match value {
        Some(v) if v.fract() == 0.0 && v.abs() < 1e15 => json!(v as i64),
        v => json!(v),
    }
}

/// What is recorded of the stages that have a knob, or whose time one changes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    pub(crate) atf: &'static Front,
    pub(crate) deform: &'static Front,
    pub(crate) map: &'static Front,
    pub(crate) refine: &'static Front,
    pub(crate) render: &'static Front,
}

impl Known {
    /// # Errors
    /// A record that isn't there, or can't be read.
    pub(crate) fn recorded() -> Result<Self, Error> {
        let fronts = recorded()?;
        let front = |stage: &Stage| {
            let found = fronts.iter().find(|front| front.stage == stage.name);
            found.ok_or_else(|| Error::Limit(format!("nothing is recorded of {}", stage.name)))
        };
        Ok(Self {
            atf: front(&ivd_atf::STAGE)?,
            deform: front(&deform::STAGE)?,
            map: front(&ivd_map::STAGE)?,
            refine: front(&refine::STAGE)?,
            render: front(&ivd_render::STAGE)?,
        })
    }
}

/// The front's points along one knob, the others at their defaults; ascending.
pub(crate) fn along<'a>(front: &'a Front, knob: &str) -> Vec<(f64, &'a FrontPoint)> {
    let default = front.points.iter().find(|p| p.default);
    let same = |p: &&FrontPoint| {
        default.is_none_or(|d| p.knobs.iter().all(|(name, value)| name == knob || d.knobs[name] == *value))
    };
    let points = front.points.iter().filter(same);
    let mut found: Vec<(f64, &FrontPoint)> = points.filter_map(|p| Some((p.knob(knob)?, p))).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// A value between recorded ones, straight between neighbours; the end's beyond an end.
pub(crate) fn between(points: impl IntoIterator<Item = (f64, f64)>, x: f64) -> f64 {
    let mut last: Option<(f64, f64)> = None;
    for (px, py) in points {
        if x <= px {
            return match last {
                Some((qx, qy)) if px > qx => qy + (py - qy) * (x - qx) / (px - qx),
                _ => py,
            };
        }
        last = Some((px, py));
    }
    last.map_or(1.0, |(_, y)| y)
}

/// By level: bound on the lattice's distance (voxels), and largest difference of the voxels' motion (part of the push).
pub(crate) fn level_errors(known: &Known) -> Vec<(f64, f64, f64)> {
    let map = known.map;
    let Some(voxel) = map.voxel_mm else { return Vec::new() };
    let of = |p: &FrontPoint| {
        let counter = |name: &str| p.counters.get(name).map(|mm| mm / voxel);
        let motion = counter("max_mm")? / counter("push_mm")?;
        Some((p.knob("refine.level")?, counter("bound_mm")?, motion))
    };
    let mut found: Vec<(f64, f64, f64)> = map.points.iter().filter_map(of).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

fn levels(requested: f64, known: &Known) -> Vec<KnobValue> {
    let errors = level_errors(known);
    let error = |level: f64| between(errors.iter().map(|e| (e.0, e.1)), level);
    let coarser = LEVELS.into_iter().filter(|&level| level > requested && level <= COARSEST);
    let values = std::iter::once(requested).chain(coarser);
    values.map(|value| KnobValue { value, other: 0.0, error: error(value) }).collect()
}

/// What was requested, and the points below it along a knob that costs more the larger it is.
fn line(front: &Front, knob: &str, requested: f64) -> Vec<KnobValue> {
    let points = along(front, knob);
    let error = between(points.iter().map(|(x, p)| (x.ln(), p.error)), requested.ln());
    let coarser = points.iter().rev().filter(|(x, p)| *x < requested && p.error > error);
    let coarser = coarser.map(|(x, p)| KnobValue { value: *x, other: 0.0, error: p.error });
    std::iter::once(KnobValue { value: requested, other: 0.0, error }).chain(coarser).collect()
}

/// What was requested, and the points of the front that take fewer samples and longer steps and end rays no later.
fn pictures(front: &Front, requested: &Setting) -> Vec<KnobValue> {
    let (work, error) = picture(front, requested.step, requested.termination);
    let mut places = vec![KnobValue { value: requested.step, other: requested.termination, error }];
    let knobs = |p: &FrontPoint| Some((p.knob("step")?, p.knob("termination")?));
    let mut points: Vec<&FrontPoint> = front
        .points
        .iter()
        .filter(|p| front.beaten(p).is_none() && p.cost() < work && p.error > error)
        .filter(|p| {
            knobs(p).is_some_and(|(step, end)| step >= requested.step && end <= requested.termination)
        })
        .collect();
    points.sort_by(|a, b| b.cost().total_cmp(&a.cost()));
    places.extend(points.iter().filter_map(|p| {
        let (value, other) = knobs(p)?;
        Some(KnobValue { value, other, error: p.error })
    }));
    places
}

/// Cost and error of a picture, from the recorded points with the termination next to it.
pub(crate) fn picture(front: &Front, step: f64, termination: f64) -> (f64, f64) {
    let ends = front.points.iter().filter_map(|p| p.knob("termination"));
    let nearest = ends.min_by(|a, b| (a - termination).abs().total_cmp(&(b - termination).abs()));
    let mut points: Vec<(f64, f64, f64)> = front
        .points
        .iter()
        .filter(|p| p.knob("termination") == nearest)
        .filter_map(|p| Some((p.knob("step")?.ln(), p.cost().ln(), p.error)))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let work = between(points.iter().map(|p| (p.0, p.1)), step.ln()).exp();
    (work, between(points.iter().map(|p| (p.0, p.2)), step.ln()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn requested() -> Setting {
        Setting { level: Some(2.0), steps: 200.0, resolution: 1024.0, step: 0.5, termination: 0.99 }
    }

    #[test]
    fn a_value_between_points_lies_straight_between_and_the_ends_hold_beyond() {
        let points = [(0.0, 1.0), (2.0, 5.0), (3.0, 5.5)];
        assert_eq!(
            [-1.0, 0.0, 1.0, 2.0, 2.5, 9.0].map(|x| between(points, x)),
            [1.0, 1.0, 3.0, 5.0, 5.25, 5.5]
        );
    }

    #[test]
    fn settings_start_at_what_was_requested_and_never_get_finer() {
        for knob in Knob::ALL {
            let places = knob.settings(&requested(), &Known::recorded().unwrap()).0;
            assert!(places.len() >= 2, "{knob:?}: {places:?}");
            assert_eq!(requested().with(knob, &places[0]), requested(), "{knob:?}");
            assert!(places[1..].iter().all(|r| r.error > places[0].error), "{knob:?}: {places:?}");
        }
        let levels: Vec<f64> = Knob::Level
            .settings(&requested(), &Known::recorded().unwrap())
            .0
            .iter()
            .map(|r| r.value)
            .collect();
        assert_eq!(levels, [2.0, 3.0]);
        assert!(
            Knob::Steps
                .settings(&requested(), &Known::recorded().unwrap())
                .0
                .iter()
                .all(|r| r.value <= 200.0)
        );
        assert!(
            Knob::Picture
                .settings(&requested(), &Known::recorded().unwrap())
                .0
                .iter()
                .all(|r| r.value >= 0.5 && r.other <= 0.99)
        );
    }

    #[test]
    fn a_setting_that_is_applied_is_read_back() {
        let text = "schema = 1\n[input]\nphantom = \"head\"\n[deform]\nduration = 0.3\n[[deform.handle]]\n\
            vertex = 0\nmove = [0.0, 0.0, 1.0]\nradius = 5.0\n[output]\nreport = true";
        let scene = ivd_pipeline::scene::parse(text, &[]).unwrap();
        assert_eq!(Setting::of(&scene), requested());
        for level in LEVELS {
            let asked =
                Setting { level: Some(level), steps: 50.0, resolution: 64.0, step: 1.5, termination: 0.8 };
            let mut changed = scene.clone();
            for knob in Knob::ALL {
                knob.apply(&mut changed, &asked).unwrap();
            }
            let found = Setting::of(&changed);
            assert!((found.level.unwrap() - level).abs() < 1e-12 && found.steps == 50.0, "{found:?}");
            assert_eq!((found.resolution, found.step, found.termination), (64.0, 1.5, 0.8));
        }
    }
}
