use std::fmt::Write as _;

use ivd_report::html::{escape, number};

use super::{ScalePoint, SceneBench, SkipRow};
use crate::page::STYLE;
use crate::plot::{Curve, curves};

/// What scenes skip and how they grow, as a page of its own.
pub fn scenes_page(bench: &SceneBench) -> String {
    let mut html = format!(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>What scenes skip and how they grow</title>\
         <style>{STYLE}</style></head><body><h1>What scenes skip and how they grow</h1>\
         <p>ivd {}, {} threads.</p>",
        escape(&bench.version),
        bench.threads
    );
    let _ = write!(
        html,
        "<h2>Skipping</h2><p>A noisy head of {0}³ voxels. Voxels looked at are summed over the stages that ran (a picture's are its \
         samples); the least is what the outputs need. The last columns are with every skip and the cache off.</p>{1}",
        bench.size,
        skip_table(&bench.skipping)
    );
    let _ = write!(
        html,
        "<h2>Growth</h2><p>A cheek of a head of 128 mm without noise is pushed in by 3 mm, on finer and finer grids: from the file to the deformed \
         volume with nothing cached, and again after the handle moved.</p>{}{}{}{}",
        growth(&bench.scaling, "processor time (s)", |p| [p.whole.cpu_s.median, p.moved.cpu_s.median]),
        growth(&bench.scaling, "processor time per voxel looked at (ns)", |p| {
            [1e9 * p.whole.cpu_s.median / p.whole.visited, 1e9 * p.moved.cpu_s.median / p.moved.visited]
        }),
        growth(&bench.scaling, "peak memory (MiB)", |p| {
            [p.whole.peak_rss_mb.unwrap_or(f64::NAN), p.moved.peak_rss_mb.unwrap_or(f64::NAN)]
        }),
        scale_table(&bench.scaling)
    );
    html.push_str("</body></html>\n");
    html
}

/// A plot over the number of voxels: the whole scene, and the moved handle.
fn growth(points: &[ScalePoint], y: &str, of: impl Fn(&ScalePoint) -> [f64; 2]) -> String {
    let curve = |name: &str, which: usize| Curve {
        name: name.to_owned(),
        points: points.iter().map(|p| [(p.size as f64).powi(3), of(p)[which]]).collect(),
    };
    curves(&[curve("whole scene", 0), curve("moved handle", 1)], "voxels of the volume", y)
}

fn skip_table(rows: &[SkipRow]) -> String {
    let mut html = String::from(
        "<table><tr><th>scene</th><th>stages run</th><th>looked at</th><th>least</th><th>bytes read</th><th>processor (ms)</th>\
         <th>looked at, no skip</th><th>processor (ms), no skip</th><th>same result</th></tr>",
    );
    for row in rows {
        let _ = write!(
            html,
            "<tr><td>{}</td><td title='{}'>{} of {}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&row.scene),
            escape(&row.ran.join(", ")),
            row.ran.len(),
            row.stages,
            number(row.visited),
            number(row.least),
            row.bytes_read,
            number(1e3 * row.cpu_s),
            number(row.visited_plain),
            number(1e3 * row.cpu_plain_s),
            if row.same { "yes" } else { "NO" }
        );
    }
    html + "</table>"
}

fn scale_table(points: &[ScalePoint]) -> String {
    let mut html = String::from(
        "<table><tr><th>voxels</th><th>wall (s)</th><th>processor (s)</th><th>looked at</th><th>peak (MiB)</th><th>moved: processor (s)</th>\
         <th>voxels moved</th><th>per moved voxel (ns)</th><th>bytes of the volume read</th></tr>",
    );
    for p in points {
        let _ = write!(
            html,
            "<tr><td>{}³</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            p.size,
            number(p.whole.wall_s.median),
            number(p.whole.cpu_s.median),
            number(p.whole.visited),
            p.whole.peak_rss_mb.map_or_else(|| "–".to_owned(), |v| format!("{v:.0}")),
            number(p.moved.cpu_s.median),
            number(p.voxels_moved),
            number(1e9 * p.moved.cpu_s.median / p.voxels_moved),
            p.volume_bytes_read
        );
    }
    html + "</table>"
}
