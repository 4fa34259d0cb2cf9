"""Pictures against VTK's ray caster for processors: python render.py PATH/TO/measure --ivd PATH/TO/ivd [options] VOLUME ...

`cargo build --release -p ivd-bench --example measure` makes our side. Of each volume a transfer function is made (k-means of 4 classes,
automatic colours); vtkFixedPointVolumeRayCastMapper gets the same table, the same step (half a voxel) and views of the same scale, parallel, from
8 fixed sides. Both cast 512² pixels with 2 threads, in turn, unshaded, shaded and as a maximum; the first picture of each isn't counted. Prints a Markdown
table: processor time of VTK over ours, as the median of the views' ratios with the least and the most, our time of a picture and ns a sample, the frames a
second that wall time makes, and the same of a first-hit surface, which VTK's has no mode for. Needs numpy, vtk and nibabel.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import nibabel
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

from program import ivd
from timing import clock

VIEWS = [(30, 15), (0, 0), (90, 0), (200, 30), (270, -20), (45, 60), (135, -45), (320, 5)]
SIDE = 512
STEP = 0.5


class Ours:
    """Scenes and views in one process of the example `measure`."""

    def __init__(self, measure, volume):
        words = [measure, "stages", str(volume)]
        self.child = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, request):
        self.child.stdin.write(request + "\n")
        self.child.stdin.flush()
        return json.loads(self.child.stdout.readline())

    def close(self):
        self.child.stdin.close()
        self.child.wait()


class Theirs:
    """The same volume in VTK, by a table of rows (r, g, b, opacity) over a range of values."""

    def __init__(self, values, spacing, transfer):
        image = vtk.vtkImageData()
        image.SetDimensions(*values.shape)
        image.SetSpacing(*spacing)
        image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F"), deep=True))
        self.mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        self.mapper.SetInputData(image)
        self.mapper.SetNumberOfThreads(2)
        self.mapper.AutoAdjustSampleDistancesOff()
        self.mapper.LockSampleDistanceToInputSpacingOff()
        self.mapper.SetImageSampleDistance(1)
        self.mapper.SetSampleDistance(STEP * min(spacing))
        colour, opacity = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
        low, high = transfer["range"]
        rows = np.array(transfer["table"][: transfer["resolution"]])
        for value, (r, g, b, alpha) in zip(np.linspace(low, high, len(rows)), rows):
            colour.AddRGBPoint(value, r, g, b)
            opacity.AddPoint(value, alpha)
        self.property = vtk.vtkVolumeProperty()
        self.property.SetColor(colour)
        self.property.SetScalarOpacity(opacity)
        self.property.SetScalarOpacityUnitDistance(transfer["reference_mm"])
        self.property.SetInterpolationTypeToLinear()
        volume = vtk.vtkVolume()
        volume.SetMapper(self.mapper)
        volume.SetProperty(self.property)
        self.renderer, self.window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetSize(SIDE, SIDE)
        self.window.AddRenderer(self.renderer)
        self.renderer.AddVolume(volume)
        self.extent = np.array(values.shape) * spacing

    def mode(self, name):
        self.mapper.SetBlendMode(1 if name == "mip" else 0)
        self.property.ShadeOn() if name == "shaded" else self.property.ShadeOff()

    def picture(self, view):
        """Times (s) of a picture: wall, processor."""
        azimuth, elevation = np.radians(view)
        towards = np.array([-np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])
        up = np.array([np.sin(azimuth) * np.sin(elevation), -np.cos(azimuth) * np.sin(elevation), np.cos(elevation)])
        camera, middle = self.renderer.GetActiveCamera(), (self.extent - 1) / 2
        size = float(np.linalg.norm(self.extent))
        camera.ParallelProjectionOn()
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + 2 * size * towards))
        camera.SetViewUp(*up)
        camera.SetParallelScale(size / 2)
        self.renderer.ResetCameraClippingRange()
        begin = clock()
        self.window.Render()
        return clock() - begin


def transfer_of(program, volume, folder):
    """A transfer function's artefact and what it holds."""
    labels, artefact, table = folder / "labels.ivd", folder / "transfer.ivd", folder / "transfer.json"
    for words in (
        ["segment", volume, "--method", "kmvs", "--k", "4", "-o", labels],
        ["atf", volume, labels, "-o", artefact],
        ["export", artefact, "-o", table],
    ):
        ivd(program, *words)
    return artefact, json.loads(table.read_text())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("measure")
    parser.add_argument("--ivd", required=True)
    parser.add_argument("volumes", nargs="+")
    args = parser.parse_args()
    print("| volume | mode | VTK's processor time over ours: median (least to most) | ours (ms) | ns a sample | ours, frames a second |")
    print("|---|---|---|---|---|---|")
    means = {}
    for path in args.volumes:
        image = nibabel.load(path)
        values = np.asarray(image.dataobj)
        spacing = [float(s) for s in image.header.get_zooms()[:3]]
        with tempfile.TemporaryDirectory() as folder:
            artefact, transfer = transfer_of(args.ivd, path, Path(folder))
            middle = (transfer["entries"][1]["lower"] + transfer["entries"][1]["upper"]) / 2
            ours, theirs = Ours(args.measure, path), Theirs(values, spacing, transfer)
            for mode in ("unshaded", "shaded", "mip", "iso"):
                word = {"unshaded": "", "iso": f" iso={middle}"}.get(mode, " " + mode)
                ours.ask(f"scene {artefact} {SIDE} {STEP}{word}")
                theirs.mode(mode)
                rows = []
                for i, view in enumerate(VIEWS[:1] + VIEWS):
                    peer = theirs.picture(view) if mode != "iso" else (np.nan, np.nan)
                    told = ours.ask(f"view {view[0]},{view[1]}")
                    samples = told["figures"]["samples_per_pixel"] * SIDE * SIDE
                    if i:
                        rows.append((peer[1] / told["cpu_s"], told["cpu_s"], told["wall_s"], samples))
                ratio, cpu, wall, samples = np.array(rows).T
                over = "–" if mode == "iso" else f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})"
                print(
                    f"| {Path(path).name.split('.')[0]} | {mode} | {over} | {1e3 * np.median(cpu):.0f} "
                    f"| {1e9 * cpu.sum() / samples.sum():.1f} | {1 / np.median(wall):.0f} |",
                    flush=True,
                )
                means.setdefault(mode, []).append(np.median(ratio))
            ours.close()
    for mode, ratios in means.items():
        if mode != "iso":
            print(f"geometric mean, {mode}: {np.exp(np.mean(np.log(ratios))):.2f}")


if __name__ == "__main__":
    main()
