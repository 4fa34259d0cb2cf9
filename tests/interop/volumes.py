"""volumes.py IVD: every real volume through every format, read back by other people's readers.

For each volume of ../shared/data: `ivd import`, then `ivd export` to every format; voxels, spacing, origin and direction
of what was written must equal SimpleITK's own reading of the source. nibabel, pynrrd, VTK and tifffile read what they can,
too. A TIFF keeps values and spacing alone: the latter by tifffile's reading of ImageJ's description, x and y by SimpleITK's.
The sources that SimpleITK can't read (VTI, raw slices) are read by VTK and numpy. Values may differ by the rounding of the
format's f32 where a slope is not 1, places by 1e-3 mm.
Prints `N passed, N failed`.
"""
import pathlib, subprocess, sys, tempfile, zlib

import nibabel as nib
import nrrd
import numpy as np
import SimpleITK as sitk
import tifffile

from checks import check, outcome
from readers import vti

IVD = pathlib.Path(sys.argv[1]).resolve()
DATA = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"
ENDINGS = ["nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "vti", "tif", "raw"]
PLACE_MM = 1e-3
LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0])
sitk.ProcessObject.SetGlobalWarningDisplay(False)


class Volume:
    """Real values indexed [z, y, x], and the voxel-to-world affine (3 × 4) in LPS mm; None where a format has none, with
    the spacing along as many axes as it has."""

    def __init__(self, values, affine, spacing=()):
        self.values, self.affine, self.spacing = np.asarray(values), affine, spacing

    def corners(self):
        n = np.array(self.values.shape[::-1]) - 1
        at = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)]) * n
        return at @ self.affine[:, :3].T + self.affine[:, 3]


def of_image(image):
    direction = np.array(image.GetDirection()).reshape(3, 3)
    affine = np.c_[direction * np.array(image.GetSpacing()), np.array(image.GetOrigin())]
    return Volume(sitk.GetArrayFromImage(image), affine)


def by_sitk(path):
    return of_image(sitk.ReadImage(str(path)))


def series_by_sitk(folder):
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    return of_image(reader.Execute())


def by_nibabel(path):
    image = nib.load(str(path))
    values = np.asarray(image.dataobj).transpose(2, 1, 0)
    return Volume(values, LPS_TO_RAS @ image.affine[:3])


def by_pynrrd(path):
    values, header = nrrd.read(str(path))
    affine = np.c_[np.array(header["space directions"]).T, np.array(header["space origin"])]
    return Volume(values.transpose(2, 1, 0), affine)


def by_vtk(path):
    # VTK's world has no anatomy: its coordinates are LPS to the program, as they are to ITK.
    return Volume(*vti(path))


def tiff_by_sitk(path):
    """SimpleITK knows the distance of pixels, not that of pages, and no 32-bit integers."""
    image = sitk.ReadImage(str(path))
    return Volume(sitk.GetArrayFromImage(image), None, image.GetSpacing()[:2])


def by_tifffile(path):
    with tifffile.TiffFile(path) as file:
        tags, said = file.pages[0].tags, file.imagej_metadata
        cm = [tags[name].value[1] / tags[name].value[0] for name in ("XResolution", "YResolution")]
        assert said["unit"] == "cm" and tags["ResolutionUnit"].value == 3 and said["slices"] == len(file.pages)
        assert "images" not in said, "ImageJ would read the tags between the pages as voxels"
        # Page by page: ImageJ's own layout is another matter.
        values = np.stack([page.asarray() for page in file.pages])
        whole = file.asarray().reshape(values.shape)
        assert np.array_equal(values, whole, equal_nan=values.dtype.kind == "f"), "as pages and as a whole"
        return Volume(values, None, [10 * s for s in (*cm, said["spacing"])])


def frog(folder):
    """Its header gives a CompressedDataSize that is too small: SimpleITK leaves the last voxels unread."""
    header = dict(line.split(" = ") for line in (folder / "frogtissue.mhd").read_text().splitlines())
    dims = [int(n) for n in header["DimSize"].split()]
    values = np.frombuffer(zlib.decompress((folder / "frogtissue.zraw").read_bytes()), np.uint8)
    spacing = [float(s) for s in header["ElementSpacing"].split()]
    return Volume(values.reshape(dims[::-1]), np.c_[np.diag(spacing), np.zeros(3)])


def raw_slices(folder, numbers, dims, spacing):
    values = np.stack([np.fromfile(folder / f"CThead.{i}", ">u2").reshape(dims[1], dims[0]) for i in numbers])
    return Volume(values, np.c_[np.diag(spacing), np.zeros(3)])


