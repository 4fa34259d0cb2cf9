//! Lattices from other programs' meshes.
//!
//! A mesh file knows no grid. [`lattice`] puts a closed triangle mesh on one: coincident vertices are welded, triangles turned
//! so that all are counter-clockwise from outside, and every vertex gets an address near it. Its position is kept to 10⁻⁶ of a
//! voxel. What can't be a lattice (open borders, edges of three triangles) is an error that says how often and where.
//!
//! **Addresses.** A vertex on a grid edge (within 5 · 10⁻⁷ of a voxel) gets that edge, another on a face of the cells that face,
//! any other its cell. Where several vertices share a cell, an element stands for the *nearest free* one of the voxel: its name
//! then tells where the vertex is found, not where it lies; the place does. A file that we wrote carries its addresses, and on
//! its own grid it keeps them.
//!
//! ```
//! use ivd_core::{Exec, Grid, Mesh};
//! use ivd_lattice::import::{ImportParams, lattice};
//!
//! let positions = [[1.0; 3], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 1.0, 2.0]].map(Into::into).to_vec();
//! let triangles = vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]; // two of them inside out
//! let mesh = Mesh { positions, triangles, addresses: None };
//! let grid = Grid::with_spacing([4; 3], [1.0; 3])?;
//! let imported = lattice(&mesh, &grid, &ImportParams::default(), &Exec::default())?;
//! assert_eq!((imported.lattice.keys().len(), imported.flipped), (4, 2));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod address;
mod boxes;
mod nesting;
mod orient;
mod part;
mod refusal;
mod weld;

use ivd_core::{Exec, Grid, Lattice, Mesh, ParamError, counted};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::figures::link::{Link, LinkCounts};
use crate::figures::stars::Stars;
use refusal::{place, unfit};

/// How a mesh is taken.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImportParams {
    /// Vertices no further apart than this are one (mm); at 0 those at exactly one place. Files without shared vertices
    /// (STL) need no more if their writer rounded all corners alike.
    pub weld: f64,
    /// Takes a mesh with open borders, edges of more than two triangles, bow ties or one side alone. Its inside has no
    /// meaning then.
    pub allow_open: bool,
}

impl ImportParams {
    /// Checks that the tolerance is a length.
    ///
    /// # Errors
    /// [`ParamError`] names `weld` and what is wrong with it.
    pub fn check(&self) -> Result<(), ParamError> {
        if self.weld.is_finite() && self.weld >= 0.0 {
            return Ok(());
        }
        let problem = format!("{} mm is not a distance", self.weld);
        Err(ParamError::new("weld", problem, "give 0 or a small distance in mm"))
    }
}

/// What became of the addresses in a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Addresses {
    /// The mesh had none.
    Absent,
    /// They fit the positions on this grid, and the vertices keep them.
    Kept,
    /// They don't: another grid, or a deformed mesh. The vertices got new ones.
    Replaced,
}

/// A lattice made of a mesh, and what had to be done to it.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedMesh {
    /// The lattice, of the source [`ivd_core::LatticeSource::Foreign`].
    pub lattice: Lattice,
    /// Whether the mesh's own addresses were taken.
    pub addresses: Addresses,
    /// Vertices of the mesh.
    pub vertices_in: u64,
    /// Triangles of the mesh.
    pub triangles_in: u64,
    /// Vertices that were one with another.
    pub welded: u64,
    /// Vertices dropped because no triangle named them.
    pub unused: u64,
    /// Triangles dropped because two of their corners are one vertex.
    pub degenerate: u64,
    /// Triangles dropped because another has the same corners.
    pub duplicate: u64,
    /// Triangles turned over.
    pub flipped: u64,
    /// Edges with one triangle; 0 unless allowed.
    pub boundary_edges: u64,
    /// Edges with more than two triangles; 0 unless allowed.
    pub non_manifold_edges: u64,
    /// Vertices in which fans of triangles meet that nothing else joins; 0 unless allowed.
    pub bow_tie_vertices: u64,
    /// Edges whose triangles can't be turned to agree (a Möbius strip has some); 0 unless allowed.
    pub one_sided_edges: u64,
    /// Largest distance between a vertex of the mesh that was kept and its place in the lattice (mm).
    pub moved_mm: f64,
}

