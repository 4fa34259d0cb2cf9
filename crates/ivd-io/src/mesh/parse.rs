//! What the readers share: memory that is counted before it is taken, words, numbers, and errors with their place.

use std::path::Path;

use crate::FileError;
use crate::mesh::Error;
use crate::number::Number;
use crate::order::ByteOrder;

/// Bytes that any file may take, however small it is.
const FREE: u64 = 64 << 20;
/// Bytes that each byte of a file may take, itself included.
const PER_BYTE: u64 = 4;

/// What is wrong with a file; its name is added at the door.
#[derive(Debug)]
pub(super) enum Failure {
    /// The bytes are at fault.
    Bad { place: String, problem: String, remedy: &'static str },
    /// The caller's limit is.
    Core(ivd_core::Error),
}

impl Failure {
    /// A fault at a line, a byte or a part of the file.
    pub(super) fn at(place: impl Into<String>, problem: impl Into<String>, remedy: &'static str) -> Self {
        Self::Bad { place: place.into(), problem: problem.into(), remedy }
    }

    /// A fault at a byte, counted from 0.
    pub(super) fn byte(at: usize, problem: impl Into<String>, remedy: &'static str) -> Self {
        Self::at(format!("byte {at}"), problem, remedy)
    }

    /// A fault in a line, counted from 1.
    pub(super) fn line(line: u64, problem: impl Into<String>, remedy: &'static str) -> Self {
        Self::at(format!("line {line}"), problem, remedy)
    }

    /// The same for a caller, with the file's name.
    pub(super) fn of(self, path: &Path) -> Error {
        match self {
            Self::Bad { place, problem, remedy } => {
                FileError::Unreadable { path: path.to_owned(), place, problem, remedy }.into()
            }
            Self::Core(error) => error.into(),
        }
    }
}

/// What to do about a file whose writer went wrong.
pub(super) const REWRITE: &str = "write the file again, or copy it again if it was cut short";
/// What to do about numbers that aren't any.
pub(super) const REPAIR: &str = "repair the mesh in the program that made it";

/// Memory, counted before it is taken: what a file says of itself is no reason to take more than a few times its size.
#[derive(Debug)]
pub(super) struct Budget {
    /// The caller's limit.
    limit: u64,
    /// The reader's own.
    bound: u64,
    held: u64,
}

impl Budget {
    /// For a file of `bytes`, which are in memory already.
    pub(super) fn new(bytes: usize, limit: u64) -> Result<Self, Failure> {
        let mut budget = Self { limit, bound: FREE + PER_BYTE * bytes as u64, held: 0 };
        budget.take("the file", bytes as u64)?;
        Ok(budget)
    }

    /// Counts bytes that are about to be taken.
    pub(super) fn take(&mut self, what: &str, bytes: u64) -> Result<(), Failure> {
        let needed = self.held.saturating_add(bytes);
        if needed > self.limit {
            let what = format!("reading {what} of a mesh");
            return Err(Failure::Core(ivd_core::Error::MemoryLimit { what, needed, limit: self.limit }));
        }
        if needed > self.bound {
            let problem = format!("{what} would need {needed} bytes of memory, {} are allowed", self.bound);
            return Err(Failure::at(
                "size",
                problem,
                "a file may need 64 MiB and four times its size; write it uncompressed and without instances",
            ));
        }
        self.held = needed;
        Ok(())
    }

    /// Counts bytes that were given back.
    pub(super) fn give(&mut self, bytes: u64) {
        self.held = self.held.saturating_sub(bytes);
    }

    /// An empty list with room for exactly `count` items.
    pub(super) fn list<T>(&mut self, what: &str, count: u64) -> Result<Vec<T>, Failure> {
        self.take(what, count.saturating_mul(size_of::<T>() as u64))?;
        let mut list = Vec::new();
        self.reserve(what, &mut list, count as usize)?;
        Ok(list)
    }

    /// Appends to a list that may have to grow.
    #[inline]
    pub(super) fn push<T>(&mut self, what: &str, list: &mut Vec<T>, item: T) -> Result<(), Failure> {
        if list.len() == list.capacity() {
            self.grow(what, list, 1)?;
        }
        list.push(item);
        Ok(())
    }

