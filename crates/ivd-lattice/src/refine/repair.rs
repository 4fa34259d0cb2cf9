//! Repair of a lattice that keeps addresses: components and slivers go, no vertex is made or moved.
//!
//! [`repair`] removes whole components below a size, and slivers by half-edge collapse within a bound. What is left is a
//! subset of the vertices with their keys and places; a closed manifold stays one.

use ivd_core::{Exec, Lattice, ParamError};
use serde::{Deserialize, Serialize};

use super::slivers::{Slivers, WithoutSlivers};
use crate::Error;
use crate::figures::component_roots;

/// What to remove. By default nothing is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RepairParams {
    /// Components of fewer triangles go.
    pub min_triangles: u64,
    /// Components of less area (mm²) go; ≥ 0.
    pub min_area_mm2: f64,
    /// Components that enclose less volume (mm³), taken without its sign, go; ≥ 0. It means something where they are
    /// closed: a cavity is one too, and removing it fills it.
    pub min_volume_mm3: f64,
    /// Triangles whose longest side is more than this many times their least height are slivers; above 2/√3, which is an
    /// equilateral triangle's.
    pub max_aspect: Option<f64>,
    /// Triangles with a height below this (mm) are slivers; ≥ 0.
    pub min_height_mm: f64,
    /// Largest distance from the input that the removal of slivers may lead to, both ways (mm); ≥ 0.
    pub max_error_mm: f64,
    /// Most that one collapse may turn a triangle (degrees), above 0 and below 180.
    pub max_turn_degrees: f64,
}

impl Default for RepairParams {
    fn default() -> Self {
        Self {
            min_triangles: 0,
            min_area_mm2: 0.0,
            min_volume_mm3: 0.0,
            max_aspect: None,
            min_height_mm: 0.0,
            max_error_mm: 0.0,
            max_turn_degrees: 75.0,
        }
    }
}

impl RepairParams {
    /// Checks every field's domain.
    ///
    /// # Errors
    /// [`ParamError`] names the first field outside its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        let sizes = [
            ("min_area_mm2", self.min_area_mm2, "mm²"),
            ("min_volume_mm3", self.min_volume_mm3, "mm³"),
            ("min_height_mm", self.min_height_mm, "mm"),
            ("max_error_mm", self.max_error_mm, "mm"),
        ];
        for (field, value, unit) in sizes {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ParamError::new(field, format!("{value} {unit}"), "give 0 or more"));
            }
        }
        if let Some(aspect) = self.max_aspect
            && !(aspect.is_finite() && aspect > 2.0 / 3.0_f64.sqrt())
        {
            return Err(ParamError::new("max_aspect", format!("{aspect}"), "give more than 1.155, or none"));
        }
        if !(self.max_turn_degrees > 0.0 && self.max_turn_degrees < 180.0) {
            let problem = format!("{} degrees", self.max_turn_degrees);
            let remedy = "give an angle above 0 and below 180 degrees";
            return Err(ParamError::new("max_turn_degrees", problem, remedy));
        }
        Ok(())
    }
}

/// A repaired lattice and what was done to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Repaired {
    /// A subset of the input's vertices, with their keys and places. Its `max_error_mm` grows by that of the slivers; of
    /// components that went it says nothing.
    pub lattice: Lattice,
    /// What was done.
    pub done: RepairFigures,
}

/// Figures of a repair.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct RepairFigures {
    /// Components of the input that have triangles.
    pub components: u64,
    /// Of these, removed.
    pub components_removed: u64,
    /// Triangles of removed components.
    pub triangles_removed: u64,
    /// Area of removed components (mm²).
    pub area_removed_mm2: f64,
    /// Volume that removed components enclosed (mm³), each without its sign.
    pub volume_removed_mm3: f64,
    /// Slivers in the components left.
    pub slivers_found: u64,
    /// Slivers at the end.
    pub slivers_left: u64,
    /// Vertices that went with slivers.
    pub vertices_collapsed: u64,
    /// Bound on the distance that the removal of slivers led to, both ways (mm).
    pub max_error_mm: f64,
}

