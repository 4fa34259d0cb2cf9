//! Colours over slices: how far what is seen has come, and how its volume has changed.

use ivd_core::{Displacement, VoxelIndex};
use ivd_render::scale::{colour_at, mixed, rounded_up};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Colours of changes of volume, by octaves, the same for what grows but red and yellow: what has changed by a few percent is blue or red already, what by
/// more than any matter does is violet or yellow in the end.
const SQUEEZED: [(f64, [u8; 3]); 4] =
    [(0.0, [247, 247, 247]), (0.3, [90, 160, 235]), (1.0, [20, 70, 190]), (3.0, [170, 40, 220])];
const STRETCHED: [(f64, [u8; 3]); 4] =
    [(0.0, [247, 247, 247]), (0.3, [250, 140, 110]), (1.0, [190, 20, 40]), (3.0, [255, 215, 60])];
/// Octaves at the end of their scale.
const MOST: f64 = 3.0;
/// How much of a pixel is its colour at most.
const OPAQUE: f64 = 0.7;
/// How much of a pixel is the colour of its class.
const CLASS: f64 = 0.4;
/// From this share of the scale on the colour of a motion is whole; before that it fades in.
const WHOLE: f64 = 0.15;
/// From so many octaves on that of a change is.
const WHOLE_CHANGE: f64 = 0.3;
/// What is darker than this grey fades out: of air nobody asks where it has gone.
const SEEN: f64 = 24.0;
/// From dark to light, for any colour vision: a few of viridis (van der Walt and Smith 2015).
const MOTION: [[u8; 3]; 5] = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

/// What colours over slices tell of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Overlay {
    /// How far what is seen there has come.
    Motion,
    /// By how many times its volume has grown.
    Volume,
    /// Of which class it is, in the colours that classes have in the volume.
    Classes,
}

impl Overlay {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Volume, Self::Classes];

    /// How it is called in a window.
    pub fn word(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Volume => "change of volume",
            Self::Classes => "classes",
        }
    }

    /// Its scale; none of classes, which have colours of their own.
    ///
    /// - `largest_mm`: the longest motion.
    pub fn scale(self, largest_mm: f64) -> Option<Scale> {
        match self {
            Self::Motion => {
                let ends = [0.0, rounded_up(largest_mm.max(0.01))];
                Some(Scale { ends, unit: "mm", goes_on: false })
            }
            // Squeezed is blue, and violet in the end; stretched is red, and yellow. Always the same, so that pictures can be compared.
            Self::Volume => {
                let ends = [(-MOST).exp2(), MOST.exp2()];
                Some(Scale { ends, unit: "times the volume", goes_on: true })
            }
            Self::Classes => None,
        }
    }

    /// A pixel of a slice with its colour over it.
    ///
    /// - `class`: the colour of a voxel's class, where it has one and lies deformed there.
    pub(crate) fn over(
        self,
        displacement: &Displacement,
        largest_mm: f64,
        class: impl Fn([usize; 3]) -> Option<[u8; 3]>,
        voxel: [usize; 3],
        grey: u8,
    ) -> [u8; 3] {
        let Some(scale) = self.scale(largest_mm) else {
            let is_matter = !is_vacated(displacement, voxel);
            return tinted(grey, is_matter.then(|| class(voxel)).flatten());
        };
        let Some(value) = self.value(displacement, voxel) else { return [grey; 3] };
        // From where nothing has happened to the end of the scale.
        let (share, far) = if self == Self::Motion {
            let share = value / scale.ends[1];
            (share, share / WHOLE)
        } else {
            let octaves = value.log2();
            (0.5 + 0.5 * octaves / MOST, octaves.abs() / WHOLE_CHANGE)
        };
        let weight = OPAQUE * far.clamp(0.0, 1.0) * (f64::from(grey) / SEEN).min(1.0);
        mixed([grey; 3], scale.colour(share), weight)
    }

    /// Whether what is so bright has a colour to be seen.
    pub(crate) fn is_coloured(grey: u8) -> bool {
        f64::from(grey) >= SEEN
    }

    /// What a scale tells of a deformed voxel; nothing where a cut has opened.
    pub(crate) fn value(self, displacement: &Displacement, voxel: [usize; 3]) -> Option<f64> {
        if is_vacated(displacement, voxel) {
            return None;
        }
        match self {
            Self::Motion => Some(vector(displacement, voxel).norm()),
            Self::Volume => {
                Some(times(displacement, voxel)).filter(|times| times.is_finite() && *times > 0.0)
            }
            Self::Classes => None,
        }
    }
}

/// What colours mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Values at both ends.
    pub ends: [f64; 2],
    /// Of what.
    pub unit: &'static str,
    /// Whether it is one of changes, by octaves: values go on beyond the ends, in the colours of the ends.
    goes_on: bool,
}

impl Scale {
    /// Its ends in words.
    pub fn told(self) -> String {
        let ([low, high], unit) = (self.ends.map(|end| (end * 1e6).round() / 1e6), self.unit);
        if self.goes_on {
            format!("≤ {low} to ≥ {high} {unit}")
        } else {
            format!("{low} to {high} {unit}")
        }
    }

