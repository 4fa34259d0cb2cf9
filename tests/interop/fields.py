"""fields.py PROGRAM: displacement fields that SimpleITK wrote, imported, certified and warped with, held against its own resampling.

A field of ours goes out and back in pipeline.py and the program's own tests; here another program is the one that writes. The grid is oblique
and its spacing uneven, so that axes, space and unit can't be mistaken without being seen.
"""
import json, pathlib, subprocess, sys, tempfile

import numpy as np
import SimpleITK as sitk


def ivd(program, folder, *words):
    done = subprocess.run([program, *map(str, words), "--json"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def on_grid(array, is_vector=False):
    image = sitk.GetImageFromArray(array, isVector=is_vector)
    image.SetSpacing((1.5, 1.0, 2.0))
    image.SetOrigin((-20.0, 35.0, 7.0))
    turn = np.deg2rad(25)
    c, s = np.cos(turn), np.sin(turn)
    image.SetDirection((c, -s, 0, s, c, 0, 0, 0, 1))
    return image


def made(n=(36, 40, 28)):
    """A smooth volume, and a field of some mm that ends before the border (arrays by z, y, x)."""
    x, y, z = np.meshgrid(*(np.arange(k) for k in n), indexing="ij")
    volume = 100 + 50 * np.sin(x / 3.1) * np.cos(y / 4.3) + 30 * np.sin(z / 2.7)
    inside = np.prod([np.sin(np.pi * axis / (k - 1)) ** 2 for axis, k in zip((x, y, z), n)], axis=0)
    field = np.stack([3 * inside, -2 * inside, 1.5 * inside], axis=-1)
    by_zyx = lambda array: np.ascontiguousarray(np.moveaxis(array, [0, 1, 2], [2, 1, 0]))
    return by_zyx(volume).astype(np.float32), by_zyx(field)


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    volume, field = made()
    image, vectors = on_grid(volume), on_grid(field, is_vector=True)
    transform = sitk.DisplacementFieldTransform(sitk.Cast(vectors, sitk.sitkVectorFloat64))
    theirs = sitk.GetArrayFromImage(sitk.Resample(image, image, transform, sitk.sitkLinear, 0.0))
    moved = np.abs(theirs - volume).max()
    assert moved > 20, moved
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder)
        sitk.WriteImage(image, path / "v.nrrd")
        for name in ("f.nrrd", "f.nii.gz", "f.mha"):
            for kind in (sitk.sitkVectorFloat32, sitk.sitkVectorFloat64):
                sitk.WriteImage(sitk.Cast(vectors, kind), path / name)
                told = ivd(program, folder, "import", name, "--displacement=inverse", "-o", "d.ivd")["metrics"]
                largest = np.linalg.norm(field, axis=-1).max()
                assert told["folds"] == 0 and abs(told["largest_mm"] / largest - 1) < 0.02, (name, told, largest)
                ivd(program, folder, "warp", "v.nrrd", "d.ivd", "-o", "w.ivd")
                ivd(program, folder, "export", "w.ivd", "-o", "w.nrrd")
                ours = sitk.GetArrayFromImage(sitk.ReadImage(path / "w.nrrd"))
                off = np.abs(ours - theirs).max()
                assert off < 1e-3, (name, kind, off)
                print(f"{name}, {sitk.GetPixelIDValueAsString(kind)}: values move by up to {moved:.1f}, ours and ITK's differ by {off:.1e}")


if __name__ == "__main__":
    main()
