use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use crate::volume::Error;

/// Refuses a TIFF whose first directory declares values that the file can't hold.
///
/// The decoder reads that directory before it can be given limits, and takes 32 bytes for every value that an entry
/// declares. What is no TIFF, or cut within the directory, is left for the decoder to tell.
pub(super) fn check_first(path: &Path, file: &mut BufReader<File>, length: u64) -> Result<(), Error> {
    let checked = entries(path, file, length);
    file.rewind().map_err(|e| Error::io(path, "seek in", e))?;
    match checked {
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::UnexpectedEof => Ok(()),
        other => other,
    }
}

fn entries(path: &Path, file: &mut BufReader<File>, length: u64) -> Result<(), Error> {
    let mut reader = Numbers { path, file, big_endian: false };
    reader.big_endian = reader.bytes::<2>()? == *b"MM";
    // BigTIFF: 8 bytes for every offset and count.
    let wide = reader.number(2)? == 43;
    let width = if wide { 8 } else { 4 };
    if wide {
        reader.number(4)?;
    }
    let directory = reader.number(width)?;
    if directory >= length {
        return Ok(());
    }
    reader.file.seek(SeekFrom::Start(directory)).map_err(|e| Error::io(path, "seek in", e))?;
    let count = reader.number(if wide { 8 } else { 2 })?;
    for _ in 0..count {
        let (tag, kind) = (reader.number(2)?, reader.number(2)?);
        let values = reader.number(width)?;
        reader.number(width)?;
        let needed = values.saturating_mul(bytes_of(kind));
        if needed > length {
            return Err(Error::truncated(path, format!("tag {tag}"), needed, length));
        }
    }
    Ok(())
}

/// Bytes of a value of a field type (TIFF 6.0, section 2, and BigTIFF); at least 1.
fn bytes_of(kind: u64) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => 1,
    }
}

/// Unsigned numbers in the file's order.
struct Numbers<'a> {
    path: &'a Path,
    file: &'a mut BufReader<File>,
    big_endian: bool,
}

impl Numbers<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes).map_err(|e| Error::io(self.path, "read", e))?;
        Ok(bytes)
    }

    /// A number of 2, 4 or 8 bytes.
    fn number(&mut self, width: usize) -> Result<u64, Error> {
        let mut bytes = [0; 8];
        let own = &mut bytes[..width];
        self.file.read_exact(own).map_err(|e| Error::io(self.path, "read", e))?;
        if self.big_endian {
            own.reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}