    /// The colour at a share of the scale, 0 … 1; beyond its ends that of the end.
    pub fn colour(self, share: f64) -> [u8; 3] {
        if !self.goes_on {
            return colour_at(&MOTION, share);
        }
        let octaves = (2.0 * share.clamp(0.0, 1.0) - 1.0) * MOST;
        let stops = if octaves < 0.0 { SQUEEZED } else { STRETCHED };
        let next = stops.iter().position(|(at, _)| *at >= octaves.abs()).unwrap_or(stops.len() - 1).max(1);
        let [(from, first), (to, last)] = [stops[next - 1], stops[next]];
        mixed(first, last, (octaves.abs() - from) / (to - from))
    }
}

/// A grey with the colour of its class over it, where it has one.
pub(crate) fn tinted(grey: u8, class: Option<[u8; 3]>) -> [u8; 3] {
    class.map_or([grey; 3], |colour| mixed([grey; 3], colour, CLASS))
}

/// From where a deformed voxel comes (mm, RAS).
fn vector(displacement: &Displacement, voxel: [usize; 3]) -> Vector3<f64> {
    Vector3::from(displacement.inverse().at(VoxelIndex(voxel))).map(f64::from)
}

fn flag(displacement: &Displacement, flags: &[u8], voxel: [usize; 3]) -> u8 {
    flags.get(displacement.grid().linear(VoxelIndex(voxel))).copied().unwrap_or(0)
}

fn is_vacated(displacement: &Displacement, voxel: [usize; 3]) -> bool {
    flag(displacement, displacement.vacated(), voxel) != 0
}

