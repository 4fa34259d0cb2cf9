//! Surfaces between the parts of a cell, which fill in the network on its faces.
//!
//! A closed curve between two parts is filled by a sheet. Where three parts or more meet, the curves are joined to a vertex
//! in the cell: a cone. A part that has two regions round one cone would touch itself there, so that one of the two gets
//! an apex of its own, nearer to it, and the room between the apexes goes to the neighbours: along a walk round the separated
//! regions each arc's tetrahedron belongs to the part beyond it, with a wall where that part changes.
//!
//! Which separation serves is found by trying them, the simplest first; whether it serves is counted, not argued: every
//! part's surface must be a manifold that ends in its arcs. Every pattern has one (tested over all of them), but for
//! three or four parts on diagonals of the cell: there a core goes through.

use std::collections::BTreeMap;

use super::super::table::triangulate;
use super::network::{Arc, FACE, Node, Pattern, Region, arcs, components, regions};
use crate::extract::cell;

/// Corner of a triangle that is the first apex.
pub(super) const APEX: u8 = 18;

/// A triangle between two parts, counter-clockwise seen from `outside`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wall {
    /// Nodes, or [`APEX`] and those after it.
    pub(super) corners: [u8; 3],
    pub(super) inside: u8,
    pub(super) outside: u8,
}

/// How the parts of a cell meet in it.
#[derive(Debug, Clone, Default)]
pub(super) struct Filling {
    pub(super) walls: Vec<Wall>,
    /// Place of each apex in the cell, 0…1.
    pub(super) apexes: Vec<[f32; 3]>,
}

/// Regions with an apex of their own.
#[derive(Debug, Clone)]
struct Separated {
    /// Indices into the component's regions, a bit each.
    regions: u32,
    /// Whether the room between the apexes goes to the parts outside the walk, or to those within.
    to_outside: bool,
}

/// The surfaces of a pattern.
///
/// - `first_joined`: see [`arcs`].
pub(super) fn fill(pattern: Pattern, first_joined: u8) -> Filling {
    let arcs = arcs(pattern, first_joined);
    let all = regions(&arcs);
    let mut filling = Filling::default();
    for members in components(&arcs, &all) {
        let members: Vec<&Region> = members.into_iter().map(|r| &all[r]).collect();
        // A closed curve has two sides.
        if let [a, b] = members.as_slice()
            && a.walk.iter().all(|&arc| arcs[arc].to < FACE && arcs[arc].from < FACE)
        {
            sheet(a, b.part, &arcs, &mut filling);
        } else {
            cone(pattern, &members, &arcs, &mut filling);
        }
    }
    filling
}

/// Fills a closed curve between two parts.
fn sheet(region: &Region, other: u8, arcs: &[Arc], filling: &mut Filling) {
    // Seen from outside the part its surface's border runs against the walk that has it on its left.
    let ring: Vec<Node> = region.walk.iter().rev().map(|&a| end(arcs[a], region.part)).collect();
    let wall = |corners| Wall { corners, inside: region.part, outside: other };
    if let Some(triangles) = triangulate(&ring) {
        filling.walls.extend(triangles.into_iter().map(wall));
        return;
    }
    let apex = APEX + filling.apexes.len() as u8;
    filling.apexes.push(mean(ring.iter().map(|&node| place(node))));
    let next = ring.iter().cycle().skip(1);
    filling.walls.extend(ring.iter().zip(next).map(|(&a, &b)| wall([a, b, apex])));
}

