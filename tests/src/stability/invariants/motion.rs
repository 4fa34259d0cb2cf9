//! Motions of lattices.

use std::collections::BTreeMap;

use ivd_core::{Labels, Lattice, Motion, Role, VoxelIndex};
use ivd_field::shape::{Kind as Form, Shape};
use ivd_motion::freeform::Shaped;
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring::{self, Kind, Params, Solver};
use ivd_motion::rigid::{BoneSpec, Drive};
use ivd_motion::ring::RingResult;
use nalgebra::{Rotation3, Unit, Vector3};

use super::{EPS, Verdict};
use crate::hold;

/// The vertex of a handle that names one.
fn vertex(at: &Anchor) -> Option<usize> {
    if let Anchor::Vertex(v) = at { Some(*v as usize) } else { None }
}

/// What a solver is asked.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// The lattice at rest.
    pub lattice: &'a Lattice,
    /// Handles.
    pub handles: &'a [Handle],
    /// What stays.
    pub fixed: &'a [Pin],
    /// What springs are made of.
    pub labels: Option<&'a Labels>,
    /// Bones.
    pub bones: &'a [BoneSpec],
}

impl Asked<'_> {
    /// The bone that holds a vertex, by its region alone.
    fn bone(&self, v: usize) -> Option<&BoneSpec> {
        let rest = self.lattice.local_positions()[v];
        let origin = Vector3::from(self.lattice.grid().origin());
        self.bones.iter().find(|bone| bone.region.is_some_and(|region| region.holds(rest, origin)))
    }

    /// Stiffness of a structural spring of what a vertex is made of (N/m). Cases have no lattice edge between two labels.
    fn stiffness(&self, v: usize, params: &Params) -> f64 {
        let at = self.lattice.voxel(v).0.map(|c| c.floor().max(0.0) as usize);
        let at = self.lattice.grid().linear(VoxelIndex(at.into()));
        let own = self.labels.and_then(|labels| params.springs.material.get(&labels.ids()[at])?.stiffness);
        own.unwrap_or(params.springs.stiffness)
    }
}

/// A motion by rings: finite, exact at handles that move and at what is fixed, 0 beyond every handle's reach, and nothing where
/// nothing is asked.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn solved(asked: &Asked<'_>, found: &RingResult) -> Verdict {
    let numbers =
        [found.residual, found.energy_first, found.energy_last, found.max_displacement_mm, found.dt];
    hold!(numbers.iter().all(|n| n.is_finite() && *n >= 0.0), "figures {numbers:?}");
    moved(asked, &found.motion, found.vertices_moved, true)
}

/// What holds of the last frame of any motion by handles.
///
/// - `whole`: whether handles have come to the end of their ways.
fn moved(asked: &Asked<'_>, motion: &Motion, vertices: usize, whole: bool) -> Verdict {
    let Asked { lattice, handles, fixed, .. } = *asked;
    hold!(motion.vertex_count() == lattice.keys().len(), "{} vertices", motion.vertex_count());
    let u = &motion.frames()[motion.frames().len() - 1].displacement;
    let moved = u.iter().filter(|d| **d != [0.0; 3]).count();
    hold!(vertices == moved, "{vertices} vertices moved, plainly {moved}");
    out_of_reach(lattice, motion)?;
    let rest = lattice.local_positions();
    let held = |v: usize| {
        fixed
            .iter()
            .filter_map(|f| Some((vertex(&f.at)?, f.radius)))
            .any(|(f, radius)| v == f || (rest[v] - rest[f]).norm() <= radius)
    };
    for handle in handles.iter().filter(|_| whole) {
        if let (Some(v), Action::Move(by)) = (vertex(&handle.at), handle.action)
            && asked.bone(v).is_none()
        {
            let expected = if held(v) { [0.0; 3] } else { by.map(|c| c + 0.0) };
            hold!(u[v] == expected, "handle at vertex {v} went {:?}, not {expected:?}", u[v]);
        }
    }
    for v in fixed.iter().filter_map(|f| vertex(&f.at)) {
        hold!(u[v] == [0.0; 3], "fixed vertex {v} went {:?}", u[v]);
    }
    let idle = handles.iter().all(|h| match h.action {
        Action::Move(by) | Action::Force(by) => by == [0.0; 3],
    });
    hold!(!idle || moved == 0 || !asked.bones.is_empty(), "nothing pulls and {moved} vertices move");
    Ok(())
}

