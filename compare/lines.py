#!/usr/bin/env python3
"""Fits simulated scans whose points lie on lines (laser stripes, sections), and prints what was found.

    lines.py [SHAPE...] [--tool PATH] [--dense N...] [--noise SIGMA] [--outliers SHARE] [--rows]

Points on a line are N times as dense as the lines are apart. A cell holds the topology, the control points, the 95 % and
the largest distance of exact points of the shape, anywhere on it, from the surface, in mm, and the verdict if it is not
pass; or why the scan was refused. With --rows the file keeps the lines, one block each, that start anywhere; else its
points are shuffled.
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import tempfile

TURN = 2 * math.pi


def around(count, radius, dense, gap, chance):
    """Angles of a closed line: evenly spaced from a start by chance; `count` of them, or as the spacing says."""
    many = count or max(8, round(TURN * radius * dense / gap))
    start = chance.uniform(0, TURN)
    return [start + TURN * k / many for k in range(many)]


def sheet(x, y):
    return (x, y, 8 * math.exp(-((x - 3) ** 2 + (y + 2) ** 2) / 120) + 3 * math.sin(x / 9) * math.cos(y / 7))


def vase(z, angle):
    radius = 20 + 3 * math.sin(z / 20) + 0.8 * math.cos(3 * angle)
    return (radius * math.cos(angle), radius * math.sin(angle), z)


def body(z, angle):
    """A closed shape with three lobes, bent; z from -1 to 1."""
    wide = math.sqrt(max(0.0, 1 - z * z))
    lobe = wide * (1 + 0.15 * wide * math.cos(3 * angle))
    return (25 * lobe * math.cos(angle) + 6 * z * z, 18 * lobe * math.sin(angle), 40 * z)


def sphere(polar, angle):
    ring = 30 * math.sin(polar)
    return (ring * math.cos(angle), ring * math.sin(angle), 30 * math.cos(polar))


def elbow(turn, angle):
    """A quarter of a ring of oval section."""
    reach = 100 + 12 * math.cos(angle)
    return (reach * math.cos(turn), reach * math.sin(turn), 8 * math.sin(angle))


def sheet_lines(dense, chance):
    gap = 100 / 59
    for j in range(60):
        first, count = chance.uniform(0, gap / dense), round(100 * dense / gap)
        yield [sheet(-50 + first + k * gap / dense, -50 + j * gap) for k in range(count)]


def vase_rings(dense, chance):
    gap = 120 / 39
    for j in range(40):
        yield [vase(j * gap, a) for a in around(0, 20, dense, gap, chance)]


def body_slices(dense, chance):
    for j in range(50):
        z = -1 + (2 * j + 1) / 50
        yield [body(z, a) for a in around(0, 22 * math.sqrt(1 - z * z), dense, 1.6, chance)]


def sphere_rings(dense, chance):
    """All of as many points, as a turning probe takes them: very dense at the poles."""
    for j in range(41):
        yield [sphere(math.pi * (j + 0.5) / 41, a) for a in around(82 * dense, 0, 0, 0, chance)]


def elbow_sections(dense, chance):
    gap = 100 * math.pi / 2 / 29
    for j in range(30):
        yield [elbow(j / 29 * math.pi / 2, a) for a in around(0, 10, dense, gap, chance)]


# The lines; a point anywhere, of two numbers from 0 to 1; the topology.
SHAPES = {
    "sheet": (sheet_lines, lambda s, t: sheet(100 * s - 50, 100 * t - 50), "disk"),
    "vase": (vase_rings, lambda s, t: vase(120 * s, TURN * t), "tube"),
    "body": (body_slices, lambda s, t: body(1.96 * s - 0.98, TURN * t), "sphere"),
    "sphere": (sphere_rings, lambda s, t: sphere(math.acos(2 * s - 1), TURN * t), "sphere"),
    "elbow": (elbow_sections, lambda s, t: elbow(s * math.pi / 2, TURN * t), "tube"),
}


def write(path, lines):
    with open(path, "w") as file:
        for line in lines:
            file.writelines("%.5f %.5f %.5f\n" % p for p in line)
            file.write("\n")


def cell(args, shape, dense, folder):
    chance = random.Random(dense)
    lines_of, anywhere, topology = SHAPES[shape]
    noisy = lambda p: tuple(x + chance.gauss(0, args.noise) for x in p)
    lines = [[noisy(p) for p in line] for line in lines_of(dense, chance)]
    if not args.rows:
        points = [p for line in lines for p in line]
        points += [tuple(chance.uniform(-60, 60) for _ in range(3)) for _ in range(round(args.outliers * len(points)))]
        chance.shuffle(points)
        lines = [points]
    scan, part, truth = (folder / name for name in ("scan.xyz", "part.step", "truth.xyz"))
    write(scan, lines)
    write(truth, [[anywhere(chance.random(), chance.random()) for _ in range(4000)]])
    done = subprocess.run([args.tool, "fit", scan, "-o", part, "--json", "-q"], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        return "refused: " + (done.stderr.strip() or f"exit {done.returncode}").splitlines()[-1].split(": ", 2)[-1][:60]
    made = json.loads(done.stdout)
    measured = subprocess.run([args.tool, "deviation", truth, part, "-t", "1", "--json", "-q"], capture_output=True, text=True)
    if measured.returncode not in (0, 3):
        raise RuntimeError(measured.stderr)
    off = json.loads(measured.stdout)["deviation"]["scan_to_surface"]
    found = made["surface"]["topology"]
    m, n = made["surface"]["control_points"]
    said = [] if found == topology else [found]
    said += [f"{m * n}", f"{off['p95']:.3f} / {off['max']:.3f}"]
    if made["verdict"] != "pass":
        said.append(made["verdict"])
    return ", ".join(said)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", choices=[*SHAPES, []])
    parser.add_argument("--tool", default="target/release/nurbskin")
    parser.add_argument("--dense", type=int, nargs="+", default=[3, 6, 10, 20, 50])
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--rows", action="store_true")
    args = parser.parse_args()
    if args.rows and args.outliers:
        parser.error("outliers are on no line: leave --rows or --outliers away")
    args.tool = str(pathlib.Path(args.tool).resolve())
    print("| shape | " + " | ".join(f"{dense} times" for dense in args.dense) + " |")
    print("|---" * (1 + len(args.dense)) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for shape in args.shapes or SHAPES:
            cells = [cell(args, shape, dense, pathlib.Path(folder)) for dense in args.dense]
            print(f"| {shape} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
