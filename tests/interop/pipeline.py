"""pipeline.py IVD [SCENE ...] [--made FOLDER]: whole scenes on real volumes, their outputs recomputed by other people's programs.

For every scene of fixtures/scenes whose input is there:
- it exits 0 (5 is reported: a map that can't be made fold-free, with its place);
- the extracted and the refined lattice are closed and manifold by trimesh, have no repeated or coincident corner, and
  every refined vertex is exactly one of the extracted ones;
- the deformed volume lies where the input lies, read by nibabel and by SimpleITK;
- outside the displacement field it equals the input bit for bit, inside it equals, to 1e-3 of the range, SimpleITK's own
  resampling of the input through the exported field, besides the rounding to the stored type (half a stored step);
- two of them again on the volume as 32-bit floats, where there is no such rounding.
--made has what `golden.py --keep` left there, so that no scene is run twice.
Prints `N passed, N failed`.
"""
import argparse, json, os, pathlib, re, subprocess, sys, tempfile, tomllib

import nibabel as nib
import numpy as np
import SimpleITK as sitk
import trimesh

from checks import check, outcome

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("program", type=pathlib.Path)
parser.add_argument("scenes", nargs="*", type=pathlib.Path, metavar="SCENE")
parser.add_argument("--made", type=pathlib.Path, metavar="FOLDER")
ARGS = parser.parse_args()
IVD = ARGS.program.resolve()
# Scenes that run on floats as well.
SINGLE = ["mri_brain_dicom", "tooth"]
SCENES = pathlib.Path(__file__).resolve().parents[2] / "fixtures" / "scenes"


def run(*words):
    done = subprocess.run([IVD, *map(str, words), "--json"], capture_output=True, text=True)
    return done.returncode, (json.loads(done.stdout) if done.stdout.strip() else None), done.stderr


def closed_manifold(name, mesh):
    faces = np.asarray(mesh.faces, np.int64)
    repeated = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 0] == faces[:, 2])
    check(f"{name}: no repeated corner", not repeated.any(), f"{repeated.sum()} triangles")
    corners = mesh.vertices[faces]
    apart = [np.linalg.norm(corners[:, a] - corners[:, b], axis=1).min() for a, b in ((0, 1), (1, 2), (2, 0))]
    check(f"{name}: no coincident corner", min(apart) > 0, f"{apart}")
    # Every directed edge once, and its opposite once.
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    key = edges[:, 0] * (faces.max() + 1) + edges[:, 1]
    back = edges[:, 1] * (faces.max() + 1) + edges[:, 0]
    there, opposite = np.sort(key), np.sort(back)
    check(f"{name}: edges are used once each way", (there[1:] != there[:-1]).all() and np.array_equal(there, opposite))
    check(f"{name}: watertight by trimesh", mesh.is_watertight and mesh.is_winding_consistent)
    check(f"{name}: outward", mesh.volume > 0, f"volume {mesh.volume}")


def lattices(name, out):
    load = lambda file: trimesh.load(out / file, process=False)
    whole, part = load("extracted.ply"), load("lattice.ply")
    closed_manifold(f"{name} extracted", whole)
    closed_manifold(f"{name} refined", part)
    rows = lambda m: {row.tobytes() for row in np.ascontiguousarray(m.vertices)}
    check(f"{name}: refined vertices are extracted ones", rows(part) <= rows(whole))
    check(f"{name}: refined is smaller", len(part.faces) < len(whole.faces))


def input_volume(scene, folder, temporary):
    """The input as another reader sees it; raw slices, VTI and what SimpleITK can't read go through a NIfTI of ours."""
    source = (folder / scene["input"]["file"]).resolve()
    if source.is_dir() and any(source.glob("*.dcm")):
        reader = sitk.ImageSeriesReader()
        reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(source)))
        return reader.Execute()
    if source.is_file() and not source.name.endswith(".vti"):
        return sitk.ReadImage(str(source))
    words = ["import", source, "-o", temporary / "input.ivd"]
    if "raw" in scene["input"]:
        raw = scene["input"]["raw"]
        words += ["--raw-dims", ",".join(map(str, raw["dims"])), "--raw-type", raw["type"],
                  "--raw-spacing", ",".join(map(str, raw["spacing"])), "--raw-order", raw["order"]]
    run(*words)
    run("export", temporary / "input.ivd", "-o", temporary / "input.nii.gz")
    return sitk.ReadImage(str(temporary / "input.nii.gz"))


def same_place(name, a, b, dims):
    """World positions of the eight corners agree to the rounding of a file that holds f32."""
    corners = [[(d - 1) * c for d, c in zip(dims, at)] for at in np.ndindex(2, 2, 2)]
    p = np.array([a.TransformContinuousIndexToPhysicalPoint(c) for c in corners])
    q = np.array([b.TransformContinuousIndexToPhysicalPoint(c) for c in corners])
    bound = 1e-3 + 1e-6 * np.abs(p).max()
    check(f"{name}: lies where the input lies (SimpleITK)", np.abs(p - q).max() < bound, f"{np.abs(p - q).max()} mm")
    return corners, p


