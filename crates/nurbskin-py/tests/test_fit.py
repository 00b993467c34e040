"""Fits: inputs, outputs, errors, threads, memory, Ctrl-C."""

import hashlib
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import nurbskin


def test_a_fit_tells_all_about_itself(fitted, face):
    assert fitted.verdict == "pass" and fitted.topology == "disk"
    assert fitted.summary["verdict"] == "pass"
    assert len(fitted.points) == len(fitted.indices) == len(fitted.deviation())
    assert np.array_equal(face.points[fitted.indices], fitted.points)
    assert np.abs(fitted.deviation().signed - fitted.deviation(fitted.points).signed).max() < 1e-9
    assert "Result(pass: disk" in repr(fitted)
    assert "<iframe srcdoc=" in fitted.page()._repr_html_()


def test_files_are_written(fitted, tmp_path):
    checks = fitted.write(tmp_path / "face.step", tmp_path / "face.igs", tmp_path / "face.stl", step_schema="ap242")
    assert checks["verdict"] == "pass"
    fitted.report(tmp_path / "face.html", tmp_path / "face.csv", tmp_path / "face.json")
    assert (tmp_path / "face.html").read_text().startswith("<!doctype html>")
    assert json.loads((tmp_path / "face.json").read_text())["verdict"] == "pass"
    assert len((tmp_path / "face.csv").read_text().splitlines()) == len(fitted.points) + 1
    with pytest.raises(nurbskin.InvalidError, match="extension"):
        fitted.write(tmp_path / "face.doc")
    with pytest.raises(nurbskin.WriteError, match="does not exist"):
        fitted.write(tmp_path / "nowhere" / "face.step")


def test_files_are_read(face, fitted, tmp_path):
    path = tmp_path / "face.ply"
    face.write(path)
    scan = nurbskin.read(path)
    assert np.array_equal(scan.points, face.points) and scan.unit == "mm"
    again = nurbskin.fit(path, tolerance=0.25)
    assert again.surface == fitted.surface and again.path == path
    with pytest.raises(nurbskin.ReadError, match="nothing.ply") as caught:
        nurbskin.fit(tmp_path / "nothing.ply")
    assert isinstance(caught.value, OSError)


@pytest.mark.parametrize("kind", [np.float64, np.float32, ">f8", list])
def test_any_numbers(face, kind):
    points = face.points.tolist() if kind is list else face.points.astype(kind)
    result = nurbskin.fit(points, tolerance=0.2)
    assert result.verdict == "pass"
    # In another order, and in another layout of memory.
    shuffled = np.asfortranarray(np.asarray(points)[::-1])
    assert nurbskin.fit(shuffled, tolerance=0.2).surface == result.surface


def test_numbers_at_odd_addresses(face):
    shifted = np.frombuffer(b"x" + face.points.tobytes(), offset=1).reshape(-1, 3)
    assert not shifted.flags.aligned
    assert np.array_equal(nurbskin.Scan(shifted).points, face.points)
    triangles = np.frombuffer(b"x" + np.array([[0, 1, 2]], dtype=np.int64).tobytes(), dtype=np.int64, offset=1)
    assert nurbskin.Scan(face.points, triangles=triangles.reshape(1, 3)).triangles.tolist() == [[0, 1, 2]]


def test_grids_with_gaps(sheet):
    grid, *_ = sheet
    result = nurbskin.fit(grid, tolerance=0.1)
    assert result.summary["input"]["organisation"] == "grid" and result.summary["input"]["grid"] == [23, 17]
    holes = grid.copy()
    holes[8:10, 5:7] = np.nan
    result = nurbskin.fit(holes, tolerance=0.1)
    assert result.summary["input"]["points"] == 23 * 17 - 4


