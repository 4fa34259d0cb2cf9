//! Lattices, their refinement, and octrees.

use std::collections::BTreeSet;

use ivd_core::{Exec, Labels, Lattice, Mask, Octree, OctreeNode, VoxelCoord};
use ivd_lattice::extract::Part;
use ivd_lattice::figures::{Figures, measure};
use ivd_lattice::refine::Refined;
use nalgebra::Vector3;

use super::Verdict;
use crate::hold;
use crate::stability::seeded::Seeded;

/// A lattice as extracted: closed, manifold, nothing degenerate, and exactly the voxels of `inside` within.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn extracted(lattice: &Lattice, inside: &[bool], exec: &Exec) -> Verdict {
    let figures = closed(lattice)?;
    hold!(figures.unused_vertices == 0, "{} unused vertices", figures.unused_vertices);
    let any = inside.contains(&true);
    hold!((figures.triangles > 0) == any, "{} triangles, voxels inside: {any}", figures.triangles);
    hold!(!any || figures.volume_mm3 > 0.0 && figures.area_mm2 > 0.0, "turned inside out: {figures:?}");
    let within = ivd_octree::inside(lattice, exec).map_err(|e| e.to_string())?;
    for (i, (&got, &expected)) in within.inside().iter().zip(inside).enumerate() {
        let at = lattice.grid().index(i).0;
        hold!((got == 1) == expected, "voxel {at:?}: {got} within the lattice, {expected} by its value");
    }
    Ok(())
}

/// Consistent, closed, manifold, finite.
fn closed(lattice: &Lattice) -> Result<Figures, String> {
    let figures = measure(lattice);
    hold!(figures.is_closed_manifold(), "not a closed manifold: {figures:?}");
    hold!(figures.euler % 2 == 0, "Euler characteristic {}", figures.euler);
    hold!(figures.area_mm2.is_finite() && figures.volume_mm3.is_finite(), "{figures:?}");
    Ok(figures)
}

/// The lattices of several labels: each closed and manifold with its label's voxels within, and no triangle in two of them the
/// same way round.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn parts(labels: &Labels, parts: &[Part]) -> Verdict {
    let mut seen = BTreeSet::new();
    for part in parts {
        let lattice = &part.lattice;
        let figures = closed(lattice).map_err(|e| format!("label {}: {e}", part.id))?;
        let voxels = labels.ids().iter().filter(|id| **id == part.id).count() as u64;
        hold!(voxels > 0 && figures.triangles > 0, "label {} of {voxels} voxels: {figures:?}", part.id);
        for t in lattice.triangles() {
            let mut corners = t.map(|v| <[f64; 3]>::from(lattice.voxel(v as usize).0).map(f64::to_bits));
            let least = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
            corners.rotate_left(least);
            hold!(seen.insert(corners), "label {}: triangle {t:?} is another label's too", part.id);
        }
    }
    Ok(())
}

/// A lattice that was sampled at a coarser rate: as a refined one, but components may vanish and join.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn sampled(input: &Lattice, found: &Refined, exec: &Exec) -> Verdict {
    subset(input, found)?;
    if !measure(input).is_closed_manifold() {
        return Ok(());
    }
    closed(&found.lattice)?;
    if found.lattice.triangles().is_empty() {
        return Ok(());
    }
    bounded(input, &found.lattice, found.max_error_mm, exec)?;
    bounded(&found.lattice, input, found.max_error_mm, exec)
}

/// Places at which a refined lattice is held against its bound.
const PROBES: usize = 64;

/// A refined lattice: vertices of its input at their places, the same components and genus where the input was closed, and
/// nowhere further from it than it says.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn refined(input: &Lattice, found: &Refined, exec: &Exec) -> Verdict {
    let output = &found.lattice;
    subset(input, found)?;
    let before = measure(input);
    if !before.is_closed_manifold() {
        return Ok(());
    }
    let after = closed(output)?;
    let topology = |f: &Figures| (f.components, f.genus);
    hold!(topology(&before) == topology(&after), "{:?} became {:?}", topology(&before), topology(&after));
    bounded(input, output, found.max_error_mm, exec)?;
    bounded(output, input, found.max_error_mm, exec)
}

/// Vertices of the input at their places, and errors that are numbers.
fn subset(input: &Lattice, found: &Refined) -> Verdict {
    let output = &found.lattice;
    for (i, key) in output.keys().iter().enumerate() {
        let Some(at) = input.vertex_at(*key) else { return Err(format!("vertex {i} is a new one")) };
        let (place, before) = (output.places()[i], input.places()[at as usize]);
        hold!(place.map(f32::to_bits) == before.map(f32::to_bits), "vertex {i} moved");
    }
    hold!(found.max_error_mm.is_finite() && found.max_error_mm >= 0.0, "bound {}", found.max_error_mm);
    hold!(found.mean_error_mm.is_finite() && found.mean_error_mm >= 0.0, "mean {}", found.mean_error_mm);
    Ok(())
}

