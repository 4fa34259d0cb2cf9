//! What a person does in a window, as values: nothing in it names a file, and what it costs is bounded before anything is computed.

use ivd_field::lies::Lies;
use ivd_map::DepthWeight;
use ivd_session::ClipPart;
use serde::{Deserialize, Serialize};

use crate::compared::middle;
use crate::{Overlay, Shows, Sight};

/// Most handles, most pins, and most planes that clip.
pub(crate) const MOST_HANDLES: usize = 64;

/// A part of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pane {
    /// The volume, drawn.
    Volume,
    /// A slice from the feet.
    Axial,
    /// A slice from the front.
    Coronal,
    /// A slice from the left.
    Sagittal,
}

impl Pane {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Volume, Self::Axial, Self::Coronal, Self::Sagittal];

    /// Its place in [`Pane::ALL`].
    pub fn number(self) -> usize {
        self as usize
    }
}

/// What a drag keeps to: an axis of the patient, or the surface's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Left to right.
    X,
    /// Back to front.
    Y,
    /// Feet to head.
    Z,
    /// Out of the surface and into it, as it lies at rest: with the hand where it is seen from the side; where it is seen from in front, up presses in and down
    /// pulls out.
    N,
}

/// A way to carry a motion to the voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MapName {
    /// Through the octree.
    Octree,
    /// The smoothest.
    Biharmonic,
}

/// A way in which the lattice follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SolverName {
    /// By rings about handles.
    Ring,
    /// By springs, that can be stiffer by class.
    Springs,
}

/// What is written to be kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Saved {
    /// The scene, as TOML: `ivd pipeline` makes the same of it.
    Scene,
    /// The deformed volume, as NIfTI, without what planes and boxes take away.
    Volume,
    /// The deformed volume, as NIfTI, with what planes and boxes take away.
    Whole,
    /// Labels that a person gave, deformed, as NIfTI: 0 where planes and boxes take away.
    Labels,
    /// The displacement from deformed to rest, as NRRD.
    Displacement,
    /// The deformed lattice, as PLY.
    Lattice,
    /// The picture, as PNG.
    Picture,
    /// The log, as lines of JSON.
    Log,
}

