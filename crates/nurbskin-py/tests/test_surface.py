"""Surfaces against scipy and OpenCascade, and as objects of Python."""

import copy
import pickle

import numpy as np
import pytest

import nurbskin
from conftest import clamped


def test_values_and_derivatives_are_those_of_scipy(surface):
    spline = surface.to_scipy()
    (a, b), (c, d) = surface.domain
    random = np.random.default_rng(1)
    at = np.column_stack([random.uniform(a, b, 1000), random.uniform(c, d, 1000)])
    assert np.abs(surface(*at.T) - spline(at)).max() <= 1e-14 * np.abs(spline(at)).max()
    for order in [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]:
        expected = spline(at, nu=order)
        got = surface(*at.T, du=order[0], dv=order[1])
        assert np.abs(got - expected).max() <= 1e-12 * np.abs(expected).max(), order


def test_periodic_surfaces_are_those_of_scipy():
    breaks = np.array([0, 0.2, 0.5, 0.6, 1.0])
    knots = np.r_[breaks[-4:-1] - 1, breaks, breaks[1:4] + 1]
    angle = 2 * np.pi * np.arange(4) / 4
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    net = np.stack([ring + [0, 0, z] for z in range(4)])
    net = np.concatenate([net, net[:, :3]], axis=1)
    tube = nurbskin.NurbsSurface(net, clamped(3, [0, 1]), knots, periodic=(False, True))
    at = np.random.default_rng(2).uniform(0, 1, (500, 2))
    assert np.abs(tube(*at.T) - tube.to_scipy()(at)).max() <= 1e-14
    assert np.abs(tube(0.3, 1.25) - tube(0.3, 0.25)).max() <= 1e-15


def test_parameters_broadcast(surface):
    u, v = np.linspace(0, 1, 5), np.linspace(-1, 2, 7)
    assert surface(0.5, 0.5).shape == (3,)
    assert surface(u[:, None], v).shape == (5, 7, 3)
    assert surface.normal(u[:, None], v).shape == (5, 7, 3)
    assert surface.curvature(u, 0.0).gaussian.shape == (5,)
    assert np.array_equal(surface(u[:, None], v)[2, 3], surface(u[2], v[3]))
    assert surface([], []).shape == (0, 3)
    with pytest.raises(nurbskin.InvalidError, match="parameter 1 is not finite"):
        surface([0.1, np.nan], 0.0)


@pytest.fixture
def cylinder():
    """An exact quarter of a cylinder of radius 1."""
    arc = [[[1, 0, 0], [1, 1, 0], [0, 1, 0]], [[1, 0, 2], [1, 1, 2], [0, 1, 2]]]
    return nurbskin.NurbsSurface(arc, [0, 0, 1, 1], [0, 0, 0, 1, 1, 1], (1, 2), [[1, 0.5**0.5, 1]] * 2)


def test_curvature_of_a_cylinder(cylinder):
    found = cylinder.curvature(np.linspace(0, 1, 9)[:, None], np.linspace(0, 1, 7))
    assert np.abs(found.gaussian).max() < 1e-14
    assert np.abs(np.abs(found.mean) - 0.5).max() < 1e-14
    assert np.abs(np.abs(found.k1 - found.k2) - 1).max() < 1e-14
    normal = cylinder.normal(0.5, np.linspace(0, 1, 7))
    assert np.abs(np.abs(np.sum(normal * cylinder(0.0, np.linspace(0, 1, 7)), axis=1)) - 1).max() < 1e-14


def test_arrays_share_the_memory_of_the_surface(surface):
    net = surface.control_points
    assert net.shape == (7, 4, 3)
    assert np.shares_memory(net, surface.control_points)
    assert np.shares_memory(surface.knots_u, surface.knots_u)
    with pytest.raises(ValueError):
        net[0, 0, 0] = 1
    # The array keeps the memory.
    copied = net.copy()
    del surface
    assert np.array_equal(net, copied)


def test_weights(cylinder):
    assert cylinder.rational and np.array_equal(cylinder.weights, [[1, 0.5**0.5, 1]] * 2)
    radius = np.hypot(*cylinder(0.3, np.linspace(0, 1, 50))[:, :2].T)
    assert np.abs(radius - 1).max() < 1e-15
    with pytest.raises(nurbskin.UnsupportedError, match="rational"):
        cylinder.to_scipy()
    with pytest.raises(nurbskin.InvalidError, match="shape"):
        nurbskin.NurbsSurface(cylinder.control_points, [0, 0, 1, 1], [0, 0, 0, 1, 1, 1], (1, 2), [[1, 1, 1]])


