"""The plots of clustering in the documentation: python plots.py growth|error PATH/TO/measure PATH/TO/ivd OUT.svg [--data DIR]

growth: processor time and peak memory of every method on head phantoms of 64³ to 512³ voxels (u8). error: processor time
against what is labelled wrongly, of every method at several settings, on a noisy head and the MNI152 average. Prints the
figures as a Markdown table. Needs numpy, nibabel, scipy and matplotlib (and what truth.py needs).
"""

import argparse
import tempfile
from pathlib import Path

import matplotlib
import nibabel
import numpy as np

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "ivd"
from matplotlib import pyplot

from speed import Ours
from truth import Program, atlas, dice, phantoms

SIZES = (64, 128, 256, 512)


def growing(edge):
    """Methods with their parameters, for a cube of values 0 to 255."""
    return {
        "kmvs": ("kmvs", {"k": 4}),
        "kmvs with places": ("kmvs", {"k": 4, "spatial_weight": 64 / edge}),
        "emvs": ("emvs", {"k": 4}),
        "emvs, smoothing": ("emvs", {"k": 4, "smoothing": 0.5}),
        "emvs, diagonal": ("emvs", {"k": 4, "covariance": "diagonal", "max_iterations": 20}),
        "emvs, full": ("emvs", {"k": 4, "covariance": "full", "max_iterations": 20}),
        "msvs": ("msvs", {}),
        "msvs with places": ("msvs", {"spatial_bandwidth": 0.1 * edge}),
        "hvs, single": ("hvs", {"linkage": "single"}),
        "hvs, Ward": ("hvs", {"linkage": "ward"}),
    }


def bytes_of(volume):
    values = np.asarray(nibabel.load(volume).dataobj).astype(float)
    return np.clip(np.round(values / values.max() * 255), 0, 255).astype(np.uint8)


def growth(ours, program, folder, out):
    found = {}
    for size in SIZES:
        program.run("phantom", "head", "--size", size, "-o", folder / "head.ivd")
        program.run("export", folder / "head.ivd", "-o", folder / "head.nii")
        voxels = bytes_of(folder / "head.nii")
        for name, (method, params) in growing(size).items():
            answer, seconds = ours(voxels, method, params, repeats=1)
            found.setdefault(name, []).append((seconds[1], answer["peak_mib"]))
            print(f"<!-- {size} {name}: {seconds[1]:.2f} s, {answer['peak_mib']:.0f} MiB -->", flush=True)
    print("| method | " + " | ".join(f"{s}³ (s)" for s in SIZES) + " | peak at 512³ (MiB) |\n" + "|---" * (len(SIZES) + 2) + "|")
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4.6))
    counts = np.array(SIZES, dtype=float) ** 3
    for i, (name, points) in enumerate(found.items()):
        points = np.array(points)
        print(f"| {name} | " + " | ".join(f"{t:.2g}" for t in points[:, 0]) + f" | {points[-1, 1]:.0f} |")
        style = dict(marker="o" if i < 5 else "s", ms=4, lw=1.2, color=f"C{i}", label=name)
        left.loglog(counts, points[:, 0], **style)
        right.loglog(counts, points[:, 1], **style)
    guide = counts * np.log(counts)
    left.loglog(counts, guide / guide[0] * 0.01, "k:", lw=1, label="N log N")
    right.axhline(4096, color="k", ls=":", lw=1)
    for axes, what in ((left, "processor time (s)"), (right, "peak memory, with the volume (MiB)")):
        axes.set_xlabel("voxels N (64³, 128³, 256³, 512³)")
        axes.set_ylabel(what)
        axes.grid(alpha=0.3, which="both", lw=0.4)
    left.legend(fontsize=7)
    save(figure, out)


def settings(k, edge, width):
    """Methods at several settings: name, family, method, parameters."""
    yield "kmvs", "kmvs", {"k": k}
    for share in (0.1, 0.25, 0.5):
        yield f"kmvs with places {share}", "kmvs", {"k": k, "spatial_weight": share * width / edge}
    yield "emvs", "emvs", {"k": k}
    for beta in (0.1, 0.25, 0.5, 1.0):
        yield f"emvs, β {beta}", "emvs", {"k": k, "smoothing": beta}
    yield "emvs, diagonal", "emvs", {"k": k, "covariance": "diagonal"}
    for regions in (4_000, 64_000, 400_000):
        yield f"hvs, Ward {regions // 1000}k", "hvs", {"classes": k, "max_regions": regions}
    yield "hvs, single", "hvs", {"classes": k, "linkage": "single"}
    yield "msvs", "msvs", {}
    yield "msvs+kmvs", "msvs+kmvs", {}


def error(ours, program, folder, out, data):
    sources = [s for s in phantoms(program, folder, (0.04,))] + list(atlas(data))
    figure, axes = pyplot.subplots(1, len(sources), figsize=(5.2 * len(sources), 4.6), squeeze=False)
    for axes, (name, volume, truth, names, k) in zip(axes[0], sources):
        voxels = bytes_of(volume)
        print(f"\n| {name} | processor time (s) | 1 − mean Dice |\n|---|---|---|")
        families = {}
        for label, method, params in settings(k, max(voxels.shape), 255.0):
            _, seconds = ours(voxels, method, params, repeats=2, labels=folder / "labels.raw")
            labels = np.fromfile(folder / "labels.raw", np.uint16).reshape(voxels.shape, order="F").astype(np.int64)
            wrong = 1 - dice(labels, truth, names).mean()
            print(f"| {label} | {seconds[1]:.3g} | {wrong:.3f} |", flush=True)
            families.setdefault(label.split(",")[0].split(" ")[0], []).append((seconds[1], wrong, label))
        for family, points in families.items():
            axes.semilogx([p[0] for p in points], [p[1] for p in points], "o", ms=5, label=family)
            for x, y, label in points:
                rest = label.removeprefix(family).removeprefix(", ").strip()
                axes.annotate(rest, (x, y), fontsize=5.5, xytext=(3, 3), textcoords="offset points", rotation=35)
        axes.set_xlim(right=4 * axes.get_xlim()[1])
        axes.set_title(f"{name}, {k} classes", fontsize=9)
        axes.set_xlabel("processor time (s)")
        axes.set_ylabel("error: 1 − mean Dice of the classes")
        axes.grid(alpha=0.3, which="both", lw=0.4)
        axes.legend(fontsize=7)
    save(figure, out)


def save(figure, out):
    figure.tight_layout()
    figure.savefig(out, metadata={"Date": None})


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("what", choices=("growth", "error"))
    arguments.add_argument("measure")
    arguments.add_argument("ivd")
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[3] / "shared" / "data")
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        ours, program = Ours(given.measure, folder), Program(given.ivd, folder)
        if given.what == "growth":
            growth(ours, program, folder, given.out)
        else:
            error(ours, program, folder, given.out, given.data)


if __name__ == "__main__":
    main()
