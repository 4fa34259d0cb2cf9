use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rigid::{BoneSpec, Drive, Region, RigidTransform};

/// A bone, which moves as one. It holds the vertices within a region (a ball, a capsule or a box), those beside voxels of a class,
/// or those of both.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bone {
    /// Its name. Default: its number, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Name of the bone that carries it, about whose joint (`pivot`) it turns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// Ball: centre, RAS.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub centre: Option<[f64; 3]>,
    /// Ball and capsule: how far from the centre, or the line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm", "exclusiveMinimum" = 0.0))]
    pub radius: Option<f64>,
    /// Capsule: one end of its line, RAS.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub from: Option<[f64; 3]>,
    /// Capsule: the other end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub to: Option<[f64; 3]>,
    /// Box: lowest corner, RAS.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub low: Option<[f64; 3]>,
    /// Box: highest corner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub high: Option<[f64; 3]>,
    /// Class (its number) beside whose voxels its vertices lie.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1"))]
    pub class: Option<u16>,
    /// Point that it turns about, RAS; with a parent, their joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub pivot: Option<[f64; 3]>,
    /// Direction of the axis, RAS. Default: z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "1"))]
    pub axis: Option<[f64; 3]>,
    /// Angle, counter-clockwise as seen from the axis' tip; more than 360 is more than one turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "degrees"))]
    pub angle: Option<f64>,
    /// Where it goes, relative, RAS; not with a parent.
    #[serde(default, rename = "move", skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "mm"))]
    pub by: Option<[f64; 3]>,
    /// Whether it goes where the handles on it go, as nearly as a rigid motion can; in place of `angle` and `move`.
    #[serde(default)]
    pub fit: bool,
    /// How far from its vertices others may follow, in rest space.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm"))]
    pub reach: f64,
}

impl Bone {
    /// The bone as solvers take it; `number` is its place in the list.
    ///
    /// # Errors
    /// The key that is missing, not read or out of its domain.
    pub fn read(&self, number: usize) -> Result<BoneSpec, ParamError> {
        let part = BoneSpec {
            name: self.name.clone().unwrap_or_else(|| number.to_string()),
            parent: self.parent.clone(),
            region: self.region()?,
            class: self.class,
            drive: self.drive()?,
            reach: self.reach,
        };
        part.check()?;
        Ok(part)
    }

    fn region(&self) -> Result<Option<Region>, ParamError> {
        let given = (self.centre, self.radius, self.from, self.to, self.low, self.high);
        Ok(Some(match given {
            (None, None, None, None, None, None) => return Ok(None),
            (Some(centre), Some(radius), None, None, None, None) => Region::Ball { centre, radius },
            (None, Some(radius), Some(from), Some(to), None, None) => Region::Capsule { from, to, radius },
            (None, None, None, None, Some(low), Some(high)) => Region::Box { low, high },
            _ => {
                return Err(ParamError::at_itself(
                    "the keys of its region are those of no ball, no capsule and no box",
                    "give a ball (centre, radius), a capsule (from, to, radius) or a box (low, high), one of them, each with \
                     all of its keys",
                ));
            }
        }))
    }

    fn drive(&self) -> Result<Drive, ParamError> {
        if self.fit {
            let given =
                [("angle", self.angle.is_some()), ("axis", self.axis.is_some()), ("move", self.by.is_some())];
            if let Some((key, _)) = given.iter().find(|(_, given)| *given) {
                return Err(ParamError::new(
                    *key,
                    "a bone that is fitted doesn't read it",
                    "drop it, or fit",
                ));
            }
            return Ok(Drive::Fitted { pivot: self.pivot });
        }
        if self.angle.is_none() && self.axis.is_some() {
            let remedy = "add angle = … (degrees), or drop the axis";
            return Err(ParamError::new("axis", "there is no angle to turn by", remedy));
        }
        if self.angle.is_some() && self.pivot.is_none() {
            let problem = "pivot = [x, y, z] (mm) is missing";
            return Err(ParamError::new("angle", problem, "give the point that it turns about"));
        }
        Ok(Drive::Prescribed(RigidTransform {
            pivot: self.pivot.unwrap_or(RigidTransform::NONE.pivot),
            axis: self.axis.unwrap_or(RigidTransform::NONE.axis),
            angle: self.angle.unwrap_or(0.0),
            by: self.by.unwrap_or([0.0; 3]),
        }))
    }

