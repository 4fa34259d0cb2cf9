//! What space is made of, and which of it is rigid.

use std::collections::{BTreeMap, BTreeSet};

use ivd_core::{Grid, Labels, Mask, Volume, VoxelIndex};
use ivd_elastic::{FLESH, Lame, Medium, Tissue};
use nalgebra::Vector3;

use super::ElasticParams;
use super::grip::{Grip, local};
use crate::rigid::BoneSpec;

/// Poisson's ratio of what fills the outside: air is pressed evenly, lest a few cells of it fold while the rest hardly yields.
const AIR: f64 = 0.4;
/// Mean value (HU) of a voxel and its six neighbours from which one of bone's value is bone, and no speck of noise. Less than 0 counts as 0: bone may lie
/// beside air.
const SOLID: f64 = 150.0;
/// Kinds of matter by value: numbers that classes hardly have. Where one has, cells on its border with such matter are coarser.
const BONE: u16 = u16::MAX;
const LUNG: u16 = u16::MAX - 1;
const GAS: u16 = u16::MAX - 2;

/// What a voxel's value says that it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ByValue {
    /// Nothing in particular.
    Flesh,
    Tissue(Tissue),
}

/// What a voxel does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Matter {
    /// It yields.
    Soft,
    /// It goes with a bone of that number.
    Bone(usize),
    /// It stays.
    Still,
}

/// Lamé's constants by voxel (kPa): a class's own where it has been given any; else those of the inside, or of the filler.
pub(super) struct Tissues<'a> {
    inside: &'a Mask,
    labels: Option<&'a Labels>,
    /// Whose Hounsfield values say what has no class of its own.
    values: Option<&'a Volume>,
    /// Inside the lattice, and outside.
    classes: BTreeMap<u16, [Lame; 2]>,
    rigid: BTreeSet<u16>,
    bones: &'a [BoneSpec],
    own: Lame,
    filler: Lame,
    /// Young's modulus of flesh over what tissues' are relative to, where they are known by value.
    flesh: f64,
    grips: Vec<Grip>,
}

impl<'a> Tissues<'a> {
    /// Checked parameters; labels, and values where these are to be read, on the grid of `inside`.
    pub(super) fn new(
        inside: &'a Mask,
        (labels, values): (Option<&'a Labels>, Option<&'a Volume>),
        bones: &'a [BoneSpec],
        params: &ElasticParams,
    ) -> Self {
        let own = Lame::new(params.kpa, params.poisson);
        let filler = Lame::new(params.kpa * params.filler, AIR);
        let classes = params.material.iter().map(|(class, material)| {
            if material.is_air() {
                return (*class, [filler; 2]);
            }
            let (kpa, poisson) = material.moduli();
            let of = |kpa: f64| Lame::new(kpa, poisson.unwrap_or(params.poisson));
            // The share of a cell that is rigid counts for nothing in what the rest yields by.
            (*class, [of(kpa.unwrap_or(params.kpa)), kpa.map_or(filler, of)])
        });
        let rigid = params.material.iter().filter(|(_, own)| own.is_rigid()).map(|(class, _)| *class);
        let (classes, rigid) = (classes.collect(), rigid.collect());
        Self {
            inside,
            labels,
            values,
            classes,
            rigid,
            bones,
            own,
            filler,
            flesh: params.kpa / FLESH,
            grips: Vec::new(),
        }
    }

    /// With what the handles have hold of.
    pub(super) fn gripped(self, grips: Vec<Grip>) -> Self {
        Self { grips, ..self }
    }

    pub(super) fn grid(&self) -> &Grid {
        self.inside.grid()
    }

    /// The voxel nearest to a voxel coordinate, and its number; `None` beyond the grid.
    pub(super) fn nearest(&self, voxel: Vector3<f64>) -> Option<(VoxelIndex, usize)> {
        self.grid().nearest_voxel(voxel).map(|index| (index, self.grid().linear(index)))
    }

    /// Whether anything may be rigid.
    pub(super) fn has_rigid(&self) -> bool {
        !(self.bones.is_empty() && self.rigid.is_empty() && self.values.is_none())
    }

    /// Whether a voxel lies inside the lattice.
    pub(super) fn is_inside(&self, number: usize) -> bool {
        self.inside.inside()[number] != 0
    }

