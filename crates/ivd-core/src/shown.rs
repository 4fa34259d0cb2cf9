//! Text from elsewhere on its way to a person.

use std::borrow::Cow;
use std::fmt::Display;

/// Text as it is shown to a person, on a terminal or on a page: what would act on the display instead of being seen is written out, as
/// `\u{1b}`.
///
/// Names, headers and paths come from whoever made a file. A control character in them may colour, move or erase what a terminal shows,
/// a bidirectional one reorders what is read, and a line separator makes two lines of one. Written out are C0 but the newline, DEL, C1,
/// the bidirectional controls (U+061C, U+200E, U+200F, U+202A–E, U+2066–9) and U+2028, U+2029. All else stays, other scripts too.
/// What a program reads (`--json`, files) isn't shown, and isn't changed.
///
/// ```
/// assert_eq!(ivd_core::shown("scan\u{1b}[2J.nrrd"), r"scan\u{1b}[2J.nrrd");
/// assert_eq!(ivd_core::shown("頭蓋骨, naïve"), "頭蓋骨, naïve");
/// ```
pub fn shown(text: &str) -> Cow<'_, str> {
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if acts(c) { out.extend(c.escape_unicode()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// A count with what is counted, one or several.
///
/// ```
/// assert_eq!(ivd_core::counted(1, "piece", "pieces"), "1 piece");
/// assert_eq!(ivd_core::counted(0_u64, "vertex", "vertices"), "0 vertices");
/// ```
pub fn counted<N: Copy + Display + PartialEq + From<bool>>(count: N, one: &str, several: &str) -> String {
    let what = if count == N::from(true) { one } else { several };
    format!("{count} {what}")
}

/// Whether a character acts on the display instead of being seen.
fn acts(c: char) -> bool {
    matches!(c,
        '\0'..='\t' | '\u{b}'..='\u{1f}' | '\u{7f}'..='\u{9f}'
        | '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
        | '\u{2028}' | '\u{2029}'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_that_acts_is_written_out_and_no_other_is_touched() {
        let mut written_out = 0;
        for c in (0..=0x0010_ffff).filter_map(char::from_u32) {
            let (text, n) = (format!("a{c}b"), c as u32);
            let due = match n {
                0xa => false,
                0..=0x1f | 0x7f..=0x9f | 0x61c | 0x200e | 0x200f | 0x2028 | 0x2029 => true,
                0x202a..=0x202e | 0x2066..=0x2069 => true,
                _ => false,
            };
            written_out += usize::from(due);
            let expected = if due { format!("a\\u{{{n:x}}}b") } else { text.clone() };
            assert_eq!(shown(&text), expected);
        }
        assert_eq!(written_out, 31 + 33 + 14);
    }

    #[test]
    fn what_is_shown_once_is_shown_the_same_again() {
        let once = shown("\u{202e}\t\u{1b}[0m\n").into_owned();
        assert_eq!(shown(&once), once);
    }
}
