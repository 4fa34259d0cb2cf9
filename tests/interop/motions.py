"""Motions and displacement fields as other programs read them: python motions.py PATH/TO/ivd

A phantom's lattice is twisted and the twist carried to its voxels. VTK plays the GLB's morph targets and reads the series of VTP
that the PVD names; SimpleITK reads both fields as NRRD, NIfTI and MetaImage, alike, each undoing the other, and its resampling through
the field is the program's warp to 1e-4 of the range; ITK's own inverse of the forward field, by fixed points, has the same
places. Prints `N passed, N failed`; the exit code is 1 where something failed. Needs numpy, SimpleITK and vtk.
"""

import json
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import SimpleITK as sitk
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from checks import check, ivd, outcome

# From the metres with y up of glTF to mm, RAS.
TO_RAS = 1000.0 * np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
TO_LPS = np.array([-1.0, -1.0, 1.0])
TWIST = "kind=twist;centre=24,24,24;axis=0.2,0.3,1;radius=22;core=0.3;rate=2.5"
PUSH = "kind=translate;centre=24,24,24;radius=23;core=0;by=1.5,-1,0.5"


def points_of(data):
    """Points of a mesh, or of all meshes in a composite."""
    if data.IsA("vtkCompositeDataSet"):
        iterator = data.NewIterator()
        iterator.InitTraversal()
        found = []
        while not iterator.IsDoneWithTraversal():
            found.append(points_of(iterator.GetCurrentDataObject()))
            iterator.GoToNextItem()
        return np.concatenate(found)
    return vtk_to_numpy(data.GetPoints().GetData()).astype(float)


def played(path, time):
    """Points of a GLB's first animation at a time (mm, RAS)."""
    reader = vtk.vtkGLTFReader()
    reader.SetFileName(str(path))
    reader.ApplyDeformationsToGeometryOn()
    reader.UpdateInformation()
    reader.EnableAnimation(0)
    reader.SetFrameRate(60)
    reader.UpdateInformation()
    reader.UpdateTimeStep(time)
    return points_of(reader.GetOutput()) @ TO_RAS.T


def vtp(path):
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return points_of(reader.GetOutput()) * TO_LPS


def motions(program, at):
    """A handle's motion in one frame, as JSON, GLB, PVD and PLY."""
    ivd(program, "deform", at / "l.ivd", "--handle", "vertex=7;move=0,0,4;radius=15", "--shape", TWIST, "--duration", "0.5", "-o", at / "h.ivd")
    ivd(program, "export", at / "h.ivd", "-o", at / "h.json")
    frames = json.loads((at / "h.json").read_text())["frames"]
    ivd(program, "export", at / "l.ivd", "-o", at / "rest.vtp")
    rest = vtp(at / "rest.vtp")
    for ending in ("glb", "pvd", "ply"):
        ivd(program, "export", at / "h.ivd", "--lattice", at / "l.ivd", "-o", at / f"h.{ending}")
    places = [rest] + [rest + np.array(frame["displacement_mm"]) for frame in frames]
    times = [0.0] + [frame["time"] for frame in frames]
    series = [(float(d.get("timestep")), d.get("file")) for d in ElementTree.parse(at / "h.pvd").iter("DataSet")]
    check("pvd: times", [time for time, _ in series] == times, f"{series} {times}")
    for (_, name), expected in zip(series, places):
        check(f"pvd: {name}", np.array_equal(vtp(at / name), expected))
    for time, expected in zip(times, places):
        got = played(at / "h.glb", time)
        check(f"glb at {time} s", got.shape == expected.shape and np.abs(got - expected).max() < 1e-4,
              f"{got.shape} {np.abs(got - expected).max() if got.shape == expected.shape else ''}")
    middle = 0.5 * (places[0] + places[1])
    check("glb half way", np.abs(played(at / "h.glb", 0.5 * times[1]) - middle).max() < 1e-4)


