//! MetaImage: `.mha` with its data inside, `.mhd` with the data in a file of its own.
//!
//! Its space is LPS. Row `a` of `TransformMatrix` is the direction of axis `a`. The intensity slope and offset that
//! some files carry (`ElementToIntensityFunctionSlope`) and `DistanceUnits` change nothing, as in ITK. `CompressedDataSize` is not believed
//! (there are files in which it is wrong): the data ends where its stream ends.

mod header;
mod write;

use std::path::{Path, PathBuf};

use ivd_core::{Exec, Grid, Modality, Volume, VoxelType, Voxels};

use crate::Space;
use crate::volume::components::Components;
use crate::volume::data::{self, DataFile, Encoding, Frames, Start};
use crate::volume::stored::FileType;
use crate::volume::text_header::Header;
use crate::volume::{ByteOrder, Error, bounded, orientation};
pub(crate) use write::{field, write};

/// Whether bytes open a MetaImage header: it has no magic, but starts with one of its first fields.
pub(crate) fn is_metaimage(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(256)]);
    let first = text.trim_start().lines().next().unwrap_or_default();
    first.split_once('=').is_some_and(|(key, _)| {
        ["objecttype", "ndims", "comment"].contains(&key.trim().to_lowercase().as_str())
    })
}

/// Reads a volume; `frame` chooses one of a 4-D file.
pub(crate) fn read(path: &Path, frame: Option<usize>, exec: &Exec) -> Result<Volume, Error> {
    let header = header::read(path)?;
    let (grid, voxels) = components(path, &header, 1, frame, exec)?;
    let modality = match header.fields.get("Modality").map(str::to_uppercase).as_deref() {
        Some("MET_MOD_CT") => Some(Modality::ComputedTomography),
        Some("MET_MOD_MR") => Some(Modality::MagneticResonance),
        _ => None,
    };
    let stated = header.fields.get("AnatomicalOrientation").is_some_and(|way| !way.contains('?'));
    let volume = Volume::new(grid, voxels)?;
    Ok(volume.with_modality(modality).with_patient_space(stated))
}

/// Reads the vectors of a displacement field: three numbers a voxel, along LPS.
pub(crate) fn read_field(path: &Path, exec: &Exec) -> Result<Components, Error> {
    let header = header::read(path)?;
    let (grid, voxels) = components(path, &header, 3, None, exec)?;
    let says = header.fields.get("Comment").unwrap_or_default().to_owned();
    Ok(Components { grid, voxels, together: true, space: Space::Lps, says })
}

/// The grid, and so many numbers of each of its voxels, one voxel after the other.
fn components(
    path: &Path,
    header: &Header,
    channels: usize,
    frame: Option<usize>,
    exec: &Exec,
) -> Result<(Grid, Voxels), Error> {
    let (dims, frames) = sizes(path, header, channels)?;
    let count = bounded::voxel_count(path, "DimSize", dims)?.checked_mul(channels);
    let grid = grid(path, header, dims)?;
    let encoding = encoding(path, header)?;
    let (data_path, offset) =
        data::place(path, "ElementDataFile", data_name(path, header)?.as_deref(), header.length)?;
    let data = DataFile {
        path: data_path,
        offset,
        start: start(path, header)?,
        encoding,
        order: order(path, header)?,
        file_type: file_type(path, header)?,
        count: count.ok_or_else(|| Error::field(path, "DimSize", "more numbers than can be counted"))?,
        frames: Frames { field: "DimSize", count: frames, chosen: frame },
    };
    Ok((grid, data.read(exec)?))
}

/// The files of a volume.
pub(crate) fn sources(path: &Path) -> Result<Vec<PathBuf>, Error> {
    data::files(path, "ElementDataFile", data_name(path, &header::read(path)?)?.as_deref())
}

/// Name of the data's own file; `None` for data in the header's file.
fn data_name(path: &Path, header: &Header) -> Result<Option<String>, Error> {
    let name = header.fields.need(path, "ElementDataFile")?;
    if name.eq_ignore_ascii_case("LOCAL") {
        return Ok(None);
    }
    if name.starts_with("LIST") || name.contains('%') {
        return Err(Error::unsupported(
            path,
            format!("`ElementDataFile = {name}`, several data files,"),
            "join them into one file",
        ));
    }
    Ok(Some(name.to_owned()))
}

