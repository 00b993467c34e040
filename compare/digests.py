#!/usr/bin/env python3
"""Digests of what the command writes, to see that a change of the code changes no output.

    digests.py [--tool PATH] [--data FOLDER] [--only TEXT] > before
    digests.py --tool OTHER ... | diff before -

Fits simulated scans of every shape (exact, with noise, in order, shuffled), `examples/` and all scans under `--data`, and
prints a line for each output: the SHA-256 of STEP and IGES files without their dates, and of the JSON without its times. A
scan that is refused gives the digest of the message. Deterministic for any number of threads.
"""
import argparse
import hashlib
import json
import os
import pathlib
import re
import subprocess
import tempfile

SHAPES = ["pot", "patch", "face", "handle", "sphere", "ellipsoid", "torus", "tube", "saddle", "blade", "plane"]
# What the virtual scanner is told, by name.
SCANS = {
    "ordered": [],
    "shuffled": ["--shuffled", "--points", "4000"],
    "noise 0.02": ["--shuffled", "--points", "4000", "--noise", "0.02"],
    "noise 0.2": ["--shuffled", "--points", "8000", "--noise", "0.2", "--outliers", "0.005", "--holes", "2"],
}
ENDINGS = {".ply", ".xyz", ".obj", ".stl", ".off", ".pcd", ".vtk", ".vtp", ".e57", ".las", ".laz", ".pts", ".ptx", ".txt"}
DATES = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d|\d{8}\.\d{6}")
# Slow without a bound, which the fit reaches.
BOUND = ["--max-control-points", "1600"]


def without_times(value):
    if isinstance(value, dict):
        dropped = {"time", "times", "seconds", "path", "bytes", "replaced"}
        return {k: without_times(v) for k, v in value.items() if k not in dropped}
    if isinstance(value, list):
        return [without_times(v) for v in value]
    return value


def digest(data):
    return hashlib.sha256(data).hexdigest()[:16]


def fit(tool, scan, options, folder):
    """One line: exit code and digests."""
    outputs = [folder / "part.step", folder / "part.igs"]
    for output in outputs:
        output.unlink(missing_ok=True)
    command = [tool, "fit", scan, "-o", outputs[0], "-o", outputs[1], "--json", *options]
    done = subprocess.run([str(c) for c in command], capture_output=True, cwd=folder)
    files = [digest(DATES.sub(b"", o.read_bytes())) if o.exists() else "-" for o in outputs]
    try:
        found = without_times(json.loads(done.stdout))
    except json.JSONDecodeError:
        found = done.stdout.decode(errors="replace")
    text = json.dumps(found, sort_keys=True).replace(str(folder), "")
    return f"exit {done.returncode}  step {files[0]}  iges {files[1]}  json {digest(text.encode())}"


def scans(arguments, folder):
    """Name, path and options of each scan."""
    for shape in SHAPES:
        for name, options in SCANS.items():
            path = folder / f"{shape}.ply"
            command = [arguments.tool, "simulate", shape, "-o", path, "--quiet", *options]
            if arguments.only in f"{shape}, {name}":
                subprocess.run([str(c) for c in command], check=True)
                yield f"{shape}, {name}", path, BOUND
    roots = [pathlib.Path(__file__).resolve().parent.parent / "examples"]
    if arguments.data:
        roots.append(pathlib.Path(arguments.data).resolve())
    for root in roots:
        for path in sorted(p for p in root.rglob("*") if p.suffix.lower() in ENDINGS):
            name = str(path.relative_to(root))
            if arguments.only in name:
                yield name, path, BOUND


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tool", default="target/release/nurbskin", help="the command to run")
    parser.add_argument("--data", default=os.environ.get("NURBSKIN_DATA"), help="folder of real scans")
    parser.add_argument("--only", default="", help="only the scans whose name has this in it")
    arguments = parser.parse_args()
    arguments.tool = pathlib.Path(arguments.tool).resolve()
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        for name, path, options in scans(arguments, folder):
            print(f"{name}: {fit(arguments.tool, path, options, folder)}", flush=True)


if __name__ == "__main__":
    main()
