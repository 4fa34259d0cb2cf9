//! The body at rest, in the place of what is shown or beside it.

use ivd_core::{Exec, Image, Volume};

use super::Model;
use crate::compared::divided;
use crate::{Compared, Error, Overlay, Pane, Shows};

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
        if self.compared.shows == Shows::Rest { self.session.rest() } else { self.session.deformed() }
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
        let rest = || self.drawn(pane, self.session.rest(), None, coarser, exec);
        let now = || self.drawn(pane, self.session.deformed(), self.overlay, coarser, exec);
        match shows {
            Shows::Now => now(),
            Shows::Rest => rest(),
            Shows::Both => divided(&rest()?, &now()?, at),
        }
    }

    /// Draws a state of the body in a pane, with colours over it.
    fn drawn(
        &self,
        pane: Pane,
        volume: &Volume,
        overlay: Option<Overlay>,
        coarser: usize,
        exec: &Exec,
    ) -> Result<Image, Error> {
        match self.panes.planes.plane(pane) {
            Some(plane) => self.panes.planes.draw(plane, volume, self.window, |voxel, grey| {
                let largest_mm = self.session.last().largest_mm;
                let colour = |of: Overlay| of.over(self.session.displacement(), largest_mm, voxel, grey);
                overlay.map_or([grey; 3], colour)
            }),
            None => self.panes.draw(volume, self.transfer.as_ref(), coarser, exec),
        }
    }
}
