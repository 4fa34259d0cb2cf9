//! A level of refinement with what its deformations have in common.

use std::fmt;
use std::sync::Arc;

use ivd_core::op::{Op as _, Want};
use ivd_core::{Displacement, Exec, Grid, Labels, Lattice, Motion};
use ivd_lattice::refine::collapse;
use ivd_map::space::{SpaceParams, Start, displace};
use ivd_map::{Biharmonic, IncrementalMap, MapUpdate, Outside, fem};
use ivd_motion::freeform;
use ivd_motion::handles::{Anchor, Pin, find_picks};
use ivd_motion::mass_spring;
use ivd_motion::rigid::BoneSpec;
use ivd_motion::ring;

use crate::numbered::plain;
use crate::{Error, MapChoice, Physics, Settings};

/// A lattice, and what was prepared of it. Nothing that is kept changes a result.
pub(crate) struct Level {
    pub(crate) lattice: Arc<Lattice>,
    nearest: Option<IncrementalMap<Arc<Lattice>>>,
    smoothest: Option<(Outside, Biharmonic<Arc<Lattice>>)>,
    springs: Option<(Held, mass_spring::Prepared<Arc<Lattice>>)>,
    /// What rings' handles take along.
    coupling: Option<(Coupled, ring::Coupling)>,
}

/// What a coupling depends on.
type Coupled = (Vec<(Anchor, f64)>, ring::Couple);

impl fmt::Debug for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Level").field("vertices", &self.lattice.keys().len()).finish_non_exhaustive()
    }
}

/// What prepared springs depend on.
#[derive(Debug, PartialEq)]
struct Held {
    params: mass_spring::Params,
    handles: Vec<(Anchor, f64)>,
    fixed: Vec<Pin>,
    bones: Vec<BoneSpec>,
}

impl Level {
    /// Level `level` of a lattice.
    pub(crate) fn new(
        finest: &Arc<Lattice>,
        level: u8,
        settings: &Settings,
        exec: &Exec,
    ) -> Result<Self, Error> {
        let lattice = if level == 0 {
            finest.clone()
        } else {
            Arc::new(collapse(finest, &settings.refinement(level), exec)?.lattice)
        };
        Ok(Self { lattice, nearest: None, smoothest: None, springs: None, coupling: None })
    }

    /// Lets go everything but the lattice.
    pub(crate) fn forget(&mut self) {
        (self.nearest, self.smoothest, self.springs, self.coupling) = (None, None, None, None);
    }

    /// Lets go what was found of motions, as nothing moves it any more.
    pub(crate) fn come_to_rest(&mut self) {
        (self.smoothest, self.springs, self.coupling) = (None, None, None);
        // Its octree and what lies inside are of the lattice alone.
        if let Some(nearest) = &mut self.nearest {
            nearest.forget();
        }
    }

    /// The lattice's motion; `None` where nothing could move it.
    pub(crate) fn solve(
        &mut self,
        settings: &Settings,
        labels: Option<&Labels>,
        exec: &Exec,
    ) -> Result<Option<Motion>, Error> {
        // A fix that nothing moves yet is where it can be, too.
        let fixed = settings.fixed.iter().map(|fix| &fix.at);
        find_picks(&self.lattice, "fixed vertex", fixed)?;
        let handled = match &settings.physics {
            _ if settings.handles.is_empty() && settings.bones.is_empty() => None,
            Physics::Ring(params) => Some(self.rings(settings, params, exec)?),
            Physics::Springs(params) => Some(self.springs(settings, params, labels, exec)?),
        };
        if settings.shapes.is_empty() {
            return Ok(handled);
        }
        let shaped = freeform::lattice(&self.lattice, handled.as_ref(), &plain(&settings.shapes), exec)?;
        Ok(Some(shaped.motion))
    }

    fn rings(
        &mut self,
        settings: &Settings,
        params: &ring::RingParams,
        exec: &Exec,
    ) -> Result<Motion, Error> {
        let (handles, fixed) = (&plain(&settings.handles), &plain(&settings.fixed));
        let of: Coupled = (handles.iter().map(|h| (h.at, h.radius)).collect(), params.followers_by());
        let kept = self.coupling.take().filter(|(other, _)| *other == of).map(|(_, coupling)| coupling);
        let coupling = match kept {
            Some(coupling) => coupling,
            None => ring::Coupling::new(&self.lattice, handles, params, exec)?,
        };
        let solved = ring::solve_coupled(&self.lattice, &coupling, handles, fixed, params, exec);
        self.coupling = Some((of, coupling));
        Ok(solved?.motion)
    }

    fn springs(
        &mut self,
        settings: &Settings,
        params: &mass_spring::Params,
        labels: Option<&Labels>,
        exec: &Exec,
    ) -> Result<Motion, Error> {
        let bones = settings.bone_specs()?;
        let knows_classes =
            !params.springs.material.is_empty() || bones.iter().any(|bone| bone.class.is_some());
        let labels = labels.filter(|_| knows_classes);
        if labels.is_none() && knows_classes {
            return Err(no_labels("material"));
        }
        let (handles, fixed) = (plain(&settings.handles), plain(&settings.fixed));
        let held = Held {
            params: params.clone(),
            handles: handles.iter().map(|h| (h.at, h.radius)).collect(),
            fixed: fixed.clone(),
            bones,
        };
        let kept = self.springs.take().filter(|(other, _)| *other == held).map(|(_, prepared)| prepared);
        let mut prepared = if let Some(prepared) = kept {
            prepared
        } else {
            let (lattice, bones) = (self.lattice.clone(), &held.bones);
            mass_spring::Prepared::with_bones(lattice, labels, &handles, &fixed, bones, params, exec)?
        };
        prepared.forget();
        let solved = prepared.update(&handles, exec);
        self.springs = Some((held, prepared));
        Ok(solved?.motion)
    }

