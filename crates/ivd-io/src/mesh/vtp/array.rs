//! The numbers of an array, whichever way they are encoded, without holding them all.

use std::io::{self, Read};

use flate2::{Decompress, FlushDecompress, Status};

use super::document::Array;
use crate::mesh::parse::{Budget, Failure, REPAIR, REWRITE, Words};
use crate::number::Number;
use crate::vtk::{Base64, Coding, Content};

/// Bytes of numbers converted at a time; a multiple of every number's size.
const CHUNK: usize = 1 << 16;

/// Takes the bytes of a number, with its index.
type Take<'a> = dyn FnMut(u64, &[u8], &mut Budget) -> Result<(), Failure> + 'a;

/// How many numbers an array must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Count {
    Exactly(u64),
    /// Takes what there is, up to this many.
    AtMost(u64),
}

impl Array<'_> {
    fn bad(&self, problem: impl Into<String>) -> Failure {
        Failure::at(format!("DataArray {:?}", self.name), problem, REWRITE)
    }

    /// Hands every number over, with its index, as an integer.
    pub(super) fn integers(
        &self,
        coding: Coding,
        count: Count,
        budget: &mut Budget,
        mut take: impl FnMut(u64, i64, &mut Budget) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let number =
            self.number.filter(|n| n.is_integer()).ok_or_else(|| self.bad("its type isn't an integer's"))?;
        if let Content::Ascii(text) = self.content {
            return self.words(text, count, |i, words| take(i, words.integer("an integer")?, budget));
        }
        self.bytes(coding, number, count, budget, |i, bytes, budget| {
            take(i, number.integer(bytes, coding.order), budget)
        })
    }

    /// Hands every number over, with its index, as a finite real number.
    pub(super) fn reals(
        &self,
        coding: Coding,
        count: Count,
        budget: &mut Budget,
        mut take: impl FnMut(u64, f64, &mut Budget) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let number = self.number.ok_or_else(|| self.bad("its type isn't a number's"))?;
        let finite = |i: u64, value: f64| {
            let problem = || format!("number {i} is {value}, not finite");
            if value.is_finite() {
                Ok(value)
            } else {
                Err(Failure::at(format!("DataArray {:?}", self.name), problem(), REPAIR))
            }
        };
        if let Content::Ascii(text) = self.content {
            return self.words(text, count, |i, words| take(i, finite(i, words.real("a number")?)?, budget));
        }
        self.bytes(coding, number, count, budget, |i, bytes, budget| {
            take(i, finite(i, number.real(bytes, coding.order))?, budget)
        })
    }

    fn words(
        &self,
        text: &[u8],
        count: Count,
        mut take: impl FnMut(u64, &mut Words) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut words = Words::new(text, 0, 1);
        let named = |failure| match failure {
            Failure::Bad { place, problem, remedy } => {
                Failure::at(format!("DataArray {:?}, {place} of it", self.name), problem, remedy)
            }
            other @ Failure::Core(_) => other,
        };
        let (Count::Exactly(most) | Count::AtMost(most)) = count;
        let mut i = 0;
        while !words.is_done() {
            if i == most {
                return match count {
                    Count::Exactly(_) => Err(self.bad(format!("more than {most} numbers"))),
                    Count::AtMost(_) => Ok(()),
                };
            }
            take(i, &mut words).map_err(named)?;
            i += 1;
        }
        self.check(count, i)
    }

    fn check(&self, count: Count, found: u64) -> Result<(), Failure> {
        match count {
            Count::Exactly(wanted) if wanted != found => {
                Err(self.bad(format!("{found} numbers instead of {wanted}")))
            }
            _ => Ok(()),
        }
    }

    /// Binary numbers: a word that tells their bytes and the bytes, or zlib blocks behind a table of theirs.
    fn bytes(
        &self,
        coding: Coding,
        number: Number,
        count: Count,
        budget: &mut Budget,
        mut take: impl FnMut(u64, &[u8], &mut Budget) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut source: Box<dyn Read + '_> = match self.content {
            Content::Base64(text) => Box::new(Base64::new(text)),
            Content::Raw(bytes) | Content::Ascii(bytes) => Box::new(bytes),
        };
        if !coding.zlib {
            let bytes = self.word(coding, &mut source)?;
            return self.each(&mut source, bytes, number, count, budget, &mut take);
        }
        let blocks = self.word(coding, &mut source)?;
        let (size, last) = (self.word(coding, &mut source)?, self.word(coding, &mut source)?);
        let missing = if last == 0 { Some(0) } else { size.checked_sub(last) };
        let total = blocks.checked_mul(size).zip(missing).and_then(|(all, missing)| all.checked_sub(missing));
        let total =
            total.ok_or_else(|| self.bad(format!("{blocks} blocks of {size} bytes, the last of {last}")))?;
        let (Content::Base64(whole) | Content::Raw(whole) | Content::Ascii(whole)) = self.content;
        if blocks > (whole.len() / coding.word.bytes()) as u64 {
            return Err(self.bad(format!("a table of {blocks} blocks in {} bytes", whole.len())));
        }
        let mut sizes: Vec<u64> = budget.list("the table of compressed blocks", blocks)?;
        for _ in 0..blocks {
            sizes.push(self.word(coding, &mut source)?);
        }
        let mut inflated = Blocks::new(&mut source, &sizes);
        let held = 8 * blocks;
        self.each(&mut inflated, total, number, count, budget, &mut take)?;
        budget.give(held);
        Ok(())
    }

    fn word(&self, coding: Coding, source: &mut dyn Read) -> Result<u64, Failure> {
        let mut bytes = [0; 8];
        let bytes = &mut bytes[..coding.word.bytes()];
        self.fill(source, bytes)?;
        Ok(coding.word.integer(bytes, coding.order) as u64)
    }

    fn fill(&self, source: &mut dyn Read, bytes: &mut [u8]) -> Result<(), Failure> {
        source.read_exact(bytes).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => self.bad("its data end too early"),
            _ => self.bad(format!("its data: {e}")),
        })
    }

    /// Hands over the numbers in `length` bytes.
    fn each(
        &self,
        source: &mut dyn Read,
        length: u64,
        number: Number,
        count: Count,
        budget: &mut Budget,
        take: &mut Take,
    ) -> Result<(), Failure> {
        let size = number.bytes();
        if !length.is_multiple_of(size as u64) {
            return Err(self.bad(format!("{length} bytes, no multiple of {size}")));
        }
        let found = length / size as u64;
        self.check(count, found)?;
        let (Count::Exactly(most) | Count::AtMost(most)) = count;
        let found = found.min(most);
        let mut buffer = vec![0_u8; CHUNK.min((found as usize).saturating_mul(size))];
        let mut i = 0;
        while i < found {
            let part = (buffer.len() / size).min((found - i) as usize);
            let bytes = &mut buffer[..part * size];
            self.fill(source, bytes)?;
            for entry in bytes.chunks_exact(size) {
                take(i, entry, budget)?;
                i += 1;
            }
        }
        Ok(())
    }
}

