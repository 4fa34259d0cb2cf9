/// A class as a weighted Gaussian in real values, with the crossings that its segmentation gave.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WeightedGaussian {
    pub(crate) mean: f64,
    /// Standard deviation, > 0 (the caller sets a floor).
    pub(crate) sd: f64,
    /// Number of voxels: the prior.
    pub(crate) voxels: f64,
    pub(crate) lower: Option<f64>,
    pub(crate) upper: Option<f64>,
    /// Whether it is only the way from one class to another.
    pub(crate) is_transition: bool,
    /// Whether it is what lies round the matter.
    pub(crate) is_background: bool,
}

/// One side of a class's window: where it lies and the half width over which it fades. `None`: open.
pub(crate) type Edge = Option<(f64, f64)>;

/// The part of the value axis in which a class shows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Window {
    pub(crate) lower: Edge,
    pub(crate) upper: Edge,
}

impl Window {
    /// Weight of the class at a value, 0…1; ½ on an edge.
    pub(crate) fn weight(&self, value: f64) -> f64 {
        let rise = |edge: Edge, sign: f64| {
            edge.map_or(1.0, |(at, half)| {
                let d = sign * (value - at);
                if half > 0.0 {
                    let t = (0.5 + 0.5 * d / half).clamp(0.0, 1.0);
                    t * t * (3.0 - 2.0 * t)
                } else {
                    f64::from(u8::from(d >= 0.0))
                }
            })
        };
        rise(self.lower, 1.0).min(rise(self.upper, -1.0))
    }
}

/// Whether values tell two classes apart: their means are further apart than half the mean of their spreads.
pub(crate) fn are_separate(a: &WeightedGaussian, b: &WeightedGaussian) -> bool {
    (b.mean - a.mean).abs() > 0.25 * (a.sd + b.sd)
}

/// Windows of `gaussians`, which are in the order of their means. `softness`: half width of an edge in standard deviations.
///
/// Classes that values can't tell apart don't bound each other: their windows overlap, and the label decides. Nor do transitions bound other
/// classes: the edge between the classes on either side fades over all of the transition.
pub(crate) fn windows(gaussians: &[WeightedGaussian], softness: f64) -> Vec<Window> {
    let edge = |a: usize, b: usize| edge(&gaussians[a], &gaussians[a + 1..b], &gaussians[b], softness);
    (0..gaussians.len())
        .map(|i| {
            let bounds = |j: &usize| {
                (gaussians[i].is_transition || !gaussians[*j].is_transition)
                    && are_separate(&gaussians[i], &gaussians[*j])
            };
            let below = (0..i).rev().find(bounds);
            let above = (i + 1..gaussians.len()).find(bounds);
            Window { lower: below.map(|j| edge(j, i)), upper: above.map(|j| edge(i, j)) }
        })
        .collect()
}

/// Where `a` gives way to `b`, with the half width over which it does; `between`: the classes between them.
pub(crate) fn edge(
    a: &WeightedGaussian,
    between: &[WeightedGaussian],
    b: &WeightedGaussian,
    softness: f64,
) -> (f64, f64) {
    let mut transitions = between.iter().filter(|gaussian| gaussian.is_transition);
    if !a.is_transition
        && !b.is_transition
        && let Some(first) = transitions.next()
    {
        let last = transitions.next_back().unwrap_or(first);
        let (from, to) = (crossing(a, first), crossing(last, b));
        let at = off_background(a, b, 0.5 * (from + to));
        return (at, (0.5 * (to - from)).min(at - a.mean).min(b.mean - at).max(0.0));
    }
    let at = off_background(a, b, crossing(a, b));
    let half = (softness * a.sd.min(b.sd)).min(0.5 * (b.mean - a.mean));
    // An edge never fades beyond a mean by more than it must.
    (at, half.min((at - a.mean).abs().max(0.1 * half)).min((b.mean - at).abs().max(0.1 * half)))
}

/// An edge between background and matter, no nearer to the background than half way: a voxel that is half matter has the value half way, whereas the
/// posterior of a background of little spread ends where its noise does, so that the outermost voxels and haze would be drawn as matter.
fn off_background(a: &WeightedGaussian, b: &WeightedGaussian, at: f64) -> f64 {
    let half_way = 0.5 * (a.mean + b.mean);
    match (a.is_background, b.is_background) {
        (true, false) => at.max(half_way),
        (false, true) => at.min(half_way),
        _ => at,
    }
}

/// Where the posteriors of `a` and `b` (`a.mean < b.mean`) are equal, if that is between the means; else the crossing
/// that the segmentation gave, if that is; else half way.
fn crossing(a: &WeightedGaussian, b: &WeightedGaussian) -> f64 {
    let between = |x: &f64| *x > a.mean && *x < b.mean;
    let given = match (a.upper, b.lower) {
        (Some(x), Some(y)) if x == y => Some(x),
        _ => None,
    };
    gaussian_crossing(a, b).filter(between).or(given.filter(between)).unwrap_or(0.5 * (a.mean + b.mean))
}

