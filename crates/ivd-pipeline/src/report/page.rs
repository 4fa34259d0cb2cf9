//! The page itself.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ivd_artefact::Artefact;
use ivd_core::{Exec, Scalar, TransferFunction, Volume, with_voxels};
use ivd_segment::{AnyFigures, ClassFigures, Figures};
use rayon::prelude::*;
use serde_json::Value;

use super::Material;
use super::chart::{Bars, Line, bars, escape, histogram, number};
use super::curve::{Curve, curve};
use super::slices::{class_colour, slices};
use super::tables::{bones, class_volumes, classes, metric, pairs, stages};
use super::tree::dendrogram;
use crate::export::png_bytes;
use crate::runner::StageRecord;
use crate::scene::Loaded;

/// Bars of a histogram.
const BINS: usize = 256;

/// More curves than these can't be told apart.
const MOST_DENSITIES: usize = 16;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The report of a run, self-contained.
pub(crate) fn html(loaded: &Loaded, records: &[StageRecord], material: &Material, exec: &Exec) -> String {
    let name = loaded.file.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy());
    let find = |stage: &str| records.iter().find(|r| r.stage == stage && r.output.is_some());
    let mut page = format!(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><meta name='viewport' content='width=device-width'>\
         <title>{0} – IVD report</title><style>{STYLE}</style></head><body><h1>{0}</h1>",
        escape(&name)
    );
    pictures(&mut page, material);
    section(&mut page, "Volume", &volume_table(find("import")));
    let found = find("segment").map(StageRecord::figures::<Figures<AnyFigures>>);
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
    if let Some((segment, found)) = find("segment").zip(found.as_ref()) {
        let colour = |value: f64| colour_of(material.transfer.as_ref(), value);
        let mut body = match found {
            Ok(found) => segmentation(segment, found) + &classes(&found.common.classes, &colour),
            Err(problem) => format!("<p>{}</p>", escape(&problem.to_string())),
        };
        if let Some(Artefact::Volume(volume)) = material.volume.as_deref() {
            body += &slices(volume, &material.class_slices);
        }
        section(&mut page, "Classes", &body);
    }
    section(&mut page, "Lattice", &lattice_table(find("lattice"), find("refine")));
    // Steps in space have the last word over the voxels; what the lattice makes of it is the map's.
    if let Some(last) = find("space").or(find("map")) {
        let moves = Moves { deform: find("deform"), map: find("map"), last, warp: find("warp") };
        section(
            &mut page,
            "Deformation",
            &(deformation(&moves, &material.displacements)
                + &bones(find("deform"))
                + &class_volumes(&material.class_volumes)),
        );
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
    page
}

fn section(page: &mut String, title: &str, body: &str) {
    let _ = write!(page, "<section><h2>{}</h2>{body}</section>", escape(title));
}

