use super::*;
use ivd_core::sets;

/// Whether every class of `coarse` is a union of classes of `fine`.
fn nested(fine: &[u16], coarse: &[u16]) -> bool {
    let mut above = std::collections::HashMap::new();
    fine.iter().zip(coarse).all(|(f, c)| above.entry(f).or_insert(c) == &c)
}

/// Number of connected parts of the classes.
fn parts(volume: &Volume, ids: &[u16]) -> usize {
    let mut sets = sets::singles(ids.len());
    for [a, b] in neighbours(volume, None) {
        if ids[a] == ids[b] {
            sets::join(&mut sets, a as u32, b as u32);
        }
    }
    sets.iter().enumerate().filter(|(i, s)| *i as u32 == **s && ids[*i] > 0).count()
}

#[test]
fn cuts_nest_and_their_classes_are_connected() {
    let (volume, _) = head(24, 8.0);
    let exec = Exec::default();
    for params in [single(), HvsParams::default(), HvsParams { max_regions: 900, ..HvsParams::default() }] {
        let tree = grow(&volume, &params).tree;
        for ranking in [Ranking::Persistence, Ranking::Height, Ranking::Area] {
            for smallest in [1, 40] {
                let base = CutParams { ranking, least_part: smallest, ..CutParams::default() };
                let at = |params| cut(&tree, &params, &exec).unwrap();
                let mut before: Option<Vec<u16>> = None;
                for k in [40, 17, 16, 5, 2, 1] {
                    let found = at(CutParams { k, ..base });
                    assert!(found.k <= k && (smallest > 1 || found.k == k));
                    assert!(found.labels.classes().iter().all(|c| c.voxels >= smallest), "{k} {ranking:?}");
                    assert_eq!(parts(&volume, found.labels.ids()), found.k);
                    let exact = inertia(&volume, found.labels.ids());
                    assert!((found.objective - exact).abs() <= 1e-9 * exact);
                    assert!(before.is_none_or(|fine| nested(&fine, found.labels.ids())));
                    before = Some(found.labels.ids().to_vec());
                }
                let levels: Vec<_> =
                    (0..5).map(|level| at(CutParams { level: Some(level), ..base })).collect();
                assert!(levels.windows(2).all(|w| nested(w[0].labels.ids(), w[1].labels.ids())));
                assert_eq!(levels[4].labels, at(CutParams { k: 2, ..base }).labels);
            }
        }
        let [low, high] = tree.height_range().unwrap();
        let above: Vec<_> = [0.9, 0.5, 0.1]
            .map(|f| {
                cut(
                    &tree,
                    &CutParams { height: Some(high * f), least_part: 5, ..CutParams::default() },
                    &exec,
                )
                .unwrap()
            })
            .into();
        assert!(above.windows(2).all(|w| nested(w[1].labels.ids(), w[0].labels.ids())));
        assert!(low >= 0.0);
    }
}

#[test]
fn a_cut_by_height_joins_what_lies_below_it() {
    let volume = volume([6, 1, 1], vec![0_u8, 1, 5, 5, 20, 22]);
    let tree = grow(&volume, &single()).tree;
    let at = |height| {
        let params = CutParams { height: Some(height), ..CutParams::default() };
        cut(&tree, &params, &Exec::default()).unwrap()
    };
    assert_eq!(at(0.0).labels.ids(), [1, 2, 3, 3, 4, 5]);
    assert_eq!(at(2.0).labels.ids(), [1, 1, 2, 2, 3, 3]);
    assert_eq!(at(14.9).labels.ids(), [1, 1, 1, 1, 2, 2]);
    assert_eq!(at(15.0).k, 1);
    let class = &at(2.0).labels.classes()[2].clone();
    assert_eq!((class.mean, class.sd, class.voxels), (21.0, 1.0, 2));
}

/// The share of the voxels whose class is mostly of their tissue.
fn purity(ids: &[u16], k: usize, truth: &[usize]) -> f64 {
    let mut votes = vec![[0_u32; 5]; k + 1];
    ids.iter().zip(truth).for_each(|(id, t)| votes[usize::from(*id)][*t] += 1);
    votes.iter().map(|v| *v.iter().max().unwrap()).sum::<u32>() as f64 / ids.len() as f64
}

#[test]
fn as_many_classes_as_tissues_are_the_parts_of_a_noisy_head() {
    let (volume, truth) = head(40, 6.0);
    for params in [single(), HvsParams::default(), HvsParams { max_regions: 5000, ..HvsParams::default() }] {
        let tree = grow(&volume, &params).tree;
        // Air, skin, skull, brain, two ventricles.
        let found = cut(&tree, &classes(6, Ranking::Persistence), &Exec::default()).unwrap();
        let least = found.labels.classes().iter().map(|c| c.voxels).min().unwrap();
        let pure = purity(found.labels.ids(), found.k, &truth);
        println!("{:?}: {least} voxels at least, {pure} pure", params.linkage);
        assert!(least > 150 && pure > 0.97, "{:?}: {least}, {pure}", params.linkage);
    }
    // By height alone, single linkage splits off single voxels.
    let tree = grow(&volume, &single()).tree;
    let found = cut(&tree, &classes(6, Ranking::Height), &Exec::default()).unwrap();
    assert_eq!(found.labels.classes().iter().map(|c| c.voxels).min(), Some(1));
}

#[test]
fn parameters_outside_their_domain_are_named() {
    let tree = grow(&volume([4, 1, 1], vec![1_u8, 2, 3, 4]), &single()).tree;
    let refused = |params: CutParams, part: &str| {
        let error = cut(&tree, &params, &Exec::default()).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    };
    let plain = CutParams::default();
    refused(CutParams { k: 0, ..plain }, "1 … 65535");
    refused(CutParams { k: 65_536, ..plain }, "1 … 65535");
    refused(CutParams { level: Some(5), ..plain }, "0 … 4");
    refused(CutParams { height: Some(f64::NAN), ..plain }, "`height`");
    refused(CutParams { height: Some(1.0), level: Some(1), ..plain }, "give one of them");
    refused(CutParams { k: 7, height: Some(1.0), ..plain }, "give one of them");
    refused(CutParams { least_part: 0, ..CutParams::default() }, "least_part");
    for (params, field) in [
        (HvsParams { alpha: Some(-1.0), ..HvsParams::default() }, "alpha"),
        (HvsParams { max_regions: 0, ..HvsParams::default() }, "max_regions"),
        (HvsParams { within: Within::range(2.0, 1.0), ..HvsParams::default() }, "range"),
    ] {
        assert!(params.check().unwrap_err().to_string().contains(field));
    }
}

#[test]
fn more_classes_than_labels_are_refused_with_a_remedy() {
    let mut next = noise(9);
    let voxels: Vec<f32> = (0..70_000).map(|_| next() as f32).collect();
    let tree = grow(&volume([70, 100, 10], voxels), &single()).tree;
    let params = CutParams { height: Some(0.0), ..CutParams::default() };
    let error = cut(&tree, &params, &Exec::default()).unwrap_err().to_string();
    assert!(error.contains("raise the height"), "{error}");
    let most = cut(&tree, &classes(65_535, Ranking::Height), &Exec::default()).unwrap();
    assert_eq!((most.k, most.labels.ids().iter().max()), (65_535, Some(&65_535)));
}
