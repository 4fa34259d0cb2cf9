use ivd_deform::freeform::{Kind, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a shape does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShapeKind {
    /// Moves: `by`.
    Translate,
    /// Turns about the axis: `angle`.
    Rotate,
    /// Scales: `along` the axis and `across` it.
    Scale,
    /// Longer and thinner, the volume kept: `factor`.
    Stretch,
    /// Thinner and longer, the volume kept: `factor`.
    Squeeze,
    /// Turns about the axis more and more along it: `rate`.
    Twist,
    /// Wider and wider along the axis: `rate`.
    Taper,
    /// Rolls the line along `spine` up about the axis: `rate`.
    Bend,
}

/// `[[deform.shape]]`: a change of shape within a ball, after the solver and the shapes before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShapeSection {
    /// What it does.
    pub kind: ShapeKind,
    /// Centre (mm), RAS.
    pub centre: [f64; 3],
    /// Distance from the centre from which on nothing moves (mm).
    pub radius: f64,
    /// Direction of the axis, RAS; z where it isn't given.
    #[serde(default)]
    pub axis: Option<[f64; 3]>,
    /// Fraction of the radius within which the work is done whole, 0 to below 1; 0.5 where it isn't given.
    #[serde(default)]
    pub core: Option<f64>,
    /// For translate: way to go (mm).
    #[serde(default)]
    pub by: Option<[f64; 3]>,
    /// For rotate: degrees, counter-clockwise as seen from the axis' tip.
    #[serde(default)]
    pub angle: Option<f64>,
    /// For scale: factor along the axis.
    #[serde(default)]
    pub along: Option<f64>,
    /// For scale: factor across the axis.
    #[serde(default)]
    pub across: Option<f64>,
    /// For stretch, along the axis; for squeeze, across it.
    #[serde(default)]
    pub factor: Option<f64>,
    /// For twist and bend: degrees for each mm. For taper: growth for each mm (1/mm).
    #[serde(default)]
    pub rate: Option<f64>,
    /// For bend: direction of the line that is bent.
    #[serde(default)]
    pub spine: Option<[f64; 3]>,
    /// For twist, taper and bend: length of the part that is twisted, tapered or bent (mm); no end where it isn't given.
    #[serde(default)]
    pub length: Option<f64>,
}

/// Fraction of the radius within which a scene's shapes do their work whole, where it says nothing.
const CORE: f64 = 0.5;

