//! What is told beside the pictures.

use ivd_core::{Grid, Volume, VoxelCoord, VoxelIndex, World};
use ivd_field::lies::Lies;
use ivd_map::DepthWeight;
use ivd_render::Lens;
use ivd_session::ClipPart;
use serde::Serialize;

use crate::request::MapName;
use crate::{Compared, Made, Overlay, Pane, ShownBy};

/// Sine of the angle to the line of sight from which on the way into a surface is seen aside (30°): nearer to it a drag along [`Axis::N`](crate::Axis::N) presses in by a way up,
/// and pulls out by one down.
pub const SEEN_ASIDE: f64 = 0.5;

/// A handle or a pin, and where the panes show it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spot {
    /// What it is called by.
    pub id: u32,
    /// Its vertex at rest (mm, RAS).
    pub rest: [f64; 3],
    /// How far that is from what was pointed at (mm).
    pub away_mm: f64,
    /// Where that is now.
    pub now: [f64; 3],
    /// How far a handle is told to move it (mm).
    pub by: Option<[f64; 3]>,
    /// What force it pulls it with (mN).
    pub with: Option<[f64; 3]>,
    /// Reach (mm).
    pub radius: f64,
    /// Where each pane shows it, as shares.
    pub at: [Option<[f64; 2]>; 4],
    /// How many slices it lies before or behind each slice.
    pub off: [f64; 3],
    /// The direction out of the surface about a handle, as it lies at rest; none where it has no side.
    pub out: Option<[f64; 3]>,
    /// Where each pane shows the place half its reach into the surface from it, as shares.
    pub inwards: [Option<[f64; 2]>; 4],
    /// How far the voxels about it have gone (mm): less than the vertex where more would fold. Not told where free forms or steps in space move them as well.
    pub gone: Option<[f64; 3]>,
    /// Whether each pane shows it: a slice that it reaches, the volume where what is seen before it is no further away than its radius.
    pub seen: [bool; 4],
    /// Whether it lies beside each pane's slice, or behind what the volume shows there.
    pub beside: [bool; 4],
}

/// What lies under the pointer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hovered {
    /// Where the pointer is.
    pub pane: Pane,
    /// What is shown there (mm, RAS).
    pub place: [f64; 3],
    /// Where that was at rest.
    pub rest: [f64; 3],
    /// Its value.
    pub value: Option<f64>,
    /// Its class, where classes are known.
    pub class: Option<u16>,
    /// By how many times its volume has grown, while colours tell of that.
    pub times: Option<f64>,
    /// The handle that would be taken hold of.
    pub handle: Option<u32>,
    /// The vertex that a new handle would take, at rest; `None` where the lattice is too far.
    pub vertex: Option<[f64; 3]>,
    /// Where each pane shows that vertex where it is now, as shares.
    pub vertex_at: [Option<[f64; 2]>; 4],
    /// How far it is from the place at rest (mm).
    pub away_mm: Option<f64>,
    /// Where each pane shows the place, as shares.
    pub at: [Option<[f64; 2]>; 4],
}

impl Hovered {
    /// What lies at a place of a volume at rest, where nothing can be taken hold of; `at`: where the panes show it.
    pub(crate) fn at_rest(pane: Pane, place: [f64; 3], volume: &Volume, at: [Option<[f64; 2]>; 4]) -> Self {
        Self {
            pane,
            place,
            rest: place,
            value: value_at(volume, place),
            class: None,
            times: None,
            handle: None,
            vertex: None,
            vertex_at: [None; 4],
            away_mm: None,
            at,
        }
    }
}

/// The cut that there is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Incision {
    /// Its number among the steps in space.
    pub id: u32,
    /// Its middle (mm, RAS).
    pub centre: [f64; 3],
    /// Across it, of length 1.
    pub normal: [f64; 3],
    /// Where it ends (mm).
    pub radius: f64,
    /// How far its lips are apart in the middle (mm).
    pub open: f64,
    /// Where each pane shows the ends of its mouth, before it opens, as shares; `None` where the pane lies along it or beside it.
    pub at: [Option<[[f64; 2]; 2]>; 4],
}

/// Two or three places that a length, or two with the angle between them, are measured at. They go with the body.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ruler {
    /// What it is called by.
    pub id: u32,
    /// The places (mm, RAS); of three the angle is at the second.
    pub now: Vec<[f64; 3]>,
    /// Where they were at rest.
    pub rest: Vec<[f64; 3]>,
    /// From each place to the next (mm).
    pub mm: Vec<f64>,
    /// The same at rest.
    pub rest_mm: Vec<f64>,
    /// The angle, where there are three.
    pub degrees: Option<f64>,
    /// The same at rest.
    pub rest_degrees: Option<f64>,
    /// Where each pane shows each place, as shares.
    pub at: Vec<[Option<[f64; 2]>; 4]>,
    /// Whether any of the places lies beside each pane's slice, or behind what the volume shows there.
    pub beside: [bool; 4],
}

