//! Marching cubes at a coarser rate, from a lattice alone.
//!
//! The keys of a lattice as extracted tell every crossing of its surface with an edge of the grid: along a row of voxels,
//! from the outside on, each crossing changes sides. So every voxel's side is known without the volume. Every `step`-th
//! voxel along each axis, from the layer outside the volume on, is a corner of a coarse cell. A coarse edge whose ends are
//! on two sides is crossed an odd number of times; the middle crossing is its vertex.
//!
//! An ambiguous face of a coarse cell never joins its inside corners. So both cells at a face agree, no case needs a vertex
//! in a cell's middle, and no triangle has an edge across a face but the face's own arcs: the result is closed and manifold,
//! by the argument of [`crate::extract`]. Thin parts that no coarse voxel hits vanish or come apart, gaps close, components
//! join: it is what marching cubes makes of fewer voxels (thesis, Figure 5.6).

use ivd_core::{ElementKey, Exec, Lattice, LatticeSource, ParamError};
use rayon::prelude::*;

use super::locks::Locks;
use super::measured::Draft;
use super::params::{RefineParams, Target};
use super::refusal::StopReason;
use super::report::Refined;
use crate::Error;
use crate::extract::{PARTED, cell};

/// Refines a lattice as extracted by marching cubes at a coarser rate.
///
/// Level `L` takes every `2ᴸ`-th voxel. For a share or a number of triangles the step is the least, of all whole numbers,
/// that keeps no more; for an error, the largest found within it, no less than the last before the first that exceeds it. Where a
/// step would leave nothing, the last that leaves something is taken.
///
/// # Errors
/// [`Error::Unreachable`] for a lattice that isn't as extracted, [`ivd_core::Error::Param`] for locks, which this method can't keep;
/// [`ivd_core::Error::MemoryLimit`], [`ivd_core::Error::Cancelled`].
pub(super) fn sample(
    lattice: &Lattice,
    params: &RefineParams,
    locks: Locks<'_>,
    exec: &Exec,
) -> Result<Refined, Error> {
    if let Some(&v) = locks.vertices.first() {
        return Err(ParamError::new(
            "locks",
            format!("vertex {v} is locked, and a coarser rate keeps the vertices that it hits"),
            "leave out the locks, or use collapse",
        )
        .into());
    }
    if *lattice.source() == LatticeSource::Foreign {
        return Err(Error::Unreachable {
            asked: "a coarser rate".into(),
            problem: "the lattice is a mesh of another program, whose vertices aren't crossings".into(),
            remedy: "use collapse".into(),
        });
    }
    exec.run(|| {
        let signs = Signs::of(lattice, exec)?;
        let coarse = |step: usize| Coarse::new(lattice, &signs, step);
        let draft = match params.target.get() {
            Target::Level(level) => at_level(lattice, level, coarse, exec)?,
            Target::Ratio(ratio) => {
                let keep = (lattice.triangles().len() as f64 * ratio).round() as usize;
                at_count(lattice, keep, coarse, exec)?
            }
            Target::Count(keep) => at_count(lattice, keep, coarse, exec)?,
            Target::MaxError(mm) => return within(lattice, mm, coarse, exec),
        };
        draft.finished(lattice, f64::INFINITY, exec)
    })
}

fn at_level<'a>(
    lattice: &Lattice,
    level: u8,
    coarse: impl Fn(usize) -> Coarse<'a>,
    exec: &Exec,
) -> Result<Draft, Error> {
    // A step beyond the grid leaves nothing, however far beyond.
    let most = level.min(lattice.grid().dims().iter().map(|n| n + 2).max().unwrap_or(0).ilog2() as u8 + 1);
    for lower in (1..=most).rev() {
        let triangles = coarse(1 << lower).triangles(exec)?;
        if !triangles.is_empty() {
            let mut draft = Draft::of(triangles, lattice, Locks::NONE, 1);
            draft.stopped_by = if lower == level { StopReason::Target } else { StopReason::Vanishing };
            return Ok(draft);
        }
    }
    let reached = level == 0 || lattice.triangles().is_empty();
    Ok(Draft::same(lattice, if reached { StopReason::Target } else { StopReason::Vanishing }))
}

