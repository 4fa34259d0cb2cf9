//! Which classes are background, which are materials, and which are only the transition between two materials.

use crate::Error;
use crate::joined::joined_share;
use crate::params::ValueScale;
use crate::reduced::Reduced;
use crate::statistics::ClassStatistics;
use crate::structure::Structure;
use ivd_core::{Modality, NO_DATA, Volume};

pub(crate) use ivd_core::ClassRole as Role;

/// Share of the background's voxels, at least, that are joined to the volume's outermost layer.
const JOINED: f64 = 0.9;

/// Share of the voxels with data, at least, that have label 0 where a person chose the parts. Fewer are strays of a segmentation.
const CHOSEN: f64 = 0.01;

/// Hounsfield value at which half of a voxel is gas: the scale is linear in density, with air at −1000 and water at 0.
pub(crate) const HALF_GAS: f64 = -500.0;
/// Hounsfield value up to which there is air alone, whatever a class says.
pub(crate) const AIR: f64 = -900.0;

/// Whether values look like Hounsfield units: they reach from air, at most −900, to beyond water, at least 100, and lie within what
/// scanners write. Magnetic resonance has no negative values.
fn looks_like_hounsfield([low, high]: [f64; 2]) -> bool {
    (-5000.0..=AIR).contains(&low) && (100.0..=70_000.0).contains(&high)
}

/// Whether a volume's values are taken as Hounsfield units; `values`: what is said of them.
pub fn is_computed_tomography(volume: &Volume, values: ValueScale) -> bool {
    volume.range().is_some_and(|range| are_hounsfield(values, volume.modality(), range))
}

/// Usual for the trunk in computed tomography (HU): 400 wide about 40. Bone is white in it, lung black.
const SOFT_TISSUE: [f64; 2] = [-160.0, 240.0];
/// Share of the voxels looked at, at least, that are soft tissue where it is looked for.
const SOFT: f64 = 0.1;
/// Voxels looked at, about.
const LOOKED_AT: usize = 1 << 17;

/// Values that are black and white in slices where soft tissue is told apart in them: of computed tomography that shows some.
pub fn soft_tissue_window(volume: &Volume) -> Option<[f64; 2]> {
    if !is_computed_tomography(volume, ValueScale::Auto) {
        return None;
    }
    let [low, high] = SOFT_TISSUE;
    let (mut soft, mut count) = (0_usize, 0_usize);
    for value in volume.sampled(LOOKED_AT) {
        soft += usize::from((low..high).contains(&value));
        count += 1;
    }
    (soft as f64 >= SOFT * count as f64).then_some(SOFT_TISSUE)
}

/// Hounsfield values up to which something is for the most part what it is called. Fat lies about −100, water at 0, muscle and organs up to 80, and up
/// to 130 with some contrast medium; what lies between gas and fat is both in part.
const MATTER: [(f64, &str); 5] =
    [(AIR, "air"), (HALF_GAS, "lung or gas"), (-150.0, "partly gas"), (-30.0, "fat"), (130.0, "soft tissue")];

/// What matter of a Hounsfield value is for the most part.
pub fn matter_of_hounsfield(value: f64) -> &'static str {
    MATTER.iter().find(|(most, _)| value <= *most).map_or("bone or contrast medium", |(_, matter)| matter)
}

/// Whether values are taken as Hounsfield units.
pub(crate) fn are_hounsfield(values: ValueScale, modality: Option<Modality>, range: [f64; 2]) -> bool {
    match values {
        ValueScale::Auto => modality != Some(Modality::MagneticResonance) && looks_like_hounsfield(range),
        ValueScale::Hounsfield => true,
        ValueScale::Plain => false,
    }
}

/// Whether the labels are a person's choice of parts: label 0 on voxels with data has at least [`CHOSEN`] of the voxels.
pub(crate) fn are_chosen(classes: &[ClassStatistics]) -> bool {
    let all: u64 = classes.iter().map(|class| class.voxels).sum();
    let unlabelled: u64 = classes.iter().filter(|class| class.id == NO_DATA).map(|class| class.voxels).sum();
    unlabelled > 0 && unlabelled as f64 >= CHOSEN * all as f64
}

