use std::path::Path;

use ivd_core::op::{Place, PlaceKind, Want};
use ivd_lattice::extract;
use ivd_volume::{RawLayout, ReadOptions, phantom};

use crate::scene::{InputSection, Loaded, Picture, Scene};
use crate::stages::{Import, ImportSource};
use crate::{Error, Section, Stage};

/// The places that a stage can have in a pipeline, in the order in which they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(usize)]
pub enum NodeId {
    /// The volume.
    Import,
    /// The tree of its regions, which classes are cut from.
    Tree,
    /// Its classes.
    Segment,
    /// The isolated part.
    Boundary,
    /// Its lattice.
    Lattice,
    /// The simplified lattice.
    Refine,
    /// The index over it.
    Octree,
    /// Its motion.
    Deform,
    /// The voxels' displacement with the lattice.
    Map,
    /// And without it.
    Space,
    /// The deformed volume.
    Warp,
    /// The transfer function.
    Atf,
    /// The picture at rest.
    Before,
    /// The deformed picture.
    After,
    /// What differs.
    Difference,
}

impl NodeId {
    /// All of them, in the order in which they run.
    pub const ALL: [Self; 15] = [
        Self::Import,
        Self::Tree,
        Self::Segment,
        Self::Boundary,
        Self::Lattice,
        Self::Refine,
        Self::Octree,
        Self::Deform,
        Self::Map,
        Self::Space,
        Self::Warp,
        Self::Atf,
        Self::Before,
        Self::After,
        Self::Difference,
    ];

    /// Name of its stage.
    pub fn stage(self) -> &'static str {
        match self {
            Self::Import => "import",
            Self::Tree | Self::Segment => "segment",
            Self::Boundary => "boundary",
            Self::Lattice => "lattice",
            Self::Refine => "refine",
            Self::Octree => "octree",
            Self::Deform => "deform",
            Self::Map => "map",
            Self::Space => "space",
            Self::Warp => "warp",
            Self::Atf => "atf",
            Self::Before | Self::After | Self::Difference => "render",
        }
    }

    /// Its stage, where that is on the list.
    fn declared(self) -> Option<&'static ivd_core::op::Stage> {
        crate::list::stage(self.stage())
    }

    /// Which use of the stage it is; empty for the only one.
    pub fn variant(self) -> &'static str {
        match self {
            Self::Tree => "tree",
            Self::Before => "before",
            Self::After => "after",
            Self::Difference => "difference",
            _ => "",
        }
    }

    /// The place that the output file of a scene's key is made from.
    pub(crate) fn of_output(key: &str, scene: &Scene) -> Self {
        match key {
            "volume" => Self::Warp,
            "lattice_extracted" => Self::Lattice,
            "lattice" => Self::Refine,
            "displacement" => Self::of_displacement(scene),
            "labels" => Self::Segment,
            "mask" => Self::Boundary,
            _ => Self::Deform,
        }
    }

    /// The place of a scene's last displacement.
    pub(crate) fn of_displacement(scene: &Scene) -> Self {
        if is_idle(scene, &ivd_deform::space::STAGE) { Self::Map } else { Self::Space }
    }

    /// The picture that it draws.
    pub fn of_picture(picture: Picture) -> Self {
        match picture {
            Picture::Before => Self::Before,
            Picture::After => Self::After,
            Picture::Difference => Self::Difference,
        }
    }
}