/// Beyond the balls nothing moves, exactly. Rounding of world positions, which the balls' centres are in, is allowed for.
fn out_of_reach(lattice: &Lattice, motion: &Motion) -> Verdict {
    let rest = lattice.positions();
    for (v, d) in motion.frames().iter().flat_map(|frame| frame.displacement.iter().enumerate()) {
        let reached = motion.reach().iter().any(|b| {
            let centre = Vector3::from(b.centre);
            let slack = 8.0 * EPS * (centre.amax() + rest[v].amax() + b.radius);
            (rest[v] - centre).norm() < b.radius + slack
        });
        hold!(reached || *d == [0.0; 3], "vertex {v} is out of reach and went {d:?}");
    }
    Ok(())
}

/// A motion by masses on springs: as one by rings; and the figures are those of forces summed plainly.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn sprung(asked: &Asked<'_>, params: &Params, found: &mass_spring::MassSpringResult) -> Verdict {
    let mut numbers = vec![found.residual, found.energy_first, found.energy_last, found.max_displacement_mm];
    numbers.extend([found.dt, found.truncation, found.truncation_mn]);
    hold!(numbers.iter().all(|n| n.is_finite() && *n >= 0.0), "figures {numbers:?}");
    hold!(found.motion.frames().len() == params.springs.frames, "{} frames", found.motion.frames().len());
    let whole = params.springs.ramp.is_none_or(|ramp| ramp <= params.springs.duration);
    moved(asked, &found.motion, found.vertices_moved, whole)?;
    if whole {
        rigid(asked, &found.motion)?;
    }
    if params.springs.youngs_kpa.is_some() {
        return Ok(());
    }
    let plain = Plain::new(asked, params, &found.motion);
    // Places are rounded, and every force is a stiffness times a difference of lengths.
    let slack = 1e-9 * plain.energy + 64.0 * EPS * plain.rounding_nj;
    if params.solver == Solver::Projective && !params.descent.inertia {
        hold!(
            (found.energy_last - plain.energy).abs() <= slack,
            "an energy of {} nJ, plainly {}",
            found.energy_last,
            plain.energy
        );
        balanced(asked, params, found, &plain)?;
    } else {
        let least = plain.energy - slack;
        hold!(found.energy_last >= least, "{} nJ, springs alone hold {}", found.energy_last, plain.energy);
    }
    Ok(())
}

/// Bones have gone where they are sent: by the turn that is given, or with the one handle that they are fitted to.
fn rigid(asked: &Asked<'_>, motion: &Motion) -> Verdict {
    let (rest, origin) = (asked.lattice.local_positions(), Vector3::from(asked.lattice.grid().origin()));
    let u = &motion.frames()[motion.frames().len() - 1].displacement;
    for (v, rest) in rest.iter().enumerate() {
        let Some(bone) = asked.bone(v) else { continue };
        let expected = match (bone.drive, asked.handles) {
            (Drive::Prescribed(turn), _) if bone.parent.is_none() => {
                let (axis, at) = (Vector3::from(turn.axis), rest + origin - Vector3::from(turn.pivot));
                let angle = (turn.angle % 360.0).to_radians();
                let turned = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle) * at;
                turned - at + Vector3::from(turn.by)
            }
            (Drive::Fitted { pivot: None }, [Handle { action: Action::Move(by), .. }]) => Vector3::from(*by),
            _ => continue,
        };
        let most = 1e-9 * (1.0 + expected.norm() + rest.norm()) + 16.0 * EPS * origin.amax();
        hold!((Vector3::from(u[v]) - expected).norm() <= most, "vertex {v} of a bone went {:?}", u[v]);
    }
    Ok(())
}

/// What holds of forces in balance.
fn balanced(
    asked: &Asked<'_>,
    params: &Params,
    found: &mass_spring::MassSpringResult,
    plain: &Plain,
) -> Verdict {
    let u = &found.motion.frames()[params.springs.frames - 1].displacement;
    let whole = params.springs.ramp.is_none_or(|ramp| ramp <= params.springs.duration);
    // A bone that moves does work of its own.
    let pull =
        whole && asked.bones.is_empty() && asked.handles.iter().all(|h| matches!(h.action, Action::Force(_)));
    let (mut work, mut sizes) = (0.0, 0.0);
    let mut seen = Vec::new();
    for handle in asked.handles {
        if let (Some(v), Action::Force(force)) = (vertex(&handle.at), handle.action)
            && !seen.contains(&v)
        {
            seen.push(v);
            // mN · mm = µJ.
            work += 1e3 * Vector3::from(force).dot(&Vector3::from(u[v]));
            sizes += 1e3 * Vector3::from(force).norm() * Vector3::from(u[v]).norm();
        }
    }
    // From rest the objective, energy less work, never rises.
    if pull && seen.len() == asked.handles.len() {
        let slack = 1e-9 * (plain.energy + sizes) + 64.0 * EPS * plain.rounding_nj;
        hold!(plain.energy <= work + slack, "{} nJ in springs, {work} nJ of work", plain.energy);
    }
    // One frame, one residual.
    let named = asked.handles.iter().all(|h| vertex(&h.at).is_some());
    if params.springs.frames == 1 && params.springs.grip == Some(0.0) && named && whole {
        let (unbalanced, put_in, most_put_in) = plain.relative(asked, found);
        // Of slack springs nothing may be left of what was put in at first, of which a millionth counts.
        let put_in = put_in.max(1e-6 * most_put_in);
        let rounding = 64.0 * EPS * plain.rounding_mn;
        let most = found.residual * put_in * (1.0 + 1e-6) + rounding;
        hold!(
            unbalanced <= most,
            "{unbalanced} mN without balance, of {put_in} put in, stated {}",
            found.residual
        );
    }
    Ok(())
}

