use std::borrow::Cow;
use std::path::Path;

use ivd_core::VoxelType;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::volume::{ByteOrder, Error, bounded};
use crate::vtk::{Appended, Broken, Parts, split};

/// Where an array's bytes are.
#[derive(Debug, Clone)]
pub(super) enum Content<'a> {
    /// Numbers as text.
    Ascii(Cow<'a, [u8]>),
    /// Base64 between the tags.
    Inline(Cow<'a, [u8]>),
    /// The appended bytes from the array's offset on.
    AppendedRaw(&'a [u8]),
    /// The appended base64 from the array's offset on.
    AppendedText(&'a [u8]),
}

/// What the XML says, and where the chosen array is.
#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) dims: [usize; 3],
    /// First index of the extent.
    pub(super) start: [i64; 3],
    pub(super) spacing: [f64; 3],
    pub(super) origin: [f64; 3],
    /// `axes[a]` is the direction of axis `a`.
    pub(super) axes: [[f64; 3]; 3],
    pub(super) order: ByteOrder,
    /// Bytes of a word of a block header: 4 or 8.
    pub(super) word: usize,
    pub(super) zlib: bool,
    pub(super) voxel_type: VoxelType,
    pub(super) content: Content<'a>,
}

/// An element's attributes.
struct Attributes<'p>(&'p Path, String, Vec<(String, String)>);

impl<'p> Attributes<'p> {
    fn of(path: &'p Path, element: &BytesStart) -> Result<Self, Error> {
        let name = String::from_utf8_lossy(element.name().as_ref()).into_owned();
        let mut list = Vec::new();
        for attribute in element.attributes() {
            let attribute = attribute.map_err(|e| Error::corrupt(path, format!("element {name}"), e))?;
            list.push((
                String::from_utf8_lossy(attribute.key.as_ref()).into_owned(),
                String::from_utf8_lossy(&attribute.value).into_owned(),
            ));
        }
        Ok(Self(path, name, list))
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.2.iter().find(|(k, _)| k == key).map(|(_, v)| v.trim())
    }

    fn bad(&self, key: &str, problem: impl Into<String>) -> Error {
        Error::field(self.0, format!("{} {key}", self.1), problem)
    }

    /// `N` numbers separated by white space; `None` where the attribute is absent.
    fn numbers<T: std::str::FromStr, const N: usize>(&self, key: &str) -> Result<Option<[T; N]>, Error> {
        let Some(text) = self.get(key) else { return Ok(None) };
        let values: Option<Vec<T>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
        let values: Option<[T; N]> = values.and_then(|v| v.try_into().ok());
        values.map(Some).ok_or_else(|| self.bad(key, format!("`{text}` isn't {N} numbers")))
    }
}

/// A `DataArray` of the point data.
struct Array<'a, 'p> {
    attributes: Attributes<'p>,
    text: Cow<'a, [u8]>,
}

/// The XML's elements as far as they matter.
#[derive(Default)]
struct Elements<'a, 'p> {
    file: Option<Attributes<'p>>,
    image: Option<Attributes<'p>>,
    piece: Option<Attributes<'p>>,
    pieces: usize,
    points: Option<Attributes<'p>>,
    arrays: Vec<Array<'a, 'p>>,
    cell_arrays: usize,
}

impl<'a> Header<'a> {
    pub(super) fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self, Error> {
        let (xml, appended) = parts(path, bytes)?;
        let elements = scan(path, xml)?;
        let missing = |what: &str| Error::field(path, what, "the element is missing");
        let file = elements.file.as_ref().ok_or_else(|| missing("VTKFile"))?;
        check_kind(path, file)?;
        let image = elements.image.as_ref().ok_or_else(|| missing("ImageData"))?;
        let piece = elements.piece.as_ref().ok_or_else(|| missing("Piece"))?;
        if elements.pieces != 1 {
            let what = format!("image data in {} pieces", elements.pieces);
            return Err(Error::unsupported(path, what, "save the image as one piece"));
        }
        let (start, dims) = extent(path, image, piece)?;
        let direction: [f64; 9] =
            image.numbers("Direction")?.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let array = choose(path, &elements)?;
        Ok(Self {
            dims,
            start,
            spacing: image.numbers("Spacing")?.unwrap_or([1.0; 3]),
            origin: image.numbers("Origin")?.unwrap_or([0.0; 3]),
            // Stored row by row; an axis is a column.
            axes: std::array::from_fn(|a| std::array::from_fn(|row| direction[3 * row + a])),
            order: byte_order(file)?,
            word: match file.get("header_type") {
                None | Some("UInt32") => 4,
                Some("UInt64") => 8,
                Some(other) => return Err(file.bad("header_type", format!("`{other}` is no known type"))),
            },
            zlib: compressed(path, file)?,
            voxel_type: voxel_type(path, &array.attributes)?,
            content: content(path, array, appended)?,
        })
    }
}

fn check_kind(path: &Path, file: &Attributes) -> Result<(), Error> {
    match file.get("type") {
        Some("ImageData") => Ok(()),
        Some(other) => {
            Err(Error::unsupported(path, format!("VTK data of type {other}"), "save it as ImageData"))
        }
        None => Err(file.bad("type", "missing")),
    }
}

fn byte_order(file: &Attributes) -> Result<ByteOrder, Error> {
    match file.get("byte_order") {
        None | Some("LittleEndian") => Ok(ByteOrder::Little),
        Some("BigEndian") => Ok(ByteOrder::Big),
        Some(other) => Err(file.bad("byte_order", format!("`{other}` is no byte order"))),
    }
}

fn compressed(path: &Path, file: &Attributes) -> Result<bool, Error> {
    match file.get("compressor") {
        None | Some("") => Ok(false),
        Some("vtkZLibDataCompressor") => Ok(true),
        Some(other) => Err(Error::unsupported(
            path,
            format!("compressor {other}"),
            "save with zlib or without compression",
        )),
    }
}

fn voxel_type(path: &Path, array: &Attributes) -> Result<VoxelType, Error> {
    Ok(match array.get("type") {
        Some("UInt8") => VoxelType::U8,
        Some("Int8") => VoxelType::I8,
        Some("UInt16") => VoxelType::U16,
        Some("Int16") => VoxelType::I16,
        Some("UInt32") => VoxelType::U32,
        Some("Int32") => VoxelType::I32,
        Some("Float32") => VoxelType::F32,
        Some("Float64") => VoxelType::F64,
        Some(other) => {
            return Err(Error::unsupported(
                path,
                format!("DataArray of type {other}"),
                "save at most 32 bit integers",
            ));
        }
        None => return Err(array.bad("type", "missing")),
    })
}

/// First index and number of points along each axis.
fn extent(path: &Path, image: &Attributes, piece: &Attributes) -> Result<([i64; 3], [usize; 3]), Error> {
    let whole: Option<[i64; 6]> = image.numbers("WholeExtent")?;
    let own: Option<[i64; 6]> = piece.numbers("Extent")?;
    let extent = own.or(whole).ok_or_else(|| piece.bad("Extent", "missing"))?;
    if whole.is_some_and(|whole| whole != extent) {
        return Err(piece.bad("Extent", format!("{extent:?} isn't the whole extent")));
    }
    let mut dims = [0; 3];
    for axis in 0..3 {
        let [low, high] = [extent[2 * axis], extent[2 * axis + 1]];
        let points = high.checked_sub(low).and_then(|n| n.checked_add(1)).unwrap_or(-1);
        dims[axis] = bounded::size(path, "Piece Extent", points)?;
    }
    bounded::voxel_count(path, "Piece Extent", dims)?;
    Ok(([extent[0], extent[2], extent[4]], dims))
}

/// The scalar array: the one that `Scalars` names, else the first.
fn choose<'e, 'a, 'p>(path: &Path, elements: &'e Elements<'a, 'p>) -> Result<&'e Array<'a, 'p>, Error> {
    let wanted = elements.points.as_ref().and_then(|p| p.get("Scalars"));
    let named = wanted.and_then(|w| elements.arrays.iter().find(|a| a.attributes.get("Name") == Some(w)));
    let Some(array) = named.or(elements.arrays.first()) else {
        if elements.cell_arrays > 0 {
            let remedy = "convert cell data to point data";
            return Err(Error::unsupported(path, "image data with CellData alone", remedy));
        }
        return Err(Error::field(path, "PointData", "no DataArray"));
    };
    match array.attributes.get("NumberOfComponents") {
        None | Some("1") => Ok(array),
        Some(n) => {
            Err(Error::unsupported(path, format!("DataArray of {n} components"), "save a single component"))
        }
    }
}

