//! Where single places go, and where they came from.
//!
//! Between voxels the forward field says where a place goes, and Newton's steps on it, from where the inverse field points, where one came
//! from. Beside a cut a place goes with one side of it, and that side's field goes straight on from its own voxels: those of the
//! other take no part.
//!
//! ```
//! use ivd_core::{Displacement, FieldBricks, Grid, VoxelCoord};
//! use ivd_field::{inverse, place};
//!
//! // Everything moves along x by half a voxel more for each voxel.
//! let grid = Grid::with_spacing([8; 3], [1.0; 3])?;
//! let vectors: Vec<[f32; 3]> = (0..512).map(|i| [0.5 * (i % 8) as f32, 0.0, 0.0]).collect();
//! let forward = FieldBricks::new([8; 3], vec![0], vectors.into())?;
//! let inverse = inverse::invert(&forward, &grid, &Default::default())?;
//! let displacement = Displacement::new(grid, forward, inverse.field)?;
//! let rest = VoxelCoord([3.5, 4.0, 4.0].into());
//! let moved = place::moved(&displacement, rest);
//! assert_eq!(moved.0.x, 5.25);
//! assert!((place::at_rest(&displacement, moved).0 - rest.0).norm() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use ivd_core::{Displacement, FieldBricks, VoxelCoord, VoxelIndex};
use nalgebra::{Matrix3, Vector3};

use crate::sampler::{Corners, Sampler, gradient, interpolate};

/// Newton's steps at most: two or three are enough.
const NEWTON: usize = 6;

/// Where what rests at a place is now. Within a voxel of a cut it goes with the side that its nearest voxels are on.
pub fn moved(displacement: &Displacement, rest: VoxelCoord) -> VoxelCoord {
    let side = OneSided::new(displacement, Space::Rest, 0).side_at(rest.0);
    VoxelCoord(rest.0 + OneSided::new(displacement, Space::Rest, side).at(rest.0))
}

/// Where what is now at a place was at rest, closer than the inverse field's voxels say. Beside an open cut that lies on the side whose
/// voxels are seen there; where nothing has come to, as where a cut has opened, it is where the inverse field goes on to.
pub fn at_rest(displacement: &Displacement, now: VoxelCoord) -> VoxelCoord {
    let side = OneSided::new(displacement, Space::Deformed, 0).side_at(now.0);
    let forward = OneSided::new(displacement, Space::Rest, side);
    let mut rest = now.0 + OneSided::new(displacement, Space::Deformed, side).at(now.0);
    let mut off = rest + forward.at(rest) - now.0;
    for _ in 0..NEWTON {
        // Further beyond the lip than its side is known the inverse field has gone on already.
        if !forward.knows(rest) {
            break;
        }
        let (cell, within) = forward.field.locate(rest);
        let slope = Matrix3::identity() + gradient(&forward.corners(cell), within);
        let Some(step) = slope.try_inverse().map(|inverse| inverse * off) else { break };
        let next = rest - step;
        let left = next + forward.at(next) - now.0;
        // Where nothing has gone from, as beside what is left behind, no step comes nearer.
        if !forward.knows(next) || left.norm() >= off.norm() {
            break;
        }
        (rest, off) = (next, left);
    }
    VoxelCoord(rest)
}

/// Whose voxels a field has vectors of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Space {
    Rest,
    Deformed,
}

/// The field of a space (voxels), as a side of the cut has it: 1 below, 2 above; as 0 has it, all voxels count.
struct OneSided<'a> {
    displacement: &'a Displacement,
    field: Sampler<'a>,
    space: Space,
    side: u8,
}

impl<'a> OneSided<'a> {
    fn new(displacement: &'a Displacement, space: Space, side: u8) -> Self {
        let field: &FieldBricks = match space {
            Space::Rest => displacement.forward(),
            Space::Deformed => displacement.inverse(),
        };
        Self { displacement, field: Sampler::new(field, displacement.grid()), space, side }
    }

