//! Cuts, clips and bones.

use ivd_core::Grid;
use ivd_field::clip::HalfSpace;
use ivd_map::space::{Cut, Step};
use ivd_motion::rigid::RigidTransform;
use ivd_session::{ClipPart, Event};

use super::Model;
use crate::request::MOST_HANDLES;
use crate::{Error, Request};

/// Fraction of a cut's radius within which it opens whole.
const CORE: f64 = 0.5;

/// Most voxels of the box round a cut: for each some 120 bytes are needed while it is made.
const MOST_VOXELS: f64 = 4e6;

/// Refuses a cut that reaches too many voxels.
fn check_reach(grid: &Grid, radius: f64) -> Result<(), Error> {
    let (reach, dims) = (grid.ball_extent(radius), grid.dims());
    let voxels: f64 = (0..3).map(|a| (2.0 * reach[a] + 1.0).min(dims[a] as f64)).product();
    if voxels <= MOST_VOXELS {
        return Ok(());
    }
    let problem =
        format!("within {radius} mm there are up to {voxels:.0} voxels, and a cut may reach {MOST_VOXELS}");
    Err(Error::Request { what: "cut", problem, remedy: "use a smaller radius" })
}

impl Model {
    /// Follows a request about a part of the settings that isn't a handle.
    pub(super) fn change_part(&mut self, request: &Request) -> Result<(), Error> {
        // What is held stays one step by itself; a slider that is held goes on.
        if !self.adjusts {
            self.let_go()?;
        }
        match *request {
            Request::Incise { centre, normal, radius, open } => {
                check_reach(self.session.rest().grid(), radius)?;
                let step = Step::Cut(Cut { centre, normal, radius, core: CORE, open });
                let steps = &self.session.settings().space;
                let there = steps.iter().find(|one| matches!(one.what, Step::Cut(_))).map(|one| one.id);
                self.apply(match there {
                    Some(space) => Event::Respace { space, step },
                    None => Event::Space { id: None, step },
                })
            }
            Request::Close { space } => self.apply(Event::Unspace { space }),
            Request::Clip { point, normal } => {
                self.no_more_than(MOST_HANDLES)?;
                self.apply(Event::Clip { id: None, part: ClipPart::Plane(HalfSpace { point, normal }) })
            }
            Request::Unclip { clip } => self.apply(Event::Unclip { clip }),
            Request::Turn { bone, pivot, axis, angle, by } => {
                self.apply(Event::Turn { bone, to: RigidTransform { pivot, axis, angle, by } })
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_of_too_many_voxels_is_refused_before_anything_is_made() {
        let grid = Grid::with_spacing([512; 3], [0.5; 3]).expect("a grid");
        assert!(check_reach(&grid, 39.0).is_ok());
        for radius in [40.0, 1e6] {
            assert!(check_reach(&grid, radius).is_err_and(|error| error.to_string().contains("smaller")));
        }
        // What there isn't costs nothing.
        let small = Grid::with_spacing([128; 3], [1.0; 3]).expect("a grid");
        assert!(check_reach(&small, 1e6).is_ok());
    }
}
