use std::path::Path;

use ivd_core::{Reference, VoxelType};

use crate::Space;
use crate::volume::stored::FileType;
use crate::volume::{ByteOrder, Error};

/// Bytes of a NIfTI-1 header.
pub(super) const SIZE_1: usize = 348;
/// Bytes of a NIfTI-2 header.
pub(super) const SIZE_2: usize = 540;

/// The description of a file of ours whose affine says nothing of the patient.
pub(super) const NO_PATIENT: &[u8] = b"IVD: where the patient lies isn't known";

/// The fields of either version that place, type and scale the voxels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) version: u8,
    pub(super) order: ByteOrder,
    /// Header and voxels are in one file.
    pub(super) single: bool,
    pub(super) dim: [i64; 8],
    pub(super) intent: i32,
    pub(super) intent_name: String,
    /// Whether a file of ours says that its affine isn't the patient's.
    pub(super) disclaims_patient: bool,
    pub(super) datatype: i16,
    pub(super) bitpix: i16,
    pub(super) pixdim: [f64; 8],
    pub(super) vox_offset: f64,
    pub(super) scl_slope: f64,
    pub(super) scl_inter: f64,
    pub(super) xyzt_units: i32,
    pub(super) qform_code: i32,
    pub(super) sform_code: i32,
    /// Components b, c, d.
    pub(super) quatern: [f64; 3],
    pub(super) qoffset: [f64; 3],
    /// Rows x, y, z.
    pub(super) srow: [[f64; 4]; 3],
}

/// `intent_code` of displacements, along RAS.
const INTENT_DISPLACEMENTS: i32 = 1006;
/// `intent_code` of vectors; those of ITK and ANTs are along LPS.
const INTENT_VECTOR: i32 = 1007;

/// Numbers at fixed places, in the file's order.
struct Fields<'a> {
    bytes: &'a [u8],
    order: ByteOrder,
}

impl Fields<'_> {
    fn take<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes: [u8; N] = self.bytes[at..at + N].try_into().expect("a slice of N bytes");
        if self.order == ByteOrder::Big {
            bytes.reverse();
        }
        bytes
    }
    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.take(at))
    }
    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.take(at))
    }
    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.take(at))
    }
    fn f32(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.take(at)))
    }
    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.take(at))
    }
}

/// A text of fixed length, up to its first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// Version and byte order, told by the first field, the header's own size.
pub(super) fn version(bytes: &[u8]) -> Option<(u8, ByteOrder)> {
    let first: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
    for order in [ByteOrder::Little, ByteOrder::Big] {
        match (Fields { bytes: &first, order }).i32(0) {
            348 => return Some((1, order)),
            540 => return Some((2, order)),
            _ => {}
        }
    }
    None
}

impl Header {
    /// Decodes the bytes of a header. Values are checked later, by whoever uses them.
    pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Self, Error> {
        let Some((version, order)) = version(bytes) else {
            return Err(Error::field(path, "sizeof_hdr", "neither 348 (NIfTI-1) nor 540 (NIfTI-2)"));
        };
        let needed = if version == 1 { SIZE_1 } else { SIZE_2 };
        if bytes.len() < needed {
            return Err(Error::truncated(path, "header", needed as u64, bytes.len() as u64));
        }
        let fields = Fields { bytes, order };
        if version == 1 { Self::decode_1(path, &fields) } else { Self::decode_2(path, &fields) }
    }

