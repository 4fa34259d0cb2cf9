"""Bodies against equilibria that an independent package finds: python body.py PATH/TO/ivd [--data DIR] [--scenes NAME ...]

A part of a scan is pushed or pulled by `ivd deform --solver body`. FElupe (its compressible neo-Hookean law; uniform hexahedra of half of the
program's finest edge on all of the ball that the handle reaches) finds the same equilibrium: the same moduli by voxel at its Gauss points, the same
grip (half of the radius, so that its core has several cells), rigid voxels and border; mesh, assembly, increments and Newton's method are its own, equations by Intel's PARDISO. It is solved with hexahedra twice as
long too, and what that changes is printed. Over the soft voxels of the part outside the grip that the truth moves by at least a tenth of its most:
relative L2 difference, and the difference of 95 % of them as a share of the largest motion; for `body`, and for the maps of the lattice's motion by
`octree`, `biharmonic` and `fem`. The exit code is 1 where `body` is further off than the limit for its push, where it or the truth fails, or where the
truth changes by more than 2 %. Needs numpy, scipy, nibabel, pynrrd, trimesh, felupe (11.3) and pypardiso.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import felupe
import nibabel
import nrrd
import numpy as np
import pypardiso
import scipy.ndimage
import trimesh
from program import ivd, vectors

KPA, POISSON, FILLER, AIR = 4.0, 0.45, 1e-3, 0.4
MAPS = ["octree", "biharmonic", "fem"]
# Relative L2, and the difference of 95 % as a share of the largest motion, by push over radius.
LIMITS = [(0.2, 0.05, 0.15), (0.3, 0.10, 0.25)]


class Scan:
    """Labels on a grid, where matter is whose: `kinds` by label are (kPa, Poisson's ratio) or None for what is rigid."""

    def __init__(self, image, labels, part, kinds):
        self.affine = image.affine
        self.labels, self.kinds = labels, kinds
        self.inside = np.isin(labels, part) if part is not None else labels > 0
        self.spacing = np.linalg.norm(self.affine[:3, :3], axis=0)
        # From the directions of the grid's axes to the world's.
        self.turn = self.affine[:3, :3] / self.spacing

    def steps(self, cell):
        """Voxels along the edges of the program's finest cells."""
        longest = 1.001 * cell * self.spacing.min()
        return np.array([next((s for s in (4, 2) if s * h <= longest), 1) for h in self.spacing])

    def in_voxels(self, points):
        return (points - self.affine[:3, 3]) @ np.linalg.inv(self.affine[:3, :3]).T

    def moduli(self, grip):
        """Young's modulus and Poisson's ratio by voxel, and which voxels are rigid."""
        young = np.where(self.inside, KPA, KPA * FILLER)
        poisson = np.where(self.inside, POISSON, AIR)
        rigid = np.zeros(self.labels.shape, bool)
        for label, kind in self.kinds.items():
            here = self.labels == label
            if kind is None:
                rigid |= here
            else:
                young[here], poisson[here] = kind
        return np.where(self.inside, young * grip, young), poisson, rigid


class Grip:
    """What a handle has hold of: docs/methods/body.md."""

    def __init__(self, scan, vertex, rho):
        self.centre = vertex * scan.spacing
        index = np.stack(np.meshgrid(*map(np.arange, scan.labels.shape), indexing="ij"), -1)
        far = np.linalg.norm(index * scan.spacing - self.centre, axis=-1)
        rigid = np.isin(scan.labels, [label for label, kind in scan.kinds.items() if kind is None])
        self.rho = min([rho, *far[rigid & (far < rho)]])
        near = (far <= self.rho) & scan.inside
        parts, _ = scipy.ndimage.label(near)
        low, high = np.floor(vertex + 1e-3).astype(int), np.ceil(vertex - 1e-3).astype(int)
        around = parts[tuple(slice(l, h + 1) for l, h in zip(low, high))]
        self.voxels = np.isin(parts, around[around > 0])
        self.factor = np.where(self.voxels & (far < self.rho), (self.rho / np.maximum(far, self.rho / 2)) ** 3, 1.0)


def lame(young, poisson):
    return young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))


