use ivd_core::{Exec, Labels, Volume};

use crate::bins::SampleBins;
use crate::built::{Built, reference_mm};
use crate::colour::{self, Coloured};
use crate::edges::WeightedGaussian;
use crate::error::Error;
use crate::figures::{ClosePair, Figures, MaterialVisibility};
use crate::gradient::{ByGradient, by_gradient};
use crate::mix::Mix;
use crate::params::{Axes, OpacityRule, Params};
use crate::range::{range_of, table_range};
use crate::rays;
use crate::reduced::Reduced;
use crate::roles::{HALF_GAS, Role, are_chosen, are_hounsfield, roles};
use crate::statistics::{ClassStatistics, measure};
use crate::structure;
use crate::table::{Looks, tabulate};
use crate::visibility::{Bounds, Fit, fit};

/// Most samples along an axis that a volume is held in.
const MOST_ALONG: usize = 256;
/// Most pairs of close colours that are reported.
const MOST_PAIRS: usize = 64;

/// The automatic transfer function of a segmented volume (thesis 4.2.2).
///
/// Every label above 0 that occurs gives an entry, in the order of means (ties by label); statistics are measured, so
/// that labels from elsewhere, without classes, do as well. Label 0 on voxels with data is background: it gives no entry
/// but competes for the value axis in row 0, as a clear class. Where it has 1 % of the voxels or more, every other label is a material, but for gas.
///
/// **Roles.** In Hounsfield units classes with a mean of at most −500 are background. Else it is the class with the largest share of the
/// sides, each axis alike, with those that noise splits it into, if 9/10 of it is joined to them, and every class beyond it. A class that noise split off
/// the background belongs to it; a thin steep class between two others is a transition.
///
/// **Opacity** over `reference_mm`, by visibility: that of each material goes by what it would cover alone and by how much of it lies in front. By border
/// strength `g` (real units per mm) and share `n` of the voxels:
///
/// ```text
/// opacity = clamp(max_opacity · s / max s, min_opacity, max_opacity),   s = g · n^(-size_exponent)
/// ```
///
/// where classes all without border (a constant volume) have `g = 1`. **Reference length**: the cube root of the volume's size in mm³, over 128.
///
/// # Errors
/// [`Error::Core`] where volume and labels lie on different grids, memory is short or the work was cancelled; [`ivd_core::Error::Param`];
/// [`Error::TooManyClasses`] above 1,024; [`Error::TooWide`] for values beyond ±10¹⁴⁰.
pub fn transfer(volume: &Volume, labels: &Labels, params: &Params, exec: &Exec) -> Result<Built, Error> {
    params.require_valid()?;
    volume.grid().require(labels.grid(), "volume", "labels")?;
    exec.run(|| {
        let whole = range_of(volume)?;
        let mut classes = measure(volume, labels, exec)?;
        classes.sort_by(|a, b| a.mean.total_cmp(&b.mean).then(a.id.cmp(&b.id)));
        let mut rank = vec![0; 1 << 16];
        for (i, class) in classes.iter().enumerate() {
            rank[usize::from(class.id)] = i as u16;
        }
        let range = table_range(volume, &classes, whole);
        let reduced = Reduced::new(volume, labels, rank.clone(), range, MOST_ALONG, exec)?;
        let least_noise = least_noise(volume, &reduced);
        let structure = structure::measure(&reduced, classes.len(), least_noise, exec)?;
        let hounsfield = are_hounsfield(params.values, volume.modality(), whole);
        let apart = || structure::apart(&reduced, &structure, least_noise, exec);
        let roles = roles(&classes, &structure, apart, &reduced, hounsfield)?;
        let gaussians = gaussians(&classes, &roles, labels, range, params);
        let mix = Mix::new(
            &classes,
            &roles,
            &gaussians,
            params.softness,
            hounsfield && has_matter(&classes, &roles),
        );
        let (opacity, fit) = match params.opacity {
            OpacityRule::Border => (by_border(&mix, params), None),
            OpacityRule::Visibility => {
                let fit = by_visibility(volume, &reduced, &mix, params, exec)?;
                (fit.opacity.clone(), Some(fit))
            }
        };
        // Chosen parts of about the same value would look alike by tissue.
        let are_alike = are_chosen(&classes) && !mix.tells_materials_apart();
        let palette = colour::chosen(params.palette, hounsfield, volume.modality(), are_alike);
        let touching = colour::touching(&roles, &structure);
        let rgb = colour::colours(&Coloured {
            classes: &classes,
            roles: &roles,
            structure: &structure,
            reduced: &reduced,
            touching: &touching,
            palette,
            hounsfield,
            by_value: mix.rows() == 1,
        });
        let looks = Looks { mix: &mix, opacity: &opacity, rgb: &rgb, range, resolution: params.resolution };
        let mut transfer = tabulate(volume, &looks, exec)?;
        let mut boundaries = Vec::new();
        if params.axes == Axes::ValueGradient {
            let noise = structure.noise * reduced.step();
            let (looks, gaussians, softness) = (&looks, &gaussians[..], params.softness);
            let of = ByGradient { volume, labels, looks, gaussians, rank: &rank, noise, softness };
            let (table, found) = by_gradient(&of, exec)?;
            (transfer, boundaries) = (transfer.with_gradient(table), found);
        }
        let of =
            |role: Role| (0..classes.len()).filter(|&c| roles[c] == role).map(|c| classes[c].id).collect();
        let pairs = colour::close_pairs(&touching, &rgb);
        let entries = Figures::of_entries(&transfer, palette, hounsfield);
        let figures = Figures {
            background: of(Role::Background),
            transitions: of(Role::Transition),
            boundaries,
            close_pairs: pairs.iter().take(MOST_PAIRS).map(|pair| close_pair(pair, &classes)).collect(),
            ..fit.map_or(entries.clone(), |fit| with_visibility(entries, &mix, &fit, params))
        };
        Ok(Built { transfer, figures })
    })
}

