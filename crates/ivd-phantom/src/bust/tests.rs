use std::sync::OnceLock;

use ivd_core::{Exec, VoxelIndex, VoxelType, sets};

use super::super::{Contrast, Params, Phantom, Shape, generate};
use super::contrast::Tissue;
use super::*;

/// A size at which a voxel (2.5 mm on an adult) is thinner than the skin.
const SIZE: usize = 128;

fn make(size: usize, contrast: Contrast) -> Phantom {
    let params =
        Params { shape: Shape::Bust, size, contrast, voxel_type: VoxelType::F32, ..Params::default() };
    generate(&params, &Exec::default()).unwrap()
}

fn mr() -> &'static Phantom {
    static MADE: OnceLock<Phantom> = OnceLock::new();
    MADE.get_or_init(|| make(SIZE, Contrast::Mr))
}

fn ct() -> &'static Phantom {
    static MADE: OnceLock<Phantom> = OnceLock::new();
    MADE.get_or_init(|| make(SIZE, Contrast::Ct))
}

fn ids() -> &'static [u16] {
    mr().truth.ids()
}

fn label([x, y, z]: [usize; 3]) -> u16 {
    ids()[(z * SIZE + y) * SIZE + x]
}

/// Sizes of the connected parts of what is chosen, largest first; voxels that share a corner touch.
fn parts(size: usize, chosen: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut of = sets::singles(size.pow(3));
    let grid = mr().truth.grid();
    assert_eq!(grid.len(), of.len());
    for i in (0..of.len()).filter(|&i| chosen(i)) {
        let at = grid.index(i).0;
        for step in 0..27 {
            let near: [usize; 3] =
                std::array::from_fn(|a| (at[a] + step / 3_usize.pow(a as u32) % 3).wrapping_sub(1));
            if near.iter().all(|&v| v < size) {
                let j = grid.linear(VoxelIndex(near));
                if j < i && chosen(j) {
                    sets::join(&mut of, i as u32, j as u32);
                }
            }
        }
    }
    sets::flatten(&mut of);
    let mut counts = std::collections::BTreeMap::new();
    for i in (0..of.len()).filter(|&i| chosen(i)) {
        *counts.entry(of[i]).or_insert(0) += 1;
    }
    let mut sizes: Vec<usize> = counts.into_values().collect();
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}

fn count(tissues: &[Tissue]) -> f64 {
    let voxel = (SIDE / SIZE as f64).powi(3) / 1000.0;
    ids().iter().filter(|&&id| tissues.iter().any(|&t| t as u16 == id)).count() as f64 * voxel
}

#[test]
fn every_tissue_is_there_at_64_and_has_its_name() {
    let names: Vec<_> =
        make(64, Contrast::Mr).truth.classes().iter().map(|c| c.name.clone().unwrap()).collect();
    assert_eq!(names, TISSUES.map(|(name, ..)| name));
}

#[test]
fn organs_are_in_as_many_parts_as_in_a_body() {
    let expected = [
        (Tissue::Air, 1),
        (Tissue::Skin, 1),
        (Tissue::Skull, 1),
        (Tissue::Jaw, 1),
        (Tissue::Vertebrae, 8),
        (Tissue::Discs, 7),
        (Tissue::Eyes, 2),
        (Tissue::Lenses, 2),
        (Tissue::Ventricles, 1),
        (Tissue::Grey, 1),
        (Tissue::CerebellarWhite, 1),
        (Tissue::Stem, 1),
        (Tissue::Airway, 1),
    ];
    for (tissue, number) in expected {
        let found = parts(SIZE, |i| ids()[i] == tissue as u16);
        assert_eq!(found.len(), number, "{tissue:?}: {found:?}");
    }
    // Teeth touch their neighbours at this size, but not those of the other jaw.
    assert!(parts(SIZE, |i| ids()[i] == Tissue::Teeth as u16).len() >= 2);
    // Thin blades of white matter may be met as separate voxels; nearly all of it is one.
    let white = parts(SIZE, |i| ids()[i] == Tissue::White as u16);
    assert!(white[0] as f64 > 0.99 * white.iter().sum::<usize>() as f64, "{white:?}");
}

/// Between air and skin at the middle of their values the body is one piece and the air around it another, without specks or pockets. In CT,
/// where nothing inside is as dark as air, that is all there is: the airway opens at the nostrils. (In MR bone is as dark as air.)
#[test]
fn the_skin_is_one_surface_without_specks() {
    for (phantom, contrast) in [(mr(), Contrast::Mr), (ct(), Contrast::Ct)] {
        let level = f64::midpoint(Tissue::Air.value(contrast), Tissue::Skin.value(contrast));
        let solid = |i: usize| phantom.volume.voxels().get(i) >= level;
        if contrast == Contrast::Ct {
            assert_eq!(parts(SIZE, |i| !solid(i)).len(), 1);
            assert_eq!(parts(SIZE, solid).len(), 1);
            // One piece with two holes through it: from the wind pipe's end to either nostril.
            assert_eq!(euler(solid), 1 - 2);
        }
        let open = |i: usize| !solid(i) && ids()[i] == Tissue::Air as u16;
        let outer = reached(open);
        assert!((0..ids().len()).all(|i| outer[i] == open(i)), "{contrast}: air that is shut in");
        assert_eq!(parts(SIZE, |i| !outer[i]).len(), 1, "{contrast}: specks");
    }
}

