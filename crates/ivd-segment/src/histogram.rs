//! Exact histograms of 8 and 16 bit voxels.

use ivd_core::{Error, Exec, Kernel, Mask, Scalar, Voxels, parallel};

/// Voxels that one task counts; long enough to pay for its private tables.
const CHUNK: usize = 1 << 20;

/// The stored values that occur, ascending, and how often.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Histogram {
    pub(crate) values: Vec<i64>,
    pub(crate) counts: Vec<u64>,
}

/// An integer voxel small enough for a table over all its values.
pub(crate) trait Tabled: Scalar {
    /// Number of values.
    const VALUES: usize;
    /// Smallest value.
    const LOWEST: i64;
    /// Place of the value in a table that ascends with it.
    fn slot(self) -> usize;
}

macro_rules! tabled {
    ($($type:ty, $values:expr, $slot:expr;)*) => {$(
        impl Tabled for $type {
            const VALUES: usize = $values;
            const LOWEST: i64 = <$type>::MIN as i64;
            #[inline(always)]
            fn slot(self) -> usize {
                ($slot)(self)
            }
        }
    )*};
}

tabled! {
    u8, 256, |v: u8| v as usize;
    i8, 256, |v: i8| (v as u8 ^ 0x80) as usize;
    u16, 65536, |v: u16| v as usize;
    i16, 65536, |v: i16| (v as u16 ^ 0x8000) as usize;
}

