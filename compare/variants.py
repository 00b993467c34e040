#!/usr/bin/env python3
"""Fits variants of real meshes without a flag, as other scans of the same kinds: cut off, with holes, as clouds.

    variants.py DATA [NAME...]  --judge JUDGE.PY [--tool PATH] [--seeds N] [--kinds crop holes cloud vertices] [--out FOLDER]

Each mesh under DATA (or those whose path contains a NAME) is cut by a plane that leaves 50 to 90 % of its vertices, gets 1
to 4 holes of 2 to 7 % of the diagonal in radius, is sampled by 8,000 to 60,000 points with noise of up to 0.05 % of the
diagonal, and is taken for its vertices alone. The first table is that of real.py: what is fitted is what is measured
against. The second has a line per mesh: topology, p95 to the surface and back, folds and bare area from 0.5 % on.

Needs numpy, trimesh and what the judge needs, in the Python that runs it.
"""
import argparse
import pathlib
import re
import sys

import numpy as np
import trimesh

import real

MESHES = [
    scan
    for scan in real.SCANS
    if pathlib.Path(scan).suffix in (".ply", ".obj", ".stl", ".off")
    # Grids, and what no one surface is.
    and not scan.startswith("organised/")
    and scan not in ("tubes/aorta2.stl", "pots/sea_vase.ply")
]


def kept(mesh, mask, path):
    """The triangles of which all vertices are kept."""
    part = mesh.copy()
    part.update_faces(mask[part.faces].all(axis=1))
    part.remove_unreferenced_vertices()
    part.export(path)
    return path


def crop(mesh, diagonal, rng, stem):
    heights = mesh.vertices @ trimesh.unitize(rng.normal(size=3))
    return kept(mesh, heights < np.quantile(heights, rng.uniform(0.5, 0.9)), stem.with_suffix(".ply"))


def holes(mesh, diagonal, rng, stem):
    mask = np.ones(len(mesh.vertices), bool)
    for centre in rng.integers(len(mask), size=rng.integers(1, 5)):
        distances = np.linalg.norm(mesh.vertices - mesh.vertices[centre], axis=1)
        mask &= distances > rng.uniform(0.02, 0.07) * diagonal
    return kept(mesh, mask, stem.with_suffix(".ply"))


def cloud(mesh, diagonal, rng, stem):
    points, _ = trimesh.sample.sample_surface(mesh, int(rng.uniform(8000, 60000)), seed=int(rng.integers(2**31)))
    noise = 5e-4 * diagonal * rng.uniform(0, 1)
    np.savetxt(stem.with_suffix(".xyz"), points + noise * rng.normal(size=points.shape), fmt="%.7g")
    return stem.with_suffix(".xyz")


def vertices(mesh, diagonal, rng, stem):
    np.savetxt(stem.with_suffix(".xyz"), mesh.vertices, fmt="%.9g")
    return stem.with_suffix(".xyz")


KINDS = {"crop": crop, "holes": holes, "cloud": cloud, "vertices": vertices}


def cell(result, verdict):
    """One fit in short."""
    if isinstance(result, str):
        genus = re.search(r"genus \d+", result)
        return f"refused ({genus.group()})" if genus else "refused"
    if "scan_to_surface" not in verdict:
        return "not measured"
    figures = real.independent(verdict)
    more = len(result.get("parts") or [None]) - 1
    surface = result["surface"]
    kind = "network" if surface["layout"] == "network" else surface["topology"]
    said = kind + (f" and {more} more" if more else "")
    said += f", {figures['there'][1]:.3g} / {figures['back'][0]:.3g}"
    for name, key in (("folds", "folds"), ("bare", "unsupported")):
        if (figures[key] or 0.0) >= 0.5:
            said += f", {name} {figures[key]:.2f} %"
    return said


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--judge", required=True)
    parser.add_argument("--tool", default="target/release/nurbskin")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("target/variants"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(real.HEADER)
    lines = []
    for name in MESHES:
        if arguments.names and not any(n in name for n in arguments.names):
            continue
        mesh = trimesh.load(arguments.data / name, process=True, force="mesh")
        diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        cells = []
        for kind in arguments.kinds:
            said = []
            for seed in range(1 if kind == "vertices" else arguments.seeds):
                stem = arguments.out / f"{pathlib.Path(name).stem}-{kind}-{seed}"
                scan = KINDS[kind](mesh, diagonal, np.random.default_rng(seed), stem)
                output = stem.with_suffix(".igs")
                result, seconds = real.fitted(arguments.tool, scan, output, [])
                verdict = {}
                if isinstance(result, str):
                    print(real.refused(stem.name, result, seconds), flush=True)
                else:
                    verdict = real.judged(sys.executable, arguments.judge, output, scan)
                    print(real.judged_row(stem.name, result, verdict, seconds), flush=True)
                said.append(cell(result, verdict))
            cells.append("; ".join(said))
        lines.append(" | ".join([pathlib.Path(name).stem, *cells]))
    print("\n| mesh |", " | ".join(arguments.kinds), "|")
    print("|---" * (1 + len(arguments.kinds)) + "|")
    for line in lines:
        print("|", line, "|")


if __name__ == "__main__":
    main()
