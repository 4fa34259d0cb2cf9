//! What of a scene is found before a view is known: looks, bounds, what is empty, and what a picture holds.

use ivd_core::{BrickRange, Exec, Lattice, TransferFunction};

use crate::camera::{centre, step_mm};
use crate::classify::{Classifier, Rows};
use crate::empty_space::Space;
use crate::fit::{DARK, Held};
use crate::preintegrated::Preintegrated;
use crate::project::Bounds;
use crate::samples::Shape;
use crate::skip::{NOTHING, carried, join, joined_about, rows_of_bricks, through_warp};
use crate::warp::Warp;
use crate::{Classification, Error, Fit};

use super::{ModeState, Prepared, is_still};

impl Prepared<'_> {
    /// Finds what bricks may add to a projection.
    pub(super) fn project(&mut self) {
        let bounds: Vec<f32> = self.ranges().map(|range| self.bound(range, self.sign())).collect();
        let [low, high] = self.window();
        let seen_from = low + DARK * (high - low);
        // What isn't dark is held in mode minip too.
        let rises = self.scene.volume.slope().signum();
        let seen_from = (rises * (self.scene.volume.stored(seen_from) - self.shift)) as f32;
        let seen: Vec<bool> = self.ranges().map(|range| self.bound(range, rises) >= seen_from).collect();
        self.hold(&seen);
        let bounds = self.moved(bounds, f32::NEG_INFINITY, f32::max);
        self.optics = ModeState::Projection(Bounds::new(self.space.bricks(), bounds));
    }

    /// Finds the bricks that reach an isovalue.
    pub(super) fn split(&mut self, value: f64) {
        let iso = self.signed(value) as f32;
        let shells = self.params.shells.iter().map(|shell| self.signed(shell.iso) as f32);
        let least = shells.fold(iso, f32::min);
        let empty: Vec<bool> = self.ranges().map(|range| self.bound(range, self.sign()) < least).collect();
        self.hold(&empty.iter().map(|empty| !empty).collect::<Vec<_>>());
        if self.params.skip {
            self.pass_over(empty);
        }
        self.optics = ModeState::Iso(iso);
    }

    /// Sets what the picture holds, of the undeformed bricks that are seen: where they are, and where displacements carry them.
    fn hold(&mut self, seen: &[bool]) {
        if self.params.fit == Fit::Volume || self.scene.whole.is_some() {
            return;
        }
        let grid = self.scene.volume.grid();
        let bricks = self.scene.volume.bricks().dims();
        let framing = self.scene.framing.filter(|d| !is_still(d));
        let framing = framing.map(|d| Warp::new(d, grid.inverse_linear_part()));
        let mut held = seen.to_vec();
        for warp in [self.warp.as_ref(), framing.as_ref()].into_iter().flatten() {
            held.iter_mut().zip(carried(warp, bricks, seen)).for_each(|(held, carried)| *held |= carried);
        }
        let middle = centre(grid);
        let outline = self.scene.lattice.map_or_else(Vec::new, Lattice::positions);
        let outline = outline.into_iter().map(|place| place - middle).collect();
        self.held = Held::of_bricks(grid, &held, outline);
    }

    /// Makes the transfer function ready, and finds what it leaves clear.
    pub(super) fn classify(&mut self, exec: &Exec) -> Result<(), Error> {
        let transfer = self.scene.transfer.ok_or(Error::NoTransfer)?;
        let index = self.scene.volume.bricks();
        let range = index.total().map_or([0.0; 2], |(lo, hi)| [self.fast(lo), self.fast(hi)]);
        let step = step_mm(self.scene.volume.grid(), &self.params) / transfer.reference_mm();
        let rows = match (self.scene.labels.is_none(), self.scene.unlabelled) {
            (true, _) => Rows::Union,
            (false, false) => Rows::Labelled,
            (false, true) => Rows::LabelledOrUnion,
        };
        let real = |fast: f64| self.scene.volume.real(fast + self.shift);
        if self.params.classification == Classification::PreIntegrated {
            return self.pre_integrate(transfer, range, step, exec);
        }
        let classifier = Classifier::new(transfer, range, real, step, rows);
        if self.params.skip || self.params.fit == Fit::Visible {
            exec.check_cancelled()?;
            let labels = self.scene.labels;
            let rows =
                labels.map_or_else(|| vec![1; index.len()], |labels| rows_of_bricks(labels, &classifier));
            let clear = |(range, &rows): (BrickRange, &u64)| classifier.is_clear(range, self.shift, rows);
            let empty: Vec<bool> = self.ranges().zip(&rows).map(clear).collect();
            self.hold(&empty.iter().map(|empty| !empty).collect::<Vec<_>>());
            if self.params.skip {
                self.pass_over(empty);
            }
        }
        self.optics = ModeState::Dvr(classifier);
        Ok(())
    }

    /// The same for steps between values.
    fn pre_integrate(
        &mut self,
        transfer: &TransferFunction,
        range: [f32; 2],
        step: f64,
        exec: &Exec,
    ) -> Result<(), Error> {
        if self.scene.labels.is_some() || transfer.gradient().is_some() {
            return Err(Error::NotByValue);
        }
        let real = |fast: f64| self.scene.volume.real(fast + self.shift);
        let table = Preintegrated::new(transfer, range, real, step, exec)?;
        let seen: Vec<bool> = self.ranges().map(|range| !table.is_clear(range, self.shift)).collect();
        self.hold(&seen);
        if self.params.skip {
            // A step whose middle lies in a brick ends in it or in one beside it: at most five voxels on.
            let index = self.scene.volume.bricks();
            let ranges: Vec<BrickRange> = self.ranges().collect();
            let ranges = self.moved(ranges, NOTHING, join);
            let about = joined_about(index.dims(), &ranges);
            let empty: Vec<bool> = about.into_iter().map(|range| table.is_clear(range, self.shift)).collect();
            self.space = Space::new(Shape::new(self.scene.volume.grid().dims()), &empty);
        }
        self.optics = ModeState::PreIntegrated(table);
        Ok(())
    }

    /// Sets what is passed over from the undeformed bricks that are empty.
    fn pass_over(&mut self, empty: Vec<bool>) {
        let empty = self.moved(empty, true, |a, b| a && b);
        self.space = Space::new(Shape::new(self.scene.volume.grid().dims()), &empty);
    }

    /// A value of every undeformed brick, joined over where each brick of the deformed volume comes from.
    fn moved<V: Copy + Send + Sync>(
        &self,
        of_brick: Vec<V>,
        outside: V,
        join: impl Fn(V, V) -> V + Sync,
    ) -> Vec<V> {
        through_warp(self.warp.as_ref(), self.scene.volume.bricks().dims(), of_brick, outside, join)
    }

    fn ranges(&self) -> impl Iterator<Item = BrickRange> {
        let index = self.scene.volume.bricks();
        (0..index.len()).map(|b| index.range(b))
    }

    fn fast(&self, stored: f32) -> f32 {
        (f64::from(stored) - self.shift) as f32
    }

    /// A value that no interpolated `sign · fast` of the range exceeds, with room for rounding; −∞ where there is no data.
    fn bound(&self, range: BrickRange, sign: f64) -> f32 {
        if range.min > range.max {
            return f32::NEG_INFINITY;
        }
        let (low, high) = (self.fast(range.min), self.fast(range.max));
        let top = if sign < 0.0 { -low } else { high };
        top + 1e-5 * (low.abs() + high.abs())
    }
}
