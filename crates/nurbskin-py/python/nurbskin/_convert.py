"""Surfaces and results as other libraries' objects."""

from __future__ import annotations

import html
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
    """The surface as a ``trimesh.Trimesh`` within a chordal tolerance."""
    import trimesh

    points, triangles, _ = surface.triangles(tolerance)
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


def result_to_html(result: Any) -> str:
    """The report as a notebook shows it: a page of its own in a frame."""
    page = html.escape(result.page(), quote=True)
    return (
        f'<iframe srcdoc="{page}" title="nurbskin report" '
        'style="width:100%;height:640px;border:1px solid #ccc"></iframe>'
    )
