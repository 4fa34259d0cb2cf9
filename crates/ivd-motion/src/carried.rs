//! What nothing reaches goes along with the nearest vertex that moves.

use nalgebra::Vector3;
use rayon::prelude::*;

/// For vertices, the nearest of some others.
#[derive(Debug, Clone, Default)]
pub(crate) struct Companions {
    /// A vertex, and the one that it goes along with.
    pairs: Vec<(u32, u32)>,
}

impl Companions {
    /// - `rest`: places of all vertices (mm).
    /// - `carried`: those that go along; `leaders`: those that may be gone along with.
    pub(crate) fn new(rest: &[Vector3<f64>], carried: &[u32], leaders: &[u32]) -> Self {
        let mut by_x: Vec<u32> = leaders.to_vec();
        by_x.sort_unstable_by(|a, b| rest[*a as usize].x.total_cmp(&rest[*b as usize].x).then(a.cmp(b)));
        let nearest = |&v: &u32| {
            let at = rest[v as usize];
            let start = by_x.partition_point(|u| rest[*u as usize].x < at.x);
            let mut best: Option<(f64, u32)> = None;
            // From its place on both sides, as far as x alone doesn't rule them out.
            let (mut up, mut down) = (by_x[start..].iter(), by_x[..start].iter().rev());
            let mut look = |u: u32| {
                let place = rest[u as usize];
                let far = (place - at).norm_squared();
                if best.is_none_or(|best| (far, u) < best) {
                    best = Some((far, u));
                }
                best.is_some_and(|best| (place.x - at.x).powi(2) <= best.0)
            };
            let _ = up.all(|u| look(*u));
            let _ = down.all(|u| look(*u));
            best.map(|best| (v, best.1))
        };
        Self { pairs: carried.par_iter().filter_map(nearest).collect() }
    }

    /// Gives each its companion's motion.
    pub(crate) fn go_along(&self, displacement: &mut [[f64; 3]]) {
        for &(v, leader) in &self.pairs {
            displacement[v as usize] = displacement[leader as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use ivd_core::noise;

    use super::*;

    #[test]
    fn companions_are_the_nearest_of_all() {
        let rest: Vec<Vector3<f64>> =
            (0..400).map(|v| Vector3::from_fn(|a, _| 10.0 * noise::unit(v, a as u64))).collect();
        let (carried, leaders): (Vec<u32>, Vec<u32>) = (0..400).partition(|v| v % 3 == 0);
        let found = Companions::new(&rest, &carried, &leaders);
        for (v, leader) in found.pairs {
            let far = |u: &u32| (rest[*u as usize] - rest[v as usize]).norm();
            let plain = leaders.iter().copied().min_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
            assert_eq!(leader, plain);
        }
        assert!(Companions::new(&rest, &carried, &[]).pairs.is_empty());
    }
}
