"""Many scans, or one that is too large for a memory, on the workers of a Dask cluster (``pip install nurbskin[cluster]``).

docs/cluster.md has the figures and the plan for many workers.
"""

from __future__ import annotations

import functools
import inspect
import os
import sys
import uuid
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, Sequence, Union
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike

from . import _api
from ._errors import Error, InvalidError, MissingFileError, NoSolutionError, ReadError
from ._nurbskin import NormalSums, NurbsSurface, Result, Scan
from ._types import Approximation

if TYPE_CHECKING:
    from distributed import Client, Future
else:
    # Dask is imported only by those who use it; annotations must be names all the same.
    Client = Future = Any

Path = Union[str, os.PathLike[str]]
Chart = Union[Callable[[np.ndarray], np.ndarray], NurbsSurface]

__all__ = ["approximate", "fit_many"]

#: Sums that are added up in one task: the breadth of the tree of additions.
BREADTH = 8
#: Chunks under way for each thread of the cluster: one that is worked on, one that is on its way.
AHEAD = 2
#: For those who give something else.
KINDS = (
    "a chunk is a pair of (n, 3) points and (n, 2) parameters, each an array, a Dask array, a future, delayed, or the path of "
    "a .npy file; or a future, delayed or a function that gives a pair of arrays; with a chart, points alone, a Scan, or the "
    "path of one, may stand for a pair"
)


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

    Raises
    ------
    InvalidError : if ``paths`` is a single path.
    TypeError : for an option that :func:`nurbskin.fit` does not have.
    """
    _refuse_one_path(paths)
    inspect.signature(_api.fit).bind(None, **options)
    names = [os.fspath(path) for path in paths]
    with _Futures(client) as held:
        futures = [held.submit("fit", _fitted, name, options) for name in names]
        return [_result_of(future) for future in futures]


def _refuse_one_path(given: Any) -> None:
    """A path is an iterable of its letters."""
    if isinstance(given, (str, bytes, os.PathLike)):
        raise InvalidError(f"{os.fsdecode(given)} is one path: give a list")


class _Futures:
    """All that a call has on the cluster: given up when the call ends, however it ends.

    Tracebacks keep the frames of a call that failed, and these its futures, which keep tasks and data on the workers: here they
    are released by hand. They are held weakly, so that what is used up in between goes at once. Futures of the caller are not
    among them.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._held: WeakValueDictionary[int, Future] = WeakValueDictionary()

    def __enter__(self) -> _Futures:
        return self

    def __exit__(self, *_: object) -> None:
        for future in list(self._held.values()):
            future.release()

    def submit(self, what: str, work: Callable[..., Any], *arguments: Any) -> Future:
        """A task. It has a name that no other has: equal tasks are never taken for one."""
        key = f"nurbskin-{what}-{uuid.uuid4().hex}"
        return self._own(self._client.submit(work, *arguments, pure=False, key=key))

    def scatter(self, data: Any, broadcast: bool = False) -> Future:
        """Data on one worker, or on all. A pair stays together: of a tuple, Dask would spread the parts."""
        return self._own(self._client.scatter([data], hash=False, broadcast=broadcast)[0])

    def compute(self, delayed: Any) -> Future:
        return self._own(self._client.compute(delayed))

    def _own(self, future: Future) -> Future:
        self._held[id(future)] = future
        return future


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
    degree: int | Sequence[int] = 3,
    periodic: Sequence[bool] = (False, False),
    origin: ArrayLike | None = None,
    smoothing: float = 0.0,
    size: ArrayLike = (1.0, 1.0),
) -> Approximation:
    """The least-squares surface on given knots of any number of points, chunk by chunk.

    The same surface as ``nurbskin.approximate(points, uv, knots=knots)`` of all points together. A worker holds two chunks
    for each of its threads, one of them on its way, and some sums, 832 bytes for each cell of bicubic knots; only sums travel.
    If a worker dies, others make its chunks again: those that are files, functions or delayed. Arrays of the caller that it
    held are lost, and the call fails. When it ends, in whatever way, nothing of it is left on the cluster.

    Parameters
    ----------
    chunks : an iterable of chunks. Each is a pair of (n, 3) points and (n, 2) parameters; or, with a ``chart``, points alone
        or a :class:`nurbskin.Scan`. Arrays are numpy's or Dask's (each block of rows of the points is a chunk of its own, and
        the parameters are cut in the same way), futures or delayed. A future, delayed, or a function without arguments may
        also give a whole chunk, on the worker. Files are read there, too: the path of a scan, or a pair of paths of ``.npy``
        files. Chunks of an iterator are taken only as fast as the cluster goes. A single array, Dask array or scan, or a
        single pair of arrays or Dask arrays, needs no list around it.
    knots : knot vectors of u and v.
    client : a ``distributed.Client``.
    chart : places points: a function from (n, 3) points to (n, 2) parameters in the domain of the knots, or a surface, on
        which each point is placed where it is nearest.
    degree, periodic, smoothing, size : as for :func:`nurbskin.approximate` with knots.
    origin : a place near the scan; the middle of the first chunk with points where None. Coordinates far from it lose digits.

    Raises
    ------
    InvalidError : if an argument makes no sense, a chunk is none of these, or there is none. Errors of a chunk begin with its
        number in the iterable, counted from 0, and its path: ``chunk 3 (scan.ply): ...``.
    ReadError : if a file of a chunk cannot be read.
    NoSolutionError : if the points do not determine the surface.
    """
    # All of this is refused here, before anything travels.
    try:
        knots_u, knots_v = (np.asarray(of_one, dtype=np.float64) for of_one in knots)
    except (TypeError, ValueError):
        raise InvalidError("knots: two knot vectors are needed, of u and of v") from None
    smoothing = _numbers("smoothing", smoothing, (), "a number of 0 or more is needed", lambda x: x >= 0)
    size = tuple(_numbers("size", size, (2,), "two positive numbers are needed", lambda x: x > 0))
    if origin is not None:
        origin = tuple(_numbers("origin", origin, (3,), "three numbers are needed"))
    flags = _numbers("periodic", periodic, (2,), "two of True and False are needed", lambda x: (x == 0) | (x == 1))
    periodic = (flags[0] == 1, flags[1] == 1)
    if not (chart is None or callable(chart)):
        raise InvalidError(f"chart: a function or a surface is needed, not {type(chart).__name__}")
    NormalSums(knots_u, knots_v, degree, periodic)
    limit = AHEAD * max(1, sum(client.nthreads().values()))
    with _Futures(client) as held:
        shared = held.scatter(chart, broadcast=True) if isinstance(chart, NurbsSurface) else chart
        tree = _Tree(held)
        under_way: dict[Future, str] = {}
        count = 0
        for count, (name, chunk) in enumerate(_each(chunks), 1):
            _make_room(under_way, limit)
            space = (knots_u, knots_v, degree, periodic, origin)
            with _naming(name):
                future = held.submit("sums", _summed, space, _sent(held, chunk), shared)
                if origin is None:
                    # The first chunk with points says what all are taken relative to; those before it have nothing to add.
                    origin = held.submit("origin", _origin, future).result()
                    if origin is None:
                        continue
            under_way[future] = name
            tree.add(future)
        if count == 0:
            raise InvalidError("approximate: there are no chunks")
        if origin is None:
            raise NoSolutionError("approximate: no chunk has a point")
        # Here, where errors still have the names of their chunks.
        _make_room(under_way, 1)
        with _naming("the sum of all chunks"):
            sums = tree.total().result()
    surface, rms = sums.solve(smoothing, size)
    return Approximation(surface, rms, None, None, None, None)


