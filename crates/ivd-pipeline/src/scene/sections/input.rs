use std::path::{Path, PathBuf};

use ivd_core::VoxelType;
use ivd_io::volume::VoxelAxes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[input]`: a file or folder, or a generated phantom.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputSection {
    /// Volume file or folder of slices, relative to the scene's folder.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Layout of a raw file or of raw slices.
    #[serde(default)]
    pub raw: Option<RawSection>,
    /// A drawn part that a surface starts from, or that seeds go on from: a mask, or what isn't 0 in a volume file, on the volume's grid.
    /// Relative to the scene's folder.
    #[serde(default)]
    pub start: Option<PathBuf>,
    /// Labels that another program made of this scan: those of an artefact, or the whole numbers of a volume file, put onto the scan's voxels by
    /// where they lie. They stand in for those that a segmentation would find; 0 is no part. Relative to the scene's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<PathBuf>,
    /// Frame of a 4-D file, from 0.
    #[serde(default)]
    pub frame: Option<usize>,
    /// DICOM series, where the folder holds several: its number, its UID or the start of that.
    #[serde(default)]
    pub series: Option<String>,
    /// Puts slices of a DICOM series that aren't evenly spaced onto even spacing, by linear interpolation. Without it such a series is
    /// refused.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub resample_slices: bool,
    /// Distance of voxel centres (mm), for formats that don't say it.
    #[serde(default)]
    pub spacing: Option<[f64; 3]>,
    /// Where x, y and z of the voxels lead: a letter each, R or L, A or P, S or I. Default: what the file says; LPS where it says nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub axes: Option<VoxelAxes>,
    /// A file with as many voxels whose grid (spacing, place and axes) is taken as it is, where the file's own is missing or wrong. Relative to
    /// the scene's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid_of: Option<PathBuf>,
    /// A generated volume: head, sphere, torus, gyroid, spheres, shell, bars, neck or bust.
    #[serde(default)]
    #[schemars(with = "Option<String>")]
    pub phantom: Option<ivd_phantom::Shape>,
    /// Voxels along a phantom's edge.
    #[serde(default)]
    pub size: Option<usize>,
    /// Rician noise of a phantom, as a fraction of the value range.
    #[serde(default)]
    pub noise: Option<f64>,
    /// Stored type of a phantom: u8, u16 or f32.
    #[serde(default, rename = "type")]
    #[schemars(with = "Option<String>")]
    pub voxel_type: Option<VoxelType>,
    /// Seed of a phantom's noise.
    #[serde(default)]
    pub seed: Option<u64>,
    /// What a scan of the phantom bust shows bright: mr (T1-weighted, the default) or ct.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub contrast: Option<ivd_phantom::Contrast>,
}

/// Layout of raw voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSection {
    /// Voxels along x, y, z (x fastest).
    pub dims: [usize; 3],
    /// Stored type.
    #[serde(rename = "type")]
    #[schemars(with = "String")]
    pub voxel_type: VoxelType,
    /// Distance of voxel centres (mm).
    #[serde(default = "unit_spacing")]
    pub spacing: [f64; 3],
    /// Byte order: "little" or "big".
    #[serde(default)]
    #[schemars(with = "String")]
    pub order: ivd_io::volume::ByteOrder,
    /// Bytes before the voxels.
    #[serde(default)]
    pub skip: u64,
}

fn unit_spacing() -> [f64; 3] {
    [1.0; 3]
}

/// The files that an input is read from, by the keys that name them, and which series of one of them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InputFiles {
    /// The volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Labels that another program made of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<PathBuf>,
    /// A part that was drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<PathBuf>,
    /// The file whose grid is taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid_of: Option<PathBuf>,
    /// Which series of a folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<String>,
}

impl InputFiles {
    /// Each with its key.
    pub(crate) fn named(&self) -> [(&'static str, Option<&Path>); 4] {
        let Self { file, labels, start, grid_of, .. } = self;
        [("file", file), ("labels", labels), ("start", start), ("grid_of", grid_of)]
            .map(|(key, file)| (key, file.as_deref()))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The same files by other paths.
    ///
    /// - `path`: gives that of a file under a key.
    #[must_use]
    pub fn renamed(self, path: impl Fn(&'static str, &Path) -> PathBuf) -> Self {
        let [file, labels, start, grid_of] = self.named().map(|(key, file)| file.map(|file| path(key, file)));
        Self { file, labels, start, grid_of, series: self.series }
    }
}
