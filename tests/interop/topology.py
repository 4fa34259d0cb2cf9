#!/usr/bin/env python3
"""Holds the topology of extracted lattices against that of the trilinear function: topology.py PATH/TO/ivd [--fields N] [--seed S]

Random integer fields of 8³ to 20³ voxels, values 0 to 3, isovalues 0, 1, 1.5 and 2. Each lattice is written as PLY and read by
trimesh: it must be closed, wound one way, without repeated triangles or coincident corners, and its Betti numbers must be those of
the surface of the function that is trilinear in every cell, below everything outside the volume, at an isovalue less by a hair (so
that voxels and saddles on the isovalue are inside). That count shares no code or idea with the program: components come from
joining the slices of each cell, the Euler characteristic from integrating that of the slices. With --peers the same fields go
through scikit-image and VTK, whose surfaces are counted likewise. Prints what failed; the status is 1 where something of ours did.
Needs numpy, scipy, trimesh; with --peers also scikit-image and vtk.
"""
import argparse
import itertools
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ISOS = (0.0, 1.0, 1.5, 2.0)
OUTSIDE = -1000  # twice the level of what surrounds the volume
HAIR = Fraction(1, 10**5)
CORNERS = list(itertools.product((0, 1), repeat=3))  # z, y, x
TURN = ((0, 0), (0, 1), (1, 1), (1, 0))  # corners of a slice in turn, y and x


def slice_characteristic(a, b, c, d, on_saddle=False):
    """Euler characteristic of where a bilinear function with these corners, in turn, is at least 0."""
    inside = [v >= 0 for v in (a, b, c, d)]
    edges = sum(inside[i] and inside[(i + 1) % 4] for i in range(4))
    face = 0
    if all(inside):
        face = 1
    elif inside[0] == inside[2] and inside[1] == inside[3] and inside[0] != inside[1]:
        saddle = a * c - b * d if inside[0] else b * d - a * c
        face = -1 if on_saddle or saddle >= 0 else 0
    return sum(inside) - edges + face


@lru_cache(None)
def cell(levels):
    """Of a cell with these twice the levels: pairs of corners that hang together in it, and the Euler characteristic of its inside."""
    low = [Fraction(levels[CORNERS.index((0, *at))]) + HAIR for at in TURN]
    high = [Fraction(levels[CORNERS.index((1, *at))]) + HAIR for at in TURN]
    at = lambda t: [p + (q - p) * t for p, q in zip(low, high)]
    joint = lambda v: v[0] * v[2] - v[1] * v[3]
    cuts = {(Fraction(0), False), (Fraction(1), False)}
    cuts |= {(p / (p - q), False) for p, q in zip(low, high) if (p > 0) != (q > 0)}
    c0, c1, half = joint(low), joint(high), joint(at(Fraction(1, 2)))
    square = 2 * c0 + 2 * c1 - 4 * half
    slope = c1 - c0 - square
    root = slope * slope - 4 * square * c0
    if root > 0:
        r = float(root) ** 0.5
        q = -0.5 * (float(slope) + (r if slope >= 0 else -r))
        for t in ([q / float(square)] if square else []) + ([float(c0) / q] if q else []):
            if 0 < t < 1 and all(abs(t - float(other)) > 1e-13 for other, _ in cuts):
                cuts.add((Fraction(t), True))
    cuts = sorted(cuts)
    characteristic = sum(slice_characteristic(*at(t), on_saddle) for t, on_saddle in cuts)
    parent = {}

    def find(a):
        while parent.setdefault(a, a) != a:
            a = parent[a]
        return a

    def join(a, b):
        parent[find(a)] = find(b)

    before = None
    for n, ((t, _), (u, _)) in enumerate(zip(cuts, cuts[1:])):
        middle = at((t + u) / 2)
        characteristic -= slice_characteristic(*middle)
        inside = [v > 0 for v in middle]
        for i in range(4):
            if inside[i] == inside[(i + 1) % 4]:
                join((n, i), (n, (i + 1) % 4))
            if before and before[i] == inside[i]:
                join((n - 1, i), (n, i))
        if inside[0] == inside[2] != inside[1] and inside[1] == inside[3]:
            first = 0 if joint(middle) > 0 else 1
            join((n, first), (n, first + 2))
        before = inside
    last = len(cuts) - 2
    corner = {(0, *at): find((0, i)) for i, at in enumerate(TURN)} | {(1, *at): find((last, i)) for i, at in enumerate(TURN)}
    pairs = [(i, j) for i, j in itertools.combinations(range(8), 2) if corner[CORNERS[i]] == corner[CORNERS[j]]]
    return pairs, characteristic


