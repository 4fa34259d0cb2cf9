//! From places to pixels and back, for whoever draws over a picture or takes hold of what it shows.

use ivd_core::Grid;
use nalgebra::Vector3;

use crate::camera::Camera;
use crate::fit::Held;
use crate::{Error, Prepared, Projection, RenderParams, View};

/// How a view turns places into pixels. Places are mm, RAS; pixels count from the middle of the top left one.
pub struct Lens {
    camera: Camera,
    middle: Vector3<f64>,
}

impl Lens {
    fn new(camera: Camera) -> Self {
        Self { middle: camera.centre(), camera }
    }

    /// That of pictures that hold the whole volume ([`Fit::Volume`](crate::Fit)) at zoom 1, whatever is seen of it: known without a look at a voxel.
    ///
    /// # Errors
    /// [`ivd_core::Error::Param`] names a parameter outside its domain.
    pub fn of_volume(grid: &Grid, params: &RenderParams) -> Result<Self, Error> {
        params.check()?;
        Ok(Self::new(Camera::new(grid, params, &Held::Volume)))
    }

    /// Where a place is seen, as column and row; `None` behind the eye.
    pub fn project(&self, place: [f64; 3]) -> Option<[f64; 2]> {
        self.camera.project(Vector3::from(place))
    }

    /// What lies in the middle of the picture (mm, RAS).
    pub fn middle(&self) -> [f64; 3] {
        self.middle.into()
    }

    /// Unit directions to the picture's right, up, and towards the eye (RAS).
    pub fn axes(&self) -> [[f64; 3]; 3] {
        [self.camera.right, self.camera.up, self.camera.towards_eye].map(Into::into)
    }

    /// Unit direction from a place towards the eye (RAS): the line of sight through it.
    pub fn sight(&self, place: [f64; 3]) -> [f64; 3] {
        self.camera.sight(Vector3::from(place)).into()
    }

    /// How far apart places beside this one are that neighbouring pixels show (mm): for moving it with the pointer.
    pub fn pixel_at(&self, place: [f64; 3]) -> f64 {
        match self.camera.projection() {
            Projection::Orthographic => self.camera.pixel_mm,
            Projection::Perspective => {
                self.camera.pixel_mm * self.camera.depth(Vector3::from(place)).max(0.0)
                    / self.camera.distance()
            }
        }
    }
}

impl Prepared<'_> {
    /// How a view turns places into pixels.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn lens(&self, view: View) -> Result<Lens, Error> {
        let params = RenderParams { view, ..self.params().clone() };
        params.check()?;
        Ok(Lens::new(self.camera(&params)))
    }
}
