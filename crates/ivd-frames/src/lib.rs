//! What a window onto a session shows and does, without a window: a [`Model`] follows [`Request`]s (the camera is turned, a handle dragged, a level
//! changed) and draws panes; a [`Service`] runs one on a thread of its own and publishes [`Frame`]s.
//!
//! A handle is taken hold of where it is seen, in the volume's picture or in a slice, and moved with the pointer; the picked place goes back through the
//! deformation to where it was at rest, so that handles can be put on what has been deformed. What can't be deformed as asked stays as it was, and the
//! figures say why and how far the hand is ahead.
//!
//! What a model shows follows from its subject and settings alone: [`Subject::scene_of`] is the scene from which `ivd pipeline` makes the same voxels.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]

mod bare;
mod bounds;
mod colours;
mod compared;
mod error;
mod figures;
mod log;
mod made;
mod model;
mod opening;
mod overlay;
mod panes;
mod planes;
mod preview;
mod queue;
mod request;
mod save;
mod service;
mod sight;
mod source;
mod subject;
mod tools;

pub use error::Error;
pub use ivd_field::clip::{Cuboid, HalfSpace};
pub use ivd_field::lies::Lies;
pub use ivd_map::DepthWeight;
pub use ivd_session::{ClipPart, Entry};

pub use compared::{Compared, Shows};
pub use figures::{
    Bone, Class, Clipped, Figures, Hovered, Incision, Matter, Missed, Refused, Ruler, SEEN_ASIDE, Slice, Spot,
};
pub use log::Log;
pub use made::Made;
pub use model::{Model, Outline, Patience};
pub use opening::{Begun, Line, Tell};
pub use overlay::{Overlay, Scale};
pub use preview::{Scan, VolumeAtRest};
pub use queue::Client;
pub use request::{Axis, MapName, Pane, Request, Saved, SolverName};
pub use save::File;
pub use service::{Frame, Output, Picture, Service, TOO_MUCH};
pub use sight::Sight;
pub use source::{Opened, Source, demo_scene};
pub use subject::{ShownBy, Subject, bare_scene, in_few_digits};
pub use tools::{KEYS, NOTICE, Tool, WEIGHTS};
