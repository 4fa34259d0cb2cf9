use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{Error, Grid, World};

/// A ball in rest space.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ball {
    /// Centre (mm), RAS.
    pub centre: [f64; 3],
    /// Radius (mm).
    pub radius: f64,
}

impl Ball {
    /// Distance (mm) of a point from the ball's surface, negative inside.
    pub fn distance(&self, point: World) -> f64 {
        (point.0 - Vector3::from(self.centre)).norm() - self.radius
    }
}

/// Displacement of every lattice vertex at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Time since rest (s).
    pub time: f64,
    /// Displacement of each vertex (mm), RAS, shape `[vertex_count, 3]`; exactly 0 where nothing moved.
    pub displacement: Vec<[f64; 3]>,
}

/// Points inside rigid parts of a lattice, which go with them and tell a map what the surface alone doesn't.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inner {
    /// Places at rest (voxel coordinates), shape `[n, 3]`.
    pub places: Vec<[f64; 3]>,
    /// Displacement of each (mm), RAS, a list for every frame of the motion; none where there are no places.
    pub frames: Vec<Vec<[f64; 3]>>,
}

/// How a lattice moves: one or many frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// The grid of the lattice that moves.
    pub grid: Grid,
    /// Vertices of the lattice that moves: a check that the two belong together.
    pub vertex_count: usize,
    /// Frames in the order of time.
    pub frames: Vec<Frame>,
    /// Balls round the handles beyond which no vertex moves (rest space).
    pub reach: Vec<Ball>,
    /// Points inside rigid parts; none for most.
    pub inner: Inner,
}

impl Motion {
    /// Checks lengths, that every displacement is finite, and that the balls are balls.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first frame and vertex that don't fit, or the ball.
    pub fn check(&self) -> Result<(), Error> {
        for (f, frame) in self.frames.iter().enumerate() {
            if frame.displacement.len() != self.vertex_count {
                return Err(Error::Inconsistent {
                    what: "motion",
                    problem: format!(
                        "frame {f} moves {} vertices of {}",
                        frame.displacement.len(),
                        self.vertex_count
                    ),
                });
            }
            if let Some(v) = frame.displacement.iter().position(|d| !d.iter().all(|c| c.is_finite())) {
                return Err(Error::Inconsistent {
                    what: "motion",
                    problem: format!("frame {f}, vertex {v}: displacement is not finite"),
                });
            }
        }
        let round =
            |b: &Ball| b.centre.iter().all(|c| c.is_finite()) && b.radius >= 0.0 && b.radius.is_finite();
        if let Some(ball) = self.reach.iter().position(|b| !round(b)) {
            return Err(Error::Inconsistent {
                what: "motion",
                problem: format!(
                    "ball {ball} of its reach has no finite centre, or no radius of 0 mm or more"
                ),
            });
        }
        let Inner { places, frames } = &self.inner;
        let expected = if places.is_empty() { 0 } else { self.frames.len() };
        let fits = frames.len() == expected && frames.iter().all(|frame| frame.len() == places.len());
        let finite = |vectors: &[[f64; 3]]| vectors.iter().flatten().all(|c| c.is_finite());
        if fits && finite(places) && frames.iter().all(|frame| finite(frame)) {
            return Ok(());
        }
        Err(Error::Inconsistent {
            what: "motion",
            problem: format!(
                "its {} inner points don't have a finite place and displacement in every frame",
                places.len()
            ),
        })
    }

    /// Largest displacement of any frame (mm).
    pub fn max_displacement(&self) -> f64 {
        self.frames.iter().flat_map(|f| &f.displacement).map(|&d| Vector3::from(d).norm()).fold(0.0, f64::max)
    }
}