/// A slot and the place that fills it.
type Source = (&'static str, NodeId);

/// One place of the graph.
pub struct PlanNode {
    /// Which.
    pub id: NodeId,
    /// Its stage; `None` where the scene gives it nothing to do.
    pub stage: Option<Box<dyn Stage>>,
    /// Slots and where they are filled from.
    pub inputs: Vec<Source>,
    /// Whether some output needs it.
    pub needed: bool,
    /// Who needs it, or why nobody does.
    pub why: String,
}

impl PlanNode {
    /// Whether a report of the run names it: a tree that the scene's method doesn't have is no stage of it, nor are steps that it
    /// doesn't have.
    pub(crate) fn is_told(&self) -> bool {
        let is_quiet = self.id.declared().is_some_and(|stage| stage.quiet);
        self.stage.is_some() || !(is_quiet || self.id == NodeId::Tree)
    }
}

/// The graph of a scene.
pub struct Plan {
    nodes: Vec<PlanNode>,
}

impl Plan {
    /// The graph of a scene, with what its outputs need marked. `input` stands in for the scene's input; `until`
    /// makes a stage the only output.
    ///
    /// # Errors
    /// Parameters that don't fit together.
    pub fn new(loaded: &Loaded, input: Option<&Path>, until: Option<&str>) -> Result<Self, Error> {
        let scene = &loaded.scene;
        let mut plan = Self { nodes: wire(scene, import(loaded, input)?) };
        match until {
            Some(stage) => plan.want_stage(stage)?,
            None => plan.want_outputs(scene)?,
        }
        plan.explain_rest(scene);
        Ok(plan)
    }

    /// All places, in the order in which they run.
    pub fn nodes(&self) -> &[PlanNode] {
        &self.nodes
    }

    /// Gives every place the stage that another scene of the same outputs has there.
    pub(crate) fn retune(&mut self, loaded: &Loaded, input: Option<&Path>) -> Result<(), Error> {
        let fresh = wire(&loaded.scene, import(loaded, input)?);
        for (node, new) in self.nodes.iter_mut().zip(fresh) {
            node.stage = new.stage;
        }
        Ok(())
    }

    /// One place.
    pub fn node(&self, id: NodeId) -> &PlanNode {
        &self.nodes[id as usize]
    }

    /// Marks every place that has a stage, whoever needs it.
    pub(crate) fn want_everything(&mut self) {
        for id in NodeId::ALL.into_iter().filter(|&id| self.node(id).stage.is_some()).collect::<Vec<_>>() {
            self.need(id, "nothing: skipping is switched off");
        }
    }

    fn want_stage(&mut self, stage: &str) -> Result<(), Error> {
        let found: Vec<NodeId> = NodeId::ALL
            .into_iter()
            .filter(|id| id.stage() == stage && self.node(*id).stage.is_some())
            .collect();
        if found.is_empty() {
            let known = stage_names();
            return Err(Error::usage(
                "pipeline",
                format!("--until {stage}: not a stage of this scene; stages are {known}"),
            ));
        }
        for id in found {
            self.need(id, &format!("--until {stage}"));
        }
        Ok(())
    }

    fn want_outputs(&mut self, scene: &Scene) -> Result<(), Error> {
        for (key, _) in scene.output.files() {
            let id = NodeId::of_output(key, scene);
            if self.node(id).stage.is_none() {
                let problem = format!(
                    "output.{key}: the scene gives {} nothing to do; add its section, or drop the output",
                    id.stage()
                );
                return Err(Error::usage("pipeline", problem));
            }
            self.need(id, &format!("output.{key}"));
            if key == "lattice_deformed" {
                self.need(NodeId::Refine, "output.lattice_deformed");
            }
        }
        for picture in scene.pictures() {
            let asked =
                if scene.output.images.contains(&picture) { "output.images" } else { "output.report" };
            self.need(NodeId::of_picture(picture), &format!("{asked} ({})", picture.name()));
        }
        if scene.output.report {
            let moved = NodeId::of_displacement(scene);
            let last = if self.node(moved).stage.is_some() { moved } else { NodeId::Refine };
            self.need(last, "output.report");
        }
        Ok(())
    }

    fn need(&mut self, id: NodeId, why: &str) {
        let node = &mut self.nodes[id as usize];
        if node.needed {
            return;
        }
        node.needed = true;
        node.why = format!("needed for {why}");
        let name = if id.variant().is_empty() {
            id.stage().to_owned()
        } else {
            format!("{} {}", id.stage(), id.variant())
        };
        for (_, from) in node.inputs.clone() {
            self.need(from, &name);
        }
    }

    fn explain_rest(&mut self, scene: &Scene) {
        for node in self.nodes.iter_mut().filter(|n| !n.needed) {
            let declared = node.id.declared();
            let nothing = declared.filter(|_| node.stage.is_none()).and_then(|stage| idle(scene, stage));
            let unread = declared.map_or("", |stage| stage.unread);
            let why = match node.id {
                _ if nothing.is_some() => nothing.unwrap_or_default(),
                NodeId::Segment if !uses_labels(scene) => unread,
                NodeId::Tree if node.stage.is_none() => "the classes come from no tree",
                NodeId::Boundary | NodeId::Atf if node.stage.is_none() => unread,
                NodeId::Octree | NodeId::Map | NodeId::Warp | NodeId::After | NodeId::Difference
                    if node.stage.is_none() =>
                {
                    idle(scene, &ivd_deform::deform::STAGE).unwrap_or("no output needs it")
                }
                NodeId::Octree if !wants(scene, &ivd_deform::map::STAGE, "octree") => unread,
                NodeId::Atf | NodeId::Before | NodeId::After | NodeId::Difference => ivd_render::STAGE.unread,
                _ => "no output needs it",
            };
            why.clone_into(&mut node.why);
        }
    }
}

/// Names of the stages, each once, in the order in which they run.
pub(crate) fn stage_names() -> String {
    let mut names = NodeId::ALL.map(NodeId::stage).to_vec();
    names.dedup();
    names.join(", ")
}

/// Whether the part is found through a class.
fn uses_labels(scene: &Scene) -> bool {
    wants(scene, &extract::STAGE, "labels") || wants(scene, &ivd_boundary::STAGE, "labels")
}

fn import(loaded: &Loaded, input: Option<&Path>) -> Result<Import, Error> {
    let section: &InputSection = &loaded.scene.input;
    let file = input.map(Path::to_owned).or_else(|| section.file.as_ref().map(|f| loaded.folder.join(f)));
    let source = match (file, section.phantom) {
        (Some(path), _) => ImportSource::File { path, options: read_options(section) },
        (None, Some(shape)) => {
            let base = phantom::Params::default();
            ImportSource::Phantom(phantom::Params {
                shape,
                size: section.size.unwrap_or(base.size),
                noise: section.noise,
                voxel_type: section.voxel_type.unwrap_or(base.voxel_type),
                seed: section.seed.unwrap_or(base.seed),
            })
        }
        (None, None) => {
            return Err(Error::usage("import", "the scene has no input; give input.file or --input"));
        }
    };
    Ok(Import { source })
}

fn read_options(section: &InputSection) -> ReadOptions {
    ReadOptions {
        raw: section.raw.as_ref().map(|r| RawLayout {
            dims: r.dims,
            voxel_type: r.voxel_type,
            spacing: r.spacing,
            order: r.order,
            skip: r.skip,
        }),
        frame: section.frame,
        series: section.series.clone(),
        spacing: section.spacing,
    }
}

/// Whether a stage of the list has a use for a slot.
fn wants(scene: &Scene, stage: &ivd_core::op::Stage, slot: &str) -> bool {
    scene.section(stage).is_some_and(|section| section.wants(slot) == Want::Yes)
}

/// Why a scene gives a stage of the list nothing to do, where it doesn't.
fn idle(scene: &Scene, stage: &ivd_core::op::Stage) -> Option<&'static str> {
    scene.section(stage)?.job().idle()
}

