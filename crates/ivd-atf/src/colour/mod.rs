//! Colours of classes.

mod blindness;
mod difference;
mod palettes;
mod slots;

use std::collections::HashMap;

use crate::params::Palette;
use crate::reduced::Reduced;
use crate::roles::Role;
use crate::statistics::ClassStatistics;
use crate::structure::Structure;
use ivd_core::{Modality, NO_DATA};

pub(crate) use palettes::safe;

/// Colour of the class of rank `rank` in the order of means, where no transfer function tells: linear RGB in 0…1.
pub fn class_colour(rank: usize) -> [f32; 3] {
    safe(rank)
}

/// Two materials that touch, and how different their colours look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair {
    pub(crate) classes: [usize; 2],
    /// Least ΔE₀₀ over normal vision and the three colour blindnesses.
    pub(crate) difference: f64,
}

/// The palette that `wanted` means.
///
/// - `are_alike`: whether classes are parts that a person chose, and values don't tell them apart.
pub(crate) fn chosen(
    wanted: Palette,
    hounsfield: bool,
    modality: Option<Modality>,
    are_alike: bool,
) -> Palette {
    match wanted {
        Palette::Auto if are_alike => Palette::Safe,
        // Magnetic resonance is made of bodies, tomography with other numbers than Hounsfield's of anything.
        Palette::Auto if hounsfield || modality == Some(Modality::MagneticResonance) => Palette::Tissue,
        Palette::Auto => Palette::Safe,
        other => other,
    }
}

/// What colours go by.
pub(crate) struct Coloured<'a> {
    pub(crate) classes: &'a [ClassStatistics],
    pub(crate) roles: &'a [Role],
    pub(crate) structure: &'a Structure,
    pub(crate) reduced: &'a Reduced<'a>,
    /// Pairs of materials that touch: [`touching`].
    pub(crate) touching: &'a [[usize; 2]],
    pub(crate) palette: Palette,
    pub(crate) hounsfield: bool,
    /// Whether values alone tell all classes apart.
    pub(crate) by_value: bool,
}

