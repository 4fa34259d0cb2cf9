//! The processor's rays.

use ivd_core::{Exec, Labels, srgb};

use crate::camera::{Camera, Ray, diagonal, step_mm};
use crate::cast::{Cast, Field};
use crate::dvr::{AtMiddle, dvr as plain};
use crate::frame::{Radiance, one_by_one, tiles};
use crate::light::Light;
use crate::pick::{self, Pick, Seen};
use crate::preintegrated::AtEnds;
use crate::project::{Attenuated, Bounds, FirstPeak, Greatest, Mean};
use crate::samples::{Samples, Shape, Stored};
use crate::shells::{Layer, Layers, Shell};
use crate::stack::{self, Looks};
use crate::surroundings::{self, Around, Surrounded};
use crate::warp::Warp;
use crate::wide::{Pairs, ProjectLanes, Wide, dvr, first_hit, project};
use crate::{Error, Mode, RenderParams, View};

use super::{ModeState, Prepared};

/// Binds the typed voxels and runs the same code for each type.
macro_rules! with_fast {
    ($fast:expr, $slice:ident => $body:expr) => {
        match $fast {
            $crate::samples::KernelVoxels::U8($slice) => $body,
            $crate::samples::KernelVoxels::U16($slice) => $body,
            $crate::samples::KernelVoxels::I16($slice) => $body,
            $crate::samples::KernelVoxels::F32($slice) => $body,
        }
    };
}
pub(super) use with_fast;

