use std::collections::BTreeMap;

use ivd_deform::space::{ChainMail, Curve, Cut, Links, Over, Step, Way};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ShapeKind, ShapeSection};

/// What a step does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StepKind {
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
    /// A spatial transfer function: `over`, `way`, `knots`.
    Curve,
    /// Chain mail: `grip`, `by`, `shrink`, `stretch`, `shear`.
    Chain,
    /// A cut that opens: `normal`, `open`.
    Cut,
}

impl StepKind {
    /// The shape that a deflector has.
    fn shape(self) -> Option<ShapeKind> {
        Some(match self {
            Self::Translate => ShapeKind::Translate,
            Self::Rotate => ShapeKind::Rotate,
            Self::Scale => ShapeKind::Scale,
            Self::Stretch => ShapeKind::Stretch,
            Self::Squeeze => ShapeKind::Squeeze,
            Self::Twist => ShapeKind::Twist,
            Self::Taper => ShapeKind::Taper,
            Self::Bend => ShapeKind::Bend,
            Self::Curve | Self::Chain | Self::Cut => return None,
        })
    }
}

/// The coordinate that a curve runs over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CurveOver {
    /// Along the axis, from the centre.
    Along,
    /// Distance from the axis.
    Across,
    /// Distance from the centre.
    Distance,
}

/// What a curve's value does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CurveWay {
    /// Moves along the axis (mm).
    Shift,
    /// Turns about the axis (degrees).
    Turn,
    /// Scales the distance from the axis (a factor).
    Swell,
    /// Scales the distance from the centre (a factor).
    Grow,
}

/// `[space.step.material.<class>]`: how far a class's links give way; what isn't given is as in the step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinkSection {
    /// Least length of a link, relative to its length at rest, above 0 to 1.
    pub shrink: Option<f64>,
    /// Largest length of a link, relative to its length at rest, 1 to 1000.
    pub stretch: Option<f64>,
    /// Most that a link's ends go sideways, relative to its length at rest, 0 to 1000.
    pub shear: Option<f64>,
}

impl LinkSection {
    fn links(self, default: Links) -> Links {
        Links {
            shrink: self.shrink.unwrap_or(default.shrink),
            stretch: self.stretch.unwrap_or(default.stretch),
            shear: self.shear.unwrap_or(default.shear),
        }
    }
}

/// `[[space.step]]`: a change of space within a ball, after the map of the lattice and the steps before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StepSection {
    /// What it does.
    pub kind: StepKind,
    /// Centre (mm), RAS.
    pub centre: [f64; 3],
    /// Distance from the centre from which on nothing moves (mm); not for chain.
    #[serde(default)]
    pub radius: Option<f64>,
    /// Direction of the axis, RAS; z where it isn't given. Not for chain and cut.
    #[serde(default)]
    pub axis: Option<[f64; 3]>,
    /// Fraction of the radius within which the work is done whole, 0 to below 1; 0.5 where it isn't given. Not for chain.
    #[serde(default)]
    pub core: Option<f64>,
    /// For translate and chain: way to go (mm).
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
    /// For curve: the coordinate that it runs over (mm).
    #[serde(default)]
    pub over: Option<CurveOver>,
    /// For curve: what its value does.
    #[serde(default)]
    pub way: Option<CurveWay>,
    /// For curve: pairs of a coordinate (mm), ascending, and a value.
    #[serde(default)]
    pub knots: Option<Vec<[f64; 2]>>,
    /// For chain: distance from the centre within which voxels are gripped (mm).
    #[serde(default)]
    pub grip: Option<f64>,
    /// For chain: least length of a link, relative to its length at rest, above 0 to 1; 0.5 where it isn't given.
    #[serde(default)]
    pub shrink: Option<f64>,
    /// For chain: largest length of a link, relative to its length at rest, 1 to 1000; 1.5 where it isn't given.
    #[serde(default)]
    pub stretch: Option<f64>,
    /// For chain: most that a link's ends go sideways, relative to its length at rest, 0 to 1000; 0.2 where it isn't given.
    #[serde(default)]
    pub shear: Option<f64>,
    /// For chain, as the first step: links by class.
    #[serde(default)]
    pub material: BTreeMap<String, LinkSection>,
    /// For cut: normal of its plane, RAS.
    #[serde(default)]
    pub normal: Option<[f64; 3]>,
    /// For cut: distance of its sides at the centre, once open (mm).
    #[serde(default)]
    pub open: Option<f64>,
}

