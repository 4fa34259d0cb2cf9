//! `ivd info`.

use std::path::Path;

use ivd_artefact::{Artefact, Cache};
use ivd_core::{Classified as _, counted};
use ivd_io::mesh::Format as MeshFormat;
use ivd_io::volume::dicom::{self, Series};
use ivd_io::volume::{Error as VolumeError, ReadOptions, read_field};
use ivd_pipeline::{Error, describe, describe_field, describe_mesh};
use serde_json::{Map, Value, json};

use super::at;
use crate::context::Context;
use crate::exit::Failure;
use crate::files::imported;

/// Lists the DICOM series of a folder.
pub(super) fn series(folder: &Path, context: &Context) -> anyhow::Result<()> {
    must_be_folder(folder)?;
    let series = dicom::list(folder, &context.exec)
        .map_err(|error| Failure::of(error.error_class(), error.to_string()))?;
    let object = json!({ "path": folder, "kind": "dicom folder", "series": series });
    context.print(&object, || {
        let lines: Vec<String> = series.iter().map(series_line).collect();
        format!("{}\nread one with: ivd import {} --series …", lines.join("\n"), folder.display())
    })
}

/// Refuses a file where series of a folder are meant.
fn must_be_folder(path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    Err(Failure::usage(format!("{}: --series is of a folder, and this is none", path.display())))
}

/// A series for a person: what chooses it first.
fn series_line(series: &Series) -> String {
    let known = |length: Option<f64>| length.map_or_else(|| "?".to_owned(), |mm| format!("{mm:.4}"));
    let [x, y, z] = series.spacing.map(known);
    let [columns, rows] = series.size;
    let word =
        if series.series.is_empty() { "\"\" (it has no number: --series \"\")" } else { &series.series };
    let uneven = series
        .uneven_mm
        .map_or_else(String::new, |mm| format!(", slices unevenly spaced by up to {mm:.4} mm"));
    let refused = series.unreadable.map_or_else(String::new, |what| format!("; not readable: {what}"));
    format!(
        "{word}: {}, `{}`, {} of {columns}×{rows}, {x} × {y} × {z} mm{uneven}{refused}",
        series.modality,
        series.description,
        counted(series.slices, "slice", "slices")
    )
}

/// What is asked of a file beside what it holds.
pub(super) struct Asked<'a> {
    /// Series of a DICOM folder.
    pub(super) series: Option<String>,
    /// Vertices of a lattice.
    pub(super) vertices: &'a [u32],
    /// Voxels of a lattice's grid.
    pub(super) voxels: &'a [[i64; 3]],
    /// Places (mm, RAS) of a volume.
    pub(super) places: &'a [[f64; 3]],
    /// Labels and a mask of which is told what they have at the places.
    pub(super) beside: at::Beside<'a>,
}

/// Tells what a file holds, what lies at places of it, or of a lattice where vertices and voxels belong.
pub(super) fn run(file: &Path, asked: Asked<'_>, context: &Context) -> anyhow::Result<()> {
    let Asked { series, vertices, voxels, places, beside } = asked;
    if !places.is_empty() {
        let object = at::places(file, series, places, beside, context)?;
        return context.print(&object, || lines("", &object).join("\n"));
    }
    if !(vertices.is_empty() && voxels.is_empty()) {
        let object = relation(file, vertices, voxels, context)?;
        return context.print(&object, || lines("", &object).join("\n"));
    }
    if series.is_some() {
        must_be_folder(file)?;
    }
    let mut object = if file.is_file() && ivd_artefact::is_artefact(file) {
        artefact(file, context)?
    } else if let Some(told) = mesh(file, context)? {
        told
    } else {
        // What holds vectors is no volume.
        volume(file, series, context).or_else(|refused| field(file, refused, context))?
    };
    if let Value::Object(map) = &mut object {
        map.insert("path".to_owned(), json!(file));
    }
    context.print(&object, || lines("", &object).join("\n"))
}

