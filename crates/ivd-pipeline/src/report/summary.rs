//! What was asked and what was done: what moved, how far, and whether to trust it, on one screen.

use std::fmt::Write as _;

use ivd_boundary::BoundaryFigures;
use ivd_core::counted;
use ivd_field::clip::{self, ClipFigures};
use ivd_field::combine::{self, CombineFigures};
use ivd_lattice::extract::{self, LatticeFigures};
use ivd_lattice::refine::{self, RefineFigures, StopReason};
use ivd_map::space::{self, SpaceFigures, SpaceParams};
use ivd_map::{MapFigures, SurfaceFit};
use ivd_motion::deform::{self, Asked, Handle, PickFigures};
use ivd_report::html::{escape, number};
use ivd_report::{Cell, Figure, figures, pairs, shown, table};
use serde_json::Value as Json;

use super::recorded::{in_full, of_record};
use super::{asked, plain};
use crate::scene::{Loaded, Picture, Scene};
use crate::series::FRAME;
use crate::stages::{IMPORT, ImportFigures};
use crate::{Error, Section, StageRecord, figures_of};

/// The settings, the handles, what came of them, and what to know about it.
///
/// - `specks_moved`: small parts of the lattice that lie where something moves.
pub(super) fn summary(
    loaded: &Loaded,
    records: &[StageRecord],
    specks_moved: Option<u64>,
) -> Result<String, Error> {
    let scene = &loaded.scene;
    let done = figures_of::<deform::Figures>(records, deform::STAGE.name)?;
    let map = figures_of::<MapFigures>(records, ivd_map::STAGE.name)?;
    let space = figures_of::<SpaceFigures>(records, space::STAGE.name)?;
    let told = told(records, specks_moved, map.as_ref())?;
    let refined = figures_of::<RefineFigures>(records, refine::STAGE.name)?;
    let mut html = verdict(&told, map.as_ref(), space.as_ref(), refined.as_ref());
    html += &pairs(&settings(loaded, records)?);
    if let Some(asked) = scene.section(&deform::STAGE).and_then(|section| Asked::of(section.job())) {
        let picks = done.as_ref().map(|done| (&done.handles[..], &done.fixed[..]));
        html += &handles(&asked, picks.unwrap_or_default());
        html += &others(&asked);
    }
    html += &steps(scene);
    html += &asked::asked(scene, records);
    let mut outcome = outcome(done.as_ref(), map.as_ref(), space.as_ref());
    outcome.extend(parts(records)?);
    html += &figures(&outcome);
    if !told.is_empty() {
        html += "<ul class='told'>";
        html.extend(told.iter().map(|Told { about, frame, text, warns }| {
            let sign = if *warns { "<b>▲ Look at:</b>" } else { "Note:" };
            format!("<li>{sign} {about}{}: {}</li>", escape(frame), escape(text))
        }));
        html += "</ul>";
    }
    html += &written(scene);
    Ok(html)
}

/// What the page marks, for who doesn't open it.
pub(crate) fn remark(records: &[StageRecord], specks_moved: Option<u64>) -> Result<Option<String>, Error> {
    let map = figures_of::<MapFigures>(records, ivd_map::STAGE.name)?;
    let told = told(records, specks_moved, map.as_ref())?;
    let marked = told.iter().filter(|told| told.warns).map(|told| format!("{}{}", told.about, told.frame));
    let marked = marked.collect::<Vec<String>>().join("; ");
    let remark = format!("marks (▲) what to look at before it is trusted: {marked}");
    Ok(Some(remark).filter(|_| !marked.is_empty()))
}

