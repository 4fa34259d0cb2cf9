//! From a scene to what a session begins with, and back.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ivd_artefact::Cache;
use ivd_atf::is_computed_tomography;
use ivd_core::op::Op as _;
use ivd_core::{Exec, Grid, Labels, Lattice, TransferFunction, Value as _, Volume};
use ivd_field::clip::{SceneClip, Whose};
use ivd_field::warp::WarpParams;
use ivd_map::space::SpaceParams;
use ivd_map::{BiharmonicParams, FemParams, OctreeParams};
use ivd_motion::deform::{Asked, DynamicsMethod, ProjectiveMethod, RingMethod, XpbdMethod};
use ivd_pipeline::plan::{NodeId, Plan};
use ivd_pipeline::scene::{InputFiles, Loaded, OutputSection, Override, Picture, Scene, parse};
use ivd_pipeline::{PipelineOptions, Runner, StageResult, run_node};
use ivd_render::{
    AttenuatedMipParams, ClipSpace, DvrParams, IsoParams, LmipParams, MeanParams, MinipParams, MipParams,
    RenderParams, Surroundings,
};
use ivd_session::{Clip, ClipPart, ClipRule, MapChoice, Physics, Settings, numbered};
use serde::Serialize;
use serde_json::{Value as Json, json};

use crate::bare::{above_background, leaves_part_open, says};
use crate::model::{first_transfer, usual_radius};
use crate::panes::Seen;
use crate::preview::AtRest;
use crate::{Error, Made, Tell};

/// Vertices above which a bare scan is deformed at a coarser level.
const MANY_VERTICES: usize = 40_000;
/// Longest edge of a bare scan's lattice, as a share of a handle's usual reach.
const EDGE: f64 = 0.25;
/// Edges at a level are about as long as a voxel's are at that level, and a voxel's longest aren't done away with; no less than this many of
/// those.
const VOXELS: f64 = 1.25;
/// What the scene of a bare scan says beside its input.
const BARE: &str = "schema = 1\n[output]\nimages = [\"before\"]\n";

/// More digits than these aren't a person's.
const FEW_DIGITS: usize = 9;

/// What isn't shown.
const PLAIN: &str =
    "drawn without ambient occlusion, shadows and surfaces that are seen through, which the scene keeps";

/// What tells in pictures what is to be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ShownBy {
    /// The scan's values.
    Values,
    /// The labels that a person gave, one of whose parts moves.
    Labels,
}

/// Why labels aren't shown.
const UNSEEN: &str = "its labels aren't shown, as the surface that moves is of values (lattice.iso, boundary.above or a seed) and of none of them: boundary.class names one";

/// What a session begins with.
#[derive(Debug)]
pub struct Subject {
    /// The scene that it comes from.
    pub scene: Scene,
    /// Where the files of its input lie.
    pub files: InputFiles,
    /// The volume at rest.
    pub volume: Volume,
    /// The lattice as it was cut.
    pub lattice: Lattice,
    /// Classes, where something was found by them.
    pub labels: Option<Labels>,
    /// What its pictures go by.
    pub shown_by: ShownBy,
    /// How the scene wants classes drawn; `None` where its pictures aren't made by them.
    pub looks: Option<ivd_render::ClassLooks>,
    /// Colour and opacity, without those.
    pub transfer: Option<TransferFunction>,
    /// How pictures are drawn.
    pub picture: RenderParams,
    /// What the scene asks to be moved.
    pub settings: Settings,
    /// What the body is made of.
    pub made: Made,
    /// What it is made of, for a person to read.
    pub said: Vec<String>,
    /// Whether that was chosen here: of a bare scan. A scene says it, or leaves it to be found.
    pub is_chosen: bool,
    /// Whether the scene's pictures have light taken away by what is around, or surfaces that are seen through, which those of a window haven't.
    pub is_plain: bool,
    /// Whether its values are Hounsfield units, which tell what matter is.
    pub is_tomography: bool,
}

/// The scene of a bare scan.
///
/// # Errors
/// An override that doesn't fit.
pub fn bare_scene(file: &Path, overrides: &[Override]) -> Result<Loaded, Error> {
    let named = file.file_name().map_or_else(|| "scan".into(), |name| name.to_string_lossy().into_owned());
    let mut text = toml::Table::new();
    text.insert("file".to_owned(), named.into());
    let text = format!("{BARE}[input]\n{text}");
    let scene = parse(&text, overrides)
        .map_err(|problem| ivd_pipeline::Error::Scene { file: file.to_owned(), problem })?;
    Ok(Loaded {
        scene,
        folder: file.parent().map_or_else(PathBuf::new, Path::to_owned),
        file: file.to_owned(),
    })
}