/// A plane or a box that clips.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Clipped {
    /// What it is called by.
    pub id: u32,
    /// What is kept.
    pub part: ClipPart,
}

/// A bone, and how it is moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bone {
    /// What it is called by.
    pub id: u32,
    /// Its name.
    pub name: String,
    /// Point that it turns about (mm, RAS); none where neither that nor where it lies is said, but a class alone.
    pub pivot: Option<[f64; 3]>,
    /// Direction of its axis.
    pub axis: [f64; 3],
    /// How far it is turned (degrees).
    pub angle: f64,
    /// How far the pivot goes (mm).
    pub by: [f64; 3],
    /// Whether another bone carries it: then it turns and goes nowhere by itself.
    pub carried: bool,
    /// Whether it goes where the handles on it go.
    pub fitted: bool,
    /// How far from its middle, or its line, it holds what is there (mm); none where something else says that.
    pub radius: Option<f64>,
    /// How far from that others may follow (mm).
    pub reach: f64,
    /// Where each pane shows the ends of the line that it lies along, as shares.
    pub at: [Option<[[f64; 2]; 2]>; 4],
    /// Whether one of these lies beside each pane's slice.
    pub beside: [bool; 4],
}

/// A deformation that wasn't possible: what is shown is the last that was.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refused {
    /// Why, and what to do.
    pub why: String,
    /// The same with its figures, where these are left out.
    pub exactly: Option<String>,
    /// How voxels may follow instead: smoothest, which may come further, or what is nearest, which is sooner there.
    pub instead: Option<MapName>,
    /// How far the hand is from what it holds (mm).
    pub ahead_mm: f64,
}

/// A step that couldn't be done again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Missed {
    /// What it is called.
    pub name: String,
    /// Why.
    pub why: String,
}

/// What is told of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Slice {
    /// Its pane.
    pub pane: Pane,
    /// What lies to the left, right, top and bottom, where the file says where the patient lies.
    pub letters: Option<[&'static str; 4]>,
    /// Width and height (mm).
    pub extent_mm: [f64; 2],
    /// Which it is, from 0.
    pub slice: usize,
    /// How many there are.
    pub slices: usize,
    /// Whether planes or boxes take something of it away.
    pub clipped: bool,
    /// By how much it is turned out of the plane of the patient that it is named by (degrees), where that is known and is seen.
    pub oblique: Option<f64>,
}

/// How stiff a class is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Matter {
    /// Its number.
    pub class: u16,
    /// Stiffness of its springs (N/m); `None` where it is told otherwise, by a Young's modulus or a tissue.
    pub stiffness: Option<f64>,
}

/// How a class is drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Class {
    /// Its number.
    pub id: u16,
    /// Its name, where it has one.
    pub name: Option<String>,
    /// How much of it there is (ml), where that is known.
    pub ml: Option<f64>,
    /// How much of the surface that is moved it has, 0…1; `None` where classes aren't known.
    pub of_surface: Option<f64>,
    /// Values that it is seen at.
    pub values: [f64; 2],
    /// Whether it isn't drawn.
    pub hidden: bool,
    /// Opacity over the transfer function's reference length, 0…1.
    pub opacity: f64,
    /// Colour, `#rrggbb`.
    pub colour: String,
}

