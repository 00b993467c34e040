#!/usr/bin/env python3
"""nurbskin beside its peers on the same arrays, in one run.

  run.py grid [MxN ...]     interpolation of a grid, parameters given (scipy's RectBivariateSpline: its own knots)
  run.py deviation [COUNT]  distance of points to a bicubic 30 x 30 surface: near, far, and beyond its edges

Peers that are not installed are skipped with a line that says so (compare/setup.sh installs them). Within a size the
peers take turns, so that a slow spell of the machine meets them all; medians are printed, and ratios to nurbskin.
"""
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")
import numpy as np

from data import (averaged_knots, grid, parameters, pointwise, queries, reference_distance, tensor, wavy_surface)

HERE = pathlib.Path(__file__).resolve().parent
OURS = HERE.parent / "target" / "release" / "examples" / "compare"
SISL = HERE / "build" / "sisl"
SIZES = [(18, 18), (29, 13), (25, 32), (100, 100), (300, 300), (1000, 1000), (3000, 3000)]


def run(*command):
    out = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True).stdout
    return out.splitlines()


def times_of(lines):
    return [float(line.split()[1]) for line in lines if line.startswith("T ")]


def write_grid(path, points, u, v):
    with open(path, "wb") as f:
        np.array(points.shape[:2], np.int32).tofile(f)
        for array in (u, v, points):
            np.ascontiguousarray(array).tofile(f)


def python_peers(points, u, v):
    """name -> function that interpolates once."""
    peers = {}
    tu, tv = averaged_knots(u), averaged_knots(v)
    try:
        from scipy.interpolate import RectBivariateSpline, make_interp_spline

        def by_axes():
            c = make_interp_spline(u, points, 3, t=tu, check_finite=False).c
            return make_interp_spline(v, np.ascontiguousarray(c.transpose(1, 0, 2)), 3, t=tv, check_finite=False)

        peers["scipy RectBivariateSpline x 3"] = lambda: [RectBivariateSpline(u, v, points[..., d], s=0) for d in range(3)]
        peers["scipy make_interp_spline x 2"] = by_axes
    except ImportError as missing:
        print(f"skipped: {missing}")
    if points.size <= 3 * 1000 * 1000:
        try:
            from splipy import BSplineBasis, surface_factory
            bases = [BSplineBasis(4, tu), BSplineBasis(4, tv)]
            peers["splipy"] = lambda: surface_factory.interpolate(points, bases, [u, v])
        except ImportError as missing:
            print(f"skipped: {missing}")
        try:
            from OCP.GeomAPI import GeomAPI_PointsToBSplineSurface
            from OCP.gp import gp_Pnt
            try:
                from OCP.TColgp import TColgp_Array2OfPnt as Array
            except ImportError:
                from OCP.collections import Array2_gp_Pnt as Array
            m, n = points.shape[:2]
            array = Array(1, m, 1, n)
            for i in range(m):
                for j in range(n):
                    array.SetValue(i + 1, j + 1, gp_Pnt(*map(float, points[i, j])))

            def occt():
                fit = GeomAPI_PointsToBSplineSurface()
                fit.Interpolate(array)
                return fit

            peers["OpenCascade Interpolate"] = occt
        except ImportError as missing:
            print(f"skipped: {missing}")
    if points.size <= 3 * 32 * 32:
        try:
            from geomdl import fitting
            listed = [tuple(map(float, p)) for p in points.reshape(-1, 3)]
            peers["geomdl"] = lambda: fitting.interpolate_surface(listed, *points.shape[:2], 3, 3)
        except ImportError as missing:
            print(f"skipped: {missing}")
    return peers


