//! Lengths scaled by 10⁻³ to 10³ and scenes moved by 10⁶ mm.
//!
//! With all lengths times `L`, lengths scale by `L`, and so must forces (springs pull by stretch) while the mass of the
//! surface falls by `L²`, so that the springs keep their period. Times a power of two every number of the scene is the same
//! mantissa with another exponent, and so must every result be: bit for bit, as only sums, products, quotients and roots
//! are taken. Times 10^±3 inputs are rounded, and results differ by what the stages make of one rounding.

use ivd_core::{Exec, Grid, Lattice, Volume, Voxels};
use ivd_field::warp::WarpParams;
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, Refined, collapse};
use ivd_map::{MapResult, OctreeParams};
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::ring::{self, RingParams, RingResult};
use ivd_render::{RenderParams, Rendered, Scene, View};
use ivd_segment::{KmvsParams, Segmentation};

/// Everything that comes of a scene.
struct Results {
    found: Segmentation,
    transfer: ivd_core::TransferFunction,
    lattice: Lattice,
    refined: Refined,
    solved: RingResult,
    mapped: MapResult,
    warped: Volume,
    picture: Rendered,
}

/// The scene with all lengths times `scale`, its origin moved by `shift` (mm).
fn scene(scale: f64, shift: f64) -> Results {
    let exec = Exec::default();
    // Numbers with short mantissas, so that a shift by 10⁶ leaves the picks' places relative to the origin unchanged.
    let spacing = [0.875, 1.0, 1.25].map(|s| s * scale);
    let origin = [shift, -shift, shift];
    let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let grid = Grid::new([15, 14, 13], spacing, origin, upright).unwrap();
    let value = |i: usize| {
        let [x, y, z] = grid.index(i).0.map(|c| c as f64);
        let r = ((x - 6.7) / 1.1).powi(2) + (y - 6.3).powi(2) + ((z - 6.1) / 0.9).powi(2);
        (100.0 - 13.0 * r.sqrt() + 2.0 * (0.9 * x).sin() + 1.7 * (0.8 * y + z).cos()) as f32
    };
    let values: Vec<f32> = (0..grid.len()).map(value).collect();
    let volume = Volume::new(grid, Voxels::from(values)).unwrap();
    let found =
        ivd_segment::kmvs(&volume, None, &KmvsParams { k: 3, ..KmvsParams::default() }, &exec).unwrap();
    let transfer =
        ivd_atf::transfer(&volume, &found.labels, &ivd_atf::Params::default(), &exec).unwrap().transfer;
    let iso = ExtractParams { iso: Iso::Value(52.0) };
    let lattice = extract(&volume, None, &iso, &exec).unwrap().lattice;
    let params =
        RefineParams { target: ivd_lattice::refine::Target::Level(1).into(), ..RefineParams::default() };
    let refined = collapse(&lattice, &params, &exec).unwrap();
    let at = |p: [f64; 3]| Anchor::NearestTo(std::array::from_fn(|a| origin[a] + p[a] * scale));
    let handles = [
        Handle {
            at: at([5.5, 6.0, 11.25]),
            action: Action::Move([0.5, -0.25, 0.75].map(|c| c * scale)),
            radius: 5.5 * scale,
        },
        Handle {
            at: at([9.75, 6.5, 7.5]),
            action: Action::Force([24.0, 12.0, -8.0].map(|c| c * scale)),
            radius: 5.0 * scale,
        },
    ];
    let ring_params = RingParams { density: 1e-3 / (scale * scale), ..RingParams::default() };
    let solved = ring::solve(&lattice, &handles, &[], &ring_params, &exec).unwrap();
    let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec).unwrap();
    let map = OctreeParams::default();
    let mapped = ivd_map::octree(&lattice, &octree, &solved.motion, 0, &map, &exec).unwrap();
    let warped =
        ivd_field::warp::volume(&volume, &mapped.displacement, &WarpParams::default(), &exec).unwrap().output;
    let params =
        RenderParams { size: [40, 32], view: View::FRONT, annotate: false, ..RenderParams::default() };
    let drawn =
        Scene { transfer: Some(&transfer), displacement: Some(&mapped.displacement), ..Scene::new(&volume) };
    let picture = ivd_render::render(&drawn, &params, &exec).unwrap();
    Results { found, transfer, lattice, refined, solved, mapped, warped, picture }
}

/// Largest difference of two motions and of two fields, the second over `scale` (mm).
fn apart(a: &Results, b: &Results, scale: f64) -> [f64; 2] {
    let (u, v) = (&a.solved.motion.frames()[0].displacement, &b.solved.motion.frames()[0].displacement);
    let difference =
        |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|c| (p[c] - q[c] / scale).abs()).fold(0.0, f64::max);
    let motion = u.iter().zip(&v[..]).map(|(p, q)| difference(p, q)).fold(0.0, f64::max);
    let (f, g) = (a.mapped.displacement.forward(), b.mapped.displacement.forward());
    let grid = a.lattice.grid();
    let at = |i: usize| (f.at(grid.index(i)).map(f64::from), g.at(grid.index(i)).map(f64::from));
    let field = (0..grid.len()).map(|i| difference(&at(i).0, &at(i).1)).fold(0.0, f64::max);
    [motion, field]
}