    /// The voxels' motion.
    pub(crate) fn map(
        &mut self,
        motion: Option<&Motion>,
        labels: Option<&Labels>,
        choice: &MapChoice,
        exec: &Exec,
    ) -> Result<MapUpdate, Error> {
        let Some(motion) = motion else { return Ok(still(&self.lattice)) };
        let frame = motion.frames().len() - 1;
        match choice {
            MapChoice::Octree(params) => {
                let mut nearest = if let Some(nearest) = self.nearest.take() {
                    nearest
                } else {
                    let octree = ivd_octree::build(&self.lattice, &ivd_octree::Params::default(), exec)?;
                    IncrementalMap::new(self.lattice.clone(), octree, exec)?
                };
                let moved = nearest.map(motion, frame, params, exec);
                self.nearest = Some(nearest);
                Ok(moved?)
            }
            MapChoice::Fem(params) => {
                let labels = labels.filter(|_| !params.material.is_empty());
                Ok(fem(&self.lattice, labels, motion, frame, params, exec)?.into())
            }
            MapChoice::Biharmonic(params) => {
                let kept = self.smoothest.take().filter(|(outside, _)| *outside == params.band.outside);
                let (outside, mut smoothest) = match kept {
                    Some(kept) => kept,
                    None => (
                        params.band.outside,
                        Biharmonic::new(self.lattice.clone(), params.band.outside, exec)?,
                    ),
                };
                let moved = smoothest.drag(motion, frame, params, exec);
                self.smoothest = Some((outside, smoothest));
                Ok(moved?)
            }
        }
    }
}

/// Where steps in space take voxels from where a map has brought them; `None` where there are no steps.
pub(crate) fn displaced(
    settings: &Settings,
    (grid, mapped): (&Grid, Option<&Displacement>),
    labels: Option<&Labels>,
    exec: &Exec,
) -> Result<Option<Displacement>, Error> {
    if settings.space.is_empty() {
        return Ok(None);
    }
    let params = SpaceParams { step: plain(&settings.space) };
    let labels = labels.filter(|_| params.wants("labels") == Want::Yes);
    Ok(Some(displace(grid, &params.step, &Start { after: mapped, labels }, exec)?.displacement))
}

/// Something knows classes, and nobody says which voxel is of which.
fn no_labels(event: &'static str) -> Error {
    Error::Event {
        event,
        problem: "there are no labels to know classes by".into(),
        remedy: "begin the session with labels",
    }
}

/// A displacement of nothing.
pub(crate) fn still(lattice: &Lattice) -> MapUpdate {
    let displacement = Displacement::identity(lattice.grid().clone());
    MapUpdate { displacement, relaxations: 0, halvings: 0, misfit: 0.0, left_mm: 0.0 }
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Volume, Voxels};
    use ivd_lattice::extract::{ExtractParams, Iso, extract};
    use ivd_map::BiharmonicParams;
    use ivd_motion::handles::{Action, Handle};

    use super::*;
    use crate::{Event, Session};

    #[test]
    fn what_was_found_of_motions_goes_once_nothing_moves_and_is_found_again() {
        let exec = Exec::default();
        let grid = Grid::with_spacing([24; 3], [1.0; 3]).unwrap();
        let from_middle = |i: usize| grid.index(i).0.map(|c| (c as f64 - 11.6).powi(2)).iter().sum::<f64>();
        let voxels: Vec<f32> = (0..grid.len()).map(|i| 100.0 - 8.0 * from_middle(i).sqrt() as f32).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(voxels)).unwrap();
        let params = ExtractParams { iso: Iso::Value(40.0) };
        let lattice = extract(&volume, None, &params, &exec).unwrap().lattice;
        let mut session = Session::new(volume, lattice, None, Settings::default(), &exec).unwrap();
        let springs = Event::Physics(Physics::Springs(Box::default()));
        let smoothest = Event::Map(MapChoice::Biharmonic(BiharmonicParams::default()));
        let at = Anchor::NearestTo([11.6, 11.6, 19.1]);
        let handle = Handle { at, action: Action::Move([0.2, 0.0, 1.0]), radius: 6.0 };
        for ways in [vec![], vec![springs], vec![smoothest]] {
            let way = ways.len();
            for event in ways {
                session.apply(event, &exec).unwrap();
            }
            let rest = session.displacement().clone();
            session.apply(Event::Add { id: None, handle }, &exec).unwrap();
            let moved = session.displacement().clone();
            let keeps = |session: &Session| {
                let level = &session.levels[&0];
                level.springs.is_some() || level.coupling.is_some() || level.smoothest.is_some()
            };
            assert!(moved != rest && keeps(&session), "{way}");
            session.undo(&exec).unwrap();
            assert!(*session.displacement() == rest && !keeps(&session), "{way}");
            session.redo(&exec).unwrap();
            assert!(*session.displacement() == moved, "{way}");
            session.undo(&exec).unwrap();
        }
    }
}