def sources():
    """Path, words for `ivd import`, and the volume as others read it."""
    for pattern in ["*/*.nii.gz", "hippocampus_msd/*/*.nii.gz", "*/*.nrrd", "*/*.nhdr", "*/*.mhd"]:
        for path in sorted(DATA.glob(pattern)):
            load = frog if path.name == "frogtissue.mhd" else by_sitk
            yield path, [], lambda path=path, load=load: load(path.parent if load is frog else path)
    yield DATA / "mri_brain_dicom", [], lambda: series_by_sitk(DATA / "mri_brain_dicom")
    yield DATA / "ct_abdomen_ts" / "dicom_j2k", [], lambda: series_by_sitk(DATA / "ct_abdomen_ts" / "dicom_j2k")
    yield DATA / "vase" / "vase_1comp.vti", [], lambda: by_vtk(DATA / "vase" / "vase_1comp.vti")
    layout = ["--raw-dims", "256,256,113", "--raw-type", "u16", "--raw-spacing", "1,1,2", "--raw-order", "big"]
    head = DATA / "ct_head_unc"
    yield head, layout, lambda: raw_slices(head, range(1, 114), (256, 256), (1, 1, 2))


def raw(file, expected):
    """A raw file doesn't tell its type: the source's own, or f32 where it has a slope or intercept."""
    own = expected.values.dtype.newbyteorder("<")
    for kind in (own, np.dtype("<f4")):
        if file.stat().st_size == kind.itemsize * expected.values.size:
            found = Volume(np.fromfile(file, kind).reshape(expected.values.shape), None)
            if np.allclose(found.values, expected.values, rtol=0, atol=1):
                return found
    raise ValueError(f"{file.stat().st_size} bytes are neither {own} nor f32")


def same(name, found, expected):
    check(f"{name}: dims", found.values.shape == expected.values.shape, f"{found.values.shape}, {expected.values.shape}")
    if found.values.shape != expected.values.shape:
        return
    scale = max(float(np.abs(expected.values).max()), 1.0)
    difference = float(np.abs(found.values.astype(np.float64) - expected.values).max())
    exact = np.issubdtype(expected.values.dtype, np.integer)
    check(f"{name}: values", difference <= (0 if exact else 1e-6 * scale), f"differ by {difference}")
    if found.affine is None:
        meant = np.linalg.norm(expected.affine[:, :3], axis=0)[: len(found.spacing)]
        check(f"{name}: spacing", np.allclose(found.spacing, meant, rtol=1e-6, atol=0), f"{found.spacing}, {meant}")
        return
    apart = float(np.linalg.norm(found.corners() - expected.corners(), axis=1).max())
    check(f"{name}: places", apart <= PLACE_MM, f"{apart} mm")


def readers(ending, file, expected):
    """Each reader that knows the format, by name."""
    if ending == "raw":
        yield "numpy", lambda: raw(file, expected)
        return
    if ending == "vti":
        yield "VTK", lambda: by_vtk(file)
        return
    if ending == "tif":
        yield "tifffile", lambda: by_tifffile(file)
        if expected.values.dtype.kind == "f" or expected.values.dtype.itemsize < 4:
            yield "SimpleITK", lambda: tiff_by_sitk(file)
        return
    yield "SimpleITK", lambda: by_sitk(file)
    if ending in ("nii", "nii.gz"):
        yield "nibabel", lambda: by_nibabel(file)
    if ending in ("nrrd", "nhdr"):
        yield "pynrrd", lambda: by_pynrrd(file)


def run(*words):
    done = subprocess.run([IVD, *map(str, words)], capture_output=True, text=True)
    return done.returncode, done.stderr.strip()


def volume(path, words, expected, folder):
    name = str(path.relative_to(DATA))
    artefact = folder / "volume.ivd"
    code, said = run("import", path, "-o", artefact, *words)
    check(f"{name}: import", code == 0, said)
    if code != 0:
        return
    for number, ending in enumerate(ENDINGS):
        # A stem of its own for each: .nhdr, .mhd and .raw all leave a .raw file.
        file = folder / f"written{number}.{ending}"
        code, said = run("export", artefact, "-o", file)
        check(f"{name} -> {ending}: export", code == 0, said)
        if code != 0:
            continue
        for reader, load in readers(ending, file, expected):
            try:
                found = load()
            except Exception as error:
                check(f"{name} -> {ending} by {reader}", False, repr(error))
                continue
            same(f"{name} -> {ending} by {reader}", found, expected)


def main():
    if not DATA.is_dir():
        print(f"no data at {DATA}; 0 passed, 0 failed")
        return
    for path, words, load in sources():
        expected = load()
        with tempfile.TemporaryDirectory() as folder:
            volume(path, words, expected, pathlib.Path(folder))
    sys.exit(outcome())


main()
