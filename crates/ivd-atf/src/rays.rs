//! What rays through a volume meet: gathered once, looked at again for every choice of opacities.

use ivd_core::{Exec, Grid, parallel};
use nalgebra::Vector3;

use crate::Error;
use crate::built::reference_mm;
use crate::empty::Empty;
use crate::mix::Mix;
use crate::reduced::{MISSING, Reduced, TOP};
use crate::roles::Role;

/// Most rays along a side of a view.
const MOST_ACROSS: usize = 128;
/// Directions of views along the grid: its six sides, then its eight corners.
const DIRECTIONS: [[f32; 3]; 14] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [1.0, 1.0, 1.0],
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, 1.0],
];
/// Distance of samples, in reference lengths at least.
const STEP: f64 = 0.75;
/// Most values that are told apart, in all rows together.
const MOST_SYMBOLS: usize = 1 << 16;
/// Most values that are told apart in a row.
const MOST_IN_ROW: usize = 2048;

/// What a sample may be: a value of one of a number of bins, in a row.
pub(crate) struct Symbols {
    /// Materials of every symbol with their shares, one after the other.
    parts: Vec<(u16, f32)>,
    /// Where the parts of each symbol begin, and the end.
    starts: Vec<u32>,
    in_row: usize,
    /// Bins a level.
    per_level: f32,
}

impl Symbols {
    pub(crate) fn new(mix: &Mix<'_>, reduced: &Reduced<'_>) -> Self {
        let rows = mix.rows();
        let in_row = (MOST_SYMBOLS / rows.next_power_of_two()).clamp(16, MOST_IN_ROW);
        let value = |bin: usize| reduced.real((bin as f64 + 0.5) * f64::from(TOP) / in_row as f64);
        let at: Vec<Vec<(usize, f64)>> = (0..in_row).map(|bin| mix.at(value(bin))).collect();
        let (mut parts, mut starts, mut shares) = (Vec::new(), vec![0], Vec::new());
        for row in 0..rows {
            for (bin, at) in at.iter().enumerate() {
                mix.shares(row, value(bin), at, &mut shares);
                parts.extend(shares.iter().map(|&(class, share)| (class as u16, share as f32)));
                starts.push(parts.len() as u32);
            }
        }
        Self { parts, starts, in_row, per_level: in_row as f32 / f32::from(TOP) }
    }

    /// Number of symbols.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// How many bins before each hold something to see in some row.
    fn seen_below(&self) -> Vec<usize> {
        let is_seen = |bin: usize| (bin..self.len()).step_by(self.in_row).any(|s| !self.parts(s).is_empty());
        let mut below = vec![0];
        (0..self.in_row).for_each(|bin| below.push(below[bin] + usize::from(is_seen(bin))));
        below
    }

    /// The bin of a level, which may lie between two.
    #[inline]
    fn bin(&self, level: f32) -> usize {
        ((level * self.per_level) as usize).min(self.in_row - 1)
    }

    /// Whether at least half of what is at a level, by its value alone, is material.
    fn is_matter(&self) -> Vec<bool> {
        (0..self.in_row)
            .map(|bin| self.parts(bin).iter().map(|(_, share)| share).sum::<f32>() >= 0.5)
            .collect()
    }

    /// Materials of a symbol with their shares.
    pub(crate) fn parts(&self, symbol: usize) -> &[(u16, f32)] {
        &self.parts[self.starts[symbol] as usize..self.starts[symbol + 1] as usize]
    }
}

/// Samples of a row of rays.
#[derive(Default)]
pub(crate) struct Rays {
    /// What isn't clear whatever the opacities, ray after ray, front to back.
    pub(crate) symbols: Vec<u32>,
    /// Of each ray: the end of its symbols, and whether it meets matter: a voxel of a material, or one of a transition whose value lies on the
    /// materials' side.
    pub(crate) ends: Vec<(u32, bool)>,
}

/// All rays, and the length of a step [mm].
pub(crate) struct Bundle {
    pub(crate) rows: Vec<Rays>,
    pub(crate) step_mm: f64,
}

/// Casts rays along the first `views` directions, a sample every voxel or so, values interpolated between voxels and labels those of the nearest.
pub(crate) fn cast(
    reduced: &Reduced<'_>,
    mix: &Mix<'_>,
    symbols: &Symbols,
    grid: &Grid,
    views: usize,
    exec: &Exec,
) -> Result<Bundle, Error> {
    let spacing: [f64; 3] = std::array::from_fn(|a| grid.spacing()[a] * reduced.stride[a] as f64);
    let step_mm = spacing.iter().product::<f64>().cbrt().max(STEP * reference_mm(grid));
    let across = reduced.dims.into_iter().max().unwrap_or(1).clamp(8, MOST_ACROSS);
    let is_matter: Vec<bool> = mix.roles.iter().map(|role| *role != Role::Background).collect();
    let bin = |level: u16| symbols.bin(f32::from(level));
    let caster = Caster {
        reduced,
        symbols,
        empty: Empty::new(reduced, &symbols.seen_below(), &bin, &is_matter),
        roles: mix.roles,
        row_of: (0..mix.classes.len()).map(|class| mix.row(class) * symbols.in_row).collect(),
        rows_differ: mix.rows() > 1,
        is_matter: symbols.is_matter(),
        is_seen: (0..symbols.len()).map(|symbol| !symbols.parts(symbol).is_empty()).collect(),
    };
    let planes: Vec<Plane> =
        DIRECTIONS[..views].iter().map(|d| Plane::new(*d, reduced, spacing, step_mm)).collect();
    let rows = parallel::try_map(views * across, &|i| {
        exec.check_cancelled()?;
        let (plane, v) = (&planes[i / across], i % across);
        let mut rays = Rays::default();
        for u in 0..across {
            let place = |i: usize| (i as f32 + 0.5) / across as f32;
            caster.ray(plane.start(place(u), place(v)), plane.step, &mut rays);
        }
        Ok::<_, Error>(rays)
    })?;
    Ok(Bundle { rows, step_mm })
}

