use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::syntax::Syntax;
use crate::volume::{ByteOrder, Error, bounded};

/// Group and element number of an attribute.
pub(super) type Tag = (u16, u16);

/// Longest value kept; those that are wanted are short.
const LONGEST: u32 = 1 << 14;
/// Sequences inside sequences; more is an attack.
const DEEPEST: usize = 64;
const UNDEFINED: u32 = u32::MAX;
const ITEM: Tag = (0xfffe, 0xe000);
const ITEM_END: Tag = (0xfffe, 0xe00d);
const SEQUENCE_END: Tag = (0xfffe, 0xe0dd);
pub(super) const PIXEL_DATA: Tag = (0x7fe0, 0x0010);

/// Where a file's pixels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PixelData {
    /// First byte of the value.
    pub(super) offset: u64,
    /// Its length; `None` for fragments.
    pub(super) length: Option<u32>,
    /// Whether its bytes come in 16-bit words.
    pub(super) words: bool,
}

/// The wanted elements of a file.
#[derive(Debug)]
pub(super) struct Elements {
    pub(super) syntax: Syntax,
    pub(super) values: BTreeMap<Tag, Vec<u8>>,
    pub(super) pixel_data: Option<PixelData>,
    /// Length of the file.
    pub(super) length: u64,
}

/// Takes the wanted elements of the outermost level, in one pass that stops at the pixels.
///
/// A sequence that is wanted has an empty value.
pub(super) fn read(path: &Path, wanted: &[Tag]) -> Result<Elements, Error> {
    let (file, length) = bounded::open(path)?;
    let mut walk = Walk {
        path,
        reader: BufReader::with_capacity(1 << 13, file),
        at: 0,
        length,
        explicit: true,
        order: ByteOrder::Little,
    };
    walk.skip(132)?;
    let syntax = walk.file_meta()?;
    walk.explicit = syntax.is_explicit();
    walk.order = syntax.order();
    let mut values = BTreeMap::new();
    while walk.at < length {
        let header = walk.header()?;
        if header.tag == PIXEL_DATA {
            let length = (header.length != UNDEFINED).then_some(header.length);
            let words = header.vr == *b"OW" || !walk.explicit;
            let pixel_data = Some(PixelData { offset: walk.at, length, words });
            return Ok(Elements { syntax, values, pixel_data, length: walk.length });
        }
        if header.tag > PIXEL_DATA {
            break;
        }
        if !wanted.contains(&header.tag) {
            walk.skip_value(&header, 0)?;
        } else if header.length == UNDEFINED || header.vr == *b"SQ" {
            values.insert(header.tag, Vec::new());
            walk.skip_value(&header, 0)?;
        } else {
            values.insert(header.tag, walk.value(&header)?);
        }
    }
    Ok(Elements { syntax, values, pixel_data: None, length })
}

struct Header {
    tag: Tag,
    vr: [u8; 2],
    length: u32,
}

struct Walk<'p> {
    path: &'p Path,
    reader: BufReader<File>,
    at: u64,
    length: u64,
    explicit: bool,
    order: ByteOrder,
}

