"""The verbs of the command in Python: the same figures as the command's JSON, on files and on objects."""

import json
import os
import pathlib
import pickle
import shutil
import subprocess

import numpy as np
import pytest

import nurbskin

TOLERANCE = 0.25


def command():
    """The command, as it was built beside this package; skips where it was not."""
    here = pathlib.Path(__file__).resolve()
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", here.parents[3] / "target"))
    found = [target / kind / "nurbskin" for kind in ("debug", "release")]
    found = [path for path in [os.environ.get("NURBSKIN_COMMAND"), *found] if path and pathlib.Path(path).is_file()]
    known = max(found, key=lambda path: pathlib.Path(path).stat().st_mtime, default=shutil.which("nurbskin"))
    if known is None:
        pytest.skip("the command is not built: cargo build -p nurbskin, or set NURBSKIN_COMMAND")
    return str(known)


def said(*arguments):
    """The JSON of the command."""
    done = subprocess.run([command(), *map(str, arguments), "--json"], capture_output=True, text=True)
    assert done.returncode in (0, 3), done.stderr
    return json.loads(done.stdout)


def without(value, *names):
    """What does not depend on when, or by whom, it was measured."""
    dropped = {"time", "nurbskin", "schema", "next", "reason", "warnings", *names}
    if isinstance(value, dict):
        return {key: without(item, *names) for key, item in value.items() if key not in dropped}
    return [without(item, *names) for item in value] if isinstance(value, list) else value


@pytest.fixture(scope="module")
def files(tmp_path_factory, face, fitted):
    """A scan, the surface that was fitted to it, and the scan turned by two degrees."""
    folder = tmp_path_factory.mktemp("verbs")
    face.write(folder / "face.ply")
    fitted.write(folder / "face.step", folder / "face.igs")
    turn = np.deg2rad(2)
    matrix = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    nurbskin.Scan(face.points @ matrix.T + [1.0, -2.0, 0.5]).write(folder / "moved.ply")
    return folder


def test_a_cad_file_is_its_faces(files, fitted):
    model = nurbskin.read_cad(files / "face.step")
    assert (len(model), model.format, model.unit, model.path) == (1, "step", "mm", files / "face.step")
    assert set(model.header) == {"author", "organization", "system", "date"} and "nurbskin" in model.header["system"]
    found = said("info", files / "face.step")["files"][0]
    assert nurbskin.info(files / "face.step") == found and model.summary == found
    assert found["kind"] == "cad" and model.area == found["area"] and model.closed is found["closed"] is False
    assert np.array_equal(model.bounds, found["bounding_box"]) and model.volume is None
    u, v = np.linspace(0, 1, 7)[:, None], np.linspace(0, 1, 5)
    assert np.abs(model.surfaces[0](u, v) - fitted.surface(u, v)).max() < 1e-9
    # The other formats and the model in memory are the same model.
    for same in [nurbskin.read_cad(files / "face.igs"), fitted.model, pickle.loads(pickle.dumps(model))]:
        assert same.area == pytest.approx(model.area, rel=1e-9)
        assert np.abs(same.bounds - model.bounds).max() < 1e-6
    with pytest.raises(nurbskin.ReadError, match="this is a scan"):
        nurbskin.read_cad(files / "face.ply")


def test_triangles_of_a_model_have_its_area_and_bounds(files):
    model = nurbskin.read_cad(files / "face.step")
    points, triangles, faces = model.triangles(0.01)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(model.area, rel=1e-3) and area <= model.area * (1 + 1e-6)
    assert set(faces) == {0} and len(faces) == len(triangles)
    assert np.abs([points.min(axis=0), points.max(axis=0)] - model.bounds).max() < 0.02
    mesh = model.to_trimesh(0.01)
    assert mesh.area == pytest.approx(area) and mesh.units == "mm"


def test_closed_models_have_a_volume(tmp_path):
    """A ball as the command would write it: its area and volume are known."""
    scan = nurbskin.simulate("sphere", points=3000)
    result = nurbskin.fit(scan, tolerance=0.05)
    model = result.model
    radius = np.linalg.norm(scan.points - scan.points.mean(axis=0), axis=1).mean()
    assert model.closed
    assert model.area == pytest.approx(4 * np.pi * radius**2, rel=1e-2)
    assert abs(model.volume) == pytest.approx(4 / 3 * np.pi * radius**3, rel=1e-2)


