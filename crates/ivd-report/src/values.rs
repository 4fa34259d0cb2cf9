//! How the values of a volume are spread, with what classes and a transfer function make of them.

use ivd_core::{Scalar, TransferFunction, Volume, parallel, srgb, with_voxels};

use crate::chart::{Bars, Line, bars};
use crate::html::{css_colour, number};

/// Bars of a histogram.
const BINS: usize = 256;

/// More curves than these can't be told apart.
const MOST_DENSITIES: usize = 16;

/// A class of values, as a normal density.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassDensity {
    /// Mean of its values.
    pub mean: f64,
    /// Their standard deviation.
    pub sd: f64,
    /// Number of its voxels.
    pub voxels: u64,
    /// Crossing with the class above, where there is one.
    pub upper: Option<f64>,
    /// Colour of its curve, as CSS writes it.
    pub colour: String,
}

/// Normal density of each class, in voxels a bar.
fn densities(classes: &[ClassDensity], range: [f64; 2]) -> Vec<Line> {
    let width = (range[1] - range[0]) / BINS as f64;
    let line = |class: &ClassDensity| {
        let ClassDensity { mean, sd, voxels, .. } = *class;
        let density =
            |value: f64| (-0.5 * ((value - mean) / sd).powi(2)).exp() / (sd * std::f64::consts::TAU.sqrt());
        let heights = (0..BINS).map(|i| voxels as f64 * width * density(range[0] + (i as f64 + 0.5) * width));
        (sd > 0.0 && width > 0.0).then(|| Line { heights: heights.collect(), colour: class.colour.clone() })
    };
    classes.iter().take(MOST_DENSITIES).filter_map(line).collect()
}

/// The histogram of a volume under the densities and crossings of its classes, and the opacity of a transfer function below it.
pub fn value_histogram(
    volume: &Volume,
    transfer: Option<&TransferFunction>,
    classes: &[ClassDensity],
) -> String {
    let Some(range) = volume.range() else { return "<p>The volume holds no data.</p>".to_owned() };
    let counts = count_values(volume, range);
    let crossings: Vec<(f64, String)> =
        classes.iter().filter_map(|class| class.upper).map(|v| (v, number(v))).collect();
    let mut html = bars(&Bars {
        range,
        counts: &counts,
        x_label: "value; vertical: crossings of the classes, curves: their normal densities, bars: the transfer function's colours",
        y_label: "voxels",
        logarithmic: true,
        marks: crossings,
        colour: &|value| value_colour(transfer, value),
        lines: densities(classes, range),
    });
    if let Some(transfer) = transfer {
        let opacity: Vec<u64> = (0..BINS)
            .map(|i| range[0] + (i as f64 + 0.5) / BINS as f64 * (range[1] - range[0]))
            .map(|value| (f64::from(transfer.sample(0, value)[3]) * 1000.0).round() as u64)
            .collect();
        html += &bars(&Bars {
            range,
            counts: &opacity,
            x_label: "value",
            y_label: "opacity [‰]",
            logarithmic: false,
            marks: Vec::new(),
            colour: &|value| value_colour(Some(transfer), value),
            lines: Vec::new(),
        });
    }
    html
}

/// Number of voxels in equal bins of real values.
fn count_values(volume: &Volume, range: [f64; 2]) -> Vec<u64> {
    let scale = if range[1] > range[0] { BINS as f64 / (range[1] - range[0]) } else { 0.0 };
    with_voxels!(volume.voxels(), slice => {
        parallel::map_pieces(slice.len(), 1 << 18, &|piece| {
            let mut counts = vec![0_u64; BINS];
            for value in slice[piece].iter().filter(|v| v.is_data()) {
                let bin = (volume.real(value.to_f64()) - range[0]) * scale;
                counts[(bin as usize).min(BINS - 1)] += 1;
            }
            counts
        })
    })
    .into_iter()
    .fold(vec![0; BINS], |a, b| a.iter().zip(&b).map(|(x, y)| x + y).collect())
}

/// Colour of a value in the transfer function, for a page; grey where there is none.
fn value_colour(transfer: Option<&TransferFunction>, value: f64) -> String {
    let Some(transfer) = transfer else { return "#777".to_owned() };
    let rgba = transfer.sample(0, value);
    // Clear values (air) would be drawn black on white: grey says that they aren't shown.
    if rgba[3] < 1e-4 {
        return "#bbb".to_owned();
    }
    css_colour([rgba[0], rgba[1], rgba[2]].map(srgb::byte))
}
