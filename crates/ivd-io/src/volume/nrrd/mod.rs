//! NRRD: `.nrrd` with its data inside, `.nhdr` with the data in a file of its own.
//!
//! Raw, gzip and text encodings. Spaces LPS, RAS and LAS; a file without a space, or with one without anatomy
//! (`3D-right-handed`), is taken as ITK takes it: its coordinates are LPS. `space units` and `old min`/`old max` change
//! nothing, as in ITK.

mod axes;
mod header;
mod write;

use std::path::{Path, PathBuf};

use ivd_core::{Exec, Volume, VoxelType};

use crate::Space;
use crate::volume::components::Components;
use crate::volume::data::{self, DataFile, Encoding, Frames, Start};
use crate::volume::stored::FileType;
use crate::volume::text_header::Header;
use crate::volume::{ByteOrder, Error, bounded, orientation};
use axes::Axes;
pub(crate) use write::{field, write};

/// Reads a volume; `frame` chooses one of a file whose slowest axis isn't space.
pub(crate) fn read(path: &Path, frame: Option<usize>, exec: &Exec) -> Result<Volume, Error> {
    let header = header::read(path)?;
    let axes = Axes::of(path, &header, 1)?;
    let voxels = data_file(path, &header, &axes, 1, frame)?.read(exec)?;
    Ok(Volume::new(axes.grid, voxels)?.with_patient_space(names_anatomy(&header)))
}

/// Reads the vectors of a displacement field: three numbers a voxel, on the fastest axis, along LPS.
pub(crate) fn read_field(path: &Path, exec: &Exec) -> Result<Components, Error> {
    let header = header::read(path)?;
    let axes = Axes::of(path, &header, 3)?;
    let space = header.fields.get("space").unwrap_or("left-posterior-superior").to_lowercase();
    if !["left-posterior-superior", "lps"].contains(&space.as_str()) {
        let remedy = "give it in left-posterior-superior, as ITK and 3D Slicer write it";
        return Err(Error::unsupported(path, format!("a displacement field in space `{space}`"), remedy));
    }
    if let Some(frame) = header.fields.get("measurement frame")
        && header::vectors(path, "measurement frame", frame)?
            != orientation::IDENTITY.map(|row| Some(row.to_vec()))
    {
        let remedy = "give vectors along the space's own axes, as ITK and 3D Slicer write them";
        return Err(Error::unsupported(path, format!("`measurement frame: {frame}`"), remedy));
    }
    let voxels = data_file(path, &header, &axes, 3, None)?.read(exec)?;
    let says = header.fields.get("displacement").unwrap_or_default().to_owned();
    Ok(Components { grid: axes.grid, voxels, together: true, space: Space::Lps, says })
}

/// Where the voxels are, of some numbers each.
fn data_file(
    path: &Path,
    header: &Header,
    axes: &Axes,
    components: usize,
    frame: Option<usize>,
) -> Result<DataFile, Error> {
    let count = bounded::voxel_count(path, "sizes", axes.dims)?;
    let count = count.checked_mul(components);
    let file_type = file_type(path, header)?;
    let encoding = encoding(path, header)?;
    let (data_path, offset) =
        data::place(path, "data file", data_name(path, header)?.as_deref(), header.length)?;
    Ok(DataFile {
        path: data_path,
        offset,
        start: start(path, header, encoding)?,
        encoding,
        order: order(path, header, file_type, encoding)?,
        file_type,
        count: count.ok_or_else(|| Error::field(path, "sizes", "more numbers than can be counted"))?,
        frames: Frames { field: "sizes", count: axes.frames, chosen: frame },
    })
}

/// Whether the header names a space of anatomy.
fn names_anatomy(header: &Header) -> bool {
    // The other spaces that are read (scanner-xyz, 3d-right-handed) say nothing of the patient.
    let anatomy = ["superior", "ras", "las", "lps"];
    let space = header.fields.get("space").unwrap_or_default().to_lowercase();
    anatomy.iter().any(|word| space.contains(word))
}

