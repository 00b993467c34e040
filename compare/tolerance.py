#!/usr/bin/env python3
"""Sweeps the tolerance and the budget over simulated and real scans, prints a table and draws docs/figures/tolerance.png.

    tolerance.py [DATA]  [--tool PATH] [--figure FILE.png]

DATA is a folder of real scans (tubes/, pots/, ...); without it only the simulated ones are fitted. Lengths are in 1e-3 of
the scan's bounding-box diagonal. The last column says whether the order is kept: from a looser tolerance to a tighter one
no surface gets smaller, and no p95 larger by more than 2 %, the chance of noise; from a budget to a larger one no p95 gets
larger by more than that. Needs matplotlib for the figure.
"""
import argparse
import json
import math
import pathlib
import subprocess
import tempfile

SIMULATED = [("face", 0), ("face", 0.05), ("blade", 0), ("blade", 0.05), ("torus", 0)]
REAL = [
    "tubes/ycb_banana.obj",
    "tubes/ycb_mustard_body_crop.ply",
    "faces/fran_cut.ply",
    "pots/plastic_vase.ply",
    "classics/stanford_bun_zipper.ply",
]
# In per cent of the diagonal.
TOLERANCES = [0.8, 0.4, 0.2, 0.1, 0.05]
BUDGETS = [100, 200, 400, 800, 1600, 3200, 6400]
CHANCE = 1.02


def fitted(tool, scan, folder, options):
    output = pathlib.Path(folder) / "swept.step"
    command = [tool, "fit", str(scan), "-o", str(output), "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    result = json.loads(done.stdout)
    if "error" in result:
        raise SystemExit(f"{scan}: {result['error']['message']}")
    diagonal = math.dist(*result["input"]["bounding_box"])
    distances = result["deviation"]["scan_to_surface"]
    return {
        "size": math.prod(result["surface"]["control_points"]),
        "p95": 1e3 * distances["p95"] / diagonal,
        "within": distances["within_tolerance"],
        "seconds": result["time"]["fit"],
        "verdict": result["verdict"],
    }


def swept(tool, scan, folder):
    by_tolerance = [fitted(tool, scan, folder, ["-t", f"{t}%"]) for t in TOLERANCES]
    by_budget = [fitted(tool, scan, folder, ["--max-control-points", str(n)]) for n in BUDGETS]
    return by_tolerance, by_budget


def in_order(rows, sizes):
    pairs = list(zip(rows, rows[1:]))
    return all((not sizes or a["size"] <= b["size"]) and b["p95"] <= CHANCE * a["p95"] for a, b in pairs)


def draw(all_rows, figure):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, 2, figsize=(11, 4.6), sharey=True)
    for name, by_tolerance, by_budget in all_rows:
        for axis, rows in zip(axes, (by_tolerance, by_budget)):
            axis.plot([r["size"] for r in rows], [r["p95"] for r in rows], marker="o", markersize=4, label=name)
    for axis, title in zip(axes, ("Tolerance from 0.8 % to 0.05 % of the diagonal", "Budget from 100 to 6400")):
        axis.set(xscale="log", yscale="log", xlabel="control points", title=title)
        axis.grid(True, which="both", linewidth=0.3)
    axes[0].set_ylabel("distance of 95 % of the points, 1e-3 of the diagonal")
    axes[1].legend(fontsize=7)
    fig.tight_layout()
    fig.savefig(figure, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", type=pathlib.Path)
    parser.add_argument("--tool", default="target/release/nurbskin")
    parser.add_argument("--figure", type=pathlib.Path)
    arguments = parser.parse_args()
    tool = arguments.tool
    print("| scan | " + " | ".join(f"{t} %" for t in TOLERANCES) + " | in order: tolerance, budget |")
    print("|---|" + "---|" * (len(TOLERANCES) + 1))
    all_rows = []
    with tempfile.TemporaryDirectory() as folder:
        scans = []
        for shape, noise in SIMULATED:
            path = pathlib.Path(folder) / f"{shape}{noise}.ply"
            made = ["--points", "10000", "--noise", str(noise), "--shuffled", "-o", str(path)]
            subprocess.run([tool, "simulate", shape, *made], check=True, capture_output=True)
            scans.append((f"{shape}, noise {noise} mm", path))
        if arguments.data:
            scans += [(pathlib.Path(name).stem, arguments.data / name) for name in REAL]
        for name, path in scans:
            by_tolerance, by_budget = swept(tool, path, folder)
            cells = [
                f"{r['size']}, {r['p95']:.3g}, {100 * r['within']:.2f} %, {r['verdict']}, {r['seconds']:.1f} s"
                for r in by_tolerance
            ]
            kept = "yes" if in_order(by_tolerance, True) else "NO"
            worse = [b["p95"] / a["p95"] for a, b in zip(by_budget, by_budget[1:])]
            kept += ", yes" if in_order(by_budget, False) else f", NO ({max(worse):.2f} times)"
            print(f"| {name} | " + " | ".join(cells) + f" | {kept} |", flush=True)
            all_rows.append((name, by_tolerance, by_budget))
    if arguments.figure:
        draw(all_rows, arguments.figure)


if __name__ == "__main__":
    main()
