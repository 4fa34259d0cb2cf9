"""Explicit steps of masses on springs against a plain loop that numba compiles: python springs.py PATH/TO/measure [options]

`cargo build --release -p ivd-bench --example measure` makes our side; its head says what the sheet is. The loop goes over the
vertices and their neighbours in double precision, on one thread and on two; both programs take turns, --turns times, with the same sheet and
steps. First the displacements after 1,000 steps are compared. Prints a Markdown table: springs a second of ours over the loop's
in wall and in processor time, as the median of the turns' ratios with the least and the most. Needs numpy and numba.
"""

import argparse
import json
import subprocess
import time

import numpy as np
from numba import njit, prange, set_num_threads

STIFFNESS, GROUND, DRAG, STEP, LIFT, RAMP = 1000.0, 5.0, 2.0, 1 / 240, 5.0, 0.2


def sheet(side):
    """Rest positions, and neighbours of each vertex as one list with the places where its own begin."""
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    rest = np.stack([x.ravel(), y.ravel(), np.zeros(side * side)], axis=1).astype(float)
    number = np.arange(side * side).reshape(side, side)
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:]), (number[:-1, :-1], number[1:, 1:])]
    edges = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    begin = np.searchsorted(both[:, 0], np.arange(side * side + 1))
    length = np.linalg.norm(rest[both[:, 0]] - rest[both[:, 1]], axis=1)
    return rest, begin, both[:, 1].copy(), length, len(edges)


@njit(parallel=True)
def run(rest, begin, near, length, middle, steps):
    at, speed, force = rest.copy(), np.zeros_like(rest), np.zeros_like(rest)
    for step in range(steps):
        for i in prange(len(at)):
            fx, fy, fz = -GROUND * (at[i, 0] - rest[i, 0]), -GROUND * (at[i, 1] - rest[i, 1]), -GROUND * (at[i, 2] - rest[i, 2])
            for k in range(begin[i], begin[i + 1]):
                j = near[k]
                x, y, z = at[j, 0] - at[i, 0], at[j, 1] - at[i, 1], at[j, 2] - at[i, 2]
                now = np.sqrt(x * x + y * y + z * z)
                pull = STIFFNESS * (now - length[k]) / now
                fx, fy, fz = fx + pull * x, fy + pull * y, fz + pull * z
            force[i, 0], force[i, 1], force[i, 2] = fx, fy, fz
        for i in prange(len(at)):
            for a in range(3):
                speed[i, a] += STEP * (force[i, a] - DRAG * speed[i, a])
                at[i, a] += STEP * speed[i, a]
        at[middle] = rest[middle]
        at[middle, 2] += LIFT * min(1.0, (step + 1) * STEP / RAMP)
        speed[middle] = 0.0
    return at - rest


class Ours:
    def __init__(self, program, side, steps, threads, *others):
        words = [program, "springs", str(side), str(steps), str(threads), *map(str, others)]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self, asked=""):
        self.process.stdin.write(asked + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def spread(ratios):
    return f"{np.median(ratios):.2f} ({min(ratios):.2f}–{max(ratios):.2f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measure")
    parser.add_argument("--sides", type=int, nargs="+", default=[50, 100, 200, 400])
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--turns", type=int, default=7)
    given = parser.parse_args()

    side = 50
    rest, begin, near, length, _ = sheet(side)
    ours = Ours(given.measure, side, 1000, 1)
    apart = np.abs(np.array(ours()["moved"]) - run(rest, begin, near, length, side // 2 * (side + 1), 1000)).max()
    ours.close()
    print(f"after 1,000 steps of {side}² vertices displacements differ by {apart:.1e} mm at most\n")
    assert apart < 1e-4

    print("| vertices | threads | ours, the loop (million springs a second) | wall | processor |")
    print("|---|---|---|---|---|")
    for side in given.sides:
        rest, begin, near, length, springs = sheet(side)
        for threads in (1, 2):
            set_num_threads(threads)
            ours = Ours(given.measure, side, given.steps, threads)
            turn = lambda: run(rest, begin, near, length, side // 2 * (side + 1), given.steps)
            ours(), turn()
            rows = []
            for _ in range(given.turns):
                mine = ours()
                wall, cpu = time.perf_counter(), time.process_time()
                turn()
                rows.append((mine["wall_s"], mine["cpu_s"], time.perf_counter() - wall, time.process_time() - cpu))
            ours.close()
            rows = np.array(rows)
            rates = [given.steps * springs / np.median(rows[:, a]) / 1e6 for a in (0, 2)]
            print(
                f"| {side * side:,} | {threads} | {rates[0]:.0f}, {rates[1]:.0f} | {spread(rows[:, 2] / rows[:, 0])} | "
                f"{spread(rows[:, 3] / np.maximum(rows[:, 1], 1e-9))} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
