//! Quasi-Newton descent on the matrix of projective dynamics.
//!
//! Projective dynamics (Liu, Bargteil, O'Brien & Kavan 2013; Bouaziz, Martin, Liu, Kavan & Pauly 2014) projects every spring to
//! its rest length and then solves one linear system, whose matrix never changes. That is a step `−A⁻¹ ∇Φ` (Liu, Bouaziz &
//! Kavan 2017), so the matrix starts L-BFGS, and a line search sees to it that the objective never rises.

use ivd_core::{Exec, Iteration};

use super::body::Body;
use super::drives::Drives;
use super::forces::dot;
use super::metric::Metric;
use super::objective::{Inertia, Objective, PutIn};
use super::outcome::Outcome;
use super::params::Params;
use super::spring::Vectors;
use crate::Error;

/// Share of the slope by which a step must lower the objective (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// A step is halved so often before the descent ends: nothing shorter changes a digit.
const HALVINGS: usize = 40;
/// More steps than these take longer than anybody waits.
pub(super) const MOST_STEPS: f64 = 1e6;

/// What is kept between solves: the factor, and where the last one ended.
#[derive(Debug, Clone, Default)]
pub(super) struct Kept {
    /// The metric, for a length of step; 0 is statics.
    metric: Option<(f64, Metric)>,
    /// The last static solution, with the positions of its moved vertices.
    last: Option<Vec<[f64; 3]>>,
}

impl Kept {
    /// Forgets the solution, and keeps the factor.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }
}

/// Lowers the objective from `moved` until its relative gradient is at most the tolerance; gives the iterations made and
/// the relative gradient reached.
pub(super) fn descend(
    objective: &Objective,
    metric: &Metric,
    moved: &mut Vectors,
    params: &Params,
    exec: &Exec,
) -> Result<(usize, f64), Error> {
    let loose = objective.body.loose;
    let mut gradient = vec![[0.0; 3]; loose];
    let mut put_in = PutIn::default();
    let mut relative = objective.gradient(moved, &mut gradient, &mut put_in);
    let mut history: Vec<Secant> = Vec::new();
    let mut iterations = 0;
    while relative > params.closeness.tolerance && iterations < params.closeness.max_iterations {
        exec.check_cancelled()?;
        let mut way = direction(&gradient, &history, metric);
        let mut slope = dot(&gradient, &way);
        // A slope that isn't a number leads nowhere either.
        let falls = |slope: f64| slope < 0.0;
        if !falls(slope) && !history.is_empty() {
            history.clear();
            way = direction(&gradient, &history, metric);
            slope = dot(&gradient, &way);
        }
        if !falls(slope) {
            break;
        }
        way.resize(moved.len(), [0.0; 3]);
        if !search(objective, moved, &mut way, slope, history.is_empty()) {
            // What was remembered may mislead; without it the way is the surest.
            if history.is_empty() {
                break;
            }
            history.clear();
            continue;
        }
        for (u, w) in moved.iter_mut().zip(&way) {
            *u = std::array::from_fn(|a| u[a] + w[a]);
        }
        let before = gradient.clone();
        relative = objective.gradient(moved, &mut gradient, &mut put_in);
        iterations += 1;
        exec.observer().iteration(Iteration {
            method: "projective",
            index: iterations as u64,
            value: relative,
        });
        way.truncate(loose);
        Secant::remember(&mut history, way, &before, &gradient, params.descent.history);
    }
    Ok((iterations, relative))
}

/// Shortens a way until the objective falls enough along it; whether it does. With `first`, where nothing is known of the
/// curvature along it, lengthens one that does as long as that pays: a flat sheet has no stiffness at first, and its matrix does.
fn search(objective: &Objective, moved: &Vectors, way: &mut Vectors, slope: f64, first: bool) -> bool {
    let mut length = 1.0;
    for _ in 0..HALVINGS {
        let growth = objective.growth(moved, way);
        if growth <= SUFFICIENT * length * slope {
            if first && length == 1.0 {
                lengthen(objective, moved, way, growth);
            }
            return true;
        }
        // The parabola through the slope and this point, within bounds.
        let parabola = -0.5 * slope * length / (growth / length - slope);
        let part = if parabola.is_finite() { (parabola / length).clamp(0.1, 0.5) } else { 0.1 };
        length *= part;
        for w in way.iter_mut() {
            *w = w.map(|c| c * part);
        }
    }
    false
}

fn lengthen(objective: &Objective, moved: &Vectors, way: &mut Vectors, mut least: f64) {
    for _ in 0..HALVINGS {
        let longer: Vec<[f64; 3]> = way.iter().map(|w| w.map(|c| 2.0 * c)).collect();
        let growth = objective.growth(moved, &longer);
        if growth < least {
            least = growth;
            way.copy_from_slice(&longer);
        } else {
            return;
        }
    }
}

/// A step made, and how the gradient changed along it.
struct Secant {
    way: Vec<[f64; 3]>,
    change: Vec<[f64; 3]>,
    /// 1 / (way · change).
    inverse: f64,
}