def test_pickle_and_copy(surface):
    for again in [pickle.loads(pickle.dumps(surface)), copy.deepcopy(surface)]:
        assert again == surface
        assert np.array_equal(again(0.3, 0.1), surface(0.3, 0.1))
    assert surface != nurbskin.NurbsSurface(
        2 * surface.control_points, surface.knots_u, surface.knots_v, surface.degree
    )


def test_what_is_no_surface_is_refused(surface):
    net, u, v = surface.control_points, surface.knots_u, surface.knots_v
    for wrong, text in [
        (lambda: nurbskin.NurbsSurface(net[..., :2], u, v, (3, 2)), "control_points: .* not \\(7, 4, 2\\)"),
        (lambda: nurbskin.NurbsSurface(net, u[:-1], v, (3, 2)), "control points|knots"),
        (lambda: nurbskin.NurbsSurface(net, u[::-1], v, (3, 2)), "knots_u: .*smaller"),
        (lambda: nurbskin.NurbsSurface(net, u, v, 0), "degree"),
        (lambda: nurbskin.NurbsSurface(np.where(net > 6, np.nan, net), u, v, (3, 2)), "finite"),
    ]:
        with pytest.raises(nurbskin.InvalidError, match=text) as caught:
            wrong()
        assert isinstance(caught.value, ValueError)


def test_deviation_is_the_distance(surface):
    (a, b), (c, d) = surface.domain
    random = np.random.default_rng(3)
    u, v = random.uniform(a, b, 200), random.uniform(c, d, 200)
    off = 1e-3 * random.normal(size=200)
    points = surface(u, v) + off[:, None] * surface.normal(u, v)
    deviation = surface.deviation(points)
    inside = ~deviation.free_edge
    assert np.abs(deviation.signed - off)[inside].max() < 1e-12
    assert (deviation.lower <= deviation.upper).all() and len(deviation) == 200
    assert np.array_equal(np.asarray(deviation), deviation.signed)
    feet = surface(*deviation.parameters.T)
    assert np.abs(np.linalg.norm(points - feet, axis=1) - deviation.upper).max() < 1e-14
    assert deviation.statistics["max"] == deviation.max


def test_triangles_follow_the_surface(surface):
    points, triangles, parameters = surface.triangles(0.01)
    assert np.abs(surface(*parameters.T) - points).max() < 1e-12
    middles = points[triangles].mean(axis=1)
    assert surface.deviation(middles).max <= 0.01
    trimesh = pytest.importorskip("trimesh")
    mesh = surface.to_trimesh(0.01)
    assert isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) == len(triangles)


def test_pyvista(surface):
    pytest.importorskip("pyvista")
    mesh = surface.to_pyvista(0.01)
    assert mesh.is_all_triangles and "parameters" in mesh.point_data


def test_step_is_read_by_opencascade(surface, tmp_path):
    pytest.importorskip("OCP", reason="OpenCascade (cadquery-ocp) is not installed")
    from OCP.BRep import BRep_Tool
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    path = tmp_path / "surface.step"
    surface.write(path)
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_FACE)
    cast = getattr(TopoDS, "Face_s", None) or TopoDS.Face
    geometry = BRep_Tool.Surface_s(cast(explorer.Current()))
    (a, b), (c, d) = surface.domain
    random = np.random.default_rng(4)
    for u, v in zip(random.uniform(a, b, 200), random.uniform(c, d, 200)):
        at = geometry.Value(u, v)
        assert np.abs(np.array([at.X(), at.Y(), at.Z()]) - surface(u, v)).max() < 1e-13


def test_masked_parameters_are_not_used(surface):
    masked = np.ma.masked_array([0.25, 99.0], mask=[0, 1])
    for call in (surface, surface.normal, surface.curvature):
        with pytest.raises(nurbskin.InvalidError, match="parameter 1 is not finite"):
            call(masked, 0.5)
    with pytest.raises(nurbskin.InvalidError, match="masked"):
        nurbskin.Scan(np.eye(3), triangles=np.ma.masked_array([[0, 1, 2]], mask=[[0, 1, 0]]))


def test_surfaces_keep_the_unit_of_their_scan(tmp_path):
    scan = nurbskin.Scan(nurbskin.simulate("saddle", points=900).points, unit="in")
    result = nurbskin.fit(scan, tolerance=0.5)
    assert result.surface.unit == pickle.loads(pickle.dumps(result.surface)).unit == "in"
    result.surface.write(tmp_path / "own.step")
    result.surface.write(tmp_path / "said.step", unit="cm")
    result.write(tmp_path / "whole.step")
    inch = "CONVERSION_BASED_UNIT('INCH'"
    own, said, whole = ((tmp_path / f"{name}.step").read_text() for name in ("own", "said", "whole"))
    assert inch in own and inch in whole and inch not in said
    assert nurbskin.fit(scan.points, tolerance=0.5).surface.unit == "mm"
