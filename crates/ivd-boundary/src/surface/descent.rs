//! The descent at one resolution: sweeps, and every ten of them a look at what the set is by now.

use ivd_core::{BRICK, Exec, Iteration};

use super::band::{Band, place};
use super::evidence::evidence;
use super::level::{CUBE, Level, within_brick};
use super::look::{Bits, Look, Tally, is_inside, look_at_all, tallies, tally_of};
use super::mixture::Mixture;
use super::model::{Force, Model};
use super::params::{DataTerm, Distribution, SurfaceParams};
use super::sweep::Steps;
use crate::Error;

/// Sweeps between two looks.
const BETWEEN: u32 = 10;
/// Looks without a lower energy after which the descent ends.
const PATIENCE: usize = 1;
/// Share of the border's energy by which a step must lower the whole to count.
const GAIN: f64 = 1e-3;

/// Share of the contrast by which a mixture's border is brought back at most to where voxels of half and half lie, once at each resolution. The area's weight draws a
/// border that curves inwards; where values rise slowly across it, by much of a voxel: what its whole length is drawn in by is made up for.
const MOST_TILT: f64 = 0.5;

/// What a descent goes by, the same at all resolutions.
pub(super) struct Settings<'a> {
    pub(super) params: &'a SurfaceParams,
    /// What values are expected to be, where that stays as it is.
    pub(super) frozen: Option<Model>,
    pub(super) exec: &'a Exec,
}

impl Settings<'_> {
    fn binned(&self) -> bool {
        let likelihood = self.params.data == DataTerm::Likelihood;
        self.frozen.is_some() || likelihood && self.params.distribution != Some(Distribution::Gaussian)
    }

    /// What a resolution's values are mixed of, where a mixture is asked for.
    fn mixture(&self, all: &Tally) -> Result<Option<Mixture>, Error> {
        let noise = self.params.distribution.and_then(Distribution::noise_of_mixture);
        let Some(noise) = noise.filter(|_| self.frozen.is_none()) else { return Ok(None) };
        let found = Mixture::fit(&all.bins, noise).ok_or_else(|| {
            let problem = "the values aren't a mixture of two, as `distribution` says";
            Error::no_boundary(problem, "give another distribution, or a window about the two values")
        })?;
        Ok(Some(found))
    }
}

/// Why there is a set to go on from.
const ACCEPTED: &str = "the first pair is accepted";

/// Where a descent stands.
pub(super) struct Descent {
    pub(super) band: Band,
    /// Set of the lowest energy, by slot.
    pub(super) best: Vec<Bits>,
    /// Energies of the pairs of set and statistics that were accepted, falling (values of the range squared, or nats; voxels).
    pub(super) energies: Vec<f64>,
    pub(super) sweeps: u32,
    /// Voxels whose share was worked out, over all sweeps.
    pub(super) updates: u64,
    /// Weight of the area that was used (shortest edges of this resolution).
    pub(super) mu: f64,
    /// Mean values inside and outside, of the best set.
    pub(super) means: [f64; 2],
    /// Noise over contrast, of the best set.
    pub(super) noise: f64,
    /// How much more the best set is than one of noise: see [`evidence()`].
    pub(super) evidence: f64,
    /// What the best set's statistics make of values.
    pub(super) force: Force,
}

/// Values inside and outside of the set that is looked at.
struct Sides {
    inside: Tally,
    outside: Tally,
    area: f64,
    faces: u64,
}

impl Sides {
    /// Half the difference of what a voxel costs on its wrong and on its right side.
    fn contrast(&self, force: &Force) -> f64 {
        0.5 * (force.mean(&self.outside) - force.mean(&self.inside))
    }
}

fn sides(looks: &[Look], inner: &Tally, total: &Tally) -> Sides {
    let mut inside = inner.clone();
    for look in looks {
        inside.plus(1.0, &look.inside);
    }
    let mut outside = total.clone();
    outside.plus(-1.0, &inside);
    let area = looks.iter().map(|look| look.area).sum();
    Sides { inside, outside, area, faces: looks.iter().map(|look| look.faces).sum() }
}

