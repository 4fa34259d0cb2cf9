//! The elements against elasticity that formulas give.

use ivd_core::Exec;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::course::Course;
use crate::material::{Hexahedron, Lame, gauss};
use crate::mesh::{Mesh, weights};
use crate::system::{Body, Pull};
use crate::tangent::Tangent;
use crate::tree::Tree;
use crate::vectors::Triple;

mod pressed;

/// A block of `roots` cells of `edge`³ finest ones, cut to finest at `fine`; `held` says which nodes are.
fn block(
    (roots, edge): ([i32; 3], i32),
    fine: &[[i32; 3]],
    edges: &Matrix3<f64>,
    lame: Lame,
    held: impl Fn([i32; 3]) -> bool,
) -> Body {
    let mut tree = Tree::new(roots, edge, |_| true);
    for finest in fine {
        tree.refine(*finest, 1);
    }
    tree.balance();
    let mut mesh = Mesh::new(tree, |_| true);
    mesh.held = mesh.nodes.iter().map(|n| held(*n)).collect();
    let matter = vec![[lame; 8]; mesh.cells.len()];
    Body::new(mesh, Hexahedron::new(edges), matter, Vec::new())
}

/// Places of the nodes (mm).
fn places(body: &Body, edges: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    body.mesh.nodes.iter().map(|n| edges * Vector3::from(n.map(f64::from))).collect()
}

fn border(n: [i32; 3], size: [i32; 3]) -> bool {
    (0..3).any(|a| n[a] == 0 || n[a] == size[a])
}

/// Scattered values, −1 … 1.
fn scatter(i: usize) -> f64 {
    let hash = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((hash >> 20 & 0xffff) as f64) / 32_768.0 - 1.0
}

fn sheared() -> Matrix3<f64> {
    Matrix3::new(0.9, 0.1, 0.0, -0.2, 1.1, 0.1, 0.0, 0.3, -1.4)
}

fn relative(a: &[Triple], b: &[Triple]) -> f64 {
    let apart: f64 = a.iter().zip(b).flat_map(|(a, b)| (0..3).map(move |i| (a[i] - b[i]).powi(2))).sum();
    (apart / b.iter().flatten().map(|x| x * x).sum::<f64>()).sqrt()
}

#[test]
fn forces_and_matrix_are_the_differences_of_the_energy_also_where_nodes_hang() {
    let plain =
        block(([2, 2, 1], 4), &[[0, 0, 0], [5, 5, 2]], &sheared(), Lame::new(1.0, 0.4), |n| n == [0; 3]);
    assert!(plain.mesh.cells.len() > 30, "{} cells", plain.mesh.cells.len());
    let pull = Pull {
        cell: 3,
        vertex: 0,
        weights: weights([0.2, 0.7, 0.4]),
        spring: 3.0,
        goal: Vector3::new(0.3, -0.2, 0.1),
        multiplier: Vector3::new(0.5, 0.25, -1.0),
    };
    // A guard that every corner meets.
    let guarded = plain.element.clone().guarded(1.2, 2.0);
    for (element, exact) in [(&plain.element, true), (&guarded, true), (&guarded, false)] {
        let mut body =
            Body::new(plain.mesh.clone(), element.clone(), plain.matter.clone(), vec![pull.clone()]);
        for (i, load) in body.loads.iter_mut().enumerate() {
            *load = [scatter(i), 0.1, scatter(i + 50)];
        }
        let n = body.mesh.nodes.len();
        let random = |seed: usize, much: f64| -> Vec<Triple> {
            let of = |i: usize, a: usize| {
                if body.mesh.held[i] { 0.0 } else { much * scatter(3 * i + a + seed) }
            };
            (0..n).map(|i| std::array::from_fn(|a| of(i, a))).collect()
        };
        let dot = |a: &[Triple], b: &[Triple]| -> f64 {
            a.iter().zip(b).flat_map(|(a, b)| (0..3).map(move |i| a[i] * b[i])).sum()
        };
        for case in 0..8 {
            let (u, way, h) = (random(97 * case, 0.08), random(7000 + case, 1.0), 1e-5);
            let moved = |s: f64| -> Vec<Triple> {
                u.iter().zip(&way).map(|(u, w)| std::array::from_fn(|a| u[a] + s * w[a])).collect()
            };
            let slope = dot(&body.forces(&u).left, &way);
            let steep = (body.energy(&moved(h)).unwrap().0 - body.energy(&moved(-h)).unwrap().0) / (2.0 * h);
            assert!((slope - steep).abs() <= 1e-7 * slope.abs().max(1.0), "{slope} {steep}");
            let product = Tangent::new(&body, &u, !exact, &Exec::default()).unwrap().times(&way);
            // The plain loops give the same bytes.
            let plain = Exec::default().with_simd(false);
            assert_eq!(product, Tangent::new(&body, &u, !exact, &plain).unwrap().times(&way));
            let (up, down) = (body.forces(&moved(h)).left, body.forces(&moved(-h)).left);
            let bend: Vec<Triple> = up
                .iter()
                .zip(&down)
                .map(|(p, q)| std::array::from_fn(|a| (p[a] - q[a]) / (2.0 * h)))
                .collect();
            if exact {
                assert!(relative(&product, &bend) < 1e-7, "{}", relative(&product, &bend));
            } else {
                // As much as there is, or more, and never less than none.
                let (found, there) = (dot(&product, &way), dot(&bend, &way));
                assert!(found >= there - 1e-6 * found && found > 0.0, "{found} {there}");
            }
        }
    }
}