def _numbers(
    name: str, given: Any, shape: tuple[int, ...], needed: str, fit: Callable[[Any], Any] = lambda x: True
) -> Any:
    """An argument as a finite float or a list of them."""
    try:
        array = np.asarray(given, dtype=np.float64)
        fits = array.shape == shape and bool(np.all(np.isfinite(array) & fit(array)))
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise InvalidError(f"{name}: {needed}, not {given!r}")
    return array.tolist()


@contextmanager
def _naming(name: str) -> Iterator[None]:
    """Errors say of which chunk they are; the package's in their text, others in a note (Python 3.11)."""
    try:
        yield
    except Error as error:
        error.args = (f"{name}: {error}",)
        raise
    except CancelledError:
        raise Error(
            f"{name}: cancelled; if a worker died, it held arrays of the caller: chunks that are files or functions are made "
            "again by others"
        ) from None
    except Exception as error:
        if hasattr(error, "add_note"):
            error.add_note(f"nurbskin: this is of {name}")
        raise


class _Tree:
    """Adds sums up, so many at a time, always in the same order: each full level gives one of the next."""

    def __init__(self, held: _Futures) -> None:
        self._held = held
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
        return self._held.submit("merge", _merged, futures)


def _make_room(under_way: dict[Future, str], limit: int) -> None:
    """Waits until fewer than so many are under way; raises what went wrong."""
    from distributed import wait

    while True:
        for future in [f for f in under_way if f.done() or f.cancelled()]:
            name = under_way.pop(future)
            if future.status != "finished":
                with _naming(name):
                    future.result()
        if len(under_way) < limit:
            return
        try:
            wait(list(under_way), return_when="FIRST_COMPLETED")
        except CancelledError:
            # Of one of them: it is told above.
            if not any(future.cancelled() for future in under_way):
                raise


