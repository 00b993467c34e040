#!/usr/bin/env python3
"""scipy's LSQBivariateSpline on the bump of docs/scattered.md: 24 x 24 control points on even knots.

    bump.py [--points N...] [--seeds K]

Prints the largest and the root mean square distance of the exact shape from the surface, across it, in mm, and seconds. The
clouds are drawn as `cargo run --release --example scatter -- --only bump --uniform 21` draws its own, with other numbers.
"""
import argparse
import math
import statistics
import time
import warnings

import numpy as np
from scipy.interpolate import LSQBivariateSpline

SIGMA = 0.05
RADIUS = 50.0
SPANS = 21


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


def run(count, seed):
    chance = np.random.default_rng(seed)
    x, y = disk(count, chance)
    along, across, length = slopes(x, y)
    off = SIGMA * chance.standard_normal(count) / length
    x, y, z = x - off * along, y - off * across, height(x, y) + off
    knots = np.linspace(-RADIUS, RADIUS, SPANS + 1)[1:-1]
    reach = max(RADIUS, np.abs(x).max(), np.abs(y).max())
    start = time.perf_counter()
    surface = LSQBivariateSpline(x, y, z, knots, knots, bbox=[-reach, reach, -reach, reach])
    seconds = time.perf_counter() - start
    x, y = disk(10_000, chance)
    # Nearly the distance: the slopes of surface and shape differ by less than 1 %.
    error = np.abs(surface.ev(x, y) - height(x, y)) / slopes(x, y)[2]
    return len(surface.get_coeffs()), error.max(), math.sqrt(np.mean(error**2)), seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    # Corners of the square hold no points: scipy says so, and goes on.
    warnings.simplefilter("ignore")
    print("| points | control points | max, mm | rms, mm | s |\n|---|---|---|---|---|")
    for count in given.points:
        rows = list(zip(*(run(count, seed) for seed in range(1, given.seeds + 1))))
        columns = [f"{statistics.median(row):.{d}f} ({max(row):.{d}f})" for row, d in zip(rows[1:], (4, 5, 1))]
        print(f"| {count} | {rows[0][0]} | " + " | ".join(columns) + " |", flush=True)


if __name__ == "__main__":
    main()
