//! The body at rest, in the place of what is shown or beside it.

use std::collections::BTreeMap;

use ivd_core::{Classified as _, ErrorClass, Exec, Image, Labels, Volume, VoxelIndex};
use ivd_field::clip::{self, By, ClipParams};
use ivd_report::Plane;
use nalgebra::Vector3;

use super::Model;
use crate::compared::divided;
use crate::overlay::tinted;
use crate::panes::Seen;
use crate::{Compared, Error, Overlay, Pane, ShownBy, Shows};

/// How much of its grey what is taken away has: of no colour, as colours over slices mean something.
const TAKEN: f64 = 0.3;

impl Model {
    /// Shows another state of the body, or divides the pictures elsewhere.
    pub(super) fn compare(&mut self, next: Compared) -> Result<(), Error> {
        if next.shows == Shows::Rest {
            // A hand sees what it holds.
            self.let_go()?;
        }
        let before = std::mem::replace(&mut self.compared, next);
        if before != next {
            if let Err(error) = self.clip_rest() {
                self.compared = before;
                return Err(error);
            }
            self.hovered = None;
            self.touch(&Pane::ALL);
        }
        Ok(())
    }

    /// Takes away of the body at rest what planes and boxes take away, while it is shown.
    pub(super) fn clip_rest(&mut self) -> Result<(), Error> {
        let shown = self.compared.shows != Shows::Now;
        let Some(params) = self.session.settings().clip.params().filter(|_| shown) else {
            self.rest = None;
            return Ok(());
        };
        // Of both halves only the other's bricks are known to have changed.
        if self.rest.as_ref().is_none_or(|(same, ..)| *same != params) {
            let clipped = clip::volume(self.session.rest(), &params, &By::default(), &self.exec)?.output;
            clipped.find_bricks(&self.exec)?;
            // A value that stands in for what is thrown away is no label.
            let of_labels = ClipParams { background: None, ..params.clone() };
            let labels = self.subject.drawn_labels();
            let labels = labels.map(|labels| clip::labels(labels, &of_labels, &By::default(), &self.exec));
            self.rest = Some((params, clipped, labels.transpose()?.map(|clipped| clipped.output)));
            self.touch(&Pane::ALL);
        }
        Ok(())
    }