/// By how many times the volume about a deformed voxel has grown: one over the determinant of the way back, by differences to the neighbours on its side of a cut.
fn times(displacement: &Displacement, voxel: [usize; 3]) -> f64 {
    let (grid, here) = (displacement.grid(), vector(displacement, voxel));
    let side = |voxel| flag(displacement, displacement.sides(), voxel) >> 2 & 3;
    let beside = |a: usize, by: isize| {
        let mut other = voxel;
        other[a] = voxel[a].checked_add_signed(by).filter(|at| *at < grid.dims()[a])?;
        let is_apart = (side(voxel) | side(other)) == 3 || is_vacated(displacement, other);
        (!is_apart).then(|| vector(displacement, other))
    };
    let columns = [0, 1, 2].map(|a| match [beside(a, -1), beside(a, 1)] {
        [Some(before), Some(after)] => (after - before) / 2.0,
        [None, Some(after)] => after - here,
        [Some(before), None] => here - before,
        [None, None] => Vector3::zeros(),
    });
    let change = Matrix3::from_columns(&columns) * grid.inverse_linear_part();
    1.0 / (Matrix3::identity() + change).determinant()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{FieldBricks, Grid};

    /// What lies at `y` comes from `y / times`, all along the first axis.
    fn stretched(times: f64) -> Displacement {
        let grid = Grid::with_spacing([16, 8, 8], [2.0; 3]).unwrap();
        let vectors = |sign: f64, factor: f64| {
            let mut vectors = Vec::new();
            for brick in 0..2 {
                for slot in 0..512 {
                    let x = 2.0 * (8 * brick + slot % 8) as f64;
                    vectors.push([(sign * factor * x) as f32, 0.0, 0.0]);
                }
            }
            FieldBricks::of_bricks([16, 8, 8], &[0, 1], vectors.into()).unwrap()
        };
        Displacement::new(grid, vectors(1.0, times - 1.0), vectors(-1.0, 1.0 - 1.0 / times)).unwrap()
    }

    #[test]
    fn a_stretch_has_its_length_and_its_change_of_volume_everywhere() {
        for by in [1.25, 0.8, 1.0] {
            let displacement = stretched(by);
            for voxel in [[0, 0, 0], [7, 3, 2], [15, 7, 7]] {
                let volume = Overlay::Volume.value(&displacement, voxel).unwrap();
                assert!((volume - by).abs() < 1e-5, "{volume} at {voxel:?}");
                let length = Overlay::Motion.value(&displacement, voxel).unwrap();
                assert!((length - (2.0 * voxel[0] as f64) * (1.0 - 1.0 / by).abs()).abs() < 1e-5);
            }
        }
        let still = stretched(1.0);
        let red = |voxel: [usize; 3]| (voxel[0] == 4).then_some([255, 0, 0]);
        for overlay in Overlay::ALL {
            let over = |voxel| overlay.over(&still, 0.0, red, voxel, 77);
            assert_eq!(over([5, 4, 4]), [77; 3], "what rests has no colour");
            let has_class = overlay == Overlay::Classes;
            assert_eq!(over([4; 3]), if has_class { [148, 46, 46] } else { [77; 3] });
        }
    }

    #[test]
    fn a_linear_motion_on_an_oblique_grid_has_its_determinant_and_a_cut_keeps_to_its_sides() {
        // Axes turned by about 30°, voxels of three lengths.
        let (s, c) = 0.5_f64.sin_cos();
        let axes = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]];
        let grid = Grid::new([16, 8, 8], [1.0, 2.0, 0.5], [5.0, -3.0, 40.0], axes).unwrap();
        let way_back = Matrix3::new(0.1, 0.3, -0.05, -0.02, -0.15, 0.2, 0.07, 0.0, 0.25);
        let fill = |of: &dyn Fn([usize; 3]) -> Vector3<f64>| {
            let mut vectors = Vec::new();
            for brick in 0..2 {
                for slot in 0..512 {
                    let voxel = [8 * brick + slot % 8, slot / 8 % 8, slot / 64];
                    let v = of(voxel);
                    vectors.push([v.x as f32, v.y as f32, v.z as f32]);
                }
            }
            FieldBricks::of_bricks([16, 8, 8], &[0, 1], vectors.into()).unwrap()
        };
        let place = |voxel: [usize; 3]| grid.world(VoxelIndex(voxel).into()).0;
        let linear = |voxel| way_back * place(voxel);
        let truth = 1.0 / (Matrix3::identity() + way_back).determinant();
        let whole = Displacement::new(grid.clone(), fill(&|_| Vector3::zeros()), fill(&linear)).unwrap();
        for voxel in [[0, 0, 0], [7, 3, 2], [8, 4, 4], [15, 7, 7]] {
            let told = Overlay::Volume.value(&whole, voxel).unwrap();
            assert!((told - truth).abs() < 1e-4, "{told} at {voxel:?} for {truth}");
        }
        // Cut between the seventh and the eighth: the lips are 6 mm apart, a voxel between them is vacated.
        let cut = |voxel: [usize; 3]| linear(voxel) + Vector3::x() * if voxel[0] > 7 { -3.0 } else { 3.0 };
        let flags = |of: &dyn Fn([usize; 3]) -> u8| -> Vec<u8> {
            (0..grid.len()).map(|i| of(grid.index(i).0)).collect()
        };
        let is_gap = |voxel: [usize; 3]| voxel[0] == 7;
        let sides = flags(&|voxel| if voxel[0] > 7 { 2 << 2 } else { 1 << 2 });
        let vacated = flags(&|voxel| u8::from(is_gap(voxel)));
        let parted = Displacement::new(grid.clone(), fill(&|_| Vector3::zeros()), fill(&cut)).unwrap();
        let parted = parted.with_vacated(vacated.into()).unwrap().with_sides(sides.into()).unwrap();
        for voxel in [[6, 3, 2], [8, 3, 2], [5, 0, 7], [9, 7, 0]] {
            let told = Overlay::Volume.value(&parted, voxel).unwrap();
            assert!((told - truth).abs() < 1e-4, "{told} at {voxel:?} beside the cut, for {truth}");
        }
        for overlay in Overlay::ALL {
            assert_eq!(overlay.value(&parted, [7, 3, 2]), None);
        }
    }

    #[test]
    fn scales_have_round_ends_and_colours_their_own() {
        let scale = |of: Overlay, most| of.scale(most).unwrap();
        let ends = [0.0, 0.011, 1.0, 1.2, 4.9, 12.0, 60.0].map(|most| scale(Overlay::Motion, most).ends[1]);
        let wanted = [0.01, 0.02, 1.0, 2.0, 5.0, 20.0, 100.0];
        assert!(ends.iter().zip(wanted).all(|(end, wanted)| (end - wanted).abs() < 1e-9), "{ends:?}");
        assert_eq!(scale(Overlay::Volume, 9.0).ends, [0.125, 8.0]);
        assert_eq!(scale(Overlay::Volume, 9.0).told(), "≤ 0.125 to ≥ 8 times the volume");
        let colours = |of: Overlay, shares: [f64; 2]| shares.map(|share| scale(of, 1.0).colour(share));
        assert_eq!(colours(Overlay::Motion, [-1.0, 0.0]), [MOTION[0]; 2]);
        // An octave is a sixth of the scale: half the volume, and twice as much.
        assert_eq!(colours(Overlay::Volume, [1.0 / 3.0, 2.0 / 3.0]), [SQUEEZED[2].1, STRETCHED[2].1]);
        assert_eq!(colours(Overlay::Volume, [-1.0, 2.0]), [SQUEEZED[3].1, STRETCHED[3].1]);
        assert_eq!(colours(Overlay::Volume, [0.5, 0.5 + 1e-9]), [SQUEEZED[0].1; 2]);
        // What is squeezed more is never of the colour of what is squeezed less.
        let all = (0..=80).map(|step| scale(Overlay::Volume, 1.0).colour(f64::from(step) / 80.0));
        let all: std::collections::BTreeSet<_> = all.collect();
        assert_eq!(all.len(), 81);
        assert!(Overlay::Classes.scale(1.0).is_none());
    }
}
