//! How the motion fades with depth.

use ivd_core::{Exec, VoxelIndex};
use ivd_frames::{DepthWeight, Figures, MapName, Model, Request, Saved, WEIGHTS};

use super::common::{BALL, model};
use super::scripts::assert_as_piped;

/// The whole ball is moved: each vertex as far, which fades inwards within 8 mm.
const MOVED: &str =
    "[deform]\n[[deform.handle]]\npick = [16.0, 27.0, 16.0]\nmove = [0.0, -0.5, 0.0]\nradius = 8.0\n";

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    model.figures()
}

/// How far what comes to a voxel below the handle has come (mm).
fn motion(model: &Model, y: usize) -> f64 {
    f64::from(model.session().displacement().inverse().at(VoxelIndex([16, y, 16]))[1])
}

#[test]
fn each_weight_moves_what_is_inside_as_it_says_as_a_step_and_in_the_scene() {
    let mut model = model(&format!("{BALL}{MOVED}"));
    let first = model.session().deformed().clone();
    assert_eq!(model.figures().depth, Some(DepthWeight::Smooth));
    let mut told = Vec::new();
    for (weight, _) in WEIGHTS {
        let now = follow(&mut model, &Request::Depth { weight });
        assert_eq!((now.depth, &now.refused), (Some(weight), &None));
        assert_as_piped(&model);
        told.push(motion(&model, 24));
    }
    // At the same depth: not at all fades least, and soon fades most.
    let [smooth, even, soon, all] = told[..] else { panic!("{told:?}") };
    assert!(all > smooth && smooth > even && even > soon && soon > 0.0, "{told:?}");
    let scene = String::from_utf8(model.save(Saved::Scene, String::new(), &Exec::default()).unwrap().bytes);
    assert!(scene.unwrap().contains("weight = \"one\""));
    // The first is what was so already.
    for weight in [DepthWeight::Exponential, DepthWeight::Linear, DepthWeight::Smooth] {
        let undone = follow(&mut model, &Request::Undo);
        assert_eq!(undone.depth, Some(weight));
    }
    assert_eq!(model.session().deformed(), &first);
}

#[test]
fn what_follows_smoothest_has_no_depth_to_be_chosen() {
    let mut model = model(BALL);
    let told = follow(&mut model, &Request::Map { map: MapName::Biharmonic });
    assert_eq!(told.depth, None);
    let refused = model.follow(&Request::Depth { weight: DepthWeight::One }).unwrap_err().to_string();
    assert!(refused.contains("nearest first"), "{refused}");
    assert_eq!(model.figures(), told);
}
