//! How the motion is carried to the voxels.

use ivd_map::{BiharmonicParams, DepthWeight, OctreeParams};
use ivd_session::{Event, MapChoice};

use super::Model;
use crate::{Error, MapName};

impl Model {
    /// Lets the motion fade otherwise with depth; only where voxels follow what is nearest.
    pub(super) fn weigh_depth(&mut self, weight: DepthWeight) -> Result<(), Error> {
        let MapChoice::Octree(params) = &self.session.settings().map else {
            return Err(Error::Request {
                what: "depth",
                problem: "voxels follow smoothest, which has no depth of its own".to_owned(),
                remedy: "let them follow nearest first",
            });
        };
        let params = OctreeParams { weight, ..params.clone() };
        self.apply(Event::Map(MapChoice::Octree(params)))
    }

    /// How the motion fades with depth, where that can be chosen.
    pub(crate) fn depth(&self) -> Option<DepthWeight> {
        match &self.session.settings().map {
            MapChoice::Octree(params) => Some(params.weight),
            MapChoice::Biharmonic(_) | MapChoice::Fem(_) => None,
        }
    }
}

/// The map of a name: as one of those known already has it, the first first, else in the band of the first.
pub(super) fn chosen(name: MapName, known: [&MapChoice; 2]) -> MapChoice {
    let is = |map: &&&MapChoice| match name {
        MapName::Octree => matches!(map, MapChoice::Octree(_)),
        MapName::Biharmonic => matches!(map, MapChoice::Biharmonic(_)),
    };
    if let Some(same) = known.iter().find(is) {
        return (*same).clone();
    }
    let band = match known[0] {
        MapChoice::Octree(params) => params.band.clone(),
        MapChoice::Biharmonic(params) => params.band.clone(),
        MapChoice::Fem(params) => params.band.clone(),
    };
    match name {
        MapName::Octree => MapChoice::Octree(OctreeParams { band, ..OctreeParams::default() }),
        MapName::Biharmonic => {
            MapChoice::Biharmonic(BiharmonicParams { band, ..BiharmonicParams::default() })
        }
    }
}
