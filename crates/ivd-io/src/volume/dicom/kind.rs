//! Objects that are no plain slices, by their SOP class (PS3.4, annex B; PS3.6, annex A).

use std::path::Path;

use super::element::{self, Tag};

const SOP_CLASS: Tag = (0x0008, 0x0016);
/// What the SOP classes of stored objects begin with.
const STORAGE: &str = "1.2.840.10008.5.1.4.1.1.";

/// What an object is, and what to do with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) what: &'static str,
    pub(super) remedy: &'static str,
}

const FRAMES: &str =
    "convert it to NIfTI, such as with dcm2niix, or to a file for every slice, such as with dcm4che's emf2sf";
const LABELS: &str = "convert it to a label volume, such as with dcmqi's segimage2itkimage or in 3D Slicer, and read that with \
                      `ivd import --labels`";
const IMAGES: &str = "give the file or folder of the images that it belongs to";

/// The kind of an object of this SOP class; `None` of plain slices, and of classes that say nothing about it.
pub(super) fn of(sop_class: &str) -> Option<Kind> {
    let (what, remedy) = match sop_class.strip_prefix(STORAGE)? {
        "2.1" => ("an Enhanced CT image, a series in one file", FRAMES),
        "2.2" => ("a Legacy Converted Enhanced CT image, a series in one file", FRAMES),
        "4.1" => ("an Enhanced MR image, a series in one file", FRAMES),
        "4.3" => ("an Enhanced MR colour image", FRAMES),
        "4.4" => ("a Legacy Converted Enhanced MR image, a series in one file", FRAMES),
        "130" => ("an Enhanced PET image, a series in one file", FRAMES),
        "128.1" => ("a Legacy Converted Enhanced PET image, a series in one file", FRAMES),
        "30" => ("a parametric map, a series in one file", FRAMES),
        "481.2" => ("an RT dose, a grid in one file", FRAMES),
        "66.4" => ("a segmentation (SEG), parts of an image and no image", LABELS),
        "481.3" => ("an RT structure set, contours and no image", LABELS),
        "66.5" => (
            "a surface segmentation, meshes and no image",
            "save its surfaces as .stl or .ply and give them to `ivd lattice --mesh`",
        ),
        "66.1" | "66.3" => ("a registration, which holds no image", IMAGES),
        "104.1" => ("a document (PDF)", IMAGES),
        "11.1" => ("a presentation state, which holds no image", IMAGES),
        report if report.starts_with("88.") => ("a structured report, which holds no image", IMAGES),
        _ => return None,
    };
    Some(Kind { what, remedy })
}

/// The kind of a file; `None` where it is plain, or can't be told.
pub(super) fn of_file(path: &Path) -> Option<Kind> {
    let elements = element::read(path, &[SOP_CLASS]).ok()?;
    of(&element::text(elements.values.get(&SOP_CLASS)?))
}
