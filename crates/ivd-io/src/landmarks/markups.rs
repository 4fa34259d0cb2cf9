//! Markups of 3D Slicer, by its schemas 1.0.0 to 1.0.4.

use serde_json::Value;

use super::{Landmarks, Problem, space};
use crate::Space;

pub(super) fn read(bytes: &[u8]) -> Result<Landmarks, Problem> {
    let file: Value = serde_json::from_slice(bytes)
        .map_err(|error| Problem::new(format!("line {}", error.line()), format!("no JSON: {error}")))?;
    let Some(markups) = file.get("markups").and_then(Value::as_array) else {
        let problem = Problem::new("markups", "the list is missing");
        return Err(problem.with_remedy("give markups of 3D Slicer, a .mrk.json file"));
    };
    let mut landmarks = Landmarks::default();
    for (i, markup) in markups.iter().enumerate() {
        add(&mut landmarks, markup, &format!("markups[{i}]"))?;
    }
    Ok(landmarks)
}

fn add(landmarks: &mut Landmarks, markup: &Value, place: &str) -> Result<(), Problem> {
    let system = coordinate_system(markup.get("coordinateSystem"), &format!("{place}.coordinateSystem"))?;
    let unit_mm = unit(markup.get("coordinateUnits"), &format!("{place}.coordinateUnits"))?;
    let points = match markup.get("controlPoints") {
        None | Some(Value::Null) => return Ok(()),
        Some(Value::Array(points)) => points,
        Some(_) => return Err(Problem::new(format!("{place}.controlPoints"), "not a list")),
    };
    for (i, point) in points.iter().enumerate() {
        let place = format!("{place}.controlPoints[{i}]");
        match position(point, &place)? {
            None => landmarks.unplaced += 1,
            Some(position) => {
                let label = point.get("label").and_then(Value::as_str).unwrap_or_default().to_owned();
                landmarks.add(&place, label, position, (system, unit_mm))?;
            }
        }
    }
    Ok(())
}

/// LPS where nothing is said, as the schema has it.
fn coordinate_system(value: Option<&Value>, place: &str) -> Result<Space, Problem> {
    match value {
        None | Some(Value::Null) => Ok(Space::Lps),
        Some(Value::String(word)) => space(word, place),
        Some(other) => space(&other.to_string(), place),
    }
}

/// Millimetres in a unit: a word, or a code of DICOM whose first item is one.
fn unit(value: Option<&Value>, place: &str) -> Result<f64, Problem> {
    let word = match value {
        None | Some(Value::Null) => return Ok(1.0),
        Some(Value::Array(code)) => code.first(),
        one => one,
    };
    match word.and_then(Value::as_str) {
        Some("mm") => Ok(1.0),
        Some("um") => Ok(1e-3),
        _ => Err(Problem::new(place, "the unit is neither mm nor um").with_remedy("save the points in mm")),
    }
}

/// Where a point is; `None` of one that isn't placed.
fn position(point: &Value, place: &str) -> Result<Option<[f64; 3]>, Problem> {
    match point.get("positionStatus") {
        None | Some(Value::Null) => {}
        Some(status) => match status.as_str() {
            Some("defined") => {}
            Some("undefined" | "preview" | "missing") => return Ok(None),
            _ => return Err(Problem::new(format!("{place}.positionStatus"), "not a status of 3D Slicer")),
        },
    }
    let position = match point.get("position") {
        None | Some(Value::Null) => return Ok(None),
        Some(position) => position,
    };
    let place = format!("{place}.position");
    let Some([x, y, z]) = position.as_array().map(Vec::as_slice) else {
        return Err(Problem::new(place, "not three numbers"));
    };
    match [x, y, z].map(Value::as_f64) {
        [Some(x), Some(y), Some(z)] => Ok(Some([x, y, z])),
        _ => Err(Problem::new(place, "not three numbers")),
    }
}
