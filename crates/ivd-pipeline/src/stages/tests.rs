//! Every parameter of a stage can be said in a scene.

use serde::de::DeserializeOwned;

use super::*;
use crate::Stage;

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
}

#[test]
fn a_section_that_says_nothing_is_the_stages_own_defaults() {
    let deform = Deform::from_section(&toml::from_str("").unwrap()).unwrap();
    assert_eq!(deform.method, DeformMethod::Ring(ivd_deform::spring::RingParams::default()));
    let deform = Deform::from_section(&toml::from_str("solver = \"dynamics\"").unwrap()).unwrap();
    assert_eq!(deform.method, DeformMethod::MassSpring(Box::default()));
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
