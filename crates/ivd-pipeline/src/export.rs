//! Artefacts out of the pipeline's own format: by the file's ending.

use std::borrow::Cow;
use std::io::Write as _;
use std::path::Path;

use ivd_artefact::Artefact;
use ivd_core::{Displacement, Exec, Image, Labels, Lattice, Mask, Motion, Volume, Voxels};
use ivd_io::Space;
use ivd_io::transfer::Format;
use ivd_io::volume::FieldDirection;

use crate::{Depth, Error, describe, pictures};

/// Writes an artefact in the format of `path`'s ending. A file whose bytes would not change isn't touched.
///
/// Volumes, labels and masks: nii, nii.gz, nrrd, mha, mhd, vti, tif, tiff, raw. Lattices: ply, obj, stl, glb, vtp.
/// Displacements: [`FIELD_ENDINGS`] (deformed → rest, LPS mm, as ITK reads it). Images: png and apng (all frames of a turntable as an animation), gif, exr (the light
/// that was kept). Transfer functions: vp.json (3D
/// Slicer), paraview.json, json. Motions, octrees, and the figures of anything else: json. What else may be chosen: [`export_with`].
///
/// # Errors
/// A usage error where the kind has no such format, and whatever writing runs into.
pub fn export(artefact: &Artefact, path: &Path, exec: &Exec) -> Result<bool, Error> {
    export_with(artefact, path, &ExportOptions::default(), exec)
}

/// What may be chosen in an export.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExportOptions<'a> {
    /// For a motion: the lattice that it moves, which makes it a mesh (glb with morph targets, pvd with a vtp for every frame, else
    /// the last frame).
    pub lattice: Option<&'a Lattice>,
    /// For a displacement: which of its fields.
    pub direction: FieldDirection,
    /// For a lattice or a motion: the file's axes; the format's own where none are given.
    pub space: Option<Space>,
    /// For a motion with its lattice: the frame that a mesh is written of, counted from 0; where none is given all, or the last in a
    /// format that holds one. For a picture: the one that is written of a turntable.
    pub frame: Option<usize>,
    /// For a picture: how fine a png's levels are.
    pub depth: Depth,
}

/// As [`export()`], with what may be chosen.
///
/// # Errors
/// As [`export()`].
pub fn export_with(
    artefact: &Artefact,
    path: &Path,
    options: &ExportOptions<'_>,
    exec: &Exec,
) -> Result<bool, Error> {
    if let (Artefact::Transfer(transfer), Some(format)) = (artefact, Format::of(path)) {
        return ivd_io::transfer::write(path, transfer, format).map_err(Error::in_stage("export"));
    }
    if ending(path) == "json" {
        if options.frame.is_some() {
            return Err(Error::usage(
                "export",
                "--frame: figures are of the whole motion; leave it out, or write a mesh",
            ));
        }
        return write_text(path, &format!("{:#}\n", describe(artefact)));
    }
    match artefact {
        Artefact::Volume(volume) => write_volume(path, exec.run(|| whole(volume))?, exec),
        Artefact::Labels(labels) => write_volume(path, &labels_volume(labels)?, exec),
        Artefact::Mask(mask) => write_volume(path, &mask_volume(mask)?, exec),
        Artefact::Lattice(lattice) => ivd_io::mesh::write(path, lattice, options.space)
            .map(|w| w.touched)
            .map_err(Error::in_stage("export")),
        Artefact::Displacement(field) => write_field(path, field, options.direction, exec),
        Artefact::Image(image) => {
            let chosen = options.frame.map(|frame| picture_of(image, frame)).transpose()?;
            write_bytes(
                path,
                &exec.run(|| pictures::bytes(path, chosen.as_ref().unwrap_or(image), options.depth))?,
            )
        }
        Artefact::Motion(motion) => {
            let Some(lattice) = options.lattice else {
                let problem = "a motion is written as .json, or as a mesh with the lattice that it moves: add --lattice";
                return Err(Error::usage("export", problem));
            };
            let written = match options.frame {
                None => ivd_io::mesh::write_motion(path, lattice, motion, options.space),
                Some(frame) => {
                    check_frame(frame, motion)?;
                    if ending(path) == "pvd" {
                        let problem =
                            "a .pvd names the meshes of all frames; leave --frame out, or write a .vtp";
                        return Err(Error::usage("export", problem));
                    }
                    let displacement = &motion.frames()[frame].displacement;
                    ivd_io::mesh::write_deformed(path, lattice, displacement, options.space)
                }
            };
            written.map(|w| w.touched).map_err(Error::in_stage("export"))
        }
        Artefact::Transfer(_) | Artefact::Octree(_) | Artefact::Tree(_) => Err(Error::usage(
            "export",
            format!("a {} artefact is written as .json, not as .{}", artefact.kind().name(), ending(path)),
        )),
    }
}