def test_deviation_is_that_of_the_command(files, face):
    expected = said("deviation", files / "face.ply", files / "face.step", "-t", TOLERANCE)
    found = nurbskin.deviation(files / "face.ply", files / "face.step", TOLERANCE)
    assert without(found.summary) == without(expected) and found.verdict == expected["verdict"] == "pass"
    assert found.tolerance == TOLERANCE and found.within == 0.995 and found.alignment is None
    # Objects in memory are the same as files.
    scan, cad = nurbskin.read(files / "face.ply"), nurbskin.read_cad(files / "face.step")
    again = nurbskin.deviation(scan, cad, "0.25mm")
    assert without(again.summary) == without(expected)
    assert np.array_equal(again.deviation().signed, found.deviation().signed)
    # The distances are those of the model, and of the points themselves.
    distances = cad.deviation(face.points)
    assert np.abs(np.abs(distances.signed) - found.deviation().upper).max() < 1e-9
    near = cad.closest_point(face.points)
    assert np.abs(near.distance - distances.upper).max() < 1e-9
    assert np.abs(np.linalg.norm(face.points - near.points, axis=1) - near.distance).max() < 1e-12


def test_an_alignment_is_that_of_the_command_and_the_motion_itself(files):
    expected = said("deviation", files / "moved.ply", files / "face.step", "-t", TOLERANCE, "--align")
    found = nurbskin.deviation(files / "moved.ply", files / "face.step", TOLERANCE, align=True)
    assert without(found.summary) == without(expected) and found.verdict == "pass"
    assert found.alignment.shape == (4, 4)
    scan = nurbskin.read(files / "moved.ply")
    homogeneous = np.column_stack([scan.points, np.ones(len(scan))])
    assert np.abs((homogeneous @ found.alignment.T)[:, :3] - found.points).max() < 1e-9
    assert np.linalg.det(found.alignment[:3, :3]) == pytest.approx(1)
    # Without it the scan is not where the model is.
    assert nurbskin.deviation(files / "moved.ply", files / "face.step", TOLERANCE).verdict == "fail"


def test_the_motion_is_right_far_from_the_origin(files):
    """Coordinates of a survey: the scan is read less an offset, and the matrix is for the coordinates of the file."""
    offset = np.array([4.5e6, 5.4e6, 300.0])
    model = nurbskin.read_cad(files / "face.step").surfaces[0]
    shift = np.eye(4)
    shift[:3, 3] = offset
    scan = nurbskin.read(files / "moved.ply")
    far = nurbskin.Scan(scan.points + offset)
    found = nurbskin.deviation(far, model.transform(shift), TOLERANCE, align=True)
    homogeneous = np.column_stack([scan.points + offset, np.ones(len(scan))])
    assert np.abs((homogeneous @ found.alignment.T)[:, :3] - found.points).max() < 1e-6
    assert found.deviation().statistics["p95"] < TOLERANCE


def test_comparisons_say_what_is_wrong_in_the_words_of_python(files, face):
    found = nurbskin.deviation(files / "moved.ply", files / "face.step", TOLERANCE)
    assert found.verdict == "fail" and found.reasons and "--" not in str(found.reasons) + found.reason + str(found.warnings)
    none = nurbskin.deviation(face, files / "face.step")
    assert none.verdict == "not_asked" and none.tolerance is None and "not_asked" in repr(none)
    half = nurbskin.Scan(face.points[face.points[:, 0] < np.median(face.points[:, 0])])
    assert nurbskin.deviation(half, files / "face.step", TOLERANCE).verdict == "cannot_tell"
    assert nurbskin.deviation(half, files / "face.step", TOLERANCE, min_coverage=0).verdict == "pass"
    with pytest.raises(nurbskin.InvalidError, match="within: a share"):
        nurbskin.deviation(half, files / "face.step", TOLERANCE, within=99)
    with pytest.raises(nurbskin.ReadError, match="not a CAD file"):
        nurbskin.deviation(face, files / "face.ply")


