use ivd_core::{Frame, Grid, Motion, sets};
use ivd_field::falloff::smooth_fall;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::params::Band;

/// Widths of a margin in lengths of the motion that it takes up: what falls over so much folds nothing by itself.
const WIDTHS: f64 = 4.0;

/// Ω: where something may move. The union of the handles' balls, each widened by a margin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Region {
    balls: Vec<Reach>,
}

/// The ball of a handle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reach {
    /// Relative to the grid's origin (mm).
    centre: Vector3<f64>,
    /// (mm).
    radius: f64,
    widths: Widths,
}

/// How far a motion falls off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Widths {
    /// Width of the fall-off beyond a ball, and outside the lattice (mm).
    pub(super) margin: f64,
    /// Depth inside the lattice at which the depth weight ends (mm).
    pub(super) depth: f64,
}

impl Widths {
    /// For a motion of `most` (mm) within a radius (mm): widths that are given stay as they are.
    fn following(most: f64, radius: f64, band: &Band, depth: Option<f64>, grid: &Grid) -> Self {
        Self {
            margin: band.margin.unwrap_or_else(|| (WIDTHS * most).max(least_margin(grid))),
            depth: depth.unwrap_or_else(|| radius.max(WIDTHS * most).max(grid.voxel_diagonal())),
        }
    }
}

impl Reach {
    /// Radius with the margin (mm).
    fn far(&self) -> f64 {
        self.radius + self.widths.margin
    }

