//! The report's tables.

use std::fmt::Write as _;

use ivd_field::class_volume::ClassVolume;
use ivd_motion::deform::Figures;
use ivd_segment::ClassFigures;
use serde::Serialize;
use serde_json::Value;

use super::slices::class_colour;
use crate::html::{escape, number};
use crate::runner::{StageRecord, State};

/// Longer tables aren't read.
const MOST_CLASSES: usize = 100;

/// A table of names and values.
pub(super) fn pairs(rows: &[(&str, String)]) -> String {
    let mut html = String::from("<table>");
    for (name, value) in rows {
        let _ = write!(html, "<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(value));
    }
    html + "</table>"
}

/// A figure as text; a dash where there is none.
pub(super) fn shown(figure: impl Serialize) -> String {
    match serde_json::to_value(figure) {
        Ok(Value::Number(n)) => {
            n.as_u64().map_or_else(|| number(n.as_f64().unwrap_or(f64::NAN)), |u| u.to_string())
        }
        Ok(Value::Null) | Err(_) => "–".to_owned(),
        Ok(Value::String(s)) => s,
        Ok(other) => other.to_string(),
    }
}

/// The classes of a segmentation.
pub(super) fn classes(list: &[ClassFigures], colour: &dyn Fn(f64) -> String) -> String {
    let mut html = String::from(
        "<table><tr><th>in slices</th><th>in pictures</th><th>class</th><th>mean</th><th>sd</th><th>voxels</th><th>from</th><th>to</th></tr>",
    );
    for (rank, class) in list.iter().enumerate().take(MOST_CLASSES) {
        let real = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), number);
        let _ = write!(
            html,
            "<tr><td><span class='swatch' style='background:{}'></span></td><td><span class='swatch' style='background:{}'></span></td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            class_colour(rank),
            colour(class.mean),
            class.id,
            number(class.mean),
            number(class.sd),
            class.voxels,
            real(class.lower),
            real(class.upper),
        );
    }
    let more = list.len().saturating_sub(MOST_CLASSES);
    html += "</table>";
    if more > 0 { html + &format!("<p>and {more} more</p>") } else { html }
}

/// What every stage did, how long it took and why.
pub(super) fn stages(records: &[StageRecord]) -> String {
    let mut html = String::from(
        "<table><tr><th>stage</th><th>state</th><th>wall [s]</th><th>processor [s]</th><th>peak memory [MiB]</th><th>why</th></tr>",
    );
    for record in records {
        let (state, time) = match record.state {
            State::Ran => ("ran", true),
            State::Cached => ("cached", true),
            State::NotNeeded => ("not needed", false),
            State::Planned => ("planned", false),
        };
        let seconds =
            |value: Option<f64>| value.filter(|_| time).map_or_else(|| "–".to_owned(), |v| format!("{v:.3}"));
        let memory =
            record.peak_rss_mb.filter(|_| time).map_or_else(|| "–".to_owned(), |v| format!("{v:.0}"));
        let _ = write!(
            html,
            "<tr><td>{} {}</td><td>{state}</td><td>{}</td><td>{}</td><td>{memory}</td><td>{}</td></tr>",
            escape(&record.stage),
            escape(&record.variant),
            seconds(Some(record.wall_s)),
            seconds(record.cpu_s),
            escape(&record.why),
        );
    }
    html + "</table>"
}

/// What bones have done; nothing where there is none.
pub(super) fn bones(deform: Option<Figures>) -> String {
    let springs = deform.and_then(|found| found.springs);
    let Some(list) = springs.map(|springs| springs.bones).filter(|list| !list.is_empty()) else {
        return String::new();
    };
    let mut html = String::from(
        "<table><tr><th>bone</th><th>vertices</th><th>turned by [°]</th><th>about</th><th>its middle went by [mm]</th><th>its handles are left [mm]</th><th>held with [mN]</th></tr>",
    );
    for bone in list.iter().take(MOST_CLASSES) {
        let vector = |parts: [f64; 3]| parts.map(number).join(", ");
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&bone.name),
            bone.vertices,
            number(bone.angle_deg),
            vector(bone.axis),
            vector(bone.shift_mm),
            bone.left_mm.map_or_else(|| "–".to_owned(), number),
            vector(bone.force_mn),
        );
    }
    let more = list.len().saturating_sub(MOST_CLASSES);
    html += "</table>";
    if more > 0 { html + &format!("<p>and {more} more</p>") } else { html }
}

/// What the classes gain or lose; nothing where none does.
pub(super) fn class_volumes(volumes: &[ClassVolume]) -> String {
    if volumes.iter().all(|v| v.change_mm3 == 0.0) {
        return String::new();
    }
    let mut html = String::from(
        "<table><tr><th>class</th><th>volume at rest [mm³]</th><th>change [mm³]</th><th>change [%]</th></tr>",
    );
    for volume in volumes.iter().filter(|v| v.change_mm3 != 0.0).take(MOST_CLASSES) {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:+.4}</td></tr>",
            volume.class,
            number(volume.rest_mm3),
            number(volume.change_mm3),
            100.0 * volume.change_mm3 / volume.rest_mm3,
        );
    }
    html + "</table>"
}
