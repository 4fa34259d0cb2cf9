//! Expectation and maximisation over space and intensity.

use ivd_core::{Error, Exec, Iteration, Mask, Volume, parallel, with_voxels};

use super::bins::Bins;
use super::covariance::Covariance;
use super::factorisation::{factor, product};
use super::line::{Found, Limits};
use super::mixture::{AXES, Component, Frame};
use super::quadratic::{self, Quadratic};
use super::rows;
use super::sums::Sums;
use super::tables::Tables;

/// What the search looks at.
pub(super) struct Space<'a> {
    pub(super) volume: &'a Volume,
    pub(super) mask: Option<&'a Mask>,
    pub(super) bins: &'a Bins,
    pub(super) frame: &'a Frame,
    pub(super) shape: Covariance,
    pub(super) limits: Limits,
}

impl Space<'_> {
    /// Plain EM until the likelihood stands still.
    pub(super) fn search(&self, mut components: Vec<Component>, exec: &Exec) -> Result<Found, Error> {
        let mut last = f64::NEG_INFINITY;
        for index in 1..=self.limits.iterations {
            let (sums, log_likelihood) = self.expect(&components, exec)?;
            exec.observer().iteration(Iteration { method: "emvs", index, value: log_likelihood });
            self.maximise(&mut components, &sums);
            let converged = log_likelihood - last < self.limits.tolerance && index > 1;
            if converged || index == self.limits.iterations {
                let (_, log_likelihood) = self.expect(&components, exec)?;
                return Ok(Found { components, log_likelihood, iterations: index, converged });
            }
            last = log_likelihood;
        }
        unreachable!("the loop returns in its last round, and has one")
    }

    /// Components with the places that belong to components on intensity alone: each voxel wholly to its likeliest.
    pub(super) fn placed(&self, on_intensity: &[Component], exec: &Exec) -> Result<Vec<Component>, Error> {
        let mut components = on_intensity.to_vec();
        // For those that nothing chooses: everywhere.
        for c in &mut components {
            for axis in 0..3 {
                c.covariance[axis][axis] = self.limits.floor[axis].max(1.0 / 12.0);
            }
        }
        let tables = Tables::choosing(self.bins, self.frame, &components);
        let (sums, _) = self.total(exec, components.len(), &|range| self.tabled(&tables, range))?;
        self.maximise(&mut components, &sums);
        if self.shape == Covariance::Full {
            return Ok(components);
        }
        Ok(components.into_iter().map(only_variances).collect())
    }

    fn expect(&self, components: &[Component], exec: &Exec) -> Result<(Vec<Sums>, f64), Error> {
        // Bins of several values would stand for each other; the tables are for those of one.
        let (sums, likelihood) = if self.shape == Covariance::Full || !self.bins.is_exact() {
            let densities: Vec<Quadratic> = components.iter().map(Quadratic::of).collect();
            self.total(exec, components.len(), &|range| {
                with_voxels!(self.volume.voxels(), slice => {
                    quadratic::expect(slice, self.mask, self.frame, &densities, range)
                })
            })?
        } else {
            let tables = Tables::of(self.bins, self.frame, components);
            self.total(exec, components.len(), &|range| self.tabled(&tables, range))?
        };
        Ok((sums, likelihood / self.bins.total))
    }

    fn tabled(&self, tables: &Tables, range: [usize; 2]) -> (Vec<Sums>, f64) {
        with_voxels!(self.volume.voxels(), slice => tables.expect(slice, self.mask, self.bins, self.frame, range))
    }

    /// Joins what every chunk gives, in their order.
    fn total(
        &self,
        exec: &Exec,
        k: usize,
        part: &(impl Fn([usize; 2]) -> (Vec<Sums>, f64) + Sync),
    ) -> Result<(Vec<Sums>, f64), Error> {
        let (len, chunk) = (self.volume.grid().len(), rows::chunk(self.frame.dims));
        let parts: Vec<(Vec<Sums>, f64)> = parallel::try_map_pieces(len, chunk, &|piece| {
            exec.check_cancelled()?;
            Ok::<_, Error>(part([piece.start, piece.end]))
        })?;
        let mut total = (vec![Sums::default(); k], 0.0);
        for (sums, likelihood) in &parts {
            total.0.iter_mut().zip(sums).for_each(|(total, part)| total.join(part));
            total.1 += likelihood;
        }
        Ok(total)
    }

    /// Weights, means and covariances of greatest expected likelihood, variances no less than their floors: for a full
    /// covariance, those of y given x, of z given both and of the intensity given all three. A component that nothing
    /// belongs to stays where it is.
    fn maximise(&self, components: &mut [Component], sums: &[Sums]) {
        let Limits { floor, added, .. } = &self.limits;
        for (c, sums) in components.iter_mut().zip(sums) {
            c.weight = sums.n / self.bins.total;
            if sums.n <= 1e-200 * self.bins.total {
                continue;
            }
            let off = sums.d.map(|d| d / sums.n);
            let mut covariance = [[0.0; AXES]; AXES];
            for a in 0..AXES {
                c.mean[a] += off[a];
                for b in a..AXES {
                    covariance[a][b] = sums.dd[a][b] / sums.n - off[a] * off[b];
                    covariance[b][a] = covariance[a][b];
                }
                covariance[a][a] += added[a];
            }
            c.covariance = if self.shape == Covariance::Full {
                let (lower, pivots) = factor(&covariance, floor);
                product(&lower, &pivots)
            } else {
                let mut own = [[0.0; AXES]; AXES];
                (0..AXES).for_each(|a| own[a][a] = covariance[a][a].max(floor[a]));
                own
            };
        }
    }
}

fn only_variances(mut c: Component) -> Component {
    for a in 0..AXES {
        for b in 0..AXES {
            if a != b {
                c.covariance[a][b] = 0.0;
            }
        }
    }
    c
}
