//! Opacities by which every material has the visibility that is aimed at (Ruiz et al. 2011; Correa & Ma 2011).

use ivd_core::{Exec, Iteration, parallel};

use crate::Error;
use crate::bins::SampleBins;
use crate::rays::{Bundle, Kind, Ray};

/// Opacity that materials start with.
const START: f64 = 0.3;
/// Share of the light on the way through the matter that is let through on average.
const LET_THROUGH: f64 = 0.02;
/// Power of target over visibility that an opacity is multiplied by in a round. At ½ a crop of an abdomen in CT still improves after 40 rounds.
const GAIN: f64 = 0.9;
/// Most rounds.
const MOST_ROUNDS: u32 = 40;
/// The divergence has stopped falling when it hasn't fallen by this much …
const SETTLED: f64 = 1e-4;
/// … for so many rounds: on their way opacities may pass a worse place.
const PATIENCE: u32 = 4;
/// Visibility is summed in whole numbers of this part, so that the order of rays doesn't matter.
const PARTS: f32 = (1_u64 << 32) as f32;

/// What opacities are held between, and the length that they hold over.
pub(crate) struct Bounds {
    pub(crate) least: f64,
    pub(crate) most: f64,
    /// (mm)
    pub(crate) reference_mm: f64,
}

/// Opacities, and the visibility of materials by them. All lists are by class; zeros for those that are no material.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fit {
    /// Opacity over the reference length.
    pub(crate) opacity: Vec<f64>,
    /// Share of all visibility.
    pub(crate) visibility: Vec<f64>,
    /// All visibility, as a share of the light on the rays that meet matter.
    visible: f64,
    /// Share of all visibility that is aimed at.
    pub(crate) target: Vec<f64>,
    /// Mean opacity that a material would have as the only one, at the greatest opacity, on rays that meet matter.
    pub(crate) coverage: Vec<f64>,
    /// Kullback–Leibler divergence of the visibility from the target.
    pub(crate) divergence: f64,
    pub(crate) rounds: u32,
    /// Mean opacity of rays that meet data but no matter, where there are any.
    pub(crate) background_opacity: Option<f64>,
    /// Rays that meet matter and are less than half opaque, or the reverse, per ray that meets matter, where there are any.
    pub(crate) silhouette_difference: Option<f64>,
}

/// Sums of one thread over its rays.
struct Sums {
    /// Visibility of each kind of sample.
    visibility: Vec<u64>,
    /// Rays that meet matter, those of them that are less than half opaque, the opposite, and rays that meet data but no matter.
    rays: [u64; 4],
    background: u64,
}

/// Share of the rays that meet matter that may be less than half opaque, or the reverse, before the outside is made more visible. Less than the 3 % that
/// are asked for: other views than those of the rounds, along the grid's axes, see up to twice as much.
const SILHOUETTE: f64 = 0.015;
/// Shares of what lies in front in the targets: the first, and those that are tried where the silhouette needs it.
const OF_FRONT: f64 = 0.5;
const MORE_OF_FRONT: [f64; 2] = [1.0, 0.75];
/// Visibility that no material is to lose for the silhouette: this, or this part of its coverage, if that is less.
const ASKED: f64 = 0.05;
const ASKED_OF_COVERAGE: f64 = 0.5;

