"""Results of several values."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ._nurbskin import NurbsSurface


class Curvature(NamedTuple):
    """Curvatures, each in the shape of the parameters, in 1 / unit (Gaussian: 1 / unit^2); NaN where there is none."""

    gaussian: NDArray[np.float64]
    """Product of the principal curvatures."""
    mean: NDArray[np.float64]
    """Half their sum."""
    k1: NDArray[np.float64]
    """The larger principal curvature."""
    k2: NDArray[np.float64]
    """The smaller principal curvature."""


class Interpolation(NamedTuple):
    """A surface through a grid: ``surface(u[i], v[j])`` is ``grid[i, j]``."""

    surface: NurbsSurface
    u: NDArray[np.float64]
    """Parameters of the lines ``grid[i, :]``, shape (m,)."""
    v: NDArray[np.float64]
    """Parameters of the lines ``grid[:, j]``, shape (n,)."""


class Rarefaction(NamedTuple):
    """The lines of a grid that are kept: ``grid[np.ix_(i, j)]``."""

    i: NDArray[np.uintp]
    """Indices of the lines ``grid[i, :]``."""
    j: NDArray[np.uintp]
    """Indices of the lines ``grid[:, j]``."""
    u: NDArray[np.float64] | None
    """Parameters of the kept lines ``grid[i, :]`` with which the tolerance is met; None without a tolerance."""
    v: NDArray[np.float64] | None
    """The same for ``grid[:, j]``."""


class Approximation(NamedTuple):
    """A least-squares surface."""

    surface: NurbsSurface
    rms: float
    """Root mean square residual, in the unit of the points: with the parameters kept if knots were given, else from the
    surface along its normal."""
    residuals: NDArray[np.float64] | None
    """Signed distance of each point along the normal, shape (n,); None if knots were given."""
    weights: NDArray[np.float64] | None
    """Robust weight of each point, 0 (an outlier) to 1, shape (n,); None if knots were given."""
    noise: float | None
    """Standard deviation of the points about the surface; None if knots were given."""
    not_met: str | None
    """Why the tolerance was not met; None if it was, or if knots were given."""
