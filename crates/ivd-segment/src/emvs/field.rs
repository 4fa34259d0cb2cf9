//! Voxels coupled to their neighbours: a hidden Markov random field, by mean field.
//!
//! The labels' prior is a Potts model over the 6-neighbourhood (Zhang, Brady & Smith 2001): a pair of neighbours along axis a
//! with equal labels adds `β · (least spacing / spacing of a)` to its logarithm. The labels' distribution is taken for a
//! product of one distribution a voxel (mean field: Zhang 1992; Celeux, Forbes & Peyrard 2003). Given the neighbours', the
//! best for a voxel is known in closed form, and no two voxels of one colour of a checkerboard are neighbours: so all red
//! ones are renewed at once, then all black ones, and the variational free energy falls with each.
//!
//! The distributions are stored in steps of 1/255, so that K maps of a large volume fit into memory; a voxel keeps its old
//! distribution where the rounded new one isn't better, so that rounding can't make the energy rise. The colours are stored
//! apart: whoever writes one only reads the other.

use ivd_core::{Buffer, Error, Exec, Scalar, SpillVec, parallel, with_voxels};

use super::covariance::Covariance;
use super::labels::Scene;
use super::line::Sums;
use super::mixture::{Component, INTENSITY};
use super::quadratic::{self, Quadratic};
use super::rows::{PIECE, Piece, Values};

/// The whole of a distribution.
const WHOLE: f64 = 255.0;
/// Beyond this share all others round to nothing.
const CERTAIN: f64 = 1.0 - 0.5 / WHOLE;
/// Voxels of a task, about.
const TASK: usize = 1 << 14;

/// Places that are tried for each voxel of a sample: a part may fill little of its grid.
const TRIES: usize = 16;

/// A step through the remainders of `n` that meets each once, and early ones far from each other: near the golden section of
/// `n`, and without a common divisor.
fn scattering(n: usize) -> usize {
    let divisor = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let golden = (n as f64 * 0.618_033_988_749) as usize;
    // n - 1 has none.
    (golden.max(1)..n).find(|step| divisor(*step, n) == 1).unwrap_or(1)
}

/// The voxels' distributions over the components.
pub(super) struct Field {
    dims: [usize; 3],
    k: usize,
    /// Voxels of one colour in a row.
    half: usize,
    /// By colour: rows, in each the components' shares one after the other.
    shares: [SpillVec<u8>; 2],
    /// The components in the order of their means.
    pub(super) order: Vec<usize>,
}

/// Sums of a colour.
pub(super) struct Tally {
    /// Free energy with the neighbours' part, and without.
    pub(super) coupled: f64,
    pub(super) alone: f64,
    pub(super) sums: Vec<Sums>,
}

impl Tally {
    fn new(k: usize) -> Self {
        Self { coupled: 0.0, alone: 0.0, sums: vec![Sums::default(); k] }
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.coupled += other.coupled;
        self.alone += other.alone;
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            sum.n += other.n;
            sum.d += other.d;
            sum.dd += other.dd;
        }
    }
}

/// What a task renews shares with.
struct Renewal<'a> {
    scene: &'a Scene<'a>,
    densities: &'a [Quadratic],
    /// Means of the intensity.
    means: &'a [f64],
    /// Places along x of either parity.
    places: &'a [Vec<f64>; 2],
    colour: usize,
    other: &'a [u8],
    couplings: Option<[f64; 3]>,
    /// `q ln q` of a share.
    entropy: &'a [f64; 256],
    half: usize,
}

/// Scratch of a task.
struct Work {
    values: Values,
    alone: Vec<[f64; PIECE]>,
    coupled: Vec<[f64; PIECE]>,
    shares: Vec<[f64; PIECE]>,
}

impl Field {
    pub(super) fn new(scene: &Scene, exec: &Exec) -> Result<Self, Error> {
        let dims = scene.frame.dims;
        let (k, half) = (scene.components.len(), dims[0].div_ceil(2));
        let len = half * k * dims[1] * dims[2];
        let colour = || exec.bulk("the voxels' distributions", len);
        Ok(Self { dims, k, half, shares: [colour()?, colour()?], order: (0..k).collect() })
    }

