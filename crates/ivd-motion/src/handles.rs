//! Handles: which vertices of a lattice are told to move, are pulled or stay, as every solver takes them.

use ivd_core::{Error, Grid, Lattice, ParamError, VoxelCoord, World};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A pick takes a vertex at most this many voxel diagonals away.
const PICK_DIAGONALS: f64 = 10.0;

/// Which vertex is meant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Anchor {
    /// The vertex nearest to a point [mm, world RAS], at most ten voxel diagonals away.
    NearestTo([f64; 3]),
    /// The vertex of this number.
    Vertex(u32),
}

/// What a handle does to its vertex.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// Moves it by a vector [mm, RAS], exactly.
    Move([f64; 3]),
    /// Pulls it with a force [mN, RAS]; how far it goes is physics.
    Force([f64; 3]),
}

/// A vertex that is moved or pulled, and how far round it the lattice follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Handle {
    /// The target vertex.
    pub at: Anchor,
    /// What happens to it.
    pub action: Action,
    /// Radius [mm, rest space], > 0: beyond it nothing moves.
    pub radius: f64,
}

/// Vertices that stay where they are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pin {
    /// The vertex in the middle.
    pub at: Anchor,
    /// Radius [mm, rest space], ≥ 0, of the vertices that stay; 0: this vertex alone.
    pub radius: f64,
}

impl Handle {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_at(&self.at)?;
        let (field, vector) = match &self.action {
            Action::Move(vector) => ("move", vector),
            Action::Force(vector) => ("force", vector),
        };
        if !vector.iter().all(|c| c.is_finite() && c.abs() <= 1e100) {
            return Err(ParamError::new(field, format!("{vector:?}"), "give three finite numbers"));
        }
        if !(self.radius > 0.0 && self.radius <= 1e100) {
            return Err(ParamError::new("radius", format!("{} mm", self.radius), "use a positive length"));
        }
        Ok(())
    }

    /// How far it moves its vertex [mm, RAS]; 0 where it pulls.
    pub(crate) fn way(&self) -> [f64; 3] {
        match self.action {
            Action::Move(by) => by,
            Action::Force(_) => [0.0; 3],
        }
    }
}

impl Pin {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        check_at(&self.at)?;
        if !(0.0..=1e100).contains(&self.radius) {
            return Err(ParamError::new(
                "radius",
                format!("{} mm", self.radius),
                "use a length of at least 0",
            ));
        }
        Ok(())
    }
}

fn check_at(at: &Anchor) -> Result<(), ParamError> {
    match at {
        Anchor::NearestTo(point) if !point.iter().all(|c| c.is_finite()) => {
            Err(ParamError::new("pick", format!("{point:?}"), "give three finite numbers in mm"))
        }
        _ => Ok(()),
    }
}

/// The vertex that is meant.
pub(crate) fn resolve(
    what: &'static str,
    at: &Anchor,
    lattice: &Lattice,
    rest: &[Vector3<f64>],
) -> Result<usize, Error> {
    let point = match *at {
        Anchor::Vertex(v) if (v as usize) < rest.len() => return Ok(v as usize),
        Anchor::Vertex(v) => {
            let problem = format!("{v} where the lattice has {} vertices", rest.len());
            return Err(
                ParamError::new("vertex", problem, "count from 0 in the lattice that is deformed").into()
            );
        }
        Anchor::NearestTo(point) => Vector3::from(point) - Vector3::from(lattice.grid().origin()),
    };
    let nearest = (0..rest.len())
        .into_par_iter()
        .map(|v| ((rest[v] - point).norm(), v))
        .reduce(|| (f64::INFINITY, usize::MAX), |a, b| if (b.0, b.1) < (a.0, a.1) { b } else { a });
    let limit = PICK_DIAGONALS * lattice.grid().voxel_diagonal();
    if nearest.0 <= limit {
        return Ok(nearest.1);
    }
    let problem = if rest.is_empty() {
        "the lattice has no vertex".into()
    } else {
        let world: [f64; 3] = lattice.world(nearest.1).0.into();
        let point: [f64; 3] = (point + Vector3::from(lattice.grid().origin())).into();
        format!(
            "the vertex nearest to {point:.3?} mm, at {world:.3?} mm, is {:.3} mm away, further than {limit:.3} mm \
             (ten voxel diagonals){}",
            nearest.0,
            lattice.grid().told_outside(point).map_or_else(String::new, |told| format!("; {told}"))
        )
    };
    Err(Error::Mismatch {
        what,
        problem,
        remedy: "pick a place on the lattice, such as that one; `ivd render --picks` tells the place of a pixel",
    })
}