fn content<'a>(
    path: &Path,
    array: &Array<'a, '_>,
    appended: Option<Appended<'a>>,
) -> Result<Content<'a>, Error> {
    let attributes = &array.attributes;
    match attributes.get("format") {
        Some("ascii") | None => Ok(Content::Ascii(array.text.clone())),
        Some("binary") => Ok(Content::Inline(array.text.clone())),
        Some("appended") => {
            let [offset]: [usize; 1] =
                attributes.numbers("offset")?.ok_or_else(|| attributes.bad("offset", "missing"))?;
            let appended =
                appended.ok_or_else(|| Error::field(path, "AppendedData", "the element is missing"))?;
            let rest = appended.bytes.get(offset..).ok_or_else(|| {
                Error::truncated(path, "AppendedData", offset as u64, appended.bytes.len() as u64)
            })?;
            Ok(if appended.raw { Content::AppendedRaw(rest) } else { Content::AppendedText(rest) })
        }
        Some(other) => Err(attributes.bad("format", format!("`{other}` is no known format"))),
    }
}

/// Parts the XML from the appended data.
fn parts<'a>(path: &Path, bytes: &'a [u8]) -> Result<Parts<'a>, Error> {
    split(bytes).map_err(|(_, broken)| match broken {
        Broken::Tag | Broken::Empty => {
            Error::truncated(path, "AppendedData", bytes.len() as u64 + 1, bytes.len() as u64)
        }
        Broken::Mark => Error::field(path, "AppendedData", "the data doesn't start with `_`"),
        Broken::Encoding => Error::field(path, "AppendedData encoding", "neither `raw` nor `base64`"),
    })
}

