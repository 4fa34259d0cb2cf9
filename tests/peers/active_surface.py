"""Active surfaces against other people's: python active_surface.py PATH/TO/measure [--rounds N] [--cases ball,0.5 …] [--certify | --blurred]

`cargo build --release -p ivd-bench --example measure` makes our side. Balls and tori of 128³ with Gaussian noise, from the same ball in the middle:
scikit-image's morphological Chan-Vese at 60 iterations with 1 to 4 smoothings (the one of the best Dice is timed), ITK's dense Chan-Vese at 60
with the curvature weight of the best Dice of four, PyMaxflow's minimum cut of 6 neighbours with our statistics, with the weight of the best Dice of five. Ours chooses
its weight by itself. Programs take turns, two threads each. Prints a Markdown table: the median of the other's time over ours, wall and
processor, with Dice, and for ours the distance of the level function's zeros from the true surface. With --certify: energies of our cuts against PyMaxflow's
on 20 volumes of 64³, and the gap, with that of two of 128³. With --blurred: borders over eight voxels, in noise of magnitudes (values above 1 cut off) and in
normal noise, by what tells our sides apart. Needs numpy, scipy, scikit-image, SimpleITK and PyMaxflow.
"""

import argparse
import itertools
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy import ndimage

from timing import timed

SHIFT = np.array([0.13, -0.21, 0.37])


def distances(shape, n):
    """Signed distance (voxels) at every voxel, array by z, y, x."""
    axis = [np.arange(n) - (n - 1) / 2 - s for s in SHIFT]
    x, y, z = axis[0][None, None, :], axis[1][None, :, None], axis[2][:, None, None]
    return distance(shape, (x, y, z), n)


def distance(shape, p, n):
    x, y, z = p
    if shape == "ball":
        return np.sqrt(x * x + y * y + z * z) - 0.35 * n
    if shape == "torus":
        return np.hypot(np.hypot(x, y) - 0.28 * n, z) - 0.12 * n
    w = 2 * np.pi * 4 / n
    f = np.sin(x * w) * np.cos(y * w) + np.sin(y * w) * np.cos(z * w) + np.sin(z * w) * np.cos(x * w)
    return f / w


def make(shape, n, sigma, seed):
    truth = distances(shape, n) < 0
    noise = np.random.default_rng(seed).normal(0, sigma, truth.shape) if sigma else 0
    return (truth + noise).astype(np.float32), truth


def dice(mask, truth):
    return 2 * np.count_nonzero(mask & truth) / (np.count_nonzero(mask) + np.count_nonzero(truth))


def far(level, shape):
    """Mean distance (voxels) of the zeros along the axes from the surface, and the mean with its sign, above 0 outside."""
    n = len(level)
    found = []
    for axis in range(3):
        a, b = np.moveaxis(level, axis, 0)[:-1], np.moveaxis(level, axis, 0)[1:]
        at = np.argwhere((a > 0) != (b > 0))
        va, vb = a[tuple(at.T)], b[tuple(at.T)]
        place = at.astype(float)
        place[:, 0] += va / (va - vb)
        order = [axis] + [i for i in range(3) if i != axis]
        zyx = np.empty_like(place)
        zyx[:, order] = place
        x, y, z = (zyx[:, 2 - i] - (n - 1) / 2 - SHIFT[i] for i in range(3))
        found.append(distance(shape, (x, y, z), n))
    found = np.concatenate(found)
    return np.abs(found).mean(), found.mean()


class Refused(Exception):
    """The program says that there is no boundary."""


class Ours:
    def __init__(self, program, folder):
        self.program, self.folder = program, Path(folder)

    def __call__(self, volume, repeats=1, **params):
        path, mask, level = (self.folder / name for name in ("v.raw", "mask.raw", "level.raw"))
        volume.tofile(path)
        dims = ",".join(map(str, volume.shape[::-1]))
        words = [self.program, "surface", path, "f32", dims, json.dumps(params), repeats, mask, level]
        done = subprocess.run([*map(str, words)], capture_output=True, text=True)
        if done.returncode:
            raise (Refused if "NoBoundary" in done.stderr else RuntimeError)(done.stderr)
        told = json.loads(done.stdout)
        told["mask"] = np.fromfile(mask, np.uint8).reshape(volume.shape) != 0
        told["level"] = np.fromfile(level, np.float32).reshape(volume.shape)
        return told


def start(n):
    axis = np.arange(n) - (n - 1) / 2
    return np.sqrt(axis[:, None, None] ** 2 + axis[None, :, None] ** 2 + axis[None, None, :] ** 2) - 0.2 * n


def morphological(volume, smoothing):
    from skimage.segmentation import morphological_chan_vese

    begin = (start(len(volume)) < 0).astype(np.int8)
    return morphological_chan_vese(volume, 60, init_level_set=begin, smoothing=smoothing) > 0


