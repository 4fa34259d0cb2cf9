#!/usr/bin/env python3
"""Holds the lattices of several labels against the label volume itself: label_lattices.py PATH/TO/ivd VOLUME…

Each volume of labels is imported, all its labels are cut at once and written as PLY. Read by trimesh, every lattice must be closed,
wound one way and a manifold (every edge with two triangles, every vertex with one fan). Seams: wherever two neighbouring voxels have
different labels, the place halfway between them is a vertex of both lattices (and of no third); every triangle of a lattice that
isn't turned over in exactly one other's borders a voxel without a label. The volume is read by SimpleITK, apart from the program.
Without volumes: three made here, of which one is noise. Prints a line each; the status is 1 where something failed.
Needs numpy, trimesh, SimpleITK.
"""
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np
import SimpleITK as sitk
import trimesh


def made(folder):
    """Small label volumes: noise, nested balls, columns that meet along lines."""
    rng = np.random.default_rng(3)
    z, y, x = np.indices((20, 22, 24))
    ball = np.sqrt((x - 12) ** 2 + (y - 10) ** 2 + (z - 9.5) ** 2)
    volumes = {
        "noise": rng.integers(0, 6, (12, 13, 14)).astype(np.uint8),
        "balls": np.digitize(-ball, [-9.0, -6.0, -3.0]).astype(np.uint8),
        "columns": (1 + x // 6 + 4 * (y // 8)).astype(np.uint16),
    }
    for name, array in volumes.items():
        image = sitk.GetImageFromArray(array)
        image.SetSpacing((0.5, 0.75, 2.0))
        image.SetOrigin((-100.0, 40.0, 3.0))
        sitk.WriteImage(image, str(folder / f"{name}.nrrd"))
        yield folder / f"{name}.nrrd"


def voxels(volume, image):
    """The labels by voxel, z first. What a MetaImage holds compressed is unpacked here: of one made elsewhere SimpleITK 2.5 gives some
    thousands of voxels another label than zlib does."""
    if volume.suffix == ".mhd":
        header = dict(line.split(" = ") for line in volume.read_text().splitlines())
        if header.get("CompressedData") == "True" and header["ElementType"] == "MET_UCHAR":
            packed = (volume.parent / header["ElementDataFile"]).read_bytes()
            return np.frombuffer(zlib.decompress(packed), np.uint8).reshape(image.GetSize()[::-1])
    return sitk.GetArrayFromImage(image)


def is_one_fan(faces, vertices):
    """Whether the triangles round every vertex hang together by edges: components of (vertex, triangle) pairs joined across edges."""
    corner = np.arange(faces.size).reshape(faces.shape)
    directed = {}
    parent = np.arange(faces.size)

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for k in range(3):
        for at, (a, b) in zip(corner[:, [k, (k + 1) % 3]], zip(faces[:, k].tolist(), faces[:, (k + 1) % 3].tolist())):
            directed[(a, b)] = (at[0], at[1])
    for (a, b), (at_a, at_b) in directed.items():
        twin = directed.get((b, a))
        if twin is None:
            return False
        parent[root(at_a)] = root(twin[1])
        parent[root(at_b)] = root(twin[0])
    fans = len({root(i) for i in range(faces.size)})
    return fans == vertices


def check(ivd, volume, folder):
    run = lambda *words: subprocess.run([ivd, *words, "--cache", "off", "--progress", "never", "-q"], check=True)
    labels, parts = folder / "labels.ivd", folder / "parts"
    run("import", str(volume), "--labels", "-o", str(labels))
    run("lattice", str(labels), "--labels", str(labels), "--parts", "all", "-o", str(parts))
    image = sitk.ReadImage(str(volume))
    array = voxels(volume, image).astype(np.int64)
    ids = [int(i) for i in np.unique(array) if i != 0]
    files = {int(f.stem.split("-")[1]): f for f in parts.glob("label-*.ivd")}
    problems = [] if sorted(files) == ids else [f"labels {ids}, files {sorted(files)}"]

    # Places as twice the voxel coordinate where they are halfway between voxels.
    direction = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    inverse, origin = np.linalg.inv(direction), np.array(image.GetOrigin())
    places, triangles, total = {}, {}, 0
    for label, file in files.items():
        ply = folder / f"{label}.ply"
        run("export", str(file), "-o", str(ply))
        mesh = trimesh.load(ply, process=False)
        faces, count = np.asarray(mesh.faces), len(mesh.vertices)
        total += len(faces)
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        _, uses = np.unique(edges, axis=0, return_counts=True)
        if not (mesh.is_watertight and mesh.is_winding_consistent and (uses == 2).all() and mesh.volume > 0):
            problems.append(f"label {label} isn't closed, wound one way and outward")
        elif count <= 400_000 and not is_one_fan(faces, count):
            problems.append(f"label {label} has a vertex of several fans")
        voxel = (np.asarray(mesh.vertices) * (-1, -1, 1) - origin) @ inverse.T
        if len(np.unique(np.round(voxel * 1024), axis=0)) != count:
            problems.append(f"label {label} has coincident vertices")
        key = np.round(voxel * 1024).astype(np.int64) + 4096
        key = (key[:, 0] << 42) + (key[:, 1] << 21) + key[:, 2]
        places[label] = key
        own = key[faces]
        least = own.argmin(axis=1)
        triangles[label] = np.stack([np.take_along_axis(own, ((least + k) % 3)[:, None], 1)[:, 0] for k in range(3)], 1)

    whole = np.pad(array, 1)
    for axis in range(3):
        first = np.moveaxis(whole, axis, 0)
        a, b = first[:-1], first[1:]
        for label in ids:
            at = np.argwhere((a == label) != (b == label))
            at = np.insert(at[:, 1:], axis, at[:, 0], axis=1)[:, ::-1] - 1  # x, y, z of the lower voxel
            twice = at * 1024 + 512 * (np.arange(3) == 2 - axis) + 4096
            key = (twice[:, 0] << 42) + (twice[:, 1] << 21) + twice[:, 2]
            if not np.isin(key, places.get(label, [])).all():
                problems.append(f"label {label} lacks vertices between voxels along axis {2 - axis}")
    rows = np.concatenate([np.insert(t, 3, label, axis=1) for label, t in triangles.items()])
    turned = rows[:, [0, 2, 1]]
    join = lambda t: np.ascontiguousarray(t).view([("", np.int64)] * 3).ravel()
    forward, uses = np.unique(join(rows[:, :3].copy()), return_counts=True)
    if (uses > 1).any():
        problems.append(f"{(uses > 1).sum()} triangles are in two lattices the same way round")
    alone = rows[~np.isin(join(turned.copy()), forward)]
    # A triangle on no other's side borders the outside: one of its corners lies between a labelled voxel and one without a label.
    outside = sum(len(t) for t in [alone])
    if (array != 0).all():
        inner = np.all([(lambda c: (c > 4096) & (c < 4096 + 1024 * (n - 1)))((alone[:, :3] >> s & 0x1FFFFF)) for s, n in
                        zip((42, 21, 0), array.shape[::-1])], axis=(0, 2))
        if inner.any():
            problems.append(f"{inner.sum()} triangles within have no other side")
    print(f"{volume.name}: {len(ids)} labels, {total} triangles, {(total - outside) // 2} on seams: {'; '.join(problems) or 'closed, manifold, seams coincide'}")
    return not problems


def main():
    ivd, volumes = sys.argv[1], [Path(v) for v in sys.argv[2:]]
    good = True
    with tempfile.TemporaryDirectory() as scratch:
        for i, volume in enumerate(volumes or list(made(Path(scratch)))):
            folder = Path(scratch) / str(i)
            folder.mkdir()
            good &= check(ivd, volume, folder)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