def test_fits_and_surfaces_are_nominal_geometry(face, fitted):
    by_result = nurbskin.deviation(face, fitted, TOLERANCE)
    assert by_result.verdict == "pass"
    assert np.abs(by_result.deviation().upper - fitted.model.deviation(face.points).upper).max() < 1e-9
    whole = nurbskin.deviation(face.points, fitted.surface, TOLERANCE)
    assert np.abs(whole.deviation().upper - fitted.surface.deviation(face.points).upper).max() < 1e-9


def test_reports_of_comparisons(files, tmp_path):
    found = nurbskin.deviation(files / "face.ply", files / "face.step", TOLERANCE)
    found.report(tmp_path / "a.html", tmp_path / "a.csv", tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text())["verdict"] == "pass"
    assert len((tmp_path / "a.csv").read_text().splitlines()) == len(found.points) + 1
    page = (tmp_path / "a.html").read_text()
    assert "face.ply against face.step" in page and page.count("sha256") >= 1
    assert found.page().count("face.step") >= 1 and found.page()._repr_html_().startswith("<iframe")
    with pytest.raises(nurbskin.InvalidError, match="is also an input"):
        nurbskin.deviation(files / "face.ply", files / "face.step").report(files / "face.ply")


def test_reports_have_the_title_and_the_notes_of_the_command(files, fitted, tmp_path):
    found = nurbskin.deviation(files / "face.ply", files / "face.step", TOLERANCE)
    heading = {"title": "A mask", "notes": {"fixture": "none", "part": "R-7", "revision": 3}}
    for each in [fitted, found]:
        each.report(tmp_path / "a.html", **heading)
        page = each.page(**heading)
        assert "<title>A mask" in page and '"text":"R-7"' in page and '"text":"3"' in page
        assert (tmp_path / "a.html").read_text().count("R-7") == page.count("R-7")
        assert "A mask" not in each.page()
        for wrong in [{"": "x"}, {"part": " "}, {"a=b": "c"}, {"part": "x" * 501}]:
            with pytest.raises(nurbskin.InvalidError, match="notes: "):
                each.report(tmp_path / "b.html", notes=wrong)
    assert not (tmp_path / "b.html").exists()


def test_a_result_and_a_comparison_are_measurements(files, fitted):
    for each in [fitted, nurbskin.deviation(files / "face.ply", fitted, TOLERANCE)]:
        assert isinstance(each, nurbskin.Measurement) and isinstance(each.details, list)
        assert each.deviation(tolerance=1e-9).statistics["within_tolerance"] < 0.5
        assert each.deviation().statistics["above_tolerance"] is not None


def test_check_is_that_of_the_command(files, fitted):
    for name in ["face.step", "face.igs"]:
        expected = said("check", files / name)
        assert nurbskin.check(files / name) == expected and expected["verdict"] == "pass"
    names = [one["name"] for one in nurbskin.check(fitted)["checks"]]
    assert names == [one["name"] for one in nurbskin.check(files / "face.step")["checks"]]
    assert fitted.model.check()["faces"] == 1


def test_info_is_that_of_the_command(files, face):
    expected = said("info", files / "face.ply")["files"][0]
    assert nurbskin.info(files / "face.ply") == expected
    in_memory = nurbskin.info(face)
    assert without(in_memory, "path", "format", "unit_source") == without(expected, "path", "format", "unit_source")
    assert nurbskin.info(face.points)["points"] == len(face)


