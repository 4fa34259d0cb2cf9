use crate::order::ByteOrder;

/// A type of number as files name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    /// Bytes of one.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(crate) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// The number in `bytes`, of which there are as many as it takes.
    #[inline]
    pub(crate) fn real(self, bytes: &[u8], order: ByteOrder) -> f64 {
        match self {
            Self::F32 => f64::from(f32::from_bits(raw(bytes, order) as u32)),
            Self::F64 => f64::from_bits(raw(bytes, order)),
            Self::U64 => raw(bytes, order) as f64,
            _ => self.integer(bytes, order) as f64,
        }
    }

    /// The same as an integer; 64-bit ones beyond `i64` become its largest, which no index is.
    #[inline]
    pub(crate) fn integer(self, bytes: &[u8], order: ByteOrder) -> i64 {
        let raw = raw(bytes, order);
        match self {
            Self::I8 => i64::from(raw as i8),
            Self::I16 => i64::from(raw as i16),
            Self::I32 => i64::from(raw as i32),
            Self::I64 => raw as i64,
            Self::U64 => i64::try_from(raw).unwrap_or(i64::MAX),
            Self::U8 | Self::U16 | Self::U32 => raw as i64,
            Self::F32 | Self::F64 => self.real(bytes, order) as i64,
        }
    }
}

#[inline]
fn raw(bytes: &[u8], order: ByteOrder) -> u64 {
    let fold = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
    match order {
        ByteOrder::Little => bytes.iter().rev().fold(0, fold),
        ByteOrder::Big => bytes.iter().fold(0, fold),
    }
}
