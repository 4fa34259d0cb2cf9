"""scales.py IVD: DICOM series with slopes and intercepts, as other people's readers take what is written of them.

Makes a series each of an MR (slope 2.0222414), a CT (slope 1, intercept -1024, signed and unsigned) and a PET (a slope for every
slice), imports and exports it, and reads the files by SimpleITK and nibabel: values against the stored ones times their slope, within
1e-6 of their range; spacing and places against SimpleITK's own reading of the series. NIfTI must be version 1, a CT whole numbers.
Prints `N passed, N failed`.
"""
import gzip
import pathlib
import struct
import sys
import tempfile

import nibabel as nib
import numpy as np
import SimpleITK as sitk

from checks import check, ivd, outcome
from readers import vti

MR, CT, PET = (f"1.2.840.10008.5.1.4.1.1.{n}" for n in ("4", "2", "128"))
SHAPE = (4, 5, 6)
ROW, COLUMN = np.array([np.cos(0.3), np.sin(0.3), 0.0]), np.array([-np.sin(0.3), np.cos(0.3), 0.0])
SPACING, ORIGIN = (0.7, 0.9, 2.5), np.array([-31.25, 12.5, 40.0])
ENDINGS = ("nii", "nii.gz", "nrrd", "mha", "vti")
sitk.ProcessObject.SetGlobalWarningDisplay(False)


def element(group, number, kind, value):
    """An element in Explicit VR Little Endian (PS3.5, 7.1.2)."""
    if isinstance(value, str):
        value = value.encode() + (b"\0" if kind == "UI" else b" ") * (len(value) % 2)
    elif isinstance(value, int):
        value = struct.pack("<H", value)
    length = struct.pack("<HI", 0, len(value)) if kind in ("OB", "OW") else struct.pack("<H", len(value))
    return struct.pack("<HH", group, number) + kind.encode() + length + value


def numbers(values):
    return "\\".join(f"{v:.10g}" for v in values)


def slice_file(sop_class, at, pixels, slope, intercept):
    """The bytes of one slice: `pixels` [rows, columns] of 16 bits."""
    uid = f"1.2.826.0.1.3680043.8.1.{at + 1}"
    position = ORIGIN + at * SPACING[2] * np.cross(ROW, COLUMN)
    meta = element(2, 0x01, "OB", b"\0\1") + element(2, 0x02, "UI", sop_class) + element(2, 0x03, "UI", uid)
    meta += element(2, 0x10, "UI", "1.2.840.10008.1.2.1")
    meta = element(2, 0x00, "UL", struct.pack("<I", len(meta))) + meta
    modality = {MR: "MR", CT: "CT", PET: "PT"}[sop_class]
    body = [
        (0x08, 0x16, "UI", sop_class), (0x08, 0x18, "UI", uid), (0x08, 0x60, "CS", modality),
        (0x20, 0x0D, "UI", "1.2.826.0.1.3680043.8.2"), (0x20, 0x0E, "UI", "1.2.826.0.1.3680043.8.3"),
        (0x20, 0x11, "IS", "3"), (0x20, 0x13, "IS", str(at + 1)), (0x20, 0x32, "DS", numbers(position)),
        (0x20, 0x37, "DS", numbers([*ROW, *COLUMN])), (0x28, 0x02, "US", 1), (0x28, 0x04, "CS", "MONOCHROME2"),
        (0x28, 0x10, "US", pixels.shape[0]), (0x28, 0x11, "US", pixels.shape[1]),
        (0x28, 0x30, "DS", numbers([SPACING[1], SPACING[0]])), (0x28, 0x100, "US", 16), (0x28, 0x101, "US", 16),
        (0x28, 0x102, "US", 15), (0x28, 0x103, "US", int(pixels.dtype.kind == "i")),
        (0x28, 0x1052, "DS", intercept), (0x28, 0x1053, "DS", slope), (0x7FE0, 0x10, "OW", pixels.tobytes()),
    ]
    return b"\0" * 128 + b"DICM" + meta + b"".join(element(*one) for one in body)


def series(folder, sop_class, kind, scales):
    """Writes a series; gives its real values [z, y, x]."""
    folder.mkdir()
    top = 4095 if sop_class == CT else np.iinfo(kind).max
    stored = np.random.default_rng(7).integers(0, top, SHAPE, endpoint=True).astype(kind)
    stored[0, 0, :2] = 0, top
    for at, (slope, intercept) in enumerate(scales):
        (folder / f"{at}.dcm").write_bytes(slice_file(sop_class, at, stored[at], slope, intercept))
    each = np.array([[float(v) for v in scale] for scale in scales])
    return each[:, 0, None, None] * stored + each[:, 1, None, None]


def place(image):
    direction = np.array(image.GetDirection()).reshape(3, 3)
    return np.c_[direction * np.array(image.GetSpacing()), np.array(image.GetOrigin())]


def by_sitk(path):
    image = sitk.ReadImage(str(path))
    return sitk.GetArrayFromImage(image), place(image)


def by_nibabel(path):
    image = nib.load(str(path))
    return np.asarray(image.dataobj).transpose(2, 1, 0), np.diag([-1.0, -1.0, 1.0]) @ image.affine[:3]


def read_back(name, program, folder, real, whole):
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    expected_place = place(reader.Execute())
    artefact = folder.parent / f"{name}.ivd"
    ivd(program, "import", folder, "-o", artefact)
    for ending in ENDINGS:
        file = folder.parent / f"{name}.{ending}"
        ivd(program, "export", artefact, "-o", file)
        if ending.startswith("nii"):
            head = (gzip.open if ending.endswith("gz") else open)(file, "rb").read(4)
            check(f"{name}.{ending}: NIfTI-1", struct.unpack("<i", head)[0] == 348)
        by = [vti] if ending == "vti" else [by_sitk] + [by_nibabel] * ending.startswith("nii")
        for read in by:
            case = f"{name}.{ending} {read.__name__}"
            values, affine = read(file)
            error = np.abs(values.astype(np.float64) - real).max() / np.ptp(real)
            check(f"{case}: values", error <= 1e-6, f"{error} of the range")
            check(f"{case}: places", np.abs(affine - expected_place).max() < 1e-4, f"{affine}, {expected_place}")
            if whole:
                check(f"{case}: whole numbers", values.dtype == np.int16 and np.array_equal(values, real), values.dtype)


def main():
    program = sys.argv[1]
    every = lambda slope, intercept: [(slope, intercept)] * SHAPE[0]
    cases = {
        "mr": (MR, np.int16, every("2.0222414", "0"), False),
        "mr-shifted": (MR, np.uint16, every("0.4884005", "-1000.3"), False),
        "ct": (CT, np.int16, every("1", "-1024"), True),
        "ct-unsigned": (CT, np.uint16, every("1", "-1024"), True),
        "pet": (PET, np.int16, [("2.0222414", "0"), ("0.3141593", "0"), ("17.25", "0"), ("1e-3", "0")], False),
    }
    with tempfile.TemporaryDirectory() as made:
        for name, (sop_class, kind, scales, whole) in cases.items():
            folder = pathlib.Path(made) / name
            real = series(folder, sop_class, kind, scales)
            try:
                read_back(name, program, folder, real, whole)
            except RuntimeError as error:
                check(name, False, str(error))
    sys.exit(outcome())


main()
