use ivd_core::ParamError;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::turn::{RigidTransform, finite};

/// A part of space, its border included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// A ball.
    Ball {
        /// Middle (mm), RAS.
        centre: [f64; 3],
        /// Radius (mm), > 0.
        radius: f64,
    },
    /// What is no further than a radius from a line.
    Capsule {
        /// One end of the line (mm), RAS.
        from: [f64; 3],
        /// The other.
        to: [f64; 3],
        /// Radius (mm), > 0.
        radius: f64,
    },
    /// A box along the axes of the world.
    Box {
        /// Lowest corner (mm), RAS.
        low: [f64; 3],
        /// Highest corner (mm), above the lowest along every axis.
        high: [f64; 3],
    },
}

impl Region {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        let length = |value: f64| {
            if value > 0.0 && value <= 1e100 {
                return Ok(());
            }
            Err(ParamError::new("radius", format!("{value} mm"), "use a positive length"))
        };
        match self {
            Self::Ball { centre, radius } => finite("centre", centre).and(length(*radius)),
            Self::Capsule { from, to, radius } => {
                finite("from", from).and(finite("to", to)).and(length(*radius))
            }
            Self::Box { low, high } => {
                finite("low", low).and(finite("high", high))?;
                if low.iter().zip(high).all(|(l, h)| l < h) {
                    return Ok(());
                }
                let problem = format!("{high:?} isn't above low = {low:?} along every axis");
                Err(ParamError::new("high", problem, "give the lowest and the highest corner"))
            }
        }
    }

    /// Whether it holds a point.
    ///
    /// - `point`: mm, relative to `origin` (mm, RAS), which may be far away.
    pub fn holds(&self, point: Vector3<f64>, origin: Vector3<f64>) -> bool {
        let local = |at: [f64; 3]| Vector3::from(at) - origin;
        match *self {
            Self::Ball { centre, radius } => (point - local(centre)).norm() <= radius,
            Self::Capsule { from, to, radius } => {
                let (start, way) = (local(from), local(to) - local(from));
                let square = way.norm_squared();
                let t = if square > 0.0 { ((point - start).dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
                (point - (start + way * t)).norm() <= radius
            }
            Self::Box { low, high } => {
                let (low, high) = (local(low), local(high));
                (0..3).all(|a| (low[a]..=high[a]).contains(&point[a]))
            }
        }
    }
}

/// What moves a bone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// A motion that is given: after its parent's, where it has one.
    Prescribed(RigidTransform),
    /// The motion that brings the handles on the bone nearest to where they go.
    Fitted {
        /// Point (mm, RAS) that the bone turns about; of a bone with a parent their joint. Without it the bone is free, and
        /// turns about the middle of its handles.
        pivot: Option<[f64; 3]>,
    },
}

/// A bone as it is asked for: a part of a lattice that moves as one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoneSpec {
    /// What errors, children and reports call it.
    pub name: String,
    /// The bone that carries it.
    pub parent: Option<String>,
    /// Vertices that it holds: those within.
    pub region: Option<Region>,
    /// Vertices that it holds: those beside a voxel of this class; with a region, those of both.
    pub class: Option<u16>,
    /// What moves it.
    pub drive: Drive,
    /// How far from its vertices others may follow (mm, rest space), ≥ 0.
    pub reach: f64,
}

impl BoneSpec {
    /// # Errors
    /// [`ParamError`] names the part that is out of its domain.
    pub fn check(&self) -> Result<(), ParamError> {
        if self.region.is_none() && self.class.is_none() {
            let problem = format!("bone {} has neither a region nor a class", self.name);
            return Err(ParamError::new("rigid", problem, "say which vertices it holds"));
        }
        self.region.as_ref().map_or(Ok(()), Region::check)?;
        if !(0.0..=1e100).contains(&self.reach) {
            let problem = format!("{} mm", self.reach);
            return Err(ParamError::new("reach", problem, "use a length of at least 0"));
        }
        match &self.drive {
            Drive::Prescribed(turn) => {
                turn.check()?;
                if self.parent.is_some() && turn.by != [0.0; 3] {
                    let problem = format!("{:?} mm takes bone {} off its joint", turn.by, self.name);
                    return Err(ParamError::new(
                        "move",
                        problem,
                        "turn it about the joint, or drop its parent",
                    ));
                }
                Ok(())
            }
            Drive::Fitted { pivot: Some(pivot) } => finite("pivot", pivot),
            Drive::Fitted { pivot: None } if self.parent.is_some() => {
                let problem = format!("bone {} has a parent and no joint", self.name);
                Err(ParamError::new("pivot", problem, "give the point that both share"))
            }
            Drive::Fitted { pivot: None } => Ok(()),
        }
    }
}