/// Root between the means of `ln(n_a N(x; a)) = ln(n_b N(x; b))`: the difference falls from `a` to `b` strictly, so that
/// bisection finds the one root, if the ends differ in sign.
fn gaussian_crossing(a: &WeightedGaussian, b: &WeightedGaussian) -> Option<f64> {
    let log = |h: &WeightedGaussian, x: f64| (h.voxels / h.sd).ln() - 0.5 * ((x - h.mean) / h.sd).powi(2);
    let ahead = |x: f64| log(a, x) - log(b, x);
    let (mut lo, mut hi) = (a.mean, b.mean);
    if !(ahead(lo) > 0.0 && ahead(hi) < 0.0) {
        return None;
    }
    for _ in 0..64 {
        let mid = 0.5 * (lo + hi);
        if ahead(mid) > 0.0 { lo = mid } else { hi = mid }
    }
    Some(0.5 * (lo + hi))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(mean: f64, sd: f64, voxels: f64) -> WeightedGaussian {
        WeightedGaussian {
            mean,
            sd,
            voxels,
            lower: None,
            upper: None,
            is_transition: false,
            is_background: false,
        }
    }

    #[test]
    fn equal_gaussians_cross_half_way_and_the_larger_class_is_wider() {
        assert!((crossing(&gaussian(10.0, 2.0, 5.0), &gaussian(20.0, 2.0, 5.0)) - 15.0).abs() < 1e-9);
        // ln(100) · σ² / Δ further towards the small class.
        let at = crossing(&gaussian(10.0, 2.0, 500.0), &gaussian(20.0, 2.0, 5.0));
        assert!((at - (15.0 + 100.0_f64.ln() * 4.0 / 10.0)).abs() < 1e-9);
    }

    #[test]
    fn against_the_background_an_edge_lies_half_way_or_nearer_to_the_matter() {
        let mut air = gaussian(0.0, 2.0, 1000.0);
        let matter = gaussian(100.0, 25.0, 500.0);
        assert!(crossing(&air, &matter) < 20.0, "where the noise of the air ends");
        assert_eq!(edge(&air, &[], &matter, 1.0), (crossing(&air, &matter), 2.0));
        air.is_background = true;
        assert_eq!(edge(&air, &[], &matter, 1.0), (50.0, 2.0));
        // Turned round: bright background.
        let mut bright = gaussian(200.0, 2.0, 1000.0);
        bright.is_background = true;
        assert_eq!(edge(&matter, &[], &bright, 1.0).0, 150.0);
        // What the background's noise reaches beyond half way stays its own.
        let mut noisy = gaussian(0.0, 15.0, 100_000.0);
        noisy.is_background = true;
        assert!(edge(&noisy, &[], &gaussian(100.0, 15.0, 100.0), 1.0).0 > 60.0);
        // A transition fades about half way too.
        let mut between = gaussian(30.0, 5.0, 50.0);
        between.is_transition = true;
        let (at, half) = edge(&air, &[between], &matter, 1.0);
        assert!((50.0..60.0).contains(&at) && half > 5.0 && at + half <= 100.0, "{at} {half}");
    }

    #[test]
    fn a_root_outside_the_means_falls_back_to_the_given_crossing() {
        let mut a = gaussian(10.0, 4.0, 1e9);
        let mut b = gaussian(12.0, 4.0, 1.0);
        assert_eq!(crossing(&a, &b), 11.0);
        (a.upper, b.lower) = (Some(11.5), Some(11.5));
        assert_eq!(crossing(&a, &b), 11.5);
    }

    #[test]
    fn neighbouring_windows_share_the_edge_and_sum_to_one() {
        let windows =
            windows(&[gaussian(0.0, 3.0, 10.0), gaussian(30.0, 5.0, 20.0), gaussian(80.0, 1.0, 5.0)], 1.0);
        for i in 0..=100 {
            let v = f64::from(i);
            let sum: f64 = windows.iter().map(|w| w.weight(v)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "at {v}: {sum}");
        }
        assert_eq!(windows[0].lower, None);
        assert_eq!(windows[1].weight(30.0), 1.0);
    }

    #[test]
    fn classes_of_equal_mean_do_not_squeeze_each_other() {
        let windows =
            windows(&[gaussian(0.0, 3.0, 10.0), gaussian(30.0, 3.0, 9.0), gaussian(30.0, 3.0, 1.0)], 1.0);
        assert_eq!(windows[1].weight(30.0), 1.0);
        assert_eq!(windows[2].weight(30.0), 1.0);
        assert_eq!(windows[2].weight(0.0), 0.0);
    }

    #[test]
    fn an_edge_fades_over_the_whole_of_a_transition() {
        let mut between = gaussian(50.0, 5.0, 10.0);
        between.is_transition = true;
        let found = windows(&[gaussian(0.0, 5.0, 10.0), between, gaussian(100.0, 5.0, 10.0)], 1.0);
        assert_eq!(found[0].upper, Some((50.0, 25.0)));
        assert_eq!(found[0].upper, found[2].lower);
        assert_eq!(
            found[1].lower.map(|(at, _)| at),
            Some(25.0),
            "the transition's own place is still reported"
        );
        for value in [0.0, 30.0, 50.0, 60.0, 100.0] {
            assert!((found[0].weight(value) + found[2].weight(value) - 1.0).abs() < 1e-12);
        }
    }
}
