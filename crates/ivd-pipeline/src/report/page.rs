//! The page itself.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ivd_artefact::Artefact;
use ivd_core::{Exec, Image, Scalar, TransferFunction, Value as _, Volume, parallel, srgb, with_voxels};
use ivd_field::certificate::Histogram;
use ivd_field::warp;
use ivd_field::warp::WarpFigures;
use ivd_lattice::extract::{self, LatticeFigures};
use ivd_lattice::refine::{self, RefineFigures};
use ivd_map::MapFigures;
use ivd_map::space;
use ivd_map::space::SpaceFigures;
use ivd_motion::deform;
use ivd_segment::{AnyFigures, ClassFigures, Figures};
use serde_json::Value;

use super::Material;
use super::chart::{Bars, Line, bars, histogram};
use super::curve::{Curve, curve};
use super::slices::{class_colour, slices};
use super::tables::{bones, class_volumes, classes, pairs, shown, stages};
use super::tree::dendrogram;
use crate::Error;
use crate::export::png_bytes;
use crate::html::{escape, number};
use crate::runner::{StageRecord, figures_of};
use crate::scene::{Loaded, Picture};
use crate::stages::{IMPORT, ImportFigures};

/// Bars of a histogram.
const BINS: usize = 256;

/// More curves than these can't be told apart.
const MOST_DENSITIES: usize = 16;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The report of a run, self-contained.
///
/// # Errors
/// A picture that can't be shown.
pub(crate) fn html(
    loaded: &Loaded,
    records: &[StageRecord],
    material: &Material,
    exec: &Exec,
) -> Result<String, Error> {
    let name = loaded.file.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy());
    let mut page = format!(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><meta name='viewport' content='width=device-width'>\
         <title>{0} – IVD report</title><style>{STYLE}</style></head><body><h1>{0}</h1>",
        escape(&name)
    );
    pictures(&mut page, material)?;
    section(&mut page, "Volume", &or_problem(volume_table(records)));
    let segment = records.iter().find(|r| r.stage == ivd_segment::STAGE.name && r.output.is_some());
    let found = segment.map(StageRecord::figures::<Figures<AnyFigures>>);
    if let Some(Artefact::Volume(volume)) = material.volume.as_deref() {
        let chart = exec.run(|| {
            value_histogram(
                volume,
                material.transfer.as_ref(),
                found.as_ref().and_then(|found| found.as_ref().ok()),
            )
        });
        section(&mut page, "Histogram, classes and transfer function", &chart);
    }
    if let Some((segment, found)) = segment.zip(found) {
        let colour = |value: f64| colour_of(material.transfer.as_ref(), value);
        let mut body = or_problem(
            found.map(|found| segmentation(segment, &found) + &classes(&found.common.classes, &colour)),
        );
        if let Some(Artefact::Volume(volume)) = material.volume.as_deref() {
            body += &slices(volume, &material.class_slices)?;
        }
        section(&mut page, "Classes", &body);
    }
    section(&mut page, "Lattice", &or_problem(lattice_table(records)));
    if let Some(moves) = Moves::of(records).transpose() {
        let told = |moves: Moves| deformation(&moves, &material.displacements) + &bones(moves.deform);
        let body = or_problem(moves.map(told)) + &class_volumes(&material.class_volumes);
        section(&mut page, "Deformation", &body);
    }
    if !material.budget.is_empty() {
        let lines = material.budget.iter().map(|line| format!("<p>{}</p>", escape(line)));
        section(&mut page, "Budget", &lines.collect::<String>());
    }
    section(&mut page, "Stages", &stages(records));
    let _ = writeln!(
        page,
        "<p class='foot'>Made by IVD {}. A research tool, not a medical device.</p><script>{SCRIPT}</script></body></html>",
        env!("CARGO_PKG_VERSION")
    );
    Ok(page)
}

fn section(page: &mut String, title: &str, body: &str) {
    let _ = write!(page, "<section><h2>{}</h2>{body}</section>", escape(title));
}

fn pictures(page: &mut String, material: &Material) -> Result<(), Error> {
    let source = |picture: Picture| {
        let image = material.pictures.get(picture.name()).and_then(|artefact| Image::of(artefact));
        let bytes = image.map(png_bytes).transpose()?;
        Ok::<_, Error>(bytes.map(|bytes| format!("data:image/png;base64,{}", STANDARD.encode(bytes))))
    };
    match (source(Picture::Before)?, source(Picture::After)?) {
        (Some(before), Some(after)) => {
            let _ = write!(
                page,
                "<div class='pictures'><figure><div class='slider'><img src='{before}' alt='before'>\
                 <img class='over' src='{after}' alt='after'><input type='range' min='0' max='100' value='50' \
                 aria-label='before to after'></div><figcaption>before · after: move the slider</figcaption></figure>"
            );
            if let Some(difference) = source(Picture::Difference)? {
                let _ = write!(
                    page,
                    "<figure><img src='{difference}' alt='difference'><figcaption>difference, amplified</figcaption></figure>"
                );
            }
            page.push_str("</div>");
        }
        (Some(before), None) => {
            let _ = write!(
                page,
                "<div class='pictures'><figure><img src='{before}' alt='volume'></figure></div>"
            );
        }
        _ => {}
    }
    Ok(())
}