@_task
def _summed(space: tuple[Any, ...], chunk: Any, chart: Chart | None) -> NormalSums:
    """A task: the sums of one chunk."""
    points, parameters = _placed(chunk, chart)
    knots_u, knots_v, degree, periodic, origin = space
    sums = NormalSums(knots_u, knots_v, degree, periodic, _middle(points) if origin is None else origin)
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


def _placed(chunk: Any, chart: Chart | None) -> tuple[np.ndarray, Any]:
    """Points and parameters of a chunk, on the worker: functions are called, files read."""
    if callable(chunk):
        chunk = chunk()
    if _is_pair(chunk):
        points, parameters = (_array(_loaded(part) if _is_path(part) else part) for part in chunk)
    else:
        scan = _api.read(chunk) if _is_path(chunk) else chunk
        points, parameters = _array(scan.points if isinstance(scan, Scan) else scan), None
    points = points.astype(np.float64, copy=False)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidError(f"a chunk holds an array of shape (n, 3) as its points, not {points.shape}")
    if parameters is not None:
        return points, parameters
    if chart is None:
        raise InvalidError("a chunk is points alone: give their parameters, too, or a chart that places them")
    if isinstance(chart, NurbsSurface):
        return points, chart.deviation(points).parameters
    return points, chart(points)


def _loaded(path: Path) -> np.ndarray:
    """The array of a .npy file."""
    try:
        array = np.load(path)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: there is no such file; the workers must be able to read it") from None
    except (OSError, ValueError, EOFError) as error:
        raise ReadError(f"{path}: this cannot be read as a .npy file: {getattr(error, 'strerror', None) or error}") from None
    if not isinstance(array, np.ndarray):
        raise ReadError(f"{path}: an archive of arrays; give .npy files of one array each")
    return array


def _is_path(given: Any) -> bool:
    return isinstance(given, (str, os.PathLike))


def _is_pair(chunk: Any) -> bool:
    return isinstance(chunk, (tuple, list)) and len(chunk) == 2


def _is_dask_array(given: Any) -> bool:
    # By its class: what is delayed has every attribute that one asks for. Who has an array has imported this.
    module = sys.modules.get("dask.array")
    return module is not None and isinstance(given, module.Array)


def _array(given: Any) -> np.ndarray:
    """An array of numbers; masked ones are NaN, as in a scan, and not what is under the mask."""
    if isinstance(given, np.ma.MaskedArray):
        given = np.ma.filled(given.astype(np.float64), np.nan)
    try:
        array = np.asarray(given)
    except ValueError:
        array = np.asarray(None)
    if array.ndim == 0 or array.dtype.kind not in "biuf":
        raise InvalidError(f"{type(given).__name__}: {KINDS}")
    return array


