#!/usr/bin/env python3
"""Holds EMVS against scikit-learn's GaussianMixture: same volume, start, iterations and added variance, then the same mixture.

    mixture.py PROGRAM [--volume FILE --type u8 --dims NX,NY,NZ --spacing SX,SY,SZ] [--k 4] [--iterations 30]

PROGRAM is the example `measure` of ivd-bench. Without a volume it makes small ones with numpy. Needs numpy and scikit-learn.
Prints the largest differences of each case; the status is 1 where one is beyond the tolerance.
"""
import argparse
import json
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
from sklearn.mixture import GaussianMixture

TYPES = {"u8": np.uint8, "i16": np.int16, "u16": np.uint16, "f32": np.float32}
SHAPES = {"intensity": "full", "diagonal": "diag", "full": "full"}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--volume", type=Path)
    parser.add_argument("--type", choices=TYPES, default="u8")
    parser.add_argument("--dims", default="64,64,64")
    parser.add_argument("--spacing", default="1,1,1")
    parser.add_argument("--k", type=int, default=4)
    parser.add_argument("--iterations", type=int, default=30)
    parser.add_argument("--added", type=float, default=0.0, help="variance added in every iteration (reg_covar)")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--shapes", default="intensity,diagonal,full")
    return parser.parse_args()


def features(values, spacing, shape):
    """One row a voxel: place in mm and value, or the value alone."""
    flat = values.reshape(-1, 1).astype(np.float64)
    if shape == "intensity":
        return flat
    z, y, x = np.meshgrid(*(np.arange(n, dtype=np.float64) for n in values.shape), indexing="ij")
    places = [axis.ravel() * step for axis, step in zip((x, y, z), spacing)]
    return np.column_stack([*places, flat])


def start(data, k):
    """Equal weights, means at quantiles of the intensity, wide variances."""
    means = np.tile(data.mean(0), (k, 1))
    levels = np.linspace(data[:, -1].min(), data[:, -1].max(), 2 * k + 1)[1::2]
    means[:, -1] = 0.5 * (levels + np.quantile(data[:, -1], (np.arange(k) + 0.5) / k))
    variances = np.tile(data.var(0), (k, 1))
    variances[:, -1] /= k**2
    return np.full(k, 1 / k), means, variances


def ours(args, path, kind, dims, spacing, shape, begin, added, iterations):
    weights, means, variances = begin
    covariances = variances.tolist() if shape != "full" else [np.diag(v).ravel().tolist() for v in variances]
    params = {
        "covariance": shape,
        "max_iterations": iterations,
        "tolerance": 0.0,
        "variance_floor": 0.0,
        "k": len(weights),
        "variance_added": added,
        "start": {"weights": weights.tolist(), "means": means.tolist(), "covariances": covariances},
    }
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(params, file)
        file.flush()
        join = lambda numbers: ",".join(str(n) for n in numbers)
        command = [args.program, "mixture", str(path), kind, join(dims), join(spacing), "@" + file.name]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def theirs(data, shape, begin, added, iterations):
    weights, means, variances = begin
    precisions = 1 / variances
    if shape != "diagonal":
        precisions = np.stack([np.diag(p) for p in precisions])
    model = GaussianMixture(
        len(weights), covariance_type=SHAPES[shape], weights_init=weights, means_init=means,
        precisions_init=precisions, max_iter=iterations, tol=0.0, reg_covar=added, init_params="random", random_state=0,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(data)
    return model, float(model.score(data))


def differences(found, model, likelihood, shape):
    """Largest differences, means and variances in units of the components' own deviations."""
    order = np.argsort(model.means_[:, -1], kind="stable")
    k = len(order)
    covariances = model.covariances_[order].reshape(k, -1)
    variances = covariances if shape == "diagonal" else covariances[:, :: int(covariances.shape[1] ** 0.5) + 1]
    deviations = np.sqrt(variances)
    mixture = {name: np.asarray(found["mixture"][name]) for name in ("weights", "means", "covariances")}
    scale = variances if shape != "full" else (deviations[:, :, None] * deviations[:, None, :]).reshape(k, -1)
    return {
        "weights": np.abs(mixture["weights"] - model.weights_[order]).max(),
        "means": (np.abs(mixture["means"] - model.means_[order]) / deviations).max(),
        "covariances": (np.abs(mixture["covariances"] - covariances) / scale).max(),
        "log_likelihood": abs(found["log_likelihood"] - likelihood) / max(1.0, abs(likelihood)),
    }


def cases(args):
    """(name, values in z, y, x order, stored type, spacing)"""
    if args.volume:
        dims = [int(n) for n in args.dims.split(",")]
        values = np.fromfile(args.volume, TYPES[args.type]).reshape(dims[::-1])
        yield args.volume.name, values, args.type, [float(s) for s in args.spacing.split(",")]
        return
    rng = np.random.default_rng(7)
    shape = (14, 20, 33)
    place = np.indices(shape)
    ball = ((place - np.array(shape).reshape(3, 1, 1, 1) / 2) ** 2).sum(0) < 60
    smooth = 60 + 50 * ball + 25 * (place[2] > 20) + rng.normal(0, 9, shape)
    yield "bytes", np.clip(np.rint(smooth), 0, 255).astype(np.uint8), "u8", [1.0, 1.0, 1.0]
    yield "words", np.rint(smooth * 16 + 900).astype(np.uint16), "u16", [0.5, 0.7, 3.0]
    yield "signed", np.rint(smooth * 8 - 1000).astype(np.int16), "i16", [1.0, 1.0, 2.5]
    yield "floats", (smooth / 100).astype(np.float32), "f32", [0.9, 1.1, 4.0]


def main():
    args = arguments()
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name, values, kind, spacing in cases(args):
            path = args.volume or Path(folder) / "volume.raw"
            if not args.volume:
                values.tofile(path)
            for shape in args.shapes.split(","):
                data = features(values, spacing, shape)
                begin = start(data, args.k)
                dims = values.shape[::-1]
                found = ours(args, path, kind, dims, spacing, shape, begin, args.added, args.iterations)
                model, likelihood = theirs(data, shape, begin, args.added, args.iterations)
                off = differences(found, model, likelihood, shape)
                worst = max(worst, *off.values())
                print(f"{name:10} {shape:10} k={args.k} " + " ".join(f"{n} {v:.1e}" for n, v in off.items()), flush=True)
    print(f"largest difference {worst:.1e}, tolerance {args.tolerance:.0e}")
    return int(not worst <= args.tolerance)


if __name__ == "__main__":
    sys.exit(main())
