//! Presets of ParaView: a list of them, of which the first with colours is taken.

use serde_json::{Value, json};

use super::points::{Point, Points, ascending, range};
use super::{Problem, number};

pub(super) fn write(points: &Points) -> Value {
    let colour: Vec<f64> = points.colour.iter().flat_map(|p| [p.x, p.y[0], p.y[1], p.y[2]]).collect();
    let opacity: Vec<f64> =
        points.opacity.iter().flat_map(|p| [p.x, p.y[0], p.midpoint, p.sharpness]).collect();
    json!([{
        "Name": format!("IVD, opacities over {} mm", points.reference_mm),
        "ColorSpace": "RGB",
        "NanColor": [0.0, 0.0, 0.0],
        "RGBPoints": colour,
        "Points": opacity,
        "ScalarOpacityUnitDistance": points.reference_mm,
    }])
}

/// The preset that is taken.
pub(super) fn preset(value: &Value) -> Option<&Value> {
    let has_colours = |preset: &&Value| preset.get("RGBPoints").is_some();
    value.as_array().map_or_else(|| Some(value).filter(has_colours), |all| all.iter().find(has_colours))
}

pub(super) fn read(value: &Value) -> Result<super::TransferFunction, Problem> {
    let preset = preset(value).ok_or_else(|| Problem::new("RGBPoints", "there are none"))?;
    let space = preset.get("ColorSpace").and_then(Value::as_str).unwrap_or("RGB");
    if space != "RGB" {
        let problem = format!("colours are mixed in {space}; those that are mixed in RGB are read");
        return Err(Problem::new("ColorSpace", problem));
    }
    let list = |name: &str| -> Result<Vec<f64>, Problem> {
        let Some(all) = preset.get(name).and_then(Value::as_array) else { return Ok(Vec::new()) };
        if all.len() % 4 != 0 {
            return Err(Problem::new(name, format!("{} numbers, which is no multiple of 4", all.len())));
        }
        all.iter().enumerate().map(|(i, v)| number(Some(v), &format!("{name}[{i}]"))).collect()
    };
    let colour = list("RGBPoints")?;
    let colour = colour.chunks_exact(4).map(|p| Point::linear(p[0], [p[1], p[2], p[3]])).collect();
    let colour = ascending(colour, "RGBPoints")?;
    let opacity = list("Points")?;
    let shaped = |p: &[f64]| Point { x: p[0], y: [p[1]], midpoint: p[2], sharpness: p[3] };
    let mut opacity: Vec<Point<1>> = opacity.chunks_exact(4).map(shaped).collect();
    if opacity.is_empty() {
        // A map of colours alone: ParaView's own default is a ramp.
        let [low, high] = range(&colour, &[]);
        opacity = vec![Point::linear(low, [0.0]), Point::linear(high, [1.0])];
    }
    let opacity = ascending(opacity, "Points")?;
    let reference_mm = preset.get("ScalarOpacityUnitDistance").and_then(Value::as_f64).unwrap_or(1.0);
    let range = range(&colour, &opacity);
    Points { colour, opacity, reference_mm, range }.transfer()
}