/// Removes components below a size and slivers.
///
/// The same result for any number of threads. Vertices that no triangle names stay.
///
/// # Errors
/// [`ivd_core::Error::Param`] for parameters outside their domain, [`ivd_core::Error::Inconsistent`] for a lattice whose parts
/// don't fit, [`ivd_core::Error::MemoryLimit`], [`ivd_core::Error::Cancelled`].
pub fn repair(lattice: &Lattice, params: &RepairParams, exec: &Exec) -> Result<Repaired, Error> {
    params.check()?;
    exec.check_cancelled()?;
    let mut done = RepairFigures::default();
    let mut repaired = exec.run(|| without_small(lattice, params, &mut done))?;
    if params.max_aspect.is_some() || params.min_height_mm > 0.0 {
        let slivers = Slivers {
            max_aspect: params.max_aspect.unwrap_or(f64::INFINITY),
            min_height_mm: params.min_height_mm,
            max_error_mm: params.max_error_mm,
            turn_cosine: params.max_turn_degrees.to_radians().cos(),
        };
        let without = exec.run(|| slivers.remove(&repaired, exec))?;
        let WithoutSlivers { kept, triangles, found, left, max_error_mm } = without;
        (done.slivers_found, done.slivers_left, done.max_error_mm) = (found, left, max_error_mm);
        done.vertices_collapsed = (repaired.keys().len() - kept.len()) as u64;
        let bound = repaired.max_error_mm() + max_error_mm;
        repaired = repaired.subset(&kept, triangles)?.with_max_error_mm(bound);
    }
    Ok(Repaired { lattice: repaired, done })
}

/// Size of a component.
#[derive(Debug, Clone, Copy, Default)]
struct Size {
    triangles: u64,
    area: f64,
    volume: f64,
}

/// Volumes that the components with triangles enclose (mm³), each without its sign; see [`RepairParams::min_volume_mm3`].
pub(crate) fn enclosed_volumes(lattice: &Lattice) -> Vec<f64> {
    let sizes = sizes(lattice, &component_roots(lattice));
    sizes.iter().filter(|size| size.triangles > 0).map(|size| size.volume.abs()).collect()
}

/// How many of the components that enclose less than a share of what the largest does have a vertex of which `is_there` holds.
pub fn small_components(lattice: &Lattice, share: f64, is_there: impl Fn(usize) -> bool) -> u64 {
    let roots = component_roots(lattice);
    let sizes = sizes(lattice, &roots);
    let limit = share * sizes.iter().map(|size| size.volume.abs()).fold(0.0, f64::max);
    let is_small = |root: usize| sizes[root].triangles > 0 && sizes[root].volume.abs() < limit;
    let mut found: Vec<u32> =
        (0..roots.len()).filter(|&v| is_small(roots[v] as usize) && is_there(v)).map(|v| roots[v]).collect();
    found.sort_unstable();
    found.dedup();
    found.len() as u64
}

/// The size of each component, at its first vertex.
fn sizes(lattice: &Lattice, roots: &[u32]) -> Vec<Size> {
    let positions = lattice.local_positions();
    let mut sizes = vec![Size::default(); positions.len()];
    for t in lattice.triangles() {
        let root = roots[t[0] as usize] as usize;
        // Relative to the component, so that the volume of a small one far away loses nothing.
        let [a, b, c] = t.map(|v| positions[v as usize] - positions[root]);
        let size = &mut sizes[root];
        size.triangles += 1;
        size.area += 0.5 * (b - a).cross(&(c - a)).norm();
        size.volume += a.dot(&b.cross(&c)) / 6.0;
    }
    sizes
}

fn without_small(
    lattice: &Lattice,
    params: &RepairParams,
    done: &mut RepairFigures,
) -> Result<Lattice, Error> {
    let roots = component_roots(lattice);
    let sizes = sizes(lattice, &roots);
    let goes = |size: &Size| {
        size.triangles > 0
            && (size.triangles < params.min_triangles
                || size.area < params.min_area_mm2
                || size.volume.abs() < params.min_volume_mm3)
    };
    for size in sizes.iter().filter(|s| s.triangles > 0) {
        done.components += 1;
        if goes(size) {
            done.components_removed += 1;
            done.triangles_removed += size.triangles;
            done.area_removed_mm2 += size.area;
            done.volume_removed_mm3 += size.volume.abs();
        }
    }
    let stays = |v: u32| !goes(&sizes[roots[v as usize] as usize]);
    let kept: Vec<u32> = (0..sizes.len() as u32).filter(|&v| stays(v)).collect();
    let triangles: Vec<_> = lattice.triangles().iter().copied().filter(|t| stays(t[0])).collect();
    Ok(lattice.subset(&kept, triangles)?)
}