fn sizes(path: &Path, header: &Header, channels: usize) -> Result<([usize; 3], usize), Error> {
    let rank = rank(path, header)?;
    let sizes: Vec<i64> = header
        .fields
        .numbers(path, "DimSize", rank)?
        .ok_or_else(|| Error::field(path, "DimSize", "missing"))?;
    let sizes = sizes.iter().map(|&n| bounded::size(path, "DimSize", n)).collect::<Result<Vec<_>, _>>()?;
    let text = header.fields.get("ElementNumberOfChannels").unwrap_or("1");
    let has: usize = text.parse().map_err(|_| {
        Error::field(path, "ElementNumberOfChannels", format!("`{text}` is no number of values a voxel"))
    })?;
    match (channels, has) {
        (wanted, has) if wanted == has => {}
        (1, _) => {
            let what = format!("`ElementNumberOfChannels = {text}`");
            return Err(Error::unsupported(path, what, bounded::vectors_remedy(has)));
        }
        _ => {
            let problem = format!("not a field of vectors ({text} a voxel, where it has {channels})");
            return Err(Error::field(path, "ElementNumberOfChannels", problem));
        }
    }
    if channels > 1 && (rank < 3 || sizes.get(3).is_some_and(|&frames| frames != 1)) {
        return Err(Error::field(path, "NDims", "not a field of vectors, which has three"));
    }
    let at = |a: usize| sizes.get(a).copied().unwrap_or(1);
    Ok(([at(0), at(1), at(2)], at(3)))
}

fn rank(path: &Path, header: &Header) -> Result<usize, Error> {
    let text = header.fields.need(path, "NDims")?;
    text.parse()
        .ok()
        .filter(|n| (1..=4).contains(n))
        .ok_or_else(|| Error::field(path, "NDims", format!("`{text}` is not a rank of 1 to 4")))
}

fn grid(path: &Path, header: &Header, dims: [usize; 3]) -> Result<Grid, Error> {
    let rank = rank(path, header)?;
    let (mut spacing, mut origin, mut direction) = ([1.0; 3], [0.0; 3], orientation::IDENTITY);
    if let Some(given) = header::any::<f64>(header, path, &["ElementSpacing", "ElementSize"], rank)? {
        (0..rank.min(3)).for_each(|a| spacing[a] = given[a]);
    }
    if let Some(given) = header::any::<f64>(header, path, &["Offset", "Position", "Origin"], rank)? {
        (0..rank.min(3)).for_each(|a| origin[a] = given[a]);
    }
    if let Some(given) =
        header::any::<f64>(header, path, &["TransformMatrix", "Rotation", "Orientation"], rank * rank)?
    {
        for axis in 0..rank.min(3) {
            (0..rank.min(3)).for_each(|w| direction[axis][w] = given[axis * rank + w]);
        }
    }
    orientation::grid_from_lps_parts(path, dims, spacing, origin, direction).map_err(|error| match error {
        Error::Field { problem, .. } => {
            Error::field(path, "ElementSpacing, Offset, TransformMatrix", problem)
        }
        other => other,
    })
}

fn encoding(path: &Path, header: &Header) -> Result<Encoding, Error> {
    let text = !header::flag(header, path, "BinaryData")?.unwrap_or(true);
    match (text, header::flag(header, path, "CompressedData")?.unwrap_or(false)) {
        (false, false) => Ok(Encoding::Raw),
        (false, true) => Ok(Encoding::Deflated),
        (true, false) => Ok(Encoding::Text),
        (true, true) => Err(Error::unsupported(path, "compressed text", "write binary data")),
    }
}

fn start(path: &Path, header: &Header) -> Result<Start, Error> {
    let text = header.fields.get("HeaderSize").unwrap_or("0");
    match text.parse::<i64>() {
        Ok(-1) => Ok(Start::AtEnd),
        Ok(bytes @ 0..) => Ok(Start::After { lines: 0, bytes: bytes as u64 }),
        _ => Err(Error::field(path, "HeaderSize", format!("`{text}` is neither -1 nor a number of bytes"))),
    }
}

fn order(path: &Path, header: &Header) -> Result<ByteOrder, Error> {
    let most_first = match header::flag(header, path, "BinaryDataByteOrderMSB")? {
        Some(flag) => Some(flag),
        None => header::flag(header, path, "ElementByteOrderMSB")?,
    };
    Ok(if most_first.unwrap_or(false) { ByteOrder::Big } else { ByteOrder::Little })
}

fn file_type(path: &Path, header: &Header) -> Result<FileType, Error> {
    let name = header.fields.need(path, "ElementType")?;
    Ok(match name {
        "MET_UCHAR" => FileType::Plain(VoxelType::U8),
        "MET_CHAR" => FileType::Plain(VoxelType::I8),
        "MET_USHORT" => FileType::Plain(VoxelType::U16),
        "MET_SHORT" => FileType::Plain(VoxelType::I16),
        // MetaIO's `long` has 4 bytes on every machine.
        "MET_UINT" | "MET_ULONG" => FileType::Plain(VoxelType::U32),
        "MET_INT" | "MET_LONG" => FileType::Plain(VoxelType::I32),
        "MET_FLOAT" => FileType::Plain(VoxelType::F32),
        "MET_DOUBLE" => FileType::Plain(VoxelType::F64),
        "MET_LONG_LONG" => FileType::I64,
        "MET_ULONG_LONG" => FileType::U64,
        _ if name.ends_with("_ARRAY") => {
            return Err(Error::unsupported(
                path,
                format!("`ElementType = {name}`"),
                "write one scalar a voxel",
            ));
        }
        _ => return Err(Error::field(path, "ElementType", format!("`{name}` is no type of MetaImage"))),
    })
}