#[test]
fn diagonal_blocks_are_what_nodes_are_pushed_by_as_they_move_alone() {
    let plain = block(([2, 2, 2], 1), &[], &sheared(), Lame::new(1.0, 0.4), |n| n == [0; 3]);
    let pull = Pull {
        cell: 3,
        vertex: 0,
        weights: weights([0.2, 0.7, 0.4]),
        spring: 3.0,
        goal: Vector3::zeros(),
        multiplier: Vector3::zeros(),
    };
    let element = plain.element.clone().guarded(1.1, 2.0);
    let body = Body::new(plain.mesh, element, plain.matter, vec![pull]);
    let n = body.mesh.nodes.len();
    let u: Vec<Triple> = (0..n).map(|i| std::array::from_fn(|a| 0.08 * scatter(3 * i + a))).collect();
    for bounded in [false, true] {
        let tangent = Tangent::new(&body, &u, bounded, &Exec::default()).unwrap();
        for (node, block) in tangent.diagonal().iter().enumerate() {
            for axis in 0..3 {
                let mut way = vec![[0.0; 3]; n];
                way[node][axis] = 1.0;
                let pushed = Vector3::from(tangent.times(&way)[node]);
                let held = body.mesh.held[node];
                assert!((pushed - block.column(axis)).norm() < 1e-12 && held == (block.norm() == 0.0));
            }
        }
    }
}

#[test]
fn the_bounded_derivative_bends_down_nowhere_however_matter_is_strained() {
    let edges = sheared();
    let plain = block(([2, 2, 1], 2), &[[0, 0, 0]], &edges, Lame::new(1.0, 0.45), |n| n == [0; 3]);
    let element = plain.element.clone().guarded(0.3, 0.5);
    let body = Body::new(plain.mesh, element, plain.matter, vec![]);
    let places = places(&body, &edges);
    for case in 0..60 {
        // Pressed, pulled and sheared, with a turn: stretches from 0.15 to 3.
        let much = |a: usize| (1.2 * scatter(40 * case + a)).exp() - 0.05;
        let stretch = Matrix3::from_diagonal(&Vector3::new(much(0), much(1), much(2)));
        let turn = |a: usize| {
            let by = |b: usize| 2.0 * scatter(40 * case + 10 * a + b + 3);
            *Rotation3::new(Vector3::new(by(0), by(1), by(2))).matrix()
        };
        let map = turn(0) * stretch * turn(1) - Matrix3::identity();
        let u: Vec<Triple> = (0..places.len())
            .map(|i| {
                let off = map * places[i];
                std::array::from_fn(|a| off[a] + 0.02 * scatter(3 * i + a + case))
            })
            .collect();
        if body.energy(&u).is_none() {
            continue;
        }
        let tangent = Tangent::new(&body, &u, true, &Exec::default()).unwrap();
        for seed in 0..40 {
            let way: Vec<Triple> = (0..u.len())
                .map(|i| {
                    let of = |a: usize| if body.mesh.held[i] { 0.0 } else { scatter(97 * seed + 3 * i + a) };
                    std::array::from_fn(of)
                })
                .collect();
            let pushed = tangent.times(&way);
            let (mut sum, mut size) = (0.0, 0.0);
            for (p, w) in pushed.iter().flatten().zip(way.iter().flatten()) {
                (sum, size) = (sum + p * w, size + (p * w).abs());
            }
            assert!(sum > -1e-12 * size, "case {case}: {sum} of {size}");
        }
    }
}

