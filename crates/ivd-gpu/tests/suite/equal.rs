//! Kernels that give the processor's bytes: the same work without a device and on one, which must have served.

use ivd_core::{
    BrickIndex, BrickRanges, Displacement, Exec, FieldBricks, Grid, Kernel, Mask, NO_BRICK, Served, Volume,
    Voxels,
};
use ivd_field::warp::plan::Warping;
use ivd_field::warp::{self, WarpParams};
use ivd_gpu::{Gpu, Options};
use ivd_lattice::extract::plan::Cutting;
use ivd_lattice::extract::{ExtractParams, Extracted, Iso, extract};
use ivd_segment::plan::{Counted, Counting, Labelled, Labelling};

use super::sides::on;
use super::{gpu, with_planted};

/// What the processor made.
#[derive(Debug)]
struct Processor<T>(T);
/// What a device made.
#[derive(Debug)]
struct Device<T>(T);

/// The same pass on both.
fn both<K: Kernel, T>(exec: &Exec, work: impl Fn(&Exec) -> T) -> (Processor<T>, Device<T>) {
    let plain = Exec::default();
    let by_processor = Processor(work(&plain));
    assert_eq!(plain.take_served()[K::NAME].gpu, 0);
    exec.take_served();
    let by_device = Device(work(exec));
    let served = exec.take_served()[K::NAME];
    assert!(served.gpu > 0 && served.cpu == 0, "{}: {served:?}", K::NAME);
    (by_processor, by_device)
}

impl<T: PartialEq> PartialEq<Device<T>> for Processor<T> {
    fn eq(&self, other: &Device<T>) -> bool {
        self.0 == other.0
    }
}

/// Grids that divide into no brick, no word and no quad, and of one voxel along an axis or all.
const SIZES: [[usize; 3]; 7] =
    [[1, 1, 1], [1, 9, 33], [70, 1, 1], [31, 17, 9], [33, 8, 3], [64, 10, 16], [95, 23, 21]];

fn noise(i: usize, seed: usize) -> u32 {
    let x = (i as u32 ^ (seed as u32).wrapping_mul(0x9e37_79b9)).wrapping_mul(2_654_435_761);
    (x ^ x >> 15).wrapping_mul(0x2c1b_3c6d) >> 8
}

/// Values like a scan's in every stored type that kernels know: hills with noise; where asked for nothing but noise; floats with gaps, infinities, zeros of both
/// signs and numbers too small for most devices.
pub(super) fn volumes(dims: [usize; 3], wild: bool, seed: usize) -> Vec<Volume> {
    let grid = Grid::with_spacing(dims, [0.7, 1.0, 1.9]).unwrap();
    let value = |i: usize| {
        let at = grid.index(i).0.map(|c| c as f64);
        let hills = 100.0 + 70.0 * (at[0] * 0.31).sin() * (at[1] * 0.23 + 1.0).cos() * (at[2] * 0.4).sin();
        let noise = f64::from(noise(i, seed) % 1000) / 1000.0;
        if wild { 255.0 * noise } else { (hills + 30.0 * noise).clamp(0.0, 255.0).round() }
    };
    let odd = |i: usize| match noise(i, seed + 7) % 40 {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::NEG_INFINITY,
        3 => -0.0,
        4 => 0.0,
        5 => -1e-42,
        6 => 1e-44,
        7 => -f32::NAN,
        _ => value(i) as f32 - 90.0,
    };
    let n = grid.len();
    let all: Vec<Voxels> = vec![
        (0..n).map(|i| value(i) as u8).collect::<Vec<_>>().into(),
        (0..n).map(|i| (value(i) - 128.0) as i8).collect::<Vec<_>>().into(),
        (0..n).map(|i| (value(i) * 257.0) as u16).collect::<Vec<_>>().into(),
        (0..n).map(|i| (value(i) * 257.0 - 32_768.0) as i16).collect::<Vec<_>>().into(),
        (0..n).map(odd).collect::<Vec<_>>().into(),
    ];
    all.into_iter().map(|voxels| Volume::new(grid.clone(), voxels).unwrap()).collect()
}