/// Whether a scene gives a stage of the list nothing to do.
fn is_idle(scene: &Scene, stage: &ivd_core::op::Stage) -> bool {
    idle(scene, stage).is_some()
}

/// A place on the list, with its stage where it has one in the scene.
fn placed(scene: &Scene, id: NodeId) -> Option<(&'static Place, Section)> {
    let stage = id.declared()?;
    let place = stage.places.iter().find(|place| place.variant == id.variant())?;
    Some((place, scene.section(stage)?.at(place)?))
}

/// Those of some slots that a place fills: what it is declared to have whatever its job wants, and what the job reads.
fn filled(place: &Place, section: &Section, slots: &[Source]) -> Vec<Source> {
    let (with, without) = match place.kind {
        PlaceKind::Own { with, without } => (with, without),
        PlaceKind::Precursor { .. } | PlaceKind::Fixed { .. } => (&[][..], &[][..]),
    };
    let fills = |slot| with.contains(&slot) || (!without.contains(&slot) && section.wants(slot) != Want::No);
    slots.iter().copied().filter(|(slot, _)| fills(*slot)).collect()
}

/// Every place with its stage and where its slots are filled from.
fn wire(scene: &Scene, import: Import) -> Vec<PlanNode> {
    let isolates = uses_labels(scene)
        || scene.section(&ivd_boundary::STAGE).is_some_and(|part| part.written().is_some());
    let (moves, deforms) = (!is_idle(scene, &ivd_deform::deform::STAGE), scene.deforms());
    let coloured = wants(scene, &ivd_render::STAGE, "transfer");

    let volume = ("volume", NodeId::Import);
    let labels = ("labels", NodeId::Segment);
    let lattice = ("lattice", NodeId::Refine);
    let displacement = ("displacement", NodeId::of_displacement(scene));
    let drawn = [volume, ("transfer", NodeId::Atf), displacement];
    let mask = isolates.then_some(("mask", NodeId::Boundary));
    let after = moves.then_some(("after", NodeId::Map));
    let part: Vec<Source> = [volume, labels].into_iter().chain(mask).collect();
    let space: Vec<Source> = [volume].into_iter().chain(after).chain([labels]).collect();

    let boxed = |stage: Section| Box::new(stage) as Box<dyn Stage>;
    let node = |id: NodeId, has_work: bool, slots: &[Source]| {
        let found = placed(scene, id);
        let inputs = found.as_ref().map_or_else(Vec::new, |(place, section)| filled(place, section, slots));
        let stage = found.map(|(_, section)| section);
        let stage = stage.filter(|section| has_work && section.job().idle().is_none()).map(boxed);
        PlanNode { id, stage, inputs, needed: false, why: String::new() }
    };
    vec![
        PlanNode { stage: Some(Box::new(import)), ..node(NodeId::Import, true, &[]) },
        node(NodeId::Tree, true, &[volume]),
        node(NodeId::Segment, true, &[("tree", NodeId::Tree), volume]),
        node(NodeId::Boundary, isolates, &[volume, labels]),
        node(NodeId::Lattice, true, &part),
        node(NodeId::Refine, true, &[("lattice", NodeId::Lattice)]),
        node(NodeId::Octree, moves, &[lattice]),
        node(NodeId::Deform, true, &[lattice, labels]),
        node(NodeId::Map, moves, &[lattice, ("octree", NodeId::Octree), ("motion", NodeId::Deform), labels]),
        node(NodeId::Space, true, &space),
        node(NodeId::Warp, deforms, &[volume, displacement]),
        node(NodeId::Atf, coloured, &[volume, labels]),
        node(NodeId::Before, true, &drawn),
        node(NodeId::After, deforms, &drawn),
        node(NodeId::Difference, deforms, &[("before", NodeId::Before), ("after", NodeId::After)]),
    ]
}