#[test]
fn the_least_stretch_is_that_of_the_singular_values() {
    for case in 0..100 {
        let g = Matrix3::from_fn(|r, c| 1.5 * scatter(9 * case + 3 * r + c));
        let least = (Matrix3::identity() + g).svd(false, false).singular_values.min().powi(2);
        let found = crate::material::least_stretch(&g);
        assert!((found - least).abs() <= 1e-9 * (1.0 + g.norm_squared()), "{found} {least}");
    }
    assert_eq!(crate::material::least_stretch(&Matrix3::zeros()), 1.0);
}

#[test]
fn turns_cost_nothing_and_turn_the_forces() {
    let edges = sheared();
    let body = block(([2, 2, 2], 4), &[[3, 3, 3]], &edges, Lame::new(1.0, 0.3), |_| false);
    let places = places(&body, &edges);
    let turn = *Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2).matrix()
        * *Rotation3::new(Vector3::new(0.4, 2.0, 0.1)).matrix();
    let rigid: Vec<Triple> = places.iter().map(|x| (turn * x - x).into()).collect();
    let worst = body.forces(&rigid).left.iter().flatten().fold(0.0, |m: f64, f| m.max(f.abs()));
    assert!(worst < 1e-12, "{worst}");
    let bent: Vec<Triple> =
        (0..places.len()).map(|i| std::array::from_fn(|a| 0.05 * scatter(3 * i + a))).collect();
    let turned: Vec<Triple> =
        places.iter().zip(&bent).map(|(x, u)| (turn * (x + Vector3::from(*u)) - x).into()).collect();
    let expected: Vec<Triple> =
        body.forces(&bent).left.iter().map(|f| (turn * Vector3::from(*f)).into()).collect();
    assert!(relative(&body.forces(&turned).left, &expected) < 1e-11);
    let (a, b) = (body.energy(&bent).unwrap().0, body.energy(&turned).unwrap().0);
    assert!((a - b).abs() < 1e-11 * a, "{a} {b}");
}

#[test]
fn affine_borders_give_affine_insides_also_where_nodes_hang() {
    let (edges, size) = (sheared(), [8, 8, 8]);
    let stretch = Matrix3::new(0.3, 0.2, 0.0, -0.1, -0.2, 0.1, 0.0, 0.3, 0.15);
    let turn = *Rotation3::new(Vector3::new(0.0, 0.9, -0.8)).matrix();
    for map in [stretch, turn * (Matrix3::identity() + stretch) - Matrix3::identity()] {
        let body =
            block(([2, 2, 2], 4), &[[3, 3, 3], [6, 1, 7]], &edges, Lame::new(2.0, 0.4), |n| border(n, size));
        let wanted: Vec<Triple> = places(&body, &edges).iter().map(|x| (map * x).into()).collect();
        let mut u: Vec<Triple> = (0..wanted.len())
            .map(|i| {
                let off = if body.mesh.held[i] { 0.0 } else { 0.1 };
                std::array::from_fn(|a| wanted[i][a] + off * scatter(3 * i + a))
            })
            .collect();
        assert!(relative(&u, &wanted) > 1e-3);
        let balance = body.balance(&mut u, 1e-13, 30, &Exec::default()).unwrap();
        assert!(relative(&u, &wanted) < 1e-10, "{} {balance:?}", relative(&u, &wanted));
    }
}

