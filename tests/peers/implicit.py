"""Implicit steps of masses on springs against other people's: python implicit.py PATH/TO/time_springs [--side N] [--plot FILE]

`cargo build --release -p ivd-deform --example time_springs` makes our side; its head says what the sheet is. A second of it is computed
by our projective descent (implicit Euler), by implicit Euler with SciPy (springs linearised once a step, conjugate gradients on a matrix whose
pattern is made once) and by pypbd (XPBD), each at several steps a second and several tolerances or iterations. The error is the root mean
square difference from explicit steps of 1/20,000 s, as a share of the motion's. pypbd has no drag and can't switch its gravity off, so that it is held
against a motion without the one and with the other. Programs take turns. Prints a Markdown table of all, and for every point of the others the time in
which ours is as near. Needs numpy, scipy, numba and pypbd; matplotlib with --plot.
"""

import argparse

import numpy as np
import scipy.sparse as sparse
from numba import njit
from scipy.sparse.linalg import cg

from springs import DRAG, GROUND, LIFT, RAMP, STIFFNESS, Ours, sheet
from timing import timed

FINEST = 20_000
GRAVITY = -9.81


@njit
def explicit(rest, begin, near, length, middle, hz, drag, gravity):
    """A second of symplectic Euler."""
    at, speed, dt = rest.copy(), np.zeros_like(rest), 1.0 / hz
    for step in range(hz):
        for i in range(len(at)):
            force = -GROUND * (at[i] - rest[i]) - drag * speed[i]
            force[1] += gravity
            for k in range(begin[i], begin[i + 1]):
                way = at[near[k]] - at[i]
                now = np.sqrt((way * way).sum())
                force += STIFFNESS * (now - length[k]) / now * way
            speed[i] += dt * force
        at += dt * speed
        at[middle] = rest[middle]
        at[middle, 2] += LIFT * min(1.0, (step + 1) * dt / RAMP)
        speed[middle] = 0.0
    return at - rest


class Linearised:
    """Implicit Euler, one linear system a step."""

    def __init__(self, rest, edges, length, middle):
        self.rest, self.length, self.middle = rest, length, middle
        self.a, self.b = edges.T
        count = len(rest)
        own = np.arange(count)
        rows = np.concatenate([own, self.a, self.b])
        columns = np.concatenate([own, self.b, self.a])
        # Which block of the sorted matrix each of these is.
        order = np.lexsort((columns, rows))
        self.order = order
        self.columns = columns[order]
        self.begin = np.searchsorted(rows[order], np.arange(count + 1))

    def __call__(self, hz, tolerance):
        rest, a, b, dt = self.rest, self.a, self.b, 1.0 / hz
        count = len(rest)
        at, speed = rest.copy(), np.zeros_like(rest)
        one = np.eye(3)
        for step in range(hz):
            way = at[b] - at[a]
            now = np.linalg.norm(way, axis=1)
            unit = way / now[:, None]
            pull = STIFFNESS * (now - self.length)[:, None] * unit
            force = -GROUND * (at - rest) - DRAG * speed
            for c in range(3):
                force[:, c] += np.bincount(a, pull[:, c], count) - np.bincount(b, pull[:, c], count)
            outer = unit[:, :, None] * unit[:, None, :]
            side = np.maximum(0.0, 1.0 - self.length / now)[:, None, None]
            stiff = STIFFNESS * (outer + side * (one - outer))
            flat = stiff.reshape(-1, 9)
            own = np.stack([np.bincount(a, f, count) + np.bincount(b, f, count) for f in flat.T], axis=1).reshape(-1, 3, 3)
            own += GROUND * one
            blocks = np.concatenate([own, -stiff, -stiff])
            matrix = sparse.bsr_matrix((blocks[self.order], self.columns, self.begin), shape=(3 * count, 3 * count))
            wanted = dt * (force.ravel() - dt * (matrix @ speed.ravel()))
            blocks *= dt * dt
            blocks[:count] += (1.0 + dt * DRAG) * one
            # The middle is moved, not solved for.
            blocks[self.middle] = one
            matrix = sparse.bsr_matrix((blocks[self.order], self.columns, self.begin), shape=(3 * count, 3 * count))
            free = np.ones(3 * count)
            free[3 * self.middle : 3 * self.middle + 3] = 0.0
            system = sparse.linalg.LinearOperator(matrix.shape, lambda v: free * (matrix @ (free * v)) + (1.0 - free) * v)
            change, _ = cg(system, free * wanted, rtol=tolerance, maxiter=1000)
            speed += change.reshape(-1, 3)
            speed[self.middle] = 0.0
            at = at + dt * speed
            at[self.middle] = rest[self.middle]
            at[self.middle, 2] += LIFT * min(1.0, (step + 1) * dt / RAMP)
        return at - rest


