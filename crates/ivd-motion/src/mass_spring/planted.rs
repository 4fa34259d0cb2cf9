//! A fault that a test plants in what runs on wide registers and nowhere else, so that a comparison with the plain loops can be seen
//! to fail. It is the planting thread's own: work on a pool of one thread, planted from within, leaves other tests alone.

use std::cell::Cell;

thread_local! {
    static PLANTED: Cell<bool> = const { Cell::new(false) };
}

/// Plants the fault on this thread, or takes it out again.
pub(crate) fn set(planted: bool) {
    PLANTED.set(planted);
}

/// Makes numbers a little larger where the fault is planted.
pub(crate) fn spoil<'a>(numbers: impl IntoIterator<Item = &'a mut f64>) {
    if PLANTED.get() {
        numbers.into_iter().for_each(|x| *x *= 1.0 + 1e-9);
    }
}