class Truth:
    """The equilibrium on hexahedra of `edge` voxels, nodes on the voxels."""

    def __init__(self, scan, grip, radius, edge, vertices):
        self.scan, self.edge = scan, edge
        vertex = grip.centre / scan.spacing
        reach = radius / scan.spacing
        # Every node of the coarser one is one of the finer.
        self.low = np.maximum(np.floor((vertex - reach) / (2 * edge)) * 2 * edge - 2 * edge, 0)
        high = np.minimum(vertex + reach + edge, np.array(scan.labels.shape) - 1)
        shape = np.floor((high - self.low) / edge).astype(int) + 1
        nodes = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1) * edge + self.low
        far = np.linalg.norm(nodes * scan.spacing - grip.centre, axis=-1)
        within = far <= radius
        corners = [np.s_[a: shape[0] - 1 + a, b: shape[1] - 1 + b, c: shape[2] - 1 + c] for c in (0, 1) for b in (0, 1) for a in (0, 1)]
        cells = np.all([within[c] for c in corners], axis=0)
        # The nodes of all cells that take part; those of one that doesn't are held, the grid's end isn't.
        touched, beside = np.zeros(shape, bool), np.zeros(shape, bool)
        for c in corners:
            touched[c] |= cells
            beside[c] |= ~cells
        self.number = np.cumsum(touched.ravel()).reshape(shape) - 1
        order = [0, 1, 3, 2, 4, 5, 7, 6]
        connectivity = np.stack([self.number[corners[c]][cells] for c in order], -1)
        self.nodes = nodes[touched]
        self.far = far[touched]
        self.border = beside[touched]
        self.touched = touched
        mesh = felupe.Mesh(self.nodes * scan.spacing, connectivity, "hexahedron")
        region = felupe.RegionHexahedron(mesh)
        self.field = felupe.FieldContainer([felupe.Field(region, dim=3)])
        young, poisson, rigid = scan.moduli(grip.factor)
        lows = nodes[:-1, :-1, :-1][cells]
        places = lows[None] + edge * (region.quadrature.points[:, None] + 1) / 2
        at = self.nearest(places)
        mu, lam = lame(young[at], poisson[at])
        law = felupe.NeoHookeCompressible(mu=mu, lmbda=lam)
        # Moduli by cell can't be cut in pieces.
        law.chunksize = None
        self.body = felupe.SolidBody(law, self.field)
        self.rigid = self.touches(rigid)
        of_part = self.touches(grip.voxels)
        # The surface goes with its inside: the nodes of cells that hold its vertices, but not those of another part.
        skin = np.zeros(touched.shape, bool)
        near = scan.in_voxels(vertices)
        near = near[np.linalg.norm(near * scan.spacing - grip.centre, axis=1) <= grip.rho / 2]
        lows_of = np.floor((near - self.low) / edge).astype(int)
        for c in np.ndindex(2, 2, 2):
            skin[tuple((lows_of + c).T)] = True
        core = (self.far <= grip.rho / 2) & of_part
        self.gripped = (core | (skin[touched] & (of_part | ~self.touches(scan.inside)))) & ~self.rigid & ~self.border
        self.held = self.rigid | self.border | self.gripped
        stiffness = np.repeat(mu.mean(0), 8) * edge * np.cbrt(np.prod(scan.spacing))
        self.yields = np.repeat(1.0 / np.bincount(connectivity.ravel(), stiffness, len(self.nodes)), 3)

    def nearest(self, places):
        index = np.clip(np.floor(places + 0.5).astype(int), 0, np.array(self.scan.labels.shape) - 1)
        return tuple(np.moveaxis(index, -1, 0))

    def touches(self, voxels):
        """Whether any voxel that a node touches is one of these."""
        found = np.zeros(len(self.nodes), bool)
        for off in np.ndindex(2, 2, 2):
            found |= voxels[self.nearest(self.nodes + 1e-6 * (2.0 * np.array(off) - 1.0))]
        return found

    def volumes(self):
        return np.linalg.det(np.moveaxis(self.field.extract()[0], (0, 1), (-2, -1)))

    def solve(self, move, increments):
        u = self.field[0].values
        u[:] = 0
        free = ~np.repeat(self.held, 3)
        for i in range(1, increments + 1):
            jump = np.zeros_like(u)
            jump[self.gripped] = move * i / increments - u[self.gripped]
            for step in range(60):
                force = np.asarray(self.body.assemble.vector(self.field).todense()).ravel()
                matrix = self.body.assemble.matrix(self.field).tocsr()
                right = -(force + matrix @ jump.ravel())[free]
                left = np.linalg.norm((force * self.yields)[free])
                if not jump.any() and left < 1e-6 * np.linalg.norm(move):
                    break
                way = jump.ravel().copy()
                way[free] += pypardiso.spsolve(matrix[free][:, free].tocsr(), right)
                start, share = u.copy(), 1.0
                while True:
                    u[:] = start + share * way.reshape(-1, 3)
                    if np.all(self.volumes() > 0):
                        break
                    share /= 2
                    if share < 1e-4:
                        raise RuntimeError(f"the truth folds at {i} of {increments} parts of the way")
                jump *= 1 - share if share < 1 else 0
            else:
                raise RuntimeError(f"the truth finds no balance at {i} of {increments} parts of the way")
        return u.copy()

    def at_voxels(self, u):
        """The motion by voxel of the scan, where nodes lie on voxels; elsewhere 0."""
        out = np.zeros([*self.scan.labels.shape, 3])
        on = np.all(np.abs(self.nodes - np.round(self.nodes)) < 1e-9, axis=1)
        out[tuple(np.round(self.nodes[on]).astype(int).T)] = u[on]
        return out


