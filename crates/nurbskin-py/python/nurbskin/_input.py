"""Scans of other libraries, told by what they have: none of these libraries is needed."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ._errors import InvalidError
from ._nurbskin import Scan


def scan_of(points: Any, unit: str | None = None) -> Scan:
    """A scan of arrays, of a mesh or cloud of trimesh, Open3D, PyVista or meshio, or of a file.

    Files are read; a scan is taken as it is. A mesh is one only if all its faces are triangles or can be cut into them.
    """
    if isinstance(points, Scan):
        return points
    if isinstance(points, (str, os.PathLike)):
        from ._nurbskin import read

        return read(os.fspath(points))
    for known in (_open3d_tensor, _open3d, _pyvista, _trimesh):
        parts = known(points)
        if parts is not None:
            vertices, triangles, normals = parts
            if triangles is not None and len(triangles) == 0:
                triangles = None
            if normals is not None and len(normals) != len(vertices):
                normals = None
            return Scan(vertices, triangles=triangles, normals=normals, unit=unit)
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidError(
            f"{type(points).__name__}: no points can be taken from this; give an (n, 3) or (m, n, 3) array, a mesh or cloud "
            "of trimesh, Open3D or PyVista, or the path of a file"
        ) from None
    return Scan(array, unit=unit)


Parts = "tuple[Any, Any, Any] | None"


def _open3d_tensor(data: Any) -> Parts:
    """Open3D's tensor geometries."""

    def numpy(holder: Any, name: str) -> Any:
        return holder[name].numpy() if name in holder else None

    if hasattr(data, "vertex") and hasattr(data, "triangle"):
        return numpy(data.vertex, "positions"), numpy(data.triangle, "indices"), numpy(data.vertex, "normals")
    if hasattr(data, "point") and hasattr(data.point, "__contains__") and "positions" in data.point:
        return numpy(data.point, "positions"), None, numpy(data.point, "normals")
    return None


def _open3d(data: Any) -> Parts:
    """Open3D's legacy geometries."""
    if hasattr(data, "vertices") and hasattr(data, "triangles") and not hasattr(data, "faces"):
        normals = getattr(data, "vertex_normals", None)
        return np.asarray(data.vertices), np.asarray(data.triangles), None if normals is None else np.asarray(normals)
    if hasattr(data, "points") and hasattr(data, "has_normals"):
        return np.asarray(data.points), None, np.asarray(data.normals) if data.has_normals() else None
    return None


def _pyvista(data: Any) -> Parts:
    """PyVista's PolyData and grids, and meshio's meshes."""
    if not hasattr(data, "points"):
        return None
    points = np.asarray(data.points)
    cells = getattr(data, "cells_dict", None)
    if isinstance(cells, dict) and not hasattr(data, "faces"):
        return points, cells.get("triangle"), None
    if not hasattr(data, "faces"):
        return points, None, None
    if getattr(data, "is_all_triangles", True) is not True:
        data = data.triangulate()
    faces = np.asarray(data.faces)
    # Each face is its number of corners and then these.
    triangles = faces.reshape(-1, 4)[:, 1:] if faces.size else None
    return np.asarray(data.points), triangles, None


def _trimesh(data: Any) -> Parts:
    """Trimesh's meshes and clouds."""
    if not hasattr(data, "vertices"):
        return None
    faces = getattr(data, "faces", None)
    return np.asarray(data.vertices), None if faces is None else np.asarray(faces), None