/// Puts a mesh on a grid.
///
/// Vertices come back within 10⁻⁶ of a voxel of where the mesh has them. (Beyond that only the rounding of the mesh's own
/// coordinates counts: 10⁶ mm from 0 that is 10⁻¹⁰ mm.) Triangles keep their order, those that are dropped excepted. Closed parts
/// are turned counter-clockwise seen from outside, those that lie wholly in an odd number of others (cavities) the other way
/// round; open parts as most of their triangles are. Addresses that the mesh carries are kept if all of them fit its positions on
/// this grid; such a mesh isn't welded.
///
/// # Errors
/// [`ivd_core::Error::Param`] for a bad tolerance, [`Error::Unfit`] for indices out of range, positions that aren't finite or lie outside
/// the padded grid, a mesh that isn't closed, and a voxel with more than 8 vertices; [`ivd_core::Error::MemoryLimit`],
/// [`ivd_core::Error::Cancelled`].
pub fn lattice(mesh: &Mesh, grid: &Grid, params: &ImportParams, exec: &Exec) -> Result<ImportedMesh, Error> {
    params.check()?;
    check(mesh)?;
    let bytes = 128 * mesh.positions.len() as u64 + 128 * mesh.triangles.len() as u64;
    exec.check_memory("the lattice of a mesh", bytes)?;
    exec.run(|| build(mesh, grid, params, exec))
}

fn check(mesh: &Mesh) -> Result<(), Error> {
    let n = mesh.positions.len();
    if u32::try_from(n).is_err() {
        return Err(Error::TooManyVertices { vertices: n as u64 });
    }
    if mesh.triangles.len() > (u32::MAX / 3) as usize {
        return Err(unfit(
            format!("{} triangles, 2³² / 3 are the most", mesh.triangles.len()),
            "refine the mesh first",
        ));
    }
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= n)) {
        return Err(unfit(format!("triangle {t} names a vertex beyond {n}"), "repair the mesh"));
    }
    if let Some(v) = mesh.positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(unfit(
            format!("vertex {v} is at {:?}, not finite", mesh.positions[v]),
            "repair the mesh",
        ));
    }
    Ok(())
}

fn build(mesh: &Mesh, grid: &Grid, params: &ImportParams, exec: &Exec) -> Result<ImportedMesh, Error> {
    address::check_inside(mesh, grid)?;
    let own = address::kept(mesh, grid);
    let addresses = match (&mesh.addresses, &own) {
        (None, _) => Addresses::Absent,
        (Some(_), Some(_)) => Addresses::Kept,
        (Some(_), None) => Addresses::Replaced,
    };
    exec.check_cancelled()?;
    let all = 0..mesh.positions.len() as u32;
    let (onto, welded) = if own.is_some() {
        (all.collect(), 0)
    } else {
        weld::onto(&mesh.positions, params.weld, grid, exec)?
    };
    let mut cleaned = weld::clean(&mesh.triangles, &onto, exec)?;
    let defects = defects(mesh, &cleaned.triangles, params.allow_open, exec)?;
    let turned = orient::turn(&mesh.positions, &mut cleaned.triangles, exec)?;
    if turned.one_sided_edges > 0 && !params.allow_open {
        let problem = format!(
            "it has one side alone: {} triangles that can't agree, the first at {}",
            counted(turned.one_sided_edges, "edge has", "edges have"),
            place(&mesh.positions[turned.first_one_sided as usize])
        );
        return Err(unfit(problem, "repair it, or allow open meshes"));
    }
    exec.check_cancelled()?;
    let kept = weld::kept(mesh.positions.len(), &onto, own.is_none().then_some(&cleaned.triangles[..]));
    let addressed = match own {
        Some(own) => own,
        None => address::assign(&kept, mesh, grid)?,
    };
    let unused = mesh.positions.len() as u64 - welded - kept.len() as u64;
    let (lattice, moved_mm) = assemble(mesh, grid, &kept, &addressed, &cleaned.triangles)?;
    Ok(ImportedMesh {
        lattice,
        addresses,
        vertices_in: mesh.positions.len() as u64,
        triangles_in: mesh.triangles.len() as u64,
        welded,
        unused,
        degenerate: cleaned.degenerate,
        duplicate: cleaned.duplicate,
        flipped: turned.flipped,
        boundary_edges: defects.boundary_edges,
        non_manifold_edges: defects.non_manifold_edges,
        bow_tie_vertices: defects.bow_tie_vertices,
        one_sided_edges: turned.one_sided_edges,
        moved_mm,
    })
}

