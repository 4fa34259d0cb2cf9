//! Densities of components whose axes are independent: the places form a grid and the values lie in bins, so that a density is
//! a product of four small tables, and no voxel needs an exponential.

use ivd_core::{Mask, Scalar};

use super::bins::Bins;
use super::exponential::exp;
use super::line::{Density, likeliest, log_weight};
use super::mixture::{AXES, Component, Frame, INTENSITY};
use super::rows::{PIECE, Piece, pieces};
use super::sums::Sums;

const LANES: usize = 4;
/// Voxels whose sums of densities are multiplied before the logarithm is taken.
const PRODUCT: usize = 8;
/// A sum of densities below this has lost digits, or a product of several would: logarithms are taken one by one.
const SMALL: f64 = 1e-200;
const TINY: f64 = 1e-280;
/// Values of 8 and 16 bit types, and where 0 stands among them.
const SHORT: usize = 1 << 15;
/// Bin of a voxel without a datum.
const NONE: u32 = u32::MAX;

/// Logarithms and values of a component's factors along one axis, by place or bin.
struct Factor {
    logs: Vec<f64>,
    values: Vec<f64>,
}

impl Factor {
    fn new(logs: Vec<f64>) -> Self {
        Self { values: logs.iter().map(|l| exp(*l)).collect(), logs }
    }
}

pub(super) struct Tables {
    components: Vec<[Factor; AXES]>,
    means: Vec<[f64; AXES]>,
    /// Mean of a bin's values and of their squares.
    value: Vec<f64>,
    square: Vec<f64>,
    /// Sum over all voxels of what was taken from the logarithms of their bins.
    taken: f64,
    /// Bins of the values of 8 and 16 bit types.
    short: Vec<u32>,
}

impl Tables {
    /// The components' weighted densities.
    pub(super) fn of(bins: &Bins, frame: &Frame, components: &[Component]) -> Self {
        let intensity: Vec<Density> = components.iter().map(Density::of).collect();
        let log = |density: &Density, b: usize| density.log(bins.value[b]) - density.half * bins.spread[b];
        let most: Vec<f64> = (0..bins.len())
            .map(|b| intensity.iter().map(|d| log(d, b)).fold(f64::NEG_INFINITY, f64::max))
            .collect();
        let taken = most.iter().zip(&bins.count).map(|(most, n)| most * n).sum();
        let factors = |(c, density): (&Component, &Density)| {
            let along = |a: usize| {
                let variance = c.covariance[a][a];
                let constant = -0.5 * (std::f64::consts::TAU.ln() + variance.ln());
                let log = |i: usize| constant - 0.5 * (frame.place(a, i) - c.mean[a]).powi(2) / variance;
                Factor::new((0..frame.dims[a]).map(log).collect())
            };
            let values = (0..bins.len()).map(|b| log(density, b) - most[b]).collect();
            [along(0), along(1), along(2), Factor::new(values)]
        };
        let factors = components.iter().zip(&intensity).map(factors).collect();
        Self::new(bins, components, factors, taken)
    }

    /// 1 where a component on intensity alone is the likeliest, else as good as 0; everywhere in space.
    pub(super) fn choosing(bins: &Bins, frame: &Frame, components: &[Component]) -> Self {
        let densities: Vec<Density> = components.iter().map(Density::of).collect();
        let chosen: Vec<usize> = bins.value.iter().map(|t| likeliest(&densities, *t)).collect();
        let factors = |k: usize| {
            let flat = |a: usize| Factor::new(vec![0.0; frame.dims[a]]);
            let own = chosen.iter().map(|c| if *c == k { 0.0 } else { log_weight(0.0) }).collect();
            [flat(0), flat(1), flat(2), Factor::new(own)]
        };
        Self::new(bins, components, (0..components.len()).map(factors).collect(), 0.0)
    }

