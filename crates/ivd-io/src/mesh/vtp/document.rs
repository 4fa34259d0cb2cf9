//! What a polydata is: its pieces, and the arrays of each.

use crate::mesh::parse::{Failure, REWRITE, parsed, shown};
use crate::number::Number;
use crate::vtk::{self, Appended, Broken, Coding, Content, DEEPEST, Element, Fault};

/// Most arrays and pieces that are looked at.
const MOST: usize = 4096;

/// A part of a piece that holds arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Section {
    Field,
    PointData,
    Points,
    Strips,
    Polys,
}

impl Section {
    /// The section that an element is.
    fn of(name: &[u8]) -> Option<Self> {
        match name {
            b"FieldData" => Some(Self::Field),
            b"PointData" => Some(Self::PointData),
            b"Points" => Some(Self::Points),
            b"Strips" => Some(Self::Strips),
            b"Polys" => Some(Self::Polys),
            _ => None,
        }
    }
}

#[derive(Debug)]
pub(super) struct Array<'a> {
    /// Number of its piece, from 0; of field data, how many pieces came before.
    pub(super) piece: usize,
    pub(super) section: Section,
    pub(super) name: String,
    pub(super) number: Option<Number>,
    pub(super) components: u64,
    pub(super) content: Content<'a>,
}

#[derive(Debug, Default)]
pub(super) struct Piece {
    pub(super) points: u64,
    pub(super) strips: u64,
    pub(super) polys: u64,
}

#[derive(Debug)]
pub(super) struct Document<'a> {
    pub(super) coding: Coding,
    pub(super) pieces: Vec<Piece>,
    pub(super) arrays: Vec<Array<'a>>,
}

impl<'a> Document<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, Failure> {
        let (mut elements, appended) = vtk::open(bytes).map_err(failure)?;
        let mut coding = None;
        let mut pieces = Vec::new();
        let mut arrays = Vec::new();
        while let Some(element) = elements.read().map_err(failure)? {
            let at = elements.at();
            match element.name() {
                b"VTKFile" => {
                    vtk::check_type(&element, "PolyData").map_err(failure)?;
                    coding = Some(Coding::of(&element).map_err(failure)?);
                }
                b"Piece" => pieces.push(Piece::of(&element)?),
                b"DataArray" | b"Array" => {
                    if let Some(section) = Section::of(element.parent()) {
                        let mut array = Array::of(&element, section, pieces.len(), appended)?;
                        // A file that ends inside is told by the array's reader, if the array is used.
                        let text = elements.text(&element).map_err(failure)?;
                        array.content = array.content.between(text.bytes);
                        arrays.push(array);
                    }
                }
                _ => {}
            }
            if arrays.len() + pieces.len() > MOST {
                let problem = format!("more than {MOST} arrays and pieces");
                return Err(Failure::byte(at, problem, "join the pieces"));
            }
        }
        let coding = coding.ok_or_else(|| Failure::at("VTKFile", "the element is missing", REWRITE))?;
        Ok(Self { coding, pieces, arrays })
    }
}

impl Piece {
    fn of(element: &Element) -> Result<Self, Failure> {
        let count = |key| count(element, key).map(Option::unwrap_or_default);
        Ok(Self {
            points: count("NumberOfPoints")?,
            strips: count("NumberOfStrips")?,
            polys: count("NumberOfPolys")?,
        })
    }
}

impl<'a> Array<'a> {
    /// What its tag says; `pieces` have begun.
    fn of(
        element: &Element,
        section: Section,
        pieces: usize,
        appended: Option<Appended<'a>>,
    ) -> Result<Self, Failure> {
        let name = element.get("Name").map_err(failure)?.unwrap_or_default();
        let content = Content::of(element, appended).map_err(|fault| failure_in(&name, fault))?;
        let components = count(element, "NumberOfComponents")?.unwrap_or(1);
        let number = element.get("type").map_err(failure)?.and_then(|kind| match kind.as_str() {
            // The text of a string array is character codes.
            "String" => Some(Number::U8),
            kind => vtk::number(kind),
        });
        Ok(Self { piece: pieces.saturating_sub(1), section, name, number, components, content })
    }
}

/// A count among an element's attributes.
fn count(element: &Element, key: &'static str) -> Result<Option<u64>, Failure> {
    let value = element.get(key).map_err(failure)?;
    value.map(|value| parsed(value.as_bytes()).ok_or_else(|| no_count(key, &value))).transpose()
}

fn no_count(key: &str, value: &str) -> Failure {
    Failure::at(key, format!("`{}` is no count", shown(value.as_bytes())), REWRITE)
}

/// What is wrong with the file, as it is said of a mesh.
fn failure(fault: Fault) -> Failure {
    failure_in("", fault)
}

/// The same, for the tag of the array of that name.
fn failure_in(array: &str, fault: Fault) -> Failure {
    let shown = |text: &str| shown(text.as_bytes());
    let in_file = |problem: String, remedy| Failure::at("VTKFile", problem, remedy);
    let in_array = |problem: String| Failure::at(format!("DataArray {array:?}"), problem, REWRITE);
    match fault {
        Fault::Xml { at, problem } => Failure::byte(at, format!("XML: {problem}"), REWRITE),
        Fault::Deep { at } => {
            Failure::byte(at, format!("elements inside each other more than {DEEPEST} deep"), REWRITE)
        }
        Fault::Attributes { element, problem } => {
            Failure::at(shown(&element), format!("its attributes: {problem}"), REWRITE)
        }
        Fault::Long { element, key, bytes } => {
            Failure::at(shown(&element), format!("`{key}` of {bytes} bytes"), REWRITE)
        }
        Fault::Appended { at, broken, .. } => {
            let problem = match broken {
                Broken::Tag => "its tag doesn't end",
                Broken::Empty | Broken::Mark => "its data don't begin with `_`",
                Broken::Encoding => "its encoding is neither `raw` nor `base64`",
            };
            Failure::byte(at, format!("AppendedData: {problem}"), REWRITE)
        }
        Fault::Type(None) => in_file("no type".into(), REWRITE),
        Fault::Type(Some(other)) => {
            in_file(format!("data of type `{}`", shown(&other)), "save the surface as PolyData")
        }
        Fault::ByteOrder(other) => in_file(format!("byte order `{}`", shown(&other)), REWRITE),
        Fault::HeaderType(other) => in_file(format!("header type `{}`", shown(&other)), REWRITE),
        Fault::Compressor(other) => {
            in_file(format!("compressor `{}`", shown(&other)), "save it with zlib or uncompressed")
        }
        Fault::Format(other) => in_array(format!("format `{}` isn't known", shown(&other))),
        Fault::NoOffset => in_array("no offset".into()),
        Fault::Offset(text) => no_count("offset", &text),
        Fault::NoAppended => in_array("the element AppendedData is missing".into()),
        Fault::Beyond { offset, length } => in_array(format!("offset {offset} of {length} appended bytes")),
    }
}
