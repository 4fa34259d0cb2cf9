/// A name without its ending, in upper or lower case; `None` where it has another.
pub(super) fn strip_ending<'a>(name: &'a str, ending: &str) -> Option<&'a str> {
    let cut = name.len().checked_sub(ending.len())?;
    name.get(cut..)?.eq_ignore_ascii_case(ending).then(|| &name[..cut])
}
