//! What goes along with a deformed volume: labels, where somebody asks for them, and single places.

use ivd_core::{Exec, Labels, World};
use ivd_field::clip::{self, By, ClipParams};
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
    /// What planes and boxes leave of them, where there are any.
    clipped: Option<Labels>,
}

impl Followed {
    /// Notes bricks whose displacement has changed.
    pub(crate) fn fall_behind(&mut self, bricks: &[usize]) {
        self.behind = merged(&self.behind, bricks);
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
                clipped: None,
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

    /// Makes [`Session::shown_labels`] those of the present state.
    ///
    /// # Errors
    /// The memory limit, cancellation.
    pub fn follow_labels(&mut self, exec: &Exec) -> Result<(), Error> {
        self.deformed_labels(exec)?;
        let clip = &self.settings().clip;
        let by = By { tag: None, displacement: clip.is_at_rest().then(|| self.displacement()) };
        let clipped = match (&self.followed, clip.params()) {
            (Some(followed), Some(params)) => {
                // A value that stands in for what is thrown away is no label.
                let params = ClipParams { background: None, ..params };
                Some(clip::labels(followed.labels.output(), &params, &by, exec)?.output)
            }
            _ => None,
        };
        if let Some(followed) = &mut self.followed {
            followed.clipped = clipped;
        }
        Ok(())
    }

    /// The labels of what is shown: deformed, and 0 where planes and boxes take away, as [`Session::follow_labels`] made them last; `None` before.
    pub fn shown_labels(&self) -> Option<&Labels> {
        let followed = self.followed.as_ref()?;
        Some(followed.clipped.as_ref().unwrap_or(followed.labels.output()))
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
