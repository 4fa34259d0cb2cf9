//! The pass that gives each voxel its label.

use ivd_core::{
    Error, Exec, Kernel, Mask, NO_DATA, Scalar, SpillVec, VoxelType, Voxels, parallel, with_voxels,
};

use crate::histogram::{Tabled, with_tabled};

/// Voxels that one task labels.
const CHUNK: usize = 1 << 16;
/// Voxels whose labels stay close to the processor while they are compared with every step.
const NEAR: usize = 1 << 12;
/// Steps beyond which a table is faster than comparisons.
const MOST_STEPS: usize = 12;

/// The pass that gives each voxel its label by its value.
pub struct Labelling;

/// What is labelled: a value with `g` of the ascending `cuts` at or below it gets `ids[g]`; what is no data or outside the mask gets
/// [`NO_DATA`](ivd_core::NO_DATA).
#[derive(Clone, Copy)]
pub struct Labelled<'a> {
    /// Voxels.
    pub voxels: &'a Voxels,
    /// Those that get a label, where not all do.
    pub mask: Option<&'a Mask>,
    /// Stored values, ascending.
    pub cuts: &'a [f64],
    /// A label more than there are cuts.
    pub ids: &'a [u16],
}

impl Labelled<'_> {
    /// The label of each value of a type of 8 or 16 bits, ascending; `None` of wider types.
    pub fn table(&self) -> Option<Vec<u16>> {
        let all = |count: usize, lowest: i64| {
            (0..count).map(|slot| id_of((lowest + slot as i64) as f64, self.cuts, self.ids)).collect()
        };
        match self.voxels.voxel_type() {
            VoxelType::U8 => Some(all(u8::VALUES, u8::LOWEST)),
            VoxelType::I8 => Some(all(i8::VALUES, i8::LOWEST)),
            VoxelType::U16 => Some(all(u16::VALUES, u16::LOWEST)),
            VoxelType::I16 => Some(all(i16::VALUES, i16::LOWEST)),
            _ => None,
        }
    }
}

impl Kernel for Labelling {
    const NAME: &'static str = "segment/label";
    type Args<'a> = Labelled<'a>;
    type Out = SpillVec<u16>;
    type Error = Error;

    fn on_processor(args: &Labelled<'_>, exec: &Exec) -> Result<SpillVec<u16>, Error> {
        let mut labels = exec.bulk("the labels", args.voxels.len())?;
        if let Some(table) = args.table() {
            with_tabled!(args.voxels, slice => by_table(slice, args.mask, &table, &mut labels), else {});
        } else {
            with_voxels!(args.voxels, slice => by_cuts(slice, args, &mut labels));
        }
        Ok(labels)
    }
}

/// Labels by the group of each stored value: `ids(g)` for a value with `g` of the ascending `cuts` at or below it.
pub(crate) fn of(
    voxels: &Voxels,
    mask: Option<&Mask>,
    cuts: &[f64],
    ids: &[u16],
    exec: &Exec,
) -> Result<SpillVec<u16>, Error> {
    exec.check_cancelled()?;
    let labels = exec.launch::<Labelling>(&Labelled { voxels, mask, cuts, ids })?;
    exec.check_cancelled()?;
    Ok(labels)
}

pub(crate) fn id_of(value: f64, cuts: &[f64], ids: &[u16]) -> u16 {
    ids.get(cuts.partition_point(|cut| *cut <= value)).copied().unwrap_or(NO_DATA)
}

/// Labels by the label of each value of the type, ascending.
pub(crate) fn by_table<T: Tabled>(voxels: &[T], mask: Option<&Mask>, table: &[u16], labels: &mut [u16]) {
    match (mask, steps(table)) {
        (None, Some(steps)) => by_steps(voxels, table[0], &steps, labels),
        _ => each(voxels, mask, labels, |v| table[v.slot()]),
    }
}

