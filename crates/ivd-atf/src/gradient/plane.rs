/// What the inside of a class looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blob {
    /// Voxels with all neighbours of their own class.
    pub(crate) voxels: f64,
    pub(crate) mean: f64,
    /// Deviation of the values.
    pub(crate) sd: f64,
    /// Deviation of each component of the gradient [real units / mm].
    pub(crate) slope: f64,
}

/// The boundary between two classes: a step between their means, blurred by a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Arc {
    /// The classes, the one of the lower mean first.
    pub(crate) classes: [usize; 2],
    /// Values inside them.
    pub(crate) means: [f64; 2],
    /// Voxels of the boundary.
    pub(crate) voxels: f64,
    /// Deviation of the blur (mm).
    pub(crate) blur: f64,
}

/// Places across a boundary that its likelihood is summed over, …
const PLACES: usize = 96;
/// … so many deviations of the blur to either side of its middle.
const REACH: f64 = 2.5;
/// Deviation of the gradients of a boundary as a share of the gradient: edges are curved, and blurs differ.
const UNEVEN: f64 = 0.2;
/// Deviations beyond which a likelihood is none.
const FAR: f64 = 5.0;

impl Blob {
    /// Likelihood of a value and a gradient, times the voxels: values are normal, and so is each component of the gradient.
    pub(crate) fn weight(&self, value: f64, gradient: f64) -> f64 {
        let g = gradient / self.slope;
        let of_gradient = (2.0 / std::f64::consts::PI).sqrt() * g * g * (-0.5 * g * g).exp() / self.slope;
        self.voxels * normal(value, self.mean, self.sd) * of_gradient
    }
}

impl Arc {
    /// What a gradient at a value says of the blur of a step from one value to another: `g = Δ/b φ(Φ⁻¹(t))` at the share `t` of the way. `None` near
    /// the ends, where little can be told.
    pub(crate) fn blur_of(ends: [f64; 2], value: f64, gradient: f64) -> Option<f64> {
        let width = ends[1] - ends[0];
        let t = (value - ends[0]) / width;
        if !(0.2..=0.8).contains(&t) {
            return None;
        }
        Some(width / gradient * bell(quantile(t)))
    }

    /// The greatest gradient of the arc.
    pub(crate) fn top(&self) -> f64 {
        (self.means[1] - self.means[0]) / self.blur * bell(0.0)
    }

    /// Adds the likelihood, times the voxels, to a grid of values and gradients (distances of samples `steps` from 0, with the first value `low`), which has
    /// `dims[0]` values a row. Voxels lie evenly across the boundary. `sd`: deviations of the values of both classes; `slope`: of a component of the gradient.
    pub(crate) fn splat(
        &self,
        grid: &mut [f64],
        dims: [usize; 2],
        low: f64,
        steps: [f64; 2],
        sd: [f64; 2],
        slope: f64,
    ) {
        let width = self.means[1] - self.means[0];
        for i in 0..PLACES {
            let z = REACH * (2.0 * (i as f64 + 0.5) / PLACES as f64 - 1.0);
            let t = cumulative(z);
            let (value, gradient) = (self.means[0] + width * t, width / self.blur * bell(z));
            // Neighbouring places are joined: a value's deviation is at least their distance.
            let apart = gradient * self.blur * 2.0 * REACH / PLACES as f64;
            let of_value = (sd[0] + (sd[1] - sd[0]) * t).hypot(apart);
            let of_gradient = slope.hypot(UNEVEN * gradient).max(steps[1]);
            let near = |at: f64, deviation: f64, from: f64, step: f64, count: usize| {
                let place = |x: f64| ((x - from) / step).clamp(0.0, (count - 1) as f64) as usize;
                place(at - FAR * deviation)..place(at + FAR * deviation) + 1
            };
            let values = near(value, of_value, low, steps[0], dims[0]);
            let along: Vec<f64> =
                values.clone().map(|v| normal(low + v as f64 * steps[0], value, of_value)).collect();
            for g in near(gradient, of_gradient, 0.0, steps[1], dims[1]) {
                let across = normal(g as f64 * steps[1], gradient, of_gradient);
                let share = self.voxels / PLACES as f64 * across;
                let row = &mut grid[g * dims[0]..][values.clone()];
                row.iter_mut().zip(&along).for_each(|(sum, along)| *sum += share * along);
            }
        }
    }
}

fn normal(x: f64, mean: f64, sd: f64) -> f64 {
    bell((x - mean) / sd) / sd
}

/// Density of the standard normal distribution.
fn bell(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// Its distribution, to 10⁻⁷ (Abramowitz & Stegun 1964, 7.1.26).
fn cumulative(z: f64) -> f64 {
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let sum = series.iter().fold(0.0, |sum, c| (sum + c) * t);
    let upper = 0.5 * sum * (-x * x).exp();
    if z > 0.0 { 1.0 - upper } else { upper }
}

/// Where the distribution reaches a share in 0.01 … 0.99, by bisection.
fn quantile(share: f64) -> f64 {
    let (mut low, mut high) = (-3.0, 3.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if cumulative(middle) < share { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_and_its_inverse() {
        for (z, share) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.959_963_985, 0.025)] {
            assert!((cumulative(z) - share).abs() < 2e-7);
            assert!((quantile(share) - z).abs() < 1e-5);
        }
    }

    #[test]
    fn the_blur_follows_from_any_place_on_an_arc() {
        let arc = Arc { classes: [0, 1], means: [50.0, 250.0], voxels: 1.0, blur: 1.3 };
        for z in [-0.7, 0.0, 0.4] {
            let (value, gradient) = (50.0 + 200.0 * cumulative(z), 200.0 / 1.3 * bell(z));
            assert!((Arc::blur_of(arc.means, value, gradient).unwrap() - 1.3).abs() < 1e-4);
        }
        assert_eq!(Arc::blur_of(arc.means, 60.0, 10.0), None);
        assert!((arc.top() - 200.0 / 1.3 / (2.0 * std::f64::consts::PI).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn likelihoods_sum_to_the_voxels() {
        let (dims, low, steps) = ([400, 300], -20.0, [0.5, 0.2]);
        let arc = Arc { classes: [0, 1], means: [20.0, 120.0], voxels: 300.0, blur: 1.5 };
        let mut grid = vec![0.0; dims[0] * dims[1]];
        arc.splat(&mut grid, dims, low, steps, [3.0, 5.0], 2.0);
        let sum = grid.iter().sum::<f64>() * steps[0] * steps[1];
        assert!((sum - 300.0).abs() < 15.0, "{sum}");
        let blob = Blob { voxels: 70.0, mean: 60.0, sd: 6.0, slope: 3.0 };
        let at = |i: usize| (low + (i % 400) as f64 * 0.5, (i / 400) as f64 * 0.2);
        let sum: f64 = (0..grid.len()).map(at).map(|(v, g)| blob.weight(v, g)).sum::<f64>() * 0.1;
        assert!((sum - 70.0).abs() < 1.0, "{sum}");
    }
}
