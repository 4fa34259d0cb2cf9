//! Which keys of a scene's `[segment]` a method reads.

use crate::Error;
use crate::scene::SegmentMethod::{Emvs, Hvs, Kmvs, Msvs, MsvsKmvs, Threshold};
use crate::scene::{SegmentMethod, SegmentSection};

/// A key, whether it says something else than its default, and the methods that read it.
type Key = (&'static str, bool, &'static [SegmentMethod]);

/// A key that the method doesn't read is a mistake: whoever wrote it expects something of it.
///
/// # Errors
/// A usage error that names the key and the methods that read it.
pub(super) fn check(section: &SegmentSection) -> Result<(), Error> {
    let method = section.method;
    let Some((key, _, readers)) =
        keys(section).into_iter().find(|(_, set, by)| *set && !by.contains(&method))
    else {
        return Ok(());
    };
    let readers: Vec<String> = readers.iter().map(|m| name(*m)).collect();
    Err(Error::usage(
        "segment",
        format!("{key}: {} doesn't read it; it belongs to {}", name(method), readers.join(", ")),
    ))
}

fn keys(of: &SegmentSection) -> [Key; 25] {
    let plain = SegmentSection::default();
    let spatial = of.spatial_weight > 0.0;
    [
        ("k", of.k != plain.k, &[Kmvs, Emvs, Hvs]),
        ("k_max", of.k_max.is_some(), &[Emvs, Msvs, MsvsKmvs]),
        ("k_min", of.k_min.is_some(), &[MsvsKmvs]),
        ("values", of.values != plain.values, &[Threshold]),
        ("range", of.range.is_some(), &[Kmvs, Emvs, Msvs, Hvs, MsvsKmvs]),
        ("spatial_weight", of.spatial_weight != plain.spatial_weight, &[Kmvs]),
        ("seed", of.seed.is_some(), &[Kmvs]),
        ("max_iterations", of.max_iterations.is_some(), if spatial { &[Kmvs, Emvs] } else { &[Emvs] }),
        ("tolerance", of.tolerance.is_some(), if spatial { &[Kmvs, Emvs] } else { &[Emvs] }),
        ("covariance", of.covariance != plain.covariance, &[Emvs]),
        ("smoothing", of.smoothing != plain.smoothing, &[Emvs]),
        ("smoothing_iterations", of.smoothing_iterations.is_some(), &[Emvs]),
        ("variance_floor", of.variance_floor.is_some(), &[Emvs]),
        ("bias", of.bias != plain.bias, &[Emvs]),
        ("kernel", of.kernel != plain.kernel, &[Msvs, MsvsKmvs]),
        ("range_bandwidth", of.range_bandwidth.is_some(), &[Msvs, MsvsKmvs]),
        ("spatial_bandwidth", of.spatial_bandwidth.is_some(), &[Msvs, MsvsKmvs]),
        ("persistence", of.persistence.is_some(), &[Msvs, MsvsKmvs]),
        ("cells_per_bandwidth", of.cells_per_bandwidth.is_some(), &[Msvs, MsvsKmvs]),
        ("linkage", of.linkage != plain.linkage, &[Hvs]),
        ("alpha", of.alpha.is_some(), &[Hvs]),
        ("max_regions", of.max_regions.is_some(), &[Hvs]),
        ("height", of.height.is_some(), &[Hvs]),
        ("level", of.level.is_some(), &[Hvs]),
        ("ranking", of.ranking != plain.ranking, &[Hvs]),
    ]
}

/// The name of a method in a scene.
fn name(method: SegmentMethod) -> String {
    let word = serde_json::to_value(method).expect("a method is a word");
    word.as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Option<String> {
        let section: SegmentSection = toml::from_str(text).unwrap();
        check(&section).err().map(|e| e.to_string())
    }

    #[test]
    fn a_key_of_another_method_is_named_with_the_methods_that_read_it() {
        let found = told("method = \"kmvs\"\nsmoothing = 0.5").unwrap();
        assert!(found.contains("smoothing: kmvs doesn't read it; it belongs to emvs"), "{found}");
        assert!(told("method = \"threshold\"\nlevel = 2").unwrap().contains("hvs"));
        assert!(told("max_iterations = 9").is_some(), "k-means on intensity has no iterations");
        for fine in [
            "",
            "k = 9",
            "spatial_weight = 2.0\nmax_iterations = 9\nseed = 4",
            "method = \"emvs\"\nk = \"auto\"\nk_max = 7\nbias = 30.0",
            "method = \"msvs+kmvs\"\nkernel = \"flat\"\nrange = [1.0, 2.0]",
            "method = \"hvs\"\nlevel = 2\nsmallest = 9\norder = \"size\"",
        ] {
            assert_eq!(told(fine), None, "{fine}");
        }
    }
}