    /// A ball round its region (mm), with its reach; no centre where a class alone says which vertices it holds.
    pub fn ball(&self) -> (Option<[f64; 3]>, f64) {
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
    use ivd_core::op::check_fields;
    use serde_json::{Value, json};

    use super::*;

    fn part(keys: &Value) -> Result<BoneSpec, String> {
        let mut all = json!({ "reach": 9 });
        all.as_object_mut().unwrap().extend(keys.as_object().unwrap().clone());
        let bone: Bone = serde_json::from_value(all).map_err(|e| e.to_string())?;
        check_fields(&bone).and_then(|()| bone.read(2)).map_err(|e| e.told_of(""))
    }

    #[test]
    fn regions_and_motions_are_read_whole() {
        let ball = part(&json!({ "centre": [1, 2, 3], "radius": 4, "move": [0, 0, 1] })).unwrap();
        assert_eq!((ball.name.as_str(), ball.reach), ("2", 9.0));
        assert_eq!(ball.region, Some(Region::Ball { centre: [1.0, 2.0, 3.0], radius: 4.0 }));
        assert_eq!(
            ball.drive,
            Drive::Prescribed(RigidTransform { by: [0.0, 0.0, 1.0], ..RigidTransform::NONE })
        );
        let capsule = part(&json!({
            "name": "a", "parent": "b", "from": [0, 0, 0], "to": [0, 0, 5], "radius": 2, "class": 4,
            "pivot": [0, 0, 0], "axis": [1, 0, 0], "angle": 400,
        }))
        .unwrap();
        let to = [0.0, 0.0, 5.0];
        assert_eq!(capsule.region, Some(Region::Capsule { from: [0.0; 3], to, radius: 2.0 }));
        assert_eq!((capsule.class, capsule.parent.as_deref()), (Some(4), Some("b")));
        let fitted =
            part(&json!({ "low": [0, 0, 0], "high": [1, 1, 1], "fit": true, "pivot": [0, 0, 1] })).unwrap();
        assert_eq!(fitted.drive, Drive::Fitted { pivot: Some([0.0, 0.0, 1.0]) });
        assert_eq!(
            part(&json!({ "class": 3 })).unwrap().drive,
            Drive::Prescribed(RigidTransform::NONE),
            "it stays"
        );
    }

    #[test]
    fn what_does_not_go_together_is_refused_by_key() {
        for (keys, word) in [
            (json!({}), "neither a region nor a class"),
            (json!({ "centre": [1, 2, 3] }), "radius"),
            (json!({ "centre": [1, 2, 3], "radius": 4, "low": [0, 0, 0], "high": [1, 1, 1] }), "one of them"),
            (json!({ "centre": [1, 2, 3], "radius": -4 }), "radius"),
            (json!({ "low": [0, 0, 0], "high": [1, 0, 1] }), "high"),
            (json!({ "class": 3, "angle": 3 }), "pivot"),
            (json!({ "class": 3, "axis": [1, 0, 0] }), "axis"),
            (json!({ "class": 3, "fit": true, "angle": 3 }), "angle"),
            (json!({ "class": 3, "parent": "b", "move": [1, 0, 0] }), "joint"),
            (json!({ "class": 3, "parent": "b", "fit": true }), "joint"),
            (json!({ "class": 3, "pivot": [0, 0, 0], "axis": [0, 0, 0], "angle": 3 }), "axis"),
            (json!({ "class": 3, "pivot": [0, 0, 0], "angle": 1e7 }), "angle"),
            (json!({ "class": 3, "turn": 3 }), "turn"),
        ] {
            let error = part(&keys).unwrap_err();
            assert!(error.contains(word), "{keys}: {error}");
        }
    }
}