/// The roles of `classes`, which are in the order of their means.
///
/// Label 0 on voxels with data is background. Where the labels are a person's choice of parts, each of the others is a material, but for gas by its
/// Hounsfield value.
///
/// - `apart`: finds the structure of voxels so far apart that noise is independent in them, where it isn't in neighbours; it is asked for where it tells something.
pub(crate) fn roles(
    classes: &[ClassStatistics],
    structure: &Structure,
    apart: impl FnOnce() -> Result<Option<Structure>, Error>,
    reduced: &Reduced<'_>,
    hounsfield: bool,
) -> Result<Vec<Role>, Error> {
    let is_chosen = are_chosen(classes);
    let mut background: Vec<bool> = if hounsfield {
        classes.iter().map(|class| class.mean <= HALF_GAS).collect()
    } else if is_chosen {
        vec![false; classes.len()]
    } else {
        let is_joined = |outside: &[bool]| joined_share(reduced, |class| outside[class]) >= JOINED;
        by_border(classes, [apart()?.as_ref(), Some(structure)], reduced.sides(), is_joined)
    };
    keep_one(&mut background, |class| classes[class].id != NO_DATA);
    if !is_chosen {
        merge_noise(&mut background, structure);
    }
    for (is, class) in background.iter_mut().zip(classes) {
        *is |= class.id == NO_DATA;
    }
    let transition = if is_chosen { vec![false; classes.len()] } else { transitions(&background, structure) };
    let role = |(background, transition)| match (background, transition) {
        (true, _) => Role::Background,
        (_, true) => Role::Transition,
        _ => Role::Material,
    };
    Ok(background.into_iter().zip(transition).map(role).collect())
}

/// Some class is always a material: where all that have a label would be background, none is.
fn keep_one(background: &mut [bool], has_label: impl Fn(usize) -> bool) {
    if (0..background.len()).all(|class| background[class] || !has_label(class)) {
        background.fill(false);
    }
}

/// So many classes, those with the largest shares of the sides, may be what lies outside.
const MOST_OUTSIDE: usize = 16;

/// The class with the largest share of the volume's sides, with those that noise splits it into, if it is joined to them, and every class on its far side
/// from the bulk of the rest. Each axis counts as much as another: of a thin stack of slices, which cut through the body, most sides lie across one.
///
/// - `structures`: by the first of these that tells something noise is looked for.
/// - `sides`: voxels on those across each axis.
fn by_border(
    classes: &[ClassStatistics],
    structures: [Option<&Structure>; 2],
    sides: [u64; 3],
    is_joined: impl Fn(&[bool]) -> bool,
) -> Vec<bool> {
    let nothing = vec![false; classes.len()];
    let shares = shares_of_sides(classes, sides);
    let mut firsts: Vec<usize> = (0..classes.len()).filter(|&class| shares[class] > 0.0).collect();
    firsts.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
    firsts.truncate(MOST_OUTSIDE);
    let share_of = |outside: &[bool]| -> f64 {
        outside.iter().zip(&shares).filter(|(is, _)| **is).map(|(_, share)| share).sum()
    };
    let largest = |structure: &Structure| {
        let with_noise = firsts.iter().map(|&first| (first, mixture(structure, first)));
        // Of several of one share the first.
        with_noise.rev().max_by(|a, b| share_of(&a.1).total_cmp(&share_of(&b.1)))
    };
    let is_all = |outside: &[bool]| outside.iter().all(|is| *is);
    let found: Vec<_> = structures.into_iter().flatten().filter_map(largest).collect();
    let Some((first, mut outside)) =
        found.iter().find(|(_, outside)| !is_all(outside)).or(found.last()).cloned()
    else {
        return nothing;
    };
    let mut alone = nothing.clone();
    alone[first] = true;
    // Where all would be one noise, what is seen in it is told apart by its value alone.
    if is_all(&outside) {
        outside.clone_from(&alone);
    }
    if classes.len() < 2 || !(is_joined(&outside) || is_joined(&alone)) {
        return nothing;
    }
    let mean_of = |is_outside: bool| {
        let chosen =
            || classes.iter().zip(&outside).filter(|(_, is)| **is == is_outside).map(|(class, _)| class);
        let voxels: f64 = chosen().map(|class| class.voxels as f64).sum();
        chosen().map(|class| class.mean * (class.voxels as f64 / voxels)).sum::<f64>()
    };
    let is_above = mean_of(false) > mean_of(true);
    let is_beyond = |class: usize| if is_above { class < first } else { class > first };
    (0..classes.len()).map(|class| outside[class] || is_beyond(class)).collect()
}