impl Walk<'_> {
    /// The transfer syntax from group 2, which is Explicit VR Little Endian in every file.
    fn file_meta(&mut self) -> Result<Syntax, Error> {
        let mut uid = None;
        loop {
            let start = self.at;
            if start >= self.length {
                break;
            }
            let mut group = [0; 2];
            self.take(&mut group)?;
            self.reader.seek_relative(-2).map_err(|e| Error::io(self.path, "seek in", e))?;
            self.at = start;
            if u16::from_le_bytes(group) != 2 {
                break;
            }
            let header = self.header()?;
            if header.tag == (0x0002, 0x0010) {
                uid = Some(self.value(&header)?);
            } else {
                self.skip_value(&header, 0)?;
            }
        }
        let uid = uid.ok_or_else(|| Error::field(self.path, "TransferSyntaxUID", "missing"))?;
        Syntax::of(self.path, &text(&uid))
    }

    fn take(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        let left = self.length.saturating_sub(self.at);
        if (bytes.len() as u64) > left {
            return Err(Error::truncated(
                self.path,
                "data elements",
                self.at + bytes.len() as u64,
                self.length,
            ));
        }
        self.reader.read_exact(bytes).map_err(|e| Error::io(self.path, "read", e))?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), Error> {
        if count > self.length.saturating_sub(self.at) {
            return Err(Error::truncated(
                self.path,
                "data elements",
                self.at.saturating_add(count),
                self.length,
            ));
        }
        let step = i64::try_from(count).expect("a file is shorter than 2^63 bytes");
        self.reader.seek_relative(step).map_err(|e| Error::io(self.path, "seek in", e))?;
        self.at += count;
        Ok(())
    }

    fn u16(&mut self) -> Result<u16, Error> {
        let mut bytes = [0; 2];
        self.take(&mut bytes)?;
        Ok(number16(bytes, self.order))
    }

    fn u32(&mut self) -> Result<u32, Error> {
        let mut bytes = [0; 4];
        self.take(&mut bytes)?;
        Ok(match self.order {
            ByteOrder::Little => u32::from_le_bytes(bytes),
            ByteOrder::Big => u32::from_be_bytes(bytes),
        })
    }

    fn header(&mut self) -> Result<Header, Error> {
        let tag = (self.u16()?, self.u16()?);
        if tag.0 == 0xfffe || !self.explicit {
            return Ok(Header { tag, vr: [0; 2], length: self.u32()? });
        }
        let mut vr = [0; 2];
        self.take(&mut vr)?;
        let length = match &vr {
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN" | b"UR" | b"UT"
            | b"UV" => {
                self.skip(2)?;
                self.u32()?
            }
            [b'A'..=b'Z', b'A'..=b'Z'] => u32::from(self.u16()?),
            _ => {
                let field = format!("({:04x},{:04x})", tag.0, tag.1);
                return Err(Error::field(self.path, field, "no value representation"));
            }
        };
        Ok(Header { tag, vr, length })
    }

    fn value(&mut self, header: &Header) -> Result<Vec<u8>, Error> {
        if header.length > LONGEST {
            let field = format!("({:04x},{:04x})", header.tag.0, header.tag.1);
            return Err(Error::field(
                self.path,
                field,
                format!("{} bytes are no sensible length", header.length),
            ));
        }
        let mut bytes = vec![0; header.length as usize];
        self.take(&mut bytes)?;
        Ok(bytes)
    }

    fn skip_value(&mut self, header: &Header, depth: usize) -> Result<(), Error> {
        if header.length != UNDEFINED {
            return self.skip(u64::from(header.length));
        }
        // An unknown element of undefined length is a sequence in Implicit VR Little Endian (PS3.5, 6.2.2).
        let outside = (self.explicit, self.order);
        if header.vr == *b"UN" {
            (self.explicit, self.order) = (false, ByteOrder::Little);
        }
        self.skip_sequence(depth)?;
        (self.explicit, self.order) = outside;
        Ok(())
    }

    /// Passes over a sequence of undefined length, to behind its end.
    fn skip_sequence(&mut self, depth: usize) -> Result<(), Error> {
        if depth > DEEPEST {
            return Err(Error::field(
                self.path,
                "sequences",
                format!("more than {DEEPEST} inside each other"),
            ));
        }
        loop {
            let item = self.header()?;
            match item.tag {
                SEQUENCE_END => return Ok(()),
                ITEM if item.length != UNDEFINED => self.skip(u64::from(item.length))?,
                ITEM => loop {
                    let element = self.header()?;
                    if element.tag == ITEM_END {
                        break;
                    }
                    self.skip_value(&element, depth + 1)?;
                },
                tag => {
                    let field = format!("({:04x},{:04x})", tag.0, tag.1);
                    return Err(Error::field(self.path, field, "stands where an item of a sequence should"));
                }
            }
        }
    }
}

/// The fragments of encapsulated pixels as one, without the offset table before them.
pub(super) fn fragments(path: &Path, offset: u64) -> Result<Vec<u8>, Error> {
    let (mut file, length) = bounded::open(path)?;
    file.seek(SeekFrom::Start(offset)).map_err(|e| Error::io(path, "seek in", e))?;
    let mut walk = Walk {
        path,
        reader: BufReader::new(file),
        at: offset,
        length,
        explicit: true,
        order: ByteOrder::Little,
    };
    let mut all = Vec::new();
    let mut table = true;
    loop {
        let item = walk.header()?;
        match item.tag {
            SEQUENCE_END => return Ok(all),
            ITEM if item.length != UNDEFINED => {
                let left = walk.length - walk.at;
                if u64::from(item.length) > left {
                    return Err(Error::truncated(path, "PixelData fragment", u64::from(item.length), left));
                }
                if table {
                    walk.skip(u64::from(item.length))?;
                    table = false;
                } else {
                    let start = all.len();
                    all.resize(start + item.length as usize, 0);
                    walk.take(&mut all[start..])?;
                }
            }
            _ => return Err(Error::field(path, "PixelData", "something else than a fragment")),
        }
    }
}

pub(super) fn number16(bytes: [u8; 2], order: ByteOrder) -> u16 {
    match order {
        ByteOrder::Little => u16::from_le_bytes(bytes),
        ByteOrder::Big => u16::from_be_bytes(bytes),
    }
}

/// A text value without its padding; bytes beyond ASCII become `?`.
pub(super) fn text(value: &[u8]) -> String {
    let text: String = value
        .iter()
        .map(|&b| if b.is_ascii() && !b.is_ascii_control() { char::from(b) } else { '?' })
        .collect();
    text.trim_matches(|c| c == ' ' || c == '?').to_owned()
}