    /// The side of a voxel; beyond the grid that of the nearest border voxel, and `None` where nothing has come to.
    fn side_of(&self, at: [i64; 3]) -> Option<u8> {
        let grid = self.displacement.grid();
        let last = grid.dims().map(|n| n as i64 - 1);
        let voxel = grid.linear(VoxelIndex(std::array::from_fn(|a| at[a].clamp(0, last[a]) as usize)));
        let flags = self.displacement.sides().get(voxel).copied().unwrap_or(0);
        match self.space {
            Space::Rest => Some(flags & 3),
            Space::Deformed => {
                let left = self.displacement.vacated().get(voxel).is_some_and(|flag| *flag != 0);
                (!left).then_some(flags >> 2)
            }
        }
    }

    /// The side that the voxels round a place are on, the nearer ones before the others; 0 where no side matters.
    fn side_at(&self, place: Vector3<f64>) -> u8 {
        if !self.displacement.has_cut() {
            return 0;
        }
        let (cell, within) = self.field.locate(place);
        let mut weights = [0.0; 4];
        for corner in 0..8 {
            let weight = (0..3)
                .map(|a| if corner >> a & 1 == 1 { within[a] } else { 1.0 - within[a] })
                .product::<f64>();
            if let Some(side) = self.side_of(corner_of(cell, corner)) {
                weights[usize::from(side)] += weight;
            }
        }
        match weights {
            [_, below, above, _] if below == 0.0 && above == 0.0 => 0,
            [_, below, above, _] => 1 + u8::from(above >= below),
        }
    }

    /// The vector at a place (voxels).
    fn at(&self, place: Vector3<f64>) -> Vector3<f64> {
        let (cell, within) = self.field.locate(place);
        interpolate(&self.corners(cell), within)
    }

    /// Whether the side has a voxel in the cell of a place.
    fn knows(&self, place: Vector3<f64>) -> bool {
        let (cell, _) = self.field.locate(place);
        self.side == 0 || (0..8).any(|corner| self.counts(corner_of(cell, corner)))
    }

    fn counts(&self, voxel: [i64; 3]) -> bool {
        self.side_of(voxel).is_some_and(|side| [0, self.side].contains(&side))
    }

    /// The vectors at the corners of a cell; those of voxels that don't count go on from those that do.
    fn corners(&self, cell: [i64; 3]) -> Corners {
        let known = self.field.corners(cell);
        if self.side == 0 {
            return known;
        }
        let own: [bool; 8] = std::array::from_fn(|corner| self.counts(corner_of(cell, corner)));
        if own.iter().all(|own| *own) || !own.iter().any(|own| *own) {
            return known;
        }
        std::array::from_fn(|corner| {
            if own[corner] { known[corner] } else { self.going_on(cell, corner, &known, own) }
        })
    }

    /// What a corner would have if its side went on: straight on along the axes where two voxels say how, else as the next corners.
    fn going_on(&self, cell: [i64; 3], corner: usize, known: &Corners, own: [bool; 8]) -> Vector3<f64> {
        let here = corner_of(cell, corner);
        let beside = || (0..3).map(|a| corner ^ (1 << a)).filter(|near| own[*near]);
        let straight = beside().filter_map(|near| {
            let next = corner_of(cell, near);
            let further = std::array::from_fn(|a| 2 * next[a] - here[a]);
            self.counts(further).then(|| known[near] * 2.0 - self.field.voxel(further))
        });
        mean(straight)
            .or_else(|| mean(beside().map(|near| known[near])))
            .or_else(|| mean((0..8).filter(|other| own[*other]).map(|other| known[other])))
            .unwrap_or(known[corner])
    }
}

/// The voxel at a corner of a cell: x in bit 0, y in bit 1, z in bit 2.
fn corner_of(cell: [i64; 3], corner: usize) -> [i64; 3] {
    std::array::from_fn(|a| cell[a] + (corner >> a & 1) as i64)
}