def volumes(name, scene, folder, out, temporary):
    before, after = input_volume(scene, folder, temporary), sitk.ReadImage(str(out / "deformed.nii.gz"))
    check(f"{name}: same size", before.GetSize() == after.GetSize(), f"{before.GetSize()} {after.GetSize()}")
    corners, lps = same_place(name, before, after, before.GetSize())
    ras = nib.affines.apply_affine(nib.load(out / "deformed.nii.gz").affine, corners)
    worst = np.abs(ras * [-1, -1, 1] - lps).max()
    check(f"{name}: lies where the input lies (nibabel)", worst < 1e-3 + 1e-6 * np.abs(lps).max(), f"{worst} mm")
    field = sitk.ReadImage(str(out / "inverse.nrrd"), sitk.sitkVectorFloat64)
    u = sitk.GetArrayFromImage(field)
    moved = (u != 0).any(-1)
    a, b = sitk.GetArrayFromImage(before), sitk.GetArrayFromImage(after)
    check(f"{name}: something moved", moved.any() and (a != b).any())
    check(f"{name}: bit-identical outside", np.array_equal(a[~moved], b[~moved]))
    spacing = min(before.GetSpacing())
    check(f"{name}: moved by at least 3 voxels", np.linalg.norm(u, axis=-1).max() >= 3 * spacing,
          f"{np.linalg.norm(u, axis=-1).max() / spacing:.2f} voxels")
    if not moved.any():
        return
    field.CopyInformation(before)
    warp = sitk.DisplacementFieldTransform(field)
    # The box in which something moved: the rest was looked at above.
    ends = [(at.min(), at.max() + 1) for at in np.nonzero(moved)]
    box = tuple(slice(*end) for end in ends)
    there = before[tuple(slice(int(low), int(high)) for low, high in reversed(ends))]
    dense = sitk.Resample(sitk.Cast(before, sitk.sitkFloat64), there, warp, sitk.sitkLinear, float("nan"))
    expected, b = sitk.GetArrayFromImage(dense), b[box]
    inside = moved[box] & np.isfinite(expected)
    span = float(a.max()) - float(a.min())
    # The result is stored in the input's type: half a stored step (integers times the slope) is its rounding, no error.
    header = nib.load(out / "deformed.nii.gz")
    step = abs(header.dataobj.slope) if np.issubdtype(header.get_data_dtype(), np.integer) else 0.0
    rounding = 0.5 * step
    worst = np.abs(expected[inside] - b[inside].astype(float)).max()
    check(f"{name}: equals SimpleITK's resampling", worst <= 1e-3 * span + rounding * 1.001, f"{worst} of range {span}")
    print(f"   {name}: {inside.sum()} voxels resampled, largest difference {worst:.4f} of range {span:g}")


def as_single(name, file, scene, out, temporary):
    """The same scene on the volume as 32-bit floats, where no rounding to a stored step hides an error of the resampling."""
    volume = sitk.Cast(input_volume(scene, file.parent, temporary), sitk.sitkFloat32)
    sitk.WriteImage(volume, str(temporary / "single.nii"))
    sections = re.split(r"^(?=\[)", file.read_text(), flags=re.MULTILINE)
    kept = [s for s in sections if not s.startswith("[input")]
    single = temporary / "single.toml"
    single.write_text(kept[0] + '[input]\nfile = "single.nii"\n\n' + "".join(kept[1:]))
    code, _, talk = run("pipeline", single, "--out", out)
    check(f"{name}: exit code 0", code == 0, f"{code}: {talk.strip()}")
    if code == 0:
        volumes(name, tomllib.loads(single.read_text()), temporary, out, temporary)


def main():
    chosen = ARGS.scenes or sorted(SCENES.glob("*.toml"))
    exits = {}
    with tempfile.TemporaryDirectory() as root:
        os.environ["IVD_CACHE"] = os.path.join(root, "cache")
        for file in chosen:
            scene, name = tomllib.loads(file.read_text()), file.stem
            if "file" not in scene["input"]:
                continue
            if not (file.parent / scene["input"]["file"]).exists():
                print(f"-- {name} skipped: its volume isn't here")
                continue
            out, temporary = pathlib.Path(root) / name, pathlib.Path(root) / f"{name}-other"
            temporary.mkdir()
            if ARGS.made and (ARGS.made / name).is_dir():
                out, code, talk = ARGS.made / name, 0, ""
            else:
                code, _, talk = run("pipeline", file, "--out", out)
            exits[name] = code
            check(f"{name}: exit code 0 or 5", code in (0, 5), f"{code}: {talk.strip()}")
            if code != 0:
                print(f"   {name}: exit {code}: {talk.strip()}")
                continue
            lattices(name, out)
            volumes(name, scene, file.parent, out, temporary)
            if name in SINGLE:
                as_single(f"{name} as f32", file, scene, pathlib.Path(root) / f"{name}-single", temporary)
        if len(exits) >= 8:
            check("at least 7 of 8 scenes exit 0", sum(c == 0 for c in exits.values()) >= len(exits) - 1, str(exits))
    sys.exit(outcome())


main()
