//! Places by the landmarks of other programs: `FILE.mrk.json#LABEL` where a point is expected.

use std::path::Path;

use ivd_io::landmarks::{self, Format};
use serde_json::{Value as Json, json};

use crate::Error;

/// The key that takes landmarks for its point.
const KEY: &str = "pick";

/// Says in the schema of lists whose elements have a point that a landmark may stand for it.
pub fn tell_landmarks(schema: &mut Json) {
    let point = schema.pointer_mut(&format!("/items/properties/{KEY}"));
    let Some(point) = point.filter(|point| point["items"]["type"] == "number") else { return };
    let about = point["description"].take();
    let named = json!({
        "type": "string",
        "pattern": "\\.(mrk\\.json|fcsv)(#.+)?$",
        "description": "A file of landmarks, FILE.mrk.json or FILE.fcsv; of one of them, FILE#LABEL.",
    });
    *point = json!({ "description": about, "anyOf": [point.take(), named] });
}

/// The points (mm, RAS) that `FILE` or `FILE#LABEL` names, where FILE ends as files of landmarks do; `None` where it isn't such a name.
///
/// - `folder`: what a relative path starts from.
///
/// # Errors
/// A file that can't be read, or doesn't have the label exactly once.
pub fn landmarks_at(text: &str, folder: &Path) -> Result<Option<Vec<[f64; 3]>>, Error> {
    let (file, label) = match text.split_once('#') {
        Some((file, label)) => (file.trim(), Some(label.trim())),
        None => (text.trim(), None),
    };
    if Format::of(Path::new(file)).is_none() {
        return Ok(None);
    }
    let path = folder.join(file);
    let found = landmarks::read(&path).map_err(Error::in_stage("landmarks"))?;
    let points = match label {
        Some(label) => {
            let point = found.named(label);
            vec![point.map_err(|e| Error::usage("landmarks", format!("{}: {e}", path.display())))?]
        }
        None => found.points.iter().collect(),
    };
    Ok(Some(points.into_iter().map(|point| point.position.0.into()).collect()))
}

/// `pick=FILE.mrk.json#LABEL;radius=5` with the point in its place; as often as the file has points, where no label is named.
///
/// # Errors
/// Those of [`landmarks_at`].
pub fn with_landmarks(text: &str, folder: &Path) -> Result<Vec<String>, Error> {
    let parts: Vec<&str> = text.split(';').collect();
    let is_pick = |part: &&str| {
        part.trim_start().strip_prefix(KEY).is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let Some(at) = parts.iter().position(is_pick) else { return Ok(vec![text.to_owned()]) };
    let Some((_, value)) = parts[at].split_once('=') else { return Ok(vec![text.to_owned()]) };
    let Some(points) = landmarks_at(value, folder)? else { return Ok(vec![text.to_owned()]) };
    let with = |[x, y, z]: [f64; 3]| {
        let point = format!("{KEY}={x},{y},{z}");
        parts
            .iter()
            .enumerate()
            .map(|(i, part)| if i == at { &*point } else { part })
            .collect::<Vec<_>>()
            .join(";")
    };
    Ok(points.into_iter().map(with).collect())
}

/// Puts points in the place of landmarks in a scene's sections; an element of a list with a whole file becomes as many elements.
///
/// # Errors
/// Those of [`landmarks_at`].
pub fn place_landmarks(values: &mut dyn Iterator<Item = &mut Json>, folder: &Path) -> Result<(), Error> {
    for value in values {
        match value {
            Json::Object(inner) => place_landmarks(&mut inner.values_mut(), folder)?,
            Json::Array(list) => {
                let mut placed = Vec::with_capacity(list.len());
                for element in std::mem::take(list) {
                    placed.extend(each_placed(element, folder)?);
                }
                *list = placed;
            }
            Json::Null | Json::Bool(_) | Json::Number(_) | Json::String(_) => {}
        }
    }
    Ok(())
}

/// An element of a list, as often as its pick names points.
fn each_placed(element: Json, folder: &Path) -> Result<Vec<Json>, Error> {
    let Json::Object(mut element) = element else { return Ok(vec![element]) };
    let named = element.get(KEY).and_then(Json::as_str).map(|text| landmarks_at(text, folder)).transpose()?;
    let Some(points) = named.flatten() else {
        place_landmarks(&mut element.values_mut(), folder)?;
        return Ok(vec![Json::Object(element)]);
    };
    let at = |point: [f64; 3]| {
        let mut placed = element.clone();
        placed.insert(KEY.to_owned(), json!(point));
        Json::Object(placed)
    };
    Ok(points.into_iter().map(at).collect())
}

#[cfg(test)]
mod tests {
    use serde_json::Map;

    use super::*;

    const POINTS: &str = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label\n\
        1,-10,-20,30,0,0,0,1,1,1,0,nose\n2,1.5,2.25,3,0,0,0,1,1,1,0,chin\n";

    #[test]
    fn the_schema_tells_of_landmarks_where_a_list_has_points() {
        let list = |pick: Json| json!({ "type": "array", "items": { "properties": { "pick": pick } } });
        let mut of_points =
            list(json!({ "description": "A point.", "type": "array", "items": { "type": "number" } }));
        tell_landmarks(&mut of_points);
        let pick = &of_points["items"]["properties"]["pick"];
        assert_eq!(pick["description"], "A point.");
        assert_eq!(pick["anyOf"][0]["items"]["type"], "number");
        assert_eq!(pick["anyOf"][1]["type"], "string");
        let mut of_words = list(json!({ "type": "string" }));
        let before = of_words.clone();
        tell_landmarks(&mut of_words);
        assert_eq!(of_words, before);
    }

    #[test]
    fn a_label_is_a_point_and_a_file_as_many_as_it_has() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("face.fcsv"), POINTS).unwrap();
        let texts = with_landmarks("pick=face.fcsv#nose;move=0,-5,0;radius=20", folder.path()).unwrap();
        assert_eq!(texts, ["pick=10,20,30;move=0,-5,0;radius=20"]);
        let texts = with_landmarks("radius=5;pick=face.fcsv", folder.path()).unwrap();
        assert_eq!(texts, ["radius=5;pick=10,20,30", "radius=5;pick=-1.5,-2.25,3"]);
        assert_eq!(with_landmarks("pick=1,2,3;radius=5", folder.path()).unwrap(), ["pick=1,2,3;radius=5"]);
        let mut scene = Map::from_iter([(
            "deform".to_owned(),
            json!({ "handle": [{ "pick": "face.fcsv#chin", "radius": 3 }], "fix": [{ "pick": "face.fcsv" }, { "pick": [1, 2, 3] }] }),
        )]);
        place_landmarks(&mut scene.values_mut(), folder.path()).unwrap();
        assert_eq!(
            scene["deform"],
            json!({
                "handle": [{ "pick": [-1.5, -2.25, 3.0], "radius": 3 }],
                "fix": [{ "pick": [10.0, 20.0, 30.0] }, { "pick": [-1.5, -2.25, 3.0] }, { "pick": [1, 2, 3] }],
            })
        );
        let error = with_landmarks("pick=face.fcsv#ear", folder.path()).unwrap_err().to_string();
        assert!(error.contains("ear") && error.contains("nose"), "{error}");
    }
}