/// What a section shows, or why there is nothing to show.
fn or_problem(body: Result<String, Error>) -> String {
    body.unwrap_or_else(|problem| format!("<p>{}</p>", escape(&problem.to_string())))
}

fn volume_table(records: &[StageRecord]) -> Result<String, Error> {
    let import = figures_of::<ImportFigures>(records, IMPORT)?;
    let import = import.as_ref();
    Ok(pairs(&[
        ("voxels along x, y, z", shown(import.map(|found| found.dims))),
        ("spacing [mm]", shown(import.map(|found| found.spacing))),
        ("stored type", shown(import.map(|found| &found.stored))),
        ("range", shown(import.map(|found| found.range))),
        ("voxels without data", shown(import.map(|found| found.missing))),
    ]))
}

fn lattice_table(records: &[StageRecord]) -> Result<String, Error> {
    let cut = figures_of::<LatticeFigures>(records, extract::STAGE.name)?;
    let refined = figures_of::<RefineFigures>(records, refine::STAGE.name)?;
    let (cut, last) = (cut.as_ref(), refined.as_ref().map(|found| &found.last));
    Ok(pairs(&[
        ("vertices, as cut", shown(cut.map(|found| found.vertices))),
        ("triangles, as cut", shown(cut.map(|found| found.triangles))),
        ("components", shown(cut.map(|found| found.components))),
        ("Euler characteristic", shown(cut.map(|found| found.euler))),
        ("area [mm²]", shown(cut.map(|found| found.area_mm2))),
        ("enclosed volume [mm³]", shown(cut.map(|found| found.volume_mm3))),
        ("open edges", shown(cut.map(|found| found.boundary_edges))),
        ("non-manifold edges", shown(cut.map(|found| found.non_manifold_edges))),
        ("vertices, refined", shown(last.map(|found| found.vertices))),
        ("triangles, refined", shown(last.map(|found| found.triangles))),
        ("distance to the cut lattice, bound [mm]", shown(last.map(|found| found.max_error_mm))),
        ("distance to the cut lattice, mean [mm]", shown(last.map(|found| found.mean_error_mm))),
    ]))
}

/// The figures of a deformation.
struct Moves {
    deform: Option<deform::Figures>,
    /// What the lattice encloses at rest and deformed, as the map tells it.
    enclosed_mm3: Option<[f64; 2]>,
    last: Carried,
    warp: Option<WarpFigures>,
}

/// Figures of the displacement that is carried out.
struct Carried {
    voxels_moved: u64,
    min_det_j: f64,
    folds: u64,
    residual_voxel: f64,
    det_j: Histogram,
}

impl Moves {
    /// Those of a run; `None` where nothing is displaced.
    fn of(records: &[StageRecord]) -> Result<Option<Self>, Error> {
        let space: Option<SpaceFigures> = figures_of(records, space::STAGE.name)?;
        let map: Option<MapFigures> = figures_of(records, ivd_map::STAGE.name)?;
        let enclosed_mm3 = map.as_ref().map(|map| map.followed.volume_mm3);
        // Steps in space have the last word over the voxels; what the lattice makes of it is the map's.
        let last = space.map(Carried::from).or(map.map(Carried::from));
        let Some(last) = last else { return Ok(None) };
        let deform = figures_of(records, deform::STAGE.name)?;
        Ok(Some(Self { deform, enclosed_mm3, last, warp: figures_of(records, warp::STAGE.name)? }))
    }
}

impl From<MapFigures> for Carried {
    fn from(found: MapFigures) -> Self {
        Self {
            voxels_moved: found.voxels_moved,
            min_det_j: found.min_det_j,
            folds: found.folds,
            residual_voxel: found.inverse_residual_max_voxel,
            det_j: found.det_j_histogram,
        }
    }
}

impl From<SpaceFigures> for Carried {
    fn from(found: SpaceFigures) -> Self {
        Self {
            voxels_moved: found.voxels_moved,
            min_det_j: found.min_det_j,
            folds: found.folds,
            residual_voxel: found.inverse_residual_max_voxel,
            det_j: found.det_j_histogram,
        }
    }
}

