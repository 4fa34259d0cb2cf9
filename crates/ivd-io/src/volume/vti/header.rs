//! What an image is: its extent and place, and the array that holds its voxels.

use std::path::Path;
use std::str::FromStr;

use ivd_core::VoxelType;

use crate::Space;
use crate::volume::foreign::SURFACE;
use crate::volume::{Error, bounded};
use crate::vtk::{self, Appended, Broken, Coding, Content, DEEPEST, Element, Fault, Text};

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
    /// What the field `SPACE` says.
    pub(super) space: Option<Space>,
    pub(super) coding: Coding,
    pub(super) voxel_type: VoxelType,
    pub(super) content: Content<'a>,
}

/// A `DataArray` of the point data.
struct Array<'a> {
    element: Element<'a>,
    text: &'a [u8],
}

/// The XML's elements as far as they matter.
#[derive(Default)]
struct Scan<'a> {
    file: Option<Element<'a>>,
    image: Option<Element<'a>>,
    piece: Option<Element<'a>>,
    pieces: usize,
    points: Option<Element<'a>>,
    arrays: Vec<Array<'a>>,
    cell_arrays: usize,
    space: Option<Space>,
    appended: Option<Appended<'a>>,
}

impl<'a> Header<'a> {
    pub(super) fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self, Error> {
        let found = Scan::of(path, bytes)?;
        let said = |fault| error(path, fault);
        let missing = |what: &str| Error::field(path, what, "the element is missing");
        let file = found.file.as_ref().ok_or_else(|| missing("VTKFile"))?;
        vtk::check_type(file, "ImageData").map_err(said)?;
        let image = found.image.as_ref().ok_or_else(|| missing("ImageData"))?;
        let piece = found.piece.as_ref().ok_or_else(|| missing("Piece"))?;
        if found.pieces != 1 {
            let what = format!("image data in {} pieces", found.pieces);
            return Err(Error::unsupported(path, what, "save the image as one piece"));
        }
        let (start, dims) = extent(path, image, piece)?;
        let direction: [f64; 9] =
            numbers(path, image, "Direction")?.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let array = found.scalars(path)?;
        Ok(Self {
            dims,
            start,
            spacing: numbers(path, image, "Spacing")?.unwrap_or([1.0; 3]),
            origin: numbers(path, image, "Origin")?.unwrap_or([0.0; 3]),
            // Stored row by row; an axis is a column.
            axes: std::array::from_fn(|a| std::array::from_fn(|row| direction[3 * row + a])),
            space: found.space,
            coding: Coding::of(file).map_err(said)?,
            voxel_type: voxel_type(path, &array.element)?,
            content: Content::of(&array.element, found.appended).map_err(said)?.between(array.text),
        })
    }
}

impl<'a> Scan<'a> {
    fn of(path: &Path, bytes: &'a [u8]) -> Result<Self, Error> {
        let said = |fault| error(path, fault);
        let (mut elements, appended) = vtk::open(bytes).map_err(said)?;
        let mut found = Self { appended, ..Self::default() };
        while let Some(element) = elements.read().map_err(said)? {
            element.check().map_err(said)?;
            match (element.name(), element.parent()) {
                (b"VTKFile", _) => found.file = Some(element),
                (b"ImageData", _) => found.image = Some(element),
                (b"Piece", _) => {
                    found.pieces += 1;
                    found.piece = Some(element);
                }
                (b"PointData", _) => found.points = Some(element),
                (b"DataArray", b"CellData") => found.cell_arrays += 1,
                (b"Array", b"FieldData")
                    if element.get("Name").map_err(said)?.as_deref() == Some("SPACE") =>
                {
                    found.space = Some(space(path, &element, &elements.text(&element).map_err(said)?)?);
                }
                (b"DataArray", b"PointData") => {
                    let text = elements.text(&element).map_err(|fault| match fault {
                        Fault::Xml { problem, .. } => Error::corrupt(path, "DataArray", problem),
                        other => error(path, other),
                    })?;
                    if !text.closed {
                        return Err(Error::corrupt(path, "DataArray", "the file ends inside it"));
                    }
                    found.arrays.push(Array { element, text: text.bytes });
                }
                _ => {}
            }
        }
        Ok(found)
    }

    /// The scalar array: the one that `Scalars` names, else the first.
    fn scalars(&self, path: &Path) -> Result<&Array<'a>, Error> {
        let said = |fault| error(path, fault);
        let mut chosen = self.arrays.first();
        if let Some(points) = &self.points
            && let Some(wanted) = points.get("Scalars").map_err(said)?
        {
            for array in &self.arrays {
                if array.element.get("Name").map_err(said)?.as_ref() == Some(&wanted) {
                    chosen = Some(array);
                    break;
                }
            }
        }
        let Some(array) = chosen else {
            if self.cell_arrays > 0 {
                let remedy = "convert cell data to point data";
                return Err(Error::unsupported(path, "image data with CellData alone", remedy));
            }
            return Err(Error::field(path, "PointData", "no DataArray"));
        };
        match array.element.get("NumberOfComponents").map_err(said)?.as_deref() {
            None | Some("1") => Ok(array),
            Some(n) => Err(Error::unsupported(
                path,
                format!("DataArray of {n} components"),
                "save a single component",
            )),
        }
    }
}

