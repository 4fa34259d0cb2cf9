"""Volumes, processes and meshes that lattice.py, convergence.py and simplify.py share."""

import json
import subprocess
from pathlib import Path

import nibabel
import numpy as np

THREADS = 2


def vtk_threads():
    """VTK with as many threads as ours; returns what they are run by."""
    import vtk

    vtk.vtkSMPTools.SetBackend("STDThread")
    vtk.vtkSMPTools.Initialize(THREADS)
    assert vtk.vtkSMPTools.GetEstimatedNumberOfThreads() == THREADS
    return vtk.vtkSMPTools.GetBackend()


def ivd(program, *words):
    """What the program says of itself, as JSON."""
    done = subprocess.run([program, *map(str, words), "--json", "--progress", "never", "-q"], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"ivd {' '.join(map(str, words))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def phantom(program, folder, shape, size, kind):
    """A phantom's voxels, x first."""
    ivd(program, "phantom", shape, "--size", size, "--type", kind, "-o", folder / "phantom.ivd")
    ivd(program, "export", folder / "phantom.ivd", "-o", folder / "phantom.nii")
    voxels = np.asarray(nibabel.load(folder / "phantom.nii").dataobj)
    (folder / "phantom.ivd").unlink()
    voxels = np.asfortranarray(voxels.copy(order="F"))
    (folder / "phantom.nii").unlink()
    return voxels


def scan(path):
    """A NIfTI scan's voxels as they are stored, x first."""
    return np.asfortranarray(np.asarray(nibabel.load(path).dataobj))


def write_nrrd(path, voxels):
    """Voxels of 1 mm as a file that the program reads."""
    kind = {"uint8": "uint8", "uint16": "uint16", "float32": "float"}[str(voxels.dtype)]
    sizes = " ".join(map(str, voxels.shape))
    header = f"NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nendian: little\nencoding: raw\n\n"
    with open(path, "wb") as file:
        file.write(header.encode())
        voxels.ravel(order="F").tofile(file)


class TimeMethod:
    """Our side in memory: the example `measure` of ivd-bench on these voxels."""

    def __init__(self, program, folder, voxels):
        self.program, self.path, self.shape = program, Path(folder) / "voxels.raw", voxels.shape
        self.kind = {"uint8": "u8", "uint16": "u16", "float32": "f32"}[str(voxels.dtype)]
        voxels.ravel(order="F").tofile(self.path)

    def __call__(self, method, params, repeats):
        """Its JSON; `times` is [repeats, 2]: wall and processor time (s)."""
        words = [self.program, "method", method, self.path, self.kind, ",".join(map(str, self.shape)), json.dumps(params), repeats]
        done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        found = json.loads(done.stdout)
        found["times"] = np.array(found["times"])
        return found


def read_ply(path):
    """Vertices (mm) and triangles of a binary PLY."""
    types = {"double": "<f8", "float": "<f4", "int": "<i4", "uint": "<u4", "uchar": "u1", "ushort": "<u2", "short": "<i2"}
    with open(path, "rb") as file:
        elements = []
        while (line := file.readline().decode().split()) != ["end_header"]:
            if line[0] == "element":
                elements.append((line[1], int(line[2]), []))
            elif line[0] == "property" and line[1] == "list":
                elements[-1][2].extend([("count", types[line[2]]), ("corners", types[line[3]], 3)])
            elif line[0] == "property":
                elements[-1][2].append((line[2], types[line[1]]))
        found = {name: np.fromfile(file, np.dtype(fields), count) for name, count, fields in elements}
    vertices = np.stack([found["vertex"][axis] for axis in "xyz"], 1).astype(float)
    return vertices, found["face"]["corners"].astype(np.int64)


def defects(vertices, triangles):
    """Edges without two triangles in opposite directions, vertices whose triangles are not one fan, and coincident corners."""
    corners = triangles.astype(np.int64)
    n = len(vertices)
    flat = (vertices[corners] == vertices[np.roll(corners, 1, axis=1)]).all(2).any(1).sum()
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    corner = np.arange(len(start)).reshape(-1, 3)
    after = np.roll(corner, -1, axis=1).ravel()
    corner = corner.ravel()
    edge = np.minimum(start, end) * n + np.maximum(start, end)
    order = np.argsort(edge, kind="stable")
    sorted_edges = edge[order]
    first = np.flatnonzero(np.r_[True, sorted_edges[1:] != sorted_edges[:-1]])
    uses = np.diff(np.r_[first, len(order)])
    pair = first[uses == 2]
    a, b = order[pair], order[pair + 1]
    opposite = start[a] == end[b]
    bad = int((uses != 2).sum() + (~opposite).sum())
    a, b = a[opposite], b[opposite]
    # Corners of one vertex that share an edge hang together; a vertex is a fan where all its corners do.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows, columns = np.concatenate([corner[a], after[a]]), np.concatenate([after[b], corner[b]])
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(len(start),) * 2)
    fans, _ = connected_components(graph, directed=False)
    return {"edges": bad, "vertices": int(fans - len(np.unique(start))), "coincident": int(flat)}
