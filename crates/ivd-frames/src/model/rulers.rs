//! Lengths and angles of what is seen. They go with the body, and are no part of what is done to it.

use nalgebra::Vector3;

use super::{Model, no_more_than, nothing_there};
use crate::figures::Ruler;
use crate::planes::BESIDE;
use crate::request::MOST_HANDLES;
use crate::{Error, Pane, Request, Shows};

/// A line that begins so near to an end of another begins there (shares of the pane).
const NEAR: f64 = 0.025;
/// A line is no shorter than this share of a voxel diagonal: a click is none.
const SHORTEST: f64 = 0.2;

/// Two or three places of the body; of three the angle is at the second.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Places {
    id: u32,
    ends: Vec<End>,
}

/// A place of the body (mm, RAS).
#[derive(Debug, Clone, Copy, PartialEq)]
struct End {
    now: [f64; 3],
    rest: [f64; 3],
}

impl Model {
    /// Measures, or takes a ruler elsewhere or away: each is a step.
    pub(super) fn change_rulers(&mut self, request: &Request) -> Result<(), Error> {
        let name = match request {
            Request::Unmeasure { ruler } => format!("remove ruler {ruler}"),
            Request::Ruler { ruler: Some(ruler), .. } => format!("move ruler {ruler}"),
            _ => "measure".to_owned(),
        };
        self.view_otherwise((name, false), |model| match request {
            Request::Measure { pane, from, to } => model.measure(*pane, *from, *to),
            Request::Ruler { ruler, places } => model.rule(*ruler, places),
            Request::Unmeasure { ruler } => model.remove_ruler(*ruler),
            _ => Ok(()),
        })
    }

    /// Measures along a line that is drawn over a picture. One that begins at an end of another makes an angle with it there.
    fn measure(&mut self, pane: Pane, from: [f64; 2], to: [f64; 2]) -> Result<(), Error> {
        if self.compared.shows == Shows::Both {
            self.check_seen_now("measure", &[from, to])?;
        }
        let seen = |at| {
            let place = self.look(pane, at)?;
            place.map(|place| self.end_of(place)).ok_or_else(|| nothing_there("measure"))
        };
        let last = seen(to)?;
        match self.end_near(pane, from) {
            // The angle is at the end that both have.
            Some((ruler, end)) if self.rulers[ruler].ends.len() == 2 => {
                let other = self.rulers[ruler].ends[1 - end];
                let ends = vec![other, self.rulers[ruler].ends[end], last];
                self.check_ends(&ends)?;
                self.rulers[ruler].ends = ends;
                Ok(())
            }
            Some((ruler, end)) => self.add_ruler(vec![self.rulers[ruler].ends[end], last]),
            None => self.add_ruler(vec![seen(from)?, last]),
        }
    }

    /// Measures between places as they are shown, in the place of another ruler or as one more.
    fn rule(&mut self, ruler: Option<u32>, places: &[[f64; 3]]) -> Result<(), Error> {
        let ends: Vec<End> = places.iter().map(|place| self.end_of(*place)).collect();
        let Some(id) = ruler else { return self.add_ruler(ends) };
        self.check_ends(&ends)?;
        let there = self.rulers.iter_mut().find(|one| one.id == id);
        there.ok_or_else(|| no_ruler(id))?.ends = ends;
        Ok(())
    }

    /// Takes a ruler away.
    fn remove_ruler(&mut self, id: u32) -> Result<(), Error> {
        let there = self.rulers.iter().position(|one| one.id == id);
        self.rulers.remove(there.ok_or_else(|| no_ruler(id))?);
        Ok(())
    }

    fn add_ruler(&mut self, ends: Vec<End>) -> Result<(), Error> {
        no_more_than(MOST_HANDLES, self.rulers.len())?;
        self.check_ends(&ends)?;
        self.push_ruler(ends);
        Ok(())
    }

    fn push_ruler(&mut self, ends: Vec<End>) {
        let id = self.next_ruler;
        self.next_ruler = id.wrapping_add(1);
        self.rulers.push(Places { id, ends });
    }

    /// Measures between places at rest.
    pub(super) fn add_ruler_at_rest(&mut self, places: &[[f64; 3]]) {
        let end = |&rest: &[f64; 3]| End { now: self.session.moved(rest), rest };
        let ends = places.iter().map(end).collect();
        self.push_ruler(ends);
    }

    /// The places at rest that are measured between.
    pub(super) fn rulers_at_rest(&self) -> Vec<Vec<[f64; 3]>> {
        self.rulers.iter().map(|one| one.ends.iter().map(|end| end.rest).collect()).collect()
    }

    /// A place that is shown, now and at rest.
    fn end_of(&self, place: [f64; 3]) -> End {
        match self.compared.shows {
            Shows::Rest => End { now: self.session.moved(place), rest: place },
            Shows::Now | Shows::Both => End { now: place, rest: self.rest_of(place) },
        }
    }