    /// 1 in the ball, 0 beyond the margin; nothing of what lies beyond.
    fn weight(&self, point: Vector3<f64>) -> Option<f64> {
        let (squared, far) = ((point - self.centre).norm_squared(), self.far());
        // Most voxels lie beyond or within; a root and a quotient tell no more of them.
        if squared > far * far * (1.0 + 1e-12) {
            return None;
        }
        if self.radius > 0.0 && squared < self.radius * self.radius * (1.0 - 1e-12) {
            return Some(1.0);
        }
        Some(smooth_fall((squared.sqrt() - self.radius) / self.widths.margin))
    }
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
        let balls = balls_of(motion, frame, positions);
        let reach = balls.iter().map(|b| b.1).fold(0.0, f64::max);
        let widths = Widths::following(largest(frame), reach, band, depth, motion.grid());
        let reach = |(centre, radius)| Reach { centre, radius, widths };
        Self { balls: balls.into_iter().map(reach).collect() }
    }

    /// The same with margins and depths that follow the motion of each ball's own vertices, but for those that are given: what a handle moves doesn't depend on
    /// how far others, far from it, are moved. Where balls come to overlap, each adopts the other's by degrees.
    pub(super) fn of_each(
        mut self,
        grid: &Grid,
        frame: &Frame,
        positions: &[Vector3<f64>],
        band: &Band,
        depth: Option<f64>,
    ) -> Self {
        if (band.margin.is_some() && depth.is_some()) || self.balls.len() < 2 {
            return self;
        }
        let balls = &self.balls;
        let most = largest_of_each(balls, frame, positions);
        let alone = |i: usize| Widths::following(most[i], balls[i].radius, band, depth, grid);
        let alone: Vec<Widths> = (0..balls.len()).map(alone).collect();
        let far = |i: usize| balls[i].radius + alone[i].margin;
        let overlap =
            |i: usize, j: usize| (far(i) + far(j) - (balls[i].centre - balls[j].centre).norm()).max(0.0);
        // Of another's margin that part which follows its motion, by how far it reaches in; of its depth as much as it reaches in. Neither grows
        // by more than a few times what a motion does.
        let adopted = |i: usize| {
            (0..balls.len()).filter(|j| *j != i).fold(alone[i], |own, j| {
                let overlap = overlap(i, j);
                let margin = match band.margin {
                    Some(given) => given,
                    None => own.margin.max(WIDTHS * most[j] * (overlap / alone[j].margin).min(1.0)),
                };
                let depth = depth.unwrap_or_else(|| own.depth.max(alone[j].depth.min(overlap)));
                Widths { margin, depth }
            })
        };
        let all: Vec<Widths> = (0..balls.len()).map(adopted).collect();
        for (ball, widths) in self.balls.iter_mut().zip(all) {
            ball.widths = widths;
        }
        self
    }

    /// The parts of it that don't touch, each with its balls in their order.
    pub(super) fn parts(&self) -> Vec<Self> {
        let touch =
            |one: &Reach, other: &Reach| (one.centre - other.centre).norm() <= one.far() + other.far();
        let mut part_of = sets::singles(self.balls.len());
        for (i, ball) in self.balls.iter().enumerate() {
            for (j, _) in self.balls[..i].iter().enumerate().filter(|(_, other)| touch(ball, other)) {
                sets::join(&mut part_of, i as u32, j as u32);
            }
        }
        sets::flatten(&mut part_of);
        // Rounding goes by the order of balls: it is the same whatever lies beside a part.
        let mut parts: Vec<(u32, Self)> = Vec::new();
        for (root, ball) in part_of.into_iter().zip(&self.balls) {
            match parts.iter_mut().find(|(other, _)| *other == root) {
                Some((_, part)) => part.balls.push(*ball),
                None => parts.push((root, Self { balls: vec![*ball] })),
            }
        }
        parts.into_iter().map(|(_, part)| part).collect()
    }

    /// Whether another one has the same balls, whatever their margins.
    pub(super) fn has_balls_of(&self, other: &Self) -> bool {
        let same = |(one, other): (&Reach, &Reach)| one.centre == other.centre && one.radius == other.radius;
        self.balls.len() == other.balls.len() && self.balls.iter().zip(&other.balls).all(same)
    }

    /// The widest margin (mm).
    pub(super) fn margin(&self) -> f64 {
        self.balls.iter().map(|ball| ball.widths.margin).fold(0.0, f64::max)
    }

    /// The widths of all balls, where they are alike.
    pub(super) fn alike(&self) -> Option<Widths> {
        let first = self.balls.first()?.widths;
        self.balls.iter().all(|ball| ball.widths == first).then_some(first)
    }

    /// The widest of them.
    pub(super) fn widest(&self) -> Widths {
        let depth = self.balls.iter().map(|ball| ball.widths.depth).fold(0.0, f64::max);
        Widths { margin: self.margin(), depth }
    }

    /// The widths at a point: of the ball that reaches it, and between those of several by how much each counts there. `widest`: of all.
    pub(super) fn widths(&self, point: Vector3<f64>, widest: Widths) -> Widths {
        let mut reached = self
            .balls
            .iter()
            .filter_map(|ball| Some((ball.widths, ball.weight(point).filter(|w| *w > 0.0)?)));
        let Some((first, weight)) = reached.next() else { return widest };
        // Differences from the first: a ball that reaches a point alone has its own widths to the bit.
        let (mut sum, mut beyond) = (weight, [0.0; 2]);
        for (other, weight) in reached {
            sum += weight;
            beyond[0] += weight * (other.margin - first.margin);
            beyond[1] += weight * (other.depth - first.depth);
        }
        Widths {
            margin: (first.margin + beyond[0] / sum).min(widest.margin),
            depth: (first.depth + beyond[1] / sum).min(widest.depth),
        }
    }

    /// How far a point lies beyond it (mm); below 0 within.
    pub(super) fn beyond(&self, point: Vector3<f64>) -> f64 {
        let beyond = |ball: &Reach| (point - ball.centre).norm() - ball.far();
        self.balls.iter().map(beyond).fold(f64::INFINITY, f64::min)
    }

    /// Radius of the smallest ball, with the widest margin (mm): cells go by it, which are of one size for all balls.
    pub(super) fn narrowest(&self) -> f64 {
        self.balls.iter().map(|ball| ball.radius).fold(f64::INFINITY, f64::min) + self.margin()
    }

    /// Where a drag that begins is likely to reach, where the margin follows the motion: each ball as for a motion of an eighth of
    /// its own radius.
    pub(super) fn ahead(&self, band: &Band) -> Self {
        if band.margin.is_some() {
            return self.clone();
        }
        let wider = |ball: &Reach| {
            let margin = ball.widths.margin.max(0.5 * ball.radius);
            Reach { widths: Widths { margin, ..ball.widths }, ..*ball }
        };
        Self { balls: self.balls.iter().map(wider).collect() }
    }

    /// The same with margins that motions of about this length share, where they follow the motion: the next of a row, each √2 times the one
    /// before.
    ///
    /// - `least`: the smallest margin (mm).
    pub(super) fn shared(&self, band: &Band, least: f64) -> Self {
        let mut shared = self.clone();
        if band.margin.is_none() {
            for ball in &mut shared.balls {
                let margin = &mut ball.widths.margin;
                let steps = (2.0 * (*margin / least).log2()).ceil().max(0.0);
                *margin = margin.max(least * (0.5 * steps).exp2());
            }
        }
        shared
    }

    /// ω: 1 in the balls, 0 beyond the margin, `1 − Π (1 − ωᵢ)` over the balls in between.
    pub(super) fn weight(&self, point: Vector3<f64>) -> f64 {
        let mut still = 1.0;
        for weight in self.balls.iter().filter_map(|ball| ball.weight(point)) {
            still *= 1.0 - weight;
            if still == 0.0 {
                break;
            }
        }
        1.0 - still
    }

    /// Whether a point lies in one of the balls.
    pub(super) fn holds(&self, point: Vector3<f64>) -> bool {
        self.balls.iter().any(|b| (point - b.centre).norm_squared() <= b.radius * b.radius)
    }

    /// Centres of the balls, relative to the grid's origin, and their radii with the margin (mm).
    pub(super) fn balls(&self) -> impl Iterator<Item = (Vector3<f64>, f64)> + '_ {
        self.balls.iter().map(|ball| (ball.centre, ball.far()))
    }

    /// The bricks that Ω may meet, ascending.
    pub(super) fn bricks(&self, grid: &Grid) -> Vec<usize> {
        grid.bricks_of_balls(self.balls())
    }
}

