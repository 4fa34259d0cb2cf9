//! From a field as carried to a map: repair, proof, inverse.

use ivd_core::{Displacement, Exec, FieldBricks, Frame, Lattice, Mask, Motion, NO_BRICK};
use ivd_field::certificate::{Certificate, Detail};
use ivd_field::inverse::{from_bricks, invert, invert_part};

use super::compose::{Composed, halve};
use super::outcome::{self, MapResult, MapUpdate, SurfaceFit};
use super::params::Band;
use super::region::{Region, largest};
use super::relax::relax;
use crate::Error;

/// What a field is held against.
pub(super) struct Settle<'a> {
    pub(super) lattice: &'a Lattice,
    /// The inside of a part that moves alone.
    pub(super) alone: Option<&'a Mask>,
    pub(super) region: &'a Region,
    /// The motion that the frame is of.
    pub(super) motion: &'a Motion,
    pub(super) frame: &'a Frame,
    pub(super) band: &'a Band,
}

impl Settle<'_> {
    /// Whether a cell is to be free of folds.
    pub(super) fn counts(&self) -> impl Fn([i64; 3]) -> bool + Sync + use<'_> {
        move |cell| self.alone.is_none_or(|inside| touches(inside, cell))
    }

    /// Repairs the field where it folds, certifies and inverts it, and measures what came of it.
    pub(super) fn settle(&self, field: FieldBricks, exec: &Exec) -> Result<MapResult, Error> {
        let proven = self.prove(field, Detail::All, exec)?;
        let followed = self.fit(&proven.field);
        self.check(&followed)?;
        let (rounds, halvings, certificate) = (proven.rounds, proven.halvings, proven.certificate.clone());
        let displacement = self.invert(proven, exec)?;
        Ok(MapResult::new(displacement, certificate, rounds, halvings, followed))
    }

    /// As [`Settle::settle`], without the figures that only a report shows.
    pub(super) fn moved(&self, field: FieldBricks, exec: &Exec) -> Result<MapUpdate, Error> {
        let proven = self.prove(field, if exec.skip { Detail::Least } else { Detail::All }, exec)?;
        let misfit = outcome::misfit(self.lattice, self.motion, &proven.field, self.frame);
        let left_mm = outcome::most_left(self.lattice, self.motion, &proven.field, self.frame, self.region);
        // The whole fit is measured only where it may refuse.
        let follows = misfit <= self.band.tolerance && left_mm <= self.may_be_left();
        if !exec.skip || !follows {
            self.check(&self.fit(&proven.field))?;
        }
        let (relaxations, halvings) = (proven.rounds, proven.halvings);
        let displacement = self.invert(proven, exec)?;
        Ok(MapUpdate { displacement, relaxations, halvings, misfit, left_mm })
    }

    /// Refuses a field that leaves the lattice behind.
    fn check(&self, fit: &SurfaceFit) -> Result<(), Error> {
        Ok(fit.check(self.band.tolerance, self.may_be_left(), self.edge())?)
    }

    /// Edge of a cube of a voxel's volume (mm).
    fn edge(&self) -> f64 {
        self.lattice.grid().voxel_volume().cbrt()
    }

    /// How far all but a thousandth of the vertices may be left behind (mm): a voxel at least.
    fn may_be_left(&self) -> f64 {
        (self.band.tolerance * largest(self.frame)).max(self.edge())
    }

    /// How well a field follows the lattice.
    fn fit(&self, field: &FieldBricks) -> SurfaceFit {
        SurfaceFit::measure(self.lattice, self.motion, field, self.frame, self.region)
    }

    /// Repairs the field where it folds, and certifies it.
    fn prove(&self, field: FieldBricks, detail: Detail, exec: &Exec) -> Result<Proven, Error> {
        let grid = self.lattice.grid();
        let counts = self.counts();
        let relaxed = relax(field, grid, self.region, &counts, detail, exec)?;
        let (mut field, mut certificate, mut halvings) = (relaxed.field, relaxed.certificate, 0);
        if !certificate.holds() {
            match halve(&field, grid, certificate, &counts, detail, exec)? {
                Composed::Found { field: f, certificate: c, halvings: h } => {
                    (field, certificate, halvings) = (f, c, h);
                }
                Composed::Folded(last) => return Err(Error::folded(&last, grid)),
            }
        }
        Ok(Proven { field: without_zeros(field)?, certificate, rounds: relaxed.rounds, halvings })
    }

    fn invert(&self, proven: Proven, exec: &Exec) -> Result<Displacement, Error> {
        let (grid, field) = (self.lattice.grid(), proven.field);
        let (inverse, vacated) = match self.alone {
            None => (invert(&field, grid, exec)?, Vec::new()),
            Some(inside) => invert_part(&field, grid, inside, exec)?,
        };
        inverse
            .check_residual("the inverse of the map", "move the handle less, or give it a larger radius")?;
        Ok(Displacement::new(grid.clone(), field, inverse.field)?
            .with_time(self.frame.time)
            .with_inverse_residual_max(inverse.residual_max_voxels)
            .with_min_det_j(proven.certificate.min_det)
            .with_vacated(vacated.into())?)
    }
}

/// A field that doesn't fold, and what proves it.
struct Proven {
    field: FieldBricks,
    certificate: Certificate,
    rounds: u32,
    halvings: u32,
}

fn without_zeros(field: FieldBricks) -> Result<FieldBricks, Error> {
    let stored: Vec<usize> = (0..field.table().len()).filter(|&b| field.table()[b] != NO_BRICK).collect();
    let some_zero = stored.iter().any(|&b| field.brick(b).is_some_and(|v| v.iter().all(|u| *u == [0.0; 3])));
    if !some_zero {
        return Ok(field);
    }
    let bricks = stored.iter().map(|&b| field.brick(b).expect("the brick is stored"));
    Ok(from_bricks(field.dims(), &stored, bricks)?)
}

/// Whether a corner of the cell lies in the part.
fn touches(inside: &Mask, cell: [i64; 3]) -> bool {
    let dims = inside.grid().dims();
    (0..8_usize).any(|i| {
        let at: [usize; 3] =
            std::array::from_fn(|a| (cell[a] + (i >> a & 1) as i64).clamp(0, dims[a] as i64 - 1) as usize);
        inside.inside()[at[0] + dims[0] * (at[1] + dims[1] * at[2])] != 0
    })
}
