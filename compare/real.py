#!/usr/bin/env python3
"""Fits real scans without a flag and prints a table: what was found, how close, how fair, how fast.

    real.py DATA [NAME...]  [--tool PATH] [--judge JUDGE.PY --python PYTHON] [--max-control-points N] [--out FOLDER]

DATA is a folder of scans (tubes/, pots/, faces/, ...); with NAMEs only scans whose path contains one of them are fitted.
With --judge the written file is measured by an independent program (both directions, folds, unsupported area), whose
figures then fill the table; without, the tool's own do. Lengths are in 1e-3 of the scan's bounding-box diagonal.
"""
import argparse
import json
import math
import pathlib
import subprocess
import sys
import time

SCANS = [
    "faces/fran_cut.ply",
    "faces/rvcg_humface.ply",
    "faces/lee_perry_smith_head.ply",
    "tubes/ycb_mustard_body_crop.ply",
    "tubes/ycb_mustard_body_crop.xyz",
    "tubes/ycb_mustard_bottle.obj",
    "tubes/ycb_banana.obj",
    "tubes/aorta2.stl",
    "pots/plastic_vase.ply",
    "pots/sea_vase.ply",
    "pots/ycb_bowl_16k.stl",
    "pots/ycb_tomato_soup_can.obj",
    "pots/ycb_master_chef_can.obj",
    "patches/neon_side_panel.off",
    "patches/gismo_deepdrawingC_xyzuv.txt",
    "organised/stanford_bun000.ply",
    "organised/stanford_bun090.ply",
    "organised/stanford_bun180.ply",
    "organised/stanford_bun270.ply",
    "classics/stanford_bun_zipper.ply",
    "classics/cgal_kitten_normals.xyz",
    "classics/fandisk.obj",
]


def fitted(tool, scan, output, options):
    """The tool's JSON, or what it said instead; and the seconds of the whole command."""
    start = time.monotonic()
    command = [tool, "fit", str(scan), "-o", str(output), "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    seconds = time.monotonic() - start
    if done.returncode in (0, 3):
        return json.loads(done.stdout), seconds
    return done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit {done.returncode}", seconds


def judged(python, judge, output, scan):
    command = [python, judge, str(output), str(scan), "--unit-scale", "auto", "--json", "--no-fairness"]
    done = subprocess.run(command, capture_output=True, text=True)
    try:
        return json.loads(done.stdout)
    except json.JSONDecodeError:
        return {"verdict": "unreadable", "said": done.stderr.strip()[-200:]}


def own(result, diagonal):
    there, back = result["deviation"]["scan_to_surface"], result["deviation"]["surface_to_scan"]
    return {
        "there": [1e3 * there[k] / diagonal for k in ("p50", "p95", "max")],
        "back": [1e3 * back[k] / diagonal for k in ("p95", "max")],
        "unsupported": 100 * back["unsupported_area"],
        "folds": None,
    }


def independent(verdict):
    there, back = verdict["scan_to_surface"]["all"], verdict["surface_to_scan"]
    # The judge gives lengths in the scan's unit, and some of them as parts of the diagonal, too.
    diagonal = there["p95"] / there["of_diag"]["p95"] if there["of_diag"]["p95"] else math.nan
    share = lambda stats, key: 1e3 * stats[key] / diagonal
    return {
        "there": [share(there, k) for k in ("p50", "p95", "max")],
        "back": [share(back, k) for k in ("p95", "max")],
        "unsupported": 100 * back["unsupported_area"],
        "folds": None if back.get("folds") is None else 100 * back["folds"],
    }


def row(name, result, figures, seconds):
    surface = result["surface"]
    shape, count = surface["topology"], str(math.prod(surface["control_points"]))
    if surface["layout"] == "network":
        shape = f"network of {surface['faces']} faces"
    else:
        count += " ({}x{})".format(*surface["control_points"])
    parts = f" (+{len(result['parts']) - 1} parts)" if result.get("parts") else ""
    folds = "-" if figures["folds"] is None else f"{figures['folds']:.2f}"
    there = " / ".join(f"{x:.3g}" for x in figures["there"])
    back = " / ".join(f"{x:.3g}" for x in figures["back"])
    unit = result["input"]["unit"]
    p95 = f"{result['deviation']['scan_to_surface']['p95']:.3g} {unit}"
    return (f"| {name} | {shape}{parts} | {count} | {there} | {p95} | {back} | "
            f"{figures['unsupported']:.2f} | {folds} | {seconds:.1f} | {result['verdict']} |")


HEADER = """\
| scan | topology | control points | to surface p50 / p95 / max | p95 | to scan p95 / max | bare % | folds % | s | verdict |
|---|---|---|---|---|---|---|---|---|---|"""


def refused(name, why, seconds):
    return f"| {name} | refused: {why} | | | | | | | {seconds:.1f} | |"


def judged_row(name, result, verdict, seconds):
    if "scan_to_surface" not in verdict:
        return f"| {name} | judge: {verdict} | | | | | | | {seconds:.1f} | {result['verdict']} |"
    return row(name, result, independent(verdict), seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--tool", default="target/release/nurbskin")
    parser.add_argument("--judge")
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--max-control-points", type=int)
    parser.add_argument("--format", default="igs")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("target/real"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    budget = arguments.max_control_points
    options = ["--max-control-points", str(budget)] if budget else []
    print(HEADER)
    for name in SCANS:
        if arguments.names and not any(part in name for part in arguments.names):
            continue
        scan = arguments.data / name
        output = arguments.out / (pathlib.Path(name).stem + pathlib.Path(name).suffix[1:] + "." + arguments.format)
        result, seconds = fitted(arguments.tool, scan, output, options)
        if isinstance(result, str):
            print(refused(name, result, seconds), flush=True)
        elif arguments.judge:
            verdict = judged(arguments.python, arguments.judge, output, scan)
            print(judged_row(name, result, verdict, seconds), flush=True)
        else:
            figures = own(result, math.dist(*result["input"]["bounding_box"]))
            print(row(name, result, figures, seconds), flush=True)


if __name__ == "__main__":
    main()