    /// Renews the distributions of one colour, given the other's; without couplings from nothing.
    pub(super) fn renew(
        &mut self,
        scene: &Scene,
        components: &[Component],
        colour: usize,
        couplings: Option<[f64; 3]>,
        exec: &Exec,
    ) -> Result<Tally, Error> {
        let of = if scene.shape == Covariance::Intensity { Quadratic::on_intensity } else { Quadratic::of };
        let densities: Vec<Quadratic> = components.iter().map(of).collect();
        let means: Vec<f64> = components.iter().map(|c| c.mean[INTENSITY]).collect();
        let places = [0, 1].map(|parity| {
            let last = self.dims[0] - 1;
            (0..self.half).map(|i| scene.frame.place(0, (2 * i + parity).min(last))).collect()
        });
        let entropy = std::array::from_fn(|q| {
            let share = q as f64 / WHOLE;
            if q == 0 { 0.0 } else { share * share.ln() }
        });
        let row = self.k * self.half;
        let rows = (TASK / self.dims[0]).max(1);
        let [red, black] = &mut self.shares;
        let (own, other): (&mut [u8], &[u8]) = if colour == 0 { (red, black) } else { (black, red) };
        let (densities, means, places, entropy) = (&densities[..], &means[..], &places, &entropy);
        let renewal =
            Renewal { scene, densities, means, places, colour, other, couplings, entropy, half: self.half };
        let parts: Vec<Tally> = with_voxels!(scene.volume.voxels(), slice => {
            parallel::try_map_pieces_mut(own, rows * row, &|i, own: &mut [u8]| {
                exec.check_cancelled()?;
                Ok::<_, Error>(renewal.rows(slice, i * rows, own))
            })
        })?;
        let mut total = Tally::new(self.k);
        for part in &parts {
            total.join(part);
        }
        Ok(total)
    }

    /// Shares of up to `most` red voxels from all over the volume, and their neighbours' shares times the couplings, summed:
    /// shape `(voxels)[K]`, both. All of them in their order, where there are no more.
    pub(super) fn red_sample(&self, most: usize, couplings: [f64; 3]) -> (Vec<f64>, Vec<f64>) {
        let ([nx, ny, nz], k, half) = (self.dims, self.k, self.half);
        let (mut own, mut neighbours) = (Vec::new(), Vec::new());
        let slots = half * ny * nz;
        let stride = if slots <= most { 1 } else { scattering(slots) };
        for slot in (0..slots.min(TRIES * most)).map(|i| (i as u64 * stride as u64 % slots as u64) as usize) {
            let (row, i) = (slot / half, slot % half);
            let (y, z) = (row % ny, row / ny);
            let parity = (y + z) % 2;
            if 2 * i + parity >= nx || (0..k).all(|j| self.shares[0][(row * k + j) * half + i] == 0) {
                continue;
            }
            let across = [
                (1, (y > 0).then(|| row - 1)),
                (1, (y + 1 < ny).then_some(row + 1)),
                (2, (z > 0).then(|| row - ny)),
                (2, (z + 1 < nz).then_some(row + ny)),
            ];
            let share = |colour: usize, row: usize, j: usize, i: usize| {
                f64::from(self.shares[colour][(row * k + j) * half + i]) / WHOLE
            };
            // Along x one neighbour has the same place among those of its colour.
            let next = if parity == 1 { Some(i + 1).filter(|i| *i < half) } else { i.checked_sub(1) };
            for j in 0..k {
                own.push(share(0, row, j, i));
                let along = share(1, row, j, i) + next.map_or(0.0, |i| share(1, row, j, i));
                let across = across
                    .iter()
                    .filter_map(|(axis, row)| row.map(|row| couplings[*axis] * share(1, row, j, i)));
                neighbours.push(couplings[0] * along + across.sum::<f64>());
            }
            if own.len() >= most * k {
                break;
            }
        }
        (own, neighbours)
    }

