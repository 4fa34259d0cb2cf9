#!/usr/bin/env python3
"""Holds exported transfer functions against VTK: transfer_functions.py PATH/TO/ivd [SCHEMA]

A head phantom is coloured and its transfer function exported for 3D Slicer (.vp.json) and ParaView (.paraview.json). VTK's own functions, built of
the points in these files, must give our table at 1,024 values to 1/255, colours as the screen shows them; so must what the program reads back.
Slicer's file must have what its schema asks for; given the schema's file, it is checked by the package jsonschema too. Needs numpy, vtk.
"""
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import vtk

import checks
from checks import check, ivd

LIMIT = 1 / 255


def encoded(light):
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def ours(path, values):
    """Colours as the screen shows them and opacity, of the row for label 0."""
    told = json.loads(path.read_text())
    table = np.array(told["table"])[: told["resolution"]]
    at = np.linspace(*told["range"], told["resolution"])
    samples = np.stack([np.interp(values, at, table[:, c]) for c in range(4)], 1)
    return np.hstack([encoded(samples[:, :3]), samples[:, 3:]])


def theirs(colours, opacities, values):
    """VTK's functions of points (x, r, g, b, midpoint, sharpness) and (x, y, midpoint, sharpness)."""
    colour, opacity = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
    for point in colours:
        colour.AddRGBPoint(*point)
    for point in opacities:
        opacity.AddPoint(*point)
    return np.array([[*colour.GetColor(v), opacity.GetValue(v)] for v in values])


def slicer(path, schema):
    told = json.loads(path.read_text())
    if schema:
        import jsonschema

        jsonschema.validate(told, json.loads(Path(schema).read_text()))
    check("slicer: schema", told["@schema"].endswith("volume-property-schema-v1.0.0.json#"))
    component = told["volumeProperties"][0]["components"][0]
    colours, opacities = component["rgbTransferFunction"]["points"], component["scalarOpacity"]["points"]
    check("slicer: lighting", set(component["lighting"]) == {"ambient", "diffuse", "specular", "specularPower"})
    shape = lambda p: (p["midpoint"], p["sharpness"])
    return (
        [(p["x"], *p["color"], *shape(p)) for p in colours],
        [(p["x"], p["y"], *shape(p)) for p in opacities],
    )


def paraview(path):
    preset = json.loads(path.read_text())[0]
    check("paraview: colour space", preset["ColorSpace"] == "RGB")
    colours = np.reshape(preset["RGBPoints"], (-1, 4))
    return [(*map(float, p), 0.5, 0.0) for p in colours], [tuple(map(float, p)) for p in np.reshape(preset["Points"], (-1, 4))]


def main():
    program, schema = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        f = lambda file: folder / file
        ivd(program, "phantom", "head", "--size", 48, "-o", f("head.ivd"))
        ivd(program, "segment", f("head.ivd"), "--method", "kmvs", "--k", 4, "-o", f("labels.ivd"))
        ivd(program, "atf", f("head.ivd"), f("labels.ivd"), "-o", f("transfer.ivd"))
        for file in ("own.json", "own.vp.json", "own.paraview.json"):
            ivd(program, "export", f("transfer.ivd"), "-o", f(file))
        low, high = json.loads(f("own.json").read_text())["range"]
        values = np.linspace(low, high, 1024)
        own = ours(f("own.json"), values)
        for program_name, points in (("slicer", slicer(f("own.vp.json"), schema)), ("paraview", paraview(f("own.paraview.json")))):
            off = np.abs(theirs(*points, values) - own).max()
            check(f"{program_name}: VTK's table", off <= LIMIT, f"{off * 255:.2f}/255")
            print(f"{program_name}: {len(points[0])} points of colour, {len(points[1])} of opacity, off by {off * 255:.2f}/255 at most")
        for file in ("own.json", "own.vp.json", "own.paraview.json"):
            ivd(program, "import", f(file), "-o", f("back.ivd"))
            ivd(program, "export", f("back.ivd"), "-o", f("back.json"))
            off = np.abs(ours(f("back.json"), values) - own).max()
            check(f"{file}: read back", off <= LIMIT, f"{off * 255:.2f}/255")
    sys.exit(checks.outcome())


if __name__ == "__main__":
    main()
