//! Isosurfaces that are seen through, about the opaque one of mode iso.

use std::ops::ControlFlow;

use ivd_core::{Grid, VoxelCoord};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::{Camera, Ray};
use crate::cast::{Cast, Field, HALVINGS, halved, refined};
use crate::samples::Stored;

/// Most surfaces that are seen through.
pub(crate) const MOST_SHELLS: usize = 8;

/// An isosurface that is seen through, as a thin film is: the more opaque the more aslant it is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Shell {
    /// Its isovalue.
    #[schemars(extend("x-unit" = "real units"))]
    pub iso: f64,
    /// Its colour, linear RGB.
    #[schemars(inner(range(min = 0.0, max = 1.0)), extend("x-unit" = "1"))]
    pub colour: [f64; 3],
    /// Its opacity where it is looked at straight.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub opacity: f64,
}

impl Default for Shell {
    fn default() -> Self {
        Self { iso: f64::NAN, colour: [0.80, 0.55, 0.45], opacity: 0.25 }
    }
}

/// A surface as rays meet it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layer {
    /// `sign · fast`.
    pub(crate) iso: f32,
    pub(crate) colour: [f32; 3],
    pub(crate) opacity: f32,
}

/// What rays gather through layers.
pub(crate) struct Layers<'a> {
    pub(crate) all: Vec<Layer>,
    pub(crate) sign: f32,
    /// Opacity at which a ray ends.
    pub(crate) termination: f32,
    pub(crate) camera: &'a Camera,
    pub(crate) grid: &'a Grid,
}

/// Which layers a sample lies within, one bit each.
type Within = u32;

/// What a ray has come to.
#[derive(Default)]
struct Walked {
    cast: Cast,
    /// The last sample, and what it lay within; `None` where there is no data.
    last: Option<(usize, Option<Within>)>,
}

/// Where a ray passes through a layer.
struct Passage {
    layer: usize,
    at: [f32; 3],
    /// Of a face that the picture is cut at: its normal.
    cut: Option<[f32; 3]>,
}

impl Layers<'_> {
    /// The light of a ray through all of them: every passage, in and out, from the nearest on.
    pub(crate) fn cast<T: Stored>(&self, field: &Field<'_, T>, ray: &Ray) -> Cast {
        let mut walked = Walked::default();
        let mut ended = false;
        let skipped = field.space.walk(ray, |_, range| {
            self.leave(field, ray, &mut walked, range.start);
            for i in range {
                if self.step(field, ray, &mut walked, i, ray.at(i)) {
                    ended = true;
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        if !ended {
            self.leave(field, ray, &mut walked, ray.steps);
            if ray.rest > 0.0 {
                self.step(field, ray, &mut walked, ray.steps, ray.rest_at);
            }
        }
        Cast { skipped, ..walked.cast }
    }

    /// Takes a sample, and what lies between it and the one before; whether the ray ends.
    fn step<T: Stored>(
        &self,
        field: &Field<'_, T>,
        ray: &Ray,
        walked: &mut Walked,
        i: usize,
        at: [f32; 3],
    ) -> bool {
        walked.cast.taken += 1;
        let now = self.within(field, at);
        let before = match walked.last {
            Some((j, within)) if j + 1 == i => within,
            // What was passed over lies within nothing.
            _ if i > 0 => Some(0),
            _ => None,
        };
        walked.last = Some((i, now));
        if before != now {
            for passage in self.passages(field, ray, (i, at), (before, now), &mut walked.cast.taken) {
                self.pass(field, &passage, &mut walked.cast.rgba);
            }
        }
        walked.cast.rgba[3] >= self.termination
    }

    /// Where samples before `next` are passed over, the ray leaves what the last one that was taken lies within.
    fn leave<T: Stored>(&self, field: &Field<'_, T>, ray: &Ray, walked: &mut Walked, next: usize) {
        if let Some((j, Some(within))) = walked.last
            && within != 0
            && j + 1 < next
        {
            self.step(field, ray, walked, j + 1, ray.at(j + 1));
        }
    }

    fn within<T: Stored>(&self, field: &Field<'_, T>, at: [f32; 3]) -> Option<Within> {
        let value = self.sign * field.value_there(at)?;
        let bit = |(i, layer): (usize, &Layer)| Within::from(value >= layer.iso) << i;
        Some(self.all.iter().enumerate().map(bit).sum())
    }

    /// Where a ray passes through layers between a sample and the one before, from the nearest on; samples that this takes are counted.
    fn passages<T: Stored>(
        &self,
        field: &Field<'_, T>,
        ray: &Ray,
        (i, at): (usize, [f32; 3]),
        (before, now): (Option<Within>, Option<Within>),
        taken: &mut usize,
    ) -> Vec<Passage> {
        let Some(now) = now else { return Vec::new() };
        let changed = now ^ before.unwrap_or(0);
        let passage = |layer: usize| {
            let iso = self.all[layer].iso;
            if now >> layer & 1 == 1 {
                let (hit, more) = refined(field, iso, self.sign, ray, i, at);
                *taken += more;
                return Passage { layer, at: hit.at, cut: hit.cut };
            }
            *taken += HALVINGS;
            let inside = if i > 0 { ray.at(i - 1) } else { at };
            Passage { layer, at: halved(field, iso, self.sign, [at, inside]), cut: None }
        };
        let mut found: Vec<Passage> =
            (0..self.all.len()).filter(|layer| changed >> layer & 1 == 1).map(passage).collect();
        let along = |passage: &Passage| -> f32 { (0..3).map(|a| passage.at[a] * ray.delta[a]).sum() };
        found.sort_by(|a, b| along(a).total_cmp(&along(b)).then(a.layer.cmp(&b.layer)));
        found
    }

    /// Puts a passage behind what was gathered.
    fn pass<T: Stored>(&self, field: &Field<'_, T>, passage: &Passage, rgba: &mut [f32; 4]) {
        let Layer { colour: [r, g, b], opacity, .. } = self.all[passage.layer];
        let place = self.grid.world(VoxelCoord(Vector3::from(passage.at).map(f64::from))).0;
        let sight = self.camera.sight(place);
        let moves = field.moves(field.space.brick(passage.at));
        let normal = passage.cut.or_else(|| field.normal_there(passage.at, moves));
        // Both sides are lit alike; a film is as much thicker as it is looked at aslant.
        let turned = normal.map(|n| (n, Vector3::from(n).map(f64::from).dot(&sight) as f32));
        let normal = turned.map(|(n, cosine)| if cosine < 0.0 { n.map(|c| -c) } else { n });
        let cosine = turned.map_or(1.0, |(_, cosine)| cosine.abs().max(1e-3));
        let adds = (1.0 - rgba[3]) * (1.0 - (1.0 - opacity).powf(1.0 / cosine));
        let lit = field.light.lit([r, g, b, 1.0], normal);
        for (sum, c) in rgba.iter_mut().zip(lit) {
            *sum += adds * c;
        }
    }
}