    /// Room for `more` items: where there is none, for half as many again as there are. Old and new are held at once for a
    /// moment.
    #[cold]
    pub(super) fn grow<T>(&mut self, what: &str, list: &mut Vec<T>, more: usize) -> Result<(), Failure> {
        if list.capacity() - list.len() >= more {
            return Ok(());
        }
        let each = size_of::<T>() as u64;
        let (old, least) = (list.capacity() as u64, (list.len() + more) as u64);
        let new = least.max(old + old / 2).max(256);
        self.take(what, new.saturating_mul(each))?;
        self.reserve(what, list, new as usize - list.len())?;
        self.give(old * each);
        Ok(())
    }

    fn reserve<T>(&self, what: &str, list: &mut Vec<T>, more: usize) -> Result<(), Failure> {
        list.try_reserve_exact(more).map_err(|_| {
            Failure::Core(ivd_core::Error::MemoryLimit {
                what: format!("reading {what} of a mesh"),
                needed: self.held,
                limit: self.limit,
            })
        })
    }
}

/// Bytes from the front on.
#[derive(Debug, Clone)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// Where the next byte is.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// Bytes that are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// The next `count` bytes.
    #[inline]
    pub(super) fn take(&mut self, what: &str, count: usize) -> Result<&'a [u8], Failure> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.bytes.len());
        let Some(end) = end else {
            let problem = format!("{what}: {count} bytes needed, {} left", self.left());
            return Err(Failure::byte(self.at, problem, REWRITE));
        };
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    /// The next little-endian 32-bit number.
    pub(super) fn u32(&mut self, what: &str) -> Result<u32, Failure> {
        self.take(what, 4).map(|b| Number::U32.integer(b, ByteOrder::Little) as u32)
    }
}

/// Words between white space, with their lines.
#[derive(Debug, Clone)]
pub(super) struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Line of the word that came last, from 1.
    pub(super) line: u64,
}

impl<'a> Words<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize, line: u64) -> Self {
        Self { bytes, at, line }
    }

    /// Bytes that are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// Whether nothing but white space is left.
    pub(super) fn is_done(&self) -> bool {
        self.bytes.get(self.at..).is_none_or(|rest| rest.iter().all(u8::is_ascii_whitespace))
    }

    /// A real number.
    #[inline]
    pub(super) fn real(&mut self, what: &str) -> Result<f64, Failure> {
        let word = self.expect(what)?;
        parsed(word).ok_or_else(|| no_number(self.line, what, word))
    }

    /// An integer.
    #[inline]
    pub(super) fn integer(&mut self, what: &str) -> Result<i64, Failure> {
        let word = self.expect(what)?;
        parsed(word).ok_or_else(|| no_number(self.line, what, word))
    }

    fn expect(&mut self, what: &str) -> Result<&'a [u8], Failure> {
        self.next().ok_or_else(|| Failure::line(self.line, format!("the text ends before {what}"), REWRITE))
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        while let Some(b) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            self.line += u64::from(*b == b'\n');
            self.at += 1;
        }
        let rest = self.bytes.get(self.at..)?;
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += end;
        (end > 0).then(|| &rest[..end])
    }
}

/// A word as a number.
#[inline]
pub(super) fn parsed<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The error for a word that should have been a number.
pub(super) fn no_number(line: u64, what: &str, word: &[u8]) -> Failure {
    Failure::line(line, format!("{what}: `{}` is no such number", shown(word)), REPAIR)
}

/// A word as it may stand in a message.
pub(super) fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(40)]).escape_debug().to_string()
}

/// Triangles of polygons whose corners come one after the other: a fan about the first.
#[derive(Debug, Default)]
pub(super) struct Fan {
    corners: usize,
    first: u32,
    last: u32,
}

impl Fan {
    /// Takes the next corner.
    #[inline]
    pub(super) fn corner(
        &mut self,
        vertex: u32,
        triangles: &mut Vec<[u32; 3]>,
        budget: &mut Budget,
    ) -> Result<(), Failure> {
        match self.corners {
            0 => self.first = vertex,
            1 => {}
            _ => budget.push("triangles", triangles, [self.first, self.last, vertex])?,
        }
        self.last = vertex;
        self.corners += 1;
        Ok(())
    }

    /// Corners so far.
    pub(super) fn corners(&self) -> usize {
        self.corners
    }
}

/// The index if it names one of `vertices`.
#[inline]
pub(super) fn index(value: i64, vertices: u64) -> Option<u32> {
    u32::try_from(value).ok().filter(|&v| u64::from(v) < vertices)
}

/// Says that an index names no vertex.
pub(super) fn out_of_range(value: impl std::fmt::Display, vertices: u64) -> String {
    format!("index {value} names no vertex of {vertices}")
}
