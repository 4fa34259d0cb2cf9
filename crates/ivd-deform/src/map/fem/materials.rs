//! What the voxels are made of.

use std::collections::BTreeMap;

use ivd_core::{Labels, Mask};
use nalgebra::Vector3;

use super::super::{MapParams, Outside};
use super::material::Lame;

/// Modulus round a part that moves alone, relative to it.
const FREE: f64 = 1e-3;

/// Lamé's constants by voxel: a class's own where it has been given any, inside and outside the lattice; else those of the
/// inside, or of the filler.
pub(super) struct Materials<'a> {
    inside: &'a Mask,
    labels: Option<&'a Labels>,
    classes: BTreeMap<u16, Lame>,
    own: Lame,
    filler: Lame,
}

impl<'a> Materials<'a> {
    /// Checked parameters; `labels` on the grid of `inside`.
    pub(super) fn new(inside: &'a Mask, labels: Option<&'a Labels>, params: &MapParams) -> Self {
        // The layer in which a part that moves alone goes on is to follow it.
        let filler = if params.outside == Outside::Free { params.filler.min(FREE) } else { params.filler };
        let classes = params.classes.iter().map(|(class, own)| {
            (*class, Lame::new(own.young.unwrap_or(1.0), own.poisson.unwrap_or(params.poisson)))
        });
        Self {
            inside,
            labels,
            classes: classes.collect(),
            own: Lame::new(1.0, params.poisson),
            filler: Lame::new(filler, params.poisson),
        }
    }

    /// What the voxel nearest to a voxel coordinate is made of; beyond the grid the filler.
    pub(super) fn at(&self, voxel: Vector3<f64>) -> Lame {
        let dims = self.inside.grid().dims();
        let nearest = voxel.map(|c| c.round() as i64);
        if !(0..3).all(|a| (0..dims[a] as i64).contains(&nearest[a])) {
            return self.filler;
        }
        let v = nearest.map(|c| c as usize);
        let index = v[0] + dims[0] * (v[1] + dims[1] * v[2]);
        let class = self.labels.and_then(|labels| self.classes.get(&labels.ids()[index]));
        let plain = if self.inside.inside()[index] != 0 { self.own } else { self.filler };
        class.copied().unwrap_or(plain)
    }

    /// Shear modulus relative to the inside's.
    pub(super) fn modulus(&self, lame: &Lame) -> f64 {
        lame.mu / self.own.mu
    }
}