/// The lattice's index relation: from vertices to their voxels, and back.
fn relation(file: &Path, vertices: &[u32], voxels: &[[i64; 3]], context: &Context) -> anyhow::Result<Value> {
    let input = context.artefact(file)?;
    let Artefact::Lattice(lattice) = &*input.artefact else {
        let kind = input.artefact.kind().name();
        let problem = format!("{}: a {kind} artefact; --vertex and --voxel are of a lattice", file.display());
        return Err(Failure::usage(problem));
    };
    let count = lattice.keys().len();
    if let Some(beyond) = vertices.iter().find(|&&v| v as usize >= count) {
        let problem = format!("--vertex {beyond}: {} has vertices 0 to {}", file.display(), count as i64 - 1);
        return Err(Failure::usage(problem));
    }
    let dims = lattice.grid().dims();
    let padded = |voxel: &[i64; 3]| (0..3).all(|a| (-1..=dims[a] as i64).contains(&voxel[a]));
    if let Some(beyond) = voxels.iter().find(|voxel| !padded(voxel)) {
        let problem =
            format!("--voxel {beyond:?}: the grid has {dims:?} voxels, and a border layer at −1 and n");
        return Err(Failure::usage(problem));
    }
    let described = |v: u32| {
        let d = lattice.describe(v);
        json!({
            "vertex": d.vertex, "voxel": d.voxel, "element": d.element, "place": d.place,
            "world": <[f64; 3]>::from(d.world.0), "voxels": d.voxels,
        })
    };
    let of_voxel = |voxel: &[i64; 3]| {
        let starting: Vec<Value> = lattice.vertices_of_voxel(*voxel).map(described).collect();
        json!({ "voxel": voxel, "vertices": starting, "vertices_round": lattice.vertices_touching_voxel(*voxel) })
    };
    Ok(json!({
        "path": file,
        "kind": "lattice",
        "vertices": vertices.iter().map(|&v| described(v)).collect::<Vec<_>>(),
        "voxels": voxels.iter().map(of_voxel).collect::<Vec<_>>(),
    }))
}

fn artefact(file: &Path, context: &Context) -> anyhow::Result<Value> {
    let info = ivd_artefact::peek(file)?;
    let input = context.artefact(file)?;
    let content = context.exec.run(|| describe(&input.artefact));
    Ok(json!({
        "kind": info.kind.name(),
        "kind_version": info.kind_version,
        "hash": info.hash.to_string(),
        "bytes": info.file_bytes,
        "provenance": {
            "stage": info.provenance.stage,
            "revision": info.provenance.revision,
            "params": info.provenance.params,
            "inputs": info.provenance.inputs.iter().map(|(k, v)| (k.clone(), json!(v.to_string()))).collect::<Map<_, _>>(),
            "backend": info.provenance.backend,
        },
        "metrics": info.metrics,
        "content": without_bulk(content),
    }))
}

fn volume(file: &Path, series: Option<String>, context: &Context) -> anyhow::Result<Value> {
    let options = ReadOptions { series, ..ReadOptions::default() };
    // Nothing is imported: it is told by the file alone.
    let input =
        imported(file, options, &Cache::disabled(), context).map_err(|error| match error.downcast() {
            Ok(Error::Stage { source, class, .. }) => Failure::of(class, source.to_string()),
            Ok(other) => other.into(),
            Err(other) => other,
        })?;
    let content = context.exec.run(|| describe(&input.artefact));
    Ok(json!({ "kind": "volume file", "hash": input.hash.to_string(), "content": content }))
}

/// A mesh file of any program; `None` of what has another ending.
fn mesh(file: &Path, context: &Context) -> anyhow::Result<Option<Value>> {
    if !file.is_file() || MeshFormat::of(file).is_none() {
        return Ok(None);
    }
    let mesh = ivd_io::mesh::read(file, context.exec.memory_limit.unwrap_or(u64::MAX))
        .map_err(|error| Failure::of(error.error_class(), error.to_string()))?;
    Ok(Some(json!({ "kind": "mesh file", "content": describe_mesh(&mesh) })))
}