    /// Reads the distributions of all voxels in their order: `write(shares, out)`, shares by component.
    fn each<O: Send>(
        &self,
        out: &mut [O],
        exec: &Exec,
        write: impl Fn(&mut dyn Iterator<Item = u8>, &mut O) + Sync,
    ) -> Result<(), Error> {
        let ([nx, ny, _], half, k) = (self.dims, self.half, self.k);
        let rows = (TASK / nx).max(1);
        parallel::try_for_each_piece_mut(out, nx * rows, &|i, out| {
            exec.check_cancelled()?;
            for (r, out) in out.chunks_mut(nx).enumerate() {
                let row = i * rows + r;
                let parity = (row % ny + row / ny) % 2;
                for (x, out) in out.iter_mut().enumerate() {
                    let shares = &self.shares[(x + parity) % 2][row * k * half..(row + 1) * k * half];
                    write(&mut shares[x / 2..].iter().copied().step_by(half), out);
                }
            }
            Ok(())
        })
    }

    /// The component (from 1, in their order) of the greatest share; of equal ones the first.
    pub(super) fn labels(&self, exec: &Exec) -> Result<SpillVec<u16>, Error> {
        let mut place = vec![0; self.k];
        self.order.iter().zip(1..).for_each(|(k, id)| place[*k] = id);
        let mut ids = exec.bulk::<u16>("the labels", self.dims.iter().product())?;
        self.each(&mut ids, exec, |shares, id| {
            let mut best = 0;
            for (share, place) in shares.zip(&place) {
                if share > best || share == best && share > 0 && *place < *id {
                    best = share;
                    *id = *place;
                }
            }
        })?;
        Ok(ids)
    }

    /// The shares, a map for every component, in their order.
    pub(super) fn posteriors(&self, exec: &Exec) -> Result<Vec<Buffer<f32>>, Error> {
        let map = |k: usize| {
            let mut map = exec.bulk::<f32>("a posterior map", self.dims.iter().product())?;
            self.each(&mut map, exec, |shares, p| *p = f32::from(shares.nth(k).unwrap_or(0)) / WHOLE as f32)?;
            Ok(map.into_buffer())
        };
        self.order.iter().map(|k| map(*k)).collect()
    }
}

