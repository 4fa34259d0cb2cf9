use std::collections::BTreeMap;
use std::path::Path;

use super::header::Slice;
use super::syntax::printable;
use crate::volume::Error;

/// The slices of the chosen series; of the only one where nothing is chosen.
pub(super) fn choose(dir: &Path, slices: Vec<Slice>, wanted: Option<&str>) -> Result<Vec<Slice>, Error> {
    let mut series: BTreeMap<String, Vec<Slice>> = BTreeMap::new();
    for slice in slices {
        series.entry(slice.series_uid.clone()).or_default().push(slice);
    }
    if series.is_empty() {
        return Err(Error::choice(dir, "no DICOM image", "give the folder of an image series"));
    }
    let list = list(&series);
    let fitting: Vec<String> = match wanted {
        None => series.keys().cloned().collect(),
        Some(wanted) => matching(&series, wanted),
    };
    match fitting.as_slice() {
        [uid] => one_geometry(dir, series.remove(uid).expect("the UID is one of the map's")),
        [] => Err(Error::choice(
            dir,
            format!("no series is `{}`; there are: {list}", wanted.unwrap_or_default()),
            "choose one with --series",
        )),
        several => {
            let problem = format!("{} series fit: {list}", several.len());
            Err(Error::choice(
                dir,
                problem,
                "choose one with --series and its UID, the start of it, or its number",
            ))
        }
    }
}

/// UIDs that fit: the one that is equal, else those with that number, else those that start so.
fn matching(series: &BTreeMap<String, Vec<Slice>>, wanted: &str) -> Vec<String> {
    if series.contains_key(wanted) {
        return vec![wanted.to_owned()];
    }
    let pick = |fits: &dyn Fn(&str, &Slice) -> bool| -> Vec<String> {
        series.iter().filter(|(uid, slices)| fits(uid, &slices[0])).map(|(uid, _)| uid.clone()).collect()
    };
    let number = wanted.parse::<i64>().ok();
    let numbered = pick(&|_, slice| number.is_some() && slice.series_number == number);
    if numbered.is_empty() { pick(&|uid, _| uid.starts_with(wanted)) } else { numbered }
}

fn list(series: &BTreeMap<String, Vec<Slice>>) -> String {
    let lines: Vec<String> = series
        .iter()
        .map(|(uid, slices)| {
            let first = &slices[0];
            let number = first.series_number.map_or("without number".into(), |n| format!("number {n}"));
            let uid = if uid.is_empty() { "without UID".into() } else { printable(uid) };
            let modality: String =
                first.modality.chars().filter(char::is_ascii_alphanumeric).take(8).collect();
            format!(
                "{uid} ({number}, {modality}, `{}`, {} slices of {}×{})",
                first.description,
                slices.len(),
                first.columns,
                first.rows
            )
        })
        .collect();
    lines.join("; ")
}

/// Refuses a series whose images differ in size or orientation.
fn one_geometry(dir: &Path, slices: Vec<Slice>) -> Result<Vec<Slice>, Error> {
    let first = &slices[0];
    for slice in &slices[1..] {
        if (slice.rows, slice.columns) != (first.rows, first.columns) {
            let problem = format!(
                "the series holds images of {}×{} and of {}×{} pixels",
                first.columns, first.rows, slice.columns, slice.rows
            );
            return Err(Error::choice(dir, problem, "keep images of one size in the folder"));
        }
        if !same_direction(first.orientation, slice.orientation) {
            let problem = "the series holds images of several orientations";
            return Err(Error::choice(dir, problem, "keep images of one orientation in the folder"));
        }
        if !close(first.pixel_spacing, slice.pixel_spacing) {
            let problem = "PixelSpacing differs within the series";
            return Err(Error::choice(dir, problem, "keep images of one pixel size in the folder"));
        }
    }
    Ok(slices)
}

fn same_direction(a: Option<[[f64; 3]; 2]>, b: Option<[[f64; 3]; 2]>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.iter().flatten().zip(b.iter().flatten()).all(|(x, y)| (x - y).abs() < 1e-3),
        (None, None) => true,
        _ => false,
    }
}

fn close(a: Option<[f64; 2]>, b: Option<[f64; 2]>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.iter().zip(&b).all(|(x, y)| (x - y).abs() <= 1e-4 * x.abs()),
        (None, None) => true,
        _ => false,
    }
}