/// Finds opacities of `materials` (class numbers below `classes`).
///
/// Targets go by coverage and by what lies in front, but for a least share of what is small. Where more than [`SILHOUETTE`] of the rays differ from the
/// matter's silhouette, targets that go more by what lies in front are tried, and taken if they bring it nearer and no material loses the visibility that
/// is asked for: of those that bring it within the bound the one that goes least by what lies in front, else the nearest.
pub(crate) fn fit<K: Kind>(
    bundle: &Bundle<K>,
    bins: &SampleBins,
    classes: usize,
    materials: &[usize],
    bounds: &Bounds,
    exec: &Exec,
) -> Result<Fit, Error> {
    let steps: Vec<f64> = bundle.step_mm.iter().map(|mm| mm / bounds.reference_mm).collect();
    let (threads, kinds) = (rayon::current_num_threads() + 1, bins.len());
    exec.check_memory("visibility of samples", (8 * threads * kinds + 4 * steps.len() * kinds) as u64)?;
    let coverage = coverage(bundle, bins, classes, &steps, bounds.most, exec)?;
    let in_front = in_front(bundle, bins, &coverage, &steps, materials, bounds, exec)?;
    let start =
        |k: usize| if coverage[k] > 0.0 { START.clamp(bounds.least, bounds.most) } else { bounds.most };
    let mut opacity = vec![0.0; classes];
    for &k in materials {
        opacity[k] = start(k);
    }
    let seen = Seen { bundle, bins, steps: &steps, materials, bounds };
    let solve = |of_front: f64, opacity: Vec<f64>, before: u32| {
        let wanted = proportions(&in_front, &coverage, of_front);
        let found = seen.settle(&targets(&coverage, &wanted, materials), opacity, before, exec)?;
        Ok::<_, Error>(Fit { coverage: coverage.clone(), ..found })
    };
    let mut best = solve(OF_FRONT, opacity, 0)?;
    let asked = |k: usize| ASKED.min(ASKED_OF_COVERAGE * coverage[k]).min(best.visibility[k]);
    let asked: Vec<f64> = (0..classes).map(asked).collect();
    for of_front in MORE_OF_FRONT {
        let off = best.silhouette_difference.unwrap_or(0.0);
        if materials.len() < 2 || of_front == MORE_OF_FRONT[0] && off <= SILHOUETTE {
            break;
        }
        let found = solve(of_front, best.opacity.clone(), best.rounds)?;
        let is_kept = materials.iter().all(|&k| found.visibility[k] >= asked[k]);
        let found_off = found.silhouette_difference.unwrap_or(0.0);
        if is_kept && (found_off <= SILHOUETTE || found_off < off) {
            best = found;
        } else {
            best.rounds = found.rounds;
        }
    }
    Ok(best)
}

/// What opacities are settled by.
struct Seen<'a, K> {
    bundle: &'a Bundle<K>,
    bins: &'a SampleBins,
    steps: &'a [f64],
    materials: &'a [usize],
    bounds: &'a Bounds,
}

impl<K: Kind> Seen<'_, K> {
    /// In every round an opacity is multiplied by a power of target over visibility, until their divergence stops falling. `before`: rounds that were
    /// needed already.
    fn settle(&self, target: &[f64], mut opacity: Vec<f64>, before: u32, exec: &Exec) -> Result<Fit, Error> {
        let Self { materials, bounds, .. } = *self;
        let mut best: Option<(f64, Fit)> = None;
        let (mut standing, mut rounds) = (0, before);
        for round in before + 1..=before + MOST_ROUNDS {
            let (score, found) = self.score(target, &opacity, round, exec)?;
            let all = found.visible * (1.0 - LET_THROUGH).recip();
            for &k in materials {
                let (wanted, now) = (target[k], found.visibility[k] * all);
                let factor = if now > 0.0 { (wanted / now).powf(GAIN) } else { 4.0 };
                if wanted > 0.0 {
                    opacity[k] = (opacity[k] * factor.clamp(0.25, 4.0)).clamp(bounds.least, bounds.most);
                }
            }
            let least = best.as_ref().map_or(f64::INFINITY, |(least, _)| *least);
            standing = if score < least - SETTLED { 0 } else { standing + 1 };
            rounds = round;
            if score < least {
                best = Some((score, found));
            }
            if standing == PATIENCE {
                break;
            }
        }
        let best = best.expect("there is a first round").1;
        Ok(Fit { rounds, ..best })
    }

    /// How far visibility is from its target with some opacities, with what is let through as one more share.
    fn score(&self, target: &[f64], opacity: &[f64], round: u32, exec: &Exec) -> Result<(f64, Fit), Error> {
        let mut found = visibility(self.bundle, self.bins, opacity, self.steps, exec)?;
        found.target = target.to_vec();
        found.visible = found.visibility.iter().sum();
        let through = [LET_THROUGH, (1.0 - found.visible).max(0.0)];
        let score = divergence(target, &found.visibility, through);
        exec.observer().iteration(Iteration { method: "atf", index: u64::from(round), value: score });
        let total = found.visible.max(f64::MIN_POSITIVE);
        found.visibility.iter_mut().for_each(|share| *share /= total);
        found.divergence = divergence(target, &found.visibility, [0.0; 2]);
        Ok((score, found))
    }
}

