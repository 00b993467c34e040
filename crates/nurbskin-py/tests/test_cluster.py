"""Many scans and large ones, on a real cluster of separate processes."""

import os
import signal
import time

import numpy as np
import pytest

import nurbskin
from conftest import clamped, height

distributed = pytest.importorskip("distributed", reason="Dask is not installed")
from nurbskin import cluster  # noqa: E402


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit="2GiB"
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


def chunk(seed, count=20_000):
    """Points of a waved sheet with noise."""
    random = np.random.default_rng(seed)
    uv = random.uniform(0, 1, (count, 2))
    return height(*uv.T) + 0.05 * random.normal(size=(count, 3)), uv


def place(points):
    """A chart of that sheet."""
    return np.clip(points[:, :2] / [100, 80], 0, 1)


def knots():
    return clamped(3, np.linspace(0, 1, 12)), clamped(3, np.linspace(0, 1, 10))


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scans")
    paths = []
    for k, shape in enumerate(["face", "saddle", "tube", "patch", "pot", "face"]):
        paths.append(folder / f"{k}.ply")
        nurbskin.simulate(shape, points=3000, noise=0.02, seed=k, shuffled=True).write(paths[-1])
    paths.insert(2, folder / "missing.ply")
    paths.append(folder / "broken.ply")
    paths[-1].write_text("ply\nformat ascii 1.0\nelement vertex 3\n")
    return paths


@pytest.fixture(scope="module")
def serial(scans):
    def fitted(path):
        try:
            return nurbskin.fit(path)
        except nurbskin.Error as error:
            return error

    return [fitted(path) for path in scans]


def same(found, expected):
    assert len(found) == len(expected)
    for one, other in zip(found, expected):
        if isinstance(other, Exception):
            assert type(one) is type(other) and str(one) == str(other)
        else:
            assert one.surface == other.surface and one.verdict == other.verdict
            assert np.array_equal(one.deviation().signed, other.deviation().signed)


def test_many_scans(client, scans, serial):
    assert sum(isinstance(entry, Exception) for entry in serial) == 2
    same(cluster.fit_many(scans, client), serial)


def test_a_killed_worker_loses_nothing(client, scans, serial):
    """The first worker that begins is killed in the middle of its scan."""
    victims = client.run(os.getpid)
    import threading

    def kill():
        time.sleep(0.3)
        os.kill(next(iter(victims.values())), signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    found = cluster.fit_many(scans * 3, client)
    killer.join()
    same(found, serial * 3)
    client.wait_for_workers(2, timeout=60)
    assert set(client.run(os.getpid).values()) != set(victims.values())


def test_chunks_give_the_surface_of_all_points(client, tmp_path):
    chunks = [chunk(seed) for seed in range(19)]
    points, uv = (np.concatenate(parts) for parts in zip(*chunks))
    expected = nurbskin.approximate(points, uv, knots=knots())

    def check(found):
        assert np.abs(found.surface.control_points - expected.surface.control_points).max() < 1e-10
        assert abs(found.rms - expected.rms) < 1e-8

    check(cluster.approximate(chunks, knots(), client))
    # One by one, made on the workers.
    check(cluster.approximate((lambda seed=seed: chunk(seed) for seed in range(19)), knots(), client))
    files = []
    for k, (p, t) in enumerate(chunks):
        files.append((tmp_path / f"{k}-p.npy", tmp_path / f"{k}-t.npy"))
        np.save(files[-1][0], p)
        np.save(files[-1][1], t)
    check(cluster.approximate(files, knots(), client))


def peak():
    """The most memory that a process has had, in bytes."""
    with open("/proc/self/status") as status:
        return 1024 * int(next(line for line in status if line.startswith("VmHWM")).split()[1])


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="memory is read from /proc")
def test_memory_of_a_worker_is_that_of_its_chunk(client):
    def of(count):
        cluster.approximate((lambda seed=seed: chunk(seed, 100_000) for seed in range(count)), knots(), client)
        return max(client.run(peak).values())

    few = of(6)
    # All of forty more chunks, 4 MB each, would be 160 MB.
    assert of(46) - few < 40e6


def test_points_alone_are_placed_by_a_chart(client, tmp_path):
    chunks = [chunk(seed)[0] for seed in range(5)]
    points = np.concatenate(chunks)
    expected = nurbskin.approximate(points, place(points), knots=knots())
    files = []
    for k, part in enumerate(chunks):
        files.append(tmp_path / f"{k}.npy")
        np.save(files[-1], part)
    dask = pytest.importorskip("dask.array")
    for form in [chunks, files, dask.from_array(points, chunks=(20_000, 3))]:
        found = cluster.approximate(form, knots(), client, chart=place)
        assert np.abs(found.surface.control_points - expected.surface.control_points).max() < 1e-10
    # A surface as a chart: each point where it is nearest.
    placed = expected.surface.deviation(points).parameters
    expected = nurbskin.approximate(points, placed, knots=knots())
    found = cluster.approximate(files, knots(), client, chart=expected.surface)
    other = nurbskin.approximate(points, expected.surface.deviation(points).parameters, knots=knots())
    assert np.abs(found.surface.control_points - other.surface.control_points).max() < 1e-10


def test_what_cannot_be_is_said(client):
    with pytest.raises(nurbskin.InvalidError, match="no chunks"):
        cluster.approximate([], knots(), client)
    with pytest.raises(nurbskin.InvalidError, match="a chart that places them"):
        cluster.approximate([chunk(0)[0]], knots(), client)
    with pytest.raises(nurbskin.InvalidError, match="shape"):
        cluster.approximate([np.zeros((5, 2))], knots(), client, chart=place)
    with pytest.raises(nurbskin.NoSolutionError):
        cluster.approximate([chunk(0, count=5)], knots(), client)
