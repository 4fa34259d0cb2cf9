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
        role: mix.roles[class],
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::WeightedGaussian;
    use crate::statistics::ClassStatistics;
    use ivd_core::{ClassLook, Grid, Voxels};

    const MATERIAL: Role = Role::Material;

    /// Mean, spread, voxels, role, colour and opacity of classes 1, 2, … in the order of their means.
    type Class = (f64, f64, u64, Role, [f32; 3], f64);

    fn tabulated(classes: &[Class], clear_air: bool) -> TransferFunction {
        let statistics: Vec<ClassStatistics> = classes
            .iter()
            .enumerate()
            .map(|(i, &(mean, sd, voxels, ..))| ClassStatistics {
                id: i as u16 + 1,
                voxels,
                mean,
                sd,
                border_strength: 1.0,
                on_sides: [0; 3],
            })
            .collect();
        let roles: Vec<Role> = classes.iter().map(|class| class.3).collect();
        let gaussian = |&(mean, sd, voxels, role, ..): &Class| WeightedGaussian {
            mean,
            sd,
            voxels: voxels as f64,
            lower: None,
            upper: None,
            is_transition: role == Role::Transition,
            is_background: role == Role::Background,
        };
        let gaussians: Vec<WeightedGaussian> = classes.iter().map(gaussian).collect();
        let mix = Mix::new(&statistics, &roles, &gaussians, 1.0, clear_air);
        let opacity: Vec<f64> = classes.iter().map(|class| class.5).collect();
        let rgb: Vec<[f32; 3]> = classes.iter().map(|class| class.4).collect();
        let looks =
            Looks { mix: &mix, opacity: &opacity, rgb: &rgb, range: [-1000.0, 1000.0], resolution: 1024 };
        let volume = Volume::new(Grid::with_spacing([1; 3], [1.0; 3]).unwrap(), Voxels::from(vec![0_u8]));
        tabulate(&volume.unwrap(), &looks, &Exec::default()).unwrap()
    }

    /// That hiding and colouring each material afterwards is making the table so, in every row, to within `room`.
    fn assert_changed_afterwards_as_from_the_start(classes: &[Class], clear_air: bool, room: f32) {
        let made = tabulated(classes, clear_air);
        for class in (0..classes.len()).filter(|&class| classes[class].3 == MATERIAL) {
            for (rgb, opacity) in [(classes[class].4, 0.0), ([0.3, 0.9, 0.7], 0.45)] {
                let look = ClassLook { rgb: Some(rgb), opacity: Some(opacity as f32) };
                let found = made.clone().with_class_looks(&[(class as u16 + 1, look)].into()).unwrap();
                let mut wanted = classes.to_vec();
                (wanted[class].4, wanted[class].5) = (rgb, opacity);
                let wanted = tabulated(&wanted, clear_air);
                for (i, (a, b)) in found.table().iter().zip(wanted.table()).enumerate() {
                    let far = (0..4).map(|c| {
                        let light = |s: &[f32; 4]| if c < 3 { s[c] * s[3] } else { s[3] };
                        (light(a) - light(b)).abs()
                    });
                    let far = far.fold(0.0, f32::max);
                    assert!(far <= room, "class {} at {i}: {a:?} for {b:?}", class + 1);
                }
            }
        }
    }

    #[test]
    fn a_class_that_is_changed_afterwards_looks_as_if_it_had_been_made_so() {
        let rest: [Class; 4] = [
            (-100.0, 20.0, 500, MATERIAL, [0.9, 0.7, 0.2], 0.05),
            (30.0, 15.0, 900, MATERIAL, [0.6, 0.1, 0.1], 0.2),
            (200.0, 60.0, 80, Role::Transition, [0.0; 3], 0.0),
            (600.0, 150.0, 100, MATERIAL, [0.8, 0.8, 0.7], 0.6),
        ];
        let mut classes = vec![(-980.0, 12.0, 3000, Role::Background, [0.0; 3], 0.0)];
        classes.extend(rest);
        for clear_air in [false, true] {
            assert_changed_afterwards_as_from_the_start(&classes, clear_air, 1e-4);
        }
    }

    #[test]
    fn one_that_labels_alone_tell_from_another_is_changed_where_its_label_is() {
        let classes: [Class; 5] = [
            (-980.0, 12.0, 3000, Role::Background, [0.0; 3], 0.0),
            (-100.0, 20.0, 500, MATERIAL, [0.9, 0.7, 0.2], 0.05),
            (30.0, 15.0, 900, MATERIAL, [0.6, 0.1, 0.1], 0.2),
            (34.0, 17.0, 700, MATERIAL, [0.1, 0.3, 0.8], 0.3),
            (600.0, 150.0, 100, MATERIAL, [0.8, 0.8, 0.7], 0.6),
        ];
        let made = tabulated(&classes, true);
        let look = ClassLook { rgb: None, opacity: Some(0.0) };
        let found = made.clone().with_class_looks(&[(3, look)].into()).unwrap();
        let rows = |transfer: &TransferFunction, row: usize| transfer.table()[1024 * row..][..1024].to_vec();
        assert!(rows(&found, 3).iter().all(|sample| *sample == [0.0; 4]));
        for row in [1, 2, 4, 5] {
            assert_eq!(rows(&found, row), rows(&made, row), "row {row}");
        }
        let mut without = classes;
        without[2].5 = 0.0;
        let wanted = rows(&tabulated(&without, true), 0);
        let off = rows(&found, 0).iter().zip(&wanted).map(|(a, b)| (a[3] - b[3]).abs()).fold(0.0, f32::max);
        assert!(off < 1e-3, "the union: {off}");
    }
}
