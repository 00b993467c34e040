"""Skin a 3-D scan with one clean NURBS surface: numpy in, surface out.

>>> import nurbskin
>>> result = nurbskin.fit(nurbskin.simulate("face", points=4000, noise=0.05, shuffled=True), tolerance="0.25mm")
>>> print(result.verdict)
pass

:func:`fit` takes arrays, files, and the meshes and clouds of trimesh, Open3D and PyVista. :func:`deviation` measures how far a
scan is from a CAD file. :func:`read_cad`, :func:`check`, :func:`convert`, :func:`info` and :func:`view` work on files of both
kinds. :mod:`nurbskin.cluster` fits many scans, or one that is too large for a memory, on many machines.
"""

from . import cluster
from ._api import (
    approximate,
    check,
    convert,
    deviation,
    enrich,
    fit,
    info,
    interpolate,
    rarefy,
    read,
    read_cad,
    simulate,
    view,
)
from ._errors import Error, InvalidError, NoSolutionError, ReadError, UnsupportedError, WriteError
from ._nurbskin import (
    CadModel,
    Comparison,
    Deviation,
    FaceEdge,
    Measurement,
    NormalSums,
    NurbsCurve,
    NurbsSurface,
    Result,
    Scan,
    __version__,
)
from ._types import Approximation, ClosestPoints, Curvature, Interpolation, Page, Rarefaction

__all__ = [
    "Approximation",
    "CadModel",
    "ClosestPoints",
    "Comparison",
    "Curvature",
    "Deviation",
    "Error",
    "FaceEdge",
    "Interpolation",
    "InvalidError",
    "Measurement",
    "NoSolutionError",
    "NormalSums",
    "NurbsCurve",
    "NurbsSurface",
    "Page",
    "Rarefaction",
    "ReadError",
    "Result",
    "Scan",
    "UnsupportedError",
    "WriteError",
    "__version__",
    "approximate",
    "check",
    "cluster",
    "convert",
    "deviation",
    "enrich",
    "fit",
    "info",
    "interpolate",
    "rarefy",
    "read",
    "read_cad",
    "simulate",
    "view",
]
