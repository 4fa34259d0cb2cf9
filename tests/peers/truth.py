"""Segmentations against labels that are known, beside other people's: python truth.py PATH/TO/ivd [--data DIR]

Head phantoms with three strengths of noise (their labels), the MNI152 T1 average (its grey and white matter maps) and ten
hippocampus crops (manual labels). Each program gets the same voxels and number of classes, on intensity alone unless it is
named otherwise. Classes are matched one to one so that the sum of their Dice is largest. Prints a Markdown table of the Dice
per class; the exit code is 1 where one of ours lies more than 0.005 below the peer it stands beside, or where smoothing
doesn't lie above it. Needs numpy, scipy, nibabel, scikit-learn and itk.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import itk
import nibabel
import numpy as np
from scipy.optimize import linear_sum_assignment
from sklearn.cluster import KMeans
from sklearn.mixture import GaussianMixture

# Ours, the peer it stands beside, and whether it must lie above it.
PAIRS = [
    ("kmvs", "scikit-learn KMeans", False),
    ("kmvs", "ITK ScalarImageKmeans", False),
    ("emvs", "scikit-learn GaussianMixture", False),
    ("emvs, smoothing", "scikit-learn GaussianMixture", True),
    ("emvs, smoothing", "ITK Bayesian classifier", True),
]
ALLOWED = 0.005


def dice(found, truth, names):
    """Dice of each class of the truth with the class matched to it."""
    table = np.zeros((len(names), int(found.max()) + 1))
    for i, label in enumerate(names):
        inside = found[truth == label]
        table[i] = np.bincount(inside, minlength=table.shape[1])
    sizes = np.bincount(found.ravel(), minlength=table.shape[1])
    counts = np.array([(truth == label).sum() for label in names])
    score = 2 * table / np.maximum(counts[:, None] + sizes[None], 1)
    rows, columns = linear_sum_assignment(-score)
    result = np.zeros(len(names))
    result[rows] = score[rows, columns]
    return result


class Program:
    def __init__(self, path, folder):
        self.path, self.folder = path, folder

    def run(self, *arguments):
        done = subprocess.run([self.path, *map(str, arguments), "--progress", "never", "-q"], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"ivd {' '.join(map(str, arguments))}: exit {done.returncode}: {done.stderr.strip()}")

    def labels(self, volume, *arguments):
        self.run("segment", volume, "-o", self.folder / "labels.ivd", *arguments)
        self.run("export", self.folder / "labels.ivd", "-o", self.folder / "labels.nii")
        return np.asarray(nibabel.load(self.folder / "labels.nii").dataobj).astype(np.int64)


def ours(program, volume, k, smoothing):
    return {
        "kmvs": program.labels(volume, "--method", "kmvs", "--k", k),
        "emvs": program.labels(volume, "--method", "emvs", "--k", k),
        "emvs, smoothing": program.labels(volume, "--method", "emvs", "--k", k, "--smoothing", smoothing),
        "hvs, Ward": program.labels(volume, "--method", "hvs", "--k", k),
        "msvs+kmvs": program.labels(volume, "--method", "msvs+kmvs"),
    }


def peers(voxels, k):
    values, inverse, counts = np.unique(voxels, return_inverse=True, return_counts=True)
    inverse = inverse.reshape(voxels.shape)
    column = values.astype(float)[:, None]
    kmeans = KMeans(k, n_init=10, random_state=0).fit(column, sample_weight=counts)
    # A mixture takes no weights: a sample of the voxels stands for them.
    sample = np.random.default_rng(0).choice(voxels.ravel(), min(voxels.size, 200_000), replace=False)
    mixture = GaussianMixture(k, n_init=1, max_iter=500, tol=1e-6, means_init=np.sort(kmeans.cluster_centers_, 0), random_state=0)
    mixture.fit(sample.astype(float)[:, None])
    image = itk.image_from_array(voxels.astype(np.float32))
    classes = itk.ScalarImageKmeansImageFilter.New(image)
    for centre in np.sort(kmeans.cluster_centers_.ravel()):
        classes.AddClassWithInitialMean(float(centre))
    classes.Update()
    first = itk.BayesianClassifierInitializationImageFilter.New(image, number_of_classes=k)
    first.Update()
    bayes = itk.BayesianClassifierImageFilter.New(first.GetOutput(), number_of_smoothing_iterations=2)
    bayes.Update()
    return {
        "scikit-learn KMeans": kmeans.predict(column)[inverse],
        "scikit-learn GaussianMixture": mixture.predict(column)[inverse],
        "ITK ScalarImageKmeans": itk.array_from_image(classes.GetOutput()).astype(np.int64),
        "ITK Bayesian classifier": itk.array_from_image(bayes.GetOutput()).astype(np.int64),
    }


def phantoms(program, folder, noises=(0.02, 0.04, 0.08)):
    for noise in noises:
        volume, truth = folder / "head.nii", folder / "truth.nii"
        program.run("phantom", "head", "--size", 128, "--noise", noise, "-o", folder / "head.ivd", "--truth", truth)
        program.run("export", folder / "head.ivd", "-o", volume)
        labels = np.asarray(nibabel.load(truth).dataobj).astype(np.int64)
        names = [int(l) for l in np.unique(labels)]
        yield f"head phantom 128³, noise {noise}", volume, labels, names, len(names)


def atlas(data):
    folder = data / "mni152"
    if not folder.exists():
        return
    load = lambda part: np.asarray(nibabel.load(folder / f"mni_icbm152_{part}_tal_nlin_sym_09a_converted.nii.gz").dataobj)
    grey, white = load("gm").astype(int), load("wm").astype(int)
    # 1 grey, 2 white: more likely than all the rest together.
    labels = np.where(grey > 127, 1, np.where(white > 127, 2, 0))
    yield "MNI152: grey, white", folder / "mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz", labels, [1, 2], 4


def hippocampi(data):
    for image in sorted((data / "hippocampus_msd" / "images").glob("*.nii.gz")):
        labels = np.asarray(nibabel.load(data / "hippocampus_msd" / "labels" / image.name).dataobj).astype(np.int64)
        yield f"hippocampus {image.name[12:15]}: whole", image, (labels > 0).astype(np.int64), [1], 3


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("ivd")
    arguments.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[3] / "shared" / "data")
    arguments.add_argument("--smoothing", type=float, default=0.5, help="coupling of emvs where it smooths")
    given = arguments.parse_args()
    bad = 0
    print("| volume | method | Dice per class | mean |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        program = Program(given.ivd, folder)
        for source in (phantoms(program, folder), atlas(given.data), hippocampi(given.data)):
            sums = {}
            for name, volume, labels, names, k in source:
                voxels = np.ascontiguousarray(nibabel.load(volume).dataobj)
                scores = {m: dice(f, labels, names) for m, f in {**ours(program, volume, k, given.smoothing), **peers(voxels, k)}.items()}
                for method, score in scores.items():
                    sums.setdefault(method, []).append(score.mean())
                    if not name.startswith("hippocampus"):
                        print(f"| {name} | {method} | {' '.join(f'{s:.3f}' for s in score)} | {score.mean():.4f} |", flush=True)
                if not name.startswith("hippocampus"):
                    bad += judge(name, {m: s.mean() for m, s in scores.items()})
            if source.__name__ == "hippocampi" and sums:
                means = {m: float(np.mean(s)) for m, s in sums.items()}
                for method, mean in means.items():
                    print(f"| hippocampus, mean of {len(sums[method])} | {method} | | {mean:.4f} |")
                bad += judge("hippocampus", means)
    print(f"{bad} figures below a peer's")
    return 1 if bad else 0


def judge(name, means):
    bad = 0
    for method, peer, above in PAIRS:
        short = means[method] <= means[peer] if above else means[method] < means[peer] - ALLOWED
        if short:
            bad += 1
            print(f"<!-- {name}: {method} {means[method]:.4f} against {peer} {means[peer]:.4f} -->", flush=True)
    return bad


if __name__ == "__main__":
    sys.exit(main())
