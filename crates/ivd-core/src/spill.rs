use std::sync::Arc;

use crate::ByteSource;

/// Gives room for bulk data beyond the memory limit, such as mapped temporary files.
pub trait Spill: Send + Sync {
    /// Room for `bytes` bytes, all 0, aligned for every number.
    ///
    /// # Errors
    /// Why there is none.
    fn space(&self, bytes: usize) -> std::io::Result<Box<dyn SpillSpace>>;

    /// Bytes of memory that the process has taken so far, where the host knows it and the limit is of the whole process. Arrays then go
    /// elsewhere once there is no room for them beside what is held; without it each is held against the limit by itself.
    fn held(&self) -> Option<u64> {
        None
    }
}

/// Room for bulk data that is being written.
pub trait SpillSpace: Send + Sync {
    /// What was written so far.
    fn bytes(&self) -> &[u8];
    /// The bytes, to be written.
    fn bytes_mut(&mut self) -> &mut [u8];
    /// Ends the writing.
    fn seal(self: Box<Self>) -> Arc<dyn ByteSource>;
}
