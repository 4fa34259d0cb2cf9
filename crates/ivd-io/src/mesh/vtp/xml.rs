//! The elements of a VTP file as far as they matter, and where the bytes of each array are.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::mesh::parse::{Failure, Number, REWRITE, parsed, shown};
use crate::vtk::{Appended, Broken, Parts, split};

/// Most arrays and pieces that are looked at.
const MOST: usize = 4096;
/// Most elements inside each other.
const DEEPEST: usize = 64;

/// Where an array's bytes are.
#[derive(Debug, Clone, Copy)]
pub(super) enum Content<'a> {
    /// Numbers as text.
    Ascii(&'a [u8]),
    /// Base64, between the tags or appended.
    Base64(&'a [u8]),
    /// Bytes as they are.
    Raw(&'a [u8]),
}

/// A part of a piece that holds arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Section {
    Field,
    PointData,
    Points,
    Strips,
    Polys,
    /// An array whose numbers stand between its tags.
    Array,
    Other,
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

/// How numbers are encoded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coding {
    pub(super) big: bool,
    /// Type of the words in front of an array.
    pub(super) word: Number,
    pub(super) zlib: bool,
}

#[derive(Debug)]
pub(super) struct Document<'a> {
    pub(super) coding: Coding,
    pub(super) pieces: Vec<Piece>,
    pub(super) arrays: Vec<Array<'a>>,
}

impl<'a> Document<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, Failure> {
        // The reader would pass over a mark of the encoding without counting it.
        let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        let (xml, appended) = parts(bytes)?;
        let mut reader = Reader::from_reader(xml);
        let mut document =
            Scan { xml, appended, coding: None, pieces: Vec::new(), arrays: Vec::new(), inside: Vec::new() };
        loop {
            let before = reader.buffer_position() as usize;
            let event = reader
                .read_event()
                .map_err(|e| Failure::byte(reader.error_position() as usize, format!("XML: {e}"), REWRITE))?;
            let after = reader.buffer_position() as usize;
            match event {
                Event::Start(start) => document.start(&start, after, false)?,
                Event::Empty(start) => document.start(&start, after, true)?,
                Event::Text(_) => document.text(before..after),
                Event::End(_) => drop(document.inside.pop()),
                Event::Eof => break,
                _ => {}
            }
        }
        let coding =
            document.coding.ok_or_else(|| Failure::at("VTKFile", "the element is missing", REWRITE))?;
        Ok(Self { coding, pieces: document.pieces, arrays: document.arrays })
    }
}

struct Scan<'a> {
    xml: &'a [u8],
    appended: Option<Appended<'a>>,
    coding: Option<Coding>,
    pieces: Vec<Piece>,
    arrays: Vec<Array<'a>>,
    /// The sections that are open.
    inside: Vec<Section>,
}

impl<'a> Scan<'a> {
    /// - `after`: the byte behind the tag.
    fn start(&mut self, start: &BytesStart, after: usize, empty: bool) -> Result<(), Failure> {
        let within = self.inside.last().copied();
        let section = match start.name().as_ref() {
            b"VTKFile" => {
                self.coding = Some(coding(start)?);
                Section::Other
            }
            b"PolyData" | b"Verts" | b"Lines" | b"CellData" => Section::Other,
            b"Piece" => {
                let count = |key: &str| attribute(start, key)?.map_or(Ok(0), |v| number(key, &v));
                self.pieces.push(Piece {
                    points: count("NumberOfPoints")?,
                    strips: count("NumberOfStrips")?,
                    polys: count("NumberOfPolys")?,
                });
                Section::Other
            }
            b"FieldData" => Section::Field,
            b"PointData" => Section::PointData,
            b"Points" => Section::Points,
            b"Strips" => Section::Strips,
            b"Polys" => Section::Polys,
            b"DataArray" | b"Array" => {
                if let Some(section) = within.filter(|s| !matches!(s, Section::Other | Section::Array)) {
                    let array = self.array(start, section)?;
                    self.arrays.push(array);
                    Section::Array
                } else {
                    Section::Other
                }
            }
            _ => Section::Other,
        };
        if self.arrays.len() + self.pieces.len() > MOST {
            return Err(Failure::byte(
                after,
                format!("more than {MOST} arrays and pieces"),
                "join the pieces",
            ));
        }
        if !empty {
            self.inside.push(section);
        }
        if self.inside.len() > DEEPEST {
            return Err(Failure::byte(
                after,
                format!("elements inside each other more than {DEEPEST} deep"),
                REWRITE,
            ));
        }
        Ok(())
    }

    /// The first text between an array's tags; elements may stand before it.
    fn text(&mut self, at: std::ops::Range<usize>) {
        let text = self.xml.get(at).unwrap_or_default();
        if self.inside.last() != Some(&Section::Array) || text.trim_ascii().is_empty() {
            return;
        }
        if let Some(Content::Ascii(held @ []) | Content::Base64(held @ [])) =
            self.arrays.last_mut().map(|a| &mut a.content)
        {
            *held = text;
        }
    }

