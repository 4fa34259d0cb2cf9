//! Incisions by a line that is drawn over a picture.

use ivd_core::VoxelCoord;
use nalgebra::Vector3;

use super::Model;
use super::parts::cut_of;
use crate::figures::{Incision, value_at};
use crate::panes::Across;
use crate::{Error, Pane, Request};

/// How far the lips of a new cut are apart, as a share of its radius.
const OPEN: f64 = 0.25;
/// They are no further apart at first (mm).
const WIDEST: f64 = 5.0;
/// A line is no shorter than so many voxel diagonals: a click is none.
const SHORTEST: f64 = 2.0;
/// So many places of a line are looked at, at most, for something that is seen.
const LOOKED_AT: f64 = 512.0;

/// What to do instead.
const DRAW: &str = "draw a line over the body, from one end of the cut to the other";

fn wrong(problem: &str, remedy: &'static str) -> Error {
    Error::Request { what: "cut", problem: problem.to_owned(), remedy }
}

impl Model {
    /// Cuts open what a line goes over: the cut's mouth lies along it, its plane along the line of sight.
    pub(super) fn stroke(&mut self, pane: Pane, from: [f64; 2], to: [f64; 2]) -> Result<(), Error> {
        self.check_seen_now("cut", &[from, to])?;
        let halfway = [0, 1].map(|a| f64::midpoint(from[a], to[a]));
        let places = [self.look(pane, from)?, self.look(pane, halfway)?, self.look(pane, to)?];
        let [Some(first), Some(centre), Some(last)] = places.map(|place| place.map(Vector3::from)) else {
            let problem = if from == to { "nothing is seen there" } else { "the line leaves what is seen" };
            return Err(wrong(problem, DRAW));
        };
        let grid = self.session.rest().grid();
        // Over what is round a line is longer than from end to end; over what leaps away behind an edge it isn't as long as the leap.
        let over = 0.5 * ((centre - first).norm() + (last - centre).norm());
        let Across { right, down } = self.panes.across(pane, grid, &self.lens, centre.into());
        let drawn = (right * (to[0] - from[0]) + down * (to[1] - from[1])).norm();
        let radius = over.min(drawn);
        if 2.0 * radius < SHORTEST * grid.voxel_diagonal() {
            return Err(wrong("the line is too short", DRAW));
        }
        let along = last - first;
        let sight = if pane == Pane::Volume {
            Vector3::from(self.lens.sight(centre.into()))
        } else {
            self.check_seen(first, last)?;
            right.cross(&down)
        };
        let normal = along.cross(&sight);
        if normal.norm() < 1e-6 * along.norm() * sight.norm() {
            return Err(wrong("the line goes straight away from you", "turn the volume first"));
        }
        let (centre, normal) = (centre.into(), normal.normalize().into());
        self.change_part(&Request::Incise { centre, normal, radius, open: (OPEN * radius).min(WIDEST) })
    }

    /// Refuses a line over a slice where all of it is black.
    fn check_seen(&self, first: Vector3<f64>, last: Vector3<f64>) -> Result<(), Error> {
        let volume = self.session.whole();
        let finest = volume.grid().spacing().into_iter().fold(f64::INFINITY, f64::min);
        let count = ((last - first).norm() / finest).ceil().clamp(1.0, LOOKED_AT) as usize;
        let places = (0..=count).map(|i| first + (last - first) * (i as f64 / count as f64));
        let mut values = places.filter_map(|place| value_at(volume, place.into()));
        if values.any(|value| self.window.grey(value) > 0) {
            return Ok(());
        }
        Err(wrong("nothing is seen there", DRAW))
    }

    /// The cut that there is, and where the panes show its mouth.
    pub(crate) fn incision(&self) -> Option<Incision> {
        let (id, cut) = cut_of(self.session.settings())?;
        let grid = self.session.rest().grid();
        let (centre, normal) = (Vector3::from(cut.centre), Vector3::from(cut.normal).normalize());
        let mouth = |pane: Pane| {
            let (middle, across) = match self.panes.planes.plane(pane) {
                None => (centre, Vector3::from(self.lens.sight(cut.centre))),
                Some(plane) => {
                    let slice = self.panes.planes.slice(plane, grid.dims());
                    let inside = VoxelCoord(plane.voxel(grid.dims(), slice as f64, [0.5; 2]).into());
                    let Across { right, down } = self.panes.across(pane, grid, &self.lens, cut.centre);
                    let across = right.cross(&down).normalize();
                    // Down the plane of the cut to the slice.
                    let down = across - normal * normal.dot(&across);
                    let off = (grid.world(inside).0 - centre).dot(&across);
                    (centre + down * (off / down.norm_squared()), across)
                }
            };
            let along = normal.cross(&across);
            let half = (cut.radius * cut.radius - (middle - centre).norm_squared()).sqrt();
            let along = along * (half / along.norm());
            // Along the slice, or beside it, there is no such line.
            along.iter().all(|c| c.is_finite()).then_some([middle - along, middle + along])
        };
        let at = Pane::ALL.map(|pane| {
            let ends = mouth(pane)?.map(|end| self.panes.shares(grid, &self.lens, end.into())[pane.number()]);
            Some([ends[0]?, ends[1]?])
        });
        let (normal, radius, open) = (normal.into(), cut.radius, cut.open);
        Some(Incision { id, centre: cut.centre, normal, radius, open, at })
    }
}