/// The share of each class of the volume's sides: of those across each axis, summed.
///
/// - `sides`: voxels on those across each axis.
fn shares_of_sides(classes: &[ClassStatistics], sides: [u64; 3]) -> Vec<f64> {
    let across = || (0..3).filter(|&a| sides[a] > 0);
    let share = |class: &ClassStatistics| across().map(|a| class.on_sides[a] as f64 / sides[a] as f64).sum();
    classes.iter().map(share).collect()
}

/// At least this of what it would be if they lay among each other by chance makes classes a mixture.
const MIXED: f64 = 0.25;

/// A class with those that lie among its voxels, and theirs, as by chance, at steps that noise makes: noise has split them. If voxels were of a class or of
/// the others at random, the faces between them, squared, would be four times the product of those within each. The step is that to the one of the others
/// which is nearest in value, or to all of them if that is less.
fn mixture(structure: &Structure, first: usize) -> Vec<bool> {
    let count = structure.classes();
    let mut chosen = vec![false; count];
    // Faces of each class on those that are chosen, and faces among these.
    let (mut between, mut among) = (vec![0_u64; count], 0_u64);
    let mut next = Some(first);
    while let Some(added) = next {
        chosen[added] = true;
        among += between[added] + structure.faces(added, added);
        (0..count)
            .filter(|&class| class != added)
            .for_each(|class| between[class] += structure.faces(class, added));
        next = (0..count).find(|&class| {
            let own = structure.faces(class, class);
            let by_chance = 4.0 * own as f64 * among as f64;
            !chosen[class]
                && between[class] > 0
                && (between[class] as f64).powi(2) >= MIXED * by_chance
                && least_step(structure, &chosen, class) <= NOISE_STEP * structure.noise
        });
    }
    chosen
}

/// The mean step from a class to those that are chosen, or to the one of them that is nearest in the order of means, whichever is less.
fn least_step(structure: &Structure, chosen: &[bool], class: usize) -> f64 {
    let below = (0..class).rev().find(|&b| chosen[b]);
    let above = (class + 1..chosen.len()).find(|&b| chosen[b]);
    let nearest = [below, above].into_iter().flatten().map(|b| structure.step(class, |other| other == b));
    nearest.fold(structure.step(class, |b| chosen[b]), f64::min)
}

/// A class whose mean step to the background is at most so many deviations of the noise may be a split of the background …
const NOISE_STEP: f64 = 3.0;
/// … if at least this share of its faces lies on the background. Measured: a split of a tooth's air 0.52 at 2.1 deviations; what must not
/// merge: haze round a tree 0.28 at 3.3, cerebrospinal fluid 0.10 at 2.4.
const NOISE_FACES: f64 = 0.4;
/// … and at most this share on anything but itself and the background. That split: 0.06; cerebrospinal fluid and bone of the noisy head phantom,
/// which are one class at K = 4, lie on brain and skin too.
const MATTER_FACES: f64 = 0.1;

/// Adds classes that noise split off the background.
fn merge_noise(background: &mut [bool], structure: &Structure) {
    let is_split = |background: &[bool], class: usize| {
        let on_background: u64 =
            (0..background.len()).filter(|&b| background[b]).map(|b| structure.faces(class, b)).sum();
        let all = structure.all_faces(class);
        let on_matter = all - structure.faces(class, class) - on_background;
        let step = structure.step(class, |b| background[b]);
        on_background as f64 >= NOISE_FACES * all as f64
            && on_matter as f64 <= MATTER_FACES * all as f64
            && step <= NOISE_STEP * structure.noise
    };
    let left = |background: &[bool]| background.iter().filter(|&&is| !is).count();
    while left(background) > 1
        && let Some(class) = (0..background.len()).find(|&c| !background[c] && is_split(background, c))
    {
        background[class] = true;
    }
}

