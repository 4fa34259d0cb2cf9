//! The part of the voxels that stays.

use ivd_core::{Displacement, Grid, NO_BRICK, VoxelCoord, VoxelIndex};
use nalgebra::{Matrix3, Vector3};

use super::by::{By, Tag};
use super::params::{ClipParams, HalfSpace};

/// Share of the smallest spacing within which a centre lies on a plane.
const ON_PLANE: f64 = 1e-6;

/// How much of a brick stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    All,
    None,
    /// To be found voxel by voxel.
    Some,
}

/// Signed distance from a plane (mm) of a voxel coordinate, with what makes its border part of it.
#[derive(Debug, Clone, Copy)]
struct Distance {
    constant: f64,
    gradient: [f64; 3],
}

impl Distance {
    fn new(grid: &Grid, half_space: &HalfSpace) -> Self {
        let normal = Vector3::from(half_space.normal);
        let smallest = grid.shortest_edge();
        let offset = Vector3::from(grid.origin()) - Vector3::from(half_space.point);
        Self {
            constant: normal.dot(&offset) + ON_PLANE * smallest,
            gradient: (grid.linear_part().transpose() * normal).into(),
        }
    }

    /// Never falls, or never rises, along an axis, rounding and all, as every product and sum in it: over a brick it is least and
    /// greatest at corners, exactly.
    #[inline]
    fn at(&self, [x, y, z]: [f64; 3]) -> f64 {
        let [p, q, r] = self.gradient;
        self.constant + (p * x + (q * y + r * z))
    }

    /// Least and greatest between two corners.
    fn between(&self, low: [f64; 3], high: [f64; 3]) -> [f64; 2] {
        let corner = |greatest: bool| {
            std::array::from_fn(|a| if (self.gradient[a] > 0.0) == greatest { high[a] } else { low[a] })
        };
        [self.at(corner(false)), self.at(corner(true))]
    }
}

/// What tags, as the data's grid meets it.
struct Tagged<'a> {
    tag: Tag<'a>,
    class: Option<u16>,
    grid: &'a Grid,
    /// From voxel coordinates of the data to those of the tag; `None` where they are the same.
    mapping: Option<(Matrix3<f64>, Vector3<f64>)>,
}

impl<'a> Tagged<'a> {
    fn new(data: &Grid, tag: Tag<'a>, class: Option<u16>) -> Self {
        let grid = match tag {
            Tag::Mask(mask) => mask.grid(),
            Tag::Labels(labels) => labels.grid(),
        };
        let mapping = (!grid.matches(data)).then(|| {
            let inverse = grid.inverse_linear_part();
            let offset = inverse * (Vector3::from(data.origin()) - Vector3::from(grid.origin()));
            (inverse * data.linear_part(), offset)
        });
        Self { tag, class, grid, mapping }
    }

    /// Whether the voxel nearest to a voxel coordinate of the data is tagged.
    fn at(&self, place: Vector3<f64>) -> bool {
        let x = self.mapping.map_or(place, |(linear, offset)| linear * place + offset);
        let dims = self.grid.dims();
        if (0..3).any(|a| !(-0.5..dims[a] as f64 - 0.5).contains(&x[a])) {
            return false;
        }
        // Half way the one with the higher index, as everywhere.
        let nearest = |a: usize| ((x[a] + 0.5).floor() as usize).min(dims[a] - 1);
        let voxel = self.grid.linear(VoxelIndex([nearest(0), nearest(1), nearest(2)]));
        match (self.tag, self.class) {
            (Tag::Mask(mask), _) => mask.inside()[voxel] != 0,
            (Tag::Labels(labels), Some(class)) => labels.ids()[voxel] == class,
            (Tag::Labels(labels), None) => labels.ids()[voxel] != ivd_core::NO_DATA,
        }
    }
}

/// What stays of data on a grid.
pub(super) struct Region<'a> {
    dims: [usize; 3],
    distances: Vec<Distance>,
    tagged: Option<Tagged<'a>>,
    invert: bool,
    displacement: Option<&'a Displacement>,
    to_voxel: Matrix3<f64>,
}

impl<'a> Region<'a> {
    pub(super) fn new(grid: &Grid, params: &ClipParams, by: &By<'a>) -> Self {
        Self {
            dims: grid.dims(),
            distances: params.half_spaces().iter().map(|h| Distance::new(grid, h)).collect(),
            tagged: by.tag.map(|tag| Tagged::new(grid, tag, params.class)),
            invert: params.invert,
            displacement: by.displacement,
            to_voxel: grid.inverse_linear_part(),
        }
    }

    /// Voxels of the grid.
    pub(super) fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Whether a voxel stays.
    pub(super) fn keeps(&self, [x, y, z]: [usize; 3]) -> bool {
        let mut place = VoxelCoord::from(VoxelIndex([x, y, z])).0;
        if let Some(displacement) = self.displacement {
            let linear = x + self.dims[0] * (y + self.dims[1] * z);
            if displacement.vacated().get(linear).is_some_and(|flag| *flag != 0) {
                return true;
            }
            let vector = displacement.inverse().at(VoxelIndex([x, y, z]));
            if vector != [0.0; 3] {
                place += self.to_voxel * Vector3::from(vector).map(f64::from);
            }
        }
        let inside = self.distances.iter().all(|distance| distance.at(place.into()) >= 0.0)
            && self.tagged.as_ref().is_none_or(|tagged| tagged.at(place));
        inside != self.invert
    }

    /// How much of a brick stays, as far as that is known without its voxels.
    pub(super) fn brick(&self, brick: [usize; 3]) -> Part {
        if let Some(displacement) = self.displacement {
            let [bx, by, _] = displacement.inverse().brick_dims();
            let index = brick[0] + bx * (brick[1] + by * brick[2]);
            if displacement.inverse().table()[index] != NO_BRICK || displacement.leaves_behind(brick) {
                return Part::Some;
            }
        }
        let low = brick.map(|b| (8 * b) as f64);
        let high = std::array::from_fn(|a| ((8 * brick[a] + 7).min(self.dims[a] - 1)) as f64);
        let mut whole = self.tagged.is_none();
        for [least, greatest] in self.distances.iter().map(|distance| distance.between(low, high)) {
            if greatest < 0.0 {
                return if self.invert { Part::All } else { Part::None };
            }
            whole &= least >= 0.0;
        }
        match (whole, self.invert) {
            (false, _) => Part::Some,
            (true, false) => Part::All,
            (true, true) => Part::None,
        }
    }
}
