"""How extraction errs as the voxel shrinks: python convergence.py PATH/TO/ivd [--sizes 64 128 256 512] [--shapes sphere torus gyroid]

The phantoms of `ivd phantom` (f32) by `ivd lattice --iso 0.5`: area and enclosed volume relative to the truth, and the vertices'
distance from the exact surface as a fraction of the body's size, which falls with the square of the voxel as they do. Of the
gyroid, whose part in the volume is capped, the area is that of the triangles in cells that make up three periods a side; its
truth is a quadrature of the surface's own equation, and its distance is that to first order. Prints a Markdown table and the orders that regression of logarithms finds. Needs numpy and
nibabel.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from surfaces import ivd, read_ply

SHIFT = np.array([0.13, -0.21, 0.37])
BALL, LARGE, SMALL, PERIODS = 0.35, 0.28, 0.12, 4  # of the size


def gyroid(p, size):
    """f and its gradient (1/voxel) at voxel coordinates."""
    wave = 2 * np.pi * PERIODS / size
    s, c = np.sin(p * wave).T, np.cos(p * wave).T
    f = s[0] * c[1] + s[1] * c[2] + s[2] * c[0]
    return f, wave * np.stack([c[0] * c[1] - s[2] * s[0], c[1] * c[2] - s[0] * s[1], c[2] * c[0] - s[1] * s[2]], 1)


def area_of_a_period(steps=6000):
    """Of the gyroid in a cube of side 2π: three times the integral over x and y of |f_z| / |∇f| at every z on the surface."""
    step = 2 * np.pi / steps
    x, total = (np.arange(steps) + 0.5) * step, 0.0
    for y in x:
        length, turn = np.hypot(np.sin(y), np.cos(x)), np.arctan2(np.cos(x), np.sin(y))
        share = -np.sin(x) * np.cos(y) / length
        there = np.abs(share) < 1
        for sign in (1, -1):
            z = turn[there] + sign * np.arccos(share[there])
            _, gradient = gyroid(np.stack([x[there], np.full(len(z), y), z], 1), 2 * np.pi * PERIODS)
            total += (np.abs(gradient[:, 2]) / np.linalg.norm(gradient, axis=1)).sum()
    return 3 * total * step * step


def distance(shape, p, size):
    """From the exact surface (voxels), of places relative to its centre."""
    if shape == "sphere":
        return np.abs(np.linalg.norm(p, axis=1) - BALL * size)
    if shape == "torus":
        return np.abs(np.hypot(np.hypot(p[:, 0], p[:, 1]) - LARGE * size, p[:, 2]) - SMALL * size)
    f, gradient = gyroid(p, size)
    return np.abs(f) / np.linalg.norm(gradient, axis=1)


def measure(program, folder, shape, size, unit):
    ivd(program, "phantom", shape, "--size", size, "--type", "f32", "-o", folder / "volume.ivd")
    found = ivd(program, "lattice", folder / "volume.ivd", "--iso", "0.5", "-o", folder / "lattice.ivd")["metrics"]
    ivd(program, "export", folder / "lattice.ivd", "-o", folder / "lattice.ply")
    vertices, triangles = read_ply(folder / "lattice.ply")
    inside = ((vertices >= 0) & (vertices <= size - 1)).all(1)
    far = np.concatenate([distance(shape, part - (size - 1) / 2 - SHIFT, size) for part in np.array_split(vertices[inside], 64)])
    if shape == "gyroid":
        area, middle = 0.0, 0
        for part in np.array_split(triangles, 64):
            corners = vertices[part]
            middle = corners.mean(1)
            kept = corners[((middle >= 0) & (middle < 3 * size // PERIODS)).all(1)]
            area += np.linalg.norm(np.cross(kept[:, 1] - kept[:, 0], kept[:, 2] - kept[:, 0]), axis=1).sum() / 2
        truth, enclosed = unit * 27 * (size / (2 * np.pi * PERIODS)) ** 2, None
    else:
        area = found["area_mm2"]
        if shape == "sphere":
            truth, volume = 4 * np.pi * (BALL * size) ** 2, 4 / 3 * np.pi * (BALL * size) ** 3
        else:
            truth, volume = 4 * np.pi**2 * LARGE * SMALL * size**2, 2 * np.pi**2 * LARGE * SMALL**2 * size**3
        enclosed = abs(found["volume_mm3"] / volume - 1)
    return {"shape": shape, "size": size, "triangles": len(triangles), "area": abs(area / truth - 1), "volume": enclosed,
            "distance_max": far.max() / size, "distance_mean": far.mean() / size}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ivd")
    parser.add_argument("--sizes", type=int, nargs="+", default=[64, 128, 256, 512])
    parser.add_argument("--shapes", nargs="+", default=["sphere", "torus", "gyroid"])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    unit = area_of_a_period() if "gyroid" in given.shapes else None
    rows = []
    print("| shape | voxels | triangles | area | volume | farthest vertex | mean vertex |\n|---|---|---|---|---|---|---|")
    form = lambda value: "" if value is None else f"{value:.2e}"
    with tempfile.TemporaryDirectory() as folder:
        for shape in given.shapes:
            mine = []
            for size in given.sizes:
                mine.append(measure(given.ivd, Path(folder), shape, size, unit))
                r = mine[-1]
                print(f"| {shape} | {size}³ | {r['triangles']:,} | {form(r['area'])} | {form(r['volume'])} | {form(r['distance_max'])} | {form(r['distance_mean'])} |", flush=True)
            orders = {key: -np.polyfit(np.log([r["size"] for r in mine]), np.log([r[key] for r in mine]), 1)[0]
                      for key in ("area", "volume", "distance_max", "distance_mean") if mine[0][key] is not None}
            print(f"| {shape} | order | | " + " | ".join(f"{orders[k]:.2f}" if k in orders else "" for k in ("area", "volume", "distance_max", "distance_mean")) + " |", flush=True)
            rows.append({"shape": shape, "sizes": mine, "orders": orders})
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1, default=float))


if __name__ == "__main__":
    main()