/// Input, part, lattice, solver and map, each in a line.
fn settings(loaded: &Loaded, records: &[StageRecord]) -> Result<Vec<(&'static str, String)>, Error> {
    let scene = &loaded.scene;
    let mut rows = vec![("input", input(loaded))];
    // Folders may carry a patient's name.
    let labels = scene.input.labels.as_ref().and_then(|file| file.file_name());
    rows.extend(labels.map(|name| ("labels", name.to_string_lossy().into_owned())));
    if let Some(found) = figures_of::<ImportFigures>(records, IMPORT)? {
        let spacing = found.spacing.map(number).join(" × ");
        rows.push((
            "grid",
            format!("{} voxels of {spacing} mm", found.dims.map(|n| n.to_string()).join(" × ")),
        ));
    }
    if let Some(found) = figures_of::<BoundaryFigures>(records, ivd_boundary::STAGE.name)? {
        let method = method(scene, &ivd_boundary::STAGE);
        let filled = match found.filled {
            0 => String::new(),
            filled => format!(", {filled} of them in holes that were filled"),
        };
        rows.push(("part", format!("{method}; {}{filled}", counted(found.voxels, "voxel", "voxels"))));
    }
    if let Some(found) = figures_of::<LatticeFigures>(records, extract::STAGE.name)? {
        let iso = of_record(records, extract::STAGE.name, "iso");
        rows.push((
            "lattice",
            format!(
                "cut at {iso}; {}, {}",
                counted(found.vertices, "vertex", "vertices"),
                counted(found.components, "piece", "pieces")
            ),
        ));
    }
    if let Some(found) = figures_of::<RefineFigures>(records, refine::STAGE.name)? {
        let last = &found.last;
        rows.push((
            "refined",
            format!(
                "by {}; {} of {}, proven to lie within {} mm of the surface as cut{}",
                of_record(records, refine::STAGE.name, "method"),
                last.vertices,
                counted(found.vertices_in, "vertex", "vertices"),
                number(last.max_error_mm),
                last.seen_error_mm.map_or_else(String::new, |seen| format!(
                    " ({} mm where that was looked at)",
                    number(seen)
                )),
            ),
        ));
    }
    let has_run = |stage: &ivd_core::op::Stage| {
        records.iter().any(|record| record.stage == stage.name && record.output.is_some())
    };
    if has_run(&deform::STAGE) {
        let method = method(scene, &deform::STAGE);
        rows.push(("solver", plain::with(&method, plain::solver(&method))));
    }
    if has_run(&ivd_map::STAGE) {
        let method = method(scene, &ivd_map::STAGE);
        rows.push(("map", plain::with(&method, plain::map(&method))));
    }
    Ok(rows)
}

/// The file's own name, or that of what was generated. Folders may carry a patient's.
pub(crate) fn input(loaded: &Loaded) -> String {
    let input = &loaded.scene.input;
    match (&input.file, input.phantom) {
        (Some(file), _) if loaded.folder.join(file).is_dir() => "a folder of slices".to_owned(),
        (Some(file), _) => file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        (None, Some(shape)) => format!("generated: {}", shown(shape)),
        (None, None) => "–".to_owned(),
    }
}

fn method(scene: &Scene, stage: &ivd_core::op::Stage) -> String {
    let method = scene.section(stage).map(Section::method);
    method.map_or_else(|| "–".to_owned(), |method| method.name.to_owned())
}

/// What handles and fixed places were asked for, and the vertices that they took.
fn handles(asked: &Asked<'_>, (taken, fixed): (&[PickFigures], &[PickFigures])) -> String {
    let moves = asked.moves;
    if moves.handle.is_empty() && moves.fix.is_empty() {
        return String::new();
    }
    let head = [
        "",
        "asked for at [mm, RAS]",
        "took vertex",
        "at [mm, RAS]",
        "away [mm]",
        "moved by [mm], or pulled with [mN]",
        "radius [mm]",
    ];
    let place = |at: Option<[f64; 3]>| Cell::Text(at.map_or_else(|| "–".to_owned(), in_full));
    let cells =
        |name: String, pick: Option<&PickFigures>, asked: Option<[f64; 3]>, action: String, radius: f64| {
            [
                Cell::Text(name),
                place(asked),
                Cell::Text(shown(pick.map(|pick| pick.vertex))),
                place(pick.map(|pick| pick.at_mm)),
                Cell::number_or_dash(pick.map(|pick| pick.away_mm)),
                Cell::Text(action),
                Cell::number(radius),
            ]
        };
    let action = |handle: &Handle| match (handle.by, handle.force) {
        (Some(by), _) => in_full(by),
        (None, Some(force)) => format!("{} mN", vector(force)),
        (None, None) => "–".to_owned(),
    };
    let of_handles = moves.handle.iter().enumerate().map(|(i, handle)| {
        cells(format!("handle {i}"), taken.get(i), handle.pick, action(handle), handle.radius)
    });
    let of_fixed = moves.fix.iter().enumerate().map(|(i, pin)| {
        cells(format!("fixed {i}"), fixed.get(i), Some(pin.pick), "stays".to_owned(), pin.radius)
    });
    table(head, of_handles.chain(of_fixed))
}