impl Subject {
    /// Does what a session needs of a scene: reads its volume, finds colours, cuts the lattice.
    ///
    /// - `is_bare`: whether the scene is that of a bare scan, whose level and map are chosen here.
    /// - `tell`: is told the stages, each as it begins, and the scan as soon as it is read.
    ///
    /// # Errors
    /// A scene with parts that a session has not; those of the stages.
    pub fn open(
        loaded: &Loaded,
        is_bare: bool,
        cache: &Cache,
        exec: &Exec,
        tell: &Tell,
    ) -> Result<Self, Error> {
        check(&loaded.scene)?;
        let (picture, looks) = drawn(&loaded.scene)?;
        if !picture.clip.is_empty() && picture.clip_space == ClipSpace::Rest {
            return Err(none("render.clip_space = \"rest\""));
        }
        let asked = settings(&loaded.scene)?;
        let by_class = asked.knows_classes();
        let mut done: BTreeMap<NodeId, StageResult> = BTreeMap::new();
        let (mut cut, mut is_body) = (loaded.clone(), false);
        if is_bare && leaves_part_open(&cut.scene) {
            cut.scene.output = OutputSection { images: vec![Picture::Before], ..OutputSection::default() };
            run(&cut, &mut done, Runner { exec, cache, lazy: false }, tell)?;
            let coloured = done.values().find_map(|result| TransferFunction::of(&result.artefact));
            if let Some(above) = coloured.and_then(above_background) {
                cut.scene.set(&ivd_boundary::STAGE, &[("above", Some(json!(above)))])?;
                is_body = true;
            }
        }
        let mut scene = cut.scene.clone();
        cut.scene.output = OutputSection {
            images: vec![Picture::Before],
            lattice_extracted: Some("extracted.ply".into()),
            labels: (by_class || cut.scene.input.labels.is_some()).then(|| "labels.nii.gz".into()),
            ..OutputSection::default()
        };
        run(&cut, &mut done, Runner { exec, cache, lazy: false }, tell)?;
        let volume: Volume = done
            .get(&NodeId::IMPORT)
            .and_then(|result| Volume::of(&result.artefact).cloned())
            .ok_or_else(|| missing("a volume"))?;
        let mut found = (None, None, None);
        for result in done.values() {
            let artefact = &*result.artefact;
            found.0 = Lattice::of(artefact).cloned().or(found.0);
            found.1 = Labels::of(artefact).cloned().or(found.1);
            found.2 = TransferFunction::of(artefact).cloned().or(found.2);
        }
        let (lattice, labels, transfer) = found;
        let lattice = lattice.ok_or_else(|| missing("a lattice"))?;
        let mut said = Vec::new();
        let vertices = lattice.keys().len();
        let refine = &ivd_lattice::refine::STAGE;
        if is_bare && !says(&scene, refine, "level") {
            let level = (vertices as f64 / MANY_VERTICES as f64).log(4.0).ceil().max(0.0) as u64;
            scene.set(refine, &[("level", Some(json!(level)))])?;
            said.push(format!("level {level}, for {vertices} vertices as cut"));
        }
        let level = scene.param(refine, "level").and_then(|level| level.as_u64()).unwrap_or_default();
        if is_bare && level > 0 && !says(&scene, refine, "max_edge") {
            let edge = in_digits(longest_edge(volume.grid(), level), 2);
            scene.set(refine, &[("max_edge", Some(json!(edge)))])?;
            said.push(format!("edges up to {edge} mm, so that a handle finds a vertex near"));
        }
        if is_bare && !says(&scene, &ivd_map::STAGE, "method") {
            // Hands press anywhere, on thin walls as well, where what lies nearest can't follow far.
            scene.set(&ivd_map::STAGE, &[("method", Some(json!("biharmonic")))])?;
            said.push("voxels follow smoothest".to_owned());
        }
        if is_bare {
            said.push(
                "what lies within a handle's radius goes along with it, bone as soft parts do".to_owned(),
            );
        }
        let settings = settings(&scene)?;
        let part = done.iter().find(|(id, _)| id.stage == ivd_boundary::STAGE.name);
        let part = part.map(|(_, result)| json!(result.record.metrics));
        let found = part.as_ref().and_then(|part| part_of(&volume, part));
        if is_bare {
            said.splice(0..0, found.into_iter().chain([material_of(&settings)]));
        } else {
            let iso = scene.param(&ivd_lattice::extract::STAGE, "iso");
            said.extend(found.or(iso.map(|iso| format!("the surface: where values are {iso}"))));
            said.extend([
                material_of(&settings),
                format!("level {}, for {vertices} vertices as cut", settings.level),
            ]);
        }
        let asks = |key| {
            let asked = scene.param(&ivd_render::STAGE, key);
            asked.is_some_and(|value| ![json!(0), json!(false), json!([])].contains(&value))
        };
        let is_plain = ["ao", "shadow", "shells"].into_iter().any(asks);
        let mut subject = Self {
            made: Made::of(&scene, part.as_ref(), is_body),
            scene,
            files: loaded.input_files(),
            volume,
            lattice,
            labels,
            shown_by: shown_by(&cut)?,
            looks,
            transfer,
            // One picture at a time, and nothing kept beside it.
            picture: RenderParams { turntable: 1, keep_light: false, ..picture },
            settings,
            said,
            is_chosen: is_bare,
            is_plain,
            is_tomography: false,
        };
        // Both that are drawn have it then.
        subject.volume.find_bricks(exec)?;
        let values = subject.scene.param(&ivd_atf::STAGE, "values");
        let values = values.and_then(|values| serde_json::from_value(values).ok()).unwrap_or_default();
        subject.is_tomography = is_computed_tomography(&subject.volume, values);
        let transfer = first_transfer(&subject)?;
        tell.stage(refine.name);
        tell.at_rest(|| AtRest::of(subject.seen(transfer.as_ref()), &subject.picture));
        Ok(subject)
    }

