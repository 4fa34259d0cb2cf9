//! What the voxels are made of.

use std::collections::BTreeMap;

use ivd_core::{Labels, Mask, VoxelIndex};
use ivd_elastic::{Lame, Medium};
use nalgebra::Vector3;

use super::super::{FemParams, Outside};

/// Modulus round a part that moves alone, relative to it.
const FREE: f64 = 1e-3;

/// Lamé's constants by voxel: a class's own where it has been given any; else those of the inside, or of the filler. Round a
/// part that moves alone there is filler only.
pub(super) struct Materials<'a> {
    inside: &'a Mask,
    labels: Option<&'a Labels>,
    /// Inside the lattice, and outside.
    classes: BTreeMap<u16, [Lame; 2]>,
    own: Lame,
    filler: Lame,
}

impl<'a> Materials<'a> {
    /// Checked parameters; `labels` on the grid of `inside`.
    pub(super) fn new(inside: &'a Mask, labels: Option<&'a Labels>, params: &FemParams) -> Self {
        // The layer in which a part that moves alone goes on is to follow it.
        let alone = params.band.outside == Outside::Free;
        let filler = if alone { params.filler.min(FREE) } else { params.filler };
        let outside = Lame::new(filler, params.poisson);
        let classes = params.material.iter().map(|(class, own)| {
            let (young, poisson) = own.moduli();
            let of = |plain| Lame::new(young.unwrap_or(plain), poisson.unwrap_or(params.poisson));
            (*class, [of(1.0), if alone { outside } else { of(filler) }])
        });
        Self {
            inside,
            labels,
            classes: classes.collect(),
            own: Lame::new(1.0, params.poisson),
            filler: outside,
        }
    }

    /// Shear modulus relative to the inside's.
    pub(super) fn modulus(&self, lame: &Lame) -> f64 {
        lame.mu / self.own.mu
    }
}

impl Medium for Materials<'_> {
    /// What the voxel nearest to a voxel coordinate is made of; beyond the grid the filler.
    fn at(&self, voxel: Vector3<f64>) -> Lame {
        let grid = self.inside.grid();
        let Some(nearest) = grid.nearest_voxel(voxel) else { return self.filler };
        let index = grid.linear(nearest);
        let here = self.inside.inside()[index] != 0;
        let class = self.labels.and_then(|labels| self.classes.get(&labels.ids()[index]));
        let [inner, outer] = class.copied().unwrap_or([self.own, self.filler]);
        if here { inner } else { outer }
    }

    /// Whether any class has been given a material.
    fn has_kinds(&self) -> bool {
        !self.classes.is_empty()
    }

    /// The class of a voxel, if that has been given a material.
    fn kind(&self, voxel: VoxelIndex) -> Option<u16> {
        let labels = self.labels?;
        let id = labels.ids()[labels.grid().linear(voxel)];
        self.classes.contains_key(&id).then_some(id)
    }
}
