//! What was typed or chosen and isn't followed yet: it is shown where that was done until an answer comes.

use std::collections::BTreeMap;

use ivd_frames::{MapName, Request, SolverName};

/// The last of each kind.
#[derive(Debug, Default)]
pub(crate) struct Awaited {
    /// By the names of sliders and fields.
    values: BTreeMap<String, f64>,
    map: Option<MapName>,
    solver: Option<SolverName>,
}

impl Awaited {
    /// A slider or field was changed.
    pub(crate) fn turn(&mut self, name: &str, value: f64) {
        self.values.insert(name.to_owned(), value);
    }

    /// Something is asked for.
    pub(crate) fn ask(&mut self, request: &Request) {
        match request {
            Request::Map { map } => self.map = Some(*map),
            Request::Solver { solver } => self.solver = Some(*solver),
            Request::Undo | Request::Redo | Request::Reset | Request::Abandon => *self = Self::default(),
            _ => {}
        }
    }

    /// The value of a slider or field as it will be, or as it is shown.
    pub(crate) fn value(&self, name: &str, shown: f64) -> f64 {
        self.values.get(name).copied().unwrap_or(shown)
    }

    /// How voxels will follow, or do.
    pub(crate) fn map(&self, shown: Option<MapName>) -> Option<MapName> {
        self.map.or(shown)
    }

    /// How the surface will follow, or does.
    pub(crate) fn solver(&self, shown: Option<SolverName>) -> Option<SolverName> {
        self.solver.or(shown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_typed_is_shown_in_its_own_place_alone_and_no_longer_once_it_is_taken_back() {
        let mut awaited = Awaited::default();
        awaited.turn("Level", 5.0);
        awaited.ask(&Request::Map { map: MapName::Octree });
        assert_eq!((awaited.value("Level", 3.0), awaited.value("Radius", 8.0)), (5.0, 8.0));
        assert_eq!(awaited.map(Some(MapName::Biharmonic)), Some(MapName::Octree));
        assert_eq!(awaited.solver(Some(SolverName::Ring)), Some(SolverName::Ring));
        awaited.ask(&Request::Undo);
        assert_eq!((awaited.value("Level", 3.0), awaited.map(None)), (3.0, None));
    }
}
