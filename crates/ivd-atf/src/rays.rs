//! What rays through a volume meet: gathered once, composited again for every choice of opacities.

use ivd_core::{Exec, parallel};
use nalgebra::Vector3;

use crate::Error;
use crate::bins::SampleBins;
use crate::empty::EmptyBricks;
use crate::mix::Mix;
use crate::reduced::{MISSING, Reduced};
use crate::roles::Role;

/// Most rays along the longest side of the volume; as far from each other along all other sides, in all views: a view of twice the area counts
/// twice.
const MOST_ACROSS: usize = 128;
/// Least rays along a side of a view, however narrow.
const LEAST_ACROSS: usize = 8;
/// Directions of views along the grid, each of them both ways, by the same rays: along its axes, …
const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// … and then along its diagonals.
const DIAGONALS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];
/// A step, in distances of samples, is their mean number along an axis over [`ALONG`], but no shorter than one and no longer than this.
const LONGEST_STEP: f64 = 1.5;
/// Mean number of samples along an axis at which a step is one distance of samples.
const ALONG: f64 = 512.0 / 3.0;

/// A ray, by where what it meets ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    /// End of its samples among those of its row of rays.
    pub(crate) end: u32,
    /// Whether it meets matter: a voxel of a material, or one of a transition whose value lies on the materials' side.
    pub(crate) meets_matter: bool,
    /// Whether it meets any voxel with data.
    pub(crate) meets_data: bool,
}

/// Number of a kind of samples: by two bytes where there aren't more kinds than that.
pub(crate) trait Kind: Copy + Send + Sync {
    fn of(kind: u32) -> Self;
    fn place(self) -> usize;
}

impl Kind for u16 {
    #[inline]
    fn of(kind: u32) -> Self {
        debug_assert!(u16::try_from(kind).is_ok(), "more kinds than two bytes tell");
        kind as u16
    }

    #[inline]
    fn place(self) -> usize {
        usize::from(self)
    }
}

impl Kind for u32 {
    #[inline]
    fn of(kind: u32) -> Self {
        kind
    }

    #[inline]
    fn place(self) -> usize {
        self as usize
    }
}

/// Samples of a row of rays.
pub(crate) struct RayRow<K> {
    /// Kinds of the samples that aren't clear whatever the opacities, ray after ray, front to back.
    pub(crate) kinds: Vec<K>,
    pub(crate) rays: Vec<Ray>,
    /// Which of [`Bundle::step_mm`] is the distance of the samples.
    pub(crate) step: usize,
    /// Whether they are looked along from the back, too.
    pub(crate) is_both_ways: bool,
}

impl<K> RayRow<K> {
    /// The rays with the kinds of their samples.
    pub(crate) fn each(&self) -> impl Iterator<Item = (Ray, &[K])> {
        let starts = std::iter::once(0).chain(self.rays.iter().map(|ray| ray.end as usize));
        starts.zip(&self.rays).map(|(start, &ray)| (ray, &self.kinds[start..ray.end as usize]))
    }
}

/// All rays, and the different distances of their samples (mm).
pub(crate) struct Bundle<K> {
    pub(crate) rows: Vec<RayRow<K>>,
    pub(crate) step_mm: Vec<f64>,
}

/// Casts rays along the first `views` directions, a sample every voxel or so, values interpolated between voxels and labels those of the nearest.
///
/// `K` has room for the number of every kind.
pub(crate) fn cast<K: Kind>(
    reduced: &Reduced<'_>,
    mix: &Mix<'_>,
    bins: &SampleBins,
    views: usize,
    exec: &Exec,
) -> Result<Bundle<K>, Error> {
    let across = reduced.dims.into_iter().max().unwrap_or(1).clamp(LEAST_ACROSS, MOST_ACROSS);
    let extents = (0..3).map(|a| reduced.dims[a] as f64 * reduced.spacing[a]);
    let apart = extents.fold(0.0, f64::max) / across as f64;
    let directions = AXES.into_iter().chain(DIAGONALS).zip((0..views).step_by(2));
    let views: Vec<View> = directions.map(|(d, i)| View::new(d, i + 1 < views, reduced, apart)).collect();
    let samples: usize = views.iter().map(|view| view.samples * view.rays[0] * view.rays[1]).sum();
    exec.check_memory("samples on rays", (size_of::<K>() * samples) as u64)?;
    let rows: Vec<(&View, usize)> =
        views.iter().flat_map(|view| (0..view.rays[1]).map(move |v| (view, v))).collect();
    let mut step_mm: Vec<f64> = views.iter().map(|view| view.step_mm).collect();
    step_mm.sort_by(f64::total_cmp);
    step_mm.dedup();
    let is_matter: Vec<bool> = mix.roles.iter().map(|role| *role != Role::Background).collect();
    let caster = Caster {
        reduced,
        bins,
        empty: EmptyBricks::new(reduced, &bins.visible_below(), &|level| bins.bin(level), &is_matter),
        roles: mix.roles,
        row_of: (0..mix.classes.len()).map(|class| mix.row(class)).collect(),
        rows_differ: mix.rows() > 1,
        is_matter: bins.is_matter(),
        is_visible: (0..bins.len()).map(|kind| !bins.parts(kind).is_empty()).collect(),
    };
    let rows = parallel::try_map(rows.len(), &|i| {
        exec.check_cancelled()?;
        let (view, v) = rows[i];
        let step = step_mm.iter().position(|&mm| mm == view.step_mm).expect("each view's step is listed");
        let (kinds, rays, is_both_ways) = (Vec::new(), Vec::new(), view.is_both_ways);
        let mut row = RayRow { kinds, rays, step, is_both_ways };
        (0..view.rays[0]).for_each(|u| caster.ray(view, view.start([u, v]), &mut row));
        row.kinds.shrink_to_fit();
        Ok::<_, Error>(row)
    })?;
    Ok(Bundle { rows, step_mm })
}

