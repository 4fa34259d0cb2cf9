//! Which bone holds which vertex.

use ivd_core::vertex_class;
use ivd_core::{Labels, Lattice};
use nalgebra::Vector3;

use super::{BoneSpec, Region};
use crate::Error;

/// The bone of each vertex, by its number in the list of parts.
pub(super) type Holders = Vec<Option<usize>>;

/// The bone that holds each vertex.
///
/// - `rest`: vertices (mm), relative to the grid's origin.
///
/// # Errors
/// [`Error::Mismatch`]: a class without labels, labels on another grid, a bone without a vertex, a vertex that two bones hold.
pub(super) fn holders(
    lattice: &Lattice,
    labels: Option<&Labels>,
    rest: &[Vector3<f64>],
    parts: &[BoneSpec],
) -> Result<Holders, Error> {
    let origin = Vector3::from(lattice.grid().origin());
    let mut holder: Holders = vec![None; rest.len()];
    for (b, part) in parts.iter().enumerate() {
        let within = |v: usize| part.region.is_none_or(|region: Region| region.holds(rest[v], origin));
        let of_class = match (part.class, labels) {
            (None, _) => None,
            (Some(class), Some(labels)) => {
                vertex_class::check(lattice, labels)?;
                Some((class, labels))
            }
            (Some(class), None) => {
                return Err(Error::Mismatch {
                    what: "rigid",
                    problem: format!("there are no labels to know class {class} of bone {} by", part.name),
                    remedy: "give labels, or say by a region which vertices it holds",
                });
            }
        };
        let (mut inside, mut held) = (0_usize, 0_usize);
        for v in (0..rest.len()).filter(|&v| within(v)) {
            inside += 1;
            if of_class.is_some_and(|(class, labels)| !vertex_class::beside(lattice, labels, v, class)) {
                continue;
            }
            held += 1;
            if let Some(other) = holder[v] {
                let world: [f64; 3] = lattice.world(v).0.into();
                return Err(Error::Mismatch {
                    what: "rigid",
                    problem: format!(
                        "bones {} and {} both hold vertex {v} at {world:.3?} mm",
                        parts[other].name, part.name
                    ),
                    remedy: "make their regions smaller, or make them one bone",
                });
            }
            holder[v] = Some(b);
        }
        if held == 0 {
            let problem = match part.class {
                Some(class) if inside > 0 => format!(
                    "bone {} holds no vertex: of the {inside} within its region none lies beside a voxel of class {class}",
                    part.name
                ),
                _ => format!("bone {} holds no vertex of the lattice's {}", part.name, rest.len()),
            };
            let remedy = "look at the lattice and its labels (`ivd info`), and make the region larger";
            return Err(Error::Mismatch { what: "rigid", problem, remedy });
        }
    }
    Ok(holder)
}