fn mask(grid: &Grid, seed: usize) -> Mask {
    let inside: Vec<u8> = (0..grid.len()).map(|i| u8::from(noise(i / 3, seed) % 5 > 1)).collect();
    Mask::new(grid.clone(), inside.into()).unwrap()
}

fn bits(index: &BrickIndex) -> (Vec<u32>, Vec<u32>, Vec<u8>) {
    let (min, max, missing) = index.parts();
    let bits = |of: &[f32]| of.iter().map(|v| v.to_bits()).collect();
    (bits(min), bits(max), missing.to_vec())
}

fn ranges_of(volume: &Volume, exec: &Exec) -> bool {
    let work = |exec: &Exec| bits(&exec.launch::<BrickRanges>(&(volume.grid(), volume.voxels())).unwrap());
    let (plain, device) = both::<BrickRanges, _>(exec, work);
    plain == device
}

fn counts_of(volume: &Volume, exec: &Exec) -> bool {
    let mask = mask(volume.grid(), 3);
    [None, Some(&mask)].into_iter().all(|mask| {
        let Some(counted) = Counted::new(volume.voxels(), mask) else { return true };
        let (plain, device) = both::<Counting, _>(exec, |exec| exec.launch::<Counting>(&counted).unwrap());
        assert_eq!(plain.0.iter().sum::<u64>(), mask.map_or(volume.grid().len() as u64, Mask::count));
        plain == device
    })
}

fn labels_of(volume: &Volume, exec: &Exec) -> bool {
    let mask = mask(volume.grid(), 4);
    let [low, high] = volume.stored_range().unwrap_or([0.0, 1.0]);
    let cuts: Vec<f64> = (1..7).map(|i| low + (high - low) * f64::from(i) / 7.3).chain([high]).collect();
    // A cut that is a value, and one that lies between two numbers of the type.
    let cuts = [&cuts[..], &[], &[0.0, 1e-44, 1.0 + 1e-12]].map(<[f64]>::to_vec);
    cuts.iter().all(|cuts| {
        let mut cuts = cuts.clone();
        cuts.sort_by(f64::total_cmp);
        let ids: Vec<u16> = (0..=cuts.len() as u16).map(|i| 1 + i * 37).collect();
        [None, Some(&mask)].into_iter().all(|mask| {
            let of = Labelled { voxels: volume.voxels(), mask, cuts: &cuts, ids: &ids };
            let work = |exec: &Exec| exec.launch::<Labelling>(&of).unwrap().to_vec();
            let (plain, device) = both::<Labelling, _>(exec, work);
            plain == device
        })
    })
}

fn bytes_of(cut: &Extracted) -> (Vec<u64>, Vec<u32>, Vec<[u32; 3]>, u64) {
    let keys = cut.lattice.keys().iter().map(|key| key.0).collect();
    let places = cut.lattice.places().as_flattened().iter().map(|v| v.to_bits()).collect();
    (keys, places, cut.lattice.triangles().to_vec(), cut.bricks_active)
}

fn cut_of(volume: &Volume, exec: &Exec) -> bool {
    let mask = mask(volume.grid(), 5);
    let levels = [0.45, 0.0, 0.61];
    let [low, high] = volume.range().unwrap_or([0.0, 1.0]);
    let at = |share: f64| low + share * (high - low);
    let cuts = levels.map(|share| (Iso::Value(at(share)), None)).into_iter().chain([
        (Iso::Interval { lower: Some(at(0.3)), upper: Some(at(0.5) + 0.5) }, None),
        (Iso::Interval { lower: None, upper: Some(at(0.5) + 0.5) }, None),
        (Iso::Value(high + 1.0), None),
        (Iso::Value(at(0.4)), Some(&mask)),
        (Iso::Mask, Some(&mask)),
    ]);
    let mut all = true;
    for (iso, mask) in cuts {
        // What isn't a lattice at all is found where it is made.
        let work =
            |exec: &Exec| extract(volume, mask, &ExtractParams { iso }, exec).ok().map(|cut| bytes_of(&cut));
        let (plain, device) = both::<Cutting, _>(exec, work);
        assert!(plain.0.is_some());
        all &= plain == device;
    }
    all
}

