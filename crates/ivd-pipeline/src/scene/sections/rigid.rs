use ivd_deform::rigid::{Drive, Part, Region, Turn};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[deform.rigid]]`: a bone, which moves as one. It holds the vertices within a region (a ball, a capsule or a box), those
/// beside voxels of a class, or those of both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigidSection {
    /// What it is called; its number, from 0, where it isn't given.
    #[serde(default)]
    pub name: Option<String>,
    /// Name of the bone that carries it, about whose joint (`pivot`) it turns.
    #[serde(default)]
    pub parent: Option<String>,
    /// Ball: centre (mm), RAS.
    #[serde(default)]
    pub centre: Option<[f64; 3]>,
    /// Ball and capsule: radius (mm).
    #[serde(default)]
    pub radius: Option<f64>,
    /// Capsule: one end of its line (mm), RAS.
    #[serde(default)]
    pub from: Option<[f64; 3]>,
    /// Capsule: the other end.
    #[serde(default)]
    pub to: Option<[f64; 3]>,
    /// Box: lowest corner (mm), RAS.
    #[serde(default)]
    pub low: Option<[f64; 3]>,
    /// Box: highest corner.
    #[serde(default)]
    pub high: Option<[f64; 3]>,
    /// Class (its number) beside whose voxels its vertices lie.
    #[serde(default)]
    pub class: Option<u16>,
    /// Point that it turns about (mm), RAS; with a parent, their joint.
    #[serde(default)]
    pub pivot: Option<[f64; 3]>,
    /// Direction of the axis, RAS; z where it isn't given.
    #[serde(default)]
    pub axis: Option<[f64; 3]>,
    /// Degrees, counter-clockwise as seen from the axis' tip.
    #[serde(default)]
    pub angle: Option<f64>,
    /// Where it goes (mm), relative; not with a parent.
    #[serde(default, rename = "move")]
    pub displace: Option<[f64; 3]>,
    /// Whether it goes where the handles on it go, as nearly as a rigid motion can; in place of `angle` and `move`.
    #[serde(default)]
    pub fit: bool,
    /// How far from its vertices others may follow (mm, rest space).
    pub reach: f64,
}

impl RigidSection {
    /// The bone that is meant; `number` is its place in the list.
    ///
    /// # Errors
    /// A sentence with the key that is missing, not read or out of its domain.
    pub fn part(&self, number: usize) -> Result<Part, String> {
        let part = Part {
            name: self.name.clone().unwrap_or_else(|| number.to_string()),
            parent: self.parent.clone(),
            region: self.region()?,
            class: self.class,
            drive: self.drive()?,
            reach: self.reach,
        };
        part.check().map_err(|e| e.to_string())?;
        Ok(part)
    }

    fn region(&self) -> Result<Option<Region>, String> {
        let given = (self.centre, self.radius, self.from, self.to, self.low, self.high);
        Ok(Some(match given {
            (None, None, None, None, None, None) => return Ok(None),
            (Some(centre), Some(radius), None, None, None, None) => Region::Ball { centre, radius },
            (None, Some(radius), Some(from), Some(to), None, None) => Region::Capsule { from, to, radius },
            (None, None, None, None, Some(low), Some(high)) => Region::Box { low, high },
            _ => {
                return Err("give a ball (centre, radius), a capsule (from, to, radius) or a box (low, high), one of them, \
                            each with all of its keys"
                    .into());
            }
        }))
    }

    fn drive(&self) -> Result<Drive, String> {
        if self.fit {
            let given = [
                ("angle", self.angle.is_some()),
                ("axis", self.axis.is_some()),
                ("move", self.displace.is_some()),
            ];
            if let Some((key, _)) = given.iter().find(|(_, given)| *given) {
                return Err(format!("{key}: a bone that is fitted doesn't read it; drop it, or fit"));
            }
            return Ok(Drive::Fitted { pivot: self.pivot });
        }
        if self.angle.is_none() && self.axis.is_some() {
            return Err(
                "axis: there is no angle to turn by; add angle = … (degrees), or drop the axis".into()
            );
        }
        if self.angle.is_some() && self.pivot.is_none() {
            return Err("pivot = [x, y, z] (mm) is missing; angle turns about it".into());
        }
        Ok(Drive::Given(Turn {
            pivot: self.pivot.unwrap_or(Turn::NONE.pivot),
            axis: self.axis.unwrap_or(Turn::NONE.axis),
            angle: self.angle.unwrap_or(0.0),
            by: self.displace.unwrap_or([0.0; 3]),
        }))
    }

    /// A ball round its region (mm), with its reach; no centre where a class alone says which vertices it holds.
    pub(crate) fn ball(&self) -> (Option<[f64; 3]>, f64) {
        let between = |a: [f64; 3], b: [f64; 3]| {
            let half: f64 = a.iter().zip(&b).map(|(a, b)| (b - a) * (b - a)).sum();
            (std::array::from_fn(|i| f64::midpoint(a[i], b[i])), half.sqrt() / 2.0)
        };
        let own = self.radius.unwrap_or(0.0);
        match (self.centre, self.from.zip(self.to), self.low.zip(self.high)) {
            (Some(centre), ..) => (Some(centre), own + self.reach),
            (_, Some((a, b)), _) | (.., Some((a, b))) => {
                let (centre, half) = between(a, b);
                (Some(centre), half + own + self.reach)
            }
            _ => (None, self.reach),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(text: &str) -> Result<Part, String> {
        let section: RigidSection =
            toml::from_str(&format!("reach = 9\n{text}")).map_err(|e| e.message().to_owned())?;
        section.part(2)
    }

    #[test]
    fn regions_and_motions_are_read_whole() {
        let ball = part("centre = [1, 2, 3]\nradius = 4\nmove = [0, 0, 1]").unwrap();
        assert_eq!((ball.name.as_str(), ball.reach), ("2", 9.0));
        assert_eq!(ball.region, Some(Region::Ball { centre: [1.0, 2.0, 3.0], radius: 4.0 }));
        assert_eq!(ball.drive, Drive::Given(Turn { by: [0.0, 0.0, 1.0], ..Turn::NONE }));
        let capsule = part(
            "name = \"a\"\nparent = \"b\"\nfrom = [0, 0, 0]\nto = [0, 0, 5]\nradius = 2\nclass = 4\n\
            pivot = [0, 0, 0]\naxis = [1, 0, 0]\nangle = 400",
        )
        .unwrap();
        let to = [0.0, 0.0, 5.0];
        assert_eq!(capsule.region, Some(Region::Capsule { from: [0.0; 3], to, radius: 2.0 }));
        assert_eq!((capsule.class, capsule.parent.as_deref()), (Some(4), Some("b")));
        let fitted = part("low = [0, 0, 0]\nhigh = [1, 1, 1]\nfit = true\npivot = [0, 0, 1]").unwrap();
        assert_eq!(fitted.drive, Drive::Fitted { pivot: Some([0.0, 0.0, 1.0]) });
        assert_eq!(part("class = 3").unwrap().drive, Drive::Given(Turn::NONE), "it stays");
    }

    #[test]
    fn what_does_not_go_together_is_refused_by_key() {
        for (text, word) in [
            ("", "neither a region nor a class"),
            ("centre = [1, 2, 3]", "radius"),
            ("centre = [1, 2, 3]\nradius = 4\nlow = [0, 0, 0]\nhigh = [1, 1, 1]", "one of them"),
            ("centre = [1, 2, 3]\nradius = -4", "radius"),
            ("low = [0, 0, 0]\nhigh = [1, 0, 1]", "high"),
            ("class = 3\nangle = 3", "pivot"),
            ("class = 3\naxis = [1, 0, 0]", "axis"),
            ("class = 3\nfit = true\nangle = 3", "angle"),
            ("class = 3\nparent = \"b\"\nmove = [1, 0, 0]", "joint"),
            ("class = 3\nparent = \"b\"\nfit = true", "joint"),
            ("class = 3\npivot = [0, 0, 0]\naxis = [0, 0, 0]\nangle = 3", "axis"),
            ("class = 3\npivot = [0, 0, 0]\nangle = 1e7", "angle"),
            ("class = 3\nturn = 3", "turn"),
        ] {
            let error = part(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