def compare(found, truth, chosen):
    most = np.linalg.norm(truth[chosen], axis=-1).max()
    off = np.linalg.norm((found - truth)[chosen], axis=-1)
    return np.linalg.norm(off) / np.linalg.norm(truth[chosen]), np.quantile(off, 0.95) / most


def head(program, folder, _):
    image = folder / "head.nii.gz"
    ivd(program, "phantom", "head", "--size", 96, "--noise", 0, "--truth", folder / "truth.nii.gz", "-o", folder / "head.ivd")
    ivd(program, "export", folder / "head.ivd", "-o", image)
    labels = np.asarray(nibabel.load(folder / "truth.nii.gz").dataobj).astype(int)
    # Brain, in fluid, in bone.
    kinds = {1: (3.0, 0.45), 2: None, 3: (0.1, 0.45), 4: (1.6, 0.45), 5: (1.6, 0.45)}
    return nibabel.load(image), labels, [4, 5], kinds, 18.0, 2


def hippocampus(_, __, data):
    labels = nibabel.load(data / "hippocampus_msd/labels/hippocampus_001.nii.gz")
    return labels, (np.asarray(labels.dataobj) > 0).astype(int), [1], {}, 10.0, 1


def mri_head(_, __, data):
    image = nibabel.load(data / "mri_head_seg3d/MR.nii.gz")
    values = np.asarray(image.dataobj)
    skull = nrrd.read(str(data / "mri_head_seg3d/Skull.nrrd"))[0][::-1, ::-1]
    labels = np.where(skull > 0, 2, np.where(values >= 60, 1, 0))
    return image, labels, [1, 2], {1: (3.0, 0.45), 2: None}, 20.0, 2


def abdomen(_, __, data):
    image = nibabel.load(data / "ct_abdomen_ts/example_seg.nii.gz")
    labels = np.asarray(image.dataobj).astype(int)
    values = np.asarray(nibabel.load(data / "ct_abdomen_ts/example_ct_sm.nii.gz").dataobj)
    # The liver among flesh, fat, air and bone by value.
    others = np.select([values < -500, values < -30, values < 250], [200, 201, 202], 203)
    labels = np.where(labels == 5, 5, others)
    kinds = {5: (6.3, 0.45), 200: (0.01, 0.4), 201: (2.3, 0.45), 202: (10.0, 0.45), 203: None}
    return image, labels, [5], kinds, 40.0, 1


SCENES = {"hippocampus": hippocampus, "head": head, "mri_head": mri_head, "abdomen": abdomen}


def outward(scan, voxel):
    """The direction out of the part, by the gradient of it smoothed."""
    smooth = scipy.ndimage.gaussian_filter(scan.inside.astype(float), 3.0)
    index = np.clip(np.round(voxel).astype(int), 0, np.array(scan.labels.shape) - 1)
    normal = -np.array([slope[tuple(index)] for slope in np.gradient(smooth, *scan.spacing)])
    return normal / np.linalg.norm(normal)


