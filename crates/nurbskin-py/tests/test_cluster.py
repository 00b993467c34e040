"""Many scans and large ones, on a real cluster of separate processes."""

import os
import pathlib
import signal
import threading
import time

import numpy as np
import pytest

import nurbskin
from conftest import clamped, height

distributed = pytest.importorskip("distributed", reason="Dask is not installed")
from nurbskin import cluster  # noqa: E402
from nurbskin._errors import MissingFileError  # noqa: E402


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
    """The first worker that has a scan is killed."""
    pids = client.run(os.getpid)
    victims = []

    def kill():
        def busy():
            return [worker for worker, keys in client.processing().items() if any("nurbskin-fit" in str(key) for key in keys)]

        victims.extend(pids[worker] for worker in eventually(busy)[:1])
        os.kill(victims[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    found = cluster.fit_many(scans * 3, client)
    killer.join()
    same(found, serial * 3)
    client.wait_for_workers(2, timeout=60)
    assert victims and victims[0] not in client.run(os.getpid).values()


def test_arrays_that_a_dead_worker_held_are_told(client):
    def kill():
        time.sleep(1)
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

    def slowly(points):
        time.sleep(3)
        return place(points)

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(nurbskin.Error, match=r"^chunk \d: cancelled; if a worker died"):
        cluster.approximate([chunk(seed)[0] for seed in range(4)], knots(), client, chart=slowly, origin=(50, 40, 0))
    killer.join()
    client.wait_for_workers(2, timeout=60)
    eventually(lambda: not left_on(client))


def eventually(what, seconds=20):
    """What this gives as soon as that is true."""
    end = time.monotonic() + seconds
    while not (given := what()):
        assert time.monotonic() < end, "this has never become true"
        time.sleep(0.01)
    return given


def left_on(client):
    """Whether tasks or data of a call are on the cluster."""
    return bool(client.futures) or client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)) > 0


def test_one_path_and_options_that_are_none_are_refused(client):
    for one in ["scan.ply", pathlib.Path("scan.ply"), b"scan.ply"]:
        with pytest.raises(nurbskin.InvalidError, match="scan.ply is one path"):
            cluster.fit_many(one, client)
    with pytest.raises(TypeError, match="tolerence"):
        cluster.fit_many(["scan.ply"], client, tolerence=0.1)


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


@pytest.mark.parametrize(
    "name,wrong",
    [
        ("smoothing", [-1, np.nan, "much", [0, 0], None]),
        ("size", [(0, 1), (1,), 1.0, (1, np.inf), "ab"]),
        ("origin", ["a", (1, 2), np.array([0, 0, np.nan]), [[1, 2, 3]]]),
        ("periodic", [True, (0, 2), "ab", (None, None)]),
        ("chart", ["a"]),
    ],
)
def test_arguments_are_refused_before_any_chunk(client, name, wrong):
    def chunks():
        raise AssertionError("a chunk was taken")
        yield

    for value in wrong:
        with pytest.raises(nurbskin.InvalidError, match=f"^{name}: .* needed, not"):
            cluster.approximate(chunks(), knots(), client, **{name: value})
    with pytest.raises(nurbskin.InvalidError, match="^knots"):
        cluster.approximate(chunks(), None, client)
    eventually(lambda: not left_on(client))


def test_lists_and_arrays_are_arguments(client):
    points, uv = chunk(0)
    expected = nurbskin.approximate(points, uv, knots=knots(), degree=(3, 3), smoothing=1e-6, size=(100, 80))
    found = cluster.approximate(
        [(points, uv)],
        knots(),
        client,
        degree=[3, 3],
        periodic=np.array([False, False]),
        origin=points.mean(axis=0),
        smoothing=np.array(1e-6),
        size=[100, 80],
    )
    assert np.abs(found.surface.control_points - expected.surface.control_points).max() < 1e-9


def test_nothing_stays_on_the_cluster(client):
    good = chunk(0)

    def broken():
        raise ZeroDivisionError("broken")

    def interrupted():
        yield from [good] * 3
        raise KeyboardInterrupt

    surface = cluster.approximate([good], knots(), client).surface
    eventually(lambda: not left_on(client))
    caught = []
    for chunks, error in [
        ([good] * 10 + [(good[0], good[1] + 9)], nurbskin.InvalidError),
        ([good] * 3 + [broken], ZeroDivisionError),
        (interrupted(), KeyboardInterrupt),
        ([good] * 3 + ["no.ply"] + [good] * 20, nurbskin.ReadError),
    ]:
        # What is kept of the error keeps the frames of the call.
        with pytest.raises(error) as info:
            cluster.approximate(chunks, knots(), client, chart=surface)
        caught.append(info)
        eventually(lambda: not left_on(client))


def test_a_future_of_the_caller_stays(client):
    future = client.submit(chunk, 0)
    cluster.approximate([future, chunk(1)], knots(), client)
    assert len(future.result()[0]) == 20_000
    future.release()
    eventually(lambda: not left_on(client))


