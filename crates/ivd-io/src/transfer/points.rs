//! A transfer function as points with something between them, as other programs keep it.

use ivd_core::{TransferFunction, srgb};

use super::Problem;

/// Most that a colour or opacity between points may differ from the function's.
const TOLERANCE: f64 = 0.25 / 255.0;
/// Places between two samples of the table where that is looked at.
const BETWEEN: usize = 32;
/// Steps between the samples of a table that is made of points, at least and at most.
const STEPS: [usize; 2] = [4095, 65_535];

/// A point: the value there, and how it goes on to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point<const N: usize> {
    pub(super) x: f64,
    pub(super) y: [f64; N],
    /// Share of the way to the next point at which half of the change is made.
    pub(super) midpoint: f64,
    /// 0: linear; 1: a step at the midpoint.
    pub(super) sharpness: f64,
}

impl<const N: usize> Point<N> {
    pub(super) fn linear(x: f64, y: [f64; N]) -> Self {
        Self { x, y, midpoint: 0.5, sharpness: 0.0 }
    }
}

/// Colours as the screen shows them, and opacities, by ascending value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Points {
    pub(super) colour: Vec<Point<3>>,
    pub(super) opacity: Vec<Point<1>>,
    /// Length over which opacities hold (mm).
    pub(super) reference_mm: f64,
    /// Values of the first and the last sample.
    pub(super) range: [f64; 2],
}

impl Points {
    /// Those of the row for label 0.
    pub(super) fn of(transfer: &TransferFunction) -> Self {
        let [low, high] = transfer.range();
        let count = if high > low { (transfer.resolution() - 1) * BETWEEN + 1 } else { 1 };
        let value = |i: usize| low + (high - low) * i as f64 / (count - 1).max(1) as f64;
        let samples: Vec<[f64; 4]> = (0..count)
            .map(|i| {
                let [r, g, b, a] = transfer.sample(0, value(i)).map(f64::from);
                [srgb::encoded(r), srgb::encoded(g), srgb::encoded(b), a]
            })
            .collect();
        let colours: Vec<[f64; 3]> = samples.iter().map(|s| [s[0], s[1], s[2]]).collect();
        let opacities: Vec<[f64; 1]> = samples.iter().map(|s| [s[3]]).collect();
        Self {
            colour: kept(&colours).into_iter().map(|i| Point::linear(value(i), colours[i])).collect(),
            opacity: kept(&opacities).into_iter().map(|i| Point::linear(value(i), opacities[i])).collect(),
            reference_mm: transfer.reference_mm(),
            range: [low, high],
        }
    }

    /// The transfer function of them.
    pub(super) fn transfer(&self) -> Result<TransferFunction, Problem> {
        let [low, high] = self.range;
        let steps = self.steps();
        let value = |i: usize| low + (high - low) * i as f64 / steps as f64;
        let table = (0..=steps)
            .map(|i| {
                let [r, g, b] = at(&self.colour, value(i)).map(|c| srgb::linear(c.clamp(0.0, 1.0)) as f32);
                [r, g, b, at(&self.opacity, value(i))[0].clamp(0.0, 1.0) as f32]
            })
            .collect();
        TransferFunction::new(self.range, steps + 1, self.reference_mm, vec![0], table, Vec::new())
            .map_err(|error| Problem::new("the points", error.to_string()))
    }
}

impl Points {
    /// So many steps that every point is a sample where they lie on a grid that is fine enough, as those of a table do; else as many as
    /// can be.
    fn steps(&self) -> usize {
        let [low, high] = self.range;
        let mut places: Vec<f64> =
            self.colour.iter().map(|p| p.x).chain(self.opacity.iter().map(|p| p.x)).collect();
        places.sort_by(f64::total_cmp);
        let gaps = places.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 1e-9 * (high - low));
        let count = ((high - low) / gaps.fold(f64::INFINITY, f64::min)).round().max(1.0);
        // The smallest gap may be several of the grid's.
        let on_grid = |count: f64| {
            places.iter().all(|x| {
                let at = (x - low) / (high - low) * count;
                (at - at.round()).abs() < 1e-3
            })
        };
        let found = (1..=64).map(|by| f64::from(by) * count).find(|count| on_grid(*count));
        match found.filter(|count| *count <= STEPS[1] as f64) {
            Some(count) => {
                count as usize * (STEPS[0].div_ceil(count as usize)).min(STEPS[1] / count as usize)
            }
            None => STEPS[1],
        }
    }
}

/// Indices of samples that, joined by lines, come near to all of them: of each stretch as long a one as can be.
fn kept<const N: usize>(samples: &[[f64; N]]) -> Vec<usize> {
    let mut kept = vec![0];
    while let Some(&from) = kept.last().filter(|&&from| from + 1 < samples.len()) {
        kept.push(furthest(samples, from));
    }
    kept
}