/// Opacity over `length` reference lengths.
fn over(opacity: f64, length: f64) -> f64 {
    -(length * (-opacity.min(1.0)).ln_1p()).exp_m1()
}

/// `Σ t ln (t / v)`, with what is let through (its target and itself) as one more share.
fn divergence(target: &[f64], visibility: &[f64], through: [f64; 2]) -> f64 {
    let rest = 1.0 - through[0];
    let pairs =
        target.iter().map(|t| t * rest).zip(visibility.iter().copied()).chain([(through[0], through[1])]);
    pairs.filter(|(t, _)| *t > 0.0).map(|(t, v)| t * (t / v.max(1e-9)).ln()).sum::<f64>().max(0.0)
}

/// Shares of the visibility when each material has the greatest opacity.
fn in_front<K: Kind>(
    bundle: &Bundle<K>,
    bins: &SampleBins,
    coverage: &[f64],
    steps: &[f64],
    materials: &[usize],
    bounds: &Bounds,
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    let mut opacity = vec![0.0; coverage.len()];
    for &k in materials {
        opacity[k] = bounds.most;
    }
    Ok(visibility(bundle, bins, &opacity, steps, exec)?.visibility)
}

/// What targets are in proportion to: between the materials' shares of coverage and, to the part `of_front`, of what lies in front. By coverage alone
/// what lies inside would have to be as visible as if nothing lay before it: no opacities do that, and those that come nearest leave the outside too faint
/// to be seen.
fn proportions(in_front: &[f64], coverage: &[f64], of_front: f64) -> Vec<f64> {
    let [all_in_front, all] = [in_front, coverage].map(|of| of.iter().sum::<f64>().max(f64::MIN_POSITIVE));
    let mixed = in_front.iter().zip(coverage);
    mixed.map(|(front, own)| of_front * front / all_in_front + (1.0 - of_front) * own / all).collect()
}

/// The target of a small material is at least this share of all visibility, …
const LEAST_TARGET: f64 = 0.065;
/// … or this part of its coverage, if that is less, …
const OF_COVERAGE: f64 = 0.65;
/// … as long as these come to no more than this together; else all of them are scaled down to it.
const MOST_GUARANTEED: f64 = 0.5;

/// Shares in proportion to `proportions`, none below its least; what that takes comes from the others.
///
/// The least shares come to at most [`MOST_GUARANTEED`] together: of many materials each is promised less, so that the larger ones always
/// keep more than the smaller ones.
fn targets(coverage: &[f64], proportions: &[f64], materials: &[usize]) -> Vec<f64> {
    let mut target = vec![0.0; coverage.len()];
    let mut open: Vec<usize> = materials.iter().copied().filter(|&k| coverage[k] > 0.0).collect();
    let asked = |k: usize| LEAST_TARGET.min(OF_COVERAGE * coverage[k]);
    let all_asked: f64 = open.iter().map(|&k| asked(k)).sum();
    let scale = (MOST_GUARANTEED / all_asked).min(1.0);
    let least = |k: usize| scale * asked(k);
    let mut left = 1.0;
    // What is left exceeds the least shares of the open ones, so that never all of them are small.
    while !open.is_empty() {
        let all: f64 = open.iter().map(|&k| proportions[k]).sum();
        let (small, large): (Vec<usize>, Vec<usize>) =
            open.iter().partition(|&&k| left * proportions[k] / all < least(k));
        if small.is_empty() {
            for &k in &open {
                target[k] = left * proportions[k] / all;
            }
            break;
        }
        for &k in &small {
            target[k] = least(k);
            left -= least(k);
        }
        open = large;
    }
    target
}