/// Shapes and bones, as they were asked for.
fn others(asked: &Asked<'_>) -> String {
    let (shapes, bones) = (asked.moves.shape.len(), asked.bones.len());
    let mut rows = Vec::new();
    if shapes > 0 {
        rows.push(("changes of shape", shapes.to_string()));
    }
    if bones > 0 {
        rows.push(("bones", bones.to_string()));
    }
    if rows.is_empty() { String::new() } else { pairs(&rows) }
}

fn vector(parts: [f64; 3]) -> String {
    parts.map(number).join(", ")
}

/// Steps in space, as they were asked for.
fn steps(scene: &Scene) -> String {
    let steps = scene.get::<SpaceParams>(&space::STAGE).map_or(&[][..], |params| &params.step);
    let kind = |step: &space::Step| {
        let written = serde_json::to_value(step).unwrap_or_default();
        written.get("kind").and_then(Json::as_str).unwrap_or("–").to_owned()
    };
    if steps.is_empty() {
        return String::new();
    }
    pairs(&[("then, in space", steps.iter().map(kind).collect::<Vec<_>>().join(", "))])
}

/// How far things went, and how closely the voxels followed. Where steps in space go on from the map, what it says of the voxels isn't
/// the last word, and theirs is told.
fn outcome(
    done: Option<&deform::Figures>,
    map: Option<&MapFigures>,
    space: Option<&SpaceFigures>,
) -> Vec<Figure> {
    let mut rows = done.map(of_lattice).unwrap_or_default();
    rows.extend(map.into_iter().flat_map(|map| of_map(map, space.is_none())));
    if let Some(space) = space {
        rows.extend([
            Figure::new("voxels moved, in the end", "space.voxels_moved", space.voxels_moved),
            Figure::new("smallest det J, certified", "space.min_det_j", space.min_det_j)
                .meaning(plain::smallest_det_j(space.min_det_j, None)),
            Figure::new("folds", "space.folds", space.folds).meaning(plain::folds(space.folds)),
        ]);
    }
    rows
}

/// What a combination changed and a clip kept.
fn parts(records: &[StageRecord]) -> Result<Vec<Figure>, Error> {
    let combined = figures_of::<CombineFigures>(records, combine::STAGE.name)?;
    let clipped = figures_of::<ClipFigures>(records, clip::STAGE.name)?;
    let mut rows = Vec::new();
    if let Some(combined) = combined {
        rows.push(Figure::new(
            "voxels that the combination changed",
            "combine.voxels_changed",
            combined.voxels_changed,
        ));
    }
    if let Some(clipped) = clipped {
        rows.extend([
            Figure::new("voxels that the clip kept", "clip.voxels_kept", clipped.voxels_kept),
            Figure::new("voxels that it made background", "clip.voxels_clipped", clipped.voxels_clipped),
        ]);
    }
    Ok(rows)
}

fn of_lattice(done: &deform::Figures) -> Vec<Figure> {
    let share = done.elastic.as_ref().map(|elastic| elastic.share);
    vec![
        Figure::new("vertices moved", "deform.vertices_moved", done.vertices_moved),
        Figure::new(
            "largest motion of the lattice [mm]",
            "deform.max_displacement_mm",
            done.max_displacement_mm,
        ),
        Figure::new("share of the way that matter went", "deform.share", share),
    ]
}