/// Zlib streams of known packed sizes, one after the other.
struct Blocks<'a> {
    source: &'a mut dyn Read,
    sizes: std::slice::Iter<'a, u64>,
    inflate: Decompress,
    /// Whether a stream has begun and not ended.
    within: bool,
    /// Packed bytes of the stream that are still in the source.
    left: u64,
    packed: Vec<u8>,
    /// Packed bytes that were taken.
    taken: usize,
}

impl<'a> Blocks<'a> {
    fn new(source: &'a mut dyn Read, sizes: &'a [u64]) -> Self {
        let inflate = Decompress::new(true);
        Self { source, sizes: sizes.iter(), inflate, within: false, left: 0, packed: Vec::new(), taken: 0 }
    }

    fn refill(&mut self) -> io::Result<()> {
        self.packed.resize(self.left.min(CHUNK as u64) as usize, 0);
        self.taken = 0;
        self.source.read_exact(&mut self.packed)?;
        self.left -= self.packed.len() as u64;
        Ok(())
    }
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let damaged = |problem: &str| io::Error::new(io::ErrorKind::InvalidData, format!("zlib: {problem}"));
        loop {
            if !self.within {
                let Some(size) = self.sizes.next() else { return Ok(0) };
                (self.within, self.left) = (true, *size);
                self.inflate.reset(true);
                self.packed.clear();
                self.taken = 0;
            }
            if self.taken == self.packed.len() && self.left > 0 {
                self.refill()?;
            }
            let before = (self.inflate.total_in(), self.inflate.total_out());
            let status = self.inflate.decompress(&self.packed[self.taken..], buffer, FlushDecompress::None);
            let status = status.map_err(|e| damaged(&e.to_string()))?;
            let taken = (self.inflate.total_in() - before.0) as usize;
            let made = (self.inflate.total_out() - before.1) as usize;
            self.taken += taken;
            if status == Status::StreamEnd {
                if self.taken < self.packed.len() || self.left > 0 {
                    return Err(damaged("a block is shorter than its table says"));
                }
                self.within = false;
            } else if taken == 0 && made == 0 {
                return Err(damaged("a block is longer than its table says"));
            }
            if made > 0 {
                return Ok(made);
            }
        }
    }
}
