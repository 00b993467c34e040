#!/usr/bin/env python3
"""Distances of random places from CAD files, by nurbskin and by OpenCascade (BRepExtrema).

    closest.py FILE... [--points N] [--seed N] [--tool PATH]

The places fill the box around the shape, a tenth wider on each side. A row has, in parts of the box's diagonal, how far
ours is above and below OpenCascade's at worst, and the widest certified bracket; then the microseconds a place of both, the
start of our program included. OpenCascade may stop early, or measure to edges that lie beside their faces: then ours is
the smaller one. The exit status is 1 if ours is anywhere larger by more than 1e-9 of the diagonal and its bracket.

Needs numpy and cadquery-ocp.
"""
import argparse
import csv
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt

import cad

ABOVE = 1e-9


def ours(tool, path, places):
    """Distances and brackets, and the seconds they took."""
    with tempfile.TemporaryDirectory() as folder:
        scan, report = pathlib.Path(folder, "places.xyz"), pathlib.Path(folder, "places.csv")
        np.savetxt(scan, places, fmt="%.17g")
        start = time.perf_counter()
        command = [tool, "deviation", scan, path, "--unit", "mm", "-t", "1", "--quiet", "--report", report]
        done = subprocess.run(command, capture_output=True, text=True)
        seconds = time.perf_counter() - start
        if done.returncode not in (0, 3):
            raise ValueError(done.stderr.strip())
        with open(report, newline="") as file:
            rows = list(csv.DictReader(file))
    distances, lower = (np.array([abs(float(row[key])) for row in rows]) for key in ("deviation", "lower"))
    return distances, distances - lower, seconds


def theirs(shape, places):
    start = time.perf_counter()
    vertices = [BRepBuilderAPI_MakeVertex(gp_Pnt(*p)).Vertex() for p in places]
    distances = [BRepExtrema_DistShapeShape(shape, vertex).Value() for vertex in vertices]
    return np.array(distances), time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    parser.add_argument("--points", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tool", help="the nurbskin program")
    options = parser.parse_args()
    tool = cad.tool_of(options) or parser.error("no nurbskin program: give --tool")
    print("| file | above | below | bracket | us a place | OpenCascade |\n|---|--:|--:|--:|--:|--:|")
    good = True
    for path in options.files:
        with cad.silence():
            shape = cad.read(path)
            low, high = cad.box_of(shape)
        size = np.linalg.norm(high - low)
        random = np.random.default_rng(options.seed)
        places = low + (high - low) * (1.2 * random.random((options.points, 3)) - 0.1)
        mine, bracket, seconds = ours(tool, path, places)
        reference, their_seconds = theirs(shape, places)
        off = (mine - reference) / size
        good &= bool((off <= ABOVE + bracket / size).all())
        each = [1e6 * s / len(places) for s in (seconds, their_seconds)]
        print(f"| {path.name} | {max(off.max(), 0):.0e} | {max(-off.min(), 0):.0e} | {bracket.max() / size:.0e} "
              f"| {each[0]:.0f} | {each[1]:.0f} |", flush=True)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
