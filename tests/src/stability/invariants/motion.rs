//! Motions of lattices.

use ivd_core::Lattice;
use ivd_deform::spring::{Action, Fix, Handle, HandleAt, Solved};
use nalgebra::Vector3;

use super::Verdict;
use crate::hold;

/// The vertex of a handle that names one.
fn vertex(at: &HandleAt) -> Option<usize> {
    if let HandleAt::Vertex(v) = at { Some(*v as usize) } else { None }
}

/// A motion: finite, exact at handles that move and at what is fixed, 0 beyond every handle's reach, and nothing where
/// nothing is asked.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn solved(lattice: &Lattice, handles: &[Handle], fixed: &[Fix], found: &Solved) -> Verdict {
    let motion = &found.motion;
    motion.check().map_err(|e| e.to_string())?;
    hold!(motion.vertex_count == lattice.keys.len(), "{} vertices", motion.vertex_count);
    let numbers =
        [found.residual, found.energy_first, found.energy_last, found.max_displacement_mm, found.dt];
    hold!(numbers.iter().all(|n| n.is_finite() && *n >= 0.0), "figures {numbers:?}");
    let u = &motion.frames[0].displacement;
    let moved = u.iter().filter(|d| **d != [0.0; 3]).count();
    hold!(found.vertices_moved == moved, "{} vertices moved, plainly {moved}", found.vertices_moved);
    out_of_reach(lattice, found)?;
    let held = |v: usize| {
        fixed.iter().filter_map(|f| Some((vertex(&f.at)?, f.radius))).any(|(f, radius)| {
            v == f || (lattice.local_positions()[v] - lattice.local_positions()[f]).norm() <= radius
        })
    };
    for handle in handles {
        if let (Some(v), Action::Move(by)) = (vertex(&handle.at), handle.action) {
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
    hold!(!idle || moved == 0, "nothing pulls and {moved} vertices move");
    Ok(())
}

/// Beyond the balls nothing moves, exactly. Rounding of world positions, which the balls' centres are in, is allowed for.
fn out_of_reach(lattice: &Lattice, found: &Solved) -> Verdict {
    let rest = lattice.positions();
    for (v, d) in found.motion.frames[0].displacement.iter().enumerate() {
        let reached = found.motion.reach.iter().any(|b| {
            let centre = Vector3::from(b.centre);
            let slack = 8.0 * f64::EPSILON * (centre.amax() + rest[v].amax() + b.radius);
            (rest[v] - centre).norm() < b.radius + slack
        });
        hold!(reached || *d == [0.0; 3], "vertex {v} is out of reach and went {d:?}");
    }
    Ok(())
}
