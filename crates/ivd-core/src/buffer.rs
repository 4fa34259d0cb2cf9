use std::fmt;
use std::ops::{Deref, Range};
use std::sync::Arc;

use bytemuck::Pod;

/// Bytes owned by somebody else, such as a memory-mapped artefact.
pub trait ByteSource: Send + Sync {
    /// The bytes. Must be the same slice at every call.
    fn bytes(&self) -> &[u8];

    /// Says that a range of the bytes is about to be read. A source that checks its bytes piece by piece checks these now;
    /// what it finds is told by [`ByteSource::damaged`].
    fn touch(&self, range: Range<usize>) {
        let _ = range;
    }

    /// Whether bytes that were touched aren't what they should be: what was made from them is worth nothing.
    fn damaged(&self) -> bool {
        false
    }
}

/// Bulk data: owned, or a typed view over shared bytes. Cloning a shared view is cheap.
///
/// Dereferences to a slice, so stages read `&buffer[..]` and never ask where the data lives.
#[derive(Clone)]
pub struct Buffer<T> {
    storage: Storage<T>,
}

#[derive(Clone)]
enum Storage<T> {
    Owned(Arc<Vec<T>>),
    Shared { source: Arc<dyn ByteSource>, offset: usize, bytes: usize },
}

impl<T: Pod> Buffer<T> {
    /// A view of `len` values starting `offset` bytes into `source`.
    ///
    /// Returns `None` where the range leaves the source or isn't aligned for `T`.
    pub fn shared(source: Arc<dyn ByteSource>, offset: usize, len: usize) -> Option<Self> {
        let bytes = len.checked_mul(size_of::<T>())?;
        let range = source.bytes().get(offset..offset.checked_add(bytes)?)?;
        bytemuck::try_cast_slice::<u8, T>(range).ok()?;
        Some(Self { storage: Storage::Shared { source, offset, bytes } })
    }

    /// The values.
    pub fn as_slice(&self) -> &[T] {
        match &self.storage {
            Storage::Owned(values) => values,
            Storage::Shared { source, offset, bytes } => {
                bytemuck::cast_slice(&source.bytes()[*offset..*offset + *bytes])
            }
        }
    }

    /// Says that a range of the values is about to be read; see [`ByteSource::touch`].
    pub fn touch(&self, range: Range<usize>) {
        if let Storage::Shared { source, offset, bytes } = &self.storage {
            let byte = |at: usize| offset + at.saturating_mul(size_of::<T>()).min(*bytes);
            source.touch(byte(range.start)..byte(range.end));
        }
    }

    /// Whether values that were touched aren't what they should be; see [`ByteSource::damaged`].
    pub fn damaged(&self) -> bool {
        matches!(&self.storage, Storage::Shared { source, .. } if source.damaged())
    }

    /// The values as bytes in memory order.
    pub fn as_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.as_slice())
    }

    /// The values, to be changed: copied first where they are shared, so that nobody else sees it.
    pub fn make_mut(&mut self) -> &mut [T]
    where
        T: Clone,
    {
        if let Storage::Shared { .. } = self.storage {
            self.storage = Storage::Owned(Arc::new(self.as_slice().to_vec()));
        }
        match &mut self.storage {
            Storage::Owned(values) => Arc::<Vec<T>>::make_mut(values),
            Storage::Shared { .. } => unreachable!("owned since the lines above"),
        }
    }

    /// The values, copied only where they are shared.
    pub fn into_vec(self) -> Vec<T> {
        match self.storage {
            Storage::Owned(values) => Arc::try_unwrap(values).unwrap_or_else(|shared| shared.to_vec()),
            Storage::Shared { .. } => self.as_slice().to_vec(),
        }
    }
}

impl<T> From<Vec<T>> for Buffer<T> {
    fn from(values: Vec<T>) -> Self {
        Self { storage: Storage::Owned(Arc::new(values)) }
    }
}

impl<T> FromIterator<T> for Buffer<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Vec::from_iter(values).into()
    }
}

impl<T: Pod> Deref for Buffer<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        self.as_slice()
    }
}

impl<T: Pod + PartialEq> PartialEq for Buffer<T> {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl<T: Pod> fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer<{}>[{}]", std::any::type_name::<T>(), self.len())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    struct Bytes(Vec<u64>);
    impl ByteSource for Bytes {
        fn bytes(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }
    }

    #[test]
    fn shared_view_reads_the_source_and_refuses_what_does_not_fit() {
        let source: Arc<dyn ByteSource> = Arc::new(Bytes(vec![1, 2, 3]));
        let view = Buffer::<u64>::shared(source.clone(), 8, 2).unwrap();
        assert_eq!(&view[..], &[2, 3]);
        assert!(Buffer::<u64>::shared(source.clone(), 8, 3).is_none());
        assert!(Buffer::<u64>::shared(source.clone(), 4, 1).is_none(), "unaligned");
        assert!(Buffer::<u64>::shared(source, 8, usize::MAX).is_none());
    }

    #[test]
    fn changed_values_are_seen_by_nobody_else() {
        let mut owned = Buffer::from(vec![1_u64, 2]);
        let other = owned.clone();
        owned.make_mut()[0] = 7;
        assert_eq!((&owned[..], &other[..]), (&[7, 2][..], &[1, 2][..]));
        let source: Arc<dyn ByteSource> = Arc::new(Bytes(vec![1, 2, 3]));
        let mut view = Buffer::<u64>::shared(source.clone(), 0, 3).unwrap();
        view.make_mut()[2] = 9;
        assert_eq!((&view[..], source.bytes()[16]), (&[1, 2, 9][..], 3));
    }

    #[derive(Default)]
    struct Touched(Vec<u64>, Mutex<Vec<Range<usize>>>);
    impl ByteSource for Touched {
        fn bytes(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }
        fn touch(&self, range: Range<usize>) {
            self.1.lock().unwrap().push(range);
        }
        fn damaged(&self) -> bool {
            self.1.lock().unwrap().iter().any(|r| r.contains(&11))
        }
    }

    #[test]
    fn touched_values_are_told_as_bytes_of_the_source() {
        let source = Arc::new(Touched(vec![0; 4], Mutex::default()));
        let view = Buffer::<u16>::shared(source.clone(), 8, 8).unwrap();
        view.touch(4..7);
        assert!(!view.damaged());
        view.touch(0..100);
        assert_eq!(*source.1.lock().unwrap(), [16..22, 8..24]);
        assert!(view.damaged());
        let owned = Buffer::from(vec![1_u8; 3]);
        owned.touch(0..3);
        assert!(!owned.damaged());
    }
}
