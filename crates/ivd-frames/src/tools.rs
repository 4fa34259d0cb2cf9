//! The tools, and what hands do with them, for whoever shows a window: one table for all of them.

use crate::{DepthWeight, MapName, Saved, SolverName};

/// What the left button does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tool {
    /// Turns the volume; in slices it puts the cross hair.
    Turn,
    /// Takes hold of a handle.
    Handle,
    /// Holds what is there.
    Pin,
    /// Cuts open along a line.
    Incise,
    /// Makes a bone along a line.
    Bone,
    /// Measures along a line.
    Measure,
    /// Brightness, contrast, colours.
    Brightness,
}

impl Tool {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Turn, Self::Handle, Self::Pin, Self::Incise, Self::Bone, Self::Measure, Self::Brightness];

    /// Its name.
    pub fn word(self) -> &'static str {
        match self {
            Self::Turn => "Turn",
            Self::Handle => "Handle",
            Self::Pin => "Pin",
            Self::Incise => "Incise",
            Self::Bone => "Bone",
            Self::Measure => "Measure",
            Self::Brightness => "Brightness",
        }
    }

    /// How it is used, in a few words.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Turn => "drag the volume to turn it, in a slice to move the cross hair",
            Self::Handle => "drag from a surface in any picture; wheel over an existing handle: its radius",
            Self::Pin => "press, in any picture, on what is to stay where it is",
            Self::Incise => {
                "draw a line over the body, in any picture: it is cut as deep as half the line is long"
            }
            Self::Bone => {
                "draw a line along it: what lies round it moves as one; from a bone's end: their joint"
            }
            Self::Measure => "draw a line: its length; from a line's end: the angle",
            Self::Brightness => "drag over a picture: its contrast and brightness",
        }
    }

    /// The key that chooses it.
    pub fn key(self) -> char {
        match self {
            Self::Turn => 't',
            Self::Handle => 'h',
            Self::Pin => 'p',
            Self::Incise => 'i',
            Self::Bone => 'j',
            Self::Measure => 'm',
            Self::Brightness => 'b',
        }
    }
}

/// The keys and buttons that every window has: which, and what they do.
pub const KEYS: [(&str, &str); 15] = [
    ("Turn", "left: turn the volume, cross hair in slices"),
    ("middle, or Shift and left", "move the picture"),
    ("right, or the wheel", "zoom; in slices the wheel goes through them"),
    (
        "Handle",
        "left: take hold of what is at the ring, the nearest vertex of the surface that is pointed at, and drag; the wheel changes the radius meanwhile; X, Y, Z keep to an axis, N to straight in and out of the surface (where that faces you, up is in and down is out); Esc cancels",
    ),
    ("Pin", "left: hold what is there"),
    (
        "Incise",
        "left: draw a line over the body, in a slice or in the volume: it is cut open along it, straight away from you, as deep as half the line is long",
    ),
    (
        "Measure",
        "left: draw a line, in a slice or between two places of the volume: its length; from an end of another line: the angle there; Esc cancels. It edits nothing",
    ),
    ("Brightness", "left: in slices brightness and contrast, in the volume its colours"),
    ("T, H, P, I, M, B", "the tools Turn, Handle, Pin, Incise, Measure, Brightness"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo"),
    ("Esc", "gives up what is held; else stops what is worked on"),
    (
        "O, W",
        "the body at rest, and deformed again; pictures divided at a line that can be dragged: at rest, deformed",
    ),
    ("1, 3, 7, 0", "from the front, the left, the top; whole"),
    (
        "Look inside",
        "leaves out of the volume's picture what lies before the place where the slices meet; go through slices, or put the cross hair elsewhere, to move it",
    ),
    ("arrows", "turn, or go through slices"),
];

/// What stands in every window: what is seen is no diagnosis.
pub const NOTICE: &str = "For research, not for diagnosis.";

impl MapName {
    /// As scenes and figures call it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Octree => "octree",
            Self::Biharmonic => "biharmonic",
        }
    }

    /// All of them.
    pub const ALL: [Self; 2] = [Self::Octree, Self::Biharmonic];

    /// How it is called in a window: how the voxels follow.
    pub fn word(self) -> &'static str {
        match self {
            Self::Octree => "nearest",
            Self::Biharmonic => "smoothest",
        }
    }
}

/// How the motion fades with depth, with what that is called in a window.
pub const WEIGHTS: [(DepthWeight, &str); 4] = [
    (DepthWeight::Smooth, "smoothly"),
    (DepthWeight::Linear, "evenly"),
    (DepthWeight::Exponential, "soon"),
    (DepthWeight::One, "not at all"),
];

impl SolverName {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Ring, Self::Springs];

    /// How it is called in a window: by what the lattice follows.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ring => "distance alone",
            Self::Springs => "springs",
        }
    }
}

impl Saved {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Scene,
        Self::Volume,
        Self::Whole,
        Self::Labels,
        Self::Displacement,
        Self::Lattice,
        Self::Picture,
        Self::Log,
    ];

    /// How it is called in a window.
    pub fn word(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Volume => "deformed volume",
            Self::Whole => "deformed volume, unclipped",
            Self::Labels => "deformed labels",
            Self::Displacement => "displacement",
            Self::Lattice => "lattice",
            Self::Picture => "picture",
            Self::Log => "log",
        }
    }

    /// What its file may be called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene.toml",
            Self::Volume | Self::Whole => "deformed.nii.gz",
            Self::Labels => "deformed-labels.nii.gz",
            Self::Displacement => "inverse.nrrd",
            Self::Lattice => "lattice.ply",
            Self::Picture => "picture.png",
            Self::Log => "session.jsonl",
        }
    }
}