impl Renewal<'_> {
    /// Renews the rows that `own` holds, from row `first` on.
    fn rows<T: Scalar>(&self, voxels: &[T], first: usize, own: &mut [u8]) -> Tally {
        let k = self.densities.len();
        let empty = || vec![[0.0; PIECE]; k];
        let mut work = Work { values: Values::new(), alone: empty(), coupled: empty(), shares: empty() };
        let mut tally = Tally::new(k);
        for (r, own) in own.chunks_mut(k * self.half).enumerate() {
            for from in (0..self.half).step_by(PIECE) {
                let span = [from, (from + PIECE).min(self.half)];
                self.gather(voxels, first + r, span, &mut work);
                self.choose(span, own, &mut work, &mut tally);
            }
        }
        tally
    }

    /// Logarithms of the densities of some voxels, alone and with what their neighbours add, and the shares they call for.
    fn gather<T: Scalar>(&self, voxels: &[T], row: usize, [from, to]: [usize; 2], work: &mut Work) {
        let [nx, ny, nz] = self.scene.frame.dims;
        let (y, z) = (row % ny, row / ny);
        let parity = (y + z + self.colour) % 2;
        work.values.fill_every_second(
            voxels,
            self.scene.mask,
            [row * nx, (row + 1) * nx],
            [from, to, parity],
            self.scene.frame,
        );
        let piece = Piece { start: 0, len: to - from, at: [0, y, z] };
        let x = &self.places[parity][from..to];
        for (k, density) in self.densities.iter().enumerate() {
            density.logs(&piece, self.scene.frame, x, &work.values.t, &mut work.alone[k]);
            work.coupled[k] = work.alone[k];
            let Some(couplings) = self.couplings else { continue };
            let out = &mut work.coupled[k][..to - from];
            let shares =
                |row: usize| &self.other[(row * self.densities.len() + k) * self.half..][..self.half];
            let steps = [
                (1, y > 0, row.wrapping_sub(1)),
                (1, y + 1 < ny, row + 1),
                (2, z > 0, row.wrapping_sub(ny)),
                (2, z + 1 < nz, row + ny),
            ];
            for (axis, _, row) in steps.into_iter().filter(|(_, there, _)| *there) {
                add(out, &shares(row)[from..to], couplings[axis]);
            }
            // Along x one neighbour has the same place among those of its colour, the other the one before or after.
            let along = shares(row);
            add(out, &along[from..to], couplings[0]);
            if parity == 1 {
                add(out, &along[from + 1..(to + 1).min(self.half)], couplings[0]);
            } else if from > 0 {
                add(out, &along[from - 1..to - 1], couplings[0]);
            } else {
                add(&mut out[1..], &along[..to - 1], couplings[0]);
            }
        }
        work.shares.copy_from_slice(&work.coupled);
        quadratic::posteriors(&mut work.shares, to - from, &work.values);
    }

    /// Rounds the shares and takes them where that is no worse than what there was.
    fn choose(&self, [from, to]: [usize; 2], own: &mut [u8], work: &mut Work, tally: &mut Tally) {
        let k = self.densities.len();
        let mut rounded = vec![0_u8; k];
        for i in (0..to - from).filter(|i| work.values.valid[*i] != 0.0) {
            let best =
                (1..k).fold(0, |best, j| if work.shares[j][i] > work.shares[best][i] { j } else { best });
            let place = |j: usize| j * self.half + from + i;
            rounded.fill(0);
            rounded[best] = WHOLE as u8;
            if work.shares[best][i] < CERTAIN {
                let mut left = WHOLE as i32;
                for (j, rounded) in rounded.iter_mut().enumerate() {
                    *rounded = (work.shares[j][i] * WHOLE + 0.5) as u8;
                    left -= i32::from(*rounded);
                }
                match u8::try_from(i32::from(rounded[best]) + left) {
                    Ok(rest) => rounded[best] = rest,
                    // Very many shares that all rounded up.
                    Err(_) => rounded
                        .iter_mut()
                        .enumerate()
                        .for_each(|(j, q)| *q = u8::from(j == best) * WHOLE as u8),
                }
            }
            if (0..k).any(|j| own[place(j)] != rounded[j]) {
                let energy = |q: &dyn Fn(usize) -> u8| -> f64 {
                    (0..k).map(|j| self.energy(q(j), work.coupled[j][i])).sum()
                };
                if self.couplings.is_none() || energy(&|j| rounded[j]) <= energy(&|j| own[place(j)]) {
                    (0..k).for_each(|j| own[place(j)] = rounded[j]);
                }
            }
            for j in (0..k).filter(|j| own[place(*j)] != 0) {
                let q = own[place(j)];
                tally.coupled += self.energy(q, work.coupled[j][i]);
                tally.alone += self.energy(q, work.alone[j][i]);
                let (r, d) = (f64::from(q) / WHOLE, work.values.t[i] - self.means[j]);
                tally.sums[j].n += r;
                tally.sums[j].d += r * d;
                tally.sums[j].dd += r * d * d;
            }
        }
    }

    #[inline]
    fn energy(&self, q: u8, log: f64) -> f64 {
        self.entropy[usize::from(q)] - f64::from(q) / WHOLE * log
    }
}

