//! Lists of numbers in text headers.

use std::path::Path;
use std::str::FromStr;

use crate::volume::Error;

/// Numbers separated by white space in the field `name` of a header: exactly `count` of them.
///
/// # Errors
/// [`Error::Field`] names the word that is no number, or tells how many there are.
pub(crate) fn numbers<T: FromStr>(
    path: &Path,
    name: &str,
    text: &str,
    count: usize,
) -> Result<Vec<T>, Error> {
    let numbers = text
        .split_whitespace()
        .map(|word| {
            word.parse().map_err(|_| Error::field(path, name, format!("`{word}` is no number of its kind")))
        })
        .collect::<Result<Vec<T>, _>>()?;
    if numbers.len() != count {
        return Err(Error::field(path, name, format!("{} numbers where {count} are due", numbers.len())));
    }
    Ok(numbers)
}
