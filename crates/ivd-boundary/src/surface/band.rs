//! The bricks that are worked on, and what they hold. The others are all inside or all outside.

use bytemuck::Zeroable;
use ivd_core::{BRICK, Error, Exec, parallel};

use super::level::{CUBE, Level};
use super::sweep::{Brick, Faces, Primal, Steps, dual, primal};

/// Voxels around the front that must be worked on.
pub(super) const MARGIN: usize = 2;

/// A brick that isn't worked on and lies outside; inside.
const OUT: u32 = u32::MAX;
const IN: u32 = u32::MAX - 1;
static ZEROS: Brick = [0.0; CUBE];
static ONES: Brick = [1.0; CUBE];

/// Bricks that a thread makes at a time.
const PIECE: usize = 16;

/// Bricks of a level that are worked on.
pub(super) struct Band {
    dims: [usize; 3],
    bricks: [usize; 3],
    /// For every brick where its state lies, or which side it is on.
    slots: Vec<u32>,
    /// The brick of each slot.
    places: Vec<[usize; 3]>,
    /// Values; NaN without data and beyond the volume.
    pub(super) values: Vec<Brick>,
    pub(super) primal: Vec<Primal>,
    /// Flow through the upper faces along x, y and z.
    pub(super) flow: Vec<[Brick; 3]>,
    /// What a voxel costs inside, less what it costs outside; 0 without data.
    pub(super) force: Vec<Brick>,
    /// Share of its weight that area has at each voxel; empty where that is all of it everywhere.
    pub(super) softness: Vec<Brick>,
}

