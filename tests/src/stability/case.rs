//! A case: a volume, how every stage is asked, and which refusals are right.

use ivd_core::{ErrorClass, Labels, Lattice, Volume};
use ivd_field::shape::Shape;
use ivd_field::warp::WarpParams;
use ivd_lattice::refine::RefineParams;
use ivd_map::OctreeParams;
use ivd_motion::handles::{Handle, Pin};
use ivd_motion::mass_spring;
use ivd_motion::rigid;
use ivd_motion::ring::RingParams;
use ivd_render::{RenderParams, View};

/// A stage of the pipeline, in the order in which they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// k-means on intensity.
    Segment,
    /// Classes between given values.
    Threshold,
    /// k-means on position and intensity.
    KmvsSpatial,
    /// A mixture on intensity.
    Emvs,
    /// The same with coupled neighbours.
    EmvsSmooth,
    /// A mixture on position and intensity, independent of each other.
    EmvsDiagonal,
    /// The same, together.
    EmvsFull,
    /// Mean shift on intensity.
    Msvs,
    /// Mean shift on position and intensity.
    MsvsJoint,
    /// Mean shift, then k-means.
    MsvsKmvs,
    /// A tree by Ward, cut.
    HvsWard,
    /// A tree by single linkage, cut.
    HvsSingle,
    /// Automatic transfer function.
    Atf,
    /// Isolation of a part.
    Boundary,
    /// Extraction of the lattice.
    Lattice,
    /// Lattices of all classes at once.
    Parts,
    /// Refinement.
    Refine,
    /// The same by decimation.
    RefineDecimate,
    /// The same by levels after Loop.
    RefineLoop,
    /// The same by merging vertices.
    RefineMerge,
    /// The same by coarser sampling.
    RefineSample,
    /// Octree.
    Octree,
    /// Motion of the lattice.
    Deform,
    /// The same by masses on springs, explicit steps.
    DeformDynamics,
    /// The same in balance.
    DeformBalance,
    /// The same by implicit steps.
    DeformImplicit,
    /// The same by constraints.
    DeformXpbd,
    /// The same by free forms.
    DeformShapes,
    /// Motion of the voxels.
    Map,
    /// The same by the smoothest field.
    MapBiharmonic,
    /// The same by elastic matter.
    MapFem,
    /// Inverse of the map.
    Inverse,
    /// Deformed volume, labels and mask.
    Warp,
    /// Picture.
    Render,
}

impl Stage {
    /// The stage that does the same in the pipeline's own way.
    #[must_use]
    pub fn first_of_its_kind(self) -> Self {
        match self {
            Self::DeformDynamics | Self::DeformBalance | Self::DeformImplicit | Self::DeformXpbd => {
                Self::Deform
            }
            Self::MapBiharmonic | Self::MapFem => Self::Map,
            other => other,
        }
    }
}

/// Which surface the lattice is cut from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// The isolated part, placed by its class's crossings.
    Part,
    /// The border of the mask.
    Mask,
    /// A value of the volume, without a mask.
    Value(f64),
}

/// Groups that the other ways to cluster, to thin out, to deform and to map take turns in, where a case doesn't call them all: they
/// would cost more than the rest.
pub const TURNS: usize = 5;

/// How the stages are asked.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Classes of the segmentation.
    pub k: usize,
    /// Which of the other ways have their turn, of [`TURNS`] groups; `None`: all.
    pub turn: Option<usize>,
    /// Thresholds.
    pub thresholds: Vec<f64>,
    /// Transfer function.
    pub atf: ivd_atf::Params,
    /// Which part.
    pub boundary: ivd_boundary::ComponentParams,
    /// Which surface.
    pub cut: Cut,
    /// Refinement.
    pub refine: RefineParams,
    /// Octree.
    pub octree: ivd_octree::Params,
    /// Handles; the number of a vertex is taken modulo the number of vertices.
    pub handles: Vec<Handle>,
    /// Vertices that stay, numbered in the same way.
    pub fixed: Vec<Pin>,
    /// Rings.
    pub ring: RingParams,
    /// Masses on springs; their solver is every one in turn.
    pub springs: mass_spring::Params,
    /// Labels that say what springs are made of.
    pub materials: Option<Labels>,
    /// Bones in what springs hold.
    pub bones: Vec<rigid::BoneSpec>,
    /// Free forms.
    pub shapes: Vec<Shape>,
    /// Map.
    pub map: OctreeParams,
    /// Warp.
    pub warp: WarpParams,
    /// Picture.
    pub render: RenderParams,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            k: 3,
            turn: None,
            thresholds: vec![0.5],
            atf: ivd_atf::Params { resolution: 64, ..ivd_atf::Params::default() },
            boundary: ivd_boundary::ComponentParams::default(),
            cut: Cut::Part,
            refine: RefineParams {
                target: ivd_lattice::refine::Target::Level(1).into(),
                ..RefineParams::default()
            },
            octree: ivd_octree::Params::default(),
            handles: Vec::new(),
            fixed: Vec::new(),
            ring: RingParams { dt: Some(0.2 / 40.0), ..RingParams::default() },
            springs: mass_spring::Params {
                springs: mass_spring::Springs {
                    duration: 0.01,
                    dt: Some(0.01 / 4.0),
                    grip: Some(0.0),
                    ..mass_spring::Springs::default()
                },
                closeness: mass_spring::Closeness { max_iterations: 20, ..mass_spring::Closeness::default() },
                ..mass_spring::Params::default()
            },
            materials: None,
            bones: Vec::new(),
            shapes: Vec::new(),
            map: OctreeParams::default(),
            warp: WarpParams::default(),
            render: RenderParams {
                size: [20, 14],
                view: View::FRONT,
                annotate: false,
                ..RenderParams::default()
            },
        }
    }
}

/// A refusal that a case allows or asks for.
pub type Refused = (Stage, ErrorClass);

/// A case.
#[derive(Debug)]
pub struct Case {
    /// What is awkward about it.
    pub name: String,
    /// The volume.
    pub volume: Volume,
    /// A lattice that stands in for the extracted one.
    pub lattice: Option<Lattice>,
    /// How the stages are asked.
    pub setup: Setup,
    /// Refusals that are right but need not happen.
    pub may: Vec<Refused>,
    /// Refusals that must happen.
    pub must: Vec<Refused>,
}

impl Case {
    /// A case without handles, from which no refusal is expected.
    pub fn new(name: impl Into<String>, volume: Volume) -> Self {
        Self {
            name: name.into(),
            volume,
            lattice: None,
            setup: Setup::default(),
            may: Vec::new(),
            must: Vec::new(),
        }
    }

    /// The case with other questions.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Setup)) -> Self {
        change(&mut self.setup);
        self
    }

    /// The case on a given lattice.
    #[must_use]
    pub fn on(mut self, lattice: Lattice) -> Self {
        self.lattice = Some(lattice);
        self
    }

    /// The case where some refusals are right.
    #[must_use]
    pub fn may(mut self, refusals: &[Refused]) -> Self {
        self.may.extend(refusals);
        self
    }

    /// The case where some refusals must happen.
    #[must_use]
    pub fn must(mut self, refusals: &[Refused]) -> Self {
        self.must.extend(refusals);
        self
    }
}