def test_errors_name_their_chunk(client, tmp_path):
    good = chunk(0, 2000)
    lost, text = tmp_path / "lost.npy", tmp_path / "text.npy"
    text.write_text("no array")

    def broken():
        raise ZeroDivisionError("broken")

    for wrong, error, says in [
        ((good[0][:, :2], good[1]), nurbskin.InvalidError, r"^chunk 2: a chunk holds an array of shape \(n, 3\)"),
        (lost, MissingFileError, r"^chunk 2 \(.*lost.npy\): .*there is no such file"),
        ((lost, lost), MissingFileError, r"^chunk 2 \(.*lost.npy, .*lost.npy\): .*lost.npy: there is no such file"),
        ((text, text), nurbskin.ReadError, r"^chunk 2 \(.*\): .*text.npy: this cannot be read as a .npy file"),
        (7, nurbskin.InvalidError, "^chunk 2: int: a chunk is a pair of"),
        ({"a": 1}, nurbskin.InvalidError, "^chunk 2: dict: a chunk is a pair of"),
        (lambda: None, nurbskin.InvalidError, "^chunk 2: NoneType: a chunk is a pair of"),
        (lambda: ("a", "b", "c"), nurbskin.InvalidError, "^chunk 2: tuple: a chunk is a pair of"),
        (broken, ZeroDivisionError, "broken"),
    ]:
        with pytest.raises(error, match=says) as caught:
            cluster.approximate([good, good, wrong], knots(), client)
        assert not isinstance(caught.value, nurbskin.Error) or type(caught.value) is error
        assert error is not MissingFileError or isinstance(caught.value, nurbskin.ReadError)
        assert error is not MissingFileError or isinstance(caught.value, FileNotFoundError)
        if error is ZeroDivisionError and hasattr(caught.value, "__notes__"):
            assert caught.value.__notes__ == ["nurbskin: this is of chunk 2"]
    with pytest.raises(nurbskin.ReadError, match=r"^chunk 0 \(.*lost.npy\)"):
        cluster.approximate([lost], knots(), client, chart=place)
    for wrong in [7, None, print]:
        with pytest.raises(nurbskin.InvalidError, match="an iterable of chunks is needed, not .*; a chunk is a pair"):
            cluster.approximate(wrong, knots(), client)


def test_chunks_of_all_kinds(client):
    dask = pytest.importorskip("dask")
    array = pytest.importorskip("dask.array")
    points, uv = chunk(0, 40_000)
    scattered = [client.scatter(part, hash=False) for part in (points, uv)]
    dask_points, dask_uv = array.from_array(points, chunks=(7_000, 2)), array.from_array(uv, chunks=(30_000, 1))
    # Rows that are selected are unknown in number.
    unknown = array.from_array(points, chunks=(7_000, 3)), array.from_array(uv, chunks=(7_000, 2))
    unknown = [part[(unknown[0] > -1e9).all(axis=1)] for part in unknown]
    for name, chunks, chart in [
        ("a pair", (points, uv), None),
        ("a pair as a list", [points, uv], None),
        ("a pair of Dask arrays", (dask_points, dask_uv), None),
        ("in a list", [(dask_points, dask_uv)], None),
        ("of unknown sizes", unknown, None),
        ("Dask and numpy", [(dask_points, uv)], None),
        ("futures", [tuple(scattered)], None),
        ("a future and an array", [(scattered[0], uv)], None),
        ("delayed", [dask.delayed(chunk)(0, 40_000)], None),
        ("a delayed one", dask.delayed(chunk)(0, 40_000), None),
        ("a pair of delayed", [tuple(map(dask.delayed, (points, uv)))], None),
        ("a future of a pair", client.submit(chunk, 0, 40_000), None),
        ("points", points, place),
        ("lists", [points[:20_000].tolist(), points[20_000:]], place),
        ("a scan", nurbskin.Scan(points), place),
        ("scans", [nurbskin.Scan(points[:9]), nurbskin.Scan(points[9:])], place),
        ("functions that give scans", [lambda: nurbskin.Scan(points)], place),
        ("Dask's points", dask_points, place),
    ]:
        expected = nurbskin.approximate(points, uv if chart is None else place(points), knots=knots())
        found = cluster.approximate(chunks, knots(), client, chart=chart)
        assert np.abs(found.surface.control_points - expected.surface.control_points).max() < 1e-9, name
    for chunks, text in [
        ((dask_points, dask_uv[:-1]), "40000 points have 39999 parameters"),
        ((unknown[0], array.from_array(uv, chunks=(20_000, 2))), "points of 6 blocks have parameters of 2"),
        ([(dask_points, dask_points)], r"a Dask array of parameters has shape \(n, 2\), not \(40000, 3\)"),
        (dask_uv, r"a Dask array of points has shape \(n, 3\)"),
        ([(np.ma.masked_equal(points, points[7, 0]), uv)], "point 7 is not finite"),
    ]:
        with pytest.raises(nurbskin.InvalidError, match=text):
            cluster.approximate(chunks, knots(), client)


def test_workers_hold_blocks_of_pairs_of_dask_arrays():
    array = pytest.importorskip("dask.array")
    points, uv = array.zeros((50, 3), chunks=(10, 3)), array.zeros((50, 2), chunks=(50, 1))
    blocks = list(cluster._each([(points, uv)]))
    assert [name for name, _ in blocks] == [f"chunk 0, block {k}" for k in range(5)]
    assert all(block[0].compute().shape == (10, 3) and block[1].compute().shape == (10, 2) for _, block in blocks)
