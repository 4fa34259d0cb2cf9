//! What the caller asked for: a class or a value, and where the seed lies.

use ivd_core::{ClassChoice, Labels, ParamError, Scalar, Volume, World, with_voxels};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::{ComponentParams, Error};

/// The class, or the values, to isolate.
pub(super) struct Chosen {
    pub(super) class: Option<u16>,
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
}

/// Tells which voxels belong to what was chosen.
pub(super) struct Members<'a> {
    volume: &'a Volume,
    /// Labels and the id, or the least value.
    rule: Rule<'a>,
}

enum Rule<'a> {
    Id(&'a [u16], u16),
    Above(f64),
}

pub(super) fn choose(
    volume: &Volume,
    labels: Option<&Labels>,
    params: &ComponentParams,
) -> Result<Chosen, Error> {
    if let Some(above) = params.above {
        return Ok(Chosen { class: None, lower: Some(above), upper: None });
    }
    let Some(labels) = labels else {
        if params.class.is_some() {
            let problem = "there are no labels that a class could be of";
            return Err(ParamError::new("class", problem, "give labels, or leave it out").into());
        }
        let problem = "there are neither labels nor a value to isolate";
        return Err(ParamError::new("above", problem, "give labels, or the least value of the part").into());
    };
    volume.grid().require(labels.grid(), "volume", "labels")?;
    let id = match (params.class, params.seed) {
        (Some(ClassChoice::Id(id)), _) => id,
        (Some(choice), _) => labels.choose(choice)?.id,
        (None, Some(seed)) => labels.ids()[linear(volume, seed_voxel(volume, seed)?)],
        (None, None) => labels.choose(ClassChoice::Largest)?.id,
    };
    let class = labels.class(id);
    if class.is_none() && (id == ivd_core::NO_DATA || !labels.ids().par_iter().any(|&other| other == id)) {
        return Err(labels.no_such_class(id).into());
    }
    Ok(Chosen { class: Some(id), lower: class.and_then(|c| c.lower), upper: class.and_then(|c| c.upper) })
}

/// The voxel that holds a point.
pub(crate) fn seed_voxel(volume: &Volume, seed: [f64; 3]) -> Result<[usize; 3], Error> {
    let grid = volume.grid();
    let at = grid.voxel(World(Vector3::from(seed))).0;
    let nearest = at.map(f64::round);
    let dims = grid.dims();
    if (0..3).all(|a| nearest[a] >= 0.0 && nearest[a] < dims[a] as f64) {
        return Ok(std::array::from_fn(|a| nearest[a] as usize));
    }
    let told = grid.told_outside(seed).unwrap_or_default();
    Err(Error::SeedOutside { seed, voxel: at.into(), dims, told })
}

fn linear(volume: &Volume, voxel: [usize; 3]) -> usize {
    volume.grid().linear(ivd_core::VoxelIndex(voxel))
}

/// Why there is nothing to isolate.
pub(super) fn nothing_there(volume: &Volume, labels: Option<&Labels>, chosen: &Chosen) -> Error {
    match (chosen.class, labels) {
        (Some(id), Some(labels)) => labels.no_such_class(id).into(),
        _ => Error::NothingAbove {
            above: chosen.lower.unwrap_or(f64::NEG_INFINITY),
            range: volume.range().map_or("all missing".into(), |[low, high]| format!("{low} to {high}")),
        },
    }
}

/// Says what is at the seed, and how far the part is.
pub(super) fn seed_elsewhere(
    volume: &Volume,
    labels: Option<&Labels>,
    chosen: &Chosen,
    members: &Members,
    seed: [f64; 3],
) -> Error {
    let grid = volume.grid();
    let at = seed_voxel(volume, seed).map_or(0, |voxel| linear(volume, voxel));
    let value = volume.real(volume.voxels().get(at));
    let found = match (chosen.class, labels) {
        (Some(_), Some(labels)) => match labels.ids()[at] {
            ivd_core::NO_DATA => "class 0 (no data)".into(),
            id => format!("class {id}"),
        },
        _ => format!("a voxel of value {value}"),
    };
    let wanted =
        chosen.class.map_or_else(|| "the voxels at or above the value".into(), |id| format!("class {id}"));
    let (linear_part, offset) = (grid.linear_part(), grid.voxel(World(Vector3::from(seed))).0);
    let nearest = (0..grid.len())
        .into_par_iter()
        .filter(|&i| members.holds(i))
        .map(|i| (linear_part * (Vector3::from(grid.index(i).0.map(|v| v as f64)) - offset)).norm())
        .reduce(|| f64::INFINITY, f64::min);
    Error::SeedElsewhere { seed, found, wanted, distance_mm: nearest }
}

impl<'a> Members<'a> {
    pub(super) fn new(volume: &'a Volume, labels: Option<&'a Labels>, chosen: &Chosen) -> Self {
        let rule = match (chosen.class, labels) {
            (Some(id), Some(labels)) => Rule::Id(labels.ids(), id),
            _ => Rule::Above(chosen.lower.unwrap_or(f64::NEG_INFINITY)),
        };
        Self { volume, rule }
    }

    /// Whether a voxel belongs.
    fn holds(&self, linear: usize) -> bool {
        let value = self.volume.voxels().get(linear);
        value.is_finite()
            && match self.rule {
                Rule::Id(ids, id) => ids[linear] == id,
                Rule::Above(above) => self.volume.real(value) >= above,
            }
    }

    /// Appends the runs of a row.
    pub(super) fn row_runs(&self, y: usize, z: usize, found: &mut Vec<[u32; 2]>) {
        let [nx, ny, _] = self.volume.grid().dims();
        let start = nx * (y + ny * z);
        match self.rule {
            Rule::Id(ids, id) if self.volume.voxel_type().is_integer() => {
                runs_where(&ids[start..start + nx], |&other| other == id, found);
            }
            Rule::Id(ids, id) => with_voxels!(self.volume.voxels(), voxels => {
                let row: Vec<bool> = voxels[start..start + nx]
                    .iter()
                    .zip(&ids[start..start + nx])
                    .map(|(v, &other)| v.is_data() && other == id)
                    .collect();
                runs_where(&row, |&holds| holds, found);
            }),
            Rule::Above(above) => with_voxels!(self.volume.voxels(), voxels => {
                let (slope, intercept) = (self.volume.slope(), self.volume.intercept());
                let holds = |v: f64| slope * v + intercept >= above;
                runs_where(&voxels[start..start + nx], |v| v.is_data() && holds(v.to_f64()), found);
            }),
        }
    }
}

/// Appends the runs of values that hold.
pub(super) fn runs_where<T>(row: &[T], holds: impl Fn(&T) -> bool, found: &mut Vec<[u32; 2]>) {
    let mut x = 0;
    while let Some(start) = row[x..].iter().position(&holds) {
        let start = x + start;
        let end = row[start..].iter().position(|v| !holds(v)).map_or(row.len(), |n| start + n);
        found.push([start as u32, end as u32]);
        x = end;
    }
}
