use ivd_core::op::Op as _;
use ivd_core::{Exec, Labels, NO_DATA, TransferEntry, TransferFunction, Volume, parallel};

use crate::built::{range_of, reference_mm};
use crate::colour::{self, close_pairs};
use crate::edges::Hill;
use crate::mix::Mix;
use crate::params::{ClosePair, Figures, MaterialVisibility, OpacityRule, ValueScale};
use crate::rays::{self, Symbols};
use crate::reduced::Reduced;
use crate::roles::{Role, looks_like_hounsfield, roles};
use crate::statistics::{ClassStatistics, measure};
use crate::structure;
use crate::visibility::{Balance, Bounds, balance};
use crate::{Built, Error, Params};

/// Most pairs of close colours that are told of.
const MOST_PAIRS: usize = 64;

/// The automatic transfer function of a segmented volume (thesis 4.2.2).
///
/// Every label above 0 that occurs gives an entry, in the order of means (ties by label); statistics are measured, so
/// that labels from elsewhere, without classes, do as well. Label 0 on voxels with data is a background: it gives no entry
/// but competes for the value axis in row 0, as a clear class.
///
/// **Roles.** In Hounsfield units classes with a mean of at most −500 are background. Else it is the class with the largest share of the
/// outermost layer, if 9/10 of it is joined to that layer, with every class beyond it. A class that noise split off the background belongs
/// to it; a thin steep class between two others is a transition.
///
/// **Opacity** over `reference_mm`, by visibility: what rays see is shared out in proportion to what each material would cover alone. By border strength `g` (real units per mm) and share `n` of the voxels:
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
    params.check()?;
    volume.grid().require(labels.grid(), "volume", "labels")?;
    exec.run(|| {
        let range = range_of(volume)?;
        let mut classes = measure(volume, labels, exec)?;
        classes.sort_by(|a, b| a.mean.total_cmp(&b.mean).then(a.id.cmp(&b.id)));
        let mut rank = vec![0; 1 << 16];
        for (i, class) in classes.iter().enumerate() {
            rank[usize::from(class.id)] = i as u16;
        }
        let reduced = Reduced::new(volume, labels, rank, range, exec)?;
        let structure = structure::measure(&reduced, classes.len(), least_noise(volume, &reduced), exec)?;
        let hounsfield = match params.values {
            ValueScale::Auto => looks_like_hounsfield(range),
            ValueScale::Hounsfield => true,
            ValueScale::Plain => false,
        };
        let roles = roles(&classes, &structure, &reduced, hounsfield);
        let hills = hills(&classes, &roles, labels, range, params);
        let clear_air = hounsfield && classes.iter().all(|class| class.id != NO_DATA);
        let mix = Mix::new(&classes, &roles, &hills, params.softness, clear_air);
        let (opacity, balance) = match params.opacity {
            OpacityRule::Border => (by_border(&mix, params), None),
            OpacityRule::Visibility => {
                let found = by_visibility(volume, &reduced, &mix, params, exec)?;
                (found.opacity.clone(), Some(found))
            }
        };
        let palette = colour::chosen(params.palette, hounsfield);
        let rgb = colour::colours(&classes, &roles, &structure, &reduced, palette, hounsfield);
        let transfer = tabulate(volume, &mix, &opacity, &rgb, range, params.resolution)?;
        let of =
            |role: Role| (0..classes.len()).filter(|&c| roles[c] == role).map(|c| classes[c].id).collect();
        let pairs = close_pairs(&roles, &structure, &rgb);
        let figures = Figures {
            hounsfield,
            palette,
            background: of(Role::Background),
            transitions: of(Role::Transition),
            close_pairs: pairs.iter().take(MOST_PAIRS).map(|pair| close_pair(pair, &classes)).collect(),
            ..figures(&transfer, &mix, balance.as_ref(), params)
        };
        Ok(Built { transfer, figures })
    })
}

fn close_pair(pair: &colour::Pair, classes: &[ClassStatistics]) -> ClosePair {
    ClosePair { classes: pair.classes.map(|class| classes[class].id), difference: pair.difference }
}

/// Figures of a table, without what only the classes know.
fn figures(
    transfer: &TransferFunction,
    mix: &Mix<'_>,
    balance: Option<&Balance>,
    params: &Params,
) -> Figures {
    let materials = (0..mix.classes.len()).filter(|&class| mix.roles[class] == Role::Material);
    let visibility = balance.into_iter().flat_map(|found| {
        materials.clone().map(|class| MaterialVisibility {
            class: mix.classes[class].id,
            visibility: found.seen[class],
            target: found.target[class],
            alone: found.alone[class],
        })
    });
    Figures {
        visibility: visibility.collect(),
        divergence: balance.map_or(0.0, |found| found.divergence),
        rounds: balance.map_or(0, |found| found.rounds),
        views: if balance.is_some() { params.views as u32 } else { 0 },
        background_opacity: balance.map_or(0.0, |found| found.background_opacity),
        silhouette_difference: balance.map_or(0.0, |found| found.silhouette_difference),
        ..Figures::of_entries(transfer)
    }
}

impl Figures {
    /// Figures of the entries alone.
    pub(crate) fn of_entries(transfer: &TransferFunction) -> Self {
        let opacities = || transfer.entries().iter().map(|entry| entry.opacity);
        let least = opacities().fold(f32::INFINITY, f32::min);
        let entries = transfer.entries().len();
        Self {
            entries,
            opacity_range: if entries == 0 { [0.0; 2] } else { [least, opacities().fold(0.0, f32::max)] },
            hounsfield: false,
            palette: crate::Palette::Safe,
            background: Vec::new(),
            transitions: Vec::new(),
            visibility: Vec::new(),
            divergence: 0.0,
            rounds: 0,
            views: 0,
            background_opacity: 0.0,
            silhouette_difference: 0.0,
            close_pairs: Vec::new(),
        }
    }
}

