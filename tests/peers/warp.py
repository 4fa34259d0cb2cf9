"""Linear warps through a field against ITK and a plain loop that numba compiles: python warp.py PATH/TO/measure [options]

`cargo build --release -p ivd-bench --example measure` makes our side. A volume of --side³ random f32, smoothed, goes through a dense
field of sines of 6 voxels, and through bumps that end within balls of growing radius. Our program, the loop, itk.WarpImageFilter and
SimpleITK's take turns, --turns times, with the same arrays and threads. First the values are compared, away from the border. Prints two
Markdown tables: times of the others over ours, as the median of the turns' ratios with the least and the most, and, for the bumps, the
time of a frame that makes only the touched bricks anew. --plot FILE.svg draws the second. Needs numpy, scipy and numba; itk,
SimpleITK and matplotlib where they are there.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numba import njit, prange, set_num_threads
from scipy.ndimage import gaussian_filter

from timing import timed

RADII = (12, 24, 36, 48, 72, 96)


@njit(parallel=True, fastmath=False)
def loop(volume, field, out):
    """out(p) = volume(p + field(p)), trilinear; 0 where that is outside."""
    nz, ny, nx = volume.shape
    for z in prange(nz):
        for y in range(ny):
            for x in range(nx):
                px, py, pz = x + field[z, y, x, 0], y + field[z, y, x, 1], z + field[z, y, x, 2]
                if not (0 <= px <= nx - 1 and 0 <= py <= ny - 1 and 0 <= pz <= nz - 1):
                    out[z, y, x] = 0
                    continue
                i, j, k = min(int(px), nx - 2), min(int(py), ny - 2), min(int(pz), nz - 2)
                u, v, w = px - i, py - j, pz - k
                low = (volume[k, j, i] * (1 - u) + volume[k, j, i + 1] * u) * (1 - v) + (
                    volume[k, j + 1, i] * (1 - u) + volume[k, j + 1, i + 1] * u
                ) * v
                high = (volume[k + 1, j, i] * (1 - u) + volume[k + 1, j, i + 1] * u) * (1 - v) + (
                    volume[k + 1, j + 1, i] * (1 - u) + volume[k + 1, j + 1, i + 1] * u
                ) * v
                out[z, y, x] = low * (1 - w) + high * w


def dense(side):
    """Vectors of 6 voxels at most, everywhere."""
    angle = np.linspace(0, 2 * np.pi, side, endpoint=False, dtype=np.float32)
    field = np.empty((side, side, side, 3), np.float32)
    field[..., 0] = 6 * np.sin(2 * angle)[:, None, None] * np.cos(angle)[None, :, None]
    field[..., 1] = 6 * np.sin(3 * angle)[None, None, :] * np.cos(angle)[:, None, None]
    field[..., 2] = 6 * np.sin(2 * angle)[None, :, None] * np.cos(angle)[None, None, :]
    return field


def bump(side, radius):
    """A push that ends at a radius round the middle."""
    from_middle = (np.arange(side, dtype=np.float32) - (side - 1) / 2) ** 2
    t = (from_middle[:, None, None] + from_middle[None, :, None] + from_middle[None, None, :]) / radius**2
    push = np.where(t < 1, radius / 6 * (1 - np.minimum(t, 1)) ** 3, 0).astype(np.float32)
    return push[..., None] * np.array([1, 0.5, -0.25], np.float32)


class Ours:
    def __init__(self, program, volume, field, threads):
        self.folder = tempfile.TemporaryDirectory()
        self.at = Path(self.folder.name)
        volume.tofile(self.at / "volume.f32")
        field.tofile(self.at / "field.f32")
        words = [program, "warp", self.at, str(len(volume)), str(threads)]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.folder.cleanup()


def others(volume, field, threads):
    """Names, and what makes the warped volume."""
    set_num_threads(threads)
    out = np.empty_like(volume)

    def numba():
        loop(volume, field, out)
        return out

    found = {"numba": numba}
    try:
        import itk

        itk.MultiThreaderBase.SetGlobalDefaultNumberOfThreads(threads)
        image, kind = itk.image_from_array(volume), itk.Image[itk.Vector[itk.F, 3], 3]
        vectors = itk.image_from_array(field, ttype=(kind,))

        def itk_warp():
            made = itk.WarpImageFilter[type(image), type(image), kind].New(Input=image, DisplacementField=vectors)
            made.SetOutputParametersFromImage(image)
            made.Update()
            return itk.array_view_from_image(made.GetOutput())

        found["ITK"] = itk_warp
    except ImportError:
        print("itk isn't there: passed over\n")
    try:
        import SimpleITK as sitk

        sitk.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
        plain, moves = sitk.GetImageFromArray(volume), sitk.GetImageFromArray(field, isVector=True)
        made = sitk.WarpImageFilter()
        made.SetOutputSize(plain.GetSize())
        made.SetInterpolator(sitk.sitkLinear)
        last = []

        def simple():
            # A view doesn't keep its image.
            last[:] = [made.Execute(plain, moves)]
            return sitk.GetArrayViewFromImage(last[0])

        found["SimpleITK"] = simple
    except ImportError:
        print("SimpleITK isn't there: passed over\n")
    return found


def spread(ratios):
    return f"{np.median(ratios):.2f} ({min(ratios):.2f}–{max(ratios):.2f})"


def turns(ours, rivals, count):
    """Times, count × (ours and rivals) × (wall, processor), and ours of a frame."""
    rows, frames = [], []
    for _ in range(count):
        mine = ours()
        frames.append([mine["frame_wall_s"], mine["frame_cpu_s"]])
        rows.append([[mine["wall_s"], mine["cpu_s"]], *(timed(rival)[1] for rival in rivals.values())])
    return np.array(rows), np.array(frames), mine["bricks"]


def plot(path, bricks, frames, wholes):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4))
    axes.loglog(bricks, frames, "o-", label="a frame: touched bricks alone")
    axes.loglog(bricks, wholes, "s-", label="the whole volume, anew")
    axes.loglog(bricks, np.array(bricks) * frames[-1] / bricks[-1], "k:", label="in proportion")
    axes.set_xlabel("bricks touched")
    axes.set_ylabel("processor time (ms)")
    axes.legend()
    figure.savefig(path, bbox_inches="tight")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measure")
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--plot")
    given = parser.parse_args()
    side = given.side
    volume = gaussian_filter(np.random.default_rng(5).random((side,) * 3, np.float32), 1.0)

    field = dense(side)
    ours, rivals = Ours(given.measure, volume, field, given.threads), others(volume, field, given.threads)
    ours()
    mine = np.fromfile(ours.at / "ours.f32", np.float32).reshape(volume.shape)
    inner, scale = (slice(8, -8),) * 3, np.ptp(volume)
    for name, rival in rivals.items():
        apart = np.abs(rival()[inner] - mine[inner]).max() / scale
        print(f"{name} differs by {apart:.1e} of the range at most\n")
        assert apart < 1e-4, name
    rows, _, bricks = turns(ours, rivals, given.turns)
    ours.close()
    print(f"dense, {side}³, {given.threads} threads, {bricks:,} bricks: {np.median(rows[:, 0, 0]):.3f} s wall, ", end="")
    print(f"{np.median(rows[:, 0, 1]):.3f} s processor time\n")
    print("| over ours | wall | processor |\n|---|---|---|")
    for i, name in enumerate(rivals, 1):
        ratio = rows[:, i] / rows[:, 0]
        print(f"| {name} | {spread(ratio[:, 0])} | {spread(ratio[:, 1])} |", flush=True)

    print("\n| radius of the bump (voxels) | bricks | whole warp, processor (ms) | frame, processor (ms) | frame, µs a brick |")
    print("|---|---|---|---|---|")
    drawn = []
    for radius in (r for r in RADII if 2 * r < side):
        ours = Ours(given.measure, volume, bump(side, radius), given.threads)
        ours()
        # The system's clock of processor time ticks in hundredths of a second: many turns together.
        found = [ours() for _ in range(8 * given.turns)]
        ours.close()
        whole, frame = (1e3 * np.mean([f[key] for f in found]) for key in ("cpu_s", "frame_cpu_s"))
        bricks = found[0]["bricks"]
        drawn.append((bricks, frame, whole))
        print(f"| {radius} | {bricks:,} | {whole:.1f} | {frame:.2f} | {1e3 * frame / bricks:.1f} |", flush=True)
    if given.plot:
        plot(given.plot, *zip(*drawn))


if __name__ == "__main__":
    main()
