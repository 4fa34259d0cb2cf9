//! The text at the head of a PLY file.

use crate::Space;
use crate::mesh::parse::{Failure, REWRITE, parsed, shown};
use crate::number::Number;
use crate::order::ByteOrder;

/// Longest head that is read; ours has some 600 bytes.
const LONGEST: usize = 1 << 20;
/// Most properties of all elements together.
const MOST: usize = 4096;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary(ByteOrder),
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) number: Number,
    /// Type of the length in front of a list.
    pub(super) length: Option<Number>,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) space: Space,
    /// Where the body starts.
    pub(super) body: usize,
    /// Line in which it starts, from 1.
    pub(super) line: u64,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, Failure> {
        let mut lines = Lines { bytes: &bytes[..bytes.len().min(LONGEST)], at: 0, line: 0 };
        if lines.next().map(<[u8]>::trim_ascii) != Some(b"ply") {
            return Err(Failure::line(1, "a PLY file starts with `ply`", "give the file its right ending"));
        }
        let (mut encoding, mut space) = (None, Space::Ras);
        let mut elements: Vec<Element> = Vec::new();
        let mut properties = 0;
        while let Some(text) = lines.next() {
            let bad = |problem: String| Failure::line(lines.line, problem, REWRITE);
            let words: Vec<&[u8]> = text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect();
            match words.as_slice() {
                [b"format", name, _] => {
                    let known = "ascii, binary_little_endian, binary_big_endian";
                    let unknown = || bad(format!("format `{}` is none of {known}", shown(name)));
                    encoding = Some(encoding_of(name).ok_or_else(unknown)?);
                }
                [b"comment" | b"obj_info", ..] => space = Space::of(text).unwrap_or(space),
                [b"element", name, count] => {
                    let count =
                        parsed(count).ok_or_else(|| bad(format!("`{}` is no count", shown(count))))?;
                    elements.push(Element { name: owned(name), count, properties: Vec::new() });
                }
                [b"property", rest @ ..] => {
                    let property =
                        property(rest).ok_or_else(|| bad(format!("property `{}`", shown(text))))?;
                    let element =
                        elements.last_mut().ok_or_else(|| bad("a property before any element".into()))?;
                    element.properties.push(property);
                    properties += 1;
                }
                [b"end_header"] => {
                    let encoding = encoding.ok_or_else(|| bad("the line `format` is missing".into()))?;
                    return Ok(Self { encoding, elements, space, body: lines.at, line: lines.line + 1 });
                }
                [] => {}
                _ => return Err(bad(format!("`{}` is no line of a PLY head", shown(text)))),
            }
            if properties + elements.len() > MOST {
                return Err(bad(format!("more than {MOST} elements and properties")));
            }
        }
        let problem = format!("no `end_header` in the first {} bytes", lines.bytes.len());
        Err(Failure::line(lines.line, problem, REWRITE))
    }
}

fn owned(word: &[u8]) -> String {
    String::from_utf8_lossy(word).into_owned()
}

fn encoding_of(name: &[u8]) -> Option<Encoding> {
    match name {
        b"ascii" => Some(Encoding::Ascii),
        b"binary_little_endian" => Some(Encoding::Binary(ByteOrder::Little)),
        b"binary_big_endian" => Some(Encoding::Binary(ByteOrder::Big)),
        _ => None,
    }
}

/// `type name` or `list type type name`.
fn property(words: &[&[u8]]) -> Option<Property> {
    match words {
        [b"list", length, number, name] => {
            let length = number_of(length).filter(|n| n.is_integer())?;
            Some(Property { name: owned(name), number: number_of(number)?, length: Some(length) })
        }
        [number, name] => Some(Property { name: owned(name), number: number_of(number)?, length: None }),
        _ => None,
    }
}

fn number_of(name: &[u8]) -> Option<Number> {
    Some(match name {
        b"char" | b"int8" => Number::I8,
        b"uchar" | b"uint8" => Number::U8,
        b"short" | b"int16" => Number::I16,
        b"ushort" | b"uint16" => Number::U16,
        b"int" | b"int32" => Number::I32,
        b"uint" | b"uint32" => Number::U32,
        b"int64" => Number::I64,
        b"uint64" => Number::U64,
        b"float" | b"float32" => Number::F32,
        b"double" | b"float64" => Number::F64,
        _ => return None,
    })
}

/// Lines that end in a line feed, with or without a carriage return, or in a carriage return alone.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Number of the line that came last.
    line: u64,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r'))?;
        let both = rest[end] == b'\r' && rest.get(end + 1) == Some(&b'\n');
        self.at += end + 1 + usize::from(both);
        self.line += 1;
        Some(&rest[..end])
    }
}