def test_objects_of_other_libraries(sheet):
    """Told by what they have; the libraries themselves where they are installed."""
    grid, *_ = sheet
    m, n = grid.shape[:2]
    points = grid.reshape(-1, 3)
    k = np.arange(m * n).reshape(m, n)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    padded = np.column_stack([np.full(len(faces), 3), faces]).ravel()

    class Holder(dict):
        def __getitem__(self, name):
            return SimpleNamespace(numpy=lambda: dict.__getitem__(self, name))

    objects = {
        "trimesh": SimpleNamespace(vertices=points, faces=faces),
        "open3d": SimpleNamespace(vertices=points, triangles=faces, vertex_normals=np.empty((0, 3))),
        "open3d tensor": SimpleNamespace(vertex=Holder(positions=points), triangle=Holder(indices=faces)),
        "pyvista": SimpleNamespace(points=points, n_points=len(points), faces=padded, is_all_triangles=True),
        "meshio": SimpleNamespace(points=points, cells_dict={"triangle": faces, "line": faces[:, :2]}),
        "meshio with quads": SimpleNamespace(points=points, cells_dict={"quad": np.stack([a, b, c, d], axis=1)}),
    }
    for library, make in {
        "trimesh": lambda lib: lib.Trimesh(points, faces, process=False),
        "pyvista": lambda lib: lib.PolyData(points, padded),
    }.items():
        try:
            objects[f"real {library}"] = make(__import__(library))
        except ImportError:
            pass
    expected = nurbskin.fit(nurbskin.Scan(points, triangles=faces), tolerance=0.1)
    assert expected.summary["input"]["organisation"] == "mesh"
    for name, mesh in objects.items():
        result = nurbskin.fit(mesh, tolerance=0.1)
        assert np.abs(result.surface.control_points - expected.surface.control_points).max() < 1e-9, name
    clouds = [
        SimpleNamespace(vertices=points),
        SimpleNamespace(points=points, has_normals=lambda: False),
        SimpleNamespace(point=Holder(positions=points)),
    ]
    expected = nurbskin.fit(points, tolerance=0.1)
    for cloud in clouds:
        assert nurbskin.fit(cloud, tolerance=0.1).surface == expected.surface


def test_wrong_arguments_are_refused(face):
    for wrong, text in [
        (lambda: nurbskin.fit(np.zeros((5, 2))), r"points: an array of shape \(n, 3\) is needed, not \(5, 2\)"),
        (lambda: nurbskin.fit(face, tolerance=-1), "tolerance: a tolerance is a positive length, not -1"),
        (lambda: nurbskin.fit(face, tolerance="1 parsec"), "tolerance: `parsec` is not a unit of length"),
        (lambda: nurbskin.fit(face, tolerance="1,250mm"), "tolerance: .* may mean 1.250 or 1250"),
        (lambda: nurbskin.fit(face, within=99.5), "within: a share is a number from 0 to 1"),
        (lambda: nurbskin.fit(face, topology="klein"), "topology: .* use one of auto, disk, tube, sphere, torus"),
        (lambda: nurbskin.fit(face, hold_out=0.9), "hold_out"),
        (lambda: nurbskin.fit(face, degree=(3, 99)), "degree"),
        (lambda: nurbskin.fit(face, rarefy="much"), "rarefy: write degrees"),
        (lambda: nurbskin.fit(object()), "no points can be taken from this"),
        (lambda: nurbskin.fit(np.full((50, 3), np.nan)), "0 different usable points of 50"),
        (lambda: nurbskin.simulate("teapot"), "no shape is called teapot"),
        (lambda: nurbskin.Scan(np.zeros((3, 3)), triangles=[[0, 1, 3]]), "contradicts itself"),
        (lambda: nurbskin.Scan(np.zeros((3, 3)), triangles=[[0, 1, -1]]), "from 0 to"),
    ]:
        with pytest.raises(nurbskin.InvalidError, match=text):
            wrong()
    with pytest.raises(TypeError):
        nurbskin.fit(face, no_such_option=1)
    with pytest.raises(nurbskin.UnsupportedError, match="ordered"):
        nurbskin.fit(face, method="interpolate")