impl Band {
    /// No brick is worked on; `inside` tells on which side each one is.
    pub(super) fn new(level: &Level, inside: &dyn Fn([usize; 3]) -> bool) -> Self {
        let bricks = level.bricks();
        let slots =
            (0..bricks.iter().product()).map(|i| if inside(place(bricks, i)) { IN } else { OUT }).collect();
        Self {
            dims: level.dims,
            bricks,
            slots,
            places: Vec::new(),
            values: Vec::new(),
            primal: Vec::new(),
            flow: Vec::new(),
            force: Vec::new(),
            softness: Vec::new(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// Share of the part in a voxel; 0 or 1 where its brick isn't worked on.
    pub(super) fn share(&self, voxel: [usize; 3]) -> f32 {
        let brick = voxel.map(|v| v / BRICK);
        match self.slot(brick) {
            Some(slot) => {
                let [x, y, z] = voxel.map(|v| v % BRICK);
                self.primal[slot].u[x + BRICK * (y + BRICK * z)]
            }
            None => f32::from(u8::from(self.side(brick) == Some(true))),
        }
    }

    /// Bricks of the level.
    pub(super) fn all(&self) -> usize {
        self.slots.len()
    }

    /// The brick of a slot.
    pub(super) fn place(&self, slot: usize) -> [usize; 3] {
        self.places[slot]
    }

    /// The side of a brick that isn't worked on.
    pub(super) fn side(&self, brick: [usize; 3]) -> Option<bool> {
        match self.slots[linear(self.bricks, brick)] {
            OUT => Some(false),
            IN => Some(true),
            _ => None,
        }
    }

    /// Where a brick's state lies.
    pub(super) fn slot(&self, brick: [usize; 3]) -> Option<usize> {
        let slot = self.slots[linear(self.bricks, brick)];
        (slot < IN).then_some(slot as usize)
    }

    /// Whether a brick isn't worked on and lies inside.
    pub(super) fn is_inner(&self, brick: [usize; 3]) -> bool {
        self.side(brick) == Some(true)
    }

    /// Takes bricks into work: `start` fills in their shares (zeros before). Those that are in work are passed over; returns the slots
    /// of the new ones.
    ///
    /// # Errors
    /// Memory, cancelled.
    pub(super) fn take(
        &mut self,
        level: &Level,
        bricks: impl IntoIterator<Item = [usize; 3]>,
        start: &(dyn Fn([usize; 3], bool, &mut Brick) + Sync),
        exec: &Exec,
    ) -> Result<std::ops::Range<usize>, Error> {
        let first = self.places.len();
        let mut sides = Vec::new();
        for brick in bricks {
            let slot = &mut self.slots[linear(self.bricks, brick)];
            if *slot >= IN {
                sides.push(*slot == IN);
                *slot = self.places.len() as u32;
                self.places.push(brick);
            }
        }
        let bytes = self.places.len() * size_of::<Brick>() * 7;
        exec.check_memory("the bricks round the surface", bytes as u64)?;
        exec.check_cancelled()?;
        // Made where they lie: there are tens of megabytes of them.
        let places = &self.places[first..];
        let more = places.len();
        lengthen(&mut self.flow, more);
        lengthen(&mut self.force, more);
        lengthen(&mut self.values, more);
        parallel::for_each_piece_mut(&mut self.values[first..], PIECE, &|piece, values| {
            (PIECE * piece..).zip(values).for_each(|(i, values)| level.brick(places[i], values));
        });
        lengthen(&mut self.primal, more);
        parallel::for_each_piece_mut(&mut self.primal[first..], PIECE, &|piece, states| {
            for (i, state) in (PIECE * piece..).zip(states) {
                start(places[i], sides[i], &mut state.u);
                state.ahead = state.u;
            }
        });
        if let Some(edge) = level.edge {
            lengthen(&mut self.softness, more);
            parallel::for_each_piece_mut(&mut self.softness[first..], PIECE, &|piece, softness| {
                (PIECE * piece..).zip(softness).for_each(|(i, out)| *out = level.softness(places[i], edge));
            });
        }
        Ok(first..self.places.len())
    }

    /// The neighbouring brick along an axis; `None` beyond the volume.
    fn neighbour(&self, brick: [usize; 3], axis: usize, up: bool) -> Option<[usize; 3]> {
        let mut other = brick;
        other[axis] = if up { brick[axis] + 1 } else { brick[axis].checked_sub(1)? };
        (other[axis] < self.bricks[axis]).then_some(other)
    }

    /// What of a neighbour is looked at; a brick that isn't worked on has its side's constant, and nothing lies beyond the volume.
    fn beside<'a>(
        &'a self,
        brick: [usize; 3],
        axis: usize,
        up: bool,
        of: impl Fn(usize) -> &'a Brick,
    ) -> Option<&'a Brick> {
        self.neighbour(brick, axis, up).map(|other| match self.slots[linear(self.bricks, other)] {
            OUT => &ZEROS,
            IN => &ONES,
            slot => of(slot as usize),
        })
    }

    /// Voxels of a brick that lie in the volume.
    pub(super) fn extent(&self, brick: [usize; 3]) -> [usize; 3] {
        std::array::from_fn(|a| BRICK.min(self.dims[a] - brick[a] * BRICK))
    }

    /// One step of Chambolle and Pock's iteration over all bricks in work.
    ///
    /// # Errors
    /// Cancelled.
    pub(super) fn sweep(&mut self, steps: &Steps, exec: &Exec) -> Result<(), Error> {
        exec.check_cancelled()?;
        let mut flow = std::mem::take(&mut self.flow);
        parallel::for_each_piece_mut(&mut flow, 4, &|piece, flows| {
            for (slot, flow) in (4 * piece..).zip(flows) {
                let brick = self.places[slot];
                let above = [0, 1, 2].map(|a| self.beside(brick, a, true, |s| &self.primal[s].ahead));
                let faces = Faces { above, extent: self.extent(brick) };
                dual(flow, &self.primal[slot].ahead, &faces, self.softness.get(slot), steps);
            }
        });
        self.flow = flow;
        let mut primal_of = std::mem::take(&mut self.primal);
        parallel::for_each_piece_mut(&mut primal_of, 4, &|piece, states| {
            for (slot, state) in (4 * piece..).zip(states) {
                let brick = self.places[slot];
                primal(state, &self.flow[slot], self.below(brick), &self.force[slot], steps);
            }
        });
        self.primal = primal_of;
        Ok(())
    }

    /// Flows through the upper faces of the bricks below one along x, y and z.
    pub(super) fn below(&self, brick: [usize; 3]) -> [&Brick; 3] {
        [0, 1, 2].map(|a| match self.neighbour(brick, a, false).and_then(|other| self.slot(other)) {
            Some(slot) => &self.flow[slot][a],
            None => &ZEROS,
        })
    }

    /// Shares of the bricks above one along x, y and z; `None` beyond the volume.
    pub(super) fn above(&self, brick: [usize; 3]) -> [Option<&Brick>; 3] {
        [0, 1, 2].map(|a| self.beside(brick, a, true, |s| &self.primal[s].u))
    }

    /// Bricks that reach within the margin of a box of voxels of a brick (lowest and highest, within the brick).
    pub(super) fn around(&self, brick: [usize; 3], [low, high]: [[usize; 3]; 2]) -> Vec<[usize; 3]> {
        let range = |a: usize| {
            let from = (brick[a] * BRICK + low[a]).saturating_sub(MARGIN) / BRICK;
            let to = ((brick[a] * BRICK + high[a] + MARGIN) / BRICK).min(self.bricks[a] - 1);
            from..=to
        };
        let mut found = Vec::new();
        for z in range(2) {
            for y in range(1) {
                found.extend(range(0).map(|x| [x, y, z]));
            }
        }
        found
    }
}

/// Adds zeros; to nothing, pages that the system clears when they are first written to.
fn lengthen<T: Zeroable + Clone>(of: &mut Vec<T>, more: usize) {
    if of.is_empty() {
        *of = bytemuck::zeroed_vec(more);
    } else {
        of.resize_with(of.len() + more, T::zeroed);
    }
}

/// A brick by its number.
pub(super) fn place([nx, ny, _]: [usize; 3], i: usize) -> [usize; 3] {
    [i % nx, i / nx % ny, i / nx / ny]
}

/// A brick's number.
pub(super) fn linear([nx, ny, _]: [usize; 3], [x, y, z]: [usize; 3]) -> usize {
    x + nx * (y + ny * z)
}
