//! `ivd info FILE --at x,y,z`: what lies at a place.

use std::path::Path;

use ivd_artefact::Cache;
use ivd_core::{Grid, Kind, Labels, Mask, Value as _, Volume, VoxelCoord, VoxelIndex, World};
use ivd_io::volume::ReadOptions;
use ivd_pipeline::Input;
use serde_json::{Map, Value, json};

use crate::context::Context;
use crate::exit::Failure;
use crate::files::{file_for, imported, volume_or_artefact};

/// Files on the grid of one that is asked about.
#[derive(Default, Clone, Copy)]
pub(super) struct Beside<'a> {
    /// Labels, whose class is told; or a mask.
    pub(super) labels: Option<&'a Path>,
    /// A mask, of which inside or outside is told.
    pub(super) mask: Option<&'a Path>,
}

impl Beside<'_> {
    /// What the files hold.
    fn read(self, context: &Context) -> anyhow::Result<Vec<Input>> {
        let files = [("--labels", self.labels, Kind::Labels), ("--mask", self.mask, Kind::Mask)];
        let given = files.into_iter().filter_map(|(flag, file, kind)| Some((flag, file?, kind)));
        given
            .map(|(flag, file, kind)| {
                let input = file_for(file, &[kind], &Cache::disabled(), context)?;
                let held = input.artefact.kind();
                if held == kind || (held, kind) == (Kind::Mask, Kind::Labels) {
                    return Ok(input);
                }
                Err(Failure::usage(format!(
                    "{flag} {}: a {held} artefact, not {}; `ivd import FILE {flag} -o OUT` makes what is wanted of a volume file",
                    file.display(),
                    if kind == Kind::Labels { "labels or a mask" } else { "a mask" },
                )))
            })
            .collect()
    }
}

/// What lies at places (mm, RAS) of a volume, of labels or of a mask; with the class that labels beside it have there, and whether a mask
/// beside it holds them.
pub(super) fn places(
    file: &Path,
    series: Option<String>,
    places: &[[f64; 3]],
    beside: Beside<'_>,
    context: &Context,
) -> anyhow::Result<Value> {
    let input = match series {
        Some(_) => {
            let options = ReadOptions { series, ..ReadOptions::default() };
            imported(file, options, &Cache::disabled(), context)?
        }
        None => volume_or_artefact(file, &Cache::disabled(), context)?,
    };
    let artefact = &*input.artefact;
    let (volume, own, mask) = (Volume::of(artefact), Labels::of(artefact), Mask::of(artefact));
    let grids = [volume.map(Volume::grid), own.map(Labels::grid), mask.map(Mask::grid)];
    let grid = grids.into_iter().flatten().next().ok_or_else(|| {
        let kind = artefact.kind().name();
        Failure::usage(format!(
            "{}: a {kind} artefact; --at is of a volume, labels or a mask",
            file.display()
        ))
    })?;
    let beside = beside.read(context)?;
    let labels_beside = beside.iter().find_map(|input| Labels::of(&input.artefact));
    let mask_beside = beside.iter().rev().find_map(|input| Mask::of(&input.artefact));
    for (what, other) in
        [("--labels", labels_beside.map(Labels::grid)), ("mask", mask_beside.map(Mask::grid))]
    {
        let fits = other.map_or(Ok(()), |other| grid.require(other, "the volume", what));
        fits.map_err(|e| Failure::usage(e.to_string()))?;
    }
    let told: Vec<Value> = places
        .iter()
        .map(|&place| {
            let (voxel, index) = voxel(grid, place, file)?;
            let mut told = Map::from_iter([
                ("asked_mm".to_owned(), json!(place)),
                ("voxel".to_owned(), json!(index.0)),
                ("voxel_exact".to_owned(), json!(voxel)),
                ("voxel_centre_mm".to_owned(), json!(<[f64; 3]>::from(grid.world(index.into()).0))),
            ]);
            if let Some(volume) = volume {
                let value = context.exec.run(|| volume.value(index));
                told.insert("value".to_owned(), json!(value.is_finite().then_some(value)));
            }
            if let Some(mask) = mask {
                told.insert("inside".to_owned(), json!(mask.inside()[grid.linear(index)] != 0));
            }
            if let Some(labels) = own {
                class(labels, index, &mut told);
            }
            if let Some(labels) = labels_beside {
                class(labels, index, &mut told);
            }
            if let Some(mask) = mask_beside {
                told.insert("inside_mask".to_owned(), json!(mask.inside()[grid.linear(index)] != 0));
            }
            Ok(Value::Object(told))
        })
        .collect::<anyhow::Result<_>>()?;
    Ok(json!({ "path": file, "kind": artefact.kind().name(), "at": told }))
}

/// The label of a voxel, with what is known of its class.
fn class(labels: &Labels, index: VoxelIndex, told: &mut Map<String, Value>) {
    let id = labels.ids()[labels.grid().linear(index)];
    told.insert("label".to_owned(), json!(id));
    if let Some(class) = labels.class(id) {
        told.insert("class".to_owned(), json!(class));
    }
}

/// The voxel at a place, exactly and the nearest.
fn voxel(grid: &Grid, place: [f64; 3], file: &Path) -> anyhow::Result<([f64; 3], VoxelIndex)> {
    let VoxelCoord(exact) = grid.voxel(World(place.into()));
    let Some(index) = grid.nearest_voxel(exact) else {
        let problem = format!(
            "--at {place:?} mm lies at voxel {:.1?}, beyond the {:?} of {}; {}",
            <[f64; 3]>::from(exact),
            grid.dims(),
            file.display(),
            grid.told_outside(place).unwrap_or_default()
        );
        return Err(Failure::usage(problem));
    };
    Ok((exact.into(), index))
}