    fn decode_1(path: &Path, f: &Fields) -> Result<Self, Error> {
        let single = match &f.bytes[344..348] {
            b"n+1\0" => true,
            b"ni1\0" => false,
            b"\0\0\0\0" => {
                return Err(Error::unsupported(
                    path,
                    "Analyze 7.5 (a header without NIfTI's magic)",
                    "it doesn't tell left from right: convert it to NIfTI with a tool that knows its origin",
                ));
            }
            other => return Err(magic(path, other)),
        };
        Ok(Self {
            version: 1,
            order: f.order,
            single,
            dim: std::array::from_fn(|i| i64::from(f.i16(40 + 2 * i))),
            intent: i32::from(f.i16(68)),
            intent_name: text(&f.bytes[328..344]),
            disclaims_patient: f.bytes[148..228].starts_with(NO_PATIENT),
            datatype: f.i16(70),
            bitpix: f.i16(72),
            pixdim: std::array::from_fn(|i| f.f32(76 + 4 * i)),
            vox_offset: f.f32(108),
            scl_slope: f.f32(112),
            scl_inter: f.f32(116),
            xyzt_units: i32::from(f.bytes[123]),
            qform_code: i32::from(f.i16(252)),
            sform_code: i32::from(f.i16(254)),
            quatern: std::array::from_fn(|i| f.f32(256 + 4 * i)),
            qoffset: std::array::from_fn(|i| f.f32(268 + 4 * i)),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f32(280 + 16 * r + 4 * c))),
        })
    }

    fn decode_2(path: &Path, f: &Fields) -> Result<Self, Error> {
        let single = match &f.bytes[4..12] {
            b"n+2\0\r\n\x1a\n" => true,
            b"ni2\0\r\n\x1a\n" => false,
            other => return Err(magic(path, other)),
        };
        Ok(Self {
            version: 2,
            order: f.order,
            single,
            dim: std::array::from_fn(|i| f.i64(16 + 8 * i)),
            intent: f.i32(504),
            intent_name: text(&f.bytes[508..524]),
            disclaims_patient: f.bytes[240..320].starts_with(NO_PATIENT),
            datatype: f.i16(12),
            bitpix: f.i16(14),
            pixdim: std::array::from_fn(|i| f.f64(104 + 8 * i)),
            vox_offset: f.i64(168) as f64,
            scl_slope: f.f64(176),
            scl_inter: f.f64(184),
            xyzt_units: f.i32(500),
            qform_code: f.i32(344),
            sform_code: f.i32(348),
            quatern: std::array::from_fn(|i| f.f64(352 + 8 * i)),
            qoffset: std::array::from_fn(|i| f.f64(376 + 8 * i)),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f64(400 + 32 * r + 8 * c))),
        })
    }

    /// What is known of the affine's space, by the code of the one that is read.
    pub(super) fn reference(&self) -> Reference {
        // What another program has placed since has another code.
        let ours = self.disclaims_patient && self.sform_code == 2 && matches!(self.qform_code, 0 | 2);
        let code = if self.sform_code > 0 { self.sform_code } else { self.qform_code };
        match code {
            ..=0 => Reference::Unknown,
            _ if ours => Reference::Unknown,
            2 => Reference::Aligned,
            3 => Reference::Talairach,
            4 => Reference::Mni,
            5 => Reference::Template,
            _ => Reference::Patient,
        }
    }

    /// The space of a field of three components, as ITK takes the intents; `None` where it is none.
    pub(super) fn space_of_field(&self) -> Option<Space> {
        let is_vectors = self.dim[0] == 5 && self.dim[4] <= 1 && self.dim[5] == 3;
        match self.intent {
            INTENT_VECTOR if is_vectors => Some(Space::Lps),
            INTENT_DISPLACEMENTS if is_vectors => Some(Space::Ras),
            _ => None,
        }
    }

    /// Voxels along x, y, z, and the number of frames.
    pub(super) fn sizes(&self, path: &Path) -> Result<([usize; 3], usize), Error> {
        let Some(rank) = usize::try_from(self.dim[0]).ok().filter(|n| (1..=7).contains(n)) else {
            return Err(Error::field(path, "dim[0]", format!("{} is not a rank of 1 to 7", self.dim[0])));
        };
        let mut sizes = [1_usize; 8];
        for a in 1..=rank {
            sizes[a] = crate::volume::bounded::size(path, &format!("dim[{a}]"), self.dim[a])?;
        }
        if let Some(a) = (5..8).find(|&a| sizes[a] > 1) {
            return Err(Error::unsupported(
                path,
                format!("a vector-valued image (dim[{a}] = {})", sizes[a]),
                crate::volume::bounded::vectors_remedy(sizes[a]),
            ));
        }
        Ok(([sizes[1], sizes[2], sizes[3]], sizes[4]))
    }

    /// The voxels' type; `bitpix` must agree, where it is given.
    pub(super) fn file_type(&self, path: &Path) -> Result<FileType, Error> {
        let file_type = match self.datatype {
            2 => FileType::Plain(VoxelType::U8),
            4 => FileType::Plain(VoxelType::I16),
            8 => FileType::Plain(VoxelType::I32),
            16 => FileType::Plain(VoxelType::F32),
            64 => FileType::Plain(VoxelType::F64),
            256 => FileType::Plain(VoxelType::I8),
            512 => FileType::Plain(VoxelType::U16),
            768 => FileType::Plain(VoxelType::U32),
            1024 => FileType::I64,
            1280 => FileType::U64,
            code => return Err(not_a_number(path, code)),
        };
        if self.bitpix != 0 && i64::from(self.bitpix) != 8 * file_type.bytes() as i64 {
            let problem =
                format!("{} bits, but datatype {} has {}", self.bitpix, self.datatype, 8 * file_type.bytes());
            return Err(Error::field(path, "bitpix", problem));
        }
        Ok(file_type)
    }

    /// Place of the first voxel in the file that holds the voxels.
    pub(super) fn offset(&self, path: &Path) -> Result<u64, Error> {
        let least = match (self.single, self.version) {
            (false, _) => 0.0,
            (true, 1) => 352.0,
            (true, _) => 544.0,
        };
        let at = self.vox_offset;
        if at == 0.0 {
            return Ok(least as u64);
        }
        if at.is_finite() && at >= least && at.fract() == 0.0 && at < 9e15 {
            return Ok(at as u64);
        }
        Err(Error::field(path, "vox_offset", format!("{at} is not a whole number of bytes from {least} on")))
    }

    /// Slope and intercept. As nibabel takes it: a slope of 0 or not finite means that there is none.
    pub(super) fn scale(&self, path: &Path) -> Result<(f64, f64), Error> {
        if self.scl_slope == 0.0 || !self.scl_slope.is_finite() {
            return Ok((1.0, 0.0));
        }
        if !self.scl_inter.is_finite() {
            let problem = format!("{} beside a slope of {}", self.scl_inter, self.scl_slope);
            return Err(Error::field(path, "scl_inter", problem));
        }
        Ok((self.scl_slope, self.scl_inter))
    }
}

/// NIfTI's code of a stored type.
pub(super) fn code(voxel_type: VoxelType) -> i16 {
    match voxel_type {
        VoxelType::U8 => 2,
        VoxelType::I16 => 4,
        VoxelType::I32 => 8,
        VoxelType::F32 => 16,
        VoxelType::F64 => 64,
        VoxelType::I8 => 256,
        VoxelType::U16 => 512,
        VoxelType::U32 => 768,
    }
}

fn magic(path: &Path, found: &[u8]) -> Error {
    Error::field(path, "magic", format!("\"{}\" is not NIfTI's", found.escape_ascii()))
}

fn not_a_number(path: &Path, code: i16) -> Error {
    let name = match code {
        1 => "single bits",
        32 | 1792 | 2048 => "complex numbers",
        128 | 2304 => "colours",
        1536 => "128-bit floats",
        _ => return Error::field(path, "datatype", format!("{code} is no known type")),
    };
    Error::unsupported(path, format!("datatype {code}, {name},"), "convert the file to one scalar a voxel")
}