def test_convert_writes_what_the_command_writes(files, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for source, name in [("face.step", "out.igs"), ("face.igs", "out.stl"), ("face.step", "out.glb"), ("face.ply", "out.xyz")]:
        theirs, ours = tmp_path / "command" / name, tmp_path / "python" / name
        theirs.parent.mkdir(exist_ok=True)
        ours.parent.mkdir(exist_ok=True)
        expected = said("convert", files / source, "-o", theirs, "--to-unit", "cm")
        found = nurbskin.convert(files / source, ours, to_unit="cm")
        assert ours.read_bytes() == theirs.read_bytes(), name
        assert found["input"] == expected["input"] and found["outputs"][0]["bytes"] == ours.stat().st_size
    # A model in memory writes the same.
    model = nurbskin.read_cad(files / "face.step")
    assert model.write(tmp_path / "out.igs", to_unit="cm") == []
    assert (tmp_path / "out.igs").read_bytes() == (tmp_path / "python" / "out.igs").read_bytes()
    assert nurbskin.read_cad(tmp_path / "out.igs").area == pytest.approx(model.area / 100)
    with pytest.raises(nurbskin.InvalidError, match="a scan becomes a CAD file by fitting"):
        nurbskin.convert(files / "face.ply", tmp_path / "out.step")
    with pytest.raises(nurbskin.InvalidError, match="also an input"):
        model.write(files / "face.step")


def test_view_writes_a_page_and_opens_it(files, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    page = nurbskin.view(files / "face.step", tmp_path / "page.html", open=False)
    assert page == tmp_path / "page.html" and "face.step" in page.read_text() and opened == []
    for shown in [files / "face.ply", nurbskin.read(files / "face.ply"), nurbskin.simulate("saddle", points=400)]:
        page = nurbskin.view(shown)
        assert page.suffix == ".html" and opened[-1] == page.absolute().as_uri()
        page.unlink()


def test_what_is_missing_is_not_found(files, tmp_path, fitted):
    nothing, nowhere = tmp_path / "nothing.step", tmp_path / "nowhere" / "out.igs"
    for call in [
        lambda: nurbskin.read(nothing),
        lambda: nurbskin.read_cad(nothing),
        lambda: nurbskin.fit(tmp_path / "nothing.ply"),
        lambda: nurbskin.check(nothing),
        lambda: nurbskin.info(nothing),
        lambda: nurbskin.view(nothing, open=False),
        lambda: nurbskin.convert(nothing, tmp_path / "out.igs"),
        lambda: nurbskin.deviation(nothing, files / "face.step"),
        lambda: nurbskin.deviation(files / "face.ply", nothing),
        lambda: nurbskin.deviation(files / "face.ply", tmp_path / "nothing"),
    ]:
        with pytest.raises(FileNotFoundError, match="nothing.*there is no such file") as caught:
            call()
        assert isinstance(caught.value, nurbskin.ReadError)
    for call in [lambda: fitted.write(nowhere), lambda: nurbskin.convert(files / "face.step", nowhere)]:
        with pytest.raises(FileNotFoundError, match="the folder .* does not exist") as caught:
            call()
        assert isinstance(caught.value, nurbskin.WriteError)
    with pytest.raises(nurbskin.ReadError) as caught:
        nurbskin.read_cad(files / "face.ply")
    assert not isinstance(caught.value, FileNotFoundError)


def test_rarefied_and_enriched_scans_are_those_of_the_command(tmp_path):
    pot = nurbskin.simulate("pot", points=13_140)
    pot.write(tmp_path / "pot.ply")
    said("rarefy", tmp_path / "pot.ply", "-o", tmp_path / "kept.ply", "--rarefy", "20")
    kept = pot.rarefy(20)
    assert kept.grid == nurbskin.read(tmp_path / "kept.ply").grid and kept.unit == pot.unit
    assert np.array_equal(kept.points, nurbskin.read(tmp_path / "kept.ply").points)
    lines = nurbskin.rarefy(pot, 20, topology="tube")
    assert np.array_equal(kept.array, pot.array[np.ix_(lines.i, lines.j)])
    said("enrich", tmp_path / "kept.ply", "-o", tmp_path / "dense.ply", "--enrich", "1")
    dense = kept.enrich(1)
    assert np.array_equal(dense.points, nurbskin.read(tmp_path / "dense.ply").points)
    assert len(dense) > 3 * len(kept)
    with pytest.raises(nurbskin.UnsupportedError, match="order"):
        nurbskin.simulate("face", points=900, shuffled=True).rarefy(20)
    # Rows of different lengths, and an order that only the caller knows.
    rows = nurbskin.simulate("pot")
    assert rows.organisation == "rows" and rows.rarefy("18x18").grid == (18, 18)
    m, n = pot.grid
    assert nurbskin.Scan(pot.points).enrich(0, grid=(m, n)).grid == (m, n)


def test_arrays_of_scans():
    scan = nurbskin.simulate("saddle", points=900)
    assert np.array_equal(np.asarray(scan), scan.points) and np.asarray(scan, dtype=np.float32).dtype == np.float32
