use std::io::{Seek, Write};
use std::path::Path;

use ::tiff::encoder::colortype::{
    ColorType, Gray8, Gray16, Gray32, Gray32Float, Gray64Float, GrayI8, GrayI16, GrayI32,
};
use ::tiff::encoder::{Rational, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard, TiffValue};
use ::tiff::tags::{ResolutionUnit, Tag};
use ::tiff::{TiffError, TiffResult};
use ivd_core::{Exec, Grid, Scalar, Volume, VoxelType, with_voxels};

use crate::volume::orientation;
use crate::volume::replace::replace;
use crate::volume::values::{Values, reals};
use crate::volume::{Error, Written};

/// Bytes that a page's tags may take in the file, generously, without the tables of its strips.
const TAGS: u64 = 1024;
/// The encoder begins another strip after so many bytes.
const STRIP: u64 = 1_000_000;
/// What a strip adds to the tables: its place and its length.
const STRIP_ENTRY: u64 = 8;

/// Writes a TIFF stack: a page a slice, the first page z = 0, uncompressed, the stored type kept.
///
/// The spacing goes where ImageJ looks for it: x and y in the resolution tags (pixels per cm), z in the description. That
/// doesn't count the pages as ImageJ's own files do, so that ImageJ goes from page to page. Origin and direction have no place in the format: where they aren't those of a file without a space, a note says
/// that they are left out. A volume with slope and intercept is written as real values. Beyond 4 GiB the file
/// is a BigTIFF. It is replaced at once, and left alone where it holds the same bytes.
///
/// # Errors
/// [`Error::Unsupported`] for a slice of more than 2³² − 1 voxels along x or y, [`Error::Io`] where the system refuses,
/// or a cancelled [`Error::Core`].
pub fn write_tiff(path: &Path, volume: &Volume, exec: &Exec) -> Result<Written, Error> {
    let grid = volume.grid();
    let values = Values::without_scale(volume);
    let bytes = file_bytes(grid.dims(), values.voxel_type(volume).bytes());
    let stack = Stack::new(path, grid, exec)?;
    let written = replace(path, |to| {
        if u32::try_from(bytes).is_ok() {
            stack.write::<TiffKindStandard, _>(to, values, volume)
        } else {
            stack.write::<TiffKindBig, _>(to, values, volume)
        }
    })?;
    say_what_is_left_out(path, grid, exec);
    Ok(written)
}

/// The most bytes that a file may have that isn't a BigTIFF.
fn file_bytes([nx, ny, nz]: [usize; 3], voxel: usize) -> u64 {
    let page = (nx * ny * voxel) as u64;
    let strips = page / STRIP + 1;
    nz as u64 * (page + TAGS + strips * STRIP_ENTRY)
}

fn say_what_is_left_out(path: &Path, grid: &Grid, exec: &Exec) {
    let plain = orientation::plain_grid(path, grid.dims(), grid.spacing());
    let same = plain.is_ok_and(|p| p.origin() == grid.origin() && p.direction() == grid.direction());
    let mut missing = if same { vec![] } else { vec!["origin and direction"] };
    if resolution(grid).is_none() {
        missing.push("a spacing of this size");
    }
    if !missing.is_empty() {
        let missing = missing.join(" and ");
        let note = format!("{}: TIFF can't hold {missing}: left out", path.display());
        exec.observer().note(&note);
    }
}

/// What all pages share.
struct Stack<'a> {
    path: &'a Path,
    exec: &'a Exec,
    /// Pixels along x and y.
    size: [u32; 2],
    /// Pixels per cm along x and y.
    resolution: Option<[Rational; 2]>,
    description: String,
}

impl<'a> Stack<'a> {
    fn new(path: &'a Path, grid: &Grid, exec: &'a Exec) -> Result<Self, Error> {
        let [nx, ny, nz] = grid.dims();
        let size = |n: usize| {
            u32::try_from(n).map_err(|_| {
                Error::unsupported(
                    path,
                    format!("a TIFF page {n} voxels wide"),
                    "write .nrrd or .nii instead",
                )
            })
        };
        let resolution = resolution(grid);
        // The key that ImageJ begins with is the version that the reader must understand. With `images=` it would take
        // all voxels from one place, back to back, but here every page's tags follow its voxels.
        let pages = format!("ImageJ=1.11a\nslices={nz}\nloop=false\n");
        let description = match &resolution {
            Some(_) => format!("{pages}unit=cm\nspacing={}\n", grid.spacing()[2] / MM_PER_CM),
            None => pages,
        };
        Ok(Self { path, exec, size: [size(nx)?, size(ny)?], resolution, description })
    }

