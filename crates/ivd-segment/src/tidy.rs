//! What is done with labels after they are found: specks go to their surroundings, ids follow sizes.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::{Class, Error, Exec, Labels, NO_DATA, SpillVec, Volume, parallel, sets};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Segmentation, classes};

/// Voxels that one task looks at.
const CHUNK: usize = 1 << 16;

/// The order of class ids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// By mean value, the lowest first.
    #[default]
    Mean,
    /// By size, the largest first.
    Size,
}

/// What is done with labels after they are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct TidyParams {
    /// Connected parts of fewer voxels (6-neighbourhood) take the label of the part that they share most faces with; 0 and 1
    /// leave all as they are. A part that touches none but missing data stays.
    #[schemars(extend("x-unit" = "voxels"))]
    pub smallest: u64,
    /// The order of class ids.
    pub order: Order,
}

impl TidyParams {
    /// Whether anything is done.
    pub fn is_any(self) -> bool {
        self != Self::default()
    }
}

/// Cleans labels up. The list of classes stays in the order of their means, whatever their ids; figures and crossings are those
/// of the new labels, and classes without voxels are gone. The objective stays that of the labels as they were found.
///
/// # Errors
/// [`Error`]: labels on another grid than the volume, too many voxels, the memory limit, or cancelled.
pub fn tidy(
    volume: &Volume,
    found: Segmentation,
    params: TidyParams,
    exec: &Exec,
) -> Result<Segmentation, Error> {
    let grid = volume.grid();
    grid.require(found.labels.grid(), "volume", "labels")?;
    exec.run(|| {
        let mut found = found;
        if params.smallest > 1 {
            let mut ids = exec.bulk::<u16>("the labels", grid.len())?;
            ids.copy_from_slice(found.labels.ids());
            absorb(&mut ids, grid.dims(), params.smallest, exec)?;
            let most = found.labels.classes().iter().map(|c| c.id).max().unwrap_or(0);
            let described = classes::by_mean(volume, ids, usize::from(most), exec)?;
            found.k = described.classes.len();
            found.labels = Labels::new(grid.clone(), described.ids, described.classes)?;
        }
        if params.order == Order::Size {
            found.labels = by_size(&found.labels, exec)?;
        }
        Ok(found)
    })
}

/// The same labels with ids by size.
fn by_size(labels: &Labels, exec: &Exec) -> Result<Labels, Error> {
    let mut order: Vec<&Class> = labels.classes().iter().collect();
    order.sort_by_key(|c| (Reverse(c.voxels), c.id));
    let most = order.iter().map(|c| c.id).max().unwrap_or(0);
    let mut names = vec![NO_DATA; usize::from(most) + 1];
    for (rank, class) in order.iter().enumerate() {
        names[usize::from(class.id)] = rank as u16 + 1;
    }
    let mut ids = exec.bulk::<u16>("the labels", labels.ids().len())?;
    parallel::for_each_piece_mut(&mut ids, CHUNK, &|i, ids| {
        ids.iter_mut()
            .zip(&labels.ids()[i * CHUNK..])
            .for_each(|(id, old)| *id = names.get(usize::from(*old)).copied().unwrap_or(*old));
    });
    let classes = labels.classes().iter().map(|c| Class { id: names[usize::from(c.id)], ..c.clone() });
    Labels::new(labels.grid().clone(), ids.into_buffer(), classes.collect())
}

/// Connected parts of one label.
struct Parts {
    /// Part of each voxel, by its first voxel's rank.
    of: SpillVec<u32>,
    sizes: Vec<u32>,
    labels: Vec<u16>,
}

fn parts(ids: &[u16], dims: [usize; 3], exec: &Exec) -> Result<Parts, Error> {
    let mut of = exec.bulk::<u32>("the parts of the voxels", ids.len())?;
    sets::reset(&mut of);
    each_face(ids.len(), dims, exec, |a, b| {
        if ids[a] == ids[b] {
            sets::join(&mut of, a as u32, b as u32);
        }
    })?;
    let (mut sizes, mut labels) = (Vec::new(), Vec::new());
    for voxel in 0..of.len() {
        let above = of[voxel] as usize;
        if above < voxel {
            of[voxel] = of[above];
        } else {
            of[voxel] = sizes.len() as u32;
            sizes.push(0);
            labels.push(ids[voxel]);
        }
        sizes[of[voxel] as usize] += 1;
    }
    Ok(Parts { of, sizes, labels })
}