/// `[space]`: what happens to the voxels without a lattice.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SpaceSection {
    /// Its steps, in their order.
    pub step: Vec<StepSection>,
}

impl SpaceSection {
    /// The steps that are meant.
    ///
    /// # Errors
    /// A sentence with the step and the key that is missing, not read or out of its domain.
    pub fn steps(&self) -> Result<Vec<Step>, String> {
        let step = |(i, section): (usize, &StepSection)| section.step().map_err(|e| format!("step {i}: {e}"));
        self.step.iter().enumerate().map(step).collect()
    }
}

/// Fraction of the radius within which a scene's steps do their work whole, where it says nothing.
const CORE: f64 = 0.5;

impl StepSection {
    /// The step that is meant.
    ///
    /// # Errors
    /// A sentence with the key that is missing, not read or out of its domain.
    pub fn step(&self) -> Result<Step, String> {
        let step = match self.kind {
            StepKind::Curve => Step::Curve(self.curve()?),
            StepKind::Chain => Step::Chain(self.chain()?),
            StepKind::Cut => Step::Cut(self.cut()?),
            kind => {
                self.only(
                    "a deflector",
                    &[
                        "radius", "axis", "core", "by", "angle", "along", "across", "factor", "rate",
                        "spine", "length",
                    ],
                )?;
                let section = ShapeSection {
                    kind: kind.shape().expect("the other kinds are deflectors"),
                    centre: self.centre,
                    radius: self.needed("radius", self.radius)?,
                    axis: self.axis,
                    core: self.core,
                    by: self.by,
                    angle: self.angle,
                    along: self.along,
                    across: self.across,
                    factor: self.factor,
                    rate: self.rate,
                    spine: self.spine,
                    length: self.length,
                };
                Step::Shape(section.shape()?)
            }
        };
        step.check().map_err(|e| e.to_string())?;
        Ok(step)
    }

    fn curve(&self) -> Result<Curve, String> {
        self.only("curve", &["radius", "axis", "core", "over", "way", "knots"])?;
        let over = match self.needed("over", self.over)? {
            CurveOver::Along => Over::Along,
            CurveOver::Across => Over::Across,
            CurveOver::Distance => Over::Distance,
        };
        let way = match self.needed("way", self.way)? {
            CurveWay::Shift => Way::Shift,
            CurveWay::Turn => Way::Turn,
            CurveWay::Swell => Way::Swell,
            CurveWay::Grow => Way::Grow,
        };
        Ok(Curve {
            centre: self.centre,
            axis: self.axis.unwrap_or([0.0, 0.0, 1.0]),
            radius: self.needed("radius", self.radius)?,
            core: self.core.unwrap_or(CORE),
            over,
            way,
            knots: self.needed("knots", self.knots.clone())?,
        })
    }

    fn chain(&self) -> Result<ChainMail, String> {
        self.only("chain", &["grip", "by", "shrink", "stretch", "shear", "material"])?;
        let own = LinkSection { shrink: self.shrink, stretch: self.stretch, shear: self.shear };
        let links = own.links(Links::default());
        let class = |(name, own): (&String, &LinkSection)| {
            let id = name
                .parse::<u16>()
                .map_err(|_| format!("material.{name}: a class is named by its number, 0 to 65535"))?;
            Ok((id, own.links(links)))
        };
        let classes = self.material.iter().map(class).collect::<Result<BTreeMap<_, _>, String>>()?;
        if classes.len() < self.material.len() {
            return Err("material: a class is named twice".into());
        }
        Ok(ChainMail {
            centre: self.centre,
            grip: self.needed("grip", self.grip)?,
            by: self.needed("by", self.by)?,
            links,
            classes,
        })
    }

    fn cut(&self) -> Result<Cut, String> {
        self.only("cut", &["radius", "core", "normal", "open"])?;
        Ok(Cut {
            centre: self.centre,
            normal: self.needed("normal", self.normal)?,
            radius: self.needed("radius", self.radius)?,
            core: self.core.unwrap_or(CORE),
            open: self.needed("open", self.open)?,
        })
    }