fn at_count<'a>(
    lattice: &Lattice,
    keep: usize,
    coarse: impl Fn(usize) -> Coarse<'a>,
    exec: &Exec,
) -> Result<Draft, Error> {
    if lattice.triangles().len() <= keep {
        return Ok(Draft::same(lattice, StopReason::Target));
    }
    let mut step = 1;
    let stopped_by = loop {
        match coarse(step + 1).count(exec)? {
            0 => break StopReason::Vanishing,
            count => {
                step += 1;
                if count <= keep {
                    break StopReason::Target;
                }
            }
        }
    };
    if step == 1 {
        return Ok(Draft::same(lattice, stopped_by));
    }
    let draft = Draft::of(coarse(step).triangles(exec)?, lattice, Locks::NONE, 1);
    Ok(Draft { stopped_by, ..draft })
}

/// The largest step found to be within an error: none below it that is proven to be within it before the first that isn't.
///
/// A step that is within the error for sure is so by the cheap measure too. So the first step that is beyond by that measure, found by
/// doubling and halving, lies above all steps up to the first that can't be proven; below it the largest that can is taken.
fn within<'a>(
    lattice: &Lattice,
    mm: f64,
    coarse: impl Fn(usize) -> Coarse<'a>,
    exec: &Exec,
) -> Result<Refined, Error> {
    let draft = |step: usize| {
        let triangles = coarse(step).triangles(exec)?;
        let draft = (!triangles.is_empty()).then(|| Draft::of(triangles, lattice, Locks::NONE, 1));
        Ok::<_, Error>(draft.map(|draft| Draft { stopped_by: StopReason::MaxError, ..draft }))
    };
    let may_be = |step: usize| match draft(step)? {
        Some(draft) => Ok::<_, Error>(draft.least(lattice, exec)? <= mm),
        None => Ok(false),
    };
    let (mut within, mut beyond) = (1, 2);
    while may_be(beyond)? {
        (within, beyond) = (beyond, 2 * beyond);
    }
    while beyond - within > 1 {
        let middle = within.midpoint(beyond);
        *if may_be(middle)? { &mut within } else { &mut beyond } = middle;
    }
    for step in (2..=within).rev() {
        if let Some(draft) = draft(step)?
            && let Some(refined) = draft.measured(lattice, f64::INFINITY, mm, exec)?
        {
            return Ok(refined);
        }
    }
    Draft::same(lattice, StopReason::MaxError).finished(lattice, f64::INFINITY, exec)
}

/// Which voxels of the padded grid are inside, a bit each.
struct Signs {
    dims: [usize; 3],
    /// Words of a row along x.
    row: usize,
    words: Vec<u64>,
}

impl Signs {
    /// The sides that a lattice's keys tell along x, if those along y and z tell the same.
    fn of(lattice: &Lattice, exec: &Exec) -> Result<Self, Error> {
        if lattice.level() > 0 {
            return Err(not_as_extracted(&format!(
                "the lattice has been refined to level {}",
                lattice.level()
            )));
        }
        let dims = lattice.grid().dims().map(|n| n + 2);
        let row = dims[0].div_ceil(64);
        let bytes = (8 * row) as u64 * dims[1] as u64 * dims[2] as u64;
        exec.check_memory("the voxels' sides of the surface", bytes)?;
        let mut signs = Self { dims, row, words: vec![0; row * dims[1] * dims[2]] };
        for key in lattice.keys().iter().filter(|k| k.element() < 3) {
            let at = key.padded(lattice.grid().dims());
            let axis = usize::from(key.element());
            if at[axis] + 1 >= dims[axis] {
                return Err(not_as_extracted(&format!("key {} names an edge that leaves the grid", key.0)));
            }
            if axis == 0 {
                let word = signs.word(at);
                signs.words[word] |= 1 << (at[0] % 64);
            }
        }
        signs.words.par_chunks_mut(row).for_each(fill);
        exec.check_cancelled()?;
        signs.check(lattice)?;
        Ok(signs)
    }

    /// The word that holds a voxel's bit.
    fn word(&self, [x, y, z]: [usize; 3]) -> usize {
        x / 64 + self.row * (y + self.dims[1] * z)
    }

    /// Whether a voxel is inside; beyond the grid all are outside.
    fn inside(&self, at: [usize; 3]) -> bool {
        (0..3).all(|a| at[a] < self.dims[a]) && self.words[self.word(at)] >> (at[0] % 64) & 1 == 1
    }

