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

/// The same within one method.
fn unmoved_of<S: DeserializeOwned, T: Stage>(
    method: &str,
    said: &str,
    stage: impl Fn(&S) -> T,
) -> Vec<String> {
    moved_from(&format!("method = \"{method}\"\n"), said, stage)
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
    let segment = |said: &str, method: &str| unmoved_of(method, said, |s| Segment::from_section(s).unwrap());
    let kmvs = "k = 9\nspatial_weight = 0.5\nseed = 9\nmax_iterations = 9\ntolerance = 0.5\nrange = [0.0, 1.0]\n\
        smallest = 9\norder = \"size\"";
    assert_eq!(segment(kmvs, "kmvs"), [".method"]);
    let emvs = "k = 9\nk_max = 7\ncovariance = \"full\"\nmax_iterations = 9\ntolerance = 0.5\nvariance_floor = 0.1\n\
        smoothing = 1.0\nsmoothing_iterations = 7\nbias = 9.0\nrange = [0.0, 1.0]\nsmallest = 9\norder = \"size\"";
    // What is added to variances serves comparisons, a start only embedders; maps are asked for by --posteriors-out.
    let hidden = [".emvs.posteriors", ".emvs.start", ".emvs.variance_added", ".method"];
    assert_eq!(segment(emvs, "emvs"), hidden);
    let window = "k_max = 7\nkernel = \"flat\"\nrange_bandwidth = 3.0\nspatial_bandwidth = 3.0\npersistence = 0.5\n\
        cells_per_bandwidth = 3.0\nrange = [0.0, 1.0]\nsmallest = 9\norder = \"size\"";
    assert_eq!(segment(window, "msvs"), [".method"]);
    assert_eq!(segment(&format!("k_min = 3\n{window}"), "msvs+kmvs"), [".method"]);
    let hvs = "k = 9\nlinkage = \"single\"\nalpha = 1.0\nmax_regions = 9\nranking = \"area\"\nrange = [0.0, 1.0]\n\
        smallest = 9\norder = \"size\"";
    assert_eq!(segment(hvs, "hvs"), [".cut.smallest", ".method"], "tidying does the same to any labels");
    assert_eq!(segment("values = [1.0]\nsmallest = 9\norder = \"size\"", "threshold"), [".method"]);
    let atf = "resolution = 9\nmax_opacity = 0.3\nmin_opacity = 0.2\nsize_exponent = 1.0\nsoftness = 0.0";
    assert_eq!(unmoved(atf, |s| Atf::from_section(s, None)), [".iso"], "the isovalue is the lattice's");
    let part = "class = 1\nseed = [1.0, 2.0, 3.0]\nfill_holes = false\nabove = 4.0";
    assert_eq!(unmoved(part, |s: &BoundarySection| Boundary::from_section(s, None)), nothing);
    let refine = "method = \"merge\"\nratio = 0.5\nmax_turn_degrees = 30.0\nshape_weight = 0.5\nallow_topology = true\n\
        feature_degrees = 30.0\nmin_component = 9\n[[lock]]\npick = [0.0, 0.0, 0.0]\nradius = 1.0";
    assert_eq!(unmoved(refine, |s| Refine::from_section(s).unwrap()), nothing);
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
    assert_eq!(Warp::from_section(&toml::from_str("").unwrap()), Warp::default());
    let mut render = Render::from_section(&toml::from_str("").unwrap(), None).unwrap().params;
    // A picture from the side shows more than one from the front.
    (render.view.azimuth_deg, render.view.elevation_deg) = (0.0, 0.0);
    assert_eq!(render, ivd_render::RenderParams::default());
}