/// Lowers the energy at one resolution, from the shares that the band holds.
///
/// # Errors
/// [`Error::NoBoundary`] where one side is empty or the two are alike; memory, cancelled.
pub(super) fn descend(level: &Level, mut band: Band, settings: &Settings) -> Result<Descent, Error> {
    let (params, exec) = (settings.params, settings.exec);
    let bins = settings.binned();
    let whole = band.len() == band.all();
    let [total, mut inner] = tallies(level, &|brick| band.is_inner(brick), bins, exec)?;
    let mixture = settings.mixture(&total)?;
    let slope = Steps::new(1.0, level.edges_of_axes(), false).slope;
    let mut looks = look_at_all(&band, slope, bins, exec)?;
    let (mut best, mut energies, mut sweeps, mut updates) = (Vec::new(), Vec::<f64>::new(), 0, 0);
    let (mut steps, mut weight) = (None::<Steps>, None::<f64>);
    let mut kept = None;
    let mut stalled = 0;
    let (mut tilt, mut is_brighter) = (None, None);
    loop {
        let sides = sides(&looks, &inner, &total);
        let model = match (&settings.frozen, &mixture) {
            (Some(frozen), _) => frozen.clone(),
            (None, Some(mixture)) => {
                // Sides don't change places on the way.
                let is_brighter = *is_brighter.get_or_insert(sides.inside.mean() >= sides.outside.mean());
                Model::mixed(mixture, is_brighter, tilt.unwrap_or(0.0))
            }
            (None, None) => {
                let distribution = params.distribution.unwrap_or_default();
                Model::fit(&sides.inside, &sides.outside, params.data, distribution)
            }
        };
        let force = model.force();
        band.act(&force);
        let moved = weight.is_none() || (whole && tilt.is_none() && sweeps <= 3 * BETWEEN);
        if moved {
            let now = weight_of(&band, &force, &sides, level, params)?;
            if weight.is_none_or(|before| (now / before - 1.0).abs() > 0.05) {
                let scale = (now / weight.unwrap_or(1.0)) as f32;
                band.flow.iter_mut().flatten().flatten().for_each(|flow| *flow *= scale);
                steps = Some(Steps::new(now, level.edges_of_axes(), exec.simd));
                weight = Some(now);
                energies.clear();
            }
        }
        let (Some(steps), Some(mu)) = (&steps, weight) else { unreachable!("both are set above") };
        let energy = model.cost(&sides.inside, &sides.outside) + mu * sides.area;
        let gain = GAIN * mu * sides.area;
        let before = energies.last().copied().unwrap_or(f64::INFINITY);
        stalled = if energy < before - gain { 0 } else { stalled + 1 };
        if energy < before {
            energies.push(energy);
            best = looks.iter().map(|look| look.bits).collect();
            kept = Some((sides, force));
        }
        exec.observer().iteration(Iteration { method: "surface", index: u64::from(sweeps), value: energy });
        if sweeps >= params.sweeps {
            break;
        }
        if stalled >= PATIENCE {
            let (Some(mixture), None) = (&mixture, tilt) else { break };
            let (sides, force) = kept.take().expect(ACCEPTED);
            let most = MOST_TILT * sides.contrast(&force).max(0.0);
            let found = band.force_at_front(&best).clamp(-most, most);
            let tilted = Model::mixed(mixture, is_brighter.expect("it is set above"), found);
            tilt = Some(found);
            stalled = 0;
            // What is best so far is what others have to be better than, by the new costs too.
            energies = vec![tilted.cost(&sides.inside, &sides.outside) + mu * sides.area];
            let force = tilted.force();
            band.act(&force);
            kept = Some((sides, force));
        }
        for _ in 0..BETWEEN.min(params.sweeps - sweeps) {
            band.sweep(steps, exec)?;
            sweeps += 1;
            updates += (band.len() * CUBE) as u64;
        }
        looks = look_at_all(&band, slope, bins, exec)?;
        if !whole && grow(level, &mut band, &looks, &mut inner, bins, exec)? {
            looks = look_at_all(&band, slope, bins, exec)?;
        }
    }
    complete(&mut best, &band);
    let (sides, force) = kept.expect(ACCEPTED);
    let mu = weight.expect("it is set before the first pair");
    band.act(&force);
    let noise = band.noise(level.edges) / (2.0 * sides.contrast(&force).max(LEAST_CONTRAST));
    let counts = [sides.inside.count, sides.outside.count];
    let evidence = evidence(level, &band, &best, counts, sides.faces);
    Ok(Descent {
        band,
        best,
        energies,
        sweeps,
        updates,
        mu,
        means: [sides.inside.mean(), sides.outside.mean()],
        noise,
        evidence,
        force,
    })
}