/// Composites all rays once; `steps`: lengths of a step, in reference lengths.
fn visibility<K: Kind>(
    bundle: &Bundle<K>,
    bins: &SampleBins,
    opacity: &[f64],
    steps: &[f64],
    exec: &Exec,
) -> Result<Fit, Error> {
    let of_kind = |kind: usize| {
        bins.parts(kind).iter().map(|&(k, share)| f64::from(share) * opacity[usize::from(k)]).sum()
    };
    let reference: Vec<f64> = (0..bins.len()).map(of_kind).collect();
    let of_steps: Vec<Vec<f32>> = steps
        .iter()
        .map(|&step| reference.iter().map(|&opacity| over(opacity, step) as f32).collect())
        .collect();
    let empty = || Sums { visibility: vec![0; bins.len()], rays: [0; 4], background: 0 };
    let gathered = parallel::try_gather(bundle.rows.len(), &empty, &|sums, i| {
        exec.check_cancelled()?;
        let row = &bundle.rows[i];
        let step = &of_steps[row.step];
        for (ray, kinds) in row.each() {
            composite(ray, kinds.iter(), step, sums);
            if row.is_both_ways {
                composite(ray, kinds.iter().rev(), step, sums);
            }
        }
        Ok::<_, Error>(())
    })?;
    let mut all = empty();
    for sums in gathered {
        all.visibility.iter_mut().zip(&sums.visibility).for_each(|(sum, part)| *sum += part);
        all.rays.iter_mut().zip(&sums.rays).for_each(|(sum, part)| *sum += part);
        all.background += sums.background;
    }
    let [matter, faint, opaque, past] = all.rays.map(|n| n as f64);
    let mut visibility = vec![0.0; opacity.len()];
    for (kind, &sum) in all.visibility.iter().enumerate().filter(|(_, sum)| **sum > 0) {
        for &(k, share) in bins.parts(kind) {
            let part = f64::from(share) * opacity[usize::from(k)] / reference[kind];
            visibility[usize::from(k)] += sum as f64 / f64::from(PARTS) * part;
        }
    }
    // Rays that are opaque beside the matter see it too.
    let rays = (matter + opaque).max(1.0);
    for visibility in &mut visibility {
        *visibility /= rays;
    }
    Ok(Fit {
        opacity: opacity.to_vec(),
        visibility,
        visible: 0.0,
        target: Vec::new(),
        coverage: Vec::new(),
        divergence: 0.0,
        rounds: 0,
        background_opacity: (past > 0.0).then(|| all.background as f64 / f64::from(PARTS) / past),
        silhouette_difference: (matter > 0.0).then(|| (faint + opaque) / matter),
    })
}

/// Transmittance at which a ray is at its end.
const OPAQUE: f32 = 1e-3;

/// A ray from front to back: `kinds` of its samples, and the opacity of each kind over a step.
fn composite<'a, K: Kind + 'a>(ray: Ray, kinds: impl Iterator<Item = &'a K>, step: &[f32], sums: &mut Sums) {
    let mut through = 1.0_f32;
    for kind in kinds {
        let kind = kind.place();
        let taken = through * step[kind];
        sums.visibility[kind] += (taken * PARTS) as u64;
        through -= taken;
        if through < OPAQUE {
            break;
        }
    }
    let is_opaque = through < 0.5;
    sums.rays[0] += u64::from(ray.meets_matter);
    sums.rays[1] += u64::from(ray.meets_matter && !is_opaque);
    sums.rays[2] += u64::from(!ray.meets_matter && is_opaque);
    if ray.meets_data && !ray.meets_matter {
        sums.rays[3] += 1;
        sums.background += ((1.0 - through) * PARTS) as u64;
    }
}

