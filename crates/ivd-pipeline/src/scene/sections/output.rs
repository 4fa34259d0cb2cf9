use std::path::{Path, PathBuf};

use ivd_io::Space;
use ivd_io::mesh::Format as MeshFormat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ending;
use crate::export::{FIELD_ENDINGS, VOLUME_ENDINGS};
use crate::pictures::ANIMATION_ENDINGS;

/// The output of what every frame of a motion makes of the volume.
pub(crate) const SERIES: &str = "volume_series";
/// The output of a picture of every frame of a motion.
pub(crate) const PICTURES: &str = "picture_series";
/// The output of the pictures before and after beside each other.
pub(crate) const SIDE_BY_SIDE: &str = "side_by_side";
/// The output of the picture after, wiped over that before.
pub(crate) const WIPE: &str = "wipe";
/// Outputs of every frame.
pub(crate) const OF_FRAMES: [&str; 2] = [SERIES, PICTURES];
/// Name of the report among the outputs, and its file.
pub(crate) const REPORT: (&str, &str) = ("report", "report.html");

/// Name of a picture among the outputs, and its file.
pub(crate) fn picture_file(picture: Picture) -> (String, PathBuf) {
    (format!("image {}", picture.name()), PathBuf::from(format!("{}.png", picture.name())))
}

/// A picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Picture {
    /// The volume at rest.
    Before,
    /// The deformed volume.
    After,
    /// Where the two differ.
    Difference,
    /// How far what is seen has come out of its surface or gone into it, in colours, with a bar in mm; in modes dvr and iso.
    Moved,
}

impl Picture {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Before, Self::After, Self::Difference, Self::Moved];

    /// Its name in scenes and file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::After => "after",
            Self::Difference => "difference",
            Self::Moved => "moved",
        }
    }
}

/// Which way the axes of a lattice's file run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MeshSpace {
    /// To the patient's right, front and head.
    Ras,
    /// To the patient's left, back and head.
    Lps,
}

impl From<MeshSpace> for Space {
    fn from(space: MeshSpace) -> Self {
        match space {
            MeshSpace::Ras => Self::Ras,
            MeshSpace::Lps => Self::Lps,
        }
    }
}

/// `[output]`: names of files in the output folder. Nothing that isn't named is computed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputSection {
    /// Pictures, written as `before.png`, `after.png`, `difference.png`, `moved.png`.
    pub images: Vec<Picture>,
    /// What comes of the volume: deformed, combined and clipped, as the scene says.
    pub volume: Option<PathBuf>,
    /// The lattice that was deformed, at rest.
    pub lattice: Option<PathBuf>,
    /// The lattice as it was cut, before refinement.
    pub lattice_extracted: Option<PathBuf>,
    /// The deformed lattice.
    pub lattice_deformed: Option<PathBuf>,
    /// The lattice at rest with its motion, all frames: `.glb` (a morph target for every frame, with an animation) or `.pvd` (ParaView's
    /// series of `.vtp`).
    pub animation: Option<PathBuf>,
    /// What comes of the volume in every frame, each mapped and certified: `name.nii.gz` is written as `name_0000.nii.gz` and so
    /// on.
    pub volume_series: Option<PathBuf>,
    /// The picture `after` of every frame, each mapped and certified, all by one camera: `name.png` is written as `name_0000.png` and so on, `name.exr` too; `.gif` and
    /// `.apng` hold all of them, as an animation.
    pub picture_series: Option<PathBuf>,
    /// The pictures before and after beside each other: `.png`, `.apng` or `.gif`, animated where `render.turntable` asks for several.
    pub side_by_side: Option<PathBuf>,
    /// The picture after, wiped over that before and away again, as an animation: `.gif`, `.apng` or `.png`.
    pub wipe: Option<PathBuf>,
    /// Axes of the lattices' files, ras or lps; each says its own. Where this is left out ply, obj and stl are in RAS, vtp in LPS; glb
    /// has the axes of its standard and takes no others.
    pub space: Option<MeshSpace>,
    /// The displacement field from deformed to rest space, as a vector image.
    pub displacement: Option<PathBuf>,
    /// The labels, at rest.
    pub labels: Option<PathBuf>,
    /// The labels as the scan is deformed: they go along with it, each voxel with the nearest one's.
    pub labels_deformed: Option<PathBuf>,
    /// The isolated part, at rest.
    pub mask: Option<PathBuf>,
    /// The isolated part as the scan is deformed.
    pub mask_deformed: Option<PathBuf>,
    /// The report, `report.html`, with its pictures.
    pub report: bool,
}

