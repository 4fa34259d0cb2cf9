//! How single classes of a transfer function look, changed after it was made.
//!
//! A sample of the table is a mix of materials: with the premultiplied look `p_c` of each (colour times opacity, and opacity) and its share
//! `s_c` of the sample, `p = Σ s_c p_c`. The shares follow from the table: those nearest to what the windows of the entries say, among all that
//! give the sample. Where no more than four materials of different looks meet they are exact. A class looks otherwise as
//! `p + s_c (p'_c − p_c)`.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Vector4};

use crate::{ClassRole, Error, TransferEntry, TransferFunction};

/// Looks whose difference is less than this part of the greatest aren't told apart.
const TOLD_APART: f64 = 1e-3;
/// Opacity, over that of before, up to which what is left of a sample is rounding.
const LEFT: f64 = 1e-4;

/// How a class is to look.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ClassLook {
    /// Linear RGB in 0…1, where it changes.
    pub rgb: Option<[f32; 3]>,
    /// Opacity over the reference length, 0…1, where it changes.
    pub opacity: Option<f32>,
}

/// A colour with its opacity, premultiplied.
fn premultiplied(rgb: [f32; 3], opacity: f32) -> Vector4<f64> {
    let [r, g, b] = rgb.map(|c| f64::from(c) * f64::from(opacity));
    Vector4::new(r, g, b, f64::from(opacity))
}

/// Weight of a class at a value by its window, 0…1.
fn weight(entry: &TransferEntry, [low, high]: [f64; 2], value: f64) -> f64 {
    let rise = |d: f64| {
        let t = if entry.softness > 0.0 {
            (0.5 + 0.5 * d / entry.softness).clamp(0.0, 1.0)
        } else {
            f64::from(u8::from(d >= 0.0))
        };
        t * t * (3.0 - 2.0 * t)
    };
    // Nothing lies beyond an end of the range, where windows are open.
    let below = if entry.lower <= low { 1.0 } else { rise(value - entry.lower) };
    let above = if entry.upper >= high { 1.0 } else { rise(entry.upper - value) };
    below.min(above)
}

/// A class as it was and as it is to be.
struct Changed<'a> {
    entry: &'a TransferEntry,
    before: Vector4<f64>,
    after: Vector4<f64>,
    /// Its colour, where that changes or nothing was seen of it.
    rgb: Option<[f32; 3]>,
}

impl Changed<'_> {
    /// A straight sample of a voxel that is known to be of the class.
    fn changed_voxel(&self, [r, g, b, alpha]: [f32; 4]) -> [f32; 4] {
        if self.before == self.after {
            return [r, g, b, alpha];
        }
        let alpha = if self.before.w > 0.0 {
            (f64::from(alpha) * self.after.w / self.before.w).min(1.0) as f32
        } else {
            self.after.w as f32
        };
        let [r, g, b] = self.rgb.unwrap_or([r, g, b]);
        if alpha > 0.0 { [r, g, b, alpha] } else { [0.0; 4] }
    }
}

impl TransferFunction {
    /// Classes whose look can be changed: materials, and background, which can be made visible.
    pub fn classes_with_looks(&self) -> impl Iterator<Item = u16> {
        self.entries().iter().filter(|entry| entry.role != ClassRole::Transition).map(|entry| entry.class)
    }