/// Colours of all classes, linear RGB in 0…1; black for the background and for transitions, which have none of their own.
pub(crate) fn colours(of: &Coloured<'_>) -> Vec<[f32; 3]> {
    let materials = || (0..of.classes.len()).filter(|&class| of.roles[class] == Role::Material);
    let mut rgb = vec![[0.0; 3]; of.classes.len()];
    if of.palette == Palette::Safe || of.palette == Palette::Auto {
        let slots = slots(of);
        let places = places(&slots, of.roles);
        materials().for_each(|c| rgb[c] = safe(places[c]));
        return rgb;
    }
    let [low, high] = spread(of.structure, of.reduced);
    let share = |value: f64| ((value - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let colour = |class: &ClassStatistics| match of.palette {
        Palette::Tissue if of.hounsfield => palettes::of_hounsfield(class.mean),
        Palette::Tissue => palettes::of_share(share(class.mean)),
        _ => palettes::of_thesis(share(class.mean)),
    };
    let mut lab: Vec<[f64; 3]> = of.classes.iter().map(colour).collect();
    move_apart(&mut lab, of.touching);
    materials().for_each(|c| rgb[c] = palettes::linear(lab[c]));
    rgb
}

/// The one colour of a volume that is split at a value: by the palette, that of the value at which it is split.
pub(crate) fn of_isovalue(palette: Palette, hounsfield: bool, iso: f64, range: [f64; 2]) -> [f32; 3] {
    let share = ((iso - range[0]) / (range[1] - range[0]).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    match palette {
        Palette::Auto | Palette::Safe => safe(0),
        Palette::Tissue if hounsfield => palettes::linear(palettes::of_hounsfield(iso)),
        Palette::Tissue => palettes::linear(palettes::of_share(share)),
        Palette::Thesis => palettes::linear(palettes::of_thesis(share)),
    }
}

/// Every class's own slot: by value one that goes by how the values divide, else the place of the label among the labels.
fn slots(of: &Coloured<'_>) -> Vec<usize> {
    if of.by_value {
        return slots::slots(&of.structure.histogram, of.classes.len());
    }
    let mut ids: Vec<u16> = of.classes.iter().map(|class| class.id).filter(|id| *id != NO_DATA).collect();
    ids.sort_unstable();
    let slot = |class: &ClassStatistics| ids.binary_search(&class.id).unwrap_or(ids.len());
    of.classes.iter().map(slot).collect()
}

/// Places of the materials in a palette of distinct colours: each its slot, whatever the others are; but one whose slot lies beyond the colours
/// that so many materials need takes the lowest of these that no material has. Other classes' places mean nothing.
fn places(slots: &[usize], roles: &[Role]) -> Vec<usize> {
    let mut materials: Vec<usize> = (0..slots.len()).filter(|&c| roles[c] == Role::Material).collect();
    materials.sort_by_key(|&c| slots[c]);
    let enough = materials.len().next_multiple_of(palettes::DISTINCT);
    let is_taken = |place: &usize| materials.iter().any(|&c| slots[c] == *place);
    let mut free = (0..enough).filter(|place| !is_taken(place));
    let mut places = slots.to_vec();
    for &class in materials.iter().filter(|&&c| slots[c] >= enough) {
        places[class] = free.next().expect("there are as many places as materials");
    }
    places
}

/// Share of the voxels below and above the range that colours by value are spread over.
const TAIL: f64 = 0.002;

/// Values between which nearly all voxels lie.
fn spread(structure: &Structure, reduced: &Reduced<'_>) -> [f64; 2] {
    let all: u64 = structure.histogram.iter().sum();
    let bins = structure.histogram.len();
    let value =
        |bin: usize| reduced.real((bin as f64 + 0.5) / bins as f64 * f64::from(crate::reduced::MAX_LEVEL));
    let tail = |from_top: bool| {
        let mut counted = 0;
        let is_beyond = |i: &usize| {
            counted += structure.histogram[if from_top { bins - 1 - i } else { *i }];
            counted as f64 > TAIL * all as f64
        };
        let i = (0..bins).find(is_beyond).unwrap_or(0);
        value(if from_top { bins - 1 - i } else { i })
    };
    [tail(false), tail(true)]
}

/// Two classes touch if at least this share of the faces that one of them has on others lies between them.
const TOUCHES: f64 = 0.01;
/// Most lower and most higher materials that touch each other through a transition: those with most faces on it.
const MOST_THROUGH: usize = 8;

/// Pairs of materials that touch, through a transition too, the lower first.
pub(crate) fn touching(roles: &[Role], structure: &Structure) -> Vec<[usize; 2]> {
    let n = roles.len();
    let foreign: Vec<u64> = (0..n).map(|c| structure.all_faces(c) - structure.faces(c, c)).collect();
    let materials: Vec<usize> = (0..n).filter(|&c| roles[c] == Role::Material).collect();
    let mut through = HashMap::new();
    for t in (0..n).filter(|&c| roles[c] == Role::Transition) {
        let most_on = |mut on: Vec<usize>| {
            on.sort_by_key(|&c| std::cmp::Reverse(structure.faces(c, t)));
            on.truncate(MOST_THROUGH);
            on
        };
        let (lower, higher): (Vec<usize>, Vec<usize>) =
            materials.iter().filter(|&&c| structure.faces(c, t) > 0).partition(|&&c| c < t);
        let higher = most_on(higher);
        for a in most_on(lower) {
            for &b in &higher {
                let faces = structure.faces(a, t).min(structure.faces(t, b));
                let most = through.entry([a, b]).or_insert(0);
                *most = faces.max(*most);
            }
        }
    }
    let mut pairs = Vec::new();
    for (i, &a) in materials.iter().enumerate() {
        for &b in &materials[i + 1..] {
            let least = TOUCHES * foreign[a].min(foreign[b]) as f64;
            let through = through.get(&[a, b]).copied().unwrap_or(0);
            if structure.faces(a, b).max(through) as f64 > least {
                pairs.push([a, b]);
            }
        }
    }
    pairs
}

/// Least ΔE₀₀ that colours by value are moved apart to, where their materials touch and lightness has room for it.
const APART: f64 = 8.0;
/// Most steps of lightness by which they are moved.
const MOST_STEPS: usize = 60;
/// Most touching pairs that are moved apart: where there are more, their colours can't all differ.
const MOST_MOVED: usize = 2048;

/// Makes the darker of two materials that look alike darker and the lighter one lighter, step by step, [`MOST_STEPS`] at most: where lightness
/// ends before that, and where one class has to differ from many, some stay nearer.
fn move_apart(lab: &mut [[f64; 3]], pairs: &[[usize; 2]]) {
    if pairs.len() > MOST_MOVED {
        return;
    }
    for _ in 0..MOST_STEPS {
        let mut moved = false;
        for &[a, b] in pairs {
            let seen = |c: [f64; 3]| difference::lab(difference::from_lab(c));
            if difference::ciede2000(seen(lab[a]), seen(lab[b])) < APART + 0.2 {
                let [dark, light] = if lab[a][0] <= lab[b][0] { [a, b] } else { [b, a] };
                lab[dark][0] = (lab[dark][0] - 0.5).max(8.0);
                lab[light][0] = (lab[light][0] + 0.5).min(99.0);
                moved = true;
            }
        }
        if !moved {
            break;
        }
    }
}

/// ΔE₀₀ below which a pair is worth reporting.
const CLOSE: f64 = 20.0;

/// Pairs of touching materials whose colours are near, nearest first.
pub(crate) fn close_pairs(touching: &[[usize; 2]], rgb: &[[f32; 3]]) -> Vec<Pair> {
    let seen: Vec<_> = rgb.iter().map(|&rgb| blindness::seen(rgb)).collect();
    let pair = |&classes: &[usize; 2]| {
        let difference = blindness::least_difference(&seen[classes[0]], &seen[classes[1]]);
        Pair { classes, difference }
    };
    let mut pairs: Vec<Pair> = touching.iter().map(pair).collect();
    pairs.retain(|pair| pair.difference < CLOSE);
    pairs.sort_by(|a, b| a.difference.total_cmp(&b.difference).then(a.classes.cmp(&b.classes)));
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_materials_are_moved_apart_in_lightness() {
        let mut lab = vec![[50.0, 20.0, 10.0], [51.0, 20.0, 10.0], [50.5, 20.0, 10.0]];
        move_apart(&mut lab, &[[0, 1]]);
        assert!(difference::ciede2000(lab[0], lab[1]) >= APART);
        assert!(lab[0][0] < lab[1][0]);
        assert_eq!(lab[2], [50.5, 20.0, 10.0], "what touches nothing stays");
    }

    #[test]
    fn classes_touch_through_a_transition() {
        let faces = vec![900, 60, 0, 60, 10, 60, 0, 60, 900];
        let structure = Structure::of_faces(3, faces);
        assert_eq!(touching(&[Role::Material, Role::Transition, Role::Material], &structure), [[0, 2]]);
        assert_eq!(touching(&[Role::Material; 3], &structure), [[0, 1], [1, 2]]);
    }

    #[test]
    fn a_change_of_the_background_moves_no_colour() {
        use Role::{Background, Material};
        let slots = [0, 2, 1, 3];
        let places_of = |roles: [Role; 4]| places(&slots, &roles);
        let one = places_of([Background, Material, Material, Material]);
        let two = places_of([Background, Background, Material, Material]);
        assert_eq!((one[2], one[3]), (two[2], two[3]));
    }

    #[test]
    fn no_more_than_eight_materials_need_no_dimmed_colour() {
        use Role::{Background, Material, Transition};
        // Ten classes, six of them materials, two of these beyond the eight colours.
        let slots = [0, 4, 1, 9, 2, 5, 3, 8, 6, 7];
        let mut roles = [Material; 10];
        (roles[0], roles[1], roles[2], roles[4]) = (Background, Transition, Background, Transition);
        let found = places(&slots, &roles);
        let of: Vec<usize> = (0..10).filter(|&c| roles[c] == Material).map(|c| found[c]).collect();
        assert_eq!(of, [1, 5, 3, 0, 6, 7]);
    }

    #[test]
    fn values_and_modality_choose_the_palette() {
        let [ct, mr] = [Modality::ComputedTomography, Modality::MagneticResonance].map(Some);
        assert_eq!(chosen(Palette::Auto, true, None, false), Palette::Tissue);
        assert_eq!(chosen(Palette::Auto, false, None, false), Palette::Safe);
        assert_eq!(chosen(Palette::Auto, false, mr, false), Palette::Tissue);
        assert_eq!(chosen(Palette::Auto, false, ct, false), Palette::Safe);
        assert_eq!(chosen(Palette::Thesis, true, mr, true), Palette::Thesis);
        // Organs are told apart.
        assert_eq!(chosen(Palette::Auto, true, ct, true), Palette::Safe);
        assert_eq!(chosen(Palette::Tissue, true, ct, true), Palette::Tissue);
    }
}
