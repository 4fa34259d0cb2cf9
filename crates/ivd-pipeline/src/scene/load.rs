use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use ivd_core::ParamError;
use serde_json::{Map, Value as Json};
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::stage_sections::{Written, stage_sections};
use super::{InputFiles, Scene};
use crate::Error;
use crate::params::{from_toml, place_landmarks};

/// One `--set stage.key=value`.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// Keys from the top; a number indexes an array (`deform.handle.0.radius`).
    pub path: Vec<String>,
    /// The new value; an empty text takes the key out (`boundary.above=`).
    pub value: Value,
}

impl std::str::FromStr for Override {
    type Err = String;

    /// Reads `stage.key=value`. A value that isn't TOML is taken as a string: `render.mode=mip`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (path, value) = text.split_once('=').ok_or_else(|| format!("`{text}`: write stage.key=value"))?;
        let path: Vec<String> = path.trim().split('.').map(str::to_owned).collect();
        if path.iter().any(String::is_empty) {
            return Err(format!("`{text}`: an empty key; write stage.key=value"));
        }
        let value = value.trim();
        let parsed = format!("v = {value}").parse::<Table>().ok().and_then(|mut t| t.remove("v"));
        Ok(Self { path, value: parsed.unwrap_or_else(|| Value::String(value.to_owned())) })
    }
}

/// A scene with where it lies.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Folder that its relative paths start from.
    pub folder: PathBuf,
    /// The scene file.
    pub file: PathBuf,
}

impl Loaded {
    /// Where the files of its input lie.
    pub fn input_files(&self) -> InputFiles {
        self.scene.input_files().renamed(|_, file| {
            let file = self.folder.join(file);
            std::path::absolute(&file).unwrap_or(file)
        })
    }

    /// The same with another value of a key.
    ///
    /// # Errors
    /// A value that doesn't fit.
    pub(crate) fn with(&self, section: &str, key: &str, value: Json) -> Result<Self, Error> {
        let mut changed = self.clone();
        let keys =
            changed.scene.written.entry(section.to_owned()).or_insert_with(|| Json::Object(Map::new()));
        if let Json::Object(keys) = keys {
            keys.insert(key.to_owned(), value);
        }
        let sections = stage_sections(&changed.scene.written);
        changed.scene.sections = sections
            .map_err(|problem| Error::Scene { file: self.file.clone(), problem: problem.told_of("") })?;
        Ok(changed)
    }
}

/// Reads a scene file and applies overrides before anything is checked.
///
/// # Errors
/// [`Error::Scene`] with the place and, for an unknown key, the nearest known one; [`Error::Io`] where it can't be read.
pub fn load(file: &Path, overrides: &[Override]) -> Result<Loaded, Error> {
    let wrong = |problem| Error::Scene { file: file.to_owned(), problem };
    let bytes = read_text_limited(file).map_err(|e| Error::io("reading", file, e))?;
    let bytes = bytes
        .ok_or_else(|| wrong(format!("longer than {MAX_SCENE_BYTES} bytes; a scene is a short text")))?;
    let text = String::from_utf8(bytes).map_err(|e| wrong(format!("{e}; a scene is a TOML text file")))?;
    let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
    let scene = parse_in(&text, overrides, Some(&folder)).map_err(|problem| match problem {
        Problem::Scene(problem) => wrong(problem),
        Problem::File(error) => error,
    })?;
    Ok(Loaded { scene, folder, file: file.to_owned() })
}

/// Most bytes of a text that is read; written by hand it has a few thousand.
pub const MAX_SCENE_BYTES: u64 = 16 << 20;

/// The bytes of a text file; `None` where it has more than [`MAX_SCENE_BYTES`], or no end, as a device has none.
///
/// # Errors
/// The system's.
pub fn read_text_limited(file: &Path) -> std::io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    File::open(file)?.take(MAX_SCENE_BYTES + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= MAX_SCENE_BYTES).then_some(bytes))
}

/// Reads a scene from its text; see [`load`]. Files of landmarks have no folder here to lie in: points are given as numbers.
///
/// # Errors
/// A sentence that names the place, what is wrong and what to do.
pub fn parse(text: &str, overrides: &[Override]) -> Result<Scene, String> {
    parse_in(text, overrides, None).map_err(|problem| match problem {
        Problem::Scene(problem) => problem,
        Problem::File(error) => error.to_string(),
    })
}

/// What is wrong: with the scene's text, or with a file that it names.
enum Problem {
    Scene(String),
    File(Error),
}

impl From<String> for Problem {
    fn from(problem: String) -> Self {
        Self::Scene(problem)
    }
}