    /// The same with some classes looking otherwise; classes that it has no look of are left out.
    ///
    /// Where values tell all classes apart, a class of opacity 0 is gone: what lies beside it keeps its share alone; one that was background is seen
    /// where its window says and nothing else is. Where labels are needed to tell them apart, so it is in row 0, and the row of a label changes
    /// with its own class alone: all of it has that class's colour, and an opacity in proportion; with an opacity of 0 it is clear, whatever the class is.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] for a table by value and gradient, whose samples don't tell classes apart, and for looks that leave 0…1.
    pub fn with_class_looks(self, looks: &BTreeMap<u16, ClassLook>) -> Result<Self, Error> {
        if self.gradient().is_some() {
            let problem = "it goes by value and gradient, where single classes can't be told apart; make one with axes value".to_owned();
            return Err(Error::Inconsistent { what: "transfer function", problem });
        }
        let entries: Vec<TransferEntry> =
            self.entries().iter().map(|entry| changed_entry(entry, looks)).collect();
        let classes: Vec<Changed<'_>> = self
            .entries()
            .iter()
            .zip(&entries)
            .filter(|(entry, _)| entry.role != ClassRole::Transition)
            .map(|(entry, after)| Changed {
                entry,
                before: premultiplied(entry.rgb, entry.opacity),
                after: premultiplied(after.rgb, after.opacity),
                rgb: (entry.rgb != after.rgb || entry.opacity <= 0.0).then_some(after.rgb),
            })
            .collect();
        let [low, high] = self.range();
        let (samples, mut table) = (self.resolution(), self.table().to_vec());
        for (i, sample) in table[..samples].iter_mut().enumerate() {
            let value = low + (high - low) * (i as f64 / (samples - 1) as f64);
            *sample = changed_sample(*sample, &classes, self.range(), value);
        }
        let by_label = self.depends_on_label();
        let (of_values, of_labels) = table.split_at_mut(samples);
        for (row, label) in of_labels.chunks_exact_mut(samples).zip(&self.classes()[1..]) {
            if !by_label {
                row.copy_from_slice(of_values);
            } else if looks.get(label).is_some_and(|look| look.opacity == Some(0.0)) {
                // Voxels of a background, or between two classes, show something of those beside them.
                row.fill([0.0; 4]);
            } else if let Some(class) = classes.iter().find(|class| class.entry.class == *label) {
                for sample in row {
                    *sample = class.changed_voxel(*sample);
                }
            }
        }
        self.with_looks(table, entries)
    }
}

fn changed_entry(entry: &TransferEntry, looks: &BTreeMap<u16, ClassLook>) -> TransferEntry {
    let look = looks.get(&entry.class).filter(|_| entry.role != ClassRole::Transition);
    let ClassLook { rgb, opacity } = look.copied().unwrap_or_default();
    let role = if opacity.is_some_and(|opacity| opacity > 0.0) { ClassRole::Material } else { entry.role };
    TransferEntry {
        rgb: rgb.unwrap_or(entry.rgb),
        opacity: opacity.unwrap_or(entry.opacity),
        role,
        ..entry.clone()
    }
}

