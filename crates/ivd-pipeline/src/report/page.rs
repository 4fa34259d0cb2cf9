//! What the page shows, in its order.

use ivd_artefact::Artefact;
use ivd_boundary::BoundaryFigures;
use ivd_core::{Exec, Image, Value as _};
use ivd_lattice::extract::{self, LatticeFigures};
use ivd_lattice::refine::{self, RefineFigures};
use ivd_report::html::{escape, number};
use ivd_report::{
    Cell, Curve, Page, Pictures, body_or_problem, curve, pairs, shown, slices, table, value_histogram,
};
use ivd_segment::{AnyFigures, Figures};

use super::data::ReportData;
use super::deformation::{Moves, bones, class_volumes, deformation};
use super::segmentation::{class_densities, labelled, segmentation};
use super::slice_window;
use super::summary::summary;
use crate::control::Decisions;
use crate::pictures::png_bytes;
use crate::plan::NodeId;
use crate::scene::{InputSection, Loaded, Picture};
use crate::stages::{IMPORT, ImportFigures, LabelsOfFigures};
use crate::{Error, OutputFile, StageRecord, State, figures_of};

/// The report of a run, self-contained.
///
/// # Errors
/// A picture that can't be shown.
pub(crate) fn html(
    loaded: &Loaded,
    records: &[StageRecord],
    written: &[OutputFile],
    data: &ReportData,
    exec: &Exec,
) -> Result<String, Error> {
    let name = loaded.file.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy());
    let mut page = Page::new(&name);
    page.pictures(&pictures(data)?);
    let lettered = is_lettered(records);
    page.section(
        "What was asked, and what was done",
        &body_or_problem(summary(loaded, records, data.specks_moved)),
    );
    let window = match data.volume.as_deref() {
        Some(Artefact::Volume(volume)) => exec.run(|| slice_window(&loaded.scene, volume)),
        _ => None,
    };
    let told_window = window.map_or_else(String::new, |[low, high]| {
        format!("<p class='scale'>Black: {} and below; white: {} and above.</p>", number(low), number(high))
    });
    if let (Some(moved), Some(Artefact::Volume(volume))) = (&data.moved, data.volume.as_deref()) {
        page.section(
            "Slices through what moves about furthest",
            &(moved.html(volume.grid(), lettered, png_bytes)? + &told_window),
        );
    }
    if let (Some(result), Some(Artefact::Volume(volume))) = (&data.result, data.volume.as_deref()) {
        page.section(
            "Slices of what came of it",
            &(result.html(volume.grid(), lettered, png_bytes)? + &told_window),
        );
    }
    page.section("Volume", &body_or_problem(volume_table(&loaded.scene.input, records)));
    let segment = records.iter().find(|r| r.stage == ivd_segment::STAGE.name && r.output.is_some());
    let found = segment.map(StageRecord::figures::<Figures<AnyFigures>>);
    let of_file = records.iter().find(|r| r.stage == IMPORT && r.variant == NodeId::LABELS.variant);
    let of_file = of_file.map(StageRecord::figures::<LabelsOfFigures>);
    if let Some(Artefact::Volume(volume)) = data.volume.as_deref() {
        let readable = found.as_ref().and_then(|found| found.as_ref().ok());
        let own = readable.map(|found| &found.common.classes[..]);
        let given = of_file.as_ref().and_then(|found| found.as_ref().ok()).map(|found| &found.classes[..]);
        let classes = own.or(given).map(|classes| class_densities(classes, data)).unwrap_or_default();
        let chart = exec.run(|| value_histogram(volume, data.transfer.as_ref(), &classes));
        page.section("Histogram, classes and transfer function", &chart);
    }
    let own =
        segment.zip(found).map(|(segment, found)| found.map(|found| segmentation(segment, &found, data)));
    let is_by_label = |record: &StageRecord| {
        record.stage == ivd_render::STAGE.name
            && record.inputs.contains_key("labels")
            && record.params["unlabelled"] != true
    };
    let are_alone = records.iter().any(is_by_label);
    let given = of_file.map(|found| found.map(|found| labelled(&found, are_alone, data)));
    if let Some(found) = own.or(given) {
        let mut body = body_or_problem(found);
        if let Some(Artefact::Volume(volume)) = data.volume.as_deref() {
            body += &slices((volume, window), &data.class_slices, lettered, png_bytes)?;
        }
        page.section("Classes", &body);
    }
    if let Some(part) = part(records).transpose() {
        page.section("Part", &body_or_problem(part));
    }
    page.section("Lattice", &body_or_problem(lattice_table(records)));
    if let Some(moves) = Moves::of(records).transpose() {
        let body = moves.map(|moves| deformation(&moves, &data.displacements) + &bones(&moves));
        page.section("Deformation", &(body_or_problem(body) + &class_volumes(&data.class_volumes)));
    }
    let Decisions { title, lines } = &data.decisions;
    if !lines.is_empty() {
        let lines = lines.iter().map(|line| format!("<p>{}</p>", escape(line)));
        page.section(title, &lines.collect::<String>());
    }
    page.section("Stages", &(stages(records) + &outputs(written)));
    Ok(page.finish())
}