    /// Checks that the border is outside, and that rows along y and z cross where the keys say so, and nowhere else.
    fn check(&self, lattice: &Lattice) -> Result<(), Error> {
        let [nx, ny, nz] = self.dims;
        let border = |y: usize, z: usize| y == 0 || z == 0 || y + 1 == ny || z + 1 == nz;
        let line = |y: usize, z: usize| &self.words[self.word([0, y, z])..][..self.row];
        let open = (0..ny * nz).into_par_iter().find_first(|&i| {
            let (y, z) = (i % ny, i / ny);
            let row = line(y, z);
            // Bits from the last voxel on are the parity of the whole row.
            row[self.row - 1] >> ((nx - 1) % 64) != 0 || border(y, z) && row.iter().any(|&w| w != 0)
        });
        if let Some(i) = open {
            let [y, z] = [i % ny, i / ny].map(|c| c as i64 - 1);
            return Err(not_as_extracted(&format!("the row of voxels at y {y}, z {z} doesn't end outside")));
        }
        let dims = lattice.grid().dims();
        let mut keys = [0_u64; 3];
        for key in lattice.keys().iter().filter(|k| (1..3).contains(&k.element())) {
            let (at, axis) = (key.padded(dims), usize::from(key.element()));
            let mut next = at;
            next[axis] += 1;
            if self.inside(at) == self.inside(next) {
                let [x, y, z] = key.voxel(dims);
                return Err(not_as_extracted(&format!(
                    "both ends of the edge along {} from voxel {x}, {y}, {z}, which the surface crosses, lie on one side",
                    ["x", "y", "z"][axis]
                )));
            }
            keys[axis] += 1;
        }
        for (axis, step) in [(1, [1, 0]), (2, [0, 1])] {
            let changes: u64 = (0..(ny - step[0]) * (nz - step[1]))
                .into_par_iter()
                .map(|i| {
                    let (y, z) = (i % (ny - step[0]), i / (ny - step[0]));
                    let pairs = line(y, z).iter().zip(line(y + step[0], z + step[1]));
                    pairs.map(|(a, b)| u64::from((a ^ b).count_ones())).sum::<u64>()
                })
                .sum();
            if changes != keys[axis] {
                return Err(not_as_extracted(&format!(
                    "voxels change sides {changes} times along {}, and {} vertices say so",
                    ["x", "y", "z"][axis],
                    keys[axis]
                )));
            }
        }
        Ok(())
    }
}

/// Turns a row's crossings into sides: each bit becomes the parity of those below it.
fn fill(row: &mut [u64]) {
    let mut carry = 0;
    for word in row {
        let mut parity = *word;
        for shift in [1, 2, 4, 8, 16, 32] {
            parity ^= parity << shift;
        }
        if carry == 1 {
            parity = !parity;
        }
        *word = parity << 1 | carry;
        carry = parity >> 63;
    }
}

fn not_as_extracted(problem: &str) -> Error {
    Error::Unreachable {
        asked: "a coarser rate".into(),
        problem: format!("its vertices don't tell which voxels are inside, as {problem}"),
        remedy: "extract the lattice anew and sample it first, or use collapse".into(),
    }
}

/// The cells between every `step`-th voxel.
struct Coarse<'a> {
    lattice: &'a Lattice,
    signs: &'a Signs,
    step: usize,
    /// Coarse cells along each axis; the last reach to the grid's last layer or beyond.
    cells: [usize; 3],
    /// Whether the grid is left-handed.
    flip: bool,
}

impl<'a> Coarse<'a> {
    fn new(lattice: &'a Lattice, signs: &'a Signs, step: usize) -> Self {
        let cells = signs.dims.map(|n| (n - 1).div_ceil(step));
        let flip = lattice.grid().linear_part().determinant() < 0.0;
        Self { lattice, signs, step, cells, flip }
    }

    /// Number of triangles.
    fn count(&self, exec: &Exec) -> Result<usize, Error> {
        let count = |z| {
            let mut count = 0;
            if !exec.cancel.is_cancelled() {
                self.layer(z, |_, case| count += PARTED[case].len());
            }
            count
        };
        let count = (0..self.cells[2]).into_par_iter().map(count).sum();
        exec.check_cancelled()?;
        Ok(count)
    }

    /// Triangles between the lattice's vertices.
    fn triangles(&self, exec: &Exec) -> Result<Vec<[u32; 3]>, Error> {
        let triangles = |z| {
            let mut triangles = Vec::new();
            if !exec.cancel.is_cancelled() {
                self.layer(z, |at, case| {
                    for corners in &PARTED[case] {
                        let [a, b, c] = corners.map(|edge| self.vertex(at, edge));
                        triangles.push(if self.flip { [a, c, b] } else { [a, b, c] });
                    }
                });
            }
            triangles
        };
        let layers: Vec<Vec<_>> = (0..self.cells[2]).into_par_iter().map(triangles).collect();
        exec.check_cancelled()?;
        Ok(layers.concat())
    }

