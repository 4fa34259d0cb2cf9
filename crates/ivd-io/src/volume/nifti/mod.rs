//! NIfTI-1 and NIfTI-2: `.nii`, `.nii.gz`, and `.hdr` with `.img`.
//!
//! The affine is the sform where its code is above 0, else the qform where its code is, as nibabel takes them (ITK
//! differs only in files whose two forms contradict each other). With neither, the file has no space: as ITK takes it,
//! `pixdim` along LPS from 0. `xyzt_units` of metres and microns become millimetres.
//!
//! The header codec is written here: the `nifti` crate (0.18) reads NIfTI-1 alone and takes memory for whatever the
//! header declares.

mod ending;
mod header;
mod orient;
mod write;

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use ivd_core::{Exec, Grid, Volume, Voxels};

use crate::volume::bounded::{self, Packing};
use crate::volume::components::Components;
use crate::volume::stored::{self, Layout};
use crate::volume::{Error, frames};
use ending::strip_ending;
use header::Header;
pub(crate) use write::{field, write};

/// Whether bytes, unpacked, open a NIfTI header.
pub(crate) fn is_nifti(bytes: &[u8]) -> bool {
    match header::version(bytes) {
        Some((1, _)) => bytes.get(344..348).is_some_and(|m| m == b"n+1\0" || m == b"ni1\0"),
        Some(_) => bytes.get(4..7).is_some_and(|m| m == b"n+2" || m == b"ni2"),
        None => false,
    }
}

/// First bytes of a file, unpacked if they are a gzip stream; enough to tell NIfTI.
pub(crate) fn unpacked_head(path: &Path) -> Result<Vec<u8>, Error> {
    let mut bytes = bounded::head(path, 4 << 10)?;
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut start = vec![0; header::SIZE_2];
        let got = bounded::read_up_to(&mut MultiGzDecoder::new(&bytes[..]), path, &mut start).unwrap_or(0);
        start.truncate(got);
        bytes = start;
    }
    Ok(bytes)
}

/// Reads a volume; `frame` chooses one of a 4-D file.
pub(crate) fn read(path: &Path, frame: Option<usize>, exec: &Exec) -> Result<Volume, Error> {
    let open = Open::of(path)?;
    let (dims, frames) = open.header.sizes(&open.header_path)?;
    let reference = open.header.reference();
    let (grid, voxels, [slope, intercept]) = open.read(path, dims, frames, frame, 1, exec)?;
    Ok(Volume::with_scale(grid, voxels, slope, intercept)?.with_reference(reference))
}

/// Reads the components of a displacement field, one after the other.
pub(crate) fn read_field(path: &Path, exec: &Exec) -> Result<Components, Error> {
    let open = Open::of(path)?;
    let Some(space) = open.header.space_of_field() else {
        let problem = "not a field of vectors (five dimensions, the last of 3, intent 1006 or 1007)";
        return Err(Error::field(path, "dim, intent_code", problem));
    };
    let says = open.header.intent_name.clone();
    let dims = std::array::from_fn(|a| open.header.dim[a + 1].clamp(0, i64::MAX) as usize);
    let (grid, voxels, scale) = open.read(path, dims, 1, None, 3, exec)?;
    if scale != [1.0, 0.0] {
        let problem = format!("a slope of {} and an intercept of {}", scale[0], scale[1]);
        return Err(Error::field(path, "scl_slope, scl_inter", problem));
    }
    Ok(Components { grid, voxels, together: false, space, says })
}

/// A file whose header is read.
struct Open {
    header_path: PathBuf,
    data_path: PathBuf,
    header: Header,
    stream: Stream,
    /// Bytes that are read of it.
    got: usize,
}