impl Secant {
    fn remember(history: &mut Vec<Self>, way: Vec<[f64; 3]>, before: &Vectors, now: &Vectors, most: usize) {
        let change: Vec<[f64; 3]> =
            now.iter().zip(before).map(|(n, b)| std::array::from_fn(|a| n[a] - b[a])).collect();
        let curvature = dot(&way, &change);
        // Where the objective isn't convex along the step, it says nothing of a minimum.
        if curvature > 1e-12 * (dot(&way, &way) * dot(&change, &change)).sqrt() {
            history.push(Self { way, change, inverse: 1.0 / curvature });
        }
        if history.len() > most {
            history.remove(0);
        }
    }
}

/// The way down: two loops over what is remembered (Nocedal 1980), with the metric between them.
fn direction(gradient: &Vectors, history: &[Secant], metric: &Metric) -> Vec<[f64; 3]> {
    let mut q: Vec<[f64; 3]> = gradient.iter().map(|g| g.map(|c| -c)).collect();
    let mut shares = Vec::with_capacity(history.len());
    for secant in history.iter().rev() {
        let share = secant.inverse * dot(&secant.way, &q);
        add(&mut q, &secant.change, -share);
        shares.push(share);
    }
    let mut way = metric.apply(&q);
    for (secant, share) in history.iter().zip(shares.iter().rev()) {
        let other = secant.inverse * dot(&secant.change, &way);
        add(&mut way, &secant.way, share - other);
    }
    way
}

fn add(to: &mut Vectors, what: &Vectors, times: f64) {
    for (t, w) in to.as_flattened_mut().iter_mut().zip(what.as_flattened()) {
        *t += times * w;
    }
}

/// Moves the moved and the carried vertices to where they are when handles have reached a fraction, and the others after them.
fn follow(moved: &mut Vectors, body: &Body, drives: &Drives, metric: &Metric, reached: f64) {
    let on: Vec<[f64; 3]> = drives
        .moved
        .iter()
        .map(|&(v, by, _)| std::array::from_fn(|a| by[a] * reached - moved[v][a]))
        .collect();
    let mut way = on.iter().flatten().any(|c| *c != 0.0).then(|| metric.extend(&on, drives.is_moved.len()));
    let mut dragged = vec![[0.0; 3]; moved.len()];
    for (v, to) in drives.bones.at(reached) {
        dragged[v] = std::array::from_fn(|a| to[a] - moved[v][a]);
    }
    if dragged.iter().flatten().any(|c| *c != 0.0) {
        // Every spring to a bone pulls as its stiffness in every direction.
        let mut pull = vec![[0.0; 3]; body.loose];
        for spring in &body.to_bones {
            let [i, j] = spring.ends.map(|v| v as usize);
            let (loose, bone) = if i < body.loose { (i, j) } else { (j, i) };
            for a in 0..3 {
                pull[loose][a] += spring.stiffness * dragged[bone][a];
            }
        }
        let with_bones = metric.apply(&pull);
        match &mut way {
            Some(way) => add(way, &with_bones, 1.0),
            None => way = Some(with_bones),
        }
    }
    if let Some(way) = way {
        add(moved, &way, 1.0);
    }
    // To the bit.
    drives.place(moved, reached);
}

/// Balance at each frame, or implicit Euler through the duration.
pub(super) fn run(
    body: &Body,
    drives: &Drives,
    params: &Params,
    kept: &mut Kept,
    exec: &Exec,
) -> Result<Outcome, Error> {
    if params.descent.inertia {
        return stepped(body, drives, params, kept, exec);
    }
    drives.check_held(body)?;
    // Many frames start from rest.
    let last = kept.last.take().filter(|_| params.springs.frames == 1);
    let mut moved = last.unwrap_or_else(|| vec![[0.0; 3]; body.vertices.len()]);
    let metric = metric(body, drives, &mut kept.metric, 0.0, &[]);
    let mut outcome = Outcome {
        steps: params.springs.frames,
        dt: params.springs.duration / params.springs.frames as f64,
        ..Outcome::default()
    };
    let mut worst = 0.0_f64;
    for frame in 1..=params.springs.frames {
        let reached =
            params.springs.reached(params.springs.duration * (frame as f64 / params.springs.frames as f64));
        follow(&mut moved, body, drives, metric, reached);
        let objective = Objective { body, drives, reached, inertia: None };
        let (iterations, relative) = descend(&objective, metric, &mut moved, params, exec)?;
        outcome.iterations += iterations;
        worst = larger(worst, relative);
        outcome.energies[usize::from(frame > 1)] = body.energy(&moved);
        outcome.frames.push(moved.clone());
    }
    if params.springs.frames == 1 {
        outcome.energies[1] = outcome.energies[0];
    }
    outcome.residual = Some(worst);
    kept.last = Some(moved).filter(|moved| moved.iter().flatten().all(|c| c.is_finite()));
    Ok(outcome)
}

