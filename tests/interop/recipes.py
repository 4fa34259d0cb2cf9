"""Every output of every recipe, opened by other programs' readers: python recipes.py PATH/TO/ivd

Runs docs/recipes.md word for word on generated heads, and opens what comes of it by SimpleITK, nibabel, VTK and trimesh: volumes have the
values, the spacing and the place that `ivd` exports from the artefact in raw bytes; meshes have the lattice's places and triangles; the series of
frames ends in the motion's last, and the animation lasts as long as was asked. Prints `N passed, N failed`; the exit code is 1 where something failed.
"""

import json
import os
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import nibabel as nib
import numpy as np
import SimpleITK as sitk
import trimesh
import vtk

from checks import check, ivd, outcome
from readers import vti

PAGE = Path(__file__).resolve().parent / "../../docs/recipes.md"


def begin(program, at):
    """The files that recipes begin with: a head in MR and its labels, and a shell in something like CT."""
    ivd(program, "phantom", "head", "--size", 96, "--noise", 0.02, "-o", at / "h.ivd", "--truth", at / "t.ivd")
    ivd(program, "export", at / "h.ivd", "-o", at / "head.nii.gz")
    ivd(program, "export", at / "h.ivd", "-o", at / "slices.tif")
    ivd(program, "export", at / "t.ivd", "-o", at / "organs.nii.gz")
    ivd(program, "phantom", "shell", "--size", 96, "-o", at / "s.ivd")
    ivd(program, "export", at / "s.ivd", "-o", at / "s.nii")
    image = sitk.ReadImage(str(at / "s.nii"))
    image = sitk.Cast(image, sitk.sitkInt16) * 10 - 1000
    sitk.WriteImage(image, str(at / "ct.nii.gz"))
    sitk.GetArrayFromImage(image).tofile(at / "ct.raw")


def run_page(program, at):
    """Every scene is written, every command run; gives the commands."""
    bin_folder = at / "bin"
    bin_folder.mkdir()
    (bin_folder / "ivd").symlink_to(program)
    environment = dict(os.environ, PATH=f"{bin_folder}:{os.environ['PATH']}", IVD_CACHE=str(at / "cache"))
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(), re.S)
    for language, block in blocks:
        if language == "toml":
            (at / block.splitlines()[0].removeprefix("# ")).write_text(block)
            continue
        done = subprocess.run(["sh", "-euc", block], cwd=at, env=environment, capture_output=True, text=True)
        check(f"`{block.splitlines()[0]}` and what follows", done.returncode == 0, done.stderr)
    return [block for language, block in blocks if language == "sh"]


TYPES = {"u8": "u1", "i8": "i1", "u16": "<u2", "i16": "<i2", "u32": "<u4", "i32": "<i4", "f32": "<f4", "f64": "<f8"}


def truth(program, at, artefact):
    """An artefact's real values, from the bytes that `ivd` writes without a header, and its grid."""
    raw = at / "truth.raw"
    raw.unlink(missing_ok=True)
    ivd(program, "export", artefact, "-o", raw)
    told = json.loads(subprocess.run([program, "info", artefact, "--json"], capture_output=True, text=True, check=True).stdout)
    content = told["content"]
    # Labels are written in as few bytes as they need.
    voxels = int(np.prod(content["grid"]["dims"]))
    stored = np.fromfile(raw, TYPES[content.get("type", f"u{8 * raw.stat().st_size // voxels}")])
    values = stored.reshape(content["grid"]["dims"][::-1]) * content.get("slope", 1.0) + content.get("intercept", 0.0)
    return values, content["grid"]


def by_itk(path):
    image = sitk.ReadImage(str(path))
    turn = np.diag([-1.0, -1.0, 1.0])
    columns = turn @ np.array(image.GetDirection()).reshape(3, 3)
    return sitk.GetArrayFromImage(image).astype(float), image.GetSpacing(), columns, turn @ np.array(image.GetOrigin())


def with_place(values, affine):
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    return np.asarray(values, float), spacing, affine[:3, :3] / spacing, affine[:3, 3]


def by_nibabel(path):
    image = nib.load(path)
    return with_place(np.asarray(image.dataobj).T, image.affine)


def by_vtk(path):
    return with_place(*vti(path))


def check_volume(name, found, values, told, to_ras=np.eye(3)):
    read, spacing, columns, origin = found
    check(f"{name}: values", read.shape == values.shape and np.array_equal(read, values), f"{read.shape} {np.abs(read - values).max() if read.shape == values.shape else ''}")
    check(f"{name}: spacing", np.allclose(spacing, told["spacing"], rtol=1e-6), f"{spacing} {told['spacing']}")
    check(f"{name}: origin", np.allclose(to_ras @ origin, told["origin"], atol=1e-4), f"{origin} {told['origin']}")
    check(f"{name}: axes", np.allclose(to_ras @ columns, np.array(told["direction"]).T, atol=1e-6), f"{columns}")


