//! The body at rest, in the place of what is shown or beside it.

use ivd_core::{Exec, Image, Volume, VoxelIndex};
use ivd_report::Plane;

use super::Model;
use crate::compared::divided;
use crate::{Compared, Error, Pane, Shows};

/// How much of its grey what is taken away has in red, green and blue.
const TAKEN: [f64; 3] = [0.25, 0.3, 0.45];

impl Model {
    /// Shows another state of the body, or divides the pictures elsewhere.
    pub(super) fn compare(&mut self, next: Compared) -> Result<(), Error> {
        if next.shows == Shows::Rest {
            // A hand sees what it holds.
            self.let_go()?;
        }
        let before = std::mem::replace(&mut self.compared, next);
        if before != next {
            self.hovered = None;
            self.touch(&Pane::ALL);
        }
        Ok(())
    }

    /// Something was changed: it is to be seen.
    pub(super) fn show_now(&mut self) {
        if self.compared.shows == Shows::Rest {
            self.compared.shows = Shows::Now;
            self.touch(&Pane::ALL);
        }
    }

    /// The body as a pane shows it at a share.
    pub(super) fn seen(&self, at: [f64; 2]) -> &Volume {
        if self.compared.is_rest_at(at) { self.session.rest() } else { self.session.deformed() }
    }

    /// The body as it is told of where no pane is pointed at.
    pub(crate) fn told(&self) -> &Volume {
        if self.compared.shows == Shows::Rest { self.session.rest() } else { self.session.whole() }
    }

    /// What the panes show.
    pub(crate) fn compared(&self) -> Compared {
        self.compared
    }

    /// Refuses to edit what is pointed at where it is shown at rest: it lies elsewhere now.
    pub(super) fn check_seen_now(&self, what: &'static str, at: &[[f64; 2]]) -> Result<(), Error> {
        if !at.iter().any(|at| self.compared.is_rest_at(*at)) {
            return Ok(());
        }
        Err(Error::Request {
            what,
            problem: "the body is shown at rest there".to_owned(),
            remedy: "show it as it is first",
        })
    }

    /// Draws a pane; `coarser`: by how many the sides of the volume's are divided.
    ///
    /// # Errors
    /// Those of pictures; cancellation.
    pub fn draw(&self, pane: Pane, coarser: usize, exec: &Exec) -> Result<Image, Error> {
        let Compared { shows, at } = self.compared;
        let rest = || match self.panes.planes.plane(pane) {
            Some(plane) => {
                self.panes.planes.draw(plane, self.session.rest(), self.window, |_, grey| [grey; 3])
            }
            None => self.panes.draw(self.session.rest(), self.transfer.as_ref(), coarser, exec),
        };
        let now = || match self.panes.planes.plane(pane) {
            Some(plane) => self.slice_now(plane),
            None => self.panes.draw(self.session.deformed(), self.transfer.as_ref(), coarser, exec),
        };
        match shows {
            Shows::Now => now(),
            Shows::Rest => rest(),
            Shows::Both => divided(&rest()?, &now()?, at),
        }
    }

    /// Draws a slice of the body as it is now, with colours over it; what planes and boxes take away of it is dark.
    fn slice_now(&self, plane: &Plane) -> Result<Image, Error> {
        let largest_mm = self.session.last().largest_mm;
        let clips = !self.session.settings().clip.parts.is_empty();
        self.panes.planes.draw(plane, self.session.whole(), self.window, |voxel, grey| {
            if clips && self.is_taken(voxel) {
                return TAKEN.map(|share| (share * f64::from(grey)).round() as u8);
            }
            self.overlay.map_or([grey; 3], |of| of.over(self.session.displacement(), largest_mm, voxel, grey))
        })
    }

    /// Whether planes and boxes take something else than background away in a voxel.
    pub(super) fn is_taken(&self, voxel: [usize; 3]) -> bool {
        let [shown, whole] =
            [self.session.deformed(), self.session.whole()].map(|volume| volume.value(VoxelIndex(voxel)));
        // What is no number stays none.
        shown != whole && !(shown.is_nan() && whole.is_nan())
    }
}
