use std::sync::atomic::{AtomicU64, Ordering};

use ivd_core::{
    BrickRange, Exec, Kernel as _, Labels, Lattice, NO_DATA, Scalar as _, TransferFunction, Volume,
    with_voxels,
};

use crate::camera::{Camera, Ray, centre, step_mm};
use crate::cast::{Cast, Field};
use crate::classify::{Classifier, Steep};
use crate::dvr::AtMiddle;
use crate::empty_space::Space;
use crate::fit::{DARK, Held};
use crate::frame::{Radiance, tiles};
use crate::light::Light;
use crate::pick::{self, Pick};
use crate::plan::{Casting, Grey, Plan, PlanLook, PlanWarp, Sight};
use crate::preintegrated::{AtEnds, Preintegrated};
use crate::project::Bounds;
use crate::samples::{KernelVoxels, Samples, Shape, Stored, fast};
use crate::skip::{NOTHING, carried, join, joined_about, rows_of_bricks, through_warp};
use crate::warp::Warp;
use crate::wide::{Pairs, Wide, dvr, first_hit, mip};
use crate::{
    Classification, Error, Fit, Mode, RenderParams, Rendered, Scene, View, annotate, outline, picture,
};

/// A scene made ready for many views: its classified values, what of it is empty, and its deformation. Views of it are the same, byte for byte, as those
/// of [`crate::render`].
pub struct Prepared<'a> {
    scene: Scene<'a>,
    /// The scene's labels, whether or not they change a picture.
    labels: Option<&'a Labels>,
    params: RenderParams,
    voxels: KernelVoxels<'a>,
    /// `stored = fast + shift`.
    shift: f64,
    warp: Option<Warp<'a>>,
    optics: ModeState,
    space: Space,
    held: Held,
    /// Differs for every prepared scene.
    number: u64,
}

static NUMBERS: AtomicU64 = AtomicU64::new(0);

/// What a mode needs to know of the values.
enum ModeState {
    Dvr(Classifier),
    PreIntegrated(Preintegrated),
    /// Values that no `sign · fast` exceeds.
    Mip(Bounds),
    /// `sign · fast` of the surface.
    Iso(f32),
}

/// Binds the typed voxels and runs the same code for each type.
macro_rules! with_fast {
    ($fast:expr, $slice:ident => $body:expr) => {
        match $fast {
            KernelVoxels::U8($slice) => $body,
            KernelVoxels::U16($slice) => $body,
            KernelVoxels::I16($slice) => $body,
            KernelVoxels::F32($slice) => $body,
        }
    };
}

