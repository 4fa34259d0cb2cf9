use std::collections::{BTreeMap, BTreeSet};

use super::fill::{APEX, Filling, fill, place};
use super::network::{Pattern, is_crossed};
use super::*;

/// Every way to divide eight corners between parts, with every decision about the crossed faces that priorities can
/// lead to, and many that they can't.
fn all_patterns() -> Vec<(Pattern, u8)> {
    let mut patterns = vec![(0_u8, [0_u8; 8])];
    for corner in 1..8 {
        patterns = patterns
            .into_iter()
            .flat_map(|(most, pattern)| {
                (0..=most + 1).map(move |part| {
                    let mut next = pattern;
                    next[corner] = part;
                    (most.max(part), next)
                })
            })
            .collect();
    }
    assert_eq!(patterns.len(), 4140, "Bell's number of eight");
    let decided = |pattern: Pattern| {
        let crossed: u8 = (0..6).filter(|&f| is_crossed(pattern, f)).map(|f| 1 << f).sum();
        let ranks: BTreeSet<u8> = permutations(4).map(|rank| by_rank(pattern, &rank)).collect();
        ranks.into_iter().filter(move |joined| joined & !crossed == 0).map(move |joined| (pattern, joined))
    };
    patterns.into_iter().flat_map(|(_, pattern)| decided(pattern)).collect()
}

/// The faces whose first corner's part has the lower rank, where the parts with two corners or more have ranks.
fn by_rank(pattern: Pattern, rank: &[usize]) -> u8 {
    let is_several = |part: u8| (0..8).filter(|&corner| pattern[corner] == part).nth(1).is_some();
    let several: Vec<u8> = (0..8).filter(|&part| is_several(part)).collect();
    let rank_of = |part: u8| rank[several.iter().position(|p| *p == part).unwrap()];
    (0..6).filter(|&f| is_crossed(pattern, f)).fold(0, |joined, f| {
        let [a, b] = [0, 1].map(|i| rank_of(pattern[usize::from(FACES[f][i])]));
        joined | u8::from(a < b) << f
    })
}

fn permutations(n: usize) -> impl Iterator<Item = Vec<usize>> {
    let all = (0..n.pow(n as u32)).map(move |code| (0..n).map(|i| code / n.pow(i as u32) % n).collect());
    all.filter(move |p: &Vec<usize>| (0..n).all(|i| p.contains(&i)))
}

#[test]
fn every_pattern_has_surfaces_that_are_manifolds_with_the_right_borders() {
    let patterns = all_patterns();
    for (pattern, joined) in &patterns {
        // Filling looks for a sound plan and fails without one; elements are given or fail.
        let filled = Filled::new(*pattern, *joined);
        for part in 0..8_u8 {
            let elements: Vec<u8> = filled.elements.iter().filter(|e| e.0 == part).map(|e| e.2).collect();
            let different: BTreeSet<u8> = elements.iter().copied().collect();
            assert_eq!(different.len(), elements.len(), "{pattern:?}");
        }
        assert_sound(*pattern, &filled.filling);
    }
    assert_eq!(patterns.len(), 4961, "with decisions about their crossed faces");
}

/// Of all parts together: sheets and cones don't share what they mustn't, and no two corners of a triangle coincide.
fn assert_sound(pattern: Pattern, filling: &Filling) {
    let at = |corner: u8| {
        if corner < APEX { place(corner) } else { filling.apexes[usize::from(corner - APEX)] }
    };
    for part in 0..8_u8 {
        let mut next: BTreeMap<u8, BTreeMap<u8, u8>> = BTreeMap::new();
        for wall in filling.walls.iter().filter(|w| [w.inside, w.outside].contains(&part)) {
            let [a, b, c] = wall.corners;
            let [a, b, c] = if wall.inside == part { [a, b, c] } else { [a, c, b] };
            for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
                assert!(next.entry(p).or_default().insert(q, r).is_none(), "{pattern:?}: {p}-{q} twice");
                let apart: f32 = (0..3).map(|k| (at(p)[k] - at(q)[k]).powi(2)).sum();
                assert!(apart > 0.05_f32.powi(2), "{pattern:?}: {p} and {q} nearly coincide");
            }
        }
        for (vertex, ring) in &next {
            // One fan: open at a node of the network, closed at an apex.
            let ends: BTreeSet<u8> = ring.values().copied().collect();
            let starts: Vec<u8> = ring.keys().copied().filter(|q| !ends.contains(q)).collect();
            assert_eq!(starts.len(), usize::from(*vertex < APEX), "{pattern:?}: fans of {vertex}");
            let mut at = starts.first().copied().unwrap_or(*ring.keys().next().unwrap());
            let mut steps = 0;
            while let Some(&to) = ring.get(&at).filter(|_| steps < ring.len()) {
                (at, steps) = (to, steps + 1);
            }
            assert_eq!(steps, ring.len(), "{pattern:?}: {vertex} joins several fans");
        }
    }
}

#[test]
fn patterns_of_two_parts_have_no_vertex_on_a_face() {
    for (pattern, joined) in all_patterns().into_iter().filter(|(p, _)| p.iter().all(|part| *part < 2)) {
        let filling = fill(pattern, joined);
        let corners = filling.walls.iter().flat_map(|w| w.corners);
        assert!(corners.into_iter().all(|c| !(FACE..APEX).contains(&c)), "{pattern:?}");
    }
}
