use std::fmt::Write as _;

use ivd_core::Image;
use ivd_pipeline::{Error, png_bytes};
use ivd_report::html::{escape, number, png_url};

use super::LEVELS;
use super::pictures::{COLOURS, SCALE};
use super::results::{Claim, LatticeBench, Reach, RefinementBench};
use super::rows::{CREASE_DEGREES, RefinementRow, Shape, ended};
use crate::page::STYLE;

const OWN_STYLE: &str = "
body { max-width: 88rem } h3 { font-size: 1rem; margin: 1.5rem 0 .3rem }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); gap: .8rem; margin: .6rem 0 }
figure { margin: 0; border: 1px solid #e4e8ee; padding: .4rem }
.row { display: flex; flex-wrap: wrap; justify-content: center } .row img { flex: 0 1 240px; min-width: 10rem; max-width: 240px }
figcaption { font-size: 12px } .wide { overflow-x: auto } .legend { display: flex; align-items: center; gap: .5rem; font-size: 12px }
.bar { width: 14rem; height: .8rem; border: 1px solid #e4e8ee }
tr.break td { border-top: 2px solid #9aa5b4 } dt { font-weight: 600; margin-top: .6rem } dd { margin: 0 0 0 1rem; max-width: 60rem }
";

/// Refinements by every method, as a page of its own with all pictures in it.
///
/// # Errors
/// A picture that can't be shown.
pub fn refinements_page(bench: &RefinementBench) -> Result<String, Error> {
    let mut html = format!(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Refinement by every method</title>\
         <style>{STYLE}{OWN_STYLE}</style></head><body><h1>Refinement by every method</h1>\
         <p>ivd {}, {} threads, median of {} runs. Every method works with its defaults, and every result is a subset of the lattice's \
         vertices. Pictures: lit; as a wire-frame; coloured by the distance from the lattice. The bound is what the result carries; \
         largest and mean distance are measured over both surfaces. Creases are edges where the lattice turns by more than \
         {CREASE_DEGREES} degrees; told is how far their vertices are from the result on average.</p>{}",
        escape(&bench.version),
        bench.threads,
        bench.repeats,
        legend()
    );
    for lattice in &bench.lattices {
        lattice_part(&mut html, lattice)?;
    }
    html.push_str("</body></html>\n");
    Ok(html)
}

fn lattice_part(html: &mut String, bench: &LatticeBench) -> Result<(), Error> {
    let _ = write!(
        html,
        "<h2>{}</h2><p>{}. Voxels of {} mm, {} vertices on creases.</p><h3>What the thesis says, and what was found</h3>{}",
        escape(&bench.input),
        escape(&topology(&bench.shape)),
        number(bench.voxel_mm),
        bench.crease_vertices,
        claims(&bench.claims)
    );
    html.push_str("<h3>The same shares of the triangles (figures 5.6 to 5.9)</h3>");
    for group in bench.shares.chunk_by(|a, b| a.asked == b.asked) {
        html.push_str(&cards(group)?);
    }
    html.push_str(&table(&bench.shares, bench));
    html.push_str("<h3>The same counts as the inverse subdivision's levels (table 5.1)</h3>");
    for group in bench.same_counts.chunk_by(|a, b| a.asked == b.asked) {
        html.push_str(&cards(group)?);
    }
    html.push_str(&table(&bench.same_counts, bench));
    let _ = write!(html, "<h3>How far they go: vertices by level (table 5.2)</h3>{}", reach(&bench.reach));
    html.push_str("<h3>Levels of the default, each from the one before (figure 5.10)</h3>");
    html.push_str(&cards(&bench.levels)?);
    html.push_str(&table(&bench.levels, bench));
    Ok(())
}

fn topology(shape: &Shape) -> String {
    let genus = shape.genus.map_or_else(|| "no manifold".to_owned(), |g| format!("genus {g}"));
    let parts = if shape.components == 1 { "part" } else { "parts" };
    format!("Euler characteristic {}, {genus}, {} {parts}", shape.euler, shape.components)
}

fn legend() -> String {
    let stops: Vec<String> = COLOURS.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
    format!(
        "<div class='legend'><span>{} voxel or less</span><div class='bar' style='background:linear-gradient(to right,{})'></div>\
         <span>{} voxels or more, by the logarithm</span></div>",
        SCALE[0],
        stops.join(","),
        SCALE[1]
    )
}

fn claims(claims: &[Claim]) -> String {
    let mut html = String::from("<dl>");
    for claim in claims {
        let _ = write!(
            html,
            "<dt>{} ({}): {}.</dt><dd>{}</dd>",
            escape(&claim.says),
            escape(&claim.section),
            claim.verdict(),
            escape(&claim.found)
        );
    }
    html + "</dl>"
}

fn cards(rows: &[RefinementRow]) -> Result<String, Error> {
    let mut html = String::from("<div class='cards'>");
    for row in rows {
        let [lit, coloured, wires] = &row.pictures;
        let _ = write!(
            html,
            "<figure><div class='row'>{}{}{}</div><figcaption><b>{}</b>, {}: {} vertices, largest distance {} mm, mean {} mm</figcaption></figure>",
            picture(lit, "lit")?,
            picture(wires, "wire-frame")?,
            picture(coloured, "distance from the lattice")?,
            row.method,
            escape(&row.asked),
            row.vertices,
            number(row.max_mm),
            number(row.mean_mm)
        );
    }
    Ok(html + "</div>")
}

fn picture(image: &Image, words: &str) -> Result<String, Error> {
    Ok(format!("<img src='{}' alt='{words}'>", png_url(&png_bytes(image)?)))
}

fn table(rows: &[RefinementRow], bench: &LatticeBench) -> String {
    let mut html = String::from(
        "<div class='wide'><table><tr><th>asked for</th><th>method</th><th>vertices</th><th>triangles</th><th>share</th>\
         <th>bound (mm)</th><th>largest (mm)</th><th>mean (mm)</th><th>creases (mm)</th><th>Euler, genus, parts</th><th>time (ms)</th>\
         <th>ended by</th></tr>",
    );
    let mut last = "";
    for row in rows {
        let first = last != row.asked;
        last = &row.asked;
        let Shape { euler, genus, components } = &row.shape;
        let genus = genus.map_or_else(|| "–".to_owned(), |g| g.to_string());
        let changed = if row.shape.is_as(&bench.shape) { "" } else { " (changed)" };
        let _ = write!(
            html,
            "<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{} %</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
             <td>{euler}, {genus}, {components}{changed}</td><td>{}</td><td>{}</td></tr>",
            if first { " class='break'" } else { "" },
            escape(&row.asked),
            row.method,
            row.vertices,
            row.triangles,
            number(100.0 * row.ratio),
            number(row.bound_mm),
            number(row.max_mm),
            number(row.mean_mm),
            number(row.crease_mm),
            number(1e3 * row.seconds),
            ended(row.stopped_by)
        );
    }
    html + "</table></div>"
}

fn reach(all: &[Reach]) -> String {
    let mut html = String::from("<table><tr><th>level</th>");
    for method in all {
        let _ = write!(html, "<th>{}</th>", method.method);
    }
    html.push_str("</tr>");
    for (i, level) in LEVELS.iter().enumerate() {
        let _ = write!(html, "<tr><td>{level}</td>");
        for method in all {
            let vertices = method.levels[i].map_or_else(|| "–".to_owned(), |v| v.to_string());
            let _ = write!(html, "<td>{vertices}</td>");
        }
        html.push_str("</tr>");
    }
    html.push_str("<tr><td>fewest</td>");
    for method in all {
        let changed = if method.same_topology { "" } else { ", changed" };
        let _ = write!(html, "<td>{} ({}{changed})</td>", method.least, ended(method.stopped_by));
    }
    html + "</tr></table>"
}