/// What the map says: of the lattice's voxels, and of all where it is the last.
fn of_map(map: &MapFigures, is_last: bool) -> Vec<Figure> {
    let SurfaceFit { vertices_driven, vertices_held, vertices_carried, conflicts, .. } = map.followed;
    let fit = &map.followed;
    let last = |figure: Figure| is_last.then_some(figure);
    let always = [
        Figure::new("largest motion of a voxel by the lattice [mm]", "map.largest_mm", map.largest_mm),
        Figure::new("there, at rest [mm, RAS]", "map.largest_at_mm", map.largest_at_mm),
        Figure::new("share of the way that was mapped", "map.share", map.share),
        Figure::new(
            "vertices near it that the solver moved",
            "map.followed.vertices_driven",
            vertices_driven,
        ),
        Figure::new("vertices near it that were to stay", "map.followed.vertices_held", vertices_held),
        Figure::new(
            "vertices near it that go along with what surrounds them",
            "map.followed.vertices_carried",
            vertices_carried,
        ),
        Figure::new("vertices told to move unlike others beside them", "map.followed.conflicts", conflicts),
        Figure::new(
            "voxels behind the vertices, mean [voxels]",
            "map.followed.misfit_mean_voxel",
            fit.misfit_mean_voxel,
        ),
        Figure::new(
            "95 % of the vertices within [voxels]",
            "map.followed.misfit_p95_voxel",
            fit.misfit_p95_voxel,
        ),
        Figure::new(
            "99.9 % of them within [voxels]",
            "map.followed.misfit_p999_voxel",
            fit.misfit_p999_voxel,
        ),
        Figure::new("all of them within [mm]", "map.followed.misfit_max_mm", fit.misfit_max_mm),
        Figure::new(
            "the worst is, at rest, at [mm, RAS]",
            "map.followed.misfit_max_at_mm",
            fit.misfit_max_at_mm,
        ),
    ];
    let voxels = last(
        Figure::new("voxels moved", "map.voxels_moved", map.voxels_moved)
            .meaning("of the scan at rest; of the deformed scan a few more or fewer are made anew"),
    );
    let proof = [
        Figure::new("smallest det J, certified", "map.min_det_j", map.min_det_j)
            .meaning(plain::smallest_det_j(map.min_det_j, map.squeezed.map(|squeezed| squeezed.voxels))),
        Figure::new(
            "space squeezed to less than a tenth [voxels]",
            "map.squeezed.voxels",
            map.squeezed.map(|squeezed| squeezed.voxels),
        ),
        Figure::new(
            "the same [mm³]",
            "map.squeezed.volume_mm3",
            map.squeezed.map(|squeezed| squeezed.volume_mm3),
        ),
        Figure::new(
            "its share of what moves",
            "map.squeezed.share",
            map.squeezed.map(|squeezed| squeezed.share),
        ),
        Figure::new("folds", "map.folds", map.folds).meaning(plain::folds(map.folds)),
    ];
    voxels.into_iter().chain(always).chain(proof.into_iter().filter_map(last)).collect()
}

/// Whether to trust the result, in one sentence, and what shows it; `told` is what to know before.
fn verdict(
    told: &[Told],
    map: Option<&MapFigures>,
    space: Option<&SpaceFigures>,
    refined: Option<&RefineFigures>,
) -> String {
    let then = if space.is_some() { ", before the steps in space" } else { "" };
    let seen = refined.and_then(|refined| refined.last.seen_error_mm);
    let near = seen.map_or_else(String::new, |seen| {
        format!(", which lies within {} mm of the surface as cut where that was looked at", number(seen))
    });
    let follows = map.filter(|map| map.follows()).map(|map| {
        let within = number(map.followed.misfit_max_mm);
        format!("the deformed volume follows the lattice to within {within} mm{then}{near}")
    });
    let folds = space.map(|space| space.folds).or(map.map(|map| map.folds));
    let whole = (folds == Some(0)).then(|| "it folds nowhere, which is certified".to_owned());
    let shown = follows.into_iter().chain(whole).collect::<Vec<_>>().join(", and ");
    let mut about: Vec<&str> =
        told.iter().filter(|told| told.warns).map(|told| told.about.as_str()).collect();
    about.dedup();
    if about.is_empty() {
        let shown = if shown.is_empty() { "every stage did what was asked of it".to_owned() } else { shown };
        return format!("<p class='verdict'>✓ <b>Trust:</b> {}.</p>", escape(&shown));
    }
    let shown = if shown.is_empty() { shown } else { format!(" Apart from that {shown}.") };
    format!(
        "<p class='verdict'>▲ <b>Look at:</b> what is said below of {}, before the result is trusted.{}</p>",
        escape(&about.join(", ")),
        escape(&shown)
    )
}

/// What to know before the result is trusted.
struct Told {
    /// Which stages it is of.
    about: String,
    /// Which frame of several, after a comma.
    frame: String,
    /// What.
    text: String,
    /// Whether the result may not be what was meant.
    warns: bool,
}

