//! The leak guard: a part is cut where it is narrow, and what its start lies in stays.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use ivd_core::{Exec, Grid};

use super::frame::Frame;
use super::{Chosen, keep_piece, limit, squared_distances};
use crate::Error;
use crate::axes::mean_edge;

/// How far from the start the core that is kept may lie, over the radius of the opening.
const NEAR: f64 = 2.0;

/// Erosion by a ball, the piece of the start, and what of the set lies as near to it again, and a voxel more.
///
/// # Errors
/// [`Error::NoBoundary`] where erosion leaves nothing near the start; memory, cancelled.
pub(super) fn open(
    inside: &mut [u8],
    grid: &Grid,
    radius: f64,
    chosen: &Chosen,
    exec: &Exec,
) -> Result<(), Error> {
    let dims = grid.dims();
    let edges = grid.spacing();
    // The part and a voxel round it, which is outside.
    let frame = Frame::about(inside, dims, [1; 3]);
    let size = frame.size;
    let holds = |i: usize| frame.voxel(i).is_some_and(|voxel| inside[voxel] != 0);
    let starts = |i: usize| holds(i) && frame.voxel(i).is_some_and(chosen);
    let depth = squared_distances(size, edges, &|i| !holds(i), exec)?;
    let mut core: Vec<u8> = depth.iter().map(|&d| u8::from(d > limit(radius))).collect();
    drop(depth);
    if !core.contains(&1) {
        let problem =
            format!("the part is nowhere wider than {} mm, which the leak guard opens", 2.0 * radius);
        return Err(Error::no_boundary(problem, "give a smaller open"));
    }
    if (0..core.len()).any(|i| core[i] != 0 && starts(i)) {
        keep_piece(&mut core, size, &starts)?;
    } else {
        let nearest = nearest(&frame, edges, &core, &holds, &starts, NEAR * radius, exec)?;
        keep_piece(&mut core, size, &|i| i == nearest)?;
    }
    let away = squared_distances(size, edges, &|i| core[i] != 0, exec)?;
    // A voxel further than was taken off: the border's steps come back whole.
    let reach = limit(radius + mean_edge(dims, edges));
    for (i, &away) in away.iter().enumerate() {
        if let Some(voxel) = frame.voxel(i) {
            inside[voxel] = u8::from(inside[voxel] != 0 && away <= reach);
        }
    }
    // Dilation may reach across a thin wall into what hung on a bridge: the piece of the core alone stays.
    let mut kept = vec![0_u8; inside.len()];
    for i in (0..core.len()).filter(|&i| core[i] != 0) {
        if let Some(voxel) = frame.voxel(i) {
            kept[voxel] = 1;
        }
    }
    keep_piece(inside, dims, &|voxel| kept[voxel] != 0)?;
    Ok(())
}

/// The voxel of a core that is nearest to the start, on ways through the part of at most `most` mm.
fn nearest(
    frame: &Frame,
    edges: [f64; 3],
    core: &[u8],
    holds: &dyn Fn(usize) -> bool,
    starts: &dyn Fn(usize) -> bool,
    most: f64,
    exec: &Exec,
) -> Result<usize, Error> {
    exec.check_memory("ways from the start", 8 * frame.len() as u64)?;
    let mut away = vec![f64::INFINITY; frame.len()];
    // Distances above 0 are in the order of their bits.
    let mut queue = BinaryHeap::new();
    for i in (0..frame.len()).filter(|&i| starts(i)) {
        away[i] = 0.0;
        queue.push(Reverse((0.0_f64.to_bits(), i)));
    }
    let size = frame.size.map(|n| n as isize);
    while let Some(Reverse((bits, i))) = queue.pop() {
        let so_far = f64::from_bits(bits);
        if so_far > away[i] {
            continue;
        }
        if core[i] != 0 {
            return Ok(i);
        }
        exec.check_cancelled()?;
        let at = frame.place(i).map(|v| v as isize);
        for step in (0..27_isize).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]) {
            let to: [isize; 3] = std::array::from_fn(|a| at[a] + step[a]);
            if (0..3).any(|a| to[a] < 0 || to[a] >= size[a]) {
                continue;
            }
            let j = (to[0] + size[0] * (to[1] + size[1] * to[2])) as usize;
            let length = (0..3).map(|a| (step[a] as f64 * edges[a]).powi(2)).sum::<f64>().sqrt();
            if so_far + length <= most && so_far + length < away[j] && holds(j) {
                away[j] = so_far + length;
                queue.push(Reverse((away[j].to_bits(), j)));
            }
        }
    }
    let problem = format!("within {most} mm of the start the part is nowhere as wide as the leak guard asks");
    Err(Error::no_boundary(problem, "give a smaller open, or start where the part is wider"))
}