fn mean(vectors: impl Iterator<Item = Vector3<f64>>) -> Option<Vector3<f64>> {
    let (sum, count) = vectors.fold((Vector3::zeros(), 0), |(sum, count), one| (sum + one, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, noise};

    use super::*;
    use crate::fixtures::{displacement, field, voxels};

    /// The plane of the cut (voxels along z).
    const CUT: f64 = 11.7;

    /// A cut by a plane, whose sides go apart by an affine map each: forward, of a place on a side.
    fn apart(place: Vector3<f64>, side: f64) -> Vector3<f64> {
        let along = 2.0 + 0.04 * (place.x - 12.0);
        Vector3::new(0.05 * side * (place.y - 12.0), 0.0, side * along + 0.1 * (place.z - CUT))
    }

    fn side_of(height: f64) -> usize {
        usize::from(height >= CUT)
    }

    /// Both maps over the whole grid, put together as cuts are.
    fn cut_open() -> Displacement {
        let grid = Grid::with_spacing([24; 3], [1.0; 3]).unwrap();
        let maps = [-1.0, 1.0].map(|side| {
            let forward = field(&grid, |place| apart(place, side));
            displacement(&grid, forward)
        });
        let (mut sides, mut vacated) = (vec![0; grid.len()], vec![0; grid.len()]);
        let forward = field(&grid, |place| apart(place, [-1.0, 1.0][side_of(place.z)]));
        for voxel in voxels(&grid) {
            let i = grid.linear(voxel);
            sides[i] = 1 + side_of(voxel.0[2] as f64) as u8;
            let from = [0, 1].map(|s| voxel.0[2] as f64 + f64::from(maps[s].inverse().at(voxel)[2]));
            match [side_of(from[0]) == 0, side_of(from[1]) == 1] {
                [true, _] => sides[i] |= 1 << 2,
                [_, true] => sides[i] |= 2 << 2,
                _ => vacated[i] = 1,
            }
        }
        let inverse = field(&grid, |place| {
            let voxel = VoxelIndex([place.x as usize, place.y as usize, place.z as usize]);
            let own = usize::from(sides[grid.linear(voxel)] >> 2 == 2);
            Vector3::from(maps[own].inverse().at(voxel)).map(f64::from)
        });
        Displacement::new(grid, forward, inverse)
            .unwrap()
            .with_vacated(vacated.into())
            .unwrap()
            .with_sides(sides.into())
            .unwrap()
    }

    #[test]
    fn beside_a_cut_a_place_comes_from_its_own_side() {
        let cut = cut_open();
        let mut nearest = [f64::INFINITY; 2];
        for i in 0..4000_u64 {
            let part = |k: u64| noise::unit(5, 3 * i + k);
            // Half of them within a voxel of the cut.
            let height = if i % 2 == 0 { CUT - 1.0 + 2.0 * part(2) } else { 6.0 + 12.0 * part(2) };
            let rest = Vector3::new(6.0 + 12.0 * part(0), 6.0 + 12.0 * part(1), height);
            let side = side_of(height);
            nearest[side] = nearest[side].min((height - CUT).abs());
            let now = rest + apart(rest, [-1.0, 1.0][side]);
            let back = at_rest(&cut, VoxelCoord(now)).0;
            assert!((back - rest).norm() < 1e-3, "{rest} went to {now} and came back to {back}");
            // Of its own voxels' side it goes where that goes.
            if side_of(height.round()) == side {
                let there = moved(&cut, VoxelCoord(rest)).0;
                assert!((there - now).norm() < 1e-4, "{rest} goes to {there}, not to {now}");
            }
        }
        assert!(nearest.iter().all(|nearest| *nearest < 0.01), "{nearest:?}");
    }

    #[test]
    fn without_a_cut_it_is_the_field_itself() {
        let grid = Grid::with_spacing([24; 3], [1.0; 3]).unwrap();
        let bump = crate::fixtures::bump(Vector3::new(11.0, 12.0, 12.5), 9.0, Vector3::new(1.5, -0.5, 1.0));
        let whole = displacement(&grid, field(&grid, bump));
        let forward = Sampler::new(whole.forward(), &grid);
        for i in 0..500_u64 {
            let rest = Vector3::from_fn(|k, _| 3.0 + 17.0 * noise::unit(9, 3 * i + k as u64));
            let now = moved(&whole, VoxelCoord(rest));
            assert_eq!(now.0, rest + forward.at(rest));
            assert!((at_rest(&whole, now).0 - rest).norm() < 1e-4);
        }
    }
}
