//! A clipped volume that is kept while the volume changes, or what clips it.

use ivd_core::{Displacement, Exec, Labels, NO_DATA, Scalar, Volume, Voxels, parallel};

use super::region::{Part, Region};
use super::{By, ClipParams, Counts, discard, stored_background};
use crate::Error;
use crate::combine::nearest_data;
use crate::sampler::brick_at;
use crate::warp::{for_each_row, ids_of, recount};

/// What [`volume`](super::volume) makes of a volume by planes and boxes, made anew brick by brick.
///
/// Memory: one copy of the voxels. Without a background that is given the ranges of the volume's bricks are looked at for every update; whoever
/// has them kept (as [`Deformed`](crate::warp::Deformed) does) has no pass over the volume.
#[derive(Debug, Clone)]
pub struct Kept {
    output: Volume,
    /// `None` as long as nothing was clipped.
    made: Option<Made>,
}

/// What it was made by.
#[derive(Debug, Clone, PartialEq)]
struct Made {
    params: ClipParams,
    at_rest: bool,
    /// The bits of the stored value.
    background: u64,
}

impl Kept {
    /// A volume of which nothing is clipped yet.
    ///
    /// # Errors
    /// The memory limit.
    pub fn new(volume: &Volume, exec: &Exec) -> Result<Self, Error> {
        exec.check_memory("the clipped volume", volume.voxels().as_bytes().len() as u64)?;
        Ok(Self { output: volume.clone(), made: None })
    }

    /// The clipped volume.
    pub fn output(&self) -> &Volume {
        &self.output
    }

    /// Clips the volume as it is now. Gives the bricks, ascending, that were made anew.
    ///
    /// - `params`: checked; planes and boxes.
    /// - `displacement`: what deformed the volume; read where the part is one of rest space, `at_rest`.
    /// - `bricks`: those in which the volume or the displacement has changed since, ascending.
    ///
    /// # Panics
    /// Where volume or displacement lie on another grid than the volume that it was made of, or that was of another type.
    pub fn update(
        &mut self,
        volume: &Volume,
        params: &ClipParams,
        at_rest: bool,
        displacement: &Displacement,
        bricks: &[usize],
        exec: &Exec,
    ) -> Vec<usize> {
        let made =
            Made { params: params.clone(), at_rest, background: stored_background(volume, params).to_bits() };
        let again = made.again(self.made.as_ref(), displacement, bricks);
        let region = region(&made, displacement);
        let job = Job {
            region: &region,
            bricks: &again,
            background: f64::from_bits(made.background),
            skip: exec.skip,
        };
        let remake = |output: &mut Voxels| {
            of_one_type!(volume.voxels(), output, from, to => job.run(from, to.make_mut()))
                .expect("a copy is of the same type");
        };
        let output = &mut self.output;
        exec.run(|| output.change_blocks(&again, remake));
        self.made = Some(made);
        again
    }

    /// The bricks, ascending, that may not be the volume's own.
    pub fn clipped(&self, displacement: &Displacement) -> Vec<usize> {
        self.made.as_ref().map_or_else(Vec::new, |made| made.touched(displacement))
    }
}

impl Made {
    /// The bricks, ascending, that are made anew after what was made before.
    ///
    /// - `bricks`: those in which what is clipped or the displacement has changed since, ascending.
    fn again(&self, before: Option<&Self>, displacement: &Displacement, bricks: &[usize]) -> Vec<usize> {
        let mut again = bricks.to_vec();
        if before != Some(self) {
            again.extend(before.map_or_else(Vec::new, |before| before.touched(displacement)));
            again.extend(self.touched(displacement));
            again.sort_unstable();
            again.dedup();
        }
        again
    }

    /// The bricks of which not all is surely kept.
    fn touched(&self, displacement: &Displacement) -> Vec<usize> {
        touched(&region(self, displacement), displacement)
    }
}

