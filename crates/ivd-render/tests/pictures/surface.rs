//! Pictures of lattices: what they cover, which place each pixel shows, and what hides what.

use std::sync::Mutex;

use ivd_core::{ElementKey, Exec, Grid, Lattice, LatticeSource};
use ivd_render::{Projection, RenderParams, SurfaceStyle, View, surface};
use nalgebra::Vector3;

const FRAME: [[f64; 3]; 2] = [[-10.0; 3], [10.0; 3]];

/// A lattice of corners on voxels of 1 mm round an origin.
fn lattice(corners: &[[i64; 3]], triangles: &[[u32; 3]], origin: f64) -> Lattice {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let grid = Grid::new([21; 3], [1.0; 3], [origin - 10.0; 3], axes).unwrap();
    // The padded grid is a voxel larger on every side.
    let mut order: Vec<(ElementKey, u32)> = corners
        .iter()
        .zip(0..)
        .map(|(c, i)| (ElementKey::new(grid.dims(), c.map(|x| (x + 11) as usize), 6), i))
        .collect();
    order.sort_unstable();
    let new = |old: u32| order.iter().position(|v| v.1 == old).unwrap() as u32;
    Lattice::new(
        grid,
        order.iter().map(|v| v.0).collect(),
        vec![[0.0; 3]; order.len()].into(),
        triangles.iter().map(|t| t.map(new)).collect(),
    )
    .unwrap()
    .with_source(LatticeSource::Mask)
}

/// An octahedron of 8 mm from the middle to each corner, counter-clockwise from outside.
fn octahedron(origin: f64) -> Lattice {
    let corners = [[8, 0, 0], [-8, 0, 0], [0, 8, 0], [0, -8, 0], [0, 0, 8], [0, 0, -8]];
    let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    lattice(&corners, &triangles, origin)
}

fn params(view: View) -> RenderParams {
    RenderParams { size: [120; 2], view, annotate: false, ..RenderParams::default() }
}

/// Millimetres of a pixel: the picture holds the sphere round the frame.
const PIXEL: f64 = 2.0 * 17.320_508_075_688_775 / 120.0;

#[test]
fn an_octahedron_from_the_front_covers_a_square_and_shows_its_front_half() {
    let places = Mutex::new(Vec::new());
    let note = |p: [f64; 3]| {
        places.lock().unwrap().push(Vector3::from(p));
        [1.0; 3]
    };
    let look = SurfaceStyle { colour: Some(&note), frame: Some(FRAME), ..SurfaceStyle::default() };
    let unlit = RenderParams { shading: false, ..params(View::FRONT) };
    for projection in [Projection::Orthographic, Projection::Perspective] {
        places.lock().unwrap().clear();
        let view = View { projection, ..View::FRONT };
        let image =
            surface(&octahedron(0.0), &look, &RenderParams { view, ..unlit.clone() }, &Exec::default())
                .unwrap();
        let places = places.lock().unwrap();
        // Half of the diagonals' product; nine samples a pixel.
        if projection == Projection::Orthographic {
            let area = places.len() as f64 * (PIXEL / 3.0).powi(2);
            assert!((area / 128.0 - 1.0).abs() < 0.01, "{area}");
            let white = image.rgba().chunks(4).filter(|p| p[0] == 255).count() as f64 * PIXEL * PIXEL;
            assert!(white < 128.0 && white > 110.0, "{white}: pixels inside alone are white");
        }
        // The eye is at +y.
        for p in places.iter() {
            assert!((p.abs().sum() - 8.0).abs() < 1e-9 && p.y > -1e-9, "{p}");
        }
    }
}

#[test]
fn what_lies_behind_is_hidden_with_its_edges() {
    let far = lattice(&[[-8, -4, -8], [8, -4, -8], [0, -4, 8]], &[[0, 1, 2]], 0.0);
    let both = lattice(
        &[[-8, -4, -8], [8, -4, -8], [0, -4, 8], [-9, 4, -9], [9, 4, -9], [-9, 4, 9], [9, 4, 9]],
        &[[0, 1, 2], [3, 4, 5], [5, 4, 6]],
        0.0,
    );
    let look = SurfaceStyle { edges: true, frame: Some(FRAME), ..SurfaceStyle::default() };
    let paper = RenderParams { shading: false, surface: [1.0; 3], ..params(View::FRONT) };
    let drawn = |l: &Lattice| surface(l, &look, &paper, &Exec::default()).unwrap();
    // Inside the quad in front, off its diagonal, where the far triangle has its left side.
    let dark = |image: &ivd_core::Image| {
        let at = |mm: f64| (60.0 + mm / PIXEL) as usize;
        (at(-7.0)..at(-2.0)).any(|x| image.rgba()[4 * (x + 120 * at(-2.0))] < 100)
    };
    assert!(dark(&drawn(&far)), "an edge is seen where nothing hides it");
    let hidden = drawn(&both);
    assert!(!dark(&hidden), "and isn't through a face");
    // The order of triangles doesn't matter.
    let reversed: Vec<_> = both.triangles().iter().rev().copied().collect();
    assert_eq!(drawn(&both.with_triangles(reversed.into()).unwrap()), hidden);
}

#[test]
fn the_same_bytes_for_any_number_of_threads_far_from_the_origin_and_without_triangles() {
    let view = View { angles: [31.0, 22.0], ..View::FRONT };
    let look = SurfaceStyle { edges: true, ..SurfaceStyle::default() };
    let drawn = |lattice: &Lattice, threads: usize| {
        surface(lattice, &look, &params(view), &Exec::default().with_threads(threads)).unwrap()
    };
    let near = drawn(&octahedron(0.0), 1);
    assert_eq!(near, drawn(&octahedron(0.0), 3));
    assert_eq!(near, drawn(&octahedron((1 << 20) as f64), 1));
    let none = octahedron(0.0).with_triangles(Vec::new().into()).unwrap();
    assert!(drawn(&none, 1).rgba().chunks(4).all(|p| p == [0, 0, 0, 255]));
}

#[test]
fn a_face_is_lit_alike_from_both_sides() {
    let (ccw, cw) = ([[0, 1, 2]], [[0, 2, 1]]);
    let corners = [[-8, 1, -8], [8, -2, -8], [0, 0, 8]];
    let drawn = |triangles: &[[u32; 3]]| {
        let look = SurfaceStyle { frame: Some(FRAME), ..SurfaceStyle::default() };
        surface(&lattice(&corners, triangles, 0.0), &look, &params(View::FRONT), &Exec::default()).unwrap()
    };
    let image = drawn(&ccw);
    assert_eq!(image, drawn(&cw));
    assert!(image.rgba()[4 * (60 + 120 * 60)] > 120, "the lamp is beside the eye");
}