    fn new(bins: &Bins, components: &[Component], factors: Vec<[Factor; AXES]>, taken: f64) -> Self {
        let mut short = Vec::new();
        if bins.is_exact() {
            short = vec![NONE; 3 * SHORT];
            for (b, [value, _]) in bins.ends.iter().enumerate() {
                if let Some(bin) = short.get_mut((value + SHORT as f64) as usize) {
                    *bin = b as u32;
                }
            }
        }
        Self {
            components: factors,
            means: components.iter().map(|c| c.mean).collect(),
            value: bins.value.clone(),
            square: bins.value.iter().zip(&bins.spread).map(|(t, s)| t * t + s).collect(),
            taken,
            short,
        }
    }

    /// The sums over the voxels `start … end - 1`, and their log-likelihood. (What was taken from the bins' logarithms is
    /// added for the voxels that come first.)
    pub(super) fn expect<T: Scalar>(
        &self,
        voxels: &[T],
        mask: Option<&Mask>,
        bins: &Bins,
        frame: &Frame,
        [start, end]: [usize; 2],
    ) -> (Vec<Sums>, f64) {
        let k = self.components.len();
        let mut work = Work {
            bins: [0; PIECE],
            shares: vec![[0.0; PIECE]; k],
            along: vec![[0.0; PIECE]; k],
            all: [0.0; PIECE],
        };
        let mut sums = vec![Sums::default(); k];
        let mut likelihood = if start == 0 { self.taken } else { 0.0 };
        for piece in pieces(frame.dims, start, end) {
            let all_valid = self.fill(voxels, mask, bins, &piece, &mut work.bins);
            likelihood += self.shares(&piece, all_valid, &mut work);
            for k in 0..k {
                self.add(k, &piece, frame, &mut work, &mut sums[k]);
            }
            // The sums along x are kept by place as long as the pieces of all rows begin at the same.
            if frame.dims[0] > PIECE {
                self.flush(&piece, frame, &mut work, &mut sums);
            }
        }
        if frame.dims[0] <= PIECE {
            let whole = Piece { start: 0, len: frame.dims[0], at: [0; 3] };
            self.flush(&whole, frame, &mut work, &mut sums);
        }
        (sums, likelihood)
    }

    /// Bins of a piece; whether all its voxels have one.
    fn fill<T: Scalar>(
        &self,
        voxels: &[T],
        mask: Option<&Mask>,
        bins: &Bins,
        piece: &Piece,
        out: &mut [u32],
    ) -> bool {
        let voxels = &voxels[piece.range()];
        if T::TYPE.is_integer() && T::TYPE.bytes() <= 2 && !self.short.is_empty() {
            let at = |v: &T| (v.to_f64() as i32 + SHORT as i32) as usize;
            out.iter_mut().zip(voxels).for_each(|(bin, v)| *bin = self.short[at(v)]);
        } else {
            let bin = |v: &T| if v.is_data() { bins.bin(v.to_f64()) } else { NONE };
            // Outside the mask a value may be one that was never counted.
            out.iter_mut().zip(voxels).for_each(|(out, v)| *out = bin(v));
        }
        let Some(mask) = mask else { return T::TYPE.is_integer() || !out[..voxels.len()].contains(&NONE) };
        out.iter_mut()
            .zip(&mask.inside()[piece.range()])
            .filter(|(_, m)| **m == 0)
            .for_each(|(o, _)| *o = NONE);
        !out[..voxels.len()].contains(&NONE)
    }

    /// Responsibilities of a piece, and its log-likelihood.
    fn shares(&self, piece: &Piece, all_valid: bool, work: &mut Work) -> f64 {
        let len = piece.len;
        work.all[..len].fill(0.0);
        let missing: Vec<usize> =
            if all_valid { Vec::new() } else { (0..len).filter(|i| work.bins[*i] == NONE).collect() };
        for i in &missing {
            work.bins[*i] = 0;
        }
        for (factors, shares) in self.components.iter().zip(&mut work.shares) {
            let row = factors[1].values[piece.at[1]] * factors[2].values[piece.at[2]];
            let along = &factors[0].values[piece.at[0]..piece.at[0] + len];
            let table = &factors[INTENSITY].values[..];
            for (((share, x), bin), all) in shares.iter_mut().zip(along).zip(&work.bins).zip(&mut work.all) {
                *share = (row * x) * table[*bin as usize];
                *all += *share;
            }
        }
        for i in &missing {
            work.all[*i] = 1.0;
        }
        let mut likelihood = 0.0;
        if work.all[..len].iter().any(|all| *all < SMALL) {
            for i in (0..len).filter(|i| work.all[*i] < SMALL).collect::<Vec<_>>() {
                likelihood += self.share_by_logs(piece, i, work);
            }
        }
        for all in work.all[..len].chunks(PRODUCT) {
            let product: f64 = all.iter().product();
            likelihood += if product > TINY { product.ln() } else { all.iter().map(|a| a.ln()).sum() };
        }
        work.all[..len].iter_mut().for_each(|all| *all = 1.0 / *all);
        for i in &missing {
            work.all[*i] = 0.0;
        }
        likelihood
    }