/// What doesn't depend on lengths at all.
fn same_shape(a: &Results, b: &Results, what: &str) {
    assert_eq!(a.found.labels.ids(), b.found.labels.ids(), "{what}");
    assert_eq!(a.found.labels.classes(), b.found.labels.classes(), "{what}");
    assert_eq!(a.lattice.keys(), b.lattice.keys(), "{what}");
    assert_eq!(a.lattice.places(), b.lattice.places(), "{what}");
    assert_eq!(a.lattice.triangles(), b.lattice.triangles(), "{what}");
}

#[test]
fn powers_of_two_change_exponents_and_nothing_else() {
    let plain = scene(1.0, 0.0);
    assert!(plain.mapped.figures.voxels_moved > 100 && plain.solved.max_displacement_mm > 0.5);
    for scale in [1024.0, 1.0 / 1024.0] {
        let scaled = scene(scale, 0.0);
        same_shape(&plain, &scaled, "power of two");
        assert_eq!(plain.refined.lattice.keys(), scaled.refined.lattice.keys(), "{scale}");
        assert_eq!(plain.refined.lattice.triangles(), scaled.refined.lattice.triangles(), "{scale}");
        assert_eq!(plain.refined.max_error_mm, scaled.refined.max_error_mm / scale, "{scale}");
        assert_eq!(apart(&plain, &scaled, scale), [0.0; 2], "{scale}");
        assert_eq!(plain.mapped.figures.min_det_j, scaled.mapped.figures.min_det_j, "{scale}");
        assert_eq!(plain.warped.voxels().as_bytes(), scaled.warped.voxels().as_bytes(), "{scale}");
        let tables = plain.transfer.table().iter().zip(scaled.transfer.table());
        // The reference length is a cube root, and a weight is a power: not exact, but of numbers near each other.
        assert!(tables.flat_map(|(a, b)| a.iter().zip(b)).all(|(a, b)| (a - b).abs() <= 2.0 * f32::EPSILON));
        let difference = ivd_render::difference(&plain.picture.image, &scaled.picture.image).unwrap();
        assert!(difference.max <= 1, "{scale}: pictures {} levels apart", difference.max);
    }
}

#[test]
fn thousands_and_thousandths_differ_by_roundings() {
    let plain = scene(1.0, 0.0);
    for scale in [1e3, 1e-3] {
        let scaled = scene(scale, 0.0);
        same_shape(&plain, &scaled, "power of ten");
        // A rounding of every input; 200 steps of a stable motion keep what each adds, as none is amplified.
        let [motion, field] = apart(&plain, &scaled, scale);
        let most = plain.solved.max_displacement_mm;
        assert!(motion <= 200.0 * 8.0 * f64::EPSILON * most, "{scale}: {motion} mm");
        // Stored in single precision on both sides.
        assert!(field <= 2.0 * f64::from(f32::EPSILON) * most, "{scale}: {field} mm");
        let range = plain.warped.range().unwrap();
        for i in 0..plain.lattice.grid().len() {
            let off = (plain.warped.voxels().get(i) - scaled.warped.voxels().get(i)).abs();
            // The steepest value, a quarter of the range a voxel, times what `f32` vectors of a voxel differ by.
            assert!(off <= 1e-6 * (range[1] - range[0]), "{scale}, voxel {i}: {off}");
        }
        let bounds = (scaled.refined.max_error_mm / scale) / plain.refined.max_error_mm;
        assert!((0.3..3.0).contains(&bounds), "{scale}: bounds {bounds}");
        let difference = ivd_render::difference(&plain.picture.image, &scaled.picture.image).unwrap();
        assert!(difference.max <= 2, "{scale}: pictures {} levels apart", difference.max);
    }
}

#[test]
fn a_scene_a_million_millimetres_away_is_the_same() {
    let plain = scene(1.0, 0.0);
    let moved = scene(1.0, 1e6);
    same_shape(&plain, &moved, "moved");
    assert_eq!(plain.refined.lattice.keys(), moved.refined.lattice.keys());
    assert_eq!(plain.refined.max_error_mm, moved.refined.max_error_mm);
    let [motion, field] = apart(&plain, &moved, 1.0);
    // Handles are picked by places relative to the origin, which are exact here.
    assert_eq!(motion, 0.0);
    // The balls of reach are world places: 10⁶ mm are known to 1.2e-10, and weights fall by 3/2 over the margin.
    let most = plain.solved.max_displacement_mm;
    assert!(field <= 2.0 * f64::from(f32::EPSILON) * most + 1e-9, "{field} mm");
    let difference = ivd_render::difference(&plain.picture.image, &moved.picture.image).unwrap();
    assert!(difference.max <= 2, "pictures {} levels apart", difference.max);
}
