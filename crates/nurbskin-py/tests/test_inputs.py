"""What other libraries have: their objects, their bars, their type hints. And what help() says."""

import inspect
import subprocess
import sys
import typing
import warnings
from collections import UserList
from types import SimpleNamespace

import numpy as np
import pytest

import nurbskin
import nurbskin._api
from nurbskin import cluster
from nurbskin._input import scan_of

POINTS = np.random.default_rng(3).random((50, 3))


class Interface:
    """Only numpy's interface of arrays."""

    def __init__(self, array):
        self.array = array
        self.__array_interface__ = array.__array_interface__


def tensor(array):
    """As a tensor of Open3D's, of which numpy alone makes an array of objects."""
    there = SimpleNamespace(numpy=lambda: array)
    return SimpleNamespace(cpu=lambda: there, numpy=lambda: None)


@pytest.mark.parametrize("make", [memoryview, Interface, tensor, UserList], ids=lambda make: make.__name__)
def test_all_that_numpy_takes_for_an_array(make):
    assert np.array_equal(scan_of(make(POINTS)).points, POINTS)


@pytest.mark.parametrize("wrong", ["text", b"text", {"a": POINTS}, {1.0}, 5, object(), iter(POINTS), None])
def test_what_has_no_points_is_refused(wrong):
    with pytest.raises(nurbskin.InvalidError, match=f"^{type(wrong).__name__}: no points can be taken from this"):
        scan_of(wrong)


def test_empty_meshes_have_no_points():
    class Empty(dict):
        pass

    for empty in [
        SimpleNamespace(vertex=Empty(), triangle=Empty()),
        SimpleNamespace(point=Empty()),
        SimpleNamespace(vertices=np.empty((0, 3)), faces=np.empty((0, 3))),
    ]:
        with pytest.raises(nurbskin.InvalidError, match="it has no points"):
            scan_of(empty)


def test_pyvista():
    pyvista = pytest.importorskip("pyvista")
    plane = np.meshgrid([0.0, 1, 2], [0.0, 1], [0.0], indexing="ij")
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        cloud = scan_of(pyvista.PointSet(POINTS))
        assert np.abs(cloud.points - POINTS).max() < 1e-6 and cloud.triangles is None
        image = pyvista.ImageData(dimensions=(3, 2, 1))
        for grid in [pyvista.StructuredGrid(*plane), image, image.cast_to_unstructured_grid()]:
            scan = scan_of(grid)
            assert len(scan.points) == 6 and len(scan.triangles) == 4
    assert not [str(warning.message) for warning in warned if "algorithm" in str(warning.message)]


def test_open3d():
    open3d = pytest.importorskip("open3d")
    for array in [open3d.utility.Vector3dVector(POINTS), open3d.core.Tensor(POINTS)]:
        assert np.array_equal(scan_of(array).points, POINTS)
    assert len(scan_of(open3d.t.geometry.TriangleMesh.create_box()).triangles) == 12
    for empty in [open3d.t.geometry.TriangleMesh(), open3d.t.geometry.PointCloud(), open3d.geometry.PointCloud()]:
        with pytest.raises(nurbskin.InvalidError, match="it has no points"):
            scan_of(empty)


def test_scenes_and_units_of_trimesh():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box()
    for units, unit in {"millimeters": "mm", "mm": "mm", "inches": "in", "in": "in", "meters": "m", "parsecs": "mm"}.items():
        box.units = units
        assert scan_of(box).unit == unit
    box.units = None
    assert scan_of(box).unit == "mm"
    moved = box.copy().apply_translation([5, 0, 0])
    scene = trimesh.Scene([box, moved])
    scene.units = "cm"
    scan = scan_of(scene)
    assert len(scan.points) == 16 and len(scan.triangles) == 24 and scan.unit == "cm"
    assert scan.points[:, 0].max() == 5.5
    # As of versions of trimesh before to_geometry.
    older = SimpleNamespace(geometry={}, graph=None, dump=lambda concatenate: box if concatenate else None)
    assert len(scan_of(older).points) == 8
    # Units of others are other things.
    assert scan_of(SimpleNamespace(vertices=POINTS, units=np.ones(3))).unit == "mm"


def test_bars_of_a_class(face, capfd):
    tqdm = pytest.importorskip("tqdm")
    made = []

    class Bar(tqdm.tqdm):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            made.append(self)

    nurbskin.fit(face, tolerance=0.5, progress=Bar)
    assert "approximate" in [bar.desc for bar in made] and all(bar.disable for bar in made)
    assert "approximate" in capfd.readouterr().err
    with tqdm.tqdm() as bar, pytest.raises(TypeError, match="give tqdm's class"):
        nurbskin.fit(face, progress=bar)


