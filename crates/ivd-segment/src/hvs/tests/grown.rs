use super::*;
use crate::hvs::{classes as grown_classes, dendrogram, drawn};

/// Volumes of which some have leaves of several voxels, islands, or values that `f32` doesn't hold.
fn volumes() -> Vec<Volume> {
    let mut next = noise(21);
    let dims = [37, 18, 17];
    let len: usize = dims.iter().product();
    let speckled = (0..len)
        .map(|i| if next().is_multiple_of(5) { f32::NAN } else { (i % 37) as f32 })
        .collect::<Vec<_>>();
    let wide = (0..len).map(|_| next() as i16).collect::<Vec<_>>();
    let grid = Grid::with_spacing(dims, [1.0; 3]).unwrap();
    vec![
        head(24, 8.0).0,
        volume(dims, (0..len).map(|_| (next() % 3) as u8).collect::<Vec<_>>()),
        volume(dims, speckled),
        Volume::with_scale(grid, wide.into(), 0.1, -3.0).unwrap(),
        volume([1, 1, 1], vec![4_u8]),
        volume([2, 2, 2], vec![f32::NAN; 8]),
    ]
}

#[test]
fn classes_without_a_whole_tree_are_those_of_the_tree() {
    let exec = Exec::default();
    let grown = [single(), HvsParams { alpha: Some(2.0), ..single() }, HvsParams::default()];
    for volume in volumes() {
        for params in &grown {
            let tree = grow(&volume, params).tree;
            for ranking in [Ranking::Persistence, Ranking::Height, Ranking::Area] {
                for least_part in [1, 6] {
                    let at = CutParams { least_part, ..classes(7, ranking) };
                    let cut = cut(&tree, &at, &exec).unwrap();
                    let drawing = dendrogram(&tree, &at, 32, &exec).unwrap();
                    let found = grown_classes((&volume, None), params, &at, 32, &exec).unwrap();
                    assert!(found == (cut.clone(), drawing.clone(), tree.leaf_count()), "{params:?} {at:?}");
                    assert!(drawn(&tree, &at, 32, &exec).unwrap() == (cut, drawing), "{params:?} {at:?}");
                }
            }
        }
    }
}

#[test]
fn a_grown_tree_fits_together() {
    for volume in volumes() {
        for params in [single(), HvsParams::default()] {
            let tree = grow(&volume, &params).tree;
            let parts = (*tree).clone();
            assert_eq!(Tree::new(parts).unwrap(), tree);
        }
    }
}