/// Adds to a set that was found earlier the bricks that came into work since: each was all on one side then.
pub(super) fn complete(best: &mut Vec<Bits>, band: &Band) {
    for slot in best.len()..band.len() {
        best.push([if band.primal[slot].u[0] > 0.5 { u64::MAX } else { 0 }; BRICK]);
    }
}

/// Takes into work what the front has come near to; tells whether that was anything.
pub(super) fn grow(
    level: &Level,
    band: &mut Band,
    looks: &[Look],
    inner: &mut Tally,
    bins: bool,
    exec: &Exec,
) -> Result<bool, Error> {
    let mut wanted = Vec::new();
    for (slot, look) in looks.iter().enumerate() {
        if let Some(front) = look.front {
            wanted.extend(band.around(band.place(slot), front));
        }
    }
    let start = |_: [usize; 3], inside: bool, u: &mut [f32; CUBE]| {
        if inside {
            u.fill(1.0);
        }
    };
    let new = band.take(level, wanted, &start, exec)?;
    for slot in new.clone() {
        if band.primal[slot].u[0] > 0.5 {
            inner.plus(-1.0, &tally_of(&band.values[slot], bins));
        }
    }
    Ok(!new.is_empty())
}

/// Area's weight over contrast, a mean voxel's edge, for noise of this many contrasts. Fitted on balls, tori, gyroids and bars with noise of
/// 0.1 … 1.5 of the contrast.
fn smoothness(noise: f64) -> f64 {
    (2.75 * noise).clamp(0.1, 8.0)
}

/// Least contrast, in what a voxel costs: a tenth of a step of 16 bits.
const LEAST_CONTRAST: f64 = 1e-12;

/// The weight of the border's area (shortest edges).
///
/// # Errors
/// [`Error::NoBoundary`] where one side is empty or the two are alike.
fn weight_of(
    band: &Band,
    force: &Force,
    sides: &Sides,
    level: &Level,
    params: &SurfaceParams,
) -> Result<f64, Error> {
    for (side, name) in [(&sides.inside, "inside"), (&sides.outside, "outside")] {
        if side.count < 0.5 {
            let problem = format!("nothing lies {name} of the surface");
            return Err(Error::no_boundary(problem, "give a smaller phi, or another start"));
        }
    }
    let contrast = sides.contrast(force);
    if contrast.is_nan() || contrast <= LEAST_CONTRAST {
        let problem = "values inside and outside of the start are alike";
        return Err(Error::no_boundary(problem, "start elsewhere, or with another radius or data term"));
    }
    // An edge of a mean voxel: of this resolution where the weight follows from its own noise, else of the volume's.
    let (share, mean) = match params.phi {
        Some(phi) => (phi / (1.0 - phi), level.mean_edge_of_finest()),
        None => (smoothness(band.noise(level.edges) / (2.0 * contrast)), level.mean_edge()),
    };
    Ok(share * contrast * mean / level.finest_edge())
}