class Xpbd:
    """pypbd; home springs are springs to vertices without a mass."""

    def __init__(self, rest, edges, middle):
        import pypbd

        self.pbd, self.rest, self.middle = pypbd, rest, middle
        self.simulation = pypbd.Simulation.getCurrent()
        self.simulation.initDefault()
        self.model = self.simulation.getModel()
        particles = self.model.getParticles()
        for place in np.concatenate([rest, rest]):
            particles.addVertex(place)
        for i in range(len(rest)):
            particles.setMass(i, 0.0 if i == middle else 1.0)
            particles.setMass(len(rest) + i, 0.0)
        for a, b in edges:
            self.model.addDistanceConstraint_XPBD(int(a), int(b), STIFFNESS)
        for i in range(len(rest)):
            self.model.addDistanceConstraint_XPBD(i, len(rest) + i, GROUND)

    def __call__(self, hz, iterations):
        pbd, stepper = self.pbd, self.simulation.getTimeStep()
        stepper.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, 1)
        stepper.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, iterations)
        stepper.setValueInt(pbd.TimeStepController.VELOCITY_UPDATE_METHOD, 0)
        pbd.TimeManager.getCurrent().setTimeStepSize(1.0 / hz)
        self.simulation.reset()
        pbd.TimeManager.getCurrent().setTime(0)
        particles = self.model.getParticles()
        for step in range(hz):
            place = self.rest[self.middle] + [0.0, 0.0, LIFT * min(1.0, (step + 1) / hz / RAMP)]
            particles.setPosition(self.middle, place)
            stepper.step(self.model)
        return np.array([particles.getPosition(i) for i in range(len(self.rest))]) - self.rest


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("time_springs")
    parser.add_argument("--side", type=int, default=50)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--plot")
    given = parser.parse_args()

    side = given.side
    rest, begin, near, length, _ = sheet(side)
    middle = side // 2 * (side + 1)
    owner = np.repeat(np.arange(len(rest)), np.diff(begin))
    once = owner < near
    edges = np.stack([owner[once], near[once]], axis=1)
    truth = explicit(rest, begin, near, length, middle, FINEST, DRAG, 0.0)
    fallen = explicit(rest, begin, near, length, middle, FINEST, 0.0, GRAVITY)
    half = explicit(rest, begin, near, length, middle, FINEST // 2, DRAG, 0.0)
    size = lambda moved: np.sqrt((moved**2).sum(1).mean())
    print(f"{side}² vertices; the truth differs from twice its step by {size(half - truth) / size(truth):.1e} of the motion\n")

    ours = Ours(given.time_springs, side, 1, 1)
    linear, xpbd = Linearised(rest, edges, length[once], middle), Xpbd(rest, edges, middle)

    def mine(hz, tolerance):
        told = ours(f"{hz} {tolerance}")
        return np.array(told["moved"]), np.array([told["wall_s"], told["cpu_s"]])

    points = []
    for hz in (15, 30, 60, 120, 240, 480):
        for tolerance in (1e-1, 1e-2, 1e-3, 1e-4):
            points.append(("ours", f"{hz} Hz, {tolerance:g}", lambda h=hz, t=tolerance: mine(h, t), truth))
        for tolerance in (1e-2, 1e-5):
            points.append(("SciPy", f"{hz} Hz, {tolerance:g}", lambda h=hz, t=tolerance: timed(lambda: linear(h, t)), truth))
        for iterations in (1, 5, 20):
            points.append(("pypbd", f"{hz} Hz, {iterations}", lambda h=hz, n=iterations: timed(lambda: xpbd(h, n)), fallen))
    times, errors = [[] for _ in points], [0.0] * len(points)
    for turn in range(given.turns + 1):
        for i, (_, _, work, right) in enumerate(points):
            moved, time = work()
            errors[i] = size(moved - right) / size(right)
            if turn > 0:
                times[i].append(time)
    ours.close()
    times = np.array([np.median(t, axis=0) for t in times])
    own = [i for i, p in enumerate(points) if p[0] == "ours"]
    print("| program | steps a second; tolerance or iterations | error | wall (s) | processor (s) | ours as near: processor (s) | × |")
    print("|---|---|---|---|---|---|---|")
    below = True
    for i, (program, words, _, _) in enumerate(points):
        wall, cpu = times[i]
        told = "|  |  |"
        if program != "ours":
            near_enough = [times[k][1] for k in own if errors[k] <= errors[i]]
            least = min(near_enough, default=np.inf)
            told = f"| {least:.3f} | {cpu / least:.1f} |"
            below &= least < cpu
        print(f"| {program} | {words} | {errors[i]:.1e} | {wall:.3f} | {cpu:.3f} {told}")
    print("\nours is below the others everywhere" if below else "\nours is NOT below the others everywhere")
    if given.plot:
        plot(points, times, errors, given.plot)


def plot(points, times, errors, path):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "ivd"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6.4, 4.2), layout="constrained")
    for program, marker in (("ours", "o"), ("SciPy", "s"), ("pypbd", "^")):
        of = [i for i, p in enumerate(points) if p[0] == program]
        axes.loglog([times[i][1] for i in of], [errors[i] for i in of], marker, label=program)
    axes.set_xlabel("processor time of a second of motion (s)")
    axes.set_ylabel("error, of the motion")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
