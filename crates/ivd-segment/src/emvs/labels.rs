//! Labels and posterior maps: every voxel to its likeliest component.

use ivd_core::{Buffer, Class, Error, Exec, Labels, Mask, NO_DATA, SpillVec, Volume, parallel, with_voxels};

use super::bins::Bins;
use super::covariance::Covariance;
use super::line::{Density, likeliest};
use super::mixture::{Component, Frame};
use super::quadratic::{self, Quadratic};
use super::rows::{self, PIECE, Piece, Values, pieces};
use crate::moments::{Frame as MomentsFrame, Moments};
use crate::{classes, labelling};

/// Halvings of the stretch between two values that are labelled differently.
const HALVINGS: usize = 200;

/// What labels are made from.
pub(super) struct Scene<'a> {
    /// The volume whose values the components describe (corrected, where there is a bias).
    pub(super) volume: &'a Volume,
    /// The volume that classes are described by.
    pub(super) original: &'a Volume,
    pub(super) mask: Option<&'a Mask>,
    pub(super) bins: &'a Bins,
    pub(super) frame: &'a Frame,
    pub(super) shape: Covariance,
    /// In the order of their real means.
    pub(super) components: &'a [Component],
}

impl Scene<'_> {
    pub(super) fn densities(&self) -> Vec<Quadratic> {
        let of = if self.shape == Covariance::Intensity { Quadratic::on_intensity } else { Quadratic::of };
        self.components.iter().map(of).collect()
    }

    /// Labels by the likeliest component; of equally likely ones by that of the lower mean.
    pub(super) fn labels(&self, exec: &Exec) -> Result<Labels, Error> {
        if self.shape == Covariance::Intensity {
            return self.by_cuts(exec);
        }
        let densities = self.densities();
        let mut ids = exec.bulk::<u16>("the labels", self.volume.grid().len())?;
        self.each_piece(&densities, &mut ids, exec, |piece, _, logs, values, ids| {
            for (i, id) in ids.iter_mut().enumerate() {
                let mut best = (NO_DATA, f64::NEG_INFINITY);
                for (k, logs) in logs.iter().enumerate() {
                    if logs[i] > best.1 {
                        best = (k as u16 + 1, logs[i]);
                    }
                }
                *id = if values.valid[i] == 0.0 { NO_DATA } else { best.0 };
            }
            debug_assert_eq!(piece.len, ids.len());
        })?;
        self.described(ids, exec)
    }

    /// Labels with their classes, of the components' numbers (from 1).
    pub(super) fn described(&self, ids: SpillVec<u16>, exec: &Exec) -> Result<Labels, Error> {
        let found = classes::by_mean(self.original, ids, self.components.len(), exec)?;
        Labels::new(self.volume.grid().clone(), found.ids, found.classes)
    }

    /// Calls `write` for every piece, with the densities' logarithms there and its part of `out`.
    fn each_piece<O: Send>(
        &self,
        densities: &[Quadratic],
        out: &mut [O],
        exec: &Exec,
        write: impl Fn(&Piece, usize, &mut [[f64; PIECE]], &Values, &mut [O]) + Sync,
    ) -> Result<(), Error> {
        let (x, dims) = (quadratic::places(self.frame), self.frame.dims);
        let chunk = rows::chunk(dims);
        with_voxels!(self.volume.voxels(), slice => {
            parallel::try_for_each_piece_mut(out, chunk, &|i, out| {
                exec.check_cancelled()?;
                let mut values = Values::new();
                let mut logs = vec![[0.0; PIECE]; densities.len()];
                for piece in pieces(dims, i * chunk, i * chunk + out.len()) {
                    values.fill(slice, self.mask, &piece, self.frame);
                    let x = &x[piece.at[0]..piece.at[0] + piece.len];
                    for (density, logs) in densities.iter().zip(&mut logs) {
                        density.logs(&piece, self.frame, x, &values.t, logs);
                    }
                    let from = piece.start - i * chunk;
                    write(&piece, i, &mut logs, &values, &mut out[from..from + piece.len]);
                }
                Ok(())
            })
        })
    }

    /// Posterior probability of every component, a map each; 0 where there is no datum.
    pub(super) fn posteriors(&self, exec: &Exec) -> Result<Vec<Buffer<f32>>, Error> {
        let densities = self.densities();
        let map = |k: usize| {
            let mut map = exec.bulk::<f32>("a posterior map", self.volume.grid().len())?;
            self.each_piece(&densities, &mut map, exec, |piece, _, logs, values, map| {
                quadratic::posteriors(logs, piece.len, values);
                map.iter_mut().zip(&logs[k]).for_each(|(p, share)| *p = *share as f32);
            })?;
            Ok(map.into_buffer())
        };
        (0..densities.len()).map(map).collect()
    }

    /// On intensity alone the label is a table of the stored values: it changes at some of them.
    fn by_cuts(&self, exec: &Exec) -> Result<Labels, Error> {
        let (cuts, mut ids) = self.cuts();
        if !self.bins.is_exact() || !std::ptr::eq(self.original, self.volume) {
            return self.described(labelling::of(self.volume.voxels(), self.mask, &cuts, &ids, exec)?, exec);
        }
        // Every value is known with its count: no need to go through the voxels for the classes' figures.
        let frame = MomentsFrame::of(self.volume);
        let mut moments = vec![Moments::default(); self.components.len()];
        for ([value, _], n) in self.bins.ends.iter().zip(&self.bins.count) {
            let id = ids[cuts.partition_point(|cut| cut <= value)];
            moments[usize::from(id) - 1].add_many(*value, *n as u64, &frame);
        }
        let (described, renamed) = describe(self.volume, &moments, &frame);
        for id in &mut ids {
            *id = renamed[usize::from(*id) - 1];
        }
        let labels = labelling::of(self.volume.voxels(), self.mask, &cuts, &ids, exec)?;
        Labels::new(self.volume.grid().clone(), labels.into_buffer(), described)
    }

    /// The stored values at which the likeliest component changes, ascending, and the components (from 1) before, between and
    /// after them.
    fn cuts(&self) -> (Vec<f64>, Vec<u16>) {
        let densities: Vec<Density> = self.components.iter().map(Density::of).collect();
        let best = |stored: f64| likeliest(&densities, self.frame.value(stored)) as u16 + 1;
        let mut ids = vec![best(self.bins.ends[0][0])];
        let mut cuts = Vec::new();
        for [low, high] in &self.bins.ends {
            let first = best(*low);
            if ids.last() != Some(&first) {
                cuts.push(*low);
                ids.push(first);
            }
            let last = best(*high);
            if last != first {
                cuts.push(change(*low, *high, &best));
                ids.push(last);
            }
        }
        (cuts, ids)
    }
}

