"""What a notebook, matplotlib and PyVista show of a result."""

import base64
import re
import struct
import zlib

import numpy as np
import pytest

import nurbskin
from nurbskin import _nurbskin, _picture


@pytest.fixture(scope="module")
def bump():
    """A plane of 40 x 30, and a scan that is 0.2 above it where x > 20, and on it elsewhere; none of it where y > 25."""
    x, y = np.meshgrid([0.0, 40.0], [0.0, 30.0], indexing="ij")
    plane = nurbskin.NurbsSurface(np.stack([x, y, 0 * x], axis=-1), [0, 0, 1, 1], [0, 0, 1, 1], 1)
    x, y = np.meshgrid(np.arange(0.25, 40, 0.5), np.arange(0.25, 25, 0.5), indexing="ij")
    points = np.stack([x, y, np.where(x > 20, 0.2, 0.0)], axis=-1).reshape(-1, 3)
    return nurbskin.deviation(points, plane, 0.5, min_coverage=0)


def decoded(data):
    """The pixels of a PNG with the filter Sub, read without the code that wrote it."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    place, parts = 8, {}
    while place < len(data):
        length, name = struct.unpack(">I4s", data[place : place + 8])
        body = data[place + 8 : place + 8 + length]
        (sum_of_it,) = struct.unpack(">I", data[place + 8 + length : place + 12 + length])
        assert sum_of_it == zlib.crc32(name + body)
        parts[name] = body
        place += 12 + length
    width, height, depth, kind = struct.unpack(">IIBB", parts[b"IHDR"][:10])
    rows = np.frombuffer(zlib.decompress(parts[b"IDAT"]), np.uint8).reshape(height, 1 + 4 * width)
    assert (depth, kind) == (8, 6) and (rows[:, 0] == 1).all()
    # Filter 1: the difference to the pixel before, modulo 256.
    return np.cumsum(rows[:, 1:].reshape(height, width, 4), axis=1, dtype=np.uint8)


def test_the_nearer_triangle_is_seen():
    """A square at z = 1 over half of a square at z = 0, from above: x to the right where the viewer is in -y."""
    square = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]])
    points = np.vstack([square, square * [0.5, 1, 1] + [0, 0, 1]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    values = np.repeat([10.0, 20.0], 4)
    normals = np.tile([0.0, 0, 1], (8, 1))
    seen, light = _nurbskin.render(points, triangles, normals, values, 100, 100, 90.0, -90.0)
    assert seen.shape == light.shape == (100, 100)
    assert np.abs(seen[50, 5:48] - 20).max() < 1e-9 and np.abs(seen[50, 52:95] - 10).max() < 1e-9
    # It fills 94 % of the picture; the rest is empty. A face that looks at the viewer has all the light.
    assert np.isfinite(seen).mean() == pytest.approx(0.94**2, abs=0.01)
    assert np.array_equal(light > 0, np.isfinite(seen)) and np.allclose(light[light > 0], 1)
    # From below the other one is nearer.
    below, _ = _nurbskin.render(points, triangles, normals, values, 100, 100, -90.0, -90.0)
    assert np.abs(below[np.isfinite(below)] - 10).max() < 1e-9
    with pytest.raises(nurbskin.InvalidError, match="size"):
        _nurbskin.render(points, triangles, normals, values, 0, 100, 90.0, -90.0)
    with pytest.raises(nurbskin.InvalidError, match="for every vertex"):
        _nurbskin.render(points, triangles, normals, values[1:], 100, 100, 90.0, -90.0)


def test_meshes_have_the_deviation_of_the_scan(bump):
    mesh = bump._mesh()
    x, y = mesh["points"][:, 0], mesh["points"][:, 1]
    inside = y < 23
    assert np.abs(mesh["deviation"][inside & (x < 18)]).max() < 1e-9
    assert np.abs(mesh["deviation"][inside & (x > 22)] - 0.2).max() < 1e-9
    # Nobody measured there.
    assert np.isnan(mesh["deviation"][y > 28]).all() and np.isfinite(mesh["deviation"][inside]).all()
    assert np.abs(mesh["normals"] - [0, 0, 1]).max() < 1e-12 and not mesh["face"].any()
    assert np.abs(mesh["gaussian_curvature"]).max() == 0 and np.abs(mesh["mean_curvature"]).max() == 0
    assert np.abs(mesh["parameters"] * [40, 30] - mesh["points"][:, :2]).max() < 1e-9


def test_curvature_of_a_ball():
    scan = nurbskin.simulate("sphere", points=3000)
    result = nurbskin.fit(scan, tolerance=0.02)
    radius = np.linalg.norm(scan.points - scan.points.mean(axis=0), axis=1).mean()
    mesh = result._mesh()
    assert np.nanmedian(mesh["mean_curvature"]) == pytest.approx(1 / radius, rel=0.01)
    assert np.nanmedian(mesh["gaussian_curvature"]) == pytest.approx(1 / radius**2, rel=0.02)
    out = mesh["points"] - scan.points.mean(axis=0)
    assert ((out * mesh["normals"]).sum(axis=1) > 0.9 * radius).all()


def test_pyvista_has_the_arrays(bump, fitted):
    pytest.importorskip("pyvista")
    names = {"deviation", "normals", "parameters", "face", "mean_curvature", "gaussian_curvature"}
    for shown in [bump, fitted]:
        mesh = shown.to_pyvista()
        assert set(mesh.point_data) == names and mesh.active_scalars_name == "deviation"
        assert mesh.n_points == len(shown._mesh()["points"]) and mesh.is_all_triangles
    model = fitted.model.to_pyvista()
    assert set(model.point_data) == names - {"deviation"}
    assert model.area == pytest.approx(fitted.model.area, rel=1e-2)


def test_colours_tell_inside_outside_and_beyond():
    red, blue = _picture.STOPS[-1], _picture.STOPS[0]
    found = _picture.colours(np.array([-1.0, 0.0, 1.0, -1.1, 1.1, np.nan]), 1.0, True)
    expected = [blue, _picture.STOPS[2], red, _picture.UNDER, _picture.OVER, _picture.NO_DATA]
    assert np.array_equal(found, expected)
    assert np.array_equal(_picture.colours(np.array([5.0]), 1.0, False), [red])


def test_pictures_are_files_of_the_standard(bump):
    image = _picture.picture(bump, (120, 90), 90.0, -90.0)
    assert np.array_equal(decoded(_picture.png(image)), image)
    # From above: white on the left, 0.4 of the way to red on the right, grey at the top, nothing at the corners.
    assert (image[60, 20, :3] > 230).all() and image[60, 20, 3] == 255
    right = image[60, 100].astype(int)
    assert right[0] > right[2] + 20
    assert np.abs(image[8, 60, :3].astype(int) - _picture.NO_DATA).max() < 12
    assert image[0, 0, 3] == 0


def test_notebooks_show_a_picture_and_the_figures(bump, fitted):
    for shown in [fitted, bump, fitted.model]:
        text = shown._repr_html_()
        assert len(text) < 150_000 and "<script" not in text and "http" not in text
        data = re.search(r'src="data:image/png;base64,([^"]+)"', text).group(1)
        image = decoded(base64.b64decode(data))
        assert image.shape == (360, 480, 4) and 0.05 < (image[..., 3] > 0).mean() < 0.95
    text = fitted._repr_html_()
    assert fitted.verdict in text and "result.page()" in text
    # The whole report on demand.
    page = fitted.page()
    assert isinstance(page, str) and isinstance(page, nurbskin.Page) and page.startswith("<!")
    assert page._repr_html_().startswith("<iframe") and len(page._repr_html_()) > len(page)


def test_figures(bump, fitted):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    for shown, tolerance in [(bump, 0.5), (fitted, 0.25)]:
        figure = shown.plot()
        picture, histogram = figure.axes[:2]
        assert shown.verdict in picture.get_title() and len(picture.images) == 1
        assert sum(bar.get_height() for bar in histogram.patches) == len(shown.points)
        assert sorted(line.get_xdata()[0] for line in histogram.lines) == [-tolerance, tolerance]
        pyplot.close(figure)
    own = pyplot.figure()
    assert fitted.plot(elevation=80, azimuth=0, figure=own) is own
    pyplot.close(own)
