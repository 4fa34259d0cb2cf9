//! Volume properties of 3D Slicer.

use serde_json::{Value, json};

use super::points::{Point, Points, ascending, range};
use super::{Problem, number};

const SCHEMA: &str = "https://raw.githubusercontent.com/Slicer/Slicer/main/Modules/Loadable/VolumeRendering/Resources/Schema/volume-property-schema-v1.0.0.json#";

pub(super) fn write(points: &Points) -> Value {
    let colour: Vec<Value> = points
        .colour
        .iter()
        .map(|p| json!({ "x": p.x, "color": p.y, "midpoint": p.midpoint, "sharpness": p.sharpness }))
        .collect();
    let opacity: Vec<Value> = points
        .opacity
        .iter()
        .map(|p| json!({ "x": p.x, "y": p.y[0], "midpoint": p.midpoint, "sharpness": p.sharpness }))
        .collect();
    let everywhere = json!({ "points": [{ "x": 0.0, "y": 1.0, "midpoint": 0.5, "sharpness": 0.0 }] });
    json!({
        "@schema": SCHEMA,
        "volumeProperties": [{
            "effectiveRange": points.range,
            "interpolationType": "linear",
            "components": [{
                "componentWeight": 1.0,
                "shade": true,
                "lighting": { "ambient": 0.2, "diffuse": 0.8, "specular": 0.1, "specularPower": 10.0 },
                "scalarOpacityUnitDistance": points.reference_mm,
                "scalarOpacity": { "points": opacity },
                "gradientOpacity": everywhere,
                "rgbTransferFunction": { "points": colour },
            }],
        }],
    })
}

pub(super) fn read(value: &Value) -> Result<super::TransferFunction, Problem> {
    let property = value.pointer("/volumeProperties/0");
    let property = property.ok_or_else(|| Problem::new("volumeProperties", "it is empty"))?;
    let component = property.pointer("/components/0");
    let component = component.ok_or_else(|| Problem::new("volumeProperties[0].components", "it is empty"))?;
    let list = |name: &str| {
        let points = component.pointer(&format!("/{name}/points")).and_then(Value::as_array);
        points.ok_or_else(|| Problem::new(name, "it has no points"))
    };
    let colour = list("rgbTransferFunction")?.iter().enumerate().map(|(i, point)| {
        let place = format!("rgbTransferFunction.points[{i}]");
        let component = |c: usize| number(point.pointer(&format!("/color/{c}")), &place);
        shaped(point, &place, [component(0)?, component(1)?, component(2)?])
    });
    let opacity = list("scalarOpacity")?.iter().enumerate().map(|(i, point)| {
        let place = format!("scalarOpacity.points[{i}]");
        shaped(point, &place, [number(point.get("y"), &place)?])
    });
    let colour = ascending(colour.collect::<Result<_, _>>()?, "rgbTransferFunction")?;
    let opacity = ascending(opacity.collect::<Result<_, _>>()?, "scalarOpacity")?;
    let reference_mm = component.get("scalarOpacityUnitDistance").and_then(Value::as_f64).unwrap_or(1.0);
    let range = range(&colour, &opacity);
    Points { colour, opacity, reference_mm, range }.transfer()
}

fn shaped<const N: usize>(point: &Value, place: &str, y: [f64; N]) -> Result<Point<N>, Problem> {
    Ok(Point {
        x: number(point.get("x"), place)?,
        y,
        midpoint: point.get("midpoint").and_then(Value::as_f64).unwrap_or(0.5),
        sharpness: point.get("sharpness").and_then(Value::as_f64).unwrap_or(0.0),
    })
}
