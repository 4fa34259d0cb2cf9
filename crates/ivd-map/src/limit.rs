//! How far a motion can be mapped, where the whole of it can't.

use ivd_core::{Classified as _, ErrorClass, Motion};
use ivd_field::param::Limit;

use crate::{Error, MapResult};

/// Times that the way is halved to find where it ends.
const HALVINGS: u32 = 5;

/// The map of a motion; where it can't be trusted, the share of the way that can be mapped is looked for, and gone or told, as `limit` says.
///
/// # Errors
/// As `map`; [`Error::Beyond`] where a part of the way holds.
pub(super) fn as_far(
    motion: &Motion,
    limit: Limit,
    mut map: impl FnMut(&Motion) -> Result<MapResult, Error>,
) -> Result<MapResult, Error> {
    let problem = match map(motion) {
        Err(error) if error.error_class() == ErrorClass::Untrusted => error,
        whole => return whole,
    };
    let (mut share, mut step, mut found) = (0.0, 0.5, None);
    for _ in 0..HALVINGS {
        match map(&motion.part(share + step)) {
            Ok(part) => {
                share += step;
                found = Some(part);
            }
            Err(error) if error.error_class() == ErrorClass::Untrusted => {}
            Err(error) => return Err(error),
        }
        step /= 2.0;
    }
    match found {
        None => Err(problem),
        Some(mut found) if limit == Limit::Stop => {
            found.figures.share = share;
            Ok(found)
        }
        Some(_) => Err(Error::Beyond { problem: Box::new(problem), share }),
    }
}
