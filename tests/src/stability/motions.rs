//! The other ways to deform a lattice and to carry its motion to the voxels, as one subject each.

use ivd_core::{Exec, Lattice};
use ivd_map::{Band, BiharmonicParams, FemParams};
use ivd_motion::handles::{Handle, Pin};
use ivd_motion::mass_spring::{Descent, Params, Solver};
use ivd_session::MapChoice;

use super::backend::{Answer, Backend};
use super::case::{Case, Stage};
use super::invariants::motion::{self, Asked};
use super::invariants::{Verdict, field};
use super::subject::{Subject, Values};
use super::surfaces::has_turn;

const RAN: &str = "checked after it ran";

/// A solver of masses on springs, with its name and whether masses count.
pub(super) struct Springs(Stage, &'static str, Solver, bool);

pub(super) static DYNAMICS: Springs =
    Springs(Stage::DeformDynamics, "deform by explicit steps", Solver::Dynamics, true);
pub(super) static BALANCE: Springs =
    Springs(Stage::DeformBalance, "deform to balance", Solver::Projective, false);
pub(super) static IMPLICIT: Springs =
    Springs(Stage::DeformImplicit, "deform by implicit steps", Solver::Projective, true);
pub(super) static XPBD: Springs = Springs(Stage::DeformXpbd, "deform by constraints", Solver::Xpbd, true);

impl Springs {
    fn params(&self, case: &Case) -> Params {
        Params {
            solver: self.2,
            descent: Descent { inertia: self.3, ..case.setup.springs.descent },
            ..case.setup.springs.clone()
        }
    }
}

fn asked<'a>(case: &'a Case, lattice: &'a Lattice, handles: &'a [Handle], fixed: &'a [Pin]) -> Asked<'a> {
    Asked { lattice, handles, fixed, labels: case.setup.materials.as_ref(), bones: &case.setup.bones }
}

impl Subject for Springs {
    fn stage(&self) -> Stage {
        self.0
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let something = !case.setup.handles.is_empty() || !case.setup.bones.is_empty();
        let Some(refined) = values.refined.as_ref().filter(|_| something && has_turn(case, self.0)) else {
            return Ok(false);
        };
        let (handles, fixed) = (values.handles(case), values.fixed(case));
        let asked = asked(case, &refined.lattice, &handles, &fixed);
        let found = on.springs(&asked, &self.params(case), exec)?;
        values.sprung.insert(self.1, found);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let (handles, fixed) = (values.handles(case), values.fixed(case));
        let asked = asked(case, &values.refined.as_ref().expect(RAN).lattice, &handles, &fixed);
        motion::sprung(&asked, &self.params(case), &values.sprung[self.1])
    }
}

/// Free forms, on top of what rings did.
pub(super) struct Shapes;

impl Subject for Shapes {
    fn stage(&self) -> Stage {
        Stage::DeformShapes
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let asked = !case.setup.shapes.is_empty() && has_turn(case, self.stage());
        let (Some(refined), Some(start)) = (&values.refined, values.solved.as_ref().filter(|_| asked)) else {
            return Ok(false);
        };
        values.shaped = Some(on.shapes(&refined.lattice, &start.motion, &case.setup.shapes, exec)?);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let lattice = &values.refined.as_ref().expect(RAN).lattice;
        let start = &values.solved.as_ref().expect(RAN).motion;
        motion::shaped(lattice, start, &case.setup.shapes, values.shaped.as_ref().expect(RAN))
    }
}

/// Another way to carry the rings' motion to the voxels.
pub(super) struct Carrying(Stage, &'static str, fn(Band) -> MapChoice);

pub(super) static BIHARMONIC: Carrying = Carrying(Stage::MapBiharmonic, "map biharmonic", |band| {
    MapChoice::Biharmonic(BiharmonicParams { band, ..BiharmonicParams::default() })
});
pub(super) static FEM: Carrying =
    Carrying(Stage::MapFem, "map fem", |band| MapChoice::Fem(FemParams { band, ..FemParams::default() }));

impl Subject for Carrying {
    fn stage(&self) -> Stage {
        self.0
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        let turn = has_turn(case, self.0);
        let (Some(refined), Some(octree), Some(solved)) =
            (&values.refined, &values.octree, values.solved.as_ref().filter(|_| turn))
        else {
            return Ok(false);
        };
        let found =
            on.map(&refined.lattice, octree, &solved.motion, &(self.2)(case.setup.map.band.clone()), exec)?;
        values.maps.insert(self.1, found);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        let (solved, inside) = (values.solved.as_ref().expect(RAN), values.inside.as_ref().expect(RAN));
        field::mapped(&solved.motion, inside, &case.setup.map.band, &values.maps[self.1])
    }
}
