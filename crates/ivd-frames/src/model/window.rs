//! What a scene says of windows, and what is said there of this one.

use ivd_core::Grid;
use ivd_pipeline::scene::{RulerSection, WindowSection};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Model;
use crate::planes::Planes;
use crate::{Compared, Error, Shows};

/// What windows and scenes have the same word for.
fn same<A: Serialize, B: DeserializeOwned>(of: A) -> Option<B> {
    serde_json::to_value(of).and_then(serde_json::from_value).ok()
}

/// Reach (mm) of a handle in a volume where nobody says it: a share of its shortest side.
pub(crate) fn usual_radius(grid: &Grid) -> f64 {
    let [low, high] = grid.extent();
    let side = (0..3).map(|a| high[a] - low[a]).fold(f64::INFINITY, f64::min);
    (0.15 * side).max(f64::MIN_POSITIVE)
}

impl Model {
    /// Reach of the next handle where nobody says it (mm): as far as the farthest goes, or as is usual.
    pub(super) fn first_radius(&self) -> f64 {
        let usual = usual_radius(self.session.rest().grid());
        let largest = self.session.settings().handles.iter().map(|one| one.radius).fold(0.0, f64::max);
        if largest > 0.0 { largest } else { usual }
    }

    /// Shows what a scene says that windows show.
    pub(super) fn show_section(&mut self, said: &WindowSection) -> Result<(), Error> {
        let grid = self.session.rest().grid().clone();
        if let Some(cross) = said.cross {
            self.panes.planes.meet(cross, &grid);
        }
        self.window = self.first_window.or_said(said);
        self.radius = said.radius.unwrap_or_else(|| self.first_radius());
        self.panes.cut = said.inside.and_then(same);
        self.overlay = said.over.and_then(same);
        for RulerSection { places } in &said.ruler {
            self.add_ruler_at_rest(places);
        }
        let shows = said.shows.and_then(same).unwrap_or_default();
        self.compare(Compared { shows, at: said.line.unwrap_or(self.compared.at) })
    }

    /// The same of what is shown now.
    pub(crate) fn section(&self) -> WindowSection {
        let grid = self.session.rest().grid();
        let (cross, middle) = (self.panes.planes.cross, Planes::new(grid).cross);
        let ruler = self.rulers_at_rest().into_iter().map(|places| RulerSection { places });
        WindowSection {
            cross: (cross != middle).then(|| self.panes.planes.place(grid)),
            values: (self.window != self.first_window).then_some([self.window.low, self.window.high]),
            radius: Some(self.radius).filter(|radius| *radius != self.first_radius()),
            colours: self.turned.said(),
            inside: self.panes.cut.and_then(same),
            line: Some(self.compared.at)
                .filter(|at| self.compared.shows == Shows::Both && *at != Compared::default().at),
            shows: Some(self.compared.shows).filter(|shows| *shows != Shows::Now).and_then(same),
            over: self.overlay.and_then(same),
            ruler: ruler.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use ivd_pipeline::scene::{Body, Inside, Over};

    use super::*;
    use crate::{Overlay, Pane};

    #[test]
    fn windows_and_scenes_have_the_same_words() {
        let panes = Pane::ALL.map(same::<_, Inside>);
        assert!(panes.iter().all(Option::is_some));
        assert_eq!(panes.map(same::<_, Pane>), Pane::ALL.map(Some));
        let shows = Shows::ALL.map(same::<_, Body>);
        assert_eq!(shows.map(same::<_, Shows>), Shows::ALL.map(Some));
        let overlays = Overlay::ALL.map(same::<_, Over>);
        assert_eq!(overlays.map(same::<_, Overlay>), Overlay::ALL.map(Some));
    }
}
