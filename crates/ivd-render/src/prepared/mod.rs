//! What several views of one scene share.

mod cast;
mod moved;
mod ready;

pub(crate) use moved::LEAST_MOVED;
pub use moved::Moved;

use std::sync::atomic::{AtomicU64, Ordering};

use ivd_core::{Exec, Image, Kernel as _, Labels, NO_DATA, Scalar as _, Volume, with_voxels};

use crate::annotate::{Bar, Marks};
use crate::camera::Camera;
use crate::classify::{Classifier, Steep};
use crate::cut::HalfSpace;
use crate::empty_space::Space;
use crate::fit::Held;
use crate::frame::Radiance;
use crate::legend::Legend;
use crate::light::Light;
use crate::picture::Background;
use crate::plan::{Casting, Grey, Plan, PlanLook, PlanWarp, Sight};
use crate::preintegrated::Preintegrated;
use crate::project::Bounds;
use crate::samples::{KernelVoxels, Shape, fast};
use crate::warp::Warp;
use crate::{
    Classification, ClipSpace, Error, Fit, Mode, RenderParams, Rendered, Scene, View, annotate, outline,
    picture,
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
    /// What the picture's greys or colours stand for, where that is asked for.
    legend: Option<Legend>,
    /// Differs for every prepared scene.
    number: u64,
}

static NUMBERS: AtomicU64 = AtomicU64::new(0);

