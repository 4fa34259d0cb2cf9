//! The stage as scenes see it.

use ivd_core::op::{Failure, Memory, Method, Op, Output, Place, Remark, Stage, Voxelwise, Want, method};
use ivd_core::{Artefact, Displacement, Exec, Labels, ParamError, slots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{By, ClipParams, Clipped, Tag, labels, mask, volume};
use crate::Error;
use crate::lies::{Lies, OF_SCENE};

/// The stage: what comes of a scene's volume at last is clipped, or the input is before anything is done with it.
pub const STAGE: Stage = Stage {
    name: "clip",
    about: "Keeps the part of a volume, of labels or of a mask that lies on given sides of planes, in boxes, and in what is tagged.",
    selector: "",
    methods: METHODS,
    positional: &["volume"],
    places: &[
        Place {
            variant: "input",
            is_first: true,
            when: Some(("of", "input")),
            named: TAG,
            empty: &["displacement"],
            ..Place::only("volume")
        },
        Place {
            when: Some(("of", "result")),
            from: &[("volume", "result"), ("volume", "deformed"), ("volume", "volume")],
            named: TAG,
            ..Place::only("result")
        },
    ],
    quiet: true,
    memory: Memory { voxel: 12, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[method::<SceneClip>("")];
const TAG: &[(&str, &[&str])] = &[("tag", OF_SCENE)];

slots! {
    /// What is clipped, and by what beside planes and boxes.
    pub struct Given<'a> { volume: Voxelwise<'a>, tag: Option<Tag<'a>>, displacement: Option<&'a Displacement> }
}

/// Which volume of a scene is clipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Whose {
    /// What comes of the volume: deformed and combined, where the scene says so, else the input.
    #[default]
    Result,
    /// The input, before anything is done with it.
    Input,
}

/// A clip in a scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SceneClip {
    /// Planes, boxes, class, background.
    #[serde(flatten)]
    pub clip: ClipParams,
    /// What tags the voxels that are kept: `mask` or `labels`, those of the scene, or the file of a mask or of labels, relative to the
    /// scene's folder.
    pub tag: Option<String>,
    /// Which volume is clipped.
    pub of: Whose,
    /// Where planes, boxes and tag lie. Without it at rest where the tag is of the scene, else where the deformed body is.
    pub space: Option<Lies>,
}

/// What a clip comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ClipFigures {
    /// Voxels as they were.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 1))]
    pub voxels_kept: u64,
    /// Voxels of the result with a label or inside of the mask; not told of a volume.
    #[schemars(extend("x-unit" = "voxels", "x-headline" = 2))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voxels_filled: Option<u64>,
    /// Voxels that became background.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_clipped: u64,
    /// Voxels of the grid.
    #[schemars(extend("x-unit" = "voxels"))]
    pub voxels_total: u64,
    /// Bricks (8³ voxels) that were looked at voxel by voxel.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_visited: u64,
    /// Bricks of the grid.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_total: u64,
}

impl ClipFigures {
    /// What a person should know: that nothing is left, or that all is.
    pub fn remark(&self) -> Option<String> {
        let places = "planes and boxes are places in mm, RAS, and `ivd info` tells where the volume lies";
        match (self.voxels_kept, self.voxels_clipped) {
            (0, _) => Some(format!("nothing is left; {places}")),
            (_, 0) => Some(format!("nothing is clipped; {places}")),
            _ => None,
        }
    }
}

/// Clips what there is at every voxel, whatever it is, with the figures.
///
/// # Errors
/// As [`volume`], [`labels`] and [`mask`].
pub fn any(
    given: Voxelwise<'_>,
    params: &ClipParams,
    by: &By<'_>,
    exec: &Exec,
) -> Result<(Artefact, ClipFigures), Error> {
    Ok(match given {
        Voxelwise::Volume(given) => told(volume(given, params, by, exec)?, |_| None),
        Voxelwise::Labels(given) => told(labels(given, params, by, exec)?, |l| Some(labelled(l))),
        Voxelwise::Mask(given) => told(mask(given, params, by, exec)?, |m| Some(m.count())),
    })
}

/// Voxels that have a label.
pub(crate) fn labelled(labels: &Labels) -> u64 {
    labels.ids().iter().filter(|id| **id != 0).count() as u64
}

fn told<V: Output>(clipped: Clipped<V>, filled: impl Fn(&V) -> Option<u64>) -> (Artefact, ClipFigures) {
    let Clipped { output, voxels_kept, voxels_clipped, voxels_total, bricks_visited, bricks_total } = clipped;
    let voxels_filled = filled(&output);
    let figures = ClipFigures {
        voxels_kept,
        voxels_filled,
        voxels_clipped,
        voxels_total,
        bricks_visited,
        bricks_total,
    };
    (output.into_artefact(), figures)
}

impl Op for SceneClip {
    const REVISION: u32 = 2;
    const REMARK: Option<Remark<ClipFigures>> = Some(ClipFigures::remark);
    type Inputs<'a> = Given<'a>;
    type Gives = (Artefact, ClipFigures);

    fn check_together(&self) -> Result<(), ParamError> {
        self.clip.check()?;
        if self.clip.class.is_some() && self.tag.is_none() {
            let remedy = "give tag = \"labels\" or a file of labels, or leave the class out";
            return Err(ParamError::new("class", "it is a class of what tags, and nothing does", remedy));
        }
        let of_scene = self.tag.as_deref().filter(|tag| OF_SCENE.contains(tag));
        match (self.of, of_scene) {
            (Whose::Input, Some(tag)) => Err(ParamError::new(
                "tag",
                format!("the scene's {tag} is made from the input, which is clipped before"),
                "clip the result (of = \"result\"), or name a file",
            )),
            (Whose::Input, None) if self.space == Some(Lies::Deformed) => Err(ParamError::new(
                "space",
                "the input isn't deformed yet where it is clipped",
                "leave it out, or clip the result (of = \"result\")",
            )),
            _ => Ok(()),
        }
    }

    fn wants(&self, slot: &str) -> Want {
        let is_read = match slot {
            "tag" => self.tag.is_some(),
            "displacement" => Lies::or_of(self.space, self.tag.as_deref()) == Lies::Rest,
            _ => true,
        };
        if is_read { Want::Yes } else { Want::No }
    }

    fn idle(&self) -> Option<&'static str> {
        let ClipParams { planes, boxes, .. } = &self.clip;
        let is_idle = planes.is_empty() && boxes.is_empty() && self.tag.is_none();
        is_idle.then_some("the scene has nothing to clip by: no plane, no box, no tag")
    }

    fn run(&self, inputs: Given<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Given { volume, tag, displacement } = inputs;
        Ok(any(volume, &self.clip, &By { tag, displacement }, exec)?)
    }
}
