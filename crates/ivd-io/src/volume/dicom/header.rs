use std::path::{Path, PathBuf};

use super::element::{self, Elements, PixelData, Tag, number16, text};
use super::kind::{self, Kind};
use super::syntax::Syntax;
use crate::volume::Error;

const SOP_CLASS: Tag = (0x0008, 0x0016);
const MODALITY: Tag = (0x0008, 0x0060);
const SERIES_DESCRIPTION: Tag = (0x0008, 0x103e);
const SLICE_THICKNESS: Tag = (0x0018, 0x0050);
const SPACING_BETWEEN: Tag = (0x0018, 0x0088);
const IMAGER_SPACING: Tag = (0x0018, 0x1164);
const SERIES_UID: Tag = (0x0020, 0x000e);
const SERIES_NUMBER: Tag = (0x0020, 0x0011);
const POSITION: Tag = (0x0020, 0x0032);
const ORIENTATION: Tag = (0x0020, 0x0037);
const SAMPLES: Tag = (0x0028, 0x0002);
const PHOTOMETRIC: Tag = (0x0028, 0x0004);
const FRAMES: Tag = (0x0028, 0x0008);
const ROWS: Tag = (0x0028, 0x0010);
const COLUMNS: Tag = (0x0028, 0x0011);
const PIXEL_SPACING: Tag = (0x0028, 0x0030);
const BITS_ALLOCATED: Tag = (0x0028, 0x0100);
const BITS_STORED: Tag = (0x0028, 0x0101);
const HIGH_BIT: Tag = (0x0028, 0x0102);
const REPRESENTATION: Tag = (0x0028, 0x0103);
const INTERCEPT: Tag = (0x0028, 0x1052);
const SLOPE: Tag = (0x0028, 0x1053);
const MODALITY_LUT: Tag = (0x0028, 0x3000);
/// What names a patient. Read only to mask its words in the series' description.
const PATIENT: [Tag; 7] = [
    (0x0008, 0x0050),
    (0x0010, 0x0010),
    (0x0010, 0x0020),
    (0x0010, 0x0030),
    (0x0010, 0x1000),
    (0x0010, 0x1001),
    (0x0010, 0x1060),
];
const WANTED: [Tag; 23] = [
    SOP_CLASS,
    MODALITY,
    SERIES_DESCRIPTION,
    SLICE_THICKNESS,
    SPACING_BETWEEN,
    IMAGER_SPACING,
    SERIES_UID,
    SERIES_NUMBER,
    POSITION,
    ORIENTATION,
    SAMPLES,
    PHOTOMETRIC,
    FRAMES,
    ROWS,
    COLUMNS,
    PIXEL_SPACING,
    BITS_ALLOCATED,
    BITS_STORED,
    HIGH_BIT,
    REPRESENTATION,
    INTERCEPT,
    SLOPE,
    MODALITY_LUT,
];

/// How a pixel's bits lie in its word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bits {
    /// 8, 16 or 32.
    pub(super) allocated: u16,
    pub(super) stored: u16,
    pub(super) high: u16,
    pub(super) signed: bool,
}

/// What one file tells about its image.
#[derive(Debug, Clone)]
pub(super) struct Slice {
    pub(super) path: PathBuf,
    /// What it is where it is no plain slice.
    pub(super) kind: Option<Kind>,
    pub(super) series_uid: String,
    pub(super) series_number: Option<i64>,
    pub(super) modality: String,
    /// With the patient's words masked.
    pub(super) description: String,
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Centre of the first pixel (mm), LPS.
    pub(super) position: Option<[f64; 3]>,
    /// Directions of growing column index and of growing row index, LPS.
    pub(super) orientation: Option<[[f64; 3]; 2]>,
    /// Distance of rows, distance of columns (mm).
    pub(super) pixel_spacing: Option<[f64; 2]>,
    /// Distance to the next slice, or thickness (mm): for a single slice.
    pub(super) thickness: Option<f64>,
    pub(super) slope: f64,
    pub(super) intercept: f64,
    pub(super) bits: Bits,
    pub(super) frames: i64,
    pub(super) samples: u16,
    pub(super) photometric: String,
    /// MONOCHROME1.
    pub(super) inverted: bool,
    pub(super) lookup_table: bool,
    pub(super) syntax: Syntax,
    pub(super) pixel_data: PixelData,
    /// Bytes of the file from the pixels on.
    pub(super) available: u64,
}

