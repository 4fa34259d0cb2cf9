"""Motions through time as other programs read them: python animations.py PATH/TO/ivd

For every solver a scene writes its motion as GLB, PVD, a series of volumes and a series of pictures. Frames that were asked for are
frames written, no two are alike, the last is the still output bit for bit, and the duration is the one asked for: VTK tells that of a GLB
(and plays it), the PVD names its times, trimesh and SimpleITK read the files. What can't be written is refused with its key.
Prints `N passed, N failed`; the exit code is 1 where something failed. Needs numpy, SimpleITK, trimesh and vtk.
"""

import itertools
import json
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import SimpleITK as sitk
import trimesh
import vtk

from checks import check, outcome
from motions import played, vtp

FRAMES, DURATION = 4, 0.02
SCENE = """
schema = 1
[input]
phantom = "sphere"
size = 40
[lattice]
iso = 128.0
[refine]
level = 1
[render]
size = 96
[deform]
solver = "{solver}"
{keys}
[[deform.handle]]
pick = [20.0, 33.0, 20.0]
move = [0.0, -2.0, 0.0]
radius = 12.0
[output]
{output}
"""
# Those that go through time, and those that give where the lattice comes to rest.
THROUGH_TIME = ["dynamics", "projective", "xpbd"]
AT_REST = ["ring", "body"]


def run(program, at, solver, keys, output):
    """Runs a scene; gives the exit code and what was told."""
    scene = at / "scene.toml"
    scene.write_text(SCENE.format(solver=solver, keys=keys, output=output))
    words = [program, "pipeline", scene, "--out", at / "out", "--cache", at / "cache", "--progress", "never"]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    return done.returncode, done.stderr


def all_differ(values):
    return all(not np.array_equal(a, b) for a, b in itertools.combinations(values, 2))


def glb(path):
    """The JSON of a GLB."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20:20 + length])


def duration(path):
    """How long VTK plays a GLB's first animation (s)."""
    reader = vtk.vtkGLTFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    return reader.GetAnimationDuration(0)


def arrays(at, name, count):
    files = [at / "out" / name.format(i) for i in range(count + 1)]
    check(f"{name}: {count} files", [file.is_file() for file in files] == [True] * count + [False])
    return [sitk.GetArrayFromImage(sitk.ReadImage(str(file))) for file in files[:count]]


def written(program, at, solver, count, seconds):
    """What a solver writes of its motion."""
    keys = f"duration = {seconds}" if solver != "body" else ""
    keys += f"\nframes = {count}" if solver in THROUGH_TIME else ""
    outputs = 'volume = "still.nrrd"\nvolume_series = "volumes/at.nrrd"\npicture_series = "pictures/at.png"\nimages = ["after"]\n'
    for ending in ("glb", "pvd"):
        code, told = run(program, at, solver, keys, f'animation = "move.{ending}"\nlattice_deformed = "still.vtp"\n{outputs}')
        check(f"{solver}: {ending}", code == 0, told)
    still, out = vtp(at / "out" / "still.vtp"), at / "out"

    described = glb(out / "move.glb")
    targets = len(described["meshes"][0]["primitives"][0]["targets"])
    times = described["accessors"][described["animations"][0]["samplers"][0]["input"]]
    check(f"{solver}: glb frames", targets == count, f"{targets}")
    check(f"{solver}: glb duration", abs(duration(out / "move.glb") - times["max"][0]) < 1e-6, f"{times}")
    if solver != "body":
        check(f"{solver}: duration asked", abs(times["max"][0] - seconds) < 1e-6 * seconds, f"{times['max']} {seconds}")
    shown = [played(out / "move.glb", times["max"][0] * (i + 1) / count) for i in range(count)]
    check(f"{solver}: glb frames differ", all_differ(shown))
    check(f"{solver}: glb ends as it stands still", np.abs(shown[-1] - still).max() < 1e-4, f"{np.abs(shown[-1] - still).max()} mm")
    check(f"{solver}: trimesh reads the glb", len(trimesh.load(out / "move.glb", force="mesh").vertices) == len(still))

    series = [(float(d.get("timestep")), d.get("file")) for d in ElementTree.parse(out / "move.pvd").iter("DataSet")]
    meshes = [vtp(out / name) for _, name in series]
    check(f"{solver}: pvd frames", len(series) == count + 1, f"rest and {count}: {len(series)}")
    check(f"{solver}: pvd times", abs(series[-1][0] - times["max"][0]) < 1e-6 and series[0][0] == 0.0, f"{series}")
    check(f"{solver}: pvd frames differ", all_differ(meshes))
    check(f"{solver}: pvd ends as it stands still", np.array_equal(meshes[-1], still))

    for name, alone in (("volumes/at_{:04}.nrrd", "still.nrrd"), ("pictures/at_{:04}.png", "after.png")):
        found = arrays(at, name, count)
        check(f"{solver}: {name} differ", all_differ(found))
        last = sitk.GetArrayFromImage(sitk.ReadImage(str(out / alone)))
        check(f"{solver}: {name} ends as it stands still", np.array_equal(found[-1], last))


def refused(program, at):
    """What can't be written, and the word that says why."""
    for solver in AT_REST:
        code, told = run(program, at, solver, f"frames = {FRAMES}", 'animation = "move.glb"')
        check(f"{solver}: frames are refused", code == 2 and "frames" in told and "dynamics" in told, told)
    code, told = run(program, at, "body", f"duration = {DURATION}", 'animation = "move.glb"')
    check("body: a duration is refused", code == 2 and "duration" in told, told)
    for output, word in (
        ('animation = "move.stl"', ".glb or .pvd"),
        ('volume_series = "at.png"', "voxels are written as"),
        ('picture_series = "at.jpg"', "pictures are written as .png"),
        ('picture_series = "at.png"\n[map]\nframe = 0', "map.frame"),
        ('volume_series = "at.nrrd"\n[map]\nframe = 0', "map.frame"),
    ):
        code, told = run(program, at, "dynamics", f"frames = {FRAMES}", output)
        check(f"refused: {output}", code == 2 and word in told, told)


def main():
    program = sys.argv[1]
    for solver in THROUGH_TIME + AT_REST:
        with tempfile.TemporaryDirectory() as folder:
            at = Path(folder)
            written(program, at, solver, FRAMES if solver in THROUGH_TIME else 1, DURATION)
    with tempfile.TemporaryDirectory() as folder:
        refused(program, Path(folder))
    return outcome()


if __name__ == "__main__":
    sys.exit(main())
