"""Refinement against other simplifiers: python simplify.py PATH/TO/ivd PATH/TO/measure [options]

`cargo build --release -p ivd-bench --example measure` makes our side. The lattices of torus and gyroid of `ivd phantom`, and
of scans that --scan names, at 50, 25, 10 and 5 % of their triangles by `ivd refine --method collapse --ratio`, meshoptimizer,
fast-simplification, vtkDecimatePro and pymeshlab's quadric collapse, all given the same mesh. Of those, meshoptimizer and
vtkDecimatePro keep input vertices as ours does; the other two place new ones.

Error: vertices (all, or --samples of them) and --samples points spread evenly over the area, of the input on the output and of
the output on the input, to the nearest triangle, in double precision: the largest of either way, and the larger of the means.
Every output is sampled alike. Edges, vertex fans and coincident corners are counted here. "kept" is the share of output vertices
that are exactly vertices of the mesh that the program was given.

Time: ours is a call in memory (`measure method refine`, two threads; error bounds and the mean error are part of it), the others' is
the call alone, one thread each; --turns in turn for ours, meshoptimizer and fast-simplification, once for the others. Prints a
Markdown table; ours has its carried bound beside the error, and the exit code is 1 where the bound is below it. Needs numpy,
scipy, nibabel, vtk, meshoptimizer, fast-simplification and pymeshlab.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from surfaces import TimeMethod, defects, ivd, phantom, read_ply, scan, vtk_threads, write_nrrd
from timing import timed


def polydata(vertices, triangles):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    points, cells, made = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices), deep=True))
    cells.SetData(3, numpy_to_vtkIdTypeArray(np.ascontiguousarray(triangles, np.int64).ravel(), deep=True))
    made.SetPoints(points)
    made.SetPolys(cells)
    return made


def sampled(vertices, triangles, count):
    """Vertices, and points spread over the area."""
    random = np.random.default_rng(5)
    used = np.unique(triangles)
    if len(used) > count:
        used = random.choice(used, count, replace=False)
    corners = vertices[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = corners[np.searchsorted(np.cumsum(areas), random.random(count) * areas.sum()).clip(max=len(triangles) - 1)]
    u, v = random.random((2, count, 1))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    spread = chosen[:, 0] + u * (chosen[:, 1] - chosen[:, 0]) + v * (chosen[:, 2] - chosen[:, 0])
    return vertices[used], spread


class Surface:
    """Distances to a mesh."""

    def __init__(self, vertices, triangles):
        import vtk

        self.function = vtk.vtkImplicitPolyDataDistance()
        self.function.SetInput(polydata(vertices, triangles))

    def distances(self, points):
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

        found = vtk.vtkDoubleArray()
        self.function.FunctionValue(numpy_to_vtk(np.ascontiguousarray(points), deep=True), found)
        return np.abs(vtk_to_numpy(found))


class Measured:
    """The input, and what an output is beside it."""

    def __init__(self, vertices, triangles, count):
        self.surface, self.count = Surface(vertices, triangles), count
        self.points = sampled(vertices, triangles, count)

    def __call__(self, vertices, triangles):
        other, largest, means = Surface(vertices, triangles), 0.0, []
        for surface, (corners, spread) in ((other, self.points), (self.surface, sampled(vertices, triangles, self.count))):
            across = surface.distances(spread)
            means.append(across.mean())
            largest = max(largest, across.max(), surface.distances(corners).max())
        return {"hausdorff": float(largest), "mean": float(max(means))}


def kept(vertices, triangles, given):
    """Share of the used vertices that are among those given."""
    as_bytes = lambda v: (np.ascontiguousarray(v, float) + 0.0).view("V24").ravel()
    return float(np.isin(as_bytes(vertices[np.unique(triangles)]), as_bytes(given)).mean())


def meshoptimizer(vertices, triangles, ratio):
    import meshoptimizer

    points, indices = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(triangles.ravel(), np.uint32)
    target = int(len(triangles) * ratio) * 3

    def run():
        out = np.empty_like(indices)
        return out[: meshoptimizer.simplify(out, indices, points, target_index_count=target, target_error=1e9)]

    return run, lambda out: (points, out.reshape(-1, 3).astype(np.int64)), points


def fast_simplification(vertices, triangles, ratio):
    import fast_simplification

    points, corners = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(triangles, np.int32)
    run = lambda: fast_simplification.simplify(points, corners, 1 - ratio)
    return run, lambda out: (np.asarray(out[0]), np.asarray(out[1], np.int64)), points


def decimate_pro(vertices, triangles, ratio):
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    points = np.ascontiguousarray(vertices, np.float32)
    source = polydata(points, triangles)

    def run():
        decimate = vtk.vtkDecimatePro()
        decimate.SetInputData(source)
        decimate.SetTargetReduction(1 - ratio)
        decimate.PreserveTopologyOn()
        decimate.SplittingOff()
        decimate.Update()
        return decimate.GetOutput()

    read = lambda out: (vtk_to_numpy(out.GetPoints().GetData()).copy(), vtk_to_numpy(out.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64))
    return run, read, points


def pymeshlab(vertices, triangles, ratio):
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, triangles.astype(np.int32)))

    def run():
        meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=int(len(triangles) * ratio), preservetopology=True)
        return meshes.current_mesh()

    return run, lambda out: (out.vertex_matrix(), out.face_matrix().astype(np.int64)), vertices


# Each: what runs it, and whether it is quick enough to take turns.
PEERS = {"meshoptimizer": (meshoptimizer, True), "fast-simplification": (fast_simplification, True),
         "vtkDecimatePro": (decimate_pro, False), "pymeshlab": (pymeshlab, False)}


def compare(name, voxels, iso, folder, given):
    """Rows of one input."""
    write_nrrd(folder / "volume.nrrd", voxels)
    cut = ivd(given.ivd, "lattice", folder / "volume.nrrd", "--iso", iso, "-o", folder / "lattice.ivd")
    ivd(given.ivd, "export", folder / "lattice.ivd", "-o", folder / "lattice.ply")
    vertices, triangles = read_ply(folder / "lattice.ply")
    ours, measured, rows = TimeMethod(given.measure, folder, voxels), Measured(vertices, triangles, given.samples), []
    assert cut["metrics"]["triangles"] == len(triangles)
    print(f"| {name} | | given | {len(triangles):,} | | | | | | {plain(defects(vertices, triangles))} | |", flush=True)
    for ratio in given.ratios:
        refined = ivd(given.ivd, "refine", folder / "lattice.ivd", "--method", "collapse", "--ratio", ratio, "-o", folder / "refined.ivd")
        ivd(given.ivd, "export", folder / "refined.ivd", "-o", folder / "refined.ply")
        out = read_ply(folder / "refined.ply")
        params = {"iso": {"value": float(iso)}, "target": {"ratio": ratio}}
        times, meshes = {"ivd": []}, {"ivd": (*out, vertices)}
        runs = {peer: make(vertices, triangles, ratio) for peer, (make, _) in PEERS.items() if peer in given.peers}
        for turn in range(given.turns):
            found = ours("refine", params, 2)
            assert found["triangles"] == len(out[1]), "measure and ivd are not of one build"
            times["ivd"].append(found["times"][1])
            for peer, (run, read, points) in runs.items():
                quick = PEERS[peer][1]
                if turn == 0 and quick:
                    run()
                if turn == 0 or quick:
                    result, seconds = timed(run)
                    times.setdefault(peer, []).append(seconds)
                    meshes[peer] = (*read(result), points)
        for peer, (points, corners, origin) in meshes.items():
            wall, cpu = np.median(times[peer], axis=0)
            row = {
                "input": name, "ratio": ratio, "program": peer, "triangles": len(corners), **measured(points.astype(float), corners),
                "wall_s": wall, "cpu_s": cpu, "defects": defects(points, corners), "kept": kept(points, corners, origin),
                "cpu_over_ours": spread([t[1] / u[1] for t, u in zip(times[peer], times["ivd"])]),
                "wall_over_ours": spread([t[0] / u[0] for t, u in zip(times[peer], times["ivd"])]),
            }
            if peer == "ivd":
                row["bound"] = refined["metrics"]["max_error_mm"]
            rows.append(row)
            bound = f"{row['bound']:.4f}" if "bound" in row else ""
            print(
                f"| {name} | {100 * ratio:g} % | {peer} | {row['triangles']:,} | {row['hausdorff']:.4f} | {row['mean']:.5f} | {bound} "
                f"| {wall:.3f}, {cpu:.3f} | {row['cpu_over_ours'] if peer != 'ivd' else ''} | {plain(row['defects'])} | {100 * row['kept']:.4g} % |",
                flush=True,
            )
    return rows


def plain(found):
    """Faults as one word where there are none."""
    return ", ".join(f"{count} {what}" for what, count in found.items() if count) or "none"


def spread(ratios):
    middle = f"{np.median(ratios):.2f}"
    return middle if len(ratios) == 1 else f"{middle} ({min(ratios):.2f}–{max(ratios):.2f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ivd")
    parser.add_argument("measure")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--phantoms", nargs="*", default=["torus", "gyroid"])
    parser.add_argument("--scan", action="append", default=[], metavar="FILE@ISO", help="a NIfTI file and its isovalue")
    parser.add_argument("--ratios", type=float, nargs="+", default=[0.5, 0.25, 0.1, 0.05])
    parser.add_argument("--peers", nargs="*", default=list(PEERS), choices=list(PEERS))
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    vtk_threads()
    print(f"load {os.getloadavg()[0]:.1f}\n")
    print("| input | kept | program | triangles | largest error (mm) | mean error (mm) | carried bound (mm) | wall, processor (s) | processor over ours | faults | input's vertices |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for shape in given.phantoms:
            rows += compare(f"{shape} {given.size}³", phantom(given.ivd, folder, shape, given.size, "f32"), 0.5, folder, given)
        for file, iso in (words.rsplit("@", 1) for words in given.scan):
            rows += compare(Path(file).name.split(".")[0], scan(file), iso, folder, given)
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1, default=float))
    below = [r for r in rows if r["program"] == "ivd" and r["bound"] < r["hausdorff"]]
    for row in below:
        print(f"carried bound below the error: {row['input']}, {row['ratio']}: {row['bound']} < {row['hausdorff']}")
    return 1 if below else 0


if __name__ == "__main__":
    sys.exit(main())
