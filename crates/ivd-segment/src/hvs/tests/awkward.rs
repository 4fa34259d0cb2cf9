use std::sync::Arc;

use super::*;
use ivd_core::{ByteSource, Spill, SpillSpace};

fn both(volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> [(Hvs, crate::Segmentation); 2] {
    [Linkage::Single, Linkage::Ward].map(|linkage| {
        let params = HvsParams { linkage, max_regions: 300, ..HvsParams::default() };
        let found = region_tree(volume, mask, &params, exec).unwrap();
        let segments = cut(&found.tree, &classes(5, Ranking::Persistence), exec).unwrap();
        let classes = segments.labels.classes();
        assert!(classes.windows(2).all(|w| w[0].mean <= w[1].mean), "{classes:?}");
        assert!(classes.iter().all(|c| c.mean.is_finite() && c.sd.is_finite()), "{classes:?}");
        assert!(segments.objective.is_finite() && (0.0..=1.0).contains(&found.excess));
        (found, segments)
    })
}

#[test]
fn threads_and_storage_types_make_no_difference() {
    let mut next = noise(11);
    let dims = [40, 33, 21];
    let bytes: Vec<u8> = (0..40 * 33 * 21).map(|i| ((i % 40) as u32 + next() % 25) as u8).collect();
    let byte_volume = volume(dims, bytes.clone());
    let reference = both(&byte_volume, None, &Exec::default().with_threads(1));
    for threads in [2, 3, 8] {
        let found = both(&byte_volume, None, &Exec::default().with_threads(threads));
        assert!(found == reference, "{threads} threads");
    }
    let others = [
        volume(dims, bytes.iter().map(|v| i16::from(*v)).collect::<Vec<_>>()),
        volume(dims, bytes.iter().map(|v| u16::from(*v)).collect::<Vec<_>>()),
        volume(dims, bytes.iter().map(|v| i32::from(*v)).collect::<Vec<_>>()),
        volume(dims, bytes.iter().map(|v| f32::from(*v)).collect::<Vec<_>>()),
        volume(dims, bytes.iter().map(|v| f64::from(*v)).collect::<Vec<_>>()),
    ];
    for other in others {
        assert!(both(&other, None, &Exec::default()) == reference, "{}", other.voxel_type().name());
    }
}

#[test]
fn volumes_with_nothing_to_tell_apart() {
    let exec = Exec::default();
    for (found, segments) in both(&volume([20, 18, 17], vec![7_u16; 20 * 18 * 17]), None, &exec) {
        assert_eq!(segments.k, if found.tree.linkage == Linkage::Single { 1 } else { 5.min(found.regions) });
        assert!(segments.labels.classes().iter().all(|c| c.mean == 7.0 && c.sd == 0.0));
    }
    for (found, segments) in both(&volume([1, 1, 1], vec![3.5_f32]), None, &exec) {
        assert_eq!((found.regions, segments.labels.ids()), (1, &[1][..]));
    }
    let nothing = volume([3, 2, 2], [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].repeat(4));
    for (found, segments) in both(&nothing, None, &exec) {
        assert_eq!((found.regions, segments.k, segments.visited_fraction), (0, 0, 0.0));
        assert!(segments.labels.ids().iter().all(|id| *id == 0));
    }
    let some = volume([3, 2, 2], vec![1_u8; 12]);
    let empty = Mask::new(some.grid().clone(), vec![0; 12].into()).unwrap();
    for (found, segments) in both(&some, Some(&empty), &exec) {
        assert_eq!((found.regions, segments.k), (0, 0));
    }
    let other = volume([2, 2, 2], vec![1_u8; 8]);
    assert!(region_tree(&other, Some(&empty), &single(), &exec).is_err());
}

#[test]
fn ties_everywhere_thin_volumes_and_extreme_values() {
    let exec = Exec::default();
    let checker: Vec<u8> = (0..32_usize.pow(3)).map(|i| ((i + i / 32 + i / 1024) % 2 * 9) as u8).collect();
    let ramp: Vec<u16> = (0..32_usize.pow(3)).map(|i| (i % 32 * 16) as u16).collect();
    let mut next = noise(13);
    let offset: Vec<f32> = (0..32_usize.pow(3)).map(|_| 1e7 + bell(&mut next).round() as f32).collect();
    let extreme: Vec<f64> =
        (0..1000).map(|i| [f64::MAX, f64::MIN, 5e-324, 0.0, f64::NAN, 1e300][i % 6]).collect();
    let tiny: Vec<f64> = (0..1000).map(|i| (i % 7) as f64 * 5e-324).collect();
    let padded: Vec<u16> = (0..1000).map(|i| if i % 3 == 0 { 65_535 } else { 16 * (i % 9) }).collect();
    let speckled: Vec<f32> = (0..32_usize.pow(3))
        .map(|i| if (i + i / 32 + i / 1024) % 2 == 0 { f32::NAN } else { (i % 11) as f32 })
        .collect();
    let volumes = [
        volume([32, 32, 32], checker),
        volume([32, 32, 32], ramp),
        volume([32, 32, 32], offset),
        volume([10, 10, 10], extreme.clone()),
        volume([1, 50, 20], tiny),
        volume([1000, 1, 1], padded),
        volume([32, 32, 32], speckled),
    ];
    for volume in volumes {
        for (found, segments) in both(&volume, None, &exec) {
            assert!(segments.k >= 1 && segments.k <= 5.min(found.regions));
        }
    }
    let steep = Volume::with_scale(
        Grid::with_spacing([10, 10, 10], [1.0, 1.0, 50.0]).unwrap(),
        extreme.into(),
        -1e10,
        1.0,
    );
    both(&steep.unwrap(), None, &exec);
}

/// Memory beside the limit.
struct Heap(Vec<u64>);

impl ByteSource for Heap {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

impl SpillSpace for Heap {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
    fn bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.0)
    }
    fn seal(self: Box<Self>) -> Arc<dyn ByteSource> {
        Arc::new(*self)
    }
}

struct Elsewhere;

impl Spill for Elsewhere {
    fn space(&self, bytes: usize) -> std::io::Result<Box<dyn SpillSpace>> {
        Ok(Box::new(Heap(vec![0; bytes.div_ceil(8)])))
    }
}

#[test]
fn a_volume_beyond_the_memory_limit_gets_the_same_tree() {
    let (volume, _) = head(24, 8.0);
    let limited = Exec::default().with_memory_limit(Some(24_u64.pow(3) / 4));
    assert!(region_tree(&volume, None, &single(), &limited).is_err(), "nowhere to spill");
    let spilling = limited.with_spill(Arc::new(Elsewhere));
    assert!(both(&volume, None, &spilling) == both(&volume, None, &Exec::default()));
}

#[test]
fn work_stops_when_asked_to() {
    let (volume, _) = head(24, 8.0);
    let tree = grow(&volume, &single()).tree;
    let exec = Exec::default();
    exec.cancel.cancel();
    assert!(region_tree(&volume, None, &single(), &exec).is_err());
    assert!(region_tree(&volume, None, &HvsParams::default(), &exec).is_err());
    assert!(cut(&tree, &CutParams::default(), &exec).is_err());
}