/// The least value up to `high` that isn't labelled as `low` is, where the label changes once between them.
fn change(mut low: f64, mut high: f64, best: &impl Fn(f64) -> u16) -> f64 {
    let before = best(low);
    for _ in 0..HALVINGS {
        let middle = low.midpoint(high);
        if middle <= low || middle >= high {
            break;
        }
        if best(middle) == before { low = middle } else { high = middle }
    }
    high
}

/// Classes in the order of their means, and the class (from 1) of every group; 0 of an empty one.
fn describe(volume: &Volume, moments: &[Moments], frame: &MomentsFrame) -> (Vec<Class>, Vec<u16>) {
    let mean = |g: usize| volume.real(moments[g].mean(frame)).clamp(f64::MIN, f64::MAX);
    let mut order: Vec<usize> = (0..moments.len()).filter(|g| moments[*g].count > 0).collect();
    order.sort_by(|&a, &b| {
        mean(a).total_cmp(&mean(b)).then(moments[b].count.cmp(&moments[a].count)).then(a.cmp(&b))
    });
    let mut renamed = vec![NO_DATA; moments.len()];
    let mut described = Vec::new();
    for (i, &g) in order.iter().enumerate() {
        let id = i as u16 + 1;
        renamed[g] = id;
        described.push(Class {
            id,
            name: None,
            mean: mean(g),
            sd: (moments[g].sd(frame) * volume.slope().abs()).min(f64::MAX),
            voxels: moments[g].count,
            lower: None,
            upper: None,
        });
    }
    classes::set_crossings(&mut described);
    (described, renamed)
}

/// Labels of a volume without data.
pub(super) fn none(volume: &Volume, exec: &Exec) -> Result<Labels, Error> {
    let ids = exec.bulk::<u16>("the labels", volume.grid().len())?;
    Labels::new(volume.grid().clone(), ids.into_buffer(), Vec::new())
}