    /// The labels that pictures of it at rest go by.
    pub(crate) fn drawn_labels(&self) -> Option<&Labels> {
        self.labels.as_ref().filter(|_| self.shown_by == ShownBy::Labels)
    }

    /// It at rest, in colours.
    pub(crate) fn seen<'a>(&'a self, transfer: Option<&'a TransferFunction>) -> Seen<'a> {
        let unlabelled = self.looks.as_ref().is_some_and(|looks| looks.unlabelled);
        Seen { volume: &self.volume, transfer, labels: self.drawn_labels(), unlabelled }
    }

    /// What was said of it, each with who said it, and what isn't shown of it.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        let who = if self.is_chosen { "at opening" } else { "in this scene" };
        let plain = self.is_plain.then(|| PLAIN.to_owned());
        let unseen =
            (self.files.labels.is_some() && self.shown_by == ShownBy::Values).then(|| UNSEEN.to_owned());
        self.said.iter().map(move |said| format!("{who}: {said}")).chain(plain).chain(unseen)
    }

    /// The scene with other settings: what `ivd pipeline` makes of it is what a session shows that is at them.
    ///
    /// # Errors
    /// Settings that no scene has.
    pub fn scene_of(&self, settings: &Settings) -> Result<Scene, Error> {
        scene_of(&self.scene, settings)
    }
}

/// What a scene's pictures go by. In a window that is so however they are clipped.
fn shown_by(loaded: &Loaded) -> Result<ShownBy, Error> {
    let mut loaded = loaded.clone();
    loaded.scene.remove(&ivd_field::clip::STAGE)?;
    let plan = Plan::new(&loaded, None, None)?;
    let picture = plan.node(NodeId::of_picture(Picture::Before));
    let reads_labels =
        picture.is_some_and(|node| node.inputs.iter().any(|(_, giver)| *giver == NodeId::LABELS));
    Ok(if reads_labels { ShownBy::Labels } else { ShownBy::Values })
}

/// Does what a scene's lattice and colours need and isn't done yet.
fn run(
    loaded: &Loaded,
    done: &mut BTreeMap<NodeId, StageResult>,
    runner: Runner<'_>,
    tell: &Tell,
) -> Result<(), Error> {
    let plan = Plan::new(loaded, None, None)?;
    let needed = plan.nodes().iter().filter(|node| node.needed && node.id.stage != ivd_render::STAGE.name);
    for node in needed {
        if done.contains_key(&node.id) {
            continue;
        }
        tell.stage(node.id.stage);
        let result = run_node(node, done, runner, &PipelineOptions::default())?;
        if let Some(remark) = &result.record.remark {
            runner.exec.observer().note(&format!("{}: {remark}", node.id.stage));
        }
        if node.id == NodeId::IMPORT
            && let Some(volume) = Volume::of(&result.artefact)
        {
            tell.scan(volume, loaded.scene.window.as_ref());
        }
        done.insert(node.id, result);
    }
    Ok(())
}

