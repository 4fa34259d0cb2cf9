use std::fmt::Write as _;

use ivd_report::html::{escape, number};

use super::{Drag, FrameBench, InteractiveBench};
use crate::page::STYLE;
use crate::plot::{Curve, curves};

/// Drags as a page of its own: a table, and processor time by frame for every solver.
pub fn interactive_page(bench: &InteractiveBench) -> String {
    let mut html = format!(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>A handle that is dragged</title>\
         <style>{STYLE}</style></head><body><h1>A handle that is dragged</h1>\
         <p>ivd {}, {} threads. {}, {:?} voxels. Radius {} mm, farthest {} mm, {} frames. Times of a frame are those of solving, mapping, \
         inverting and computing the voxels that changed, of all threads; placing the handle looks up what frames keep. The error is the \
         difference of the voxels' motion from level 0's, where the handle is farthest out, over all voxels that move.</p>\
         <table><tr><th>solver</th><th>level</th><th>vertices</th><th>voxels a frame</th><th>processor: median</th><th>99 %</th>\
         <th>first (ms)</th><th>wall: median</th><th>99 %</th><th>first (ms)</th><th>placing: processor</th><th>wall (ms)</th><th>error: rms</th><th>largest (voxels)</th>\
         <th>refused</th></tr>",
        escape(&bench.version),
        bench.threads,
        escape(&bench.input),
        bench.dims,
        number(bench.radius_mm),
        number(bench.farthest_mm),
        bench.drags.first().map_or(0, |drag| drag.frames.len()),
    );
    for drag in &bench.drags {
        let cells =
            [drag.cpu_ms, drag.wall_ms].concat().into_iter().chain(drag.placed_ms).chain(drag.error_voxel);
        let cells: String = cells.fold(String::new(), |mut all, v| {
            let _ = write!(all, "<td>{}</td>", number(v));
            all
        });
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td>{cells}<td>{}</td></tr>",
            escape(&drag.solver),
            drag.level,
            drag.vertices,
            drag.voxels,
            drag.refused
        );
    }
    html.push_str("</table>");
    let lines: Vec<Curve> = bench
        .drags
        .chunk_by(|a, b| a.solver == b.solver)
        .map(|drags: &[Drag]| Curve {
            name: drags[0].solver.clone(),
            points: drags.iter().map(|drag| [drag.cpu_ms[1], drag.error_voxel[0]]).collect(),
        })
        .collect();
    let _ = write!(
        html,
        "<h2>Error over time, by level</h2>{}",
        curves(
            &lines,
            "processor time of a frame, 99 of 100 (ms)",
            "difference from level 0, root mean square (voxels)"
        )
    );
    html.push_str(&pictures(&bench.frames));
    html.push_str("</body></html>\n");
    html
}

/// What the frame service took, as a table.
fn pictures(frames: &FrameBench) -> String {
    let [solve, map, values, pictures] = frames.parts_ms;
    let [middle, most, longest] = frames.picture_ms;
    let row = |what: &str, figures: &[f64]| {
        let figures: Vec<String> = figures.iter().copied().map(number).collect();
        format!("<tr><td>{what}</td><td>{}</td></tr>", figures.join(", "))
    };
    let loaded = frames.load.map_or_else(String::new, |load| format!(", load {} before", number(load)));
    let mut rows = vec![
        row(
            "from an event to the picture that shows it: median, 99 %, longest (ms)",
            &[middle, most, longest],
        ),
        row("processor time of an event (ms)", &[frames.cpu_ms]),
        row("lattice, map, values, pictures (ms)", &[solve, map, values, pictures]),
        row("placing the handle (ms)", &[frames.placed_ms]),
        row("whole picture after the last event (ms)", &[frames.whole_ms]),
        row("slices, volume, volume that follows hands, after the start (s)", &frames.opened_s),
        row("pictures with sides divided by 1, 2, 3, 4", &frames.divided.map(|n| n as f64)),
        row("events refused", &[frames.refused as f64]),
    ];
    if let Some(error) = frames.coarse_error {
        rows.push(row("a coarse picture from the whole one: root mean square, largest (of 255)", &error));
    }
    format!(
        "<h2>Through the frame service</h2><p>{}, {:?} voxels, {} vertices at level {}, {} threads{loaded}. A pane of {} × {} pixels and three slices; \
         {} events, each after the picture of the one before.</p><table>{}</table>",
        escape(&frames.input),
        frames.dims,
        frames.vertices,
        frames.level,
        frames.threads,
        frames.pane[0],
        frames.pane[1],
        frames.event_ms.len(),
        rows.concat()
    )
}
