use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::{Buffer, with_voxels};

/// Type of a stored voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VoxelType {
    /// Unsigned 8 bit.
    U8,
    /// Signed 8 bit.
    I8,
    /// Unsigned 16 bit.
    U16,
    /// Signed 16 bit.
    I16,
    /// Unsigned 32 bit.
    U32,
    /// Signed 32 bit.
    I32,
    /// IEEE 754 single.
    F32,
    /// IEEE 754 double.
    F64,
}

impl VoxelType {
    /// Bytes of one voxel.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Name as written on the command line: `u8`, `i16`, `f32`, …
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::F32, Self::F64]
            .into_iter()
            .find(|t| t.name() == name)
    }

    /// Whether the values are integers.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// A voxel type that kernels can be generic over.
pub trait Scalar:
    bytemuck::Pod + PartialOrd + Send + Sync + std::fmt::Debug + Default + Into<f64> + 'static
{
    /// The stored type's tag.
    const TYPE: VoxelType;
    /// The value as `f64`; exact for every stored type.
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self.into()
    }
    /// The nearest value of the type (ties to even), clamped to its range; NaN becomes 0 in integer types.
    fn from_f64(value: f64) -> Self;
    /// Wraps a buffer of this type.
    fn wrap(buffer: Buffer<Self>) -> Voxels;
    /// False for NaN and the infinities: no data.
    fn is_data(self) -> bool;
}

/// The nearest whole number, ties to even, of what no integer type's range is beyond; larger ones as far away. A sum with 1.5 · 2⁵² has no
/// bits after the point: two additions, where not every processor can round.
#[inline(always)]
fn whole(value: f64) -> f64 {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (value.clamp(-1e12, 1e12) + SHIFT) - SHIFT
}

macro_rules! scalar {
    ($($type:ty, $tag:ident, $from:expr, $is_data:expr;)*) => {$(
        impl Scalar for $type {
            const TYPE: VoxelType = VoxelType::$tag;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                ($from)(value)
            }
            fn wrap(buffer: Buffer<Self>) -> Voxels {
                Voxels::$tag(buffer)
            }
            #[inline(always)]
            fn is_data(self) -> bool {
                ($is_data)(self)
            }
        }
        impl From<Vec<$type>> for Voxels {
            fn from(values: Vec<$type>) -> Self {
                Self::$tag(values.into())
            }
        }
    )*};
}

scalar! {
    u8, U8, |v: f64| whole(v) as u8, |_| true;
    i8, I8, |v: f64| whole(v) as i8, |_| true;
    u16, U16, |v: f64| whole(v) as u16, |_| true;
    i16, I16, |v: f64| whole(v) as i16, |_| true;
    u32, U32, |v: f64| whole(v) as u32, |_| true;
    i32, I32, |v: f64| whole(v) as i32, |_| true;
    f32, F32, |v: f64| v as f32, f32::is_finite;
    f64, F64, |v: f64| v, f64::is_finite;
}

/// Voxels of one stored type, linear, x fastest.
#[derive(Debug, Clone, PartialEq)]
pub enum Voxels {
    /// Unsigned 8 bit.
    U8(Buffer<u8>),
    /// Signed 8 bit.
    I8(Buffer<i8>),
    /// Unsigned 16 bit.
    U16(Buffer<u16>),
    /// Signed 16 bit.
    I16(Buffer<i16>),
    /// Unsigned 32 bit.
    U32(Buffer<u32>),
    /// Signed 32 bit.
    I32(Buffer<i32>),
    /// IEEE 754 single.
    F32(Buffer<f32>),
    /// IEEE 754 double.
    F64(Buffer<f64>),
}

/// Runs the same code on the buffer of whatever type.
macro_rules! each_buffer {
    ($voxels:expr, $buffer:ident => $body:expr) => {
        match $voxels {
            Voxels::U8($buffer) => $body,
            Voxels::I8($buffer) => $body,
            Voxels::U16($buffer) => $body,
            Voxels::I16($buffer) => $body,
            Voxels::U32($buffer) => $body,
            Voxels::I32($buffer) => $body,
            Voxels::F32($buffer) => $body,
            Voxels::F64($buffer) => $body,
        }
    };
}

impl Voxels {
    /// Number of voxels.
    pub fn len(&self) -> usize {
        with_voxels!(self, slice => slice.len())
    }

    /// Whether there is no voxel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Stored type.
    pub fn voxel_type(&self) -> VoxelType {
        match self {
            Self::U8(_) => VoxelType::U8,
            Self::I8(_) => VoxelType::I8,
            Self::U16(_) => VoxelType::U16,
            Self::I16(_) => VoxelType::I16,
            Self::U32(_) => VoxelType::U32,
            Self::I32(_) => VoxelType::I32,
            Self::F32(_) => VoxelType::F32,
            Self::F64(_) => VoxelType::F64,
        }
    }

    /// The voxels as bytes in memory order.
    pub fn as_bytes(&self) -> &[u8] {
        with_voxels!(self, slice => bytemuck::cast_slice(slice))
    }

    /// The stored value at a linear index, exact.
    #[inline]
    pub fn get(&self, linear: usize) -> f64 {
        with_voxels!(self, slice => slice[linear].to_f64())
    }

    /// [`Buffer::touch`] of some of them.
    pub(crate) fn touch(&self, linear: Range<usize>) {
        each_buffer!(self, buffer => buffer.touch(linear));
    }

    /// [`Buffer::damaged`].
    pub(crate) fn damaged(&self) -> bool {
        each_buffer!(self, buffer => buffer.damaged())
    }
}

/// Dispatches on the stored type of a [`Voxels`]: binds the typed slice and runs the same code for each type.
///
/// ```
/// use ivd_core::{Voxels, with_voxels};
/// let voxels = Voxels::from(vec![1_u16, 2, 3]);
/// let sum: f64 = with_voxels!(&voxels, slice => slice.iter().map(|&v| f64::from(v)).sum());
/// assert_eq!(sum, 6.0);
/// ```
#[macro_export]
macro_rules! with_voxels {
    ($voxels:expr, $slice:ident => $body:expr) => {
        match $voxels {
            $crate::Voxels::U8(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::I8(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::U16(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::I16(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::U32(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::I32(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::F32(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            $crate::Voxels::F64(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_to_integers_clamps_and_takes_ties_to_even() {
        assert_eq!(u8::from_f64(2.5), 2);
        assert_eq!(u8::from_f64(300.0), 255);
        assert_eq!(i16::from_f64(-40000.0), i16::MIN);
        assert_eq!(u8::from_f64(f64::NAN), 0);
    }

    #[test]
    fn whole_numbers_are_the_nearest_with_ties_to_even() {
        let halves = (-300..300).map(|i| f64::from(i) * 0.5);
        let near = halves.flat_map(|v| [v.next_down(), v, v.next_up()]);
        let ends = [255.5, 65_535.5, 2_147_483_647.5, 4_294_967_295.5].map(|v: f64| [v, -v]);
        for v in near.chain(ends.into_iter().flatten()).chain([1e-300, 1e11 + 0.5, -0.0]) {
            assert_eq!(whole(v), v.round_ties_even(), "{v}");
        }
        let huge = [1e20, f64::INFINITY, f64::MAX];
        assert!(huge.iter().all(|&v| u32::from_f64(v) == u32::MAX && i32::from_f64(-v) == i32::MIN));
        assert_eq!((u8::from_f64(f64::NAN), i16::from_f64(f64::NAN)), (0, 0));
    }
}