impl Prepared<'_> {
    /// The processor's rays.
    pub(crate) fn cast_all(&self, params: &RenderParams, exec: &Exec) -> Result<Radiance, Error> {
        with_fast!(&self.voxels, slice => self.cast(slice, params, exec))
    }

    pub(super) fn field<'f, T: Stored>(&'f self, voxels: &'f [T], camera: &Camera) -> Field<'f, T> {
        let grid = self.scene.volume.grid();
        Field {
            samples: Samples::new(voxels, Shape::new(grid.dims())),
            ids: self.scene.labels.map_or(&[], Labels::ids),
            warp: self.warp.as_ref(),
            space: &self.space,
            light: Light::new(camera, grid.inverse_linear_part(), self.scene.volume.slope()),
        }
    }

    /// Whether rays are cast in packets. What is hidden by where it was before is looked at ray by ray.
    fn wide(&self, exec: &Exec) -> Wide {
        let is_cut = self.warp.as_ref().is_some_and(Warp::is_cut);
        Wide::detected(self.scene.volume.grid().dims(), exec.simd && !is_cut)
    }

    fn cast<T: Pairs>(&self, voxels: &[T], params: &RenderParams, exec: &Exec) -> Result<Radiance, Error> {
        let camera = self.camera(params);
        let field = self.field(voxels, &camera);
        let sign = self.sign() as f32;
        if let Some(cast) = self.cast_otherwise(&field, params, &camera, exec) {
            return cast;
        }
        Ok(match &self.optics {
            ModeState::Dvr(classifier) => {
                // A termination above 1 is never reached.
                let end = params.termination as f32;
                let wide = self.wide(exec);
                match (field.ids.is_empty(), params.shading) {
                    (true, false) => tiles(&camera, exec, |rays| {
                        dvr(wide, &field, &AtMiddle::<false, false>(classifier), end, rays)
                    }),
                    (true, true) => tiles(&camera, exec, |rays| {
                        dvr(wide, &field, &AtMiddle::<false, true>(classifier), end, rays)
                    }),
                    (false, false) => tiles(&camera, exec, |rays| {
                        dvr(wide, &field, &AtMiddle::<true, false>(classifier), end, rays)
                    }),
                    (false, true) => tiles(&camera, exec, |rays| {
                        dvr(wide, &field, &AtMiddle::<true, true>(classifier), end, rays)
                    }),
                }
            }
            ModeState::PreIntegrated(table) => {
                let end = params.termination as f32;
                let wide = self.wide(exec);
                if params.shading {
                    tiles(&camera, exec, |rays| dvr(wide, &field, &AtEnds::<true>(table), end, rays))
                } else {
                    tiles(&camera, exec, |rays| dvr(wide, &field, &AtEnds::<false>(table), end, rays))
                }
            }
            ModeState::Projection(bounds) => match params.mode {
                Mode::Mean => self.projected(&field, &Mean, bounds, &camera, exec),
                Mode::Lmip { threshold } => {
                    self.projected(&field, &self.first_peak(threshold), bounds, &camera, exec)
                }
                Mode::AttenuatedMip { attenuation } => {
                    self.projected(&field, &self.attenuated(attenuation), bounds, &camera, exec)
                }
                _ => self.projected(&field, &Greatest, bounds, &camera, exec),
            },
            ModeState::Iso(iso) if !params.shells.is_empty() => {
                let layers = self.layers(*iso, params, &camera);
                tiles(&camera, exec, |rays| one_by_one(rays, |ray| layers.cast(&field, ray)))
            }
            ModeState::Iso(iso) => {
                let colour = params.surface.map(|c| c as f32);
                let wide = self.wide(exec);
                tiles(&camera, exec, |rays| first_hit(wide, &field, *iso, sign, colour, rays))
            }
        }?)
    }

    /// The opaque surface, and those that are seen through.
    fn layers<'l>(&'l self, iso: f32, params: &RenderParams, camera: &'l Camera) -> Layers<'l> {
        let single = |colour: [f64; 3]| colour.map(|c| c as f32);
        let opaque = Layer { iso, colour: single(params.surface), opacity: 1.0 };
        let shell = |shell: &Shell| Layer {
            iso: self.signed(shell.iso) as f32,
            colour: single(shell.colour),
            opacity: shell.opacity as f32,
        };
        let all = std::iter::once(opaque).chain(params.shells.iter().map(shell)).collect();
        let (sign, termination) = (self.sign() as f32, params.termination as f32);
        Layers { all, sign, termination, camera, grid: self.scene.volume.grid() }
    }

    /// What isn't cast in packets: slices, and what its surroundings take light from.
    fn cast_otherwise<T: Stored>(
        &self,
        field: &Field<'_, T>,
        params: &RenderParams,
        camera: &Camera,
        exec: &Exec,
    ) -> Option<Result<Radiance, Error>> {
        let termination = params.termination as f32;
        if let ModeState::Dvr(classifier) = &self.optics {
            let looks = Looks { field, classifier, is_shaded: params.shading, termination };
            match params.mode {
                Mode::Slices { count, across } => {
                    let found = stack::slices(&looks, camera, count, across, exec);
                    return Some(found.map_err(Error::from));
                }
                Mode::ShearWarp { count } => return Some(stack::shear_warp(&looks, camera, count, exec)),
                _ => {}
            }
        }
        if !params.surroundings.are_asked() {
            return None;
        }
        let around = Around::new(params.surroundings, camera, &field.light, self.scene.volume.grid());
        let is_shaded = params.shading;
        let found = match &self.optics {
            ModeState::Dvr(classifier) if field.ids.is_empty() => {
                let looks = Surrounded { unlit: AtMiddle::<false, false>(classifier), around, is_shaded };
                tiles(camera, exec, |rays| one_by_one(rays, |ray| plain(field, &looks, termination, ray)))
            }
            ModeState::Dvr(classifier) => {
                let looks = Surrounded { unlit: AtMiddle::<true, false>(classifier), around, is_shaded };
                tiles(camera, exec, |rays| one_by_one(rays, |ray| plain(field, &looks, termination, ray)))
            }
            ModeState::PreIntegrated(table) => {
                let looks = Surrounded { unlit: AtEnds::<false>(table), around, is_shaded };
                tiles(camera, exec, |rays| one_by_one(rays, |ray| plain(field, &looks, termination, ray)))
            }
            ModeState::Iso(iso) => {
                let (colour, sign) = (params.surface.map(|c| c as f32), self.sign() as f32);
                let cast = |ray: &Ray| surroundings::first_hit(field, *iso, sign, colour, &around, ray);
                tiles(camera, exec, |rays| one_by_one(rays, cast))
            }
            ModeState::Projection(_) => return None,
        };
        Some(found.map_err(Error::from))
    }

    /// Projects the rays of a picture, and makes of what they come to a grey.
    fn projected<T: Pairs, P: ProjectLanes>(
        &self,
        field: &Field<'_, T>,
        projection: &P,
        bounds: &Bounds,
        camera: &Camera,
        exec: &Exec,
    ) -> Result<Radiance, ivd_core::Error> {
        let (grey, is_grey) = (self.grey(), matches!(self.params.mode, Mode::AttenuatedMip { .. }));
        let shown = |(shown, cast): (f32, Cast)| {
            if shown == f32::NEG_INFINITY {
                return cast;
            }
            let grey = if is_grey { srgb::linear(shown) } else { grey.of(shown) };
            Cast { rgba: [grey, grey, grey, 1.0], ..cast }
        };
        let wide = self.wide(exec);
        let (sign, skip) = (self.sign() as f32, self.params.skip);
        tiles(camera, exec, |rays| project(wide, field, projection, bounds, sign, skip, rays).map(shown))
    }

    /// The first peak above a threshold (real), or above the middle of the range.
    fn first_peak(&self, threshold: Option<f64>) -> FirstPeak {
        let [low, high] = self.range();
        FirstPeak { threshold: self.signed(threshold.unwrap_or(0.5 * (low + high))) as f32 }
    }

    /// What white that lies before a sample, all through the volume's diagonal, dims by `exp(−attenuation)`.
    fn attenuated(&self, attenuation: f64) -> Attenuated {
        let [low, high] = self.window().map(|end| self.signed(end));
        let width = high - low;
        let grid = self.scene.volume.grid();
        let of_step = attenuation * step_mm(grid, &self.params) / diagonal(grid);
        // Where all values are the same they are white.
        let [scale, bias] = if width > 0.0 { [1.0 / width, 0.0] } else { [0.0, 1.0] };
        Attenuated { low: low as f32, scale: scale as f32, bias: bias as f32, of_step: of_step as f32 }
    }

    /// What a view shows at a pixel (column and row, from the top left): of direct volume rendering where opacity passes a half, of a projection where the sample lies
    /// that it shows, of a surface where the ray meets it. `None` where there is nothing to see, or that lies outside the volume before it is deformed.
    ///
    /// # Errors
    /// As [`crate::render`]; a pixel beyond the picture; mode mean, which shows no place.
    pub fn pick(&self, view: View, pixel: [usize; 2]) -> Result<Option<Pick>, Error> {
        self.pick_at(view, pixel, pick::HALF)
    }

    /// As [`Prepared::pick`], of direct volume rendering where opacity passes a share (0…1) of what the ray has in all: a small one is where a translucent
    /// body begins.
    ///
    /// # Errors
    /// As [`Prepared::pick`].
    pub fn pick_at(&self, view: View, [x, y]: [usize; 2], share: f32) -> Result<Option<Pick>, Error> {
        let params = RenderParams { view, picks: vec![[x, y]], ..self.params.clone() };
        params.check()?;
        let camera = self.camera(&params);
        let Some(ray) = camera.ray(x, y) else { return Ok(None) };
        Ok(with_fast!(&self.voxels, slice => self.pick_by(slice, &camera, &ray, share)))
    }

    fn pick_by<T: Pairs>(&self, voxels: &[T], camera: &Camera, ray: &Ray, share: f32) -> Option<Pick> {
        let field = self.field(voxels, camera);
        let seen = self.seen(&field, ray, share)?;
        let real = |fast: f32| self.scene.volume.real(f64::from(fast) + self.shift);
        pick::picked(&field, self.scene.volume.grid(), self.labels, real, seen)
    }

    /// What a ray shows, where a share of its opacity lies before it.
    pub(super) fn seen<T: Pairs>(&self, field: &Field<'_, T>, ray: &Ray, share: f32) -> Option<Seen> {
        let sign = self.sign() as f32;
        match &self.optics {
            ModeState::Dvr(classifier) if field.ids.is_empty() => {
                pick::part_way(field, &AtMiddle::<false, false>(classifier), ray, share)
            }
            ModeState::Dvr(classifier) => {
                pick::part_way(field, &AtMiddle::<true, false>(classifier), ray, share)
            }
            ModeState::PreIntegrated(table) => pick::part_way(field, &AtEnds::<false>(table), ray, share),
            ModeState::Projection(_) => match self.params.mode {
                // What is refused is shown nowhere.
                Mode::Mean => None,
                Mode::Lmip { threshold } => pick::projected(field, &self.first_peak(threshold), sign, ray),
                Mode::AttenuatedMip { attenuation } => {
                    pick::projected(field, &self.attenuated(attenuation), sign, ray)
                }
                _ => pick::projected(field, &Greatest, sign, ray),
            },
            ModeState::Iso(iso) => pick::on_surface(field, *iso, sign, ray),
        }
    }
}