/// Which part of a scan was chosen, and where its surface lies.
fn part_of(volume: &Volume, figures: &Json) -> Option<String> {
    let voxels = figures["voxels"].as_f64()?;
    let millilitres = voxels * volume.grid().spacing().iter().product::<f64>() / 1000.0;
    let part = match (figures["class"].as_u64(), figures["lower"].as_f64()) {
        (Some(class), _) => format!("class {class}"),
        (None, Some(lower)) => format!("values of {} and more", in_few_digits(lower)),
        (None, None) => return None,
    };
    Some(format!(
        "the part: {part}, {millilitres:.1} ml in one piece; its surface: where its values meet its neighbours'"
    ))
}

/// Of what matter it is taken to be.
fn material_of(settings: &Settings) -> String {
    let stiffness = match &settings.physics {
        Physics::Ring(params) => params.stiffness,
        Physics::Springs(params) => params.springs.stiffness,
    };
    let by_class =
        matches!(&settings.physics, Physics::Springs(params) if !params.springs.material.is_empty());
    let everywhere = if by_class { "by class, elsewhere" } else { "the same everywhere," };
    format!("the material: {everywhere} {stiffness} N/m")
}

fn missing(what: &'static str) -> Error {
    Error::NotInSessions { part: format!("{what} is made by none of its stages") }
}

/// Longest edge (mm) of a bare scan's lattice at a level: such that a handle finds a vertex near, and no shorter than edges are at that level.
fn longest_edge(grid: &Grid, level: u64) -> f64 {
    let usual = grid.voxel_volume().cbrt() * 2.0_f64.powi(level.min(60) as i32);
    (EDGE * usual_radius(grid)).max(VOXELS * usual.max(grid.longest_edge()))
}

/// A number as it is told: as it is, where few digits say it, as those of what a person says; else as near as five digits come.
pub fn in_few_digits(number: f64) -> f64 {
    let digits = number.to_string().chars().filter(char::is_ascii_digit).count();
    if digits <= FEW_DIGITS { number } else { in_digits(number, 5) }
}

/// A number with so many digits that count.
fn in_digits(number: f64, digits: usize) -> f64 {
    format!("{number:.*e}", digits - 1).parse().unwrap_or(number)
}

fn none(part: impl Into<String>) -> Error {
    Error::NotInSessions { part: part.into() }
}

/// Refuses what a session has no place for: it would show something else than the scene.
fn check(scene: &Scene) -> Result<(), Error> {
    let written = |stage| scene.section(stage).and_then(|section| section.written());
    for stage in [&ivd_field::combine::STAGE, &ivd_octree::STAGE] {
        if written(stage).is_some_and(|keys| !keys.is_empty()) {
            return Err(none(format!("[{}]", stage.name)));
        }
    }
    let refine = &ivd_lattice::refine::STAGE;
    let keys = written(refine).into_iter().flatten();
    if let Some((key, _)) = keys.into_iter().find(|(key, _)| !["level", "max_edge"].contains(&key.as_str())) {
        return Err(none(format!("refine.{key} (it knows refine.level and refine.max_edge)")));
    }
    if scene.param(&ivd_map::STAGE, "frame").is_some() {
        return Err(none("map.frame"));
    }
    if let Some(clip) = scene.get::<SceneClip>(&ivd_field::clip::STAGE) {
        match clip {
            SceneClip { tag: Some(_), .. } => return Err(none("clip.tag")),
            SceneClip { of: Whose::Input, .. } if clip.idle().is_none() => {
                return Err(none("clip.of = \"input\""));
            }
            _ => {}
        }
    }
    Ok(())
}

