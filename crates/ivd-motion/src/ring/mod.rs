//! The ring solver: a handle moves or pulls one vertex, and rings of neighbours round it follow.
//!
//! It is the thesis's solver, soundly read (section 6.1):
//! - **Followers.** The vertices within a handle's radius to which a way through the part leads that isn't much longer than the straight
//!   line ([`Couple`]). So a wall moves with both its sides, the other lip isn't touched, and beyond the radius nothing moves, exactly. Vertices that
//!   nothing reaches are [carried](ivd_core::Role::Carried): they go along by the same taper, without springs, and a map takes them with what
//!   surrounds them.
//! - **Rings** of neighbours, breadth first, through edges, within the radius: over them a force spreads.
//! - **A moved handle** takes its vertex exactly where it is told, along a smooth ramp in time. A vertex at distance `d`
//!   follows by `(1 - d²/r²)²` of it, which ends at the radius without a step or a kink.
//! - **A pulled handle** spreads its force over the rings by the angle of equations 6.2 and 6.3; no ring holds more force
//!   than the one before. The target goes where force, ground spring, structural springs and drag take it: more stiffness is
//!   less motion. The others follow the target as above, and take their component force besides. The angle is that to the
//!   target displaced by `F / K`, so the spread isn't linear in the force; a pull along the normal of a flat sheet gives the
//!   first ring `a / √(a² + L²)`, with `a = F / K` and edges of length `L`.
//! - **Springs** along the edges pull when they are stretched (Provot 1995), and every vertex is tied by a ground spring to the
//!   place that it follows to. Under a prescribed motion a uniform stiffness cancels at rest and shows in finite time only.
//! - **Several handles** act together: every target reaches its own motion; a vertex between them takes their mean, weighed by
//!   nearness. **Fixed** vertices stay; the following falls to 0 towards them.
//!
//! Momentum isn't conserved: the ground springs have no reaction.

mod dynamics;
mod params;
mod rings;
mod way;

use ivd_core::{Ball, Exec, Frame, Iteration, Lattice, Motion, Role};
use nalgebra::Vector3;

use crate::Error;
use crate::handles::{Action, Handle, Pin, check_pull, find_targets, resolve};
use dynamics::{Drive, Material, System};
use rings::{Edges, Rings, taper};

pub use params::{Couple, RingParams};

/// A pulled target that goes further than this many radii has left what its radius can follow.
const FAR: f64 = 10.0;
/// Energies reported to the observer, about.
const REPORTS: usize = 16;

/// A solved deformation.
#[derive(Debug, Clone, PartialEq)]
pub struct RingResult {
    /// One frame, at the end of the duration; one ball of reach for every handle.
    pub motion: Motion,
    /// Vertices whose displacement isn't 0.
    pub vertices_moved: usize,
    /// Time steps made.
    pub steps: usize,
    /// Length of a step (s); it differs from the one asked for where that would have made too few or too many.
    pub dt: f64,
    /// Largest unbalanced force at the end, over the largest force.
    pub residual: f64,
    /// Energy after the first step (nJ).
    pub energy_first: f64,
    /// Energy after the last step (nJ).
    pub energy_last: f64,
    /// Largest displacement (mm).
    pub max_displacement_mm: f64,
    /// For every handle that pulls, the force of each ring as a fraction of the handle's; empty for one that moves.
    pub ring_sums: Vec<Vec<f64>>,
}

/// What handles take along, which doesn't depend on where they go.
#[derive(Debug, Clone)]
pub struct Coupling {
    couple: Couple,
    /// Target, radius (mm), and the vertices that follow, of each handle.
    followers: Vec<(usize, f64, Vec<u32>)>,
    /// Whether a vertex follows one of them.
    reached: Vec<bool>,
    /// Edges in the handles' balls.
    edges: Edges,
    /// Those that pull: what is carried pulls nobody.
    tied: Edges,
}

