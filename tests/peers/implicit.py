"""Implicit steps of masses on springs against other people's: python implicit.py PATH/TO/measure [--side N] [--stiffness N/m] [--plot FILE]

`cargo build --release -p ivd-bench --example measure` makes our side; its head says what the sheet is. A second of it is computed
by our projective descent (implicit Euler, on one thread), by implicit Euler with SciPy (springs linearised once a step, conjugate gradients on a
matrix whose pattern is made once) and by pypbd (XPBD, on as many threads as it takes), each at several steps a second and several tolerances or
iterations. What each prepares once (our factored matrix, the others' lists) isn't timed. The error is the root mean square difference from short explicit steps, as a share of the motion's. pypbd has no drag and can't switch
its gravity off: both are put right in its velocities between steps, and only its steps are timed. Programs take turns. Prints a Markdown table of all,
and for every point of the others the time in which ours is as near. Needs numpy, scipy, numba and pypbd; matplotlib with --plot.
"""

import argparse

import numpy as np
import scipy.sparse as sparse
from numba import njit
from scipy.sparse.linalg import cg

from springs import DRAG, GROUND, LIFT, RAMP, Ours, sheet
from timing import clock, timed

FINEST = 20_000
GRAVITY = np.array([0.0, -9.81, 0.0])


@njit
def explicit(rest, begin, near, length, stiffness, middle, hz):
    """A second of symplectic Euler."""
    at, speed, dt = rest.copy(), np.zeros_like(rest), 1.0 / hz
    for step in range(hz):
        for i in range(len(at)):
            force = -GROUND * (at[i] - rest[i]) - DRAG * speed[i]
            for k in range(begin[i], begin[i + 1]):
                way = at[near[k]] - at[i]
                now = np.sqrt((way * way).sum())
                force += stiffness * (now - length[k]) / now * way
            speed[i] += dt * force
        at += dt * speed
        at[middle] = rest[middle]
        at[middle, 2] += LIFT * min(1.0, (step + 1) * dt / RAMP)
        speed[middle] = 0.0
    return at - rest


class Linearised:
    """Implicit Euler, one linear system a step."""

    def __init__(self, rest, edges, length, stiffness, middle):
        self.rest, self.length, self.stiffness, self.middle = rest, length, stiffness, middle
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
            pull = self.stiffness * (now - self.length)[:, None] * unit
            force = -GROUND * (at - rest) - DRAG * speed
            for c in range(3):
                force[:, c] += np.bincount(a, pull[:, c], count) - np.bincount(b, pull[:, c], count)
            outer = unit[:, :, None] * unit[:, None, :]
            side = np.maximum(0.0, 1.0 - self.length / now)[:, None, None]
            stiff = self.stiffness * (outer + side * (one - outer))
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

    def __init__(self, rest, edges, stiffness, middle):
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
            self.model.addDistanceConstraint_XPBD(int(a), int(b), stiffness)
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
        count, took = len(self.rest), np.zeros(2)
        for step in range(hz):
            place = self.rest[self.middle] + [0.0, 0.0, LIFT * min(1.0, (step + 1) / hz / RAMP)]
            particles.setPosition(self.middle, place)
            for i in range(count):
                if i != self.middle:
                    speed = np.array(particles.getVelocity(i))
                    particles.setVelocity(i, speed / (1.0 + DRAG / hz) - GRAVITY / hz)
            began = clock()
            stepper.step(self.model)
            took += clock() - began
        moved = np.array([particles.getPosition(i) for i in range(count)]) - self.rest
        return moved, took


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measure")
    parser.add_argument("--side", type=int, default=50)
    parser.add_argument("--stiffness", type=float, default=1.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--plot")
    given = parser.parse_args()

    side = given.side
    rest, begin, near, length, _ = sheet(side)
    middle = side // 2 * (side + 1)
    owner = np.repeat(np.arange(len(rest)), np.diff(begin))
    once = owner < near
    edges = np.stack([owner[once], near[once]], axis=1)
    # N/m are g/s².
    stiffness, finest = 1e3 * given.stiffness, round(FINEST * max(1.0, given.stiffness) ** 0.5)
    truth = explicit(rest, begin, near, length, stiffness, middle, finest)
    half = explicit(rest, begin, near, length, stiffness, middle, finest // 2)
    size = lambda moved: np.sqrt((moved**2).sum(1).mean())
    print(f"{side}² vertices; the truth differs from twice its step by {size(half - truth) / size(truth):.1e} of the motion\n")

    ours = Ours(given.measure, side, 1, 1, given.stiffness)
    linear, xpbd = Linearised(rest, edges, length[once], stiffness, middle), Xpbd(rest, edges, stiffness, middle)

    def mine(hz, tolerance):
        told = ours(f"{hz} {tolerance}")
        return np.array(told["moved"]), np.array([told["wall_s"], told["cpu_s"]])

    points = []
    for hz in (15, 30, 60, 120, 240, 480, 960):
        for tolerance in (1e-1, 1e-2, 1e-3):
            points.append(("ours", f"{hz} Hz, {tolerance:g}", lambda h=hz, t=tolerance: mine(h, t)))
        if hz == 960:
            break
        for tolerance in (1e-2, 1e-5):
            points.append(("SciPy", f"{hz} Hz, {tolerance:g}", lambda h=hz, t=tolerance: timed(lambda: linear(h, t))))
        for iterations in (1, 5, 20):
            points.append(("pypbd", f"{hz} Hz, {iterations}", lambda h=hz, n=iterations: xpbd(h, n)))
    times, errors = [[] for _ in points], [0.0] * len(points)
    for turn in range(given.turns + 1):
        for i, (_, _, work) in enumerate(points):
            moved, time = work()
            errors[i] = size(moved - truth) / size(truth)
            if turn > 0:
                times[i].append(time)
    ours.close()
    times = np.array([np.median(t, axis=0) for t in times])
    own = [i for i, p in enumerate(points) if p[0] == "ours"]
    print("| program | steps a second; tolerance or iterations | error | wall (s) | processor (s) | ours as near: processor (s) | × |")
    print("|---|---|---|---|---|---|---|")
    below = True
    for i, (program, words, _) in enumerate(points):
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
