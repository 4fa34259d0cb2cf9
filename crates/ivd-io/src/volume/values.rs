use std::io::Write;
use std::path::Path;

use ivd_core::{Exec, Scalar, Volume, VoxelType, with_voxels};

use crate::order::swap_in_place;
use crate::volume::data::data_beside;
use crate::volume::replace::{put, replace};
use crate::volume::{ByteOrder, Error, Written};

/// Bytes written between two looks at the cancel flag.
const CHUNK: usize = 1 << 20;

/// What a format keeps of a volume's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Values {
    /// The stored voxels; slope and intercept are in the header, or (1, 0).
    Stored,
    /// Real values, in this type.
    Real(VoxelType),
}

/// Types for whole numbers, the smallest first.
const WHOLE: [VoxelType; 6] =
    [VoxelType::U8, VoxelType::I8, VoxelType::I16, VoxelType::U16, VoxelType::I32, VoxelType::U32];

impl Values {
    /// For a format without slope and intercept: real values where the two change anything. They are whole numbers where the
    /// intercept only shifts whole numbers, as of a CT, else floats.
    pub(crate) fn without_scale(volume: &Volume) -> Self {
        if volume.slope() == 1.0 && volume.intercept() == 0.0 {
            return Self::Stored;
        }
        Self::Real(shifted(volume).unwrap_or_else(|| float(volume)))
    }

    /// For a format that keeps slope and intercept, in `f32` or in `f64`, with the two that it is to say: the stored voxels where no
    /// value that is there comes out different by [`tolerance`], else as in a format without.
    pub(crate) fn with_scale(volume: &Volume, in_f32: bool) -> (Self, [f64; 2]) {
        let plain = Self::without_scale(volume);
        let exact = [volume.slope(), volume.intercept()];
        let [slope, intercept] = if in_f32 { exact.map(|v| f64::from(v as f32)) } else { exact };
        let keeps = || {
            let range = volume.stored_range().unwrap_or_default();
            let [low, high] = range.map(|v| (slope * v + intercept - volume.real(v)).abs());
            let error = low.max(high);
            // A slope that isn't normal says something else to other programs, or nothing.
            (slope as f32).is_normal() && (error == 0.0 || error < tolerance(volume))
        };
        match plain {
            Self::Real(to) if !to.is_integer() && keeps() => (Self::Stored, [slope, intercept]),
            _ => (plain, [1.0, 0.0]),
        }
    }

    /// Type of the written voxels.
    pub(crate) fn voxel_type(self, volume: &Volume) -> VoxelType {
        match self {
            Self::Stored => volume.voxel_type(),
            Self::Real(to) => to,
        }
    }

    /// Writes the voxels, least significant byte first, without a second whole copy of them.
    pub(crate) fn write(
        self,
        to: &mut dyn Write,
        path: &Path,
        volume: &Volume,
        exec: &Exec,
    ) -> Result<(), Error> {
        match self {
            Self::Stored => stored(to, path, volume, exec),
            Self::Real(VoxelType::U8) => real::<u8>(to, path, volume, exec),
            Self::Real(VoxelType::I8) => real::<i8>(to, path, volume, exec),
            Self::Real(VoxelType::U16) => real::<u16>(to, path, volume, exec),
            Self::Real(VoxelType::I16) => real::<i16>(to, path, volume, exec),
            Self::Real(VoxelType::U32) => real::<u32>(to, path, volume, exec),
            Self::Real(VoxelType::I32) => real::<i32>(to, path, volume, exec),
            Self::Real(VoxelType::F32) => real::<f32>(to, path, volume, exec),
            Self::Real(VoxelType::F64) => real::<f64>(to, path, volume, exec),
        }
    }

    /// Writes a file of a header and the voxels; or, where its ending says that it is `detached`, of the header alone, with the voxels in a file beside it.
    ///
    /// - `header`: the text, with the name of the file of the voxels, where they have one.
    pub(crate) fn write_with_header(
        self,
        path: &Path,
        detached: &str,
        header: impl Fn(Option<&str>) -> String,
        volume: &Volume,
        exec: &Exec,
    ) -> Result<Written, Error> {
        if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(detached)) {
            return replace(path, |to| {
                put(to, path, header(None).as_bytes())?;
                self.write(to, path, volume, exec)
            });
        }
        let data = data_beside(path);
        let name = data.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // The voxels first: a header never names voxels that aren't there.
        let voxels = replace(&data, |to| self.write(to, &data, volume, exec))?;
        let head = replace(path, |to| put(to, path, header(Some(&name)).as_bytes()))?;
        Ok(voxels.and(head))
    }
}

