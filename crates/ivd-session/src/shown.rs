//! The volume that a session shows, kept while its displacement changes, and what clips it.

use ivd_core::{Displacement, Exec, Volume};
use ivd_field::clip::Kept;
use ivd_field::warp::{Deformed, WarpParams};

use crate::bricks::{merged, touched};
use crate::clip::Clip;
use crate::{Error, Settings};

/// The deformed volume, and what is left of it where it is clipped.
#[derive(Debug)]
pub(crate) struct Shown {
    deformed: Deformed,
    clipped: Option<Kept>,
    clip: Clip,
}

/// What was made anew of it.
#[derive(Debug, Default)]
pub(crate) struct Made {
    /// Bricks whose displacement may have changed, ascending.
    pub(crate) moved: Vec<usize>,
    /// Bricks that may show something else, ascending.
    pub(crate) dirty: Vec<usize>,
    /// Voxels that were computed.
    pub(crate) voxels: u64,
}

/// How else it is to be shown.
pub(crate) struct Change<'a> {
    /// The volume at rest.
    pub(crate) rest: &'a Volume,
    /// The displacement that it is shown under.
    pub(crate) before: &'a Displacement,
    /// The one that it will be shown under; `None` where that stays.
    pub(crate) after: Option<&'a Displacement>,
    /// What it will be shown by.
    pub(crate) next: &'a Settings,
}

impl Shown {
    /// A volume at rest, of which everything is kept.
    pub(crate) fn new(volume: &Volume, params: WarpParams, exec: &Exec) -> Result<Self, Error> {
        let deformed = Deformed::new(volume, params, exec)?;
        Ok(Self { deformed, clipped: None, clip: Clip::default() })
    }

    /// What is shown.
    pub(crate) fn volume(&self) -> &Volume {
        self.clipped.as_ref().map_or(self.deformed.output(), Kept::output)
    }

    /// The same, clipped by nothing.
    pub(crate) fn whole(&self) -> &Volume {
        self.deformed.output()
    }

    /// Shows the volume at rest as it is under a displacement.
    ///
    /// # Errors
    /// The memory limit, cancellation: nothing has changed then.
    pub(crate) fn update(&mut self, change: &Change<'_>, exec: &Exec) -> Result<Made, Error> {
        let &Change { before, after, next, .. } = change;
        let params = next.clip.params();
        // What may fail does so before anything is changed.
        let fresh = match (&params, &self.clipped) {
            (Some(_), None) => Some(Kept::new(self.deformed.output(), exec)?),
            _ => None,
        };
        let mut made = self.warp(change, exec)?;
        self.clipped = fresh.or(self.clipped.take());
        let displacement = after.unwrap_or(before);
        let same = self.clip == next.clip && made.moved.is_empty();
        match (params, &mut self.clipped) {
            (Some(_), Some(_)) if same => {}
            (Some(params), Some(clipped)) => {
                let at_rest = next.clip.is_at_rest();
                let volume = self.deformed.output();
                made.dirty = clipped.update(volume, &params, at_rest, displacement, &made.moved, exec);
            }
            (None, Some(clipped)) => {
                made.dirty = merged(&made.moved, &clipped.clipped(displacement));
                self.clipped = None;
            }
            (_, None) => made.dirty.clone_from(&made.moved),
        }
        self.clip.clone_from(&next.clip);
        Ok(made)
    }

    /// Deforms it, clipped by nothing.
    fn warp(&mut self, change: &Change<'_>, exec: &Exec) -> Result<Made, Error> {
        let &Change { rest, before, after, next } = change;
        let mut made = Made::default();
        if next.warp != *self.deformed.params() || !exec.skip {
            let displacement = after.unwrap_or(before);
            let mut deformed = Deformed::new(rest, next.warp.clone(), exec)?;
            let all = || (0..displacement.inverse().table().len()).collect();
            let here = if exec.skip { touched(displacement)? } else { all() };
            made.voxels = deformed.update(rest, displacement, &here, exec)?;
            made.moved = merged(&here, &touched(before)?);
            self.deformed = deformed;
        } else if let Some(after) = after {
            made.moved = after.changed(before)?;
            made.voxels = self.deformed.update(rest, after, &made.moved, exec)?;
        }
        Ok(made)
    }
}
