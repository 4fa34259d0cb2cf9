use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{Buffer, Error, FieldBricks, Grid, Lattice, World};

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
    pub displacement: Buffer<[f64; 3]>,
}

/// Points inside rigid parts of a lattice, which go with them and tell a map what the surface alone doesn't.
#[derive(Debug, Clone, PartialEq)]
pub struct InteriorPoints {
    /// Places at rest (voxel coordinates), shape `[n, 3]`.
    pub places: Buffer<[f64; 3]>,
    /// Displacement of each (mm), RAS, a list for every frame of the motion; none where there are no places.
    pub frames: Vec<Buffer<[f64; 3]>>,
}

impl Default for InteriorPoints {
    fn default() -> Self {
        Self { places: Vec::new().into(), frames: Vec::new() }
    }
}

/// What a vertex's motion says to a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Role {
    /// A solver moved it: space is to follow.
    Driven = 0,
    /// It was told to stay: space stays there.
    Held = 1,
    /// Nothing reached it: it goes along with what surrounds it, and its motion says nothing.
    Carried = 2,
}

impl Role {
    /// The role of a number, where it is one's.
    pub fn from_number(number: u8) -> Option<Self> {
        [Self::Driven, Self::Held, Self::Carried].get(usize::from(number)).copied()
    }

    /// Whether space is to be where the vertex is.
    pub fn constrains(self) -> bool {
        self != Self::Carried
    }
}

/// How a lattice moves: one or many frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    grid: Grid,
    vertex_count: usize,
    frames: Vec<Frame>,
    reach: Vec<Ball>,
    inner: InteriorPoints,
    /// Of each vertex; empty where all are driven.
    roles: Buffer<u8>,
    /// Of space, a field for every frame; none where the lattice alone was moved.
    space: Vec<FieldBricks>,
}

/// A motion that doesn't fit.
fn bad(problem: String) -> Error {
    Error::Inconsistent { what: "motion", problem }
}

/// The first vector that isn't finite.
fn not_finite(vectors: &[[f64; 3]]) -> Option<usize> {
    vectors.iter().position(|d| !d.iter().all(|c| c.is_finite()))
}

impl Motion {
    /// A motion of a lattice on the grid with so many vertices, without bounds on its reach and without inner points.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first frame that moves another number of vertices, or its first vertex that goes beyond all
    /// numbers.
    pub fn new(grid: Grid, vertex_count: usize, frames: Vec<Frame>) -> Result<Self, Error> {
        for (f, Frame { displacement, .. }) in frames.iter().enumerate() {
            if displacement.len() != vertex_count {
                return Err(bad(format!(
                    "frame {f} moves {} vertices of {vertex_count}",
                    displacement.len()
                )));
            }
            if let Some(v) = not_finite(displacement) {
                return Err(bad(format!("frame {f}, vertex {v}: displacement is not finite")));
            }
        }
        Ok(Self {
            grid,
            vertex_count,
            frames,
            reach: Vec::new(),
            inner: InteriorPoints::default(),
            roles: Vec::new().into(),
            space: Vec::new(),
        })
    }

    /// With what each vertex's motion says, as numbers of [`Role`]; without any all are driven.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where there are roles for another number of vertices, or a number that is no role's.
    pub fn with_roles(self, roles: Buffer<u8>) -> Result<Self, Error> {
        if !roles.is_empty() && roles.len() != self.vertex_count {
            return Err(bad(format!("{} vertices of {} have a role", roles.len(), self.vertex_count)));
        }
        if let Some(v) = roles.iter().position(|role| Role::from_number(*role).is_none()) {
            return Err(bad(format!("vertex {v}: {} is no role", roles[v])));
        }
        // What holds of all is said once.
        let plain = roles.iter().all(|role| *role == Role::Driven as u8);
        Ok(Self { roles: if plain { Vec::new().into() } else { roles }, ..self })
    }

    /// With a bound: see [`Motion::reach`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] names the first ball that is none.
    pub fn with_reach(self, reach: Vec<Ball>) -> Result<Self, Error> {
        let round =
            |b: &Ball| b.centre.iter().all(|c| c.is_finite()) && b.radius >= 0.0 && b.radius.is_finite();
        if let Some(ball) = reach.iter().position(|b| !round(b)) {
            let problem = "of its reach has no finite centre, or no radius of 0 mm or more";
            return Err(bad(format!("ball {ball} {problem}")));
        }
        Ok(Self { reach, ..self })
    }

