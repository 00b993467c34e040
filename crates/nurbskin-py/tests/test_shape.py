"""What a surface measures of itself, against shapes that are known; curves."""

import pickle

import numpy as np
import pytest

import nurbskin
from conftest import clamped

#: A quarter circle: weights of its three control points (The NURBS Book, 2nd ed., example E7.1).
ARC, ARC_WEIGHTS, ARC_KNOTS = np.array([[1.0, 0], [1, 1], [0, 1]]), np.array([1, 0.5**0.5, 1]), [0, 0, 0, 1, 1, 1]


@pytest.fixture
def cylinder():
    """An exact quarter of a cylinder about z, of radius 2 and height 5; u runs along z."""
    rows = [np.column_stack([2 * ARC, np.full(3, z)]) for z in (0.0, 5.0)]
    return nurbskin.NurbsSurface(rows, [0, 0, 1, 1], ARC_KNOTS, (1, 2), [ARC_WEIGHTS] * 2)


@pytest.fixture
def plane():
    """The rectangle 0 <= x <= 4, 0 <= y <= 3 at z = 1, with u along x."""
    x, y = np.meshgrid([0.0, 4.0], [0.0, 3.0], indexing="ij")
    return nurbskin.NurbsSurface(np.stack([x, y, np.ones((2, 2))], axis=-1), [0, 0, 1, 1], [0, 0, 1, 1], 1)


@pytest.fixture
def turn():
    """A rigid motion."""
    a, b = 0.7, -0.4
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = about_z @ about_x, [3, -7, 11]
    return matrix


def test_areas(cylinder, plane, surface):
    assert cylinder.area == pytest.approx(np.pi / 2 * 2 * 5, rel=1e-10)
    assert plane.area == pytest.approx(12, rel=1e-12)
    # Of a surface of no special shape: Gauss' rule in every knot span.
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for a, b in zip([0, 0.2, 0.7], [0.2, 0.7, 1]):
        for c, d in zip([-1, 0.5], [0.5, 2]):
            u, v = (a + b) / 2 + (b - a) / 2 * nodes, (c + d) / 2 + (d - c) / 2 * nodes
            density = np.linalg.norm(np.cross(surface(u[:, None], v, du=1), surface(u[:, None], v, dv=1)), axis=-1)
            total += (b - a) * (d - c) / 4 * weights @ density @ weights
    assert surface.area == pytest.approx(total, rel=1e-7)


def test_bounds_are_those_of_the_surface_and_not_of_its_control_points(cylinder):
    tall = nurbskin.NurbsSurface([[[0, 0, 0], [0, 2, 0]], [[1, 0, 4], [1, 2, 4]], [[2, 0, 0], [2, 2, 0]]], ARC_KNOTS, [0, 0, 1, 1], (2, 1))
    # A parabola through 0 and 2 with its middle control point at 4: the top is at 2.
    assert np.abs(tall.bounds - [[0, 0, 0], [2, 2, 2]]).max() < 1e-9
    assert np.abs(cylinder.bounds - [[0, 0, 0], [2, 2, 5]]).max() < 1e-9


def test_closest_points_of_a_plane(plane):
    random = np.random.default_rng(3)
    points = random.uniform([-2, -2, -3], [6, 5, 4], (500, 3)).reshape(20, 25, 3)
    found = plane.closest_point(points)
    expected = np.stack([np.clip(points[..., 0], 0, 4), np.clip(points[..., 1], 0, 3), np.ones((20, 25))], axis=-1)
    assert np.abs(found.points - expected).max() < 1e-9
    assert np.abs(found.distance - np.linalg.norm(points - expected, axis=-1)).max() < 1e-9
    assert np.abs(found.parameters - expected[..., :2] / [4, 3]).max() < 1e-9
    assert found.face.shape == (20, 25) and not found.face.any()
    one = plane.closest_point([2.0, 1.5, 9.0])
    assert one.points.shape == (3,) and one.distance == pytest.approx(8) and one.distance.shape == ()
    with pytest.raises(nurbskin.InvalidError, match="point 0 is not finite"):
        plane.closest_point([np.nan, 0, 0])
    with pytest.raises(nurbskin.InvalidError, match=r"shape \(..., 3\)"):
        plane.closest_point([1.0, 2.0])


