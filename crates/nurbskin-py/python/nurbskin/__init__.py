"""Skin a 3-D scan with one clean NURBS surface: numpy in, surface out.

>>> import nurbskin
>>> result = nurbskin.fit(nurbskin.simulate("face", points=4000, noise=0.05, shuffled=True), tolerance="0.25mm")
>>> print(result.verdict)
pass

:func:`fit` takes arrays, files, and the meshes and clouds of trimesh, Open3D and PyVista. :mod:`nurbskin.cluster` fits many
scans, or one that is too large for a memory, on many machines.
"""

from . import cluster
from ._api import approximate, enrich, fit, interpolate, rarefy, read, simulate
from ._errors import Error, InvalidError, NoSolutionError, ReadError, UnsupportedError, WriteError
from ._nurbskin import Deviation, FaceEdge, NormalSums, NurbsSurface, Result, Scan, __version__
from ._types import Approximation, Curvature, Interpolation, Rarefaction

__all__ = [
    "Approximation",
    "Curvature",
    "Deviation",
    "Error",
    "FaceEdge",
    "Interpolation",
    "InvalidError",
    "NoSolutionError",
    "NormalSums",
    "NurbsSurface",
    "Rarefaction",
    "ReadError",
    "Result",
    "Scan",
    "UnsupportedError",
    "WriteError",
    "__version__",
    "approximate",
    "cluster",
    "enrich",
    "fit",
    "interpolate",
    "rarefy",
    "read",
    "simulate",
]