/// A straight sample as it is to be.
fn changed_sample(sample: [f32; 4], classes: &[Changed<'_>], range: [f64; 2], value: f64) -> [f32; 4] {
    let at: Vec<(&Changed<'_>, f64)> = classes
        .iter()
        .map(|class| (class, weight(class.entry, range, value)))
        .filter(|(_, weight)| *weight > 0.0)
        .collect();
    if at.iter().all(|(class, _)| class.before == class.after) {
        return sample;
    }
    let all: f64 = at.iter().map(|(_, weight)| weight).sum::<f64>().max(1.0);
    let (materials, clear): (Vec<_>, Vec<_>) = at.into_iter().partition(|(class, _)| class.before.w > 0.0);
    let before = premultiplied([sample[0], sample[1], sample[2]], sample[3]);
    let shares = shares(before, &materials, all);
    let room = (1.0 - shares.iter().sum::<f64>()).max(0.0);
    let mut after = before;
    for ((class, _), share) in materials.iter().zip(&shares) {
        after += (class.after - class.before) * *share;
    }
    let clear_in_all: f64 = clear.iter().map(|(_, weight)| weight / all).sum();
    for (class, weight) in &clear {
        after += class.after * (weight / all * (room / clear_in_all).min(1.0));
    }
    straight(after, LEFT * before.w)
}

/// Straight RGBA; up to an opacity of `nothing` clear.
fn straight(premultiplied: Vector4<f64>, nothing: f64) -> [f32; 4] {
    let alpha = premultiplied.w.min(1.0);
    if alpha <= nothing {
        return [0.0; 4];
    }
    let rgb = |c: usize| ((premultiplied[c] / premultiplied.w) as f32).clamp(0.0, 1.0);
    [rgb(0), rgb(1), rgb(2), alpha as f32]
}

/// Shares of materials in a sample: none negative, those that give the sample as nearly as can be, among these the nearest to `weight / all`.
fn shares(sample: Vector4<f64>, materials: &[(&Changed<'_>, f64)], all: f64) -> Vec<f64> {
    let first: Vec<f64> = materials.iter().map(|(_, weight)| weight / all).collect();
    let mut is_in = vec![true; materials.len()];
    loop {
        let (mut square, mut rest) = (Matrix4::zeros(), sample);
        for (i, (class, _)) in materials.iter().enumerate().filter(|(i, _)| is_in[*i]) {
            square += class.before * class.before.transpose();
            rest -= class.before * first[i];
        }
        let step = solved(square, rest);
        let share = |i: usize| if is_in[i] { first[i] + materials[i].0.before.dot(&step) } else { 0.0 };
        let shares: Vec<f64> = (0..materials.len()).map(share).collect();
        match (0..shares.len()).min_by(|a, b| shares[*a].total_cmp(&shares[*b])) {
            // What is below nothing takes no part.
            Some(least) if shares[least] < 0.0 => is_in[least] = false,
            _ => return shares,
        }
    }
}

/// The least solution of `square · x = rest`, without the directions in which looks aren't told apart.
fn solved(square: Matrix4<f64>, rest: Vector4<f64>) -> Vector4<f64> {
    let eigen = square.symmetric_eigen();
    let least = TOLD_APART * TOLD_APART * eigen.eigenvalues.max();
    let mut found = Vector4::zeros();
    for (i, &value) in eigen.eigenvalues.iter().enumerate().filter(|(_, value)| **value > least) {
        let axis = eigen.eigenvectors.column(i);
        found += axis * (axis.dot(&rest) / value);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three materials and a clear class below them, meeting at 10, 20 and 30 of 0…40 over 2 to either side.
    fn mixed(looks: [([f32; 3], f32); 3]) -> TransferFunction {
        let edges = [f64::NEG_INFINITY, 10.0, 20.0, 30.0, f64::INFINITY];
        let rise = |d: f64| {
            let t = (0.5 + 0.25 * d).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        let sample = |i: usize| {
            let value = f64::from(i as u32) / 16.0;
            let share = |class: usize| rise(value - edges[class]).min(rise(edges[class + 1] - value));
            let mix = looks.iter().enumerate();
            let mix =
                mix.fold(Vector4::zeros(), |sum, (c, (rgb, a))| sum + premultiplied(*rgb, *a) * share(c + 1));
            straight(mix, 0.0)
        };
        let entry = |class: usize| {
            let (rgb, opacity) = if class == 0 { ([0.0; 3], 0.0) } else { looks[class - 1] };
            let role = if class == 0 { ClassRole::Background } else { ClassRole::Material };
            let (lower, upper) = (edges[class].max(0.0), edges[class + 1].min(40.0));
            TransferEntry { class: class as u16 + 1, role, rgb, opacity, lower, upper, softness: 2.0 }
        };
        let table = (0..=640).map(sample).collect();
        TransferFunction::new([0.0, 40.0], 641, 1.0, vec![0], table, (0..4).map(entry).collect()).unwrap()
    }

    fn assert_alike(found: &TransferFunction, wanted: &TransferFunction) {
        for (i, (a, b)) in found.table().iter().zip(wanted.table()).enumerate() {
            let (p, q) = (premultiplied([a[0], a[1], a[2]], a[3]), premultiplied([b[0], b[1], b[2]], b[3]));
            assert!((p - q).amax() < 2e-5, "sample {i}: {a:?} for {b:?}");
        }
    }

    const RED: [f32; 3] = [0.8, 0.1, 0.1];
    const GREEN: [f32; 3] = [0.1, 0.6, 0.2];
    const BLUE: [f32; 3] = [0.1, 0.2, 0.9];

    #[test]
    fn a_class_looks_as_if_the_table_had_been_made_so() {
        let before = mixed([(RED, 0.3), (GREEN, 0.05), (BLUE, 0.6)]);
        let changed = |class: u16, rgb: Option<[f32; 3]>, opacity: Option<f32>| {
            before.clone().with_class_looks(&[(class, ClassLook { rgb, opacity })].into()).unwrap()
        };
        assert_alike(&changed(3, None, Some(0.0)), &mixed([(RED, 0.3), (GREEN, 0.0), (BLUE, 0.6)]));
        assert_alike(&changed(3, None, Some(0.5)), &mixed([(RED, 0.3), (GREEN, 0.5), (BLUE, 0.6)]));
        assert_alike(&changed(2, Some(BLUE), None), &mixed([(BLUE, 0.3), (GREEN, 0.05), (BLUE, 0.6)]));
        assert_alike(&changed(4, Some(RED), Some(1.0)), &mixed([(RED, 0.3), (GREEN, 0.05), (RED, 1.0)]));
        // What is hidden is gone, not nearly so: bricks of it are passed over.
        let hidden = changed(3, None, Some(0.0));
        assert!((23 * 16..28 * 16).all(|i| hidden.table()[i] == [0.0; 4]));
        assert_eq!(hidden.entries()[2].opacity, 0.0);
        assert_eq!(
            hidden.table()[..12 * 16],
            before.table()[..12 * 16],
            "bit for bit where the class has no share"
        );
        assert_eq!(before.clone().with_class_looks(&BTreeMap::new()).unwrap(), before);
    }

    #[test]
    fn materials_of_one_look_are_told_apart_by_their_windows() {
        let before = mixed([(RED, 0.3), (RED, 0.3), (BLUE, 0.6)]);
        let look = ClassLook { opacity: Some(0.0), rgb: None };
        let found = before.with_class_looks(&[(3, look)].into()).unwrap();
        assert_alike(&found, &mixed([(RED, 0.3), (RED, 0.0), (BLUE, 0.6)]));
    }

    #[test]
    fn a_background_can_be_seen_where_its_window_is() {
        let before = mixed([(RED, 0.3), (GREEN, 0.05), (BLUE, 0.6)]);
        let look = ClassLook { opacity: Some(0.2), rgb: Some(BLUE) };
        let found = before.clone().with_class_looks(&[(1, look)].into()).unwrap();
        assert_eq!(found.table()[0][3], 0.2);
        assert_eq!(found.entries()[0].role, ClassRole::Material);
        // Half way between it and the red it has half of its opacity, and the red half of its own.
        assert!((found.table()[160][3] - 0.25).abs() < 1e-5);
        assert_eq!(found.table()[13 * 16..], before.table()[13 * 16..]);
    }

    #[test]
    fn classes_that_only_labels_tell_apart_are_changed_in_their_own_rows() {
        // Both lie between 10 and 30; each row shows one of them, row 0 their mean.
        let looks = [(RED, 0.4), (GREEN, 0.2)];
        let entry = |c: usize| TransferEntry {
            class: c as u16 + 1,
            role: ClassRole::Material,
            rgb: looks[c].0,
            opacity: looks[c].1,
            lower: 10.0,
            upper: 30.0,
            softness: 0.0,
        };
        let made = |looks: [([f32; 3], f32); 2]| {
            let row = |shares: [f64; 2]| {
                (0..41).map(move |i| {
                    let part = |c: usize| premultiplied(looks[c].0, looks[c].1) * shares[c];
                    if (10..=30).contains(&i) { straight(part(0) + part(1), 0.0) } else { [0.0; 4] }
                })
            };
            let table = row([0.5, 0.5]).chain(row([1.0, 0.0])).chain(row([0.0, 1.0])).collect();
            let entries = vec![entry(0), entry(1)];
            TransferFunction::new([0.0, 40.0], 41, 1.0, vec![0, 1, 2], table, entries).unwrap()
        };
        let before = made(looks);
        let changed = |rgb, opacity| {
            before.clone().with_class_looks(&[(1, ClassLook { rgb, opacity })].into()).unwrap()
        };
        let hidden = changed(None, Some(0.0));
        assert_alike(&hidden, &made([(RED, 0.0), looks[1]]));
        assert!(hidden.table()[41..82].iter().all(|sample| *sample == [0.0; 4]));
        assert_eq!(hidden.table()[82..], before.table()[82..], "the row of the other label");
        assert_alike(&changed(Some(BLUE), Some(0.1)), &made([(BLUE, 0.1), looks[1]]));
        // What shows of others in the voxels of a clear class goes with it.
        let clear = TransferEntry { class: 3, role: ClassRole::Background, opacity: 0.0, ..entry(0) };
        let table = [before.table(), &before.table()[41..82]].concat();
        let entries = vec![entry(0), entry(1), clear];
        let beside = TransferFunction::new([0.0, 40.0], 41, 1.0, vec![0, 1, 2, 3], table, entries).unwrap();
        assert!(beside.table()[123..].iter().any(|sample| sample[3] > 0.0));
        let look = ClassLook { rgb: None, opacity: Some(0.0) };
        let between = beside.entries().iter().cloned().map(|entry| match entry.role {
            ClassRole::Background => TransferEntry { role: ClassRole::Transition, ..entry },
            _ => entry,
        });
        let between = beside.clone().with_looks(beside.table().to_vec(), between.collect()).unwrap();
        for transfer in [beside, between] {
            let gone = transfer.with_class_looks(&[(3, look)].into()).unwrap();
            assert!(gone.table()[123..].iter().all(|sample| *sample == [0.0; 4]));
            assert_eq!(gone.table()[..123], before.table()[..]);
        }
    }
}
