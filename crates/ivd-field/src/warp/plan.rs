//! The linear warp as plain data: for backends other than the processor.

use std::marker::PhantomData;

use ivd_core::{Displacement, Exec, FieldBricks, Kernel, Scalar, Voxels};

use super::row::LANES;
use crate::Error;

/// Rows of a brick.
const ROWS: usize = FieldBricks::SIDE * FieldBricks::SIDE;

/// The pass that makes the voxels that move of those where they were before, trilinearly, where no cut parts them.
pub struct Warping<T>(PhantomData<T>);

impl<T: Scalar> Kernel for Warping<T> {
    const NAME: &'static str = "warp/linear";
    type Args<'a> = Moving<'a, T>;
    /// The voxels, and how many were computed.
    type Out = (Vec<T>, u64);
    type Error = Error;

    fn on_processor(moving: &Moving<'_, T>, exec: &Exec) -> Result<(Vec<T>, u64), Error> {
        (moving.by)(None, exec)
    }
}

/// What moves, and how.
pub struct Moving<'a, T> {
    /// The voxels before.
    pub voxels: &'a Voxels,
    /// How they move.
    pub displacement: &'a Displacement,
    /// Rows of the matrix from world vectors to voxels.
    pub to_voxel: [[f64; 3]; 3],
    /// Above what coordinate along each axis a voxel's neighbours may be beyond the last: such a voxel is the processor's.
    pub most: [f64; 3],
    pub(super) by: &'a By<'a, T>,
}

/// Makes the voxels, of what is made already where there is such.
type By<'a, T> = dyn Fn(Option<&Made<T>>, &Exec) -> Result<(Vec<T>, u64), Error> + 'a;

/// What another backend made of the bricks that are stored.
pub struct Made<T> {
    /// Of each brick, in the order in which they are stored, 512 values; those of voxels that don't move mean nothing.
    pub values: Vec<T>,
    /// Of each row of eight voxels a bit each for those that are left to the processor.
    pub left: Vec<u8>,
}

impl<T: Scalar> Made<T> {
    /// Row `row` of the brick at `slot`: its values, and which are left.
    pub(super) fn row(&self, slot: usize, row: usize) -> (&[T; LANES], u8) {
        let at = slot * ROWS + row;
        let (values, _) = self.values[LANES * at..].split_first_chunk().expect("a brick's row");
        (values, self.left[at])
    }
}

impl<T: Scalar> Moving<'_, T> {
    /// All voxels: those that moved as they were made, what was left and what was left behind by the processor, all others as they were.
    ///
    /// # Errors
    /// Cancellation.
    pub fn finish(&self, made: &Made<T>, exec: &Exec) -> Result<(Vec<T>, u64), Error> {
        (self.by)(Some(made), exec)
    }
}