/// Springs summed one by one, in N/m, mm and mN.
struct Plain {
    /// Force of springs and ground on each vertex (mN).
    force: Vec<Vector3<f64>>,
    /// Most that they resist each vertex with before any other gives way (mN).
    first: Vec<f64>,
    /// Energy in them (nJ).
    energy: f64,
    /// What a rounding of places is multiplied with: in energies (nJ) and in forces (mN).
    rounding_nj: f64,
    rounding_mn: f64,
}

impl Plain {
    fn new(asked: &Asked<'_>, params: &Params, motion: &Motion) -> Self {
        let rest = asked.lattice.local_positions();
        // What is carried has no springs.
        let last = &motion.frames()[motion.frames().len() - 1].displacement;
        let of = |(v, u): (usize, &[f64; 3])| if motion.role(v) == Role::Carried { [0.0; 3] } else { *u };
        let u: Vec<[f64; 3]> = last.iter().enumerate().map(of).collect();
        let made: Vec<f64> = (0..rest.len()).map(|v| asked.stiffness(v, params)).collect();
        let share = |kind: Kind| match kind {
            Kind::Structural => 1.0,
            Kind::Shear => params.springs.shear,
            Kind::Flexion => params.springs.flexion,
        };
        let origin = Vector3::from(asked.lattice.grid().origin());
        let targets: Vec<usize> = asked.handles.iter().filter_map(|h| vertex(&h.at)).collect();
        let moves = |bone: &BoneSpec| !matches!(bone.drive, Drive::Prescribed(turn) if turn.is_none());
        let pulls = |handle: &Handle| matches!(handle.action, Action::Force(_));
        let push = params
            .springs
            .push
            .unwrap_or_else(|| asked.bones.iter().any(moves) || asked.handles.iter().any(pulls));
        let balls: Vec<_> =
            motion.reach().iter().map(|b| (Vector3::from(b.centre) - origin, b.radius)).collect();
        // An edge is seen with the triangles at the reach alone: with those beyond it may have more than two.
        let near = |v: u32| {
            let within =
                |(centre, radius): &(Vector3<f64>, f64)| (rest[v as usize] - centre).norm() < *radius;
            let carried = asked.bone(v as usize).is_some();
            balls.iter().any(within) || targets.contains(&(v as usize)) || carried
        };
        let mut force = vec![Vector3::zeros(); rest.len()];
        let mut first = vec![0.0; rest.len()];
        let limited = if params.springs.strain_limit.is_some() { 101.0 } else { 1.0 };
        let mut structural = vec![(0.0, 0.0); rest.len()];
        let (mut energy, mut rounding_nj, mut rounding_mn) = (0.0, 0.0, 0.0_f64);
        let mut close = vec![false; rest.len()];
        for t in asked.lattice.triangles().iter().filter(|t| t.iter().any(|&v| near(v))) {
            for &v in t {
                close[v as usize] = true;
            }
        }
        let links = mass_spring::links(asked.lattice.triangles(), &rest, |v| close[v as usize]);
        for link in links.into_iter().filter(|link| link.ends.iter().any(|&v| near(v))) {
            let [a, b] = link.ends.map(|v| v as usize);
            // Of two materials, halves in a row.
            let k = share(link.kind)
                * if made[a] == made[b] { made[a] } else { 2.0 / (1.0 / made[a] + 1.0 / made[b]) };
            let span = rest[b] - rest[a];
            if link.kind == Kind::Structural {
                for v in [a, b] {
                    structural[v] = (structural[v].0 + k, structural[v].1 + 1.0);
                }
            }
            let moved = span + Vector3::from(u[b]) - Vector3::from(u[a]);
            let (short, long) = (span.norm(), moved.norm());
            let stretch = long - short;
            let far = Vector3::from(u[a]).norm().max(Vector3::from(u[b]).norm());
            // Beyond the limit a hundredfold stiffness comes on top.
            let over = params.springs.strain_limit.map_or(0.0, |limit| (stretch - limit * short).max(0.0));
            let tension = if stretch < 0.0 && !push { 0.0 } else { k * (stretch + 100.0 * over) };
            let own = if stretch < 0.0 && !push {
                0.0
            } else {
                0.5 * k * (stretch * stretch + 100.0 * over * over)
            };
            for v in [a, b] {
                first[v] += limited * k * Vector3::from(u[v]).norm();
            }
            energy += 1e3 * own;
            rounding_nj +=
                1e3 * tension.abs() * (long + short) + 1e5 * k * EPS * (long + short + far).powi(2);
            rounding_mn += 100.0 * k * (long + short + far);
            if long > 0.0 {
                let pull = moved * (tension / long);
                force[a] += pull;
                force[b] -= pull;
            }
        }
        for (v, u) in u.iter().enumerate() {
            let u = Vector3::from(*u);
            let (sum, count) = structural[v];
            if count > 0.0 {
                let ground = params.springs.ground * sum / count;
                force[v] -= u * ground;
                energy += 0.5e3 * ground * u.norm_squared();
                rounding_nj += 1e3 * ground * u.norm_squared();
            }
        }
        Self { force, first, energy, rounding_nj, rounding_mn }
    }