/// How a scene's pictures are drawn, and with a transfer function the classes. What takes light away isn't, nor what is seen through: it takes seconds; and a window has marks of its own.
fn drawn(scene: &Scene) -> Result<(RenderParams, Option<ivd_render::ClassLooks>), Error> {
    let stage = &ivd_render::STAGE;
    let coloured = scene.get::<DvrParams>(stage);
    let asked = coloured
        .map(|dvr| Ok(dvr.asked()))
        .or_else(|| scene.get(stage).map(MipParams::asked))
        .or_else(|| scene.get(stage).map(MinipParams::asked))
        .or_else(|| scene.get(stage).map(MeanParams::asked))
        .or_else(|| scene.get(stage).map(LmipParams::asked))
        .or_else(|| scene.get(stage).map(AttenuatedMipParams::asked))
        .or_else(|| scene.get(stage).map(IsoParams::asked));
    let picture = asked.ok_or_else(|| none("render.mode"))?;
    let picture = picture.map_err(|problem| ivd_core::Error::from(problem.under(stage.name)))?;
    let picture = RenderParams {
        surroundings: Surroundings::default(),
        shells: Vec::new(),
        antialias: 1,
        cube: false,
        legend: false,
        ..picture
    };
    Ok((picture, coloured.map(|dvr| dvr.classes.clone())))
}

/// What a scene asks to be moved, as a session takes it.
fn settings(scene: &Scene) -> Result<Settings, Error> {
    let stage = &ivd_motion::deform::STAGE;
    let section = scene.section(stage).ok_or_else(|| missing("a motion"))?;
    let asked = Asked::of(section.job()).ok_or_else(|| missing("a motion"))?;
    let springs = None
        .or_else(|| section.get().map(DynamicsMethod::params))
        .or_else(|| section.get().map(ProjectiveMethod::params))
        .or_else(|| section.get().map(XpbdMethod::params));
    let physics = match (section.get::<RingMethod>(), springs) {
        (Some(ring), _) => Physics::Ring(ring.ring.clone()),
        (None, Some(springs)) => Physics::Springs(Box::new(springs)),
        (None, None) => return Err(none("deform.solver = \"body\"")),
    };
    let wrong = |problem: ivd_core::ParamError| ivd_core::Error::from(problem.under(stage.name));
    let map = scene.section(&ivd_map::STAGE).ok_or_else(|| missing("a map"))?;
    let map = None
        .or_else(|| map.get().cloned().map(|params: OctreeParams| MapChoice::Octree(params)))
        .or_else(|| map.get().cloned().map(|params: BiharmonicParams| MapChoice::Biharmonic(params)))
        .or_else(|| map.get().cloned().map(|params: FemParams| MapChoice::Fem(params)))
        .ok_or_else(|| none("map.method = \"body\""))?;
    let level = scene.param(&ivd_lattice::refine::STAGE, "level").and_then(|level| level.as_u64());
    let max_edge = scene.param(&ivd_lattice::refine::STAGE, "max_edge").and_then(|mm| mm.as_f64());
    let settings = Settings {
        max_edge,
        level: level.map_or(2, |level| level.min(255) as u8),
        handles: numbered(asked.moves.handles().map_err(wrong)?),
        fixed: numbered(asked.moves.fixed()),
        physics,
        shapes: numbered(asked.moves.shape.iter().copied()),
        bones: numbered(asked.bones.iter().cloned()),
        map,
        space: scene
            .get::<SpaceParams>(&ivd_map::space::STAGE)
            .map_or_else(Vec::new, |space| numbered(space.step.iter().cloned())),
        warp: scene.get::<WarpParams>(&ivd_field::warp::STAGE).cloned().unwrap_or_default(),
        clip: scene.get::<SceneClip>(&ivd_field::clip::STAGE).map_or_else(Clip::default, clip),
    };
    settings.check()?;
    Ok(settings)
}

/// What a scene clips by.
fn clip(SceneClip { clip, space, .. }: &SceneClip) -> Clip {
    let planes = clip.planes.iter().copied().map(ClipPart::Plane);
    let parts = numbered(planes.chain(clip.boxes.iter().copied().map(ClipPart::Box)));
    if parts.is_empty() {
        return Clip::default();
    }
    Clip { parts, rule: ClipRule { invert: clip.invert, background: clip.background, space: *space } }
}

