"""Parts of real scans against those that people (or a model) drew: python parts.py PATH/TO/ivd PATH/TO/DATA [--surface WORDS]

One setting for all scans, printed with the tables. Clicks are put where a user would, by the truth: the middle of the part's largest inscribed
ball; that makes the figures optimistic. Of a scan with many organs each is found from one click alone (an active surface), and all are at once
(clicks that compete, sixteen elsewhere in the body and one in the air). Dice by organ; hippocampi and a head as well. Needs nibabel,
numpy, scipy, pynrrd.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import nibabel
import nrrd
import numpy as np
from scipy import ndimage

COMPETE = ["--method", "compete"]
BRUSH = 8.0  # Greatest radius of a click (mm).


def dice(a, b):
    return 2 * np.count_nonzero(a & b) / max(1, np.count_nonzero(a) + np.count_nonzero(b))


def world(image, index):
    return image.affine[:3, :3] @ np.asarray(index, float) + image.affine[:3, 3]


def inner(truth, spacing):
    """The voxel furthest from the border of a part, and how far that is (mm)."""
    depth = ndimage.distance_transform_edt(np.pad(truth, 1), sampling=spacing)[1:-1, 1:-1, 1:-1]
    at = np.unravel_index(np.argmax(depth), depth.shape)
    return at, depth[at]


def spread(candidates, image, count, first):
    """Voxels that lie far from each other: each the furthest from those before."""
    points = np.argwhere(candidates)
    places = points @ image.affine[:3, :3].T + image.affine[:3, 3]
    near = np.full(len(places), np.inf)
    chosen, last = [], np.asarray(first)
    for _ in range(min(count, len(places))):
        near = np.minimum(near, np.linalg.norm(places - last, axis=1))
        chosen.append(tuple(points[np.argmax(near)]))
        last = places[np.argmax(near)]
    return chosen


def seed(image, voxel, label=None, radius=0.0):
    at = ",".join(f"{v:.4f}" for v in world(image, voxel))
    return at if label is None else f"at={at};radius={radius:.3f};label={label}"


class Program:
    def __init__(self, path, folder, surface):
        self.path, self.folder, self.surface = path, Path(folder), surface

    def run(self, scan, words):
        """The part or labels that `ivd boundary` gives; nothing where it says that there is none."""
        out = self.folder / "part.ivd"
        done = subprocess.run([self.path, "boundary", str(scan), *words, "-q", "-o", out], capture_output=True, text=True)
        if done.returncode == 5:
            return None
        if done.returncode:
            raise SystemExit(done.stderr)
        subprocess.run([self.path, "export", out, "-q", "-o", self.folder / "part.nii"], check=True, capture_output=True)
        return np.asarray(nibabel.load(self.folder / "part.nii").dataobj)


def one(program, scan, image, truth, spacing):
    at, depth = inner(truth, spacing)
    words = ["--method", "surface", "--seed", seed(image, at), "--radius", f"{min(BRUSH, depth):.3f}", *program.surface]
    found = program.run(scan, words)
    return 0.0 if found is None else dice(found > 0, truth)


def abdomen(program, data):
    folder = data / "ct_abdomen_ts"
    scan = folder / "example_ct_sm.nii.gz"
    image, drawn = nibabel.load(scan), np.asarray(nibabel.load(folder / "example_seg.nii.gz").dataobj)
    values = np.asarray(image.dataobj)
    spacing = image.header.get_zooms()[:3]
    organs = [i for i in np.unique(drawn) if i and np.count_nonzero(drawn == i) >= 200]
    body = ndimage.binary_opening(values > -300, iterations=2)
    seeds, rest = [], max(organs) + 1
    for organ in organs:
        at, depth = inner(drawn == organ, spacing)
        seeds += ["--seeds", seed(image, at, organ, min(BRUSH, 0.7 * depth))]
    for at in spread(body & (drawn == 0), image, 16, world(image, (0, 0, 0))):
        seeds += ["--seeds", seed(image, at, rest, 0.0)]
    air = np.unravel_index(np.argmin(ndimage.gaussian_filter(values.astype(float), 2)[:, 0, :]), (values.shape[0], values.shape[2]))
    seeds += ["--seeds", seed(image, (air[0], 0, air[1]), rest + 1, 0.0)]
    shared = program.run(scan, COMPETE + seeds)
    rows = []
    for organ in organs:
        truth = drawn == organ
        alone = one(program, scan, image, truth, spacing)
        rows.append((organ, np.count_nonzero(truth), alone, dice(shared == organ, truth)))
    print(f"\nct_abdomen_ts, {len(organs)} labels of a model of 200 voxels or more\n\n| label | voxels | one click | competing |\n|---|---|---|---|")
    for organ, voxels, alone, competing in rows:
        print(f"| {organ} | {voxels} | {alone:.3f} | {competing:.3f} |")
    both = np.array([row[2:] for row in rows])
    counts = [f"{np.count_nonzero(both >= least, axis=0)}" for least in (0.9, 0.8, 0.7)]
    print(f"| median | | {np.median(both[:, 0]):.3f} | {np.median(both[:, 1]):.3f} |")
    print(f"\nof {len(organs)}, at 0.9, 0.8, 0.7 or more: {', '.join(counts)} (one click, competing)")


def head(program, data):
    folder = data / "mri_head_seg3d"
    scan = folder / "MR.nii.gz"
    image = nibabel.load(scan)
    mask, header = nrrd.read(str(folder / "Brain.nrrd"))
    # NRRD's LPS against NIfTI's RAS: the masks' first two axes run the other way.
    truth = mask[::-1, ::-1, :] > 0
    spacing = image.header.get_zooms()[:3]
    alone = one(program, scan, image, truth, spacing)
    rest, seeds, left = np.asarray(image.dataobj), [], truth.copy()
    for _ in range(3):
        at, depth = inner(left, spacing)
        seeds += ["--seeds", seed(image, at, 1, min(15.0, 0.8 * depth))]
        grid = np.indices(left.shape).transpose(1, 2, 3, 0)
        left &= np.linalg.norm((grid - at) * np.asarray(spacing), axis=3) > 1.5 * depth
    away = ndimage.distance_transform_edt(~truth, sampling=spacing)
    ring = (away > 8) & (away < 14) & (rest > 60)
    for at in spread(ring, image, 6, world(image, inner(truth, spacing)[0])):
        seeds += ["--seeds", seed(image, at, 2, 3.0)]
    competing = program.run(scan, COMPETE + seeds + ["--label", "1", "--open", "4"])
    print(f"\nmri_head_seg3d, brain: one click {alone:.3f}, three strokes against six {dice(competing > 0, truth):.3f}")


def hippocampi(program, data):
    folder = data / "hippocampus_msd"
    rows = []
    for scan in sorted((folder / "images").glob("*.nii.gz")):
        image = nibabel.load(scan)
        truth = np.asarray(nibabel.load(folder / "labels" / scan.name).dataobj) > 0
        rows.append(one(program, scan, image, truth, image.header.get_zooms()[:3]))
    print(f"\nhippocampus_msd, one click: median {np.median(rows):.3f}; {', '.join(f'{row:.2f}' for row in rows)}")


def main():
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("program")
    asked.add_argument("data", type=Path)
    asked.add_argument("--surface", default="--open 4", help="how parts are found from one click")
    words = asked.parse_args()
    print(f"one click: {words.surface}; competing: {' '.join(COMPETE)}; brush of at most {BRUSH} mm")
    with tempfile.TemporaryDirectory() as folder:
        program = Program(words.program, folder, words.surface.split())
        head(program, words.data)
        abdomen(program, words.data)
        hippocampi(program, words.data)


if __name__ == "__main__":
    main()
