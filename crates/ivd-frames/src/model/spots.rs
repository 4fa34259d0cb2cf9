//! Where handles and pins are, and which panes show them.

use ivd_motion::handles::{Action, Pick, find_picks};
use nalgebra::Vector3;

use super::Model;
use super::cut_off::cut_off;
use crate::figures::Spot;
use crate::panes::Depth;
use crate::planes::BESIDE;
use crate::{Error, Pane, Shows};

/// Where something is seen in the volume's picture, and where it is now and at rest.
type Place = (Option<[f64; 2]>, [[f64; 3]; 2]);

/// How far what the volume's picture shows lies before handles, pins and the ends of rulers, in that order.
#[derive(Debug, Default)]
pub(super) struct Hidden {
    /// Version of that picture, and what was looked for in it.
    of: (u64, Vec<Place>),
    /// By how much each is hidden (mm); less than 0: it lies before what is seen.
    by: Vec<f64>,
}

impl Model {
    /// Finds where handles and pins are, and how far what moves leaves the scan.
    pub(super) fn find_spots(&mut self) -> Result<(), Error> {
        let settings = self.session.settings();
        let lattice = self.session.lattice();
        let picks = find_picks(lattice, "handle", settings.handles.iter().map(|one| &one.at))?;
        self.sides.keep(
            lattice,
            settings.level,
            picks.iter().zip(&settings.handles).map(|(pick, one)| (one.id, pick.vertex, one.radius)),
        );
        let outs = picks.iter().zip(&settings.handles);
        let outs: Vec<_> = outs.map(|(pick, one)| self.sides.of(one.id, pick.vertex, one.radius)).collect();
        let alone = settings.space.is_empty() && settings.shapes.is_empty();
        let spots = settings.handles.iter().zip(picks).zip(outs).map(|((one, pick), out)| {
            let now = self.now_at(&pick);
            let voxels = self.session.moved(pick.at);
            let (by, with) = match one.action {
                Action::Move(by) => (Some(by), None),
                Action::Force(with) => (None, Some(with)),
            };
            Spot {
                id: one.id,
                rest: pick.at,
                away_mm: pick.away(),
                now,
                by,
                with,
                radius: one.radius,
                at: [None; 4],
                off: [0.0; 3],
                out,
                inwards: [None; 4],
                gone: alone.then(|| std::array::from_fn(|a| voxels[a] - pick.at[a])),
                seen: [false; 4],
                beside: [false; 4],
            }
        });
        let spots: Vec<Spot> = spots.collect();
        let picks = find_picks(lattice, "fixed vertex", settings.fixed.iter().map(|one| &one.at))?;
        let pins = settings.fixed.iter().zip(picks).map(|(one, pick)| Spot {
            id: one.id,
            rest: pick.at,
            away_mm: pick.away(),
            now: self.seen_at(pick.at, pick.at),
            by: None,
            with: None,
            radius: one.radius,
            at: [None; 4],
            off: [0.0; 3],
            out: None,
            inwards: [None; 4],
            gone: None,
            seen: [false; 4],
            beside: [false; 4],
        });
        (self.pins, self.spots) = (pins.collect(), spots);
        self.cut_off_mm = cut_off(lattice, self.session.motion());
        Ok(())
    }

    /// Where a vertex is seen now.
    pub(super) fn now_at(&self, pick: &Pick) -> [f64; 3] {
        let gone = self.gone_by(pick.vertex);
        self.seen_at(pick.at, std::array::from_fn(|a| pick.at[a] + gone[a]))
    }

    /// Where something is seen that the lattice has brought from a place to another: steps in space move voxels and no lattice, and it is voxels that are seen.
    pub(super) fn seen_at(&self, at: [f64; 3], now: [f64; 3]) -> [f64; 3] {
        if self.session.settings().space.is_empty() { now } else { self.session.moved(at) }
    }

    /// How far a vertex has moved (mm).
    pub(super) fn gone_by(&self, vertex: usize) -> Vector3<f64> {
        self.moved().map_or_else(Vector3::zeros, |moved| Vector3::from(moved[vertex]))
    }

    /// How far each vertex has moved (mm), where any has.
    pub(super) fn moved(&self) -> Option<&[[f64; 3]]> {
        Some(&self.session.motion()?.frames().last()?.displacement)
    }