fn scan<'a, 'p>(path: &'p Path, xml: &'a [u8]) -> Result<Elements<'a, 'p>, Error> {
    let mut reader = Reader::from_reader(xml);
    let mut found = Elements::default();
    let mut parents: Vec<Vec<u8>> = Vec::new();
    loop {
        let event = reader.read_event().map_err(|e| Error::corrupt(path, "XML", e))?;
        let (start, empty) = match event {
            Event::Start(start) => (start, false),
            Event::Empty(start) => (start, true),
            Event::End(_) => {
                parents.pop();
                continue;
            }
            Event::Eof => return Ok(found),
            _ => continue,
        };
        let attributes = Attributes::of(path, &start)?;
        let parent = parents.last().map_or(&b""[..], Vec::as_slice);
        match start.name().as_ref() {
            b"VTKFile" => found.file = Some(attributes),
            b"ImageData" => found.image = Some(attributes),
            b"Piece" => {
                found.pieces += 1;
                found.piece = Some(attributes);
            }
            b"PointData" => found.points = Some(attributes),
            b"DataArray" if parent == b"CellData" => found.cell_arrays += 1,
            b"DataArray" if parent == b"PointData" => {
                let text = if empty { Cow::default() } else { first_text(path, &mut reader)? };
                found.arrays.push(Array { attributes, text });
                // Its end has been read.
                continue;
            }
            _ => {}
        }
        if !empty {
            parents.push(start.name().as_ref().to_vec());
        }
    }
}

/// The text between an element's tags, up to its end; text of elements inside it is left out.
fn first_text<'a>(path: &Path, reader: &mut Reader<&'a [u8]>) -> Result<Cow<'a, [u8]>, Error> {
    let mut text = Cow::default();
    let mut depth = 0_usize;
    loop {
        match reader.read_event().map_err(|e| Error::corrupt(path, "DataArray", e))? {
            Event::Start(_) => depth += 1,
            Event::End(_) if depth == 0 => return Ok(text),
            Event::End(_) => depth -= 1,
            Event::Text(part) if depth == 0 && text.is_empty() => {
                let part = part.into_inner();
                if !part.trim_ascii().is_empty() {
                    text = part;
                }
            }
            Event::Eof => return Err(Error::corrupt(path, "DataArray", "the file ends inside it")),
            _ => {}
        }
    }
}