/// A field that moves bricks here and there by up to some voxels, out of the grid too, and by whole voxels.
fn field(grid: &Grid, seed: usize) -> Displacement {
    let dims = grid.dims();
    let bricks = dims.map(|n| n.div_ceil(8));
    let (mut table, mut vectors) = (Vec::new(), Vec::<[f32; 3]>::new());
    for b in 0..bricks.iter().product::<usize>() {
        if noise(b, seed).is_multiple_of(3) && b > 0 {
            table.push(NO_BRICK);
            continue;
        }
        table.push((vectors.len() / 512) as u32);
        let at = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
        for i in 0..512 {
            let v = [8 * at[0] + i % 8, 8 * at[1] + i / 8 % 8, 8 * at[2] + i / 64];
            let inside = (0..3).all(|a| v[a] < dims[a]);
            let n = noise(512 * b + i, seed);
            let part = |k: u32| ((n.rotate_left(k * 9) % 1009) as f32 - 504.0) / 120.0;
            vectors.push(match n % 11 {
                _ if !inside => [0.0; 3],
                0..3 => [0.0; 3],
                3 => [0.7, -2.0, 1.9],
                4 => [-0.0, 0.0, 0.0],
                5 => [1e-6, 0.0, -1e-6],
                // Half-way between two voxels: ties.
                6 => [0.0, 0.5, 0.0],
                _ => [part(0), part(1), part(2)],
            });
        }
    }
    Displacement::new(
        grid.clone(),
        FieldBricks::zero(dims),
        FieldBricks::new(dims, table, vectors.into()).unwrap(),
    )
    .unwrap()
}

fn warp_of(volume: &Volume, exec: &Exec) -> bool {
    let field = field(volume.grid(), 9);
    let left: Vec<u8> = (0..volume.grid().len()).map(|i| u8::from(noise(i, 10).is_multiple_of(17))).collect();
    let torn = field.clone().with_vacated(left.into()).unwrap();
    [field, torn].into_iter().all(|field| {
        let work = |exec: &Exec| {
            let warped = warp::volume(volume, &field, &WarpParams::default(), exec).unwrap();
            (warped.output.voxels().as_bytes().to_vec(), warped.voxels_resampled)
        };
        let (plain, device) = both::<Warping<u8>, _>(exec, work);
        assert!(volume.grid().len() < 1000 || plain.0.1 > 100, "{}", plain.0.1);
        plain == device
    })
}

pub(super) type Of = fn(&Volume, &Exec) -> bool;
pub(super) const KERNELS: [(&str, Of); 5] = [
    (BrickRanges::NAME, ranges_of),
    (Counting::NAME, counts_of),
    (Labelling::NAME, labels_of),
    (Cutting::NAME, cut_of),
    (Warping::<u8>::NAME, warp_of),
];

fn all_equal(gpu: Gpu, sizes: &[[usize; 3]]) {
    let exec = on(gpu);
    for (i, dims) in sizes.iter().enumerate() {
        for wild in [false, true] {
            for volume in volumes(*dims, wild, i) {
                for (name, of) in KERNELS {
                    let what = format!("{name}: {dims:?} {:?}, wild {wild}", volume.voxel_type());
                    assert!(of(&volume, &exec), "{what}");
                }
            }
        }
    }
}

#[test]
fn every_kernel_of_whole_numbers_gives_the_processors_bytes() {
    let Some(gpu) = gpu(Options::default()) else { return };
    all_equal(gpu, &SIZES);
}

