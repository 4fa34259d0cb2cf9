//! How the classes were found, and what they are.

use ivd_report::html::number;
use ivd_report::{Cell, ClassDensity, Curve, Dendrogram, Leaf, curve, dendrogram, pairs, shortened_table};
use ivd_segment::{AnyFigures, ClassFigures, Figures};
use serde_json::Value;

use super::colours::class_colour;
use super::data::ReportData;
use crate::StageRecord;
use crate::stages::LabelsOfFigures;

/// How the classes were found, with the curves that their number was read from, and a table of them.
pub(super) fn segmentation(segment: &StageRecord, found: &Figures<AnyFigures>, data: &ReportData) -> String {
    let Figures { common, own } = found;
    let method =
        segment.params.get(ivd_segment::STAGE.selector).and_then(Value::as_str).unwrap_or("–").to_owned();
    let mut rows = vec![("method", method), ("classes", common.k.to_string())];
    rows.extend(own.proposed().map(|k| ("classes proposed", k.to_string())));
    rows.push(("iterations", common.iterations.to_string()));
    rows.push(("objective", number(common.objective)));
    rows.extend(own.regions().map(|regions| ("regions", regions.to_string())));
    let points: Vec<(f64, f64)> =
        own.criterion().into_iter().map(|(k, criterion)| (k as f64, criterion)).collect();
    let criterion = curve(&Curve {
        points: &points,
        x_label: "number of classes",
        y_label: "criterion (less is better)",
        chosen: Some(common.k as f64),
    });
    let tree = own.dendrogram().map_or_else(String::new, tree);
    pairs(&rows) + &criterion + &tree + &classes(&common.classes, data)
}

fn tree(found: &ivd_segment::Dendrogram) -> String {
    let leaf = |(rank, leaf): (usize, &ivd_segment::Leaf)| Leaf {
        mean: leaf.mean,
        voxels: leaf.voxels,
        colour: class_colour(rank, 0, None),
    };
    dendrogram(&Dendrogram {
        leaves: found.leaves.iter().enumerate().map(leaf).collect(),
        merges: &found.merges,
    })
}

/// Whether pictures show a class.
fn in_pictures(id: u16, data: &ReportData) -> &'static str {
    let entries = data.transfer.as_ref().map(ivd_core::TransferFunction::entries);
    match entries.and_then(|entries| entries.iter().find(|entry| entry.class == id)) {
        Some(entry) if entry.opacity > 0.0 => "shown",
        Some(_) => "clear",
        None => "–",
    }
}

fn classes(list: &[ClassFigures], data: &ReportData) -> String {
    let head = ["colour", "in pictures", "class", "mean", "sd", "voxels", "from", "to"];
    let row = |(rank, class): (usize, &ClassFigures)| {
        [
            Cell::Swatch(class_colour(rank, class.id, data.transfer.as_ref())),
            Cell::plain(in_pictures(class.id, data)),
            Cell::plain(class.id),
            Cell::number(class.mean),
            Cell::number(class.sd),
            Cell::plain(class.voxels),
            Cell::number_or_dash(class.lower),
            Cell::number_or_dash(class.upper),
        ]
    };
    shortened_table(head, list.iter().enumerate().map(row))
}

/// What labels of another program are, and a table of their classes; `are_alone`: the pictures show nothing else.
pub(super) fn labelled(found: &LabelsOfFigures, are_alone: bool, data: &ReportData) -> String {
    let mut rows = vec![
        ("found by", "another program".to_owned()),
        ("classes", found.classes.len().to_string()),
        ("voxels with a label", found.put.voxels_filled.to_string()),
        ("voxels of the scan outside of the file", found.put.voxels_without_source.to_string()),
        ("labelled voxels outside of the scan", found.put.voxels_left_out.to_string()),
    ];
    let clear = "clear in the pictures; render.unlabelled = true draws it by its values".to_owned();
    let is_any = found.put.dims.iter().product::<usize>() as u64 > found.put.voxels_filled;
    rows.extend((are_alone && is_any).then_some(("what has no label", clear)));
    pairs(&rows) + &classes(&found.classes, data)
}

/// The classes as the histogram draws them.
pub(super) fn class_densities(classes: &[ClassFigures], data: &ReportData) -> Vec<ClassDensity> {
    let density = |(rank, class): (usize, &ClassFigures)| ClassDensity {
        mean: class.mean,
        sd: class.sd,
        voxels: class.voxels,
        upper: class.upper,
        colour: class_colour(rank, class.id, data.transfer.as_ref()),
    };
    classes.iter().enumerate().map(density).collect()
}