    /// With inner points: see [`Motion::inner`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where they aren't somewhere and go somewhere in every frame.
    pub fn with_inner(self, inner: InteriorPoints) -> Result<Self, Error> {
        let InteriorPoints { places, frames } = &inner;
        let expected = if places.is_empty() { 0 } else { self.frames.len() };
        let fits = frames.len() == expected && frames.iter().all(|frame| frame.len() == places.len());
        if fits && frames.iter().chain([places]).all(|vectors| not_finite(vectors).is_none()) {
            return Ok(Self { inner, ..self });
        }
        let points = places.len();
        Err(bad(format!(
            "its {points} inner points don't have a finite place and displacement in every frame"
        )))
    }

    /// With the motion of space: see [`Motion::space`].
    ///
    /// # Errors
    /// [`Error::Inconsistent`] where there isn't a field on the grid for every frame.
    pub fn with_space(self, space: Vec<FieldBricks>) -> Result<Self, Error> {
        if !space.is_empty() && space.len() != self.frames.len() {
            return Err(bad(format!("{} fields of space for {} frames", space.len(), self.frames.len())));
        }
        for (f, field) in space.iter().enumerate() {
            if field.dims() != self.grid.dims() {
                let problem = format!(
                    "frame {f} moves space of {:?} voxels, not of {:?}",
                    field.dims(),
                    self.grid.dims()
                );
                return Err(bad(problem));
            }
        }
        Ok(Self { space, ..self })
    }

    /// The same motion gone in part: displacements times a share of 0 … 1.
    #[must_use]
    pub fn part(&self, share: f64) -> Self {
        let of = |vectors: &Buffer<[f64; 3]>| -> Buffer<[f64; 3]> {
            vectors.iter().map(|u| u.map(|c| c * share + 0.0)).collect()
        };
        let frames = self.frames.iter().map(|f| Frame { time: f.time, displacement: of(&f.displacement) });
        let inner = InteriorPoints {
            places: self.inner.places.clone(),
            frames: self.inner.frames.iter().map(of).collect(),
        };
        let space = self.space.iter().map(|field| field.times(share as f32));
        Self { frames: frames.collect(), inner, space: space.collect(), ..self.clone() }
    }

    /// The grid of the lattice that moves.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Vertices of the lattice that moves: a check that the two belong together.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Refuses the motion of another lattice.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the grids or the numbers of vertices differ.
    pub fn require_of(&self, lattice: &Lattice) -> Result<(), Error> {
        if !lattice.grid().matches(&self.grid) {
            return Err(Error::Mismatch {
                what: "motion",
                problem: format!(
                    "it moves a lattice on {:?}, not on {:?}",
                    self.grid.dims(),
                    lattice.grid().dims()
                ),
                remedy: "map the motion onto the lattice that it was computed for",
            });
        }
        if lattice.keys().len() != self.vertex_count {
            return Err(Error::Mismatch {
                what: "motion",
                problem: format!(
                    "it moves {} vertices, the lattice has {}",
                    self.vertex_count,
                    lattice.keys().len()
                ),
                remedy: "map the motion onto the lattice that it was computed for (the same level of refinement)",
            });
        }
        Ok(())
    }

    /// Frames in the order of time.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Balls round the handles beyond which no vertex moves (rest space).
    pub fn reach(&self) -> &[Ball] {
        &self.reach
    }

    /// Points inside rigid parts; none for most.
    pub fn inner(&self) -> &InteriorPoints {
        &self.inner
    }

    /// The voxels' motion (mm), a field for every frame, where what moved the lattice moved space with it; else none. It is 0 beyond the reach.
    pub fn space(&self) -> &[FieldBricks] {
        &self.space
    }

    /// What the vertices' motion says, as numbers of [`Role`]; empty where all are driven.
    pub fn roles(&self) -> &Buffer<u8> {
        &self.roles
    }

    /// What a vertex's motion says.
    pub fn role(&self, vertex: usize) -> Role {
        self.roles.get(vertex).and_then(|role| Role::from_number(*role)).unwrap_or(Role::Driven)
    }

