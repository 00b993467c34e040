"""Many scans, or one that is too large for a memory, on the workers of a Dask cluster (``pip install nurbskin[cluster]``).

docs/cluster.md has the figures and the plan for many workers.
"""

from __future__ import annotations

import functools
import os
import uuid
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, Union

import numpy as np

from . import _api
from ._errors import Error, InvalidError, NoSolutionError
from ._nurbskin import NormalSums, NurbsSurface, Result
from ._types import Approximation

if TYPE_CHECKING:
    from distributed import Client, Future
    from numpy.typing import ArrayLike

    Path = Union[str, os.PathLike[str]]
    Chart = Union[Callable[[np.ndarray], np.ndarray], NurbsSurface]

__all__ = ["approximate", "fit_many"]

#: Sums that are added up in one task: the breadth of the tree of additions.
BREADTH = 8
#: Chunks under way for each thread of the cluster: one that is worked on, one that is on its way.
AHEAD = 2


def fit_many(paths: Iterable[Path], client: Client, **options: Any) -> list[Result | Exception]:
    """Fits every scan, each as a task of its own.

    A worker that dies takes nothing with it: Dask gives its tasks to others. A scan that cannot be fitted spoils no other:
    its entry is the exception, also where it brings down one worker after the other.

    Parameters
    ----------
    paths : files, which the workers must be able to read.
    client : a ``distributed.Client``.
    options : as for :func:`nurbskin.fit`.

    Returns
    -------
    list : one entry for each path, in their order: a Result, the same as :func:`nurbskin.fit` gives, or an exception.
    """
    names = [os.fspath(path) for path in paths]
    futures = [client.submit(_fitted, name, options, pure=False, key=_key("fit")) for name in names]
    return [_result_of(future) for future in futures]


def _task(work: Callable[..., Any]) -> Callable[..., Any]:
    """What a worker does. Whatever it raises becomes an exception that Dask takes home: it waits without end for others."""

    @functools.wraps(work)
    def safe(*arguments: Any) -> Any:
        try:
            return work(*arguments)
        except Exception:
            raise
        except BaseException as error:
            raise Error(f"{type(error).__name__}: {error}") from None

    return safe


@_task
def _fitted(path: str, options: dict[str, Any]) -> Result | Exception:
    """A task: errors of the scan are results, so that nobody tries again."""
    try:
        return _api.fit(path, **options)
    except Exception as error:  # noqa: BLE001
        return error


def _result_of(future: Future) -> Result | Exception:
    """What a future gives, or why it gives nothing, as when every worker that tried it died."""
    try:
        return future.result()
    except Exception as error:  # noqa: BLE001
        return error
    finally:
        future.release()


def approximate(
    chunks: Any,
    knots: tuple[ArrayLike, ArrayLike],
    client: Client,
    chart: Chart | None = None,
    *,
    degree: int | tuple[int, int] = 3,
    periodic: tuple[bool, bool] = (False, False),
    origin: tuple[float, float, float] | None = None,
    smoothing: float = 0.0,
    size: tuple[float, float] = (1.0, 1.0),
) -> Approximation:
    """The least-squares surface on given knots of any number of points, chunk by chunk.

    The same surface as ``nurbskin.approximate(points, uv, knots=knots)`` of all points together. A worker holds two chunks
    for each of its threads, one of them on its way, and some sums, 832 bytes for each cell of bicubic knots; only sums travel.
    If a worker dies, others make its chunks again: those that are files, functions or delayed. Arrays of the caller that it
    held are lost, and the call fails.

    Parameters
    ----------
    chunks : an iterable, or a Dask array of shape (n, 3). Each chunk is a pair of (n, 3) points and (n, 2) parameters; or,
        with a ``chart``, points alone; or the path of a scan that the workers can read; or a function without arguments
        that gives one of these on the worker. A pair of paths of ``.npy`` files is read on the worker, too. Chunks of an
        iterator are taken only as fast as the cluster goes.
    knots : knot vectors of u and v.
    client : a ``distributed.Client``.
    chart : places points: a function from (n, 3) points to (n, 2) parameters in the domain of the knots, or a surface, on
        which each point is placed where it is nearest.
    degree, periodic, smoothing, size : as for :func:`nurbskin.approximate` with knots.
    origin : a place near the scan; the middle of the first chunk with points where None. Coordinates far from it lose digits.

    Raises
    ------
    InvalidError : if a chunk is none of these, or there is none.
    NoSolutionError : if the points do not determine the surface.
    """
    knots = (np.asarray(knots[0], dtype=np.float64), np.asarray(knots[1], dtype=np.float64))
    # Refused here, before anything travels.
    NormalSums(knots[0], knots[1], degree, periodic)
    shared = client.scatter(chart, broadcast=True, hash=False) if isinstance(chart, NurbsSurface) else chart
    each = _each(chunks)
    tree = _Tree(client)
    limit = AHEAD * max(1, sum(client.nthreads().values()))
    under_way: list[Future] = []
    count = 0
    for count, chunk in enumerate(each, 1):
        _make_room(under_way, limit)
        space = (knots[0], knots[1], degree, periodic, origin)
        future = client.submit(_summed, space, _sent(client, chunk), shared, pure=False, key=_key("sums"))
        if origin is None:
            # The first chunk with points says what all are taken relative to; those before it have nothing to add.
            origin = client.submit(_origin, future, pure=False, key=_key("origin")).result()
            if origin is None:
                continue
        under_way.append(future)
        tree.add(future)
    if count == 0:
        raise InvalidError("approximate: there are no chunks")
    if origin is None:
        raise NoSolutionError("approximate: no chunk has a point")
    sums = tree.total().result()
    surface, rms = sums.solve(smoothing, size)
    return Approximation(surface, rms, None, None, None, None)