/// Steps of an implicit solver, and their length (s).
pub(super) fn clock(params: &Params) -> Result<(usize, f64), Error> {
    let wanted = params.springs.steps(params.springs.dt.unwrap_or(params.springs.duration / 50.0));
    if wanted > MOST_STEPS {
        return Err(Error::Untrusted {
            what: "the deformed lattice",
            problem: format!("{wanted:.3e} implicit steps, more than {MOST_STEPS:e}"),
            remedy: "use longer steps",
        });
    }
    Ok((wanted as usize, params.springs.duration / wanted))
}

fn stepped(
    body: &Body,
    drives: &Drives,
    params: &Params,
    kept: &mut Kept,
    exec: &Exec,
) -> Result<Outcome, Error> {
    let (_, dt) = clock(params)?;
    let inertia = stiffness_of_inertia(body, params, dt);
    let metric = metric(body, drives, &mut kept.metric, dt, &inertia);
    step_through(body, drives, params, "projective", exec, |objective, moved| {
        let start = moved.clone();
        follow(moved, body, drives, metric, objective.reached);
        // Where inertia alone would have them may be nearer.
        let anchor = &objective.inertia.expect("implicit steps have inertia").anchor;
        let mut coasting = vec![[0.0; 3]; moved.len()];
        for v in (0..body.loose).filter(|v| !drives.is_moved[*v]) {
            coasting[v] = std::array::from_fn(|a| start[v][a] - moved[v][a] + anchor[v][a] - start[v][a]);
        }
        if objective.growth(moved, &coasting) < 0.0 {
            add(moved, &coasting, 1.0);
        }
        descend(objective, metric, moved, params, exec)
    })
}

/// `m (1 + γh) / h²` of every loose vertex (g/s²).
pub(super) fn stiffness_of_inertia(body: &Body, params: &Params, dt: f64) -> Vec<f64> {
    body.mass.iter().map(|m| m * (1.0 + params.springs.drag * dt) / dt / dt).collect()
}

/// Implicit Euler: every step is one objective, which `solve` makes small.
pub(super) fn step_through(
    body: &Body,
    drives: &Drives,
    params: &Params,
    task: &'static str,
    exec: &Exec,
    mut solve: impl FnMut(&Objective, &mut Vec<[f64; 3]>) -> Result<(usize, f64), Error>,
) -> Result<Outcome, Error> {
    let (steps, dt) = clock(params)?;
    let frame_every = steps / params.springs.frames;
    let mut moved = vec![[0.0; 3]; body.vertices.len()];
    let mut velocity = vec![[0.0; 3]; body.loose];
    let mut inertia = Inertia { stiffness: stiffness_of_inertia(body, params, dt), anchor: Vec::new() };
    let mut outcome = Outcome { steps, dt, ..Outcome::default() };
    let mut worst = 0.0_f64;
    exec.observer().begin(task, steps as u64);
    for step in 1..=steps {
        exec.check_cancelled()?;
        let before = moved.clone();
        let coast = dt / (1.0 + params.springs.drag * dt);
        inertia.anchor = before
            .iter()
            .zip(&velocity)
            .map(|(u, v): (&[f64; 3], &[f64; 3])| std::array::from_fn(|a| u[a] + coast * v[a]))
            .collect();
        let reached = params.springs.reached(params.springs.duration * (step as f64 / steps as f64));
        let objective = Objective { body, drives, reached, inertia: Some(&inertia) };
        let (iterations, relative) = solve(&objective, &mut moved)?;
        outcome.iterations += iterations;
        worst = larger(worst, relative);
        for (v, (now, then)) in velocity.iter_mut().zip(moved.iter().zip(&before)) {
            *v = std::array::from_fn(|a| (now[a] - then[a]) / dt);
        }
        if step == 1 || step == steps {
            let squares = body.mass.iter().zip(&velocity).zip(&drives.is_moved);
            let kinetic: f64 = squares
                .filter(|(_, moved)| !**moved)
                .map(|((m, v), _)| 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
                .sum();
            outcome.energies[1] = body.energy(&moved) + kinetic;
            if step == 1 {
                outcome.energies[0] = outcome.energies[1];
            }
        }
        if step % frame_every == 0 {
            outcome.frames.push(moved.clone());
        }
        exec.observer().advance(task, 1);
    }
    exec.observer().end(task);
    outcome.residual = Some(worst);
    Ok(outcome)
}

/// The metric for a step's length, factored anew only where that changed, without the vertices that are moved now.
fn metric<'a>(
    body: &Body,
    drives: &Drives,
    slot: &'a mut Option<(f64, Metric)>,
    dt: f64,
    inertia: &[f64],
) -> &'a Metric {
    if slot.as_ref().is_none_or(|(other, _)| *other != dt) {
        *slot = Some((dt, Metric::new(body, inertia)));
    }
    let (_, metric) = slot.as_mut().expect("just made");
    metric.hold(body, drives);
    metric
}

/// The larger of two residuals; not a number, and it stays so, where one isn't.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}