/// Every pair of voxels with a common face, once.
fn each_face(
    count: usize,
    dims: [usize; 3],
    exec: &Exec,
    mut tell: impl FnMut(usize, usize),
) -> Result<(), Error> {
    let layer = dims[0] * dims[1];
    for row in (0..count).step_by(dims[0].max(1)) {
        if row % layer == 0 {
            exec.check_cancelled()?;
        }
        let [y, z] = [row / dims[0] % dims[1], row / layer];
        for a in row..row + dims[0] {
            if a + 1 < row + dims[0] {
                tell(a, a + 1);
            }
            if y + 1 < dims[1] {
                tell(a, a + dims[0]);
            }
            if z + 1 < dims[2] {
                tell(a, a + layer);
            }
        }
    }
    Ok(())
}

/// Gives parts of fewer than `smallest` voxels to the part that they share most faces with, the smallest first, until there is
/// none: among equals to the larger part, then to the one that comes first.
fn absorb(ids: &mut SpillVec<u16>, dims: [usize; 3], smallest: u64, exec: &Exec) -> Result<(), Error> {
    if ids.len() > u32::MAX as usize {
        let problem = format!("{} voxels; parts are counted for up to {}", ids.len(), u32::MAX);
        return Err(Error::Inconsistent { what: "labels", problem });
    }
    let parts = parts(ids, dims, exec)?;
    let small = |part: u32| {
        parts.labels[part as usize] != NO_DATA && u64::from(parts.sizes[part as usize]) < smallest
    };
    // Faces of small parts, by part: both sides of a face where both are small.
    let mut starts = vec![0_u32; parts.sizes.len() + 1];
    let borders = |a: usize, b: usize| {
        let [a, b] = [parts.of[a], parts.of[b]];
        let data = parts.labels[a as usize] != NO_DATA && parts.labels[b as usize] != NO_DATA;
        [(a, b), (b, a)].map(|(a, b)| (a != b && data && small(a)).then_some((a, b)))
    };
    each_face(ids.len(), dims, exec, |a, b| {
        for (from, _) in borders(a, b).into_iter().flatten() {
            starts[from as usize + 1] += 1;
        }
    })?;
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut faces = exec.bulk::<u32>("the borders of small parts", starts[starts.len() - 1] as usize)?;
    let mut next = starts.clone();
    each_face(ids.len(), dims, exec, |a, b| {
        for (from, to) in borders(a, b).into_iter().flatten() {
            faces[next[from as usize] as usize] = to;
            next[from as usize] += 1;
        }
    })?;
    let names = merge(&parts, &starts, &faces, smallest, exec)?;
    parallel::for_each_piece_mut(ids, CHUNK, &|i, ids| {
        ids.iter_mut().zip(&parts.of[i * CHUNK..]).for_each(|(id, part)| *id = names[*part as usize]);
    });
    Ok(())
}

