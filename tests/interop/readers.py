"""Readers of other people that more than one script here asks."""

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def vti(path):
    """VTK's values of an image, indexed [z, y, x], and its voxel-to-world affine (3 × 4)."""
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    m = image.GetDirectionMatrix()
    direction = np.array([[m.GetElement(r, c) for c in range(3)] for r in range(3)])
    affine = np.c_[direction * np.array(image.GetSpacing()), np.array(image.GetOrigin())]
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[::-1]), affine
