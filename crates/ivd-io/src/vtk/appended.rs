/// The bytes behind the `_` of `AppendedData`, to the end of the file.
#[derive(Clone, Copy)]
pub(crate) struct Appended<'a> {
    /// Bytes as they are; else base64.
    pub(crate) raw: bool,
    pub(crate) bytes: &'a [u8],
}

/// What is wrong with `AppendedData`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Broken {
    /// The file ends in its tag.
    Tag,
    /// The file ends behind its tag.
    Empty,
    /// Its data begin otherwise than with `_`.
    Mark,
    /// Its encoding is neither `raw` nor `base64`.
    Encoding,
}

/// The XML, and the appended data where there are some.
pub(crate) type Parts<'a> = (&'a [u8], Option<Appended<'a>>);

/// Parts the XML from the appended data, which is no XML.
///
/// # Errors
/// What is wrong, with the byte where the element begins.
pub(crate) fn split(bytes: &[u8]) -> Result<Parts<'_>, (usize, Broken)> {
    const TAG: &[u8] = b"<AppendedData";
    let mut from = 0;
    while let Some(at) = bytes[from..].iter().position(|&b| b == b'<').map(|at| from + at) {
        if !bytes[at..].starts_with(TAG) {
            from = at + 1;
            continue;
        }
        let close = bytes[at..].iter().position(|&b| b == b'>').ok_or((at, Broken::Tag))?;
        let tag = &bytes[at..at + close];
        let rest = &bytes[at + close + 1..];
        let mark = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or((at, Broken::Empty))?;
        if rest[mark] != b'_' {
            return Err((at, Broken::Mark));
        }
        let says = |word: &[u8]| {
            tag.windows(word.len() + 2)
                .any(|w| matches!(w, [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] if inner == word))
        };
        let raw = match (says(b"raw"), says(b"base64")) {
            (true, _) => true,
            (false, true) => false,
            (false, false) => return Err((at, Broken::Encoding)),
        };
        return Ok((&bytes[..at], Some(Appended { raw, bytes: &rest[mark + 1..] })));
    }
    Ok((bytes, None))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_behind_the_mark_are_parted_from_the_xml_and_what_is_wrong_is_told() {
        let (xml, found) = split(b"<a><b/> <AppendedData encoding='raw'>\n _\x00<\xff").unwrap();
        assert_eq!(
            (xml, found.map(|f| (f.raw, f.bytes))),
            (&b"<a><b/> "[..], Some((true, &b"\x00<\xff"[..])))
        );
        let (xml, found) = split(b"<AppendedData encoding=\"base64\">_AA==</AppendedData>").unwrap();
        assert!(xml.is_empty() && found.is_some_and(|f| !f.raw && f.bytes.starts_with(b"AA==")));
        assert!(split(b"<a/>").unwrap().1.is_none());
        let wrong = |text: &str| split(text.as_bytes()).map(|_| ()).unwrap_err();
        assert_eq!(wrong("<a><AppendedData encoding=\"raw\""), (3, Broken::Tag));
        assert_eq!(wrong("<AppendedData encoding=\"raw\">  "), (0, Broken::Empty));
        assert_eq!(wrong("<AppendedData encoding=\"raw\">x"), (0, Broken::Mark));
        assert_eq!(wrong("<AppendedData encoding=\"hex\">_"), (0, Broken::Encoding));
    }
}