/// Euler characteristic of the chosen voxels as closed cubes: corners less edges plus faces less cubes.
fn euler(chosen: impl Fn(usize) -> bool) -> i64 {
    // A cell has an even coordinate where it has no extent, an odd one where it spans a voxel.
    let width = 2 * SIZE + 1;
    let mut cells = vec![false; width.pow(3)];
    for i in (0..SIZE.pow(3)).filter(|&i| chosen(i)) {
        let [x, y, z] = mr().truth.grid().index(i).0.map(|v| 2 * v);
        for step in 0..27 {
            cells[((z + step / 9) * width + y + step / 3 % 3) * width + x + step % 3] = true;
        }
    }
    let sign = |c: usize| [1, -1][(c % width + c / width % width + c / width / width) % 2];
    // Parity of the coordinates' sum is that of the number of odd ones: the cell's dimension.
    (0..cells.len()).filter(|&c| cells[c]).map(sign).sum()
}

/// Voxels that are joined to the first one by steps across faces through what is free.
fn reached(free: impl Fn(usize) -> bool) -> Vec<bool> {
    let grid = mr().truth.grid();
    let mut seen = vec![false; grid.len()];
    let mut front = vec![0];
    seen[0] = true;
    while let Some(i) = front.pop() {
        let at = grid.index(i).0;
        for a in 0..3 {
            for near in [at[a].wrapping_sub(1), at[a] + 1].into_iter().filter(|&v| v < SIZE) {
                let mut to = at;
                to[a] = near;
                let j = grid.linear(VoxelIndex(to));
                if free(j) && !seen[j] {
                    seen[j] = true;
                    front.push(j);
                }
            }
        }
    }
    seen
}

#[test]
fn on_the_way_out_of_the_brain_come_bone_skin_and_air_in_this_order() {
    let brain = [Tissue::Grey as u16, Tissue::White as u16];
    let first_height = ((ORIGIN[2] + 25.0) * SIZE as f64 / SIDE) as usize;
    let (mut walks, mut wet) = (0, 0);
    for i in (0..ids().len()).step_by(7).filter(|&i| brain.contains(&ids()[i])) {
        let at = mr().truth.grid().index(i).0;
        if at[2] < first_height {
            continue;
        }
        // To the left, the right, the back, and up.
        for (axis, sign) in [(0, -1), (0, 1), (1, -1), (2, 1)] {
            let mut met = Vec::new();
            let mut to = at.map(|v| v as isize);
            while to.iter().all(|&v| (0..SIZE as isize).contains(&v)) {
                met.push(label(to.map(|v| v as usize)));
                to[axis] += sign;
            }
            let first = |t: Tissue| met.iter().position(|&id| id == t as u16);
            let order = [Tissue::Skull, Tissue::Skin, Tissue::Air].map(first);
            assert!(order.iter().all(Option::is_some) && order.is_sorted(), "{at:?}, axis {axis}: {met:?}");
            let bone = first(Tissue::Skull).unwrap();
            wet += usize::from(first(Tissue::Fluid).is_some_and(|at| at < bone));
            assert!(met[bone..].iter().all(|id| !brain.contains(id)), "brain beyond the skull at {at:?}");
            walks += 1;
        }
    }
    assert!(walks > 10_000, "{walks}");
    // The film of fluid over the crowns is thinner than a voxel.
    assert!(wet as f64 > 0.9 * walks as f64, "{wet} of {walks}");
}

#[test]
fn white_matter_touches_neither_air_nor_bone() {
    let grid = mr().truth.grid();
    let kept_away = [Tissue::Air, Tissue::Airway, Tissue::Skin, Tissue::Skull].map(|t| t as u16);
    for i in (0..ids().len()).filter(|&i| ids()[i] == Tissue::White as u16) {
        let at = grid.index(i).0;
        for a in 0..3 {
            for near in [at[a] - 1, at[a] + 1] {
                let mut to = at;
                to[a] = near;
                assert!(!kept_away.contains(&label(to)), "{at:?} beside {to:?}");
            }
        }
    }
}