    fn needed<T>(&self, key: &str, value: Option<T>) -> Result<T, String> {
        value.ok_or_else(|| format!("{key} is missing; {:?} reads it", self.kind).to_lowercase())
    }

    /// A key that a kind doesn't read is a mistake: whoever wrote it expects something of it.
    fn only(&self, name: &str, read: &[&str]) -> Result<(), String> {
        let given = [
            ("radius", self.radius.is_some()),
            ("axis", self.axis.is_some()),
            ("core", self.core.is_some()),
            ("by", self.by.is_some()),
            ("angle", self.angle.is_some()),
            ("along", self.along.is_some()),
            ("across", self.across.is_some()),
            ("factor", self.factor.is_some()),
            ("rate", self.rate.is_some()),
            ("spine", self.spine.is_some()),
            ("length", self.length.is_some()),
            ("over", self.over.is_some()),
            ("way", self.way.is_some()),
            ("knots", self.knots.is_some()),
            ("grip", self.grip.is_some()),
            ("shrink", self.shrink.is_some()),
            ("stretch", self.stretch.is_some()),
            ("shear", self.shear.is_some()),
            ("material", !self.material.is_empty()),
            ("normal", self.normal.is_some()),
            ("open", self.open.is_some()),
        ];
        match given.iter().find(|(key, given)| *given && !read.contains(key)) {
            None => Ok(()),
            Some((key, _)) => Err(format!("{key}: {name} doesn't read it; it reads {}", read.join(", "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(text: &str) -> Result<Step, String> {
        let section: StepSection =
            toml::from_str(&format!("centre = [1, 2, 3]\n{text}")).map_err(|e| e.to_string())?;
        section.step()
    }

    #[test]
    fn each_kind_reads_its_own_keys_and_no_others() {
        let twist = step("kind = \"twist\"\nradius = 9\nrate = 2").unwrap();
        let Step::Shape(shape) = twist else { panic!("{twist:?}") };
        assert_eq!((shape.core, shape.radius), (0.5, 9.0));
        let curve =
            step("kind = \"curve\"\nradius = 9\nover = \"along\"\nway = \"turn\"\nknots = [[0, 1], [2, 3]]")
                .unwrap();
        let Step::Curve(curve) = curve else { panic!("{curve:?}") };
        assert_eq!((curve.over, curve.way, curve.knots.len(), curve.core), (Over::Along, Way::Turn, 2, 0.5));
        let text = "kind = \"chain\"\ngrip = 2\nby = [1, 0, 0]\nshear = 0.1\n[material.4]\nshrink = 1.0";
        let Step::Chain(mail) = step(text).unwrap() else { panic!("not chain mail") };
        let own = Links { shear: 0.1, ..Links::default() };
        assert_eq!((mail.links, mail.classes[&4]), (own, Links { shrink: 1.0, ..own }));
        let Step::Cut(cut) = step("kind = \"cut\"\nradius = 9\nnormal = [0, 1, 0]\nopen = 4").unwrap() else {
            panic!("not a cut")
        };
        assert_eq!((cut.open, cut.core, cut.normal), (4.0, 0.5, [0.0, 1.0, 0.0]));
        let refused = [
            ("kind = \"cut\"\nradius = 9\nopen = 4", "normal is missing"),
            ("kind = \"cut\"\nradius = 9\nnormal = [0, 1, 0]\nopen = -4", "open"),
            (
                "kind = \"cut\"\nradius = 9\nnormal = [0, 1, 0]\nopen = 4\naxis = [0, 0, 1]",
                "axis: cut doesn't read it",
            ),
            ("kind = \"chain\"\ngrip = 2\nby = [1, 0, 0]\nradius = 3", "radius: chain doesn't read it"),
            ("kind = \"chain\"\ngrip = 2\nby = [1, 0, 0]\n[material.bone]\nshrink = 1", "material.bone"),
            ("kind = \"curve\"\nradius = 9\nover = \"along\"\nway = \"turn\"", "knots is missing"),
            ("kind = \"rotate\"\nangle = 3", "radius is missing"),
            ("kind = \"rotate\"\nradius = 9\nangle = 3\nopen = 2", "open: a deflector doesn't read it"),
            ("kind = \"rotate\"\nradius = 9\nangle = 3\nrate = 2", "rate"),
            ("kind = \"fold\"\nradius = 9", "fold"),
        ];
        for (text, word) in refused {
            let error = step(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
