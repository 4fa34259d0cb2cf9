//! Bulk data that a stage writes: in memory, or where a host puts what doesn't fit.

use std::fmt;
use std::ops::{Deref, DerefMut};

use bytemuck::Pod;

use crate::{Buffer, Error, Exec, Spill, SpillSpace};

/// Values that a stage writes; a slice to whoever fills it.
pub struct SpillVec<T>(Room<T>);

enum Room<T> {
    Memory(Vec<T>),
    Spilled(Box<dyn SpillSpace>, usize),
}

impl Exec {
    /// `len` zeros for `what`: in memory where they fit into [`Exec::memory_limit`], and beside what the process holds where
    /// [`Spill::held`](crate::Spill::held) tells it; else where [`Exec::spill`] puts them.
    ///
    /// # Errors
    /// [`Error::MemoryLimit`] where they don't fit and there is nowhere to put them, [`Error::Spill`] where that fails.
    pub fn bulk<T: Pod>(&self, what: &'static str, len: usize) -> Result<SpillVec<T>, Error> {
        let bytes = len.saturating_mul(size_of::<T>());
        let Some(spill) = self.spill.as_ref().filter(|_| bytes < usize::MAX) else {
            self.check_memory(what, bytes as u64)?;
            return in_memory(what, len);
        };
        let fits = self.fits(what, bytes as u64).is_ok();
        if fits && !self.is_full(spill.as_ref(), bytes as u64) {
            return in_memory(what, len);
        }
        match spill.space(bytes) {
            Ok(space) => Ok(SpillVec(Room::Spilled(space, bytes))),
            // What is held may go; the limit is watched beside.
            Err(_) if fits => in_memory(what, len),
            Err(problem) => Err(Error::Spill { what, problem: problem.to_string() }),
        }
    }
}

fn in_memory<T: Pod>(what: &'static str, len: usize) -> Result<SpillVec<T>, Error> {
    let needed = len.saturating_mul(size_of::<T>()) as u64;
    let values = bytemuck::allocation::try_zeroed_vec(len);
    let refused = |()| Error::MemoryLimit { what: what.to_owned(), needed, limit: 0 };
    values.map(|values| SpillVec(Room::Memory(values))).map_err(refused)
}

/// Smaller arrays stay in memory, whatever is held: a file each would take more than it saves (bytes).
const WORTH_SPILLING: u64 = 1 << 20;

impl Exec {
    /// Whether there is no room for so many bytes beside what is held. An eighth of the limit stays free, for what is never put elsewhere.
    fn is_full(&self, spill: &dyn Spill, bytes: u64) -> bool {
        let (Some(limit), Some(held)) = (self.memory_limit, spill.held()) else { return false };
        bytes >= WORTH_SPILLING && held.saturating_add(bytes) > limit - limit / 8
    }
}

impl<T: Pod> SpillVec<T> {
    /// Keeps the first `len` values, where there are more, and gives the room of the others back.
    pub fn truncate(&mut self, len: usize) {
        match &mut self.0 {
            Room::Memory(values) => {
                values.truncate(len);
                values.shrink_to_fit();
            }
            Room::Spilled(_, bytes) => *bytes = (*bytes).min(len * size_of::<T>()),
        }
    }

    /// Ends the writing.
    ///
    /// # Panics
    /// Where a [`Spill`](crate::Spill) gave less room than it was asked for, or room that isn't aligned.
    pub fn into_buffer(self) -> Buffer<T> {
        match self.0 {
            Room::Memory(values) => values.into(),
            Room::Spilled(space, bytes) => Buffer::shared(space.seal(), 0, bytes / size_of::<T>().max(1))
                .expect("a spill gives the room it was asked for, aligned"),
        }
    }
}

impl<T: Pod> From<SpillVec<T>> for Buffer<T> {
    fn from(bulk: SpillVec<T>) -> Self {
        bulk.into_buffer()
    }
}

impl<T: Pod> Deref for SpillVec<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        match &self.0 {
            Room::Memory(values) => values,
            Room::Spilled(space, bytes) => bytemuck::cast_slice(&space.bytes()[..*bytes]),
        }
    }
}

impl<T: Pod> DerefMut for SpillVec<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.0 {
            Room::Memory(values) => values,
            Room::Spilled(space, bytes) => bytemuck::cast_slice_mut(&mut space.bytes_mut()[..*bytes]),
        }
    }
}

