//! What of a deformed volume is kept.

use ivd_field::clip::{ClipParams, Cuboid, HalfSpace};
use ivd_field::lies::Lies;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::numbered::Numbered;

/// A part of space that is kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClipPart {
    /// What lies on a side of a plane.
    Plane(HalfSpace),
    /// What lies in a box.
    Box(Cuboid),
}

/// What planes and boxes are about.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClipRule {
    /// Throws away what would be kept, and keeps the rest.
    pub invert: bool,
    /// Value of what is thrown away (that of the volume's values). Without it the deformed volume's least.
    pub background: Option<f64>,
    /// Where planes and boxes lie: in the body at rest, or where it has come to, as without it.
    pub space: Option<Lies>,
}

/// What of the deformed volume is kept: what lies in all parts; everything where there are none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clip {
    /// Planes and boxes.
    pub parts: Vec<Numbered<ClipPart>>,
    /// What they are about.
    #[serde(flatten)]
    pub rule: ClipRule,
}

impl Clip {
    /// What the volume is clipped by; `None` where all of it is kept.
    pub fn params(&self) -> Option<ClipParams> {
        if self.parts.is_empty() {
            return None;
        }
        let (mut planes, mut boxes) = (Vec::new(), Vec::new());
        for part in &self.parts {
            match part.what {
                ClipPart::Plane(plane) => planes.push(plane),
                ClipPart::Box(cuboid) => boxes.push(cuboid),
            }
        }
        let ClipRule { invert, background, .. } = self.rule;
        Some(ClipParams { planes, boxes, class: None, invert, background })
    }

    /// Whether planes and boxes lie in the body at rest.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.rule.space == Some(Lies::Rest)
    }

    /// # Errors
    /// The part that is out of its domain; a rule where nothing clips.
    pub(crate) fn check(&self) -> Result<(), Error> {
        match self.params() {
            Some(params) => Ok(params.check()?),
            None if self.rule == ClipRule::default() => Ok(()),
            None => Err(Error::Event {
                event: "clip_rule",
                problem: "there is nothing to clip by".into(),
                remedy: "clip by a plane or a box first",
            }),
        }
    }
}