    /// Length of the list of forces that nothing stands against, of those that handles put in, and of the most that they may have put in at first (mN).
    fn relative(&self, asked: &Asked<'_>, found: &mass_spring::MassSpringResult) -> (f64, f64, f64) {
        let u = &found.motion.frames()[0].displacement;
        let targets: BTreeMap<usize, Action> =
            asked.handles.iter().filter_map(|h| Some((vertex(&h.at)?, h.action))).collect();
        let (mut unbalanced, mut put_in, mut most_put_in) = (0.0, 0.0, 0.0);
        for (v, force) in self.force.iter().enumerate() {
            match targets.get(&v) {
                Some(Action::Move(_)) => {
                    put_in += force.norm_squared();
                    most_put_in += self.first[v].powi(2);
                }
                None if asked.bone(v).is_some() => put_in += force.norm_squared(),
                // What doesn't move may be held, by a fix or as out of reach.
                _ if u[v] == [0.0; 3] => {}
                Some(Action::Force(pull)) => {
                    let pull = Vector3::from(*pull);
                    put_in += pull.norm_squared();
                    unbalanced += (force + pull).norm_squared();
                }
                None => unbalanced += force.norm_squared(),
            }
        }
        (f64::sqrt(unbalanced), f64::sqrt(put_in), f64::sqrt(most_put_in))
    }
}

/// A motion by free forms: finite; beyond their balls what was there before, bit for bit; and within the core of one that is alone and
/// simple, what the book says.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn shaped(lattice: &Lattice, start: &Motion, shapes: &[Shape], found: &Shaped) -> Verdict {
    let (before, after) = (&start.frames()[0].displacement, &found.motion.frames()[0].displacement);
    let moved = after.iter().filter(|d| **d != [0.0; 3]).count();
    hold!(found.vertices_moved == moved, "{} vertices moved, plainly {moved}", found.vertices_moved);
    let origin = Vector3::from(lattice.grid().origin());
    for (v, rest) in lattice.local_positions().into_iter().enumerate() {
        let place = rest + Vector3::from(before[v]);
        // Rounding of world positions, which the balls' centres are in.
        let slack = |shape: &Shape| 16.0 * EPS * (origin.amax() + place.amax() + shape.radius);
        let from = |shape: &Shape| place - (Vector3::from(shape.centre) - origin);
        let beyond = |shape: &Shape| from(shape).norm() > shape.radius + slack(shape);
        if shapes.iter().all(beyond) {
            hold!(after[v] == before[v], "vertex {v} lies beyond all shapes and went {:?}", after[v]);
        }
        let [shape] = shapes else { continue };
        if from(shape).norm() >= shape.core * shape.radius - slack(shape) {
            continue;
        }
        let axis = Unit::new_normalize(Vector3::from(shape.axis));
        let at = from(shape);
        let along = axis.into_inner() * axis.dot(&at);
        let expected = match shape.kind {
            Form::Translate { by } => at + Vector3::from(by),
            Form::Rotate { angle } => Rotation3::from_axis_angle(&axis, angle.to_radians()) * at,
            Form::Scale { along: s, across: q } => along * s.unwrap_or(1.0) + (at - along) * q.unwrap_or(1.0),
            _ => continue,
        };
        let went = rest + Vector3::from(after[v]) - (place - at);
        let most = slack(shape) * 1e3 + 1e-9 * expected.norm();
        hold!((went - expected).norm() <= most, "vertex {v} went to {went:?}, not {expected:?}");
    }
    Ok(())
}