/// How far a value may come out from `slope · stored + intercept`: half a step of whole numbers, the last digit of floats.
fn tolerance(volume: &Volume) -> f64 {
    let largest = volume.stored_range().unwrap_or_default().map(f64::abs).into_iter().fold(0.0, f64::max);
    let digit = match volume.voxel_type() {
        VoxelType::F32 => f64::from(f32::EPSILON) * largest,
        VoxelType::F64 => f64::EPSILON * largest,
        _ => 0.5,
    };
    volume.slope().abs() * digit
}

/// The type of a volume of whole numbers that an intercept shifts by a whole number: its own where that holds them all, else the
/// smallest that does.
fn shifted(volume: &Volume) -> Option<VoxelType> {
    let own = volume.voxel_type();
    if !own.is_integer() || volume.slope() != 1.0 || volume.intercept().fract() != 0.0 {
        return None;
    }
    let range = volume.range().unwrap_or_default();
    std::iter::once(own).chain(WHOLE).find(|&to| holds_whole(to, range))
}

/// Whether a type of whole numbers holds all from the first to the second.
fn holds_whole(to: VoxelType, [low, high]: [f64; 2]) -> bool {
    let [least, most] = match to {
        VoxelType::U8 => [0.0, f64::from(u8::MAX)],
        VoxelType::I8 => [f64::from(i8::MIN), f64::from(i8::MAX)],
        VoxelType::U16 => [0.0, f64::from(u16::MAX)],
        VoxelType::I16 => [f64::from(i16::MIN), f64::from(i16::MAX)],
        VoxelType::U32 => [0.0, f64::from(u32::MAX)],
        VoxelType::I32 => [f64::from(i32::MIN), f64::from(i32::MAX)],
        VoxelType::F32 | VoxelType::F64 => return false,
    };
    least <= low && high <= most
}

/// `f32` where rounding to it stays below [`tolerance`], else `f64`.
fn float(volume: &Volume) -> VoxelType {
    let largest = volume.range().unwrap_or_default().map(f64::abs).into_iter().fold(0.0, f64::max);
    let last_digit = (largest * f64::from(f32::EPSILON)).max(f64::from(f32::from_bits(1)));
    let rounding = last_digit / 2.0;
    let fits = rounding < tolerance(volume) && largest <= f64::from(f32::MAX);
    if fits || largest == 0.0 { VoxelType::F32 } else { VoxelType::F64 }
}

/// Real values of stored ones, in a type that holds them.
pub(crate) fn reals<T: Scalar, S: Scalar>(volume: &Volume, stored: &[S]) -> Vec<T> {
    stored.iter().map(|v| T::from_f64(volume.real(v.to_f64()))).collect()
}

fn stored(to: &mut dyn Write, path: &Path, volume: &Volume, exec: &Exec) -> Result<(), Error> {
    let width = volume.voxel_type().bytes();
    for part in volume.voxels().as_bytes().chunks(CHUNK) {
        exec.check_cancelled()?;
        put_numbers(to, path, part, width)?;
    }
    Ok(())
}

fn real<T: Scalar>(to: &mut dyn Write, path: &Path, volume: &Volume, exec: &Exec) -> Result<(), Error> {
    with_voxels!(volume.voxels(), slice => {
        for part in slice.chunks(CHUNK / size_of::<T>()) {
            exec.check_cancelled()?;
            let values: Vec<T> = reals(volume, part);
            put_numbers(to, path, bytemuck::cast_slice(&values), size_of::<T>())?;
        }
    });
    Ok(())
}

/// Writes numbers of `width` bytes, which are in this machine's order.
fn put_numbers(to: &mut dyn Write, path: &Path, bytes: &[u8], width: usize) -> Result<(), Error> {
    if !ByteOrder::Little.is_foreign() {
        return put(to, path, bytes);
    }
    let mut swapped = bytes.to_vec();
    swap_in_place(&mut swapped, width);
    put(to, path, &swapped)
}

#[cfg(test)]
mod tests {
    use ivd_core::{Grid, Voxels};

    use super::*;

    fn volume(voxels: impl Into<Voxels>, slope: f64, intercept: f64) -> Volume {
        let voxels = voxels.into();
        let grid = Grid::with_spacing([voxels.len(), 1, 1], [1.0; 3]).unwrap();
        Volume::with_scale(grid, voxels, slope, intercept).unwrap()
    }