def test_options_have_the_names_of_the_command_line(face):
    result = nurbskin.fit(face, "0.2mm", degree=(2, 3), max_control_points=400, hold_out=0.1, trim="off", unit="mm")
    assert result.surface.degree == (2, 3) and result.tolerance == 0.2
    assert result.summary["deviation"]["hold_out"]["count"] == 400
    assert nurbskin.fit(face, "0.2mm", unit="in").tolerance == pytest.approx(0.2 / 25.4)


@pytest.mark.parametrize("text,value", [("20µm", 0.02), ("0,5mm", 0.5), ("0.05 cm", 0.5), ("2thou", 0.0508)])
def test_tolerances_are_lengths_as_the_command_takes_them(fitted, text, value):
    points = fitted.points[:50]
    expected = (np.abs(fitted.deviation(points).upper) <= value).mean()
    for deviation in [fitted.deviation(points, tolerance=text), fitted.surface.deviation(points, text)]:
        assert deviation.statistics["within_tolerance"] == pytest.approx(expected, abs=1e-12)


def test_a_share_of_the_diagonal_is_a_tolerance(face):
    result = nurbskin.fit(face, "0.2%", within=0.9)
    low, high = np.array(result.summary["input"]["bounding_box"])
    assert result.tolerance == pytest.approx(0.002 * np.linalg.norm(high - low))
    assert result.within == result.summary["within"] == 0.9


def test_without_a_tolerance_nothing_is_judged(face):
    result = nurbskin.fit(face)
    assert result.verdict == result.summary["verdict"] == "not_asked"
    assert result.tolerance is None and result.within is None and result.reasons == []
    assert "no tolerance was given" in result.reason
    for deviation in [result.deviation(), result.deviation(face.points[:9]), result.surface.deviation(face.points[:9])]:
        assert deviation.statistics["within_tolerance"] is None
    assert result.deviation(tolerance=1e6).statistics["within_tolerance"] == 1.0
    assert result.deviation(tolerance="0.01um").statistics["within_tolerance"] < 0.1


def test_a_fail_says_why_where_and_what_to_do(face):
    result = nurbskin.fit(face, 0.25, max_control_points=25)
    assert result.verdict == "fail" and result.reasons
    for reason in result.reasons:
        assert set(reason) == {"what", "where", "next"} and reason["what"]
    first = result.reasons[0]
    assert first["what"] in result.reason and first["next"]
    assert np.abs(face.points - first["where"]).max(axis=1).min() < 1e-9
    assert result.reasons == result.summary["reasons"]
    # In the words of Python, not of the command line.
    assert "(max_control_points)" in first["next"] and "(tolerance)" in first["next"]
    assert "--" not in str(result.reasons) + result.reason + str(result.warnings)


def test_sentences_name_arguments_of_python(face):
    small = nurbskin.Scan(1e-3 * face.points)
    result = nurbskin.fit(small, "0.1um")
    assert any('unit="m"' in said for said in result.warnings), result.warnings
    with pytest.raises(nurbskin.UnsupportedError, match=r'method="approximate"'):
        nurbskin.fit(face, method="interpolate")


def test_signed_statistics(fitted):
    deviation = fitted.deviation()
    found, signed = deviation.statistics, deviation.signed
    assert found["mean"] == pytest.approx(np.abs(signed).mean())
    assert found["signed_mean"] == pytest.approx(signed.mean())
    assert found["signed_std"] == pytest.approx(signed.std())


def test_the_surface_is_checked_before_it_is_written(fitted, tmp_path):
    summary = fitted.summary
    assert summary["schema"] == 2 and summary["outputs"] == []
    assert summary["check"]["verdict"] == "pass" and summary["check"]["reads_back"] is True
    assert fitted.write(tmp_path / "face.step") == summary["check"]
    assert fitted.write(tmp_path / "face.stl") is None
    assert isinstance(fitted.details, list) and not set(fitted.details) & set(fitted.warnings)
    # It crosses itself: that is a fail without a tolerance, too, and written or not.
    a = np.linspace(0, 1.7 * np.pi, 60)
    y = np.linspace(0, 20, 20)
    x, z = 10 * np.sin(2 * a), 10 * np.sin(a)
    grid = np.stack(np.broadcast_arrays(x[:, None], y, z[:, None]), axis=-1)
    crossed = nurbskin.fit(grid, method="interpolate")
    assert crossed.verdict == "fail", crossed.reason
    assert crossed.summary["check"]["verdict"] == "fail"
    again = json.loads(json.dumps(crossed.reasons))
    crossed.write(tmp_path / "crossed.step")
    crossed.report(tmp_path / "crossed.json", tmp_path / "crossed.html")
    written = json.loads((tmp_path / "crossed.json").read_text())
    assert written["verdict"] == "fail" and written["reasons"] == again
    assert '"verdict":{"verdict":"fail"' in (tmp_path / "crossed.html").read_text()