/// Runs `$body` with the typed slice where the voxels have 8 or 16 bits, else `$otherwise`.
macro_rules! with_tabled {
    ($voxels:expr, $slice:ident => $body:expr, else $otherwise:expr) => {
        match $voxels {
            ivd_core::Voxels::U8(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            ivd_core::Voxels::I8(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            ivd_core::Voxels::U16(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            ivd_core::Voxels::I16(buffer) => {
                let $slice = buffer.as_slice();
                $body
            }
            _ => $otherwise,
        }
    };
}
pub(crate) use with_tabled;

/// The pass that counts how often each stored value of 8 or 16 bits occurs, ascending by value.
pub struct Counting;

/// What is counted.
#[derive(Clone, Copy)]
pub struct Counted<'a> {
    /// Voxels of 8 or 16 bits.
    pub voxels: &'a Voxels,
    /// Those that count, where not all do.
    pub mask: Option<&'a Mask>,
}

impl<'a> Counted<'a> {
    /// Voxels that can be counted so; `None` of wider types.
    pub fn new(voxels: &'a Voxels, mask: Option<&'a Mask>) -> Option<Self> {
        let kind = voxels.voxel_type();
        (kind.is_integer() && kind.bytes() <= 2).then_some(Self { voxels, mask })
    }
}

impl Kernel for Counting {
    const NAME: &'static str = "segment/histogram";
    type Args<'a> = Counted<'a>;
    type Out = Vec<u64>;
    type Error = Error;

    fn on_processor(args: &Counted<'_>, exec: &Exec) -> Result<Vec<u64>, Error> {
        with_tabled!(args.voxels, slice => count(slice, args.mask, exec), else Ok(Vec::new()))
    }
}

/// Histogram of the voxels inside the mask; `None` for types of more than 16 bits.
pub(crate) fn of(voxels: &Voxels, mask: Option<&Mask>, exec: &Exec) -> Result<Option<Histogram>, Error> {
    let Some(counted) = Counted::new(voxels, mask) else { return Ok(None) };
    let counts = exec.launch::<Counting>(&counted)?;
    let lowest = with_tabled!(voxels, slice => lowest_of(slice), else 0);
    Ok(Some(Histogram::new(lowest, &counts)))
}

fn lowest_of<T: Tabled>(_: &[T]) -> i64 {
    T::LOWEST
}

impl Histogram {
    /// The values that occur, of how often each does from the lowest of its type on.
    fn new(lowest: i64, counts: &[u64]) -> Self {
        let occupied = counts.iter().enumerate().filter(|(_, n)| **n > 0);
        Self {
            values: occupied.clone().map(|(slot, _)| lowest + slot as i64).collect(),
            counts: occupied.map(|(_, &n)| n).collect(),
        }
    }
}

/// How often each value of the type occurs, ascending.
pub(crate) fn count<T: Tabled>(voxels: &[T], mask: Option<&Mask>, exec: &Exec) -> Result<Vec<u64>, Error> {
    let pieces = parallel::pieces(voxels.len(), CHUNK);
    // Integer sums: whatever the order, the same table.
    let tables = parallel::try_gather(pieces, &|| vec![0_u64; T::VALUES], &|table, i| {
        exec.check_cancelled()?;
        let piece = parallel::piece(voxels.len(), CHUNK, i);
        let counts = match mask.map(|m| &m.inside()[piece.clone()]) {
            None => count_chunk(&voxels[piece]),
            Some(inside) => count_masked(&voxels[piece], inside),
        };
        table.iter_mut().zip(&counts).for_each(|(sum, n)| *sum += n);
        Ok::<_, Error>(())
    })?;
    let mut table = vec![0; T::VALUES];
    for part in &tables {
        table.iter_mut().zip(part).for_each(|(sum, n)| *sum += n);
    }
    Ok(table)
}

/// Counts in several tables by turns: equal values in a row would otherwise wait for each other's store.
fn count_chunk<T: Tabled>(chunk: &[T]) -> Vec<u64> {
    let tables = if T::VALUES <= 256 { 4 } else { 2 };
    let mut counts = vec![0_u32; tables * T::VALUES];
    if T::VALUES <= 256 {
        let (a, rest) = counts.split_at_mut(T::VALUES);
        let (b, rest) = rest.split_at_mut(T::VALUES);
        let (c, d) = rest.split_at_mut(T::VALUES);
        let mut fours = chunk.chunks_exact(4);
        for four in &mut fours {
            a[four[0].slot()] += 1;
            b[four[1].slot()] += 1;
            c[four[2].slot()] += 1;
            d[four[3].slot()] += 1;
        }
        fours.remainder().iter().for_each(|v| a[v.slot()] += 1);
    } else {
        let (a, b) = counts.split_at_mut(T::VALUES);
        let mut twos = chunk.chunks_exact(2);
        for two in &mut twos {
            a[two[0].slot()] += 1;
            b[two[1].slot()] += 1;
        }
        twos.remainder().iter().for_each(|v| a[v.slot()] += 1);
    }
    (0..T::VALUES).map(|slot| (0..tables).map(|t| u64::from(counts[t * T::VALUES + slot])).sum()).collect()
}

fn count_masked<T: Tabled>(chunk: &[T], inside: &[u8]) -> Vec<u64> {
    let mut counts = vec![0_u64; T::VALUES];
    for (v, &inside) in chunk.iter().zip(inside) {
        counts[v.slot()] += u64::from(inside);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn plain<T: Scalar>(voxels: &[T]) -> Histogram {
        let mut map = BTreeMap::new();
        for v in voxels {
            *map.entry(v.to_f64() as i64).or_insert(0_u64) += 1;
        }
        Histogram { values: map.keys().copied().collect(), counts: map.values().copied().collect() }
    }

    #[test]
    fn counts_equal_a_plain_count_for_signed_and_unsigned_types_and_odd_lengths() {
        fn count<T: Tabled>(voxels: &[T], mask: Option<&Mask>, exec: &Exec) -> Result<Histogram, Error> {
            super::count(voxels, mask, exec).map(|counts| Histogram::new(T::LOWEST, &counts))
        }
        let exec = Exec::default();
        let noise = |i: usize| i.wrapping_mul(2_654_435_761) >> 7;
        let bytes: Vec<u8> = (0..CHUNK + 4099).map(|i| noise(i) as u8).collect();
        assert_eq!(count(&bytes, None, &exec).unwrap(), plain(&bytes));
        let signed: Vec<i8> = bytes.iter().map(|&v| v as i8).collect();
        assert_eq!(count(&signed, None, &exec).unwrap(), plain(&signed));
        let words: Vec<u16> = (0..10_001).map(|i| noise(i) as u16).collect();
        assert_eq!(count(&words, None, &exec).unwrap(), plain(&words));
        let signed: Vec<i16> = words.iter().map(|&v| v as i16).collect();
        assert_eq!(count(&signed, None, &exec).unwrap(), plain(&signed));
    }
}
