use ivd_core::counted;
use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::geometry;
use super::header::Slice;
use super::syntax::printable;
use crate::volume::{Error, Offer, OfferedSeries};

/// The slices of the chosen series; of the only one where nothing is chosen.
pub(super) fn choose(dir: &Path, slices: Vec<Slice>, wanted: Option<&str>) -> Result<Vec<Slice>, Error> {
    let mut series = by_uid(slices);
    let fitting: Vec<String> = match wanted {
        None => series.keys().cloned().collect(),
        Some(wanted) => matching(&series, wanted),
    };
    match fitting.as_slice() {
        [uid] => one_geometry(dir, series.remove(uid).expect("the UID is one of the map's")),
        [] => Err(Error::choice(
            dir,
            format!("no series is `{}`; there are: {}", wanted.unwrap_or_default(), in_words(&series)),
            "choose one with --series",
        )
        .offering(Offer::Series { all: offered(&series), is_asked: true })),
        several => {
            let problem = format!("{} series fit: {}", several.len(), in_words(&series));
            Err(Error::choice(
                dir,
                problem,
                "choose one with --series and its UID, the start of it, or its number",
            )
            .offering(Offer::Series { all: offered(&series), is_asked: false }))
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

/// A series as it is listed, without anything that names its patient.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// What chooses it: its number where no other series has that, else its UID.
    pub series: String,
    /// SeriesInstanceUID.
    pub uid: String,
    /// SeriesNumber.
    pub number: Option<i64>,
    /// Modality, such as `CT`.
    pub modality: String,
    /// SeriesDescription in capitals, words that name the patient masked.
    pub description: String,
    /// Images.
    pub slices: usize,
    /// Columns and rows of an image.
    pub size: [usize; 2],
    /// Distance of columns, of rows and of slices (mm), each where it is known.
    pub spacing: [Option<f64>; 3],
    /// How far the distance of two slices is from the usual one at most (mm), where they aren't evenly spaced.
    pub uneven_mm: Option<f64>,
    /// What it is where it is no series of plain slices, and can't be read.
    pub unreadable: Option<&'static str>,
}

impl Series {
    fn of(uid: &str, slices: &[Slice], number_is_its_own: bool) -> Self {
        let first = &slices[0];
        let uid = printable(uid);
        let number = first.series_number;
        let [between, uneven_mm] = geometry::distances(slices).unwrap_or_default();
        let pixel = first.pixel_spacing;
        Self {
            series: number.filter(|_| number_is_its_own).map_or_else(|| uid.clone(), |n| n.to_string()),
            uid,
            number,
            modality: first.modality.chars().filter(char::is_ascii_alphanumeric).take(8).collect(),
            description: first.description.clone(),
            slices: slices.len(),
            size: [first.columns, first.rows],
            spacing: [pixel.map(|[_, x]| x), pixel.map(|[y, _]| y), between],
            uneven_mm,
            unreadable: first.kind.map(|kind| kind.what),
        }
    }
}

/// What the series of some slices are, in the order of their UIDs.
pub(super) fn list(slices: Vec<Slice>) -> Vec<Series> {
    listed(&by_uid(slices))
}

fn listed(series: &BTreeMap<String, Vec<Slice>>) -> Vec<Series> {
    let shared =
        |number: Option<i64>| series.values().filter(|slices| slices[0].series_number == number).count() > 1;
    series.iter().map(|(uid, slices)| Series::of(uid, slices, !shared(slices[0].series_number))).collect()
}

fn by_uid(slices: Vec<Slice>) -> BTreeMap<String, Vec<Slice>> {
    let mut series: BTreeMap<String, Vec<Slice>> = BTreeMap::new();
    for slice in slices {
        series.entry(slice.series_uid.clone()).or_default().push(slice);
    }
    series
}

fn in_words(series: &BTreeMap<String, Vec<Slice>>) -> String {
    let lines: Vec<String> = series
        .iter()
        .map(|(uid, slices)| {
            let series = Series::of(uid, slices, false);
            let uid = if series.uid.is_empty() { "without UID" } else { &series.uid };
            format!("{uid} ({})", told(&series))
        })
        .collect();
    lines.join("; ")
}

/// What a series is, but for its UID.
fn told(series: &Series) -> String {
    let Series { number, modality, description, slices, size: [columns, rows], .. } = series;
    let number = number.map_or("without number".into(), |n| format!("number {n}"));
    let slices = counted(*slices, "slice", "slices");
    format!("{number}, {modality}, `{description}`, {slices} of {columns}×{rows}")
}

/// All of them, each with what tells it from the others.
fn offered(series: &BTreeMap<String, Vec<Slice>>) -> Vec<OfferedSeries> {
    let all = listed(series);
    let is_like = |one: &Series, other: &Series| one.uid != other.uid && told(one) == told(other);
    let offer = |one: &Series| {
        let twin = all.iter().any(|other| is_like(one, other));
        let end: String = one.uid.chars().skip(one.uid.chars().count().saturating_sub(6)).collect();
        let which = if twin { format!(", UID … {end}") } else { String::new() };
        let unreadable = one.unreadable.map(|what| format!(": {what}, which can't be read"));
        let nameless = one.series.is_empty().then(|| ": without a UID or a number of its own".to_owned());
        let why_not = unreadable.or(nameless);
        OfferedSeries {
            series: one.series.clone(),
            slices: one.slices,
            is_readable: why_not.is_none(),
            told: format!("{}{which}{}", told(one), why_not.unwrap_or_default()),
        }
    };
    all.iter().map(offer).collect()
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