/// Layers slide over one another by what their moduli let them: the shear stress `μ γ` is the same in all. Exact, as trilinear
/// cells can bend where the layers meet.
#[test]
fn layers_of_two_materials_share_a_shear_by_their_moduli() {
    let (size, edges) = ([8, 8, 8], Matrix3::from_diagonal(&Vector3::new(0.7, 1.3, 0.9)));
    let (soft, hard) = (Lame::new(1.0, 0.4), Lame::new(50.0, 0.1));
    let mut body = block(([2, 2, 2], 4), &[[1, 1, 1], [6, 6, 6]], &edges, soft, |n| border(n, size));
    let above = |body: &Body, cell: usize| body.mesh.cells[cell].low[2] >= 4;
    body.matter =
        (0..body.mesh.cells.len()).map(|c| [if above(&body, c) { hard } else { soft }; 8]).collect();
    let (rate, middle) = (0.4, 4.0 * edges[(2, 2)]);
    let wanted: Vec<Triple> = places(&body, &edges)
        .iter()
        .map(|x| [rate * (x.z.min(middle) + (x.z - middle).max(0.0) * soft.mu / hard.mu), 0.0, 0.0])
        .collect();
    let mut u: Vec<Triple> = (0..wanted.len())
        .map(|i| {
            let off = if body.mesh.held[i] { 0.0 } else { 0.1 };
            std::array::from_fn(|a| wanted[i][a] + off * scatter(3 * i + a))
        })
        .collect();
    let balance = body.balance(&mut u, 1e-13, 30, &Exec::default()).unwrap();
    assert!(relative(&u, &wanted) < 1e-10, "{} {balance:?}", relative(&u, &wanted));
}

/// A smooth motion of the unit cube, and its gradient.
fn wave(x: Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let (mut u, mut gradient) = (Vector3::zeros(), Matrix3::zeros());
    for (a, wave) in [[2.0, 1.0, 1.5], [1.0, 2.5, 0.5], [1.5, 1.0, 2.0]].into_iter().enumerate() {
        let k = Vector3::from(wave);
        let phase = k.dot(&x) + 0.3 * a as f64;
        u[a] = 0.1 * phase.sin();
        gradient.set_row(a, &(k * (0.1 * phase.cos())).transpose());
    }
    (u, gradient)
}

/// `−Div P` of the wave: differences of the fourth order.
fn body_force(lame: &Lame, x: Vector3<f64>) -> Vector3<f64> {
    let stress = |x: Vector3<f64>| {
        let f = Matrix3::identity() + wave(x).1;
        let inverse = f.try_inverse().unwrap().transpose();
        (f - inverse) * lame.mu + inverse * (lame.lambda * f.determinant().ln())
    };
    let h = 1e-3;
    let mut sum = Vector3::zeros();
    for axis in 0..3 {
        let step = Vector3::ith(axis, h);
        let slope =
            (stress(x - step * 2.0) - stress(x + step * 2.0)) + (stress(x + step) - stress(x - step)) * 8.0;
        sum -= slope.column(axis) / (12.0 * h);
    }
    sum
}

#[test]
fn a_manufactured_motion_is_met_to_the_second_order() {
    let lame = Lame::new(1.0, 0.3);
    let error = |n: i32| {
        let edges = Matrix3::identity() / f64::from(n);
        let mut body = block(([n; 3], 1), &[], &edges, lame, |p| border(p, [n; 3]));
        for cell in 0..body.mesh.cells.len() {
            for point in 0..8 {
                let place =
                    Vector3::from(body.mesh.cells[cell].low.map(f64::from)) + Vector3::from(gauss(point));
                let force = body_force(&lame, edges * place) * body.element.volume(1.0);
                for (corner, w) in weights(gauss(point)).into_iter().enumerate() {
                    let node = body.mesh.corner(cell, corner)[0].0 as usize;
                    for a in 0..3 {
                        body.loads[node][a] += w * force[a];
                    }
                }
            }
        }
        let wanted: Vec<Triple> = places(&body, &edges).iter().map(|x| wave(*x).0.into()).collect();
        let mut u: Vec<Triple> = (0..wanted.len())
            .map(|i| if body.mesh.held[i] { wanted[i] } else { wanted[i].map(|c| 0.9 * c) })
            .collect();
        let balance = body.balance(&mut u, 1e-10, 30, &Exec::default()).unwrap();
        assert!(balance.reached, "{balance:?}");
        // The mean of squares between the nodes, where interpolation counts too.
        let squares: f64 = (0..body.mesh.cells.len())
            .map(|cell| {
                let corners = body.mesh.gather(cell, &u);
                let middle: Vector3<f64> = corners.iter().map(|c| Vector3::from(*c) / 8.0).sum();
                let place = Vector3::from(body.mesh.cells[cell].low.map(|c| f64::from(c) + 0.5));
                (middle - wave(edges * place).0).norm_squared()
            })
            .sum();
        (squares / body.mesh.cells.len() as f64).sqrt()
    };
    let errors = [4, 8, 16].map(error);
    let orders = [errors[0] / errors[1], errors[1] / errors[2]].map(f64::log2);
    assert!(orders.iter().all(|o| (1.85..2.3).contains(o)), "{errors:?} {orders:?}");
}