/// Centres of the balls that a motion names, relative to the grid's origin, and their radii (mm).
pub(super) fn reach_of(motion: &Motion) -> Vec<(Vector3<f64>, f64)> {
    let origin = Vector3::from(motion.grid().origin());
    motion.reach().iter().map(|ball| (Vector3::from(ball.centre) - origin, ball.radius)).collect()
}

/// The same; where it names none, one that holds what is moved.
fn balls_of(motion: &Motion, frame: &Frame, positions: &[Vector3<f64>]) -> Vec<(Vector3<f64>, f64)> {
    let mut balls = reach_of(motion);
    if balls.is_empty() {
        balls.extend(ball_of_moved(frame, positions));
    }
    balls
}

/// Largest motion (mm) of the vertices in each ball; one that lies in none counts for the ball that is nearest.
fn largest_of_each(balls: &[Reach], frame: &Frame, positions: &[Vector3<f64>]) -> Vec<f64> {
    let none = || vec![0.0_f64; balls.len()];
    let count = |mut most: Vec<f64>, (motion, place): (&[f64; 3], &Vector3<f64>)| {
        let length = Vector3::from(*motion).norm();
        let squared = |ball: &Reach| (place - ball.centre).norm_squared();
        let mut is_in_one = false;
        for (most, _) in most.iter_mut().zip(balls).filter(|(_, b)| squared(b) <= b.radius * b.radius) {
            *most = most.max(length);
            is_in_one = true;
        }
        if !is_in_one {
            let beyond = |i: &usize| squared(&balls[*i]).sqrt() - balls[*i].radius;
            let nearest = (0..balls.len()).min_by(|i, j| beyond(i).total_cmp(&beyond(j)));
            if let Some(i) = nearest {
                most[i] = most[i].max(length);
            }
        }
        most
    };
    let moved = frame.displacement.par_iter().zip(positions).filter(|(motion, _)| **motion != [0.0; 3]);
    let larger = |one: Vec<f64>, other: Vec<f64>| one.iter().zip(&other).map(|(a, b)| a.max(*b)).collect();
    moved.fold(none, count).reduce(none, larger)
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
        let balls = [(Vector3::repeat(5.0), 2.0), (Vector3::repeat(30.0), 40.0)];
        let balls = balls
            .map(|(centre, radius)| Reach { centre, radius, widths: Widths { margin: 3.0, depth: 40.0 } })
            .to_vec();
        let region = Region { balls };
        let ahead = region.ahead(&Band::default());
        assert_eq!(ahead.balls().map(|b| b.1).collect::<Vec<_>>(), [5.0, 60.0]);
        assert_eq!(ahead.margin(), 20.0);
        // A small ball covers what it covered, no more.
        let at = |distance: f64| Vector3::repeat(5.0) - Vector3::x() * distance;
        let small = Region { balls: ahead.balls[..1].to_vec() };
        assert!(small.weight(at(0.0)) > 0.0 && small.weight(at(4.9)) > 0.0);
        assert_eq!(small.weight(at(5.1)), 0.0);
        assert!(small.bricks(&grid).len() < region.bricks(&grid).len());
        let fixed = Band { margin: Some(3.0), ..Band::default() };
        assert_eq!(region.ahead(&fixed), region);
    }

    #[test]
    fn margins_follow_each_handles_own_motion_and_grow_by_degrees_where_balls_meet() {
        let grid = Grid::with_spacing([300, 20, 20], [1.0; 3]).unwrap();
        // A ball of 5 mm whose vertex moves by 2 mm, and one of 10 mm, moved by 8, that comes nearer.
        let region = |apart: f64, given: Option<f64>| {
            let positions = [Vector3::zeros(), Vector3::x() * apart, Vector3::x() * 400.0];
            let displacement = vec![[2.0, 0.0, 0.0], [0.0, 0.0, 8.0], [0.0; 3]].into();
            let ball = |x: f64, radius| Ball { centre: [x, 0.0, 0.0], radius };
            let motion = Motion::new(grid.clone(), 3, vec![]).unwrap();
            let motion = motion.with_reach(vec![ball(0.0, 5.0), ball(apart, 10.0)]).unwrap();
            let frame = Frame { time: 0.0, displacement };
            let band = Band { margin: given, ..Band::default() };
            Region::new(&motion, &frame, &positions, &band, None)
                .of_each(&grid, &frame, &positions, &band, None)
        };
        let margins = |apart| region(apart, None).balls.iter().map(|b| b.widths.margin).collect::<Vec<_>>();
        let depths = |apart| region(apart, None).balls.iter().map(|b| b.widths.depth).collect::<Vec<_>>();
        assert_eq!((depths(56.0), depths(12.0)), (vec![8.0, 32.0], vec![32.0, 32.0]));
        assert_eq!(margins(56.0), [8.0, 32.0], "four times the own motion");
        assert_eq!(region(56.0, None).parts().len(), 2);
        assert_eq!((margins(55.0), region(55.0, None).parts().len()), (vec![8.0, 32.0], 1));
        assert_eq!(margins(12.0), [32.0, 32.0], "one within the other");
        let mut before = margins(56.0)[0];
        for step in 0..440 {
            let margin = margins(56.0 - 0.1 * f64::from(step))[0];
            assert!((before..=before + 0.11).contains(&margin), "{margin} after {before}");
            before = margin;
        }
        // A large ball that stands lends of its depth only as far as it reaches in: as a motion grows beside it nothing jumps.
        let beside = |length: f64| {
            let displacement = vec![[length, 0.0, 0.0], [0.0, 0.0, 0.01], [0.0; 3]].into();
            let ball = |x: f64, radius| Ball { centre: [x, 0.0, 0.0], radius };
            let motion = Motion::new(grid.clone(), 3, vec![]).unwrap();
            let motion = motion.with_reach(vec![ball(0.0, 8.0), ball(50.0, 30.0)]).unwrap();
            let positions = [Vector3::zeros(), Vector3::x() * 50.0, Vector3::x() * 400.0];
            let frame = Frame { time: 0.0, displacement };
            let band = Band::default();
            let region = Region::new(&motion, &frame, &positions, &band, None);
            region.of_each(&grid, &frame, &positions, &band, None).balls[0].widths.depth
        };
        let depths: Vec<f64> = (0..600).map(|step| beside(0.01 * f64::from(step))).collect();
        assert!(depths[0] == 8.0 && depths[599] > 20.0, "{depths:?}");
        assert!(depths.windows(2).all(|pair| (0.0..0.05).contains(&(pair[1] - pair[0]))), "{depths:?}");
        // From one ball to the other widths change by degrees, and one alone has its own.
        let meet = region(45.0, None);
        let [own, other] = [0, 1].map(|i| meet.balls[i].widths);
        let at = |x: f64| meet.widths(Vector3::x() * x, meet.widest());
        assert_eq!((at(-5.0), at(2.0), at(60.0)), (own, own, other));
        assert!(own.margin < other.margin && own.depth < other.depth && meet.alike().is_none());
        for step in 0..500 {
            let [here, next] = [0.0, 0.01].map(|more| at(0.01 * f64::from(step) * 9.0 + more));
            assert!(
                (next.margin - here.margin).abs() < 0.1 && (next.depth - here.depth).abs() < 0.1,
                "{step}"
            );
            assert!((own.margin..=other.margin).contains(&here.margin), "{here:?}");
        }
        let given = region(56.0, Some(3.0));
        assert!(given.balls.iter().all(|ball| ball.widths.margin == 3.0) && given.parts().len() == 2);
        // Chains are one part, wherever they begin.
        let reach = |x: f64| Reach {
            centre: Vector3::x() * x,
            radius: 1.0,
            widths: Widths { margin: 1.5, depth: 0.0 },
        };
        let parts = Region { balls: [0.0, 8.0, 20.0, 4.0, 26.0].map(reach).to_vec() }.parts();
        let starts: Vec<Vec<f64>> =
            parts.iter().map(|part| part.balls.iter().map(|b| b.centre.x).collect()).collect();
        assert_eq!(starts, [vec![0.0, 8.0, 4.0], vec![20.0], vec![26.0]]);
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
