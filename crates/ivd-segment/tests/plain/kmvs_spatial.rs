//! The plain twin of `kmvs_spatial`: Lloyd's algorithm as it is written down, one voxel after another.
//!
//! It takes part by `#[path]`, in the unit tests as in any suite. Sums are whole numbers, so values must be multiples of 2⁻²⁰.
#![allow(unreachable_pub, dead_code, reason = "each suite takes what it needs")]

use ivd_core::{Mask, Volume};

/// Fixed-point units in a stored unit.
const FIXED: f64 = (1 << 20) as f64;

/// What plain Lloyd found.
pub struct Plain {
    /// Cluster of every voxel, numbered from 1 in the order of the start; 0 is no data.
    pub ids: Vec<u16>,
    /// Centroids that the labels belong to, [x, y, z, value] (mm, real units).
    pub centroids: Vec<[f64; 4]>,
    /// Sum of squared distances from the centroids after each update.
    pub inertia: Vec<f64>,
    /// Empty clusters that began anew.
    pub reseeded: u64,
}

/// A voxel or a centroid: its features.
type Point = [f64; 4];

struct Voxel {
    linear: usize,
    index: [usize; 3],
    /// Stored value less the centre.
    relative: f64,
    at: Point,
}

/// Lloyd's algorithm from `start` ([x, y, z, value], mm and real units), until nothing changes or `iterations` are done.
pub fn lloyd(
    volume: &Volume,
    mask: Option<&Mask>,
    weight: f64,
    start: &[[f64; 4]],
    iterations: u64,
) -> Plain {
    let grid = volume.grid();
    let stored = |i: usize| volume.voxels().get(i);
    let counts = |i: &usize| stored(*i).is_finite() && mask.is_none_or(|m| m.inside()[*i] != 0);
    let inside: Vec<usize> = (0..grid.len()).filter(counts).collect();
    let low = inside.iter().map(|i| stored(*i)).fold(f64::INFINITY, f64::min);
    let high = inside.iter().map(|i| stored(*i)).fold(f64::NEG_INFINITY, f64::max);
    let centre = low.midpoint(high).floor();
    let place = |mm: f64| weight * mm;
    let voxels: Vec<Voxel> = inside
        .iter()
        .map(|&linear| {
            let index = grid.index(linear).0;
            let mm: [f64; 3] = std::array::from_fn(|a| grid.spacing()[a] * index[a] as f64);
            let relative = stored(linear) - centre;
            Voxel {
                linear,
                index,
                relative,
                at: [place(mm[0]), place(mm[1]), place(mm[2]), volume.slope() * relative],
            }
        })
        .collect();
    let from_means = |mm: [f64; 3], relative: f64| -> (Point, [f64; 4]) {
        let real = volume.slope() * (centre + relative) + volume.intercept();
        ([place(mm[0]), place(mm[1]), place(mm[2]), volume.slope() * relative], [mm[0], mm[1], mm[2], real])
    };
    let mean = |members: &[&Voxel]| {
        let n = members.len() as f64;
        let exact = |sum: i128| {
            assert!(sum.unsigned_abs() < 1 << 53, "the twin divides what f64 holds");
            sum as f64
        };
        let index: [f64; 3] =
            std::array::from_fn(|a| exact(members.iter().map(|v| v.index[a] as i128).sum()) / n);
        let values: i128 = members.iter().map(|v| (v.relative * FIXED) as i128).sum();
        from_means(std::array::from_fn(|a| grid.spacing()[a] * index[a]), exact(values) / n / FIXED)
    };
    let middle = volume.slope() * centre + volume.intercept();
    let mut centroids: Vec<(Point, [f64; 4])> =
        start.iter().map(|c| ([place(c[0]), place(c[1]), place(c[2]), c[3] - middle], *c)).collect();
    let mut inertia = Vec::new();
    let mut reseeded = 0;
    for _ in 0..iterations {
        let ids: Vec<usize> = voxels.iter().map(|v| nearest(&v.at, &centroids).0).collect();
        let members = |k: usize| -> Vec<&Voxel> {
            voxels.iter().zip(&ids).filter(|(_, id)| **id == k).map(|(v, _)| v).collect()
        };
        let means: Vec<Option<_>> = (0..centroids.len())
            .map(|k| Some(members(k)).filter(|m| !m.is_empty()).map(|m| mean(&m)))
            .collect();
        let about = voxels.iter().zip(&ids).map(|(v, k)| distance(&v.at, &means[*k].expect("not empty").0));
        inertia.push(about.sum());
        let (next, anew) = refill(&voxels, means, &|v| {
            from_means(std::array::from_fn(|a| grid.spacing()[a] * v.index[a] as f64), v.relative)
        });
        if next == centroids {
            break;
        }
        reseeded += anew;
        centroids = next;
    }
    let mut ids = vec![0; grid.len()];
    for voxel in &voxels {
        ids[voxel.linear] = nearest(&voxel.at, &centroids).0 as u16 + 1;
    }
    Plain { ids, centroids: centroids.iter().map(|c| c.1).collect(), inertia, reseeded }
}

/// Gives each empty cluster the voxel farthest from its nearest centroid.
fn refill(
    voxels: &[Voxel],
    mut means: Vec<Option<(Point, [f64; 4])>>,
    centroid: &dyn Fn(&Voxel) -> (Point, [f64; 4]),
) -> (Vec<(Point, [f64; 4])>, u64) {
    let mut known: Vec<_> = means.iter().flatten().copied().collect();
    let mut anew = 0;
    for mean in means.iter_mut().filter(|m| m.is_none()) {
        let mut best = (0.0, None);
        for voxel in voxels {
            let (_, d) = nearest(&voxel.at, &known);
            if d > best.0 {
                best = (d, Some(voxel));
            }
        }
        let Some(voxel) = best.1 else { break };
        *mean = Some(centroid(voxel));
        known.push(centroid(voxel));
        anew += 1;
    }
    (means.into_iter().flatten().collect(), anew)
}

fn distance(a: &Point, b: &Point) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]
}

/// The nearest centroid and its squared distance, the first among equals.
fn nearest(at: &Point, centroids: &[(Point, [f64; 4])]) -> (usize, f64) {
    let mut best = (0, distance(at, &centroids[0].0));
    for (k, centroid) in centroids.iter().enumerate().skip(1) {
        let d = distance(at, &centroid.0);
        if d < best.1 {
            best = (k, d);
        }
    }
    best
}