/// Counts what keeps a mesh from being closed and manifold; an error unless that is allowed.
fn defects(mesh: &Mesh, triangles: &[[u32; 3]], allowed: bool, exec: &Exec) -> Result<LinkCounts, Error> {
    let stars = Stars::new(mesh.positions.len(), triangles);
    let (mut link, mut sum, mut first) = (Link::default(), LinkCounts::default(), [None; 3]);
    for v in 0..mesh.positions.len() {
        if v % (1 << 16) == 0 {
            exec.check_cancelled()?;
        }
        let counts = link.count(v as u32, &stars, triangles);
        sum += counts;
        let found = [counts.boundary_edges, counts.non_manifold_edges, counts.bow_tie_vertices];
        for (first, found) in first.iter_mut().zip(found) {
            if found > 0 {
                first.get_or_insert(v);
            }
        }
    }
    if allowed {
        return Ok(sum);
    }
    let kinds = [
        (sum.boundary_edges, "edges with one triangle (open borders)", "close its holes"),
        (sum.non_manifold_edges, "edges with more than two triangles", "part the surfaces that touch there"),
        (
            sum.bow_tie_vertices,
            "vertices in which parts touch (bow ties)",
            "part the surfaces that touch there",
        ),
    ];
    for ((count, what, remedy), first) in kinds.into_iter().zip(first) {
        if let Some(first) = first {
            let problem = format!("it has {count} {what}, the first at {}", place(&mesh.positions[first]));
            let weld = "weld its vertices with a tolerance";
            return Err(unfit(problem, &format!("{remedy}, {weld}, or allow open meshes")));
        }
    }
    Ok(sum)
}

/// The lattice of the vertices `kept` of the mesh, and how far the furthest was moved (mm).
fn assemble(
    mesh: &Mesh,
    grid: &Grid,
    kept: &[u32],
    addressed: &[address::Addressed],
    triangles: &[[u32; 3]],
) -> Result<(Lattice, f64), Error> {
    let mut order: Vec<u32> = (0..kept.len() as u32).collect();
    order.sort_unstable_by_key(|&i| addressed[i as usize].key);
    let mut rank = vec![u32::MAX; mesh.positions.len()];
    for (new, &i) in order.iter().enumerate() {
        rank[kept[i as usize] as usize] = new as u32;
    }
    let lattice = Lattice::new(
        grid.clone(),
        order.iter().map(|&i| addressed[i as usize].key).collect(),
        order.iter().map(|&i| addressed[i as usize].place).collect(),
        triangles.iter().map(|t| t.map(|v| rank[v as usize])).collect(),
    )?;
    let moved = order
        .iter()
        .enumerate()
        .map(|(new, &i)| (lattice.world(new).0 - mesh.positions[kept[i as usize] as usize]).norm());
    let moved = moved.fold(0.0, f64::max);
    Ok((lattice, moved))
}
