//! Work on the indices of a range, or on the pieces of a slice, by all threads of the pool that the caller is in.
//!
//! Rayon's splitting is compiled here, once, and not with every loop for every type of voxel: the work is called through a reference,
//! once a piece. Pieces are what the caller says, whatever the number of threads, and what comes of them is joined in their order: the
//! same bits on any machine.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

/// Work on a piece of a slice, of which it is told the number.
pub type OnPiece<'a, T, R> = dyn Fn(usize, &mut [T]) -> R + Sync + 'a;

/// Calls `work` with every index below `count`.
pub fn for_each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// Calls `work` with every index below `count` until one fails.
///
/// # Errors
/// Of those that failed before the others had heard of it, the one of the lowest index.
pub fn try_for_each<E: Send>(count: usize, work: &(dyn Fn(usize) -> Result<(), E> + Sync)) -> Result<(), E> {
    let failed = Failed::none();
    for_each(count, &|i| {
        if failed.is_none()
            && let Err(error) = work(i)
        {
            failed.at(i, error);
        }
    });
    failed.or(())
}

/// What `work` gives for every index below `count`, in their order.
pub fn map<R: Send>(count: usize, work: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    let slots: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::new(None)).collect();
    for_each(count, &|i| put(&slots[i], work(i)));
    slots.into_iter().map(taken).collect()
}

/// As [`map`], until one fails.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_map<R: Send, E: Send>(
    count: usize,
    work: &(dyn Fn(usize) -> Result<R, E> + Sync),
) -> Result<Vec<R>, E> {
    let slots: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::new(None)).collect();
    try_for_each(count, &|i| {
        put(&slots[i], work(i)?);
        Ok(())
    })?;
    Ok(slots.into_iter().map(taken).collect())
}

/// Works through every index below `count` with accumulators of which each is one thread's at a time, and gives them in no fixed order
/// and with the indices as the threads came: for sums and the like that are the same in any order, such as those of whole numbers.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_gather<R: Send, E: Send>(
    count: usize,
    empty: &(dyn Fn() -> R + Sync),
    add: &(dyn Fn(&mut R, usize) -> Result<(), E> + Sync),
) -> Result<Vec<R>, E> {
    let idle = Mutex::new(Vec::new());
    try_for_each(count, &|i| {
        let taken = locked(&idle).pop();
        let mut own = taken.unwrap_or_else(empty);
        let result = add(&mut own, i);
        locked(&idle).push(own);
        result
    })?;
    Ok(idle.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// As [`try_map`], with something to work in that is made once a thread or so, and comes as the last index left it.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_map_with<S: Send, R: Send, E: Send>(
    count: usize,
    new: &(dyn Fn() -> S + Sync),
    work: &(dyn Fn(&mut S, usize) -> Result<R, E> + Sync),
) -> Result<Vec<R>, E> {
    let idle = Mutex::new(Vec::new());
    try_map(count, &|i| {
        let taken = locked(&idle).pop();
        let mut own = taken.unwrap_or_else(new);
        let result = work(&mut own, i);
        locked(&idle).push(own);
        result
    })
}

/// Hands out every item, until the work on one fails.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_for_each_of<T: Send, E: Send>(
    items: Vec<T>,
    work: &(dyn Fn(T) -> Result<(), E> + Sync),
) -> Result<(), E> {
    try_map_of(items, &|| (), &|(), _, item| work(item)).map(drop)
}

/// As [`try_map_with`], over items that are handed out.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_map_of<T: Send, S: Send, R: Send, E: Send>(
    items: Vec<T>,
    new: &(dyn Fn() -> S + Sync),
    work: &(dyn Fn(&mut S, usize, T) -> Result<R, E> + Sync),
) -> Result<Vec<R>, E> {
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    try_map_with(items.len(), new, &|own, i| {
        let item = locked(&items[i]).take().expect("an item is handed out once");
        work(own, i, item)
    })
}

/// Number of pieces of `size` elements, the last one shorter, that make up `len`.
pub fn pieces(len: usize, size: usize) -> usize {
    len.div_ceil(size)
}

/// The elements of a piece.
pub fn piece(len: usize, size: usize, i: usize) -> Range<usize> {
    i * size..((i + 1) * size).min(len)
}

/// What `work` gives for every piece of `size` elements of `len`, in their order.
pub fn map_pieces<R: Send>(len: usize, size: usize, work: &(dyn Fn(Range<usize>) -> R + Sync)) -> Vec<R> {
    map(pieces(len, size), &|i| work(piece(len, size, i)))
}

/// As [`map_pieces`], until one fails.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_map_pieces<R: Send, E: Send>(
    len: usize,
    size: usize,
    work: &(dyn Fn(Range<usize>) -> Result<R, E> + Sync),
) -> Result<Vec<R>, E> {
    try_map(pieces(len, size), &|i| work(piece(len, size, i)))
}

/// The pieces of `size` elements of a slice, each for the thread that works on it.
fn shared_out<T>(out: &mut [T], size: usize) -> Vec<Mutex<&mut [T]>> {
    out.chunks_mut(size).map(Mutex::new).collect()
}