/// A displacement field of another program; of what is none, why it was refused before.
fn field(file: &Path, refused: anyhow::Error, context: &Context) -> anyhow::Result<Value> {
    if !file.is_file() {
        return Err(refused);
    }
    match read_field(file, &context.exec) {
        Ok(found) => {
            let content = context.exec.run(|| describe_field(&found));
            Ok(json!({ "kind": "displacement field file", "content": content }))
        }
        // Of another format, or of something else than vectors.
        Err(VolumeError::Unsupported { .. }) => Err(refused),
        Err(error) => Err(Failure::of(error.error_class(), error.to_string())),
    }
}

/// Tables and displacements are for `ivd export … .json`.
fn without_bulk(mut content: Value) -> Value {
    if let Value::Object(map) = &mut content {
        map.remove("table");
        if let Some(Value::Array(frames)) = map.get_mut("frames") {
            *frames = frames.iter().map(|f| json!({ "time": f.get("time") })).collect();
        }
    }
    content
}

/// An object as indented lines; short lists stay on theirs.
fn lines(indent: &str, value: &Value) -> Vec<String> {
    let Value::Object(map) = value else { return vec![format!("{indent}{value}")] };
    let mut lines = Vec::new();
    for (key, value) in map {
        match value {
            Value::Object(inner) if key == "histogram" => {
                lines.push(format!("{indent}{key} (bars as long as the square root of their share):"));
                lines.extend(bars(inner).into_iter().map(|bar| format!("{indent}  {bar}")));
            }
            Value::Object(inner) if !inner.is_empty() => {
                lines.push(format!("{indent}{key}:"));
                lines.extend(self::lines(&format!("{indent}  "), value));
            }
            Value::Array(list) if list.first().is_some_and(Value::is_object) => {
                lines.push(format!("{indent}{key}:"));
                lines.extend(list.iter().map(|item| format!("{indent}  {item}")));
            }
            Value::String(text) => lines.push(format!("{indent}{key}: {text}")),
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::Array(_) | Value::Object(_) => {
                lines.push(format!("{indent}{key}: {value}"));
            }
        }
    }
    lines
}

/// Most marks of a bar.
const LONGEST: f64 = 40.0;

/// A histogram for a person: a line for each bin, its values, a bar as long as the root of its share, and the share. Roots, as most of a scan
/// is air.
fn bars(histogram: &Map<String, Value>) -> Vec<String> {
    let numbers = |key: &str| -> Vec<f64> {
        let list = histogram.get(key).and_then(Value::as_array);
        list.into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    let (edges, voxels) = (numbers("edges"), numbers("voxels"));
    let all = voxels.iter().sum::<f64>().max(1.0);
    let most = voxels.iter().copied().fold(1.0, f64::max);
    let width = edges.windows(2).map(|ends| ends[1] - ends[0]).fold(0.0, f64::max);
    let bar = |(ends, count): (&[f64], &f64)| {
        let [low, high] = [ends[0], ends[1]].map(|edge| shown(edge, width));
        let marks = "#".repeat((LONGEST * (count / most).sqrt()).round() as usize);
        format!("{low:>12} … {high:<12} {marks:<40} {:.2} %", 100.0 * count / all)
    };
    edges.windows(2).zip(&voxels).map(bar).collect()
}

/// A number to a hundredth of a width.
fn shown(number: f64, width: f64) -> String {
    let places = if width > 0.0 { (2.0 - width.log10()).clamp(0.0, 12.0) as usize } else { 4 };
    let text = format!("{number:.places$}");
    let text = if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        "0".to_owned()
    } else {
        text
    };
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