impl Band {
    /// Sets the force of every voxel in work.
    pub(super) fn act(&mut self, force: &Force) {
        let values = &self.values;
        ivd_core::parallel::for_each_piece_mut(&mut self.force, 16, &|piece, forces| {
            for (slot, out) in (16 * piece..).zip(forces) {
                force.of(&values[slot], out);
            }
        });
    }

    /// Mean force at the border of a set, between voxels of one brick.
    fn force_at_front(&self, sets: &[Bits]) -> f64 {
        let (mut sum, mut count) = (0.0, 0_u64);
        for (slot, bits) in sets.iter().enumerate() {
            if bits.iter().all(|row| *row == 0) || bits.iter().all(|row| *row == u64::MAX) {
                continue;
            }
            let (values, force) = (&self.values[slot], &self.force[slot]);
            for axis in 0..3 {
                let stride = BRICK.pow(axis as u32);
                for i in (0..CUBE).filter(|&i| within_brick(i)[axis] + 1 < BRICK) {
                    let j = i + stride;
                    let is_front = is_inside(bits, i) != is_inside(bits, j);
                    if is_front && !values[i].is_nan() && !values[j].is_nan() {
                        sum += 0.5 * f64::from(force[i] + force[j]);
                        count += 1;
                    }
                }
            }
        }
        sum / count.max(1) as f64
    }

    /// Spread of the force from voxel to voxel: second differences, of which a slope leaves nothing, by their median. Along the axis of the
    /// shortest edge, of those along which there are any.
    fn noise(&self, edges: [f64; 3]) -> f64 {
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| edges[a].total_cmp(&edges[b]));
        let of = |axis: usize| Some(self.second_differences(axis)).filter(|found| !found.is_empty());
        let Some(mut found) = axes.into_iter().find_map(of) else { return 0.0 };
        let middle = found.len() / 2;
        let (_, median, _) = found.select_nth_unstable_by(middle, f32::total_cmp);
        f64::from(*median) / (0.674_49 * 6.0_f64.sqrt())
    }

    /// Second differences of the force along an axis, without sign, at two voxels of each row of a brick.
    fn second_differences(&self, axis: usize) -> Vec<f32> {
        let stride = BRICK.pow(axis as u32);
        let of_pieces = ivd_core::parallel::map_pieces(self.len(), 64, &|slots| {
            let mut found: Vec<f32> = Vec::with_capacity(slots.len() * 128);
            for (values, force) in self.values[slots.clone()].iter().zip(&self.force[slots]) {
                let own = (0..CUBE).filter(|&i| [1, 4].contains(&within_brick(i)[axis]));
                for i in own.filter(|i| [i - stride, *i, i + stride].iter().all(|&j| !values[j].is_nan())) {
                    found.push((force[i - stride] - 2.0 * force[i] + force[i + stride]).abs());
                }
            }
            found
        });
        of_pieces.concat()
    }

    /// All bricks of a level in work, with shares of 0 or 1.
    ///
    /// # Errors
    /// Memory, cancelled.
    pub(super) fn whole(
        level: &Level,
        inside: &(dyn Fn([usize; 3]) -> bool + Sync),
        exec: &Exec,
    ) -> Result<Self, ivd_core::Error> {
        let mut band = Self::new(level, &|_| false);
        let bricks = level.bricks();
        let all: Vec<_> = (0..bricks.iter().product()).map(|i| place(bricks, i)).collect();
        let dims = level.dims;
        let start = |brick: [usize; 3], _: bool, u: &mut [f32; CUBE]| {
            for (i, u) in u.iter_mut().enumerate() {
                let local = within_brick(i);
                let voxel: [usize; 3] = std::array::from_fn(|a| brick[a] * BRICK + local[a]);
                *u = f32::from(u8::from((0..3).all(|a| voxel[a] < dims[a]) && inside(voxel)));
            }
        };
        band.take(level, all, &start, exec)?;
        Ok(band)
    }
}