/// What [`labels`](super::labels) makes of labels by planes and boxes, made anew brick by brick: 0 where they throw away.
///
/// Memory: one copy of the labels.
#[derive(Debug, Clone)]
pub struct KeptLabels {
    output: Labels,
    /// `None` as long as nothing was clipped.
    made: Option<Made>,
}

impl KeptLabels {
    /// Labels of which nothing is clipped yet.
    ///
    /// # Errors
    /// The memory limit.
    pub fn new(labels: &Labels, exec: &Exec) -> Result<Self, Error> {
        exec.check_memory("the clipped labels", 2 * labels.ids().len() as u64)?;
        Ok(Self { output: labels.clone(), made: None })
    }

    /// The clipped labels.
    pub fn output(&self) -> &Labels {
        &self.output
    }

    /// Clips the labels as they are now, as [`Kept::update`] does.
    ///
    /// - `params`: checked; planes and boxes. The value that stands in for what a volume loses is no label: it isn't read.
    ///
    /// # Panics
    /// Where labels or displacement lie on another grid than the labels that it was made of.
    pub fn update(
        &mut self,
        labels: &Labels,
        params: &ClipParams,
        at_rest: bool,
        displacement: &Displacement,
        bricks: &[usize],
        exec: &Exec,
    ) {
        let params = ClipParams { background: None, ..params.clone() };
        let made = Made { params, at_rest, background: f64::from(NO_DATA).to_bits() };
        let again = made.again(self.made.as_ref(), displacement, bricks);
        let region = region(&made, displacement);
        let job = Job { region: &region, bricks: &again, background: f64::from(NO_DATA), skip: exec.skip };
        let before = ids_of(self.output.ids(), displacement, &again);
        exec.run(|| self.output.change_blocks(&again, |ids| job.run(labels.ids(), ids)));
        let after = ids_of(self.output.ids(), displacement, &again);
        let mut classes = self.output.classes().to_vec();
        recount(&before, &after, &mut classes);
        self.output.count(|id| classes.iter().find(|class| class.id == id).map_or(0, |class| class.voxels));
        self.made = Some(made);
    }
}

fn region<'a>(made: &Made, displacement: &'a Displacement) -> Region<'a> {
    let by = By { tag: None, displacement: made.at_rest.then_some(displacement) };
    Region::new(displacement.grid(), &made.params, &by)
}

/// The bricks of which not all is surely kept.
fn touched(region: &Region<'_>, displacement: &Displacement) -> Vec<usize> {
    let brick_dims = displacement.inverse().brick_dims();
    let all = 0..brick_dims.iter().product();
    all.filter(|&b| region.brick(brick_at(brick_dims, b)) != Part::All).collect()
}

/// Bricks to be made.
struct Job<'a> {
    region: &'a Region<'a>,
    bricks: &'a [usize],
    background: f64,
    skip: bool,
}

impl Job<'_> {
    fn run<T: Scalar>(&self, voxels: &[T], out: &mut [T]) {
        let [nx, ny, nz] = self.region.dims();
        let brick_dims = [nx, ny, nz].map(|n| n.div_ceil(8));
        let (layer, slab) = (brick_dims[0] * brick_dims[1], 8 * nx * ny);
        let background = nearest_data(self.background);
        parallel::for_each_piece_mut(out, slab, &|bz, out| {
            let voxels = &voxels[slab * bz..][..out.len()];
            let first = self.bricks.partition_point(|b| *b < layer * bz);
            let end = self.bricks.partition_point(|b| *b < layer * (bz + 1));
            for &brick in &self.bricks[first..end] {
                let at = brick_at(brick_dims, brick);
                for_each_row([nx, ny, nz], at, |_, _, row| out[row.clone()].copy_from_slice(&voxels[row]));
                discard(self.region, at, self.skip, out, &|_| background, &mut Counts::default());
            }
        });
    }
}

#[cfg(test)]
mod tests;