/// Where the rays of a view start, and the way between their samples, in samples of the volume.
struct View {
    corner: Vector3<f32>,
    along: [Vector3<f32>; 2],
    /// Rays along each of `along`.
    rays: [usize; 2],
    step: Vector3<f32>,
    step_mm: f64,
    /// Samples of its longest ray.
    samples: usize,
    is_both_ways: bool,
}

impl View {
    /// The longest way through the volume is a whole number of steps, so that a thin one is looked through at its own thickness. In no
    /// direction is a step much longer than the distance of samples there, nor much shorter, whatever their spacing.
    ///
    /// `apart`: distance of rays (mm).
    fn new(direction: [f64; 3], is_both_ways: bool, reduced: &Reduced<'_>, apart: f64) -> Self {
        let spacing = Vector3::from(reduced.spacing);
        let dims = Vector3::from(reduced.dims.map(|n| n as f64));
        let forward = Vector3::from(direction).normalize();
        // Where they look along z the rays of a row lie beside each other along x: they meet the same lines of memory.
        let first = if forward.z.abs() < 0.9 { Vector3::z() } else { Vector3::y() };
        let right = forward.cross(&first).normalize();
        let basis = [right, right.cross(&forward), forward];
        // Corners of the volume [mm] from the first voxel's centre.
        let corners = (0..8).map(|i| {
            Vector3::from_fn(|a, _| (if i >> a & 1 == 1 { dims[a] - 0.5 } else { -0.5 }) * spacing[a])
        });
        let reach = basis.map(|axis| {
            let along = corners.clone().map(|corner| corner.dot(&axis));
            along.fold([f64::MAX, f64::MIN], |[low, high], at| [low.min(at), high.max(at)])
        });
        let width = |i: usize| reach[i][1] - reach[i][0];
        let mean = dims.iter().product::<f64>().cbrt();
        let wanted = (mean / ALONG).clamp(1.0, LONGEST_STEP) / forward.component_div(&spacing).norm();
        let across = (0..3).filter(|&a| forward[a].abs() > 1e-9);
        let longest = across.map(|a| dims[a] * spacing[a] / forward[a].abs()).fold(f64::INFINITY, f64::min);
        let samples = (longest / wanted).ceil().max(1.0);
        let step_mm = longest / samples;
        let in_voxels = |mm: Vector3<f64>| mm.component_div(&spacing).map(|c| c as f32);
        let corner: Vector3<f64> = basis.iter().zip(&reach).map(|(axis, [low, _])| axis * *low).sum();
        Self {
            corner: in_voxels(corner),
            along: [0, 1].map(|i| in_voxels(basis[i] * width(i))),
            // A little less: a whole number of distances stays one.
            rays: [0, 1].map(|i| ((width(i) / apart - 1e-6).ceil() as usize).max(LEAST_ACROSS)),
            step: in_voxels(forward * step_mm),
            step_mm,
            samples: samples as usize,
            is_both_ways,
        }
    }

    fn start(&self, ray: [usize; 2]) -> Vector3<f32> {
        let place = |i: usize| (ray[i] as f32 + 0.5) / self.rays[i] as f32;
        self.corner + self.along[0] * place(0) + self.along[1] * place(1)
    }
}