/// Where the rays of a view start, in voxels.
struct Plane {
    corner: Vector3<f32>,
    along: [Vector3<f32>; 2],
    step: Vector3<f32>,
}

impl Plane {
    fn new(direction: [f32; 3], reduced: &Reduced<'_>, spacing: [f64; 3], step_mm: f64) -> Self {
        let spacing = Vector3::from(spacing.map(|s| s as f32));
        let forward = Vector3::from(direction).normalize();
        let first = if forward.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
        let right = forward.cross(&first).normalize();
        let basis = [right, right.cross(&forward), forward];
        // Corners of the volume [mm] from the first voxel's centre.
        let corners = (0..8).map(|i| {
            Vector3::from_fn(|a, _| {
                let voxels = if i >> a & 1 == 1 { reduced.dims[a] as f32 } else { 0.0 };
                (voxels - 0.5) * spacing[a]
            })
        });
        let reach: Vec<[f32; 2]> = basis
            .iter()
            .map(|axis| {
                let along = corners.clone().map(|corner| corner.dot(axis));
                along.fold([f32::MAX, f32::MIN], |[low, high], at| [low.min(at), high.max(at)])
            })
            .collect();
        let in_voxels = |mm: Vector3<f32>| mm.component_div(&spacing);
        let corner: Vector3<f32> = basis.iter().zip(&reach).map(|(axis, [low, _])| axis * *low).sum();
        Self {
            corner: in_voxels(corner),
            along: [0, 1].map(|i| in_voxels(basis[i] * (reach[i][1] - reach[i][0]))),
            step: in_voxels(forward * step_mm as f32),
        }
    }

    fn start(&self, u: f32, v: f32) -> Vector3<f32> {
        self.corner + self.along[0] * u + self.along[1] * v
    }
}

struct Caster<'a> {
    reduced: &'a Reduced<'a>,
    roles: &'a [Role],
    /// First symbol of each class's row.
    row_of: Vec<usize>,
    rows_differ: bool,
    symbols: &'a Symbols,
    empty: Empty,
    is_matter: Vec<bool>,
    is_seen: Vec<bool>,
}

/// What there was at a place.
enum Sampled {
    /// Nothing in all of its brick.
    Empty,
    /// Something, or at least a look at it.
    Met,
}

impl Caster<'_> {
    fn ray(&self, start: Vector3<f32>, step: Vector3<f32>, rays: &mut Rays) {
        let dims = self.reduced.dims.map(|n| n as f32);
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
        let mut meets_matter = false;
        if leave > enter {
            let samples = (leave - enter).round().max(1.0);
            let length = (leave - enter) / samples;
            let first = start + step * (enter + 0.5 * length);
            let step = step * length;
            let mut i = 0;
            while i < samples as usize {
                // In the middle of each step, so that no sample lies on a side of the volume.
                let at = first + step * i as f32;
                i += 1 + match self.sample(at, &mut meets_matter, &mut rays.symbols) {
                    Sampled::Empty => Empty::steps_inside(self.inside(at), at.into(), step.into()),
                    Sampled::Met => 0,
                };
            }
        }
        rays.ends.push((rays.symbols.len() as u32, meets_matter));
    }

    /// A place within half a voxel of the outermost voxels, moved to between voxels.
    #[inline]
    fn inside(&self, at: Vector3<f32>) -> [f32; 3] {
        std::array::from_fn(|a| at[a].clamp(0.0, (self.reduced.dims[a] - 1) as f32))
    }

    #[inline]
    fn sample(&self, at: Vector3<f32>, meets_matter: &mut bool, symbols: &mut Vec<u32>) -> Sampled {
        let p = self.inside(at);
        if self.empty.at(p) {
            return Sampled::Empty;
        }
        let Some(level) = self.level(p) else { return Sampled::Met };
        let mut row = 0;
        if self.rows_differ || !*meets_matter {
            let nearest = p.map(|c| (c + 0.5) as usize);
            let class = usize::from(self.reduced.rank(nearest));
            row = self.row_of[class];
            *meets_matter |= match self.roles[class] {
                Role::Background => false,
                Role::Material => true,
                Role::Transition => {
                    let [x, y, z] = nearest;
                    self.is_matter[self.symbols.bin(f32::from(self.reduced.row(y, z)[x]))]
                }
            };
        }
        let symbol = row + self.symbols.bin(level);
        if self.is_seen[symbol] {
            symbols.push(symbol as u32);
        }
        Sampled::Met
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