/// Against measures of adults: a brain of 1.1 to 1.5 l, proportions of the head by Farkas (1994).
#[test]
fn volumes_and_proportions_are_an_adults() {
    let brain = count(&[
        Tissue::Grey,
        Tissue::White,
        Tissue::Cerebellum,
        Tissue::CerebellarWhite,
        Tissue::Stem,
        Tissue::Ventricles,
    ]);
    assert!((1100.0..1500.0).contains(&brain), "{brain} ml of brain");
    let grey_to_white = count(&[Tissue::Grey]) / count(&[Tissue::White]);
    assert!((0.8..1.6).contains(&grey_to_white), "{grey_to_white}");
    let cerebellum = count(&[Tissue::Cerebellum, Tissue::CerebellarWhite]);
    assert!((90.0..170.0).contains(&cerebellum), "{cerebellum} ml of cerebellum");
    assert!((10.0..40.0).contains(&count(&[Tissue::Ventricles])));
    assert!((11.0..18.0).contains(&count(&[Tissue::Eyes, Tissue::Lenses])), "two eyes of 7 ml");

    let body = |[x, y, z]: [usize; 3]| label([x, y, z]) != Tissue::Air as u16;
    let extent = |axis: usize, from_z: f64| {
        let low = (from_z * SIZE as f64) as usize;
        let cells = (low..SIZE).flat_map(|z| (0..SIZE * SIZE).map(move |i| [i % SIZE, i / SIZE, z]));
        let along: Vec<usize> = cells.filter(|&c| body(c)).map(|c| c[axis]).collect();
        [*along.iter().min().unwrap() as f64, *along.iter().max().unwrap() as f64 + 1.0]
            .map(|v| v / SIZE as f64)
    };
    let millimetres = |[low, high]: [f64; 2]| (high - low) * SIDE;
    assert!((extent(2, 0.0)[1] - 0.95).abs() < 0.012, "top of the head: {:?}", extent(2, 0.0));
    assert!((extent(1, 0.45)[1] - 0.93).abs() < 0.012, "tip of the nose: {:?}", extent(1, 0.45));
    // Over the eyes, where there are neither nose nor ears.
    let over = (ORIGIN[2] + 32.0) / SIDE;
    let (breadth, length) = (millimetres(extent(0, over)), millimetres(extent(1, over)));
    assert!((0.63..0.70).contains(&(breadth / 230.0)), "breadth {breadth} mm");
    assert!((0.78..0.86).contains(&(length / 230.0)), "length {length} mm");
    // Between the ears, up from the middle of the brain: the vault, measured as a column of voxels.
    let column: Vec<u16> = (SIZE / 2 + 10..SIZE).map(|z| label([SIZE / 2 + 10, SIZE / 2, z])).collect();
    let vault = column.iter().filter(|&&id| id == Tissue::Skull as u16).count() as f64 * SIDE / SIZE as f64;
    assert!((5.0..11.0).contains(&vault), "{vault} mm of bone");
}

#[test]
fn a_bust_of_twice_the_size_is_the_same_bust() {
    let (small, large) = (make(96, Contrast::Mr), make(192, Contrast::Mr));
    let same = (0..96_usize.pow(3)).filter(|&i| {
        let [x, y, z] = small.truth.grid().index(i).0.map(|v| 2 * v);
        small.truth.ids()[i] == large.truth.ids()[large.truth.grid().linear(VoxelIndex([x, y, z]))]
    });
    let share = same.count() as f64 / 96_f64.powi(3);
    assert!(share >= 0.97, "{share}");
}

#[test]
fn the_sides_are_alike_but_not_mirrored() {
    let mut differ = 0;
    for i in 0..ids().len() {
        let [x, y, z] = mr().truth.grid().index(i).0;
        differ += usize::from((ids()[i] == 0) != (label([SIZE - 1 - x, y, z]) == 0));
    }
    let body = ids().iter().filter(|&&id| id != 0).count();
    assert!(differ > 0 && (differ as f64) < 0.01 * body as f64, "{differ} of {body} voxels");
    let grey = |id: u16| id == Tissue::Grey as u16;
    let folds = (0..ids().len()).filter(|&i| {
        let [x, y, z] = mr().truth.grid().index(i).0;
        grey(ids()[i]) && !grey(label([SIZE - 1 - x, y, z]))
    });
    let share = folds.count() as f64 / ids().iter().filter(|&&id| grey(id)).count() as f64;
    assert!((0.02..0.5).contains(&share), "{share} of the cortex is elsewhere on the other side");
}

