#!/usr/bin/env python3
"""How fast `nurbskin.cluster.approximate` adds up points that are made on the workers, and what memory they take.

    cluster.py [--millions 1,10,100] [--spans 37] [--chunk 500000] [--workers 2]

Needs the Python package and `distributed`. Up to ten million points the surface is compared with that of all points in one
memory.
"""
import argparse
import os
import pickle
import time

import numpy as np


def chunk(seed, count):
    """Points of a gently waved sheet of 100 x 80, with noise of 0.05, and their parameters."""
    random = np.random.default_rng(seed)
    uv = random.random((count, 2))
    height = 6 * np.sin(5 * uv[:, 0]) * np.cos(4 * uv[:, 1]) + 0.05 * random.standard_normal(count)
    return np.column_stack([100 * uv[:, 0], 80 * uv[:, 1], height]), uv


def memory(field):
    """VmHWM (the peak) or VmRSS of this process, MB."""
    with open("/proc/self/status") as status:
        return int(next(line for line in status if line.startswith(field)).split()[1]) / 1024


def forget_peak():
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def timed(work):
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def main():
    import distributed

    import nurbskin
    from nurbskin import cluster

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--millions", default="1,10,100", help="numbers of points")
    parser.add_argument("--spans", type=int, default=37, help="of the knots, along u and v")
    parser.add_argument("--chunk", type=int, default=500_000, help="points of a chunk")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    knots = [np.r_[[0.0] * 3, np.linspace(0, 1, asked.spans + 1), [1.0] * 3]] * 2
    u, v = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201), indexing="ij")
    truth = np.stack([100 * u, 80 * v, 6 * np.sin(5 * u) * np.cos(4 * v)], axis=-1)
    # A thread for each worker: they share the cores.
    os.environ["RAYON_NUM_THREADS"] = "1"
    cluster_of = distributed.LocalCluster(
        n_workers=asked.workers, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with cluster_of as local, distributed.Client(local) as client:
        client.run(__import__, "nurbskin.cluster")
        print(f"workers before: {max(client.run(memory, 'VmRSS').values()):.0f} MB")
        for millions in (float(x) for x in asked.millions.split(",")):
            seeds = range(max(1, int(millions * 1e6) // asked.chunk))
            client.run(forget_peak)
            chunks = (lambda seed=seed: chunk(seed, asked.chunk) for seed in seeds)
            found, seconds = timed(lambda: cluster.approximate(chunks, knots, client, origin=(50, 40, 0)))
            peak = max(client.run(memory, "VmHWM").values())
            off = np.sqrt(((found.surface(u, v) - truth) ** 2).sum(axis=-1).mean())
            line = f"{millions:6.0f} M: {seconds:7.2f} s, {millions / seconds:5.2f} M/s, peak {peak:4.0f} MB, off {off:.2e}"
            if millions <= 10:
                points, uv = (np.concatenate(parts) for parts in zip(*(chunk(seed, asked.chunk) for seed in seeds)))
                whole, seconds = timed(lambda: nurbskin.approximate(points, uv, knots=knots))
                apart = np.abs(whole.surface.control_points - found.surface.control_points).max()
                line += f"; in one memory {seconds:.2f} s, control points differ by {apart:.1e}"
            print(line, flush=True)
    made, making = timed(lambda: chunk(0, asked.chunk))
    sums = nurbskin.NormalSums(*knots, origin=(50, 40, 0))
    _, adding = timed(lambda: sums.add(*made))
    other = sums.copy()
    _, merging = timed(lambda: other.merge(sums))
    _, solving = timed(sums.solve)
    print(f"a chunk: made in {making:.3f} s, added in {adding:.3f} s; sums of {len(pickle.dumps(sums)) / 1e6:.2f} MB, "
          f"merged in {merging:.4f} s, solved in {solving:.3f} s")


if __name__ == "__main__":
    main()