    /// Where an end is shown.
    fn shown_end(&self, end: &End) -> [f64; 3] {
        if self.compared.shows == Shows::Rest { end.rest } else { end.now }
    }

    /// Where the ends of all rulers are shown.
    pub(super) fn shown_ends(&self) -> impl Iterator<Item = [f64; 3]> {
        self.rulers.iter().flat_map(|one| &one.ends).map(|end| self.shown_end(end))
    }

    /// Refuses lines that are none.
    fn check_ends(&self, ends: &[End]) -> Result<(), Error> {
        let least = SHORTEST * self.session.rest().grid().voxel_diagonal();
        let longest = |pair: &[End]| length(pair[0].now, pair[1].now).min(length(pair[0].rest, pair[1].rest));
        if ends.windows(2).all(|pair| longest(pair) >= least) {
            return Ok(());
        }
        Err(Error::Request {
            what: "measure",
            problem: "the line is too short".to_owned(),
            remedy: "draw a line from one place to another",
        })
    }

    /// The end of a ruler that a pane shows at a place: which ruler, and which end of it; the newest first, and no middle of three.
    fn end_near(&self, pane: Pane, at: [f64; 2]) -> Option<(usize, usize)> {
        let ends = self.rulers.iter().enumerate().rev().flat_map(|(ruler, one)| {
            let ends = one.ends.iter().enumerate().map(move |(end, place)| (ruler, end, place));
            let is_three = one.ends.len() == 3;
            ends.filter(move |(_, end, _)| !(is_three && *end == 1))
        });
        let near = ends.filter_map(|(ruler, end, place)| {
            Some((self.away(pane, self.shown_end(place), at)?, ruler, end))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, ruler, end)| (ruler, end))
    }

    /// How far from a place that is pointed at a pane shows another (shares of it), where it is near.
    pub(super) fn away(&self, pane: Pane, place: [f64; 3], at: [f64; 2]) -> Option<f64> {
        let grid = self.session.rest().grid();
        let there = self.panes.shares(grid, &self.lens, place)[pane.number()]?;
        let off = pane.number().checked_sub(1).map(|slice| self.panes.planes.off(grid, place)[slice]);
        let away = (there[0] - at[0]).hypot(there[1] - at[1]);
        (away <= NEAR && off.is_none_or(|off| off.abs() <= BESIDE)).then_some(away)
    }

    /// The body has moved: what is measured goes with it.
    pub(super) fn carry_rulers(&mut self) {
        for end in self.rulers.iter_mut().flat_map(|one| &mut one.ends) {
            end.now = self.session.moved(end.rest);
        }
    }

    /// What is told of the rulers.
    pub(crate) fn told_rulers(&self) -> Vec<Ruler> {
        let grid = self.session.rest().grid();
        let mut first = 0;
        let told = |Places { id, ends }: &Places| {
            let now: Vec<_> = ends.iter().map(|end| end.now).collect();
            let rest: Vec<_> = ends.iter().map(|end| end.rest).collect();
            let shown: Vec<_> = ends.iter().map(|end| self.shown_end(end)).collect();
            let mut beside = self.panes.planes.beside(grid, &shown);
            beside[0] = self.hides_ends(first, ends.len());
            first += ends.len();
            Ruler {
                id: *id,
                mm: lengths(&now),
                rest_mm: lengths(&rest),
                degrees: angle(&now),
                rest_degrees: angle(&rest),
                at: shown.iter().map(|place| self.panes.shares(grid, &self.lens, *place)).collect(),
                beside,
                now,
                rest,
            }
        };
        self.rulers.iter().map(told).collect()
    }
}

fn no_ruler(id: u32) -> Error {
    Error::Request {
        what: "ruler",
        problem: format!("there is none of number {id}"),
        remedy: "name one that is told",
    }
}

fn length(from: [f64; 3], to: [f64; 3]) -> f64 {
    (Vector3::from(to) - Vector3::from(from)).norm()
}

/// From each place to the next (mm).
fn lengths(places: &[[f64; 3]]) -> Vec<f64> {
    places.windows(2).map(|pair| length(pair[0], pair[1])).collect()
}

/// The angle at the second of three places (degrees).
fn angle(places: &[[f64; 3]]) -> Option<f64> {
    let [first, corner, last] = *places else { return None };
    let way = |to: [f64; 3]| Vector3::from(to) - Vector3::from(corner);
    let (a, b) = (way(first), way(last));
    // Near 0 and 180 degrees, where a cosine hardly changes, this is as close as elsewhere.
    Some(a.cross(&b).norm().atan2(a.dot(&b)).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_close_where_their_cosine_is_flat() {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            angle(&[[3.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.5 * cos, 0.5 * sin, 1.0]]).unwrap()
        };
        for degrees in [0.0, 1e-6, 30.0, 90.0, 135.0, 179.999_999, 180.0] {
            assert!((at(degrees) - degrees).abs() < 1e-9, "{} for {degrees}", at(degrees));
        }
        assert_eq!(angle(&[[0.0; 3], [1.0; 3]]), None);
    }
}