/// A scene with other settings.
fn scene_of(scene: &Scene, settings: &Settings) -> Result<Scene, Error> {
    use ivd_motion::handles::{Action, Anchor, Handle};
    let mut scene = scene.clone();
    let handle = |Handle { at, action, radius }: &Handle| {
        let (place, at) = match at {
            Anchor::NearestTo(point) => ("pick", json!(point)),
            Anchor::Vertex(vertex) => ("vertex", json!(vertex)),
        };
        let (does, by) = match action {
            Action::Move(by) => ("move", by),
            Action::Force(by) => ("force", by),
        };
        json!({ place: at, does: by, "radius": radius })
    };
    let handles: Vec<Json> = settings.handles.iter().map(|one| handle(&one.what)).collect();
    let mut fixed = Vec::new();
    for pin in &settings.fixed {
        let Anchor::NearestTo(point) = pin.at else {
            return Err(none("a pin at a vertex by its number"));
        };
        fixed.push(json!({ "pick": point, "radius": pin.radius }));
    }
    let shapes: Vec<Json> = settings.shapes.iter().map(|one| json!(one.what)).collect();
    let list = |all: Vec<Json>| (!all.is_empty()).then_some(Json::Array(all));

    let stage = &ivd_motion::deform::STAGE;
    let (solver, params) = match &settings.physics {
        Physics::Ring(params) => ("ring", json!(params)),
        Physics::Springs(params) => springs(params),
    };
    replace(&mut scene, stage, "solver", solver, params)?;
    let bones = settings.bones.iter().map(|one| json!(one.what)).collect();
    let moves =
        [("handle", list(handles)), ("fix", list(fixed)), ("shape", list(shapes)), ("rigid", list(bones))];
    scene.set(stage, &moves)?;

    let mut map = json!(settings.map);
    let method = map.as_object_mut().and_then(|keys| keys.remove("method"));
    let method = method.as_ref().and_then(Json::as_str).unwrap_or_default().to_owned();
    replace(&mut scene, &ivd_map::STAGE, "method", &method, map)?;
    let warp = json!(settings.warp);
    replace(&mut scene, &ivd_field::warp::STAGE, "", "", warp)?;
    let max_edge = settings.max_edge.map(|mm| json!(mm));
    scene.set(
        &ivd_lattice::refine::STAGE,
        &[("level", Some(json!(settings.level))), ("max_edge", max_edge)],
    )?;

    // A section without anything to do is refused, or says what isn't so.
    scene.remove(&ivd_map::space::STAGE)?;
    let steps = settings.space.iter().map(|one| json!(one.what)).collect();
    if let Some(steps) = list(steps) {
        scene.set(&ivd_map::space::STAGE, &[("step", Some(steps))])?;
    }
    scene.remove(&ivd_field::clip::STAGE)?;
    if let Some(clip) = settings.clip.params() {
        let clip = SceneClip { clip, space: settings.clip.rule.space, ..SceneClip::default() };
        replace(&mut scene, &ivd_field::clip::STAGE, "", "", json!(clip))?;
    }
    Ok(scene)
}

/// Solver and keys of masses on springs.
pub(crate) fn springs(params: &ivd_motion::mass_spring::Params) -> (&'static str, Json) {
    use ivd_motion::deform::Body;
    use ivd_motion::mass_spring::{Params, Solver};
    let Params { solver, springs, closeness, descent } = params.clone();
    let body = Body { springs, ..Body::default() };
    match solver {
        Solver::Dynamics => ("dynamics", json!(DynamicsMethod { body })),
        Solver::Projective => ("projective", json!(ProjectiveMethod { body, closeness, descent })),
        Solver::Xpbd => ("xpbd", json!(XpbdMethod { body, closeness })),
    }
}

/// Writes a section anew: a method and what differs from its defaults.
fn replace(
    scene: &mut Scene,
    stage: &ivd_core::op::Stage,
    selector: &str,
    method: &str,
    params: Json,
) -> Result<(), Error> {
    let before: Vec<String> = scene
        .section(stage)
        .and_then(|s| s.written())
        .into_iter()
        .flatten()
        .map(|(key, _)| key.clone())
        .collect();
    let gone: Vec<(&str, Option<Json>)> = before.iter().map(|key| (&**key, None)).collect();
    scene.set(stage, &gone)?;
    if !selector.is_empty() {
        scene.set(stage, &[(selector, Some(json!(method)))])?;
    }
    let defaults = scene.section(stage).map(|section| section.job().params()).unwrap_or_default();
    let Json::Object(params) = params else { return Ok(()) };
    let differs = params.iter().filter(|(key, value)| !value.is_null() && defaults.get(*key) != Some(*value));
    let differing: Vec<(&str, Option<Json>)> =
        differs.map(|(key, value)| (&**key, Some(value.clone()))).collect();
    scene.set(stage, &differing)?;
    Ok(())
}