    fn array(&self, start: &BytesStart, section: Section) -> Result<Array<'a>, Failure> {
        let name = attribute(start, "Name")?.unwrap_or_default();
        let bad = |problem: String| Failure::at(format!("DataArray {name:?}"), problem, REWRITE);
        let content = match attribute(start, "format")?.as_deref() {
            None | Some("ascii") => Content::Ascii(&[]),
            Some("binary") => Content::Base64(&[]),
            Some("appended") => {
                let offset = attribute(start, "offset")?.ok_or_else(|| bad("no offset".into()))?;
                let offset: u64 = number("offset", &offset)?;
                let appended =
                    self.appended.ok_or_else(|| bad("the element AppendedData is missing".into()))?;
                let rest =
                    usize::try_from(offset).ok().and_then(|o| appended.bytes.get(o..)).ok_or_else(|| {
                        bad(format!("offset {offset} of {} appended bytes", appended.bytes.len()))
                    })?;
                if appended.raw { Content::Raw(rest) } else { Content::Base64(rest) }
            }
            Some(other) => return Err(bad(format!("format `{}` isn't known", shown(other.as_bytes())))),
        };
        let components =
            attribute(start, "NumberOfComponents")?.map_or(Ok(1), |v| number("NumberOfComponents", &v))?;
        let kind = attribute(start, "type")?;
        let kind = kind.as_deref().and_then(number_type);
        Ok(Array {
            piece: self.pieces.len().saturating_sub(1),
            section,
            name,
            number: kind,
            components,
            content,
        })
    }
}

fn number_type(name: &str) -> Option<Number> {
    Some(match name {
        "Int8" => Number::I8,
        // The text of a string array is character codes.
        "UInt8" | "String" => Number::U8,
        "Int16" => Number::I16,
        "UInt16" => Number::U16,
        "Int32" => Number::I32,
        "UInt32" => Number::U32,
        "Int64" => Number::I64,
        "UInt64" => Number::U64,
        "Float32" => Number::F32,
        "Float64" => Number::F64,
        _ => return None,
    })
}

fn coding(file: &BytesStart) -> Result<Coding, Failure> {
    let bad = |problem: String, remedy| Failure::at("VTKFile", problem, remedy);
    match attribute(file, "type")?.as_deref() {
        Some("PolyData") => {}
        Some(other) => {
            let problem = format!("data of type `{}`", shown(other.as_bytes()));
            return Err(bad(problem, "save the surface as PolyData"));
        }
        None => return Err(bad("no type".into(), REWRITE)),
    }
    let big = match attribute(file, "byte_order")?.as_deref() {
        None | Some("LittleEndian") => false,
        Some("BigEndian") => true,
        Some(other) => return Err(bad(format!("byte order `{}`", shown(other.as_bytes())), REWRITE)),
    };
    let word = match attribute(file, "header_type")?.as_deref() {
        None | Some("UInt32") => Number::U32,
        Some("UInt64") => Number::U64,
        Some(other) => return Err(bad(format!("header type `{}`", shown(other.as_bytes())), REWRITE)),
    };
    let zlib = match attribute(file, "compressor")?.as_deref() {
        None | Some("") => false,
        Some("vtkZLibDataCompressor") => true,
        Some(other) => {
            let problem = format!("compressor `{}`", shown(other.as_bytes()));
            return Err(bad(problem, "save it with zlib or uncompressed"));
        }
    };
    Ok(Coding { big, word, zlib })
}

/// Bytes of an attribute's value at most: names and numbers are shorter.
const LONGEST: usize = 1024;

/// An attribute's value. Without the search for repeated names, which takes the square of their number.
fn attribute(element: &BytesStart, key: &str) -> Result<Option<String>, Failure> {
    for attribute in element.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| {
            Failure::at(shown(element.name().as_ref()), format!("its attributes: {e}"), REWRITE)
        })?;
        if attribute.key.as_ref() == key.as_bytes() {
            if attribute.value.len() > LONGEST {
                let problem = format!("`{key}` of {} bytes", attribute.value.len());
                return Err(Failure::at(shown(element.name().as_ref()), problem, REWRITE));
            }
            return Ok(Some(String::from_utf8_lossy(&attribute.value).trim().to_owned()));
        }
    }
    Ok(None)
}

fn number(key: &str, value: &str) -> Result<u64, Failure> {
    parsed(value.as_bytes())
        .ok_or_else(|| Failure::at(key, format!("`{}` is no count", shown(value.as_bytes())), REWRITE))
}

/// Parts the XML from the appended data.
fn parts(bytes: &[u8]) -> Result<Parts<'_>, Failure> {
    split(bytes).map_err(|(at, broken)| {
        let problem = match broken {
            Broken::Tag => "its tag doesn't end",
            Broken::Empty | Broken::Mark => "its data don't begin with `_`",
            Broken::Encoding => "its encoding is neither `raw` nor `base64`",
        };
        Failure::byte(at, format!("AppendedData: {problem}"), REWRITE)
    })
}
