//! Secrets that say who somebody is.

use std::fmt::Write as _;

use subtle::ConstantTimeEq as _;

use crate::Error;

/// 128 bits from the system.
#[derive(Clone)]
pub(crate) struct Token(String);

impl Token {
    pub(crate) fn new() -> Result<Self, Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes).map_err(|e| Error::System {
            what: "a token".into(),
            problem: e.to_string(),
            remedy: "the system has no random numbers; try again",
        })?;
        let hex = bytes.iter().fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        });
        Ok(Self(hex))
    }

    /// As it stands in a link.
    pub(crate) fn text(&self) -> &str {
        &self.0
    }

    /// Whether it is this one; how long that takes tells nothing of where they differ.
    pub(crate) fn is(&self, other: &str) -> bool {
        self.0.as_bytes().ct_eq(other.as_bytes()).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_differ_and_know_themselves() {
        let (a, b) = (Token::new().unwrap(), Token::new().unwrap());
        assert_eq!(a.text().len(), 32);
        assert!(a.is(a.text()) && !a.is(b.text()) && !a.is("") && !a.is(&a.text()[..31]));
    }
}