def fields(program, at):
    """The displacement of a twist, and what resampling through it gives."""
    ivd(program, "deform", at / "l.ivd", "--shape", TWIST, "--shape", PUSH, "-o", at / "m.ivd")
    ivd(program, "map", at / "l.ivd", at / "o.ivd", at / "m.ivd", "-o", at / "d.ivd")
    read = {}
    for direction in ("forward", "inverse"):
        both = []
        for ending in ("nrrd", "nii", "nii.gz", "mha"):
            path = at / f"{direction}.{ending}"
            ivd(program, "export", at / "d.ivd", "--direction", direction, "-o", path)
            both.append(sitk.ReadImage(str(path), sitk.sitkVectorFloat64))
        arrays = [sitk.GetArrayFromImage(image) for image in both]
        check(f"{direction}: something moves", np.abs(arrays[0]).max() > 1)
        for image, array, ending in zip(both[1:], arrays[1:], ("nii", "nii.gz", "mha")):
            check(f"{direction}: {ending} as nrrd", np.array_equal(array, arrays[0]), f"{np.abs(array - arrays[0]).max()} mm")
            corner = [n - 1 for n in image.GetSize()]
            apart = np.subtract(image.TransformIndexToPhysicalPoint(corner), both[0].TransformIndexToPhysicalPoint(corner))
            check(f"{direction}: {ending} lies as nrrd", np.abs(apart).max() < 1e-3, f"{apart} mm")
        read[direction] = both[0]
    said = sitk.ImageFileReader()
    said.SetFileName(str(at / "forward.nrrd"))
    said.ReadImageInformation()
    check("nrrd: says which way", said.HasMetaDataKey("displacement") and said.GetMetaData("displacement") == "forward mm LPS")

    forward, inverse = (sitk.DisplacementFieldTransform(sitk.Image(read[d])) for d in ("forward", "inverse"))
    random = np.random.default_rng(3)
    size = np.array(read["forward"].GetSize())
    residuals = []
    for voxel in random.integers(4, size - 4, (4000, 3)).astype(float):
        y = read["forward"].TransformContinuousIndexToPhysicalPoint(voxel)
        back = forward.TransformPoint(inverse.TransformPoint(y))
        residuals.append(np.linalg.norm(np.subtract(back, y)))
    # At the voxels; between them the inverse is interpolated.
    check("forward of inverse", np.percentile(residuals, 95) < 1e-3 and max(residuals) < 1e-2,
          f"95 %: {np.percentile(residuals, 95):.4f}, most {max(residuals):.4f} voxels")
    inverter = sitk.InvertDisplacementFieldImageFilter()
    inverter.SetMaximumNumberOfIterations(200)
    inverter.SetMaxErrorToleranceThreshold(1e-5)
    inverter.SetMeanErrorToleranceThreshold(1e-7)
    theirs = sitk.GetArrayFromImage(inverter.Execute(read["forward"]))
    ours = sitk.GetArrayFromImage(read["inverse"])
    apart = np.linalg.norm(theirs - ours, axis=-1)[4:-4, 4:-4, 4:-4]
    check("ITK's inverse", apart.max() < 0.01, f"{apart.max():.5f} voxels, mean {apart.mean():.6f}")
    print(f"   forward of inverse: 95 % within {np.percentile(residuals, 95):.4f}, all within {max(residuals):.4f} voxels; "
          f"ITK's inverse {apart.max():.5f} voxels away at most")

    volume = sitk.ReadImage(str(at / "v.nrrd"), sitk.sitkFloat32)
    sitk.WriteImage(volume, str(at / "f.nrrd"))
    ivd(program, "warp", at / "f.nrrd", at / "d.ivd", "--order", "linear", "-o", at / "w.ivd")
    ivd(program, "export", at / "w.ivd", "-o", at / "w.nrrd")
    got = sitk.GetArrayFromImage(sitk.ReadImage(str(at / "w.nrrd"))).astype(float)
    resampled = sitk.Resample(sitk.Cast(volume, sitk.sitkFloat64), volume, inverse, sitk.sitkLinear, float("nan"))
    expected = sitk.GetArrayFromImage(resampled)
    inside = np.isfinite(expected)
    span = expected[inside].max() - expected[inside].min()
    worst = np.abs(got - expected)[inside].max() / span
    check("SimpleITK's resampling", worst < 1e-4 and inside.mean() > 0.9, f"{worst:.2e} of the range")
    print(f"   resampling: {worst:.2e} of the range apart at most")


def main():
    program = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        ivd(program, "phantom", "head", "--size", "48", "-o", at / "v.ivd")
        ivd(program, "export", at / "v.ivd", "-o", at / "v.nrrd")
        ivd(program, "lattice", at / "v.ivd", "--iso", "60", "-o", at / "l.ivd")
        ivd(program, "octree", at / "l.ivd", "-o", at / "o.ivd")
        motions(program, at)
        fields(program, at)
    return outcome()


if __name__ == "__main__":
    sys.exit(main())
