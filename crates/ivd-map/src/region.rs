use ivd_core::{Frame, Grid, Motion, World};
use ivd_field::falloff::smooth_fall;
use nalgebra::Vector3;

use super::params::Band;

/// Ω: where something may move. The union of the handles' balls, each widened by the margin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Region {
    /// Centres relative to the grid's origin (mm) and radii (mm).
    balls: Vec<(Vector3<f64>, f64)>,
    /// Width of the fall-off beyond the balls (mm).
    pub(super) margin: f64,
    /// Depth at which the depth weight ends (mm).
    pub(super) depth: f64,
}

impl Region {
    /// The region of a frame. `positions`: the vertices relative to the grid's origin; they stand in where the motion
    /// names no ball.
    pub(super) fn new(
        motion: &Motion,
        frame: &Frame,
        positions: &[Vector3<f64>],
        band: &Band,
        depth: Option<f64>,
    ) -> Self {
        let origin = World(motion.grid().origin().into());
        let mut balls: Vec<(Vector3<f64>, f64)> =
            motion.reach().iter().map(|b| (Vector3::from(b.centre) - origin.0, b.radius)).collect();
        if balls.is_empty() {
            balls.extend(ball_of_moved(frame, positions));
        }
        let most = largest(frame);
        let reach = balls.iter().map(|b| b.1).fold(0.0, f64::max);
        let margin = band.margin.unwrap_or_else(|| (4.0 * most).max(least_margin(motion.grid())));
        let depth = depth.unwrap_or_else(|| reach.max(4.0 * most).max(motion.grid().voxel_diagonal()));
        Self { balls, margin, depth }
    }

    /// Where a drag that begins is likely to reach, where the margin follows the motion: each ball as for a motion of an eighth of
    /// its own radius.
    pub(super) fn ahead(&self, band: &Band) -> Self {
        if band.margin.is_some() {
            return self.clone();
        }
        let wide = |radius: f64| self.margin.max(0.5 * radius);
        let margin = wide(self.balls.iter().map(|b| b.1).fold(0.0, f64::max));
        // The margin is the same for all; a smaller ball gives up what it has too much of it.
        let balls =
            self.balls.iter().map(|&(centre, radius)| (centre, radius + wide(radius) - margin)).collect();
        Self { balls, margin, depth: self.depth }
    }

    /// The same with a margin that motions of about this length share, where the margin follows the motion: the next of a row, each √2 times the one
    /// before.
    ///
    /// - `least`: the smallest margin (mm).
    ///
    /// Its depth says nothing.
    pub(super) fn shared(&self, band: &Band, least: f64) -> Self {
        if band.margin.is_some() {
            return Self { depth: 0.0, ..self.clone() };
        }
        let steps = (2.0 * (self.margin / least).log2()).ceil().max(0.0);
        Self { balls: self.balls.clone(), margin: self.margin.max(least * (0.5 * steps).exp2()), depth: 0.0 }
    }

    /// ω: 1 in the balls, 0 beyond the margin, `1 − Π (1 − ωᵢ)` over the balls in between.
    pub(super) fn weight(&self, point: Vector3<f64>) -> f64 {
        let mut still = 1.0;
        for (centre, radius) in &self.balls {
            let (squared, far) = ((point - centre).norm_squared(), radius + self.margin);
            // Most voxels lie beyond or within; a root and a quotient tell no more of them.
            if squared > far * far * (1.0 + 1e-12) {
                continue;
            }
            if *radius > 0.0 && squared < radius * radius * (1.0 - 1e-12) {
                return 1.0;
            }
            still *= 1.0 - smooth_fall((squared.sqrt() - radius) / self.margin);
        }
        1.0 - still
    }

    /// Whether a point lies in one of the balls.
    pub(super) fn holds(&self, point: Vector3<f64>) -> bool {
        self.balls.iter().any(|(centre, radius)| (point - centre).norm_squared() <= radius * radius)
    }

    /// Centres of the balls, relative to the grid's origin, and their radii with the margin (mm).
    pub(super) fn balls(&self) -> impl Iterator<Item = (Vector3<f64>, f64)> + '_ {
        self.balls.iter().map(|(centre, radius)| (*centre, radius + self.margin))
    }

    /// The bricks that Ω may meet, ascending.
    pub(super) fn bricks(&self, grid: &Grid) -> Vec<usize> {
        grid.bricks_of_balls(self.balls())
    }
}

