//! A ball of two classes, and what the stages make of it that are called once.

use ivd_core::{Class, Displacement, Exec, Labels, Lattice, Volume, Voxels};
use ivd_field::clip::{self, By};
use ivd_field::lies::Lies;
use ivd_field::shape::Shape;
use ivd_field::warp;
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, Target, collapse};
use ivd_map::space::{self, Start, Step};
use ivd_map::{Band, BiharmonicParams, FemParams, OctreeParams, Outside};
use ivd_motion::freeform;
use ivd_motion::handles::{Action, Anchor, Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::ring;
use ivd_session::{MapChoice, Physics, Session, Settings};

pub(crate) const SIDE: usize = 40;

/// A ball whose values fall outwards, on an oblong grid.
pub(crate) fn ball() -> (Volume, Lattice) {
    let grid = ivd_core::Grid::with_spacing([SIDE, SIDE, SIDE], [1.0, 1.0, 1.25]).unwrap();
    let value = |i: usize| {
        let at = grid.index(i).0.map(|c| c as f64);
        let from = [at[0] - 19.3, at[1] - 19.6, 1.25 * (at[2] - 19.4)];
        let ripple = 3.0 * (0.7 * at[0] + 0.5 * at[1] - 0.3 * at[2]).sin();
        200.0 - 8.0 * from.iter().map(|c| c * c).sum::<f64>().sqrt() + ripple
    };
    let voxels: Vec<u8> = (0..grid.len()).map(|i| value(i).clamp(0.0, 255.0) as u8).collect();
    let volume = Volume::new(grid, Voxels::from(voxels)).unwrap();
    let iso = ExtractParams { iso: Iso::Value(100.0) };
    let lattice = extract(&volume, None, &iso, &Exec::default()).unwrap().lattice;
    (volume, lattice)
}

/// Two classes: the half of lower x, and the other.
pub(crate) fn labels(volume: &Volume) -> Labels {
    let grid = volume.grid();
    let ids: Vec<u16> = (0..grid.len()).map(|i| if grid.index(i).0[0] < SIDE / 2 { 1 } else { 2 }).collect();
    let class = |id: u16| Class {
        id,
        voxels: ids.iter().filter(|i| **i == id).count() as u64,
        mean: f64::from(id),
        name: None,
        sd: 0.0,
        lower: None,
        upper: None,
    };
    let classes = vec![class(1), class(2)];
    Labels::new(grid.clone(), ids.into(), classes).unwrap()
}

pub(crate) fn session(settings: Settings, exec: &Exec) -> Session {
    let (volume, lattice) = ball();
    let labels = labels(&volume);
    Session::new(volume, lattice, Some(labels), settings, exec).unwrap()
}

pub(crate) fn pick(direction: [f64; 3]) -> Anchor {
    let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [x, y, z] = direction.map(|c| 12.5 * c / length);
    Anchor::NearestTo([19.3 + x, 19.6 + y, 24.2 + z])
}

/// What the stages give that are called once.
pub(crate) fn at_once(settings: &Settings, exec: &Exec) -> (Option<Displacement>, Volume) {
    let (volume, finest) = ball();
    let lattice = match settings.level {
        0 => finest,
        level => {
            let params = RefineParams { target: Target::Level(level).into(), ..RefineParams::default() };
            collapse(&finest, &params, exec).unwrap().lattice
        }
    };
    let labels = labels(&volume);
    let mut motion = None;
    let handles: Vec<Handle> = settings.handles.iter().map(|handle| handle.what).collect();
    let fixed: Vec<Pin> = settings.fixed.iter().map(|pin| pin.what).collect();
    let shapes: Vec<Shape> = settings.shapes.iter().map(|shape| shape.what).collect();
    let bones: Vec<_> = settings.bones.iter().enumerate().map(|(i, bone)| bone.read(i).unwrap()).collect();
    if !handles.is_empty() || !bones.is_empty() {
        motion = Some(match &settings.physics {
            Physics::Ring(params) => ring::solve(&lattice, &handles, &fixed, params, exec).unwrap().motion,
            Physics::Springs(params) => {
                let by_class =
                    !params.springs.material.is_empty() || bones.iter().any(|bone| bone.class.is_some());
                let labels = Some(&labels).filter(|_| by_class);
                let solved =
                    mass_spring::with_bones(&lattice, labels, &handles, &fixed, &bones, params, exec);
                solved.unwrap().motion
            }
        });
    }
    if !shapes.is_empty() {
        motion = Some(freeform::lattice(&lattice, motion.as_ref(), &shapes, exec).unwrap().motion);
    }
    let mut displacement = motion.map(|motion| mapped(&lattice, &motion, &settings.map, exec).unwrap());
    let steps: Vec<Step> = settings.space.iter().map(|step| step.what.clone()).collect();
    if !steps.is_empty() {
        let start = Start { after: displacement.as_ref(), labels: Some(&labels) };
        displacement = Some(space::displace(volume.grid(), &steps, &start, exec).unwrap().displacement);
    }
    let mut shown = match &displacement {
        Some(displacement) => warp::volume(&volume, displacement, &settings.warp, exec).unwrap().output,
        None => volume,
    };
    if let Some(params) = settings.clip.params() {
        let at_rest = settings.clip.rule.space == Some(Lies::Rest);
        let by = By { tag: None, displacement: displacement.as_ref().filter(|_| at_rest) };
        shown = clip::volume(&shown, &params, &by, exec).unwrap().output;
    }
    (displacement, shown)
}

/// What a map makes of a motion's last frame, as the stage does.
pub(crate) fn mapped(
    lattice: &Lattice,
    motion: &ivd_core::Motion,
    map: &MapChoice,
    exec: &Exec,
) -> Result<Displacement, ivd_map::Error> {
    let last = motion.frames().len() - 1;
    let mapped = match map {
        MapChoice::Octree(params) => {
            let octree = ivd_octree::build(lattice, &ivd_octree::Params::default(), exec).unwrap();
            ivd_map::octree(lattice, &octree, motion, last, params, exec)
        }
        MapChoice::Biharmonic(params) => ivd_map::biharmonic(lattice, motion, last, params, exec),
        MapChoice::Fem(params) => ivd_map::fem(lattice, None, motion, last, params, exec),
    };
    mapped.map(|mapped| mapped.displacement)
}

pub(crate) fn choice(method: &str, outside: Outside) -> MapChoice {
    let band = Band { outside, ..Band::default() };
    match method {
        "octree" => MapChoice::Octree(OctreeParams { band, ..OctreeParams::default() }),
        "biharmonic" => MapChoice::Biharmonic(BiharmonicParams { band, ..BiharmonicParams::default() }),
        _ => MapChoice::Fem(FemParams { band, ..FemParams::default() }),
    }
}

pub(crate) fn assert_as_at_once(session: &Session, exec: &Exec) {
    let (displacement, volume) = at_once(session.settings(), exec);
    match displacement {
        Some(displacement) => assert!(session.displacement() == &displacement, "{:?}", session.settings()),
        None => assert!(session.displacement().is_identity()),
    }
    assert!(session.deformed() == &volume, "{:?}", session.settings());
}

/// A handle on the ball's top.
pub(crate) fn top() -> Handle {
    Handle { at: pick([0.0, 0.0, 1.0]), action: Action::Move([0.0; 3]), radius: 9.0 }
}
