use ivd_core::{Exec, GradientTable, Labels, Volume, parallel};

use super::border::find;
use super::plane::{Arc, Blob};
use crate::Error;
use crate::edges::{WeightedGaussian, Window, edge};
use crate::figures::Boundary;
use crate::mix::Mix;
use crate::roles::Role;
use crate::table::{Looks, straight};

/// Samples along the values, and along the gradients.
const DIMS: [usize; 2] = [512, 128];
/// Most classes of a table by gradient: every two may share a boundary.
const MOST_CLASSES: usize = 64;
/// The table reaches beyond the steepest arc by this factor.
const BEYOND: f64 = 1.25;
/// Where no blob and no arc is likely, the value alone decides: as if this share of the voxels were spread evenly over values and gradients.
const ANYTHING: f64 = 1e-6;

/// What a table by value and gradient is made of.
pub(crate) struct ByGradient<'a> {
    pub(crate) volume: &'a Volume,
    pub(crate) labels: &'a Labels,
    pub(crate) looks: &'a Looks<'a>,
    pub(crate) gaussians: &'a [WeightedGaussian],
    /// Place of each label among the classes.
    pub(crate) rank: &'a [u16],
    /// Deviation of the values' noise.
    pub(crate) noise: f64,
    pub(crate) softness: f64,
}

/// Samples of a kind, and what is seen there.
struct Part {
    /// Likelihood times voxels, shape `[DIMS[1], DIMS[0]]`.
    weights: Vec<f64>,
    /// Materials with their shares at each value; what is missing is clear.
    shares: Vec<Vec<(usize, f64)>>,
}

/// The table, and its arcs. At a value and a gradient every blob and arc is seen by how likely it is there: a blob as its material, an arc as its two
/// materials would be if there were no others.
///
/// # Errors
/// [`Error::RowsDiffer`] where values don't tell the classes apart, so that a label has to; [`Error::TooManyClasses`].
pub(crate) fn by_gradient(of: &ByGradient<'_>, exec: &Exec) -> Result<(GradientTable, Vec<Boundary>), Error> {
    let Looks { mix, opacity, rgb, range, .. } = *of.looks;
    let classes = mix.classes.len();
    if classes > MOST_CLASSES {
        return Err(Error::TooManyClasses { classes, most: MOST_CLASSES });
    }
    if mix.rows() > 1 {
        return Err(Error::RowsDiffer);
    }
    let found = find(of.volume, of.labels, mix, of.rank, of.noise, exec)?;
    let [values, gradients] = DIMS;
    let cells = values * gradients;
    exec.check_memory(
        "the table by value and gradient",
        (8 * cells * (classes + found.arcs.len() + 4)) as u64,
    )?;
    // Beyond the table's steepest gradient there is what is at it.
    let flattest = found.blobs.iter().flatten().map(|blob| 4.0 * blob.slope).fold(0.0, f64::max);
    let steepest = found.arcs.iter().map(Arc::top).fold(flattest, f64::max);
    let top = if steepest > 0.0 { BEYOND * steepest } else { 1.0 };
    let steps = [(range[1] - range[0]) / (values - 1) as f64, top / (gradients - 1) as f64];
    let value = |i: usize| range[0] + steps[0] * i as f64;
    let floor = [0.5 * steps[0].max(f64::MIN_POSITIVE), 0.5 * steps[1]];
    let blob = |class: usize| {
        let blob = found.blobs[class]?;
        Some(Blob { sd: blob.sd.max(floor[0]), slope: blob.slope.max(floor[1]), ..blob })
    };
    let blobs = parallel::map(classes, &|class| {
        let blob = blob(class)?;
        let weight =
            |cell: usize| blob.weight(value(cell % values), steps[1] * ((cell / values) as f64 + 0.5));
        let own = |i: usize| shares(mix, value(i), [(class, 1.0)]);
        Some(Part { weights: (0..cells).map(weight).collect(), shares: (0..values).map(own).collect() })
    });
    let arcs = parallel::map(found.arcs.len(), &|i| {
        let arc = found.arcs[i];
        let [a, b] = arc.classes;
        let sd = arc.classes.map(|class| blob(class).map_or(of.gaussians[class].sd, |blob| blob.sd));
        let slope = arc.classes.map(|class| blob(class).map_or(floor[1], |blob| blob.slope));
        let mut weights = vec![0.0; cells];
        arc.splat(&mut weights, DIMS, range[0], steps, sd, slope[0].max(slope[1]));
        let between = edge(&of.gaussians[a], &of.gaussians[a + 1..b], &of.gaussians[b], of.softness);
        let upper = Window { lower: Some(between), upper: None };
        let own = |i: usize| {
            let of_upper = upper.weight(value(i));
            shares(mix, value(i), [(a, 1.0 - of_upper), (b, of_upper)])
        };
        Part { weights, shares: (0..values).map(own).collect() }
    });
    let parts: Vec<Part> = blobs.into_iter().flatten().chain(arcs).collect();
    let all: f64 = mix.classes.iter().map(|class| class.voxels as f64).sum();
    let anything = ANYTHING * all / (range[1] - range[0]).max(floor[0]) / top;
    let table = parallel::map(cells, &|cell| {
        let i = cell % values;
        let sum: f64 = parts.iter().map(|part| part.weights[cell]).sum::<f64>() + anything;
        let mut of_classes = vec![0.0; classes];
        for part in &parts {
            for &(class, share) in &part.shares[i] {
                of_classes[class] += share * part.weights[cell] / sum;
            }
        }
        let mut by_value = Vec::new();
        mix.shares(0, value(i), &mix.at(value(i)), &mut by_value);
        for (class, share) in by_value {
            of_classes[class] += share * anything / sum;
        }
        let seen: Vec<(usize, f64)> =
            of_classes.into_iter().enumerate().filter(|(_, share)| *share > 1e-3).collect();
        straight(&seen, opacity, rgb)
    });
    let boundary = |arc: &Arc| Boundary {
        classes: arc.classes.map(|class| mix.classes[class].id),
        voxels: arc.voxels as u64,
        blur_mm: arc.blur,
    };
    Ok((GradientTable::new(top, DIMS, table)?, found.arcs.iter().map(boundary).collect()))
}

/// The materials among classes, with their shares less what air takes.
fn shares<const N: usize>(mix: &Mix<'_>, value: f64, of: [(usize, f64); N]) -> Vec<(usize, f64)> {
    let air = mix.above_air(value);
    let is_material = |class: usize| mix.roles[class] == Role::Material;
    of.into_iter()
        .filter(|(class, _)| is_material(*class))
        .map(|(class, share)| (class, share * air))
        .collect()
}
