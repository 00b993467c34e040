#!/usr/bin/env python3
"""Divides meshes into four-sided cells with nurbskin, Instant Meshes and QuadriFlow, and prints what each layout is worth.

    layouts.py FILE...    [--tool PATH] [-t TOLERANCE] [--repeat N] [--markdown]

nurbskin fits a network of faces (`--layout network`); its cells are the faces of the STEP file. The peers are asked for as many
cells, on the same mesh, each point once. They make no surface: the time of nurbskin is that of its whole command, and of the
stage that makes the layouts, fits, mends and bounds it (`fit`).

A layout is valid where each cell has four corners, no side belongs to more than two cells, the cells around each corner form one
fan, and its Euler number and its number of borders are those of our network, which is validated against the mesh in the fit. Extraordinary are corners off borders with other than four cells, on borders with other than two.

Needs numpy, trimesh, pynanoinstantmeshes and pyQuadriFlow; a peer that is not installed is skipped. The tool is looked for in
target/release, then in PATH. Each run of a peer is a process of its own; its times are medians, and count from the arrays to the
cells.
"""
import argparse
import collections
import importlib.util
import json
import math
import multiprocessing
import os
import pathlib
import queue
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
import trimesh

# Seconds that a peer may take.
LIMIT = 60
PACKAGES = {"Instant Meshes": "pynanoinstantmeshes", "QuadriFlow": "pyQuadriFlow"}
ROOT = pathlib.Path(__file__).resolve().parent.parent


def tool():
    built = ROOT / "target" / "release" / "nurbskin"
    return str(built) if built.exists() else shutil.which("nurbskin")


def network(path, binary, tolerance):
    """The cells of our network as corners, the seconds of the command and of its fit, and the verdict."""
    with tempfile.TemporaryDirectory() as folder:
        step = pathlib.Path(folder) / "network.step"
        command = [binary, "fit", path, "-o", str(step), "--layout", "network", "--json", "--quiet", "-t", tolerance]
        start = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        seconds = time.perf_counter() - start
        if not step.exists():
            print(f"{path}: nurbskin: {done.stderr.strip()}", file=sys.stderr)
            return None
        report = json.loads(done.stdout)
        return cells_of(step.read_text()), seconds, report


def cells_of(text):
    """The corners of the faces of a STEP file, by the numbers of their vertices."""
    entity = dict(re.findall(r"#(\d+)\s*=\s*([A-Z_0-9]+\s*\(.*?\))\s*;", text, re.DOTALL))
    numbers = {key: re.findall(r"#(\d+)", value) for key, value in entity.items()}
    start = {}
    for key, value in entity.items():
        if value.startswith("ORIENTED_EDGE"):
            edge = numbers[key][0]
            first, last = numbers[edge][:2]
            start[key] = last if re.search(r"\.F\.\s*\)$", value) else first
    loops = [numbers[k] for k, value in entity.items() if value.startswith("EDGE_LOOP")]
    names = {name: i for i, name in enumerate(sorted({start[use] for loop in loops for use in loop}))}
    return [[names[start[use]] for use in loop] for loop in loops]


def instant_meshes(mesh, count):
    """It divides each of the cells that it is asked for in four."""
    import pynanoinstantmeshes

    found = pynanoinstantmeshes.remesh(
        mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32), -1, face_count=max(count // 4, 1),
        align_to_boundaries=True, deterministic=True,
    )  # fmt: skip
    return np.asarray(found[1]).tolist()


def quadriflow(mesh, count):
    from pyQuadriFlow import pyQuadriFlow

    flags = {name: False for name in ["adaptive_scale", "aggresive_sat", "minimum_cost_flow"]}
    flags |= {"preserve_sharp": True, "preserve_boundary": True}
    found = pyQuadriFlow.pyquadriflow(
        count, 0, mesh.vertices.tolist(), mesh.faces.tolist(), **{f"flag_{name}": value for name, value in flags.items()}
    )
    return found["faces"]