/// Deviation of the rounding to whole stored numbers [levels].
fn least_noise(volume: &Volume, reduced: &Reduced<'_>) -> f64 {
    let whole = if volume.voxel_type().is_integer() { volume.slope().abs() } else { 0.0 };
    if reduced.step() > 0.0 { whole / 12.0_f64.sqrt() / reduced.step() } else { 0.0 }
}

/// The classes as their edges see them.
fn hills(
    classes: &[ClassStatistics],
    roles: &[Role],
    labels: &Labels,
    range: [f64; 2],
    params: &Params,
) -> Vec<Hill> {
    // A spread below half a table step can't be seen, and 0 has no posterior.
    let floor = (0.5 * (range[1] - range[0]) / (params.resolution - 1) as f64).max(f64::MIN_POSITIVE);
    let hill = |(s, role): (&ClassStatistics, &Role)| {
        let class = labels.class(s.id);
        Hill {
            mean: s.mean,
            sd: s.sd.max(floor),
            voxels: s.voxels as f64,
            lower: class.and_then(|c| c.lower),
            upper: class.and_then(|c| c.upper),
            is_transition: *role == Role::Transition,
        }
    };
    classes.iter().zip(roles).map(hill).collect()
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
) -> Result<Balance, Error> {
    let symbols = Symbols::new(mix, reduced);
    let bundle = rays::cast(reduced, mix, &symbols, volume.grid(), params.views, exec)?;
    let materials: Vec<usize> = (0..mix.classes.len()).filter(|&c| mix.roles[c] == Role::Material).collect();
    let bounds = Bounds {
        least: params.min_opacity,
        most: params.max_opacity,
        reference_mm: reference_mm(volume.grid()),
    };
    balance(&bundle, &symbols, mix.classes.len(), &materials, &bounds, exec)
}

/// The table: the union of all classes, and a row for each of them but label 0.
fn tabulate(
    volume: &Volume,
    mix: &Mix<'_>,
    opacity: &[f64],
    rgb: &[[f32; 3]],
    range: [f64; 2],
    resolution: usize,
) -> Result<TransferFunction, ivd_core::Error> {
    let value = |i: usize| range[0] + (range[1] - range[0]) * (i as f64 / (resolution - 1) as f64);
    let rows = mix.rows();
    let columns = parallel::map(resolution, &|i| {
        let at = mix.at(value(i));
        let mut shares = Vec::new();
        let sample = |row| {
            mix.shares(row, value(i), &at, &mut shares);
            straight(&shares, opacity, rgb)
        };
        (0..rows).map(sample).collect::<Vec<_>>()
    });
    let of_entries: Vec<usize> = (0..mix.classes.len()).filter(|&c| mix.classes[c].id != NO_DATA).collect();
    let mut table = Vec::with_capacity((of_entries.len() + 1) * resolution);
    for row in std::iter::once(0).chain(of_entries.iter().map(|&class| mix.row(class))) {
        table.extend(columns.iter().map(|column| column[row]));
    }
    let entry = |&class: &usize| entry(mix, class, opacity, rgb, range);
    let entries: Vec<TransferEntry> = of_entries.iter().map(entry).collect();
    let classes = std::iter::once(NO_DATA).chain(entries.iter().map(|e| e.class)).collect();
    TransferFunction::new(range, resolution, reference_mm(volume.grid()), classes, table, entries)
}

/// What a class contributes. A transition is told of as it looks at its mean.
fn entry(mix: &Mix<'_>, class: usize, opacity: &[f64], rgb: &[[f32; 3]], range: [f64; 2]) -> TransferEntry {
    let (window, mean) = (&mix.windows[class], mix.classes[class].mean);
    let (mut colour, mut most) = (rgb[class], opacity[class] as f32);
    if mix.roles[class] == Role::Transition {
        let mut shares = Vec::new();
        mix.shares(0, mean, &mix.at(mean), &mut shares);
        let [r, g, b, alpha] = straight(&shares, opacity, rgb);
        (colour, most) = ([r, g, b], alpha);
    }
    let half = |edge: Option<(f64, f64)>| edge.map_or(0.0, |(_, half)| half);
    TransferEntry {
        class: mix.classes[class].id,
        rgb: colour,
        opacity: most,
        lower: window.lower.map_or(range[0], |(at, _)| at),
        upper: window.upper.map_or(range[1], |(at, _)| at),
        softness: half(window.lower).max(half(window.upper)),
    }
}

/// Straight RGBA of materials with their shares: opacities add up, colours are weighed by them.
fn straight(shares: &[(usize, f64)], opacity: &[f64], rgb: &[[f32; 3]]) -> [f32; 4] {
    let (mut sum, mut alpha) = ([0.0_f64; 3], 0.0);
    for &(class, share) in shares {
        let a = share * opacity[class];
        alpha += a;
        for (sum, c) in sum.iter_mut().zip(rgb[class]) {
            *sum += a * f64::from(c);
        }
    }
    if alpha <= 0.0 {
        return [0.0; 4];
    }
    let [r, g, b] = sum.map(|c| ((c / alpha) as f32).clamp(0.0, 1.0));
    [r, g, b, (alpha as f32).clamp(0.0, 1.0)]
}
