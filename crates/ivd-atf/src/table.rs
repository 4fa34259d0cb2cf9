//! The table of a transfer function and its entries, from what each class contributes.

use ivd_core::{Exec, NO_DATA, TransferEntry, TransferFunction, Volume, parallel};

use crate::built::reference_mm;
use crate::error::Error;
use crate::mix::Mix;
use crate::roles::Role;

/// Samples of the table, of all its rows, that are worked out at a time.
const BLOCK: usize = 256;

/// How classes look, and where on the value axis the table lies.
pub(crate) struct Looks<'a> {
    pub(crate) mix: &'a Mix<'a>,
    /// Opacity over the reference length, by class.
    pub(crate) opacity: &'a [f64],
    /// Linear RGB, by class.
    pub(crate) rgb: &'a [[f32; 3]],
    pub(crate) range: [f64; 2],
    pub(crate) resolution: usize,
}

/// The table: the union of all classes, and a row for each of them but label 0.
pub(crate) fn tabulate(volume: &Volume, looks: &Looks<'_>, exec: &Exec) -> Result<TransferFunction, Error> {
    let Looks { mix, opacity, rgb, range, resolution } = *looks;
    let value = |i: usize| range[0] + (range[1] - range[0]) * (i as f64 / (resolution - 1) as f64);
    let of_entries: Vec<usize> = (0..mix.classes.len()).filter(|&c| mix.classes[c].id != NO_DATA).collect();
    let row_of: Vec<usize> = std::iter::once(0).chain(of_entries.iter().map(|&c| mix.row(c))).collect();
    let samples = row_of.len() * resolution + mix.rows() * BLOCK;
    exec.check_memory("the table of the transfer function", (size_of::<[f32; 4]>() * samples) as u64)?;
    let mut table = vec![[0.0; 4]; row_of.len() * resolution];
    for from in (0..resolution).step_by(BLOCK) {
        exec.check_cancelled()?;
        let columns = parallel::map(BLOCK.min(resolution - from), &|i| {
            let (value, mut shares) = (value(from + i), Vec::new());
            let at = mix.at(value);
            let sample = |row| {
                mix.shares(row, value, &at, &mut shares);
                straight(&shares, opacity, rgb)
            };
            (0..mix.rows()).map(sample).collect::<Vec<_>>()
        });
        for (row, &source) in row_of.iter().enumerate() {
            let samples = &mut table[row * resolution + from..];
            samples.iter_mut().zip(&columns).for_each(|(sample, column)| *sample = column[source]);
        }
    }
    let entries: Vec<TransferEntry> = of_entries.iter().map(|&class| entry(looks, class)).collect();
    let classes = std::iter::once(NO_DATA).chain(entries.iter().map(|e| e.class)).collect();
    let reference_mm = reference_mm(volume.grid());
    Ok(TransferFunction::new(range, resolution, reference_mm, classes, table, entries)?)
}

/// What a class contributes. A transition is reported as it looks at its mean.
fn entry(looks: &Looks<'_>, class: usize) -> TransferEntry {
    let Looks { mix, opacity, rgb, range, .. } = *looks;
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
pub(crate) fn straight(shares: &[(usize, f64)], opacity: &[f64], rgb: &[[f32; 3]]) -> [f32; 4] {
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