/// Adds the force of a traction on the face of a block where `axis` is `at`, of squares of `area` a finest one.
fn traction(body: &mut Body, axis: usize, at: i32, area: f64, force: Vector3<f64>) {
    for cell in 0..body.mesh.cells.len() {
        for corner in 0..8 {
            let c = body.mesh.cells[cell];
            if c.corner(corner)[axis] == at {
                for (node, w) in body.mesh.corner(cell, corner).to_vec() {
                    let share = w * area * f64::from(c.size * c.size) / 4.0;
                    for a in 0..3 {
                        body.loads[node as usize][a] += share * force[a];
                    }
                }
            }
        }
    }
}

#[test]
fn a_bar_is_pulled_as_far_as_the_law_says_and_thins_as_it_says() {
    let lame = Lame::new(1.0, 0.4);
    let mut body =
        block(([4, 1, 1], 4), &[[3, 1, 1], [15, 3, 3]], &Matrix3::identity(), lame, |n| n == [0; 3]);
    let pull = 0.4;
    traction(&mut body, 0, 16, 1.0, Vector3::new(pull, 0.0, 0.0));
    traction(&mut body, 0, 0, 1.0, Vector3::new(-pull, 0.0, 0.0));
    let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
    let balance = body.balance(&mut u, 1e-11, 40, &Exec::default()).unwrap();
    assert!(balance.reached, "{balance:?}");
    // Sides are free: μ (b − 1/b) + λ ln(a b²) / b = 0; along it μ (a − 1/a) + λ ln(a b²) / a is the pull.
    let across = |a: f64| {
        let (mut low, mut high) = (0.2_f64, 1.0_f64);
        for _ in 0..80 {
            let b = 0.5 * (low + high);
            let stress = lame.mu * (b * b - 1.0) + lame.lambda * (a * b * b).ln();
            if stress > 0.0 { high = b } else { low = b }
        }
        low
    };
    let (mut low, mut high) = (1.0_f64, 3.0_f64);
    for _ in 0..80 {
        let a = 0.5 * (low + high);
        let stress = lame.mu * (a - 1.0 / a) + lame.lambda * (a * across(a).powi(2)).ln() / a;
        if stress > pull { high = a } else { low = a }
    }
    let (a, b) = (low, across(low));
    assert!(a > 1.2 && b < 0.95, "{a} {b}");
    for (node, u) in body.mesh.nodes.iter().zip(&u) {
        let wanted = [a - 1.0, b - 1.0, b - 1.0];
        for axis in 0..3 {
            assert!((u[axis] - wanted[axis] * f64::from(node[axis])).abs() < 1e-6, "{node:?} {u:?}");
        }
    }
}

