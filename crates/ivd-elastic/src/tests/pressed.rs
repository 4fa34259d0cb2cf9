//! Matter that is pressed to nearly nothing.

use super::*;
use crate::tangent::Blocks;

/// A guarded block with hanging nodes, of which the corner at the origin is held.
fn guarded() -> Body {
    let plain =
        block(([5, 5, 5], 2), &[[4, 4, 4], [6, 4, 4]], &Matrix3::identity(), Lame::new(1.0, 0.4), |n| {
            n == [0; 3]
        });
    let element = plain.element.clone().guarded(0.3, 2.0);
    Body::new(plain.mesh, element, plain.matter, vec![])
}

fn find(body: &Body, place: [i32; 3]) -> usize {
    body.mesh.nodes.iter().position(|n| *n == place).unwrap()
}

#[test]
fn nodes_that_stand_out_come_to_rest_by_themselves() {
    let mut body = guarded();
    let n = body.mesh.nodes.len();
    let worst = find(&body, [5, 5, 5]);
    for case in 0..20 {
        body.loads[worst] = [0.0, 0.0, 0.1 * scatter(case)];
        let mut u: Vec<Triple> =
            (0..n).map(|i| std::array::from_fn(|a| 1e-3 * scatter(3 * i + a + case))).collect();
        // Nearly as far as it can go.
        let at = |far: f64| [far, 0.1 * far * scatter(case + 5), -0.3 * far];
        let (mut near, mut far) = (0.0, 2.0);
        for _ in 0..12 {
            u[worst] = at(0.5 * (near + far));
            let middle = if body.energy(&u).is_some() { &mut near } else { &mut far };
            *middle = u[worst][0];
        }
        u[worst] = at(near);
        let (before, mut forces) = (body.energy(&u).unwrap(), body.forces(&u));
        let (start, left) = (u.clone(), forces.left_mm());
        assert!(body.relax_worst(&mut u, &mut forces, 0.0, &Exec::default()).unwrap());
        let after = body.energy(&u).unwrap();
        assert!(after.0 < 0.1 * before.0, "{} of {}", after.0, before.0);
        assert!(forces.left_mm() < 0.02 * left, "{} of {left}", forces.left_mm());
        let found = body.forces(&u);
        assert_eq!((forces.left, forces.left_by_node), (found.left, found.left_by_node));
        // Threads take nothing from one another.
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let mut again = start.clone();
        alone
            .install(|| body.relax_worst(&mut again, &mut body.forces(&start), 0.0, &Exec::default()))
            .unwrap();
        assert_eq!(again, u);
    }
}

#[test]
fn nodes_of_a_group_have_no_cell_in_common() {
    let body = guarded();
    let nodes: Vec<usize> = (0..body.mesh.nodes.len()).step_by(2).collect();
    let groups = body.apart(&nodes);
    let mut all = groups.concat();
    all.sort_unstable();
    assert_eq!(all, nodes);
    for group in groups {
        let mut cells: Vec<u32> = Vec::new();
        for node in group {
            let mut own: Vec<u32> = body.touched(node).iter().map(|touched| touched.0).collect();
            own.dedup();
            cells.extend(own);
        }
        let many = cells.len();
        cells.sort_unstable();
        cells.dedup();
        assert_eq!(cells.len(), many);
    }
}

/// Also one on which others hang.
#[test]
fn a_node_at_rest_alone_has_the_least_energy() {
    let body = guarded();
    for place in [[5, 5, 5], [4, 4, 4]] {
        let mut held = Body::new(body.mesh.clone(), body.element.clone(), body.matter.clone(), vec![]);
        let node = find(&body, place);
        held.mesh.held = (0..body.mesh.nodes.len()).map(|i| i != node).collect();
        let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
        for (i, at) in body.mesh.nodes.iter().enumerate() {
            if (0..3).all(|a| (at[a] - place[a]).abs() <= 1) {
                u[i] = std::array::from_fn(|a| 0.25 * scatter(3 * i + a));
            }
        }
        let mut forces = held.forces(&u);
        let before = forces.left_mm();
        held.relax_worst(&mut u, &mut forces, 1e-9, &Exec::default()).unwrap();
        assert!(forces.left_mm() < 1e-6 * before, "{} of {before}", forces.left_mm());
        let least = held.energy(&u).unwrap().0;
        for (axis, by) in (0..3).flat_map(|axis| [(axis, 1e-4), (axis, -1e-4)]) {
            let mut other = u.clone();
            other[node][axis] += by;
            assert!(held.energy(&other).unwrap().0 > least, "{place:?}: {axis} {by}");
        }
    }
}

