//! What of some classes is joined to the outside.

use crate::reduced::{MISSING, Reduced, evenly};
use crate::statistics::is_outermost;

/// Most voxels along an axis that the outside is followed through.
const MOST_ALONG: usize = 128;

/// Share of some classes' voxels that are joined to the volume's outermost layer (across axes of more than two voxels) through faces of
/// voxels of these classes. Missing voxels belong to no class. Finer volumes are followed on 128 samples along an axis, evenly from the first layer to
/// the last.
pub(crate) fn joined_share(reduced: &Reduced<'_>, is_chosen: impl Fn(usize) -> bool) -> f64 {
    let dims = reduced.dims.map(|n| n.min(MOST_ALONG));
    let [nx, ny, nz] = dims;
    let index = |[x, y, z]: [usize; 3]| x + nx * (y + ny * z);
    let mut open = vec![false; nx * ny * nz];
    let mut reached = Vec::new();
    let mut voxels = 0_u64;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let place = [x, y, z];
                let at: [usize; 3] = std::array::from_fn(|a| evenly(place[a], dims[a], reduced.dims[a]));
                let level = reduced.row(at[1], at[2])[at[0]];
                if level == MISSING || !is_chosen(usize::from(reduced.rank(at))) {
                    continue;
                }
                voxels += 1;
                open[index([x, y, z])] = true;
                if [x, y, z].into_iter().zip(dims).any(|(c, n)| is_outermost(c, n)) {
                    reached.push([x, y, z]);
                }
            }
        }
    }
    reached.retain(|&at| std::mem::replace(&mut open[index(at)], false));
    let mut joined = 0_u64;
    while let Some(at) = reached.pop() {
        joined += 1;
        for a in 0..3 {
            for next in [at[a].wrapping_sub(1), at[a] + 1] {
                let mut to = at;
                to[a] = next;
                if next < dims[a] && std::mem::replace(&mut open[index(to)], false) {
                    reached.push(to);
                }
            }
        }
    }
    if voxels == 0 { 0.0 } else { joined as f64 / voxels as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Exec, Grid, Labels, Volume, Voxels};

    #[test]
    fn a_room_inside_is_not_joined_to_the_outside() {
        let grid = Grid::with_spacing([9; 3], [1.0; 3]).unwrap();
        // A shell of class 1 round a room of class 0 of 3³ voxels.
        let ids: Vec<u16> = (0..grid.len())
            .map(|i| grid.index(i).0.map(|c| c.abs_diff(4)).into_iter().max().unwrap())
            .map(|far| u16::from(far == 2))
            .collect();
        let values: Vec<f32> = ids.iter().map(|&id| f32::from(id)).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let labels = Labels::new(grid, ids.into(), vec![]).unwrap();
        let rank = (0..=u16::MAX).collect();
        let reduced = Reduced::new(&volume, &labels, rank, [0.0, 1.0], 9, &Exec::default()).unwrap();
        let all = 729.0 - 125.0 + 27.0;
        assert!((joined_share(&reduced, |class| class == 0) - (all - 27.0) / all).abs() < 1e-12);
        assert_eq!(joined_share(&reduced, |class| class == 1), 0.0);
        assert_eq!(joined_share(&reduced, |class| class < 2), 1.0);
    }
}