/// What a mode needs to know of the values.
enum ModeState {
    Dvr(Classifier),
    PreIntegrated(Preintegrated),
    /// Values that no `sign · fast` exceeds.
    Projection(Bounds),
    /// `sign · fast` of the surface.
    Iso(f32),
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
            let clears =
                |labels: &Labels| by_voxel && !scene.unlabelled && has_unlabelled(scene.volume, labels);
            let labels = scene.labels.filter(|labels| has_rows || clears(labels));
            let mut prepared = Self {
                scene: Scene { labels, ..*scene },
                labels: scene.labels,
                params: RenderParams {
                    skip: params.skip && exec.skip,
                    // The number of slices takes its place; short, so that opacities over it are far from 1.
                    step: if params.mode.is_by_slices() { 0.1 } else { params.step },
                    ..params.clone()
                },
                voxels,
                shift,
                warp: moving.map(|d| {
                    let cuts = match params.clip_space {
                        ClipSpace::Rest => HalfSpace::all(&params.clip, grid),
                        ClipSpace::Deformed => Vec::new(),
                    };
                    Warp::new(d, grid.inverse_linear_part()).with_cuts(&cuts)
                }),
                optics: ModeState::Projection(Bounds::default()),
                space: Space::full(Shape::new(grid.dims())),
                held: Held::Volume,
                legend: None,
                number: NUMBERS.fetch_add(1, Ordering::Relaxed),
            };
            match params.mode {
                Mode::Dvr | Mode::Slices { .. } | Mode::ShearWarp { .. } => prepared.classify(exec)?,
                Mode::Iso { value } => prepared.split(value),
                Mode::Mip | Mode::Minip | Mode::Mean | Mode::Lmip { .. } | Mode::AttenuatedMip { .. } => {
                    prepared.project();
                }
            }
            if let Some(held) = scene.held().filter(|_| params.fit == Fit::Visible) {
                prepared.held = Self::new(&held, params, exec)?.held;
            } else if params.turntable > 1 {
                prepared.held = std::mem::replace(&mut prepared.held, Held::Volume).turned(params.turntable);
            }
            if params.legend {
                prepared.legend = Some(prepared.legend()?);
            }
            Ok(prepared)
        })
    }

    /// −1 where what is sought, greatest values or in mode minip least ones, falls as the stored value rises, else 1.
    fn sign(&self) -> f64 {
        let turned = if self.params.mode == Mode::Minip { -1.0 } else { 1.0 };
        turned * self.scene.volume.slope().signum()
    }

    /// `sign · fast` of a real value.
    fn signed(&self, value: f64) -> f64 {
        self.sign() * (self.scene.volume.stored(value) - self.shift)
    }

    /// Real values that a projection shows black and white.
    fn window(&self) -> [f64; 2] {
        self.params.window.unwrap_or_else(|| self.range())
    }

    /// What the greys or colours stand for.
    fn legend(&self) -> Result<Legend, Error> {
        match self.scene.transfer.filter(|_| self.params.mode.is_coloured()) {
            None => Ok(Legend::of_greys(self.window())),
            Some(transfer) => {
                let by_label = self.scene.labels.is_some() && transfer.depends_on_label();
                Legend::of_table(transfer).filter(|_| !by_label).ok_or(Error::NoLegend)
            }
        }
    }

    /// Least and greatest real value.
    fn range(&self) -> [f64; 2] {
        self.scene.windowed().range().unwrap_or([0.0; 2])
    }

    /// Linear light of a view.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn radiance(&self, view: View, exec: &Exec) -> Result<Radiance, Error> {
        let rays = self.params.antialias;
        let asked = RenderParams { view, ..self.params.clone() };
        asked.check()?;
        let params = RenderParams { size: asked.size.map(|side| rays * side), antialias: 1, ..asked };
        exec.run(|| Ok(exec.launch::<Casting>(&Sight { prepared: self, params: &params })?.averaged(rays)))
    }

    /// Hands the plan of a view to somebody: for backends that are asked themselves rather than through an [`Exec`].
    ///
    /// # Errors
    /// As [`crate::render`]; [`ivd_core::Error::Device`] where there is no plan of such a picture, as of several rays a pixel.
    pub fn with_plan<R>(&self, view: View, take: impl FnOnce(&Plan<'_>) -> R) -> Result<R, Error> {
        let params = RenderParams { view, ..self.params.clone() };
        params.check()?;
        let no_plan = |why: &str| ivd_core::Error::Device { kernel: Casting::NAME, problem: why.to_owned() };
        if params.antialias > 1 {
            return Err(no_plan("a plan is of one ray a pixel; ask for the light of a view").into());
        }
        Ok(take(&self.plan(&params).map_err(no_plan)?))
    }

    /// What a device needs to know to cast the rays.
    pub(crate) fn plan(&self, params: &RenderParams) -> Result<Plan<'_>, &'static str> {
        if params.mode.is_by_slices() {
            return Err("slices have no form for devices");
        }
        if params.surroundings.are_asked() {
            return Err("ambient occlusion and shadows have no form for devices");
        }
        if !params.shells.is_empty() {
            return Err("surfaces that are seen through have no form for devices");
        }
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
            ModeState::Projection(bounds) => match params.mode {
                Mode::Mip | Mode::Minip => PlanLook::Maximum {
                    bounds: &bounds.of_bricks,
                    sign: self.sign() as f32,
                    skip: params.skip,
                    grey: self.grey(),
                },
                _ => return Err("projections other than mip and minip have no form for devices"),
            },
            ModeState::Iso(iso) => PlanLook::Surface {
                iso: *iso,
                sign: self.sign() as f32,
                colour: params.surface.map(|c| c as f32),
            },
        };
        let grid = self.scene.volume.grid();
        if !params.clip.is_empty() {
            return Err("clipped rays have no form for devices");
        }
        let camera = self.camera(params);
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

    /// What is drawn over a picture.
    fn marks<'m>(&self, bar: Option<&'m Bar<'m>>) -> Marks<'m> {
        let RenderParams { annotate, cube, .. } = self.params;
        Marks { annotate, cube, in_patient: self.scene.volume.grid().in_patient(), bar }
    }

    /// The camera of a view: its rays are clipped unless samples are by where they were before.
    pub(crate) fn camera(&self, params: &RenderParams) -> Camera {
        let grid = self.scene.volume.grid();
        if self.warp.as_ref().is_some_and(Warp::is_cut) {
            return Camera::new(grid, &RenderParams { clip: Vec::new(), ..params.clone() }, &self.held);
        }
        Camera::new(grid, params, &self.held)
    }

    pub(crate) fn params(&self) -> &RenderParams {
        &self.params
    }

    /// What makes a projected value grey.
    fn grey(&self) -> Grey<'a> {
        Grey { volume: self.scene.volume, sign: self.sign(), shift: self.shift, window: self.window() }
    }

    /// The pictures of a turntable that begins with a view, or the one picture of it.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn render_all(&self, view: View, exec: &Exec) -> Result<Rendered, Error> {
        let Self { params: RenderParams { turntable, size, keep_light, .. }, .. } = *self;
        if turntable == 1 {
            return self.render(view, exec);
        }
        let length = 4 * turntable * size[0] * size[1];
        exec.check_memory("pictures", (if keep_light { 5 * length } else { length }) as u64)?;
        let mut rgba = Vec::with_capacity(length);
        let mut light = Vec::with_capacity(if keep_light { length } else { 0 });
        let (mut samples, mut skipped) = (0, 0);
        for frame in 0..turntable {
            let made = self.picture(self.turned(view, frame), exec)?;
            rgba.extend_from_slice(made.image.rgba());
            light.extend_from_slice(made.image.light().unwrap_or_default());
            (samples, skipped) = (samples + made.samples, skipped + made.skipped);
        }
        let image = Image::of_frames(size, turntable, rgba)?;
        let image = if keep_light { image.with_light(light)? } else { image };
        Ok(Made { image, samples, skipped }.into())
    }

    /// The view of a frame of a turntable that begins with a view.
    fn turned(&self, view: View, frame: usize) -> View {
        let turn = 360.0 * frame as f64 / self.params.turntable as f64;
        View { angles: [view.angles[0] + turn, view.angles[1]], ..view }
    }

    /// The picture of a view.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn render(&self, view: View, exec: &Exec) -> Result<Rendered, Error> {
        Ok(self.picture(view, exec)?.into())
    }

    fn picture(&self, view: View, exec: &Exec) -> Result<Made, Error> {
        let light = self.radiance(view, exec)?;
        let params = &self.params;
        let params_of_view = RenderParams { view, ..params.clone() };
        let camera = self.camera(&params_of_view);
        let mut image = picture::compose(&light, &Background::of(params));
        if let Some(lattice) = self.scene.lattice {
            image = outline::outline(&image, lattice, &camera);
        }
        let legend = self.legend.as_ref().map(Legend::bar);
        image = annotate::annotate(image, &camera, &self.marks(legend.as_ref()));
        let Radiance { samples, skipped, rgba, .. } = light;
        if params.keep_light {
            image = image.with_light(rgba.into_flattened())?;
        }
        Ok(Made { image, samples, skipped })
    }
}

/// A picture, or several, with the samples that were taken and passed over for it.
struct Made {
    image: Image,
    samples: u64,
    skipped: u64,
}

impl From<Made> for Rendered {
    fn from(Made { image, samples, skipped }: Made) -> Self {
        let pixels = (image.rgba().len() / 4) as f64;
        Self {
            frames: image.frames() as u32,
            image,
            samples,
            samples_per_pixel: samples as f64 / pixels,
            skipped_fraction: skipped as f64 / (samples + skipped).max(1) as f64,
        }
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