def dense(volume, curvature):
    import SimpleITK as sitk

    sitk.ProcessObject.SetGlobalDefaultNumberOfThreads(2)
    # On values of 0 to 255: on 0 to 1 its front collapses.
    low, high = volume.min(), volume.max()
    image = sitk.GetImageFromArray((volume - low) / (high - low) * 255)
    level = sitk.GetImageFromArray(start(len(volume)).astype(np.float32))
    run = sitk.ScalarChanAndVeseDenseLevelSetImageFilter()
    run.SetNumberOfIterations(60)
    run.SetMaximumRMSError(0.0)
    run.SetCurvatureWeight(curvature)
    run.SetLambda1(1)
    run.SetLambda2(1)
    run.SetEpsilon(3.0)
    run.SetHeavisideStepFunction(run.AtanRegularizedHeaviside)
    return sitk.GetArrayFromImage(run.Execute(level, image)) > 0.5


def cut(force, weights):
    """Minimum cut of a force and weights by step (z, y, x); its set and energy."""
    import maxflow

    graph = maxflow.GraphFloat()
    nodes = graph.add_grid_nodes(force.shape)
    for step, weight in weights:
        structure = np.zeros((3, 3, 3))
        structure[tuple(1 + s for s in step)] = 1
        graph.add_grid_edges(nodes, weights=weight, structure=structure, symmetric=True)
    graph.add_grid_tedges(nodes, np.maximum(force, 0), np.maximum(-force, 0))
    graph.maxflow()
    return graph.get_grid_segments(nodes)


def both(found, truth):
    """The better of a set and what surrounds it: peers turn them about."""
    return max(dice(found, truth), dice(~found, truth))


def compare(ours, rounds, cases):
    print("| input | program | Dice | wall × | processor × | note |\n|---|---|---|---|---|---|")
    for case in cases:
        shape, sigma = case.split(",")
        sigma = float(sigma)
        volume, truth = make(shape, 128, sigma, 7)
        name = f"{shape}, σ {sigma}"
        told = ours(volume, 3)
        peers = {}
        c1, c2 = told["means"]
        force = ((volume - c1) ** 2 - (volume - c2) ** 2).astype(np.float32)
        steps = [(0, 0, 1), (0, 1, 0), (1, 0, 0)]
        options = {
            "scikit-image, smoothing": [(s, lambda s=s: morphological(volume, s)) for s in (1, 2, 3, 4)],
            "SimpleITK dense, curvature": [(m, lambda m=m: dense(volume, m)) for m in (0.1, 1.0, 10.0, 100.0)],
            "PyMaxflow, 6 neighbours, weight": [
                (w, lambda w=w: cut(force, [(s, w) for s in steps])) for w in (0.3, 0.6, 1.0, 1.5, 2.0)
            ],
        }
        times, mine = {}, []
        for peer, choices in options.items():
            mine.append(np.median(np.array(ours(volume, 5)["times"][1:]), axis=0))
            tried = []
            for value, work in choices:
                found, took = timed(work)
                tried.append((both(found, truth), value, work, took))
            *peers[peer], took = max(tried, key=lambda t: t[0])
            times[peer] = [took]
        for _ in range(rounds - 1):
            mine.append(np.median(np.array(ours(volume, 5)["times"][1:]), axis=0))
            for peer, (_, _, work) in peers.items():
                times[peer].append(timed(work)[1])
        own = np.median(mine, axis=0)
        note = f"{1e3 * own[0]:.0f} ms wall, {1e3 * own[1]:.0f} ms processor; {far(told['level'], shape)[0]:.3f} voxels; μ {told['mu']:.2f}; {told['peak_mib']:.0f} MiB"
        print(f"| {name} | ours | {dice(told['mask'], truth):.4f} | 1 | 1 | {note} |", flush=True)
        for peer, (best, value, _) in peers.items():
            ratio = np.median(times[peer], axis=0) / own
            print(f"| {name} | {peer} {value} | {best:.4f} | {ratio[0]:.0f} | {ratio[1]:.0f} | |", flush=True)