def _each(chunks: Any) -> Iterator[tuple[str, Any]]:
    """The chunks with what they are called in errors; Dask arrays are their blocks of rows."""
    _refuse_one_path(chunks)
    if _is_one_chunk(chunks):
        chunks = [chunks]
    try:
        chunks = iter(chunks)
    except TypeError:
        raise InvalidError(f"chunks: an iterable of chunks is needed, not {type(chunks).__name__}; {KINDS}") from None
    for number, chunk in enumerate(chunks):
        parts = tuple(chunk) if _is_pair(chunk) else (chunk,)
        name = f"chunk {number}"
        if any(_is_dask_array(part) for part in parts):
            with _naming(name):
                blocks = _blocks(*parts)
            yield from ((f"{name}, block {k}", block) for k, block in enumerate(blocks))
        else:
            paths = ", ".join(os.fspath(part) for part in parts if _is_path(part))
            yield f"{name} ({paths})" if paths else name, chunk


def _is_one_chunk(chunks: Any) -> bool:
    """Whether this is a chunk and not many of them."""
    from dask.base import is_dask_collection
    from distributed import Future

    if _is_pair(chunks) and all(isinstance(part, np.ndarray) or _is_dask_array(part) for part in chunks):
        return chunks[0].ndim == 2 and chunks[1].shape[1:] == (2,)
    if isinstance(chunks, np.ndarray):
        return chunks.ndim == 2
    return isinstance(chunks, (Scan, Future)) or is_dask_collection(chunks)


def _blocks(points: Any, parameters: Any = None) -> list[Any]:
    """The blocks of rows of Dask arrays, delayed; parameters are cut as their points are."""
    import dask
    from dask.array import asarray

    def rows(name: str, array: Any, columns: int) -> Any:
        array = asarray(array)
        if array.ndim != 2 or array.shape[1] != columns:
            raise InvalidError(f"a Dask array of {name} has shape (n, {columns}), not {array.shape}")
        return array.rechunk({1: columns})

    points = rows("points", points, 3)
    if parameters is None:
        return points.to_delayed().ravel().tolist()
    parameters = rows("parameters", parameters, 2)
    # Sizes of blocks may be unknown (NaN, which equals nothing): then they are taken to be the same.
    if np.isfinite([len_of for array in (points, parameters) for len_of in array.chunks[0]]).all():
        if points.shape[0] != parameters.shape[0]:
            raise InvalidError(f"{points.shape[0]} points have {parameters.shape[0]} parameters")
        parameters = parameters.rechunk({0: points.chunks[0]})
    elif points.numblocks[0] != parameters.numblocks[0]:
        raise InvalidError(
            f"points of {points.numblocks[0]} blocks have parameters of {parameters.numblocks[0]}, and the sizes of blocks "
            "are unknown: call compute_chunk_sizes() of both"
        )
    # Together: where they have steps in common, each alone would make others of them under the same names.
    both = dask.optimize(points, parameters)
    return list(zip(*(array.to_delayed(optimize_graph=False).ravel().tolist() for array in both)))


def _sent(held: _Futures, chunk: Any) -> Any:
    """The chunk as an argument of a task: arrays go straight to a worker, what is delayed is made there."""
    from dask.base import is_dask_collection
    from dask.delayed import Delayed
    from distributed import Future

    def part_of(part: Any) -> Any:
        if isinstance(part, Delayed):
            return held.compute(part)
        if isinstance(part, Future):
            return part
        if _is_path(part):
            return os.fspath(part)
        if is_dask_collection(part):
            # A bag or a frame, which numpy would fetch.
            raise InvalidError(f"{type(part).__name__}: {KINDS}")
        return _array(part)

    def placed(part: Any) -> Any:
        return held.scatter(part) if isinstance(part, np.ndarray) else part

    if _is_pair(chunk):
        parts = tuple(part_of(part) for part in chunk)
        return held.scatter(parts) if all(isinstance(part, np.ndarray) for part in parts) else tuple(map(placed, parts))
    if isinstance(chunk, Scan):
        return held.scatter(chunk)
    if callable(chunk) and not isinstance(chunk, Delayed):
        return chunk
    return placed(part_of(chunk))
