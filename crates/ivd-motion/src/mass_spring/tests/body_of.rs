//! Which springs there are, and what they are made of.

use ivd_core::{Labels, VoxelIndex};
use ivd_elastic::Tissue;

use super::*;

fn ends(lattice: &Lattice, kind: Kind) -> Vec<[u32; 2]> {
    let all = links(lattice.triangles(), &lattice.local_positions(), |_| true);
    all.iter().filter(|link| link.kind == kind).map(|link| link.ends).collect()
}

#[test]
fn a_halved_square_has_its_sides_and_both_diagonals() {
    let square = flat(2, 2, vec![[0, 1, 3], [0, 3, 2]]);
    assert_eq!(ends(&square, Kind::Structural), [[0, 1], [0, 2], [0, 3], [1, 3], [2, 3]]);
    assert_eq!(ends(&square, Kind::Shear), [[1, 2]]);
    assert!(ends(&square, Kind::Flexion).is_empty());
}

#[test]
fn every_square_of_a_sheet_has_one_shear_spring_and_every_edge_between_squares_bends() {
    for side in [2, 5, 8] {
        let sheet = sheet(side);
        let squares = (side - 1) * (side - 1);
        assert_eq!(ends(&sheet, Kind::Structural).len(), 2 * side * (side - 1) + squares);
        let shear = ends(&sheet, Kind::Shear);
        assert_eq!(shear.len(), squares);
        let rest = sheet.local_positions();
        assert!(shear.iter().all(|[a, b]| {
            ((rest[*a as usize] - rest[*b as usize]).norm() - 2.0_f64.sqrt()).abs() < 1e-12
        }));
        // Where diagonals meet, a pair is opposite two edges: one spring.
        let mut flexion = ends(&sheet, Kind::Flexion);
        assert!(flexion.len() <= 2 * (side - 1) * (side - 2));
        let count = flexion.len();
        flexion.dedup();
        assert_eq!(flexion.len(), count);
    }
}

#[test]
fn doubled_pinched_and_flat_triangles_add_no_second_spring() {
    let twice = flat(2, 2, vec![[0, 1, 3], [0, 3, 2], [0, 1, 3], [3, 0, 1], [2, 2, 2], [1, 3, 3]]);
    let all = links(twice.triangles(), &twice.local_positions(), |_| true);
    assert!(all.windows(2).all(|w| w[0].ends < w[1].ends));
    assert_eq!(all.iter().filter(|link| link.kind == Kind::Structural).count(), 5);
    assert!(all.iter().all(|link| link.aspect.is_finite()));
}

#[test]
fn youngs_modulus_gives_a_sheet_its_stiffness_whatever_the_triangles() {
    // Van Gelder's springs, stretched along x: E t per mm of width, at Poisson's ratio 1/3, for springs that fill the plane.
    let params = with_springs(Springs {
        youngs_kpa: Some(20.0),
        thickness: 3.0,
        shear: 0.0,
        flexion: 0.0,
        ..Springs::default()
    });
    let lattice = sheet(9);
    let body = body(&lattice, &[moved(40, [0.0; 3], 100.0)], &[], &params);
    let square =
        |link: [usize; 2]| body.list.iter().find(|s| s.ends.map(|v| v as usize) == link).unwrap().stiffness;
    // E t = 60 N/m; an inner side of a square has two triangles of half a square each, a diagonal too, at twice the length squared.
    assert!((square([10, 11]) - 60e3).abs() < 1e-6 && (square([10, 20]) - 30e3).abs() < 1e-6);
    assert!((square([0, 1]) - 30e3).abs() < 1e-6, "a side at the border has one");
}

#[test]
fn mass_is_area_times_density() {
    let lattice = sheet(9);
    let params = with_springs(Springs { density: 2e-3, ..Springs::default() });
    let whole = body(&lattice, &[moved(40, [0.0; 3], 100.0)], &[], &params);
    assert!((whole.mass.iter().sum::<f64>() - 64.0 * 2e-3).abs() < 1e-12);
    let unit = Params { springs: Springs { vertex_mass: Some(1.0), ..params.springs }, ..params };
    let whole = body(&lattice, &[moved(40, [0.0; 3], 100.0)], &[], &unit);
    assert!(whole.mass.iter().all(|m| *m == 1.0));
}