def expected(twice):
    """Components and tunnels (Betti numbers 0 and 1) of the surface of a field of twice the levels."""
    padded = np.pad(twice, 1, constant_values=OUTSIDE)
    inside = padded >= 0
    corners = [padded[tuple(slice(o, s - 1 + o) for o, s in zip(at, padded.shape))] for at in CORNERS]
    number = np.arange(padded.size).reshape(padded.shape)
    first = number[:-1, :-1, :-1].ravel()
    steps = [np.ravel_multi_index(at, padded.shape) for at in CORNERS]
    patterns = np.stack([c.ravel() for c in corners], 1)
    kinds, which = np.unique(patterns, axis=0, return_inverse=True)
    which = which.ravel()
    rows, columns, cells = [], [], 0
    order = np.argsort(which, kind="stable")
    bounds = np.searchsorted(which[order], np.arange(len(kinds) + 1))
    for kind, levels in enumerate(kinds):
        pairs, characteristic = cell(tuple(int(v) for v in levels))
        places = first[order[bounds[kind] : bounds[kind + 1]]]
        cells += characteristic * len(places)
        for i, j in pairs:
            rows.append(places + steps[i])
            columns.append(places + steps[j])
    # Inclusion and exclusion over the closed cells: cells - inner faces + inner edges - inner vertices.
    faces = sum(face_characteristic(np.moveaxis(padded, axis, 0)) for axis in range(3))
    characteristic = cells - faces + edge_characteristic(padded) - int(inside.sum())
    graph = coo_array((np.ones(sum(map(len, rows)), bool), (np.concatenate(rows), np.concatenate(columns))), shape=(padded.size,) * 2)
    _, part = connected_components(graph, directed=False)
    regions = len(np.unique(part))
    components = regions - 1
    if not inside.any():
        return 0, 0
    return components, 2 * components - 2 * characteristic


def face_characteristic(field):
    """Sum over the inner faces normal to axis 0 of the Euler characteristic of their inside."""
    plane = field[1:-1]
    a, b, c, d = (plane[:, y : plane.shape[1] - 1 + y, x : plane.shape[2] - 1 + x].astype(float) + float(HAIR) for y, x in TURN)
    inside = [v > 0 for v in (a, b, c, d)]
    count = sum(v.astype(int) for v in inside) - sum((inside[i] & inside[(i + 1) % 4]).astype(int) for i in range(4))
    count += inside[0] & inside[1] & inside[2] & inside[3]
    crossed = (inside[0] == inside[2]) & (inside[1] == inside[3]) & (inside[0] != inside[1])
    joined = np.where(inside[0], a * c - b * d, b * d - a * c) > 0
    return int(count.sum() - (crossed & joined).sum())


def edge_characteristic(field):
    """Sum over the inner edges of the Euler characteristic of their inside: 1 unless both ends are outside."""
    inside = field >= 0
    total = 0
    for axis in range(3):
        along = np.moveaxis(inside, axis, 0)
        total += int((along[1:] | along[:-1])[:, 1:-1, 1:-1].sum())
    return total


