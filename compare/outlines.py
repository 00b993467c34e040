#!/usr/bin/env python3
"""Fits sheets with eleven outlines, as clouds, meshes and range images, and prints a table of what came out.

    outlines.py [--tool PATH] [--tolerance 0.05%] [--noise 0 0.03] [--kinds cloud mesh range] [--only NAME...]
                [--bent roll|S|channel]

Each sheet is z = 8 sin(x / 25) cos(y / 30), or a fender whose curvature jumps, within 60 of the origin: a cloud of 25,000
random points, a mesh of squares of 0.75 that the outline clips, or a range image along z whose pixels are 0.75 apart. With
--bent the plane is rolled up by 230 degrees, bent to an S whose ends hang over, or folded to a channel with flanges of 31 and
bends of radius 3; such sheets have no range images. The true area is that of the outline for a cloud and a range image, and
that of its own triangles for a mesh. Needs numpy.
"""
import argparse
import json
import math
import pathlib
import subprocess
import tempfile

import numpy as np

SIZE = 60.0
POINTS = 25_000
SQUARES = 160


def wave(x, y):
    return 8 * np.sin(x / 25) * np.cos(y / 30)


def fender(x, y):
    return np.where(x < 0, 0, -x * x / 160) - y * y / 300


def square(x, y):
    return (np.abs(x) < SIZE) & (np.abs(y) < SIZE)


OUTLINES = {
    "disc": (lambda x, y: np.hypot(x, y) < SIZE, wave),
    "L": (lambda x, y: square(x, y) & ~((x > 0) & (y > 0)), wave),
    "triangle": (lambda x, y: (y > -SIZE) & (y < SIZE - 2 * np.abs(x)), wave),
    "ring": (lambda x, y: (np.hypot(x, y) < SIZE) & (np.hypot(x, y) > 30), wave),
    "arch": (lambda x, y: square(x, y) & (np.hypot(x, y + SIZE) > 35), fender),
    "flower": (lambda x, y: np.hypot(x, y) < 42 + 16 * np.cos(5 * np.arctan2(y, x)), wave),
    "hourglass": (lambda x, y: (np.abs(y) < SIZE) & (np.abs(x) < 15 + 40 * (y / SIZE) ** 2), wave),
    "crescent": (lambda x, y: (np.hypot(x, y) < SIZE) & (np.hypot(x - 30, y) > 45), wave),
    "comb": (lambda x, y: square(x, y) & ((y < -20) | (np.mod(x + SIZE, 24) < 13)), wave),
    "leaf": (lambda x, y: (np.abs(x) < SIZE) & (np.abs(y) < 22 * np.cos(math.pi * x / (2 * SIZE))), wave),
    "U": (lambda x, y: square(x, y) & ~((np.abs(x) < 2) & (y > -40)), wave),
}


def over(height):
    """The sheet of these heights over the plane."""
    return lambda x, y: np.stack([x, y, height(x, y)], -1)