def taken(divide, mesh, count, results):
    """Runs a peer in a process of its own, which it may take down. Its output is discarded."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    start = time.perf_counter()
    cells = divide(mesh, count)
    results.put((cells, time.perf_counter() - start))


def peer(divide, mesh, count):
    """The cells of a peer and its seconds; none where it failed or took more than `LIMIT` seconds."""
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    process = context.Process(target=taken, args=(divide, mesh, count, results))
    process.start()
    try:
        deadline = time.perf_counter() + LIMIT
        while time.perf_counter() < deadline:
            try:
                return results.get(timeout=0.2)
            except queue.Empty:
                if not process.is_alive():
                    break
        return [], math.nan
    finally:
        process.kill()
        process.join()


def figures(cells):
    """What is wrong with a layout (nothing: an empty list), its Euler number, borders and share of extraordinary corners."""
    wrong = []
    if any(len(set(cell)) != 4 for cell in cells):
        wrong.append("cells without four corners")
    uses, fans = collections.Counter(), collections.defaultdict(list)
    for cell in cells:
        for k, corner in enumerate(cell):
            after, before = cell[(k + 1) % len(cell)], cell[k - 1]
            uses[frozenset((corner, after))] += 1
            fans[corner].append((before, after))
    if any(count > 2 for count in uses.values()):
        wrong.append("sides of three cells")
    rims = {corner for side, count in uses.items() if count == 1 for corner in side}
    extraordinary = 0
    for corner, fan in fans.items():
        if not is_fan(fan):
            wrong.append("corners with several fans")
        extraordinary += len(fan) != (2 if corner in rims else 4)
    euler = len(fans) - len(uses) + len(cells)
    return sorted(set(wrong)), euler, borders(uses), extraordinary / max(len(fans), 1)


def is_fan(fan):
    """Whether the cells around a corner, each given by its two neighbours along the sides, are one fan."""
    beside = collections.defaultdict(set)
    for a, b in fan:
        beside[a].add(b)
        beside[b].add(a)
    seen, todo = set(), [fan[0][0]]
    while todo:
        at = todo.pop()
        if at not in seen:
            seen.add(at)
            todo += beside[at]
    return len(seen) == len(beside)


def borders(uses):
    """The number of loops of sides of one cell."""
    beside = collections.defaultdict(set)
    for side, count in uses.items():
        if count == 1 and len(side) == 2:
            a, b = side
            beside[a].add(b)
            beside[b].add(a)
    count, seen = 0, set()
    for first in beside:
        if first in seen:
            continue
        count += 1
        todo = [first]
        while todo:
            at = todo.pop()
            if at not in seen:
                seen.add(at)
                todo += beside[at]
    return count


def row(name, method, cells, seconds, wanted, more):
    if not cells:
        return [name, method, "0", "nothing", "-", seconds, more]
    wrong, euler, rims, extraordinary = figures(cells)
    if (euler, rims) != wanted:
        wrong.append(f"Euler number {euler}, {rims} borders; the part has {wanted[0]}, {wanted[1]}")
    return [name, method, str(len(cells)), "; ".join(wrong) or "yes", f"{extraordinary:.0%}", seconds, more]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--tool", default=tool())
    parser.add_argument("-t", "--tolerance", default="0.1%")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    if not options.tool:
        sys.exit("nurbskin is neither in target/release nor in PATH: name it with --tool")
    head = ["mesh", "method", "cells", "valid", "extraordinary", "s", "surface"]
    rows = []
    for path in options.files:
        name = pathlib.Path(path).stem
        mesh = trimesh.load(path, force="mesh", process=True)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        found = network(path, options.tool, options.tolerance)
        if found is None:
            continue
        cells, seconds, report = found
        # What the network was made of: its own topology, which its validator holds against the mesh.
        _, euler, rims, _ = figures(cells)
        wanted = (euler, rims)
        surface, fit = report["surface"], report["time"]["fit"]
        within = report["deviation"]["scan_to_surface"].get("within_tolerance")
        more = f"{surface['control_points'][0]} control points, {within:.2%} within, {report['verdict']}"
        rows.append(row(name, "nurbskin", cells, f"{seconds:.2f} (fit {fit:.2f})", wanted, more))
        for method, divide in [("Instant Meshes", instant_meshes), ("QuadriFlow", quadriflow)]:
            if importlib.util.find_spec(PACKAGES[method]) is None:
                print(f"skipped: {method}: {PACKAGES[method]} is not installed", file=sys.stderr)
                continue
            runs = [peer(divide, mesh, len(cells)) for _ in range(options.repeat)]
            other, times = runs[0][0], [seconds for _, seconds in runs]
            rows.append(row(name, method, other, f"{statistics.median(times):.2f}", wanted, "none"))
    if options.markdown:
        print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
        for line in rows:
            print("| " + " | ".join(line) + " |")
    else:
        for line in [head, *rows]:
            print("  ".join(line))


if __name__ == "__main__":
    main()
