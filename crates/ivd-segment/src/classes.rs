//! Classes of a labelling that isn't one of intervals: their figures, and ids in the order of their means.

use ivd_core::{
    Buffer, Class, Error, Exec, Labels, NO_DATA, Scalar, SpillVec, Volume, parallel, with_voxels,
};

use crate::moments::{Frame, Moments};

/// Voxels that one task looks at, at least. The joins follow this division, never the threads.
const CHUNK: usize = 1 << 16;

/// Means that differ by less than this share are the same, but for how their sums were rounded.
const SAME: f64 = 1e-9;

/// Gives the groups 1…`groups` of `ids` new ids: 1…K in the order of their means, the larger first where means are equal; empty
/// groups are left out. 0 stays no data. Also says which group became which class: `order[class - 1]` is the old id.
pub(crate) struct Described {
    pub(crate) ids: Buffer<u16>,
    pub(crate) classes: Vec<Class>,
    pub(crate) order: Vec<u16>,
}

/// # Errors
/// Cancelled.
pub(crate) fn by_mean(
    volume: &Volume,
    mut ids: SpillVec<u16>,
    groups: usize,
    exec: &Exec,
) -> Result<Described, Error> {
    let frame = Frame::of(volume);
    let moments = with_voxels!(volume.voxels(), slice => moments(slice, &ids, groups, &frame, exec))?;
    let mean = |group: usize| volume.real(moments[group].mean(&frame)).clamp(f64::MIN, f64::MAX);
    let mut order: Vec<usize> = (0..groups).filter(|g| moments[*g].count > 0).collect();
    order.sort_by(|&a, &b| {
        mean(a).total_cmp(&mean(b)).then(moments[b].count.cmp(&moments[a].count)).then(a.cmp(&b))
    });
    let mut renamed = vec![NO_DATA; groups + 1];
    for (class, &group) in order.iter().enumerate() {
        renamed[group + 1] = class as u16 + 1;
    }
    if renamed.iter().enumerate().any(|(old, new)| old != usize::from(*new)) {
        parallel::for_each_piece_mut(&mut ids, CHUNK, &|_, ids| {
            for id in ids {
                *id = renamed[usize::from(*id)];
            }
        });
    }
    let class = |(i, &group): (usize, &usize)| Class {
        id: i as u16 + 1,
        name: None,
        mean: mean(group),
        sd: (moments[group].sd(&frame) * volume.slope().abs()).min(f64::MAX),
        voxels: moments[group].count,
        lower: None,
        upper: None,
    };
    let mut classes: Vec<Class> = order.iter().enumerate().map(class).collect();
    set_crossings(&mut classes);
    let order = order.iter().map(|group| *group as u16 + 1).collect();
    Ok(Described { ids: ids.into_buffer(), classes, order })
}

/// The labels with what a volume holds at the voxels of each class: the mean and the spread of those that have a value. A class of which none
/// has one keeps what was said of it. Where classes met in other values is forgotten with these.
///
/// # Errors
/// A volume on another grid; cancelled.
pub fn measured(labels: &Labels, volume: &Volume, exec: &Exec) -> Result<Labels, Error> {
    labels.grid().require(volume.grid(), "labels", "volume")?;
    let frame = Frame::of(volume);
    let groups = labels.ids().iter().max().map_or(0, |id| usize::from(*id));
    let moments = with_voxels!(volume.voxels(), slice => moments(slice, labels.ids(), groups, &frame, exec))?;
    let mut classes = labels.classes().to_vec();
    let mut is_other = false;
    for class in &mut classes {
        let of_class = usize::from(class.id).checked_sub(1).and_then(|group| moments.get(group));
        if let Some(found) = of_class.filter(|found| found.count > 0) {
            let mean = volume.real(found.mean(&frame)).clamp(f64::MIN, f64::MAX);
            is_other |= (mean - class.mean).abs() > SAME * (mean.abs() + class.sd);
            class.mean = mean;
            class.sd = (found.sd(&frame) * volume.slope().abs()).min(f64::MAX);
        }
    }
    if is_other {
        for class in &mut classes {
            (class.lower, class.upper) = (None, None);
        }
    }
    Labels::new(labels.grid().clone(), labels.buffer().clone(), classes)
}

/// Sets where neighbouring classes meet in intensity: the value between their means at which both are as likely, taking their
/// values for normally distributed; the midpoint of the means where there is none.
pub(crate) fn set_crossings(classes: &mut [Class]) {
    for above in 1..classes.len() {
        let (low, high) = (&classes[above - 1], &classes[above]);
        let meet = crossing([low.mean, low.sd, low.voxels as f64], [high.mean, high.sd, high.voxels as f64]);
        classes[above - 1].upper = Some(meet);
        classes[above].lower = Some(meet);
    }
}

/// Where two weighted normal densities `[mean, standard deviation, weight]` cross between their means.
fn crossing(a: [f64; 3], b: [f64; 3]) -> f64 {
    let middle = a[0].midpoint(b[0]);
    let density =
        |[mean, sd, weight]: [f64; 3], at: f64| weight.ln() - sd.ln() - 0.5 * ((at - mean) / sd).powi(2);
    let above = |at: f64| density(b, at) - density(a, at);
    // A spread of 0 leaves everything up to the other's mean to the other; neither has a density then.
    if !(a[1] > 0.0 && b[1] > 0.0 && above(a[0]) < 0.0 && above(b[0]) > 0.0) {
        return middle;
    }
    let (mut low, mut high) = (a[0], b[0]);
    for _ in 0..200 {
        let at = low.midpoint(high);
        if at <= low || at >= high {
            break;
        }
        if above(at) < 0.0 { low = at } else { high = at }
    }
    high
}