/// Some places of one lattice lie within a distance of another.
fn bounded(from: &Lattice, to: &Lattice, bound: f64, exec: &Exec) -> Verdict {
    if from.triangles().is_empty() {
        return Ok(());
    }
    let octree = ivd_octree::build(to, &ivd_octree::Params::default(), exec).map_err(|e| e.to_string())?;
    let index = ivd_octree::prepare(to, &octree).map_err(|e| e.to_string())?;
    let positions = from.local_positions();
    let mut random = Seeded::new(from.triangles().len() as u64);
    // The weights of the nearest point solve a system whose condition is the square of a triangle's aspect ratio, up to 10⁶.
    let extent = positions.iter().map(Vector3::amax).fold(0.0, f64::max);
    for _ in 0..PROBES {
        let t = random.below(from.triangles().len());
        let [a, b, c] = from.triangles()[t].map(|v| positions[v as usize]);
        let (s, r) = (random.unit().sqrt(), random.unit());
        let point = a * (1.0 - s) + b * (s * (1.0 - r)) + c * (s * r);
        let Some(near) = index.nearest(point, f64::INFINITY) else { return Err("nothing is near".into()) };
        let most = bound * (1.0 + 1e-9) + 1e-9 * extent;
        hold!(
            near.distance_mm <= most,
            "triangle {t} is {} mm off, bound {bound}, extent {extent}",
            near.distance_mm
        );
    }
    Ok(())
}

/// An octree of a closed lattice: every voxel's leaf agrees with its side, every triangle is listed, and the sides with
/// the winding number.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn octree(lattice: &Lattice, inside: &Mask, octree: &Octree) -> Verdict {
    let grid = lattice.grid();
    for i in 0..grid.len() {
        let at = grid.index(i).0;
        let within = inside.inside()[i] == 1;
        match octree.locate(at.map(|c| c + 1)).2 {
            OctreeNode::Inside => hold!(within, "voxel {at:?} lies outside, its leaf inside"),
            OctreeNode::Outside => hold!(!within, "voxel {at:?} lies inside, its leaf outside"),
            OctreeNode::Surface { .. } => {}
            OctreeNode::Internal { .. } => return Err(format!("voxel {at:?} has no leaf")),
        }
    }
    let mut listed = vec![false; lattice.triangles().len()];
    octree.leaf_triangles().iter().for_each(|&t| listed[t as usize] = true);
    if let Some(t) = listed.iter().position(|l| !l) {
        return Err(format!("triangle {t} is in no leaf"));
    }
    windings(lattice, inside)
}

/// The sides of some voxels, half of them beside the lattice, against the sum of the triangles' solid angles.
fn windings(lattice: &Lattice, inside: &Mask) -> Verdict {
    let (grid, positions) = (lattice.grid(), lattice.local_positions());
    let linear = grid.linear_part();
    let mut random = Seeded::new(lattice.keys().len() as u64);
    for probe in 0..24 {
        let i = if probe % 2 == 0 || lattice.keys().is_empty() {
            random.below(grid.len())
        } else {
            let near = lattice.voxel(random.below(lattice.keys().len())).0;
            let clamped: [usize; 3] =
                std::array::from_fn(|a| near[a].round().clamp(0.0, (grid.dims()[a] - 1) as f64) as usize);
            grid.linear(ivd_core::VoxelIndex(clamped))
        };
        let point = linear * VoxelCoord::from(grid.index(i)).0;
        // A voxel in a refined face has no side.
        if let Some(turns) = winding(lattice, &positions, point) {
            let (got, expected) = (inside.inside()[i] == 1, turns.round() != 0.0);
            hold!(got == expected, "voxel {:?}: inside {got}, winding {turns}", grid.index(i).0);
        }
    }
    Ok(())
}

/// How often the lattice winds round a point (van Oosterom & Strackee 1983); `None` where the point lies in a triangle.
fn winding(lattice: &Lattice, positions: &[Vector3<f64>], point: Vector3<f64>) -> Option<f64> {
    let mut turns = 0.0;
    for t in lattice.triangles() {
        let [a, b, c] = t.map(|v| positions[v as usize] - point);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let above = a.dot(&b.cross(&c));
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        if above.abs() <= 1e-9 * la * lb * lc && below <= 1e-9 * la * lb * lc {
            return None;
        }
        turns += 2.0 * above.atan2(below);
    }
    Some(turns / (4.0 * std::f64::consts::PI))
}