def weights(neighbours):
    """Half of the neighbours' steps (z, y, x) with the area of an edge, on voxels of 1 mm: as docs/methods/boundary.md defines it."""
    steps = [(i // 9 - 1, i // 3 % 3 - 1, i % 3 - 1) for i in range(14, 27)]
    steps = [s for s in steps if neighbours == 26 or sum(map(abs, s)) == 1]
    vectors = np.array([s[::-1] for s in steps], float)
    lengths = np.linalg.norm(vectors, axis=1)
    points = 40_000
    z = (np.arange(points) + 0.5) / points
    turn = np.arange(points) * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    along = np.abs(np.stack([r * np.cos(turn), r * np.sin(turn), z], 1) @ (vectors / lengths[:, None]).T)
    # The last of equal ones, as ours takes it.
    nearest = along.shape[1] - 1 - np.argmax(along[:, ::-1], axis=1)
    angles = 2 * np.pi * np.bincount(nearest, minlength=len(steps)) / points
    return list(zip(steps, angles / (np.pi * lengths)))


def piece(inside):
    """The piece, through faces, that holds most of the start."""
    labels, _ = ndimage.label(inside)
    counts = np.bincount(labels[start(len(inside)) < 0])
    counts[0] = 0
    return labels == np.argmax(counts)


def energy(inside, force, edges):
    total = force[inside].sum(dtype=np.float64)
    border = 0.0
    for step, weight in edges:
        a, b = inside, inside
        for axis, s in enumerate(step):
            n = inside.shape[axis]
            a = a.take(range(max(0, -s), n - max(0, s)), axis)
            b = b.take(range(max(0, s), n - max(0, -s)), axis)
        border += weight * np.count_nonzero(a != b)
    return total + border, border


def certify(ours):
    print("| input | neighbours | energy off, of μ·area | labels that differ | gap | sweeps | s |\n|---|---|---|---|---|---|---|")
    worst, compared = 0, 0
    for case in itertools.count():
        if compared == 20:
            break
        shape, sigma = ("ball", "torus", "gyroid")[case % 3], (0.3, 0.6, 1.0)[case // 3 % 3]
        neighbours = 26 if case % 2 else 6
        volume, _ = make(shape, 64, sigma, case)
        area = "corners" if neighbours == 26 else "faces"
        try:
            told = ours(volume, 1, area=area, fill_holes=False)
        except Refused:
            print(f"| {shape}, σ {sigma} | {neighbours} | refused: taken for noise | | | | |", flush=True)
            continue
        compared += 1
        c1, c2 = told["means"]
        force = ((volume.astype(np.float64) - c1) ** 2 - (volume - c2) ** 2)
        edges = [(step, told["mu"] * weight) for step, weight in weights(neighbours)]
        # The part is the piece of the start: specks apart are left out of both.
        found = piece(cut(force, edges))
        theirs, border = energy(found, force, edges)
        # Both sets by one sum; what the program tells of its own is in single precision.
        mine, _ = energy(told["mask"], force, edges)
        off = (mine - theirs) / border
        worst = max(worst, abs(off))
        labels = np.count_nonzero(found != told["mask"])
        print(f"| {shape}, σ {sigma} | {neighbours} | {off:.1e} | {labels} | {told['gap']:.1e} | {told['sweeps']} | {told['times'][0][0]:.1f} |", flush=True)
    print(f"\nlargest difference {worst:.1e}")
    for shape in ("ball", "torus"):
        for area in ("faces", "corners"):
            told = ours(make(shape, 128, 0.5, 7)[0], 1, area=area, fill_holes=False)
            print(f"{shape}, 128³, σ 0.5, {area}: gap {told['gap']:.1e}, {told['sweeps']} sweeps, {told['times'][0][0]:.1f} s", flush=True)


def blurred(ours):
    print("| input | noise | means | histogram | normal | Rice | mixture |\n|---|---|---|---|---|---|---|")
    n = 128
    for shape in ("ball", "torus"):
        d = distances(shape, n)
        clean = np.clip(0.5 - d / 8, 0, 1)
        for of_magnitudes in (True, False):
            for sigma in (0.05, 0.1, 0.2, 0.3):
                draw = np.random.default_rng(7)
                noise = [draw.normal(0, sigma, clean.shape) for _ in range(2)]
                noisy = np.hypot(clean + noise[0], noise[1]).clip(0, 1) if of_magnitudes else clean + noise[0]
                mixture = "rician-mixture" if of_magnitudes else "gaussian-mixture"
                found = []
                for distribution in (None, "histogram", "gaussian", "rician", mixture):
                    how = {"data": "likelihood", "distribution": distribution} if distribution else {}
                    try:
                        told = ours(noisy.astype(np.float32), 1, **how)
                        off, bias = far(told["level"], shape)
                        found.append(f"{off:.3f}, {bias:+.3f}, {dice(told['mask'], d < 0):.4f}")
                    except Refused:
                        found.append("refused")
                kind = "of magnitudes" if of_magnitudes else "normal"
                print(f"| {shape} | {kind}, {sigma} | {' | '.join(found)} |", flush=True)


def main():
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("measure")
    asked.add_argument("--rounds", type=int, default=3)
    asked.add_argument("--cases", nargs="+", default=["ball,0.5", "ball,1", "torus,0.5", "torus,1"], help="shape and noise")
    asked.add_argument("--certify", action="store_true")
    asked.add_argument("--blurred", action="store_true")
    words = asked.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ours = Ours(words.measure, folder)
        if words.certify:
            certify(ours)
        elif words.blurred:
            blurred(ours)
        else:
            compare(ours, words.rounds, words.cases)


if __name__ == "__main__":
    main()
