"""Scans of other libraries, told by what they have: none of these libraries is needed."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Set
from typing import Any, TypeAlias

import numpy as np

from ._errors import InvalidError
from ._nurbskin import Scan

#: What trimesh calls the units that a scan may have.
UNITS = {
    "mm": ("mm", "millimeter", "millimeters"),
    "cm": ("cm", "centimeter", "centimeters"),
    "m": ("m", "meter", "meters"),
    "um": ("um", "micron", "microns", "micrometer", "micrometers"),
    "in": ("in", '"', "inch", "inches"),
    "ft": ("ft", "'", "foot", "feet"),
}


def scan_of(points: Any) -> Scan:
    """A scan of arrays, or of a mesh or cloud of trimesh, Open3D, PyVista or meshio; a scan is taken as it is.

    Faces with more than three corners are cut into triangles.
    """
    if isinstance(points, Scan):
        return points
    for known in (_open3d_tensor, _open3d, _pyvista, _meshio, _trimesh):
        parts = known(points)
        if parts is not None:
            vertices, triangles, normals = parts
            if vertices is None or len(vertices) == 0:
                raise InvalidError(f"{type(points).__name__}: it has no points")
            if triangles is not None and len(triangles) == 0:
                triangles = None
            if normals is not None and len(normals) != len(vertices):
                normals = None
            return Scan(vertices, triangles=triangles, normals=normals, unit=_unit(points))
    array = _array(points)
    if array is None:
        raise InvalidError(
            f"{type(points).__name__}: no points can be taken from this; give an (n, 3) or (m, n, 3) array, a mesh or cloud of "
            "trimesh, Open3D or PyVista, or the path of a file"
        )
    return Scan(array)


def grid_of(grid: Any) -> Any:
    """The array of an ordered scan; anything else is taken as it is.

    Raises
    ------
    InvalidError : for a scan that is not ordered, or in which cells are empty.
    """
    if not isinstance(grid, Scan):
        return grid
    array = grid.array
    if array is None:
        kind = {"mesh": "a mesh", "rows": "rows of different lengths"}.get(grid.organisation, "an unordered cloud")
        if grid.organisation == "rows":
            kind += " (scan.rarefy and scan.enrich take them)"
        raise InvalidError(f"ordered points are needed, a full grid of them, and this scan is {kind}; nurbskin.fit takes any scan")
    empty = int(np.isnan(array).any(axis=-1).sum())
    if empty:
        raise InvalidError(f"a full grid of points is needed, and {empty} of the cells of this one are empty; nurbskin.fit takes any scan")
    return array


def _array(data: Any) -> Any:
    """What numpy takes for an array of numbers; None if it takes it for none."""
    if isinstance(data, (list, tuple)) or hasattr(data, "__array__"):
        # Checked by the scan, which also sees what is masked.
        return data
    if isinstance(data, (str, bytes, bytearray, Mapping, Set)):
        return None
    try:
        # Tensors of Open3D are objects to numpy, and may be on a graphics card.
        array = data.cpu().numpy() if hasattr(data, "cpu") and hasattr(data, "numpy") else np.asarray(data)
    except (TypeError, ValueError):
        return None
    return array if array.ndim > 0 and array.dtype.kind in "biuf" else None


def _unit(data: Any) -> str | None:
    """The unit that a mesh of trimesh says that it has, if a scan may have it."""
    said = getattr(data, "units", None)
    return next((unit for unit, names in UNITS.items() if isinstance(said, str) and said in names), None)


#: Points, triangles and normals; None where an object is not of this kind.
Parts: TypeAlias = "tuple[Any, Any, Any] | None"


def _open3d_tensor(data: Any) -> Parts:
    """Open3D's tensor geometries."""

    def numpy(holder: Any, name: str) -> Any:
        return holder[name].numpy() if name in holder else None

    if hasattr(data, "vertex") and hasattr(data, "triangle"):
        return numpy(data.vertex, "positions"), numpy(data.triangle, "indices"), numpy(data.vertex, "normals")
    if hasattr(data, "point") and hasattr(data.point, "__contains__"):
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
    """PyVista's data sets: clouds, surfaces, and the surfaces of grids."""
    if not hasattr(data, "points") or not hasattr(data, "n_points"):
        return None
    if not hasattr(data, "faces"):
        if not getattr(data, "n_cells", 0):
            return np.asarray(data.points), None, None
        # Newer versions warn if they are not told how.
        how = {"algorithm": "dataset_surface"} if "algorithm" in inspect.signature(data.extract_surface).parameters else {}
        data = data.extract_surface(**how)
    if np.asarray(data.faces).size == 0:
        return np.asarray(data.points), None, None
    if not data.is_all_triangles:
        data = data.triangulate()
    # Each face is its number of corners and then these.
    return np.asarray(data.points), np.asarray(data.faces).reshape(-1, 4)[:, 1:], None


def _meshio(data: Any) -> Parts:
    """The meshes of meshio."""
    cells = getattr(data, "cells_dict", None)
    if not isinstance(cells, dict) or not hasattr(data, "points"):
        return None
    faces = [np.asarray(cells["triangle"])] if "triangle" in cells else []
    if "quad" in cells:
        quads = np.asarray(cells["quad"])
        faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    others = set(cells) - {"triangle", "quad", "vertex", "line"}
    if others:
        raise InvalidError(f"a mesh with cells {', '.join(sorted(others))}: give its surface, triangles or quads")
    return np.asarray(data.points), np.concatenate(faces) if faces else None, None


def _trimesh(data: Any) -> Parts:
    """Trimesh's meshes and clouds; the meshes of a scene as one."""
    if hasattr(data, "geometry") and hasattr(data, "graph"):
        data = data.to_geometry() if hasattr(data, "to_geometry") else data.dump(concatenate=True)
    if not hasattr(data, "vertices"):
        return None
    faces = getattr(data, "faces", None)
    return np.asarray(data.vertices), None if faces is None else np.asarray(faces), None