def compare_grid(sizes):
    exponent = []
    for m, n in sizes:
        points = grid(m, n)
        u, v = parameters(points)
        peers = python_peers(points, u, v)
        rounds = 3 if m * n > 100_000 else 7
        inner = max(1, min(1000, 200_000 // (m * n)))
        took = {}
        with tempfile.TemporaryDirectory() as folder:
            source, result = pathlib.Path(folder, "in"), pathlib.Path(folder, "out")
            write_grid(source, points, u, v)
            for _ in range(rounds):
                for threads in (1, 2):
                    lines = run(OURS, "grid", source, result, max(3, inner), threads)
                    took.setdefault(f"nurbskin, {threads} thread{'s' * (threads - 1)}", []).append(
                        statistics.median(times_of(lines)))
                    memory = next(line for line in lines if line.startswith("M "))
                if SISL.exists():
                    took.setdefault("SISL s1537", []).append(
                        statistics.median(times_of(run(SISL, "grid", source, result.with_suffix(".sisl"), max(3, inner)))))
                for name, once in peers.items():
                    best = []
                    for _ in range(3 if m * n < 100_000 else 1):
                        start = time.perf_counter()
                        once()
                        best.append(time.perf_counter() - start)
                    took.setdefault(name, []).append(min(best))
            residual, between = check(result, points, u, v)
        ours = statistics.median(took["nurbskin, 2 threads"])
        single = statistics.median(took["nurbskin, 1 thread"])
        fastest = min(statistics.median(t) for name, t in took.items() if not name.startswith("nurbskin"))
        print(f"\n{m} x {n}: largest residual {residual:.1e}, off the analytic surface between the points {between:.1e}, "
              f"peak memory {float(memory.split()[1]):.0f} MB")
        for name, t in sorted(took.items(), key=lambda item: statistics.median(item[1])):
            middle = statistics.median(t)
            print(f"  {name:32} {middle * 1e6:14.1f} us   {middle / ours:8.1f} x nurbskin")
        print(f"  fastest peer / nurbskin: {fastest / ours:.1f} with two threads, {fastest / single:.1f} with one")
        exponent.append((m * n, single, ours))
    if len(exponent) > 1:
        for name, column in (("one thread", 1), ("two threads", 2)):
            x = np.log([e[0] for e in exponent])
            print(f"growth exponent in the number of points, {name}: "
                  f"{np.polyfit(x, np.log([e[column] for e in exponent]), 1)[0]:.3f}")


def check(result, points, u, v):
    """Largest residual at the points and largest distance in z from the analytic surface between them."""
    from data import height
    m, n = points.shape[:2]
    with open(result, "rb") as f:
        tu, tv = np.fromfile(f, count=m + 4), np.fromfile(f, count=n + 4)
        c = np.fromfile(f).reshape(m, n, 3)
    residual = max(np.abs(tensor(tu, tv, c, u[k:k + 256], v) - points[k:k + 256]).max() for k in range(0, m, 256))
    t = (np.arange(401) + 0.5) / 401
    s = tensor(tu, tv, c, t, t)
    return residual, np.abs(s[..., 2] - height(s[..., 0], s[..., 1])).max()


def compare_deviation(count):
    surface = wavy_surface()
    points, classes = queries(surface, count)
    checked = min(count, 3000)
    truth = reference_distance(surface, points[:checked])
    tu, tv, c = surface
    with tempfile.TemporaryDirectory() as folder:
        shape, cloud, out = (pathlib.Path(folder, name) for name in ("surface", "points", "out"))
        with open(shape, "wb") as f:
            np.array([*c.shape[:2], 3, 3], np.int32).tofile(f)
            for array in (tu, tv, c):
                np.ascontiguousarray(array).tofile(f)
        points.tofile(cloud)

        def ours(threads):
            t = statistics.median(times_of(run(OURS, "closest", shape, cloud, out, 5, threads)))
            lower, upper = np.fromfile(out).reshape(2, -1)
            return t, upper, lower

        def sisl(method, limit=count):
            points[:limit].tofile(cloud.with_suffix(".part"))
            t = times_of(run(SISL, "closest", shape, cloud.with_suffix(".part"), out, method))[0]
            return t * count / limit, np.fromfile(out)

        rows = []
        for threads in (1, 2):
            t, upper, lower = ours(threads)
            rows.append((f"nurbskin, certified, {threads} thread{'s' * (threads - 1)}", t, upper))
        print(f"widest certified bracket {np.max(upper - lower):.1e}; the reference lies inside it or above for "
              f"{np.mean(truth >= lower[:checked] - 1e-9) * 100:.2f} % of {checked}")
        for name, chosen in classes.items():
            points[chosen].tofile(cloud)
            t = statistics.median(times_of(run(OURS, "closest", shape, cloud, out, 5, 1)))
            print(f"  nurbskin, {name} points only, one thread: {t / chosen.sum() * 1e6:.3f} us/point")
        if SISL.exists():
            rows.append(("SISL s1958 (fast)", *sisl("fast")))
            rows.append(("SISL s1954 (global)", *sisl("safe", min(count, 3000))))
        try:
            rows.append(("OpenCascade ValueOfUV", *occt(surface, points[:min(count, 3000)], count)))
        except ImportError as missing:
            print(f"skipped: {missing}")
    base = rows[0][1]
    for name, t, distance in rows:
        wrong = np.abs(distance[:checked] - truth) > 1e-4
        # The reference itself is a local search: where a peer is closer, the peer is right.
        wrong &= ~(distance[:checked] < truth)
        share = ", ".join(f"{k} {wrong[w[:checked]].mean() * 100:.2f} %" for k, w in classes.items())
        print(f"  {name:34} {t / count * 1e6:9.2f} us/point  {t / base:7.1f} x   wrong: {share}")


def occt(surface, points, count):
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.ShapeAnalysis import ShapeAnalysis_Surface
    try:
        from OCP.TColgp import TColgp_Array2OfPnt as Array
        from OCP.TColStd import TColStd_Array1OfInteger as Integers, TColStd_Array1OfReal as Reals
    except ImportError:
        from OCP.collections import Array1_double as Reals, Array1_int as Integers, Array2_gp_Pnt as Array
    tu, tv, c = surface
    poles = Array(1, c.shape[0], 1, c.shape[1])
    for i in range(c.shape[0]):
        for j in range(c.shape[1]):
            poles.SetValue(i + 1, j + 1, gp_Pnt(*map(float, c[i, j])))
    knots = []
    for t in (tu, tv):
        values, multiplicities = np.unique(t, return_counts=True)
        r, k = Reals(1, len(values)), Integers(1, len(values))
        for i, (x, y) in enumerate(zip(values, multiplicities)):
            r.SetValue(i + 1, float(x))
            k.SetValue(i + 1, int(y))
        knots.append((r, k))
    (ku, mu), (kv, mv) = knots
    solver = ShapeAnalysis_Surface(Geom_BSplineSurface(poles, ku, kv, mu, mv, 3, 3, False, False))
    listed = [gp_Pnt(*map(float, p)) for p in points]
    gap = np.empty(len(points))
    start = time.perf_counter()
    for i, p in enumerate(listed):
        solver.ValueOfUV(p, 1e-7)
        gap[i] = solver.Gap()
    return (time.perf_counter() - start) * count / len(points), gap


def main():
    what = sys.argv[1:2]
    if not OURS.exists():
        sys.exit("build ours first: cargo build --release --example compare")
    if what == ["grid"]:
        sizes = [tuple(map(int, a.split("x"))) for a in sys.argv[2:]] or SIZES
        compare_grid(sizes)
    elif what == ["deviation"]:
        compare_deviation(int(sys.argv[2]) if len(sys.argv) > 2 else 100_000)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