@pytest.mark.parametrize(
    "thing",
    [getattr(nurbskin._api, name) for name in nurbskin._api.__all__]
    + [cluster.approximate, cluster.fit_many]
    + [nurbskin.Curvature, nurbskin.Interpolation, nurbskin.Rarefaction, nurbskin.Approximation],
    ids=lambda thing: thing.__name__,
)
def test_type_hints_are_found(thing):
    assert typing.get_type_hints(thing)


@pytest.mark.parametrize("kind", [nurbskin.Curvature, nurbskin.Interpolation, nurbskin.Rarefaction, nurbskin.Approximation])
def test_fields_are_documented(kind):
    for name in kind._fields:
        text = inspect.getdoc(getattr(kind, name))
        assert not text.startswith("Alias") and text.split()[0] in inspect.getdoc(kind)


def test_the_cluster_is_there_without_dask():
    code = (
        "import sys, nurbskin\nassert nurbskin.cluster.approximate\n"
        "assert not {'dask', 'distributed', 'tqdm', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_a_scan_is_an_array_of_its_points():
    scan = nurbskin.simulate("saddle", points=900)
    assert np.array_equal(np.asarray(scan), scan.points) and np.asarray(scan).shape == (len(scan), 3)
    assert np.asarray(scan, dtype=np.float32).dtype == np.float32
    assert np.array_equal(np.array(scan), scan.points)


def test_an_ordered_scan_is_a_grid():
    scan = nurbskin.simulate("saddle", points=900)
    for rule in [{"rarefy": "8x9"}, {"tolerance": "0.5%"}, {"tolerance": 0.05}]:
        of_scan, of_array = nurbskin.rarefy(scan, **rule), nurbskin.rarefy(scan.array, **rule)
        assert all(np.array_equal(a, b) for a, b in zip(of_scan, of_array, strict=True) if a is not None)
    kept = nurbskin.rarefy(scan, "8x9")
    assert (len(kept.i), len(kept.j)) == (8, 9)
    assert nurbskin.interpolate(scan).surface == nurbskin.interpolate(scan.array).surface
    assert np.array_equal(nurbskin.enrich(scan), nurbskin.enrich(scan.array))
    with pytest.raises(nurbskin.InvalidError, match="ordered points are needed.* unordered cloud"):
        nurbskin.rarefy(nurbskin.simulate("saddle", points=900, shuffled=True), "8x9")
    holes = scan.array.copy()
    holes[3, 4] = np.nan
    with pytest.raises(nurbskin.InvalidError, match="1 of the cells of this one are empty"):
        nurbskin.rarefy(nurbskin.Scan(holes), "8x9")


def test_a_format_is_told_or_said(tmp_path):
    path = tmp_path / "points.dat"
    path.write_text("0 0 0\n1 0 0\n0 1 0\n1 1 0\n")
    scan = nurbskin.read(path, format="xyz")
    assert len(scan) == 4 and scan.path == path and np.array_equal(scan.points, nurbskin.read(path).points)
    with pytest.raises(nurbskin.ReadError, match="points.dat, line 1"):
        nurbskin.read(path, format="ply")
    with pytest.raises(nurbskin.InvalidError, match="unknown format doc"):
        nurbskin.read(path, format="doc")
    for read, format in [(nurbskin.read, "xyz"), (nurbskin.read_cad, "step")]:
        with pytest.raises(FileNotFoundError, match="nothing.dat"):
            read(tmp_path / "nothing.dat", format=format)
    surface = nurbskin.NurbsSurface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1]]], [0, 0, 1, 1], [0, 0, 1, 1], 1)
    surface.write(tmp_path / "part.step")
    (tmp_path / "part.step").rename(tmp_path / "part.dat")
    assert len(nurbskin.read_cad(tmp_path / "part.dat", format="step")) == 1


def test_a_mesh_may_cut_the_edges_of_its_body():
    along, across = [nurbskin.simulate("bracket", points=3000, mesh=True, unaligned=cut) for cut in [False, True]]
    assert along.triangles is not None and across.triangles is not None and not np.array_equal(along.points[:99], across.points[:99])
    with pytest.raises(nurbskin.InvalidError, match="mesh=True"):
        nurbskin.simulate("bracket", unaligned=True)