/// Joins a connected network to one apex, or to several.
fn cone(pattern: Pattern, members: &[&Region], arcs: &[Arc], filling: &mut Filling) {
    let first = APEX + filling.apexes.len() as u8;
    let plans = std::iter::once(Vec::new()).chain(plans(members));
    let apart = plans
        .filter_map(|plan| Some((joined(members, arcs, &plan, first)?, plan)))
        .find(|(walls, _)| is_sound(members, arcs, walls));
    if let Some((walls, plan)) = apart {
        filling.walls.extend(walls);
        filling.apexes.extend(apexes(pattern, members, arcs, &plan));
        return;
    }
    let pairs = (0..members.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
    let through = pairs
        .filter_map(|[a, b]| through([members[a], members[b]], members, arcs, first))
        .find(|walls| is_sound(members, arcs, walls));
    let walls = through.unwrap_or_else(|| panic!("no surfaces for {pattern:?}: {arcs:?}"));
    if walls.iter().any(|wall| wall.corners.contains(&first)) {
        filling.apexes.push([0.5; 3]);
    }
    filling.walls.extend(walls);
}

/// The walls where a core goes through the cell from one region to another, and the walls between the others end on it, from the
/// middle of a face of the one to that of a face of the other. If the two are different parts, they meet halfway in a wall
/// across the core. For three or four parts on diagonals of the cell, of which no two can be kept apart.
fn through([near, far]: [&Region; 2], members: &[&Region], arcs: &[Arc], first: u8) -> Option<Vec<Wall>> {
    let faces = |region: &Region| -> Vec<Node> {
        region.walk.iter().flat_map(|&a| [arcs[a].from, arcs[a].to]).filter(|&node| node >= FACE).collect()
    };
    let mut walls = Vec::new();
    for (a, arc) in arcs.iter().enumerate() {
        let Arc { from, to, left, right } = *arc;
        let of_core = |region: &&&Region| [near.walk.as_slice(), &far.walk].contains(&region.walk.as_slice());
        let own: Vec<&&Region> = members.iter().filter(|m| m.walk.contains(&a)).collect();
        let apex = match (own.iter().find(|m| of_core(m)), own.iter().find(|m| !of_core(m))) {
            (Some(core), Some(beside)) => {
                let opposite = faces(if core.walk == near.walk { far } else { near });
                faces(beside).into_iter().find(|node| opposite.contains(node))?
            }
            (None, Some(_)) => {
                // Both arcs of an edge between the same two faces: one triangle.
                let twins = arcs.iter().enumerate();
                let (twin, other) = twins.clone().find(|(b, other)| *b != a && other.from == from)?;
                if twin < a {
                    continue;
                }
                other.to
            }
            _ => return None,
        };
        walls.push(Wall { corners: [from, to, apex], inside: right, outside: left });
    }
    if near.part == far.part {
        return Some(walls);
    }
    let edges: Vec<(u8, u8)> = walls
        .iter()
        .filter(|w| w.inside == near.part || w.outside == near.part)
        .flat_map(|w| {
            let [a, b, c] = w.corners;
            if w.inside == near.part { [(a, b), (b, c), (c, a)] } else { [(a, c), (c, b), (b, a)] }
        })
        .collect();
    let on_arc = |p: Node, q: Node| arcs.iter().any(|arc| [(p, q), (q, p)].contains(&(arc.from, arc.to)));
    let rim = edges.iter().filter(|&&(p, q)| !edges.contains(&(q, p)) && !on_arc(p, q));
    let across = |&(p, q): &(u8, u8)| Wall { corners: [q, p, first], inside: near.part, outside: far.part };
    let across: Vec<Wall> = rim.map(across).collect();
    walls.extend(across);
    Some(walls)
}

/// Separations to try, the simplest first: one group of regions, then two.
fn plans(members: &[&Region]) -> impl Iterator<Item = Vec<Separated>> {
    let doubled = |r: usize| members.iter().filter(|m| m.part == members[r].part).count() > 1;
    let twice: u32 = (0..members.len()).filter(|&r| doubled(r)).map(|r| 1 << r).sum();
    let all = (1_u32 << members.len()) - 1;
    let mut groups: Vec<u32> = (1..all).filter(|group| group & twice != 0).collect();
    groups.sort_by_key(|group| group.count_ones());
    let singles: Vec<u32> = groups.iter().copied().filter(|g| g.is_power_of_two()).collect();
    let ways = |regions: u32| [true, false].map(|to_outside| Separated { regions, to_outside });
    let one = groups.into_iter().flat_map(move |group| ways(group).map(|s| vec![s]));
    let pairs = (0..singles.len()).flat_map(move |b| {
        let singles = singles.clone();
        (0..b).map(move |a| vec![ways(singles[a])[0].clone(), ways(singles[b])[0].clone()])
    });
    one.chain(pairs)
}

/// The walls of a plan; `None` where a separated group has no single closed walk round it, or two groups touch.
fn joined(members: &[&Region], arcs: &[Arc], plan: &[Separated], first: u8) -> Option<Vec<Wall>> {
    let mut walls = Vec::new();
    let mut apex_of: BTreeMap<usize, u8> =
        members.iter().flat_map(|m| m.walk.iter().map(|&arc| (arc, first))).collect();
    for (s, separated) in plan.iter().enumerate() {
        let own = first + 1 + s as u8;
        let within = |r: usize| separated.regions >> r & 1 == 1;
        let borders = |arc: usize| (0..members.len()).filter(move |&r| members[r].walk.contains(&arc));
        let keys: Vec<usize> = apex_of.keys().copied().collect();
        let mut border = Vec::new();
        for arc in keys {
            match borders(arc).filter(|&r| within(r)).count() {
                0 => {}
                2 => *apex_of.get_mut(&arc)? = own,
                _ => border.push(arc),
            }
        }
        if border.iter().any(|arc| apex_of[arc] != first) {
            return None;
        }
        let inner = |arc: usize| {
            let inner = borders(arc).find(|&r| within(r)).expect("a border arc has a region within");
            members[inner].part
        };
        let walk = round(border, arcs, inner)?;
        let given = |arc: usize| if separated.to_outside { other(arcs[arc], inner(arc)) } else { inner(arc) };
        if separated.to_outside {
            apex_of.extend(walk.iter().map(|&arc| (arc, own)));
        }
        for (i, &arc) in walk.iter().enumerate() {
            let next = walk[(i + 1) % walk.len()];
            let (before, after) = (given(arc), given(next));
            if before == after {
                continue;
            }
            let node = end(arcs[arc], inner(arc));
            let corners = if separated.to_outside { [own, node, first] } else { [node, first, own] };
            walls.push(Wall { corners, inside: before, outside: after });
        }
    }
    walls.extend(apex_of.iter().map(|(&arc, &apex)| {
        let Arc { from, to, left, right } = arcs[arc];
        Wall { corners: [from, to, apex], inside: right, outside: left }
    }));
    Some(walls)
}

/// The arcs in the order of the one closed walk that they are, with the parts `inner` on its left; `None` where they are
/// several walks or one that crosses itself.
fn round(mut border: Vec<usize>, arcs: &[Arc], inner: impl Fn(usize) -> u8) -> Option<Vec<usize>> {
    let start = |arc: usize| end(arcs[arc], other(arcs[arc], inner(arc)));
    let mut starts: Vec<Node> = border.iter().map(|&arc| start(arc)).collect();
    starts.sort_unstable();
    if starts.windows(2).any(|w| w[0] == w[1]) {
        return None;
    }
    let mut walk = vec![border.pop()?];
    loop {
        let last = *walk.last()?;
        let at = end(arcs[last], inner(last));
        match border.iter().position(|&arc| start(arc) == at) {
            Some(next) => walk.push(border.swap_remove(next)),
            None => return border.is_empty().then_some(walk),
        }
    }
}

/// Whether every part's surface is a manifold that ends in the part's arcs.
fn is_sound(members: &[&Region], arcs: &[Arc], walls: &[Wall]) -> bool {
    (0..8).all(|part| {
        let mut next: BTreeMap<(u8, u8), u8> = BTreeMap::new();
        for wall in walls.iter().filter(|w| w.inside == part || w.outside == part) {
            let [a, b, c] = wall.corners;
            let [a, b, c] = if wall.inside == part { [a, b, c] } else { [a, c, b] };
            for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
                if next.insert((p, q), r).is_some() {
                    return false;
                }
            }
        }
        let mut border: Vec<(u8, u8)> =
            next.keys().copied().filter(|&(p, q)| !next.contains_key(&(q, p))).collect();
        let walks = members.iter().filter(|m| m.part == part).flat_map(|m| &m.walk);
        let mut expected: Vec<(u8, u8)> =
            walks.map(|&a| (end(arcs[a], part), end(arcs[a], other(arcs[a], part)))).collect();
        border.sort_unstable();
        expected.sort_unstable();
        border == expected && next.keys().all(|&(p, q)| is_one_fan(&next, p, q))
    })
}