    /// Tells the first voxel and the case of every cell of a layer that the surface crosses.
    fn layer(&self, z: usize, mut tell: impl FnMut([usize; 3], usize)) {
        let [nx, ny, _] = self.cells;
        for y in 0..ny {
            for x in 0..nx {
                let at = [x, y, z].map(|c| c * self.step);
                let case = (0..8).fold(0, |case, corner| {
                    let inside = self.signs.inside(self.corner(at, corner));
                    case | usize::from(inside) << corner
                });
                if case != 0 && case != 255 {
                    tell(at, case);
                }
            }
        }
    }

    fn corner(&self, at: [usize; 3], corner: u8) -> [usize; 3] {
        let offset = cell::offset(corner);
        std::array::from_fn(|a| at[a] + self.step * offset[a])
    }

    /// The vertex on an edge of the cell at a voxel: the middle one of its crossings.
    fn vertex(&self, at: [usize; 3], edge: u8) -> u32 {
        let axis = cell::axis(edge);
        let mut from = self.corner(at, cell::EDGES[usize::from(edge)][0]);
        let first = from[axis];
        let crosses = |p: usize| {
            let (mut low, mut high) = (from, from);
            (low[axis], high[axis]) = (p, p + 1);
            self.signs.inside(low) != self.signs.inside(high)
        };
        let crossings = || (first..first + self.step).filter(|&p| crosses(p));
        let middle = crossings().nth(crossings().count() / 2);
        from[axis] = middle.expect("the ends of the edge are on two sides");
        let key = ElementKey::new(self.lattice.grid().dims(), from, axis as u8);
        self.lattice.vertex_at(key).expect("each change of sides has a vertex")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::{ExtractParams, Iso, extract};
    use ivd_core::{Grid, Volume, Voxels};

    /// Every step in turn, each proven, until one isn't within the error: the plain twin.
    fn in_turn(lattice: &Lattice, mm: f64, exec: &Exec) -> usize {
        let signs = Signs::of(lattice, exec).unwrap();
        let mut best = lattice.triangles().len();
        for step in 2.. {
            let triangles = Coarse::new(lattice, &signs, step).triangles(exec).unwrap();
            if triangles.is_empty() {
                break;
            }
            let draft = Draft::of(triangles, lattice, Locks::NONE, 1);
            match draft.measured(lattice, f64::INFINITY, mm, exec).unwrap() {
                Some(refined) => best = refined.lattice.triangles().len(),
                None => break,
            }
        }
        best
    }

    #[test]
    fn within_an_error_no_step_in_turn_is_coarser() {
        let n = 32;
        let exec = Exec::default();
        let gyroid = |p: [f64; 3]| {
            let (s, c) = (p.map(|v| (0.2 * v).sin()), p.map(|v| (0.2 * v).cos()));
            s[0] * c[1] + s[1] * c[2] + s[2] * c[0]
        };
        let ball = |p: [f64; 3]| 13.0 - (p[0] - 15.6).hypot(p[1] - 15.3).hypot(p[2] - 15.9);
        for (name, level) in [("gyroid", &gyroid as &dyn Fn([f64; 3]) -> f64), ("ball", &ball)] {
            let grid = Grid::with_spacing([n; 3], [1.0; 3]).unwrap();
            let voxels: Vec<f32> =
                (0..grid.len()).map(|i| level(grid.index(i).0.map(|c| c as f64)) as f32).collect();
            let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
            let lattice =
                extract(&volume, None, &ExtractParams { iso: Iso::Value(0.0) }, &exec).unwrap().lattice;
            for mm in [0.0, 0.3, 1.0, 4.0] {
                let plain = in_turn(&lattice, mm, &exec);
                let params = RefineParams { target: Target::MaxError(mm).into(), ..RefineParams::default() };
                let out = sample(&lattice, &params, Locks::NONE, &exec).unwrap();
                let found = out.lattice.triangles().len();
                assert!(found <= plain && out.max_error_mm <= mm, "{name} within {mm} mm");
            }
        }
    }

    #[test]
    fn a_row_is_inside_after_an_odd_number_of_crossings() {
        let mut row = vec![0_u64; 3];
        let crossings = [3_usize, 10, 62, 63, 64, 130, 170, 171];
        for c in crossings {
            row[c / 64] |= 1 << (c % 64);
        }
        fill(&mut row);
        for p in 0..192 {
            let odd = crossings.iter().filter(|&&c| c < p).count() % 2 == 1;
            assert_eq!(row[p / 64] >> (p % 64) & 1 == 1, odd, "voxel {p}");
        }
    }
}
