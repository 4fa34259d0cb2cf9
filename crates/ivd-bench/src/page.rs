//! The bench as one self-contained page: a plot of time against error for each stage, and the points in a table.

use std::fmt::Write as _;

use ivd_report::html::{escape, number};

use crate::plot::{AREA, Axis, BOTTOM, LEFT, TOP, axes};
use crate::record::{Bench, Point, StageBench};

/// Where a point without error stands, below the least error there is.
const BELOW: f64 = 0.3;

pub(crate) const STYLE: &str = "
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2430; background: #fff; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.6rem } h2 { font-size: 1.2rem; margin-top: 2.5rem } p { max-width: 46rem }
svg { width: 100%; max-width: 46rem; height: auto } .axis { stroke: #55606e } .grid { stroke: #e4e8ee }
.small { font-size: 11px; fill: #3a4452 } .label { font-size: 13px; fill: #1c2430 } .label.front { fill: #0b6fb8 } .label.other { fill: #c2410c }
.point { fill: #9aa5b4 } .front { fill: #0b6fb8 } .default { fill: none; stroke: #c2410c; stroke-width: 2.5 }
.other { fill: #c2410c } .other-line { stroke: #c2410c !important }
.line { fill: none; stroke: #0b6fb8; stroke-width: 1.5; opacity: .6 }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px }
td, th { padding: .15rem .6rem; text-align: right; border-bottom: 1px solid #e4e8ee } td:first-child, th:first-child { text-align: left }
tr.is-default { background: #fff3ea } tr.is-front td:first-child { font-weight: 600 }
";

/// The page.
pub fn page(bench: &Bench) -> String {
    let mut html = format!(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Run time against error</title>\
         <style>{STYLE}</style></head><body><h1>Run time against error</h1>\
         <p>ivd {}, {} threads, every setting run {} times in turn with the others after a first run that doesn't count. Processor time is \
         that of all threads, medians; whiskers reach from the shortest to the longest. Blue points are on the front: nothing is as good in \
         both and better in one. Orange rings are the defaults.</p>",
        escape(&bench.version),
        bench.threads,
        bench.repeats
    );
    for stage in &bench.stages {
        let _ = write!(
            html,
            "<h2>{}</h2><p>{}. Error: {} ({}), against {}.</p>{}{}",
            escape(&stage.stage),
            escape(&stage.input),
            escape(&stage.measure),
            escape(&stage.unit),
            escape(&stage.truth),
            plot(stage),
            rows(stage)
        );
    }
    html.push_str("</body></html>\n");
    html
}

fn plot(stage: &StageBench) -> String {
    let times = stage.points.iter().flat_map(|p| [p.cpu_s.least, p.cpu_s.most]).map(|s| 1e3 * s);
    let x = Axis::new(times, AREA[0]);
    let least = stage.points.iter().map(|p| p.error).filter(|&e| e > 0.0).fold(f64::INFINITY, f64::min);
    let shown = |point: &Point| if point.error > 0.0 { point.error } else { BELOW * least.min(1e300) };
    let y = Axis::new(stage.points.iter().map(shown).filter(|e| e.is_finite()), AREA[1]);
    let place = |point: &Point| {
        [LEFT + x.at(1e3 * point.cpu_s.median), TOP + AREA[1] - y.at(shown(point).clamp(y.low, y.high))]
    };
    let mut svg = format!(
        "<svg viewBox='0 0 {} {}' role='img' aria-label='time against error of {}'>",
        LEFT + AREA[0] + 12.0,
        TOP + AREA[1] + BOTTOM,
        escape(&stage.stage)
    );
    axes(&mut svg, &x, &y, "processor time (ms)", &format!("error ({})", stage.unit));
    for task in tasks(stage) {
        let mut front: Vec<[f64; 2]> =
            stage.points.iter().filter(|p| p.on_front && p.task == task).map(place).collect();
        front.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let corners: Vec<String> = front.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = write!(svg, "<polyline class='line' points='{}'/>", corners.join(" "));
    }
    for point in &stage.points {
        let [px, py] = place(point);
        let class = if point.on_front { "front" } else { "point" };
        let _ = write!(
            svg,
            "<line class='axis' x1='{:.1}' x2='{:.1}' y1='{py:.1}' y2='{py:.1}'/>\
             <circle class='{class}' cx='{px:.1}' cy='{py:.1}' r='4.5'><title>{}: {} ms, {} {}</title></circle>",
            LEFT + x.at(1e3 * point.cpu_s.least),
            LEFT + x.at(1e3 * point.cpu_s.most),
            escape(&point.label()),
            number(1e3 * point.cpu_s.median),
            number(point.error),
            escape(&stage.unit)
        );
        if point.default {
            let _ = write!(svg, "<circle class='default' cx='{px:.1}' cy='{py:.1}' r='8'/>");
        }
    }
    svg.push_str("</svg>");
    svg
}

fn rows(stage: &StageBench) -> String {
    let mut html = String::from(
        "<table><tr><th>setting</th><th>wall (ms)</th><th>processor (ms)</th><th>peak (MiB)</th><th>error</th><th>work</th></tr>",
    );
    for point in &stage.points {
        let mut class = Vec::new();
        class.extend(point.default.then_some("is-default"));
        class.extend(point.on_front.then_some("is-front"));
        let work: Vec<String> = point.counters.iter().map(|(n, v)| format!("{n} {}", number(*v))).collect();
        let _ = write!(
            html,
            "<tr class='{}'><td>{}{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            class.join(" "),
            escape(&point.label()),
            if point.default { " (default)" } else { "" },
            number(1e3 * point.wall_s.median),
            number(1e3 * point.cpu_s.median),
            point.peak_rss_mb.map_or_else(|| "–".to_owned(), |v| format!("{v:.0}")),
            number(point.error),
            escape(&work.join(", "))
        );
    }
    html.push_str("</table>");
    html
}

fn tasks(stage: &StageBench) -> Vec<String> {
    let mut tasks: Vec<String> = stage.points.iter().map(|p| p.task.clone()).collect();
    tasks.sort();
    tasks.dedup();
    tasks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::{point, stage};

    #[test]
    fn a_page_draws_every_point_marks_defaults_and_names_units() {
        let points = vec![point("1", 1.0, 0.5), point("2", 0.5, 1.0), point("3", 2.0, 0.0)];
        let bench =
            Bench { schema: 1, version: "0".to_owned(), threads: 2, repeats: 3, stages: vec![stage(points)] };
        let html = page(&bench);
        assert_eq!(html.matches("r='4.5'").count(), 3);
        assert_eq!(html.matches("class='default'").count(), 1);
        assert!(html.contains("processor time (ms)") && html.contains("error (of 1)"));
        assert!(!html.contains("NaN") && !html.contains("http"), "finite and self-contained");
    }
}
