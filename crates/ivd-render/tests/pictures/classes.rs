//! Which classes are drawn, and how.

use ivd_core::op::Op as _;
use ivd_core::{ClassRole, Exec, Grid, Labels, TransferEntry, TransferFunction, Volume, Voxels};
use ivd_render::{ClassLooks, Colour, Coloured, DvrParams, Fit, Opacity, RenderParams, Scene, View, render};

/// Blocks of −100 to the patient's left and of 100 to the right, in nothing of 0.
fn blocks() -> (Volume, Labels) {
    let grid = Grid::with_spacing([48, 32, 32], [1.0; 3]).unwrap();
    let label = |i: usize| {
        let [x, y, z] = grid.index(i).0;
        let inside = (8..24).contains(&y) && (8..24).contains(&z);
        u16::from(inside)
            * match x {
                4..18 => 1,
                30..44 => 2,
                _ => 0,
            }
    };
    let ids: Vec<u16> = (0..grid.len()).map(label).collect();
    let values: Vec<i16> = ids.iter().map(|id| [0, -100, 100][usize::from(*id)]).collect();
    let labels = Labels::new(grid.clone(), ids.into(), vec![]).unwrap();
    (Volume::new(grid, Voxels::from(values)).unwrap(), labels)
}

/// Red below −50, blue above 50, told by the same table in every row.
fn transfer() -> TransferFunction {
    let looks = [([0.9, 0.0, 0.0], 0.9), ([0.0, 0.0, 0.9], 0.9)];
    let entry = |c: usize| TransferEntry {
        class: c as u16 + 1,
        role: ClassRole::Material,
        rgb: looks[c].0,
        opacity: looks[c].1,
        lower: [-100.0, 50.0][c],
        upper: [-50.0, 100.0][c],
        softness: 0.0,
    };
    let row = (0..=200).map(|i| match i {
        0..50 => [0.9, 0.0, 0.0, 0.9],
        50..=150 => [0.0; 4],
        _ => [0.0, 0.0, 0.9, 0.9],
    });
    let rows: Vec<[f32; 4]> = row.clone().chain(row.clone()).chain(row).collect();
    TransferFunction::new([-100.0, 100.0], 201, 1.0, vec![0, 1, 2], rows, vec![entry(0), entry(1)]).unwrap()
}

fn picture() -> RenderParams {
    RenderParams {
        size: [64; 2],
        view: View::FRONT,
        fit: Fit::Volume,
        annotate: false,
        shading: false,
        ..RenderParams::default()
    }
}

/// Pixels of a picture of the blocks that are red, blue, and neither but lit.
fn colours(transfer: &TransferFunction, labels: Option<&Labels>, classes: ClassLooks) -> [usize; 3] {
    let (volume, _) = blocks();
    let inputs = Coloured {
        volume: &volume,
        transfer: Some(transfer),
        labels,
        displacement: None,
        framing: None,
        whole: None,
        lattice: None,
    };
    let (image, _) = DvrParams { picture: picture(), classes, ..DvrParams::default() }
        .run(inputs, &Exec::default())
        .unwrap();
    let mut counts = [0; 3];
    for pixel in image.rgba().chunks(4).filter(|pixel| pixel[..3].iter().any(|&c| c > 24)) {
        let [r, g, b] = [pixel[0], pixel[1], pixel[2]];
        counts[if g > 24 { 2 } else { usize::from(b > r) }] += 1;
    }
    counts
}

#[test]
fn a_hidden_class_is_gone_and_the_others_are_as_they_were() {
    let transfer = transfer();
    let [red, blue, _] = colours(&transfer, None, ClassLooks::default());
    assert!(red > 100 && blue > 100);
    let hidden = ClassLooks { hide: vec![2], ..ClassLooks::default() };
    assert_eq!(colours(&transfer, None, hidden), [red, 0, 0]);
    let hidden = ClassLooks { hide: vec![1], ..ClassLooks::default() };
    assert_eq!(colours(&transfer, None, hidden), [0, blue, 0]);
    let both = ClassLooks { hide: vec![1, 2], ..ClassLooks::default() };
    assert_eq!(colours(&transfer, None, both), [0; 3]);
    let alone = ClassLooks { show: vec![2], ..ClassLooks::default() };
    assert_eq!(colours(&transfer, None, alone), [0, blue, 0]);
    let clear =
        ClassLooks { opacity: [(1, Opacity(0.0)), (2, Opacity(0.0))].into(), ..ClassLooks::default() };
    assert_eq!(colours(&transfer, None, clear), [0; 3]);
}

