//! Words that the blocks of a pass write side by side.
//!
//! Each word belongs to one block while a pass runs, and between passes the threads have met: no order of memory needs
//! to be asked for, and relaxed loads and stores cost what plain ones do.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// No vertex.
pub(super) const NONE: u32 = u32::MAX;

/// A number that one of many threads may write.
#[derive(Debug)]
#[repr(transparent)]
pub(super) struct Word(AtomicU32);

impl Word {
    pub(super) fn new(value: u32) -> Self {
        Self(AtomicU32::new(value))
    }

    #[inline]
    pub(super) fn get(&self) -> u32 {
        self.0.load(Relaxed)
    }

    #[inline]
    pub(super) fn set(&self, value: u32) {
        self.0.store(value, Relaxed);
    }

    /// As a number in single precision.
    #[inline]
    pub(super) fn float(&self) -> f32 {
        f32::from_bits(self.get())
    }

    #[inline]
    pub(super) fn set_float(&self, value: f32) {
        self.set(value.to_bits());
    }
}

/// Triangles with their bounds.
#[derive(Debug)]
pub(super) struct Triangles {
    corners: Vec<[Word; 3]>,
    /// Bound of each triangle's distance from the input, both ways (mm).
    bounds: Vec<Word>,
    /// Number that each has in the input.
    numbers: Vec<u32>,
}

/// Corners of a triangle that a collapse has removed.
pub(super) const GONE: [u32; 3] = [u32::MAX; 3];

impl Triangles {
    /// Triangles that haven't moved yet.
    ///
    /// - `numbers`: the number that each has in the input.
    pub(super) fn new(corners: &[[u32; 3]], numbers: Vec<u32>) -> Self {
        Self {
            corners: corners.iter().map(|t| t.map(Word::new)).collect(),
            bounds: corners.iter().map(|_| Word::new(0.0_f32.to_bits())).collect(),
            numbers,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }

    /// Corners, or [`GONE`].
    #[inline]
    pub(super) fn corners(&self, t: u32) -> [u32; 3] {
        let [a, b, c] = &self.corners[t as usize];
        [a.get(), b.get(), c.get()]
    }

    /// Number in the input.
    pub(super) fn number(&self, t: u32) -> u32 {
        self.numbers[t as usize]
    }

    #[inline]
    pub(super) fn bound(&self, t: u32) -> f32 {
        self.bounds[t as usize].float()
    }

    pub(super) fn remove(&self, t: u32) {
        for (word, gone) in self.corners[t as usize].iter().zip(GONE) {
            word.set(gone);
        }
    }

    /// Moves a triangle's corner `from` to `to` and gives it a new bound.
    pub(super) fn pull(&self, t: u32, from: u32, to: u32, bound: f32) {
        let corner = self.corners[t as usize].iter().find(|c| c.get() == from);
        corner.expect("the fan lists the vertex's triangles").set(to);
        self.bounds[t as usize].set_float(bound);
    }

    /// Gives a triangle a bound if that is larger than its own.
    pub(super) fn raise(&self, t: u32, bound: f32) {
        let word = &self.bounds[t as usize];
        word.set_float(word.float().max(bound));
    }

    /// Closes the gaps of removed triangles; the order stays.
    pub(super) fn compact(&mut self) {
        let mut kept = 0;
        for t in 0..self.len() {
            let corners = self.corners(t as u32);
            if corners != GONE {
                for (word, c) in self.corners[kept].iter().zip(corners) {
                    word.set(c);
                }
                self.bounds[kept].set(self.bounds[t].get());
                self.numbers[kept] = self.numbers[t];
                kept += 1;
            }
        }
        self.corners.truncate(kept);
        self.bounds.truncate(kept);
        self.numbers.truncate(kept);
    }
}