class _Tree:
    """Adds sums up, so many at a time, always in the same order: each full level gives one of the next."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._levels: list[list[Future]] = []

    def add(self, future: Future, level: int = 0) -> None:
        if level == len(self._levels):
            self._levels.append([])
        here = self._levels[level]
        here.append(future)
        if len(here) == BREADTH:
            self._levels[level] = []
            self.add(self._merged(here), level + 1)

    def total(self) -> Future:
        rest: list[Future] = []
        for level in self._levels:
            rest = level + rest if not rest else level + [self._merged(rest)]
        return rest[0] if len(rest) == 1 else self._merged(rest)

    def _merged(self, futures: list[Future]) -> Future:
        return self._client.submit(_merged, futures, pure=False, key=_key("merge"))


def _make_room(under_way: list[Future], limit: int) -> None:
    """Waits until fewer than so many are under way; raises what went wrong."""
    from distributed import wait

    while True:
        for future in [f for f in under_way if f.done()]:
            under_way.remove(future)
            if future.status == "error":
                future.result()
        if len(under_way) < limit:
            return
        wait(under_way, return_when="FIRST_COMPLETED")


@_task
def _summed(space: tuple[Any, ...], chunk: Any, chart: Chart | None) -> NormalSums:
    """A task: the sums of one chunk."""
    points, parameters = _placed(chunk, chart)
    knots_u, knots_v, degree, periodic, origin = space
    sums = NormalSums(knots_u, knots_v, degree, periodic, origin or _middle(points))
    sums.add(points, parameters)
    return sums


@_task
def _origin(sums: NormalSums) -> tuple[float, float, float] | None:
    """A task: what sums are relative to, if they are of any points."""
    return sums.origin if sums.count > 0 else None


@_task
def _merged(parts: list[NormalSums]) -> NormalSums:
    """A task: the sum of sums, in their order; none of them is changed."""
    total = parts[0].copy()
    for part in parts[1:]:
        total.merge(part)
    return total


def _middle(points: np.ndarray) -> tuple[float, float, float]:
    """The middle of the box around points, as far as they are finite."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return (0.0, 0.0, 0.0)
    x, y, z = (0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)).tolist()
    return (x, y, z)


def _made(chunk: Any) -> Any:
    """The chunk itself: functions are called, files read."""
    if callable(chunk):
        chunk = chunk()
    if isinstance(chunk, (str, os.PathLike)):
        return _api.read(chunk).points
    if isinstance(chunk, (tuple, list)) and len(chunk) == 2:
        return tuple(np.load(part) if isinstance(part, (str, os.PathLike)) else part for part in chunk)
    return chunk


def _points_of(chunk: Any) -> np.ndarray:
    points = np.asarray(chunk[0] if isinstance(chunk, tuple) else chunk, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidError(f"a chunk holds an array of shape (n, 3) as its points, not {points.shape}")
    return points


def _placed(chunk: Any, chart: Chart | None) -> tuple[np.ndarray, np.ndarray]:
    """Points and parameters of a chunk."""
    chunk = _made(chunk)
    points = _points_of(chunk)
    if isinstance(chunk, tuple):
        return points, chunk[1]
    if chart is None:
        raise InvalidError("a chunk is points alone: give their parameters, too, or a chart that places them")
    if isinstance(chart, NurbsSurface):
        return points, chart.deviation(points).parameters
    return points, chart(points)


def _each(chunks: Any) -> Iterator[Any]:
    """The chunks; those of a Dask array are its blocks of rows."""
    if isinstance(chunks, (str, os.PathLike)):
        raise InvalidError(f"{os.fspath(chunks)} is one path: give a list of chunks")
    if hasattr(chunks, "to_delayed"):
        if chunks.ndim != 2 or chunks.shape[1] != 3:
            raise InvalidError(f"a Dask array of points has shape (n, 3), not {chunks.shape}")
        return iter(chunks.rechunk({1: 3}).to_delayed().ravel().tolist())
    if isinstance(chunks, np.ndarray) and chunks.ndim == 2:
        return iter([chunks])
    return iter(chunks)


def _sent(client: Client, chunk: Any) -> Any:
    """The chunk as an argument of a task: arrays go straight to a worker, what is delayed is made there."""
    from distributed import Future

    if hasattr(chunk, "dask"):
        return client.compute(chunk)
    if isinstance(chunk, Future):
        return chunk
    if callable(chunk) or isinstance(chunk, (str, os.PathLike)):
        return chunk
    if isinstance(chunk, (tuple, list)) and len(chunk) == 2 and any(hasattr(part, "dask") for part in chunk):
        return tuple(_sent(client, part) for part in chunk)
    if isinstance(chunk, (tuple, list)) and all(isinstance(part, (str, os.PathLike)) for part in chunk):
        return tuple(os.fspath(part) for part in chunk)
    if isinstance(chunk, list):
        chunk = tuple(chunk) if len(chunk) == 2 else np.asarray(chunk, dtype=np.float64)
    return client.scatter(chunk, hash=False)


def _key(what: str) -> str:
    """A name for a task that no other has: equal tasks are never taken for one."""
    return f"nurbskin-{what}-{uuid.uuid4().hex}"
