"""Results of several values."""

from __future__ import annotations

import html
import inspect
import re
from typing import Literal, NamedTuple, TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray

from ._nurbskin import NurbsSurface

#: Verdicts of a fit.
Verdict = Literal["pass", "fail", "cannot_tell", "not_asked"]

#: One reason for a verdict: what is the case, where (a point in the coordinates of the scan), and one thing to do.
Reason = TypedDict("Reason", {"what": str, "where": "list[float] | None", "next": "str | None"})

Kind = TypeVar("Kind", bound="type[tuple[object, ...]]")


def _documented(kind: Kind) -> Kind:
    """Gives each field of a named tuple what the tuple's documentation says of it."""
    for name, text in re.findall(r"^(\w+) : (.+(?:\n +.+)*)", inspect.getdoc(kind) or "", re.MULTILINE):
        getattr(kind, name).__doc__ = " ".join(text.split())
    return kind


class Page(str):
    """A page of HTML: a text, which a notebook shows in a frame."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        page = html.escape(self, quote=True)
        return (
            f'<iframe srcdoc="{page}" title="nurbskin report" '
            'style="width:100%;height:640px;border:1px solid #ccc"></iframe>'
        )


@_documented
class ClosestPoints(NamedTuple):
    """The nearest points of a surface or a model, for points of shape (..., 3).

    Attributes
    ----------
    points : the nearest points, shape (..., 3).
    parameters : their (u, v) on their faces, shape (..., 2).
    distance : the distances, at least 0, in the unit of the surface, shape (...).
    face : indices of the faces, shape (...).
    """

    points: NDArray[np.float64]
    parameters: NDArray[np.float64]
    distance: NDArray[np.float64]
    face: NDArray[np.uintp]


@_documented
class Curvature(NamedTuple):
    """Curvatures, each in the shape of the parameters; NaN where there is none.

    Attributes
    ----------
    gaussian : product of the principal curvatures, in 1 / unit^2.
    mean : half their sum, in 1 / unit.
    k1 : the larger principal curvature, in 1 / unit.
    k2 : the smaller principal curvature, in 1 / unit.
    """

    gaussian: NDArray[np.float64]
    mean: NDArray[np.float64]
    k1: NDArray[np.float64]
    k2: NDArray[np.float64]


@_documented
class Interpolation(NamedTuple):
    """A surface through a grid: ``surface(u[i], v[j])`` is ``grid[i, j]``.

    Attributes
    ----------
    surface : the surface.
    u : parameters of the lines ``grid[i, :]``, shape (m,).
    v : parameters of the lines ``grid[:, j]``, shape (n,).
    """

    surface: NurbsSurface
    u: NDArray[np.float64]
    v: NDArray[np.float64]


@_documented
class Rarefaction(NamedTuple):
    """The lines of a grid that are kept: ``grid[np.ix_(i, j)]``.

    Attributes
    ----------
    i : indices of the k kept lines ``grid[i, :]``, shape (k,).
    j : indices of the l kept lines ``grid[:, j]``, shape (l,).
    u : parameters of the lines ``grid[i, :]`` with which the tolerance is met, shape (k,); None without a tolerance.
    v : the same of the lines ``grid[:, j]``, shape (l,).
    """

    i: NDArray[np.uintp]
    j: NDArray[np.uintp]
    u: NDArray[np.float64] | None
    v: NDArray[np.float64] | None


@_documented
class Approximation(NamedTuple):
    """A least-squares surface.

    Attributes
    ----------
    surface : the surface.
    rms : root mean square residual, in the unit of the points: with the parameters kept if knots were given, else from the
        surface along its normal. With knots and the points in memory it is evaluated at every point. From
        ``cluster.approximate`` it comes from sums, which resolve no less than about 2e-7 of the points' distance from the
        origin: below that it is an upper bound.
    residuals : signed distance of each point along the normal, in the unit of the points, shape (n,); None if knots were
        given.
    weights : robust weight of each point, 0 (an outlier) to 1, shape (n,); None if knots were given.
    noise : standard deviation of the points about the surface, in their unit; None if knots were given.
    not_met : why the tolerance was not met; None if it was, or if knots were given.
    """

    surface: NurbsSurface
    rms: float
    residuals: NDArray[np.float64] | None
    weights: NDArray[np.float64] | None
    noise: float | None
    not_met: str | None
