//! What is seen, to be seen so once more.

use ivd_core::Grid;
use ivd_render::View;
use serde::{Deserialize, Serialize};

use crate::bounds::FARTHEST;
use crate::colours::Window;
use crate::{Error, Figures};

/// The camera, the slices, and the reach of the next handle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sight {
    /// Azimuth and elevation of the camera (degrees).
    pub angles: [f64; 2],
    /// How far it is turned about its line of sight (degrees).
    pub roll: f64,
    /// Magnification.
    pub zoom: f64,
    /// What lies in the middle of the volume's pane (mm, RAS).
    pub middle: [f64; 3],
    /// Where the slices meet (mm, RAS).
    pub cross: [f64; 3],
    /// Values that are black and white in them.
    pub window: [f64; 2],
    /// Reach of the next handle (mm).
    pub radius: f64,
}

impl Sight {
    /// Refuses what no window shows.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Self { angles: [azimuth, elevation], roll, zoom, middle, cross, window: [low, high], radius } =
            *self;
        let lengths = [azimuth, radius].into_iter().chain(middle).chain(cross);
        let is_window = (high - low).is_finite() && high > low;
        let is_right = lengths.into_iter().all(|length| length.is_finite() && length.abs() <= FARTHEST)
            && (-90.0..=90.0).contains(&elevation)
            && (-360.0..=360.0).contains(&roll)
            && (1e-3..=1e6).contains(&zoom)
            && is_window
            && radius > 0.0;
        if is_right {
            return Ok(());
        }
        Err(Error::Request {
            what: "show",
            problem: format!("{self:?}"),
            remedy: "use numbers up to a million, an elevation of −90 to 90, a roll of −360 to 360, a zoom of 0.001 to a million, black below white, and a positive radius",
        })
    }

    /// Where the volume is seen from; what isn't said of that is as in another view.
    pub(crate) fn view(&self, other: View, grid: &Grid) -> View {
        let [low, high] = grid.extent();
        let middle = std::array::from_fn(|a| self.middle[a].clamp(low[a], high[a]));
        View { angles: self.angles, roll: self.roll, zoom: self.zoom, target: Some(middle), ..other }
    }

    pub(crate) fn window(&self) -> Window {
        Window { low: self.window[0], high: self.window[1] }
    }
}

impl Figures {
    /// What is seen.
    pub fn sight(&self) -> Sight {
        Sight {
            angles: self.angles,
            roll: self.roll,
            zoom: self.zoom,
            middle: self.middle,
            cross: self.cross,
            window: self.window,
            radius: self.radius,
        }
    }
}
