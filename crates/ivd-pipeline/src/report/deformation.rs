//! What moved, by how much, and what that did to the space around.

use ivd_field::certificate::Histogram;
use ivd_field::class_volume::ClassVolume;
use ivd_field::warp;
use ivd_field::warp::WarpFigures;
use ivd_map::MapFigures;
use ivd_map::space;
use ivd_map::space::SpaceFigures;
use ivd_motion::deform;
use ivd_report::html::number;
use ivd_report::{Bars, Cell, MOST_ROWS, bars, histogram, pairs, shortened_table, shown, table};

use super::plain;
use crate::{Error, StageRecord, figures_of};

/// The figures of a deformation.
pub(super) struct Moves {
    deform: Option<deform::Figures>,
    map: Option<MapFigures>,
    last: Carried,
    warp: Option<WarpFigures>,
}

/// Figures of the displacement that is carried out.
struct Carried {
    voxels_moved: u64,
    min_det_j: f64,
    /// Voxels that are squeezed as a whole, where that is told.
    squeezed: Option<u64>,
    folds: u64,
    residual_voxel: f64,
    det_j: Histogram,
}

impl Moves {
    /// Those of a run; `None` where nothing is displaced.
    pub(super) fn of(records: &[StageRecord]) -> Result<Option<Self>, Error> {
        let space: Option<SpaceFigures> = figures_of(records, space::STAGE.name)?;
        let map: Option<MapFigures> = figures_of(records, ivd_map::STAGE.name)?;
        // Steps in space have the last word over the voxels; what the lattice makes of it is the map's.
        let last = space.map(Carried::from).or(map.clone().map(Carried::from));
        let Some(last) = last else { return Ok(None) };
        let deform = figures_of(records, deform::STAGE.name)?;
        Ok(Some(Self { deform, map, last, warp: figures_of(records, warp::STAGE.name)? }))
    }
}

impl From<MapFigures> for Carried {
    fn from(found: MapFigures) -> Self {
        let MapFigures { voxels_moved, min_det_j, folds, inverse_residual_max_voxel, .. } = found;
        let squeezed = found.squeezed.map(|squeezed| squeezed.voxels);
        let (residual_voxel, det_j) = (inverse_residual_max_voxel, found.det_j_histogram);
        Self { voxels_moved, min_det_j, squeezed, folds, residual_voxel, det_j }
    }
}

impl From<SpaceFigures> for Carried {
    fn from(found: SpaceFigures) -> Self {
        let SpaceFigures { voxels_moved, min_det_j, folds, inverse_residual_max_voxel, .. } = found;
        let (residual_voxel, det_j) = (inverse_residual_max_voxel, found.det_j_histogram);
        Self { voxels_moved, min_det_j, squeezed: None, folds, residual_voxel, det_j }
    }
}

/// Figures and charts of a deformation; `lengths` are those of the displacements (mm).
pub(super) fn deformation(moves: &Moves, lengths: &[f64]) -> String {
    let Moves { map, last, warp, .. } = moves;
    let mut html = pairs(&[
        ("voxels moved, of the scan at rest", shown(last.voxels_moved)),
        ("voxels made anew, of the deformed scan", shown(warp.map(|found| found.voxels_resampled))),
        (
            "volume inside the lattice, rest → deformed (mm³)",
            enclosed(map.as_ref().map(|map| map.followed.volume_mm3)),
        ),
        (
            "smallest det J, certified",
            plain::with(&shown(last.min_det_j), plain::smallest_det_j(last.min_det_j, last.squeezed)),
        ),
        ("folds", plain::with(&shown(last.folds), plain::folds(last.folds))),
        (
            "inverse, largest residual [voxels]",
            plain::with(&shown(last.residual_voxel), plain::inverse_residual(last.residual_voxel)),
        ),
    ]);
    let plain = |_: f64| "#5b7a99".to_owned();
    if !lengths.is_empty() {
        let top = lengths.iter().copied().fold(0.0, f64::max);
        let counts = histogram(lengths, [0.0, top], 64);
        html += &bars(&Bars {
            range: [0.0, top],
            counts: &counts,
            x_label: "displacement of moved vertices [mm]",
            y_label: "vertices",
            logarithmic: true,
            marks: Vec::new(),
            colour: &plain,
            lines: Vec::new(),
        });
    }
    html += &bars(&Bars {
        range: [last.det_j.lower, last.det_j.upper],
        counts: &last.det_j.counts,
        x_label: "det J of touched cells: what is left of a volume of 1 (1: as it was; below 0.1: nearly flat)",
        y_label: "cells",
        logarithmic: true,
        marks: vec![(1.0, "1".to_owned())],
        colour: &|v| if v < 1.0 { "#b5651d".to_owned() } else { "#2f7f6f".to_owned() },
        lines: Vec::new(),
    });
    html
}

/// The volume inside the lattice before and after, with the change.
fn enclosed(volume_mm3: Option<[f64; 2]>) -> String {
    match volume_mm3 {
        Some([rest, deformed]) if rest != 0.0 => {
            let change = 100.0 * (deformed - rest) / rest;
            format!("{} → {} ({change:+.2} %)", number(rest), number(deformed))
        }
        _ => "–".to_owned(),
    }
}

/// What bones have done; nothing where there is none.
pub(super) fn bones(moves: &Moves) -> String {
    let springs = moves.deform.as_ref().and_then(|found| found.springs.as_ref());
    let Some(list) = springs.map(|springs| &springs.bones).filter(|list| !list.is_empty()) else {
        return String::new();
    };
    let head = [
        "bone",
        "vertices",
        "turned by [°]",
        "about",
        "its middle went by [mm]",
        "its handles are left [mm]",
        "held with [mN]",
    ];
    let vector = |parts: [f64; 3]| Cell::Text(parts.map(number).join(", "));
    let rows = list.iter().map(|bone| {
        [
            Cell::plain(&bone.name),
            Cell::plain(bone.vertices),
            Cell::number(bone.angle_deg),
            vector(bone.axis),
            vector(bone.shift_mm),
            Cell::number_or_dash(bone.left_mm),
            vector(bone.force_mn),
        ]
    });
    shortened_table(head, rows)
}

/// What the classes gain or lose; nothing where none does.
pub(super) fn class_volumes(volumes: &[ClassVolume]) -> String {
    let mut changed = volumes.iter().filter(|v| v.change_mm3 != 0.0).peekable();
    if changed.peek().is_none() {
        return String::new();
    }
    let row = |volume: &ClassVolume| {
        [
            Cell::plain(volume.class),
            Cell::number(volume.rest_mm3),
            Cell::number(volume.change_mm3),
            Cell::plain(format_args!("{:+.4}", 100.0 * volume.change_mm3 / volume.rest_mm3)),
        ]
    };
    let head = ["class", "volume at rest [mm³]", "change [mm³]", "change [%]"];
    table(head, changed.take(MOST_ROWS).map(row))
}
