use ivd_core::{CoarseLevel, Exec, Lattice, ParamError};

use super::locks::Locks;
use super::params::{Method, RefineParams, Target};
use super::refine;
use super::report::Refined;
use super::small_parts::SmallParts;
use crate::Error;

/// Refines a lattice to several levels, each from the one before.
///
/// The vertices of every level are a subset of those of the level before. The errors of a [`Refined`] are those of its
/// own step; its lattice's [`max_error_mm`](Lattice::max_error_mm) is the sum from the input on, and so bounds the
/// distance from it, both ways. A level that can't be reached is as near as it gets, and the next goes on from there.
///
/// - `params`: all but the target is used.
/// - `levels`: ascending, each counted from the input: level `L` keeps 4⁻ᴸ of its vertices. Merging, Loop's scheme, and the others
///   where there are specks, count from the level before, so that what they keep too many or too few of adds up.
/// - `locks`: vertices of the input that stay in all levels.
///
/// # Errors
/// [`ivd_core::Error::Param`] for levels that don't ascend, for [`Method::Sample`], whose levels aren't nested, and for locks where
/// clustering may leave them alone; otherwise as [`refine`].
pub fn chain(
    lattice: &Lattice,
    params: &RefineParams,
    levels: &[u8],
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Vec<Refined>, Error> {
    if let Some(at) = levels.windows(2).position(|w| w[0] >= w[1]) {
        let problem = format!("{} follows {}", levels[at + 1], levels[at]);
        return Err(ParamError::new("chain", problem, "give levels in ascending order, each once").into());
    }
    if params.method == Method::Sample {
        let problem = "the vertices of a coarser sampling aren't among those of a finer one".to_owned();
        return Err(ParamError::new("method", problem, "use another method for a chain").into());
    }
    if params.method == Method::Merge && params.allow_topology && !locks.vertices.is_empty() {
        let problem = "a locked vertex may be left without a triangle, which no level can say".to_owned();
        return Err(ParamError::new("lock", problem, "leave out the locks or allow_topology").into());
    }
    locks.check(lattice)?;
    let keys: Vec<_> = locks.vertices.iter().map(|&v| lattice.keys().get(v as usize)).collect();
    let mut chain: Vec<Refined> = Vec::with_capacity(levels.len());
    let mut last_level = 0;
    for &level in levels {
        let last = chain.last().map_or(lattice, |refined| &refined.lattice);
        let step = RefineParams { target: Target::Level(level - last_level).into(), ..params.clone() };
        let counts = matches!(params.method, Method::Collapse | Method::Decimate);
        let target = if counts && SmallParts::of(last, &step).is_none() {
            count_for(lattice, last, level).into()
        } else {
            step.target
        };
        let locked: Vec<u32> = keys.iter().flatten().filter_map(|key| last.vertex_at(**key)).collect();
        let params = RefineParams { target, ..params.clone() };
        let mut step = refine(last, &params, Locks { vertices: &locked }, exec)?;
        let between = levels_between(lattice, &step.lattice);
        step.lattice = step.lattice.with_level(lattice.level().saturating_add(between));
        chain.push(step);
        last_level = level;
    }
    Ok(chain)
}

/// Triangles to keep so that as many vertices of the chain's input are left as a level has.
fn count_for(input: &Lattice, last: &Lattice, level: u8) -> Target {
    let keep = (input.keys().len() as f64 * 0.25_f64.powi(i32::from(level))).round() as usize;
    // Each vertex takes two triangles with it.
    Target::Count(last.triangles().len().saturating_sub(2 * last.keys().len().saturating_sub(keep)))
}

fn levels_between(input: &Lattice, refined: &Lattice) -> u8 {
    let times = input.keys().len() as f64 / refined.keys().len() as f64;
    if times.is_finite() { times.log(4.0).round() as u8 } else { 0 }
}

/// A lattice with the levels of [`chain`] as its [`coarser`](Lattice::coarser) ones, in the numbers of its vertices.
///
/// # Errors
/// [`ivd_core::Error::Inconsistent`] for a level with a vertex that the one before hasn't, or without one that no
/// triangle of the finest names: those belong to all levels.
pub fn with_levels(finest: Lattice, levels: &[Refined]) -> Result<Lattice, Error> {
    let bad = |problem: String| ivd_core::Error::Inconsistent { what: "chain of lattices", problem };
    let mut coarser = Vec::with_capacity(levels.len());
    let mut last: Option<&Lattice> = None;
    for (i, Refined { lattice, .. }) in levels.iter().enumerate() {
        if lattice.grid() != finest.grid() {
            return Err(bad(format!("level {} lies on another grid", i + 1)).into());
        }
        let before = last.unwrap_or(&finest);
        if let Some(v) = (0..lattice.keys().len()).find(|&v| !shares(before, lattice, v)) {
            return Err(bad(format!("vertex {v} of level {} isn't one of the level before", i + 1)).into());
        }
        let number = |v: u32| finest.vertex_at(lattice.keys()[v as usize]).expect("levels are subsets");
        let triangles: Vec<_> = lattice.triangles().iter().map(|t| t.map(number)).collect();
        let (level, max_error_mm) = (lattice.level(), lattice.max_error_mm());
        coarser.push(CoarseLevel { triangles: triangles.into(), level, max_error_mm });
        last = Some(lattice);
    }
    let whole = finest.with_coarser(coarser)?;
    for (i, Refined { lattice, .. }) in levels.iter().enumerate() {
        let told = whole.vertices_at_level(i + 1).len();
        if told != lattice.keys().len() {
            let problem =
                format!("level {} has {} vertices, its triangles tell {told}", i + 1, lattice.keys().len());
            return Err(bad(problem).into());
        }
    }
    Ok(whole)
}

/// Whether a vertex of `part` is one of `whole`, address and place alike.
fn shares(whole: &Lattice, part: &Lattice, v: usize) -> bool {
    whole.vertex_at(part.keys()[v]).is_some_and(|w| whole.places()[w as usize] == part.places()[v])
}