/// Whether there is any material that isn't gas: only then is air clear, so that a volume of nothing but gas isn't all clear.
fn has_matter(classes: &[ClassStatistics], roles: &[Role]) -> bool {
    classes.iter().zip(roles).any(|(class, role)| *role == Role::Material && class.mean > HALF_GAS)
}

fn close_pair(pair: &colour::Pair, classes: &[ClassStatistics]) -> ClosePair {
    ClosePair { classes: pair.classes.map(|class| classes[class].id), difference: pair.difference }
}

/// Figures with those of a fit.
fn with_visibility(figures: Figures, mix: &Mix<'_>, fit: &Fit, params: &Params) -> Figures {
    let materials = (0..mix.classes.len()).filter(|&class| mix.roles[class] == Role::Material);
    let visibility = materials.map(|class| MaterialVisibility {
        class: mix.classes[class].id,
        visibility: fit.visibility[class],
        target: fit.target[class],
        coverage: fit.coverage[class],
    });
    Figures {
        visibility: visibility.collect(),
        divergence: Some(fit.divergence),
        rounds: fit.rounds,
        views: params.views as u32,
        background_opacity: fit.background_opacity,
        silhouette_difference: fit.silhouette_difference,
        ..figures
    }
}

/// Deviation of the rounding to whole stored numbers [levels].
fn least_noise(volume: &Volume, reduced: &Reduced<'_>) -> f64 {
    let whole = if volume.voxel_type().is_integer() { volume.slope().abs() } else { 0.0 };
    if reduced.step() > 0.0 { whole / 12.0_f64.sqrt() / reduced.step() } else { 0.0 }
}

/// The classes as weighted Gaussians.
fn gaussians(
    classes: &[ClassStatistics],
    roles: &[Role],
    labels: &Labels,
    range: [f64; 2],
    params: &Params,
) -> Vec<WeightedGaussian> {
    // A spread below half a table step makes no difference, and 0 has no posterior.
    let floor = (0.5 * (range[1] - range[0]) / (params.resolution - 1) as f64).max(f64::MIN_POSITIVE);
    let gaussian = |(s, role): (&ClassStatistics, &Role)| {
        let class = labels.class(s.id);
        WeightedGaussian {
            mean: s.mean,
            sd: s.sd.max(floor),
            voxels: s.voxels as f64,
            lower: class.and_then(|c| c.lower),
            upper: class.and_then(|c| c.upper),
            is_transition: *role == Role::Transition,
            is_background: *role == Role::Background,
        }
    };
    classes.iter().zip(roles).map(gaussian).collect()
}

/// Opacities by the strength of borders and the inverse of sizes; zeros for what is no material.
fn by_border(mix: &Mix<'_>, params: &Params) -> Vec<f64> {
    let materials = || mix.classes.iter().zip(mix.roles).filter(|(_, role)| **role == Role::Material);
    let total: u64 = mix.classes.iter().map(|class| class.voxels).sum();
    let borderless = materials().all(|(class, _)| class.border_strength == 0.0);
    let score = |class: &ClassStatistics| {
        let strength = if borderless { 1.0 } else { class.border_strength };
        strength * (class.voxels as f64 / total as f64).powf(-params.size_exponent)
    };
    let greatest = materials().map(|(class, _)| score(class)).fold(0.0, f64::max);
    let opacity = |(class, role): (&ClassStatistics, &Role)| match role {
        Role::Material => {
            (params.max_opacity * score(class) / greatest).clamp(params.min_opacity, params.max_opacity)
        }
        _ => 0.0,
    };
    mix.classes.iter().zip(mix.roles).map(opacity).collect()
}

/// Opacities by visibility.
fn by_visibility(
    volume: &Volume,
    reduced: &Reduced<'_>,
    mix: &Mix<'_>,
    params: &Params,
    exec: &Exec,
) -> Result<Fit, Error> {
    let bins = SampleBins::new(mix, reduced, exec)?;
    let materials: Vec<usize> = (0..mix.classes.len()).filter(|&c| mix.roles[c] == Role::Material).collect();
    let bounds = Bounds {
        least: params.min_opacity,
        most: params.max_opacity,
        reference_mm: reference_mm(volume.grid()),
    };
    // Samples are most of what is held meanwhile.
    if bins.len() <= 1 << 16 {
        let bundle = rays::cast::<u16>(reduced, mix, &bins, params.views, exec)?;
        return fit(&bundle, &bins, mix.classes.len(), &materials, &bounds, exec);
    }
    let bundle = rays::cast::<u32>(reduced, mix, &bins, params.views, exec)?;
    fit(&bundle, &bins, mix.classes.len(), &materials, &bounds, exec)
}