/// Reads a scene whose files lie in a folder.
fn parse_in(text: &str, overrides: &[Override], folder: Option<&Path>) -> Result<Scene, Problem> {
    let told = |e: toml::de::Error| with_suggestion(&truncate_lines(&e.to_string()));
    let table = || text.parse::<Table>().map_err(|e| truncate_lines(&e.to_string()));
    let (typed, table) = if overrides.is_empty() {
        // Straight from the text, so that errors carry line and column. Of keys that nobody knows nothing else is made.
        let typed = toml::from_str::<Scene>(text).map_err(told);
        if typed.as_ref().is_err_and(|problem| problem.contains("unknown field")) {
            return Ok(typed?);
        }
        (typed, table()?)
    } else {
        let mut table = table()?;
        for o in overrides {
            set(&mut table, o)?;
        }
        (table.clone().try_into().map_err(told), table)
    };
    let mut written = as_json(table).map_err(|problem| placed(text, &problem))?;
    if let Some(folder) = folder {
        place_landmarks(&mut written.values_mut(), folder).map_err(Problem::File)?;
    }
    let sections = stage_sections(&written).map_err(|problem| placed(text, &problem))?;
    let mut scene = typed?;
    (scene.written, scene.sections) = (written, sections);
    scene.check()?;
    Ok(scene)
}

/// The sections as JSON.
fn as_json(table: Table) -> Result<Written, ParamError> {
    let section = |(name, section): (String, Value)| {
        let section = from_toml(section).map_err(|problem| problem.under(&name))?;
        Ok((name, section))
    };
    table.into_iter().map(section).collect()
}

/// What is wrong, with the line of the text that it stands in where there is one.
fn placed(text: &str, problem: &ParamError) -> String {
    let told = truncate_lines(&problem.told_of(""));
    match line_of(text, &problem.field) {
        Some(line) => format!("line {line}: {told}"),
        None => told,
    }
}

/// The line, from 1, of the last key of a path that a text has.
fn line_of(text: &str, path: &str) -> Option<usize> {
    let root = DeTable::parse(text).ok()?.into_inner();
    let (mut line, mut at) = (None, DeValue::Table(root));
    for key in path.split('.') {
        let (span, next) = match at {
            DeValue::Table(table) => {
                let (name, value) = table.into_iter().find(|(name, _)| name.get_ref() == key)?;
                (name.span(), value)
            }
            DeValue::Array(list) => {
                let value = list.into_iter().nth(key.parse().ok()?)?;
                (value.span(), value)
            }
            DeValue::String(_)
            | DeValue::Integer(_)
            | DeValue::Float(_)
            | DeValue::Boolean(_)
            | DeValue::Datetime(_) => break,
        };
        line = text.get(..span.start).map(|before| before.matches('\n').count() + 1);
        at = next.into_inner();
    }
    line
}

fn set(table: &mut Table, o: &Override) -> Result<(), String> {
    let whole = o.path.join(".");
    let Some((first, rest)) = o.path.split_first() else { return Err(format!("--set {whole}: give a key")) };
    let Some((last, parents)) = rest.split_last() else {
        put(table, first, &o.value);
        return Ok(());
    };
    let mut at = table.entry(first.clone()).or_insert_with(|| Value::Table(Table::new()));
    for (i, key) in parents.iter().enumerate() {
        if let Value::Array(list) = at {
            no_element(&whole, &o.path[..=i], &o.path[i + 1..], list.len())?;
        }
        at = step(at, key).ok_or_else(|| format!("--set {whole}: `{key}` is not a section or list there"))?;
    }
    if let Value::Array(list) = at {
        no_element(&whole, &o.path[..o.path.len() - 1], &o.path[o.path.len() - 1..], list.len())?;
        let slot = last.parse().ok().and_then(|i: usize| list.get_mut(i));
        *slot.ok_or_else(|| format!("--set {whole}: no element `{last}`"))? = o.value.clone();
    } else if let Value::Table(table) = at {
        put(table, last, &o.value);
    } else {
        return Err(format!("--set {whole}: `{last}` would lie inside a plain value"));
    }
    Ok(())
}

/// Says a key's value; nothing takes the key out.
fn put(table: &mut Table, key: &str, value: &Value) {
    if value.as_str() == Some("") {
        table.remove(key);
    } else {
        table.insert(key.to_owned(), value.clone());
    }
}

/// # Errors
/// Where the next key of a path isn't the number of an element of the list that the keys before lead to.
fn no_element(whole: &str, list: &[String], rest: &[String], len: usize) -> Result<(), String> {
    let (list, next) = (list.join("."), rest.join("."));
    match rest.first().map(|key| key.parse::<usize>()) {
        Some(Ok(i)) if i < len => Ok(()),
        Some(Ok(_)) => Err(format!("--set {whole}: {list} has {len} elements, numbered from 0")),
        _ if len == 0 => {
            Err(format!("--set {whole}: {list} is an empty list; write the element into the scene"))
        }
        _ => Err(format!(
            "--set {whole}: {list} is a list of {len}, numbered from 0; write {list}.0.{next} for the first"
        )),
    }
}

