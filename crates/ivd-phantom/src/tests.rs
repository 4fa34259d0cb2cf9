use super::*;

fn make(shape: Shape, size: usize, voxel_type: VoxelType, noise: Option<f64>) -> Phantom {
    let params = Params { shape, size, noise, voxel_type, ..Params::default() };
    generate(&params, &Exec::default()).unwrap()
}

#[test]
fn inside_is_where_the_signed_distance_is_negative() {
    for shape in [Shape::Sphere, Shape::Torus, Shape::Gyroid, Shape::Spheres, Shape::Shell, Shape::Bars] {
        let phantom = make(shape, 33, VoxelType::F32, None);
        for i in 0..phantom.truth.ids().len() {
            let at = phantom.truth.grid().index(i).0.map(|v| v as f64);
            let d = signed_distance(shape, at, 33);
            assert_eq!(phantom.truth.ids()[i] == 1, d < 0.0, "{shape} at {at:?}: {d}");
        }
    }
}

#[test]
fn sphere_scalar_is_the_distance_over_eight_and_one_half_on_the_surface() {
    let phantom = make(Shape::Sphere, 40, VoxelType::F32, None);
    for i in (0..phantom.truth.ids().len()).step_by(97) {
        let at = phantom.volume.grid().index(i).0;
        let q = [at[0] as f64 - 19.63, at[1] as f64 - 19.29, at[2] as f64 - 19.87];
        let d = (q[0].powi(2) + q[1].powi(2) + q[2].powi(2)).sqrt() - 14.0;
        assert!((phantom.volume.voxels().get(i) - (0.5 - d / 8.0).clamp(0.0, 1.0)).abs() < 1e-6);
    }
}

#[test]
fn head_holds_six_named_classes_whose_counts_add_up_and_whose_means_are_the_truths() {
    let clean = make(Shape::Head, 48, VoxelType::F32, Some(0.0));
    let names: Vec<_> = clean.truth.classes().iter().map(|c| c.name.clone().unwrap()).collect();
    assert_eq!(names, ["air", "skin/soft", "skull", "csf", "grey", "white"]);
    assert_eq!(clean.truth.classes().iter().map(|c| c.voxels).sum::<u64>(), 48 * 48 * 48);
    for (class, mean) in clean.truth.classes().iter().zip([0.02, 0.60, 0.10, 0.25, 0.50, 0.75]) {
        assert!((class.mean - mean).abs() < 1e-7 && class.sd == 0.0, "{class:?}");
    }
    let noisy = make(Shape::Head, 48, VoxelType::F32, None);
    assert_eq!(noisy.truth.ids(), clean.truth.ids(), "noise leaves the truth alone");
    let white = noisy.truth.class(5).unwrap();
    assert!((white.sd - 0.04).abs() < 0.004 && (white.mean - 0.751).abs() < 0.004, "{white:?}");
}

#[test]
fn a_neck_holds_five_vertebrae_apart_from_each_other_with_discs_between_and_scales_with_its_size() {
    let mut fractions = Vec::new();
    for size in [48, 96] {
        let neck = make(Shape::Neck, size, VoxelType::F32, None);
        let names: Vec<_> = neck.truth.classes().iter().map(|c| c.name.clone().unwrap()).collect();
        assert_eq!(names, ["air", "soft", "disc", "bone"]);
        for (class, mean) in neck.truth.classes().iter().zip([0.02, 0.45, 0.65, 0.95]) {
            assert!((class.mean - mean).abs() < 1e-7 && class.sd == 0.0, "{class:?}");
        }
        // Along the spine's axis: tissue, then bone and disc by turns, then tissue.
        let label = |z: usize| {
            let at = [size / 2, (0.44 * size as f64) as usize, z];
            neck.truth.ids()[neck.truth.grid().linear(ivd_core::VoxelIndex(at))]
        };
        let mut met: Vec<u16> = (0..size).map(label).collect();
        met.dedup();
        assert_eq!(met, [1, 3, 2, 3, 2, 3, 2, 3, 2, 3, 1]);
        fractions.push([1, 2, 3].map(|c| neck.truth.class(c).unwrap().voxels as f64 / (size as f64).powi(3)));
    }
    for (small, large) in fractions[0].iter().zip(&fractions[1]) {
        assert!((small / large - 1.0).abs() < 0.1, "{fractions:?}");
    }
}

#[test]
fn threads_do_not_change_a_byte_and_seeds_do() {
    let params = Params { size: 20, ..Params::default() };
    let one = generate(&params, &Exec::default().with_threads(1)).unwrap();
    let three = generate(&params, &Exec::default().with_threads(3)).unwrap();
    assert_eq!(one, three);
    let other = generate(&Params { seed: 8, ..params }, &Exec::default()).unwrap();
    assert_ne!(one.volume.voxels(), other.volume.voxels());
}

#[test]
fn integer_types_hold_the_rounded_scalar_times_their_largest_value() {
    let f = make(Shape::Torus, 21, VoxelType::F32, None);
    let u = make(Shape::Torus, 21, VoxelType::U16, None);
    for i in 0..f.truth.ids().len() {
        assert!((f.volume.voxels().get(i) * 65535.0 - u.volume.voxels().get(i)).abs() <= 0.51);
    }
}

#[test]
fn one_voxel_is_a_phantom_and_impossible_parameters_name_their_field() {
    for shape in Shape::ALL {
        let phantom = make(shape, 1, VoxelType::U8, None);
        assert_eq!(phantom.truth.classes().iter().map(|c| c.voxels).sum::<u64>(), 1);
        assert_eq!(shape.to_string().parse::<Shape>().unwrap(), shape);
    }
    let field = |params: Params| params.check().unwrap_err().field;
    assert_eq!(field(Params { size: 0, ..Params::default() }), "size");
    assert_eq!(field(Params { size: usize::MAX, ..Params::default() }), "size");
    assert_eq!(field(Params { noise: Some(f64::NAN), ..Params::default() }), "noise");
    assert_eq!(field(Params { voxel_type: VoxelType::I16, ..Params::default() }), "voxel_type");
    assert!("cube".parse::<Shape>().unwrap_err().to_string().contains("gyroid"));
}

#[test]
fn memory_limit_and_cancel_stop_it() {
    let params = Params { size: 64, ..Params::default() };
    let tight = Exec::default().with_memory_limit(Some(1000));
    assert!(matches!(generate(&params, &tight), Err(Error::MemoryLimit { .. })));
    let stopped = Exec::default();
    stopped.cancel.cancel();
    assert_eq!(generate(&params, &stopped).unwrap_err(), Error::Cancelled);
}

/// FNV-1a of the noise-free 8-bit voxels at size 24, from independent Python programs of the same formulas.
#[test]
fn noise_free_bytes_are_those_of_an_independent_implementation() {
    let golden = [
        (Shape::Head, 0x2a3a_c22c_9f7d_317e_u64),
        (Shape::Sphere, 0xca1b_2a7a_9e84_8358),
        (Shape::Torus, 0xd1b4_fd29_6370_a023),
        (Shape::Gyroid, 0x4e66_3627_d54e_f925),
        (Shape::Spheres, 0xa701_02c3_85ed_1a3b),
        (Shape::Shell, 0xd5bf_74f4_274d_3be5),
        (Shape::Bars, 0x9821_f782_e685_d725),
        (Shape::Neck, 0xc263_a1a6_c019_d094),
    ];
    for (shape, expected) in golden {
        let phantom = make(shape, 24, VoxelType::U8, Some(0.0));
        let hash = phantom
            .volume
            .voxels()
            .as_bytes()
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        assert_eq!(hash, expected, "{shape}");
    }
}