impl<T> fmt::Debug for SpillVec<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = match &self.0 {
            Room::Memory(_) => "memory",
            Room::Spilled(..) => "spilled",
        };
        write!(f, "SpillVec<{}> in {place}", std::any::type_name::<T>())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::ByteSource;

    #[derive(Default)]
    struct Elsewhere {
        held: Option<u64>,
    }
    struct Words(Vec<u64>, usize);

    impl Spill for Elsewhere {
        fn space(&self, bytes: usize) -> std::io::Result<Box<dyn SpillSpace>> {
            if bytes > 1000 && self.held.is_none() {
                return Err(std::io::Error::other("the disk is full"));
            }
            Ok(Box::new(Words(vec![0; bytes.div_ceil(8)], bytes)))
        }

        fn held(&self) -> Option<u64> {
            self.held
        }
    }

    impl ByteSource for Words {
        fn bytes(&self) -> &[u8] {
            &bytemuck::cast_slice(&self.0)[..self.1]
        }
    }

    impl SpillSpace for Words {
        fn bytes(&self) -> &[u8] {
            ByteSource::bytes(self)
        }
        fn bytes_mut(&mut self) -> &mut [u8] {
            &mut bytemuck::cast_slice_mut(&mut self.0)[..self.1]
        }
        fn seal(self: Box<Self>) -> Arc<dyn ByteSource> {
            Arc::new(*self)
        }
    }

    fn squares(exec: &Exec, len: usize) -> Result<Buffer<u16>, Error> {
        let mut bulk = exec.bulk::<u16>("squares", len)?;
        bulk.iter_mut().enumerate().for_each(|(i, v)| *v += (i * i) as u16);
        Ok(bulk.into_buffer())
    }

    #[test]
    fn what_does_not_fit_is_spilled_and_reads_the_same() {
        let roomy = Exec::default();
        let tight = Exec::default().with_memory_limit(Some(20)).with_spill(Arc::new(Elsewhere::default()));
        assert_eq!(squares(&roomy, 30).unwrap(), squares(&tight, 30).unwrap());
        assert!(format!("{:?}", tight.bulk::<u16>("squares", 30)).contains("spilled"));
        assert!(format!("{:?}", tight.bulk::<u16>("squares", 10)).contains("memory"));
    }

    #[test]
    fn what_is_cut_short_is_the_beginning() {
        for exec in [
            Exec::default(),
            Exec::default().with_memory_limit(Some(20)).with_spill(Arc::new(Elsewhere::default())),
        ] {
            let mut bulk = exec.bulk::<u16>("numbers", 30).unwrap();
            bulk.iter_mut().enumerate().for_each(|(i, v)| *v = i as u16);
            bulk.truncate(40);
            assert_eq!(bulk.len(), 30);
            bulk.truncate(7);
            assert_eq!(bulk.into_buffer()[..], [0, 1, 2, 3, 4, 5, 6]);
        }
    }

    #[test]
    fn what_fits_alone_is_spilled_where_others_hold_the_room() {
        const MIB: u64 = 1 << 20;
        let with = |held| {
            let spill = Arc::new(Elsewhere { held: Some(held) });
            Exec::default().with_memory_limit(Some(16 * MIB)).with_spill(spill)
        };
        let place =
            |held, bytes: u64| format!("{:?}", with(held).bulk::<u8>("bytes", bytes as usize).unwrap());
        // 14 of 16 MiB may be taken.
        assert!(place(0, 14 * MIB).contains("memory") && place(0, 15 * MIB).contains("spilled"));
        assert!(place(10 * MIB, 4 * MIB).contains("memory") && place(10 * MIB, 5 * MIB).contains("spilled"));
        assert!(place(20 * MIB, MIB - 1).contains("memory"), "small ones stay");
    }

    #[test]
    fn nowhere_to_put_it_is_an_error_that_says_what() {
        let tight = Exec::default().with_memory_limit(Some(20));
        assert!(matches!(squares(&tight, 30), Err(Error::MemoryLimit { needed: 60, limit: 20, .. })));
        let full = tight.with_spill(Arc::new(Elsewhere::default()));
        let failed = squares(&full, 600).unwrap_err().to_string();
        assert!(failed.contains("squares") && failed.contains("the disk is full"), "{failed}");
        assert!(squares(&full, usize::MAX).is_err());
    }
}