    /// Finds where the panes show them.
    fn place_spots(&mut self) {
        let grid = self.session.rest().grid();
        let at_rest = self.compared.shows == Shows::Rest;
        let place = |spot: &Spot| if at_rest { spot.rest } else { spot.now };
        for spot in self.spots.iter_mut().chain(&mut self.pins) {
            spot.at = self.panes.shares(grid, &self.lens, place(spot));
            let into = |out: [f64; 3]| std::array::from_fn(|a| place(spot)[a] - 0.5 * spot.radius * out[a]);
            spot.inwards = spot.out.map_or([None; 4], |out| self.panes.shares(grid, &self.lens, into(out)));
            if self.compared.shows == Shows::Both {
                // Each half of a picture shows it where it is there.
                let rest = self.panes.shares(grid, &self.lens, spot.rest);
                let is_rest = |at: &Option<[f64; 2]>| at.is_some_and(|at| self.compared.is_rest_at(at));
                spot.at = std::array::from_fn(|n| if is_rest(&spot.at[n]) { rest[n] } else { spot.at[n] });
            }
            spot.off = self.panes.planes.off(grid, place(spot));
            spot.seen = self.panes.planes.reached(grid, spot.off, spot.radius);
            spot.beside = self.panes.planes.beside(grid, &[place(spot)]);
        }
    }

    /// Finds which of them slices reach, and which of them what the volume's picture shows before them, or is opened by, hides by no more than their radius.
    pub(super) fn find_hidden(&mut self) {
        self.place_spots();
        self.cast_at_spots();
        let beside = self.behind();
        for (spot, by) in self.spots.iter_mut().chain(&mut self.pins).zip(&self.hidden.by) {
            spot.beside[0] = *by > beside;
            spot.seen[0] = *by <= spot.radius.max(beside);
        }
    }

    /// How far behind what the volume's picture shows something may lie and isn't hidden (mm).
    fn behind(&self) -> f64 {
        BESIDE * self.session.rest().grid().voxel_diagonal()
    }

    /// Whether the volume's picture hides any of so many ends of rulers, from one on.
    pub(super) fn hides_ends(&self, first: usize, count: usize) -> bool {
        let ends = self.hidden.by.iter().skip(self.spots.len() + self.pins.len() + first).take(count);
        ends.fold(f64::NEG_INFINITY, |most, by| most.max(*by)) > self.behind()
    }

    /// Finds by how much each is hidden in the volume's picture, where that or they have changed.
    fn cast_at_spots(&mut self) {
        let spots = self.spots.iter().chain(&self.pins);
        let spots = spots.map(|spot| (spot.at[0], [spot.now, spot.rest]));
        let grid = self.session.rest().grid();
        // Of divided pictures a ruler counts in the half that shows the body as it is.
        let counts = |at: &[f64; 2]| self.compared.shows != Shows::Both || !self.compared.is_rest_at(*at);
        let ends = self.shown_ends().map(|place| {
            let at = self.panes.shares(grid, &self.lens, place)[0];
            (at.filter(counts), [place; 2])
        });
        let of: (u64, Vec<Place>) = (self.versions[Pane::Volume.number()], spots.chain(ends).collect());
        if self.hidden.of == of {
            return;
        }
        let towards_eye = Vector3::from(self.lens.axes()[2]);
        let opened = self.panes.cut.and_then(|along| self.panes.here(grid, along).ok());
        let opened = opened.map(|(point, across)| [Vector3::from(point), Vector3::from(across).normalize()]);
        let places = &of.1;
        let mut by = vec![f64::NEG_INFINITY; places.len()];
        let mut is_known = true;
        // Of divided pictures each half shows a body of its own.
        for half in [false, true] {
            let here = places.iter().enumerate().filter_map(|(n, (at, place))| Some((n, place, (*at)?)));
            let here: Vec<_> = here.filter(|(.., at)| self.compared.is_rest_at(*at) == half).collect();
            let Some((.., first)) = here.first() else { continue };
            let shares: Vec<_> = here.iter().map(|(.., at)| (*at, Depth::Shown)).collect();
            let seen = self.panes.look_at_all(&shares, self.seen(*first), &self.exec);
            // What can't be told is shown, and asked again.
            is_known &= seen.is_ok();
            for ((n, place, _), seen) in here.iter().zip(seen.unwrap_or_default()) {
                let place = Vector3::from(place[usize::from(half)]);
                by[*n] = seen.map_or(by[*n], |seen| (Vector3::from(seen) - place).dot(&towards_eye));
                // What is left out with what lies before a plane is hidden as well.
                by[*n] = by[*n].max(opened.map_or(by[*n], |[point, across]| (point - place).dot(&across)));
            }
        }
        self.hidden = Hidden { of: if is_known { of } else { (0, Vec::new()) }, by };
    }
}