/// The smallest margin that follows a motion (mm).
pub(super) fn least_margin(grid: &Grid) -> f64 {
    2.0 * grid.voxel_diagonal()
}

/// Largest motion of a vertex (mm).
pub(super) fn largest(frame: &Frame) -> f64 {
    frame.displacement.iter().map(|&d| Vector3::from(d).norm()).fold(0.0, f64::max)
}

/// A ball that holds every moved vertex.
fn ball_of_moved(frame: &Frame, positions: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64)> {
    let moved = || frame.displacement.iter().zip(positions).filter(|(d, _)| **d != [0.0; 3]).map(|(_, p)| *p);
    let lo = moved().reduce(|a, b| a.inf(&b))?;
    let hi = moved().reduce(|a, b| a.sup(&b))?;
    let centre = (lo + hi) / 2.0;
    Some((centre, moved().map(|p| (p - centre).norm()).fold(0.0, f64::max)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Ball, VoxelCoord};
    use ivd_field::fixtures::{sheared_grid, voxels};

    #[test]
    fn bricks_cover_every_voxel_of_the_region_also_from_outside_the_grid() {
        let grid = sheared_grid([40, 33, 20]);
        for (voxel, radius) in [([20.0, 15.0, 10.0], 3.0), ([-3.0, 40.0, 5.0], 6.0), ([0.0, 0.0, 0.0], 0.0)] {
            let centre = grid.world(VoxelCoord(Vector3::from(voxel))).0.into();
            let frame = Frame { time: 0.0, displacement: vec![[0.5, 0.0, 0.0]].into() };
            let motion = Motion::new(grid.clone(), 1, vec![]).unwrap();
            let motion = motion.with_reach(vec![Ball { centre, radius }]).unwrap();
            let region = Region::new(&motion, &frame, &[], &Band::default(), None);
            let bricks = region.bricks(&grid);
            for v in voxels(&grid) {
                let weight = region.weight(grid.linear_part() * VoxelCoord::from(v).0);
                let brick = v.0[0] / 8 + 5 * (v.0[1] / 8 + 5 * (v.0[2] / 8));
                assert!(weight == 0.0 || bricks.binary_search(&brick).is_ok(), "{v:?}");
            }
        }
    }

    #[test]
    fn looking_ahead_widens_each_ball_by_its_own_size() {
        let grid = sheared_grid([40, 33, 20]);
        let balls = [(Vector3::repeat(5.0), 2.0), (Vector3::repeat(30.0), 40.0)].to_vec();
        let region = Region { balls, margin: 3.0, depth: 40.0 };
        let ahead = region.ahead(&Band::default());
        assert_eq!(ahead.balls().map(|b| b.1).collect::<Vec<_>>(), [5.0, 60.0]);
        assert_eq!(ahead.margin, 20.0);
        // A ball that gave up more than it has covers what it covered, no more.
        let at = |distance: f64| Vector3::repeat(5.0) - Vector3::x() * distance;
        let small = Region { balls: ahead.balls[..1].to_vec(), ..ahead };
        assert!(small.weight(at(0.0)) > 0.0 && small.weight(at(4.9)) > 0.0);
        assert_eq!(small.weight(at(5.1)), 0.0);
        assert!(small.bricks(&grid).len() < region.bricks(&grid).len());
        let fixed = Band { margin: Some(3.0), ..Band::default() };
        assert_eq!(region.ahead(&fixed), region);
    }

    #[test]
    fn without_a_ball_the_moved_vertices_span_the_region() {
        let grid = sheared_grid([8, 8, 8]);
        let displacement = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into();
        let frame = Frame { time: 0.0, displacement };
        let motion = Motion::new(grid, 3, vec![]).unwrap();
        let positions = [Vector3::repeat(100.0), Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0)];
        let region = Region::new(&motion, &frame, &positions, &Band::default(), None);
        assert_eq!(region.weight(Vector3::new(2.0, 0.0, 0.0)), 1.0);
        assert_eq!(region.weight(Vector3::repeat(100.0)), 0.0);
    }
}