#[test]
fn a_cantilever_sinks_as_timoshenko_says() {
    let (n, long, load) = (6, 8, 1e-5);
    let edges = Matrix3::identity() / f64::from(n);
    let mut body = block(([n * long, n, n], 1), &[], &edges, Lame::new(1.0, 0.0), |p| p[0] == 0);
    traction(&mut body, 0, n * long, f64::from(n * n).recip(), Vector3::new(0.0, 0.0, -load));
    let mut u = vec![[0.0; 3]; body.mesh.nodes.len()];
    assert!(body.balance(&mut u, 1e-7, 20, &Exec::default()).unwrap().reached);
    let end: Vec<f64> =
        body.mesh.nodes.iter().zip(&u).filter(|(p, _)| p[0] == n * long).map(|(_, u)| -u[2]).collect();
    let sunk = end.iter().sum::<f64>() / end.len() as f64;
    let l = f64::from(long);
    // I = 1/12, G = E/2, shear coefficient 5/6.
    let wanted = load * (l.powi(3) * 4.0 + l * 2.0 * 1.2);
    assert!((sunk / wanted - 1.0).abs() < 0.03, "{} of it", sunk / wanted);
}

#[test]
fn a_square_shaft_twists_as_saint_venant_says() {
    let (n, long) = (8, 4);
    let lame = Lame::new(1.0, 0.3);
    let edges = Matrix3::identity() / f64::from(n);
    let mut body = block(([n, n, n * long], 1), &[], &edges, lame, |p| p[2] == 0 || p[2] == n * long);
    let places = places(&body, &edges);
    let arm = |x: &Vector3<f64>| Vector3::new(0.5 - x.y, x.x - 0.5, 0.0);
    let mut u: Vec<Triple> =
        places.iter().map(|x| if x.z == 0.0 { [0.0; 3] } else { (arm(x) * (1e-5 * x.z)).into() }).collect();
    assert!(body.balance(&mut u, 1e-7, 20, &Exec::default()).unwrap().reached);
    // The reaction at the far end, and the turn between sections away from both.
    let held = std::mem::replace(&mut body.mesh.held, vec![false; places.len()]);
    let forces = body.forces(&u).left;
    let torque: f64 = (0..places.len())
        .filter(|i| held[*i] && places[*i].z > 0.0)
        .map(|i| arm(&places[i]).dot(&Vector3::from(forces[i])))
        .sum();
    let turn = |z: i32| {
        let section = || (0..places.len()).filter(|i| body.mesh.nodes[*i][2] == z);
        section().map(|i| arm(&places[i]).dot(&Vector3::from(u[i]))).sum::<f64>()
            / section().map(|i| arm(&places[i]).norm_squared()).sum::<f64>()
    };
    let rate = (turn(n * long * 5 / 8) - turn(n * long * 3 / 8)) / (f64::from(long) / 4.0);
    let wanted = lame.mu * 0.140_577 * rate;
    assert!((torque / wanted - 1.0).abs() < 0.03, "{} of it", torque / wanted);
}

/// Nodes on the border of a block that go where a map takes them.
fn told(body: &Body, size: [i32; 3]) -> Vec<u32> {
    (0..body.mesh.nodes.len() as u32).filter(|n| border(body.mesh.nodes[*n as usize], size)).collect()
}

#[test]
fn an_affine_motion_of_the_border_is_that_of_the_inside_also_where_nodes_hang() {
    let edges = sheared();
    let size = [8, 8, 4];
    let mut body =
        block(([2, 2, 1], 4), &[[0, 0, 0], [5, 5, 2]], &edges, Lame::new(2.0, 0.45), |n| border(n, size));
    let places = places(&body, &edges);
    let nodes = told(&body, size);
    let turn = *Rotation3::new(Vector3::new(0.3, -0.4, 0.5)).matrix();
    let map = turn * Matrix3::new(1.2, 0.1, 0.0, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1) - Matrix3::identity();
    let goals = |share: f64| nodes.iter().map(|n| (map * places[*n as usize] * share).into()).collect();
    let loads = vec![[0.0; 3]; places.len()];
    let course = Course { nodes: &nodes, goals: &goals, loads: &loads, tolerance: 1e-12, stops: false };
    let mut u = loads.clone();
    let arrival = body.go(&mut u, &course, &Exec::default()).unwrap();
    assert!(arrival.share == 1.0 && arrival.balance.reached, "{arrival:?}");
    let wanted: Vec<Triple> = places.iter().map(|x| (map * x).into()).collect();
    assert!(relative(&u, &wanted) < 1e-10, "{}", relative(&u, &wanted));
    // The border holds itself: what pulls on one side pushes on the other.
    let sum: Vector3<f64> = body.reactions(&u).into_iter().map(Vector3::from).sum();
    assert!(sum.norm() < 1e-9, "{sum}");
}

