#!/usr/bin/env python3
"""Fits simulated clouds from fine to noise far wider than their points are apart, and prints what was found.

    noise.py [SHAPE...] [--tool PATH] [--points N...] [--noise PART...] [--outliers SHARE] [--holes N]

Noise is given in parts of the diagonal of the shape's box. A cell holds the noise found in parts of the true one, the
topology if it is not the shape's, and the verdict if it is not pass; or that the scan was refused.
"""
import argparse
import concurrent.futures
import json
import math
import pathlib
import subprocess
import tempfile

TOPOLOGY = {
    "tube": "tube", "pot": "tube", "handle": "tube", "blade": "tube", "ellipsoid": "sphere", "sphere": "sphere",
    "torus": "torus", "saddle": "disk", "patch": "disk", "face": "disk",
}


def called(*command):
    """What a command prints as JSON; None if it refuses."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode == 1:
        return None
    if done.returncode not in (0, 3):
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def simulate(args, shape, points, noise, seed, path):
    subprocess.run(
        [args.tool, "simulate", shape, "--points", str(points), "--noise", str(noise), "--seed", str(seed), "--shuffled",
         "--outliers", str(args.outliers if noise else 0), "--holes", str(args.holes if noise else 0), "-q", "-o", path],
        check=True)


def diagonal(args, shape, folder):
    path = folder / f"{shape}.ply"
    simulate(args, shape, 2000, 0.0, 0, path)
    low, high = called(args.tool, "info", path, "--json")["files"][0]["bounding_box"]
    return math.dist(low, high)


def cell(args, shape, points, noise, folder):
    path = folder / f"{shape}-{points}-{noise}.ply"
    simulate(args, shape, points, noise, 1, path)
    made = called(args.tool, "fit", path, "-o", path.with_suffix(".step"), "--json", "--threads", "1")
    path.unlink()
    path.with_suffix(".step").unlink(missing_ok=True)
    if made is None:
        return "refused"
    said = [f"{made['input']['noise'] / noise:.2f}"]
    if made["surface"]["topology"] != TOPOLOGY[shape]:
        said.append(made["surface"]["topology"])
    if made["verdict"] != "pass":
        said.append(made["verdict"])
    return " ".join(said)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", metavar="SHAPE", help="of " + ", ".join(TOPOLOGY))
    parser.add_argument("--tool", default="nurbskin")
    parser.add_argument("--points", type=int, nargs="+", default=[10_000, 60_000, 300_000])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0005, 0.001, 0.002, 0.004])
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--holes", type=int, default=0)
    args = parser.parse_args()
    if unknown := set(args.shapes) - set(TOPOLOGY):
        parser.error(f"no such shape: {', '.join(sorted(unknown))}")
    columns = [(points, part) for points in args.points for part in args.noise]
    print("| shape | " + " | ".join(f"{points // 1000} k, {1e3 * part:g} e-3" for points, part in columns) + " |")
    print("|---|" + "---|" * len(columns))
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(2) as pool:
        folder = pathlib.Path(name)
        for shape in args.shapes or TOPOLOGY:
            size = diagonal(args, shape, folder)
            cells = pool.map(lambda c: cell(args, shape, c[0], c[1] * size, folder), columns)
            print(f"| {shape} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
