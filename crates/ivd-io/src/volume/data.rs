//! Voxels of the formats with a text header: raw, deflated or written out as text, in the header's file or beside it.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use ivd_core::{Exec, Scalar, VoxelType, Voxels};

use crate::volume::bounded::{self, Packing};
use crate::volume::stored::{self, FileType, Layout};
use crate::volume::{ByteOrder, Error};

/// How the voxels are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    /// A gzip or zlib stream; its first bytes tell which.
    Deflated,
    /// Numbers in ASCII, separated by white space or commas.
    Text,
}

/// Where the first voxel stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// So many lines after the data's start, then so many bytes. Lines are counted before unpacking, bytes after it.
    After { lines: u64, bytes: u64 },
    /// The voxels are the file's last bytes.
    AtEnd,
}

/// Where and how a header says that the voxels are written.
#[derive(Debug, Clone)]
pub(crate) struct DataFile {
    pub(crate) path: PathBuf,
    /// Where the data's part of the file starts.
    pub(crate) offset: u64,
    pub(crate) start: Start,
    pub(crate) encoding: Encoding,
    pub(crate) order: ByteOrder,
    pub(crate) file_type: FileType,
    /// Voxels of one frame.
    pub(crate) count: usize,
    pub(crate) frames: Frames,
}

/// How many frames follow each other, by which field of the header, and which is wanted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frames {
    pub(crate) field: &'static str,
    pub(crate) count: usize,
    pub(crate) chosen: Option<usize>,
}

/// A data file that a field of a header names: relative to the header's folder.
///
/// # Errors
/// There is none: the header is what is wrong, or has come without it.
fn beside(header: &Path, field: &str, name: &str) -> Result<PathBuf, Error> {
    if name.trim().is_empty() {
        return Err(Error::field(header, field, "it names no file"));
    }
    let path = header.parent().unwrap_or(Path::new("")).join(name);
    match std::fs::metadata(&path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            let problem = format!("`{}`: there is no such file beside this one", name.escape_debug());
            Err(Error::field(header, field, problem))
        }
        _ => Ok(path),
    }
}

/// Where the voxels of a written header go: its whole name and `.raw`, so that headers of other formats with the same stem, and raw voxels, have others.
pub(crate) fn data_beside(header: &Path) -> PathBuf {
    let mut name = header.as_os_str().to_owned();
    name.push(".raw");
    name.into()
}

/// The file of a header's data, by the name that a field of the header gives, and where they begin in it: behind the header of `length` bytes where
/// it names none.
pub(crate) fn place(
    header: &Path,
    field: &str,
    name: Option<&str>,
    length: u64,
) -> Result<(PathBuf, u64), Error> {
    name.map_or_else(|| Ok((header.to_owned(), length)), |name| Ok((beside(header, field, name)?, 0)))
}

/// The files of a volume: its header's, and that of its data where a field of the header names one.
pub(crate) fn files(header: &Path, field: &str, name: Option<&str>) -> Result<Vec<PathBuf>, Error> {
    let data = name.map(|name| beside(header, field, name)).transpose()?;
    Ok(std::iter::once(header.to_owned()).chain(data).collect())
}

impl DataFile {
    /// Reads the frame; sizes are checked before memory is taken.
    pub(crate) fn read(&self, exec: &Exec) -> Result<Voxels, Error> {
        let path = &self.path;
        let (mut file, length) = bounded::open(path)?;
        let frames = self.frames.count;
        let packing = if self.encoding == Encoding::Deflated { Packing::Deflated } else { Packing::Raw };
        if self.encoding != Encoding::Text {
            self.layout(length.saturating_sub(self.offset), packing, 0).fits(path, frames)?;
        }
        let frame = crate::volume::frames::choose(path, self.frames.field, frames, self.frames.chosen)?;
        let before = crate::volume::frames::skip(path, 0, frame, self.count, self.file_type)?;
        let (lines, bytes) = match self.start {
            Start::After { lines, bytes } => (lines, bytes),
            Start::AtEnd => {
                let all = crate::volume::frames::skip(path, 0, frames, self.count, self.file_type)?;
                let at =
                    length.checked_sub(all).ok_or_else(|| Error::truncated(path, "voxels", all, length))?;
                bounded::seek(&mut file, path, at + before)?;
                return stored::read(&mut file, path, self.layout(all - before, Packing::Raw, 0), exec);
            }
        };
        bounded::seek(&mut file, path, self.offset)?;
        let available = length.saturating_sub(self.offset);
        let skip = before
            .checked_add(bytes)
            .ok_or_else(|| Error::field(path, "byte skip", format!("{bytes} lies beyond any file")))?;
        if self.encoding == Encoding::Raw && lines == 0 {
            // The file's own offset passes over what is skipped.
            let layout = self.layout(available, Packing::Raw, skip);
            layout.check(path, exec)?;
            bounded::seek(&mut file, path, self.offset + skip)?;
            return stored::read(&mut file, path, self.layout(available - skip, Packing::Raw, 0), exec);
        }
        let mut reader = BufReader::with_capacity(1 << 18, file.take(available));
        skip_lines(&mut reader, path, lines)?;
        match self.encoding {
            Encoding::Raw => {
                stored::read(&mut reader, path, self.layout(available, Packing::Raw, skip), exec)
            }
            Encoding::Deflated => {
                let layout = self.layout(available, Packing::Deflated, skip);
                let mut unpacked = unpack(reader, path)?;
                stored::read(&mut unpacked, path, layout, exec)
            }
            Encoding::Text => self.read_text(reader, available, frame, exec),
        }
    }