/// Hands out every piece of `size` elements of a slice, with its number.
pub fn for_each_piece_mut<T: Send>(out: &mut [T], size: usize, work: &OnPiece<'_, T, ()>) {
    let parts = shared_out(out, size);
    for_each(parts.len(), &|i| work(i, &mut locked(&parts[i])));
}

/// As [`for_each_piece_mut`], until one fails.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_for_each_piece_mut<T: Send, E: Send>(
    out: &mut [T],
    size: usize,
    work: &OnPiece<'_, T, Result<(), E>>,
) -> Result<(), E> {
    let parts = shared_out(out, size);
    try_for_each(parts.len(), &|i| work(i, &mut locked(&parts[i])))
}

/// As [`for_each_piece_mut`], and what comes of every piece, in their order.
pub fn map_pieces_mut<T: Send, R: Send>(out: &mut [T], size: usize, work: &OnPiece<'_, T, R>) -> Vec<R> {
    let parts = shared_out(out, size);
    map(parts.len(), &|i| work(i, &mut locked(&parts[i])))
}

/// As [`map_pieces_mut`], until one fails.
///
/// # Errors
/// As [`try_for_each`].
pub fn try_map_pieces_mut<T: Send, R: Send, E: Send>(
    out: &mut [T],
    size: usize,
    work: &OnPiece<'_, T, Result<R, E>>,
) -> Result<Vec<R>, E> {
    let parts = shared_out(out, size);
    try_map(parts.len(), &|i| work(i, &mut locked(&parts[i])))
}

/// The failure of the lowest index so far.
struct Failed<E> {
    index: AtomicUsize,
    error: Mutex<Option<E>>,
}

impl<E> Failed<E> {
    fn none() -> Self {
        Self { index: AtomicUsize::new(usize::MAX), error: Mutex::new(None) }
    }

    fn is_none(&self) -> bool {
        self.index.load(Ordering::Relaxed) == usize::MAX
    }

    fn at(&self, index: usize, error: E) {
        let mut kept = locked(&self.error);
        if index < self.index.load(Ordering::Relaxed) {
            self.index.store(index, Ordering::Relaxed);
            *kept = Some(error);
        }
    }

    fn or<R>(self, result: R) -> Result<R, E> {
        match self.error.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(result),
        }
    }
}

/// A lock that only this piece's work takes; where that panicked, the panic goes on through rayon anyway.
fn locked<T>(slot: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn put<R>(slot: &Mutex<Option<R>>, result: R) {
    *locked(slot) = Some(result);
}

fn taken<R>(slot: Mutex<Option<R>>) -> R {
    let result = slot.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    result.expect("every index was worked on")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_their_pieces() {
        assert_eq!(map(1000, &|i| i * i), (0..1000).map(|i| i * i).collect::<Vec<_>>());
        assert_eq!(map_pieces(10, 4, &|range| range), [0..4, 4..8, 8..10]);
        assert!(map_pieces(0, 4, &|range| range).is_empty());
        assert_eq!(try_map_pieces(9, 4, &|range| Ok::<_, ()>(range.len())), Ok(vec![4, 4, 1]));
    }

    #[test]
    fn every_piece_of_a_slice_is_handed_out_once() {
        let mut out = vec![0; 103];
        for_each_piece_mut(&mut out, 10, &|i, piece| piece.iter_mut().for_each(|v| *v += i + 1));
        assert!(out.iter().enumerate().all(|(i, v)| *v == i / 10 + 1));
        let lengths = try_map_pieces_mut(&mut out, 10, &|i, piece| {
            piece.fill(i);
            Ok::<_, ()>(piece.len())
        });
        assert_eq!(lengths, Ok([vec![10; 10], vec![3]].concat()));
        assert_eq!(out[102], 10);
    }

    #[test]
    fn accumulators_miss_no_index_and_rooms_to_work_in_are_used_again() {
        let parts = try_gather(1000, &|| 0, &|sum, i| {
            *sum += i;
            Ok::<_, ()>(())
        });
        assert_eq!(parts.unwrap().iter().sum::<usize>(), 499_500);
        let made = AtomicUsize::new(0);
        let new = || made.fetch_add(1, Ordering::Relaxed);
        let doubled = try_map_with(1000, &new, &|_, i| Ok::<_, ()>(2 * i)).unwrap();
        assert_eq!(doubled[999], 1998);
        assert!(made.into_inner() <= rayon::current_num_threads());
        assert_eq!(try_gather(5, &|| (), &|(), i| if i == 3 { Err(i) } else { Ok(()) }), Err(3));
    }

    #[test]
    fn a_failure_stops_what_has_not_begun_and_the_lowest_is_told() {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let begun = AtomicUsize::new(0);
        let fail = |i| {
            begun.fetch_add(1, Ordering::Relaxed);
            if i >= 7 { Err(i) } else { Ok(()) }
        };
        assert_eq!(one.install(|| try_for_each(1000, &fail)), Err(7));
        assert_eq!(begun.into_inner(), 8);
        let all = |i: usize| if i % 2 == 1 { Err(i) } else { Ok(i) };
        let told = try_map(1000, &all).unwrap_err();
        assert!(told % 2 == 1);
        let mut out = [0; 9];
        assert_eq!(try_for_each_piece_mut(&mut out, 3, &|_, _| Err::<(), _>("stop")), Err("stop"));
    }
}
