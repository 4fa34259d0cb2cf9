//! Every parameter of a stage can be said in a scene.

use serde::de::DeserializeOwned;

use super::*;
use crate::Stage;
use crate::scene::BoundarySection;

/// The leaves of a JSON value, by their paths.
fn leaves(path: &str, value: &Value, found: &mut Vec<(String, Value)>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                leaves(&format!("{path}.{key}"), value, found);
            }
        }
        other => found.push((path.to_owned(), other.clone())),
    }
}

/// The parameters that are the same whether the section says nothing or another value for each of its keys.
fn unmoved<S: DeserializeOwned, T: Stage>(said: &str, stage: impl Fn(&S) -> T) -> Vec<String> {
    moved_from("", said, stage)
}

fn moved_from<S: DeserializeOwned, T: Stage>(both: &str, said: &str, stage: impl Fn(&S) -> T) -> Vec<String> {
    let params = |text: &str| {
        let mut found = Vec::new();
        leaves("", &stage(&toml::from_str(&format!("{both}{text}")).unwrap()).params(), &mut found);
        found
    };
    let other = params(said);
    params("").into_iter().filter(|leaf| other.contains(leaf)).map(|(path, _)| path).collect()
}

#[test]
fn no_parameter_is_hidden_from_scenes() {
    // What has one choice only can't be another.
    let nothing: [&str; 0] = [];
    let atf = "resolution = 9\nmax_opacity = 0.3\nmin_opacity = 0.2\nsize_exponent = 1.0\nsoftness = 0.0";
    assert_eq!(unmoved(atf, |s| Atf::from_section(s, None)), [".iso"], "the isovalue is the lattice's");
    let part = "class = 1\nseed = [1.0, 2.0, 3.0]\nfill_holes = false\nabove = 4.0";
    assert_eq!(unmoved(part, |s: &BoundarySection| Boundary::from_section(s, None)), nothing);
    let refine = "method = \"merge\"\nratio = 0.5\nmax_turn_degrees = 30.0\nshape_weight = 0.5\nallow_topology = true\n\
        feature_degrees = 30.0\nmin_component = 9\n[[lock]]\npick = [0.0, 0.0, 0.0]\nradius = 1.0";
    assert_eq!(unmoved(refine, |s| Refine::from_section(s).unwrap()), nothing);
    let deform = "stiffness = 1.0\nduration = 1.0\ndt = 0.1\nground = 2.0\ndamping = 2.0\ndensity = 2.0\n\
        vertex_mass = 2.0\nepsilon = 0.5\nliteral = true\n[[fix]]\npick = [0.0, 0.0, 0.0]\nradius = 1.0\n\
        [[handle]]\nvertex = 1\nmove = [0.0, 0.0, 1.0]\nradius = 2.0\n\
        [[shape]]\nkind = \"rotate\"\ncentre = [0.0, 0.0, 1.0]\nradius = 2.0\nangle = 3.0";
    let ring = unmoved(deform, |s| Deform::from_section(s).unwrap());
    assert_eq!(ring, [".bones", ".solver"], "rings know no bones");
    let springs = "stiffness = 1.0\nduration = 1.0\ndt = 0.1\nground = 2.0\ndensity = 2.0\nvertex_mass = 2.0\n\
        youngs_kpa = 9.0\nthickness = 2.0\nshear = 0.1\nflexion = 0.1\npush = false\nstrain_limit = 0.1\ndrag = 1.0\n\
        grip = 1.0\nramp = 0.1\ncourse = \"linear\"\nframes = 7\n\
        [material.2]\nstiffness = 9.0\n[[rigid]]\nclass = 2\nmove = [0.0, 0.0, 1.0]\nreach = 1.0\n[[fix]]\npick = [0.0, 0.0, 0.0]\nradius = 1.0\n\
        [[handle]]\nvertex = 1\nmove = [0.0, 0.0, 1.0]\nradius = 2.0\n\
        [[shape]]\nkind = \"rotate\"\ncentre = [0.0, 0.0, 1.0]\nradius = 2.0\nangle = 3.0";
    let solver = |name: &str, own: &str| {
        let said = format!("{own}{springs}");
        moved_from(&format!("solver = \"{name}\"\n"), &said, |s| Deform::from_section(s).unwrap())
    };
    // Those keys are the implicit solvers' own.
    let mut own = [".history", ".inertia", ".max_iterations", ".tolerance"]
        .map(|k| format!(".mass_spring{k}"))
        .to_vec();
    let names = [".mass_spring.solver".to_owned(), ".solver".to_owned()];
    own.splice(3..3, [names[0].clone()]);
    own.push(names[1].clone());
    assert_eq!(solver("dynamics", ""), own);
    let both = "tolerance = 0.1\nmax_iterations = 7\n";
    let [history, inertia] = [own[0].clone(), own[1].clone()];
    assert_eq!(solver("xpbd", both), [history, inertia, names[0].clone(), names[1].clone()]);
    assert_eq!(solver("projective", &format!("{both}inertia = true\nhistory = 7\n")), names);
    assert_eq!(unmoved("order = \"cubic\"\nbackground = 1.0", Warp::from_section), nothing);
    let render = "mode = \"iso\"\niso = 1.0\nsize = [7, 8]\nview = [1.0, 2.0]\nzoom = 2.0\nstep = 1.0\n\
        shading = false\nannotate = false\nprojection = \"perspective\"\ntermination = 2.0\nskip = false\n\
        background = [1.0, 1.0, 1.0, 0.0]\nsurface = [0.0, 0.0, 0.0]";
    assert_eq!(unmoved(render, |s| Render::from_section(s, None).unwrap()), nothing);
}