def counted(mesh):
    """What is wrong with a mesh, and its Betti numbers."""
    faults = []
    if not len(mesh.faces):
        return faults, (0, 0)
    if not mesh.is_watertight:
        faults.append("not closed")
    if not mesh.is_winding_consistent:
        faults.append("wound both ways")
    edges = np.sort(mesh.edges, axis=1)
    if np.unique(edges, axis=0, return_counts=True)[1].max() > 2:
        faults.append("an edge of more than two triangles")
    if len(np.unique(mesh.vertices, axis=0)) < len(mesh.vertices):
        faults.append("coincident vertices")
    if any(len(set(f)) < 3 for f in mesh.faces.tolist()):
        faults.append("repeated corners")
    if len(np.unique(np.sort(mesh.faces, axis=1), axis=0)) < len(mesh.faces):
        faults.append("repeated triangles")
    used = np.unique(mesh.faces)
    graph = coo_array((np.ones(len(edges), bool), tuple(edges.T)), shape=(len(mesh.vertices),) * 2)
    _, part = connected_components(graph, directed=False)
    components = len(np.unique(part[used]))
    characteristic = len(used) - len(np.unique(edges, axis=0)) + len(mesh.faces)
    return faults, (components, 2 * components - characteristic)


def ours(ivd, folder, name, field, iso):
    source, target = folder / f"{name}.nrrd", folder / f"{name}.ply"
    header = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {field.shape[2]} {field.shape[1]} {field.shape[0]}\nencoding: raw\n\n"
    source.write_bytes(header.encode() + field.tobytes())
    lattice = folder / f"{name}.ivd"
    for command in (["lattice", source, "--iso", iso, "-o", lattice], ["export", lattice, "-o", target]):
        command = [ivd, *map(str, command), "--threads", "1", "--progress", "never", "-q"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            return [f"exit {done.returncode}: {done.stderr.strip()}"], None
    found = counted(trimesh.load(target, process=False))
    for file in (source, lattice, target):
        file.unlink()
    return found


def peers(field, iso):
    """The same by scikit-image and by VTK, closed by a layer outside."""
    from skimage.measure import marching_cubes
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    padded = np.pad(field.astype(np.float32), 1, constant_values=-500)
    result = {}
    try:
        vertices, faces, _, _ = marching_cubes(padded, iso)
        result["scikit-image"] = counted(trimesh.Trimesh(vertices, faces, process=False))
    except (ValueError, RuntimeError) as error:
        result["scikit-image"] = ([str(error)], None)
    image = vtk.vtkImageData()
    image.SetDimensions(*padded.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(padded.ravel(), deep=True))
    filter = vtk.vtkFlyingEdges3D()
    filter.SetInputData(image)
    filter.SetValue(0, iso)
    filter.Update()
    output = filter.GetOutput()
    if output.GetNumberOfCells():
        faces = vtk_to_numpy(output.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        result["VTK Flying Edges"] = counted(trimesh.Trimesh(vtk_to_numpy(output.GetPoints().GetData()), faces, process=False))
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ivd")
    parser.add_argument("--fields", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--peers", action="store_true")
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    cases = []
    for n in range(given.fields):
        field = random.integers(0, 4, random.integers(8, 21, 3)).astype(np.uint8)
        cases.append((n, field, ISOS[n % 4]))
    failed, wrong = 0, {}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda case: ours(given.ivd, Path(folder), *case), cases)
        for (n, field, iso), (faults, betti) in zip(cases, found):
            truth = expected(2 * field.astype(int) - int(2 * iso))
            if betti is not None and betti != truth:
                faults = [*faults, f"Betti numbers {betti} for {truth}"]
            if faults:
                failed += 1
                print(f"field {n}, {field.shape}, iso {iso}: {'; '.join(faults)}")
            for name, (faults, betti) in peers(field, iso).items() if given.peers else ():
                tally = wrong.setdefault(name, [0, 0])
                tally[0] += bool(faults)
                tally[1] += betti != truth
    for name, (faults, betti) in wrong.items():
        print(f"{name}: {faults} fields with faults, {betti} with other Betti numbers")
    print(f"{given.fields - failed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