    fn layout(&self, available: u64, packing: Packing, skip: u64) -> Layout {
        Layout { file_type: self.file_type, count: self.count, order: self.order, packing, available, skip }
    }

    fn read_text(
        &self,
        reader: impl BufRead,
        available: u64,
        frame: usize,
        exec: &Exec,
    ) -> Result<Voxels, Error> {
        let FileType::Plain(voxel_type) = self.file_type else {
            return Err(Error::unsupported(&self.path, "64-bit integers as text", "write them in 32 bits"));
        };
        // A number takes a digit and a separator at least.
        let all = (self.count as u64).saturating_mul(frame as u64 + 1);
        let least = all.saturating_mul(2).saturating_sub(1);
        if least > available {
            return Err(Error::truncated(&self.path, "voxels as text", least, available));
        }
        exec.check_memory("the volume", self.count as u64 * voxel_type.bytes() as u64)?;
        let text = Text { reader, path: &self.path, count: self.count, skip: all - self.count as u64 };
        match voxel_type {
            VoxelType::U8 => text.numbers::<u8>(exec),
            VoxelType::I8 => text.numbers::<i8>(exec),
            VoxelType::U16 => text.numbers::<u16>(exec),
            VoxelType::I16 => text.numbers::<i16>(exec),
            VoxelType::U32 => text.numbers::<u32>(exec),
            VoxelType::I32 => text.numbers::<i32>(exec),
            VoxelType::F32 => text.numbers::<f32>(exec),
            VoxelType::F64 => text.numbers::<f64>(exec),
        }
    }
}

/// Numbers written out.
struct Text<'a, R> {
    reader: R,
    path: &'a Path,
    count: usize,
    /// Numbers before the first wanted.
    skip: u64,
}

impl<R: BufRead> Text<'_, R> {
    fn numbers<T: Scalar + std::str::FromStr>(mut self, exec: &Exec) -> Result<Voxels, Error> {
        let mut values: Vec<T> = bounded::zeroed(self.count)?;
        for _ in 0..self.skip {
            self.word(0)?;
        }
        for done in 0..self.count {
            if done % (1 << 16) == 0 {
                exec.check_cancelled()?;
            }
            let word = self.word(done)?;
            values[done] = word.parse().map_err(|_| {
                Error::corrupt(
                    self.path,
                    format!("voxel {done}"),
                    format!("`{word}` is no {}", T::TYPE.name()),
                )
            })?;
        }
        Ok(T::wrap(values.into()))
    }

    fn word(&mut self, done: usize) -> Result<String, Error> {
        let mut word = Vec::new();
        loop {
            let part = self.reader.fill_buf().map_err(|e| Error::io(self.path, "read", e))?;
            if part.is_empty() {
                break;
            }
            let separator = |b: &u8| b.is_ascii_whitespace() || *b == b',';
            let start = if word.is_empty() { part.iter().take_while(|b| separator(b)).count() } else { 0 };
            let end = start + part[start..].iter().take_while(|b| !separator(b)).count();
            word.extend_from_slice(&part[start..end]);
            let ended = end < part.len();
            self.reader.consume(end);
            if (ended && !word.is_empty()) || word.len() > 64 {
                break;
            }
        }
        if word.is_empty() {
            return Err(Error::truncated(self.path, "numbers", self.count as u64, done as u64));
        }
        word.truncate(64);
        Ok(String::from_utf8_lossy(&word).into_owned())
    }
}

type Limited = BufReader<std::io::Take<File>>;

/// The unpacked stream of a gzip or a zlib file, by its first bytes.
fn unpack(mut reader: Limited, path: &Path) -> Result<Box<dyn Read>, Error> {
    let start = reader.fill_buf().map_err(|e| Error::io(path, "read", e))?;
    Ok(if start.starts_with(&[0x1f, 0x8b]) {
        Box::new(MultiGzDecoder::new(reader))
    } else {
        Box::new(ZlibDecoder::new(reader))
    })
}

fn skip_lines(reader: &mut impl BufRead, path: &Path, lines: u64) -> Result<(), Error> {
    for done in 0..lines {
        let got = reader.skip_until(b'\n').map_err(|e| Error::io(path, "read", e))?;
        if got == 0 {
            return Err(Error::truncated(path, "lines to skip", lines, done));
        }
    }
    Ok(())
}
