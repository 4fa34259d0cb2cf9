//! Small files that unpack or declare far more than there is.

use crate::hostile::case::{BAD, Case};
use crate::hostile::good;

/// A limit that was hit.
const LIMIT: &[i32] = &[4];

fn nrrd(sizes: &str, kind: &str, encoding: &str, data: &[u8]) -> Vec<u8> {
    let header = format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nendian: little\nencoding: {encoding}\n\n"
    );
    [header.as_bytes(), data].concat()
}

pub(crate) fn cases() -> Vec<Case> {
    let zeros = good::gzip(&vec![0; 200 << 20]);
    let case =
        |name: &str, codes, file: &str, bytes: Vec<u8>| Case::new(name, codes).file(file, bytes).import();
    let mut nifti = good::file("nii");
    nifti[40..56].copy_from_slice(&[3_i16, 1000, 1000, 1000, 1, 1, 1, 1].map(i16::to_le_bytes).concat());
    let mut cases = vec![
        case("2^40 voxels in a line", BAD, "a.nrrd", nrrd("1099511627776 1 1", "uchar", "raw", b"abc")),
        case("2^63 bytes", BAD, "a.nrrd", nrrd("2097152 2097152 2097152", "uchar", "raw", b"abc")),
        case("2^40 voxels packed", BAD, "a.nrrd", nrrd("1048576 1048576 1", "uchar", "gzip", &zeros)),
        case("200 MiB that are there", LIMIT, "a.nrrd", nrrd("1024 1024 200", "uchar", "gzip", &zeros)),
        // Widened to 32 bit: what is read and what is kept are two sizes.
        case("25 million long integers", LIMIT, "a.nrrd", nrrd("1024 1024 25", "int64", "gzip", &zeros)),
        case("a header that never ends", BAD, "a.nrrd", [&b"NRRD0004\n"[..], &vec![b'#'; 4 << 20]].concat()),
        case("a header of zeros, packed", BAD, "a.nii.gz", zeros.clone()),
        case("a billion voxels of NIfTI", BAD, "a.nii", nifti.clone()),
        case("a billion voxels of NIfTI, packed", BAD, "a.nii.gz", good::gzip(&nifti)),
        case("gzip in gzip", BAD, "a.nii.gz", good::gzip(&good::gzip(&nifti))),
        case("2^40 voxels of MetaImage", BAD, "a.mha", b"NDims = 3\nDimSize = 1048576 1048576 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\nabc".to_vec()),
        case("2^40 voxels as text", BAD, "a.nrrd", nrrd("1048576 1048576 1", "uchar", "ascii", b"1 2 3")),
        case("one number of many digits", BAD, "a.nrrd", nrrd("2 2 2", "uchar", "ascii", &vec![b'1'; 4 << 20])),
        case("2^48 voxels of VTI", BAD, "a.vti", b"<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 65535 0 65535 0 65535\"><Piece Extent=\"0 65535 0 65535 0 65535\"><PointData><DataArray type=\"UInt8\" Name=\"a\">1 2 3</DataArray></PointData></Piece></ImageData></VTKFile>".to_vec()),
    ];
    // A stream with much more than was declared is read to what was declared.
    cases.push(
        Case::new("more than declared", &[0, 3])
            .file("a.nrrd", nrrd("2 2 2", "uchar", "gzip", &zeros))
            .import(),
    );
    // Within what the user allows, the limit decides before memory is taken.
    let allowed = nrrd("1024 1024 200", "uchar", "gzip", &zeros);
    cases.push(
        Case::new("beyond --memory-limit", LIMIT)
            .file("a.nrrd", allowed.clone())
            .words("import a.nrrd -o out.ivd --memory-limit 100MiB")
            .says("memory"),
    );
    for case in &mut cases {
        if case.name.starts_with("200 MiB") || case.name.starts_with("25 million") {
            *case = case.clone().says("memory");
        }
    }
    cases
}
