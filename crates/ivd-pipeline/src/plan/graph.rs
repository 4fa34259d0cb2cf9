use std::path::Path;

use ivd_core::op::{self, Place, PlaceKind, Want};

use super::files::{Named, drawn, import, labelled, met, named};
use crate::list::STAGES;
use crate::scene::{Loaded, OF_FRAMES, PICTURES, Picture, SERIES, SIDE_BY_SIDE, Scene, WIPE};
use crate::stages::IMPORT;
use crate::{Error, Section, Stage};

/// A place of a pipeline: a stage and which of its uses it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId {
    /// Name of its stage.
    pub stage: &'static str,
    /// Which use of the stage it is; empty for the one that the stage is named by.
    pub variant: &'static str,
}

impl NodeId {
    /// The volume's.
    pub const IMPORT: Self = Self { stage: IMPORT, variant: "" };

    /// That of a drawn start.
    pub const START: Self = Self { stage: IMPORT, variant: "start" };

    /// That of labels from a file.
    pub const LABELS: Self = Self { stage: IMPORT, variant: "labels" };

    /// The place that a stage of the list is named by.
    pub const fn of(stage: &op::Stage) -> Self {
        Self { stage: stage.name, variant: "" }
    }

    /// The place that draws a picture.
    pub fn of_picture(picture: Picture) -> Self {
        Self { stage: ivd_render::STAGE.name, variant: picture.name() }
    }
}

/// What the import gives.
const VOLUME: Place = Place::only("volume");
/// What the import of a drawn start gives.
const DRAWN: Place = Place::only(NodeId::START.variant);
/// What the import of labels gives.
const LABELS: Place = Place::only(NodeId::LABELS.variant);
/// Nobody asks for what a place gives.
const UNASKED: &str = VOLUME.unread;
/// What becomes of the volume, from the last of what may be made of it.
const MADE_OF_VOLUME: &[&str] = &["result", "deformed", VOLUME.gives];
/// Output files that are named otherwise than the value that they hold: the first of these that is made.
const RENAMED: [(&str, &[&str]); 7] = [
    ("volume", MADE_OF_VOLUME),
    (SERIES, MADE_OF_VOLUME),
    (PICTURES, &["after"]),
    (SIDE_BY_SIDE, &["after"]),
    (WIPE, &["after"]),
    ("lattice_deformed", &["motion"]),
    ("animation", &["motion"]),
];
/// Outputs of the lattice in motion.
const MOVING: [&str; 2] = ["lattice_deformed", "animation"];
/// The output of what a lattice is refined from.
const UNREFINED: &str = "lattice_extracted";