#[test]
fn a_way_that_ends_tells_where() {
    // A plate that is to go through the floor, as far as three times the height.
    let size = [4, 4, 4];
    let plates = |n: [i32; 3]| n[2] == 0 || n[2] == 4;
    let mut body = block(([4; 3], 1), &[], &Matrix3::identity(), Lame::new(1.0, 0.3), plates);
    let nodes: Vec<u32> = (0..125).filter(|n| body.mesh.nodes[*n as usize][2] == 4).collect();
    let goals = |share: f64| vec![[0.0, 0.0, -12.0 * share]; nodes.len()];
    let loads = vec![[0.0; 3]; 125];
    let course = Course { nodes: &nodes, goals: &goals, loads: &loads, tolerance: 1e-3, stops: false };
    let mut u = loads.clone();
    let arrival = body.go(&mut u, &course, &Exec::default()).unwrap();
    assert!(size[2] == 4 && (0.2..0.334).contains(&arrival.share), "{arrival:?}");
    assert!(body.energy(&u).is_some(), "nothing is turned inside out");
    let top = u[nodes[12] as usize][2];
    assert!((top + 12.0 * arrival.share).abs() < 1e-12, "the plate is where the share says: {top}");

    // Where it may stop it does so in balance, as near as it came.
    let course = Course { stops: true, ..course };
    u.fill([0.0; 3]);
    let stopped = body.go(&mut u, &course, &Exec::default()).unwrap();
    assert!(stopped.balance.reached && stopped.share > arrival.share - 0.05, "{stopped:?} {arrival:?}");
    let top = u[nodes[12] as usize][2];
    assert!((top + 12.0 * stopped.share).abs() < 1e-12, "the plate is where the share says: {top}");
    assert!((stopped.energies[1] - body.energy(&u).unwrap().0).abs() <= 1e-12 * stopped.energies[1]);
    // What nothing can reach ends at rest.
    let course = Course { tolerance: 1e-30, ..course };
    let stopped = body.go(&mut u, &course, &Exec::default()).unwrap();
    assert!(stopped.share == 0.0 && u.iter().all(|u| *u == [0.0; 3]), "{stopped:?}");
    assert!(!stopped.balance.reached && stopped.energies[1] == 0.0, "{stopped:?}");
}

#[test]
fn a_force_moves_matter_as_far_as_moving_it_takes_that_force() {
    let fixed = |n: [i32; 3]| n[2] == 0;
    let mut body = block(([3; 3], 2), &[[2, 2, 5]], &Matrix3::identity(), Lame::new(3.0, 0.4), fixed);
    let at = body.mesh.nodes.iter().position(|n| *n == [2, 2, 6]).unwrap();
    let mut loads = vec![[0.0; 3]; body.mesh.nodes.len()];
    loads[at] = [0.4, -0.1, 1.5];
    let nothing = |_: f64| Vec::new();
    let course = Course { nodes: &[], goals: &nothing, loads: &loads, tolerance: 1e-11, stops: false };
    let mut pulled = vec![[0.0; 3]; loads.len()];
    assert_eq!(body.go(&mut pulled, &course, &Exec::default()).unwrap().share, 1.0);
    body.mesh.held[at] = true;
    let nodes = [at as u32];
    let goals = |share: f64| vec![pulled[at].map(|c| c * share)];
    let none = vec![[0.0; 3]; loads.len()];
    let course = Course { nodes: &nodes, goals: &goals, loads: &none, tolerance: 1e-11, stops: false };
    let mut moved = none.clone();
    assert_eq!(body.go(&mut moved, &course, &Exec::default()).unwrap().share, 1.0);
    assert!(relative(&moved, &pulled) < 1e-8, "{}", relative(&moved, &pulled));
    let force = Vector3::from(body.reactions(&moved)[at]);
    assert!((force - Vector3::from(loads[at])).norm() < 1e-8, "{force}");
}
