"""The lower layers against scipy and geomdl."""

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline, make_interp_spline, make_lsq_spline

import nurbskin
from conftest import clamped, height


def test_interpolation_is_scipys_on_the_same_knots(sheet):
    grid, u, v = sheet
    found = nurbskin.interpolate(grid, u=u, v=v)
    surface = found.surface
    along_u = make_interp_spline(u, grid, k=3, t=np.array(surface.knots_u), axis=0)
    along_v = make_interp_spline(v, along_u.c, k=3, t=np.array(surface.knots_v), axis=1)
    expected = np.moveaxis(along_v.c, 0, 1) if along_v.c.shape[:2] != (len(u), len(v)) else along_v.c
    assert np.abs(expected - surface.control_points).max() <= 1e-12 * np.abs(grid).max()
    assert np.abs(surface(found.u[:, None], found.v) - grid).max() <= 1e-12


def test_interpolation_on_the_knots_of_rectbivariatespline(sheet):
    grid, u, v = sheet
    splines = [RectBivariateSpline(u, v, grid[..., c], s=0) for c in range(3)]
    surface = nurbskin.interpolate(grid, u=u, v=v, knots=splines[0].get_knots()).surface
    at = np.random.default_rng(6).uniform(0, 1, (2000, 2))
    expected = np.stack([s.ev(*at.T) for s in splines], axis=-1)
    assert np.abs(surface(*at.T) - expected).max() <= 1e-12 * np.abs(grid).max()
    net = np.stack([s.get_coeffs().reshape(grid.shape[:2]) for s in splines], axis=-1)
    assert np.abs(surface.control_points - net).max() <= 1e-12 * np.abs(grid).max()


def test_knots_without_a_surface_are_refused(sheet):
    grid, u, v = sheet
    knots = clamped(3, np.r_[np.linspace(0, 0.1, 20), 1])
    with pytest.raises(nurbskin.NoSolutionError, match="no surface on these knots"):
        nurbskin.interpolate(grid, u=u, v=v, knots=(knots, clamped(3, np.linspace(0, 1, 15))))


def test_interpolation_is_geomdls():
    """The grid of geomdl's example of surface interpolation, with its parameters."""
    fitting = pytest.importorskip("geomdl.fitting", reason="geomdl is not installed")
    points = [
        [-5, -5, 0], [-2.5, -5, 0], [0, -5, 0], [2.5, -5, 0], [5, -5, 0], [7.5, -5, 0], [10, -5, 0],
        [-5, 0, 3], [-2.5, 0, 3], [0, 0, 3], [2.5, 0, 3], [5, 0, 3], [7.5, 0, 3], [10, 0, 3],
        [-5, 5, 0], [-2.5, 5, 0], [0, 5, 0], [2.5, 5, 0], [5, 5, 0], [7.5, 5, 0], [10, 5, 0],
        [-5, 7.5, -3], [-2.5, 7.5, -3], [0, 7.5, -3], [2.5, 7.5, -3], [5, 7.5, -3], [7.5, 7.5, -3], [10, 7.5, -3],
        [-5, 10, 0], [-2.5, 10, 0], [0, 10, 0], [2.5, 10, 0], [5, 10, 0], [7.5, 10, 0], [10, 10, 0],
    ]  # fmt: skip
    theirs = fitting.interpolate_surface(points, 5, 7, 2, 3)
    grid = np.array(points, dtype=float).reshape(5, 7, 3)
    ours = nurbskin.interpolate(grid, degree=(2, 3), parameters="chord").surface
    net = np.array(theirs.ctrlpts).reshape(5, 7, 3)
    assert np.abs(ours.control_points - net).max() < 1e-10
    assert np.abs(ours.knots_u - theirs.knotvector_u).max() < 1e-12


def test_closed_grids_are_periodic():
    u, a = np.linspace(0, 1, 9), 2 * np.pi * np.arange(16) / 16
    grid = np.stack(
        [(1 + u[:, None]) * np.cos(a), (1 + u[:, None]) * np.sin(a), 3 * np.repeat(u[:, None], 16, axis=1)], axis=-1
    )
    found = nurbskin.interpolate(grid, topology="tube", parameters="uniform")
    assert found.surface.periodic == (False, True)
    assert np.abs(found.surface(found.u[:, None], found.v) - grid).max() < 1e-13


def test_least_squares_is_scipys(sheet):
    """On a grid of data the surface is the tensor product of two fits of curves."""
    grid, u, v = sheet
    ku, kv = clamped(3, np.linspace(0, 1, 7)), clamped(3, np.linspace(0, 1, 6))
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
    noisy = grid + 0.1 * np.random.default_rng(7).normal(size=grid.shape)
    found = nurbskin.approximate(noisy.reshape(-1, 3), uv.reshape(-1, 2), knots=(ku, kv))
    net = make_lsq_spline(u, noisy, ku, k=3, axis=0).c
    net = make_lsq_spline(v, np.swapaxes(net, 0, 1), kv, k=3, axis=0).c.swapaxes(0, 1)
    assert np.abs(found.surface.control_points - net).max() <= 1e-12 * np.abs(grid).max()
    residual = noisy - found.surface(u[:, None], v)
    assert abs(found.rms - np.sqrt((residual**2).sum(axis=-1).mean())) < 1e-9