/// One place of the graph.
pub struct PlanNode {
    /// Which.
    pub id: NodeId,
    /// Its stage; `None` where the scene gives it nothing to do.
    pub stage: Option<Box<dyn Stage>>,
    /// Slots and the places that fill them.
    pub inputs: Vec<(&'static str, NodeId)>,
    /// Places whose values are looked at when it is done.
    pub beside: Vec<NodeId>,
    /// The scene's outputs that are made from it.
    pub outputs: Vec<&'static str>,
    /// Whether some output needs it.
    pub needed: bool,
    /// Who needs it, or why nobody does.
    pub why: String,
    place: Place,
    idle: Option<Idle>,
    unmade: Option<(&'static str, &'static str)>,
    is_quiet: bool,
    /// Whether the scene has its section.
    is_written: bool,
}

/// Why a place has nothing to do.
#[derive(Clone, Copy)]
enum Idle {
    /// As its job says.
    Asked(&'static str),
    /// Nobody gives a value that it goes by.
    Missing(&'static str),
    /// Nobody reads what it gives.
    Unread,
}

impl PlanNode {
    fn new(id: NodeId, place: Place) -> Self {
        Self {
            id,
            stage: None,
            inputs: Vec::new(),
            beside: Vec::new(),
            outputs: Vec::new(),
            needed: false,
            why: String::new(),
            place,
            idle: None,
            unmade: None,
            is_quiet: false,
            is_written: false,
        }
    }

    /// Whether the scene gives it something to do of which no output shows anything, though few scenes have it.
    pub(crate) fn is_in_vain(&self) -> bool {
        self.is_quiet && self.is_written && self.stage.is_some() && !self.needed
    }

    /// Whether a report of the run names it: a tree that the scene's method doesn't have is no stage of it, nor are steps that it
    /// doesn't have, nor a stage of few scenes that it says nothing of.
    pub(crate) fn is_reported(&self) -> bool {
        !self.is_quiet || self.stage.is_some() && (self.is_written || self.needed)
    }

    /// Whether it does the stage's own job, with the scene's parameters.
    pub fn is_own(&self) -> bool {
        matches!(self.place.kind, PlaceKind::Own)
    }

    /// Name of the value that it gives.
    pub(crate) fn gives(&self) -> &'static str {
        self.place.gives
    }

    fn reads(&self, id: NodeId) -> bool {
        self.stage.is_some() && self.asked().any(|from| from == id)
    }

    /// The places that are run for it.
    fn asked(&self) -> impl Iterator<Item = NodeId> {
        let asks = |slot: &str| !self.place.if_made.contains(&slot);
        self.inputs.iter().filter(move |(slot, _)| asks(slot)).map(|(_, from)| *from)
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
        let mut plan = Self { nodes: wire(loaded, input)? };
        plan.check_named()?;
        match until {
            Some(stage) => plan.want_stage(stage)?,
            None => plan.want_outputs(scene)?,
        }
        plan.leave_unmade();
        for at in (0..plan.nodes.len()).filter(|&at| !plan.nodes[at].needed).collect::<Vec<_>>() {
            plan.why_idle(at).clone_into(&mut plan.nodes[at].why);
        }
        Ok(plan)
    }

    /// All places, in the order in which they run.
    pub fn nodes(&self) -> &[PlanNode] {
        &self.nodes
    }

    /// Gives every place the stage that another scene of the same outputs has there.
    ///
    /// # Errors
    /// Parameters that don't fit together.
    pub fn retune(&mut self, loaded: &Loaded, input: Option<&Path>) -> Result<(), Error> {
        let fresh = wire(loaded, input)?;
        for (node, new) in self.nodes.iter_mut().zip(fresh) {
            node.stage = new.stage;
        }
        Ok(())
    }

    /// Whether some output needs a place.
    pub fn needs(&self, id: NodeId) -> bool {
        self.node(id).is_some_and(|node| node.needed)
    }

    /// One place.
    pub fn node(&self, id: NodeId) -> Option<&PlanNode> {
        self.nodes.iter().find(|node| node.id == id)
    }

    /// The needed places, with a slot, whose value is still to be made from that of a place: through others that give a value of the same
    /// name.
    pub(crate) fn heirs(&self, at: usize) -> impl Iterator<Item = (&PlanNode, &'static str)> {
        let (from, mut line) = (&self.nodes[at], vec![self.nodes[at].id]);
        self.nodes[at + 1..].iter().filter(|node| node.needed).filter_map(move |node| {
            let heir =
                node.inputs.iter().find(|(_, id)| line[1..].contains(id)).map(|(slot, _)| (node, *slot));
            let carries_on =
                node.place.gives == from.place.gives && node.inputs.iter().any(|(_, id)| line.contains(id));
            if carries_on {
                line.push(node.id);
            }
            heir
        })
    }

    /// The last of the places whose values are asked for of every frame of a motion.
    pub(crate) fn series(&self) -> Option<usize> {
        self.of_frames().map(|(at, _)| at).max()
    }

    /// The places whose values are asked for of every frame of a motion, with the outputs.
    pub(crate) fn of_frames(&self) -> impl Iterator<Item = (usize, &'static str)> {
        let wanted = |node: &PlanNode| OF_FRAMES.into_iter().find(|key| node.outputs.contains(key));
        let nodes = self.nodes.iter().enumerate().filter(|(_, node)| node.needed);
        nodes.filter_map(move |(at, node)| Some((at, wanted(node)?)))
    }

    /// The place of the motion that moves lattices last.
    pub(crate) fn motion(&self) -> NodeId {
        self.nodes[self.giver("motion")].id
    }

    /// The places that depend on the motion and that what is asked for of every frame is made from, in the order in which they run.
    pub(crate) fn moved(&self) -> Vec<usize> {
        let mut above: Vec<usize> = self.of_frames().map(|(at, _)| at).collect();
        for at in (0..self.nodes.len()).rev().filter(|&at| self.nodes[at].needed) {
            let is_read = above.iter().any(|&by| self.nodes[by].reads(self.nodes[at].id));
            above.extend((is_read && !above.contains(&at)).then_some(at));
        }
        above.sort_unstable();
        let mut line = vec![self.motion()];
        above.retain(|&at| {
            let is_moved = self.nodes[at].inputs.iter().any(|(_, id)| line.contains(id));
            line.extend(is_moved.then_some(self.nodes[at].id));
            is_moved
        });
        above
    }

    /// Lets a picture hold what it would hold with another displacement than it shows; gives the place of that which it had. Nothing is
    /// done to a place that draws none, or whose picture shows no motion.
    pub(crate) fn hold(&mut self, at: usize, held: NodeId) -> Option<NodeId> {
        let node = &mut self.nodes[at];
        if node.id.stage != ivd_render::STAGE.name {
            return None;
        }
        let filled = |slot: &str| node.inputs.iter().find(|(known, _)| *known == slot).map(|(_, id)| *id);
        let (volume, whole) = (filled(ivd_render::VOLUME)?, filled(ivd_render::WHOLE));
        let shown = filled(ivd_render::FRAMING).or(filled(ivd_render::DISPLACEMENT))?;
        node.inputs.retain(|(slot, _)| ![ivd_render::WHOLE, ivd_render::FRAMING].contains(slot));
        node.inputs.push((ivd_render::WHOLE, whole.unwrap_or(volume)));
        node.inputs.push((ivd_render::FRAMING, held));
        Some(shown)
    }

    /// Marks every place that has a stage, whoever needs it.
    pub(crate) fn want_everything(&mut self) {
        for at in (0..self.nodes.len()).filter(|&at| self.nodes[at].stage.is_some()).collect::<Vec<_>>() {
            self.need(at, "nothing: skipping is switched off");
        }
    }

    fn want_stage(&mut self, stage: &str) -> Result<(), Error> {
        let found: Vec<usize> = (0..self.nodes.len())
            .filter(|&at| self.nodes[at].id.stage == stage && self.nodes[at].stage.is_some())
            .collect();
        let idle = self.nodes.iter().position(|node| node.id.stage == stage && node.idle.is_some());
        if let Some(at) = idle.filter(|_| found.is_empty()) {
            let why = self.why_idle(at);
            return Err(Error::usage("pipeline", format!("--until {stage}: there is nothing to do: {why}")));
        }
        if found.is_empty() {
            let known = stage_names();
            return Err(Error::usage(
                "pipeline",
                format!("--until {stage}: not a stage of this scene; stages are {known}"),
            ));
        }
        for at in found {
            self.need(at, &format!("--until {stage}"));
        }
        Ok(())
    }

    fn want_outputs(&mut self, scene: &Scene) -> Result<(), Error> {
        for (key, _) in scene.output.files() {
            let at = self.made_from(key);
            let node = &mut self.nodes[at];
            if node.stage.is_none() {
                let problem = format!(
                    "output.{key}: the scene gives {} nothing to do; add its section, or drop the output",
                    node.id.stage
                );
                return Err(Error::usage("pipeline", problem));
            }
            node.outputs.push(key);
            self.need(at, &format!("output.{key}"));
            let beside = match key {
                _ if MOVING.contains(&key) => "lattice",
                SIDE_BY_SIDE | WIPE => "before",
                _ => continue,
            };
            let beside = self.giver(beside);
            let id = self.nodes[beside].id;
            self.nodes[at].beside.push(id);
            self.need(beside, &format!("output.{key}"));
        }
        for picture in scene.pictures() {
            let at = self.giver(picture.name());
            let is_named = scene.output.images.contains(&picture);
            let asked = if is_named { "output.images" } else { "output.report" };
            self.nodes[at].outputs.extend(is_named.then_some(picture.name()));
            self.need(at, &format!("{asked} ({})", picture.name()));
        }
        if scene.output.report {
            let result = self.giver("result");
            if self.nodes[result].place.gives == "result" && self.nodes[result].stage.is_some() {
                self.nodes[result].outputs.push("report");
                self.need(result, "output.report");
            }
            let [moved, labels, lattice] =
                ["displacement", "labels", "lattice"].map(|value| self.giver(value));
            let moves = self.nodes[moved].stage.is_some();
            let shown = [labels, lattice].map(|at| self.nodes[at].id);
            self.nodes[moved].beside.extend(shown);
            self.nodes[moved].outputs.push("report");
            self.need(if moves { moved } else { self.giver("lattice") }, "output.report");
        }
        Ok(())
    }

    /// The place that gives a value last; where the scene gives none of them anything to do, the first.
    fn giver(&self, value: &str) -> usize {
        let gives = |node: &PlanNode| node.place.gives == value;
        let last = self.nodes.iter().rposition(|node| gives(node) && node.stage.is_some());
        last.or_else(|| self.nodes.iter().position(gives)).unwrap_or_default()
    }

    /// The place that an output file is made from.
    fn made_from(&self, key: &str) -> usize {
        if key == UNREFINED {
            return self.nodes.iter().position(|node| node.place.gives == "lattice").unwrap_or_default();
        }
        let Some((_, values)) = RENAMED.iter().find(|(renamed, _)| *renamed == key) else {
            return self.giver(key);
        };
        let is_made =
            |value: &&&str| self.nodes.iter().any(|node| node.place.gives == **value && node.stage.is_some());
        self.giver(values.iter().find(is_made).unwrap_or(&key))
    }

    /// Refuses a scene that names a value which it doesn't make.
    fn check_named(&self) -> Result<(), Error> {
        let named =
            self.nodes.iter().enumerate().find_map(|(at, node)| Some((at, node.id.stage, node.unmade?)));
        let Some((at, stage, (slot, value))) = named else { return Ok(()) };
        let giver = self.nodes[..at].iter().position(|node| node.place.gives == value);
        let why = giver.map_or("nothing gives it", |giver| self.why_idle(giver));
        let problem = format!(
            "{stage}.{slot} = \"{value}\": the scene makes none ({why}); add what makes it, or name a file"
        );
        Err(Error::usage(stage, problem))
    }

    fn need(&mut self, at: usize, why: &str) {
        let node = &mut self.nodes[at];
        if node.needed {
            return;
        }
        node.needed = true;
        node.why = format!("needed for {why}");
        let NodeId { stage, variant } = node.id;
        let name = if variant.is_empty() { stage.to_owned() } else { format!("{stage} {variant}") };
        for from in node.asked().collect::<Vec<_>>() {
            if let Some(from) = self.nodes[..at].iter().position(|node| node.id == from) {
                self.need(from, &name);
            }
        }
    }

    /// Empties the slots that would be filled with what nothing else needs.
    fn leave_unmade(&mut self) {
        let made: Vec<NodeId> = self.nodes.iter().filter(|node| node.needed).map(|node| node.id).collect();
        for node in &mut self.nodes {
            let if_made = node.place.if_made;
            node.inputs.retain(|(slot, from)| !if_made.contains(slot) || made.contains(from));
        }
    }

    /// Why a place isn't needed.
    fn why_idle(&self, at: usize) -> &'static str {
        let node = &self.nodes[at];
        match node.idle {
            Some(Idle::Asked(why)) => return why,
            Some(Idle::Missing(value)) => {
                let giver = self.nodes[..at].iter().position(|earlier| earlier.place.gives == value);
                return giver.map_or(UNASKED, |giver| self.why_idle(giver));
            }
            Some(Idle::Unread) => {
                let would_read = |later: &PlanNode| later.inputs.iter().any(|(_, from)| *from == node.id);
                let reader = self.nodes.iter().position(would_read);
                return reader.map_or(node.place.unread, |reader| self.why_idle(reader));
            }
            None => {}
        }
        let mut readers = (at..self.nodes.len()).filter(|&later| self.nodes[later].reads(node.id));
        let Some(first) = readers.next() else { return node.place.unread };
        let stage = self.nodes[first].id.stage;
        if readers.all(|other| self.nodes[other].id.stage == stage) { self.why_idle(first) } else { UNASKED }
    }
}

/// Names of the stages, each once, in the order in which they run.
pub(crate) fn stage_names() -> String {
    let names: Vec<&str> =
        [NodeId::IMPORT.stage].into_iter().chain(STAGES.iter().map(|stage| stage.name)).collect();
    names.join(", ")
}

/// Every place with its stage and the places that fill its slots: each slot is filled with the value of its name that is made last
/// before it.
fn wire(loaded: &Loaded, input: Option<&Path>) -> Result<Vec<PlanNode>, Error> {
    let import: Box<dyn Stage> = Box::new(import(loaded, input)?);
    let mut nodes = vec![PlanNode { stage: Some(import), ..PlanNode::new(NodeId::IMPORT, VOLUME) }];
    nodes.extend(
        drawn(loaded)
            .map(|drawn| PlanNode { stage: Some(Box::new(drawn)), ..PlanNode::new(NodeId::START, DRAWN) }),
    );
    nodes.extend(labelled(loaded)?.map(|labels| PlanNode {
        stage: Some(Box::new(labels)),
        inputs: vec![("volume", NodeId::IMPORT)],
        ..PlanNode::new(NodeId::LABELS, LABELS)
    }));
    let places = || STAGES.iter().flat_map(|stage| stage.places.iter().map(move |place| (*stage, place)));
    let first = places().filter(|(_, place)| place.is_first);
    for (stage, place) in first.chain(places().filter(|(_, place)| !place.is_first)) {
        let section = loaded.scene.section(stage).filter(|section| is_asked(section, place));
        if let Some(section) = section {
            for (slot, met) in met(loaded, section, place)? {
                let id = NodeId { stage: IMPORT, variant: slot };
                nodes.push(PlanNode { stage: Some(Box::new(met)), ..PlanNode::new(id, Place::only(slot)) });
            }
        }
        let node = placed(&loaded.scene, stage, place, &nodes);
        nodes.push(node);
    }
    for at in 0..nodes.len() {
        let id = nodes[at].id;
        if nodes[at].place.for_readers && !nodes[at..].iter().any(|later| later.reads(id)) {
            nodes[at].stage = None;
            nodes[at].idle = nodes[at].idle.or(Some(Idle::Unread));
        }
    }
    Ok(nodes)
}

/// Whether the parameters are for this place of their stage.
fn is_asked(section: &Section, place: &Place) -> bool {
    place.when.is_none_or(|(key, word)| {
        section.job().params().get(key).and_then(|value| value.as_str()) == Some(word)
    })
}

/// Why a place has nothing to do, whatever its section says: what it would give comes from a file, or no output asks for it.
fn unasked(scene: &Scene, stage: &op::Stage, place: &Place) -> Option<Idle> {
    let is_asked = || scene.output.files().iter().any(|(key, _)| *key == place.gives);
    if stage.name == ivd_segment::STAGE.name && scene.input.labels.is_some() {
        return Some(Idle::Asked("input.labels gives the labels"));
    }
    (place.for_outputs && !is_asked()).then_some(Idle::Unread)
}

/// A place after those before it.
fn placed(scene: &Scene, stage: &'static op::Stage, place: &'static Place, earlier: &[PlanNode]) -> PlanNode {
    let id = NodeId { stage: stage.name, variant: place.variant };
    let mut node = PlanNode { is_quiet: stage.quiet, ..PlanNode::new(id, *place) };
    if let Some(idle) = unasked(scene, stage, place) {
        (node.idle, node.is_quiet) = (Some(idle), node.is_quiet || !place.variant.is_empty());
        return node;
    }
    let is_written = |id: NodeId| {
        let of = |section: &Section| section.stage().name == id.stage && section.written().is_some();
        id == NodeId::LABELS || scene.sections().iter().any(of)
    };
    let asked = scene.section(stage).filter(|section| is_asked(section, place));
    let Some(section) = asked.and_then(|section| section.at(place)) else {
        (node.idle, node.is_quiet) = (Some(Idle::Unread), true);
        return node;
    };
    let last = |value: &str| earlier.iter().rev().find(|n| n.place.gives == value && n.stage.is_some());
    let is_made = |value: &str| last(value).is_some();
    node.is_written = section.written().is_some();
    // A part that is found by values has no label, nor has a lattice of an isovalue.
    let reads = |node: &PlanNode, slot: &str| node.inputs.iter().any(|(name, _)| *name == slot);
    let gives = |value: &'static str, slot: &'static str| {
        earlier.iter().any(|node| node.place.gives == value && node.stage.is_some() && reads(node, slot))
    };
    let is_of_part = gives("mask", "labels") && gives("lattice", "mask");
    let is_left_empty = |slot: &str| place.leaves_empty(slot, is_made);
    let needs = place.needs.iter().copied().filter(|value| !is_left_empty(value));
    let mut missing = needs.into_iter().find(|value| !is_made(value));
    for slot in section.method().slots.iter().filter(|slot| !is_left_empty(slot.name)) {
        let said = named(&section, place, slot.name);
        let value = match said {
            Some(Named::Value(value)) => value,
            Some(Named::File(_)) => slot.name,
            None => place.value_for(slot.name, is_made),
        };
        let want = section.wants(slot.name);
        let is_read = |giver: &&PlanNode| match want {
            Want::No => false,
            Want::Yes => true,
            Want::IfWritten => is_written(giver.id),
            Want::IfGiven => giver.id.stage == IMPORT && is_of_part,
        };
        match last(value) {
            Some(giver) => node.inputs.extend(Some(giver).filter(is_read).map(|giver| (slot.name, giver.id))),
            None if want != Want::Yes => {}
            None if said.is_some() => node.unmade = Some((slot.name, value)),
            None if !slot.optional => missing = missing.or(Some(value)),
            None => {}
        }
    }
    node.idle = section.job().idle().map(Idle::Asked).or(missing.map(Idle::Missing));
    node.stage = node.idle.is_none().then(|| Box::new(section) as Box<dyn Stage>);
    node
}
