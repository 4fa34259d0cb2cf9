use ivd_core::{Exec, Lattice, ParamError};

use super::locks::Locks;
use super::params::{Method, RefineParams, Target};
use super::refine;
use super::report::Refined;
use crate::Error;

/// Refines a lattice to several levels, each from the one before.
///
/// The vertices of every level are a subset of those of the level before. The errors of a [`Refined`] are those of its
/// own step; its lattice's [`max_error_mm`](Lattice::max_error_mm) is the sum from the input on, and so bounds the
/// distance from it, both ways. A level that can't be reached is as near as it gets, and the next goes on from there.
///
/// - `params`: all but the target is used.
/// - `levels`: ascending, each counted from the input: level `L` keeps 4⁻ᴸ of its vertices.
/// - `locks`: vertices of the input that stay in all levels.
///
/// # Errors
/// [`Error::Param`] for levels that don't ascend; otherwise as [`refine`].
pub fn chain(
    lattice: &Lattice,
    params: &RefineParams,
    levels: &[u8],
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Vec<Refined>, Error> {
    if let Some(w) = levels.windows(2).find(|w| w[0] >= w[1]) {
        let problem = format!("{} follows {}", w[1], w[0]);
        return Err(ParamError::new("levels", problem, "give levels in ascending order, each once").into());
    }
    locks.check(lattice)?;
    let keys: Vec<_> = locks.vertices.iter().map(|&v| lattice.keys.get(v as usize)).collect();
    let mut chain: Vec<Refined> = Vec::with_capacity(levels.len());
    let mut last_level = 0;
    for &level in levels {
        let last = chain.last().map_or(lattice, |refined| &refined.lattice);
        let target = match params.method {
            Method::Collapse | Method::Decimate => count_for(lattice, last, level),
            Method::Loop | Method::Merge | Method::Sample => Target::Level(level - last_level),
        };
        let locked: Vec<u32> = keys.iter().flatten().filter_map(|key| last.vertex_at(**key)).collect();
        let params = RefineParams { target, ..params.clone() };
        let mut step = refine(last, &params, Locks { vertices: &locked }, exec)?;
        step.lattice.level = lattice.level.saturating_add(levels_between(lattice, &step.lattice));
        chain.push(step);
        last_level = level;
    }
    Ok(chain)
}

/// Triangles to keep so that as many vertices of the chain's input are left as a level has.
fn count_for(input: &Lattice, last: &Lattice, level: u8) -> Target {
    let keep = (input.keys.len() as f64 * 0.25_f64.powi(i32::from(level))).round() as usize;
    // Each vertex takes two triangles with it.
    Target::Count(last.triangles.len().saturating_sub(2 * last.keys.len().saturating_sub(keep)))
}

fn levels_between(input: &Lattice, refined: &Lattice) -> u8 {
    let times = input.keys.len() as f64 / refined.keys.len() as f64;
    if times.is_finite() { times.log(4.0).round() as u8 } else { 0 }
}

/// A lattice with coarser levels of it on the same vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// The lattice whose vertices all levels share.
    pub finest: Lattice,
    /// Coarser levels, each on a subset of the vertices of the one before.
    pub coarser: Vec<Coarser>,
}

/// A level of a [`Chain`].
#[derive(Debug, Clone, PartialEq)]
pub struct Coarser {
    /// Vertex indices of each triangle, in the numbers of the finest level.
    pub triangles: Vec<[u32; 3]>,
    /// As in [`Lattice`].
    pub level: u8,
    /// Bound on the distance to the extracted lattice (mm).
    pub max_error_mm: f64,
}

impl Chain {
    /// Brings the levels of [`chain`] to the numbers of the finest.
    ///
    /// # Errors
    /// [`ivd_core::Error::Inconsistent`] for a level with a vertex that the one before hasn't, or without one that no
    /// triangle of the finest names: those belong to all levels.
    pub fn new(finest: Lattice, levels: &[Refined]) -> Result<Self, Error> {
        let mut chain = Self { coarser: Vec::with_capacity(levels.len()), finest };
        let mut last: Option<&Lattice> = None;
        for (i, Refined { lattice, .. }) in levels.iter().enumerate() {
            let bad = |problem: String| ivd_core::Error::Inconsistent { what: "chain of lattices", problem };
            lattice.check()?;
            let before = last.unwrap_or(&chain.finest);
            if let Some(v) = (0..lattice.keys.len()).find(|&v| !shares(before, lattice, v)) {
                return Err(
                    bad(format!("vertex {v} of level {} isn't one of the level before", i + 1)).into()
                );
            }
            let number =
                |v: u32| chain.finest.vertex_at(lattice.keys[v as usize]).expect("levels are subsets");
            let triangles = lattice.triangles.iter().map(|t| t.map(number)).collect();
            let (level, max_error_mm) = (lattice.level, lattice.max_error_mm);
            chain.coarser.push(Coarser { triangles, level, max_error_mm });
            let told = chain.vertices(i + 1).len();
            if told != lattice.keys.len() {
                let problem =
                    format!("level {} has {} vertices, its triangles tell {told}", i + 1, lattice.keys.len());
                return Err(bad(problem).into());
            }
            last = Some(lattice);
        }
        Ok(chain)
    }

    /// Number of levels, the finest included.
    pub fn levels(&self) -> usize {
        self.coarser.len() + 1
    }

    /// A level as a lattice of its own, 0 the finest; `None` beyond the last.
    pub fn lattice(&self, level: usize) -> Option<Lattice> {
        let Some(at) = level.checked_sub(1) else { return Some(self.finest.clone()) };
        let coarser = self.coarser.get(at)?;
        let kept = self.vertices(level);
        let mut rank = vec![u32::MAX; self.finest.keys.len()];
        for (new, &old) in kept.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        Some(Lattice {
            grid: self.finest.grid.clone(),
            source: self.finest.source.clone(),
            keys: kept.iter().map(|&v| self.finest.keys[v as usize]).collect(),
            places: kept.iter().map(|&v| self.finest.places[v as usize]).collect(),
            triangles: coarser.triangles.iter().map(|t| t.map(|v| rank[v as usize])).collect(),
            level: coarser.level,
            max_error_mm: coarser.max_error_mm,
        })
    }

    /// Vertices of a level, in the numbers of the finest, ascending: those that its triangles name, and those that no
    /// triangle of the finest names.
    fn vertices(&self, level: usize) -> Vec<u32> {
        let mut named = vec![true; self.finest.keys.len()];
        if let Some(coarser) = level.checked_sub(1).map(|at| &self.coarser[at]) {
            for &v in self.finest.triangles.as_flattened() {
                named[v as usize] = false;
            }
            for &v in coarser.triangles.as_flattened() {
                named[v as usize] = true;
            }
        }
        (0..named.len() as u32).filter(|&v| named[v as usize]).collect()
    }
}

/// Whether a vertex of `part` is one of `whole`, address and place alike.
fn shares(whole: &Lattice, part: &Lattice, v: usize) -> bool {
    whole.vertex_at(part.keys[v]).is_some_and(|w| whole.places[w as usize] == part.places[v])
}
