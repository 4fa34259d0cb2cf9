use super::*;

fn mesh(places: &[[f64; 3]], triangles: &[[u32; 3]]) -> (Vec<Point>, Vec<[u32; 3]>) {
    (places.iter().map(|&p| Point::from(p)).collect(), triangles.to_vec())
}

fn pair(a: &(Vec<Point>, Vec<[u32; 3]>), b: &(Vec<Point>, Vec<[u32; 3]>)) -> Pair {
    let mesh = |m: &(Vec<Point>, Vec<[u32; 3]>)| Mesh::new(m.0.clone(), &m.1, m.1.clone());
    let all = || a.0.iter().chain(&b.0);
    let low = all().fold(Point::repeat(f64::INFINITY), |low, p| low.inf(p));
    let high = all().fold(Point::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
    Pair { meshes: [mesh(a), mesh(b)], diagonal: (high - low).norm() }
}

fn measured(a: &(Vec<Point>, Vec<[u32; 3]>), b: &(Vec<Point>, Vec<[u32; 3]>)) -> Distances {
    pair(a, b).distances(f64::INFINITY, &Exec::default()).unwrap().unwrap_or(Distances::INFINITE)
}

/// 0…1.
fn noise(i: u64) -> f64 {
    ivd_core::noise::unit(0, i)
}

#[test]
fn a_bent_quadrangle_and_its_flipped_diagonal_are_a_root_of_a_half_apart() {
    let corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 1.0]];
    let a = mesh(&corners, &[[0, 1, 2], [0, 2, 3]]);
    let b = mesh(&corners, &[[0, 1, 3], [1, 2, 3]]);
    let found = measured(&a, &b);
    let expected = 0.5_f64.sqrt();
    assert!(found.max_mm >= expected && found.max_mm <= expected * (1.0 + TOLERANCE) + 1e-6, "{found:?}");
    assert!(found.least_max_mm <= expected + 1e-12 && found.least_max_mm * 1.04 >= found.max_mm);
}

#[test]
fn parallel_squares_are_their_distance_apart_in_the_largest_and_in_the_mean() {
    let square = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
    let found =
        measured(&mesh(&square(0.0), &[[0, 1, 2], [0, 2, 3]]), &mesh(&square(0.25), &[[0, 1, 3], [1, 2, 3]]));
    assert!((found.max_mm - 0.25).abs() < 1e-9 && (found.mean_mm - 0.25).abs() < 1e-9, "{found:?}");
}

#[test]
fn one_plane_cut_into_other_triangles_is_no_distance_away() {
    // A fine fan and a coarse one of the same square, slanted.
    let n = 24_u32;
    let at = |x: f64, y: f64| [x, y, 0.37 * x - 0.21 * y];
    let fine: Vec<_> =
        (0..=n).flat_map(|j| (0..=n).map(move |i| at(f64::from(i) / 24.0, f64::from(j) / 24.0))).collect();
    let quads = (0..n).flat_map(|j| (0..n).map(move |i| i + (n + 1) * j));
    let triangles: Vec<_> = quads.flat_map(|v| [[v, v + 1, v + n + 2], [v, v + n + 2, v + n + 1]]).collect();
    let coarse = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0), at(0.313, 0.477)];
    let found =
        measured(&mesh(&fine, &triangles), &mesh(&coarse, &[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]));
    assert!(found.max_mm < 1e-8, "{found:?}");
}

#[test]
fn nothing_is_infinitely_far_from_something_and_no_way_from_nothing() {
    let nothing = mesh(&[], &[]);
    let stray = mesh(&[[5.0; 3]], &[]);
    let some = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
    assert_eq!(measured(&nothing, &stray), Distances::NONE);
    assert_eq!(
        (measured(&nothing, &some), measured(&some, &stray)),
        (Distances::INFINITE, Distances::INFINITE)
    );
    assert!(measured(&some, &some).max_mm < 1e-12);
}

/// Largest distance of points of `a`, sampled densely, from all triangles of `b`.
fn plain(a: &(Vec<Point>, Vec<[u32; 3]>), b: &(Vec<Point>, Vec<[u32; 3]>), n: usize) -> f64 {
    let tree = Tree::new(&b.0, &b.1);
    let mut largest = 0.0_f64;
    for t in &a.1 {
        let [p, q, r] = t.map(|v| a.0[v as usize]);
        for i in 0..=n {
            for j in 0..=n - i {
                let (s, u) = (i as f64 / n as f64, j as f64 / n as f64);
                let x = p * (1.0 - s - u) + q * s + r * u;
                let off = (0..b.1.len() as u32).map(|t| tree.off(&x, t)).fold(f64::INFINITY, f64::min);
                largest = largest.max(off);
            }
        }
    }
    largest
}

#[test]
fn random_soups_lie_between_the_bounds_however_they_are_shaped() {
    for case in 0..60_u64 {
        let flat = [1.0, 0.1, 0.0][case as usize % 3];
        let soup = |seed: u64, count: u32| {
            let place = |i: u64| {
                let at = |k: u64| noise(case * 10_000 + seed * 1000 + i * 3 + k);
                [at(0), 2.0 * at(1), flat * at(2)]
            };
            let places: Vec<_> = (0..u64::from(count) * 3).map(place).collect();
            mesh(&places, &(0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect::<Vec<_>>())
        };
        let (a, b) = (soup(0, 3 + case as u32 % 4), soup(1, 5));
        let found = measured(&a, &b);
        let sampled = plain(&a, &b, 40).max(plain(&b, &a, 40));
        assert!(found.max_mm >= sampled - 1e-9, "case {case}: {found:?} below {sampled}");
        assert!(found.max_mm <= 1.1 * sampled + 1e-6, "case {case}: {found:?} far above {sampled}");
        assert!(found.least_max_mm <= found.max_mm && found.mean_mm <= found.max_mm);
        assert!(found.max_mm <= found.least_max_mm * (1.0 + TOLERANCE) + 1e-8, "case {case}: {found:?}");
    }
}

#[test]
fn a_limit_that_is_exceeded_is_told() {
    let square = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
    let both = pair(&mesh(&square(0.0), &[[0, 1, 2]]), &mesh(&square(0.25), &[[0, 1, 2]]));
    let exec = Exec::default();
    assert!(both.distances(0.2499, &exec).unwrap().is_none());
    assert!(both.distances(0.2501, &exec).unwrap().is_some());
}