#[test]
fn a_class_has_the_colour_that_it_is_given() {
    let transfer = transfer();
    let [_, blue, _] = colours(&transfer, None, ClassLooks::default());
    let looks = ClassLooks { colour: [(2, Colour("#00ff00".to_owned()))].into(), ..ClassLooks::default() };
    let [_, left, green] = colours(&transfer, None, looks);
    assert!(left == 0 && green == blue, "{left} blue, {green} green");
}

#[test]
fn a_class_that_is_not_known_is_refused_with_those_that_are() {
    let transfer = transfer();
    let looks = ClassLooks { hide: vec![7], ..ClassLooks::default() };
    let refused = looks.of(&transfer).unwrap_err().to_string();
    assert!(refused.contains("hide") && refused.contains('7') && refused.contains("1, 2"), "{refused}");
    let looks = ClassLooks { show: vec![7], ..ClassLooks::default() };
    assert!(looks.of(&transfer).unwrap_err().to_string().contains("show"));
    let foreign = TransferFunction::new([0.0, 1.0], 2, 1.0, vec![0], vec![[0.5; 4]; 2], vec![]).unwrap();
    let refused = looks.of(&foreign).unwrap_err().to_string();
    assert!(refused.contains("knows no classes"), "{refused}");
}

#[test]
fn what_has_no_label_is_clear_where_labels_are_given() {
    let (volume, labels) = blocks();
    let transfer = transfer();
    let [red, blue, _] = colours(&transfer, None, ClassLooks::default());
    // Every row is the same; of the second block nothing has a label.
    let ids: Vec<u16> = labels.ids().iter().map(|&id| u16::from(id == 1)).collect();
    let one = Labels::new(volume.grid().clone(), ids.into(), vec![]).unwrap();
    let [red_of_one, blue_of_one, _] = colours(&transfer, Some(&one), ClassLooks::default());
    assert!(blue > 100 && blue_of_one == 0, "{blue_of_one}");
    assert!(red_of_one.abs_diff(red) * 5 < red, "{red_of_one} for {red}");
    // Where what has no label is asked for, it is as without labels, and so is all of it where every row is the same.
    let seen = ClassLooks { unlabelled: true, ..ClassLooks::default() };
    assert_eq!(colours(&transfer, Some(&one), seen), colours(&transfer, None, ClassLooks::default()));
    // Where everything has a label, labels that tell nothing change no byte.
    let all = Labels::new(volume.grid().clone(), vec![1_u16; volume.grid().len()].into(), vec![]).unwrap();
    let seen = |labels| {
        let scene = Scene { transfer: Some(&transfer), labels, ..Scene::new(&volume) };
        render(&scene, &picture(), &Exec::default()).unwrap().image
    };
    assert_eq!(seen(Some(&all)), seen(None));
    // Nor where only voxels without data have none.
    let holes: Vec<f32> =
        (0..volume.grid().len()).map(|i| if i % 97 == 0 { f32::NAN } else { 80.0 }).collect();
    let ids: Vec<u16> = holes.iter().map(|v| u16::from(v.is_finite())).collect();
    let holed = Volume::new(volume.grid().clone(), Voxels::from(holes)).unwrap();
    let ids = Labels::new(volume.grid().clone(), ids.into(), vec![]).unwrap();
    let seen = |labels| {
        let scene = Scene { transfer: Some(&transfer), labels, ..Scene::new(&holed) };
        render(&scene, &picture(), &Exec::default()).unwrap().image
    };
    assert_eq!(seen(Some(&ids)), seen(None));
}
