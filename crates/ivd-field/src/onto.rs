//! Labels and masks on the grid of another volume: every voxel takes what the voxel nearest to its centre has, in world space.

use ivd_core::{Error, Exec, Grid, Labels, Mask, parallel};
use nalgebra::{Matrix3, Vector3};

/// Room for rounding (voxels): a centre that lies this close to the face between two voxels is the lower one's, and on an outer face within.
const ROUNDING: f64 = 1e-6;

/// What was put onto another grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Onto<T> {
    /// On the other grid.
    pub output: T,
    /// Voxels of that grid whose centre lies outside of what was given: 0.
    pub without_source: u64,
    /// Voxels given with a label, or inside, whose centre lies outside of that grid.
    pub left_out: u64,
}

/// The labels of the nearest voxels at those of another grid, and [`ivd_core::NO_DATA`] outside of theirs. Classes keep what is told of them, with
/// the voxels that they have there.
///
/// # Errors
/// [`Error::Mismatch`] where the two grids share no place; [`Error::MemoryLimit`], [`Error::Cancelled`].
pub fn labels(labels: &Labels, onto: &Grid, exec: &Exec) -> Result<Onto<Labels>, Error> {
    exec.check_memory("the labels on the other grid", 2 * onto.len() as u64)?;
    exec.run(|| {
        let Onto { output: ids, without_source, left_out } =
            nearest(labels.grid(), labels.ids(), onto, "labels", exec)?;
        let mut voxels = vec![0_u64; 1 << 16];
        for id in &ids {
            voxels[usize::from(*id)] += 1;
        }
        let mut classes = labels.classes().to_vec();
        for class in &mut classes {
            class.voxels = voxels[usize::from(class.id)];
        }
        let output = Labels::new(onto.clone(), ids.into(), classes)?;
        Ok(Onto { output, without_source, left_out })
    })
}

/// The part at the voxels of another grid; nothing is inside outside of its own. A level function is of its own voxels, and isn't kept.
///
/// # Errors
/// As [`labels()`].
pub fn mask(mask: &Mask, onto: &Grid, exec: &Exec) -> Result<Onto<Mask>, Error> {
    exec.check_memory("the mask on the other grid", onto.len() as u64)?;
    exec.run(|| {
        let Onto { output, without_source, left_out } =
            nearest(mask.grid(), mask.inside(), onto, "mask", exec)?;
        Ok(Onto { output: Mask::new(onto.clone(), output.into())?, without_source, left_out })
    })
}

fn nearest<T: Copy + Default + PartialEq + Send + Sync>(
    from: &Grid,
    given: &[T],
    onto: &Grid,
    what: &'static str,
    exec: &Exec,
) -> Result<Onto<Vec<T>>, Error> {
    let [nx, ny, _] = onto.dims();
    let (there, back) = (Way::new(onto, from), Way::new(from, onto));
    let mut output = vec![T::default(); onto.len()];
    let missed = parallel::try_map_pieces_mut(&mut output, nx * ny, &|z, slice| {
        exec.check_cancelled()?;
        let mut missed = 0;
        for (i, value) in slice.iter_mut().enumerate() {
            match there.nearest([i % nx, i / nx, z]) {
                Some(at) => *value = given[at],
                None => missed += 1,
            }
        }
        Ok::<u64, Error>(missed)
    })?;
    let without_source: u64 = missed.into_iter().sum();
    if without_source == onto.len() as u64 {
        return Err(apart(from, onto, what));
    }
    let [mx, my, mz] = from.dims();
    let beyond = parallel::try_map(mz, &|z| {
        exec.check_cancelled()?;
        let slice = &given[mx * my * z..mx * my * (z + 1)];
        let labelled = slice.iter().enumerate().filter(|(_, value)| **value != T::default());
        let beyond = labelled.filter(|(i, _)| back.nearest([i % mx, i / mx, z]).is_none());
        Ok::<u64, Error>(beyond.count() as u64)
    })?;
    Ok(Onto { output, without_source, left_out: beyond.into_iter().sum() })
}

/// The way from voxels of a grid to those of another.
struct Way {
    linear: Matrix3<f64>,
    offset: Vector3<f64>,
    dims: [usize; 3],
}

impl Way {
    fn new(from: &Grid, to: &Grid) -> Self {
        let inverse = to.inverse_linear_part();
        let offset = inverse * (Vector3::from(from.origin()) - Vector3::from(to.origin()));
        Self { linear: inverse * from.linear_part(), offset, dims: to.dims() }
    }

    /// The voxel there whose centre is nearest to that of a voxel here, by its linear index.
    fn nearest(&self, voxel: [usize; 3]) -> Option<usize> {
        let place = self.linear * Vector3::from(voxel.map(|c| c as f64)) + self.offset;
        let mut at = [0_usize; 3];
        for a in 0..3 {
            let end = self.dims[a] as f64;
            if !(-0.5 - ROUNDING..=end - 0.5 + ROUNDING).contains(&place[a]) {
                return None;
            }
            at[a] = ((place[a] + 0.5 - ROUNDING).floor().max(0.0) as usize).min(self.dims[a] - 1);
        }
        Some(at[0] + self.dims[0] * (at[1] + self.dims[1] * at[2]))
    }
}