/// For `just stress`: random sizes, values, fields and levels.
#[test]
#[ignore = "takes minutes; `just stress` runs it"]
fn a_thousand_random_fields_give_the_processors_bytes() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let exec = on(gpu);
    for i in 0..200 {
        let dims = [0, 1, 2].map(|a| 1 + noise(i, a) as usize % [90, 40, 25][a]);
        for volume in volumes(dims, i % 3 == 0, 100 + i) {
            for (name, of) in KERNELS {
                assert!(of(&volume, &exec), "{name}: {i}, {dims:?} {:?}", volume.voxel_type());
            }
        }
    }
}

#[test]
fn work_in_many_parts_gives_the_same_bytes() {
    let Some(gpu) = gpu(Options { part: Some(300), ..Options::default() }) else { return };
    all_equal(gpu, &[[64, 10, 16], [31, 17, 9]]);
}

#[test]
fn work_that_is_dispatched_in_two_directions_gives_the_same_bytes() {
    let Some(gpu) = gpu(Options { across: Some(3), ..Options::default() }) else { return };
    all_equal(gpu, &[[64, 10, 16], [95, 23, 21]]);
}

#[test]
fn kernels_asked_for_by_many_threads_at_once_wait_for_each_other_and_not_for_themselves() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let (done, all_done) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let exec = on(gpu).with_threads(3);
        let volumes = volumes([64, 33, 20], false, 4);
        exec.run(|| {
            ivd_core::parallel::for_each_piece_mut(&mut [(); 12], 1, &|i, _| {
                let (_, of) = KERNELS[i % KERNELS.len()];
                // Who served is told of all together.
                let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| of(&volumes[i % 4], &exec)));
            });
        });
        done.send(()).unwrap();
    });
    all_done.recv_timeout(std::time::Duration::from_secs(100)).expect("nobody waits for himself");
}

#[test]
fn a_device_with_small_buffers_gives_the_same_bytes_and_leaves_the_rest_to_the_processor() {
    // Room for the voxels and what is made of them, in parts; and for none of it.
    let Some(narrow) = gpu(Options { max_buffer: Some(1 << 20), part: Some(500), ..Options::default() })
    else {
        return;
    };
    all_equal(narrow, &[[64, 10, 16]]);
    let exec = on(gpu(Options { max_buffer: Some(8 << 10), ..Options::default() }).unwrap());
    let volume = &volumes([64, 10, 16], false, 1)[0];
    let params = ExtractParams { iso: Iso::Value(90.0) };
    let cut = extract(volume, None, &params, &exec).unwrap();
    assert_eq!(exec.take_served()[Cutting::NAME], Served { cpu: 1, gpu: 0 });
    assert_eq!(cut, extract(volume, None, &params, &Exec::default()).unwrap());
}

#[test]
fn what_is_missing_of_a_device_is_the_processors() {
    let Some(least) = gpu(Options { without: vec!["f64", "int64", "timestamps"], ..Options::default() })
    else {
        return;
    };
    let exec = on(least);
    let volume = &volumes([31, 17, 9], false, 1)[0];
    let field = field(volume.grid(), 9);
    let warped = warp::volume(volume, &field, &WarpParams::default(), &exec).unwrap();
    assert_eq!(exec.take_served()[Warping::<u8>::NAME], Served { cpu: 1, gpu: 0 });
    assert_eq!(warped, warp::volume(volume, &field, &WarpParams::default(), &Exec::default()).unwrap());
    // Types that no kernel knows.
    let wide = Volume::new(volume.grid().clone(), vec![7_i32; volume.grid().len()].into()).unwrap();
    wide.find_bricks(&exec).unwrap();
    assert_eq!(exec.take_served()[BrickRanges::NAME], Served { cpu: 1, gpu: 0 });
}