    /// Largest displacement of any frame (mm).
    pub fn max_displacement(&self) -> f64 {
        self.frames
            .iter()
            .flat_map(|f| &f.displacement[..])
            .map(|&d| Vector3::from(d).norm())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_balls_and_inner_points_that_do_not_fit_are_refused_by_number() {
        let grid = Grid::with_spacing([3; 3], [1.0; 3]).unwrap();
        let frame =
            |displacement: &[[f64; 3]]| Frame { time: 0.0, displacement: displacement.to_vec().into() };
        let made = |frames| Motion::new(grid.clone(), 2, frames);
        let refused = |made: Result<Motion, Error>, part: &str| {
            let error = made.unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        let sound = frame(&[[0.0; 3], [1.0, 0.0, -2.0]]);
        refused(made(vec![sound.clone(), frame(&[[0.0; 3]])]), "frame 1 moves 1 vertices of 2");
        for bad in [f64::NAN, f64::INFINITY] {
            refused(made(vec![frame(&[[0.0; 3], [0.0, bad, 0.0]])]), "frame 0, vertex 1");
        }
        let motion = made(vec![sound]).unwrap();
        let ball = |x: f64, radius: f64| Ball { centre: [x, 0.0, 0.0], radius };
        for bad in [ball(f64::NAN, 1.0), ball(0.0, -1.0), ball(0.0, f64::INFINITY), ball(0.0, f64::NAN)] {
            refused(motion.clone().with_reach(vec![ball(0.0, 0.0), bad]), "ball 1");
        }
        let inner = |places: &[[f64; 3]], frames: &[&[[f64; 3]]]| InteriorPoints {
            places: places.to_vec().into(),
            frames: frames.iter().map(|frame| frame.to_vec().into()).collect(),
        };
        let (at, lost) = ([0.5, 1.0, 2.0], [f64::NAN, 0.0, 0.0]);
        for bad in [
            inner(&[at], &[]),
            inner(&[at], &[&[]]),
            inner(&[at], &[&[at], &[at]]),
            inner(&[], &[&[]]),
            inner(&[lost], &[&[at]]),
            inner(&[at], &[&[lost]]),
        ] {
            refused(motion.clone().with_inner(bad), "inner points");
        }
        let whole =
            motion.with_reach(vec![ball(1.0, 0.0)]).unwrap().with_inner(inner(&[at], &[&[at]])).unwrap();
        assert_eq!(
            (whole.max_displacement(), whole.reach().len(), whole.inner().places.len()),
            (5.0_f64.sqrt(), 1, 1)
        );
    }

    #[test]
    fn fields_of_space_fit_the_frames_and_the_grid_and_shrink_with_the_way() {
        let grid = Grid::with_spacing([3; 3], [1.0; 3]).unwrap();
        let frame = Frame { time: 0.0, displacement: vec![[2.0, 0.0, 0.0]].into() };
        let motion = Motion::new(grid, 1, vec![frame]).unwrap();
        let field =
            |x: f32| FieldBricks::new([3; 3], vec![0], vec![[x, 0.0, 0.0]; FieldBricks::VOXELS].into());
        let refused = |space: Vec<FieldBricks>, part: &str| {
            let error = motion.clone().with_space(space).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        refused(vec![field(1.0).unwrap(); 2], "2 fields of space for 1 frames");
        refused(vec![FieldBricks::zero([4; 3])], "[4, 4, 4] voxels");
        let moved = motion.with_space(vec![field(3.0).unwrap()]).unwrap();
        let half = moved.part(0.5);
        assert_eq!(half.space()[0].at(crate::VoxelIndex([1; 3])), [1.5, 0.0, 0.0]);
        assert_eq!(half.frames()[0].displacement[0], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn roles_fit_the_vertices_and_are_said_once_where_all_are_driven() {
        let grid = Grid::with_spacing([3; 3], [1.0; 3]).unwrap();
        let motion = Motion::new(grid, 2, vec![]).unwrap();
        let with = |roles: &[u8]| motion.clone().with_roles(roles.to_vec().into());
        assert!(with(&[0]).unwrap_err().to_string().contains("1 vertices of 2"));
        assert!(with(&[0, 3]).unwrap_err().to_string().contains("vertex 1: 3 is no role"));
        assert_eq!(with(&[0, 0]).unwrap(), motion);
        let some = with(&[1, 2]).unwrap();
        assert_eq!([some.role(0), some.role(1)], [Role::Held, Role::Carried]);
        assert_eq!(motion.role(1), Role::Driven);
    }
}
