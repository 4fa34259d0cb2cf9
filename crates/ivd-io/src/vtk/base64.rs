use std::io::{self, Read};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Characters decoded at a time; a multiple of 4.
const PART: usize = 4096;

/// Base64 as VTK writes it: white space anywhere, and several streams, each with its padding, one after the other
/// (a block header is encoded apart from its blocks). Stops at the first `<`.
pub(crate) struct Base64<'a> {
    text: &'a [u8],
    decoded: Vec<u8>,
    taken: usize,
}

impl<'a> Base64<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        Self { text, decoded: Vec::new(), taken: 0 }
    }

    /// Decodes the next characters, up to the end of a padded stream.
    fn refill(&mut self) -> io::Result<()> {
        let mut part = Vec::with_capacity(PART);
        while part.len() < PART {
            let Some((&c, rest)) = self.text.split_first() else { break };
            if c == b'<' {
                self.text = &[];
                break;
            }
            self.text = rest;
            if !c.is_ascii_whitespace() {
                part.push(c);
            }
            // Padding ends a stream at a multiple of 4 characters.
            if c == b'=' && part.len().is_multiple_of(4) {
                break;
            }
        }
        self.decoded.clear();
        self.taken = 0;
        STANDARD
            .decode_vec(&part, &mut self.decoded)
            .map_err(|e| io::Error::new(io::ErrorKind::InvalidData, format!("base64: {e}")))
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.decoded.len() {
            self.refill()?;
        }
        let n = buffer.len().min(self.decoded.len() - self.taken);
        buffer[..n].copy_from_slice(&self.decoded[self.taken..self.taken + n]);
        self.taken += n;
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_with_padding_in_the_middle_are_one() {
        let text = format!(
            "  {}\n{} {}<tail",
            STANDARD.encode(b"head"),
            STANDARD.encode([7; 5000]),
            STANDARD.encode(b"x")
        );
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes()).read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, [&b"head"[..], &[7; 5000], b"x"].concat());
    }

    #[test]
    fn other_characters_are_errors() {
        assert!(Base64::new(b"AA#A").read_to_end(&mut Vec::new()).is_err());
        assert!(Base64::new(b"AAA").read_to_end(&mut Vec::new()).is_err());
    }
}