struct Caster<'a> {
    reduced: &'a Reduced<'a>,
    roles: &'a [Role],
    /// Each class's row.
    row_of: Vec<usize>,
    rows_differ: bool,
    bins: &'a SampleBins,
    empty: EmptyBricks,
    /// Of each bin.
    is_matter: Vec<bool>,
    /// Of each kind.
    is_visible: Vec<bool>,
}

impl Caster<'_> {
    fn ray<K: Kind>(&self, view: &View, start: Vector3<f32>, rays: &mut RayRow<K>) {
        let (dims, step) = (self.reduced.dims.map(|n| n as f32), view.step);
        // Steps at which the ray enters and leaves the volume.
        let [mut enter, mut leave] = [0.0_f32, f32::MAX];
        for a in 0..3 {
            let (low, high) = ((-0.5 - start[a]) / step[a], (dims[a] - 0.5 - start[a]) / step[a]);
            if step[a].abs() > 1e-12 {
                enter = enter.max(low.min(high));
                leave = leave.min(low.max(high));
            } else if start[a] < -0.5 || start[a] > dims[a] - 0.5 {
                leave = -1.0;
            }
        }
        let mut ray = Ray { end: 0, meets_matter: false, meets_data: false };
        // A ray that cuts off less than half a step of a corner has no sample.
        let samples = ((leave - enter).max(0.0).round() as usize).min(view.samples);
        // In the middle of each step, so that no sample lies on a side of the volume.
        let first = start + step * (enter + 0.5 * (leave - enter - samples as f32) + 0.5);
        let mut i = 0;
        while i < samples {
            let at = first + step * i as f32;
            let p = self.inside(at);
            if self.empty.at(p) {
                ray.meets_data = ray.meets_data || self.level(p).is_some();
                i += EmptyBricks::steps_inside(p, at.into(), step.into());
            } else {
                self.sample(p, &mut ray, &mut rays.kinds);
            }
            i += 1;
        }
        ray.end = rays.kinds.len() as u32;
        rays.rays.push(ray);
    }

    /// A place within half a voxel of the outermost voxels, moved to between voxels.
    #[inline]
    fn inside(&self, at: Vector3<f32>) -> [f32; 3] {
        std::array::from_fn(|a| at[a].clamp(0.0, (self.reduced.dims[a] - 1) as f32))
    }

    #[inline]
    fn sample<K: Kind>(&self, p: [f32; 3], ray: &mut Ray, kinds: &mut Vec<K>) {
        let Some(level) = self.level(p) else { return };
        ray.meets_data = true;
        let mut row = 0;
        if self.rows_differ || !ray.meets_matter {
            let nearest = p.map(|c| (c + 0.5) as usize);
            let class = usize::from(self.reduced.rank(nearest));
            row = self.row_of[class];
            ray.meets_matter |= match self.roles[class] {
                Role::Background => false,
                Role::Material => true,
                Role::Transition => {
                    let [x, y, z] = nearest;
                    self.is_matter[self.bins.bin(self.reduced.row(y, z)[x])]
                }
            };
        }
        let kind = self.bins.kind(row, (level + 0.5) as u16);
        if self.is_visible[kind as usize] {
            kinds.push(K::of(kind));
        }
    }

    /// Level between voxels; `None` beside missing data.
    #[inline]
    fn level(&self, p: [f32; 3]) -> Option<f32> {
        let [nx, ny, nz] = self.reduced.dims;
        let i = p.map(|c| c as usize);
        let f: [f32; 3] = std::array::from_fn(|a| p[a] - i[a] as f32);
        let base = i[0] + nx * (i[1] + ny * i[2]);
        let [dx, dy, dz] = [
            usize::from(i[0] + 1 < nx),
            if i[1] + 1 < ny { nx } else { 0 },
            if i[2] + 1 < nz { nx * ny } else { 0 },
        ];
        // A slice of one length: one test instead of eight.
        let levels = &self.reduced.levels[base..=base + dx + dy + dz];
        let c = [
            levels[0],
            levels[dx],
            levels[dy],
            levels[dx + dy],
            levels[dz],
            levels[dx + dz],
            levels[dy + dz],
            levels[dx + dy + dz],
        ];
        let highest = c[0].max(c[1]).max(c[2]).max(c[3]).max(c[4]).max(c[5]).max(c[6]).max(c[7]);
        if highest == MISSING {
            return None;
        }
        let c = c.map(f32::from);
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let x = [mix(c[0], c[1], f[0]), mix(c[2], c[3], f[0]), mix(c[4], c[5], f[0]), mix(c[6], c[7], f[0])];
        Some(mix(mix(x[0], x[1], f[1]), mix(x[2], x[3], f[1]), f[2]))
    }
}
