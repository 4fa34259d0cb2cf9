#!/usr/bin/env python3
"""Holds the topology of extracted lattices against that of the trilinear function: topology.py PATH/TO/ivd [--fields N] [--seed S]

Random integer fields of 8³ to 20³ voxels, values 0 to 3, isovalues 0, 1, 1.5 and 2; before them, unless --random-only, small
ones with ties: an array of 3 × 2 × 2 voxels at 0 whose middle face has equal products of its diagonals, for which scikit-image
makes two pairs of coincident triangles, in all its turns and mirrored, as it is and with its sign changed; and 200 fields of 3³
voxels from −9 to 9 with a 0 in the middle, cut at 0. Each lattice is written as PLY and read by
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
from math import isqrt
from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ISOS = (0.0, 1.0, 1.5, 2.0)
OUTSIDE = -1000  # twice the level of what surrounds the volume
HAIRS = 10**5  # a hair, that a level lies above itself, is one part of so many
BITS, CLOSE = 400, Fraction(1, 2**300)  # behind the point, of a root; what is closer is the same
CORNERS = list(itertools.product((0, 1), repeat=3))  # z, y, x
PAIRS = list(itertools.combinations(range(8), 2))  # of corners
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
    """Of a cell with these twice the levels: pairs of corners that hang together in it, as bits in the order of PAIRS, and the
    Euler characteristic of its inside. All in whole numbers: a slice's levels are multiples by a number above 0, which leaves
    every sign alone."""
    low = [levels[CORNERS.index((0, *at))] * HAIRS + 1 for at in TURN]
    high = [levels[CORNERS.index((1, *at))] * HAIRS + 1 for at in TURN]
    at = lambda t: [p * (t.denominator - t.numerator) + q * t.numerator for p, q in zip(low, high)]
    joint = lambda v: v[0] * v[2] - v[1] * v[3]
    cuts = {(Fraction(0), False), (Fraction(1), False)}
    cuts |= {(Fraction(p, p - q), False) for p, q in zip(low, high) if (p > 0) != (q > 0)}
    c0, c1, twice_half = joint(low), joint(high), joint([p + q for p, q in zip(low, high)])
    square = 2 * c0 + 2 * c1 - twice_half
    slope = c1 - c0 - square
    root = slope * slope - 4 * square * c0
    if root > 0:
        # To so many bits that a root a hair's square beside a corner's crossing is told from it.
        r = isqrt(root << 2 * BITS)
        q = (-slope << BITS) - (r if slope >= 0 else -r)
        roots = ([Fraction(q, 2 * square << BITS)] if square else []) + ([Fraction(2 * c0 << BITS, q)] if q else [])
        for t in roots:
            if 0 < t < 1 and all(abs(t - other) > CLOSE for other, _ in cuts):
                cuts.add((t, True))
    cuts = sorted(cuts)
    characteristic = sum(slice_characteristic(*at(t), on_saddle) for t, on_saddle in cuts)
    # Of each corner of each slab the least number that it hangs together with.
    part = list(range(4 * (len(cuts) - 1)))

    def join(a, b):
        a, b = part[a], part[b]
        if a != b:
            part[:] = [min(a, b) if p in (a, b) else p for p in part]

    before = None
    for n, ((t, _), (u, _)) in enumerate(zip(cuts, cuts[1:])):
        middle = at((t + u) / 2)
        characteristic -= slice_characteristic(*middle)
        inside = [v > 0 for v in middle]
        for i in range(4):
            if inside[i] == inside[(i + 1) % 4]:
                join(4 * n + i, 4 * n + (i + 1) % 4)
            if before and before[i] == inside[i]:
                join(4 * n - 4 + i, 4 * n + i)
        if inside[0] == inside[2] != inside[1] and inside[1] == inside[3]:
            first = 0 if joint(middle) > 0 else 1
            join(4 * n + first, 4 * n + first + 2)
        before = inside
    last = len(part) - 4
    corner = {(0, *at): part[i] for i, at in enumerate(TURN)} | {(1, *at): part[last + i] for i, at in enumerate(TURN)}
    return sum(1 << bit for bit, (i, j) in enumerate(PAIRS) if corner[CORNERS[i]] == corner[CORNERS[j]]), characteristic


def expected(twice):
    """Components and tunnels (Betti numbers 0 and 1) of the surface of a field of twice the levels."""
    padded = np.pad(twice, 1, constant_values=OUTSIDE)
    inside = padded >= 0
    corners = [padded[tuple(slice(o, s - 1 + o) for o, s in zip(at, padded.shape))] for at in CORNERS]
    number = np.arange(padded.size).reshape(padded.shape)
    first = number[:-1, :-1, :-1].ravel()
    steps = [np.ravel_multi_index(at, padded.shape) for at in CORNERS]
    # Two cells with the same eight levels are the same: a whole number stands for the eight.
    levels, which = np.unique(padded, return_inverse=True)
    which = which.reshape(padded.shape)
    code = sum(which[tuple(slice(o, s - 1 + o) for o, s in zip(at, padded.shape))] * len(levels) ** i for i, at in enumerate(CORNERS))
    _, example, kind = np.unique(code.ravel(), return_index=True, return_inverse=True)
    patterns = np.stack([c.ravel()[example] for c in corners], 1).tolist()
    found = [cell(tuple(pattern)) for pattern in patterns]
    joined = np.array([bits for bits, _ in found])[kind]
    cells = int(np.array([characteristic for _, characteristic in found])[kind].sum())
    rows, columns = [], []
    for bit, (i, j) in enumerate(PAIRS):
        places = first[joined >> bit & 1 == 1]
        rows.append(places + steps[i])
        columns.append(places + steps[j])
    # Inclusion and exclusion over the closed cells: cells - inner faces + inner edges - inner vertices.
    faces = sum(face_characteristic(np.moveaxis(padded, axis, 0)) for axis in range(3))
    characteristic = cells - faces + edge_characteristic(padded) - int(inside.sum())
    graph = coo_array((np.ones(sum(map(len, rows)), bool), (np.concatenate(rows), np.concatenate(columns))), shape=(padded.size,) * 2)
    regions, _ = connected_components(graph, directed=False)
    components = regions - 1
    if not inside.any():
        return 0, 0
    return components, 2 * components - 2 * characteristic


def face_characteristic(field):
    """Sum over the inner faces normal to axis 0 of the Euler characteristic of their inside."""
    plane = field[1:-1]
    a, b, c, d = (plane[:, y : plane.shape[1] - 1 + y, x : plane.shape[2] - 1 + x].astype(float) + 1 / HAIRS for y, x in TURN)
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


def tied(random):
    """Small fields and their isovalues, moved up by 15 so that none is below 0."""
    array = np.array([[[13, -1], [-1, -7]], [[-1, 1], [7, -7]], [[15, -9], [-3, -1]]])
    for sign, axes, flips in itertools.product((1, -1), itertools.permutations(range(3)), itertools.product((1, -1), repeat=3)):
        yield sign * array.transpose(axes)[tuple(slice(None, None, step) for step in flips)]
    for _ in range(200):
        field = random.integers(-9, 10, (3, 3, 3))
        field[1, 1, 1] = 0
        yield field


def counted(mesh):
    """What is wrong with a mesh, and its Betti numbers."""
    faults = []
    if not len(mesh.faces):
        return faults, (0, 0)
    if not mesh.is_watertight:
        faults.append("not closed")
    if not mesh.is_winding_consistent:
        faults.append("wound both ways")
    faces = np.sort(np.asarray(mesh.faces, np.int64), axis=1)
    n = len(mesh.vertices)
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [0, 2]], faces[:, [1, 2]]])
    edges, uses = np.unique(ends[:, 0] * n + ends[:, 1], return_counts=True)
    if uses.max() > 2:
        faults.append("an edge of more than two triangles")
    if len(np.unique((np.asarray(mesh.vertices) + 0.0).view("V24"))) < n:
        faults.append("coincident vertices")
    if (faces[:, :-1] == faces[:, 1:]).any():
        faults.append("repeated corners")
    if len(np.unique((faces[:, 0] * n + faces[:, 1]) * n + faces[:, 2])) < len(faces):
        faults.append("repeated triangles")
    graph = coo_array((np.ones(len(edges), bool), (edges // n, edges % n)), shape=(n, n))
    _, part = connected_components(graph, directed=False)
    used = np.unique(faces)
    components = len(np.unique(part[used]))
    characteristic = len(used) - len(edges) + len(faces)
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
    parser.add_argument("--random-only", action="store_true")
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    cases = []
    if not given.random_only:
        small = tied(np.random.default_rng(given.seed + 1))
        cases = [(f"tied {n}", (field + 15).astype(np.uint8), 15.0) for n, field in enumerate(small)]
    for n in range(given.fields):
        field = random.integers(0, 4, random.integers(8, 21, 3)).astype(np.uint8)
        cases.append((f"field {n}", field, ISOS[n % 4]))
    failed, wrong = 0, {}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda case: ours(given.ivd, Path(folder), *case), cases)
        for done, ((name, field, iso), (faults, betti)) in enumerate(zip(cases, found), 1):
            truth = expected(2 * field.astype(int) - int(2 * iso))
            if betti is not None and betti != truth:
                faults = [*faults, f"Betti numbers {betti} for {truth}"]
            if faults:
                failed += 1
                print(f"{name}, {field.shape}, iso {iso}: {'; '.join(faults)}", flush=True)
            for peer, (faults, betti) in peers(field, iso).items() if given.peers else ():
                tally = wrong.setdefault((name.split()[0], peer), [0, 0])
                tally[0] += bool(faults)
                tally[1] += betti != truth
            if done % 500 == 0:
                print(f"{done} of {len(cases)} judged, {failed} failed", file=sys.stderr, flush=True)
    for (kind, peer), (faults, betti) in wrong.items():
        print(f"{peer}, {'small fields with ties' if kind == 'tied' else 'random fields'}: {faults} with faults, {betti} with other Betti numbers")
    print(f"{len(cases) - failed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