def test_who_made_it_is_in_the_header(fitted, tmp_path):
    fitted.write(tmp_path / "face.step", author="A. Person", organization="Some Institute")
    text = (tmp_path / "face.step").read_text()
    assert "A. Person" in text and "Some Institute" in text


def test_far_off_coordinates(face):
    far = face.points + [4.0e6, -7.0e6, 0]
    result = nurbskin.fit(far, tolerance=0.2)
    assert result.verdict == "pass"
    low, high = far.min(axis=0), far.max(axis=0)
    at = result.surface(0.5, 0.5)
    assert (low <= at).all() and (at <= high).all()
    assert np.abs(result.deviation(far[:100]).signed).max() < 0.3


def test_results_travel(fitted, tmp_path):
    again = pickle.loads(pickle.dumps(fitted))
    assert again.surface == fitted.surface and again.summary == fitted.summary
    assert np.array_equal(again.deviation().signed, fitted.deviation().signed)
    for result, name in [(fitted, "a"), (again, "b")]:
        result.write(tmp_path / f"{name}.igs")
    texts = [(tmp_path / f"{name}.igs").read_text().splitlines()[-40:-5] for name in "ab"]
    assert texts[0] == texts[1]
    for kind in [nurbskin.Result, nurbskin.Scan]:
        with pytest.raises(nurbskin.InvalidError):
            kind._restored(b"nonsense", None)


def test_scans_travel(face, sheet):
    grid = sheet[0].copy()
    grid[3, 4] = np.nan
    for scan in [face, nurbskin.Scan(grid, unit="in"), nurbskin.Scan(grid[0], triangles=[[0, 1, 2]])]:
        again = pickle.loads(pickle.dumps(scan))
        assert np.array_equal(again.points, scan.points) and again.unit == scan.unit
        assert (again.organisation, again.grid, again.warnings) == (scan.organisation, scan.grid, scan.warnings)
    assert np.array_equal(nurbskin.Scan(grid).array, grid, equal_nan=True)


def test_progress_is_told_and_its_exceptions_stop_the_fit(face):
    stages = []
    nurbskin.fit(face, progress=lambda stage, done, total: stages.append(stage))
    assert "clean" in stages and "approximate" in stages

    def stop(stage, done, total):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        nurbskin.fit(face, progress=stop)
    with pytest.raises(TypeError, match="progress"):
        nurbskin.fit(face, progress=3)


def test_bars(face, capfd):
    pytest.importorskip("tqdm")
    nurbskin.fit(face, progress=True)
    assert "approximate" in capfd.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="signals are POSIX's")
def test_ctrl_c_stops_a_long_fit():
    code = (
        "import nurbskin, sys\n"
        "scan = nurbskin.simulate('face', points=2_000_000, noise=0.05, shuffled=True)\n"
        "print('ready', flush=True)\n"
        "try:\n    nurbskin.fit(scan)\nexcept KeyboardInterrupt:\n    print('stopped', flush=True)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    assert child.communicate(timeout=60)[0] == "stopped\n"
    assert child.returncode == 0


def test_other_threads_run_meanwhile_and_results_are_the_same(face, fitted):
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda _: nurbskin.fit(face, tolerance=0.25), range(4)))
    done.set()
    ticker.join()
    assert all(result.surface == fitted.surface for result in results)
    # Nobody held the lock for long.
    assert max(np.diff(ticks)) < 0.5


