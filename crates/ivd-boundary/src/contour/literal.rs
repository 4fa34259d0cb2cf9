//! The thesis's equations 4.12 to 4.14 as they stand, so that what they do can be seen.
//!
//! ```text
//! E = φ Σ inside |∇s|²  +  (1 − φ) (Σ inside μ_in − Σ outside μ_out),      μ = the sum of the values of that side
//! ```
//!
//! Table 4.9 has no step that lowers it; here a layer is added to the region or taken from it, whichever lowers E more, until neither does. Sums
//! grow with their region: the energy falls as long as voxels change sides, and the contour closes up or fills the slice.

use ivd_core::{Exec, Iteration};

use super::params::ContourParams;
use super::slice::Slice;
use crate::Error;

/// Goes down from the circle.
///
/// # Errors
/// Cancelled.
pub(super) fn descend(
    slice: &Slice,
    params: &ContourParams,
    exec: &Exec,
) -> Result<(Vec<u8>, Vec<f64>, u32), Error> {
    let [w, h] = slice.size;
    let value = |x: usize, y: usize| Some(slice.values[x + w * y]).filter(|v| !v.is_nan()).unwrap_or(0.0);
    let slope: Vec<f64> = (0..w * h)
        .map(|i| {
            let (x, y) = (i % w, i / w);
            let dx = (value((x + 1).min(w - 1), y) - value(x, y)) / slice.edges[0];
            let dy = (value(x, (y + 1).min(h - 1)) - value(x, y)) / slice.edges[1];
            dx * dx + dy * dy
        })
        .collect();
    let phi = params.phi.unwrap_or(0.5);
    let energy = |inside: &[bool]| {
        let mut smooth = 0.0;
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        for (i, &within) in inside.iter().enumerate() {
            let side = usize::from(!within);
            sums[side] += value(i % w, i / w);
            counts[side] += 1.0;
            smooth += if within { slope[i] } else { 0.0 };
        }
        phi * smooth + (1.0 - phi) * (counts[0] * sums[0] - counts[1] * sums[1])
    };
    let layer = |inside: &[bool], grows: bool| -> Vec<bool> {
        (0..w * h)
            .map(|i| {
                let (x, y) = (i % w, i / w);
                let touches = [
                    (x > 0).then(|| i - 1),
                    (x + 1 < w).then(|| i + 1),
                    (y > 0).then(|| i - w),
                    (y + 1 < h).then(|| i + w),
                ]
                .into_iter()
                .flatten()
                .any(|j| inside[j] == grows);
                if touches { grows } else { inside[i] }
            })
            .collect()
    };
    let mut inside = slice.circle();
    let mut energies = vec![energy(&inside)];
    let mut iterations = 0;
    while iterations < params.iterations {
        exec.check_cancelled()?;
        let (next, now) = [true, false]
            .map(|grows| {
                let next = layer(&inside, grows);
                let now = energy(&next);
                (next, now)
            })
            .into_iter()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("there are two");
        iterations += 1;
        exec.observer().iteration(Iteration { method: "contour", index: u64::from(iterations), value: now });
        if now >= *energies.last().expect("the start's") || next == inside {
            break;
        }
        energies.push(now);
        inside = next;
    }
    Ok((inside.iter().map(|&v| u8::from(v)).collect(), energies, iterations))
}
