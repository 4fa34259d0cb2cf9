use std::any::Any;

use ivd_core::Voxels;

use crate::buffers::Room;
use crate::{Error, Gpu};

/// What lies on the device for longer than one pass, with a clone of what it was made from, so that its address stays its own.
pub(crate) struct Kept {
    from: Source,
    _owner: Box<dyn Any + Send>,
    pub(crate) room: Room,
}

/// Where in memory something was made from, how much of it there is, and whether it lies on the device as it is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Source {
    address: usize,
    bytes: usize,
    as_it_is: bool,
}

impl Kept {
    /// Brings what was made from `owned` and lies in memory at `data`, unless it is there already.
    pub(crate) fn bring<O: Send + 'static>(
        slot: &mut Option<Self>,
        gpu: &Gpu,
        what: &'static str,
        owned: (&[u8], impl FnOnce() -> O),
        data: &[u8],
    ) -> Result<(), Error> {
        let from = Source {
            address: owned.0.as_ptr() as usize,
            bytes: owned.0.len(),
            as_it_is: owned.0.as_ptr() == data.as_ptr(),
        };
        if slot.as_ref().is_some_and(|kept| kept.from == from) {
            return Ok(());
        }
        // What is replaced leaves its room to what comes.
        *slot = None;
        let room = gpu.upload(what, data)?;
        *slot = Some(Self { from, _owner: Box::new((owned.1)()), room });
        Ok(())
    }

    /// Whether these voxels lie here as they are stored.
    pub(crate) fn is_of(&self, voxels: &Voxels) -> bool {
        let data = voxels.as_bytes();
        self.from == Source { address: data.as_ptr() as usize, bytes: data.len(), as_it_is: true }
    }

    /// Voxels as they are stored, for one pass.
    pub(crate) fn upload_voxels(gpu: &Gpu, voxels: &Voxels) -> Result<Room, Error> {
        fits(voxels)?;
        gpu.upload("the volume", voxels.as_bytes())
    }

    /// Brings voxels, as they are or as `data` made of them.
    pub(crate) fn bring_voxels(
        slot: &mut Option<Self>,
        gpu: &Gpu,
        voxels: &Voxels,
        data: &[u8],
    ) -> Result<(), Error> {
        fits(voxels)?;
        Self::bring(slot, gpu, "the volume", (voxels.as_bytes(), || voxels.clone()), data)
    }
}

/// Shaders count voxels in 32 bits.
fn fits(voxels: &Voxels) -> Result<(), Error> {
    if voxels.len() as u64 > u64::from(u32::MAX) {
        return Err(Error::TooLarge { what: "the volume", bytes: voxels.as_bytes().len() as u64 });
    }
    Ok(())
}