def run(name, options, folder):
    program, data = options.program, options.data
    image, labels, part, kinds, radius, cell = SCENES[name](program, folder, data)
    scan = Scan(image, labels, part, kinds)
    paths = {key: folder / f"{key}.nii.gz" for key in ("mask", "labels")}
    nibabel.save(nibabel.Nifti1Image(scan.inside.astype(np.uint8), image.affine), paths["mask"])
    nibabel.save(nibabel.Nifti1Image(labels.astype(np.uint8), image.affine), paths["labels"])
    lattice = folder / "lattice.ivd"
    ivd(program, "lattice", paths["mask"], "--iso", 0.5, "-o", lattice)
    ivd(program, "export", lattice, "-o", folder / "lattice.ply")
    ivd(program, "octree", lattice, "-o", folder / "octree.ivd")
    vertices = np.asarray(trimesh.load(folder / "lattice.ply", process=False).vertices)
    # The vertex of the part farthest from what is rigid and from the grid's end: it can be pushed.
    voxels = scan.in_voxels(vertices)
    rigid = np.isin(labels, [label for label, kind in kinds.items() if kind is None])
    room = np.minimum(voxels, np.array(labels.shape) - 1 - voxels) @ np.diag(scan.spacing)
    score = room.min(1)
    if rigid.any():
        depth = scipy.ndimage.distance_transform_edt(~rigid, sampling=scan.spacing)
        index = np.clip(np.round(voxels).astype(int), 0, np.array(labels.shape) - 1)
        score = np.minimum(score, depth[tuple(index.T)])
    pick = int(np.argmax(np.minimum(score, 0.6 * radius)))
    vertex, normal = voxels[pick], outward(scan, voxels[pick])
    failed = False
    for push in options.pushes:
        move = normal * push * radius
        world = scan.turn @ move
        handle = f"vertex={pick};move={','.join(f'{c:.9f}' for c in world)};radius={radius}"
        material = []
        for label, kind in kinds.items():
            material += ["--material", f"{label}=" + ("rigid:true" if kind is None else f"kpa:{kind[0]},poisson:{kind[1]}")]
        extra = ["--labels", paths["labels"], *material] if kinds else []
        rho = options.grip * radius
        what = f"{name} r {radius:g} mm, grip {rho:g} mm, {push:+g} r"
        try:
            start = time.perf_counter()
            ivd(program, "deform", lattice, "--solver", "body", "--cell", cell, "--grip", rho, "--handle", handle, *extra, "-o", folder / "motion.ivd")
            seconds = time.perf_counter() - start
        except RuntimeError as error:
            print(f"| {what} | {str(error).split('exit ')[1][:160]} |", flush=True)
            failed = True
            continue
        found = {}
        for method in ["body", *MAPS]:
            start = time.perf_counter()
            try:
                ivd(program, "map", lattice, folder / "octree.ivd", folder / "motion.ivd", "--method", method, "-o", folder / "field.ivd")
            except RuntimeError as error:
                print(f"| {what} | {method}: {str(error).split('exit ')[1][:120]} |", flush=True)
                failed |= method == "body"
                continue
            taken = time.perf_counter() - start
            ivd(program, "export", folder / "field.ivd", "--direction", "forward", "-o", folder / "field.nrrd")
            found[method] = (vectors(folder / "field.nrrd") @ scan.turn, taken + (seconds if method == "body" else 0.0))
        grip = Grip(scan, vertex, rho)
        truths = []
        try:
            for edge in (cell,) if options.alike else (cell, cell / 2):
                truth = Truth(scan, grip, radius, edge, vertices)
                start = time.perf_counter()
                truths.append((truth.at_voxels(truth.solve(move, max(1, round(abs(push) * 30)))), truth))
                print(f"{what}: truth of {edge:g} voxels, {3 * int((~truth.held).sum())} unknowns, {time.perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
        except RuntimeError as error:
            print(f"| {what} | {error} |", flush=True)
            failed = True
            continue
        finest, truth = truths[-1]
        size = np.linalg.norm(finest, axis=-1)
        _, _, stays = scan.moduli(grip.factor)
        gripped = truth.at_voxels(np.repeat(truth.gripped[:, None], 3, 1))[..., 0] > 0
        chosen = scan.inside & ~stays & ~gripped & (size >= 0.1 * size.max())
        # The coarser one has nodes on every other voxel, where its edge is two.
        on_coarse = chosen & (np.linalg.norm(truths[0][0], axis=-1) > 0)
        change, _ = compare(truths[0][0], finest, on_coarse)
        limit = next((limit for limit in LIMITS if abs(push) <= limit[0] + 1e-9), LIMITS[-1])
        for method, (motion, taken) in found.items():
            apart, most = compare(motion, finest, on_coarse if options.alike else chosen)
            alike, _ = compare(motion, truths[0][0], on_coarse)
            bad = method == "body" and (apart > limit[1] or most > limit[2])
            failed |= bad
            print(f"| {what} | {method} | {taken:.2f} s | {100 * apart:.1f} % | {100 * most:.1f} % | {100 * alike:.1f} % | {100 * change:.1f} % |{' beyond the limit' if bad else ''}", flush=True)
        failed |= change > 0.02
    return failed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[3] / "shared/data")
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--pushes", nargs="*", type=float, default=[-0.06, 0.06, -0.2, 0.2, -0.3, 0.3])
    parser.add_argument("--grip", type=float, default=0.5, help="radius of the grip as a share of the radius")
    parser.add_argument("--alike", action="store_true", help="only hexahedra as long as the program's finest: is the same found on the same mesh?")
    options = parser.parse_args()
    print("| scene | method | time | L2 | 95 % | L2, cells alike | truth's own change |\n|---|---|---|---|---|---|---|")
    failed = False
    for name in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            failed |= run(name, options, Path(folder))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