/// What is told beside the pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Of the volume's pane (pixels).
    pub size: [usize; 2],
    /// Azimuth and elevation (degrees).
    pub angles: [f64; 2],
    /// How far the camera is turned about its line of sight (degrees).
    pub roll: f64,
    /// Magnification.
    pub zoom: f64,
    /// What lies in the middle of the volume's pane (mm, RAS).
    pub middle: [f64; 3],
    /// What the volume's pane is wide, where the camera looks (mm).
    pub width_mm: f64,
    /// What lies to the left, right, top and bottom of the volume's pane.
    pub letters: Option<[&'static str; 4]>,
    /// Handles.
    pub handles: Vec<Spot>,
    /// Pins.
    pub pins: Vec<Spot>,
    /// Bones.
    pub bones: Vec<Bone>,
    /// Numbers of the steps in space, an incision among them.
    pub space: Vec<u32>,
    /// The incision.
    pub incision: Option<Incision>,
    /// What is measured.
    pub rulers: Vec<Ruler>,
    /// Planes and boxes that clip the volume.
    pub clips: Vec<Clipped>,
    /// Where they lie.
    pub clip_space: Lies,
    /// Lowest and highest corner of the volume (mm, RAS).
    pub extent: [[f64; 3]; 2],
    /// The handle that is held.
    pub held: Option<u32>,
    /// Whether the body is shown as it is, at rest, or both.
    pub compare: Compared,
    /// Along which pane the volume's picture is cut open.
    pub cut: Option<Pane>,
    /// Where the slices meet (mm, RAS).
    pub cross: [f64; 3],
    /// The value there.
    pub cross_value: Option<f64>,
    /// By how many times the volume there has grown, while colours tell of that.
    pub cross_times: Option<f64>,
    /// Where the panes show it.
    pub cross_at: [Option<[f64; 2]>; 4],
    /// What lies under the pointer.
    pub hovered: Option<Hovered>,
    /// The slices.
    pub slices: [Slice; 3],
    /// Classes whose look can be changed; none where the picture isn't made by them.
    pub classes: Vec<Class>,
    /// Classes that are only the transition between others: they are drawn as these are.
    pub transitions: Vec<u16>,
    /// Whether something would be lost that no scene was saved of.
    pub unsaved: bool,
    /// What colours over the slices tell of.
    pub overlay: Option<Overlay>,
    /// Values that are black and white in slices.
    pub window: [f64; 2],
    /// What would be undone.
    pub undo: Option<String>,
    /// What would be done again.
    pub redo: Option<String>,
    /// Reach of the next handle (mm).
    pub radius: f64,
    /// Level of the lattice.
    pub level: u8,
    /// Vertices of it.
    pub vertices: usize,
    /// How the lattice follows.
    pub solver: &'static str,
    /// Stiffness (N/m).
    pub stiffness: f64,
    /// Whether it shows: by distance alone where something is pulled with a force.
    pub stiffness_counts: bool,
    /// Classes along the lattice that may be stiffer than others; none where classes aren't known, or the lattice follows by rings.
    pub matter: Vec<Matter>,
    /// Whether classes are known.
    pub knows_classes: bool,
    /// What the volume's picture goes by; classes are parts that a person gave where those are labels.
    pub shown_by: ShownBy,
    /// How the voxels follow.
    pub map: &'static str,
    /// How the motion fades with depth; `None` where that isn't chosen.
    pub depth: Option<DepthWeight>,
    /// Largest motion of a voxel (mm).
    pub largest_mm: f64,
    /// Smallest proven lower bound of the determinant.
    pub min_det_j: f64,
    /// How far the vertices that move most are left behind, relative to their motion.
    pub behind: f64,
    /// How far any vertex is left behind by the voxels about it (mm).
    pub left_mm: f64,
    /// How far the lattice goes beyond the scan's edge, where there are no voxels to show what it takes along (mm).
    pub cut_off_mm: f64,
    /// What the last event took: lattice, displacement, values (s).
    pub times: [f64; 3],
    /// What the last pictures took (s).
    pub draw_s: f64,
    /// Why the last event wasn't followed.
    pub refused: Option<Refused>,
    /// What couldn't be done again when it was opened.
    pub missed: Vec<Missed>,
    /// What the body is made of.
    pub made: Made,
    /// What was chosen for the person.
    pub said: Vec<String>,
}

/// The sides of the patient that lie to the left, right, top and bottom of a picture.
pub(crate) fn letters(lens: &Lens) -> [&'static str; 4] {
    let [right, up, _] = lens.axes();
    let side = |way: [f64; 3]| {
        let axis = (0..3).fold(0, |best, a| if way[a].abs() > way[best].abs() + 1e-9 { a } else { best });
        [["L", "R"], ["P", "A"], ["I", "S"]][axis][usize::from(way[axis] > 0.0)]
    };
    [side(right.map(|c| -c)), side(right), side(up), side(up.map(|c| -c))]
}

/// The value of the voxel nearest to a place (mm, RAS); `None` beside the volume, and where it is no number.
pub(crate) fn value_at(volume: &Volume, place: [f64; 3]) -> Option<f64> {
    voxel_at(volume.grid(), place).map(|voxel| volume.value(voxel)).filter(|value| value.is_finite())
}

/// The voxel nearest to a place (mm, RAS); `None` beside the grid.
pub(crate) fn voxel_at(grid: &Grid, place: [f64; 3]) -> Option<VoxelIndex> {
    let VoxelCoord(voxel) = grid.voxel(World(place.into()));
    grid.nearest_voxel(voxel)
}
