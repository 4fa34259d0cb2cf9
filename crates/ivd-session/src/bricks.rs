//! Bricks in which something changes.

use ivd_core::Displacement;

use crate::Error;

/// Bricks in which a displacement shows anything else than rest, ascending.
pub(crate) fn touched(displacement: &Displacement) -> Result<Vec<usize>, Error> {
    Ok(displacement.changed(&Displacement::identity(displacement.grid().clone()))?)
}

/// Two ascending lists as one.
pub(crate) fn merged(a: &[usize], b: &[usize]) -> Vec<usize> {
    let mut all = [a, b].concat();
    all.sort_unstable();
    all.dedup();
    all
}