fn add(out: &mut [f64], shares: &[u8], coupling: f64) {
    let each = coupling / WHOLE;
    out.iter_mut().zip(shares).for_each(|(out, q)| *out += each * f64::from(*q));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_sample_comes_from_all_over_the_volume() {
        // Each voxel tells its place: shares of y and z.
        let (dims, k) = ([64_usize; 3], 2);
        let half = 32;
        let mut shares = [0, 1].map(|_| Exec::default().bulk::<u8>("shares", half * k * 64 * 64).unwrap());
        for row in 0..64 * 64 {
            shares[0][row * k * half..][..half].fill(1 + (row % 64) as u8);
            shares[0][(row * k + 1) * half..][..half].fill(1 + (row / 64) as u8);
        }
        let (own, _) = Field { dims, k, half, shares, order: Vec::new() }.red_sample(500, [1.0; 3]);
        assert_eq!(own.len(), 500 * k);
        for axis in 0..2 {
            let mut met = [0; 64];
            own.chunks_exact(k).for_each(|v| met[(v[axis] * WHOLE).round() as usize - 1] += 1);
            assert!(met.iter().all(|n| (1..=16).contains(n)), "{axis}: {met:?}");
        }
    }

    #[test]
    fn labels_and_maps_come_in_the_order_of_the_components() {
        let exec = Exec::default();
        let mut shares = [0, 1].map(|_| exec.bulk::<u8>("shares", 2).unwrap());
        // The first voxel is wholly of component 0, the second of component 1, whose mean is the lower one in the end.
        (shares[0][0], shares[1][1]) = (255, 255);
        let field = Field { dims: [2, 1, 1], k: 2, half: 1, shares, order: vec![1, 0] };
        assert_eq!(field.labels(&exec).unwrap()[..], [2, 1]);
        let maps = field.posteriors(&exec).unwrap();
        assert_eq!((maps[0][..].to_vec(), maps[1][..].to_vec()), (vec![0.0, 1.0], vec![1.0, 0.0]));
        // Undecided voxels are of the lower mean.
        let shares = [0, 1].map(|_| {
            let mut shares = exec.bulk::<u8>("shares", 2).unwrap();
            shares.fill(127);
            shares
        });
        let undecided = Field { dims: [2, 1, 1], k: 2, half: 1, shares, order: vec![1, 0] };
        assert_eq!(undecided.labels(&exec).unwrap()[..], [1, 1]);
    }

    #[test]
    fn a_sample_of_all_red_voxels_has_the_sums_of_their_neighbours() {
        let couplings = [0.5, 0.25, 2.0];
        for dims in [[5, 4, 3], [4, 3, 2], [1, 3, 5], [6, 1, 1]] {
            let ([nx, ny, nz], k): ([usize; 3], usize) = (dims, 3);
            let share = |at: [usize; 3], j: usize| {
                (((at[0] * 7 + at[1] * 13 + at[2] * 29 + j * 83) * 2_654_435_761) >> 7) as u8
            };
            let half = nx.div_ceil(2);
            let shares = [0, 1].map(|colour| {
                let mut shares = Exec::default().bulk::<u8>("shares", half * k * ny * nz).unwrap();
                for (row, j, i) in
                    (0..ny * nz).flat_map(|r| (0..k).flat_map(move |j| (0..half).map(move |i| (r, j, i))))
                {
                    let (y, z) = (row % ny, row / ny);
                    let x = 2 * i + (y + z + colour) % 2;
                    shares[(row * k + j) * half + i] = if x < nx { share([x, y, z], j) } else { 0 };
                }
                shares
            });
            let (own, neighbours) =
                Field { dims, k, half, shares, order: Vec::new() }.red_sample(1 << 20, couplings);
            let mut at = 0;
            for [z, y, x] in (0..nz)
                .flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [z, y, x])))
                .filter(|p| p.iter().sum::<usize>() % 2 == 0)
                .filter(|[z, y, x]| (0..k).any(|j| share([*x, *y, *z], j) > 0))
            {
                for j in 0..k {
                    let here = [x, y, z];
                    let mut sum = 0.0;
                    for a in 0..3 {
                        let mut near = here;
                        if here[a] > 0 {
                            near[a] = here[a] - 1;
                            sum += couplings[a] * f64::from(share(near, j));
                        }
                        if here[a] + 1 < dims[a] {
                            near[a] = here[a] + 1;
                            sum += couplings[a] * f64::from(share(near, j));
                        }
                    }
                    assert!((neighbours[at] - sum / WHOLE).abs() < 1e-12, "{dims:?} {here:?}");
                    assert!((own[at] - f64::from(share(here, j)) / WHOLE).abs() < 1e-12);
                    at += 1;
                }
            }
            assert_eq!((at, at), (own.len(), neighbours.len()));
        }
    }
}