def test_sums_add_up(sheet):
    grid, u, v = sheet
    knots = clamped(3, np.linspace(0, 1, 6))
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    points = grid.reshape(-1, 3)
    parts = [nurbskin.NormalSums(knots, knots, origin=(50, 40, 0)) for _ in range(3)]
    for k, sums in enumerate(parts):
        sums.add(points[k::3], uv[k::3])
    total = parts[0]
    total.merge(parts[1])
    total.merge(parts[2])
    assert total.count == len(points)
    surface, rms = total.solve()
    whole = nurbskin.approximate(points, uv, knots=(knots, knots))
    assert np.abs(surface.control_points - whole.surface.control_points).max() < 1e-11
    with pytest.raises(nurbskin.NoSolutionError):
        nurbskin.NormalSums(knots, knots).solve()


def test_approximation_to_a_tolerance():
    random = np.random.default_rng(8)
    uv = random.uniform(0, 1, (5000, 2))
    points = height(*uv.T)
    found = nurbskin.approximate(points, uv, tolerance=0.02)
    assert found.not_met is None and np.abs(found.residuals).max() <= 0.02
    few = nurbskin.approximate(points, uv, tolerance=1e-6, max_control_points=30)
    assert "control points" in few.not_met
    with pytest.raises(nurbskin.InvalidError, match="one of them"):
        nurbskin.approximate(points, uv)


def test_rarefaction_and_enrichment(sheet):
    grid, *_ = sheet
    i, j, *_ = nurbskin.rarefy(grid, 10)
    assert i[0] == 0 and i[-1] == grid.shape[0] - 1 and (np.diff(i.astype(int)) > 0).all()
    assert [len(k) for k in nurbskin.rarefy(grid, "8x6")[:2]] == [8, 6]
    kept = nurbskin.rarefy(grid, tolerance=0.05)
    assert len(kept.i) < grid.shape[0] and len(kept.j) < grid.shape[1]
    surface = nurbskin.interpolate(grid[np.ix_(kept.i, kept.j)], u=kept.u, v=kept.v).surface
    assert surface.deviation(grid.reshape(-1, 3)).max <= 0.05
    dense = nurbskin.enrich(grid, 2)
    assert np.array_equal(dense[::4, ::4], grid)
    with pytest.raises(nurbskin.InvalidError, match="tolerance"):
        nurbskin.rarefy(grid)


def test_small_residuals_are_those_of_the_points():
    """Not of differences of sums, which end at 1e-7 of the size."""
    random = np.random.default_rng(3)
    uv = random.uniform(0, 1, (5000, 2))
    knots = (clamped(3, np.linspace(0, 1, 5)),) * 2
    for far, noise in [(0, 1e-6), (1e3, 1e-6), (5e6, 0.05)]:
        flat = np.column_stack([100 * uv + far, noise * random.normal(size=5000)])
        found = nurbskin.approximate(flat, uv, knots=knots)
        true = np.sqrt(((found.surface(*uv.T) - flat) ** 2).sum(axis=1).mean())
        assert abs(found.rms - true) < 1e-2 * true, far
        sums = nurbskin.NormalSums(*knots)
        sums.add(flat, uv)
        assert sums.solve()[1] >= true


def test_pairs_may_be_lists(sheet):
    grid, u, v = sheet
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    knots = (clamped(3, np.linspace(0, 1, 5)), clamped(2, np.linspace(0, 1, 5)))
    tuples = nurbskin.approximate(grid.reshape(-1, 3), uv, knots=knots, degree=(3, 2), periodic=(False, False), size=(2, 1))
    lists = nurbskin.approximate(grid.reshape(-1, 3), uv, knots=knots, degree=[3, 2], periodic=[False, False], size=[2, 1])
    assert tuples.surface == lists.surface
    for wrong in ({"periodic": True}, {"size": 1.0}, {"periodic": [True]}):
        with pytest.raises(nurbskin.InvalidError, match="two of them are needed"):
            nurbskin.approximate(grid.reshape(-1, 3), uv, knots=knots, degree=(3, 2), **wrong)
    with pytest.raises(nurbskin.InvalidError, match="there are none"):
        nurbskin.approximate(np.empty((0, 3)), np.empty((0, 2)), 0.1)
    with pytest.raises(nurbskin.InvalidError, match="0 x 5 grid has no points"):
        nurbskin.interpolate(np.empty((0, 5, 3)))