def bent(curvature):
    """The plane, bent along x with this curvature."""
    x = np.linspace(-2 * SIZE, 2 * SIZE, 96_001)
    step = x[1] - x[0]

    def integral(values):
        middles = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * step)])
        return middles - middles[len(x) // 2]

    angle = integral(curvature(x))
    across, up = integral(np.cos(angle)), integral(np.sin(angle))
    return lambda u, v: np.stack([np.interp(u, x, across), v, np.interp(u, x, up)], -1)


BENT = {
    "roll": bent(lambda x: (1 + 0.25 * np.cos(x / 30)) / 30),
    "S": bent(lambda x: np.sin(x / 19) / 14),
    "channel": bent(lambda x: (np.abs(np.abs(x) - 26.6) < 0.75 * math.pi) / 3.0),
}


def normals(sheet, x, y):
    """The normals of a sheet, as long as its area per area of the plane."""
    h = 1e-3
    along_x = (sheet(x + h, y) - sheet(x - h, y)) / (2 * h)
    along_y = (sheet(x, y + h) - sheet(x, y - h)) / (2 * h)
    return np.cross(along_x, along_y)


def true_area(inside, sheet):
    count = 2400
    step = 2.2 * SIZE / count
    middle = (np.arange(count) + 0.5) * step - 1.1 * SIZE
    x, y = np.meshgrid(middle, middle)
    kept = inside(x, y)
    return float(np.linalg.norm(normals(sheet, x[kept], y[kept]), axis=-1).sum() * step * step)


def measured(sheet, x, y, noise, random):
    """Points of the sheet, off by normal errors along its normals."""
    across = normals(sheet, x, y)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    return sheet(x, y) + noise * random.standard_normal(x.shape)[..., None] * across


def write_cloud(path, inside, sheet, noise, random):
    flat = np.empty((0, 2))
    while len(flat) < POINTS:
        more = random.uniform(-SIZE, SIZE, (2 * POINTS, 2))
        flat = np.vstack([flat, more[inside(more[:, 0], more[:, 1])]])
    x, y = flat[:POINTS].T
    np.savetxt(path, measured(sheet, x, y, noise, random), fmt="%.6f")
    return true_area(inside, sheet)


def grid(turn=0.0):
    """Places 0.75 apart, turned by an angle about the origin."""
    line = np.arange(-SQUARES, SQUARES + 1) * (2 * SIZE / SQUARES)
    x, y = np.meshgrid(line, line)
    kept = np.abs(line) <= (SIZE if turn == 0.0 else SQUARES)
    x, y = x[np.ix_(kept, kept)], y[np.ix_(kept, kept)]
    c, s = math.cos(turn), math.sin(turn)
    return c * x - s * y, s * x + c * y


def write_range(path, inside, sheet, noise, random):
    # No side of an outline runs along the rows.
    x, y = grid(0.3)
    points = measured(sheet, x, y, noise, random)
    points[~inside(x, y)] = np.nan
    rows, columns = x.shape
    header = (
        f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {columns}\nHEIGHT {rows}\n"
        f"VIEWPOINT 0 0 500 1 0 0 0\nPOINTS {rows * columns}\nDATA ascii"
    )
    np.savetxt(path, points.reshape(-1, 3), fmt="%.6f", header=header, comments="")
    return true_area(inside, sheet)


def write_mesh(path, inside, sheet, noise, random):
    x, y = grid()
    kept = inside(x, y)
    number = np.full(x.shape, -1)
    number[kept] = np.arange(kept.sum())
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    triangles = triangles[(triangles >= 0).all(axis=1)]
    used, triangles = np.unique(triangles, return_inverse=True)
    exact = sheet(x[kept], y[kept])[used]
    points = measured(sheet, x[kept], y[kept], noise, random)[used]
    triangles = triangles.reshape(-1, 3)
    with open(path, "w") as out:
        out.writelines("v %.6f %.6f %.6f\n" % tuple(p) for p in points)
        out.writelines("f %d %d %d\n" % tuple(t) for t in triangles + 1)
    sides = exact[triangles[:, 1:]] - exact[triangles[:, :1]]
    return float(0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum())


KINDS = {"cloud": (write_cloud, "xyz"), "mesh": (write_mesh, "obj"), "range": (write_range, "pcd")}


def row(tool, name, scan, area, tolerance, folder):
    output = folder / "out.step"
    command = [tool, "fit", str(scan), "-o", str(output), "--json", "--unit", "mm", "-t", tolerance]
    result = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)
    if "error" in result:
        return f"| {name} | {result['error']['message']} | | | | | |"
    info = subprocess.run([tool, "info", str(output), "--json"], capture_output=True, text=True)
    found = json.loads(info.stdout)["files"][0]["area"]
    distances = result["deviation"]["scan_to_surface"]
    size = result["surface"]["control_points"]
    counts = f"{size[0] * size[1]} ({size[0]}x{size[1]})" if len(size) == 2 else f"{size[0]} (network)"
    within = 100 * distances["within_tolerance"]
    return (
        f"| {name} | {counts} | {distances['p95']:.3f} | {distances['max']:.3f} | {within:.2f} % | "
        f"{100 * (found / area - 1):+.2f} % | {result['verdict']} |"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tool", default="target/release/nurbskin")
    parser.add_argument("--tolerance", default="0.05%")
    parser.add_argument("--noise", nargs="*", type=float, default=[0.0])
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    parser.add_argument("--only", nargs="*", choices=OUTLINES, default=list(OUTLINES))
    parser.add_argument("--bent", choices=BENT)
    arguments = parser.parse_args()
    print("| outline | control points | p95 mm | max mm | within | area | verdict |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        for name in arguments.only:
            for kind in arguments.kinds:
                if arguments.bent and kind == "range":
                    continue
                write, ending = KINDS[kind]
                inside, height = OUTLINES[name]
                sheet = BENT[arguments.bent] if arguments.bent else over(height)
                for noise in arguments.noise:
                    scan = folder / f"scan.{ending}"
                    area = write(scan, inside, sheet, noise, np.random.default_rng(7))
                    said = f"{name}, {kind}" + (f", noise {noise}" if noise else "")
                    print(row(arguments.tool, said, scan, area, arguments.tolerance, folder), flush=True)


if __name__ == "__main__":
    main()