    #[test]
    fn whole_numbers_that_are_shifted_stay_whole_in_their_own_type_where_it_holds_them() {
        let of = |volume: Volume| Values::without_scale(&volume);
        assert_eq!(of(volume(vec![0_i16, 4095], 1.0, 0.0)), Values::Stored);
        assert_eq!(of(volume(vec![0_i16, 4095], 1.0, -1024.0)), Values::Real(VoxelType::I16));
        assert_eq!(of(volume(vec![0_u16, 4095], 1.0, -1024.0)), Values::Real(VoxelType::I16));
        assert_eq!(of(volume(vec![2000_u16, 4095], 1.0, -1024.0)), Values::Real(VoxelType::U16));
        assert_eq!(of(volume(vec![0_u16, 60_000], 1.0, -1024.0)), Values::Real(VoxelType::I32));
        assert_eq!(of(volume(vec![0_u8, 255], 1.0, 1.0)), Values::Real(VoxelType::I16));
        assert_eq!(of(volume(vec![0_u8, 200], 1.0, 1.0)), Values::Real(VoxelType::U8));
        assert_eq!(of(volume(vec![0_u32, u32::MAX], 1.0, -1.0)), Values::Real(VoxelType::F64));
        assert_eq!(of(volume(vec![0_i16, 1], 1.0, -0.5)), Values::Real(VoxelType::F32));
        assert_eq!(of(volume(vec![0.0_f32, 1.0], 1.0, -1.0)), Values::Real(VoxelType::F32));
    }

    #[test]
    fn a_slope_is_kept_in_f32_only_while_no_value_moves_by_half_a_step() {
        let of = |volume: Volume| Values::with_scale(&volume, true);
        let slope = 2.022_241_4;
        assert_eq!(
            of(volume(vec![0_i16, i16::MAX], slope, 0.0)),
            (Values::Stored, [f64::from(slope as f32), 0.0])
        );
        assert_eq!(
            Values::with_scale(&volume(vec![7_i16], slope, 0.1), false),
            (Values::Stored, [slope, 0.1])
        );
        // 1 + 2⁻²⁵ becomes 1: at v the difference is v · 2⁻²⁵, half a step just beyond 2²⁴.
        let barely = 1.0 + 2.0_f64.powi(-25);
        assert_eq!(of(volume(vec![0, 1_i32 << 24], barely, 0.0)).0, Values::Stored);
        assert_eq!(
            of(volume(vec![0, (1_i32 << 24) + 1], barely, 0.0)),
            (Values::Real(VoxelType::F64), [1.0, 0.0])
        );
        assert_eq!(of(volume(vec![-(1_i32 << 24) - 1, 0], barely, 0.0)).0, Values::Real(VoxelType::F64));
        // The intercept is 2⁻²⁴ beside what f32 holds near 1: many steps of this slope.
        let between = 1.0 + 2.0_f64.powi(-24);
        assert_eq!(of(volume(vec![0_i16, 100], 1e-8, between)).0, Values::Real(VoxelType::F64));
        assert_eq!(of(volume(vec![0_i16, 100], 1e-6, between)).0, Values::Stored);
        // Slopes that f32 makes 0, subnormal or infinite.
        for (slope, to) in [(1e-300, VoxelType::F64), (1e-40, VoxelType::F32), (1e300, VoxelType::F64)] {
            let (values, scale) = of(volume(vec![0_i16, 100], slope, 0.0));
            assert_eq!((values, scale), (Values::Real(to), [1.0, 0.0]), "{slope}");
        }
        assert_eq!(of(volume(vec![0_i16, 4095], 1.0, -1024.0)), (Values::Real(VoxelType::I16), [1.0, 0.0]));
        assert_eq!(of(volume(vec![1.0_f32, 3.0], 0.1, 0.0)).0, Values::Stored, "within the last digit");
    }

    #[test]
    fn real_values_are_those_of_the_plain_formula() {
        let volume = volume(vec![-300_i16, 0, 77, 4095], 0.1, 1.0 / 3.0);
        let mut bytes = Vec::new();
        Values::Real(VoxelType::F64).write(&mut bytes, Path::new("a"), &volume, &Exec::default()).unwrap();
        let found: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        assert_eq!(found, [-300.0, 0.0, 77.0, 4095.0].map(|v| 0.1 * v + 1.0 / 3.0));
    }
}
