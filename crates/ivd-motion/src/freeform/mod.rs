//! Free forms: a lattice is translated, turned, scaled, bent, twisted, tapered, stretched, squeezed, without physics.
//!
//! Each [`Shape`] is a map of space, the identity beyond its ball. Several act one after another, each on what the one before
//! left: [`lattice`] takes the vertices through all of them, from rest or from where a solver's motion took them. A solver's
//! motion is made with its handles first; shapes come after it, in their order.
//!
//! After Barr 1984 (bend, twist, taper); the thesis, 6.1.1 and figure 8.11. A shape may fold space where it fades out too
//! steeply; a map of it to voxels tells, and mends what can be mended.

#[cfg(test)]
mod tests;

use ivd_core::{Ball, Exec, Frame, InteriorPoints, Lattice, Motion, Role};
use ivd_field::shape::Shape;
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Error;

/// A lattice's motion by shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaped {
    /// The frames, from none of the shapes' work to all of it; reach: the start's balls, then a ball for each shape.
    pub motion: Motion,
    /// Vertices whose displacement in the last frame isn't 0.
    pub vertices_moved: usize,
    /// Largest displacement of any frame (mm).
    pub max_displacement_mm: f64,
}

/// Takes the vertices of a lattice through `shapes`, in their order.
///
/// With a `start`, from where each of its frames has them, the shapes doing `i / n` of their work in frame `i` of `n`, counted
/// from 1; without, from rest, one frame at the time 0.
///
/// # Errors
/// [`Error::Param`]: a shape outside its domain. [`Error::Mismatch`]: a start of another lattice. [`Error::Untrusted`]: a
/// place that isn't finite. Cancelled.
pub fn lattice(
    lattice: &Lattice,
    start: Option<&Motion>,
    shapes: &[Shape],
    exec: &Exec,
) -> Result<Shaped, Error> {
    shapes.iter().try_for_each(Shape::check)?;
    if let Some(start) = start {
        start.require_of(lattice)?;
    }
    let rest = lattice.local_positions();
    let still = [Frame { time: 0.0, displacement: vec![[0.0; 3]; rest.len()].into() }];
    let frames = start.map_or(&still[..], |start| start.frames());
    let origin = Vector3::from(lattice.grid().origin());
    exec.check_memory("the frames of the motion", 24 * (frames.len() * rest.len()) as u64)?;
    exec.run(|| {
        let mut shaped = Vec::with_capacity(frames.len());
        for (i, frame) in frames.iter().enumerate() {
            exec.check_cancelled()?;
            let amount = (i + 1) as f64 / frames.len() as f64;
            let displacement: Vec<_> = frame
                .displacement
                .par_iter()
                .zip(&rest)
                .map(|(&before, &rest)| displaced(rest, before, origin, shapes, amount))
                .collect();
            shaped.push(Frame { time: frame.time, displacement: displacement.into() });
        }
        let balls = shapes.iter().map(|shape| Ball { centre: shape.centre, radius: shape.radius });
        let reach = start.map_or(&[][..], |start| start.reach()).iter().copied().chain(balls).collect();
        let inner =
            start.map_or_else(InteriorPoints::default, |start| inner(lattice, start.inner(), origin, shapes));
        let roles = start.map_or_else(Vec::new, |start| roles(start, &shaped));
        let motion = Motion::new(lattice.grid().clone(), rest.len(), shaped)
            .and_then(|motion| motion.with_reach(reach)?.with_inner(inner)?.with_roles(roles.into()))
            .map_err(|beyond| Error::Untrusted {
                what: "the shapes",
                problem: beyond.to_string(),
                remedy: "use smaller factors and rates",
            })?;
        let last = motion.frames().last().map_or(&[][..], |frame| &frame.displacement);
        Ok(Shaped {
            vertices_moved: last.iter().filter(|u| **u != [0.0; 3]).count(),
            max_displacement_mm: motion.max_displacement(),
            motion,
        })
    })
}

/// What the vertices' motion says after shapes have gone on: those that they moved are driven.
fn roles(start: &Motion, shaped: &[Frame]) -> Vec<u8> {
    let went_on = |v: usize| {
        shaped.iter().zip(start.frames()).any(|(now, then)| now.displacement[v] != then.displacement[v])
    };
    let of = |v: usize| if went_on(v) { Role::Driven } else { start.role(v) };
    (0..start.vertex_count()).map(|v| of(v) as u8).collect()
}

/// InteriorPoints points go where the vertices round them go.
fn inner(
    lattice: &Lattice,
    start: &InteriorPoints,
    origin: Vector3<f64>,
    shapes: &[Shape],
) -> InteriorPoints {
    let linear = lattice.grid().linear_part();
    let frames = start.frames.iter().enumerate().map(|(i, frame)| {
        let amount = (i + 1) as f64 / start.frames.len() as f64;
        let of = |(place, by): (&[f64; 3], &[f64; 3])| {
            displaced(linear * Vector3::from(*place), *by, origin, shapes, amount)
        };
        start.places.iter().zip(&frame[..]).map(of).collect()
    });
    InteriorPoints { places: start.places.clone(), frames: frames.collect() }
}

/// The displacement of a point that was displaced before, after all shapes (mm). What no shape reaches keeps it bit for bit.
fn displaced(
    rest: Vector3<f64>,
    before: [f64; 3],
    origin: Vector3<f64>,
    shapes: &[Shape],
    amount: f64,
) -> [f64; 3] {
    let at = rest + Vector3::from(before);
    let mut now = at;
    for shape in shapes {
        // Relative to the grid's origin, which may be far away.
        let local = Shape { centre: (Vector3::from(shape.centre) - origin).into(), ..*shape };
        now = local.apply(now, amount);
    }
    if now == at { before } else { (now - rest).into() }
}
