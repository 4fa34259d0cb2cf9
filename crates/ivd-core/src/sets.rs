//! Disjoint sets of the numbers from 0 on: each number leads to a lesser one of its set or, where it is the least, to itself. The
//! least stands for the set, so that what is named by it depends on no order of joining.
//!
//! ```
//! use ivd_core::sets;
//!
//! let mut all = sets::singles(4);
//! assert!(sets::join(&mut all, 3, 1) && !sets::join(&mut all, 1, 3));
//! assert_eq!([0, 1, 2, 3].map(|member| sets::root(&mut all, member)), [0, 1, 2, 1]);
//! ```

use rayon::prelude::*;

/// So many numbers, each on its own.
pub fn singles(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}

/// Makes every number a set of its own.
pub fn reset(sets: &mut [u32]) {
    sets.par_iter_mut().enumerate().for_each(|(i, set)| *set = i as u32);
}

/// The least member of a number's set; halves the way to it (van Leeuwen 1977, Tarjan and van Leeuwen 1984).
#[inline(always)]
pub fn root(sets: &mut [u32], mut at: u32) -> u32 {
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

/// Joins the sets of two numbers; false where they are one already.
#[inline(always)]
pub fn join(sets: &mut [u32], a: u32, b: u32) -> bool {
    let (a, b) = (root(sets, a), root(sets, b));
    if a == b {
        return false;
    }
    sets[a.max(b) as usize] = a.min(b);
    true
}

/// Leads every number straight to the least of its set.
pub fn flatten(sets: &mut [u32]) {
    // What a number leads to comes before it, and has been led to the least by then.
    for member in 0..sets.len() {
        sets[member] = sets[sets[member] as usize];
    }
}

/// Gives every member the name of its set, a number that `name` gives for the least of them, in ascending order.
///
/// # Errors
/// Those of `check`, which is asked once in every 2¹⁶ members.
pub fn name<E>(
    sets: &mut [u32],
    mut check: impl FnMut() -> Result<(), E>,
    mut name: impl FnMut(usize) -> u32,
) -> Result<(), E> {
    for member in 0..sets.len() {
        if member % (1 << 16) == 0 {
            check()?;
        }
        // What a number leads to comes before it, and has its name by then.
        let above = sets[member] as usize;
        sets[member] = if above < member { sets[above] } else { name(member) };
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise;

    #[test]
    fn sets_are_the_parts_that_relabelling_finds_and_their_least_members_stand_for_them() {
        for seed in 0..50 {
            let (mut all, mut plain) = (vec![7; 60], singles(60));
            reset(&mut all);
            assert_eq!(all, plain);
            for i in 0..40 {
                let [a, b] = [0, 1].map(|end| noise::below(seed, 2 * i + end, 60) as u32);
                let [one, other] = [a, b].map(|member| plain[member as usize]);
                assert_eq!(join(&mut all, a, b), one != other);
                plain.iter_mut().filter(|of| **of == one.max(other)).for_each(|of| *of = one.min(other));
                assert!((0..60).all(|member| root(&mut all, member) == plain[member as usize]));
            }
            let mut named = all.clone();
            let Ok(()) =
                name(&mut named, || Ok::<_, std::convert::Infallible>(()), |least| 1000 + least as u32);
            flatten(&mut all);
            assert_eq!(all, plain);
            assert!(named.iter().zip(&plain).all(|(name, least)| *name == 1000 + least));
        }
    }
}
