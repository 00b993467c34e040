"""Surfaces, models and results as other libraries' objects."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._errors import UnsupportedError


def surface_to_scipy(surface: Any) -> Any:
    """The surface as a ``scipy.interpolate.NdBSpline``, called with (n, 2) parameters."""
    from scipy.interpolate import NdBSpline

    if surface.rational:
        raise UnsupportedError("a rational surface is no spline of scipy's: it has weights, and NdBSpline has none")
    return NdBSpline(
        (np.array(surface.knots_u), np.array(surface.knots_v)),
        np.array(surface.control_points),
        surface.degree,
    )


def surface_to_trimesh(surface: Any, tolerance: float | None) -> Any:
    """The surface, or the model, as a ``trimesh.Trimesh`` within a chordal tolerance."""
    import trimesh

    points, triangles = surface.triangles(tolerance)[:2]
    mesh = trimesh.Trimesh(points, triangles.astype(np.int64), process=False)
    mesh.units = surface.unit
    return mesh


def surface_to_pyvista(surface: Any, tolerance: float | None) -> Any:
    """The surface as a ``pyvista.PolyData`` within a chordal tolerance, with (u, v) as its point data ``parameters``."""
    import pyvista

    points, triangles, parameters = surface.triangles(tolerance)
    count = np.full((len(triangles), 1), 3, dtype=np.int64)
    mesh = pyvista.PolyData(points, np.hstack([count, triangles]).ravel())
    mesh.point_data["parameters"] = parameters
    return mesh


def mesh_to_pyvista(shown: Any) -> Any:
    """The trimmed faces of a result, a comparison or a model as a ``pyvista.PolyData`` with values per point."""
    import pyvista

    parts = shown._mesh()
    points, triangles = parts.pop("points"), parts.pop("triangles")
    count = np.full((len(triangles), 1), 3, dtype=np.int64)
    mesh = pyvista.PolyData(points, np.hstack([count, triangles]).ravel())
    for name, values in parts.items():
        mesh.point_data[name] = values
    # What is drawn in colours unless something else is asked for.
    mesh.set_active_scalars("deviation" if "deviation" in parts else "mean_curvature")
    return mesh