    /// A voxel whose densities all vanish beside 1: relative to the largest. Gives the logarithm of that.
    fn share_by_logs(&self, piece: &Piece, i: usize, work: &mut Work) -> f64 {
        let at = [piece.at[0] + i, piece.at[1], piece.at[2], work.bins[i] as usize];
        let log = |factors: &[Factor; AXES]| -> f64 { (0..AXES).map(|a| factors[a].logs[at[a]]).sum() };
        let most = self.components.iter().map(log).fold(f64::NEG_INFINITY, f64::max);
        work.all[i] = 0.0;
        for (factors, shares) in self.components.iter().zip(&mut work.shares) {
            shares[i] = exp(log(factors) - most);
            work.all[i] += shares[i];
        }
        most
    }

    fn add(&self, k: usize, piece: &Piece, frame: &Frame, work: &mut Work, sums: &mut Sums) {
        let len = piece.len;
        let (shares, inverse, bins) = (&work.shares[k][..len], &work.all[..len], &work.bins[..len]);
        let along = &mut work.along[k][..len];
        let mut lanes = [[0.0; LANES]; 3];
        let mut one = |lane: usize, share: f64, inverse: f64, bin: u32, along: &mut f64| {
            let r = share * inverse;
            *along += r;
            lanes[0][lane] += r;
            lanes[1][lane] += r * self.value[bin as usize];
            lanes[2][lane] += r * self.square[bin as usize];
        };
        let whole = len / LANES * LANES;
        for (((shares, inverse), bins), along) in shares
            .chunks_exact(LANES)
            .zip(inverse.chunks_exact(LANES))
            .zip(bins.chunks_exact(LANES))
            .zip(along.chunks_exact_mut(LANES))
        {
            for lane in 0..LANES {
                one(lane, shares[lane], inverse[lane], bins[lane], &mut along[lane]);
            }
        }
        for i in whole..len {
            one(0, shares[i], inverse[i], bins[i], &mut along[i]);
        }
        let [n, t, tt] = lanes.map(|sum| (sum[0] + sum[1]) + (sum[2] + sum[3]));
        let mean = self.means[k];
        sums.n += n;
        for a in [1, 2] {
            let d = frame.place(a, piece.at[a]) - mean[a];
            sums.d[a] += n * d;
            sums.dd[a][a] += n * d * d;
        }
        let m = mean[INTENSITY];
        sums.d[INTENSITY] += t - m * n;
        sums.dd[INTENSITY][INTENSITY] += tt - 2.0 * m * t + m * m * n;
    }

    /// Moves the sums by place along x into the sums.
    fn flush(&self, piece: &Piece, frame: &Frame, work: &mut Work, sums: &mut [Sums]) {
        for ((along, mean), sums) in work.along.iter_mut().zip(&self.means).zip(sums) {
            for (i, n) in along[..piece.len].iter_mut().enumerate() {
                let d = frame.place(0, piece.at[0] + i) - mean[0];
                sums.d[0] += *n * d;
                sums.dd[0][0] += *n * d * d;
                *n = 0.0;
            }
        }
    }
}

/// What a chunk is worked on with.
struct Work {
    bins: [u32; PIECE],
    shares: Vec<[f64; PIECE]>,
    /// Responsibilities by place along x.
    along: Vec<[f64; PIECE]>,
    /// Sums of the densities of a voxel, then their inverses; 0 where there is no datum.
    all: [f64; PIECE],
}