def resident():
    """Resident memory in bytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="memory is read from /proc")
def test_memory_does_not_grow(surface, sheet):
    grid, u, v = sheet
    points = grid.reshape(-1, 3)
    small = nurbskin.fit(points[::4], tolerance=1.0)

    def all_calls():
        surface(u[:, None], v).sum()
        surface.control_points.sum()
        surface.deviation(points[:50]).signed.sum()
        surface.triangles(0.1)
        pickle.loads(pickle.dumps(surface))
        nurbskin.interpolate(grid)
        nurbskin.Scan(points).points.sum()
        small.deviation().signed.sum()
        pickle.loads(pickle.dumps(small))
        try:
            nurbskin.fit(points, tolerance=-1)
        except nurbskin.InvalidError:
            pass

    for _ in range(100):
        all_calls()
    before = resident()
    for _ in range(1000):
        all_calls()
    # A leak of one small array (1 kB) per call would be ten times this.
    assert resident() - before < 8e6


def test_forks_are_told_what_to_do(face):
    nurbskin.fit(face, tolerance=0.3)
    code = (
        "import multiprocessing, nurbskin\n"
        "scan = nurbskin.simulate('saddle', points=900)\n"
        "surface = nurbskin.fit(scan).surface\n"
        "def work(_):\n"
        "    for call in [lambda: surface.area, lambda: surface.bounds, lambda: nurbskin.info(surface), lambda: nurbskin.fit(scan)]:\n"
        "        try:\n            call()\n        except nurbskin.UnsupportedError as error:\n            said = str(error)\n"
        "        else:\n            return 'not refused'\n"
        "    return said\n"
        "with multiprocessing.get_context('fork').Pool(1) as pool:\n    print(pool.map(work, [0])[0])\n"
    )
    if not hasattr(os, "fork"):
        pytest.skip("this system has no forks")
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=60)
    assert "spawn" in done.stdout, done


def test_strange_arrays(face, sheet):
    masked = np.ma.masked_array(face.points.copy(), mask=np.zeros((len(face), 3), dtype=bool))
    masked[5] = [1e6, 1e6, 1e6]
    masked.mask[5] = True
    assert np.isnan(nurbskin.Scan(masked).points[5]).all()
    for wrong in [face.points + 1j, [["a", "b", "c"]], np.array(["2020-01-01"] * 3, dtype="datetime64[D]"), [[10**400, 2, 3]]]:
        with pytest.raises(nurbskin.InvalidError, match="numbers are needed"):
            nurbskin.Scan(wrong)
    with pytest.raises(nurbskin.InvalidError, match="triangles"):
        nurbskin.Scan(face.points, triangles=[[0, 1, 2**32 + 2]])
    grid = sheet[0]
    scan = nurbskin.Scan(grid, normals=grid + 1)
    assert np.array_equal(scan.normals, scan.points + 1)
    with pytest.raises(nurbskin.InvalidError, match="triangles"):
        nurbskin.Scan(grid, triangles=[[0, 1, 2]])
    for option in [{"max_control_points": -1}, {"enrich": -1}, {"enrich": 7}, {"grid": (-1, 10)}]:
        with pytest.raises(nurbskin.InvalidError, match=next(iter(option))):
            nurbskin.fit(face, **option)


def test_deviations_travel(fitted):
    deviation = fitted.deviation()
    again = pickle.loads(pickle.dumps(deviation))
    assert np.array_equal(again.signed, deviation.signed) and again.statistics == deviation.statistics
    assert fitted.surface is fitted.surface


def test_a_report_of_a_scan_that_is_gone(face, tmp_path):
    path = tmp_path / "scan.ply"
    face.write(path)
    result = nurbskin.fit(path, tolerance=0.3)
    checksum = hashlib.sha256(path.read_bytes()).hexdigest()
    assert checksum in result.page()
    path.write_text("another file\n")
    assert hashlib.sha256(path.read_bytes()).hexdigest() not in result.page()
    path.unlink()
    result.report(tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size > 10_000


def test_many_threads_add():
    knots = np.r_[[0.0] * 3, np.linspace(0, 1, 6), [1.0] * 3]
    sums = nurbskin.NormalSums(knots, knots)
    random = np.random.default_rng(0)
    parts = [(random.random((5000, 3)), random.random((5000, 2))) for _ in range(8)]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda part: sums.add(*part), parts))
    assert sums.count == 40_000
    sums.merge(sums)
    assert sums.count == 80_000


@pytest.mark.skipif(os.name == "nt", reason="signals are POSIX's")
def test_ctrl_c_stops_what_does_not_ask():
    code = (
        "import numpy as np, nurbskin, signal, threading, os, time\n"
        "grid = np.random.default_rng(0).random((90, 90, 3))\n"
        "threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()\n"
        "start = time.time()\n"
        "try:\n    nurbskin.enrich(grid, 6)\nexcept KeyboardInterrupt:\n"
        "    print('stopped', time.time() - start < 3, flush=True)\n    os._exit(0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "stopped True\n", done


def interrupted_after(seconds, call):
    """Ctrl-C in the midst of a call. Returns how long it went on."""
    timer = threading.Timer(seconds, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    start = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            call()
    finally:
        timer.cancel()
        timer.join()
    return time.monotonic() - start - seconds


def test_ctrl_c_while_numbers_are_made():
    class Slow:
        def __array__(self, dtype=None, copy=None):
            time.sleep(10)

    class Broken:
        def __array__(self, dtype=None, copy=None):
            raise MemoryError("full")

    assert interrupted_after(0.2, lambda: nurbskin.fit(Slow())) < 2
    with pytest.raises(MemoryError):
        nurbskin.fit(Broken())
    with pytest.raises(nurbskin.InvalidError, match="numbers are needed"):
        nurbskin.Scan(np.eye(3), triangles=[[0, 1], [2]])


def test_ctrl_c_in_evaluation(fitted):
    many = np.random.default_rng(1).uniform(0, 1, (2, 20_000_000))
    assert interrupted_after(0.2, lambda: fitted.surface.curvature(*many)) < 2


def test_ctrl_c_adds_nothing():
    knots = np.r_[[0] * 4, np.linspace(0, 1, 60)[1:-1], [1] * 4]
    sums = nurbskin.NormalSums(knots, knots)
    uv = np.random.default_rng(1).uniform(0, 1, (20_000_000, 2))
    points = np.column_stack([uv, uv[:, 0]])
    sums.add(points[:1000], uv[:1000])
    interrupted_after(0.4, lambda: sums.add(points, uv))
    time.sleep(3)
    assert sums.count == 1000


def test_ctrl_c_in_the_midst_of_a_sequence():
    class Interrupted(Sequence):
        def __len__(self):
            return 3

        def __getitem__(self, at):
            raise KeyboardInterrupt

    knots = [0, 0, 0, 0, 1, 1, 1, 1]
    with pytest.raises(nurbskin.InvalidError, match="origin: three numbers"):
        nurbskin.NormalSums(knots, knots, origin=(1, 2))
    with pytest.raises(KeyboardInterrupt):
        nurbskin.NormalSums(knots, knots, origin=Interrupted())


def test_a_changed_scan_is_not_overwritten(tmp_path):
    path = tmp_path / "scan.ply"
    nurbskin.simulate("saddle", points=900).write(path)
    result = nurbskin.fit(path, 0.5)
    os.utime(path, (1, 1))
    with pytest.raises(nurbskin.InvalidError, match="also an input"):
        result.write(path)


def test_a_scan_is_of_the_file_that_was_read(tmp_path, monkeypatch):
    first, second = (nurbskin.simulate("saddle", points=n) for n in (900, 1600))
    monkeypatch.chdir(tmp_path)
    first.write("scan.ply")
    checksum = hashlib.sha256((tmp_path / "scan.ply").read_bytes()).hexdigest()
    scan = pickle.loads(pickle.dumps(nurbskin.read("scan.ply")))
    assert checksum in nurbskin.fit(scan, 0.5).page()
    monkeypatch.chdir("/")
    assert scan.path == tmp_path / "scan.ply"
    second.write(tmp_path / "scan.ply")
    other = hashlib.sha256((tmp_path / "scan.ply").read_bytes()).hexdigest()
    page = nurbskin.fit(scan, 0.5).page()
    assert other not in page and checksum not in page


def test_lines_of_points_are_the_cells_of_an_array(tmp_path):
    cells = nurbskin.simulate("saddle", points=900).array
    cells[3:6, 4:9] = np.nan
    scan = nurbskin.Scan(cells)
    fitted = nurbskin.fit(scan, 0.5)
    assert np.array_equal(scan.points[fitted.indices], fitted.points)
    fitted.report(tmp_path / "points.csv")
    index, *places = np.genfromtxt(tmp_path / "points.csv", delimiter=",", skip_header=1, usecols=range(4)).T
    m, n, _ = cells.shape
    assert np.array_equal(index, np.arange(m * n))
    # Counted along the first axis first, as the points of the scan are.
    np.testing.assert_allclose(np.transpose(places), cells.transpose(1, 0, 2).reshape(-1, 3), atol=1e-9)


def test_values_of_options_are_said_as_arguments():
    hammer = nurbskin.simulate("hammer", points=3000, noise=0.3, mesh=True)
    told = nurbskin.fit(hammer, "0.5%", layout="network").details
    assert any(text.endswith("(`sharp=DEGREES` keeps them)") for text in told), told
    grid = nurbskin.simulate("saddle", points=400).array
    told = nurbskin.fit(grid, method="interpolate", enrich=1).warnings
    assert any(text.endswith('rarefy=DEGREES or rarefy="MxN" thins it out') for text in told), told


def test_options_without_effect_are_told(face):
    result = nurbskin.fit(face, enrich=2, rarefy=20, parameters="chord")
    told = [text for text in result.warnings if "has no effect" in text]
    assert [text.split()[1] for text in told] == ["enrichment", "rarefaction", "choice"]
    grid = nurbskin.simulate("saddle", points=900).array
    m, n, _ = grid.shape
    assert nurbskin.fit(grid, 0.5, grid=(m, n)).surface == nurbskin.fit(grid, 0.5).surface
    with pytest.raises(nurbskin.InvalidError, match="contradicts the scan"):
        nurbskin.fit(grid[:-1], 0.5, grid=(n, m - 1))
    for wrong in [(3, 4, 5), 12, "3x4", (0.5, 2)]:
        with pytest.raises(nurbskin.InvalidError, match="grid: two whole numbers"):
            nurbskin.fit(grid, 0.5, grid=wrong)


def test_bodies_are_clouds_or_meshes():
    assert "unordered" in repr(nurbskin.simulate("knot", points=500))
    assert "mesh" in repr(nurbskin.simulate("tee", points=1000, mesh=True))
    with pytest.raises(nurbskin.InvalidError, match="a pot has no mesh"):
        nurbskin.simulate("pot", mesh=True)


def test_every_shape_is_documented():
    text = " ".join(nurbskin.simulate.__doc__.split())
    listed = text.split("shape : ")[1].split(".")[0].replace(" or ", ", ").split(", ")
    with pytest.raises(nurbskin.InvalidError) as caught:
        nurbskin.simulate("dome")
    assert str(caught.value).split("use one of ")[1].split(", ") == listed


def test_a_body_with_handles_becomes_a_network() -> None:
    scan = nurbskin.simulate("double-torus", points=3000, mesh=True)
    with pytest.raises(nurbskin.UnsupportedError, match='layout="network"'):
        nurbskin.fit(scan, tolerance="0.3%", layout="single")
    result = nurbskin.fit(scan, tolerance="0.3%", layout="network", sharp="off")
    assert result.layout == "network"
    assert result.topology is None
    assert {face for edge in result.edges for face in edge.faces} == set(range(len(result.surfaces)))
    edge = result.edges[0]
    assert edge.kind == "smooth" and edge.jump is not None and len(edge.faces) == 2
    ends = edge.points(np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends, edge.control_points[[0, -1]])
