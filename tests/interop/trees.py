"""Compares the merge heights of single linkage trees with SciPy's and, where it is installed, Higra's.

    python trees.py --program target/release/examples/measure [--volume FILE.npy ...] [--size 12]

The program is the example `measure` of ivd-bench. Random integer volumes of several ranges are compared with SciPy's single
linkage of the minimum spanning tree of the grid; the given volumes (integers, z y x) with the weights of SciPy's minimum
spanning tree, and with Higra's canonical binary partition tree. Equal means: every height, in order. Exits 1 where one isn't.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.cluster.hierarchy import linkage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

TYPES = {"uint8": "u8", "int16": "i16", "uint16": "u16", "int32": "i32"}


def ours(program, volume, folder):
    """Merge heights of the tree, those of the leaves (zeros) first."""
    raw, out = folder / "voxels.raw", folder / "heights.f64"
    np.ascontiguousarray(volume).tofile(raw)
    dims = [str(n) for n in volume.shape[::-1]]
    kind = TYPES[volume.dtype.name]
    subprocess.run(
        [program, "tree", raw, kind, *dims, "--linkage", "single", "--heights", out, "--classes", "1"],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    found = np.fromfile(out, np.float64)
    return np.concatenate([np.zeros(volume.size - 1 - found.size), found])


def grid_edges(volume):
    index = np.arange(volume.size).reshape(volume.shape)
    ends = [
        (index.take(range(n - 1), axis).ravel(), index.take(range(1, n), axis).ravel())
        for axis, n in enumerate(volume.shape)
    ]
    a, b = (np.concatenate(side) for side in zip(*ends))
    values = volume.ravel().astype(np.float64)
    return a, b, np.abs(values[a] - values[b])


def spanning_tree(volume):
    a, b, weight = grid_edges(volume)
    # SciPy takes a weight of 0 for no edge.
    tree = minimum_spanning_tree(coo_matrix((weight + 1.0, (a, b)), shape=(volume.size,) * 2).tocsr())
    tree.data -= 1.0
    return tree


def scipy_linkage(volume):
    """Heights of SciPy's single linkage; the distance of two voxels is the largest step on the way between them."""
    tree = spanning_tree(volume).tocoo()
    order = np.argsort(tree.data, kind="stable")
    distance = np.zeros((volume.size,) * 2)
    members = {i: [i] for i in range(volume.size)}
    for a, b, weight in zip(tree.row[order], tree.col[order], tree.data[order]):
        x, y = members[a], members[b]
        distance[np.ix_(x, y)] = weight
        distance[np.ix_(y, x)] = weight
        x += y
        for member in y:
            members[member] = x
    return linkage(distance[np.triu_indices(volume.size, 1)], "single")[:, 2]


def higra_heights(volume):
    import higra

    a, b, weight = grid_edges(volume)
    graph = higra.UndirectedGraph(volume.size)
    graph.add_edges(a, b)
    tree, altitudes = higra.bpt_canonical(graph, weight)
    return np.sort(altitudes[tree.num_leaves() :])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("--volume", nargs="*", default=[], type=Path)
    parser.add_argument("--size", type=int, default=12, help="voxels along an axis of a random volume")
    options = parser.parse_args()
    random = np.random.default_rng(8)
    wrong = 0

    def compare(name, found, expected):
        nonlocal wrong
        same = np.array_equal(found, expected)
        wrong += not same
        print(f"{name}: {found.size} merges, {'equal' if same else 'DIFFERENT'}", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        shapes = [(options.size, options.size - 1, options.size + 1), (1, 40, 37), (2000, 1, 1)]
        for shape in shapes:
            for top, kind in ((2, np.uint8), (256, np.uint8), (4000, np.uint16), (60000, np.int32)):
                volume = random.integers(0, top, shape).astype(kind)
                compare(f"random {shape} below {top}: SciPy", ours(options.program, volume, folder), scipy_linkage(volume))
        for path in options.volume:
            volume = np.load(path)
            found = ours(options.program, volume, folder)
            compare(f"{path.name}: SciPy's spanning tree", found, np.sort(spanning_tree(volume).data))
            try:
                compare(f"{path.name}: Higra", found, higra_heights(volume))
            except ImportError:
                print("Higra is not installed: passed over")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