#[test]
fn what_changes_no_pixel_is_read_from_scenes_and_is_in_no_cache_key() {
    let render = |text: &str| Render::from_section(&toml::from_str(text).unwrap(), None).unwrap();
    let [skipping, looking] = ["", "skip = false"].map(render);
    assert!(skipping.params.skip && !looking.params.skip);
    assert_eq!(skipping.params(), looking.params());
}

#[test]
fn a_section_that_says_nothing_is_the_stages_own_defaults() {
    assert_eq!(Atf::from_section(&toml::from_str("").unwrap(), None).params, ivd_atf::Params::default());
    let refine = Refine::from_section(&toml::from_str("").unwrap()).unwrap();
    assert_eq!(refine.params, ivd_lattice::refine::RefineParams::default());
    let deform = Deform::from_section(&toml::from_str("").unwrap()).unwrap();
    assert_eq!(deform.method, DeformMethod::Ring(ivd_deform::spring::RingParams::default()));
    let deform = Deform::from_section(&toml::from_str("solver = \"dynamics\"").unwrap()).unwrap();
    assert_eq!(deform.method, DeformMethod::MassSpring(Box::default()));
    assert_eq!(Warp::from_section(&toml::from_str("").unwrap()), Warp::default());
    let mut render = Render::from_section(&toml::from_str("").unwrap(), None).unwrap().params;
    // A picture from the side shows more than one from the front.
    (render.view.azimuth_deg, render.view.elevation_deg) = (0.0, 0.0);
    assert_eq!(render, ivd_render::RenderParams::default());
}

#[test]
fn a_key_that_the_solver_does_not_read_is_refused() {
    let said = |text: &str| Deform::from_section(&toml::from_str(text).unwrap()).map_err(|e| e.to_string());
    let error = said("drag = 1.0").unwrap_err();
    assert!(
        error.contains("drag: ring doesn't read it; it belongs to dynamics, projective, xpbd"),
        "{error}"
    );
    let error = said("solver = \"xpbd\"\ninertia = true").unwrap_err();
    assert!(error.contains("inertia: xpbd doesn't read it; it belongs to projective"), "{error}");
    let error = said("solver = \"dynamics\"\nepsilon = 0.1").unwrap_err();
    assert!(error.contains("epsilon: dynamics doesn't read it; it belongs to ring"), "{error}");
    let error = said("[[rigid]]\nclass = 4\nreach = 1.0").unwrap_err();
    assert!(error.contains("rigid: ring doesn't read it; it belongs to dynamics"), "{error}");
    let error = said("solver = \"dynamics\"\n[material.bone]\nstiffness = 1.0").unwrap_err();
    assert!(error.contains("material.bone"), "{error}");
    assert!(said("ground = 0.5").is_ok() && said("solver = \"dynamics\"\nground = 0.5").is_ok());
}