impl Coupling {
    /// Finds what handles take along.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn new(
        lattice: &Lattice,
        handles: &[Handle],
        params: &RingParams,
        exec: &Exec,
    ) -> Result<Self, Error> {
        params.check()?;
        check_pull(handles, &[])?;
        exec.run(|| {
            let rest = lattice.local_positions();
            let targets = find_targets(lattice, &rest, handles, true)?;
            let edges = Edges::new(lattice, &rest, |v| is_near(&rest, &targets, handles, v as usize));
            let couple = params.followers_by();
            let of = |(&target, handle): (&usize, &Handle)| {
                let followers = match couple {
                    Couple::Edges => Rings::new(&edges, &rest, target, handle.radius).reached(),
                    Couple::Straight => (0..rest.len() as u32)
                        .filter(|&v| is_near(&rest, &[target], &[*handle], v as usize))
                        .collect(),
                    Couple::Inside => way::followers(lattice, &edges, &rest, target, handle.radius, exec)?,
                };
                Ok((target, handle.radius, followers))
            };
            let followers: Vec<(usize, f64, Vec<u32>)> =
                targets.iter().zip(handles).map(of).collect::<Result<_, Error>>()?;
            let mut reached = vec![false; rest.len()];
            for &v in followers.iter().flat_map(|(_, _, followers)| followers) {
                reached[v as usize] = true;
            }
            let tied = edges.clone().between(|v| reached[v] || !is_near(&rest, &targets, handles, v));
            Ok(Self { couple, followers, reached, edges, tied })
        })
    }

    /// Whether it is that of handles on these vertices.
    fn fits(&self, targets: &[usize], handles: &[Handle], params: &RingParams) -> bool {
        let now = targets.iter().zip(handles).map(|(target, handle)| (*target, handle.radius));
        self.couple == params.followers_by()
            && now.eq(self.followers.iter().map(|(target, radius, _)| (*target, *radius)))
    }
}

/// Whether a vertex lies in a handle's ball, or is its target.
fn is_near(rest: &[Vector3<f64>], targets: &[usize], handles: &[Handle], v: usize) -> bool {
    targets.iter().zip(handles).any(|(&t, h)| v == t || (rest[v] - rest[t]).norm() < h.radius)
}

/// Deforms a lattice by handles; see the module's page for the model.
///
/// - `handles`: at least one; two on one vertex must do the same.
/// - `fixed`: vertices that stay, exactly; a target among them stays too.
///
/// # Errors
/// [`Error::Param`]: a parameter, handle or vertex number outside its domain. [`Error::Mismatch`]: a pick with no vertex
/// near, contradicting handles. [`Error::Untrusted`]: a force that takes its target further than ten radii, or a displacement
/// that isn't finite. Cancelled.
pub fn solve(
    lattice: &Lattice,
    handles: &[Handle],
    fixed: &[Pin],
    params: &RingParams,
    exec: &Exec,
) -> Result<RingResult, Error> {
    check_pull(handles, fixed)?;
    let coupling = Coupling::new(lattice, handles, params, exec)?;
    solve_coupled(lattice, &coupling, handles, fixed, params, exec)
}

/// As [`solve`], of handles of which it is known what they take along.
///
/// # Errors
/// As [`solve`]; [`Error::Mismatch`] where that is known of handles elsewhere.
pub fn solve_coupled(
    lattice: &Lattice,
    coupling: &Coupling,
    handles: &[Handle],
    fixed: &[Pin],
    params: &RingParams,
    exec: &Exec,
) -> Result<RingResult, Error> {
    params.check()?;
    check_pull(handles, fixed)?;
    exec.run(|| {
        let rest = lattice.local_positions();
        let mass = masses(lattice, &rest, params);
        let targets = find_targets(lattice, &rest, handles, true)?;
        if !coupling.fits(&targets, handles, params) {
            return Err(Error::Mismatch {
                what: "coupling",
                problem: "it is of other handles, or of another way to follow".into(),
                remedy: "find again what these handles take along",
            });
        }
        let still = Still::new(fixed, lattice, &rest, &targets)?;
        exec.check_cancelled()?;
        let given = Given { rest: &rest, mass: &mass, handles, targets: &targets, still: &still, params };
        let (mut system, ring_sums) = assemble(&given, coupling);
        let roles = roles(lattice, coupling, &given);
        let (steps, dt) = params.clock();
        let energies = integrate(&mut system, steps, dt, exec)?;
        trust(&system, handles, &targets)?;
        let displacement: Vec<[f64; 3]> =
            system.displacement.iter().map(|u| u.map(|c| c + 0.0).into()).collect();
        let reach = targets
            .iter()
            .zip(handles)
            .map(|(&t, h)| Ball { centre: lattice.world(t).0.into(), radius: h.radius })
            .collect();
        let vertices_moved = displacement.iter().filter(|u| **u != [0.0; 3]).count();
        let frame = Frame { time: params.duration, displacement: displacement.into() };
        let motion = Motion::new(lattice.grid().clone(), rest.len(), vec![frame])?
            .with_reach(reach)?
            .with_roles(roles.into())?;
        Ok(RingResult {
            max_displacement_mm: motion.max_displacement(),
            motion,
            vertices_moved,
            steps,
            dt,
            residual: system.residual(),
            energy_first: energies[0],
            energy_last: energies[1],
            ring_sums,
        })
    })
}

