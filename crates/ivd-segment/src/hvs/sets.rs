//! Disjoint sets whose smallest member stands for them.

/// Every member on its own.
pub(crate) fn fill(sets: &mut [u32]) {
    use rayon::prelude::*;
    sets.par_iter_mut().enumerate().for_each(|(i, set)| *set = i as u32);
}

/// The member that stands for a set; halves the way to it (van Leeuwen 1977, Tarjan and van Leeuwen 1984).
#[inline(always)]
pub(crate) fn root(sets: &mut [u32], mut at: u32) -> u32 {
    loop {
        let above = sets[at as usize];
        if above == at {
            return at;
        }
        let next = sets[above as usize];
        sets[at as usize] = next;
        at = next;
    }
}

/// Joins two sets; false where they are one already.
#[inline(always)]
pub(crate) fn join(sets: &mut [u32], a: u32, b: u32) -> bool {
    let (a, b) = (root(sets, a), root(sets, b));
    if a == b {
        return false;
    }
    sets[a.max(b) as usize] = a.min(b);
    true
}