/// What to know before the result is trusted. Specks of the lattice warn where they lie in what moves, and where nothing moves and the
/// lattice is all that there is; elsewhere they are noted.
fn told(
    records: &[StageRecord],
    specks_moved: Option<u64>,
    map: Option<&MapFigures>,
) -> Result<Vec<Told>, Error> {
    let has_frames = |stage: &str| records.iter().any(|r| r.stage == stage && r.variant.starts_with(FRAME));
    let remarks = records.iter().filter_map(|record| {
        // What a pixel shows was asked for.
        let warns = record.stage != ivd_render::STAGE.name;
        let frame = match &*record.variant {
            variant if variant.starts_with(FRAME) => format!(", {variant}"),
            // The picture before is of the body at rest.
            variant if variant != Picture::Before.name() && has_frames(&record.stage) => {
                ", last frame".to_owned()
            }
            _ => String::new(),
        };
        Some(Told { about: record.stage.clone(), frame, text: record.remark.clone()?, warns })
    });
    let mut told = joined(remarks);
    let cut = figures_of::<LatticeFigures>(records, extract::STAGE.name)?;
    let refined = figures_of::<RefineFigures>(records, refine::STAGE.name)?;
    // A corner of a voxel that is squeezed hides nothing.
    let is_plain = map.is_some_and(MapFigures::is_plain);
    told.iter_mut()
        .filter(|told| is_plain && told.about == ivd_map::STAGE.name)
        .for_each(|told| told.warns = false);
    // As coarse as it gets within an error that is kept: what was asked for.
    let is_kept = refined.as_ref().is_some_and(|found| found.within_mm.is_some());
    told.iter_mut()
        .filter(|told| is_kept && told.about == refine::STAGE.name)
        .for_each(|told| told.warns = false);
    told.extend(coarse(records, cut.as_ref(), refined.as_ref().filter(|_| !is_kept))?);
    let stopped = refined.filter(|found| found.last.reached.stopped_by == StopReason::Specks);
    let find = |told: &[Told], name: &str| told.iter().position(|told| told.about == name);
    let in_cut = find(&told, extract::STAGE.name).filter(|_| cut.is_some_and(|cut| cut.vertices > 0));
    let in_refined = find(&told, refine::STAGE.name).filter(|_| stopped.is_some());
    let Some(first) = in_cut.or(in_refined) else { return Ok(told) };
    let (apart, warns) = match specks_moved {
        Some(0) => ("; none of them lies where something moves", false),
        Some(1) => ("; one of them lies where something moves", true),
        Some(_) => ("; some of them lie where something moves", true),
        None => ("", true),
    };
    told[first].text += apart;
    told[first].warns = warns && (in_cut.is_some() || !is_kept);
    // Small parts that are told of are those that the refinement stops at: one thing to know, with one remedy.
    if let (Some(cut), Some(coarse)) = (in_cut, in_refined)
        && let Some(shortfall) = stopped.and_then(|found| found.shortfall())
    {
        let Told { about: stage, .. } = told.remove(coarse);
        let Told { about, text, .. } = &mut told[cut];
        *text = format!("{shortfall}; {text}");
        *about = format!("{about} and {stage}");
    }
    Ok(told)
}

/// What is told of several frames in the same words, but for numbers, is told of the first of them, with which others there are. What pixels of pictures show was
/// asked for of each.
fn joined(all: impl Iterator<Item = Told>) -> Vec<Told> {
    let words = |text: &str| text.replace(|c: char| c.is_ascii_digit() || ".,-[]e".contains(c), "");
    let mut told: Vec<(Told, Vec<String>)> = Vec::new();
    for next in all {
        let is_one = |told: &Told| told.warns && !told.frame.is_empty();
        let is_like = |told: &&mut (Told, Vec<String>)| {
            let told = &told.0;
            is_one(told)
                && is_one(&next)
                && told.about == next.about
                && words(&told.text) == words(&next.text)
        };
        match told.iter_mut().find(is_like) {
            Some((_, others)) => others.push(next.frame[2..].to_owned()),
            None => told.push((next, Vec::new())),
        }
    }
    let with_others = |(mut told, others): (Told, Vec<String>)| {
        if !others.is_empty() {
            let _ = write!(told.text, "; alike, with other numbers: {}", others.join(", "));
        }
        told
    };
    told.into_iter().map(with_others).collect()
}

