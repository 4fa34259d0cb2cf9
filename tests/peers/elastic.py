"""The maps against elasticity that an independent package solves: python elastic.py PATH/TO/ivd [options]

A ball in 96³ voxels of 1 mm is pushed, pulled and twisted. scikit-fem (hexahedra of --edge voxels on every place of the region that
the handle and its margin reach, neo-Hookean, Poisson's ratio and the filler's modulus those of `ivd map --method fem`) finds the
equilibrium in which the lattice's vertices move as the program moves them; its cells are uniform, the ball is cut out of them at their
Gauss points by its formula, springs and increments are its own. Every map of the program is compared with that at all voxels that lie
in such a cell. Prints a Markdown table: run time of `ivd map` beside the difference in mm and as a share of the largest motion; the exit
code is 1 where `fem` with cells of the same edge is further off than --most of it, root mean square. Needs numpy, scipy and scikit-fem.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from program import ivd, vectors
from skfem import Basis, BilinearForm, ElementHex1, ElementVector, LinearForm, MeshHex
from skfem.helpers import ddot, det, grad, identity, inv, mul, trace, transpose

SIZE, MARGIN, POISSON, FILLER = 96, 6.0, 0.4, 0.01
SCENES = {
    "push": ["--handle", "pick=48,48,81;move=0,0,-2;radius=8"],
    "pull": ["--handle", "pick=48,48,81;move=0,0,2;radius=8"],
    "twist": ["--shape", "kind=rotate;centre=48,48,81;axis=0,0,1;radius=8;core=0.3;angle=25"],
}
MAPS = {
    "octree": ["--method", "octree"],
    "octree, weight one": ["--method", "octree", "--weight", "one"],
    "biharmonic, cell 4": ["--method", "biharmonic", "--cell", "4"],
    "biharmonic, cell 2": ["--method", "biharmonic", "--cell", "2"],
    "fem, cell 4": ["--method", "fem", "--cell", "4"],
    "fem, cell 2": ["--method", "fem", "--cell", "2"],
    "fem, cell 1": ["--method", "fem", "--cell", "1"],
}
# Force on a vertex (in units of the ball's modulus times a cell's edge) for each mm that it is off: stiff enough to be a rule.
SPRING = 10.0
INCREMENTS, STEPS, TOLERANCE = 2, 40, 1e-6


@BilinearForm
def tangent(u, v, w):
    inverse, log = w.inverse, w.log
    left, right = mul(inverse, grad(u)), mul(inverse, grad(v))
    straight = w.mu * ddot(grad(u), grad(v)) + w.lame * trace(left) * trace(right)
    return straight + (w.mu - w.lame * log) * ddot(left, transpose(right))


@LinearForm
def forces(v, w):
    stress = w.mu * (w.gradient - transpose(w.inverse)) + w.lame * w.log * transpose(w.inverse)
    return ddot(stress, grad(v))


class Body:
    """The region's elastic matter, with the lattice's vertices in it."""

    def __init__(self, balls, ball, places, edge):
        ticks = np.arange(-edge, SIZE + 2 * edge, edge, dtype=float)
        whole = MeshHex.init_tensor(ticks, ticks, ticks)
        corners = whole.p[:, whole.t]
        within = np.zeros(whole.t.shape[1], bool)
        for centre, reach in balls:
            apart = np.linalg.norm(corners - np.array(centre)[:, None, None], axis=0)
            within |= (apart <= reach + MARGIN).all(axis=0)
        mesh = whole.restrict(np.flatnonzero(within))
        self.basis = Basis(mesh, ElementVector(ElementHex1()), intorder=2)
        quadrature = self.basis.global_coordinates().value
        middle, radius = ball
        inside = np.linalg.norm(quadrature - middle[:, None, None], axis=0) < radius
        modulus = np.where(inside, 1.0, FILLER)
        self.mu = modulus / (2 * (1 + POISSON))
        self.lame = modulus * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
        self.size = edge
        border = np.unique(mesh.facets[:, mesh.boundary_facets()])
        self.held = self.basis.nodal_dofs[:, border].ravel()
        low = {tuple(p) for p in corners[:, 0, within].T}
        self.chosen = self.covered(places, low)
        self.probe = self.at(places[self.chosen])
        self.low = low

    def covered(self, places, low=None):
        low = self.low if low is None else low
        cells = np.floor(places / self.size) * self.size
        return np.array([tuple(c) in low for c in cells])

    def at(self, places):
        """The matrix that gives the displacement at places (n, 3), all components of the first axis before those of the second."""
        pieces = [self.basis.probes(piece.T).tocsr() for piece in np.array_split(places, max(1, len(places) // 500))]
        rows = [np.arange(piece.shape[0]).reshape(3, -1) for piece in pieces]
        return scipy.sparse.vstack([piece[r[a]] for a in range(3) for piece, r in zip(pieces, rows)]).tocsr()

    def state(self, u):
        gradient = self.basis.interpolate(u).grad + identity(np.zeros((3, *self.mu.shape)))
        volume = det(gradient)
        if volume.min() <= 0:
            return None
        return {"gradient": gradient, "inverse": inv(gradient), "log": np.log(volume), "mu": self.mu, "lame": self.lame}

    def residual(self, state, u, goal):
        pull = SPRING * self.size * (self.probe.T @ (self.probe @ u - goal))
        all_forces = forces.assemble(self.basis, **state) + pull
        all_forces[self.held] = 0.0
        return all_forces

    def equilibrium(self, motion):
        """Displacement of the nodes where the chosen vertices move (n, 3)."""
        u = np.zeros(self.basis.N)
        springs = SPRING * self.size * (self.probe.T @ self.probe)
        free = np.setdiff1d(np.arange(self.basis.N), self.held)
        for part in range(1, INCREMENTS + 1):
            goal = motion[self.chosen].T.ravel() * part / INCREMENTS
            scale = np.linalg.norm(SPRING * self.size * (self.probe.T @ goal))
            for _ in range(STEPS):
                state = self.state(u)
                residual = self.residual(state, u, goal)
                if np.linalg.norm(residual) <= TOLERANCE * scale:
                    break
                matrix = (tangent.assemble(self.basis, **state) + springs).tocsc()[free][:, free]
                step = np.zeros_like(u)
                step[free] = scipy.sparse.linalg.spsolve(matrix, -residual[free])
                length = 1.0
                while length > 1e-4:
                    tried = self.state(u + length * step)
                    if tried is not None and np.linalg.norm(self.residual(tried, u + length * step, goal)) < np.linalg.norm(residual):
                        break
                    length /= 2
                else:
                    raise RuntimeError("no step lessens the forces")
                u = u + length * step
            else:
                raise RuntimeError(f"no equilibrium: {np.linalg.norm(residual):.1e} of {scale:.1e} left")
        return u


def scene(program, name, at, given):
    """Rows of a table."""
    ivd(program, "deform", at / "l.ivd", *SCENES[name], "-o", at / "m.ivd")
    ivd(program, "export", at / "m.ivd", "-o", at / "m.json")
    motion = json.loads((at / "m.json").read_text())
    ivd(program, "export", at / "l.ivd", "-o", at / "l.obj")
    lines = (at / "l.obj").read_text().splitlines()
    places = np.array([[float(c) for c in line.split()[1:4]] for line in lines if line.startswith("v ")])
    moved = np.array(motion["frames"][-1]["displacement_mm"])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    radius = np.linalg.norm(places - middle, axis=1).mean()
    body = Body([(b["centre"], b["radius"]) for b in motion["reach"]], (middle, radius), places, given.edge)
    u = body.equilibrium(moved)
    voxels = np.stack(np.meshgrid(*[np.arange(SIZE, dtype=float)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    within = body.covered(voxels)
    truth = (body.at(voxels[within]) @ u).reshape(3, -1).T
    solid = np.linalg.norm(voxels[within] - middle, axis=1) < radius
    largest = np.linalg.norm(moved, axis=1).max()
    left = np.linalg.norm((body.probe @ u).reshape(3, -1).T - moved[body.chosen], axis=1)
    print(f"<!-- {name}: ball of {radius:.3f} mm at {middle}, {body.basis.N} unknowns, vertices off by {left.max():.4f} mm at most -->")
    rows = []
    for kind, words in MAPS.items():
        done = ivd(program, "map", at / "l.ivd", at / "o.ivd", at / "m.ivd", "--margin", MARGIN, *words, "-o", at / "d.ivd")
        ivd(program, "export", at / "d.ivd", "--direction", "forward", "-o", at / "d.nrrd")
        apart = np.linalg.norm(vectors(at / "d.nrrd").reshape(-1, 3)[within] - truth, axis=1)
        inner, outer = (np.sqrt((apart[where] ** 2).mean()) for where in (solid, ~solid))
        rows.append({"map": kind, "inner": inner / largest, "wall": done["wall_s"]})
        print(f"| {name} | {kind} | {done['wall_s']:.2f} | {inner:.4f} | {100 * inner / largest:.2f} % | {apart[solid].max():.3f} | {outer:.4f} |")
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ivd")
    parser.add_argument("--edge", type=int, default=2, help="voxels along a cell of the other package")
    parser.add_argument("--most", type=float, default=0.03)
    given = parser.parse_args()
    print("| scene | map | wall (s) | inside: rms (mm) | of the largest motion | largest (mm) | outside: rms (mm) |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        ivd(given.ivd, "phantom", "sphere", "--size", SIZE, "-o", at / "v.ivd")
        ivd(given.ivd, "lattice", at / "v.ivd", "--iso", "128", "-o", at / "l.ivd")
        ivd(given.ivd, "octree", at / "l.ivd", "-o", at / "o.ivd")
        rows = [row for name in SCENES for row in scene(given.ivd, name, at, given)]
    far = [row for row in rows if row["map"] == f"fem, cell {given.edge}" and row["inner"] > given.most]
    sys.exit(1 if far else 0)


if __name__ == "__main__":
    main()