fn pictures(page: &mut String, material: &Material) {
    let source = |name: &str| match material.pictures.get(name).map(AsRef::as_ref) {
        Some(Artefact::Image(image)) => {
            Some(format!("data:image/png;base64,{}", STANDARD.encode(png_bytes(image))))
        }
        _ => None,
    };
    match (source("before"), source("after")) {
        (Some(before), Some(after)) => {
            let _ = write!(
                page,
                "<div class='pictures'><figure><div class='slider'><img src='{before}' alt='before'>\
                 <img class='over' src='{after}' alt='after'><input type='range' min='0' max='100' value='50' \
                 aria-label='before to after'></div><figcaption>before · after: move the slider</figcaption></figure>"
            );
            if let Some(difference) = source("difference") {
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
}

fn volume_table(import: Option<&StageRecord>) -> String {
    pairs(&[
        ("voxels along x, y, z", metric(import, "dims")),
        ("spacing [mm]", metric(import, "spacing")),
        ("stored type", metric(import, "type")),
        ("range", metric(import, "range")),
        ("voxels without data", metric(import, "missing")),
    ])
}

fn lattice_table(lattice: Option<&StageRecord>, refine: Option<&StageRecord>) -> String {
    pairs(&[
        ("vertices, as cut", metric(lattice, "vertices")),
        ("triangles, as cut", metric(lattice, "triangles")),
        ("components", metric(lattice, "components")),
        ("Euler characteristic", metric(lattice, "euler")),
        ("area [mm²]", metric(lattice, "area_mm2")),
        ("enclosed volume [mm³]", metric(lattice, "volume_mm3")),
        ("open edges", metric(lattice, "boundary_edges")),
        ("non-manifold edges", metric(lattice, "non_manifold_edges")),
        ("vertices, refined", metric(refine, "vertices")),
        ("triangles, refined", metric(refine, "triangles")),
        ("distance to the cut lattice, bound [mm]", metric(refine, "max_error_mm")),
        ("distance to the cut lattice, mean [mm]", metric(refine, "mean_error_mm")),
    ])
}

/// The records of a deformation.
struct Moves<'a> {
    deform: Option<&'a StageRecord>,
    map: Option<&'a StageRecord>,
    /// Of the displacement that is carried out.
    last: &'a StageRecord,
    warp: Option<&'a StageRecord>,
}

fn deformation(moves: &Moves<'_>, lengths: &[f64]) -> String {
    let &Moves { deform, map, last, warp } = moves;
    let mut html = pairs(&[
        ("vertices moved", metric(deform, "vertices_moved")),
        ("largest displacement [mm]", metric(deform, "max_displacement_mm")),
        ("voxels moved", metric(Some(last), "voxels_moved")),
        ("voxels resampled", metric(warp, "voxels_resampled")),
        ("volume inside the lattice, rest → deformed (mm³)", map.map_or_else(|| "–".to_owned(), enclosed)),
        ("smallest det J, certified", metric(Some(last), "min_det_j")),
        ("folds", metric(Some(last), "folds")),
        ("inverse, largest residual [voxels]", metric(Some(last), "inverse_residual_max_voxel")),
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
    if let Some((range, counts)) = det_j(last) {
        html += &bars(&Bars {
            range,
            counts: &counts,
            x_label: "det J of touched cells: local volume change (1 = unchanged)",
            y_label: "cells",
            logarithmic: true,
            marks: vec![(1.0, "1".to_owned())],
            colour: &|v| if v < 1.0 { "#b5651d".to_owned() } else { "#2f7f6f".to_owned() },
            lines: Vec::new(),
        });
    }
    html
}

/// The volume inside the lattice before and after, as the map tells it, with the change.
fn enclosed(map: &StageRecord) -> String {
    let pair = map.metrics.get("followed").and_then(|f| f.get("volume_mm3"));
    let at = |i: usize| pair.and_then(|p| p.get(i)).and_then(Value::as_f64);
    match (at(0), at(1)) {
        (Some(rest), Some(deformed)) if rest != 0.0 => {
            let change = 100.0 * (deformed - rest) / rest;
            format!("{} → {} ({change:+.2} %)", number(rest), number(deformed))
        }
        _ => "–".to_owned(),
    }
}

/// Range and counts of the map's histogram of det J, where it tells them.
fn det_j(map: &StageRecord) -> Option<([f64; 2], Vec<u64>)> {
    let histogram = map.metrics.get("det_j_histogram")?;
    let low = histogram.get("lower")?.as_f64()?;
    let high = histogram.get("upper")?.as_f64()?;
    let counts = histogram.get("counts")?.as_array()?.iter().filter_map(Value::as_u64).collect();
    Some(([low, high], counts))
}

/// How the classes were found, with the curves that their number was read from.
fn segmentation(segment: &StageRecord, found: &Figures<AnyFigures>) -> String {
    let Figures { common, own } = found;
    let method = segment.params.get("method").and_then(Value::as_str).unwrap_or("–").to_owned();
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
        slice
            .par_chunks(1 << 18)
            .map(|chunk| {
                let mut counts = vec![0_u64; BINS];
                for value in chunk.iter().filter(|v| v.is_data()) {
                    let bin = (volume.real(value.to_f64()) - range[0]) * scale;
                    counts[(bin as usize).min(BINS - 1)] += 1;
                }
                counts
            })
            .reduce(|| vec![0; BINS], |a, b| a.iter().zip(&b).map(|(x, y)| x + y).collect())
    })
}

/// Colour of a value in the transfer function, for a page; grey where there is none.
fn colour_of(transfer: Option<&TransferFunction>, value: f64) -> String {
    let Some(transfer) = transfer else { return "#777".to_owned() };
    let rgba = transfer.sample(0, value);
    // Clear values (air) would be drawn black on white: grey says that they aren't shown.
    if rgba[3] < 1e-4 {
        return "#bbb".to_owned();
    }
    let srgb = |c: f32| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round() as u8;
    format!("#{:02x}{:02x}{:02x}", srgb(rgba[0]), srgb(rgba[1]), srgb(rgba[2]))
}