    /// The body at rest, as it is shown.
    fn seen_at_rest(&self) -> Seen<'_> {
        let (volume, labels) = match &self.rest {
            Some((_, clipped, labels)) => (clipped, labels.as_ref()),
            None => (self.session.rest(), self.subject.drawn_labels()),
        };
        self.in_colours(volume, labels)
    }

    /// The body as it is now.
    fn seen_now(&self) -> Seen<'_> {
        let labels = self.subject.drawn_labels().and_then(|_| self.session.shown_labels());
        self.in_colours(self.session.deformed(), labels)
    }

    fn in_colours<'a>(&'a self, volume: &'a Volume, labels: Option<&'a Labels>) -> Seen<'a> {
        Seen { volume, labels, ..self.subject.seen(self.transfer.as_ref()) }
    }

    /// Lets the labels that pictures go by follow what is shown. Where there is no room for them pictures go by values, which is told.
    ///
    /// # Errors
    /// Cancellation.
    pub(super) fn follow_labels(&mut self) -> Result<(), Error> {
        if self.subject.shown_by == ShownBy::Values {
            return Ok(());
        }
        match self.session.follow_labels(&self.exec) {
            Err(error) if error.error_class() == ErrorClass::Cancelled => Err(error.into()),
            Err(error) => {
                self.exec
                    .observer()
                    .note(&format!("the volume's picture goes by values from now on: {error}"));
                self.subject.shown_by = ShownBy::Values;
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Something was changed: it is to be seen.
    pub(super) fn show_now(&mut self) {
        if self.compared.shows == Shows::Rest {
            self.compared.shows = Shows::Now;
            self.touch(&Pane::ALL);
        }
    }

    /// The body as a pane shows it at a share.
    pub(super) fn seen(&self, at: [f64; 2]) -> Seen<'_> {
        if self.compared.is_rest_at(at) { self.seen_at_rest() } else { self.seen_now() }
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
            remedy: "show it deformed first",
        })
    }

    /// Draws a pane; `coarser`: by how many the sides of the volume's are divided.
    ///
    /// # Errors
    /// Those of pictures; cancellation.
    pub fn draw(&self, pane: Pane, coarser: usize, exec: &Exec) -> Result<Image, Error> {
        let Compared { shows, at } = self.compared;
        let rest = || match self.panes.planes.plane(pane) {
            Some(plane) => self.slice_at_rest(plane),
            None => self.panes.draw(self.seen_at_rest(), coarser, exec),
        };
        let now = || match self.panes.planes.plane(pane) {
            Some(plane) => self.slice_now(plane),
            None => self.panes.draw(self.seen_now(), coarser, exec),
        };
        match shows {
            Shows::Now => now(),
            Shows::Rest => rest(),
            Shows::Both => divided(&rest()?, &now()?, at),
        }
    }

    /// Draws a slice of the body as it is now, with colours over it; what planes and boxes take away of it is dark.
    fn slice_now(&self, plane: &Plane) -> Result<Image, Error> {
        let (displacement, largest_mm) = (self.session.displacement(), self.session.last().largest_mm);
        let clips = !self.session.settings().clip.parts.is_empty();
        let (grid, colours) = (displacement.grid(), self.colours_over());
        // Of what lies there now.
        let class = |voxel: [usize; 3]| {
            let now = grid.world(VoxelIndex(voxel).into()).0;
            let way = displacement.inverse().at(VoxelIndex(voxel)).map(f64::from);
            self.class_colour((now + Vector3::from(way)).into(), &colours)
        };
        self.panes.planes.draw(plane, self.session.whole(), self.window, |voxel, grey| {
            if clips && self.is_taken(voxel) {
                return taken(grey);
            }
            self.overlay.map_or([grey; 3], |of| of.over(displacement, largest_mm, class, voxel, grey))
        })
    }

    /// Draws a slice of the body at rest: nothing has moved there, but it has its classes.
    fn slice_at_rest(&self, plane: &Plane) -> Result<Image, Error> {
        let (volume, colours) = (self.session.rest(), self.colours_over());
        self.panes.planes.draw(plane, volume, self.window, |voxel, grey| match self.overlay {
            _ if self.is_taken_at_rest(voxel) => taken(grey),
            Some(Overlay::Classes) => {
                let at = volume.grid().world(VoxelIndex(voxel).into()).0;
                tinted(grey, self.class_colour(at.into(), &colours))
            }
            _ => [grey; 3],
        })
    }

    /// The colour of the class at a place at rest (mm, RAS), of those that are given.
    fn class_colour(&self, rest: [f64; 3], colours: &BTreeMap<u16, [u8; 3]>) -> Option<[u8; 3]> {
        self.class_at(rest).and_then(|class| colours.get(&class).copied())
    }

    /// The colours of classes, where they lie over slices.
    fn colours_over(&self) -> BTreeMap<u16, [u8; 3]> {
        let are_seen = self.overlay == Some(Overlay::Classes);
        if are_seen { self.class_colours() } else { BTreeMap::new() }
    }

    /// Whether planes and boxes take something else than background away in a voxel.
    pub(super) fn is_taken(&self, voxel: [usize; 3]) -> bool {
        differ(self.session.deformed(), self.session.whole(), voxel)
    }

    /// The same of the body at rest.
    pub(super) fn is_taken_at_rest(&self, voxel: [usize; 3]) -> bool {
        self.rest.as_ref().is_some_and(|(_, clipped, _)| differ(clipped, self.session.rest(), voxel))
    }
}

/// Whether two volumes differ in a voxel; what is no number stays none.
fn differ(one: &Volume, other: &Volume, voxel: [usize; 3]) -> bool {
    let [one, other] = [one, other].map(|volume| volume.value(VoxelIndex(voxel)));
    one != other && !(one.is_nan() && other.is_nan())
}

/// What is taken away, as slices show it.
fn taken(grey: u8) -> [u8; 3] {
    [(TAKEN * f64::from(grey)).round() as u8; 3]
}