    fn write<K: TiffKind, W: Write + Seek>(
        &self,
        to: W,
        values: Values,
        volume: &Volume,
    ) -> Result<(), Error> {
        let mut encoder = TiffEncoder::<W, K>::new_generic(to).map_err(|e| self.failure(e))?;
        let page = self.size[0] as usize * self.size[1] as usize;
        with_voxels!(volume.voxels(), slice => {
            for voxels in slice.chunks(page) {
                self.exec.check_cancelled()?;
                match values {
                    Values::Stored => self.page(&mut encoder, voxels),
                    Values::Real(VoxelType::U8) => self.page(&mut encoder, &reals::<u8, _>(volume, voxels)),
                    Values::Real(VoxelType::I8) => self.page(&mut encoder, &reals::<i8, _>(volume, voxels)),
                    Values::Real(VoxelType::U16) => self.page(&mut encoder, &reals::<u16, _>(volume, voxels)),
                    Values::Real(VoxelType::I16) => self.page(&mut encoder, &reals::<i16, _>(volume, voxels)),
                    Values::Real(VoxelType::U32) => self.page(&mut encoder, &reals::<u32, _>(volume, voxels)),
                    Values::Real(VoxelType::I32) => self.page(&mut encoder, &reals::<i32, _>(volume, voxels)),
                    Values::Real(VoxelType::F32) => self.page(&mut encoder, &reals::<f32, _>(volume, voxels)),
                    Values::Real(VoxelType::F64) => self.page(&mut encoder, &reals::<f64, _>(volume, voxels)),
                }
                .map_err(|e| self.failure(e))?;
            }
        });
        Ok(())
    }

    fn page<T: Grey, K: TiffKind, W: Write + Seek>(
        &self,
        encoder: &mut TiffEncoder<W, K>,
        voxels: &[T],
    ) -> TiffResult<()>
    where
        [T]: TiffValue,
    {
        let mut image = encoder.new_image::<T::Color>(self.size[0], self.size[1])?;
        if let Some([x, y]) = &self.resolution {
            image.resolution_unit(ResolutionUnit::Centimeter);
            image.x_resolution(x.clone());
            image.y_resolution(y.clone());
        }
        image.encoder().write_tag(Tag::ImageDescription, self.description.as_str())?;
        image.write_data(voxels)
    }

    fn failure(&self, error: TiffError) -> Error {
        match error {
            TiffError::IoError(e) => Error::io(self.path, "write", e),
            other => {
                Error::unsupported(self.path, format!("this volume as TIFF ({other})"), "write .nrrd or .nii")
            }
        }
    }
}

/// A stored type as TIFF's grey.
trait Grey: Scalar {
    type Color: ColorType<Inner = Self>;
}

macro_rules! grey {
    ($($stored:ty: $color:ty),*) => { $(impl Grey for $stored { type Color = $color; })* };
}
grey!(u8: Gray8, i8: GrayI8, u16: Gray16, i16: GrayI16, u32: Gray32, i32: GrayI32, f32: Gray32Float, f64: Gray64Float);

const MM_PER_CM: f64 = 10.0;

/// Pixels per cm along x and y; `None` where TIFF's fractions of 32 bits don't hold them.
fn resolution(grid: &Grid) -> Option<[Rational; 2]> {
    let [x, y, _] = grid.spacing();
    Some([fraction(MM_PER_CM / x)?, fraction(MM_PER_CM / y)?])
}