/// A transition has fewer than this share of its faces on itself, …
const OWN_FACES: f64 = 0.5;
/// … a median slope [deviations of the noise over a voxel's length] of at least this, …
const STEEP: f64 = 8.0;
/// … and at least this share of its faces on lower and on higher classes each. A face between two voxels of a class counts once. The last
/// leaves thin classes at an end of the value axis, such as bone in a coarse scan.
const EACH_SIDE: f64 = 0.15;

/// Classes that are the way from one class to another.
fn transitions(background: &[bool], structure: &Structure) -> Vec<bool> {
    let is_transition = |class: usize| {
        let all = structure.all_faces(class) as f64;
        let share = |on: &mut dyn Iterator<Item = usize>| {
            on.map(|b| structure.faces(class, b)).sum::<u64>() as f64 / all
        };
        !background[class]
            && all > 0.0
            && share(&mut std::iter::once(class)) < OWN_FACES
            && structure.slope[class] >= STEEP * structure.noise
            && share(&mut (0..class)) >= EACH_SIDE
            && share(&mut (class + 1..background.len())) >= EACH_SIDE
    };
    // A class of one value everywhere has no slope at all, whatever the noise.
    let found: Vec<bool> =
        (0..background.len()).map(|c| is_transition(c) && structure.slope[c] > 0.0).collect();
    let materials = (0..background.len()).any(|c| !background[c] && !found[c]);
    if materials { found } else { vec![false; background.len()] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn class(mean: f64, voxels: u64, on_sides: u64) -> ClassStatistics {
        ClassStatistics { id: 1, voxels, mean, sd: 1.0, border_strength: 1.0, on_sides: [on_sides; 3] }
    }

    #[test]
    fn matter_is_named_by_its_hounsfield_value() {
        for (most, matter) in MATTER {
            assert_eq!(matter_of_hounsfield(most), matter);
            assert_ne!(matter_of_hounsfield(most + 0.1), matter);
        }
        assert_eq!(
            [-1000.0, -100.0, 0.0, 700.0].map(matter_of_hounsfield),
            ["air", "fat", "soft tissue", "bone or contrast medium"]
        );
    }

    #[test]
    fn the_outside_and_what_lies_beyond_it_are_background() {
        // An artefact of undershoot below the air, as in a scan of a tooth.
        let tooth =
            [class(139.0, 10, 0), class(400.0, 1000, 500), class(800.0, 200, 0), class(1200.0, 100, 0)];
        // Each of the classes apart from all others.
        let apart =
            |n: usize| Structure::of_faces(n, (0..n * n).map(|i| u64::from(i % (n + 1) == 0)).collect());
        let sides = [600; 3];
        assert_eq!(by_border(&tooth, [None, Some(&apart(4))], sides, |_| true), [true, true, false, false]);
        assert_eq!(
            by_border(&tooth, [None, Some(&apart(4))], sides, |_| false),
            [false; 4],
            "it isn't joined to the outside"
        );
        let inverted = [class(10.0, 300, 5), class(90.0, 900, 500), class(99.0, 5, 0)];
        assert_eq!(by_border(&inverted, [None, Some(&apart(3))], sides, |_| true), [false, true, true]);
        assert_eq!(
            by_border(&tooth[1..2], [None, Some(&apart(1))], sides, |_| true),
            [false],
            "one class alone is seen"
        );
        // Few slices through a body: most of the sides are its own, across one axis.
        let mut slices = [class(8.0, 1000, 0), class(90.0, 900, 0), class(140.0, 100, 0)];
        (slices[0].on_sides, slices[1].on_sides, slices[2].on_sides) =
            ([50, 50, 400], [0, 0, 600], [0, 0, 100]);
        assert_eq!(
            by_border(&slices, [None, Some(&apart(3))], [50, 50, 1100], |_| true),
            [true, false, false]
        );
    }

    #[test]
    fn classes_that_noise_has_split_are_told_by_their_faces_and_steps() {
        // Shares 1/2, 1/4 and 1/4 of 10,000 faces; the third apart from the first two, or among them.
        let faces = |among: bool| {
            let third = if among { [2500, 1250] } else { [3, 3] };
            vec![2500, 2500, third[0], 2500, 625, third[1], third[0], third[1], 625]
        };
        let with = |faces, noise| {
            let mut structure = Structure::of_faces(3, faces);
            structure.noise = noise;
            structure
        };
        assert_eq!(mixture(&with(faces(true), 1.0), 0), [true; 3]);
        assert_eq!(mixture(&with(faces(false), 1.0), 1), [true, true, false]);
        // Steps of 4 noises to all; of 1 to the one that is nearest in value.
        let mut far = with(faces(true), 1.0);
        far.set_step(0, 1, 1);
        far.set_step(0, 2, 9);
        far.set_step(1, 2, 4);
        assert_eq!(mixture(&far, 0), [true, true, false]);
        let mut near = far;
        near.set_step(1, 2, 1);
        assert_eq!(mixture(&near, 0), [true; 3]);
        // Specks lie among what is round them; what touches nothing doesn't.
        assert_eq!(mixture(&with(vec![2500, 9, 0, 9, 0, 0, 0, 0, 50], 1.0), 0), [true, true, false]);
        // Where all is one mixture the class with most of the sides is the outside.
        let classes = [class(0.0, 100, 80), class(1.0, 50, 20), class(2.0, 50, 10)];
        assert_eq!(
            by_border(&classes, [None, Some(&with(faces(true), 1.0))], [100; 3], |_| true),
            [true, false, false]
        );
        let mut all = vec![true, true];
        keep_one(&mut all, |_| true);
        assert_eq!(all, [false, false]);
        let mut rest = vec![true, false];
        keep_one(&mut rest, |class| class == 0);
        assert_eq!(rest, [false, false], "without a label it can't be the material");
    }

    #[test]
    fn a_split_of_the_background_needs_small_steps_and_many_faces_on_it() {
        let faces =
            |on_air, own, on_matter| vec![1000, on_air, 0, on_air, own, on_matter, 0, on_matter, 1000];
        let with = |faces, noise| {
            let mut structure = Structure::of_faces(3, faces);
            structure.noise = noise;
            structure
        };
        let merged = |structure: &Structure| {
            let mut background = vec![true, false, false];
            merge_noise(&mut background, structure);
            background[1]
        };
        // Steps are 0 here: at most three times any noise.
        assert!(merged(&with(faces(52, 42, 6), 1.0)));
        assert!(!merged(&with(faces(28, 66, 6), 1.0)), "too much of itself");
        assert!(!merged(&with(faces(52, 30, 18), 1.0)), "too much on the matter");
    }

    #[test]
    fn a_steep_thin_class_between_two_others_is_no_material() {
        let faces = vec![1000, 40, 0, 40, 20, 40, 0, 40, 1000];
        let structure = |slope: f64| {
            let mut structure = Structure::of_faces(3, faces.clone());
            (structure.noise, structure.slope[1]) = (1.0, slope);
            structure
        };
        let background = [true, false, false];
        assert_eq!(transitions(&background, &structure(9.0)), [false, true, false]);
        assert_eq!(transitions(&background, &structure(7.0)), [false; 3]);
        assert_eq!(
            transitions(&[true, false, true], &structure(9.0)),
            [false; 3],
            "it is all there is to see"
        );
    }

    #[test]
    fn hounsfield_units_are_known_by_their_range() {
        assert!(looks_like_hounsfield([-1024.0, 3071.0]) && looks_like_hounsfield([-3024.0, 1500.0]));
        for plain in [[0.0, 4095.0], [-1024.0, 20.0], [-32_768.0, 32_767.0], [-800.0, 1000.0]] {
            assert!(!looks_like_hounsfield(plain), "{plain:?}");
        }
    }

    /// Noise, even between −½ and ½.
    fn even() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1 << 24) as f64 - 0.5
        }
    }

    /// Roles of values of `n` voxels along each axis that `edges` divide into classes; held in at most `most` samples along an axis.
    fn roles_of(n: usize, values: Vec<f64>, edges: &[f64], most: usize) -> Vec<Role> {
        use ivd_core::{Exec, Grid, Labels, Volume, Voxels};
        let grid = Grid::with_spacing([n; 3], [64.0 / n as f64; 3]).unwrap();
        let label = |&value: &f64| edges.iter().filter(|&&edge| value > edge).count() as u16 + 1;
        let ids: Vec<u16> = values.iter().map(label).collect();
        let volume = Volume::new(grid.clone(), Voxels::from(values)).unwrap();
        let labels = Labels::new(grid, ids.into(), vec![]).unwrap();
        let exec = Exec::default();
        let classes = crate::statistics::measure(&volume, &labels, &exec).unwrap();
        let mut rank = vec![0; 1 << 16];
        (0..classes.len()).for_each(|i| rank[usize::from(classes[i].id)] = i as u16);
        let range = volume.range().unwrap();
        let reduced = Reduced::new(&volume, &labels, rank, range, most, &exec).unwrap();
        let structure = crate::structure::measure(&reduced, classes.len(), 0.0, &exec).unwrap();
        let apart = || crate::structure::apart(&reduced, &structure, 0.0, &exec);
        roles(&classes, &structure, apart, &reduced, false).unwrap()
    }

    /// How far each of `n` voxels along each axis lies from the middle (voxels), x fastest.
    fn far(n: usize) -> impl Iterator<Item = f64> {
        let off = move |at: usize| (at as f64 + 0.5 - n as f64 / 2.0).powi(2);
        (0..n * n * n).map(move |i| (off(i % n) + off(i / n % n) + off(i / n / n)).sqrt())
    }

    /// Roles of a phantom of `n` voxels along each axis over the same extent: a ball with a core, in noisy air, edges over a voxel's length; held
    /// in at most `most` samples along an axis.
    fn phantom(n: usize, most: usize) -> Vec<Role> {
        let (mut noise, step) = (even(), |at: f64| at.clamp(0.0, 1.0));
        let (ball, core) = (0.36 * n as f64, 0.18 * n as f64);
        let value =
            |far: f64| 100.0 * step(ball - far + 0.5) + 100.0 * step(core - far + 0.5) + 6.0 * noise();
        roles_of(n, far(n).map(value).collect(), &[25.0, 75.0, 125.0, 175.0], most)
    }

    /// Means of a voxel and its neighbours along each axis, `rounds` times, of deviation 1.
    fn grains(n: usize, rounds: usize) -> Vec<f64> {
        let mut noise = even();
        let mut values: Vec<f64> = (0..n * n * n).map(|_| noise()).collect();
        for stride in [1, n, n * n].repeat(rounds) {
            let at = |i: usize| values[i % values.len()];
            let all = values.len();
            let mean = |i: usize| (at(i + all - stride) + at(i) + at(i + stride)) / 3.0;
            values = (0..all).map(mean).collect();
        }
        let deviation = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        values.into_iter().map(|value| value / deviation).collect()
    }

    #[test]
    fn noise_is_outside_however_large_its_grains_and_however_it_is_split() {
        use Role::{Background, Material};
        let n = 96;
        for rounds in 0..=2 {
            let noise = grains(n, rounds);
            let ball = far(n).map(|far| 60.0 + 100.0 * (0.3 * n as f64 - far + 0.5).clamp(0.0, 1.0));
            let values: Vec<f64> = ball.zip(&noise).map(|(value, noise)| value + 15.0 * noise).collect();
            let edges = [40.0, 55.0, 68.0, 110.0];
            let wanted = [Background, Background, Background, Background, Material];
            assert_eq!(roles_of(n, values, &edges, n), wanted, "means of {rounds} rounds");
        }
    }

    #[test]
    fn a_voxel_more_than_are_looked_at_changes_no_role() {
        use Role::{Background, Material, Transition};
        let whole = phantom(64, 64);
        assert_eq!(whole, [Background, Transition, Material, Transition, Material]);
        for (n, most) in [(65, 64), (66, 64), (64, 32), (64, 63), (64, 33)] {
            assert_eq!(phantom(n, most), whole, "{n} voxels in {most} samples");
        }
    }
}