fn pictures(data: &ReportData) -> Result<Pictures, Error> {
    let png = |picture: Picture| {
        let image = data.pictures.get(picture.name()).and_then(|artefact| Image::of(artefact));
        image.map(png_bytes).transpose()
    };
    let [before, after, difference, moved] = Picture::ALL.map(png);
    Ok(Pictures { before: before?, after: after?, difference: difference?, moved: moved? })
}

/// Whether left and right are known.
fn is_lettered(records: &[StageRecord]) -> bool {
    let import = figures_of::<ImportFigures>(records, IMPORT);
    import.ok().flatten().is_some_and(|found| found.patient_space)
}

/// Who says where left and right are.
fn lettered_by(asked: &InputSection, is_known: bool) -> String {
    match (is_known, asked.axes, &asked.grid_of) {
        (false, ..) => "no".to_owned(),
        (true, Some(axes), _) => format!("yes, by axes = {axes} of the scene"),
        (true, None, Some(_)) => "yes, by the file of grid_of".to_owned(),
        (true, None, None) => "yes".to_owned(),
    }
}

fn volume_table(asked: &InputSection, records: &[StageRecord]) -> Result<String, Error> {
    let import = figures_of::<ImportFigures>(records, IMPORT)?;
    let import = import.as_ref();
    Ok(pairs(&[
        ("voxels along x, y, z", shown(import.map(|found| found.dims))),
        ("spacing [mm]", shown(import.map(|found| found.spacing))),
        ("stored type", shown(import.map(|found| &found.stored))),
        ("range", shown(import.map(|found| found.range))),
        ("voxels without data", shown(import.map(|found| found.missing))),
        ("left and right are known", shown(import.map(|found| lettered_by(asked, found.patient_space)))),
    ]))
}

/// What the isolated part comes to, with the energies that its method went through.
fn part(records: &[StageRecord]) -> Result<Option<String>, Error> {
    let Some(found) = figures_of::<BoundaryFigures>(records, ivd_boundary::STAGE.name)? else {
        return Ok(None);
    };
    let rows = pairs(&[
        ("voxels", found.voxels.to_string()),
        ("pieces that there were", found.components.to_string()),
        ("voxels of holes", found.filled.to_string()),
        ("weight of the area", shown(found.mu)),
        ("mean inside, outside", shown(found.means)),
        ("gap to the lowest energy, of the area's", shown(found.gap)),
    ]);
    let points: Vec<(f64, f64)> = (0..).map(f64::from).zip(found.energies).collect();
    let energies = curve(&Curve {
        points: &points,
        x_label: "energies that were accepted",
        y_label: "energy",
        chosen: None,
    });
    Ok(Some(rows + &energies))
}

fn lattice_table(records: &[StageRecord]) -> Result<String, Error> {
    let cut = figures_of::<LatticeFigures>(records, extract::STAGE.name)?;
    let refined = figures_of::<RefineFigures>(records, refine::STAGE.name)?;
    let (cut, last) = (cut.as_ref(), refined.as_ref().map(|found| &found.last));
    let mut rows = vec![
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
        (
            "distance to the cut lattice, largest found [mm]",
            shown(last.and_then(|found| found.seen_error_mm)),
        ),
        ("distance to the cut lattice, mean [mm]", shown(last.map(|found| found.mean_error_mm))),
    ];
    if let Some((parts, volume)) = cut.and_then(|found| found.dropped_parts.zip(found.dropped_mm3)) {
        rows.push(("parts left out by min_part", format!("{parts}, of {volume:.3} mm³ together")));
    }
    let small = cut.and_then(|found| found.small_parts.zip(found.small_parts_mm3));
    if let Some((parts, volume)) = small.filter(|(parts, _)| *parts > 0) {
        rows.push(("parts below 1 % of the largest", format!("{parts}, of {volume:.3} mm³ together")));
    }
    Ok(pairs(&rows))
}

/// What every stage did, how long it took and why.
fn stages(records: &[StageRecord]) -> String {
    let head = ["stage", "state", "wall [s]", "processor [s]", "peak memory [MiB]", "why"];
    let row = |record: &StageRecord| {
        let is_timed = matches!(record.state, State::Ran | State::Cached);
        let cell = |value: Option<f64>, places: usize| {
            let value = value.filter(|_| is_timed);
            Cell::Text(value.map_or_else(|| "–".to_owned(), |value| format!("{value:.places$}")))
        };
        [
            Cell::plain(format_args!("{} {}", record.stage, record.variant)),
            Cell::plain(record.state.words()),
            cell(Some(record.wall_s), 3),
            cell(record.cpu_s, 3),
            cell(record.peak_rss_mb, 0),
            Cell::plain(&record.why),
        ]
    };
    table(head, records.iter().map(row))
}

/// The other files of the output folder, and what writing them took.
fn outputs(written: &[OutputFile]) -> String {
    let head = ["file", "made for", "state", "wall [s]", "peak memory [MiB]"];
    let row = |file: &OutputFile| {
        let name = file.path.file_name().unwrap_or_default().to_string_lossy();
        [
            Cell::plain(&name),
            Cell::plain(&file.name),
            Cell::plain(if file.written { "written" } else { "as it was" }),
            Cell::plain(format_args!("{:.3}", file.wall_s)),
            Cell::Text(file.peak_rss_mb.map_or_else(|| "–".to_owned(), |peak| format!("{peak:.0}"))),
        ]
    };
    if written.is_empty() { String::new() } else { table(head, written.iter().map(row)) }
}
