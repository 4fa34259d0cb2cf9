//! What figures and methods mean, in plain words: what is good, and what isn't.

/// Space that keeps no more of its volume than this, at its worst, hides what lies there.
const FLAT: f64 = 0.1;
/// Space that keeps this much of its volume, at its worst, is changed little.
const LITTLE: f64 = 0.5;

/// The smallest det J, beside its value; `squeezed`: voxels that are flat as a whole, where that is known.
pub(super) fn smallest_det_j(value: f64, squeezed: Option<u64>) -> &'static str {
    match value {
        v if v <= FLAT && squeezed == Some(0) => {
            "what is left of a volume of 1 where space is squeezed most. Fine: nearly flat there, but at a corner of a voxel alone"
        }
        v if v <= FLAT => {
            "what is left of a volume of 1 where space is squeezed most. Not good: nearly flat there, so that what lies there is hard to see; above 0.1 is good"
        }
        v if v < LITTLE => "what is left of a volume of 1 where space is squeezed most. Good: above 0.1",
        v if v >= LITTLE => {
            "what is left of a volume of 1 where space is squeezed most. Good: hardly changed (1 is as it was, 0 is flat)"
        }
        _ => "what is left of a volume of 1 where space is squeezed most. Not good: it can't be told",
    }
}

/// The number of folds.
pub(super) fn folds(count: u64) -> &'static str {
    if count == 0 {
        "good: nowhere does space lie on itself or is it turned inside out"
    } else {
        "not good: there space lies on itself"
    }
}

/// The largest residual of the inverse (voxels).
pub(super) fn inverse_residual(voxels: f64) -> &'static str {
    if voxels <= 0.01 {
        "how far from where it began a way out and back ends. Good: below a hundredth of a voxel"
    } else {
        "how far from where it began a way out and back ends. Good where it is well below a voxel"
    }
}

/// How a solver moves a lattice; nothing where that is unknown.
pub(super) fn solver(method: &str) -> &'static str {
    match method {
        "ring" => {
            "the surface follows the handles, ring by ring from each, less with the distance. A tool for shapes: good for small changes, knows no tissue"
        }
        "dynamics" | "projective" | "xpbd" => {
            "the surface as masses on springs. Good for motions through time and large turns; stiffness is a setting, not tissue's"
        }
        "body" => {
            "the matter within as elastic tissue. Good where soft and stiff parts matter; as right as its materials are"
        }
        _ => "",
    }
}

/// How a map carries the motion to voxels; nothing where that is unknown.
pub(super) fn map(method: &str) -> &'static str {
    match method {
        "octree" => {
            "a voxel moves as the surface nearest to it, less with the depth. Fast, good for small moves; a tree of boxes finds what is nearest, and changes nothing of it"
        }
        "biharmonic" => "the smoothest motion that follows the surface. Good for large moves: squeezes less",
        "fem" => "elastic matter between the surfaces. Good where stiff and soft parts matter; slower",
        "body" => "the motion that the solver found within the body, as it is",
        _ => "",
    }
}

/// A method's name with what it does.
pub(super) fn with(name: &str, does: &str) -> String {
    if does.is_empty() { name.to_owned() } else { format!("{name}: {does}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_of_solver_and_map_is_explained() {
        for (stage, told) in
            [(&ivd_motion::deform::STAGE, solver as fn(&str) -> &'static str), (&ivd_map::STAGE, map)]
        {
            for method in stage.methods {
                assert!(!told(method.name).is_empty(), "{} {}", stage.name, method.name);
            }
        }
    }

    #[test]
    fn a_figure_is_called_good_where_it_is() {
        for (value, is_good) in
            [(1.0, true), (0.5, true), (0.11, true), (0.1, false), (0.001, false), (f64::NAN, false)]
        {
            assert_eq!(!smallest_det_j(value, None).contains("Not good"), is_good, "{value}");
            assert_eq!(!smallest_det_j(value, Some(3)).contains("Not good"), is_good, "{value}");
            assert!(value.is_nan() || !smallest_det_j(value, Some(0)).contains("Not good"), "{value}");
        }
        assert!(folds(0).starts_with("good") && folds(2).starts_with("not good"));
    }
}