fn deformation(moves: &Moves, lengths: &[f64]) -> String {
    let Moves { deform, enclosed_mm3, last, warp } = moves;
    let deform = deform.as_ref();
    let mut html = pairs(&[
        ("vertices moved", shown(deform.map(|found| found.vertices_moved))),
        ("largest displacement [mm]", shown(deform.map(|found| found.max_displacement_mm))),
        ("voxels moved", shown(last.voxels_moved)),
        ("voxels resampled", shown(warp.map(|found| found.voxels_resampled))),
        ("volume inside the lattice, rest → deformed (mm³)", enclosed(*enclosed_mm3)),
        ("smallest det J, certified", shown(last.min_det_j)),
        ("folds", shown(last.folds)),
        ("inverse, largest residual [voxels]", shown(last.residual_voxel)),
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
        x_label: "det J of touched cells: local volume change (1 = unchanged)",
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

/// How the classes were found, with the curves that their number was read from.
fn segmentation(segment: &StageRecord, found: &Figures<AnyFigures>) -> String {
    let Figures { common, own } = found;
    let method =
        segment.params.get(ivd_segment::STAGE.selector).and_then(Value::as_str).unwrap_or("–").to_owned();
    let mut rows = vec![("method", method), ("classes", common.k.to_string())];
    rows.extend(own.proposed().map(|k| ("classes proposed", k.to_string())));
    rows.push(("iterations", common.iterations.to_string()));
    rows.push(("objective", number(common.objective)));
    rows.extend(own.regions().map(|regions| ("regions", regions.to_string())));
    let points: Vec<(f64, f64)> = own.criterion().into_iter().map(|(k, bic)| (k as f64, bic)).collect();
    let bic = curve(&Curve {
        points: &points,
        x_label: "number of classes",
        y_label: "Bayesian information criterion",
        chosen: Some(common.k as f64),
    });
    pairs(&rows) + &bic + &dendrogram(own.dendrogram())
}

/// Normal density of each class, in voxels a bar.
fn densities(classes: &[ClassFigures], range: [f64; 2]) -> Vec<Line> {
    let width = (range[1] - range[0]) / BINS as f64;
    let line = |(rank, class): (usize, &ClassFigures)| {
        let ClassFigures { mean, sd, voxels, .. } = *class;
        let density =
            |value: f64| (-0.5 * ((value - mean) / sd).powi(2)).exp() / (sd * std::f64::consts::TAU.sqrt());
        let heights = (0..BINS).map(|i| voxels as f64 * width * density(range[0] + (i as f64 + 0.5) * width));
        (sd > 0.0 && width > 0.0).then(|| Line { heights: heights.collect(), colour: class_colour(rank) })
    };
    classes.iter().take(MOST_DENSITIES).enumerate().filter_map(line).collect()
}

fn value_histogram(
    volume: &Volume,
    transfer: Option<&TransferFunction>,
    found: Option<&Figures<AnyFigures>>,
) -> String {
    let Some(range) = volume.range() else { return "<p>The volume holds no data.</p>".to_owned() };
    let counts = count_values(volume, range);
    let classes = found.map_or(&[][..], |found| &found.common.classes);
    let crossings: Vec<(f64, String)> =
        classes.iter().filter_map(|class| class.upper).map(|v| (v, number(v))).collect();
    let mut html = bars(&Bars {
        range,
        counts: &counts,
        x_label: "value; vertical: crossings of the classes, curves: their normal densities, bars: the transfer function's colours",
        y_label: "voxels",
        logarithmic: true,
        marks: crossings,
        colour: &|value| colour_of(transfer, value),
        lines: densities(classes, range),
    });
    if let Some(transfer) = transfer {
        let opacity: Vec<u64> = (0..BINS)
            .map(|i| range[0] + (i as f64 + 0.5) / BINS as f64 * (range[1] - range[0]))
            .map(|value| (f64::from(transfer.sample(0, value)[3]) * 1000.0).round() as u64)
            .collect();
        html += &bars(&Bars {
            range,
            counts: &opacity,
            x_label: "value",
            y_label: "opacity [‰]",
            logarithmic: false,
            marks: Vec::new(),
            colour: &|value| colour_of(Some(transfer), value),
            lines: Vec::new(),
        });
    }
    html
}

/// Number of voxels in equal bins of real values.
fn count_values(volume: &Volume, range: [f64; 2]) -> Vec<u64> {
    let scale = if range[1] > range[0] { BINS as f64 / (range[1] - range[0]) } else { 0.0 };
    with_voxels!(volume.voxels(), slice => {
        parallel::map_pieces(slice.len(), 1 << 18, &|piece| {
            let mut counts = vec![0_u64; BINS];
            for value in slice[piece].iter().filter(|v| v.is_data()) {
                let bin = (volume.real(value.to_f64()) - range[0]) * scale;
                counts[(bin as usize).min(BINS - 1)] += 1;
            }
            counts
        })
    })
    .into_iter()
    .fold(vec![0; BINS], |a, b| a.iter().zip(&b).map(|(x, y)| x + y).collect())
}

/// Colour of a value in the transfer function, for a page; grey where there is none.
fn colour_of(transfer: Option<&TransferFunction>, value: f64) -> String {
    let Some(transfer) = transfer else { return "#777".to_owned() };
    let rgba = transfer.sample(0, value);
    // Clear values (air) would be drawn black on white: grey says that they aren't shown.
    if rgba[3] < 1e-4 {
        return "#bbb".to_owned();
    }
    let [r, g, b] = [rgba[0], rgba[1], rgba[2]].map(srgb::byte);
    format!("#{r:02x}{g:02x}{b:02x}")
}