/// A thing that is done in a window. Places are shares of a pane, from 0, 0 at the top left to 1, 1 at the bottom right; lengths are mm, RAS.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Another size of the volume's pane.
    Resize {
        /// Width and height (pixels).
        size: [usize; 2],
    },
    /// Turns the camera by a drag of so many shares of the pane.
    Orbit {
        /// To the right and down.
        by: [f64; 2],
    },
    /// Moves the camera along the picture.
    Pan {
        /// To the right and down.
        by: [f64; 2],
    },
    /// Magnifies about a place.
    Zoom {
        /// By how much.
        factor: f64,
        /// What stays where it is.
        at: [f64; 2],
    },
    /// Looks from a side.
    Look {
        /// Which.
        side: ivd_render::Side,
    },
    /// The whole volume, from where it was seen at first.
    ResetView,
    /// Lets be seen what was seen once.
    Show {
        /// What.
        sight: Sight,
    },
    /// Brightness and contrast of the slices, by a drag.
    Window {
        /// To the right widens, down darkens.
        by: [f64; 2],
    },
    /// Shifts and widens the range of the transfer function, by a drag.
    Transfer {
        /// To the right shifts up, down narrows.
        by: [f64; 2],
    },
    /// The transfer function and the window as they were at first.
    ResetColours,
    /// Lets a class of the transfer function look otherwise; what isn't said is as the transfer function has it.
    Class {
        /// Which.
        class: u16,
        /// Whether it isn't drawn.
        #[serde(default)]
        hidden: bool,
        /// Opacity over the transfer function's reference length, 0…1.
        #[serde(default)]
        opacity: Option<f64>,
        /// Colour, `#rrggbb`.
        #[serde(default)]
        colour: Option<String>,
    },
    /// Draws all classes of the transfer function, or none.
    AllClasses {
        /// Whether none is drawn.
        hidden: bool,
    },
    /// Goes through slices.
    Slice {
        /// In which pane.
        pane: Pane,
        /// By how many.
        steps: i32,
    },
    /// Puts the crosshair at a place.
    Cross {
        /// In which pane.
        pane: Pane,
        /// Where.
        at: [f64; 2],
    },
    /// Cuts the volume's picture open where the slices meet: along the slice of a pane, or square to the line of sight for the volume's own. What lies on the
    /// viewer's side isn't drawn. Where they meet near the body's edge, they go to its middle first.
    Cut {
        /// Along which; `None` for the whole volume.
        #[serde(default)]
        along: Option<Pane>,
    },
    /// Brings the slices where least is left of the volume, with colours over them that tell how much.
    ShowSqueezed,
    /// Colours over the slices.
    Overlay {
        /// What they tell of; `None` for none.
        #[serde(default)]
        of: Option<Overlay>,
    },
    /// Shows the body at rest, in the place of what it is now or beside it.
    Compare {
        /// Which of both.
        shows: Shows,
        /// Where the line lies that divides both, as a share of each pane's width.
        #[serde(default = "middle")]
        at: f64,
    },
    /// Asks what lies there.
    Hover {
        /// In which pane.
        pane: Pane,
        /// Where.
        at: [f64; 2],
    },
    /// Measures along a line that is drawn over a picture; one that begins at an end of another makes an angle with it.
    Measure {
        /// In which pane.
        pane: Pane,
        /// Where the line begins.
        from: [f64; 2],
        /// Where it ends.
        to: [f64; 2],
    },
    /// Measures between two places, or the angle at the second of three.
    Ruler {
        /// In the place of this ruler, else as one more.
        #[serde(default)]
        ruler: Option<u32>,
        /// They, as they are shown.
        places: Vec<[f64; 3]>,
    },
    /// Takes a ruler away.
    Unmeasure {
        /// Which.
        ruler: u32,
    },
    /// Takes hold of the handle there, or of a new one on the lattice.
    Grab {
        /// In which pane.
        pane: Pane,
        /// Where.
        at: [f64; 2],
    },
    /// Moves what is held to where the pointer is.
    Drag {
        /// Where that is.
        to: [f64; 2],
        /// Keeps to an axis.
        #[serde(default)]
        lock: Option<Axis>,
    },
    /// Begins to turn a slider: what follows until it is let go of, by a drop, is one step.
    Adjust,
    /// Lets go of what is held: one step, to be undone at once.
    Drop,
    /// Goes back to what was before the drag.
    Abandon,
    /// Radius of the next handle, and of the one that is held or named.
    Radius {
        /// Of this handle.
        #[serde(default)]
        handle: Option<u32>,
        /// Radius (mm).
        radius: f64,
    },
    /// Makes the radius larger or smaller by tenths.
    Wheel {
        /// How often.
        steps: i32,
    },
    /// A handle more.
    Add {
        /// Where, at rest.
        place: [f64; 3],
        /// How far it moves.
        by: [f64; 3],
    },
    /// Moves a handle, counted from rest.
    Move {
        /// Which.
        handle: u32,
        /// How far.
        by: [f64; 3],
    },
    /// Pulls a handle with a force.
    Pull {
        /// Which.
        handle: u32,
        /// The force (mN, RAS).
        with: [f64; 3],
    },
    /// Takes a handle away.
    Remove {
        /// Which.
        handle: u32,
    },
    /// Holds what is there where it is.
    Pin {
        /// In which pane.
        pane: Pane,
        /// Where.
        at: [f64; 2],
    },
    /// Lets a pin go.
    Release {
        /// Which.
        fix: u32,
    },
    /// Cuts open what is shown, or changes the cut that there is: a displacement has one.
    Incise {
        /// Middle of the cut, where it is now.
        centre: [f64; 3],
        /// Across it; what lies there goes that way, the rest goes the other.
        normal: [f64; 3],
        /// Where it ends.
        radius: f64,
        /// How far its lips are apart in the middle.
        open: f64,
    },
    /// Cuts open what is shown along a line that was drawn over it, straight away from whoever looks: the line is the cut's mouth.
    Stroke {
        /// In which pane.
        pane: Pane,
        /// Where the line begins.
        from: [f64; 2],
        /// Where it ends.
        to: [f64; 2],
    },
    /// Opens the cut that there is more or less, and lets it end elsewhere; its middle stays where it is.
    Open {
        /// Which.
        space: u32,
        /// Where it ends.
        radius: f64,
        /// How far its lips are apart in the middle.
        open: f64,
    },
    /// Takes a step in space away: a cut closes.
    Close {
        /// Which.
        space: u32,
    },
    /// Keeps what lies on a side of a plane, of the volume itself and not of its picture alone.
    Clip {
        /// A point of the plane.
        point: [f64; 3],
        /// Towards what is kept.
        normal: [f64; 3],
    },
    /// The same where the slices meet: along the slice of a pane, or square to the line of sight for the volume's own. What lies on the viewer's side goes.
    ClipHere {
        /// Along which.
        along: Pane,
    },
    /// Keeps what lies in a box along the patient's axes.
    ClipBox {
        /// Its lowest corner.
        min: [f64; 3],
        /// Its highest.
        max: [f64; 3],
    },
    /// Puts a plane or a box elsewhere.
    MoveClip {
        /// Which.
        clip: u32,
        /// What is kept now.
        part: ClipPart,
    },
    /// Lets planes and boxes go with the body, or stand still.
    ClipIn {
        /// Where they lie.
        space: Lies,
    },
    /// Shows again what a plane or a box has taken away.
    Unclip {
        /// Which.
        clip: u32,
    },
    /// A bone more along a line that is drawn over a picture: what lies round it moves as one. It turns in the picture's plane about where the line begins; one
    /// that begins at an end of another bone is carried by that.
    DrawBone {
        /// In which pane.
        pane: Pane,
        /// Where the line begins.
        from: [f64; 2],
        /// Where it ends.
        to: [f64; 2],
    },
    /// A bone more between two places, as they are shown; it turns about the first, along z.
    Bone {
        /// One end.
        from: [f64; 3],
        /// The other.
        to: [f64; 3],
    },
    /// Lets a bone hold more, or less.
    SetBone {
        /// Which.
        bone: u32,
        /// How far from its middle, or its line.
        radius: f64,
        /// How far from that others may follow.
        reach: f64,
    },
    /// Lets a bone turn about where the slices meet.
    Joint {
        /// Which.
        bone: u32,
    },
    /// Makes a bone soft again.
    RemoveBone {
        /// Which.
        bone: u32,
    },
    /// Moves a bone, counted from rest.
    Turn {
        /// Which.
        bone: u32,
        /// Point that it turns about.
        pivot: [f64; 3],
        /// Direction of its axis.
        axis: [f64; 3],
        /// Degrees, counter-clockwise as seen from the axis' tip.
        angle: f64,
        /// How far the pivot goes.
        by: [f64; 3],
    },
    /// Stops what is worked on now: it comes to nothing. Takes no turn of its own.
    Stop,
    /// What was asked for so far of what is drawn (looks, rulers) is how it begins: it isn't undone.
    Restored,
    /// Undoes the last step.
    Undo,
    /// Does it again.
    Redo,
    /// Takes all handles, pins, shapes, bones and steps in space away.
    Reset,
    /// Another level of the lattice.
    Level {
        /// Which.
        level: u8,
    },
    /// Stiffness of the springs.
    Stiffness {
        /// N/m.
        stiffness: f64,
    },
    /// Stiffness of the springs of a class; only with springs, and where classes are known.
    Material {
        /// Which.
        class: u16,
        /// N/m.
        stiffness: f64,
    },
    /// Another way in which the lattice follows.
    Solver {
        /// Which.
        solver: SolverName,
    },
    /// Another way to carry the motion to the voxels.
    Map {
        /// Which.
        map: MapName,
    },
    /// How the motion fades with depth; only where voxels follow what is nearest.
    Depth {
        /// How.
        weight: DepthWeight,
    },
    /// Asks for something to keep.
    Save {
        /// What.
        what: Saved,
    },
}
