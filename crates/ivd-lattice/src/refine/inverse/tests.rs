use std::collections::{BTreeMap, BTreeSet};

use super::*;

type Mesh = (Vec<Point>, Vec<[u32; 3]>);

fn octahedron() -> Mesh {
    let places = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let triangles =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    (places.map(Point::from).to_vec(), triangles)
}

fn tetrahedron() -> Mesh {
    let places = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    (places.map(Point::from).to_vec(), vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

fn icosahedron() -> Mesh {
    let g = f64::midpoint(1.0, 5.0_f64.sqrt());
    let places: Vec<Point> = (0..3)
        .flat_map(|a| {
            [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)].map(|(s, t)| {
                let mut p = Point::zeros();
                (p[a], p[(a + 1) % 3]) = (s, t);
                p
            })
        })
        .collect();
    let near = |i: usize, j: usize| ((places[i] - places[j]).norm() - 2.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for (i, j, k) in (0..12).flat_map(|i| (0..12).flat_map(move |j| (0..12).map(move |k| (i, j, k)))) {
        let outward = places[i].dot(&places[j].cross(&places[k])) > 0.0;
        if i < j && i < k && near(i, j) && near(j, k) && near(k, i) && outward {
            triangles.push([i as u32, j as u32, k as u32]);
        }
    }
    (places, triangles)
}

/// A torus of `n` by `m` quadrangles, cut in two each: six neighbours everywhere.
fn torus(n: u32, m: u32) -> Mesh {
    let places = (0..n * m).map(|v| {
        let turn = std::f64::consts::TAU;
        let (s, t) = (f64::from(v % n) / f64::from(n) * turn, f64::from(v / n) / f64::from(m) * turn);
        let r = 3.0 + t.cos();
        Point::new(r * s.cos(), r * s.sin(), t.sin())
    });
    let at = |i: u32, j: u32| i % n + n * (j % m);
    let quads = (0..n * m).map(|v| (v % n, v / n));
    let triangles = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    (places.collect(), triangles.collect())
}

/// Cuts each triangle into four, and numbers vertices and triangles in an order that has nothing to do with it. Returns
/// where the old vertices went.
fn subdivided((places, triangles): &Mesh, salt: u64) -> (Mesh, Vec<u32>) {
    let mut places = places.clone();
    let old = places.len();
    let mut middles = BTreeMap::new();
    let mut fine = Vec::new();
    for &t in triangles {
        let m = [0, 1, 2].map(|i| {
            let [a, b] = sorted([t[i], t[(i + 1) % 3]]);
            *middles.entry((a, b)).or_insert_with(|| {
                places.push((places[a as usize] + places[b as usize]) / 2.0);
                places.len() as u32 - 1
            })
        });
        fine.extend([[t[0], m[0], m[2]], [t[1], m[1], m[0]], [t[2], m[2], m[1]], m]);
    }
    let hash = |i: u64| ivd_core::noise::bits(salt, i);
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&v| hash(v as u64));
    let mut rank = vec![0; places.len()];
    for (new, &v) in order.iter().enumerate() {
        rank[v] = new as u32;
    }
    fine.sort_by_key(|t| hash(u64::from(t[0]) << 40 | u64::from(t[1]) << 20 | u64::from(t[2])));
    let turn = |t: [u32; 3]| {
        let mut t = t.map(|v| rank[v as usize]);
        let by = t[0] as usize % 3;
        t.rotate_left(by);
        t
    };
    let mesh = (order.iter().map(|&v| places[v]).collect(), fine.into_iter().map(turn).collect());
    (mesh, rank[..old].to_vec())
}

/// Triangles, each from its least corner on, in a set.
fn set(triangles: impl IntoIterator<Item = [u32; 3]>) -> BTreeSet<[u32; 3]> {
    let from_least = |t: [u32; 3]| {
        let least = (0..3).min_by_key(|&i| t[i]).unwrap();
        [0, 1, 2].map(|i| t[(least + i) % 3])
    };
    triangles.into_iter().map(from_least).collect()
}

#[test]
fn subdivided_surfaces_are_taken_back_exactly_level_by_level() {
    for (name, start) in [
        ("octahedron", octahedron()),
        ("tetrahedron", tetrahedron()),
        ("icosahedron", icosahedron()),
        ("torus", torus(6, 4)),
    ] {
        let mut levels = vec![(start, Vec::new())];
        for level in 0..4 {
            levels.push(subdivided(&levels[level].0, 31 * level as u64 + 7));
        }
        for level in (0..4).rev() {
            let (coarse, (fine, rank)) = (&levels[level].0, &levels[level + 1]);
            let found = coarser(&fine.1, &fine.0).unwrap();
            let expected = coarse.1.iter().map(|t| t.map(|v| rank[v as usize]));
            assert_eq!(set(found.triangles.iter().copied()), set(expected), "{name}, level {level}");
            assert_eq!(found.triangles.len(), coarse.1.len());
            assert_eq!(found.odd.len() + coarse.0.len(), fine.0.len());
            assert!(found.odd.iter().all(|v| !rank.contains(v)));
        }
    }
}

#[test]
fn what_was_not_subdivided_is_not_taken_back() {
    for (mesh, why) in [
        (octahedron(), NotSubdivided::Uncovered(0)),
        (tetrahedron(), NotSubdivided::Uncovered(0)),
        (icosahedron(), NotSubdivided::Uncovered(0)),
        (torus(5, 5), NotSubdivided::Uncovered(0)),
        ((Vec::new(), Vec::new()), NotSubdivided::Empty),
    ] {
        assert_eq!(coarser(&mesh.1, &mesh.0), Err(why));
    }
    let mut open = subdivided(&octahedron(), 3).0;
    open.1.pop();
    assert_eq!(coarser(&open.1, &open.0), Err(NotSubdivided::Open));
}

#[test]
fn a_flipped_edge_is_found_out() {
    let (fine, _) = subdivided(&subdivided(&icosahedron(), 1).0, 2);
    let mesh = HalfEdges::new(&fine.1).unwrap();
    for h in (0..fine.1.len() as u32 * 3).step_by(97) {
        // The two triangles (a, b, c) and (b, a, d) become (a, d, c) and (d, b, c).
        let g = mesh.twin(h);
        let (a, b, c, d) = (mesh.from(h), mesh.from(g), mesh.from(next(next(h))), mesh.from(next(next(g))));
        let mut flipped = fine.1.clone();
        flipped[h as usize / 3] = [a, d, c];
        flipped[g as usize / 3] = [d, b, c];
        assert!(matches!(coarser(&flipped, &fine.0), Err(NotSubdivided::Uncovered(_))), "half-edge {h}");
    }
}

#[test]
fn one_component_that_was_not_subdivided_stops_it() {
    let (fine, _) = subdivided(&octahedron(), 3);
    let shift = fine.0.len() as u32;
    let plain = octahedron();
    let places: Vec<_> = fine.0.iter().chain(&plain.0).copied().collect();
    let both = |more: &[[u32; 3]]| {
        fine.1.iter().copied().chain(more.iter().map(|t| t.map(|v| v + shift))).collect::<Vec<_>>()
    };
    assert_eq!(coarser(&both(&plain.1), &places), Err(NotSubdivided::Uncovered(fine.1.len() as u32)));
    let twice: Vec<_> = fine.0.iter().chain(&fine.0).copied().collect();
    assert_eq!(coarser(&both(&fine.1), &twice).unwrap().triangles.len(), 16);
}
