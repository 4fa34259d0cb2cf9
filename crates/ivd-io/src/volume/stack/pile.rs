use std::path::Path;

use ivd_core::{VoxelType, Voxels};

use crate::volume::Error;

/// Slices of one size and type, laid on each other.
#[derive(Debug, Default)]
pub(crate) struct Pile {
    size: [usize; 2],
    depth: usize,
    voxels: Option<Growing>,
}

macro_rules! growing {
    ($($tag:ident: $type:ty),*) => {
        /// Voxels while slices are added.
        #[derive(Debug)]
        enum Growing { $($tag(Vec<$type>)),* }

        impl Growing {
            fn new(voxel_type: VoxelType) -> Self {
                match voxel_type { $(VoxelType::$tag => Self::$tag(Vec::new())),* }
            }

            /// False where the types differ.
            fn push(&mut self, slice: &Voxels) -> bool {
                match (self, slice) {
                    $((Self::$tag(all), Voxels::$tag(slice)) => { all.extend_from_slice(slice); true })*
                    _ => false,
                }
            }

            fn finish(self) -> Voxels {
                match self { $(Self::$tag(all) => all.into()),* }
            }
        }
    };
}
growing!(U8: u8, I8: i8, U16: u16, I16: i16, U32: u32, I32: i32, F32: f32, F64: f64);

impl Pile {
    /// Number of slices.
    pub(crate) fn depth(&self) -> usize {
        self.depth
    }

    /// Checks a slice's size against the first one's, before it is decoded.
    pub(crate) fn expect(&mut self, path: &Path, size: [usize; 2]) -> Result<(), Error> {
        if self.depth == 0 {
            self.size = size;
        }
        if size != self.size {
            let problem = format!(
                "{}×{} pixels, but the first slice has {}×{}",
                size[0], size[1], self.size[0], self.size[1]
            );
            return Err(Error::field(path, "size", problem));
        }
        Ok(())
    }

    /// Adds a slice of the size that [`Pile::expect`] took.
    pub(crate) fn push(&mut self, path: &Path, slice: &Voxels) -> Result<(), Error> {
        let needed = self.size[0] * self.size[1];
        if slice.len() != needed {
            let width = slice.voxel_type().bytes() as u64;
            return Err(Error::truncated(path, "pixels", needed as u64 * width, slice.len() as u64 * width));
        }
        let voxels = self.voxels.get_or_insert_with(|| Growing::new(slice.voxel_type()));
        if !voxels.push(slice) {
            let problem = format!("{}, another type than the first slice", slice.voxel_type().name());
            return Err(Error::field(path, "type", problem));
        }
        self.depth += 1;
        Ok(())
    }

    pub(crate) fn finish(self, path: &Path) -> Result<([usize; 3], Voxels), Error> {
        let voxels = self.voxels.ok_or_else(|| Error::truncated(path, "slices", 1, 0))?;
        Ok(([self.size[0], self.size[1], self.depth], voxels.finish()))
    }
}