impl<'a> Prepared<'a> {
    /// Prepares a scene; the view in `params` is not used yet.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn new(scene: &Scene<'a>, params: &RenderParams, exec: &Exec) -> Result<Self, Error> {
        params.check()?;
        scene.check()?;
        exec.run(|| {
            let grid = scene.volume.grid();
            let (voxels, shift) = fast(scene.volume, exec)?;
            let moving = scene.displacement.filter(|d| !is_still(d));
            // Labels that change nothing cost nothing.
            let has_rows = scene.transfer.is_some_and(|t| t.gradient().is_none() && t.depends_on_label());
            // Steps between values know no label 0 either: it is shown there.
            let by_voxel =
                !(params.mode == Mode::Dvr && params.classification == Classification::PreIntegrated);
            let clears = |labels: &Labels| by_voxel && has_unlabelled(scene.volume, labels);
            let labels = scene.labels.filter(|labels| has_rows || clears(labels));
            let mut prepared = Self {
                scene: Scene { labels, ..*scene },
                labels: scene.labels,
                params: RenderParams { skip: params.skip && exec.skip, ..params.clone() },
                voxels,
                shift,
                warp: moving.map(|d| Warp::new(d, grid.inverse_linear_part())),
                optics: ModeState::Mip(Bounds::default()),
                space: Space::full(Shape::new(grid.dims())),
                held: Held::Volume,
                number: NUMBERS.fetch_add(1, Ordering::Relaxed),
            };
            match params.mode {
                Mode::Dvr => prepared.classify(exec)?,
                Mode::Mip => prepared.project(),
                Mode::Iso { value } => prepared.split(value),
            }
            if let Some(held) = scene.held().filter(|_| params.fit == Fit::Visible) {
                prepared.held = Self::new(&held, params, exec)?.held;
            }
            Ok(prepared)
        })
    }

    /// Finds what bricks may add to a maximum.
    fn project(&mut self) {
        let bounds: Vec<f32> = self.ranges().map(|range| self.bound(range)).collect();
        let [low, high] = self.scene.windowed().range().unwrap_or([0.0; 2]);
        let seen_from = self.signed(low + DARK * (high - low));
        self.hold(&bounds.iter().map(|&bound| bound >= seen_from).collect::<Vec<_>>());
        let bounds = self.moved(bounds, f32::NEG_INFINITY, f32::max);
        self.optics = ModeState::Mip(Bounds::new(self.space.bricks(), bounds));
    }

    /// Finds the bricks that reach an isovalue.
    fn split(&mut self, value: f64) {
        let iso = self.signed(value);
        let empty: Vec<bool> = self.ranges().map(|range| self.bound(range) < iso).collect();
        self.hold(&empty.iter().map(|empty| !empty).collect::<Vec<_>>());
        if self.params.skip {
            self.pass_over(empty);
        }
        self.optics = ModeState::Iso(iso);
    }

    /// Sets what the picture holds, of the undeformed bricks that are seen: where they are, and where displacements carry them.
    fn hold(&mut self, seen: &[bool]) {
        if self.params.fit == Fit::Volume || self.scene.whole.is_some() {
            return;
        }
        let grid = self.scene.volume.grid();
        let bricks = self.scene.volume.bricks().dims();
        let framing = self.scene.framing.filter(|d| !is_still(d));
        let framing = framing.map(|d| Warp::new(d, grid.inverse_linear_part()));
        let mut held = seen.to_vec();
        for warp in [self.warp.as_ref(), framing.as_ref()].into_iter().flatten() {
            held.iter_mut().zip(carried(warp, bricks, seen)).for_each(|(held, carried)| *held |= carried);
        }
        let middle = centre(grid);
        let outline = self.scene.lattice.map_or_else(Vec::new, Lattice::positions);
        let outline = outline.into_iter().map(|place| place - middle).collect();
        self.held = Held::of_bricks(grid, &held, outline);
    }

    /// Makes the transfer function ready, and finds what it leaves clear.
    fn classify(&mut self, exec: &Exec) -> Result<(), Error> {
        let transfer = self.scene.transfer.ok_or(Error::NoTransfer)?;
        let index = self.scene.volume.bricks();
        let range = index.total().map_or([0.0; 2], |(lo, hi)| [self.fast(lo), self.fast(hi)]);
        let step = step_mm(self.scene.volume.grid(), &self.params) / transfer.reference_mm();
        let ids = self.scene.labels.map_or(&[][..], Labels::ids);
        let real = |fast: f64| self.scene.volume.real(fast + self.shift);
        if self.params.classification == Classification::PreIntegrated {
            return self.pre_integrate(transfer, range, step, exec);
        }
        let classifier = Classifier::new(transfer, range, real, step, !ids.is_empty());
        if self.params.skip || self.params.fit == Fit::Visible {
            exec.check_cancelled()?;
            let dims = self.scene.volume.grid().dims();
            let rows =
                if ids.is_empty() { vec![1; index.len()] } else { rows_of_bricks(dims, ids, &classifier) };
            let clear = |(range, &rows): (BrickRange, &u64)| classifier.is_clear(range, self.shift, rows);
            let empty: Vec<bool> = self.ranges().zip(&rows).map(clear).collect();
            self.hold(&empty.iter().map(|empty| !empty).collect::<Vec<_>>());
            if self.params.skip {
                self.pass_over(empty);
            }
        }
        self.optics = ModeState::Dvr(classifier);
        Ok(())
    }

    /// The same for steps between values.
    fn pre_integrate(
        &mut self,
        transfer: &TransferFunction,
        range: [f32; 2],
        step: f64,
        exec: &Exec,
    ) -> Result<(), Error> {
        if self.scene.labels.is_some() || transfer.gradient().is_some() {
            return Err(Error::NotByValue);
        }
        let real = |fast: f64| self.scene.volume.real(fast + self.shift);
        let table = Preintegrated::new(transfer, range, real, step, exec)?;
        let seen: Vec<bool> = self.ranges().map(|range| !table.is_clear(range, self.shift)).collect();
        self.hold(&seen);
        if self.params.skip {
            // A step whose middle lies in a brick ends in it or in one beside it: at most five voxels on.
            let index = self.scene.volume.bricks();
            let ranges: Vec<BrickRange> = self.ranges().collect();
            let ranges = self.moved(ranges, NOTHING, join);
            let about = joined_about(index.dims(), &ranges);
            let empty: Vec<bool> = about.into_iter().map(|range| table.is_clear(range, self.shift)).collect();
            self.space = Space::new(Shape::new(self.scene.volume.grid().dims()), &empty);
        }
        self.optics = ModeState::PreIntegrated(table);
        Ok(())
    }

    /// Sets what is passed over from the undeformed bricks that are empty.
    fn pass_over(&mut self, empty: Vec<bool>) {
        let empty = self.moved(empty, true, |a, b| a && b);
        self.space = Space::new(Shape::new(self.scene.volume.grid().dims()), &empty);
    }

    /// A value of every undeformed brick, joined over where each brick of the deformed volume comes from.
    fn moved<V: Copy + Send + Sync>(
        &self,
        of_brick: Vec<V>,
        outside: V,
        join: impl Fn(V, V) -> V + Sync,
    ) -> Vec<V> {
        through_warp(self.warp.as_ref(), self.scene.volume.bricks().dims(), of_brick, outside, join)
    }

    fn ranges(&self) -> impl Iterator<Item = BrickRange> {
        let index = self.scene.volume.bricks();
        (0..index.len()).map(|b| index.range(b))
    }

    fn fast(&self, stored: f32) -> f32 {
        (f64::from(stored) - self.shift) as f32
    }

    /// −1 where the real value falls as the stored one rises, else 1.
    fn sign(&self) -> f64 {
        self.scene.volume.slope().signum()
    }

    /// `sign · fast` of a real value.
    fn signed(&self, value: f64) -> f32 {
        (self.sign() * (self.scene.volume.stored(value) - self.shift)) as f32
    }

    /// A value that no interpolated `sign · fast` of the range exceeds, with room for rounding.
    fn bound(&self, range: BrickRange) -> f32 {
        if range.min > range.max {
            return f32::NEG_INFINITY;
        }
        let (low, high) = (self.fast(range.min), self.fast(range.max));
        let top = if self.sign() < 0.0 { -low } else { high };
        top + 1e-5 * (low.abs() + high.abs())
    }

    /// Linear light of a view.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn radiance(&self, view: View, exec: &Exec) -> Result<Radiance, Error> {
        let params = RenderParams { view, ..self.params.clone() };
        params.check()?;
        exec.run(|| exec.launch::<Casting>(&Sight { prepared: self, params: &params }))
    }

    /// Hands the plan of a view to somebody: for backends that are asked themselves rather than through an [`Exec`].
    ///
    /// # Errors
    /// As [`crate::render`]; [`ivd_core::Error::Device`] where there is no plan of such a picture.
    pub fn with_plan<R>(&self, view: View, take: impl FnOnce(&Plan<'_>) -> R) -> Result<R, Error> {
        let params = RenderParams { view, ..self.params.clone() };
        params.check()?;
        let no_plan = |why: &str| ivd_core::Error::Device { kernel: Casting::NAME, problem: why.to_owned() };
        Ok(take(&self.plan(&params).map_err(no_plan)?))
    }

    /// The processor's rays.
    pub(crate) fn cast_all(&self, params: &RenderParams, exec: &Exec) -> Result<Radiance, Error> {
        with_fast!(&self.voxels, slice => self.cast(slice, params, exec))
    }

    /// What a device needs to know to cast the rays.
    pub(crate) fn plan(&self, params: &RenderParams) -> Result<Plan<'_>, &'static str> {
        let look = match &self.optics {
            ModeState::Dvr(classifier) => PlanLook::Classified {
                table: classifier.table(),
                axis: classifier.axis().numbers(),
                row_starts: classifier.row_starts(),
                steep: classifier.steep().map(Steep::numbers),
                shaded: params.shading,
                termination: params.termination as f32,
            },
            ModeState::PreIntegrated(_) => return Err("pre-integrated steps have no form for devices"),
            ModeState::Mip(bounds) => PlanLook::Maximum {
                bounds: &bounds.of_bricks,
                sign: self.sign() as f32,
                skip: params.skip,
                grey: self.grey(),
            },
            ModeState::Iso(iso) => PlanLook::Surface {
                iso: *iso,
                sign: self.sign() as f32,
                colour: params.surface.map(|c| c as f32),
            },
        };
        let grid = self.scene.volume.grid();
        let camera = Camera::new(grid, params, &self.held);
        let light = Light::new(&camera, grid.inverse_linear_part(), self.scene.volume.slope());
        let moved = self.warp.as_ref().zip(self.scene.displacement);
        let moved = moved.map(|(warp, displacement)| PlanWarp {
            displacement,
            moves: warp.all_moves(),
            rows: *warp.rows(),
        });
        let shape = Shape::new(grid.dims());
        Ok(Plan {
            camera,
            scene: self.number,
            next: shape.next(),
            ends: shape.ends(),
            volume: self.scene.volume,
            voxels: (&self.voxels).into(),
            labels: self.scene.labels.filter(|_| matches!(look, PlanLook::Classified { .. })),
            bricks: self.space.bricks(),
            leaps: self.space.leaps(),
            moved,
            lamp: light.numbers(),
            look,
        })
    }

    /// What makes a greatest value grey.
    fn grey(&self) -> Grey<'a> {
        let window = self.scene.windowed().range().unwrap_or([0.0; 2]);
        Grey { volume: self.scene.volume, sign: self.sign(), shift: self.shift, window }
    }

    /// The picture of a view.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn render(&self, view: View, exec: &Exec) -> Result<Rendered, Error> {
        let light = self.radiance(view, exec)?;
        let params = &self.params;
        let params_of_view = RenderParams { view, ..params.clone() };
        let camera = Camera::new(self.scene.volume.grid(), &params_of_view, &self.held);
        let mut image = picture::compose(&light, params.background.map(|c| c as f32));
        if let Some(lattice) = self.scene.lattice {
            image = outline::outline(&image, lattice, &camera);
        }
        if params.annotate {
            image = annotate::annotate(&image, &camera, self.scene.volume.grid().in_patient());
        }
        let on_the_way = (light.samples + light.skipped).max(1) as f64;
        Ok(Rendered {
            image,
            frames: 1,
            samples: light.samples,
            samples_per_pixel: light.samples as f64 / (params.size[0] * params.size[1]) as f64,
            skipped_fraction: light.skipped as f64 / on_the_way,
        })
    }

    /// What a view shows at a pixel (column and row, from the top left): of direct volume rendering where opacity passes a half, of a maximum where it
    /// lies, of a surface where the ray meets it. `None` where there is nothing to see, or that lies outside the volume before it is deformed.
    ///
    /// # Errors
    /// As [`crate::render`]; a pixel beyond the picture.
    pub fn pick(&self, view: View, [x, y]: [usize; 2]) -> Result<Option<Pick>, Error> {
        let params = RenderParams { view, picks: vec![[x, y]], ..self.params.clone() };
        params.check()?;
        let camera = Camera::new(self.scene.volume.grid(), &params, &self.held);
        let Some(ray) = camera.ray(x, y) else { return Ok(None) };
        Ok(with_fast!(&self.voxels, slice => self.pick_by(slice, &camera, &ray)))
    }

    fn pick_by<T: Pairs>(&self, voxels: &[T], camera: &Camera, ray: &Ray) -> Option<Pick> {
        let field = self.field(voxels, camera);
        let sign = self.sign() as f32;
        let seen = match &self.optics {
            ModeState::Dvr(classifier) if field.ids.is_empty() => {
                pick::half_way(&field, &AtMiddle::<false, false>(classifier), ray)
            }
            ModeState::Dvr(classifier) => pick::half_way(&field, &AtMiddle::<true, false>(classifier), ray),
            ModeState::PreIntegrated(table) => pick::half_way(&field, &AtEnds::<false>(table), ray),
            ModeState::Mip(_) => pick::greatest(&field, sign, ray),
            ModeState::Iso(iso) => pick::on_surface(&field, *iso, sign, ray),
        }?;
        let real = |fast: f32| self.scene.volume.real(f64::from(fast) + self.shift);
        pick::picked(&field, self.scene.volume.grid(), self.labels, real, seen)
    }

    fn field<'f, T: Stored>(&'f self, voxels: &'f [T], camera: &Camera) -> Field<'f, T> {
        let grid = self.scene.volume.grid();
        Field {
            samples: Samples::new(voxels, Shape::new(grid.dims())),
            ids: self.scene.labels.map_or(&[], Labels::ids),
            warp: self.warp.as_ref(),
            space: &self.space,
            light: Light::new(camera, grid.inverse_linear_part(), self.scene.volume.slope()),
        }
    }

    fn cast<T: Pairs>(&self, voxels: &[T], params: &RenderParams, exec: &Exec) -> Result<Radiance, Error> {
        let grid = self.scene.volume.grid();
        let camera = Camera::new(grid, params, &self.held);
        let field = self.field(voxels, &camera);
        let sign = self.sign() as f32;
        Ok(match &self.optics {
            ModeState::Dvr(classifier) => {
                // A termination above 1 is never reached.
                let end = params.termination as f32;
                let wide = Wide::detected(grid.dims(), exec.simd);
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
                let wide = Wide::detected(grid.dims(), exec.simd);
                if params.shading {
                    tiles(&camera, exec, |rays| dvr(wide, &field, &AtEnds::<true>(table), end, rays))
                } else {
                    tiles(&camera, exec, |rays| dvr(wide, &field, &AtEnds::<false>(table), end, rays))
                }
            }
            ModeState::Mip(bounds) => {
                let grey = self.grey();
                let grey = |(greatest, cast): (f32, Cast)| {
                    if greatest == f32::NEG_INFINITY {
                        return cast;
                    }
                    let grey = grey.of(greatest);
                    Cast { rgba: [grey, grey, grey, 1.0], ..cast }
                };
                let wide = Wide::detected(grid.dims(), exec.simd);
                let skip = params.skip;
                tiles(&camera, exec, |rays| mip(wide, &field, bounds, sign, skip, rays).map(grey))
            }
            ModeState::Iso(iso) => {
                let colour = params.surface.map(|c| c as f32);
                let wide = Wide::detected(grid.dims(), exec.simd);
                tiles(&camera, exec, |rays| first_hit(wide, &field, *iso, sign, colour, rays))
            }
        }?)
    }
}

/// Whether a voxel with data has no label: none of the parts that were chosen.
fn has_unlabelled(volume: &Volume, labels: &Labels) -> bool {
    let index = volume.bricks();
    if (0..index.len()).all(|b| !index.range(b).missing) {
        return labels.ids().contains(&NO_DATA);
    }
    with_voxels!(volume.voxels(), slice => {
        let mut pairs = labels.ids().iter().zip(slice);
        pairs.any(|(&id, value)| id == NO_DATA && value.to_f64().is_finite())
    })
}

/// Whether a displacement changes no pixel.
fn is_still(displacement: &ivd_core::Displacement) -> bool {
    displacement.inverse().stored() == 0 && displacement.vacated().iter().all(|&v| v == 0)
}