/// The files of a volume.
pub(crate) fn sources(path: &Path) -> Result<Vec<PathBuf>, Error> {
    data::files(path, "data file", data_name(path, &header::read(path)?)?.as_deref())
}

/// Name of the data's own file, where the header has one.
fn data_name(path: &Path, header: &Header) -> Result<Option<String>, Error> {
    let Some(name) = header.fields.get("data file") else { return Ok(None) };
    if name.starts_with("LIST") || name.contains('%') {
        return Err(Error::unsupported(
            path,
            format!("`data file: {name}`, several data files,"),
            "join them into one file",
        ));
    }
    Ok(Some(name.to_owned()))
}

fn start(path: &Path, header: &Header, encoding: Encoding) -> Result<Start, Error> {
    let lines = match header.fields.get("line skip") {
        Some(text) => text
            .parse()
            .map_err(|_| Error::field(path, "line skip", format!("`{text}` is no number of lines")))?,
        None => 0,
    };
    let skip = match header.fields.get("byte skip") {
        Some(text) => text
            .parse::<i64>()
            .map_err(|_| Error::field(path, "byte skip", format!("`{text}` is no number of bytes")))?,
        None => 0,
    };
    match (skip, encoding) {
        (-1, Encoding::Raw) => Ok(Start::AtEnd),
        (0, _) | (1.., Encoding::Raw | Encoding::Deflated) => Ok(Start::After { lines, bytes: skip as u64 }),
        _ => Err(Error::field(path, "byte skip", format!("{skip} has no meaning in this encoding"))),
    }
}

fn encoding(path: &Path, header: &Header) -> Result<Encoding, Error> {
    let name = header.fields.need(path, "encoding")?;
    match name.to_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gzip" | "gz" => Ok(Encoding::Deflated),
        "txt" | "text" | "ascii" => Ok(Encoding::Text),
        "bzip2" | "bz2" | "hex" | "zrl" => Err(Error::unsupported(
            path,
            format!("`encoding: {name}`"),
            "write the file with encoding raw or gzip",
        )),
        _ => Err(Error::field(path, "encoding", format!("`{name}` is no encoding of NRRD"))),
    }
}

fn order(path: &Path, header: &Header, file_type: FileType, encoding: Encoding) -> Result<ByteOrder, Error> {
    match header.fields.get("endian").map(str::to_lowercase).as_deref() {
        Some("little") => Ok(ByteOrder::Little),
        Some("big") => Ok(ByteOrder::Big),
        Some(other) => Err(Error::field(path, "endian", format!("`{other}` is neither `little` nor `big`"))),
        None if file_type.bytes() == 1 || encoding == Encoding::Text => Ok(ByteOrder::NATIVE),
        None => Err(Error::field(path, "endian", "missing, and a voxel has several bytes")),
    }
}

fn file_type(path: &Path, header: &Header) -> Result<FileType, Error> {
    let name = header.fields.need(path, "type")?;
    let words = name.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
    Ok(match words.as_str() {
        "signed char" | "int8" | "int8_t" => FileType::Plain(VoxelType::I8),
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => FileType::Plain(VoxelType::U8),
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            FileType::Plain(VoxelType::I16)
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => {
            FileType::Plain(VoxelType::U16)
        }
        "int" | "signed int" | "int32" | "int32_t" => FileType::Plain(VoxelType::I32),
        "uint" | "unsigned int" | "uint32" | "uint32_t" => FileType::Plain(VoxelType::U32),
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => FileType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            FileType::U64
        }
        "float" => FileType::Plain(VoxelType::F32),
        "double" => FileType::Plain(VoxelType::F64),
        "block" => return Err(Error::unsupported(path, "`type: block`", "write numbers")),
        _ => return Err(Error::field(path, "type", format!("`{name}` is no type of NRRD"))),
    })
}
