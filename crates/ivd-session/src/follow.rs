//! What goes along with a deformed volume: labels, where somebody asks for them, and single places.

use ivd_core::{Exec, Labels, World};
use ivd_field::clip::KeptLabels;
use ivd_field::place;
use ivd_field::warp::{DeformedLabels, WarpParams};

use crate::Error;
use crate::bricks::{merged, touched};
use crate::session::Session;

/// Deformed labels, and the bricks in which they are behind.
#[derive(Debug)]
pub(crate) struct Followed {
    labels: DeformedLabels,
    behind: Vec<usize>,
    /// What planes and boxes leave of them, where that was asked for.
    kept: Option<KeptLabels>,
    /// The bricks in which that is behind.
    kept_behind: Vec<usize>,
}

impl Followed {
    /// Notes bricks whose displacement has changed.
    pub(crate) fn fall_behind(&mut self, bricks: &[usize]) {
        self.behind = merged(&self.behind, bricks);
        if self.kept.is_some() {
            self.kept_behind = merged(&self.kept_behind, bricks);
        }
    }
}

impl Session {
    /// The classes' labels, deformed as the volume is and clipped by nothing: nearest labels, and background where nothing has come to. `None`
    /// where the session began without labels.
    ///
    /// Nothing is kept of them until they are asked for; from then on the bricks that have changed since are made anew by each asking.
    ///
    /// # Errors
    /// The memory limit, cancellation.
    pub fn deformed_labels(&mut self, exec: &Exec) -> Result<Option<&Labels>, Error> {
        let Some(labels) = &self.labels else { return Ok(None) };
        let mut followed = match self.followed.take() {
            Some(followed) => followed,
            None => Followed {
                labels: DeformedLabels::new(labels, &WarpParams::default(), exec)?,
                behind: touched(self.displacement())?,
                kept: None,
                kept_behind: Vec::new(),
            },
        };
        let made = followed.labels.update(labels, self.displacement(), &followed.behind, exec);
        if made.is_ok() {
            followed.behind.clear();
        }
        let followed = self.followed.insert(followed);
        made?;
        Ok(Some(followed.labels.output()))
    }

    /// Makes [`Session::shown_labels`] those of the present state, by the bricks that have changed since.
    ///
    /// # Errors
    /// The memory limit, cancellation: none are shown then.
    pub fn follow_labels(&mut self, exec: &Exec) -> Result<(), Error> {
        let deformed = self.deformed_labels(exec).map(|_| ());
        // Put back once it is that of the present state.
        let Some(mut followed) = self.followed.take() else { return deformed };
        deformed?;
        let clip = &self.settings().clip;
        followed.kept = match clip.params() {
            None => None,
            Some(params) => {
                let labels = followed.labels.output();
                let mut kept = match followed.kept.take() {
                    Some(kept) => kept,
                    None => KeptLabels::new(labels, exec)?,
                };
                let behind = std::mem::take(&mut followed.kept_behind);
                kept.update(labels, &params, clip.is_at_rest(), self.displacement(), &behind, exec);
                Some(kept)
            }
        };
        self.followed = Some(followed);
        Ok(())
    }

    /// The labels of what is shown: deformed, and 0 where planes and boxes take away. They are those of the present state where [`Session::follow_labels`]
    /// was called since it was reached; `None` where it never was, failed, or what it kept was let go ([`Session::forget`]).
    pub fn shown_labels(&self) -> Option<&Labels> {
        let followed = self.followed.as_ref()?;
        Some(followed.kept.as_ref().map_or(followed.labels.output(), KeptLabels::output))
    }

    /// Where what rests at a place is now (mm, RAS); see [`place::moved`].
    pub fn moved(&self, rest: [f64; 3]) -> [f64; 3] {
        let (displacement, grid) = (self.displacement(), self.rest().grid());
        grid.world(place::moved(displacement, grid.voxel(World(rest.into())))).0.into()
    }

    /// Where what is now at a place was at rest (mm, RAS); see [`place::at_rest`].
    pub fn rest_of(&self, now: [f64; 3]) -> [f64; 3] {
        let (displacement, grid) = (self.displacement(), self.rest().grid());
        grid.world(place::at_rest(displacement, grid.voxel(World(now.into())))).0.into()
    }
}