/// The label of each part, once the small ones are given away.
fn merge(
    parts: &Parts,
    starts: &[u32],
    faces: &[u32],
    smallest: u64,
    exec: &Exec,
) -> Result<Vec<u16>, Error> {
    let count = parts.sizes.len();
    let mut roots: Vec<u32> = (0..count as u32).collect();
    let mut sizes = parts.sizes.clone();
    let mut labels = parts.labels.clone();
    // Small parts that became one, as a ring: whose borders count as one.
    let mut ring: Vec<u32> = (0..count as u32).collect();
    let is_small = |size: u32| u64::from(size) < smallest;
    let mut waiting: BinaryHeap<Reverse<(u32, u32)>> = (0..count as u32)
        .filter(|p| labels[*p as usize] != NO_DATA && is_small(sizes[*p as usize]))
        .map(|p| Reverse((sizes[p as usize], p)))
        .collect();
    let mut touched: Vec<u32> = Vec::new();
    let mut done = 0_usize;
    while let Some(Reverse((size, part))) = waiting.pop() {
        done += 1;
        if done.is_multiple_of(1 << 12) {
            exec.check_cancelled()?;
        }
        let at = part as usize;
        if roots[at] != part || sizes[at] != size {
            continue;
        }
        touched.clear();
        let mut member = part;
        loop {
            for &to in &faces[starts[member as usize] as usize..starts[member as usize + 1] as usize] {
                touched.push(sets::root(&mut roots, to));
            }
            member = ring[member as usize];
            if member == part {
                break;
            }
        }
        touched.retain(|to| *to != part);
        touched.sort_unstable();
        let best = touched.chunk_by(|a, b| a == b).max_by_key(|same| {
            let to = same[0];
            (same.len(), sizes[to as usize], Reverse(to))
        });
        let Some(to) = best.map(|same| same[0] as usize) else { continue };
        let small = is_small(sizes[to]);
        sizes[to] = sizes[to].saturating_add(size);
        roots[at] = to as u32;
        if small {
            ring.swap(at, to);
            if is_small(sizes[to]) {
                waiting.push(Reverse((sizes[to], to as u32)));
            }
        }
    }
    for part in 0..count as u32 {
        labels[part as usize] = parts.labels[sets::root(&mut roots, part) as usize];
    }
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ThresholdParams, threshold};
    use ivd_core::{Grid, Voxels};

    fn absorbed(values: &[u16], dims: [usize; 3], smallest: u64) -> Vec<u16> {
        let exec = Exec::default();
        let mut ids = exec.bulk::<u16>("labels", values.len()).unwrap();
        ids.copy_from_slice(values);
        absorb(&mut ids, dims, smallest, &exec).unwrap();
        ids.to_vec()
    }

    #[test]
    fn specks_take_the_label_that_they_touch_most() {
        let plane = [
            1, 1, 1, 2, 2, //
            1, 3, 1, 2, 2, //
            1, 1, 1, 2, 4, //
            0, 5, 0, 2, 2,
        ];
        let found = absorbed(&plane, [5, 4, 1], 2);
        let expected = [
            1, 1, 1, 2, 2, //
            1, 1, 1, 2, 2, //
            1, 1, 1, 2, 2, //
            0, 1, 0, 2, 2,
        ];
        assert_eq!(found, expected);
        assert_eq!(absorbed(&[0, 7, 0], [3, 1, 1], 9), [0, 7, 0], "an island has nobody to go to");
    }

    #[test]
    fn no_part_is_smaller_afterwards_and_missing_data_stays() {
        for seed in 0..40_u64 {
            let dims = [3 + seed as usize % 7, 5, 4];
            let noise = |i: usize| (i as u64 + 1).wrapping_mul(6_364_136_223_846_793_005 + 2 * seed) >> 40;
            let ids: Vec<u16> = (0..dims.iter().product()).map(|i| (noise(i) % 4) as u16).collect();
            let smallest = 1 + seed % 9;
            let found = absorbed(&ids, dims, smallest);
            assert!(ids.iter().zip(&found).all(|(a, b)| (*a == 0) == (*b == 0)));
            let after = parts(&found, dims, &Exec::default()).unwrap();
            let touches_data = |part: u32| {
                let mut touches = false;
                each_face(found.len(), dims, &Exec::default(), |a, b| {
                    let pair = [after.of[a], after.of[b]];
                    touches |= pair[0] != pair[1]
                        && pair.contains(&part)
                        && pair.iter().all(|p| after.labels[*p as usize] != 0);
                })
                .unwrap();
                touches
            };
            for (part, size) in after.sizes.iter().enumerate() {
                let large = u64::from(*size) >= smallest || after.labels[part] == 0;
                assert!(large || !touches_data(part as u32), "seed {seed}: {size} voxels of {smallest}");
            }
        }
    }

    #[test]
    fn ids_follow_sizes_and_the_list_keeps_the_order_of_means() {
        let grid = Grid::with_spacing([6, 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from(vec![1_u8, 9, 9, 9, 5, 5])).unwrap();
        let exec = Exec::default();
        let found = threshold(&volume, None, &ThresholdParams { values: vec![3.0, 7.0] }, &exec).unwrap();
        let params = TidyParams { smallest: 0, order: Order::Size };
        let sized = tidy(&volume, found.clone(), params, &exec).unwrap();
        assert_eq!(sized.labels.ids(), [3, 1, 1, 1, 2, 2]);
        let means: Vec<f64> = sized.labels.classes().iter().map(|c| c.mean).collect();
        assert_eq!(means, [1.0, 5.0, 9.0]);
        let params = TidyParams { smallest: 2, order: Order::Mean };
        let merged = tidy(&volume, found, params, &exec).unwrap();
        assert_eq!(merged.labels.ids(), [2, 2, 2, 2, 1, 1]);
        assert_eq!(merged.k, 2);
        assert_eq!(merged.labels.classes()[1].mean, 7.0);
    }
}
