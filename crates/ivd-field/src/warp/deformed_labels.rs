//! Deformed labels that are kept while their displacement changes.

use ivd_core::{Displacement, Exec, Labels};

use super::deformed::Job;
use super::{Order, WarpParams, check_grid, for_each_row, label_background};
use crate::Error;
use crate::sampler::brick_at;

/// What [`labels`](super::labels) makes of labels, made anew brick by brick where their displacement changed.
///
/// Memory: one copy of the labels.
#[derive(Debug)]
pub struct DeformedLabels {
    output: Labels,
    background: u16,
    /// By label, how many voxels more have it than at rest.
    gained: Vec<i64>,
}

impl DeformedLabels {
    /// Labels at rest.
    ///
    /// # Errors
    /// A background that is no label; the memory limit.
    pub fn new(labels: &Labels, params: &WarpParams, exec: &Exec) -> Result<Self, Error> {
        let background = label_background(labels, params)?;
        exec.check_memory("the deformed labels", 2 * labels.ids().len() as u64)?;
        // Shared with the labels until something moves.
        Ok(Self { output: labels.clone(), background, gained: vec![0; 1 << 16] })
    }

    /// The deformed labels.
    pub fn output(&self) -> &Labels {
        &self.output
    }

    /// Makes bricks anew, as [`Deformed::update`](super::Deformed::update) does.
    ///
    /// # Errors
    /// Labels or a displacement on another grid; cancellation, before anything is changed.
    pub fn update(
        &mut self,
        labels: &Labels,
        displacement: &Displacement,
        bricks: &[usize],
        exec: &Exec,
    ) -> Result<u64, Error> {
        check_grid(labels.grid(), displacement, "labels")?;
        check_grid(self.output.grid(), displacement, "deformed labels")?;
        exec.check_cancelled()?;
        if bricks.is_empty() {
            return Ok(0);
        }
        let job = Job {
            displacement,
            bricks,
            order: Order::Nearest,
            background: f64::from(self.background),
            simd: exec.simd,
        };
        let before = ids_of(self.output.ids(), displacement, bricks);
        let output = &mut self.output;
        let computed =
            exec.run(|| output.change_blocks(bricks, |ids| Ok::<_, Error>(job.run(labels.ids(), ids))))?;
        for (before, after) in before.iter().zip(ids_of(self.output.ids(), displacement, bricks)) {
            self.gained[usize::from(*before)] -= 1;
            self.gained[usize::from(after)] += 1;
        }
        let at_rest = |id: u16| labels.class(id).map_or(0, |class| class.voxels);
        self.output.count(|id| at_rest(id).saturating_add_signed(self.gained[usize::from(id)]));
        Ok(computed)
    }
}

/// The labels of bricks, brick after brick.
pub(crate) fn ids_of(ids: &[u16], displacement: &Displacement, bricks: &[usize]) -> Vec<u16> {
    let (dims, brick_dims) = (displacement.grid().dims(), displacement.inverse().brick_dims());
    let mut out = Vec::new();
    for &brick in bricks {
        for_each_row(dims, brick_at(brick_dims, brick), |[x, y, z], _, range| {
            let first = x + dims[0] * (y + dims[1] * z);
            out.extend_from_slice(&ids[first..first + range.len()]);
        });
    }
    out
}