    /// What a voxel does. A bone without a class is what lies in its region and in the lattice.
    pub(super) fn matter(&self, voxel: VoxelIndex, number: usize) -> Matter {
        if !self.has_rigid() {
            return Matter::Soft;
        }
        let class = self.labels.map(|labels| labels.ids()[number]);
        let grid = self.grid();
        let point = grid.linear_part() * ivd_core::VoxelCoord::from(voxel).0;
        let origin = Vector3::from(grid.origin());
        let holds = |bone: &BoneSpec| {
            let of_class = match bone.class {
                Some(own) => class == Some(own),
                None => self.is_inside(number) || self.is_bone_by_value(voxel, number),
            };
            of_class && bone.region.is_none_or(|region| region.holds(point, origin))
        };
        if let Some(bone) = self.bones.iter().position(holds) {
            return Matter::Bone(bone);
        }
        if class.is_some_and(|class| self.rigid.contains(&class)) || self.is_bone_by_value(voxel, number) {
            Matter::Still
        } else {
            Matter::Soft
        }
    }

    /// What a voxel is by its value; `None` where that doesn't count.
    fn by_value(&self, voxel: VoxelIndex, number: usize) -> Option<ByValue> {
        let values = self.values?;
        let own = self.labels.is_some_and(|labels| self.classes.contains_key(&labels.ids()[number]));
        (!own).then(|| match Tissue::of_hounsfield(values.value(voxel)) {
            None => ByValue::Flesh,
            Some(Tissue::Bone) if !self.is_solid(values, voxel) => ByValue::Flesh,
            Some(tissue) => ByValue::Tissue(tissue),
        })
    }

    fn is_bone_by_value(&self, voxel: VoxelIndex, number: usize) -> bool {
        self.by_value(voxel, number) == Some(ByValue::Tissue(Tissue::Bone))
    }

    /// Whether a voxel of bone's value has enough of it beside it.
    fn is_solid(&self, values: &Volume, voxel: VoxelIndex) -> bool {
        let at = voxel.0.map(|c| c as i64);
        let (mut sum, mut many) = (values.value(voxel), 1.0);
        for side in 0..6_usize {
            let mut next = at;
            next[side / 2] += if side % 2 == 0 { -1 } else { 1 };
            let value = self.grid().voxel_at(next).map(|next| values.value(next));
            if let Some(value) = value.filter(|value| value.is_finite()) {
                (sum, many) = (sum + value.max(0.0), many + 1.0);
            }
        }
        sum >= SOLID * many
    }

    /// How far the nearest rigid voxel is from a place, or a radius, if that is less (mm).
    pub(super) fn nearest_rigid(&self, middle: Vector3<f64>, radius: f64) -> f64 {
        let mut least = radius;
        if !self.has_rigid() {
            return least;
        }
        let grid = self.grid();
        let [xs, ys, zs] = grid.voxels_of_ball(middle, radius);
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let voxel = VoxelIndex([x, y, z]);
                    let far = (local(grid, voxel) - middle).norm();
                    if far < least && self.matter(voxel, grid.linear(voxel)) != Matter::Soft {
                        least = far;
                    }
                }
            }
        }
        least
    }

    /// What the handles have hold of.
    pub(super) fn grips(&self) -> &[Grip] {
        &self.grips
    }
}

impl Medium for Tissues<'_> {
    fn at(&self, voxel: Vector3<f64>) -> Lame {
        let Some((index, number)) = self.nearest(voxel) else { return self.filler };
        let class = self.labels.and_then(|labels| self.classes.get(&labels.ids()[number]));
        let [inner, outer] = class.copied().unwrap_or_else(|| match self.by_value(index, number) {
            None => [self.own, self.filler],
            Some(ByValue::Flesh | ByValue::Tissue(Tissue::Bone)) => [self.own; 2],
            Some(ByValue::Tissue(Tissue::Air)) => [self.filler; 2],
            Some(ByValue::Tissue(tissue)) => {
                [tissue.moduli().map_or(self.own, |(kpa, poisson)| Lame::new(kpa * self.flesh, poisson)); 2]
            }
        });
        if !self.is_inside(number) {
            return outer;
        }
        let factor = self.grips.iter().map(|grip| grip.factor(self.grid(), index)).fold(1.0, f64::max);
        inner.times(factor)
    }

    fn kind(&self, voxel: VoxelIndex) -> Option<u16> {
        let number = self.grid().linear(voxel);
        let told = self.labels.map(|labels| labels.ids()[number]).filter(|id| {
            self.classes.contains_key(id) || self.bones.iter().any(|bone| bone.class == Some(*id))
        });
        told.or_else(|| match self.by_value(voxel, number)? {
            ByValue::Tissue(Tissue::Bone) => Some(BONE),
            ByValue::Tissue(Tissue::Lung) => Some(LUNG),
            ByValue::Tissue(Tissue::Air) => Some(GAS),
            _ => None,
        })
    }

    fn has_kinds(&self) -> bool {
        self.values.is_some()
            || self.labels.is_some()
                && (!self.classes.is_empty() || self.bones.iter().any(|bone| bone.class.is_some()))
    }
}