/// An error planted in a shader's text, and the kernel whose bytes differ by it.
const PLANTED: &[(&str, &str, &str)] = &[
    // The high-side apron is missing; rows are counted along the wrong axis; the last ones are dropped.
    (BrickRanges::NAME, "vec3<u32>(9u)", "vec3<u32>(8u)"),
    (BrickRanges::NAME, "row % size.y + params.ny", "row % size.z + params.ny"),
    (BrickRanges::NAME, "row < size.y * size.z;", "row + 1u < size.y * size.z;"),
    (
        BrickRanges::NAME,
        "rank > 0x007fffffu && rank < 0xff800000u",
        "rank > 0x007ffffeu && rank < 0xff800001u",
    ),
    // The voxels after the last whole quad, a run's last value, the mask.
    (Counting::NAME, "4u * quad + j < params.voxels", "4u * quad + 3u < params.voxels"),
    (Counting::NAME, "                    run = 0u;", "                    run = 1u;"),
    (Counting::NAME, "    add(value, run, lane);\n", "\n"),
    (Counting::NAME, "& 0xffu) != 0u", "& 0xffu) == 0u"),
    // A tie taken the other way, the wrong half of a word, a quad on.
    (Labelling::NAME, "table[middle] <= r", "table[middle] < r"),
    (Labelling::NAME, "(r & 1u) * 16u)", "(r & 2u) * 8u)"),
    (Labelling::NAME, "made.z | made.w << 16u", "made.w | made.z << 16u"),
    (Labelling::NAME, "params.first + to;", "params.first + to / 2u * 2u;"),
    // `>=` for `>`; the last bit of a word; a cell's corners; the cases of the last word; a sum of one chunk short; a vertex of the next voxel; a triangle turned over.
    (Cutting::NAME, "r >= params.first", "r > params.first"),
    (Cutting::NAME, "r <= params.last", "r < params.last"),
    (Cutting::NAME, "here >> 1u | sign(w + 1u) << 31u", "here >> 1u"),
    (Cutting::NAME, "pair.z << 4u | pair.w << 6u", "pair.w << 4u | pair.z << 6u"),
    (Cutting::NAME, "w % params.words + 1u < params.words", "w % params.words + 2u < params.words"),
    (Cutting::NAME, "reach < 256u", "reach < 128u"),
    (Cutting::NAME, "values[i] += sums[chunk]", "values[i] += sums[chunk / 2u]"),
    (Cutting::NAME, "if (bit_of(decided[i]) < bit)", "if (bit_of(decided[i]) <= bit)"),
    (Cutting::NAME, "select(0u, 1u, bit == 31u)", "0u"),
    (Cutting::NAME, "own_of(decided[i]));", "0u);"),
    (Cutting::NAME, "packed >> (4u * k)", "packed >> (8u - 4u * k)"),
    (Cutting::NAME, "low | (6u + own)", "low | 6u"),
    // Half a voxel; a swapped axis; ties away from even; the snap; a mark dropped.
    (Warping::<u8>::NAME, "let low = floor(x);\n        let t", "let low = floor(x + 0.5lf);\n        let t"),
    (Warping::<u8>::NAME, "line(i + params.nx, weight.x)", "line(i + params.nx, weight.y)"),
    (Warping::<u8>::NAME, "over > 0.5lf ||", "over >= 0.5lf ||"),
    (Warping::<u8>::NAME, "up || t <= SNAP", "up"),
    (Warping::<u8>::NAME, "1u << (lane & 31u)", "0u"),
];

#[test]
fn every_planted_error_is_found() {
    let mut missed = Vec::new();
    for planted in PLANTED {
        let (kernel, from, to) = *planted;
        let Some(gpu) = gpu(with_one_planted(from, to)) else { return };
        let exec = on(gpu);
        let (_, of) = KERNELS.iter().find(|(name, _)| *name == kernel).unwrap();
        // Rows whose last word of cells holds voxels, and rows whose last word holds none.
        let sizes = [[70, 23, 21], [31, 17, 9]];
        let found = sizes.iter().any(|dims| {
            [false, true].iter().any(|wild| volumes(*dims, *wild, 6).iter().any(|volume| !of(volume, &exec)))
        });
        if !found {
            missed.push((kernel, from));
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

fn with_one_planted(from: &'static str, to: &'static str) -> Options {
    with_planted(Box::leak(Box::new([(from, to)])))
}
