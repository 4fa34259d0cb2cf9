//! About how much memory a stage takes: what the message of a run that its limit stopped names.
//!
//! Nothing is decided by it. The numbers stand at the stages ([`ivd_core::op::Stage::memory`]) and their methods, as measured where all is reached: what is
//! named is to do, and is more than is needed where less is. `tests/memory/cage.py` measures what is.

use ivd_artefact::Artefact;
use ivd_core::op::Memory;
use ivd_core::{Classified as _, ErrorClass, Exec, Grid, Lattice, Motion};

use crate::stage::Inputs;
use crate::{Error, resource};

const MIB: u64 = 1 << 20;
/// The program, its threads, and what is small of every stage (bytes).
const BASE: u64 = 32 * MIB;

/// How large what is worked on is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Size {
    pub(crate) voxels: u64,
    pub(crate) reached: u64,
    pub(crate) triangles: u64,
}

impl Size {
    /// Of the largest grid, motion and lattice among a stage's inputs.
    pub(crate) fn of(inputs: &Inputs) -> Self {
        inputs.artefacts().fold(Self::default(), Self::with)
    }

    /// With those of a value.
    pub(crate) fn with(self, artefact: &Artefact) -> Self {
        let voxels = grid(artefact).map_or(0, |grid| grid.len() as u64);
        let triangles = lattice(artefact).map_or(0, |lattice| lattice.triangles().len() as u64);
        let reached = if let Artefact::Motion(motion) = artefact { reached(motion) } else { 0 };
        Self {
            voxels: self.voxels.max(voxels),
            reached: self.reached.max(reached),
            triangles: self.triangles.max(triangles),
        }
    }
}

/// About how many voxels a motion's map works on: boxes round what it reaches, with a band as wide as maps make it.
fn reached(motion: &Motion) -> u64 {
    let grid = motion.grid();
    if motion.reach().is_empty() {
        return grid.len() as u64;
    }
    let band = (4.0 * motion.max_displacement()).max(2.0 * grid.voxel_diagonal());
    let along = |radius: f64, a: usize| {
        let voxels = 2.0 * (radius + band) / grid.spacing()[a] + 1.0;
        voxels.min(grid.dims()[a] as f64)
    };
    let boxes = motion.reach().iter().map(|ball| (0..3).map(|a| along(ball.radius, a)).product::<f64>());
    (boxes.sum::<f64>() as u64).min(grid.len() as u64)
}

fn grid(artefact: &Artefact) -> Option<&Grid> {
    match artefact {
        Artefact::Volume(volume) => Some(volume.grid()),
        Artefact::Labels(labels) => Some(labels.grid()),
        Artefact::Mask(mask) => Some(mask.grid()),
        Artefact::Tree(tree) => Some(&tree.grid),
        Artefact::Lattice(lattice) => Some(lattice.grid()),
        Artefact::Displacement(displacement) => Some(displacement.grid()),
        Artefact::Octree(_) | Artefact::Motion(_) | Artefact::Transfer(_) | Artefact::Image(_) => None,
    }
}

fn lattice(artefact: &Artefact) -> Option<&Lattice> {
    if let Artefact::Lattice(lattice) = artefact { Some(lattice) } else { None }
}

/// About how much a stage that takes so much takes beside what is held when it begins (bytes); `None` where nothing is known of its size yet.
pub(crate) fn about(memory: Memory, size: Size) -> Option<u64> {
    let parts =
        [(memory.voxel, size.voxels), (memory.reached, size.reached), (memory.triangle, size.triangles)];
    (size != Size::default()).then_some(BASE + parts.map(|(each, count)| each * count).iter().sum::<u64>())
}

/// An error, with the limit that would do where a memory limit ended the work: `held` (MiB) at the beginning, and what the work takes, which
/// is at least what was refused to it. Other failures, and those of which neither is known, are left as they are.
pub(crate) fn explained(error: Error, exec: &Exec, held: Option<f64>, takes: Option<u64>) -> Error {
    let Some(limit) = exec.memory_limit else { return error };
    let refused = exec.refused().map(|bytes| BASE + bytes);
    let class = error.error_class();
    let was_refused = refused.is_some() && !exec.cancel.is_late();
    let by_memory = class == ErrorClass::Cancelled || (class == ErrorClass::Limit && was_refused);
    let Some(takes) = takes.max(refused).filter(|_| by_memory && !matches!(error, Error::OverMemory { .. }))
    else {
        return error;
    };
    let now = resource::own_mb().unwrap_or_default().max(held.unwrap_or_default());
    let held = (held.unwrap_or_default() * MIB as f64) as u64;
    // What was held when it ended wasn't enough.
    let least = (now * 1.5 * MIB as f64) as u64;
    let mib = (held + takes).max(least).max(limit / 4 * 5).div_ceil(MIB);
    Error::OverMemory { about_mib: mib.next_multiple_of(16), source: Box::new(error) }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use ivd_core::Error as CoreError;

    use super::*;

    fn short(error: Error, exec: &Exec) -> Option<u64> {
        match explained(error, exec, Some(10.0), Some(100 * MIB)) {
            Error::OverMemory { about_mib, .. } => Some(about_mib),
            _ => None,
        }
    }

    #[test]
    fn a_limit_is_named_where_a_limit_may_have_ended_the_work_and_nowhere_else() {
        let cancelled = || Error::Core(CoreError::Cancelled);
        let limited = Exec::default().with_memory_limit(Some(80 * MIB));
        let named = short(cancelled(), &limited).unwrap();
        assert!(named >= 110 && named.is_multiple_of(16), "{named}");
        assert_eq!(short(cancelled(), &Exec::default()), None, "no limit was set");
        assert_eq!(short(Error::usage("map", "no"), &limited), None);
        let late = limited.clone().with_deadline(Instant::now());
        assert_eq!(short(Error::Core(CoreError::Deadline), &late), None, "the time was up");
        // Other limits than that of memory name none; an array that was refused is part of what is named.
        let too_many = || Error::Core(CoreError::Deadline);
        assert_eq!(short(too_many(), &limited), None);
        assert_eq!(explained(cancelled(), &limited, None, None).to_string(), cancelled().to_string());
        let refused = limited.check_memory("a picture", 2000 * MIB).unwrap_err();
        assert!(short(Error::Core(refused), &limited).unwrap() >= 2000);
        // More than the limit that was too low, whatever is reckoned.
        let roomy = Exec::default().with_memory_limit(Some(4000 * MIB));
        assert!(short(cancelled(), &roomy).unwrap() >= 5000);
    }

    #[test]
    fn a_method_that_says_what_it_takes_is_believed() {
        let takes = |method: &str| {
            let text = format!(
                "schema = 1\n[input]\nfile = \"a.nii\"\n[refine]\nmethod = \"{method}\"\n[output]\nimages = [\"before\"]\n"
            );
            let scene = crate::scene::parse(&text, &[]).unwrap();
            crate::Stage::memory(scene.section(&ivd_lattice::refine::STAGE).unwrap())
        };
        assert_eq!(takes("loop"), ivd_lattice::refine::STAGE.memory);
        assert!(takes("collapse").triangle < takes("loop").triangle);
    }

    #[test]
    fn more_to_work_on_takes_more() {
        for stage in crate::list::STAGES.iter().filter(|stage| stage.memory != Memory::default()) {
            let small = about(stage.memory, Size { voxels: 1000, reached: 100, triangles: 10 }).unwrap();
            let large = Size { voxels: 100_000, reached: 10_000, triangles: 1000 };
            assert!(about(stage.memory, large).unwrap() > small);
        }
    }
}
