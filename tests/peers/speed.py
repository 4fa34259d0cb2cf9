"""Clustering against other people's, for time: python speed.py PATH/TO/measure [--data DIR] [--rounds N] [--only WORD]

`cargo build --release -p ivd-bench --example measure` makes our side. Bonsai, a noisy head and the MNI152 average, two
threads; ours and theirs take turns, each with the same voxels, the same start and the same number of iterations where there
are iterations. Prints a Markdown table: the other program's median time over ours, wall and processor time, with what was
found. Needs numpy, nibabel, scikit-learn, opencv-python-headless and higra.
"""

import argparse
import json
import os
import resource
import subprocess
import tempfile
import warnings
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "2"
import nibabel
import numpy as np

from timing import timed

warnings.simplefilter("ignore")
K = 4
# Added to every variance, so that a component of one value alone keeps one.
ADDED = 0.25


class Ours:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def __call__(self, voxels, method, params, repeats=3, labels=None):
        path = self.folder / "voxels.raw"
        voxels.ravel(order="F").tofile(path)
        kind = {"uint8": "u8", "uint16": "u16", "float32": "f32"}[str(voxels.dtype)]
        words = [self.program, "method", method, path, kind, ",".join(map(str, voxels.shape)), json.dumps(params), repeats]
        done = subprocess.run([*map(str, words), *([str(labels)] if labels else [])], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        found = json.loads(done.stdout)
        # The first run pays for memory that the others find warm, as the peer's process has it.
        return found, np.median(np.array(found["times"][1:] or found["times"]), axis=0)


def row(work, volume, peer, theirs, ours, note=""):
    ratio = np.median(theirs, axis=0) / np.median(ours, axis=0)
    mine = np.median(ours, axis=0)
    print(f"| {work} | {volume} | {peer} | {ratio[0]:.1f} | {ratio[1]:.1f} | {mine[1]:.3f} | {note} |", flush=True)


def kmeans(ours, name, voxels, rounds):
    from sklearn.cluster import KMeans

    flat = voxels.ravel()

    def histogram():
        if voxels.dtype == np.uint8:
            counts = np.bincount(flat, minlength=256)
            values = np.arange(256, dtype=float)
            fit = KMeans(K, n_init=1, random_state=0).fit(values[:, None], sample_weight=counts)
            return fit, fit.predict(values[:, None]).astype(np.uint16)[flat]
        values, inverse, counts = np.unique(flat, return_inverse=True, return_counts=True)
        fit = KMeans(K, n_init=1, random_state=0).fit(values.astype(float)[:, None], sample_weight=counts)
        return fit, fit.labels_.astype(np.uint16)[inverse]

    theirs, mine, whole = [], [], []
    for _ in range(rounds):
        found, seconds = ours(voxels, "kmvs", {"k": K})
        mine.append(seconds)
        (fit, _), seconds = timed(histogram)
        theirs.append(seconds)
    start = np.quantile(flat, (np.arange(K) + 0.5) / K)[:, None].astype(np.float32)
    plain, seconds = timed(lambda: KMeans(K, init=np.unique(start)[:, None] if len(np.unique(start)) == K else "k-means++", n_init=1, random_state=0).fit(flat.astype(np.float32)[:, None]))
    whole.append(seconds)
    exact = lambda centres: float(sum(((part[:, None].astype(float) - centres) ** 2).min(1).sum() for part in np.array_split(flat, 64)))
    note = f"inertia {found['objective']:.8g}, theirs {exact(fit.cluster_centers_.ravel()):.8g}, {exact(plain.cluster_centers_.ravel().astype(float)):.8g}"
    row("k-means, K = 4", f"{name}, {voxels.dtype}", "scikit-learn, weighted distinct values", theirs, mine, note)
    row("", "", "scikit-learn, all voxels, once", whole, mine)


def with_places(ours, name, voxels, rounds):
    import cv2
    from sklearn.cluster import KMeans

    cv2.setNumThreads(2)
    shape = voxels.shape
    weight = 64.0 / max(shape)
    places = np.meshgrid(*[np.arange(n, dtype=np.float32) for n in shape], indexing="ij")
    points = np.stack([*(p.ravel() * weight for p in places), voxels.ravel().astype(np.float32)], axis=1)
    random = np.random.default_rng(3)
    start = points[random.choice(len(points), K, replace=False)].astype(float)
    centres = (start / [weight, weight, weight, 1]).tolist()
    plain, lloyd = timed(lambda: KMeans(K, init=start.astype(np.float32), n_init=1, max_iter=300, tol=0).fit(points))
    first = ((points[:, None] - start.astype(np.float32)) ** 2).sum(-1).argmin(1).astype(np.int32)[:, None]
    theirs, mine, cv = [lloyd], [], []
    for _ in range(rounds):
        found, seconds = ours(voxels, "kmvs", {"k": K, "spatial_weight": weight, "start": centres, "max_iterations": 300})
        mine.append(seconds)
        rounds_done = found["iterations"]
        (inertia, *_), seconds = timed(lambda: cv2.kmeans(points, K, first.copy(), (cv2.TERM_CRITERIA_MAX_ITER, rounds_done, 0), 1, cv2.KMEANS_USE_INITIAL_LABELS))
        cv.append(seconds)
    # Their own sum is one of single precision.
    exact = sum(((points[i : i + 10**6].astype(float) - plain.cluster_centers_[plain.labels_[i : i + 10**6]]) ** 2).sum() for i in range(0, len(points), 10**6))
    note = f"inertia {found['objective']:.8g}, theirs {exact:.8g}, {inertia:.8g}; iterations {rounds_done}, {plain.n_iter_}"
    row("k-means with places, K = 4", name, "scikit-learn, Lloyd", theirs, mine, note)
    row("", "", "OpenCV", cv, mine)


def mixture_of_histogram(values, counts, weights, means, variances, rounds, added):
    total = counts.sum()
    for _ in range(rounds):
        logs = np.log(weights) - 0.5 * (np.log(2 * np.pi * variances) + (values[:, None] - means) ** 2 / variances)
        shares = np.exp(logs - logs.max(1, keepdims=True))
        shares *= (counts / shares.sum(1))[:, None]
        n = shares.sum(0)
        weights, means = n / total, (shares * values[:, None]).sum(0) / n
        variances = (shares * (values[:, None] - means) ** 2).sum(0) / n + added
    logs = np.log(weights) - 0.5 * (np.log(2 * np.pi * variances) + (values[:, None] - means) ** 2 / variances)
    return logs, (counts * np.logaddexp.reduce(logs, axis=1)).sum() / total


def mixture(ours, name, voxels, rounds):
    flat, steps, added = voxels.ravel(), 100, 1 / 12
    low, high = float(flat.min()), float(flat.max())
    means = np.linspace(low, high, 2 * K + 1)[1::2]
    variances = np.full(K, float(flat.astype(float).var()) / K**2)
    weights = np.full(K, 1 / K)
    start = {"weights": weights.tolist(), "means": means[:, None].tolist(), "covariances": variances[:, None].tolist()}
    params = {"k": K, "max_iterations": steps, "tolerance": 0.0, "variance_floor": 0.0, "variance_added": added, "start": start}

    def count():
        if voxels.dtype == np.uint8:
            counts = np.bincount(flat, minlength=256)
            return np.arange(256, dtype=float), counts.astype(float), flat
        values, inverse, counts = np.unique(flat, return_inverse=True, return_counts=True)
        return values.astype(float), counts.astype(float), inverse

    def whole():
        values, counts, places = count()
        logs, likelihood = mixture_of_histogram(values, counts, weights, means, variances, steps, added)
        return likelihood, (logs.argmax(1) + 1).astype(np.uint16)[places]

    values, counts, _ = count()
    theirs, mine, fit, short = [], [], [], []
    for _ in range(rounds):
        found, seconds = ours(voxels, "emvs", params)
        mine.append(seconds)
        # Ours without iterations: what counting and labels take.
        _, base = ours(voxels, "emvs", {**params, "max_iterations": 1})
        short.append(np.maximum(seconds - base, 1e-5))
        (likelihood, _), seconds = timed(whole)
        theirs.append(seconds)
        fit.append(timed(lambda: mixture_of_histogram(values, counts, weights, means, variances, steps, added))[1])
    kind = f"{name}, {voxels.dtype}"
    row("mixture on intensity, 100 iterations", kind, "numpy, histogram, EM, labels", theirs, mine, f"log-likelihoods differ by {abs(likelihood - found['objective']):.1e}")
    row("", "", "the iterations alone", fit, short)


def mixture_with_places(ours, name, voxels, rounds):
    from sklearn.mixture import GaussianMixture

    shape, steps = voxels.shape, 10
    places = np.meshgrid(*[np.arange(n, dtype=float) for n in shape], indexing="ij")
    points = np.stack([*(p.ravel() for p in places), voxels.ravel().astype(float)], axis=1)
    means = np.tile(points.mean(0), (K, 1))
    means[:, 3] = np.linspace(points[:, 3].min(), points[:, 3].max(), 2 * K + 1)[1::2]
    variances = np.tile(points.var(0), (K, 1))
    variances[:, 3] /= K * K
    for shape_name, theirs_name in (("diagonal", "diag"), ("full", "full")):
        diagonal = shape_name == "diagonal"
        covariances = variances.tolist() if diagonal else [np.diag(v).ravel().tolist() for v in variances]
        start = {"weights": [1 / K] * K, "means": means.tolist(), "covariances": covariances}
        params = {"k": K, "covariance": shape_name, "max_iterations": steps, "tolerance": 0.0, "variance_floor": 0.0, "variance_added": ADDED, "start": start}
        precisions = 1 / variances if diagonal else np.array([np.diag(1 / v) for v in variances])
        theirs, mine = [], []
        for _ in range(rounds):
            found, seconds = ours(voxels, "emvs", params)
            mine.append(seconds)
            fit = GaussianMixture(K, covariance_type=theirs_name, max_iter=steps, tol=0, reg_covar=ADDED, means_init=means, weights_init=np.full(K, 1 / K), precisions_init=precisions)
            # Its own first step: k-means for responsibilities that the given start then replaces.
            fit._initialize_parameters = lambda X, random_state=None, xp=None: fit._initialize(X, np.full((len(X), K), 1 / K))
            _, seconds = timed(lambda: (fit.fit(points), fit.predict(points)))
            theirs.append(seconds)
        row(f"mixture with places, {shape_name}, 10 iterations", name, "scikit-learn, GaussianMixture", theirs, mine, f"log-likelihoods differ by {abs(fit.score(points) - found['objective']):.1e}")


def tree(ours, name, voxels, rounds):
    import higra

    def partition():
        graph = higra.get_6_adjacency_graph(voxels.shape) if hasattr(higra, "get_6_adjacency_graph") else higra.get_nd_regular_graph(voxels.shape, [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
        weights = higra.weight_graph(graph, voxels.astype(np.float32).ravel(), higra.WeightFunction.L1)
        return higra.bpt_canonical(graph, weights)

    theirs, mine = [], []
    for _ in range(rounds):
        found, seconds = ours(voxels, "hvs", {"linkage": "single"})
        mine.append(seconds)
        theirs.append(timed(partition)[1])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    row("single linkage", name, "Higra, binary partition tree", theirs, mine, f"peak {found['peak_mib']:.0f} MiB, theirs {peak:.0f}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("program")
    arguments.add_argument("--ivd", help="the program that makes the head phantom")
    arguments.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[3] / "shared" / "data")
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--only", default="")
    given = arguments.parse_args()
    works = {"tree": tree, "kmeans": kmeans, "mixture": mixture, "places": with_places, "mixture-places": mixture_with_places}
    print("| work | volume | other program | × wall | × processor | ours (s) | found |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        ours = Ours(given.program, folder)

        def phantom(size):
            for words in (["phantom", "head", "--size", size, "-o", folder / "h.ivd"], ["export", folder / "h.ivd", "-o", folder / "h.nii"]):
                subprocess.run([given.ivd, *map(str, words)], check=True, capture_output=True)
            return np.asarray(nibabel.load(folder / "h.nii").dataobj)

        volumes = {}
        if given.ivd:
            head = phantom(256).astype(float)
            volumes["noisy head, 256³"] = np.clip(head / head.max() * 255, 0, 255).astype(np.uint8)
        for name, path in (("bonsai", "bonsai/bonsai.nii.gz"), ("mni152", "mni152/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz")):
            if (given.data / path).exists():
                volumes[name] = np.ascontiguousarray(nibabel.load(given.data / path).dataobj)
        for work, run in works.items():
            if given.only and work not in given.only.split(","):
                continue
            for name, voxels in volumes.items():
                kinds = [voxels]
                if work in ("kmeans", "mixture"):
                    # Some ten thousand values, evenly spaced, as scanners store them.
                    noise = np.random.default_rng(1).normal(0, 0.3, voxels.shape)
                    kinds.append((np.round((voxels + noise) * 64) / 64).astype(np.float32))
                if work in ("tree", "mixture-places"):
                    half = [slice(n // 2 - 64, n // 2 + 64) for n in voxels.shape]
                    kinds, name = [np.ascontiguousarray(voxels[tuple(half)])], f"{name}, middle 128³"
                for voxels_of in kinds:
                    run(ours, name, voxels_of, given.rounds)


if __name__ == "__main__":
    main()