/// Refuses points that lie so far outside a volume that no vertex in it is near enough.
///
/// # Errors
/// A point further than ten voxel diagonals from the volume.
pub fn check_within<'a>(
    grid: &Grid,
    what: &'static str,
    places: impl IntoIterator<Item = &'a Anchor>,
) -> Result<(), Error> {
    let limit = PICK_DIAGONALS * grid.voxel_diagonal();
    for at in places {
        let Anchor::NearestTo(point) = *at else { continue };
        let VoxelCoord(voxel) = grid.voxel(World(point.into()));
        let dims = grid.dims();
        let inside = Vector3::from_fn(|a, _| voxel[a].clamp(-0.5, dims[a] as f64 - 0.5));
        let away = (grid.linear_part() * (voxel - inside)).norm();
        if away <= limit {
            continue;
        }
        let told = grid.told_outside(point).map_or_else(String::new, |told| format!("; {told}"));
        return Err(Error::Mismatch {
            what,
            problem: format!(
                "{point:.3?} mm lies {away:.3} mm outside the volume, further than {limit:.3} mm (ten voxel diagonals){told}"
            ),
            remedy: "pick a point of what is deformed; `ivd info` tells where the volume is",
        });
    }
    Ok(())
}

/// The vertex that a place was found at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// Point that was asked for (mm, world RAS); `None` where the vertex was named by its number.
    pub asked: Option<[f64; 3]>,
    /// The vertex.
    pub vertex: usize,
    /// Where that is at rest (mm, world RAS).
    pub at: [f64; 3],
}

impl Pick {
    /// How far the vertex is from what was asked for (mm).
    pub fn away(&self) -> f64 {
        self.asked.map_or(0.0, |asked| (Vector3::from(asked) - Vector3::from(self.at)).norm())
    }
}

/// The vertices at which places are found, in their order.
///
/// # Errors
/// A vertex that the lattice doesn't have; a point further than ten voxel diagonals from any.
pub fn find_picks<'a>(
    lattice: &Lattice,
    what: &'static str,
    places: impl IntoIterator<Item = &'a Anchor>,
) -> Result<Vec<Pick>, Error> {
    let mut places = places.into_iter().peekable();
    if places.peek().is_none() {
        return Ok(Vec::new());
    }
    let rest = lattice.local_positions();
    let found = |at: &Anchor| {
        let vertex = resolve(what, at, lattice, &rest)?;
        let asked = match at {
            Anchor::NearestTo(point) => Some(*point),
            Anchor::Vertex(_) => None,
        };
        Ok(Pick { asked, vertex, at: lattice.world(vertex).0.into() })
    };
    places.map(found).collect()
}

/// What is told of a handle on something that can't be moved.
pub(crate) fn lies_on_rigid(handle: usize) -> Error {
    Error::Mismatch {
        what: "handle",
        problem: format!("handle {handle} lies on what is rigid and stays"),
        remedy: "pick soft matter, or move the bone (rigid)",
    }
}

/// Handles and fixed vertices by themselves.
pub(crate) fn check_pull(handles: &[Handle], fixed: &[Pin]) -> Result<(), Error> {
    handles.iter().try_for_each(Handle::check)?;
    fixed.iter().try_for_each(Pin::check)?;
    Ok(())
}

/// For every vertex, whether a pin holds it.
pub(crate) fn pinned(lattice: &Lattice, rest: &[Vector3<f64>], fixed: &[Pin]) -> Result<Vec<bool>, Error> {
    let mut pinned = vec![false; rest.len()];
    for pin in fixed {
        let middle = resolve("fixed vertex", &pin.at, lattice, rest)?;
        pinned[middle] = true;
        let inside = |at: &Vector3<f64>| (at - rest[middle]).norm() <= pin.radius;
        pinned.iter_mut().zip(rest).for_each(|(pinned, at)| *pinned |= inside(at));
    }
    Ok(pinned)
}

/// The target vertex of each handle; two on one vertex must agree. `needed`: there must be a handle.
pub(crate) fn find_targets(
    lattice: &Lattice,
    rest: &[Vector3<f64>],
    handles: &[Handle],
    needed: bool,
) -> Result<Vec<usize>, Error> {
    if needed && handles.is_empty() {
        return Err(ParamError::new("handle", "there is none", "give at least one handle").into());
    }
    let targets = handles.iter().map(|handle| resolve("handle", &handle.at, lattice, rest));
    let targets: Vec<usize> = targets.collect::<Result<_, _>>()?;
    for (i, target) in targets.iter().enumerate() {
        if let Some(j) = targets[..i].iter().position(|other| other == target)
            && handles[i].action != handles[j].action
        {
            return Err(Error::Mismatch {
                what: "handles",
                problem: format!("handles {j} and {i} act differently on vertex {target}"),
                remedy: "make them one, or pick points further apart",
            });
        }
    }
    Ok(targets)
}
