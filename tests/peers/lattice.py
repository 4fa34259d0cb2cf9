"""Extraction against vtkFlyingEdges3D, for time and memory: python lattice.py PATH/TO/ivd PATH/TO/measure [options]

`cargo build --release -p ivd-bench --example measure` makes our side. Sphere, torus, gyroid and head of `ivd phantom`, and
scans that --scan names; two threads each. Both take turns, on the same voxels, which lie in memory; each run cuts a volume
never seen before, whose bricks are looked at first, and the first of every turn isn't counted. Both are warm: ours is an
extractor that is given back its last lattice; VTK's is the better, in every turn, of new filters and of one filter that runs
again. `alone` is our function that starts with no memory. Ours has no normals, as VTK's with normals, gradients and scalars
off; VTK's with normals is timed beside it. Prints a Markdown table: VTK's time over ours, wall and processor, as the median of
the turns' ratios with the least and the most; ours alone; ours with the bricks known; our times; memory beyond the voxels' own,
of a single run in a process of its own each. Needs numpy, nibabel and vtk.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from surfaces import THREADS, TimeMethod, phantom, scan, vtk_threads
from timing import timed


def image(voxels):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    made = vtk.vtkImageData()
    made.SetDimensions(*voxels.shape)
    flat = voxels.ravel(order="F")
    made.GetPointData().SetScalars(numpy_to_vtk(flat, deep=False))
    made.kept = flat
    return made


def flying_edges(source, iso, normals):
    cut = filter_of(source, iso, normals)
    cut.Update()
    return cut.GetOutput()


def filter_of(source, iso, normals):
    import vtk

    cut = vtk.vtkFlyingEdges3D()
    cut.SetInputData(source)
    cut.SetValue(0, iso)
    cut.SetComputeNormals(normals)
    cut.ComputeGradientsOff()
    cut.ComputeScalarsOff()
    return cut


def peak():
    line = next(l for l in open("/proc/self/status") if l.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def memory(path, shape, dtype, iso):
    """In a process of its own: what a run of VTK's takes beyond the voxels (MiB)."""
    vtk_threads()
    source = image(np.fromfile(path, dtype).reshape(shape, order="F"))
    before = peak()
    flying_edges(source, iso, False)
    print(peak() - before)


def spread(ratios):
    return f"{np.median(ratios):.2f} ({min(ratios):.2f}–{max(ratios):.2f})"


def compare(name, voxels, iso, program, folder, given):
    ours, source = TimeMethod(program, folder, voxels), image(voxels)
    params = {"iso": {"value": iso}}
    methods = {"ours": "lattice-slider", "alone": "lattice", "again": "lattice-slider-again"}
    turns = {key: [] for key in (*methods, "plain", "normals")}
    for _ in range(given.turns):
        for key, method in methods.items():
            found = ours(method, params, given.runs + 1)
            turns[key].append(np.median(found["times"][1:], axis=0))
        for key, normals in (("plain", False), ("normals", True)):
            new, same = [], []
            for _ in range(given.runs + 1):
                output, seconds = timed(lambda: flying_edges(source, iso, normals))
                new.append(seconds)
            cut = filter_of(source, iso, normals)
            for _ in range(given.runs + 1):
                cut.Modified()
                same.append(timed(cut.Update)[1])
            turns[key].append(np.minimum(np.median(new[1:], axis=0), np.median(same[1:], axis=0)))
            del cut
    turns = {key: np.array(times) for key, times in turns.items()}
    once = ours("lattice", params, 1)
    taken = once["peak_mib"] - once["volume_mib"]
    words = [sys.executable, __file__, "--memory", ours.path, ",".join(map(str, voxels.shape)), voxels.dtype, iso]
    theirs = float(subprocess.run([str(w) for w in words], capture_output=True, text=True, check=True).stdout)
    row = {
        "volume": name, "type": str(voxels.dtype), "iso": iso, "triangles": found["triangles"], "triangles_vtk": output.GetNumberOfCells(),
        "wall": (turns["plain"] / turns["ours"])[:, 0].tolist(), "cpu": (turns["plain"] / turns["ours"])[:, 1].tolist(),
        "cpu_alone": (turns["plain"] / turns["alone"])[:, 1].tolist(), "wall_alone": (turns["plain"] / turns["alone"])[:, 0].tolist(),
        "cpu_normals": (turns["normals"] / turns["ours"])[:, 1].tolist(), "cpu_again": (turns["plain"] / turns["again"])[:, 1].tolist(),
        "ours_s": np.median(turns["ours"], axis=0).tolist(), "again_s": np.median(turns["again"], axis=0).tolist(),
        "vtk_s": np.median(turns["plain"], axis=0).tolist(), "memory_mib": taken, "memory_vtk_mib": theirs,
    }
    print(
        f"| {name}, {voxels.dtype} | {row['triangles']:,} | {row['triangles_vtk']:,} | {spread(row['wall'])} | {spread(row['cpu'])} | {spread(row['cpu_alone'])} "
        f"| {spread(row['cpu_normals'])} | {spread(row['cpu_again'])} | {1e3 * row['ours_s'][0]:.1f}, {1e3 * row['ours_s'][1]:.1f} "
        f"| {1e3 * row['vtk_s'][0]:.1f}, {1e3 * row['vtk_s'][1]:.1f} | {taken:.0f} | {theirs:.0f} |",
        flush=True,
    )
    return row


def main():
    if sys.argv[1:2] == ["--memory"]:
        path, shape, dtype, iso = sys.argv[2:]
        return memory(path, [int(n) for n in shape.split(",")], dtype, float(iso))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ivd")
    parser.add_argument("measure")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--type", default="u8", choices=["u8", "u16", "f32"])
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--scan", action="append", default=[], metavar="FILE@ISO", help="a NIfTI file and its isovalue")
    parser.add_argument("--only", default="")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    backend, rows = vtk_threads(), []
    import vtk

    print(f"VTK {vtk.vtkVersion.GetVTKVersion()}, {backend}, {THREADS} threads; load {os.getloadavg()[0]:.1f}\n")
    print("| volume | triangles | VTK's | wall | processor | alone | with normals | bricks known | ours (ms) | VTK's (ms) | memory (MiB) | VTK's |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    top = {"u8": 255, "u16": 65535, "f32": 1}[given.type]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        # The head's isovalue lies between its fluid (0.25) and its grey matter (0.5).
        for shape, iso in (("sphere", 0.5), ("torus", 0.5), ("gyroid", 0.5), ("head", 0.375)):
            if given.only in shape:
                voxels = phantom(given.ivd, folder, shape, given.size, given.type)
                rows.append(compare(f"{shape} {given.size}³", voxels, iso * top, given.measure, folder, given))
        for file, iso in (words.rsplit("@", 1) for words in given.scan):
            if given.only in file:
                rows.append(compare(Path(file).name.split(".")[0], scan(file), float(iso), given.measure, folder, given))
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
