//! Tiny volumes of any values.

use ivd_boundary::{ComponentParams as PartParams, component};
use ivd_core::{Displacement, Grid, Labels, Mask, Volume, Voxels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures;
use ivd_segment::{
    ChainParams, Covariance, CutParams, EmvsParams, Error, HvsParams, KmvsParams, Linkage, MsvsParams,
    Segmentation, ThresholdParams, cut as cut_tree, emvs, kmvs, msvs, msvs_kmvs, region_tree, threshold,
};

use crate::{Bytes, exec, lattices, stages};

/// Segments, colours, isolates, cuts and draws a volume of 1 to 6 voxels a side.
pub fn check(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let Some(grid) = lattices::grid(&mut bytes) else { return };
    let kmvs_params = KmvsParams { k: bytes.below(9), ..KmvsParams::default() };
    let cuts = ThresholdParams { values: (0..bytes.below(4)).map(|_| bytes.f64()).collect() };
    let (iso, upper) = (bytes.f64(), bytes.f64());
    let (slope, intercept) = if bytes.u8() % 2 == 0 { (1.0, 0.0) } else { (bytes.f64(), bytes.f64()) };
    let voxels = voxels(&grid, &mut bytes);
    let Ok(volume) = Volume::with_scale(grid, voxels, slope, intercept) else { return };

    for segmentation in every_way(&volume, &kmvs_params, &cuts, iso, upper).into_iter().flatten() {
        classes(&volume, &segmentation);
        colour(&volume, &segmentation.labels);
    }
    for iso in [Iso::Value(iso), Iso::Interval { lower: Some(iso), upper: Some(upper) }] {
        cut(&volume, None, iso);
    }
    if let Ok(built) = ivd_atf::from_isovalue(&volume, iso, &ivd_atf::Params::default(), exec()) {
        stages::draw(&volume, &built.transfer, None, None);
    }
}

/// The volume segmented by every method; `a` and `b` are any numbers.
fn every_way(
    volume: &Volume,
    kmvs_params: &KmvsParams,
    cuts: &ThresholdParams,
    a: f64,
    b: f64,
) -> Vec<Result<Segmentation, Error>> {
    let k = kmvs_params.k;
    let mixture = |params| Ok(emvs(volume, None, &params, exec())?.segmentation);
    let shift = |params| Ok(msvs(volume, None, &params, exec())?.segmentation);
    let tree = |linkage| {
        let params = HvsParams { linkage, alpha: Some(b).filter(|b| *b > 0.0), ..HvsParams::default() };
        let tree = region_tree(volume, None, &params, exec())?.tree;
        cut_tree(&tree, &CutParams { k, ..CutParams::default() }, exec())
    };
    let rounds = EmvsParams { k: Some(k), max_iterations: 20, ..EmvsParams::default() };
    vec![
        kmvs(volume, None, kmvs_params, exec()),
        kmvs(
            volume,
            None,
            &KmvsParams { spatial_weight: a, max_iterations: 20, ..kmvs_params.clone() },
            exec(),
        ),
        threshold(volume, None, cuts, exec()),
        mixture(rounds.clone()),
        mixture(EmvsParams { smoothing: a, bias: b, ..rounds.clone() }),
        mixture(EmvsParams { covariance: Covariance::Diagonal, ..rounds.clone() }),
        mixture(EmvsParams { covariance: Covariance::Full, ..rounds }),
        shift(MsvsParams { range_bandwidth: a, ..MsvsParams::default() }),
        shift(MsvsParams { spatial_bandwidth: b, ..MsvsParams::default() }),
        msvs_kmvs(volume, None, &ChainParams::default(), exec()).map(|found| found.segmentation),
        tree(Linkage::Ward),
        tree(Linkage::Single),
    ]
}

fn voxels(grid: &Grid, bytes: &mut Bytes) -> Voxels {
    let n = grid.len();
    match bytes.u8() % 8 {
        0 => (0..n).map(|_| bytes.u8()).collect::<Vec<u8>>().into(),
        1 => (0..n).map(|_| bytes.u8() as i8).collect::<Vec<i8>>().into(),
        2 => (0..n).map(|_| bytes.below(65536) as u16).collect::<Vec<u16>>().into(),
        3 => (0..n).map(|_| bytes.below(65536) as u16 as i16).collect::<Vec<i16>>().into(),
        4 => (0..n).map(|_| bytes.f32().to_bits()).collect::<Vec<u32>>().into(),
        5 => (0..n).map(|_| bytes.f32().to_bits() as i32).collect::<Vec<i32>>().into(),
        6 => (0..n).map(|_| bytes.f32()).collect::<Vec<f32>>().into(),
        _ => (0..n).map(|_| bytes.f64()).collect::<Vec<f64>>().into(),
    }
}

/// Every voxel has a label exactly where it is data, and the classes count them all.
fn classes(volume: &Volume, found: &Segmentation) {
    let (ids, voxels) = (found.labels.ids(), volume.voxels());
    for (i, id) in ids.iter().enumerate() {
        assert_eq!(*id != 0, voxels.get(i).is_finite(), "voxel {i}");
    }
    let counted: u64 = found.labels.classes().iter().map(|class| class.voxels).sum();
    assert_eq!(counted + volume.missing(), ids.len() as u64);
    assert!(found.labels.classes().iter().all(|class| !class.mean.is_nan() && !class.sd.is_nan()));
}

fn colour(volume: &Volume, labels: &Labels) {
    if let Ok(built) = ivd_atf::transfer(volume, labels, &ivd_atf::Params::default(), exec()) {
        assert!(built.transfer.table().as_flattened().iter().all(|c| (0.0..=1.0).contains(c)));
        stages::draw(volume, &built.transfer, Some(labels), still(volume.grid()).as_ref());
    }
    if let Ok(part) = component(volume, Some(labels), &PartParams::default(), exec()) {
        assert!(part.voxels > 0);
        cut(volume, Some(&part.mask), Iso::Mask);
    }
}

/// A displacement that moves nothing.
fn still(grid: &Grid) -> Option<Displacement> {
    Some(Displacement::identity(grid.clone()))
}

/// Cuts a lattice, which must be closed.
fn cut(volume: &Volume, mask: Option<&Mask>, iso: Iso) {
    let Ok(cut) = extract(volume, mask, &ExtractParams { iso }, exec()) else { return };
    let figures = figures::measure(&cut.lattice);
    assert_eq!(
        (figures.boundary_edges, figures.non_manifold_edges, figures.misoriented_edges),
        (0, 0, 0),
        "{iso:?}: not closed"
    );
}
