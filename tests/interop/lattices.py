"""Lattices as other programs read them: python lattices.py PATH/TO/ivd

Makes phantoms, extracts, refines and exports them by the program, reads the files by trimesh, and checks that they are
closed manifolds without repeated or coincident corners, that every refined vertex is one of the lattice's, and that the
formats agree within their precision; VTK reads the VTP. PLY, OBJ, STL and VTP in either space are read by VTK and turned by what
they say of their space, as 3D Slicer does. Prints `N passed, N failed`; the exit code is 1 where something
failed. Needs numpy, trimesh and vtk.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from checks import check, ivd, outcome

PHANTOMS = [("sphere", 48, 127.5), ("torus", 64, 127.5), ("gyroid", 48, 127.5), ("shell", 40, 127.5), ("head", 48, 60.0)]
RATIOS = [0.5, 0.1, 0.0]
# glTF is in metres with y up: left is +x, the head +y, the front +z.
TO_RAS = 1000.0 * np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def load(path):
    """Vertices [mm, RAS] and triangles, as they are in the file."""
    loaded = trimesh.load(path, process=False)
    if isinstance(loaded, trimesh.Scene):
        mesh = loaded.to_geometry() if hasattr(loaded, "to_geometry") else loaded.dump(concatenate=True)
        return np.asarray(mesh.vertices) @ TO_RAS.T, np.asarray(mesh.faces)
    return np.asarray(loaded.vertices), np.asarray(loaded.faces)


def load_vtp(path):
    """Vertices [mm, LPS], triangles, and the address of each vertex, by VTK."""
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    mesh = reader.GetOutput()
    assert mesh.GetFieldData().GetAbstractArray("SPACE").GetValue(0) == "LPS"
    faces = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    assert mesh.GetPolys().GetNumberOfCells() == mesh.GetNumberOfCells() == len(faces)
    address = [vtk_to_numpy(mesh.GetPointData().GetArray(name)) for name in ("voxel", "element")]
    return vtk_to_numpy(mesh.GetPoints().GetData()), faces, np.column_stack(address)


def addresses(path):
    """The address of each vertex of a PLY."""
    data = trimesh.load(path, process=False).metadata["_ply_raw"]["vertex"]["data"]
    return np.column_stack([data[name] for name in ("voxel_x", "voxel_y", "voxel_z", "element")])


def check_mesh(name, vertices, faces, outward=True):
    """Closed, manifold, no corner twice, outward where that was promised; counted here, and by trimesh."""
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    undirected, counts = np.unique(np.sort(half, axis=1), axis=0, return_counts=True)
    check(f"{name}: each edge has two triangles", bool((counts == 2).all()), f"{(counts != 2).sum()} have not")
    check(f"{name}: triangles agree along edges", len(np.unique(half, axis=0)) == len(half))
    check(f"{name}: no triangle names a vertex twice", bool((half[:, 0] != half[:, 1]).all()))
    lengths = np.linalg.norm(vertices[undirected[:, 0]] - vertices[undirected[:, 1]], axis=1)
    check(f"{name}: no two corners at one place", bool((lengths > 0).all()), f"{(lengths == 0).sum()} edges")
    check(f"{name}: every vertex is used", len(np.unique(faces)) == len(vertices))
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    check(f"{name}: trimesh calls it watertight", mesh.is_watertight and mesh.is_winding_consistent)
    if outward:
        check(f"{name}: it encloses a positive volume", mesh.volume > 0, str(mesh.volume))
    check(f"{name}: one fan round each vertex", fans(len(vertices), faces) == len(vertices))


def fans(vertex_count, faces):
    """Fans of triangles round the vertices: corners joined across the edges that leave their vertex."""
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    parent = np.arange(3 * len(faces))
    leaving, arriving = {}, {}
    for t, (a, b, c) in enumerate(faces.tolist()):
        for i, (v, after, before) in enumerate(((a, b, c), (b, c, a), (c, a, b))):
            leaving[v, after] = corners[t, i]
            arriving[v, before] = corners[t, i]

    def root(c):
        while parent[c] != c:
            parent[c] = parent[parent[c]]
            c = parent[c]
        return c

    joined = 0
    for side, corner in leaving.items():
        if side in arriving:
            a, b = root(corner), root(arriving[side])
            if a != b:
                parent[a] = b
                joined += 1
    return len(parent) - joined


def check_formats(name, program, lattice, folder):
    """The other formats against the PLY."""
    files = {ending: folder / f"{name}.{ending}" for ending in ("ply", "obj", "stl", "glb", "vtp")}
    for file in files.values():
        ivd(program, "export", lattice, "-o", file)
    vertices, faces = load(files["ply"])
    obj_vertices, obj_faces = load(files["obj"])
    check(f"{name}: OBJ equals PLY to 1e-9", np.allclose(obj_vertices, vertices, rtol=0, atol=1e-9))
    check(f"{name}: OBJ has the PLY's triangles", np.array_equal(obj_faces, faces))
    glb_vertices, glb_faces = load(files["glb"])
    check(f"{name}: GLB equals PLY to 1e-4 mm", np.allclose(glb_vertices, vertices, rtol=0, atol=1e-4))
    check(f"{name}: GLB has the PLY's triangles", np.array_equal(glb_faces, faces))
    stl_vertices, stl_faces = load(files["stl"])
    soup, expected = stl_vertices[stl_faces], vertices[faces].astype(np.float32)
    check(f"{name}: STL has the PLY's corners in f32", np.array_equal(soup.astype(np.float32), expected))
    vtp_vertices, vtp_faces, vtp_addresses = load_vtp(files["vtp"])
    same = vtp_vertices.dtype == np.float64 and np.array_equal(vtp_vertices * [-1.0, -1.0, 1.0], vertices)
    check(f"{name}: VTP has the PLY's vertices, bit for bit", same)
    check(f"{name}: VTP has the PLY's triangles", np.array_equal(vtp_faces, faces))
    check(f"{name}: VTP has the PLY's addresses", np.array_equal(vtp_addresses, addresses(files["ply"])))
    return vertices, faces


def slicer_space(text):
    """The space that 3D Slicer takes from a comment: None where it says none."""
    return next((space for space in ("RAS", "LPS") if f"SPACE={space}" in text), None)


def as_slicer(path):
    """Vertices [mm, RAS], triangles and the space that was said, as 3D Slicer has them: read by VTK, and turned from LPS."""
    kind = {"ply": vtk.vtkPLYReader, "obj": vtk.vtkOBJReader, "stl": vtk.vtkSTLReader, "vtp": vtk.vtkXMLPolyDataReader}
    ending = path.suffix[1:]
    reader = kind[ending]()
    reader.SetFileName(str(path))
    reader.Update()
    mesh = reader.GetOutput()
    if ending == "vtp":
        space = mesh.GetFieldData().GetAbstractArray("SPACE").GetValue(0)
        assert mesh.GetFieldData().GetAbstractArray("UNIT").GetValue(0) == "mm"
    elif ending == "ply":
        comments = reader.GetComments()
        said = (slicer_space(comments.GetValue(i)) for i in range(comments.GetNumberOfValues()))
        space = next((one for one in said if one), None)
    else:
        space = slicer_space(reader.GetComment() if ending == "obj" else reader.GetHeader())
    vertices = vtk_to_numpy(mesh.GetPoints().GetData()).astype(np.float64)
    turn = {"RAS": [1.0, 1.0, 1.0], "LPS": [-1.0, -1.0, 1.0]}[space]
    faces = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vertices * turn, faces, space


def check_spaces(name, program, lattice, vertices, faces, folder):
    """Every format in every space, as 3D Slicer and trimesh read it, against the lattice in RAS."""
    enclosed = trimesh.Trimesh(vertices, faces, process=False).volume
    for ending in ("ply", "obj", "stl", "vtp"):
        for space in ("RAS", "LPS"):
            file, case = folder / f"{name}-{space}.{ending}", f"{name} {ending} {space}"
            ivd(program, "export", lattice, "-o", file, "--space", space.lower())
            placed, triangles, said = as_slicer(file)
            check(f"{case}: it says its space", said == space, said)
            # VTK keeps f32, and joins the corners of an STL.
            apart = np.abs(placed[triangles] - vertices[faces]).max()
            check(f"{case}: it lies where the lattice does", apart < 1e-4, f"{apart} mm")
            volume = trimesh.Trimesh(placed, triangles, process=False).volume
            check(f"{case}: it isn't turned inside out", abs(volume / enclosed - 1.0) < 1e-4, f"{volume}, {enclosed}")
            if ending != "vtp":
                own, own_faces = load(file)
                turned = own * ([1.0, 1.0, 1.0] if space == "RAS" else [-1.0, -1.0, 1.0])
                apart = np.abs(turned[own_faces] - vertices[faces]).max()
                check(f"{case}: trimesh reads the same numbers", apart < 1e-4, f"{apart} mm")


def check_phantom(program, shape, size, iso, folder):
    volume, lattice = folder / f"{shape}.ivd", folder / f"{shape}-lattice.ivd"
    ivd(program, "phantom", shape, "--size", size, "-o", volume)
    ivd(program, "lattice", volume, "--iso", iso, "-o", lattice)
    vertices, faces = check_formats(shape, program, lattice, folder)
    check_mesh(shape, vertices, faces)
    if shape == PHANTOMS[0][0]:
        check_spaces(shape, program, lattice, vertices, faces, folder)
    known = {place.tobytes() for place in vertices}
    for ratio in RATIOS:
        name = f"{shape} at {ratio}"
        refined, file = folder / "refined.ivd", folder / "refined.ply"
        ivd(program, "refine", lattice, "-o", refined, "--method", "collapse", "--ratio", ratio)
        ivd(program, "export", refined, "-o", file)
        kept, kept_faces = load(file)
        # Refined to nothing, only the topology is left: sheets may have passed through each other.
        check_mesh(name, kept, kept_faces, outward=ratio >= 0.1)
        check(f"{name}: every vertex is the lattice's", all(place.tobytes() in known for place in kept))
        if ratio >= 0.1 and shape != "head":
            share = len(kept_faces) / len(faces)
            check(f"{name}: the share of triangles is met", abs(share - ratio) < 0.01, f"{share}")


def main():
    program = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        for shape, size, iso in PHANTOMS:
            try:
                check_phantom(program, shape, size, iso, Path(folder))
            except RuntimeError as error:
                check(shape, False, str(error))
    sys.exit(outcome())


if __name__ == "__main__":
    main()
