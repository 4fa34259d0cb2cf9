//! Colours of classes.

mod blindness;
mod difference;
mod palettes;
mod slots;

use crate::params::Palette;
use crate::reduced::Reduced;
use crate::roles::Role;
use crate::statistics::ClassStatistics;
use crate::structure::Structure;
use ivd_core::NO_DATA;

pub(crate) use palettes::safe;

/// Least ΔE₀₀ that colours by value are moved apart to, where their materials touch.
const APART: f64 = 8.0;
/// ΔE₀₀ below which a pair is worth telling of.
const CLOSE: f64 = 20.0;
/// Two classes touch if at least this share of the faces that one of them has on others lies between them.
const TOUCHES: f64 = 0.01;
/// Share of the voxels below and above the range that colours by value are spread over.
const TAIL: f64 = 0.002;

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
pub(crate) fn chosen(wanted: Palette, hounsfield: bool) -> Palette {
    match wanted {
        Palette::Auto if hounsfield => Palette::Tissue,
        Palette::Auto => Palette::Safe,
        other => other,
    }
}

/// Colours of all classes, linear RGB in 0…1; black for the background and for transitions, which have none of their own.
pub(crate) fn colours(
    classes: &[ClassStatistics],
    roles: &[Role],
    structure: &Structure,
    reduced: &Reduced<'_>,
    palette: Palette,
    hounsfield: bool,
) -> Vec<[f32; 3]> {
    let material = |class: usize| roles[class] == Role::Material;
    let mut rgb = vec![[0.0; 3]; classes.len()];
    if palette == Palette::Safe || palette == Palette::Auto {
        let places = places(classes, roles, structure);
        (0..classes.len()).filter(|&c| material(c)).for_each(|c| rgb[c] = safe(places[c]));
        return rgb;
    }
    let [low, high] = spread(structure, reduced);
    let share = |value: f64| ((value - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let mut lab: Vec<[f64; 3]> = classes
        .iter()
        .map(|class| match palette {
            Palette::Tissue if hounsfield => palettes::of_hounsfield(class.mean),
            Palette::Tissue => palettes::of_share(share(class.mean)),
            _ => palettes::of_thesis(share(class.mean)),
        })
        .collect();
    move_apart(&mut lab, &touching(roles, structure));
    (0..classes.len()).filter(|&c| material(c)).for_each(|c| rgb[c] = palettes::linear(lab[c]));
    rgb
}

/// Places in a palette of distinct colours. The background, that of most voxels where there are several, takes none.
fn places(classes: &[ClassStatistics], roles: &[Role], structure: &Structure) -> Vec<usize> {
    let labelled = classes.iter().any(|class| class.id == NO_DATA);
    let places = if labelled {
        (0..classes.len()).collect()
    } else {
        slots::slots(&structure.histogram, classes.len())
    };
    let background = (0..classes.len()).filter(|&c| roles[c] == Role::Background);
    let taken = background.max_by_key(|&c| classes[c].voxels).map(|c| places[c]);
    places.into_iter().map(|place| place - usize::from(taken.is_some_and(|taken| place > taken))).collect()
}

/// Values between which nearly all voxels lie.
fn spread(structure: &Structure, reduced: &Reduced<'_>) -> [f64; 2] {
    let all: u64 = structure.histogram.iter().sum();
    let bins = structure.histogram.len();
    let value = |bin: usize| reduced.real((bin as f64 + 0.5) / bins as f64 * f64::from(crate::reduced::TOP));
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

/// Pairs of materials that touch, through a transition too, the lower first.
fn touching(roles: &[Role], structure: &Structure) -> Vec<[usize; 2]> {
    let materials: Vec<usize> = (0..roles.len()).filter(|&c| roles[c] == Role::Material).collect();
    let foreign = |c: usize| structure.all_faces(c) - structure.faces(c, c);
    let mut pairs = Vec::new();
    for (i, &a) in materials.iter().enumerate() {
        for &b in &materials[i + 1..] {
            let least = TOUCHES * foreign(a).min(foreign(b)) as f64;
            let through = (a + 1..b)
                .filter(|&t| roles[t] == Role::Transition)
                .map(|t| structure.faces(a, t).min(structure.faces(t, b)))
                .max();
            if structure.faces(a, b).max(through.unwrap_or(0)) as f64 > least {
                pairs.push([a, b]);
            }
        }
    }
    pairs
}

/// Makes the lower of two materials that look alike darker and the higher one lighter, step by step.
fn move_apart(lab: &mut [[f64; 3]], pairs: &[[usize; 2]]) {
    for _ in 0..60 {
        let mut moved = false;
        for &[a, b] in pairs {
            let seen = |c: [f64; 3]| difference::lab(difference::from_lab(c));
            if difference::ciede2000(seen(lab[a]), seen(lab[b])) < APART + 0.2 {
                // The lighter one stays the lighter one.
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

/// Pairs of touching materials whose colours are near, nearest first.
pub(crate) fn close_pairs(roles: &[Role], structure: &Structure, rgb: &[[f32; 3]]) -> Vec<Pair> {
    let pair = |classes: [usize; 2]| Pair {
        classes,
        difference: blindness::least_difference(rgb[classes[0]], rgb[classes[1]]),
    };
    let mut pairs: Vec<Pair> = touching(roles, structure).into_iter().map(pair).collect();
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
    fn values_choose_the_palette() {
        assert_eq!(chosen(Palette::Auto, true), Palette::Tissue);
        assert_eq!(chosen(Palette::Auto, false), Palette::Safe);
        assert_eq!(chosen(Palette::Thesis, true), Palette::Thesis);
    }
}