/// What the field `SPACE` says, a text of character codes.
fn space(path: &Path, element: &Element, text: &Text) -> Result<Space, Error> {
    let format = element.get("format").map_err(|fault| error(path, fault))?;
    if !matches!(format.as_deref(), None | Some("ascii")) {
        let remedy = "save the image with its data as ascii, or without the field";
        return Err(Error::unsupported(path, "a field SPACE that isn't ascii", remedy));
    }
    Space::named(&vtk::text_of_codes(text.bytes)).map_err(|problem| Error::field(path, "SPACE", problem))
}

/// `N` numbers separated by white space; `None` where the attribute is absent.
fn numbers<T: FromStr, const N: usize>(
    path: &Path,
    element: &Element,
    key: &'static str,
) -> Result<Option<[T; N]>, Error> {
    let Some(text) = element.get(key).map_err(|fault| error(path, fault))? else { return Ok(None) };
    let values: Option<Vec<T>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    let values: Option<[T; N]> = values.and_then(|v| v.try_into().ok());
    let name = String::from_utf8_lossy(element.name());
    let bad = || Error::field(path, format!("{name} {key}"), format!("`{text}` isn't {N} numbers"));
    values.map(Some).ok_or_else(bad)
}

fn voxel_type(path: &Path, array: &Element) -> Result<VoxelType, Error> {
    let name = array.get("type").map_err(|fault| error(path, fault))?;
    let name = name.ok_or_else(|| Error::field(path, "DataArray type", "missing"))?;
    vtk::voxel_type(&name).ok_or_else(|| {
        Error::unsupported(path, format!("DataArray of type {name}"), "save at most 32 bit integers")
    })
}

/// First index and number of points along each axis.
fn extent(path: &Path, image: &Element, piece: &Element) -> Result<([i64; 3], [usize; 3]), Error> {
    let bad = |problem: String| Error::field(path, "Piece Extent", problem);
    let whole: Option<[i64; 6]> = numbers(path, image, "WholeExtent")?;
    let own: Option<[i64; 6]> = numbers(path, piece, "Extent")?;
    let extent = own.or(whole).ok_or_else(|| bad("missing".into()))?;
    if whole.is_some_and(|whole| whole != extent) {
        return Err(bad(format!("{extent:?} isn't the whole extent")));
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

/// What is wrong with the file, as it is said of a volume.
fn error(path: &Path, fault: Fault) -> Error {
    let field = |name: &str, problem: String| Error::field(path, name, problem);
    match fault {
        Fault::Xml { problem, .. } => Error::corrupt(path, "XML", problem),
        Fault::Deep { .. } => {
            Error::corrupt(path, "XML", format!("elements inside each other more than {DEEPEST} deep"))
        }
        Fault::Attributes { element, problem } => Error::corrupt(path, format!("element {element}"), problem),
        Fault::Long { element, key, bytes } => {
            field(&format!("{element} {key}"), format!("{bytes} bytes long"))
        }
        Fault::Appended { broken: Broken::Tag | Broken::Empty, length, .. } => {
            Error::truncated(path, "AppendedData", length as u64 + 1, length as u64)
        }
        Fault::Appended { broken: Broken::Mark, .. } => {
            field("AppendedData", "the data doesn't start with `_`".into())
        }
        Fault::Appended { broken: Broken::Encoding, .. } => {
            field("AppendedData encoding", "neither `raw` nor `base64`".into())
        }
        Fault::Type(None) => field("VTKFile type", "missing".into()),
        Fault::Type(Some(other)) => {
            let remedy = if other == "PolyData" { SURFACE } else { "save it as ImageData" };
            Error::unsupported(path, format!("VTK data of type {other}"), remedy)
        }
        Fault::ByteOrder(other) => field("VTKFile byte_order", format!("`{other}` is no byte order")),
        Fault::HeaderType(other) => field("VTKFile header_type", format!("`{other}` is no known type")),
        Fault::Compressor(other) => {
            Error::unsupported(path, format!("compressor {other}"), "save with zlib or without compression")
        }
        Fault::Format(other) => field("DataArray format", format!("`{other}` is no known format")),
        Fault::NoOffset => field("DataArray offset", "missing".into()),
        Fault::Offset(text) => field("DataArray offset", format!("`{text}` isn't 1 numbers")),
        Fault::NoAppended => field("AppendedData", "the element is missing".into()),
        Fault::Beyond { offset, length } => Error::truncated(path, "AppendedData", offset, length as u64),
    }
}
