//! Where handles and pins are, and which panes show them.

use ivd_core::Lattice;
use ivd_motion::handles::{Action, Pick, find_picks};
use nalgebra::Vector3;

use super::Model;
use crate::figures::Spot;
use crate::{Error, Shows};

/// A surface that is turned away from the eye by more than this (cosine) is the far side of something.
const TURNED_AWAY: f64 = -0.6;

/// Out of the lattice of a level at vertices.
#[derive(Debug, Clone, Default)]
pub(super) struct Outward {
    level: u8,
    vertices: Vec<usize>,
    ways: Vec<[f64; 3]>,
}

impl Outward {
    /// The same where handles hold those vertices of the lattice of a level.
    fn at(&self, level: u8, lattice: &Lattice, picks: &[Pick]) -> Self {
        let vertices: Vec<usize> = picks.iter().map(|pick| pick.vertex).collect();
        if (level, &vertices) == (self.level, &self.vertices) {
            return self.clone();
        }
        let ways = outward(lattice, &vertices);
        Self { level, vertices, ways }
    }
}

impl Model {
    /// Finds where handles and pins are.
    pub(super) fn find_spots(&mut self) -> Result<(), Error> {
        let settings = self.session.settings();
        let lattice = self.session.lattice();
        let picks = find_picks(lattice, "handle", settings.handles.iter().map(|one| &one.at))?;
        let alone = settings.space.is_empty() && settings.shapes.is_empty();
        let kept = self.outward.at(settings.level, lattice, &picks);
        let spots = settings.handles.iter().zip(picks).zip(&kept.ways).map(|((one, pick), &outward)| {
            let now = self.now_at(&pick);
            let voxels = self.session.moved(pick.at);
            let (by, with) = match one.action {
                Action::Move(by) => (Some(by), None),
                Action::Force(with) => (None, Some(with)),
            };
            Spot {
                id: one.id,
                rest: pick.at,
                now,
                by,
                with,
                radius: one.radius,
                at: [None; 4],
                off: [0.0; 3],
                gone: alone.then(|| std::array::from_fn(|a| voxels[a] - pick.at[a])),
                seen: [false; 4],
                outward,
            }
        });
        let spots: Vec<Spot> = spots.collect();
        let picks = find_picks(lattice, "fixed vertex", settings.fixed.iter().map(|one| &one.at))?;
        let pins = settings.fixed.iter().zip(picks).map(|(one, pick)| Spot {
            id: one.id,
            rest: pick.at,
            now: self.seen_at(pick.at, pick.at),
            by: None,
            with: None,
            radius: one.radius,
            at: [None; 4],
            off: [0.0; 3],
            gone: None,
            seen: [false; 4],
            outward: [0.0; 3],
        });
        (self.pins, self.spots) = (pins.collect(), spots);
        self.outward = kept;
        self.place_spots();
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
        let moved = self.session.motion().and_then(|motion| motion.frames().last());
        moved.map_or_else(Vector3::zeros, |frame| Vector3::from(frame.displacement[vertex]))
    }

    /// Finds where the panes show them.
    pub(super) fn place_spots(&mut self) {
        let grid = self.session.rest().grid();
        let towards_eye = Vector3::from(self.lens.axes()[2]);
        // Where it is cut open, or bones turn parts of it round, far sides may be seen.
        let settings = self.session.settings();
        let open = self.panes.cut.is_some()
            || !settings.clip.parts.is_empty()
            || !settings.space.is_empty()
            || !settings.bones.is_empty();
        for spot in self.spots.iter_mut().chain(&mut self.pins) {
            let place = if self.compared.shows == Shows::Rest { spot.rest } else { spot.now };
            spot.at = self.panes.shares(grid, &self.lens, place);
            spot.off = self.panes.planes.off(grid, place);
            spot.seen = self.panes.planes.reached(grid, spot.off, spot.radius);
            spot.seen[0] = open || Vector3::from(spot.outward).dot(&towards_eye) > TURNED_AWAY;
        }
    }
}

/// Out of a lattice at rest at vertices: the sum of the triangles about each, which are as long as they are large.
fn outward(lattice: &Lattice, vertices: &[usize]) -> Vec<[f64; 3]> {
    if vertices.is_empty() {
        return Vec::new();
    }
    let places = lattice.local_positions();
    let mut is_asked = vec![false; places.len()];
    for &v in vertices {
        is_asked[v] = true;
    }
    let mut sums = vec![Vector3::zeros(); vertices.len()];
    for t in lattice.triangles().iter().filter(|t| t.iter().any(|&v| is_asked[v as usize])) {
        for (sum, vertex) in sums.iter_mut().zip(vertices) {
            if t.contains(&(*vertex as u32)) {
                let [a, b, c] = t.map(|v| places[v as usize]);
                *sum += (b - a).cross(&(c - a));
            }
        }
    }
    sums.into_iter().map(|sum| sum.try_normalize(0.0).unwrap_or_default().into()).collect()
}