#[test]
fn blocks_of_single_corners_sum_up_to_the_diagonal_also_where_nodes_hang() {
    let body = guarded();
    let n = body.mesh.nodes.len();
    let u: Vec<Triple> = (0..n).map(|i| std::array::from_fn(|a| 0.2 * scatter(3 * i + a))).collect();
    let diagonal = Tangent::new(&body, &u, true, &Exec::default()).unwrap().diagonal();
    let blocks = Blocks::new(&body);
    for node in (0..n).filter(|&node| !body.mesh.held[node]) {
        let of = |&(cell, corner, weight): &(u32, u8, f64)| {
            let corners = body.mesh.gather(cell as usize, &u);
            blocks.of(cell as usize, usize::from(corner), &corners) * (weight * weight)
        };
        let sum: Matrix3<f64> = body.touched(node).iter().map(of).sum();
        assert!((sum - diagonal[node]).norm() < 1e-12 * sum.norm());
    }
}

#[test]
fn a_few_folded_cells_are_unfolded_and_held_nodes_stay() {
    let body = guarded();
    for (place, to) in
        [([5, 5, 5], [1.5, 0.0, 0.0]), ([4, 6, 6], [-3.0, 1.2, 0.4]), ([0, 2, 0], [0.0, -3.0, 0.0])]
    {
        let mut u = vec![[0.1; 3]; body.mesh.nodes.len()];
        let held = find(&body, [0; 3]);
        u[held] = [0.0; 3];
        u[find(&body, place)] = to;
        assert!(body.energy(&u).is_none(), "{place:?} folds");
        let before = u.clone();
        assert!(body.unfold(&mut u) && body.energy(&u).is_some(), "{place:?}");
        assert_eq!(u[held], [0.0; 3]);
        let moved = (0..u.len()).filter(|&i| u[i] != before[i]).count();
        assert!(moved > 0 && moved < u.len() / 2, "{moved} of {}", u.len());
    }
    // What is held inside out can't be.
    let mut body = body;
    body.mesh.held.fill(true);
    let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
    u[find(&body, [5, 5, 5])] = [1.5, 0.0, 0.0];
    assert!(!body.unfold(&mut u));
}

/// Two soft blocks and two voxels of next to nothing between them: the upper is pushed by more than twice that, and takes the lower along.
#[test]
fn a_gap_that_is_pressed_shut_carries_the_push_on() {
    let size = [8, 8, 16];
    let flesh = Lame::new(1.0, 0.4);
    let plain = block(([8, 8, 16], 1), &[], &Matrix3::identity(), flesh, |n| border(n, size) || is_punch(n));
    let element = plain.element.clone().guarded(0.3, 0.02 * flesh.bulk());
    let gap = |low: [i32; 3]| (8..10).contains(&low[2]);
    let matter =
        plain.mesh.cells.iter().map(|c| [if gap(c.low) { flesh.times(1e-3) } else { flesh }; 8]).collect();
    let mut body = Body::new(plain.mesh, element, matter, vec![]);
    let nodes: Vec<u32> =
        (0..body.mesh.nodes.len() as u32).filter(|n| is_punch(body.mesh.nodes[*n as usize])).collect();
    let goals = |share: f64| vec![[0.0, 0.0, -4.5 * share]; nodes.len()];
    let loads = vec![[0.0; 3]; body.mesh.nodes.len()];
    let course = Course { nodes: &nodes, goals: &goals, loads: &loads, tolerance: 1e-3, stops: false };
    let mut u = loads.clone();
    let arrival = body.go(&mut u, &course, &Exec::default()).unwrap();
    assert!(arrival.share == 1.0 && arrival.balance.reached, "{arrival:?}");
    let at = |z: i32| u[find(&body, [4, 4, z])][2];
    // The gap is nearly shut, and the lower surface gives way.
    assert!(2.0 + at(10) - at(8) < 0.6 && at(8) < -0.5, "{} {}", at(10), at(8));
}

/// What the push takes hold of: a plate in the upper block.
fn is_punch(n: [i32; 3]) -> bool {
    n[2] == 13 && (3..=5).contains(&n[0]) && (3..=5).contains(&n[1])
}