/// Moments of every group, in a fixed order of sums.
fn moments<T: Scalar>(
    voxels: &[T],
    ids: &[u16],
    groups: usize,
    frame: &Frame,
    exec: &Exec,
) -> Result<Vec<Moments>, Error> {
    let chunk = CHUNK.max(16 * groups);
    let parts: Vec<Vec<Moments>> = parallel::try_map_pieces(voxels.len(), chunk, &|piece| {
        exec.check_cancelled()?;
        let mut parts = vec![Moments::default(); groups];
        for (v, &id) in voxels[piece.clone()].iter().zip(&ids[piece]) {
            if id != NO_DATA && v.is_data() {
                parts[usize::from(id) - 1].add(*v, frame);
            }
        }
        Ok::<_, Error>(parts)
    })?;
    let mut total = vec![Moments::default(); groups];
    for part in &parts {
        total.iter_mut().zip(part).for_each(|(total, part)| total.join(part));
    }
    Ok(total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Voxels};

    fn bulk(values: &[u16]) -> SpillVec<u16> {
        let mut bulk = Exec::default().bulk("labels", values.len()).unwrap();
        bulk.copy_from_slice(values);
        bulk
    }

    #[test]
    fn groups_become_classes_in_the_order_of_their_means() {
        let grid = Grid::with_spacing([7, 1, 1], [1.0; 3]).unwrap();
        let volume =
            Volume::with_scale(grid, Voxels::from(vec![9_u8, 9, 1, 3, 5, 0, 7]), 2.0, 100.0).unwrap();
        let found = by_mean(&volume, bulk(&[2, 2, 4, 4, 1, 0, 1]), 5, &Exec::default()).unwrap();
        assert_eq!(&found.ids[..], [3, 3, 1, 1, 2, 0, 2]);
        assert_eq!(found.order, [4, 1, 2]);
        let means: Vec<f64> = found.classes.iter().map(|c| c.mean).collect();
        assert_eq!(means, [104.0, 112.0, 118.0]);
        assert_eq!(found.classes[0].sd, 2.0);
        assert_eq!(found.classes[2].voxels, 2);
        // Without a spread above, the midpoint; the classes share their crossing.
        assert_eq!((found.classes[1].upper, found.classes[2].lower), (Some(115.0), Some(115.0)));
        assert_eq!((found.classes[0].lower, found.classes[2].upper), (None, None));
    }

    #[test]
    fn classes_of_another_program_are_measured_where_there_are_values() {
        let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
        let of = |values: Vec<f32>| Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let labels = Labels::from_volume(&of(vec![7.0, 7.0, 7.0, 0.0, 2.0, 4.0])).unwrap();
        let scan = of(vec![10.0, 30.0, f32::NAN, 99.0, f32::NAN, -5.0]);
        let found = measured(&labels, &scan, &Exec::default()).unwrap();
        let told: Vec<_> = found.classes().iter().map(|c| (c.id, c.mean, c.sd, c.voxels)).collect();
        assert_eq!(told, [(2, 2.0, 0.0, 1), (4, -5.0, 0.0, 1), (7, 20.0, 10.0, 3)]);
        assert_eq!(found.ids(), labels.ids());
        // Where classes meet is known of the values that they were found in alone.
        let own =
            crate::kmvs(&scan, None, &crate::KmvsParams { k: 2, ..Default::default() }, &Exec::default());
        let own = own.unwrap().labels;
        let again = measured(&own, &scan, &Exec::default()).unwrap();
        assert!(
            again.classes().iter().zip(own.classes()).all(|(a, b)| (a.lower, a.upper) == (b.lower, b.upper))
        );
        let brighter =
            measured(&own, &of(vec![110.0, 130.0, f32::NAN, 199.0, f32::NAN, 95.0]), &Exec::default());
        assert!(own.classes()[0].upper.is_some());
        assert!(brighter.unwrap().classes().iter().all(|c| c.lower.is_none() && c.upper.is_none()));
        let other = Volume::new(Grid::with_spacing([6, 1, 1], [2.0; 3]).unwrap(), scan.voxels().clone());
        assert!(measured(&labels, &other.unwrap(), &Exec::default()).is_err());
    }

    #[test]
    fn normal_densities_cross_where_they_are_equal() {
        assert!((crossing([0.0, 2.0, 5.0], [10.0, 2.0, 5.0]) - 5.0).abs() < 1e-12);
        // Equal spreads s: the crossing moves by s² ln(w_a / w_b) / distance.
        let expected = 5.0 + 4.0 * 3_f64.ln() / 10.0;
        assert!((crossing([0.0, 2.0, 3.0], [10.0, 2.0, 1.0]) - expected).abs() < 1e-12);
        // The lesser lies wholly under the other: no crossing between the means.
        assert_eq!(crossing([0.0, 50.0, 1e9], [1.0, 50.0, 1.0]), 0.5);
        assert_eq!(crossing([1.0, 0.0, 1.0], [2.0, 1.0, 1.0]), 1.5);
    }
}
