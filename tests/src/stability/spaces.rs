//! Random steps in space, from a seed.

use ivd_core::{Classified, ErrorClass, Exec, Grid, Labels, VoxelCoord};
use ivd_field::shape::{Kind, Shape};
use ivd_map::space::{ChainMail, Curve, Cut, Links, Over, Start, Step, Way, displace};
use nalgebra::Vector3;

use super::invariants::field::displaced;
use super::scene::grid;
use super::seeded::Seeded;

/// What came of steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// A displacement that holds.
    Made,
    /// A refusal that says why: it folds, or its steps don't fit together.
    Refused,
}

/// Does a seed's steps on its grid, in one thread and in several, with and without skipping.
///
/// # Errors
/// The first thing that doesn't hold.
pub fn check(seed: u64) -> Result<Outcome, String> {
    let mut random = Seeded::new(seed);
    let grid = grid(&mut random);
    let count = 1 + random.below(3);
    let steps: Vec<Step> = (0..count).map(|_| step(&mut random, &grid)).collect();
    let ids: Vec<u16> = (0..grid.len()).map(|_| random.below(3) as u16).collect();
    let labels = Labels::new(grid.clone(), ids.into(), Vec::new()).map_err(|e| e.to_string())?;
    let start = Start { after: None, labels: Some(&labels) };
    let exec = Exec::default().with_threads(1);
    let made = match displace(&grid, &steps, &start, &exec) {
        Ok(made) => made,
        Err(error) if [ErrorClass::Untrusted, ErrorClass::Usage].contains(&error.error_class()) => {
            return Ok(Outcome::Refused);
        }
        Err(error) => return Err(format!("{steps:?}: {error}")),
    };
    displaced(&made).map_err(|e| format!("{steps:?} on {grid:?}: {e}"))?;
    let mut all = Exec::default().with_threads(3);
    all.skip = false;
    let again = displace(&grid, &steps, &start, &all).map_err(|e| format!("{steps:?}: not again: {e}"))?;
    if again != made {
        return Err(format!(
            "{steps:?} on {grid:?}: other threads without skipping make another displacement"
        ));
    }
    Ok(Outcome::Made)
}

/// A step somewhere about the grid.
fn step(random: &mut Seeded, grid: &Grid) -> Step {
    let length = grid.voxel_diagonal();
    let place = Vector3::from_fn(|a, _| random.between(-1.0, grid.dims()[a] as f64));
    let centre: [f64; 3] = grid.world(VoxelCoord(place)).0.into();
    let axis = if random.one_in(3) { [0.0, 0.0, 1.0] } else { random.vector(1.0) };
    let radius = length * random.spread(1.0, 20.0);
    let core = random.pick(&[0.0, 0.3, 0.5, 0.9]);
    match random.below(6) {
        0 => {
            let links = |random: &mut Seeded| Links {
                shrink: random.pick(&[1.0, 0.5, 0.3]),
                stretch: random.pick(&[1.0, 1.5, 3.0]),
                shear: random.pick(&[0.0, 0.1, 0.2, 1.0]),
            };
            let material = if random.one_in(2) { [(1, links(random).into())].into() } else { [].into() };
            let (grip, far) = (length * random.between(0.0, 2.0), length * random.spread(0.1, 5.0));
            let by = random.vector(far);
            Step::Chain(ChainMail { centre, grip, by, links: links(random), material })
        }
        1 => Step::Cut(Cut { centre, normal: axis, radius, core, open: radius * random.between(0.0, 0.9) }),
        2 => {
            let over = random.pick(&[Over::Along, Over::Across, Over::Distance]);
            let way = random.pick(&[Way::Shift, Way::Turn, Way::Swell, Way::Grow]);
            let value = |random: &mut Seeded| match way {
                Way::Shift => random.between(-0.2, 0.2) * radius,
                Way::Turn => random.between(-40.0, 40.0),
                Way::Swell | Way::Grow => random.spread(0.8, 1.25),
            };
            let knots = (0..4).map(|i| [radius * (f64::from(i) / 2.0 - 0.75), value(random)]).collect();
            Step::Curve(Curve { centre, axis, radius, core, over, way, knots })
        }
        _ => {
            let far = radius * random.between(0.0, 0.8);
            let mut kind = match random.below(7) {
                0 => Kind::Translate { by: random.vector(far) },
                1 => Kind::Rotate { angle: random.between(-180.0, 180.0) },
                2 => Kind::Scale {
                    along: Some(random.spread(0.5, 2.0)),
                    across: Some(random.spread(0.5, 2.0)),
                },
                3 => Kind::Stretch { factor: random.spread(0.5, 2.0) },
                4 => Kind::Squeeze { factor: random.spread(0.5, 2.0) },
                5 => Kind::Twist { rate: random.between(-60.0, 60.0) / radius, length: None },
                _ => Kind::Bend {
                    rate: random.between(-30.0, 30.0) / radius,
                    spine: random.vector(1.0),
                    length: None,
                },
            };
            let end = random.one_in(3).then_some(radius);
            if let Kind::Twist { length, .. } | Kind::Bend { length, .. } = &mut kind {
                *length = end;
            }
            Step::Shape(Shape { kind, centre, axis, radius, core })
        }
    }
}