/// What to do where nothing of what was given lies within the volume.
pub const NOTHING_SHARED: &str = "give what was drawn on the same scan; a file whose header places it wrongly is put right in the program that wrote it";

/// The error about grids that share no place.
fn apart(from: &Grid, onto: &Grid, what: &'static str) -> Error {
    let [own, other] = [from, onto].map(|grid| {
        let [low, high] = grid.extent();
        format!("{low:.1?} to {high:.1?} mm")
    });
    Error::Mismatch {
        what,
        problem: format!("it lies at {own} (RAS) and the volume at {other}: the two share no place"),
        remedy: NOTHING_SHARED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Volume, VoxelCoord, VoxelIndex, Voxels};

    const RAS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn grid(dims: [usize; 3], spacing: [f64; 3], origin: [f64; 3], direction: [[f64; 3]; 3]) -> Grid {
        Grid::new(dims, spacing, origin, direction).unwrap()
    }

    /// Labels that tell every voxel of a grid from the others.
    fn numbered(grid: &Grid) -> Labels {
        let ids: Vec<u16> = (1..=grid.len() as u16).collect();
        Labels::from_volume(&Volume::new(grid.clone(), Voxels::from(ids)).unwrap()).unwrap()
    }

    #[test]
    fn flipped_and_permuted_axes_give_every_voxel_its_own_label() {
        // Spacings and origins that no float holds exactly.
        let scan = grid([4, 5, 6], [0.1, 0.7, 1.3], [-101.7, 33.3, 405.42], RAS);
        let corner = |voxel: [f64; 3]| <[f64; 3]>::from(scan.world(VoxelCoord(voxel.into())).0);
        let turned = [
            grid(
                [4, 5, 6],
                [0.1, 0.7, 1.3],
                corner([3.0, 4.0, 0.0]),
                [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], RAS[2]],
            ),
            grid([6, 4, 5], [1.3, 0.1, 0.7], corner([0.0, 1.0, 2.0]), [RAS[2], RAS[0], RAS[1]])
                .with_patient_space(false),
        ];
        // The second starts at another voxel than the scan: what lies beyond is 0 here and left out there.
        for (i, turned) in turned.iter().enumerate() {
            let given = numbered(turned);
            let put = labels(&given, &scan, &Exec::default()).unwrap();
            let (mut without, mut taken) = (0, 0);
            for linear in 0..scan.len() {
                let place = turned.voxel(scan.world(scan.index(linear).into())).0;
                let wanted = turned.nearest_voxel(place).map_or(0, |v| given.ids()[turned.linear(v)]);
                assert_eq!(put.output.ids()[linear], wanted, "{i}: {:?}", scan.index(linear));
                *(if wanted == 0 { &mut without } else { &mut taken }) += 1;
            }
            assert_eq!((put.without_source, put.left_out), (without, turned.len() as u64 - taken), "{i}");
            assert_eq!(i == 0, without == 0);
            assert!(put.output.grid().in_patient());
        }
    }

    #[test]
    fn a_coarser_grid_fills_the_finer_one_and_classes_are_counted_anew() {
        // Voxels of 2 mm over the same box as those of 1 mm: the outer faces coincide.
        let coarse = grid([2, 2, 2], [2.0; 3], [0.5; 3], RAS);
        let fine = grid([4, 4, 4], [1.0; 3], [0.0; 3], RAS);
        let put = labels(&numbered(&coarse), &fine, &Exec::default()).unwrap();
        assert_eq!((put.without_source, put.left_out), (0, 0));
        assert!(put.output.classes().iter().all(|class| class.voxels == 8));
        let id = |at| put.output.ids()[fine.linear(VoxelIndex(at))];
        assert_eq!([id([0, 0, 0]), id([1, 1, 1]), id([2, 1, 1]), id([3, 3, 3])], [1, 1, 2, 8]);
        // And back: centres lie on faces between voxels, of which the lower counts, however they are rounded.
        let back = labels(&put.output, &coarse, &Exec::default()).unwrap();
        assert_eq!(back.output.ids(), numbered(&coarse).ids());
    }

    #[test]
    fn masks_are_put_alike_and_grids_that_share_no_place_are_refused() {
        let here = grid([3, 1, 1], [1.0; 3], [0.0; 3], RAS);
        let beside = grid([3, 1, 1], [1.0; 3], [2.0, 0.0, 0.0], RAS);
        let part = Mask::new(here.clone(), vec![1, 1, 1].into()).unwrap();
        let put = mask(&part, &beside, &Exec::default()).unwrap();
        assert_eq!((put.output.inside(), put.without_source, put.left_out), (&[1, 0, 0][..], 2, 2));
        let far = grid([3, 1, 1], [1.0; 3], [40.0, 0.0, 0.0], RAS);
        let told = mask(&part, &far, &Exec::default()).unwrap_err().to_string();
        assert!(
            told.contains("[-0.5, -0.5, -0.5] to [2.5, 0.5, 0.5] mm") && told.contains("share no place"),
            "{told}"
        );
    }
}