/// Refuses a frame that a motion doesn't have.
///
/// # Errors
/// A usage error that tells which there are.
pub fn check_frame(frame: usize, motion: &Motion) -> Result<(), Error> {
    let problem = match motion.frames().len() {
        0 => format!("frame {frame}: the motion has no frames"),
        count if frame >= count => format!("frame {frame}: the motion has {count}, numbered from 0"),
        _ => return Ok(()),
    };
    Err(Error::usage("export", problem))
}

/// A picture of a turntable.
fn picture_of(image: &Image, frame: usize) -> Result<Image, Error> {
    image.frame(frame).ok_or_else(|| {
        let problem = format!("frame {frame}: the image has {}, numbered from 0", image.frames());
        Error::usage("export", problem)
    })
}

/// A volume, every voxel of it verified where it is read from a file.
pub(crate) fn whole(volume: &Volume) -> Result<&Volume, Error> {
    volume.voxels();
    let damaged = || Error::Damaged("a cached volume isn't what its hashes say".to_owned());
    if volume.damaged() { Err(damaged()) } else { Ok(volume) }
}

/// Labels as a volume of their ids, in the smallest type that holds them.
///
/// # Errors
/// Never, for labels that passed their own checks.
pub fn labels_volume(labels: &Labels) -> Result<Volume, Error> {
    let small = labels.ids().iter().all(|&id| id <= 255);
    let voxels = if small {
        Voxels::from(labels.ids().iter().map(|&id| id as u8).collect::<Vec<u8>>())
    } else {
        Voxels::U16(labels.buffer().clone())
    };
    Ok(Volume::new(labels.grid().clone(), voxels)?)
}

/// A mask as a volume of 0 and 1.
///
/// # Errors
/// Never, for a mask that passed its own checks.
pub fn mask_volume(mask: &Mask) -> Result<Volume, Error> {
    Ok(Volume::new(mask.grid().clone(), Voxels::U8(mask.buffer().clone()))?)
}

fn write_volume(path: &Path, volume: &Volume, exec: &Exec) -> Result<bool, Error> {
    if !VOLUME_ENDINGS.contains(&&*ending(path)) {
        let known = VOLUME_ENDINGS.join(", .");
        return Err(Error::usage("export", format!("{}: voxels are written as .{known}", path.display())));
    }
    ivd_io::volume::write(path, volume, exec).map(|w| w.touched).map_err(Error::in_stage("export"))
}

/// Formats that voxels are written in.
pub(crate) const VOLUME_ENDINGS: [&str; 10] =
    ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif", "tiff", "raw"];

/// Formats that displacement fields are written in.
pub const FIELD_ENDINGS: [&str; 4] = ["nrrd", "mha", "nii", "nii.gz"];

fn write_field(
    path: &Path,
    field: &Displacement,
    direction: FieldDirection,
    exec: &Exec,
) -> Result<bool, Error> {
    if !FIELD_ENDINGS.contains(&&*ending(path)) {
        let known = FIELD_ENDINGS.join(", .");
        let problem = format!("{}: a displacement field is written as .{known}", path.display());
        return Err(Error::usage("export", problem));
    }
    ivd_io::volume::write_field(path, field, direction, exec)
        .map(|w| w.touched)
        .map_err(Error::in_stage("export"))
}

/// Writes text atomically; an unchanged file isn't touched. Returns whether it was.
///
/// # Errors
/// [`Error::Io`].
pub fn write_text(path: &Path, text: &str) -> Result<bool, Error> {
    write_bytes(path, text.as_bytes())
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<bool, Error> {
    let failed = |source| Error::io("writing", path, source);
    ivd_fs::replace(path, |_, source| failed(source), |to| to.write_all(bytes).map_err(failed))
}

/// Whether a file's ending is that of a format that artefacts are exported in: under it nobody looks for an artefact.
pub fn is_of_another_format(path: &Path) -> bool {
    let ending = ending(path);
    let volumes = VOLUME_ENDINGS.iter().chain(&pictures::PICTURE_ENDINGS).chain(&["json", "pvd"]);
    volumes
        .copied()
        .chain(ivd_io::mesh::Format::ALL.map(ivd_io::mesh::Format::ending))
        .any(|known| known == ending)
}

/// The ending that decides the format, lower case, without a dot (`nii.gz` is one ending).
pub fn ending(path: &Path) -> Cow<'static, str> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    if name.ends_with(".nii.gz") {
        return Cow::Borrowed("nii.gz");
    }
    Cow::Owned(name.rsplit_once('.').map(|(_, e)| e.to_owned()).unwrap_or_default())
}