#[test]
fn a_vertex_takes_the_material_of_the_voxel_inside() {
    let lattice = sheet(9);
    // Triangles turn upwards: the layer z = 0 is inside.
    let ids: Vec<u16> = (0..lattice.grid().len())
        .map(|i| match lattice.grid().index(i) {
            VoxelIndex([_, _, 1]) => 9,
            VoxelIndex([x, ..]) if x < 4 => 1,
            _ => 2,
        })
        .collect();
    let labels = Labels::new(lattice.grid().clone(), ids.into(), Vec::new()).unwrap();
    let stiff = Material { stiffness: Some(150.0), density: Some(4e-3), ..Material::default() };
    let params = with_springs(Springs { material: [(2, stiff)].into(), ..Springs::default() });
    let handle = [moved(40, [0.0; 3], 100.0)];
    let prepared = Prepared::new(&lattice, Some(&labels), &handle, &[], &params, &Exec::default()).unwrap();
    let spring = |ends: [u32; 2]| prepared.body.list.iter().find(|s| s.ends == ends).unwrap().stiffness;
    assert_eq!((spring([10, 11]), spring([14, 15])), (50e3, 150e3));
    assert_eq!(spring([12, 13]), 75e3, "two halves in a row");
    assert!((prepared.body.mass[10] - 1e-3).abs() < 1e-15 && (prepared.body.mass[15] - 4e-3).abs() < 1e-15);
    let soft = Params {
        springs: Springs {
            material: [(2, Material { youngs_kpa: Some(7.0), ..Material::default() })].into(),
            ..params.springs
        },
        ..params
    };
    let prepared = Prepared::new(&lattice, Some(&labels), &handle, &[], &soft, &Exec::default()).unwrap();
    let modulus = prepared.body.list.iter().find(|s| s.ends == [14, 15]).unwrap().stiffness;
    assert!((modulus - 7e3).abs() < 1e-9);
    let of = |tissue| {
        let own = Material { tissue: Some(tissue), ..Material::default() };
        with_springs(Springs { material: [(2, own)].into(), ..Springs::default() })
    };
    let fat =
        Prepared::new(&lattice, Some(&labels), &handle, &[], &of(Tissue::Fat), &Exec::default()).unwrap();
    let modulus = fat.body.list.iter().find(|s| s.ends == [14, 15]).unwrap().stiffness;
    assert!((modulus - 2.3e3).abs() < 1e-9, "{modulus}");
    // Bone stays, and can't be pushed.
    let on_bone = |x: usize| moved(9 * 4 + x, [0.0, 0.0, 0.5], 100.0);
    let bone = of(Tissue::Bone);
    let solved = solve(&lattice, Some(&labels), &[on_bone(0)], &[], &bone, &Exec::default()).unwrap();
    let at = |v: usize| solved.motion.frames()[0].displacement[v];
    for v in 0..lattice.keys().len() {
        let is_bone = lattice.voxel(v).0.x > 3.0;
        assert!(!is_bone || (at(v) == [0.0; 3] && solved.motion.role(v) == ivd_core::Role::Held), "{v}");
    }
    assert!(at(9 * 4 + 2) != [0.0; 3]);
    let error = solve(&lattice, Some(&labels), &[on_bone(7)], &[], &bone, &Exec::default()).unwrap_err();
    assert!(error.to_string().contains("lies on what is rigid"), "{error}");
    let elsewhere =
        Labels::new(Grid::with_spacing([9, 9, 2], [2.0; 3]).unwrap(), vec![0; 162].into(), Vec::new());
    let error = Prepared::new(&lattice, Some(&elsewhere.unwrap()), &handle, &[], &soft, &Exec::default());
    assert!(error.unwrap_err().to_string().contains("labels"));
}

#[test]
fn a_smaller_reach_has_the_same_springs_within() {
    let lattice = sheet(21);
    let params = with_springs(Springs { flexion: 0.3, ..Springs::default() });
    let whole = body(&lattice, &[moved(220, [0.0; 3], 100.0)], &[], &params);
    let part = body(&lattice, &[moved(220, [0.0; 3], 5.0)], &[], &params);
    assert!(part.loose < whole.loose && !part.leading_out.is_empty() && whole.leading_out.is_empty());
    let named = |body: &Body, s: &spring::Spring| {
        let mut ends = s.ends.map(|v| body.vertices[v as usize]);
        ends.sort_unstable();
        (ends, s.stiffness.to_bits(), s.length.to_bits())
    };
    let mut all: Vec<_> = whole.list.iter().map(|s| named(&whole, s)).collect();
    let mut some: Vec<_> = part.list.iter().map(|s| named(&part, s)).collect();
    let reached = |v: u32| part.vertices[..part.loose].contains(&v);
    all.retain(|(ends, ..)| ends.iter().any(|v| reached(*v)));
    all.sort_unstable();
    some.sort_unstable();
    assert_eq!(all, some);
    for (v, m) in part.vertices.iter().zip(&part.mass) {
        assert_eq!(*m, whole.mass[*v as usize]);
    }
}
