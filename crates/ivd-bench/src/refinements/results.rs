use ivd_lattice::refine::StopReason;
use serde::Serialize;

use super::rows::{RefinementRow, Shape};

/// Refinements of lattices by every method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RefinementBench {
    /// Version of this layout: 1.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Worker threads.
    pub threads: usize,
    /// Times that every refinement was run.
    pub repeats: usize,
    /// One for each lattice.
    pub lattices: Vec<LatticeBench>,
}

/// Refinements of one lattice.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LatticeBench {
    /// The lattice, in words.
    pub input: String,
    /// Edge of its voxels (mm).
    pub voxel_mm: f64,
    /// Vertices beside an edge where the surface turns by more than 40°.
    pub crease_vertices: usize,
    /// The lattice's own counts.
    pub shape: Shape,
    /// Every method at every share, share by share.
    pub shares: Vec<RefinementRow>,
    /// Inverse subdivision, decimation and the program's default at the counts of the inverse subdivision's levels: three
    /// rows a level (table 5.1).
    pub same_counts: Vec<RefinementRow>,
    /// How far methods go (table 5.2).
    pub reach: Vec<Reach>,
    /// Levels of the program's default method, the lattice itself first (figure 5.10).
    pub levels: Vec<RefinementRow>,
    /// What the thesis concludes, and what was found here.
    pub claims: Vec<Claim>,
}

/// How far a method goes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reach {
    /// The method.
    pub method: String,
    /// Vertices at levels 1, 2, …; none where the level can't be reached.
    pub levels: Vec<Option<usize>>,
    /// Fewest vertices, asked for none or for any of the levels.
    pub least: usize,
    /// What stopped it where it was asked for none.
    pub stopped_by: StopReason,
    /// Whether what is left has as many parts and handles as the lattice.
    pub same_topology: bool,
}

/// A conclusion of the thesis, and whether it holds here.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Claim {
    /// Where it stands.
    pub section: String,
    /// What it says.
    pub says: String,
    /// How many comparisons bear it out, and of how many.
    pub holds: [usize; 2],
    /// The numbers.
    pub found: String,
}

impl Claim {
    pub(super) fn new(section: &str, says: &str, holds: [usize; 2], found: String) -> Self {
        Self { section: section.to_owned(), says: says.to_owned(), holds, found }
    }

    /// Whether it holds, in words.
    pub fn verdict(&self) -> String {
        match self.holds {
            [_, 0] => "nothing to compare".to_owned(),
            [0, _] => "doesn't hold here".to_owned(),
            [a, b] if a == b => "holds".to_owned(),
            [a, b] => format!("holds in {a} of {b}"),
        }
    }
}
