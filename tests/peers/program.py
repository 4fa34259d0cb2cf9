"""The program as the other scripts run and read it; imported by them."""

import json
import subprocess

import numpy as np


def ivd(program, *arguments):
    """What the program says of itself, as JSON."""
    words = [program, *map(str, arguments), "--progress", "never", "--cache", "off", "--json"]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"ivd {' '.join(map(str, arguments))}: exit {done.returncode}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def vectors(path):
    """The vectors of an NRRD file as the program writes it (mm, RAS), by x, y and z."""
    head, _, raw = path.read_bytes().partition(b"\n\n")
    sizes = next(line for line in head.decode().splitlines() if line.startswith("sizes:")).split()[2:]
    field = np.frombuffer(raw, "<f4").reshape([*map(int, sizes[::-1]), 3])
    return field.transpose(2, 1, 0, 3).astype(float) * [-1.0, -1.0, 1.0]
