//! Looking into the body: what lies before a plane where the slices meet is left out of the volume's picture.

use nalgebra::Vector3;

use super::Model;
use crate::{Error, Pane, ShownBy};

/// A plane that leaves out less than this share of how deep the body is, or leaves less of it, shows next to nothing of its inside.
const SHALLOW: f64 = 0.15;

impl Model {
    /// Cuts the volume's picture open along a pane, or closes it. Where the slices meet near the body's edge, as they do after its surface was dragged, they go
    /// to its middle first.
    pub(super) fn look_inside(&mut self, along: Option<Pane>) -> Result<(), Error> {
        if let Some(along) = along.filter(|_| self.panes.cut != along) {
            let grid = self.session.rest().grid().clone();
            let (point, normal) = self.panes.here(&grid, along)?;
            let (point, normal) = (Vector3::from(point), Vector3::from(normal).normalize());
            if let Some(by) = self.to_middle(point, normal) {
                let moved = self.panes.planes.meet((point + normal * by).into(), &grid);
                self.touch(&moved);
                self.moved_cross();
            }
        }
        self.panes.cut = along;
        self.touch(&[Pane::Volume]);
        Ok(())
    }

    /// How far the body's middle lies behind a plane (mm), where the plane lies near its edge or beside it. Nothing is told where what is moved is a part of
    /// what is drawn: its edge isn't the body's.
    fn to_middle(&self, point: Vector3<f64>, normal: Vector3<f64>) -> Option<f64> {
        let lattice = self.session.lattice();
        let is_body = self.subject.made.class.is_none() && self.subject.shown_by == ShownBy::Values;
        let vertices = 0..if is_body { lattice.keys().len() } else { 0 };
        let behind = vertices.map(|v| (lattice.world(v).0 + self.gone_by(v) - point).dot(&normal));
        let [low, high] =
            behind.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], d| [low.min(d), high.max(d)]);
        let least = SHALLOW * (high - low);
        (low < high && (-low < least || high < least)).then(|| f64::midpoint(low, high))
    }
}