/// The last sample that a line from one on reaches with all between within the tolerance: slopes that do narrow down.
fn furthest<const N: usize>(samples: &[[f64; N]], from: usize) -> usize {
    let (mut least, mut most) = ([f64::NEG_INFINITY; N], [f64::INFINITY; N]);
    let mut last = from + 1;
    for (to, sample) in samples.iter().enumerate().skip(from + 1) {
        let run = (to - from) as f64;
        let slope: [f64; N] = std::array::from_fn(|c| (sample[c] - samples[from][c]) / run);
        if (0..N).any(|c| slope[c] < least[c] || slope[c] > most[c]) {
            break;
        }
        last = to;
        for c in 0..N {
            least[c] = least[c].max(slope[c] - TOLERANCE / run);
            most[c] = most[c].min(slope[c] + TOLERANCE / run);
        }
    }
    last
}

/// The value at a place; beyond the points that of the first or last one.
fn at<const N: usize>(points: &[Point<N>], x: f64) -> [f64; N] {
    let after = points.partition_point(|point| point.x <= x);
    let Some(before) = after.checked_sub(1).map(|i| points[i]) else {
        return points.first().map_or([0.0; N], |first| first.y);
    };
    let Some(next) = points.get(after) else { return before.y };
    let t = (x - before.x) / (next.x - before.x);
    std::array::from_fn(|c| between(before.y[c], next.y[c], t, before.midpoint, before.sharpness))
}

/// From one value to the next, as VTK bends a curve by midpoint and sharpness.
fn between(from: f64, to: f64, t: f64, midpoint: f64, sharpness: f64) -> f64 {
    let midpoint = midpoint.clamp(1e-5, 1.0 - 1e-5);
    let t = if t < midpoint { 0.5 * t / midpoint } else { 0.5 + 0.5 * (t - midpoint) / (1.0 - midpoint) };
    if sharpness > 0.99 {
        return if t < 0.5 { from } else { to };
    }
    if sharpness < 0.01 {
        return from + (to - from) * t;
    }
    let power = 1.0 + 10.0 * sharpness;
    let t = if t < 0.5 { 0.5 * (2.0 * t).powf(power) } else { 1.0 - 0.5 * (2.0 * (1.0 - t)).powf(power) };
    // Hermite's curve between the two, of a slope at its ends.
    let slope = (1.0 - sharpness) * (to - from);
    let (t2, t3) = (t * t, t * t * t);
    let value = (2.0 * t3 - 3.0 * t2 + 1.0) * from
        + (3.0 * t2 - 2.0 * t3) * to
        + (t3 - 2.0 * t2 + t) * slope
        + (t3 - t2) * slope;
    value.clamp(from.min(to), from.max(to))
}

/// Points whose values ascend.
pub(super) fn ascending<const N: usize>(
    mut points: Vec<Point<N>>,
    place: &str,
) -> Result<Vec<Point<N>>, Problem> {
    if points.is_empty() {
        return Err(Problem::new(place, "there are no points"));
    }
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    Ok(points)
}

/// Where the points of both begin and end.
pub(super) fn range(colour: &[Point<3>], opacity: &[Point<1>]) -> [f64; 2] {
    let all = || colour.iter().map(|p| p.x).chain(opacity.iter().map(|p| p.x));
    [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_table_are_few_and_near_to_it() {
        let table: Vec<[f32; 4]> = (0..512)
            .map(|i| {
                let bone = (i > 300) as u8 as f32;
                [0.2 + 0.8 * bone, 0.1 + 0.6 * bone, (i as f32 / 511.0).powi(2), 0.7 * bone]
            })
            .collect();
        let transfer =
            TransferFunction::new([-1000.0, 2000.0], 512, 1.5, vec![0], table, Vec::new()).unwrap();
        let points = Points::of(&transfer);
        assert!(points.opacity.len() < 8 && points.colour.len() < 200, "{}", points.colour.len());
        for i in 0..1024 {
            let value = -1000.0 + 3000.0 * f64::from(i) / 1023.0;
            let [r, g, b, a] = transfer.sample(0, value).map(f64::from);
            let [x, y, z] = at(&points.colour, value);
            let off = [
                srgb::encoded(r) - x,
                srgb::encoded(g) - y,
                srgb::encoded(b) - z,
                a - at(&points.opacity, value)[0],
            ];
            // Twice as much where a value lies between the places that were looked at.
            assert!(off.iter().all(|d| d.abs() < 2.0 * TOLERANCE), "{value}: {off:?}");
        }
        let back = points.transfer().unwrap();
        assert_eq!((back.range(), back.reference_mm()), ([-1000.0, 2000.0], 1.5));
    }

    #[test]
    fn curves_bend_by_midpoint_and_sharpness() {
        assert!((between(0.0, 1.0, 0.25, 0.25, 0.0) - 0.5).abs() < 1e-12);
        assert_eq!([0.2, 0.4].map(|t| between(0.0, 1.0, t, 0.3, 1.0)), [0.0, 1.0]);
        assert!((between(2.0, 4.0, 0.5, 0.5, 0.5) - 3.0).abs() < 1e-12);
        assert!(between(0.0, 1.0, 0.25, 0.5, 0.5) < 0.1);
    }
}