/// The last convergent of a number's continued fraction that fits 32 bits; `None` where it would be 0 or infinite.
fn fraction(value: f64) -> Option<Rational> {
    let most = f64::from(u32::MAX);
    let (mut before, mut now) = ([0.0, 1.0], [1.0, 0.0]);
    let mut rest = value;
    loop {
        let whole = rest.floor();
        let next = [whole * now[0] + before[0], whole * now[1] + before[1]];
        // `rest` may be infinite, and then `next` is not a number.
        if !(next[0] <= most && next[1] <= most) {
            break;
        }
        (before, now) = (now, next);
        rest = 1.0 / (rest - whole);
    }
    (now[0] > 0.0 && now[1] > 0.0).then_some(Rational { n: now[0] as u32, d: now[1] as u32 })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use ivd_core::Voxels;

    use super::*;
    use crate::volume::stack::read_tiff;

    #[test]
    fn a_big_tiff_holds_what_a_small_one_holds() {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid::with_spacing([3, 2, 2], [0.7, 0.5, 2.5]).unwrap();
        let volume = Volume::new(grid, Voxels::from((0..12_i16).map(|v| v - 5).collect::<Vec<_>>())).unwrap();
        let exec = Exec::default();
        let stack = Stack::new(folder.path(), volume.grid(), &exec).unwrap();
        let (mut small, mut big) = (Cursor::new(Vec::new()), Cursor::new(Vec::new()));
        stack.write::<TiffKindStandard, _>(&mut small, Values::Stored, &volume).unwrap();
        stack.write::<TiffKindBig, _>(&mut big, Values::Stored, &volume).unwrap();
        for (bytes, version) in [(small.into_inner(), 42), (big.into_inner(), 43)] {
            let path = folder.path().join("a.tif");
            std::fs::write(&path, &bytes).unwrap();
            assert!(bytes[2..4].contains(&version));
            let back = read_tiff(&path, None, &exec).unwrap();
            assert_eq!(back.voxels(), volume.voxels());
            assert_eq!(back.grid().spacing(), [0.7, 0.5, 2.5]);
        }
    }

    #[test]
    fn a_file_is_never_longer_than_what_decides_on_its_kind() {
        let exec = Exec::default();
        for dims in [[1, 1, 1], [3, 2, 40], [1000, 4001, 2], [700_001, 3, 2], [1_000_001, 4, 1]] {
            let grid = Grid::with_spacing(dims, [0.7, 1.0 / 3.0, 1e-11 / 3.0]).unwrap();
            let volume = Volume::new(grid, Voxels::from(vec![7_u8; dims.iter().product()])).unwrap();
            let mut small = Cursor::new(Vec::new());
            let stack = Stack::new(Path::new("a.tif"), volume.grid(), &exec).unwrap();
            stack.write::<TiffKindStandard, _>(&mut small, Values::Stored, &volume).unwrap();
            let (found, most) = (small.into_inner().len() as u64, file_bytes(dims, 1));
            assert!(found <= most && most - found <= dims[2] as u64 * TAGS, "{dims:?}: {found}, {most}");
        }
        // 17 kB below 4 GiB, where the strips' tables alone take 34.
        assert!(u32::try_from(file_bytes([50_000, 85_899, 1], 1)).is_err());
        assert!(u32::try_from(file_bytes([50_000, 85_800, 1], 1)).is_ok());
    }

    #[test]
    fn the_description_leaves_the_count_of_pages_to_the_file() {
        let exec = Exec::default();
        for (spacing, said) in [
            ([0.7, 0.5, 2.5], "ImageJ=1.11a\nslices=4\nloop=false\nunit=cm\nspacing=0.25\n"),
            ([1e-10, 0.5, 2.5], "ImageJ=1.11a\nslices=4\nloop=false\n"),
        ] {
            let grid = Grid::with_spacing([3, 2, 4], spacing).unwrap();
            assert_eq!(Stack::new(Path::new("a.tif"), &grid, &exec).unwrap().description, said);
        }
    }

    #[test]
    fn fractions_give_the_number_back_within_its_last_digit() {
        for value in [1.0, 10.0, 10.0 / 0.7, 10.0 / 0.898_437, 1.0 / 3.0, 1e9, 1e-9, std::f64::consts::PI] {
            let Rational { n, d } = fraction(value).unwrap();
            let error = (f64::from(n) / f64::from(d) - value).abs() / value;
            assert!(error <= 1e-15, "{value} = {n} / {d}: {error}");
        }
        let Rational { n, d } = fraction(10.0 / 0.7).unwrap();
        assert_eq!((n, d), (100, 7));
        assert!(fraction(1e10).is_none() && fraction(1e-10).is_none());
    }
}