/// Whether the triangles round `p` are one fan: as many as are reached from the one that starts with `p → q`.
fn is_one_fan(next: &BTreeMap<(u8, u8), u8>, p: u8, q: u8) -> bool {
    let all = next.keys().filter(|(a, _)| *a == p).count();
    let mut reached = 1;
    let mut at = next[&(p, q)];
    while at != q && next.contains_key(&(p, at)) {
        at = next[&(p, at)];
        reached += 1;
    }
    if at != q {
        // An open fan: the other way too.
        let mut at = q;
        while let Some((&(_, before), _)) = next.iter().find(|((a, _), r)| *a == p && **r == at) {
            at = before;
            reached += 1;
        }
    }
    reached == all
}

/// Where the apexes of a plan lie: the first among the nodes of the whole, each other halfway from its walk's nodes to the
/// corners that it is separated with.
fn apexes(pattern: Pattern, members: &[&Region], arcs: &[Arc], plan: &[Separated]) -> Vec<[f32; 3]> {
    let nodes = |r: usize| members[r].walk.iter().map(|&arc| place(arcs[arc].from));
    let apart = plan.iter().fold(0, |sum, s| sum | s.regions);
    let rest = (0..members.len()).filter(|&r| apart >> r & 1 == 0);
    let mut places = vec![mean(rest.flat_map(nodes))];
    for separated in plan {
        let own = (0..members.len()).filter(|&r| separated.regions >> r & 1 == 1);
        let middle = mean(own.clone().flat_map(nodes));
        let corners = own.flat_map(|r| {
            let part = members[r].part;
            let edges = members[r].walk.iter().flat_map(|&a| [arcs[a].from, arcs[a].to]);
            edges
                .filter(|&node| node < FACE)
                .flat_map(|edge| cell::EDGES[usize::from(edge)])
                .filter(move |&corner| pattern[usize::from(corner)] == part)
                .map(|corner| cell::offset(corner).map(|c| c as f32))
        });
        let corners = mean(corners);
        places.push(std::array::from_fn(|a| 0.5 * (middle[a] + corners[a])));
    }
    places
}

/// Where the walk with `part` on its left leaves an arc.
fn end(arc: Arc, part: u8) -> Node {
    if arc.left == part { arc.to } else { arc.from }
}

/// The part on the other side of an arc.
fn other(arc: Arc, part: u8) -> u8 {
    if arc.left == part { arc.right } else { arc.left }
}

/// Place of a node in the cell, 0…1.
pub(super) fn place(node: Node) -> [f32; 3] {
    let middle = |corners: &[u8]| mean(corners.iter().map(|&c| cell::offset(c).map(|v| v as f32)));
    match node.checked_sub(FACE) {
        None => middle(&cell::EDGES[usize::from(node)]),
        Some(face) => middle(&cell::FACES[usize::from(face)]),
    }
}

fn mean(points: impl Iterator<Item = [f32; 3]>) -> [f32; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for point in points {
        sum = std::array::from_fn(|a| sum[a] + point[a]);
        count += 1.0;
    }
    sum.map(|s| s / count)
}