impl Open {
    fn of(path: &Path) -> Result<Self, Error> {
        let [header_path, data_path] = parts(path);
        let mut stream = Stream::open(&header_path)?;
        let mut bytes = vec![0; header::SIZE_2];
        // A NIfTI-2 header is the longer one; what follows a NIfTI-1 header must not be lost.
        let first = bounded::read_up_to(&mut stream.reader, &header_path, &mut bytes[..header::SIZE_1])?;
        let mut got = first;
        if header::version(&bytes[..first]).is_some_and(|(version, _)| version == 2) {
            got += bounded::read_up_to(&mut stream.reader, &header_path, &mut bytes[first..])?;
        }
        let header = Header::decode(&header_path, &bytes[..got])?;
        Ok(Self { header_path, data_path, header, stream, got })
    }

    /// Reads a frame, of `components` numbers a voxel; gives slope and intercept too.
    fn read(
        self,
        path: &Path,
        dims: [usize; 3],
        frames: usize,
        frame: Option<usize>,
        components: usize,
        exec: &Exec,
    ) -> Result<(Grid, Voxels, [f64; 2]), Error> {
        let Self { header, header_path, data_path, mut stream, got } = self;
        let (header_path, data_path) = (&header_path, &data_path);
        let count = bounded::voxel_count(header_path, "dim", dims)?;
        let count = count.checked_mul(components);
        let count =
            count.ok_or_else(|| Error::field(header_path, "dim", "more numbers than can be counted"))?;
        let file_type = header.file_type(header_path)?;
        let grid = orient::grid(header_path, &header, dims)?;
        let (slope, intercept) = header.scale(header_path)?;
        let offset = header.offset(header_path)?;
        let mut read = got as u64;
        if !header.single {
            stream = Stream::open(data_path)?;
            read = 0;
        } else if header_path != path {
            // A pair was named, but its header says that it holds the voxels itself.
            return Err(Error::field(header_path, "magic", "a single file beside an .img"));
        }
        let data = if header.single { header_path } else { data_path };
        let mut layout = Layout {
            file_type,
            count,
            order: header.order,
            packing: stream.packing,
            available: stream.length.saturating_sub(if stream.packing == Packing::Raw { read } else { 0 }),
            skip: offset - read,
        };
        layout.fits(data, frames)?;
        let frame = frames::choose(header_path, "dim[4]", frames, frame)?;
        layout.skip = frames::skip(data, layout.skip, frame, count, file_type)?;
        let voxels = stored::read(&mut stream.reader, data, layout, exec)?;
        Ok((grid, voxels, [slope, intercept]))
    }
}

/// The files of a volume: the one, or the header and its data.
pub(crate) fn sources(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let [header, data] = parts(path);
    let single = Header::decode(&header, &unpacked_head(&header)?)?.single;
    Ok(if single { vec![header] } else { vec![header, data] })
}

/// Names of the header and, should it be apart, of the voxels.
fn parts(path: &Path) -> [PathBuf; 2] {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    for (from, to) in [(".hdr", ".img"), (".hdr.gz", ".img.gz"), (".img", ".hdr"), (".img.gz", ".hdr.gz")] {
        if let Some(stem) = strip_ending(&name, from) {
            let other = path.with_file_name(format!("{stem}{to}"));
            return if from.starts_with(".hdr") {
                [path.to_owned(), other]
            } else {
                [other, path.to_owned()]
            };
        }
    }
    [path.to_owned(), path.to_owned()]
}

/// A file's bytes, unpacked where they are a gzip stream.
struct Stream {
    reader: Box<dyn Read>,
    length: u64,
    packing: Packing,
}

impl Stream {
    fn open(path: &Path) -> Result<Self, Error> {
        let (mut file, length) = bounded::open(path)?;
        let mut magic = [0; 2];
        let got = bounded::read_up_to(&mut file, path, &mut magic)?;
        bounded::seek(&mut file, path, 0)?;
        let deflated = got == 2 && magic == [0x1f, 0x8b];
        Ok(if deflated {
            let buffered = BufReader::<File>::with_capacity(1 << 18, file);
            let reader = Box::new(MultiGzDecoder::new(buffered));
            Self { reader, length, packing: Packing::Deflated }
        } else {
            Self { reader: Box::new(file), length, packing: Packing::Raw }
        })
    }
}