impl ShapeSection {
    /// The shape that is meant.
    ///
    /// # Errors
    /// A sentence with the key that is missing, not read or out of its domain.
    pub fn shape(&self) -> Result<Shape, String> {
        let given = [
            ("by", self.by.is_some()),
            ("angle", self.angle.is_some()),
            ("along", self.along.is_some()),
            ("across", self.across.is_some()),
            ("factor", self.factor.is_some()),
            ("rate", self.rate.is_some()),
            ("spine", self.spine.is_some()),
            ("length", self.length.is_some()),
        ];
        let (name, read): (_, &[&str]) = match self.kind {
            ShapeKind::Translate => ("translate", &["by"]),
            ShapeKind::Rotate => ("rotate", &["angle"]),
            ShapeKind::Scale => ("scale", &["along", "across"]),
            ShapeKind::Stretch => ("stretch", &["factor"]),
            ShapeKind::Squeeze => ("squeeze", &["factor"]),
            ShapeKind::Twist => ("twist", &["rate", "length"]),
            ShapeKind::Taper => ("taper", &["rate", "length"]),
            ShapeKind::Bend => ("bend", &["rate", "spine", "length"]),
        };
        if let Some((key, _)) = given.iter().find(|(key, given)| *given && !read.contains(key)) {
            return Err(format!("{key}: {name} doesn't read it; it reads {}", read.join(", ")));
        }
        let number = |key: &str, value: Option<f64>| {
            value.ok_or_else(|| format!("{key} is missing; {name} reads {}", read.join(", ")))
        };
        let vector = |key: &str, value: Option<[f64; 3]>| {
            value.ok_or_else(|| format!("{key} = [x, y, z] is missing; {name} reads {}", read.join(", ")))
        };
        let kind = match self.kind {
            ShapeKind::Translate => Kind::Translate { by: vector("by", self.by)? },
            ShapeKind::Rotate => Kind::Rotate { angle: number("angle", self.angle)? },
            ShapeKind::Scale if self.along.or(self.across).is_none() => {
                return Err("along and across are missing; scale reads one of them or both".into());
            }
            ShapeKind::Scale => Kind::Scale { along: self.along, across: self.across },
            ShapeKind::Stretch => Kind::Stretch { factor: number("factor", self.factor)? },
            ShapeKind::Squeeze => Kind::Squeeze { factor: number("factor", self.factor)? },
            ShapeKind::Twist => Kind::Twist { rate: number("rate", self.rate)?, length: self.length },
            ShapeKind::Taper => Kind::Taper { rate: number("rate", self.rate)?, length: self.length },
            ShapeKind::Bend => Kind::Bend {
                rate: number("rate", self.rate)?,
                spine: vector("spine", self.spine)?,
                length: self.length,
            },
        };
        let shape = Shape {
            kind,
            centre: self.centre,
            axis: self.axis.unwrap_or([0.0, 0.0, 1.0]),
            radius: self.radius,
            core: self.core.unwrap_or(CORE),
        };
        shape.check().map_err(|e| e.to_string())?;
        Ok(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(text: &str) -> Result<Shape, String> {
        let section: ShapeSection =
            toml::from_str(&format!("centre = [1, 2, 3]\nradius = 9\n{text}")).map_err(|e| e.to_string())?;
        section.shape()
    }

    #[test]
    fn each_kind_reads_its_own_keys_and_no_others() {
        let kinds = [
            ("translate", "by = [1, 2, 3]", Kind::Translate { by: [1.0, 2.0, 3.0] }),
            ("rotate", "angle = 30", Kind::Rotate { angle: 30.0 }),
            ("scale", "across = 2", Kind::Scale { along: None, across: Some(2.0) }),
            ("stretch", "factor = 2", Kind::Stretch { factor: 2.0 }),
            ("squeeze", "factor = 0.5", Kind::Squeeze { factor: 0.5 }),
            ("twist", "rate = 3", Kind::Twist { rate: 3.0, length: None }),
            ("taper", "rate = 0.1", Kind::Taper { rate: 0.1, length: None }),
            (
                "bend",
                "rate = 3\nspine = [1, 0, 0]",
                Kind::Bend { rate: 3.0, spine: [1.0, 0.0, 0.0], length: None },
            ),
        ];
        let all = ["by", "angle", "along", "across", "factor", "rate", "spine", "length"];
        for (name, keys, kind) in kinds {
            let text = format!("kind = \"{name}\"\n{keys}\n");
            let read = shape(&text).unwrap();
            assert_eq!((read.kind, read.axis, read.core), (kind, [0.0, 0.0, 1.0], 0.5), "{name}");
            let missing = shape(&format!("kind = \"{name}\"")).unwrap_err();
            assert!(missing.contains("missing") && missing.contains(name), "{missing}");
            let ends = ["twist", "taper", "bend"].contains(&name);
            for key in all {
                let read = keys.contains(key) || (ends && key == "length") || name == "scale";
                if read {
                    continue;
                }
                let value = if ["by", "spine"].contains(&key) { "[1, 2, 3]" } else { "1" };
                let error = shape(&format!("{text}{key} = {value}")).unwrap_err();
                assert!(error.contains(key) && error.contains("doesn't read"), "{name}, {key}: {error}");
            }
        }
        assert!(shape("kind = \"rotate\"\nangle = 1\ncore = 1.5").unwrap_err().contains("core"));
    }
}