/// Mass of each vertex (g): a third of its triangles', never less than a tenth of the mean.
fn masses(lattice: &Lattice, rest: &[Vector3<f64>], params: &RingParams) -> Vec<f64> {
    if let Some(mass) = params.literal.then_some(1.0).or(params.vertex_mass) {
        return vec![mass; rest.len()];
    }
    let mut area = vec![0.0; rest.len()];
    for t in lattice.triangles() {
        let [a, b, c] = t.map(|v| rest[v as usize]);
        let third = (b - a).cross(&(c - a)).norm() / 6.0;
        for &v in t {
            area[v as usize] += third;
        }
    }
    let mean = area.iter().sum::<f64>() / area.len().max(1) as f64;
    let least = if mean > 0.0 { 0.1 * mean } else { 1.0 };
    area.into_iter().map(|a| (a.max(least) * params.density).max(1e-15)).collect()
}

/// The fixed vertices, and how the following falls to 0 towards them.
struct Still {
    /// Middle, radius, and the distance from there to the nearest target, for every fix (mm).
    balls: Vec<(Vector3<f64>, f64, f64)>,
}

impl Still {
    fn new(
        fixed: &[Pin],
        lattice: &Lattice,
        rest: &[Vector3<f64>],
        targets: &[usize],
    ) -> Result<Self, Error> {
        let balls = fixed.iter().map(|fix| {
            let middle = rest[resolve("fixed vertex", &fix.at, lattice, rest)?];
            let gap = |&t: &usize| (rest[t] - middle).norm() - fix.radius;
            let nearest = targets.iter().map(gap).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
            Ok((middle, fix.radius, nearest))
        });
        Ok(Self { balls: balls.collect::<Result<_, Error>>()? })
    }

    /// 0 at a fixed vertex, 1 as far from all of them as the nearest target; smooth between.
    fn freedom(&self, at: Vector3<f64>) -> f64 {
        let of = |&(middle, radius, width): &(Vector3<f64>, f64, f64)| {
            let gap = (at - middle).norm() - radius;
            if gap <= 0.0 {
                return 0.0;
            }
            let t = if width.is_finite() { (gap / width).min(1.0) } else { 1.0 };
            t * t * (3.0 - 2.0 * t)
        };
        self.balls.iter().map(of).product()
    }
}

/// What is solved for.
struct Given<'a> {
    rest: &'a [Vector3<f64>],
    mass: &'a [f64],
    handles: &'a [Handle],
    targets: &'a [usize],
    still: &'a Still,
    params: &'a RingParams,
}

/// What the motion of each vertex says, as a map reads it.
fn roles(lattice: &Lattice, coupling: &Coupling, given: &Given) -> Vec<u8> {
    let reached = &coupling.reached;
    let of = |reached: &bool| if *reached { Role::Driven as u8 } else { Role::Carried as u8 };
    let mut roles: Vec<u8> = reached.iter().map(of).collect();
    // Beyond the balls the next vertices stay: there the following has fallen to 0.
    for triangle in lattice.triangles().iter().filter(|t| t.iter().any(|v| reached[*v as usize])) {
        for v in triangle.map(|v| v as usize) {
            if !is_near(given.rest, given.targets, given.handles, v) {
                roles[v] = Role::Driven as u8;
            }
        }
    }
    for (role, at) in roles.iter_mut().zip(given.rest) {
        if given.still.freedom(*at) == 0.0 {
            *role = Role::Held as u8;
        }
    }
    roles
}