/// Coverage: mean opacity of every class on the rays that meet matter, if it were the only one, with opacity `most`;
/// `steps`: lengths of a step, in reference lengths.
fn coverage<K: Kind>(
    bundle: &Bundle<K>,
    bins: &SampleBins,
    classes: usize,
    steps: &[f64],
    most: f64,
    exec: &Exec,
) -> Result<Vec<f64>, Error> {
    // Optical depth of a reference length.
    let depth = -(1.0 - most).max(1e-6).ln();
    let empty = || (vec![0_u64; classes], 0_u64, vec![0.0_f64; classes], Vec::<u16>::new());
    let gathered = parallel::try_gather(bundle.rows.len(), &empty, &|(covered, rays, depths, met), i| {
        exec.check_cancelled()?;
        let row = &bundle.rows[i];
        // From the back a ray is as long.
        let ways = 1 + u64::from(row.is_both_ways);
        let depth = depth * steps[row.step];
        for (_, kinds) in row.each().filter(|(ray, _)| ray.meets_matter) {
            for &(k, share) in kinds.iter().flat_map(|&kind| bins.parts(kind.place())) {
                let sum = &mut depths[usize::from(k)];
                if *sum == 0.0 {
                    met.push(k);
                }
                *sum += f64::from(share) * depth;
            }
            *rays += ways;
            for k in met.drain(..) {
                let sum = std::mem::take(&mut depths[usize::from(k)]);
                covered[usize::from(k)] += ways * ((1.0 - (-sum).exp()) * f64::from(PARTS)) as u64;
            }
        }
        Ok::<_, Error>(())
    })?;
    let rays: u64 = gathered.iter().map(|(_, rays, ..)| rays).sum();
    let of = |k: usize| gathered.iter().map(|(covered, ..)| covered[k]).sum::<u64>() as f64;
    Ok((0..classes).map(|k| of(k) / f64::from(PARTS) / rays.max(1) as f64).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(coverage: &[f64], materials: &[usize]) -> Vec<f64> {
        targets(coverage, coverage, materials)
    }

    #[test]
    fn targets_go_by_coverage_but_for_what_is_small() {
        let close = |found: &[f64], expected: &[f64]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        close(&of(&[0.0, 1.0, 0.6], &[1, 2]), &[0.0, 0.625, 0.375]);
        // 0.65 of 0.02 for the smallest; the others share the rest.
        let rest = 1.0 - 0.013;
        close(&of(&[0.02, 1.0, 0.9, 0.1], &[0, 1, 2]), &[0.013, rest / 1.9, rest * 0.9 / 1.9, 0.0]);
        close(&of(&[0.0], &[0]), &[0.0]);
        close(&of(&[0.01, 0.03], &[0, 1]), &[0.25, 0.75]);
        let many = vec![1.0; 100];
        close(&of(&many, &(0..100).collect::<Vec<_>>()), &vec![0.01; 100]);
    }

    #[test]
    fn of_many_materials_the_largest_keeps_the_largest_target() {
        for small in [0.001, 0.05, 0.3, 0.9] {
            for count in [2, 15, 16, 20, 300] {
                let mut coverage = vec![small; count];
                (coverage[0], coverage[1]) = (1.0, 0.5 * (1.0 + small));
                let found = of(&coverage, &(0..count).collect::<Vec<_>>());
                assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{count} of {small}: {found:?}");
                assert!(
                    found[0] >= found[1] && found[1] >= found[count - 1],
                    "{count} of {small}: {found:?}"
                );
                assert!(found.iter().all(|share| *share > 0.0));
            }
        }
        let mut coverage = vec![0.3; 20];
        coverage[0] = 1.0;
        assert!((of(&coverage, &(0..20).collect::<Vec<_>>())[0] - 1.0 / 6.7).abs() < 1e-12);
    }

    #[test]
    fn the_divergence_is_none_where_all_is_as_wanted() {
        assert!(divergence(&[0.25, 0.75], &[0.25, 0.75], [0.0; 2]).abs() < 1e-12);
        let far = divergence(&[0.5, 0.5], &[0.25, 0.75], [0.0; 2]);
        assert!((far - (0.5 * 2.0_f64.ln() + 0.5 * (2.0_f64 / 3.0).ln())).abs() < 1e-12);
    }
}