/// Reads a file's header; `None` where it holds no image.
pub(super) fn read(path: &Path) -> Result<Option<Slice>, Error> {
    let wanted: Vec<Tag> = WANTED.iter().chain(&PATIENT).copied().collect();
    let elements = element::read(path, &wanted)?;
    let values = Values { path, elements: &elements };
    if !elements.values.contains_key(&ROWS) {
        return Ok(None);
    }
    let pixel_data = elements.pixel_data.ok_or_else(|| Error::field(path, "PixelData", "missing"))?;
    let photometric = values.text(PHOTOMETRIC);
    let allocated = values.u16(BITS_ALLOCATED, "BitsAllocated")?;
    let stored = values.u16(BITS_STORED, "BitsStored").unwrap_or(allocated);
    Ok(Some(Slice {
        path: path.to_owned(),
        kind: kind::of(&values.text(SOP_CLASS)),
        series_uid: values.text(SERIES_UID),
        series_number: values.text(SERIES_NUMBER).parse().ok(),
        modality: values.text(MODALITY),
        description: values.description(),
        rows: usize::from(values.u16(ROWS, "Rows")?),
        columns: usize::from(values.u16(COLUMNS, "Columns")?),
        position: values.numbers(POSITION, "ImagePositionPatient")?,
        orientation: values
            .numbers(ORIENTATION, "ImageOrientationPatient")?
            .map(|[a, b, c, d, e, f]: [f64; 6]| [[a, b, c], [d, e, f]]),
        pixel_spacing: match values.numbers(PIXEL_SPACING, "PixelSpacing")? {
            None => values.numbers(IMAGER_SPACING, "ImagerPixelSpacing")?,
            own => own,
        },
        thickness: match values.numbers::<1>(SPACING_BETWEEN, "SpacingBetweenSlices")? {
            None => values.numbers(SLICE_THICKNESS, "SliceThickness")?.map(|[t]: [f64; 1]| t),
            Some([between]) => Some(between),
        },
        slope: values.numbers(SLOPE, "RescaleSlope")?.map_or(1.0, |[v]: [f64; 1]| v),
        intercept: values.numbers(INTERCEPT, "RescaleIntercept")?.map_or(0.0, |[v]: [f64; 1]| v),
        bits: Bits {
            allocated,
            stored,
            high: values.u16(HIGH_BIT, "HighBit").unwrap_or(stored.wrapping_sub(1)),
            signed: match values.u16(REPRESENTATION, "PixelRepresentation").unwrap_or(0) {
                0 => false,
                1 => true,
                other => {
                    let problem = format!("{other} is neither 0 (unsigned) nor 1 (signed)");
                    return Err(Error::field(path, "PixelRepresentation", problem));
                }
            },
        },
        frames: values.text(FRAMES).parse().unwrap_or(1),
        samples: values.u16(SAMPLES, "SamplesPerPixel").unwrap_or(1),
        inverted: photometric == "MONOCHROME1",
        photometric,
        lookup_table: elements.values.contains_key(&MODALITY_LUT),
        syntax: elements.syntax,
        pixel_data,
        available: elements.length - pixel_data.offset,
    }))
}

/// Access to the values of a file by their kind.
struct Values<'a> {
    path: &'a Path,
    elements: &'a Elements,
}

impl Values<'_> {
    fn text(&self, tag: Tag) -> String {
        self.elements.values.get(&tag).map(|v| text(v)).unwrap_or_default()
    }

    fn u16(&self, tag: Tag, name: &str) -> Result<u16, Error> {
        match self.elements.values.get(&tag).map(Vec::as_slice) {
            Some(&[a, b, ..]) => Ok(number16([a, b], self.elements.syntax.order())),
            Some(_) => Err(Error::field(self.path, name, "no number")),
            None => Err(Error::field(self.path, name, "missing")),
        }
    }

    /// Decimal numbers separated by `\`; `None` where the attribute is absent or empty.
    fn numbers<const N: usize>(&self, tag: Tag, name: &str) -> Result<Option<[f64; N]>, Error> {
        let text = self.text(tag);
        if text.is_empty() {
            return Ok(None);
        }
        let numbers: Vec<f64> =
            text.split('\\').map_while(|w| w.trim().parse().ok()).filter(|v: &f64| v.is_finite()).collect();
        let problem = || Error::field(self.path, name, format!("not {N} finite numbers"));
        Ok(Some(numbers.try_into().map_err(|_| problem())?))
    }

    /// The series' description without words that name the patient.
    fn description(&self) -> String {
        let names: Vec<String> = PATIENT
            .iter()
            .flat_map(|&tag| words(&self.text(tag)).map(str::to_owned).collect::<Vec<_>>())
            .collect();
        let description = self.text(SERIES_DESCRIPTION).to_uppercase();
        let masked: Vec<&str> = words(&description)
            .map(|w| {
                // A name may be glued to other letters; initials are too short to tell.
                let named = names.iter().any(|n| n.len() > 1 && w.contains(&n.to_uppercase()));
                if named { "***" } else { w }
            })
            .take(12)
            .collect();
        masked.join(" ")
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty())
}

impl Slice {
    /// Refuses images that can't become a slice of a scalar volume.
    pub(super) fn check_readable(&self) -> Result<(), Error> {
        let refuse = |what: String, remedy: &str| Err(Error::unsupported(&self.path, what, remedy));
        if let Some(Kind { what, remedy }) = self.kind {
            let frames = if self.frames > 1 { format!(" ({} frames)", self.frames) } else { String::new() };
            return refuse(format!("{what}{frames},"), remedy);
        }
        if self.samples != 1 || !matches!(self.photometric.as_str(), "MONOCHROME1" | "MONOCHROME2" | "") {
            let shown: String = self
                .photometric
                .chars()
                .filter(|c| c.is_ascii_alphanumeric() || *c == '_' || *c == ' ')
                .collect();
            return refuse(
                format!("a colour image ({shown}, {} samples)", self.samples),
                "convert it to grey",
            );
        }
        if self.frames != 1 {
            return refuse(
                format!("a multi-frame image ({} frames)", self.frames),
                "convert it to single-frame files or NIfTI",
            );
        }
        if self.lookup_table {
            return refuse("ModalityLUTSequence".into(), "convert the series with its lookup table applied");
        }
        let Bits { allocated, stored, high, .. } = self.bits;
        if !matches!(allocated, 8 | 16 | 32) {
            return refuse(format!("BitsAllocated {allocated}"), "convert the series to 8, 16 or 32 bit");
        }
        if stored == 0 || stored > allocated || high >= allocated || high + 1 < stored {
            let problem = format!("{stored} bits below bit {high} of {allocated}");
            return Err(Error::field(&self.path, "BitsStored, HighBit", problem));
        }
        if !self.slope.is_finite() || self.slope == 0.0 || !self.intercept.is_finite() {
            let problem = format!("slope {}, intercept {}", self.slope, self.intercept);
            return Err(Error::field(&self.path, "RescaleSlope", problem));
        }
        Ok(())
    }
}
