//! Pictures of scanned volumes, and of deformed ones, cast ray by ray on the processor.
//!
//! [`render`] takes a [`Scene`] (a volume and what to show of it) and [`RenderParams`] (size, mode, view, step) and gives a [`Rendered`]
//! picture. It is the reference for every faster renderer, so its decisions are few and written down:
//!
//! - **Optics.** Emission and absorption with the premultiplied over operator, front to back, post-classified, or pre-integrated between the ends of
//!   steps; the opacity of a transfer function
//!   holds over its reference length and is corrected for the step: `1 - (1 - α)^(step / reference)`. The last, shorter step of a
//!   ray counts by its length, so that a homogeneous slab is exact at any step.
//! - **Space.** World millimetres: spacing, oblique and left-handed grids are honoured. A voxel reaches half a voxel round its centre; between
//!   centres values are trilinear, beyond the outermost ones constant. A cell with a missing (NaN) corner is clear.
//! - **Deformation.** A deformed volume is sampled through its inverse displacement, `f(ψ(y))`, with normals `J⁻ᵀ∇f`; no voxel is resampled, and
//!   where no displacement is stored the pixels are those of the undeformed volume, bit for bit.
//! - **Skipping.** Bricks whose range of values is clear under the transfer function (for the rows that their labels choose) are skipped. On or off, the
//!   pixels are the same bit for bit; so are they for any number of threads, and whether rays are cast one by one or eight at a time.
//! - **Clipping.** Half spaces and boxes in world space shorten rays, so that steps begin at the cut; at rest they hide samples by where these come from.
//! - **View.** Azimuth 0 and elevation 0 show a patient from the front, head up, the patient's left at the picture's right. At zoom 1 what is
//!   seen fits into the picture, before and after a deformation alike ([`Fit`]).
//!
//! [`surface`] draws a lattice: lit, as a wire-frame, or coloured by any figure of its places.
//!
//! [`Prepared`] keeps what several views of one scene share. [`radiance`] stops before background, lettering and 8-bit encoding; [`difference`] compares two pictures.
//!
//! ```
//! use ivd_core::{Exec, Grid, TransferFunction, Volume, Voxels};
//! use ivd_render::{RenderParams, Scene, render};
//!
//! let grid = Grid::with_spacing([32, 32, 32], [1.0, 1.0, 1.5])?;
//! let far = |c: usize| (c as f32 - 15.5).powi(2);
//! let voxels: Vec<f32> = (0..grid.len())
//!     .map(|i| grid.index(i).0)
//!     .map(|[x, y, z]| 100.0 - far(x) - far(y) - far(z))
//!     .collect();
//! let volume = Volume::new(grid, Voxels::from(voxels))?;
//! // Clear below 0, orange above.
//! let ramp = vec![[0.0; 4], [1.0, 0.5, 0.1, 0.4]];
//! let transfer = TransferFunction::new([0.0, 100.0], 2, 2.0, vec![0], ramp, vec![])?;
//!
//! let scene = Scene { transfer: Some(&transfer), ..Scene::new(&volume) };
//! let params = RenderParams { size: [64; 2], ..RenderParams::default() };
//! let rendered = render(&scene, &params, &Exec::default()).unwrap();
//! assert_eq!((rendered.image.width(), rendered.image.height()), (64, 64));
//! assert!(rendered.skipped_fraction > 0.0, "the corners are empty");
//! # Ok::<(), ivd_core::Error>(())
//! ```
#![deny(unsafe_code)]

mod annotate;
mod axis;
mod camera;
mod cast;
mod cell;
mod classify;
mod cube;
mod cut;
mod difference;
mod dvr;
mod empty_space;
mod error;
mod fit;
mod font;
mod frame;
mod legend;
mod lens;
mod light;
mod looks;
mod outline;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "unchecked reads of eight lanes, argued in the module's head")]
mod packet;
mod pair;
mod params;
mod pick;
mod picture;
pub mod plan;
mod preintegrated;
mod prepared;
mod project;
mod rendered;
#[allow(unsafe_code, reason = "unchecked gathers, argued in the module's head")]
mod samples;
pub mod scale;
mod scene;
mod shells;
mod skip;
mod stack;
mod stage;
mod surface;
mod surroundings;
mod warp;
#[allow(unsafe_code, reason = "calls the version for AVX2 where it was found")]
mod wide;
mod written;

pub use cut::{Clip, ClipSpace};
pub use difference::{Difference, difference};
pub use error::Error;
pub use frame::Radiance;
pub use lens::Lens;
pub use looks::{ClassLooks, Colour, Opacity};
pub use pair::{side_by_side, wipe};
pub use params::{Across, Classification, Fit, Mode, Projection, RenderParams, Side, View};
pub use pick::Pick;
pub use prepared::{Moved, Prepared};
pub use rendered::Rendered;
pub use scene::Scene;
pub use shells::Shell;
pub use stage::{
    AttenuatedMipParams, Coloured, DISPLACEMENT, DifferenceFigures, DifferenceParams, DvrParams, FRAMING,
    Greys, IsoParams, LmipParams, MeanParams, MinipParams, MipParams, MovedFigures, MovedParams, Pair,
    Picked, Plain, RenderFigures, STAGE, ShearWarpParams, SlicesParams, VOLUME, WHOLE,
};
pub use surface::{SurfaceStyle, surface};
pub use surroundings::Surroundings;

use ivd_core::Exec;

/// Renders a picture of a scene.
///
/// # Errors
/// [`ivd_core::Error::Param`] names a parameter outside its domain; [`Error::NoTransfer`] for mode `dvr` without a transfer function; [`Error::Core`] where
/// the scene's parts lie on different grids, memory is short or the work was cancelled.
pub fn render(scene: &Scene, params: &RenderParams, exec: &Exec) -> Result<Rendered, Error> {
    Prepared::new(scene, params, exec)?.render(params.view, exec)
}

/// Casts a ray through every pixel and returns linear light, without background, letters and encoding: for measuring, and for callers who compose
/// pictures themselves.
///
/// # Errors
/// As [`render`].
pub fn radiance(scene: &Scene, params: &RenderParams, exec: &Exec) -> Result<Radiance, Error> {
    Prepared::new(scene, params, exec)?.radiance(params.view, exec)
}
