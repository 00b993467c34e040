#!/usr/bin/env python3
"""The bump of docs/scattered.md by scipy's LSQBivariateSpline and by nurbskin, on the same clouds, with even knots.

    cargo build --release --example compare
    bump.py [--points N...] [--seeds K] [--spans 21 | --spans 0] [--ours PATH]

scipy has 24 x 24 control points. nurbskin has as many, or with `--spans 0` as many as it chooses. Prints the largest and the
root mean square distance of the exact shape from the surface, across it, in mm, on the disk and away from its border, and
seconds. Both have the places of the points as parameters.
"""
import argparse
import math
import os
import statistics
import subprocess
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, LSQBivariateSpline

SIGMA = 0.05
RADIUS = 50.0
SPANS = 21
# Places farther out are near the border: one span of the knots.
INSIDE = RADIUS * (1 - 2 / SPANS)
TOLERANCE = 0.15
OURS = Path(__file__).resolve().parent.parent / "target" / "release" / "examples" / "compare"


def height(x, y):
    waves = np.sin(2 * math.pi * x / 40) * np.cos(2 * math.pi * y / 35)
    return 20 * np.cos(math.pi * np.hypot(x, y) / 120) + 3 * waves


def slopes(x, y):
    step = 1e-5
    along = (height(x + step, y) - height(x - step, y)) / (2 * step)
    across = (height(x, y + step) - height(x, y - step)) / (2 * step)
    return along, across, np.sqrt(1 + along**2 + across**2)


def disk(count, chance):
    """Places spread evenly over a disk."""
    radius, angle = RADIUS * np.sqrt(chance.random(count)), 2 * math.pi * chance.random(count)
    return radius * np.cos(angle), radius * np.sin(angle)


def scipys(points, places):
    """Distances at the places, control points, seconds."""
    x, y, z = points
    knots = np.linspace(-RADIUS, RADIUS, SPANS + 1)[1:-1]
    reach = max(RADIUS, np.abs(x).max(), np.abs(y).max())
    start = time.perf_counter()
    surface = LSQBivariateSpline(x, y, z, knots, knots, bbox=[-reach, reach, -reach, reach])
    seconds = time.perf_counter() - start
    x, y = places
    # Nearly the distance: the slopes of surface and shape differ by less than 1 %.
    return (surface.ev(x, y) - height(x, y)) / slopes(x, y)[2], len(surface.get_coeffs()), seconds


def ours(points, places, spans, tool):
    """The same for nurbskin."""
    place = lambda t: np.clip(t / (2 * RADIUS) + 0.5, 0, 1)
    rows = np.stack([*points, place(points[0]), place(points[1])], axis=-1)
    with tempfile.TemporaryDirectory() as folder:
        source, result = os.path.join(folder, "in"), os.path.join(folder, "out")
        np.concatenate([[TOLERANCE, 2 * RADIUS, 2 * RADIUS], rows.ravel()]).tofile(source)
        command = [tool, "cloud", source, str(spans), result, "1", "1"]
        made = subprocess.run(command, check=True, capture_output=True, text=True)
        numbers = np.fromfile(result)
    m, n = int(numbers[0]), int(numbers[1])
    along, across, net = np.split(numbers[2:], [m + 4, m + n + 8])
    net = net.reshape(n, m, 3)
    x, y = places
    u = BSpline.design_matrix(place(x), along, 3).toarray()
    v = BSpline.design_matrix(place(y), across, 3).toarray()
    off = np.einsum("ki,kj,jid->kd", u, v, net, optimize=True) - np.stack([x, y, height(x, y)], axis=-1)
    fx, fy, length = slopes(x, y)
    normal = np.stack([-fx, -fy, np.ones_like(x)], axis=-1) / length[:, None]
    return (off * normal).sum(axis=-1), m * n, float(made.stdout.split()[1])


def run(count, seed, spans, tool):
    chance = np.random.default_rng(seed)
    x, y = disk(count, chance)
    along, across, length = slopes(x, y)
    off = SIGMA * chance.standard_normal(count) / length
    points = x - off * along, y - off * across, height(x, y) + off
    places = disk(4000, chance)
    inside = np.hypot(*places) <= INSIDE
    made = {"scipy": scipys(points, places), "nurbskin": ours(points, places, spans, tool)}
    level = lambda error: math.sqrt(np.mean(error**2))
    return {
        who: (size, np.abs(error).max(), level(error), np.abs(error[inside]).max(), level(error[inside]), seconds)
        for who, (error, size, seconds) in made.items()
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--spans", type=int, default=SPANS)
    parser.add_argument("--ours", default=str(OURS))
    given = parser.parse_args()
    # Corners of the square hold no points: scipy says so, and goes on.
    warnings.simplefilter("ignore")
    print("| points | by | control points | max, mm | rms, mm | inside: max | rms | s |\n|---|---|---|---|---|---|---|---|")
    for count in given.points:
        made = [run(count, seed, given.spans, given.ours) for seed in range(1, given.seeds + 1)]
        for who in ("scipy", "nurbskin"):
            rows = list(zip(*(of[who] for of in made)))
            digits = (0, 4, 5, 4, 5, 2)
            columns = [f"{statistics.median(row):.{d}f} ({max(row):.{d}f})" for row, d in zip(rows, digits)]
            print(f"| {count} | {who} | " + " | ".join(columns) + " |", flush=True)


if __name__ == "__main__":
    main()