impl OutputSection {
    /// What a file holds can be written by its ending: better told before all work than after it.
    pub(crate) fn check_endings(&self) -> Result<(), String> {
        let meshes = MeshFormat::ALL.map(MeshFormat::ending);
        let moving = [&meshes[..], &["pvd"]].concat();
        for (key, path, what, endings) in [
            ("volume", &self.volume, "voxels are", &VOLUME_ENDINGS[..]),
            (SERIES, &self.volume_series, "voxels are", &VOLUME_ENDINGS),
            ("labels", &self.labels, "voxels are", &VOLUME_ENDINGS),
            ("labels_deformed", &self.labels_deformed, "voxels are", &VOLUME_ENDINGS),
            ("mask", &self.mask, "voxels are", &VOLUME_ENDINGS),
            ("mask_deformed", &self.mask_deformed, "voxels are", &VOLUME_ENDINGS),
            ("displacement", &self.displacement, "a displacement field is", &FIELD_ENDINGS),
            ("lattice", &self.lattice, "a lattice is", &meshes),
            ("lattice_extracted", &self.lattice_extracted, "a lattice is", &meshes),
            ("lattice_deformed", &self.lattice_deformed, "a lattice is", &moving),
            (SIDE_BY_SIDE, &self.side_by_side, "pictures beside each other are", &ANIMATION_ENDINGS),
            (WIPE, &self.wipe, "an animation is", &ANIMATION_ENDINGS),
        ] {
            // Of all but volumes and pictures a description may be written.
            let described = !["volume", SERIES, SIDE_BY_SIDE, WIPE].contains(&key);
            let is_known = |ending: &str| endings.contains(&ending) || (described && ending == "json");
            let Some(path) = path.as_ref().filter(|path| !is_known(&ending(path))) else { continue };
            let (path, known) = (path.display(), endings.join(", ."));
            return Err(format!("output.{key} = {path}: {what} written as .{known}"));
        }
        Ok(())
    }

    /// The files that are named, with their keys.
    pub fn files(&self) -> Vec<(&'static str, &Path)> {
        [
            ("volume", &self.volume),
            ("lattice", &self.lattice),
            ("lattice_extracted", &self.lattice_extracted),
            ("lattice_deformed", &self.lattice_deformed),
            ("animation", &self.animation),
            (SERIES, &self.volume_series),
            (PICTURES, &self.picture_series),
            (SIDE_BY_SIDE, &self.side_by_side),
            (WIPE, &self.wipe),
            ("displacement", &self.displacement),
            ("labels", &self.labels),
            ("labels_deformed", &self.labels_deformed),
            ("mask", &self.mask),
            ("mask_deformed", &self.mask_deformed),
        ]
        .into_iter()
        .filter_map(|(key, path)| path.as_deref().map(|p| (key, p)))
        .collect()
    }

    /// The outputs that are named, with their files, but for the frames of a series: how many these are shows while it runs.
    pub(crate) fn named(&self) -> Vec<(String, PathBuf)> {
        let files = self.files().into_iter().filter(|(key, _)| !OF_FRAMES.contains(key));
        let files = files.map(|(key, path)| (key.to_owned(), path.to_owned()));
        let report = self.report.then(|| (REPORT.0.to_owned(), PathBuf::from(REPORT.1)));
        files.chain(self.images.iter().copied().map(picture_file)).chain(report).collect()
    }
}