def test_isocurves_are_on_the_surface(surface, cylinder):
    (a, b), (c, d) = surface.domain
    along = np.linspace(c, d, 31)
    for u in [a, 0.13, 0.2, b]:
        curve = surface.isocurve(u=u)
        assert curve.domain == (c, d) and curve.degree == 2
        assert np.abs(curve(along) - surface(u, along)).max() < 1e-13
        assert np.abs(curve(along, 1) - surface(u, along, dv=1)).max() < 1e-12
        assert np.abs(curve(along, 2) - surface(u, along, dv=2)).max() < 1e-11
    assert surface.isocurve(v=0.4)(0.5) == pytest.approx(surface(0.5, 0.4), abs=1e-14)
    # A circle at half height.
    arc = cylinder.isocurve(u=0.5)
    assert arc.weights is not None and np.abs(np.linalg.norm(arc(np.linspace(0, 1, 9))[:, :2], axis=1) - 2).max() < 1e-14
    for wrong in [{}, {"u": 0.1, "v": 0.1}, {"u": np.nan}]:
        with pytest.raises(nurbskin.InvalidError):
            surface.isocurve(**wrong)


def test_curves_are_values(surface):
    curve = surface.isocurve(v=0.4)
    assert pickle.loads(pickle.dumps(curve)) == curve and repr(curve) == "NurbsCurve(7 control points, degree 3)"
    again = nurbskin.NurbsCurve(curve.control_points, curve.knots, curve.degree, curve.weights)
    assert again == curve and curve(np.zeros((2, 3))).shape == (2, 3, 3)
    with pytest.raises(ValueError):
        curve.knots[0] = 1
    with pytest.raises(nurbskin.InvalidError, match="the knots need 3 control points, not 2"):
        nurbskin.NurbsCurve([[0, 0, 0], [1, 0, 0]], clamped(2, [0, 1]), 2)
    with pytest.raises(nurbskin.InvalidError, match="degree"):
        nurbskin.NurbsCurve([[0, 0, 0], [1, 0, 0]], [0, 0, 1, 1], 0)


def test_motions_keep_what_does_not_depend_on_place(surface, turn):
    moved = surface.transform(turn)
    u, v = np.linspace(0, 1, 11)[:, None], np.linspace(-1, 2, 9)
    assert np.abs(moved(u, v) - (surface(u, v) @ turn[:3, :3].T + turn[:3, 3])).max() < 1e-12
    assert np.abs(moved.normal(u, v) - surface.normal(u, v) @ turn[:3, :3].T).max() < 1e-12
    assert moved.area == pytest.approx(surface.area, rel=1e-9) and moved.unit == surface.unit
    assert np.abs(moved.curvature(u, v).mean - surface.curvature(u, v).mean).max() < 1e-9
    points = np.random.default_rng(4).uniform(-2, 8, (50, 3))
    there = moved.closest_point(points @ turn[:3, :3].T + turn[:3, 3])
    assert np.abs(there.distance - surface.closest_point(points).distance).max() < 1e-9
    back = moved.transform(np.linalg.inv(turn))
    assert np.abs(back.control_points - surface.control_points).max() < 1e-12
    # The other shapes of a matrix; scales change areas.
    assert moved == surface.transform(turn[:3])
    assert surface.transform(2 * np.eye(3)).area == pytest.approx(4 * surface.area, rel=1e-9)


def test_maps_that_are_none_are_refused(surface):
    perspective = np.eye(4)
    perspective[3, 0] = 0.1
    for wrong, text in [
        (np.eye(2), r"matrix: an array of shape \(4, 4\)"),
        (perspective, "the last row"),
        (np.zeros((3, 3)), "undone"),
        (np.full((3, 3), np.inf), "undone"),
    ]:
        with pytest.raises(nurbskin.InvalidError, match=text):
            surface.transform(wrong)