#[test]
fn tissues_are_as_bright_as_their_scanner_shows_them() {
    let means = |p: &Phantom, tissues: &[Tissue]| -> Vec<f64> {
        tissues.iter().map(|&t| p.truth.class(t as u16).unwrap().mean).collect()
    };
    let rising = |values: &[f64]| values.windows(2).all(|w| w[1] > w[0] + 0.03);
    let in_mr = means(mr(), &[Tissue::Air, Tissue::Skull, Tissue::Fluid, Tissue::Grey, Tissue::White]);
    assert!(rising(&in_mr), "{in_mr:?}");
    let fat = means(mr(), &[Tissue::Muscle, Tissue::Skin, Tissue::Fat]);
    assert!(rising(&fat), "{fat:?}");
    let in_ct = [Tissue::Air, Tissue::Fat, Tissue::Muscle, Tissue::Grey, Tissue::Skull, Tissue::Teeth];
    assert!(rising(&in_ct.map(|t| t.value(Contrast::Ct))));
    let in_ct = means(ct(), &in_ct);
    assert!(rising(&in_ct), "{in_ct:?}");
    assert_eq!(mr().truth.ids(), ct().truth.ids(), "the contrast leaves the truth alone");
}

/// The plain twin of bricks that leave layers out: every layer at every voxel.
#[test]
fn bricks_leave_out_nothing_that_counts() {
    for n in [9, 40, 112] {
        let bust = Bust::new(n, Contrast::Mr);
        let all = Coats { ground: Tissue::Air, layers: Layer::ALL.to_vec(), deep: false };
        let slabs = if n > 64 { vec![24, 56, 64] } else { (0..n).step_by(BRICK).collect() };
        for z in slabs {
            let depth = BRICK.min(n - z);
            let (mut values, mut labels) = (vec![0.0; depth * n * n], vec![0; depth * n * n]);
            bust.slab(z, &mut values, &mut labels);
            for i in (0..values.len()).step_by(if n > 64 { 5 } else { 1 }) {
                let voxel = [i % n, i / n % n, z + i / (n * n)];
                let (value, label) = bust.paint(&all, voxel);
                assert!((values[i] - value).abs() < 1e-9, "{voxel:?} of {n}: {} or {value}", values[i]);
                assert_eq!(labels[i], label, "{voxel:?} of {n}");
            }
        }
    }
}

/// The same of large busts, whose bricks are small against what is sculpted: places drawn evenly, each brick's corners and middles.
#[test]
fn small_bricks_leave_out_nothing_that_counts() {
    const BRICKS: usize = 8_000;
    let all = Coats { ground: Tissue::Air, layers: Layer::ALL.to_vec(), deep: false };
    for n in [256, 700, 2048] {
        let bust = Bust::new(n, Contrast::Ct);
        let mut met = 0;
        for draw in 1..=BRICKS {
            // Multiples of irrational numbers fill the cube evenly (Roberts 2018).
            let low = [0.819_172_513, 0.671_043_607, 0.549_700_478]
                .map(|step| ((draw as f64 * step).fract() * (n / BRICK) as f64) as usize * BRICK);
            // One in ten at a nostril, where the airway opens.
            let nostril = [6.4, 97.0, -40.0].map(|v| v + (low[0] % 97) as f64 / 16.0 - 3.0);
            let low = if draw % 10 == 0 {
                std::array::from_fn(|a| ((nostril[a] + ORIGIN[a]) / bust.pitch()) as usize / BRICK * BRICK)
            } else {
                low
            };
            let coats = bust.coats(low, low.map(|v| v + BRICK));
            met += usize::from(!coats.layers.is_empty());
            for step in 0..27 {
                let voxel = std::array::from_fn(|a| low[a] + [0, 3, 7][step / 3_usize.pow(a as u32) % 3]);
                let (found, plain) = (bust.paint(&coats, voxel), bust.paint(&all, voxel));
                let alike = (found.0 - plain.0).abs() < 1e-9 && found.1 == plain.1;
                assert!(alike, "{voxel:?} of {n}: {found:?} or {plain:?}");
            }
        }
        assert!(met > BRICKS / 20, "{met} bricks in which a surface may be met");
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let params = Params { shape: Shape::Bust, size: 37, noise: Some(0.05), ..Params::default() };
    let one = generate(&params, &Exec::default().with_threads(1)).unwrap();
    assert_eq!(one, generate(&params, &Exec::default().with_threads(2)).unwrap());
    assert_ne!(one.volume, generate(&Params { noise: None, ..params }, &Exec::default()).unwrap().volume);
}

#[test]
fn the_contrast_is_written_where_it_is_not_the_usual_one() {
    let usual = serde_json::to_value(Params::default()).unwrap();
    assert!(usual.get("contrast").is_none(), "parameters of other phantoms are hashed as before: {usual}");
    let ct = Params { shape: Shape::Bust, contrast: Contrast::Ct, ..Params::default() };
    let written = serde_json::to_value(&ct).unwrap();
    assert_eq!(written["contrast"], "ct");
    assert_eq!(serde_json::from_value::<Params>(written).unwrap(), ct);
    assert!("pet".parse::<Contrast>().unwrap_err().to_string().contains("mr"));
    assert_eq!("ct".parse::<Contrast>().unwrap(), Contrast::Ct);
}