/// A lattice that lies further from the surface as cut than a voxel's diagonal and this share of a part's radius is noted.
const COARSE: f64 = 0.125;

/// That the lattice is coarse for what it wraps.
fn coarse(
    records: &[StageRecord],
    cut: Option<&LatticeFigures>,
    refined: Option<&RefineFigures>,
) -> Result<Option<Told>, Error> {
    let scan = figures_of::<ImportFigures>(records, IMPORT)?;
    let (Some(cut), Some(seen), Some(scan)) = (cut, refined.and_then(|found| found.last.seen_error_mm), scan)
    else {
        return Ok(None);
    };
    if cut.area_mm2 <= 0.0 {
        return Ok(None);
    }
    let diagonal = scan.spacing.iter().map(|length| length * length).sum::<f64>().sqrt();
    // That of a ball.
    let radius = 3.0 * cut.volume_mm3.abs() / cut.area_mm2;
    let text = format!(
        "the lattice lies up to {} mm from the surface as cut, which is much for what it wraps: three times the volume over the area, the radius of a ball, is {} mm; a lower refine.level, \
         or a refine.max_error, keeps its shape",
        number(seen),
        number(radius)
    );
    let note = Told { about: refine::STAGE.name.to_owned(), frame: String::new(), text, warns: false };
    Ok(Some(note).filter(|_| seen > diagonal.max(COARSE * radius)))
}

/// The scene's sections as they were written, but for what is shown above and where files lie.
fn written(scene: &Scene) -> String {
    // Paths and series may carry a patient's name or number.
    let known = [
        "axes",
        "contrast",
        "frame",
        "noise",
        "phantom",
        "raw",
        "resample_slices",
        "seed",
        "size",
        "spacing",
        "type",
    ];
    // Or are shown above.
    let left_out = ["handle", "fix", "tag", "with"];
    let rows = scene.written.iter().filter(|(name, _)| !["schema", "output"].contains(&name.as_str()));
    let rows = rows.flat_map(|(section, keys)| {
        let keys = keys.as_object().into_iter().flatten();
        let is_shown =
            move |key: &str| if section == "input" { known.contains(&key) } else { !left_out.contains(&key) };
        keys.filter(move |(key, _)| is_shown(key))
            .map(move |(key, value)| [Cell::Text(format!("{section}.{key}")), Cell::Text(word(value))])
    });
    let rows: Vec<[Cell; 2]> = rows.collect();
    if rows.is_empty() {
        return String::new();
    }
    format!(
        "<details><summary>Settings as the scene has them</summary>{}</details>",
        table(["key", "value"], rows.into_iter())
    )
}

/// A value without its quotes.
fn word(value: &Json) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_is_told_of_one_frame_of_several_names_it() {
        let of = |stage: &str, variant: &str| -> StageRecord {
            let told = json!({
                "stage": stage, "variant": variant, "state": "ran", "why": "", "revision": 1, "backend": "cpu", "params": {}, "inputs": {},
                "output": null, "cached": false, "wall_s": 0.0, "cpu_s": null, "peak_rss_mb": null, "remark": "left behind", "metrics": {},
            });
            serde_json::from_value(told).unwrap()
        };
        let frames = |records: &[StageRecord]| -> Vec<String> {
            told(records, None, None).unwrap().into_iter().map(|told| told.about + &told.frame).collect()
        };
        assert_eq!(frames(&[of("deform", ""), of("map", "")]), ["deform", "map"]);
        let series = [of("deform", ""), of("map", ""), of("map", "frame 0"), of("map", "frame 1")];
        assert_eq!(frames(&series), ["deform", "map, last frame"]);
        let texts = told(&series, None, None).unwrap();
        assert_eq!(texts[1].text, "left behind; alike, with other numbers: frame 0, frame 1");
        // What is said in other words is told of each.
        let mut other = of("map", "frame 0");
        other.remark = Some("squeezed by 0.3".to_owned());
        assert_eq!(frames(&[of("map", ""), other]), ["map, last frame", "map, frame 0"]);
        let drawn = [of("render", "before"), of("render", "after"), of("render", "frame 0")];
        assert_eq!(frames(&drawn), ["render", "render, last frame", "render, frame 0"]);
    }
}
