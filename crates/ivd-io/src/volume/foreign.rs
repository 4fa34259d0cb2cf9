//! Files that people have and that aren't read, told by their first bytes or their ending, each with what to do with it.

use std::path::Path;

use crate::volume::Error;

/// How a kind of file says what it is.
enum Mark {
    /// Bytes from an offset on, of the start of the file, unpacked where it is gzip.
    Bytes(usize, &'static [u8]),
    /// An ending of its name.
    Ending(&'static str),
}
use Mark::{Bytes, Ending};

const FIJI: &str = "open it in Fiji (its Bio-Formats read it) and save it as TIFF";
const HDF5: &str = "write its array as .nrrd, with its spacing: in Python h5py reads it and SimpleITK writes .nrrd; mnc2nii makes NIfTI of MINC, and \
                    Fiji a TIFF of Imaris; a transform of ITK or 3D Slicer is saved there as a displacement field, .nrrd";
const MATLAB: &str = "write its array as NIfTI or .nrrd, with its spacing: niftiwrite in MATLAB; in Python scipy.io.loadmat and SimpleITK";
const NUMPY: &str = "write the array as .nrrd, with its spacing: in Python SimpleITK.GetImageFromArray, SetSpacing and WriteImage";
const UNPACK: &str = "unpack it, and give the file or the folder that was in it";
const PARAVIEW: &str = "open it in ParaView and save it as .vti";
/// What to do with a surface.
pub(super) const SURFACE: &str = "it is no volume; `ivd lattice VOLUME --mesh FILE` takes it as a lattice";
const PICTURE: &str = "a volume is a folder of PNG or TIFF slices: convert all of them, and give the folder";

/// The kinds, with what to do; the first that fits tells.
const KINDS: &[(&[Mark], &str, &str)] = &[
    (
        &[
            Bytes(0, b"\x89HDF\r\n\x1a\n"),
            Bytes(512, b"\x89HDF\r\n\x1a\n"),
            Bytes(1024, b"\x89HDF\r\n\x1a\n"),
            Bytes(2048, b"\x89HDF\r\n\x1a\n"),
        ],
        "an HDF5 file (.h5, .hdf5, .mat of MATLAB 7.3, MINC 2, Imaris)",
        HDF5,
    ),
    (
        &[Bytes(0, b"#Insight Transform File"), Ending(".tfm")],
        "a transform of ITK or 3D Slicer (.tfm)",
        "save it there as a displacement field, .nrrd, which `ivd import --displacement` takes",
    ),
    (&[Bytes(0, b"MATLAB ")], "a MATLAB file", MATLAB),
    (&[Bytes(0, b"\x93NUMPY")], "a NumPy array (.npy)", NUMPY),
    (&[Ending(".npz")], "NumPy arrays (.npz)", NUMPY),
    (
        &[Bytes(0, b"CDF\x01"), Bytes(0, b"CDF\x02"), Bytes(0, b"CDF\x05")],
        "a NetCDF or MINC 1 file",
        "mnc2nii makes NIfTI of MINC; ncdump or Python's netCDF4 read the others",
    ),
    (
        &[Ending(".mgz"), Ending(".mgh")],
        "a FreeSurfer volume (.mgz, .mgh)",
        "mri_convert scan.mgz scan.nii.gz, or nibabel in Python, make NIfTI of it",
    ),
    (&[Bytes(0, b"ZISRAWFILE")], "a Zeiss microscope's file (.czi)", FIJI),
    (&[Ending(".lif")], "a Leica microscope's file (.lif)", FIJI),
    (&[Bytes(0, b"\xda\xce\xbe\x0a"), Ending(".nd2")], "a Nikon microscope's file (.nd2)", FIJI),
    (&[Bytes(0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")], "a compound file (.oib, .zvi, .txm)", FIJI),
    (
        &[Bytes(208, b"MAP ")],
        "an MRC or CCP4 map",
        "in Python mrcfile reads it, and pynrrd or SimpleITK write it as .nrrd",
    ),
    (
        &[Bytes(0, b"# === DATA DESCRIPTION FILE"), Ending(".par"), Ending(".rec")],
        "Philips's PAR/REC",
        "dcm2niix or nibabel's parrec2nii make NIfTI of it",
    ),
    (&[Bytes(0, b"MATRIX7")], "an ECAT file", "dcm2niix or nibabel make NIfTI of it"),
    (&[Bytes(0, b"# vtk DataFile")], "VTK's legacy format (.vtk)", PARAVIEW),
    (
        &[Bytes(0, b"# AmiraMesh"), Bytes(0, b"# Avizo")],
        "an Amira or Avizo file (.am)",
        "save it there as NRRD or TIFF",
    ),
    (
        &[Bytes(0, b"ply\n"), Bytes(0, b"ply\r"), Bytes(0, b"glTF"), Ending(".stl"), Ending(".obj")],
        "a surface mesh",
        SURFACE,
    ),
    (&[Bytes(0, b"\x89PNG\r\n\x1a\n")], "a single PNG picture", "give the folder of all slices"),
    (
        &[Bytes(0, b"\xff\xd8\xff"), Bytes(4, b"jP  "), Bytes(0, b"\xff\x4f\xff\x51"), Bytes(0, b"GIF8")],
        "a picture that isn't PNG or TIFF",
        PICTURE,
    ),
    (
        &[
            Bytes(0, b"PK\x03\x04"),
            Bytes(0, b"7z\xbc\xaf"),
            Bytes(0, b"BZh"),
            Bytes(0, b"\xfd7zXZ\0"),
            Bytes(0, b"\x28\xb5\x2f\xfd"),
            Bytes(0, b"Rar!"),
            Bytes(257, b"ustar"),
        ],
        "an archive (zip, 7z, tar, bz2, xz, zst, rar)",
        UNPACK,
    ),
];

/// The error about a file of a known kind that isn't read.
///
/// - `name`: in lower case; `head`: the file's start.
pub(super) fn refusal(path: &Path, name: &str, head: &[u8]) -> Option<Error> {
    let fits = |mark: &Mark| match *mark {
        Bytes(at, bytes) => head.get(at..).is_some_and(|rest| rest.starts_with(bytes)),
        Ending(ending) => name.ends_with(ending),
    };
    let (_, what, remedy) = KINDS.iter().find(|(marks, ..)| marks.iter().any(fits))?;
    Some(Error::unsupported(path, *what, *remedy))
}

#[cfg(test)]
mod tests {
    use crate::volume::{ReadOptions, read};

    fn told(name: &str, bytes: &[u8]) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read(&path, &ReadOptions::default(), &ivd_core::Exec::default()).unwrap_err().to_string()
    }

    #[test]
    fn files_of_other_kinds_are_named_by_their_bytes_whatever_their_names() {
        let later = |at: usize, bytes: &[u8]| [&vec![b' '; at][..], bytes, &[0; 64]].concat();
        let hdf5 = b"\x89HDF\r\n\x1a\n";
        for (name, bytes, what, remedy) in [
            ("scan.h5", later(0, hdf5), "HDF5", "h5py"),
            ("scan.nii", later(0, hdf5), "HDF5", "h5py"),
            ("scan.mat", later(512, hdf5), "HDF5", "h5py"),
            ("scan.mat", later(0, b"MATLAB 5.0 MAT-file"), "MATLAB", "niftiwrite"),
            ("arrays.npz", later(0, b"PK\x03\x04"), "NumPy", "GetImageFromArray"),
            ("move.tfm", later(0, b"#Insight Transform File V1.0"), "3D Slicer", "--displacement"),
            ("move.h5", later(0, b"\x89HDF\r\n\x1a\n"), "HDF5", "displacement field"),
            ("scans.zip", later(0, b"PK\x03\x04"), "archive", "unpack"),
            ("scan", later(257, b"ustar"), "archive", "unpack"),
            ("cells.czi", later(0, b"ZISRAWFILE"), "Zeiss", "Fiji"),
            ("map.map", later(208, b"MAP "), "MRC", "mrcfile"),
            ("head.vtk", later(0, b"# vtk DataFile Version 3.0"), "legacy", ".vti"),
            ("head.stl", later(80, b"some"), "mesh", "--mesh"),
            ("one.png", later(0, b"\x89PNG\r\n\x1a\n"), "single PNG", "folder"),
        ] {
            let told = told(name, &bytes);
            assert!(told.contains(what) && told.contains(remedy), "{name}: {told}");
        }
        assert!(told("scan.raw", &[7; 4096]).contains("dims and type"), "nothing tells");
    }
}