fn step<'a>(at: &'a mut Value, key: &str) -> Option<&'a mut Value> {
    if let Value::Array(list) = at {
        return key.parse().ok().and_then(|i: usize| list.get_mut(i));
    }
    Some(at.as_table_mut()?.entry(key.to_owned()).or_insert_with(|| Value::Table(Table::new())))
}

/// A message whose lines fit on a screen: what quotes a line of megabytes would be megabytes itself, and compared with every
/// known word it would take minutes.
pub fn truncate_lines(message: &str) -> String {
    const LONGEST: usize = 600;
    let cut = |line: &str| match line.char_indices().nth(LONGEST) {
        Some((at, _)) => format!("{}…", &line[..at]),
        None => line.to_owned(),
    };
    message.lines().map(cut).collect::<Vec<_>>().join("\n")
}

/// Adds "did you mean" to serde's message about an unknown field or variant.
fn with_suggestion(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let unknown = message.contains("unknown field") || message.contains("unknown variant");
    let Some(wrong) = quoted.next().filter(|_| unknown) else { return message.to_owned() };
    let best = quoted
        .map(|known| (strsim::damerau_levenshtein(wrong, known), known))
        .filter(|(distance, known)| *distance <= known.len().max(3) / 2)
        .min();
    match best {
        Some((_, known)) => format!("{}\ndid you mean `{known}`?", message.trim_end()),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "schema = 1\n[input]\nphantom = \"head\"\nsize = 32\n[deform]\nstiffness = 50.0\n\
        [[deform.handle]]\npick = [0, 1, 2]\nmove = [0.0, 3.0, 0.0]\nradius = 20.0\n[output]\nreport = true\n";

    #[test]
    fn an_unknown_key_is_refused_with_the_nearest_known_one() {
        let error = parse(&SCENE.replace("stiffness", "stifness"), &[]).unwrap_err();
        assert!(error.contains("did you mean `stiffness`?"), "{error}");
        assert!(error.contains("line 6"), "{error}");
    }

    #[test]
    fn overrides_reach_sections_lists_and_sections_that_are_not_there() {
        let set = |s: &str| s.parse::<Override>().unwrap();
        let overrides = [
            set("deform.stiffness=80"),
            set("deform.handle.0.radius=7.5"),
            set("render.mode=mip"),
            set("segment.k=6"),
        ];
        let scene = parse(SCENE, &overrides).unwrap();
        let deform: &ivd_motion::deform::RingMethod = scene.get(&ivd_motion::deform::STAGE).unwrap();
        assert_eq!((deform.ring.stiffness, deform.moves.handle[0].radius), (80.0, 7.5));
        assert_eq!(scene.section(&ivd_render::STAGE).unwrap().method().name, "mip");
        let k = scene.param(&ivd_segment::STAGE, "k");
        assert_eq!(k, Some(6.into()));
        assert!(parse(SCENE, &[set("deform.handle.4.radius=1")]).unwrap_err().contains("handle"));
        let error = parse(SCENE, &[set("deform.handle.radius=1")]).unwrap_err();
        assert!(error.contains("write deform.handle.0.radius for the first"), "{error}");
        let error = parse(SCENE, &[set("deform.handle.0.move.7=1")]).unwrap_err();
        assert!(error.contains("deform.handle.0.move has 3 elements"), "{error}");
        assert!("deform".parse::<Override>().is_err());
    }

    #[test]
    fn a_key_of_megabytes_is_refused_in_a_few_words() {
        for text in ["a".repeat(8 << 20) + " = 1", format!("[\"{}\"]", "µ".repeat(1 << 20))] {
            let error = parse(&format!("{SCENE}{text}\n"), &[]).unwrap_err();
            assert!(error.len() < 4096 && error.contains("unknown field"), "{} bytes", error.len());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_without_an_end_is_no_scene() {
        let error = load(Path::new("/dev/zero"), &[]).unwrap_err();
        assert!(error.to_string().contains("longer than"), "{error}");
    }

    #[test]
    fn impossible_wishes_are_refused_by_name() {
        let no_handle = SCENE.replace("report = true", "images = [\"after\"]");
        let no_handle = no_handle.split("[[deform.handle]]").next().unwrap().to_owned()
            + "[output]\nimages = [\"after\"]\n";
        assert!(parse(&no_handle, &[]).unwrap_err().contains("[[deform.handle]]"));
        let escape = SCENE.replace("report = true", "volume = \"../x.nii\"");
        assert!(parse(&escape, &[]).unwrap_err().contains("output.volume"));
        let two = SCENE.replace("pick = [0, 1, 2]", "pick = [0, 1, 2]\nvertex = 3");
        assert!(parse(&two, &[]).unwrap_err().contains("deform.handle.0"));
    }
}