def mesh_of(program, at, lattice, motion=None):
    """A lattice's places and triangles, by its PLY in RAS with the first reader's own code left out."""
    text = at / "truth.obj"
    words = ["export", motion or lattice, "-o", text] + (["--lattice", lattice] if motion else [])
    ivd(program, *words)
    rows = [line.split() for line in text.read_text().splitlines()]
    places = np.array([row[1:4] for row in rows if row and row[0] == "v"], float)
    faces = np.array([[int(corner.split("/")[0]) - 1 for corner in row[1:4]] for row in rows if row and row[0] == "f"])
    return places, faces


def corners(places, faces):
    """Corners of the triangles, in their order: what is equal whichever vertices a format repeats."""
    return np.asarray(places)[np.asarray(faces)]


def check_fields(program, at):
    """Grid transforms: displacements in LPS (mm), from the deformed to the rest and back."""
    for name in ("to-rest.nrrd", "to-deformed.nrrd"):
        image = sitk.ReadImage(str(at / name))
        vectors = sitk.GetArrayFromImage(image)
        check(f"{name}: vectors of three", vectors.shape[-1] == 3 and np.isfinite(vectors).all(), vectors.shape)
        largest = np.linalg.norm(vectors, axis=-1).max()
        check(f"{name}: moves by the 5 mm that were asked", 4.5 < largest < 5.2, largest)
        check(f"{name}: a transform of ITK", sitk.DisplacementFieldTransform(sitk.Cast(image, sitk.sitkVectorFloat64)).GetDimension() == 3)
    # Back and there again is where a voxel was: what leads back is the other's inverse at its voxels, and linear only between them.
    forward, back = (
        sitk.DisplacementFieldTransform(sitk.Cast(sitk.ReadImage(str(at / f"{name}.nrrd")), sitk.sitkVectorFloat64))
        for name in ("to-deformed", "to-rest")
    )
    for place in [(-48.0, -85.0, 48.0), (-40.0, -80.0, 52.0), (-52.0, -70.0, 40.0)]:
        again = forward.TransformPoint(back.TransformPoint(place))
        check(f"back from {place} and there again", np.linalg.norm(np.array(again) - place) < 1e-3, again)


def check_animation(at):
    """Duration of the GLB, its frames, and that its last is the motion's end."""
    data = (at / "frames/press.glb").read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    gltf = json.loads(data[20 : 20 + length])
    animation = gltf["animations"][0]
    times = gltf["accessors"][animation["samplers"][0]["input"]]
    check("press.glb: lasts half a second", np.isclose(times["max"][0], 0.5), times)
    check("press.glb: a target for every frame", len(gltf["meshes"][0]["primitives"][0]["targets"]) == 10)
    loaded = trimesh.load(at / "frames/press.glb", process=False)
    check("press.glb: trimesh opens it", sum(len(g.faces) for g in loaded.geometry.values()) > 100)
    frames = [by_nibabel(at / f"frames/frames/press_{i:04}.nii.gz")[0] for i in range(10)]
    check("frames: all different", all((a != b).any() for a, b in zip(frames, frames[1:])))


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        begin(program, at)
        run_page(program, at)
        values, told = truth(program, at, at / "scan.ivd")
        for name in ("scan.nrrd", "scan.mha", "scan.nii"):
            check_volume(f"ITK, {name}", by_itk(at / name), values, told)
        check_volume("nibabel, scan.nii", by_nibabel(at / "scan.nii"), values, told)
        check_volume("VTK, scan.vti", by_vtk(at / "scan.vti"), values, told, np.diag([-1.0, -1.0, 1.0]))
        for name in ("deformed", "deformed-organs", "moved"):
            values, told = truth(program, at, at / f"{name}.ivd")
            check_volume(f"ITK, {name}.nii.gz", by_itk(at / f"{name}.nii.gz"), values, told)
            check_volume(f"nibabel, {name}.nii.gz", by_nibabel(at / f"{name}.nii.gz"), values, told)
        pressed, plain = by_itk(at / "nose/pressed.nii.gz")[0], by_nibabel(at / "nose/pressed.nii.gz")[0]
        check("pressed.nii.gz: ITK and nibabel read the same", np.array_equal(pressed, plain))
        check("pressed.nii.gz: another nose", (pressed != by_itk(at / "head.nii.gz")[0]).any())
        skull = trimesh.load(at / "skull.stl", process=False)
        found = corners(*mesh_of(program, at, at / "fine.ivd"))
        check("skull.stl: trimesh reads the triangles", np.allclose(skull.triangles, found, atol=1e-3))
        reader = vtk.vtkSTLReader()
        reader.SetFileName(str(at / "skull.stl"))
        reader.Update()
        check("skull.stl: VTK reads as many", reader.GetOutput().GetNumberOfCells() == len(found))
        check("skull.stl: nothing below the plane", skull.vertices[:, 2].min() > 58.0, skull.vertices[:, 2].min())
        ply = trimesh.load(at / "pressed.ply", process=False)
        found = corners(*mesh_of(program, at, at / "skin-1.ivd", at / "skin-motion.ivd"))
        check("pressed.ply: trimesh reads the triangles", np.allclose(ply.triangles, found, atol=1e-3))
        check_fields(program, at)
        check_animation(at)
    return outcome()


if __name__ == "__main__":
    sys.exit(main(os.path.abspath(sys.argv[1])))