/// The slots at which the label of a table of 256 rises by one, where that is all it does, and seldom.
fn steps(table: &[u16]) -> Option<Vec<u8>> {
    if table.len() != 256 {
        return None;
    }
    let mut found = Vec::new();
    for slot in 1..table.len() {
        match table[slot].checked_sub(table[slot - 1]) {
            Some(0) => {}
            Some(1) if found.len() < MOST_STEPS => found.push(slot as u8),
            _ => return None,
        }
    }
    Some(found)
}

/// Labels by how many steps a slot has passed: comparisons of many voxels at once, where a table takes them one by one.
fn by_steps<T: Tabled>(voxels: &[T], first: u16, steps: &[u8], labels: &mut [u16]) {
    parallel::for_each_piece_mut(labels, CHUNK, &|i, labels| {
        let voxels = &voxels[i * CHUNK..][..labels.len()];
        for (labels, voxels) in labels.chunks_mut(NEAR).zip(voxels.chunks(NEAR)) {
            labels.fill(first);
            for &step in steps {
                for (label, v) in labels.iter_mut().zip(voxels) {
                    *label += u16::from(v.slot() as u8 >= step);
                }
            }
        }
    });
}

pub(crate) fn by_cuts<T: Scalar>(voxels: &[T], by: &Labelled<'_>, labels: &mut [u16]) {
    each(voxels, by.mask, labels, |v| if v.is_data() { id_of(v.to_f64(), by.cuts, by.ids) } else { NO_DATA });
}

fn each<T: Scalar>(
    voxels: &[T],
    mask: Option<&Mask>,
    labels: &mut [u16],
    label: impl Fn(T) -> u16 + Sync + Send,
) {
    parallel::for_each_piece_mut(labels, CHUNK, &|i, labels| {
        let voxels = &voxels[i * CHUNK..][..labels.len()];
        match mask.map(|m| &m.inside()[i * CHUNK..][..labels.len()]) {
            None => labels.iter_mut().zip(voxels).for_each(|(id, &v)| *id = label(v)),
            Some(inside) => labels
                .iter_mut()
                .zip(voxels)
                .zip(inside)
                .for_each(|((id, &v), &inside)| *id = if inside == 0 { NO_DATA } else { label(v) }),
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_give_the_labels_of_the_table() {
        let voxels: Vec<u8> = (0..70_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let signed: Vec<i8> = voxels.iter().map(|&v| v as i8).collect();
        for cuts in
            [vec![], vec![12.0], vec![-5.5, 0.0, 17.0, 100.0, 254.5], (0..12).map(f64::from).collect()]
        {
            let ids: Vec<u16> = (1..=cuts.len() as u16 + 1).collect();
            let plain = |v: f64| id_of(v, &cuts, &ids);
            let expected: Vec<u16> = voxels.iter().map(|&v| plain(f64::from(v))).collect();
            let mut found = vec![9; voxels.len()];
            let table: Vec<u16> = (0..256).map(|slot| plain(f64::from(slot))).collect();
            by_table(&voxels, None, &table, &mut found);
            assert_eq!(found, expected);
            let expected: Vec<u16> = signed.iter().map(|&v| plain(f64::from(v))).collect();
            let table: Vec<u16> = (-128..128).map(|slot| plain(f64::from(slot))).collect();
            by_table(&signed, None, &table, &mut found);
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn tables_that_fall_jump_or_rise_often_have_no_steps() {
        let table = |at: &dyn Fn(usize) -> u16| (0..256).map(at).collect::<Vec<_>>();
        assert_eq!(steps(&table(&|s| u16::from(s >= 7) + u16::from(s == 255))), Some(vec![7, 255]));
        assert_eq!(steps(&table(&|s| u16::from(s < 7))), None);
        assert_eq!(steps(&table(&|s| 2 * u16::from(s > 7))), None);
        assert_eq!(steps(&table(&|s| (s / 10) as u16)), None);
        assert_eq!(steps(&vec![0; 65536]), None);
    }
}