/// Who may move, and what drives whom.
fn assemble<'a>(given: &Given<'a>, coupling: &'a Coupling) -> (System<'a>, Vec<Vec<f64>>) {
    let Given { rest, mass, handles, targets, still, params } = *given;
    let Coupling { reached, edges, .. } = coupling;
    let stiffness = params.stiffness * 1e3;
    let mut weights: Vec<Vec<(usize, f64)>> = vec![Vec::new(); rest.len()];
    let mut force = vec![Vector3::zeros(); rest.len()];
    let mut ring_sums = Vec::new();
    for (h, (handle, (target, _, followers))) in handles.iter().zip(&coupling.followers).enumerate() {
        let target = *target;
        for v in followers.iter().map(|v| *v as usize) {
            let w = taper((rest[v] - rest[target]).norm() / handle.radius);
            if !params.literal || matches!(handle.action, Action::Move(_)) {
                weights[v].push((target, w * still.freedom(rest[v])));
            }
        }
        let Action::Force(pull) = handle.action else {
            ring_sums.push(Vec::new());
            continue;
        };
        let rings = Rings::new(edges, rest, target, handle.radius);
        // A force of 1 mN is 1e3 µN.
        let pull = Vector3::from(pull) * 1e3;
        let (shares, sums) = rings.shares(edges, rest, pull / stiffness, params.epsilon, params.literal);
        ring_sums.push(sums);
        let again = targets[..h].contains(&target);
        for (v, share) in shares.into_iter().filter(|(v, _)| !again && reached[*v]) {
            force[v] += pull * share * still.freedom(rest[v]);
        }
    }
    // What is carried goes along as what follows as near to the handles does.
    let mut carried = vec![false; rest.len()];
    if !params.literal {
        for (handle, &target) in handles.iter().zip(targets) {
            for v in (0..rest.len()).filter(|&v| !reached[v]) {
                let w = taper((rest[v] - rest[target]).norm() / handle.radius) * still.freedom(rest[v]);
                if w > 0.0 {
                    carried[v] = true;
                    weights[v].push((target, w));
                }
            }
        }
    }
    let active: Vec<usize> = (0..rest.len()).filter(|&v| reached[v] || carried[v]).collect();
    let drive = |&v: &usize| {
        if still.freedom(rest[v]) == 0.0 {
            return Drive::Fixed;
        }
        match targets.iter().position(|t| *t == v).map(|h| handles[h].action) {
            Some(Action::Move(by)) => Drive::Moved(by.into()),
            Some(Action::Force(_)) => Drive::Pulled(force[v]),
            None => Drive::Follows(weights[v].clone(), force[v]),
        }
    };
    let drives: Vec<Drive> = active.iter().map(drive).collect();
    let ground = if params.literal { 0.0 } else { params.ground * stiffness };
    let system = System {
        edges: &coupling.tied,
        rest,
        mass,
        material: Material { stiffness, ground, damping: params.damping, push: params.literal },
        deviation: vec![[Vector3::zeros(); 2]; active.len()],
        active,
        drives,
        displacement: vec![Vector3::zeros(); rest.len()],
    };
    (system, ring_sums)
}

/// Steps through the duration; energies after the first and the last step.
fn integrate(system: &mut System, steps: usize, dt: f64, exec: &Exec) -> Result<[f64; 2], Error> {
    const TASK: &str = "ring";
    exec.observer().begin(TASK, steps as u64);
    let every = steps.div_ceil(REPORTS);
    let mut energies = [0.0; 2];
    for step in 1..=steps {
        if step % 16 == 0 {
            exec.check_cancelled()?;
        }
        system.step(step as f64 / steps as f64, dt);
        if step == 1 || step == steps || step % every == 0 {
            energies[usize::from(step > 1)] = system.energy();
            let value = energies[usize::from(step > 1)];
            exec.observer().iteration(Iteration { method: TASK, index: step as u64, value });
        }
        exec.observer().advance(TASK, 1);
    }
    exec.observer().end(TASK);
    Ok(energies)
}

/// Refuses what isn't finite and what a force carried out of its handle's reach.
fn trust(system: &System, handles: &[Handle], targets: &[usize]) -> Result<(), Error> {
    let bad = |problem: String| {
        let remedy = "use a smaller force, more stiffness or a shorter duration";
        Err(Error::Untrusted { what: "the deformed lattice", problem, remedy })
    };
    if let Some(v) = system.displacement.iter().position(|u| !u.iter().all(|c| c.is_finite())) {
        return bad(format!("the displacement of vertex {v} isn't finite"));
    }
    for (handle, &target) in handles.iter().zip(targets) {
        let far = system.displacement[target].norm();
        if matches!(handle.action, Action::Force(_)) && far > FAR * handle.radius {
            let radius = handle.radius;
            return bad(format!(
                "the force takes vertex {target} {far:.4e} mm far, with a radius of {radius} mm"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
